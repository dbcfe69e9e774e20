"""What the pages in 3D of all sequences share: script, style, three.js.

OUTPUTS  <out>/viewer/*
"""

from pathlib import Path

from dior.tables.files import folder_written_whole

STATIC = Path(__file__).parent / "static"
FILES = ("three.min.js", "viewer.js", "viewer.css")


def write(out: Path) -> None:
    """Write the folder `viewer` into the report `out`."""
    with folder_written_whole(out / "viewer") as folder:
        for name in FILES:
            (folder / name).write_bytes((STATIC / name).read_bytes())
