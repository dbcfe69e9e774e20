"""`dior export --rrd`: walks with their pictures, labels and 3D as recordings of rerun, for the lab itself.

INPUTS   a project whose workflow has run: its tables below results/, and the recordings for their pictures
OUTPUTS  a new folder with <sequence>.rrd for each walk; `rerun <sequence>.rrd` shows it
World: the session's, metres, Z up. On the timeline `time` is everything, s after t0 on the sequence's clock, the motion
capture's indoors. `frame`, which pictures and labels are on besides, is counted in each camera by itself, as in the
tables and the report, and `instant`, which the 3D is on, in the 3D; the one is not the other. Pictures are the recorded
JPEG files, at most PICTURES_HZ of them a second, with the labels of that moment; rerun knows no lens, so that a frustum
and what it projects are without distortion, pictures and labels with it.
"""

import os
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dior.arrays import Floats, Ints, Table
from dior.body import names
from dior.errors import DiorError, many
from dior.evaluate.grids import label_grids, onto, value_grid
from dior.geometry.camera import Camera
from dior.geometry.camera_tables import read_camera_covariance, read_placed
from dior.geometry.covariance import of_sigmas
from dior.ingest import bags
from dior.ingest.containers import BROKEN
from dior.project import project as projects
from dior.project.contents import Project
from dior.release import pixels
from dior.report import viewer
from dior.report.clip import clocked
from dior.report.clip import nearest as nearest_pictures
from dior.report.colours import LEFT, MIDDLE, RIGHT
from dior.shortage import sentence
from dior.tables import tables
from dior.tables.files import folder_written_whole

if TYPE_CHECKING:
    import rerun
    import rerun.blueprint as rrb

NEEDS = "`dior export --rrd` needs rerun; install it: pip install -e '.[rrd]'"
APPLICATION = "dior"
# chosen: a step is seen in its phases, and two minutes of four cameras take 300 MB
PICTURES_HZ = 5.0
# pictures written at once; chosen: it bounds the memory
AT_A_TIME = 16
# chosen, m: how far from a camera its picture stands, and how large a joint is
PICTURE_AT_M, JOINT_M = 0.5, 0.012
JOINT_UI = 3.0  # chosen: size of a label in points of the screen, at any enlargement
COLOURS = {"left": LEFT, "right": RIGHT, "middle": MIDDLE}
# RGBA of what shows a standard error
FAINT = (128, 128, 128, 90)


def run(project: Path, sequences: list[str] | None = None, *, rrd: Path) -> None:
    """Write walks of a project as recordings of rerun, uncovered pictures of people in them: for the lab alone.

    `project`: folder that holds config/; `sequences`: the walks, all if none is named; `rrd`: folder to write, which
    must not be there yet.
    Raises DiorError where rerun is not installed, for a sequence that is not there and for one that has no results.
    """
    try:
        import rerun  # noqa: F401
    except ImportError:
        raise DiorError(NEEDS) from None
    if os.path.lexists(rrd):
        raise DiorError(f"{rrd}: is there already; name a folder that is not")
    found = projects.load(project)
    needed = {sequence: _files(found, sequence) for sequence in found.named(sequences)}
    with folder_written_whole(rrd) as folder:
        said = [write(folder / f"{name}.rrd", files, found.root / found.data_root) for name, files in needed.items()]
    for name, words in zip(needed, said, strict=True):
        print(f"{rrd}/{name}.rrd: {words}")
    print("They show people as they were recorded, heads uncovered: they are for the lab, not for others.")


@dataclass(frozen=True)
class WalkFiles:
    """The tables of a walk: `labels`, `cameras`, `clocks` and `covariance` of all its cameras."""

    sequence: str
    subject: str
    frames: Path
    timeline: Path
    skeleton: Path
    labels: list[Path]
    clocks: list[Path]
    cameras: list[Path]
    covariance: list[Path]


def _files(found: Project, sequence: str) -> WalkFiles:
    """The tables of a walk. Raises DiorError for one that is not there."""
    cameras, session = found.cameras_of(sequence), found.session_of(sequence)

    def there(path: str) -> Path:
        if not (found.root / path).is_file():
            raise DiorError(f"{found.root / path}: is not there, so {sequence} is not labelled; run the workflow first")
        return found.root / path

    covariance = dict.fromkeys(filter(None, (found.covariance_table(session, camera) for camera in cameras)))
    return WalkFiles(
        sequence,
        found.subject_of(sequence),
        there(f"results/frames/{sequence}.parquet"),
        there(f"results/timeline/{sequence}.parquet"),
        there(found.skeleton_table(sequence)),
        [there(path) for path in found.label_tables(sequence)],
        [there(path) for path in found.clock_tables(sequence, cameras)],
        [there(path) for path in found.camera_tables(session, cameras)],
        [there(path) for path in covariance],
    )


def write(path: Path, walk: WalkFiles, data_root: Path) -> str:
    """Write the recording of one walk, its pictures from below `data_root`; returns what is in it."""
    import rerun as rr

    grids, index = label_grids(walk.labels), tables.read(walk.frames, "frames")
    t0 = int(tables.read(walk.timeline, "timeline", ["stamp_ns"])["stamp_ns"][0])
    times = clocked(index, walk.clocks, t0, list(grids), walk.sequence)[0]
    rig = read_placed(walk.cameras, grids, f"sequence {walk.sequence}")
    body = viewer.body_of(walk.skeleton, t0)
    joints = body["joints"] if body else next(iter(grids.values())).joints
    out = rr.RecordingStream(APPLICATION, recording_id=walk.sequence, send_properties=False)
    out.save(path, default_blueprint=_layout(rig))
    out.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    out.log("world", _annotations(walk.subject, joints), static=True)
    if body:
        _add_body(out, body)
    covariance, sigmas = read_camera_covariance(walk.covariance, list(grids)), _sigmas(walk.labels)
    count = 0
    for i, camera in enumerate(rig):
        name, place = camera.name, _place(camera)
        _add_camera(out, camera, covariance[6 * i + 3 : 6 * i + 6, 6 * i + 3 : 6 * i + 6])
        own, at = viewer.in_order(tables.of_camera(index, name), times[name])
        rows = np.unique(nearest_pictures(at, np.arange(at[0], at[-1] + 1e-9, 1 / PICTURES_HZ)))
        rows = rows[_add_pictures(out, place, tables.rows(own, rows), at[rows], data_root)]
        grid, frames = grids[name], own["frame"][rows].astype(np.int64)
        uv = onto(frames, joints, grid.uv, grid.frames, grid.joints)
        _add_labels(out, place, uv, onto(frames, joints, *sigmas[name]), at[rows], frames)
        count += len(rows)
    out.disconnect()
    instants = len(body["time"]) if body else 0
    return f"{many(len(rig), 'camera')}, {many(count, 'picture')}, 3D at {many(instants, 'instant')}"


def _place(camera: Camera) -> str:
    """Where the picture of a camera is in the recording."""
    return f"world/cameras/{camera.name}/picture"


def _layout(cameras: list[Camera]) -> "rrb.Blueprint":
    """What is seen first: the 3D, and beside it the pictures."""
    import rerun.blueprint as rrb

    pictures = rrb.Grid(*(rrb.Spatial2DView(origin=_place(camera), name=camera.name) for camera in cameras))
    scene = rrb.Spatial3DView(origin="world", name="3D")
    return rrb.Blueprint(rrb.Horizontal(scene, pictures), rrb.TimePanel(timeline="time"))


def _annotations(subject: str, joints: list[str]) -> "rerun.AnnotationContext":
    """The names of the joints, coloured by their side, and the bones."""
    import rerun as rr

    points = [(i, joint, COLOURS[names.side_of(joint)][::-1]) for i, joint in enumerate(joints)]
    bones = [(int(a), int(b)) for a, b in names.bones_of(joints)]
    about = rr.AnnotationInfo(id=0, label=subject, color=MIDDLE)
    return rr.AnnotationContext(
        rr.ClassDescription(info=about, keypoint_annotations=points, keypoint_connections=bones)
    )


def _add_body(out: "rerun.RecordingStream", body: Mapping[str, Any]) -> None:
    """Add the joints, and the ellipsoids of 1 sigma around those whose error is known."""
    import rerun as rr

    when = [rr.TimeColumn("time", duration=body["time"]), rr.TimeColumn("instant", sequence=body["instants"])]
    points = body["points"]
    known = np.isfinite(points).all(axis=-1)
    place = "world/skeleton"
    out.log(place, rr.Points3D.from_fields(class_ids=0, radii=JOINT_M, show_labels=False), static=True)
    columns = rr.Points3D.columns(positions=points[known], keypoint_ids=np.nonzero(known)[1])
    rr.send_columns(place, when, columns.partition(known.sum(axis=1)), recording=out)
    covariance = of_sigmas(body["sigmas"], body["rhos"])
    told = known & np.isfinite(covariance).all(axis=(-2, -1))
    if told.any():
        out.log(f"{place}/sigma", rr.Ellipsoids3D.from_fields(colors=FAINT), static=True)
        columns = rr.Ellipsoids3D.columns(centers=points[told], **_ellipsoids(covariance[told]))
        rr.send_columns(f"{place}/sigma", when, columns.partition(told.sum(axis=1)), recording=out)


def _ellipsoids(covariance: Floats) -> dict[str, Floats]:
    """Half sizes (N, 3) m and turns (N, 4), quaternions with the scalar last, of 1 sigma of covariances (N, 3, 3)."""
    from scipy.spatial.transform import Rotation

    values, axes = np.linalg.eigh(covariance)
    axes = axes * np.sign(np.linalg.det(axes))[:, None, None]
    return {"half_sizes": np.sqrt(np.maximum(values, 0)), "quaternions": Rotation.from_matrix(axes).as_quat()}


def _add_camera(out: "rerun.RecordingStream", camera: Camera, covariance: Floats) -> None:
    """Add a camera, and the ellipsoid of 1 sigma of its place from its `covariance` (3, 3) m^2, NaN if not known."""
    import rerun as rr

    lens, place = camera.intrinsics, _place(camera)
    pose = rr.Transform3D(translation=camera.centre, mat3x3=camera.wRc)
    out.log(place.rpartition("/")[0], pose, static=True)
    # its pixel (0, 0) is the corner of a pixel whose centre is ours
    matrix = lens.K + np.array([[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]])
    pinhole = rr.Pinhole(
        image_from_camera=matrix, width=lens.width, height=lens.height, camera_xyz=rr.ViewCoordinates.RDF,
        image_plane_distance=PICTURE_AT_M,
    )  # fmt: skip
    out.log(place, pinhole, static=True)
    if np.isfinite(covariance).all():
        sigma = rr.Ellipsoids3D(centers=[camera.centre], colors=[FAINT], **_ellipsoids(covariance[None]))
        out.log(f"world/camera_sigma/{camera.name}", sigma, static=True)


def _add_pictures(out: "rerun.RecordingStream", place: str, rows: Table, times: Floats, data_root: Path) -> Ints:
    """Add the pictures of `rows` of the frames table at `times` (P,) s; returns which of them could be read (Q,)."""
    import rerun as rr

    out.log(place, rr.EncodedImage.from_fields(media_type="image/jpeg"), static=True)
    found: list[int] = []
    jpegs = _jpegs(rows, data_root)
    while part := list(islice(jpegs, AT_A_TIME)):
        numbers = [row for row, _ in part]
        when = _at(times[numbers], rows["frame"][numbers])
        rr.send_columns(place, when, rr.EncodedImage.columns(blob=[jpeg for _, jpeg in part]), recording=out)
        found += numbers
    return np.array(sorted(found), np.int64)


def _jpegs(rows: Table, data_root: Path) -> Iterator[tuple[int, bytes]]:
    """The pictures of `rows` of the frames table as JPEG, as they were recorded where they were; what cannot be read is
    told on standard error."""
    for row, message, path in bags.read_messages(rows, data_root):
        try:
            jpeg = pixels.released(message, (int(rows["height"][row]), int(rows["width"][row])), None, [], "shown")
        except BROKEN as error:
            if sentence(error):
                raise
            print(f"{path}: frame {rows['frame'][row]} of {rows['camera'][row]} is left out ({error})", file=sys.stderr)
            continue
        if jpeg is not None:
            yield row, jpeg


def _sigmas(labels: list[Path]) -> dict[str, tuple[Floats, Ints, list[str]]]:
    """By camera the standard errors (F, J, 1) px of its labels, of both axes the root mean square, their frames (F,)
    and joints."""
    found = {}
    for path in labels:
        table = tables.read(path, "labels_2d", ["camera", "joint", "frame", "sigma_u", "sigma_v"])
        values, frames, joints = value_grid(table, "frame", "sigma_u", "sigma_v")
        found[str(table["camera"][0])] = (np.sqrt((values**2).mean(axis=-1, keepdims=True)), frames, joints)
    return found


def _add_labels(
    out: "rerun.RecordingStream", place: str, uv: Floats, sigma: Floats, times: Floats, frames: Ints
) -> None:
    """Add labels uv (P, J, 2) px, NaN where there is none, and circles of 1 sigma (P, J, 1) px."""
    import rerun as rr

    known = np.isfinite(uv).all(axis=-1)
    when, ids = _at(times, frames), np.nonzero(known)[1]
    fixed = rr.Points2D.from_fields(class_ids=0, radii=rr.Radius.ui_points(JOINT_UI), show_labels=False)
    out.log(f"{place}/labels", fixed, static=True)
    # the same half pixel as a camera's
    columns = rr.Points2D.columns(positions=uv[known] + 0.5, keypoint_ids=ids)
    rr.send_columns(f"{place}/labels", when, columns.partition(known.sum(axis=1)), recording=out)
    told = known & np.isfinite(sigma[..., 0])
    if told.any():
        out.log(f"{place}/sigma", rr.Points2D.from_fields(colors=FAINT), static=True)
        columns = rr.Points2D.columns(positions=uv[told] + 0.5, radii=sigma[told][:, 0])
        rr.send_columns(f"{place}/sigma", when, columns.partition(told.sum(axis=1)), recording=out)


def _at(times: Floats, frames: Ints) -> "list[rerun.TimeColumn]":
    import rerun as rr

    return [rr.TimeColumn("time", duration=times), rr.TimeColumn("frame", sequence=frames)]
