"""Is the world of a sequence one in which a person can walk? Asked of every sequence, whatever made its 3D.

INPUTS   `skeletons_3d` of refine (or triangulate) outdoors, of mocap indoors; the subject's height where subjects.tsv
         has it
OUTPUTS  `findings`, red: which mistake the world has (`body.wrong_world`), with the place to mend it
Pixels do not tell a size, a floor and a vertical, so that nothing else notices. World in metres, Z up.
"""

from pathlib import Path
from typing import Any

from dior.body import wrong_world
from dior.project import heights
from dior.tables import tables

# where a world comes from, and so where a mistake is mended
MEND = {
    "mocap": {
        "world_scale": "is it the subject's C3D, and are its unit (`mocap: {units: ...}` in session.yaml) and height_m "
        "right?",
        "world_left_handed": "export the C3D with right-handed axes, or correct the labels of left and right",
        "world_axes": "set `mocap: {up: ...}` in session.yaml, or export the C3D with Z up",
        "world_floor": "calibrate the motion capture's origin on the floor, and export the C3D again",
        "world_vertical": "calibrate the motion capture's axes on the floor, and export the C3D again",
        "world_speed": "is POINT:RATE of the C3D right?",
    },
    "triangulated": {
        "world_scale": "is the board's square_m, the tape, the tag's size_m or the unit of the reference calibration "
        "wrong, or height_m, or is it somebody else (config/people/<sequence>.yaml says who is the subject)?",
        "world_left_handed": "is the reference calibration right-handed, and does the detector see mirrored pictures?",
        "world_axes": "set `reference.world: from_walk`, or correct tag.up and tag.normal",
        "world_floor": "is Z = 0 the floor in the reference calibration (`reference.world: from_walk` makes it), "
        "tape.position_m and tag.position_m?",
        "world_vertical": "is Z up in the reference calibration (`reference.world: from_walk` makes it), and is tag.up "
        "right?",
        "world_speed": "check the size of the world and the stamps",
    },
}
BONES = "look for a camera with a wrong pose or lens, and at the detections"


def run(
    *, sequence: str, subject: str, skeleton: Path, people: Path, physics: dict[str, Any], source: str, findings: Path
) -> None:
    """Write what is impossible in the 3D of one sequence.

    `people`: the subjects.tsv that may have the subject's height; `physics`: limits (`dior.body.plausible`); `source`:
    mocap or triangulated.
    """
    table = tables.read(skeleton, "skeletons_3d")
    points, joints = tables.grid(table, "x", "y", "z")
    stamps = table["stamp_ns"].reshape(points.shape[:2])[:, 0]
    seconds = (stamps - stamps[0]) / 1e9
    height = heights.of(subject, people)
    person = wrong_world.Person(subject, *height) if height else None
    found = wrong_world.of_person(points, joints, seconds, person, physics)
    rows = [(sequence, "error", fault.code, f"{fault.text}; {MEND[source].get(fault.code, BONES)}") for fault in found]
    tables.write_findings(findings, rows)
