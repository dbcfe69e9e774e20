"""Labels must be where the released 3D, cameras and clocks put them.

INPUTS   a `Walk` (evidence.py). OUTPUTS: problems as (path, sentence)
A label is the 3D between two instants, at the stamp of its picture by the clock of its camera, projected
(dior/label/reproject.py). All of that is in the release, so that a label, a stamp, a pose or a clock that was moved
alone is found, however little. Labels and residuals of marks are computed in float64 from the very numbers that the
release has, and stored as float32: they differ by half a unit in the last place, where another machine's arithmetic
rounds the other way by one. That is the tolerance; a label at 1000 px may be off by 0.0001 px.
"""

from collections.abc import Iterator

import numpy as np

from dior.arrays import Bools, Floats, Ints, Table, Texts
from dior.clocks import axis
from dior.geometry import camera as cam
from dior.geometry.camera import Camera
from dior.release.layout import IN_PICTURE
from dior.release.verify.evidence import Walk
from dior.release.verify.walk_checks import Problem
from dior.tables import tables
from dior.tables.words import WITHOUT_3D

# units in the last place of a float32
ULPS = 1.0
# px and m, of what is near zero, where units in the last place are finer than float64 through a lens can be
LEAST = 1e-6
# px, within which of a picture's edge another machine may see a label on the other side of it
AT_EDGE = 1e-6


def check(walk: Walk) -> list[Problem]:
    """Compare the labels and the residuals of the marks of a walk with what projects there."""
    skeleton = walk.of("skeletons_3d")[""]
    problems = []
    for name, labels in sorted(walk.of("labels_2d").items()):
        camera, clock = walk.rig.camera(walk.sequence, name), walk.rig.clocks.get((walk.sequence, name))
        path = walk.path("labels_2d", name)
        if walk.rig.suspect(walk.sequence, name):
            # without a place (light_checks.py)
            continue
        if camera is None or clock is None:
            problems.append((path, f"cannot be recomputed: camera {name} has no pose, lens or clock"))
        elif not len(skeleton["instant"]):
            problems.append((path, "cannot be recomputed: there is nothing in skeletons_3d"))
        elif len(labels["frame"]):
            problems += [(path, text) for text in of_labels(labels, skeleton, camera, clock)]
    if walk.of("marks"):
        problems += [(walk.path("marks"), text) for text in _of_marks(walk.of("marks")[""], walk)]
    return problems


def of_labels(labels: Table, skeleton: Table, camera: Camera, clock: tuple[float, float]) -> Iterator[str]:
    """Yield what is wrong with the labels of one camera."""
    uvd, joints = tables.grid(labels, "u", "v", "depth")
    shape = uvd.shape[:2]
    frames, stamps = (labels[key].reshape(shape)[:, 0] for key in ("frame", "stamp_ns"))
    points, known = at_stamps(skeleton, stamps, clock)
    if known != joints:
        yield f"has the joints {_few(joints)}; skeletons_3d has {_few(known)}"
        return
    pixels, depth = cam.project(camera, points)
    off = np.linalg.norm(pixels - uvd[..., :2], axis=-1)
    wrong = np.asarray(~same(uvd[..., :2], pixels).all(axis=-1))
    if wrong.any():
        f, j = np.unravel_index(np.argmax(np.where(wrong, np.nan_to_num(off, nan=np.inf), -1.0)), shape)
        by = f"is off by {off[f, j]:.3g} px" if np.isfinite(off[f, j]) else "is there where nothing projects, or gone"
        yield (
            f"{int(wrong.sum())} labels are not where the 3D, the camera and its clock put them: frame {frames[f]}, "
            f"joint {joints[j]} {by}" + _whole(wrong, np.asarray(np.isfinite(points).all(axis=-1)), frames)
        )
        return
    deep = ~same(uvd[..., 2], depth)
    # of what is missing there is no depth
    deep &= np.isfinite(points).all(axis=-1)
    if deep.any():
        f, j = np.argwhere(deep)[0]
        yield f"{int(deep.sum())} depths are not those of the 3D, first frame {frames[f]}, joint {joints[j]}"
    status = labels["status"].reshape(shape)
    untrue = ~_possible(status, points, pixels, depth, camera)
    if untrue.any():
        f, j = np.argwhere(untrue)[0]
        yield (
            f"{int(untrue.sum())} labels have a status that the 3D denies, first frame {frames[f]}, joint {joints[j]}: "
            f"{status[f, j]}"
        )


def at_stamps(skeleton: Table, stamps: Ints, clock: tuple[float, float]) -> tuple[Floats, list[str]]:
    """World points (F, J, 3) m at the `stamps` (F,) ns of a camera with `clock` (offset_s, drift_ppm), and the joints.

    Between instants as `dior.clocks.axis.Moving.at_pictures` has them for the labels; what that says of their
    uncertainty is not needed here.
    """
    walker = axis.moving(skeleton)
    return walker.at_pictures(stamps, *clock)[0], walker.joints


def same(stored: Floats, computed: Floats) -> Bools:
    """Whether what was stored as float32 is what was computed; both missing is the same."""
    with np.errstate(invalid="ignore", over="ignore"):
        near = np.abs(stored - computed) <= np.maximum(ULPS * np.spacing(np.abs(computed).astype(np.float32)), LEAST)
    return near | (np.isnan(stored) & ~np.isfinite(computed))


def _possible(status: Texts, points: Floats, pixels: Floats, depth: Floats, camera: Camera) -> Bools:
    """Whether each status (F, J) may be that of the point; what the body hides is a model's word and is not judged."""
    known = np.isfinite(points).all(axis=-1)
    behind = known & (depth <= 0)
    there = np.isin(status, IN_PICTURE)
    lens = camera.intrinsics
    with np.errstate(invalid="ignore"):
        edge = np.minimum(np.abs(pixels + 0.5), np.abs(pixels + 0.5 - (lens.width, lens.height))).min(axis=-1) < AT_EDGE
    right = np.where(there, cam.in_frame(lens, pixels), status == "out_of_frame")
    right &= there == cam.in_frame(lens, pixels)
    return np.where(~known, np.isin(status, WITHOUT_3D), np.where(behind, status == "behind_camera", right | edge))


def _whole(wrong: Bools, known: Bools, frames: Ints) -> str:
    """How the wrong labels lie: that tells what was moved."""
    count = np.asarray(wrong.any(axis=1))
    if (count | ~known.any(axis=1)).all():
        return "; all frames with 3D, so the camera's pose, lens or clock, or whose labels they are, was changed"
    return f"; {int(count.sum())} of {len(count)} frames, first {frames[np.argmax(count)]}"


def _of_marks(marks: Table, walk: Walk) -> Iterator[str]:
    """Yield what is wrong with the residuals of the marks that located a camera."""
    for name in sorted(set(marks["camera"][marks["kind"] == "mark"])):
        camera = walk.rig.camera(walk.sequence, name)
        mine = tables.rows(marks, (marks["camera"] == name) & (marks["kind"] == "mark"))
        if camera is None or camera.locate != "marks":
            continue
        points = np.stack([mine[key] for key in "xyz"], axis=-1)
        pixels = np.stack([mine[key] for key in "uv"], axis=-1)
        residual = np.linalg.norm(cam.project(camera, points)[0] - pixels, axis=-1)
        wrong = ~same(mine["residual_px"], residual)
        if wrong.any():
            row = int(np.argmax(wrong))
            yield (
                f"{int(wrong.sum())} marks of camera {name} have another residual than their 3D point gives, first "
                f"frame {mine['frame'][row]}, joint {mine['joint'][row]}: {mine['residual_px'][row]:.4g} px, not "
                f"{residual[row]:.4g} px"
            )


def _few(names: list[str]) -> str:
    return ", ".join(names[:3]) + (", ..." if len(names) > 3 else "")
