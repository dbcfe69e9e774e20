"""The tables of formats in these pages, out of what the readers say of themselves (dior/formats.py).

usage: python -m docs.format_tables [--write]      (names the pages that differ; --write: and puts the tables into them)

A table stands between a line that calls it, `<!-- python -m docs.format_tables --write: detections -->`, and an end.
"""

import re
import sys
from dataclasses import astuple, fields
from pathlib import Path

from dior.cli.formats import KINDS
from dior.tables.files import write_text

PAGES = Path(__file__).parent
BLOCK = re.compile(r"(<!-- python -m docs\.format_tables --write: (\w+(?: \w+)?) -->\n).*?(<!-- end -->\n)", re.DOTALL)
SAMPLES = "samples"


def written(text):
    """The text of a page with its tables anew."""
    return BLOCK.sub(lambda found: found[1] + table(found[2]) + found[3], text)


def table(name):
    """A table in Markdown: of a kind of formats, or of what their readers were tried on (`detections samples`)."""
    kind, _, what = name.partition(" ")
    formats = KINDS[kind]
    if what:
        rows = [astuple(sample) for one in formats for sample in one.samples]
        return _markdown(["format", "what was read", "sample"], rows)
    shown = [field.name for field in fields(formats[0]) if field.name != SAMPLES]
    rows = [[getattr(one, name) for name in shown] for one in formats]
    return _markdown([name.replace("_", " ") for name in shown], [[f"`{key}`", *others] for key, *others in rows])


def _markdown(heads, rows):
    lines = [f"| {' | '.join(heads)} |", "|" + "---|" * len(heads)]
    return "\n".join([*lines, *(f"| {' | '.join(cells)} |" for cells in rows)]) + "\n"


def main():
    for path in sorted(PAGES.glob("*.md")):
        text = path.read_text(encoding="utf-8")
        if (now := written(text)) != text:
            print(path.name)
            if "--write" in sys.argv[1:]:
                write_text(path, now)


if __name__ == "__main__":
    main()
