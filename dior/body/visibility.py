"""Which joints the body itself hides from a camera: limbs as tapered capsules around the skeleton.

INPUTS   world points (F, J, 3) m of joints or Plug-in-Gait markers, the camera
OUTPUTS  hidden (F, J) bool
A joint is hidden where its line of sight enters a limb clearly before it reaches the joint. Limbs of which an end is
not known hide nothing. Things in the scene (a wall, another person) are not modelled.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from dior.arrays import Bools, Floats
from dior.body.joint_centres import CENTRES, mean_of
from dior.body.names import PLUG_IN_GAIT_39
from dior.body.proportions import SHANK, SIDES
from dior.geometry.camera import Camera

# radii as fractions of the stature, from girths and breadths of adults (ANSUR II, 2012: means of men and women,
# rounded; a girth is taken for a circle)
LIMBS = (
    ("head", "head", 0.050, 0.050),
    ("neck", "head", 0.033, 0.033),
    ("left_shoulder", "left_elbow", 0.030, 0.025),
    ("left_elbow", "left_wrist", 0.026, 0.016),
    ("left_wrist", "left_hand", 0.016, 0.020),
    ("left_hip", "left_knee", 0.054, 0.036),
    ("left_knee", "left_ankle", 0.036, 0.021),
    ("left_ankle", "left_toe", 0.024, 0.016),
    ("left_shoulder", "left_hip", 0.045, 0.058),
    ("neck", "mid_hip", 0.062, 0.066),
    ("left_hip", "right_hip", 0.058, 0.058),
)
# chosen; tests/body/test_visibility.py holds them to 90 % of the landmarks and 83 % of the markers as the simulator
# draws them, and 85 % of those called hidden
OWN = 1.2  # a joint within this many radii of a limb's axis belongs to it,
OWN_DEPTH = 1.4  # and is hidden by it only where it lies this many radii behind its surface
OTHER_DEPTH = 0.3  # the same for the other limbs
# markers whose mean is near a joint; the capsule of the head needs its middle, which is behind the joints of the face
NEAREST = {
    "head": ("LFHD", "RFHD", "LBHD", "RBHD"),
    **{name: CENTRES[name].near for name in ("neck", "mid_hip")},
    **{
        f"{side}_{name}": CENTRES[f"{side}_{name}"].near
        for side in SIDES
        for name in ("hip", "shoulder", "elbow", "wrist", "index", "knee", "ankle", "foot_index")
    },
}
# how far below its marker a joint lies, towards the other side of the body, fractions of the stature; chosen: about
# half the breadth of an adult's joint and of its marker
INWARDS = {"shoulder": 0.0, "elbow": 0.022, "knee": 0.036, "ankle": 0.024}


def hidden(camera: Camera, points: Floats, names: Sequence[str]) -> Bools:
    """Whether points (F, J, 3) m, called `names`, are behind a part of the body as seen by `camera`: (F, J) bool."""
    at = body_points(points, names)
    stature = stature_of(at)
    out = np.zeros(points.shape[:2], bool)
    if not np.isfinite(stature):
        return out
    eye = camera.centre
    sight = points - eye
    far = np.linalg.norm(sight, axis=-1)
    with np.errstate(invalid="ignore"):
        sight = np.ascontiguousarray(np.moveaxis(sight / far[..., None], -1, 0))
        for start, end, r0, r1 in _both_sides():
            if start in at and end in at:
                a, b = at[start] - eye, at[end] - eye
                out |= _behind(sight, far, a, b, r0 * stature, r1 * stature)
    return out


def _both_sides() -> Iterator[tuple[str, str, float, float]]:
    for start, end, r0, r1 in LIMBS:
        yield start, end, r0, r1
        if start.startswith("left_") and not end.startswith("right_"):
            yield start.replace("left_", "right_"), end.replace("left_", "right_"), r0, r1


def _behind(sight: Floats, far: Floats, a: Floats, b: Floats, r0: float, r1: float) -> Bools:
    """Whether joints `far` (F, J) m along unit `sight` (3, F, J) lie behind the limb from a to b (F, 3), eye at 0."""
    axis = b - a
    along, start = (np.einsum("kfj,fk->fj", sight, v) for v in (axis, a))
    length2, onto, a2 = ((v * w).sum(axis=-1)[:, None] for v, w in ((axis, axis), (a, axis), (a, a)))
    length2 = np.maximum(length2, 1e-8)
    # the points of the line of sight and of the axis that are nearest to each other
    share = np.clip((along * start - onto) / np.maximum(length2 - along**2, 1e-8), 0.0, 1.0)
    depth = start + share * along
    radius = r0 + share * (r1 - r0)
    gap2 = radius**2 - (a2 + share * (2 * onto + share * length2) - depth**2)
    # most lines of sight pass the limb by
    out = gap2 > 0
    within = np.nonzero(out)
    far, along, start, depth, radius, gap2 = (v[within] for v in (far, along, start, depth, radius, gap2))
    length2, onto, a2 = (v[within[0], 0] for v in (length2, onto, a2))
    enters = depth - np.sqrt(gap2)
    # the joint's own distance from the axis
    joint = far * along - onto
    s = np.clip(joint / length2, 0.0, 1.0)
    own = far * (far - 2 * start) + a2 + s * (s * length2 - 2 * joint) <= (OWN * (r0 + s * (r1 - r0))) ** 2
    out[within] = far - enters > np.where(own, OWN_DEPTH, OTHER_DEPTH) * radius
    return out


def body_points(points: Floats, names: Sequence[str]) -> dict[str, Floats]:
    """Joint centres (F, 3) m by name, and `head`, `neck`, `mid_hip`, `<side>_hand`, `<side>_toe`, as far as known."""
    at = {name: points[:, i] for i, name in enumerate(names)}
    if not set(names).isdisjoint(PLUG_IN_GAIT_39):
        at = _from_markers(at)
    for target, sources in (
        ("head", ("left_ear", "right_ear")),
        ("neck", ("left_shoulder", "right_shoulder")),
        ("mid_hip", ("left_hip", "right_hip")),
    ):
        middle = mean_of(at, sources)
        if target not in at and middle is not None:
            at[target] = middle
    for side in SIDES:
        _first(at, f"{side}_hand", f"{side}_index", f"{side}_wrist")
        _first(at, f"{side}_toe", f"{side}_foot_index", f"{side}_big_toe")
    return at


def _first(at: dict[str, Floats], target: str, *names: str) -> None:
    found = [name for name in names if name in at]
    if target not in at and found:
        at[target] = at[found[0]]


def _from_markers(m: dict[str, Floats]) -> dict[str, Floats]:
    """Joint centres from Plug-in-Gait markers, to a few centimetres: enough to say what hides what."""
    centres = {name: mean_of(m, markers) for name, markers in NEAREST.items()}
    at = {name: centre for name, centre in centres.items() if centre is not None}
    stature = stature_of(at)
    if not np.isfinite(stature) or not {"left_hip", "right_hip"} <= set(at):
        return at
    left = at["left_hip"] - at["right_hip"]
    left = left / np.linalg.norm(left, axis=-1, keepdims=True)
    for joint, depth in INWARDS.items():
        for side, sign in (("left", -1.0), ("right", 1.0)):
            if f"{side}_{joint}" in at:
                at[f"{side}_{joint}"] = at[f"{side}_{joint}"] + sign * depth * stature * left
    for side, sign in (("left", -1.0), ("right", 1.0)):
        down = np.array([0.0, 0.0, -0.04 * stature])
        at[f"{side}_hip"] = at[f"{side}_hip"] + sign * 0.02 * stature * left + down
        if f"{side}_shoulder" in at:
            at[f"{side}_shoulder"] = at[f"{side}_shoulder"] + down
    return at


def stature_of(at: dict[str, Floats]) -> float:
    """Stature (m) from the shanks; NaN where neither is known."""
    shanks = [
        np.linalg.norm(at[f"{side}_knee"] - at[f"{side}_ankle"], axis=-1)
        for side in SIDES
        if f"{side}_knee" in at and f"{side}_ankle" in at
    ]
    known = np.concatenate([np.empty(0), *shanks])
    known = known[np.isfinite(known)]
    return float(np.median(known)) / SHANK if len(known) else np.nan
