"""The steps `reference` and `world` on a simulated capture of benchmarks/steps.py: what its worlds are said to be."""

import numpy as np
from scipy.spatial.transform import Rotation

from dior.calibrate import place, reference
from dior.geometry import camera_tables
from dior.geometry.camera import inverse_pose
from dior.reconstruct import world
from dior.tables import tables


class Said:
    """A finding, with the names of a `wrong_world.Fault`."""

    def __init__(self, severity, code, text):
        self.severity, self.code, self.text = severity, code, text


def said(capture, name):
    """What the step `world` says of the 3D of a sequence."""
    indoor = capture.project.indoor(name)
    findings = capture.made("world", name, ".findings")
    world.run(
        sequence=name, subject=capture.project.subject_of(name),
        skeleton=capture.made("mocap" if indoor else "refine", name), people=capture.folder / "config/subjects.tsv",
        physics=capture.project.config["physics"], source="mocap" if indoor else "triangulated", findings=findings,
    )  # fmt: skip
    rows = tables.read(findings, "findings")
    return [Said(*row) for row in zip(rows["severity"], rows["code"], rows["text"], strict=True)]


def calibration(cameras):
    """The text of a TOML calibration of cameras, world to camera."""
    lines = []
    for camera in cameras:
        cTw = inverse_pose(camera.wTc)
        turn = Rotation.from_matrix(cTw[:3, :3]).as_rotvec().tolist()
        lines += [f"[{camera.name}]", f"rotation = {turn}", f"translation = {cTw[:3, 3].tolist()}", ""]
    return "\n".join(lines)


def referenced(capture, session, change=lambda cameras: cameras, **keys):
    """The YAML files of a session's close cameras, placed by a reference calibration: the true one, changed.

    `keys`: more of `reference` in the YAML.
    """
    walk = capture.project.sequences_of(session)[0]
    close = [capture.views[walk][name].placed.camera for name in capture.project.close(session)]
    (capture.folder / "data/calibration.toml").write_text(calibration(change(close)))
    more = "".join(f", {key}: {value}" for key, value in keys.items())
    files = []
    for camera in close:
        topic = capture.project.cameras(session)[camera.name]["topic"]
        files.append(capture.folder / f"reference/{camera.name}.yaml")
        files[-1].parent.mkdir(exist_ok=True)
        files[-1].write_text(
            f"role: close\ntopic: {topic}\nlocate: reference\n"
            f"reference: {{file: calibration.toml, name: {camera.name}{more}}}\n"
        )
        unit = f"{session}/{camera.name}"
        place.run(
            session=session, camera=camera.name, camera_file=files[-1], tag={},
            intrinsics=capture.made("intrinsics", unit), frames=None, data_root=capture.folder / "data",
            out=capture.made("referenced", unit), out_marks=capture.made("referenced", unit, ".marks"),
            findings=capture.made("referenced", unit, ".findings"),
        )  # fmt: skip
    return files


def outdoors(capture):
    """The outdoor session of a capture."""
    return next(s for s in capture.project.sessions if not capture.project.indoor(capture.project.first_sequence(s)))


def reference_run(capture, change=lambda cameras: cameras, marks=(), **keys):
    """The findings, cameras and covariance of the step `reference`; arguments as of `referenced`.

    `marks`: CSVs of points that are marked in the first walk.
    """
    session = outdoors(capture)
    files = referenced(capture, session, change, **keys)
    walk, choices = capture.project.sequences_of(session)[0], capture.project.config
    paths = [capture.made("reference", session, kind) for kind in ("", ".covariance", ".findings")]
    close = capture.project.close(session)
    reference.run(
        session=session, cameras=[capture.made("referenced", f"{session}/{name}") for name in close],
        camera_files=files, marks=list(marks), marked=[walk] if marks else [],
        walk=reference.WalkFiles(
            walk, capture.project.subject_of(walk), capture.made("detections", walk), capture.made("frames", walk),
            None, capture.folder / "config/subjects.tsv",
        ),
        choices=reference.Choices(
            choices["adjust"]["min_score"], choices["adjust"]["huber_px"], choices["time"]["max_gap"]
        ),
        out=paths[0], out_covariance=paths[1], findings=paths[2],
    )  # fmt: skip
    rows = tables.read(paths[2], "findings")
    found = list(zip(rows["severity"], rows["code"], rows["text"], strict=True))
    return found, camera_tables.read_cameras(paths[0]), camera_tables.read_camera_covariance(paths[1], close)


def reference_sigmas(covariance):
    """Standard errors (rad, m) of the first camera's turn and shift."""
    return np.sqrt(np.diag(covariance)[[0, 3]])
