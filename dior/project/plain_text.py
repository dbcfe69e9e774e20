"""Text files and tables that a person or another program wrote, read so that whatever is in them is one sentence.

INPUTS   files in UTF-8, with or without a byte order mark
OUTPUTS  their text; the rows of a CSV or tab-separated file with their lines
Loads no numerics.
"""

import csv
import errno
import io
import os
import shlex
import stat
from collections.abc import Iterator
from pathlib import Path
from typing import TypeAlias

from dior.errors import DiorError
from dior.paths import AnyPath

# a row's line, and its cells without the blanks around them
Line: TypeAlias = tuple[int, list[str]]

# chosen: a hundred thousand rows; no person writes more
MOST_BYTES = 1 << 22
# chosen: ten times as many as the widest table has
MOST_CELLS = 1000
UTF_8_MARK = b"\xef\xbb\xbf"
# the first bytes (RFC 1952, 2.3.1), and what to do
GZIP, UNPACK = b"\x1f\x8b", "is compressed with gzip; unpack it: `gunzip -k` keeps the packed file, too"
UTF_16 = (b"\xff\xfe", b"\xfe\xff")
SAVE = "save it again as UTF-8 (in Excel as 'CSV UTF-8')"
# what no spreadsheet writes
SAVE_TEXT = "save it again as UTF-8 (in the list of encodings where your editor has 'Save as')"
# Excel has UTF-8 for commas only
SAVE_TABS = (
    "save it again as UTF-8 with tabs between the columns (LibreOffice: 'Text CSV', with tabs; from Excel as "
    "'Unicode text', then as UTF-8 by a text editor)"
)
# what a line begins with that is for people only
COMMENT = "#"
NAMES = {",": "commas", "\t": "tabs", ";": "semicolons"}


def bytes_of(path: AnyPath, shown: AnyPath, most_bytes: int = MOST_BYTES) -> bytes:
    """The content of a file, `shown` being its name in messages.

    Raises DiorError where there is none, where it cannot be read, and for one of more than `most_bytes`.
    """
    try:
        status = os.stat(path)
        if stat.S_ISDIR(status.st_mode):
            raise DiorError(f"{shown}: is a folder where a file should be; rename or remove it")
        if not stat.S_ISREG(status.st_mode):
            raise DiorError(f"{shown}: is no plain file (a pipe or a device); put the file itself there")
        if status.st_size > most_bytes:
            raise DiorError(
                f"{shown}: has {status.st_size / 1e6:.0f} MB, and at most {most_bytes / 1e6:.0f} MB are read; is it "
                "another file?"
            )
        with open(path, "rb") as stream:
            return stream.read()
    except (FileNotFoundError, NotADirectoryError):
        link = f" as that to which it is a link, {os.readlink(path)}; mend the link" if os.path.islink(path) else ""
        raise DiorError(f"{shown}: there is no such file{link}") from None
    except OSError as error:
        raise unreadable(path, shown, error) from None


def unreadable(path: AnyPath, shown: AnyPath, error: OSError) -> DiorError:
    """What to say of a file or folder that the system does not let one read, `shown` being its name in messages."""
    if error.errno != errno.EACCES:
        return DiorError(f"{shown}: cannot be read ({error.strerror})")
    return DiorError(f"{shown}: cannot be read ({error.strerror}); {right_to(barred_by(path) or path)}")


def right_to(path: AnyPath) -> str:
    """How one gets the right to look into a file or folder."""
    return f"try `chmod -R u+rX {shlex.quote(str(path))}`, or ask whose it is"


def barred_by(path: AnyPath) -> str:
    """The outermost of a path and the folders around it that one has no right to look into; "" where one may read it,
    or where it is not there."""
    path = Path(path)
    for part in [*reversed(path.parents), path]:
        wanted = os.X_OK if part != path else os.R_OK | (os.X_OK if os.path.isdir(part) else 0)
        if os.path.exists(part) and not os.access(part, wanted):
            return str(part)
    return ""


def text_of(path: AnyPath, shown: AnyPath, most_bytes: int = MOST_BYTES) -> str:
    """The text of a file in UTF-8. Raises DiorError as `bytes_of`, and for another encoding, with the line."""
    return _decoded(bytes_of(path, shown, most_bytes), shown)


def unmarked(content: bytes, shown: AnyPath) -> bytes:
    """The same, or its beginning, without a byte order mark. Raises DiorError for UTF-16 and for what is packed."""
    if content.startswith(GZIP):
        raise DiorError(f"{shown}: {UNPACK}")
    if content.startswith(UTF_16):
        raise DiorError(f"{shown}: is UTF-16, as Excel's 'Unicode text' is; {_save(shown)}")
    return content.removeprefix(UTF_8_MARK)


def _save(shown: AnyPath) -> str:
    return {".tsv": SAVE_TABS, ".csv": SAVE}.get(os.path.splitext(shown)[1].lower(), SAVE_TEXT)


def _decoded(content: bytes, shown: AnyPath) -> str:
    save = _save(shown)
    content = unmarked(content, shown)
    if b"\0" in content:
        line = content.count(b"\n", 0, content.index(b"\0")) + 1
        raise DiorError(f"{shown} line {line}: holds a zero byte, so it is no text or damaged; {save}")
    try:
        return content.decode()
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise DiorError(
            f"{shown} line {line}: the byte 0x{content[error.start]:02x} is not UTF-8, so the file is Latin-1 or "
            f"damaged; {save}"
        ) from None


def rows_of(path: AnyPath, shown: AnyPath, delimiter: str = ",") -> list[Line]:
    """The rows of a table that a person wrote, the header among them, without those that are empty or begin with #.

    Raises DiorError as `each_row`.
    """
    rows = [row for row in each_row(path, shown, delimiter) if not row[1][0].startswith(COMMENT)]
    check_delimiter(rows[0][1] if rows else [], shown, delimiter)
    return rows


def check_delimiter(header: list[str], shown: AnyPath, delimiter: str = ",") -> None:
    """Refuse a header whose columns are separated by something else than `delimiter`."""
    for other in {*NAMES} - {delimiter}:
        if len(header) == 1 and other in header[0]:
            raise DiorError(f"{shown}: the columns must be separated by {NAMES[delimiter]}, not by {NAMES[other]}")


def each_row(
    path: AnyPath, shown: AnyPath, delimiter: str = ",", most_bytes: int = MOST_BYTES, most_cells: int = MOST_CELLS
) -> Iterator[Line]:
    """Yield the rows of a table that are not empty.

    A cell holds no line break and no delimiter: where a quote opens one, it has swallowed what came after it. Raises
    DiorError as `text_of`, and for such a cell, with the line on which it begins.
    """
    content = bytes_of(path, shown, most_bytes)
    _decoded(content, shown)
    # a str of all of it, and above all io.StringIO, would be several times as large
    reader = csv.reader(io.TextIOWrapper(io.BytesIO(content), "utf-8-sig", newline=""), delimiter=delimiter)
    line = 1
    try:
        for cells in reader:
            letters = "".join(cells)
            if "\n" in letters or "\r" in letters or delimiter in letters:
                until = f"up to line {reader.line_num}" if reader.line_num > line else f"with {NAMES[delimiter]}"
                raise DiorError(
                    f'{shown} line {line}: a cell opens a quote (") and goes on {until}; delete the quote, or the '
                    "line break within it"
                )
            if len(cells) > most_cells:
                raise DiorError(f"{shown} line {line}: has {len(cells)} cells, which no table has; is it another file?")
            stripped = [cell.strip() for cell in cells]
            if any(stripped):
                yield line, stripped
            line = reader.line_num + 1
    except csv.Error as error:
        raise DiorError(f'{shown} line {line}: no row of a table ({error}); is a quote (") open there?') from None
