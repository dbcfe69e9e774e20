"""How far the labels of a camera lie beside the hand boxes as a whole, and the nudge that would put them right.

INPUTS   `frame_metrics` of a recording (the offsets of label boxes from hand boxes, picture by picture), its figures,
         the camera and its YAML's nudge
OUTPUTS  `Offset`s px with standard errors; the values to type for a camera that is placed by eye

A camera that is turned moves all its labels by about f times the angle (`calibrate.align`): labels that lie right of
the boxes are put right by a smaller azimuth, labels below them by a smaller elevation. A wrong distance cannot be told
from how large a person draws boxes.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from dior.arrays import Floats, Ints
from dior.geometry.camera import Camera

# which boxes tell it: where they placed the camera, each by a fit without it; else all, which tell it more surely than
# the few that are kept back
KINDS = ("left_out", "box")
# that fewer boxes have no spread worth telling; chosen
FEWEST = 3
# chosen: a person draws one edge further out than the other by half a pixel (`align.habit_px` has the same), which
# moves the middle of every box by half of that
HABIT_PX = 0.25
# perfect labels lie up to 4 % of the body's height below the middle of boxes that hold the whole head (`lights.LIMITS`)
BELOW, BELOW_SIGMA = 0.02, 0.01
# standard errors from which on an offset is one; chosen
TOLD = 3.0


@dataclass(frozen=True)
class Offset:
    """Labels lie `uv` (2,) px right of and below where the boxes have them, with standard errors `sigma` (2,) px that
    all recordings of a drawer share; `n` boxes. NaN where an axis is not told."""

    uv: tuple[float, float]
    sigma: tuple[float, float]
    n: int

    @property
    def told(self) -> tuple[bool, bool]:
        """Whether each axis is certainly off."""
        u, v = (abs(off) > TOLD * sigma for off, sigma in zip(self.uv, self.sigma, strict=True))
        return u, v


def of_recording(by_metric: Mapping[str, tuple[Ints, Floats, Ints]], height_px: float) -> Offset | None:
    """The `Offset` of a recording from its `frame_metrics` by metric, (stamps, values, n), or None without boxes.

    `height_px`: of the person in its pictures.
    """
    for kind in KINDS:
        # those of boxes that were left out are in shares of the body's height
        scale = 1.0 if kind == "box" else height_px
        each = [scale * by_metric[key][1] for key in (f"{kind}_offset_u", f"{kind}_offset_v") if key in by_metric]
        if len(each) == 2 and min(map(len, each)) >= FEWEST:
            spread = [float(one.std(ddof=1) / np.sqrt(len(one))) for one in each]
            below = BELOW * height_px if np.isfinite(height_px) else 0.0
            u, v = (float(one.mean()) for one in each)
            more = (HABIT_PX, np.hypot(HABIT_PX, BELOW_SIGMA * np.nan_to_num(height_px)))
            sigma_u, sigma_v = (float(np.hypot(own, add)) for own, add in zip(spread, more, strict=True))
            return Offset((u, v - below), (sigma_u, sigma_v), min(map(len, each)))
    return None


def together(offsets: Iterable[Offset]) -> Offset | None:
    """The mean of the offsets of several recordings, by their numbers of boxes; they share the drawer's habits."""
    found = list(offsets)
    if not found:
        return None
    n = np.array([one.n for one in found], float)
    uv = np.average([one.uv for one in found], axis=0, weights=n)
    sigma = np.average([one.sigma for one in found], axis=0, weights=n)
    return Offset((float(uv[0]), float(uv[1])), (float(sigma[0]), float(sigma[1])), int(n.sum()))


def alike(offsets: Iterable[Offset]) -> bool:
    """Whether recordings are off by the same, as they are if the camera is turned and not if a clock is wrong."""
    uv = np.array([one.uv for one in offsets])
    middle = uv.mean(axis=0)
    apart = np.linalg.norm(uv - middle, axis=1).max()
    return bool(len(uv) > 1 and apart < np.linalg.norm(middle) / 3)


def nudge(offset: Offset, camera: Camera, now: Mapping[str, float]) -> dict[str, float]:
    """The section `nudge` of the camera's YAML that puts the labels where the boxes are; `now`: what it says."""
    new = dict(now)
    K = camera.intrinsics
    for key, off, told, focal in zip(
        ("azimuth_deg", "elevation_deg"), offset.uv, offset.told, (K.fx, K.fy), strict=True
    ):
        if told:
            new[key] = round(now.get(key, 0.0) - float(np.degrees(np.arctan(off / focal))), 3)
    return new


def words(offset: Offset) -> str:
    """Which way and how far, of the axes that are told: "7.8 ± 0.5 px to the right"."""
    sides = (("to the left", "to the right"), ("above", "below"))
    parts = [
        f"{abs(off):.1f} ± {1.96 * sigma:.1f} px {side[off > 0]}"
        for off, sigma, told, side in zip(offset.uv, offset.sigma, offset.told, sides, strict=True)
        if told
    ]
    return " and ".join(parts)
