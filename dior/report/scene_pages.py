"""The pages that show a sequence in 3D over time.

INPUTS   scene.js of each sequence (scene_file.py)
OUTPUTS  <out>/sequences/<sequence>.3d.html, and <out>/viewer/ with what these pages share: script, style, three.js
"""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dior.report.scene_file import header_of
from dior.tables.files import folder_written_whole, write_text

if TYPE_CHECKING:
    import jinja2

STATIC = Path(__file__).parent / "static"
SHARED = ("three.min.js", "viewer.js", "viewer.css")


def headers(scenes: Iterable[Path]) -> dict[str, dict[str, Any]]:
    """sequence -> what its scene.js says first, of the sequences that have 3D."""
    found = {Path(path).parent.name: header_of(Path(path)) for path in scenes}
    return {sequence: header for sequence, header in found.items() if header is not None}


def write(environment: "jinja2.Environment", out: Path, title: str, scenes: Mapping[str, dict[str, Any]]) -> None:
    """Write the page of each of `scenes` (`headers`), linked to the one before and after, and what they share."""
    template, sequences = environment.get_template("scene.html.j2"), list(scenes)
    for i, (sequence, scene) in enumerate(scenes.items()):
        page = template.render(
            title=title,
            sequence=sequence,
            scene=scene,
            before=sequences[i - 1] if i else "",
            after=sequences[i + 1] if i + 1 < len(sequences) else "",
        )
        write_text(out / "sequences" / f"{sequence}.3d.html", page)
    with folder_written_whole(out / "viewer") as folder:
        for name in SHARED if scenes else ():
            (folder / name).write_bytes((STATIC / name).read_bytes())
