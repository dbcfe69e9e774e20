"""Where a walker is in the pictures of a still camera, without a detector: what differs from the empty scene. And the
outline of a body whose 3D is known, which that, and a box that a person draws, is compared with.

INPUTS   BGR pictures of one recording, where the person is about to be (a window)
OUTPUTS  edges (F, 4) px of the tight box of the silhouette, NaN where nothing stands out
Recorded pixels; pixel (0, 0) is the centre of the top-left pixel. The empty scene is the median of the pictures; the
light may change between them (a gain and an offset for each channel), and what is saturated in the empty scene, such
as the sun, tells nothing.
"""

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from dior.arrays import Bools, Floats

Picture: TypeAlias = NDArray[np.uint8]
Scene: TypeAlias = NDArray[np.float32]

# chosen; what comes of it is measured by benchmarks/long_range.py and clocks_pictures.py
SATURATED = 250  # grey levels from which on a pixel tells nothing
LEAST_CONTRAST, NOISES = 14.0, 5.0  # a pixel stands out by so many grey levels in its best channel, and so many sd
SMALLEST_PX = 12  # pixels of a silhouette
JOIN = 0.5  # pieces this share of the expected height apart belong together
GAIN_STEP = 7  # every so many pixels tell the gain and offset of the light

# of the stature, from the ear canal to the crown: 13 cm of 1.72 m (ANSUR II)
EAR_TO_CROWN = 0.0755


# chosen: how far skin and clothes lie outside of a joint, as a share of the stature, about half the breadth of a limb;
# what is not here (eyes) adds nothing. An error that all share goes into the margin of the fit
FLESH = {
    "nose": 0.015, "ear": 0.012, "shoulder": 0.040, "elbow": 0.030, "wrist": 0.020, "pinky": 0.015, "index": 0.015,
    "thumb": 0.015, "hip": 0.060, "knee": 0.037, "ankle": 0.027, "heel": 0.018, "foot_index": 0.018, "crown": 0.0,
    "big_toe": 0.018, "small_toe": 0.018,
}  # fmt: skip


def flesh(joints: Sequence[str], height_m: float) -> Floats:
    """How far the outline lies outside of each of the joints (J,), m."""
    return height_m * np.array([FLESH.get(joint.removeprefix("left_").removeprefix("right_"), 0.0) for joint in joints])


def crown(points: Floats, joints: Sequence[str]) -> Floats:
    """The crown of the head (F, 3) m above the ears, or the one that is known, from points (F, J, 3): a silhouette ends
    there, joints do not."""
    each = np.stack([points[:, joints.index(f"{side}_ear")] for side in ("left", "right")])
    known = np.isfinite(each).all(axis=-1, keepdims=True)
    ears = np.where(
        known.any(axis=0), np.where(known, each, 0.0).sum(axis=0) / np.maximum(known.sum(axis=0), 1), np.nan
    )
    up = EAR_TO_CROWN / (1 - EAR_TO_CROWN) * np.nanmedian(ears[:, 2])
    return ears + (0.0, 0.0, up)


# chosen, of the stature: the band of head markers, the crown above it, toes beyond the marker on the foot (in a shoe),
# what lies outside of a marker that is stuck to clothes, fingers beyond the one on the hand
BAND, ABOVE_BAND, TOES, CLOTH = 0.95, 0.05, 0.04, 0.006
MARKER_FLESH = {"FIN": 0.025, "toes": 0.012, "HEE": 0.010, "crown": 0.0}
HEAD = ("LFHD", "RFHD", "LBHD", "RBHD")


def outline(points: Floats, joints: Sequence[str]) -> tuple[Floats, Floats]:
    """Points (F, J', 3) m that the outline of the body lies around, and how far outside of each (J',) m it does.

    `points` (F, J, 3) of joints or of Plug-in-Gait markers; the crown and the toes are added where they are known.
    """
    if not np.isfinite(points[..., 2]).any():
        # as many points as of any other walk of these joints
        whole, _ = outline(np.arange(points[:1].size, dtype=float).reshape(points[:1].shape), joints)
        return np.full((len(points), *whole.shape[1:]), np.nan), np.zeros(whole.shape[1])
    if {"left_ear", "right_ear"} <= set(joints):
        top = crown(points, joints)
        highest = top[:, 2] if np.isfinite(top).any() else points[..., 2]
        return np.concatenate([points, top[:, None]], axis=1), flesh([*joints, "crown"], float(np.nanmedian(highest)))
    at = {joint: points[:, i] for i, joint in enumerate(joints)}
    added = {}
    band = np.stack([at[joint] for joint in HEAD if joint in at], axis=1) if any(j in at for j in HEAD) else points
    height_m = float(np.nanmedian(band[..., 2])) / BAND if len(band) else np.nan
    if any(joint in at for joint in HEAD):
        added["crown"] = band.mean(axis=1) + (0.0, 0.0, ABOVE_BAND * height_m)
    for side in "LR":
        if f"{side}TOE" in at and f"{side}HEE" in at:
            sole = at[f"{side}TOE"] - at[f"{side}HEE"]
            sole = sole / np.linalg.norm(sole, axis=-1, keepdims=True)
            added[f"{side}toes"] = at[f"{side}TOE"] + TOES * height_m * sole
    names = [*joints, *added]
    out = [MARKER_FLESH.get(name.removeprefix("L").removeprefix("R"), CLOTH) for name in names]
    whole = np.concatenate([points, *(extra[:, None] for extra in added.values())], axis=1)
    return whole, height_m * np.array(out)


def window(uv: Floats, size: tuple[int, int], around_px: float) -> tuple[int, int, int, int]:
    """The part u0, v0, u1, v1 of a picture (width, height) that holds all of uv (..., 2) with so much around."""
    flat = uv.reshape(-1, 2)
    flat = flat[np.isfinite(flat).all(axis=1)]
    low = np.clip(np.floor(flat.min(axis=0) - around_px), 0, np.array(size) - 1).astype(int)
    high = np.clip(np.ceil(flat.max(axis=0) + around_px), 0, np.array(size) - 1).astype(int)
    return (*low.tolist(), *(high + 1).tolist())


def empty_scene(pictures: Sequence[Picture]) -> Scene:
    """The scene (height, width, 3) without anybody: the median of pictures (F, height, width, 3).

    They should be of several walks: one straight towards the camera hides the same place all the time.
    """
    return np.median(np.asarray(pictures), axis=0).astype(np.float32)


def stance(uv: Floats) -> tuple[float, int]:
    """How tall (px, the median) a body with the points uv (F, J, 2) px is in pictures, and along which axis it stands.

    1 is v; 0 where the camera is on its side. NaN where no picture has any point.
    """
    seen = np.asarray(np.isfinite(uv).all(axis=-1, keepdims=True))
    high, low = np.where(seen, uv, -np.inf).max(axis=1), np.where(seen, uv, np.inf).min(axis=1)
    there = seen[..., 0].any(axis=1)
    if not there.any():
        return np.nan, 1
    size = np.median((high - low)[there], axis=0)
    return float(size.max()), int(size[1] >= size[0])


def edges(pictures: Sequence[Picture], height_px: float, empty: Scene, standing: int = 1) -> Floats:
    """Edges (F, 4) px, in the coordinates of the pictures (F, height, width, 3) uint8, of a person `height_px` tall.

    `empty` as from `empty_scene`, `standing` the axis along which the person stands (`stance`). The largest group of
    pixels that stand out is the person, if it is neither too small nor more than twice as tall.
    """
    import cv2

    known = np.all(empty < SATURATED, axis=-1)
    each = [_same_light(picture.astype(np.float32), empty, known) - empty for picture in pictures]
    differs = np.stack([np.where(known, np.abs(d).max(axis=-1), 0.0) for d in each])
    noise = 1.4826 * np.median(differs, axis=0)
    limit = np.maximum(LEAST_CONTRAST, NOISES * noise)
    found = np.full((len(pictures), 4), np.nan)
    reach = max(3, int(JOIN * height_px) | 1)
    kernel = np.ones((reach, max(3, reach // 2 | 1))[:: 1 if standing else -1], np.uint8)
    along = cv2.CC_STAT_HEIGHT if standing else cv2.CC_STAT_WIDTH
    for i, strength in enumerate(differs):
        mask = (strength > limit).astype(np.uint8)
        _, labels, stats, _ = cv2.connectedComponentsWithStats(cv2.morphologyEx(mask, cv2.MORPH_CLOSE, kernel))
        inside = np.bincount(labels[mask > 0], minlength=len(stats))
        inside[0] = 0
        best = int(inside.argmax())
        if inside[best] < SMALLEST_PX or stats[best, along] > 2 * height_px:
            continue
        found[i] = _extent(np.where((labels == best) & (mask > 0), strength, 0.0))
    return found


def _same_light(picture: Scene, empty: Scene, known: Bools) -> Scene:
    """The picture with the gain and offset of each channel that bring most of it to the empty scene."""
    out = picture.copy()
    usable = known & (picture < SATURATED).all(axis=-1)
    if usable.sum() < 100:
        return out
    for channel in range(3):
        a, b = picture[..., channel][usable][::GAIN_STEP], empty[..., channel][usable][::GAIN_STEP]
        # two passes: the person is no change of the light
        keep = np.ones(len(a), bool)
        for _ in range(2):
            gain = np.cov(a[keep], b[keep])[0, 1] / max(a[keep].var(), 1e-6) if a[keep].std() > 2 else 1.0
            offset = np.median(b[keep] - gain * a[keep])
            miss = np.abs(b - gain * a - offset)
            keep = miss <= max(3 * 1.4826 * np.median(miss), 1.0)
        out[..., channel] = gain * picture[..., channel] + offset
    return out


def _extent(strength: Scene) -> tuple[float, float, float, float]:
    """u_min, v_min, u_max, v_max px of what stands out (height, width); an edge pixel counts by how much it does.

    A pixel that is half covered by the body stands out half as much as those further inside, so that the outline is
    known to a fraction of a pixel.
    """
    rows, columns = strength.max(axis=1), strength.max(axis=0)
    low_u, high_u = _ends(columns)
    low_v, high_v = _ends(rows)
    return low_u, low_v, high_u, high_v


def _ends(profile: Scene) -> tuple[float, float]:
    there = np.flatnonzero(profile > 0)
    first, last = there[0], there[-1]
    if last - first < 3:
        return first - 0.5, last + 0.5
    covered = [min(profile[a] / max(profile[b], 1e-6), 1.0) for a, b in ((first, first + 1), (last, last - 1))]
    return first + 0.5 - covered[0], last - 0.5 + covered[1]
