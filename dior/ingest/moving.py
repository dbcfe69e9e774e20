"""What moves in the pictures of a still camera: what stands out from the scene as it is most of the time.

INPUTS   BGR pictures of one recording
OUTPUTS  masks of what stands out; boxes around groups of it
The scene is the median of some pictures spread over the recording, so that who stands still for most of it is a part of
it. `calibrate/outline/silhouettes` has another one, in fractions of a grey level, for edges to a fraction of a pixel;
this one is of whole grey levels, ten times as fast, as every picture is looked at. Neither can take the other's
arithmetic and keep its results.
Pictures may be looked at smaller than they are: pixel (i, j) of one that is `factor` times smaller holds the pixels
`factor * i` to `factor * (i + 1) - 1`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from dior.arrays import Bools, Floats, Ints
from dior.ingest import messages

Picture: TypeAlias = NDArray[np.uint8]
# 0 or 1 by pixel
Mask: TypeAlias = NDArray[np.uint8]

# Pictures that make the scene. Chosen: where somebody is for a third of the time, most of so many show the scene.
SAMPLES = 21
# A pixel stands out by so many grey levels in its best channel, and by so many sd of what the samples differ by; as
# dior/calibrate/outline/silhouettes.py, whose edges benchmarks/long_range.py measures.
LEAST_CONTRAST, NOISES = 14, 5.0
# chosen: where somebody is half of the time, the samples differ by more than they ought to
MOST_CONTRAST = 60
# chosen: of so many samples without the subject a pixel of the scene is known; where this share is left, the median of
# all is the scene anyway
LEAST_LEFT, MOSTLY_LEFT = 3, 0.7
# chosen: every so many pixels tell the gain and offset of the light, so many in a row of a large picture
LIGHT_STEP, LIGHT_ACROSS = 8, 40
# rows of the scene that are in memory at once, of all samples; chosen: 30 MB of a 720p recording
ROWS = 256


@dataclass(frozen=True, eq=False)
class Scene:
    """The recording without what moves: `empty` (H, W, 3) uint8; `limit` (H, W): from what a pixel stands out."""

    empty: Picture
    limit: Picture


def samples(count: int) -> Ints:
    """Which of `count` pictures make the scene: (S,) ascending."""
    return np.unique(np.linspace(0, count - 1, min(SAMPLES, count)).round().astype(int))


def scene_of(pictures: Sequence[Picture], without: Sequence[Mask] = ()) -> Scene:
    """`Scene` of pictures (S, H, W, 3) uint8 of one size.

    `without`: 1 where the subject may be in each of them. These are left out where enough others are left, so that who
    walks towards the camera, over the same pixels all the time, is no part of the scene.
    """
    import cv2

    empty, limit = [], []
    for top in range(0, len(pictures[0]), ROWS):
        rows = slice(top, top + ROWS)
        part = [picture[rows] for picture in pictures]
        median = _middle(part)
        if without:
            _patch(median, np.stack(part), np.stack([mask[rows] for mask in without]) > 0)
        noise = 1.4826 * _middle([_strongest(cv2.absdiff(each, median)) for each in part])
        empty.append(median)
        limit.append(np.clip(NOISES * noise, LEAST_CONTRAST, MOST_CONTRAST).astype(np.uint8))
    return Scene(np.concatenate(empty), np.concatenate(limit))


def _middle(pictures: Sequence[Picture]) -> Picture:
    """Of S pictures, pixel by pixel, the value that is larger than S // 2 of them.

    By exchanges of whole pictures, a tenth of the time of numpy's partition.
    """
    import cv2

    left = list(pictures)
    for _ in range(len(pictures) // 2):
        # the least goes to the end, and away
        for i in range(len(left) - 1):
            more, less = cv2.max(left[i], left[i + 1]), cv2.min(left[i], left[i + 1])
            left[i], left[i + 1] = np.asarray(more, np.uint8), np.asarray(less, np.uint8)
        left.pop()
    least = left[0].copy()
    for each in left[1:]:
        cv2.min(least, each, least)
    return np.asarray(least, np.uint8)


def _strongest(picture: NDArray[Any]) -> Picture:
    """The largest of the three channels (H, W)."""
    import cv2

    blue, green, red = cv2.split(picture)
    return np.asarray(cv2.max(cv2.max(blue, green), red), np.uint8)


def _patch(median: Picture, part: Picture, without: Bools) -> None:
    """Take the median (H, W, 3) anew, in place, where the subject was in many of the samples `part` (S, H, W, 3)."""
    left = (~without).sum(axis=0)
    often = (left >= LEAST_LEFT) & (left < MOSTLY_LEFT * len(part))
    if not often.any():
        return
    values = np.where(without[:, often, None], 999, part[:, often].astype(np.int16))
    order = np.sort(values, axis=0)
    median[often] = np.take_along_axis(order, ((left[often] - 1) // 2)[None, :, None], axis=0)[0]


def smaller(message: Any, size: tuple[int, int], factor: int) -> Picture:
    """The picture (height, width, 3) of a message of `size` (height, width) px, `factor` (1, 2, 4 or 8) times smaller.

    Raises one of `containers.BROKEN` for a picture that cannot be read.
    """
    if factor > 1:
        found = messages.small_jpeg(message.kind, message.raw, message.wire, size, factor)
        if found is not None:
            return found
    whole = messages.decode(message.kind, message.raw, message.wire, size)
    return reduced(whole, factor)


def reduced(picture: Picture, factor: int) -> Picture:
    """The mean over `factor` x `factor` pixels of a picture (height, width, 3)."""
    import cv2

    if factor == 1:
        return picture
    high, wide = (-(-side // factor) for side in picture.shape[:2])
    padded = cv2.copyMakeBorder(
        picture, 0, high * factor - picture.shape[0], 0, wide * factor - picture.shape[1], cv2.BORDER_REPLICATE
    )
    return np.asarray(cv2.resize(padded, (wide, high), interpolation=cv2.INTER_AREA), np.uint8)


def standing_out(picture: Picture, scene: Scene) -> Mask:
    """1 where a picture (H, W, 3) differs from the scene, after its light is brought to that of the scene: (H, W)."""
    import cv2

    off = cv2.absdiff(cv2.LUT(picture, _light(picture, scene.empty)), scene.empty)
    return np.greater(_strongest(off), scene.limit).view(np.uint8)


def _light(picture: Picture, empty: Picture) -> Picture:
    """Grey levels (1, 256, 3) that those of the picture have in the scene's light: a gain and an offset by channel."""
    levels, table = np.arange(256.0), np.empty((1, 256, 3), np.uint8)
    step = max(LIGHT_STEP, picture.shape[1] // LIGHT_ACROSS)
    few = [p[::step, ::step].reshape(-1, 3).T.astype(float) for p in (picture, empty)]
    tells = np.logical_and(*((p > 5) & (p < 250) for p in few))
    for channel, (a, b, keep) in enumerate(zip(*few, tells, strict=True)):
        gain, offset = 1.0, 0.0
        # two passes: what moves is no change of the light
        for _ in range(2):
            x, y = a[keep], b[keep]
            if len(x) < 100:
                break
            off = x - x.sum() / len(x)
            square = float(off @ off)
            # a plain scene tells no gain
            gain = float(off @ y) / square * len(x) / (len(x) - 1) if square > 100 * len(x) else 1.0
            offset = _median(y - gain * x)
            miss = np.abs(b - gain * a - offset)
            keep &= miss <= max(3 * 1.4826 * _median(miss[keep]), 2.0)
        table[0, :, channel] = np.clip(np.rint(gain * levels + offset), 0, 255)
    return table


def _median(values: Floats) -> float:
    """The median of values (N,), which are sorted a little on the way: numpy's own takes ten times as long for few."""
    half = len(values) // 2
    values.partition((half - 1, half))
    return float(values[half] if len(values) % 2 else (values[half - 1] + values[half]) / 2)


def groups(mask: Mask, join_px: float, least: int, near: Mask | None = None) -> Ints:
    """Boxes (N, 4) of pixels (first column and row, those after the last) around groups of what is 1 in a mask.

    Pieces up to `join_px` apart are one group; a group has at least `least` pixels, or touches what is 1 in `near`.
    """
    import cv2

    # only where there is something
    u, v, wide, high = cv2.boundingRect(mask)
    if not wide:
        return np.zeros((0, 4), int)
    part = mask[v : v + high, u : u + wide]
    reach = max(int(join_px), 1) | 1
    count, labels, _, _ = cv2.connectedComponentsWithStats(cv2.dilate(part, np.ones((reach, reach), np.uint8)))
    labels = np.where(part > 0, labels, 0)
    sizes = np.bincount(labels.ravel(), minlength=count)
    touching = np.zeros(count, bool)
    if near is not None:
        beside = near[v : v + high, u : u + wide] > 0
        touching[np.unique(labels[beside & (part > 0)])] = True
    found = []
    for group in np.flatnonzero((sizes >= least) | touching):
        if group:
            inside = labels == group
            across, down = (np.flatnonzero(inside.any(axis=axis)) for axis in (0, 1))
            found.append((u + across[0], v + down[0], u + across[-1] + 1, v + down[-1] + 1))
    return np.array(found, int).reshape(-1, 4)
