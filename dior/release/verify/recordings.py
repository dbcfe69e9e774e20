"""`dior verify --inputs`: are a project's recordings those that its labels were made from.

INPUTS   a project folder: its sheets, results/provenance/<sequence>.json, and all bytes of the recordings
OUTPUT   a line per recording that differs, and how many are right

A run looks at the length and the two ends of a recording (dior/project/replaced.py). What was changed between them is
found here alone.
"""

from pathlib import Path
from typing import Any

from dior.errors import DiorError
from dior.progress import reporting
from dior.project import project as projects
from dior.release import provenance


def problems(root: Path) -> tuple[list[str], int]:
    """(sentences, number of recordings that were hashed) of the project in the folder `root`."""
    project = projects.load(root)
    known = {name: root / f"results/provenance/{name}.json" for name in project.sequences}
    known = {name: path for name, path in known.items() if path.is_file()}
    if not known:
        raise DiorError(f"{root}/results/provenance: has no checksums to compare with; the target `release` makes them")
    looked_at = [
        (name, what, root / recordings[what], recorded)
        for name, path in known.items()
        for recordings in [project.recordings(name)]
        for what, recorded in provenance.read(path).items()
        if what in recordings
    ]
    found = (_problem(*one) for one in looked_at)
    said = [text for text in reporting(found, len(looked_at), "recordings hashed", "inputs") if text]
    return said, len(looked_at)


def _problem(sequence: str, what: str, path: Path, recorded: dict[str, Any]) -> str:
    """What is wrong with one recording, "" where nothing is."""
    if not path.exists():
        return f"{sequence}, {what}: {path} is gone"
    if provenance.checksum_of(path, f"{sequence}, {what}") == recorded:
        return ""
    made = f"results/{{frames,mocap,detections,provenance}}/{sequence}.*"
    return (
        f"{sequence}, {what}: {path} is not what the labels were made from, or was changed since; bring it back, or "
        f"delete {made} and run again"
    )
