"""2D labels of the cameras of a sequence: the 3D skeleton at every picture's own stamp, projected.

INPUTS   skeleton (`skeletons_3d`: mocap indoors, triangulated outdoors), the cameras, frames; the cameras that the
         skeleton was triangulated from, the joint covariance of all of them, and their clocks
OUTPUTS  `labels_2d`, a table a camera: one row per frame and joint, px in the recorded picture
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
from dior.clocks.axis import Moving, moving, seconds
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
    labelled: list[str],
    cameras: list[Path],
    makers: list[str],
    covariance: list[Path],
    skeleton: Path,
    frames: Path,
    clocks: list[Path],
    clock_gains: list[Path],
    source: str,
    out: list[Path],
) -> None:
    """Write the labels of the cameras of one sequence.

    `labelled`: the cameras that get labels; `out`: a `labels_2d` table to write for each of them, in that order;
    `cameras`: `cameras` tables that hold these and those called `makers`, which the skeleton was triangulated from
    (none indoors); `covariance`: their `camera_covariance` tables; `clocks`, `clock_gains`: their tables of both names.
    """
    views = seen_by(sequence, labelled, cameras, makers, covariance, frames, clocks, clock_gains)
    body = moving(tables.read(skeleton, "skeletons_3d"))
    for view, path in zip(views, out, strict=True):
        known = columns(view, body, source)
        once = np.zeros(len(known["frame"]), int)
        whose = {"subject": subject, "sequence": sequence, "camera": view.camera.name}
        tables.write(path, "labels_2d", {key: tables.Repeated([word], once) for key, word in whose.items()} | known)


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
    labelled: list[str],
    cameras: list[Path],
    makers: list[str],
    covariance: list[Path],
    frames: Path,
    clocks: list[Path],
    clock_gains: list[Path],
) -> list[View]:
    """The `View` of each camera that is `labelled`, from the files; arguments as of `run`."""
    every = list(dict.fromkeys([*makers, *labelled]))
    rig = dict(zip(every, camera_tables.read_placed(cameras, every, sequence), strict=True))
    pictures, known = tables.read(frames, "frames"), on_axis.read(clocks, clock_gains)
    joint = camera_tables.read_camera_covariance(covariance, every, with_lenses=True).reshape(len(every), 9, -1, 9)
    views = []
    for camera in labelled:
        rows = tables.of_camera(pictures, camera)
        if not len(rows["frame"]):
            raise DiorError(f"{sequence}, camera {camera}: {frames} lists no picture of it")
        lens = rig[camera].intrinsics
        cam.check_picture_size(lens, rows["width"][0], rows["height"][0], f"{sequence}, camera {camera}")
        for name in (*makers, camera):
            if name not in known:
                raise DiorError(f"{sequence}, camera {camera}: {', '.join(map(str, clocks))} has no clock of {name}")
        names = list(dict.fromkeys([*makers, camera]))
        own = [every.index(name) for name in names]
        among = joint[own][:, :, own].reshape(9 * len(own), 9 * len(own))
        views.append(View(rig[camera], [rig[name] for name in makers], names, among, known, rows))
    return views


def columns(view: View, body: Moving, source: str) -> dict[str, tables.Column]:
    """The columns of `labels_2d` of a `body`, but for whose and of which camera they are."""
    camera, rows = view.camera, view.rows
    own = view.clocks[camera.name]
    at = rows["stamp_ns"], own.offset_s, own.drift_ppm
    points, velocity, bridged = body.at_pictures(*at)
    # a marker's own error is not counted
    noise = np.zeros((*points.shape, 3)) if source == "mocap" else body.noise_at_pictures(*at)
    uv, depth, status = labels(camera, points, body.joints)
    status = np.where((status == "missing_3d") & body.said_at_pictures(*at, "suspect"), "suspect", status)
    elapsed = seconds(rows["stamp_ns"], body.stamps_ns[0])
    timing = uncertainty.Timing(view.clocks, velocity, elapsed, np.nan_to_num(rows["restored_sigma_s"]))
    spread = uncertainty.of_labels(camera, points, noise, view.makers, view.names, view.joint, timing)
    sigma_u, sigma_v, rho_uv = uncertainty.columns(spread)
    count, each = status.shape
    words = [source, "interpolated"]
    has_source = ~np.isin(status, WITHOUT_3D).ravel()
    return {
        "joint": tables.Repeated(body.joints, np.tile(np.arange(each), count)),
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
