"""Which frames of a walk to mark: where the feet pass each other and the person is somewhere else.

INPUTS   the C3D's markers of a walk; where the person is on the frames that have marks
OUTPUTS  a frame, and in a sentence why
What tells a camera's clock is the foot that swings, and it is fastest where it passes the other; what tells its pose is
that the marks are spread in space. World in metres, Z up; seconds.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dior.arrays import Floats, Ints
from dior.calibrate.marks.marks import Motion

# markers at the two feet, the first pair that a capture has
FEET = (("LANK", "RANK"), ("LHEE", "RHEE"), ("LTOE", "RTOE"))
WALKS_M_S = 0.3  # chosen: slower is no walk, and feet that stand side by side tell no time
SPREAD = 24  # chosen: frames of a walk that are looked at; a step of a walk of 15 s is as long
# chosen: grey levels between two pictures that are no noise, and how far apart these are, s: a walker is 0.1 m on
CHANGED, APART_S = 25, 0.1


def middle(xyz: Floats) -> Floats:
    """Where the person is (..., 3) m: the mean of the markers (..., J, 3) that are there."""
    there = np.asarray(np.isfinite(xyz).all(axis=-1))
    total = np.where(there[..., None], xyz, 0.0).sum(axis=-2)
    with np.errstate(invalid="ignore"):
        return np.asarray(total / np.where(there.any(axis=-1), there.sum(axis=-1), np.nan)[..., None], float)


def feet_pass(motion: Motion) -> Floats:
    """Times (K,) s of the capture at which one foot passes the other on the way."""
    pair = next((pair for pair in FEET if set(pair) <= set(motion.joints)), None)
    if pair is None or len(motion.t) < 3:
        return np.zeros(0)
    left, right = (motion.xyz[:, motion.joints.index(name), :2] for name in pair)
    way = np.gradient(middle(motion.xyz)[:, :2], motion.t, axis=0)
    speed = np.linalg.norm(way, axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        ahead = ((left - right) * way).sum(axis=1) / speed
        crosses = (ahead[:-1] * ahead[1:] <= 0) & (ahead[:-1] != ahead[1:]) & (speed[:-1] > WALKS_M_S)
    at = np.flatnonzero(crosses)
    share = ahead[at] / (ahead[at] - ahead[at + 1])
    return motion.t[at] + share * (motion.t[at + 1] - motion.t[at])


def spread(count: int, most: int = SPREAD) -> Ints:
    """Frame numbers, evenly spread over `count` pictures, without the first and the last."""
    return np.unique(np.linspace(0, count - 1, min(most, count) + 2).round().astype(int)[1:-1])


def nearest_frames(times: Floats, wanted: Floats) -> Ints:
    """The frames, of pictures taken at `times` (F,) s, that are nearest to the times `wanted` (K,) that it covers."""
    inside = wanted[(wanted >= times[0]) & (wanted <= times[-1])]
    return np.unique(np.abs(times[:, None] - inside).argmin(axis=0)) if len(inside) else np.zeros(0, int)


def furthest(places: Floats, marked: Floats) -> tuple[int, float]:
    """Of places (K, 3) m the one that is furthest from all `marked` (M, 3): its index and that distance m."""
    away = np.linalg.norm(places[:, None] - marked, axis=2).min(axis=1)
    best = int(np.nanargmax(away))
    return best, float(away[best])


def sentence(frame: int, passes: bool, away_m: float | None, marked: int) -> str:
    """Why a frame is offered: the person is `away_m` from where the `marked` frames have it, None where none is."""
    parts = ["one foot passes the other, which tells the clock most"] if passes else []
    if away_m is not None:
        parts.append(f"the person is {away_m:.1f} m away from the {'place' if marked == 1 else 'places'} with marks")
    return f"On frame {frame} {', and '.join(parts) or 'the person is seen well'}."


def movement(before: NDArray[Any], after: NDArray[Any]) -> tuple[int, tuple[int, int, int, int] | None]:
    """How many pixels change between two grey pictures (height, width), and the box of most of these: u, v of its first
    and its last pixel; None where nothing moves. 0 where what moves is cut by the picture's edge."""
    import cv2

    off = cv2.absdiff(cv2.GaussianBlur(before, (0, 0), 1.0), cv2.GaussianBlur(after, (0, 0), 1.0)) > CHANGED
    if off.sum() < 10:
        return 0, None
    rows, columns = np.nonzero(off)
    # a few pixels of noise far away are none of the person
    (left, right), (top, bottom) = np.quantile(columns, (0.02, 0.98)), np.quantile(rows, (0.02, 0.98))
    box = int(left), int(top), int(right), int(bottom)
    height, width = off.shape
    cut = box[0] <= 1 or box[1] <= 1 or box[2] >= width - 2 or box[3] >= height - 2
    return 0 if cut else int(off.sum()), box


def liveliest(found: Sequence[tuple[int, int, tuple[int, int, int, int] | None]]) -> int:
    """Index of the picture (frame, pixels, box) in which most moves; the middle one where nothing does."""
    pixels = [one[1] for one in found]
    return int(np.argmax(pixels)) if max(pixels) else len(found) // 2
