"""What a check has found: faults, with which a run would fail, and warnings, with which it would not."""

import re
from collections.abc import Iterator
from contextlib import contextmanager

from dior.errors import Faults
from dior.project.missing import Fault
from dior.project.plain_text import unreadable

# how the sentences of those who read a file begin
_WHERE = re.compile(r"(config(?:/[^\s:,]*)?)(?:,? line (\d+))?: (.*)", re.DOTALL)


class Notes:
    """`faults` and `warnings`, as they were found; `before_release`: sentences on what a release would lack."""

    def __init__(self) -> None:
        self.faults: list[Fault] = []
        self.warnings: list[Fault] = []
        self.before_release: list[str] = []

    def fault(self, file: str, line: int | None, text: str, walk: str = "") -> None:
        self.faults.append(Fault(file, line, text, walk))

    def warn(self, file: str, line: int | None, text: str, walk: str = "") -> None:
        self.warnings.append(Fault(file, line, text, walk))

    @contextmanager
    def kept(self, file: str, line: int | None, walk: str = "") -> Iterator[None]:
        """Keep what is wrong with what is done within, to be mended in that file, on that line unless the sentences
        name the file and another."""
        faults = Faults()
        try:
            with faults.kept():
                yield
        except OSError as error:
            path = str(error.filename or file)
            faults.found.append(unreadable(path, path, error))
        self.faults += [of_sentence(str(one), file, line, walk) for one in faults.found]


def of_sentence(text: str, file: str, line: int | None = None, walk: str = "") -> Fault:
    """A sentence as a fault of `file`, or of that of config/ which it begins with, whose name and line are then not
    said a second time."""
    found = _WHERE.fullmatch(text)
    if not found:
        return Fault(file, line, text, walk)
    named, at, rest = found.groups()
    return Fault(named, int(at) if at else line if named == file else None, rest, walk)
