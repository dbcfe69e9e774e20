"""Place a camera before any person is looked at: by tape and look-at, an AprilTag, or somebody else's calibration.

INPUTS   camera YAML (`locate: tape` with `tape`, `locate: reference` with `reference`, or `locate: apriltag` with the
         `tag` of session.yaml and the pictures of one sequence), intrinsics
OUTPUTS  cameras (one row with wTc), `marks` (where the corners of the tag were seen, else empty), findings

World in metres, Z up, floor at Z = 0. A reference file is one of those that `dior.calibrate.readers.files` reads.
"""

from pathlib import Path
from typing import Any

from dior.arrays import AnyPath, Floats
from dior.calibrate.readers import files, given
from dior.errors import DiorError
from dior.geometry import camera_tables
from dior.geometry.camera_tables import unplaced
from dior.geometry.tape import look_at_pose
from dior.project.camera_file import camera_settings
from dior.tables import tables


def reference_pose(path: AnyPath, name: str, convention: str = "", units: str = "", world: str = "as_given") -> Floats:
    """wTc (4, 4) m of the camera `name` in a calibration file; the others are what `reference` of its YAML says.

    Raises DiorError as `readers.files.camera` and `readers.given.placed`.
    """
    return given.placed(files.camera(path, name), path, convention, units, world)


def run(
    *,
    session: str,
    camera: str,
    camera_file: Path,
    tag: dict[str, Any],
    intrinsics: Path,
    frames: Path | None,
    data_root: Path,
    out: Path,
    out_marks: Path,
    findings: Path,
) -> None:
    """Write the placed camera, its marks and findings.

    `reference.file` and the bags of `frames` are relative to `data_root`. `tag` and `frames`, the table of the sequence
    that shows it, are needed for `locate: apriltag` only.
    """
    settings = camera_settings(camera_file, needs="tape|apriltag|reference")
    found: list[tuple[str, str, str]] = []
    marks: dict[str, Any] = {}
    if settings["locate"] == "apriltag":
        from dior.calibrate.marks.apriltag import place

        where = f"session {session}, {camera}"
        if frames is None:
            raise DiorError(f"{where}: `locate: apriltag` needs the frames of a sequence that shows the tag")
        wTc, found, marks = place(unplaced(intrinsics, camera), tag, frames, data_root, settings.get("tape"), where)
    elif settings["locate"] == "tape":
        wTc = look_at_pose(camera_file, settings["tape"])
    else:
        reference = settings["reference"]
        path = Path(data_root) / reference["file"]
        # whether it is above a floor is asked where its world is known: in the step reference
        convention, units = (reference.get(key, "") for key in ("convention", "units"))
        wTc = reference_pose(path, reference["name"], convention, units, reference["world"])
    camera_tables.write_cameras(out, [unplaced(intrinsics, camera).at(wTc, settings["locate"])], session)
    count = len(marks.get("joint", ()))
    tables.write(out_marks, "marks", {"session": [session] * count, "camera": [camera] * count, **marks})
    tables.write_findings(findings, [(f"{session}/{camera}", *finding) for finding in found])
