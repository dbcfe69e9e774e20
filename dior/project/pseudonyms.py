"""Make up pseudonyms for the people of subjects.tsv who have none.

INPUTS   <project>/config/subjects.tsv
OUTPUTS  the same file, in which every empty cell of the column `pseudonym` is filled; all else stays as it is
They are random, so nobody can tell who it is from one, and they stay in the sheet, which never leaves the lab: a
pseudonym that was made anew at each run would change everything that is made of the person.
"""

import secrets
from pathlib import Path

from dior.errors import DiorError
from dior.project.plain_text import COMMENT, text_of
from dior.tables.files import write_text

SHEET = "config/subjects.tsv"
# chosen: 40 bits; of a thousand people no two get the same
BYTES = 5


def run(project: Path) -> None:
    """Fill the empty pseudonyms of the project and say how many those were.

    `project`: folder of the project.
    Raises DiorError where there is no such sheet or no such column.
    """
    text = text_of(project / SHEET, SHEET)
    filled, count = with_pseudonyms(text)
    if count:
        write_text(project / SHEET, filled)
    print(f"{SHEET}: {count} made" if count else f"{SHEET}: everybody has one")


def with_pseudonyms(text: str) -> tuple[str, int]:
    """The text of a sheet with its empty pseudonyms filled, and how many those were."""
    lines = text.split("\n")
    told = [i for i, line in enumerate(lines) if line.strip() and not line.lstrip().startswith(COMMENT)]
    columns = [cell.strip() for cell in lines[told[0]].split("\t")] if told else []
    if "pseudonym" not in columns:
        raise DiorError(f"{SHEET}: column 'pseudonym' is missing; add it to the first line")
    at, count = columns.index("pseudonym"), 0
    for number in told[1:]:
        line = lines[number]
        ending = "\r" if line.endswith("\r") else ""
        cells = line.removesuffix("\r").split("\t")
        cells += [""] * (at + 1 - len(cells))
        if not cells[at].strip():
            cells[at] = f"p{secrets.token_hex(BYTES)}"
            lines[number] = "\t".join(cells) + ending
            count += 1
    return "\n".join(lines), count
