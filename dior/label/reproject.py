"""2D labels of one camera: the 3D skeleton at every picture's own stamp, projected.

INPUTS   skeleton (`skeletons_3d`: mocap indoors, triangulated outdoors), the camera, frames; the cameras that the
         skeleton was triangulated from, the joint covariance of all of them, and their clocks
OUTPUTS  `labels_2d`: one row per frame and joint, px in the recorded picture
Paper, section 3D-2D re-projection. A label is evaluated at its picture's stamp, between the instants of the skeleton.
Its sigma is null where its camera's pose, its clock or the 3D has no known uncertainty.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dior.arrays import Floats, Table, Texts
from dior.body.visibility import hidden
from dior.clocks import clock as on_axis
from dior.clocks.axis import at_pictures, said_at_pictures, seconds, velocity_at_pictures
from dior.errors import DiorError
from dior.geometry import camera as cam
from dior.geometry import camera_tables
from dior.geometry.camera import Camera
from dior.label import uncertainty
from dior.tables import tables
from dior.tables.words import WITHOUT_3D


def labels(camera: Camera, points: Floats, names: Sequence[str]) -> tuple[Floats, Floats, Texts]:
    """Pixels (F, J, 2), depth (F, J) m and status (F, J) of world points (F, J, 3), joints called `names`.

    A label outside the picture keeps its pixel, as does one that the body hides; behind the camera there is none.
    """
    uv, depth = cam.project(camera, points)
    known = np.isfinite(points).all(axis=-1)
    with np.errstate(invalid="ignore"):
        behind = known & (depth <= 0)
    status = np.where(
        ~known,
        "missing_3d",
        np.where(behind, "behind_camera", np.where(cam.in_frame(camera.intrinsics, uv), "ok", "out_of_frame")),
    )
    status = np.where((status == "ok") & hidden(camera, points, names), "occluded", status)
    return uv, np.where(known, depth, np.nan), status


def run(
    *,
    sequence: str,
    subject: str,
    camera: str,
    cameras: list[Path],
    makers: list[str],
    covariance: list[Path],
    skeleton: Path,
    frames: Path,
    clocks: list[Path],
    clock_gains: list[Path],
    source: str,
    out: Path,
) -> None:
    """Write the labels of one camera of one sequence.

    `cameras`: `cameras` tables that hold the camera and those called `makers`, which the skeleton was triangulated from
    (none indoors); `covariance`: their `camera_covariance` tables; `clocks`, `clock_gains`: their tables of both names.
    """
    view = seen_by(sequence, camera, cameras, makers, covariance, frames, clocks, clock_gains)
    known = columns(view, tables.read(skeleton, "skeletons_3d"), source)
    once = np.zeros(len(known["frame"]), int)
    whose = {"subject": subject, "sequence": sequence, "camera": camera}
    tables.write(out, "labels_2d", {key: tables.Repeated([word], once) for key, word in whose.items()} | known)


@dataclass(frozen=True, eq=False)
class View:
    """A `camera` and its pictures, `rows` of `frames`; the `makers` of the 3D, the `names` of all of these, their joint
    covariance and their `clocks` by name."""

    camera: Camera
    makers: list[Camera]
    names: list[str]
    joint: Floats
    clocks: dict[str, on_axis.Clock]
    rows: Table


def seen_by(
    sequence: str,
    camera: str,
    cameras: list[Path],
    makers: list[str],
    covariance: list[Path],
    frames: Path,
    clocks: list[Path],
    clock_gains: list[Path],
) -> View:
    """`View` from the files; arguments as of `run`."""
    names = list(dict.fromkeys([*makers, camera]))
    rig = dict(zip(names, camera_tables.read_placed(cameras, names, sequence), strict=True))
    rows = tables.of_camera(tables.read(frames, "frames"), camera)
    if not len(rows["frame"]):
        raise DiorError(f"{sequence}, camera {camera}: {frames} lists no picture of it")
    cam.check_picture_size(rig[camera].intrinsics, rows["width"][0], rows["height"][0], f"{sequence}, camera {camera}")
    known = on_axis.read(clocks, clock_gains)
    for name in (*makers, camera):
        if name not in known:
            raise DiorError(f"{sequence}, camera {camera}: {', '.join(map(str, clocks))} has no clock of {name}")
    joint = camera_tables.read_camera_covariance(covariance, names, with_lenses=True)
    return View(rig[camera], [rig[name] for name in makers], names, joint, known, rows)


def columns(view: View, body: Table, source: str) -> dict[str, tables.Column]:
    """The columns of `labels_2d` of a `body` (`skeletons_3d`), but for whose and of which camera they are."""
    camera, rows = view.camera, view.rows
    own = view.clocks[camera.name]
    at = rows["stamp_ns"], own.offset_s, own.drift_ppm
    points, noise, bridged, joints = at_pictures(body, *at)
    velocity = velocity_at_pictures(body, *at)
    uv, depth, status = labels(camera, points, joints)
    suspect = said_at_pictures(body, *at, "suspect")
    status = np.where((status == "missing_3d") & suspect, "suspect", status)
    if source == "mocap":
        noise = np.zeros_like(noise)
    elapsed = seconds(rows["stamp_ns"], body["stamp_ns"][0])
    timing = uncertainty.Timing(view.clocks, velocity, elapsed, np.nan_to_num(rows["restored_sigma_s"]))
    spread = uncertainty.of_labels(camera, points, noise, view.makers, view.names, view.joint, timing)
    sigma_u, sigma_v, rho_uv = uncertainty.columns(spread)
    count, each = status.shape
    words = [source, "interpolated"]
    has_source = ~np.isin(status, WITHOUT_3D).ravel()
    return {
        "joint": tables.Repeated(joints, np.tile(np.arange(each), count)),
        "frame": np.repeat(rows["frame"], each),
        "stamp_ns": np.repeat(rows["stamp_ns"], each),
        "u": uv[..., 0].ravel(),
        "v": uv[..., 1].ravel(),
        "sigma_u": sigma_u.ravel(),
        "sigma_v": sigma_v.ravel(),
        "rho_uv": rho_uv.ravel(),
        "depth": depth.ravel(),
        "status": status.ravel(),
        "source": tables.Repeated(words, np.where(has_source, bridged.ravel().astype(int), -1)),
    }
