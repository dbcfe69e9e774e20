"""What moves in the pictures of a still camera: what stands out from the scene as it is most of the time.

INPUTS   BGR pictures of one recording
OUTPUTS  masks of what stands out; boxes around groups of it
The scene is the median of some pictures spread over the recording, so that who stands still for most of it is a part of
it. Pictures may be looked at smaller than they are: pixel (i, j) of one that is `factor` times smaller holds the pixels
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
# chosen: every so many pixels tell the gain and offset of the light
LIGHT_STEP = 8
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
    middle = len(pictures) // 2
    empty, limit = [], []
    for top in range(0, len(pictures[0]), ROWS):
        rows = slice(top, top + ROWS)
        part = np.stack([picture[rows] for picture in pictures])
        median = np.partition(part, middle, axis=0)[middle]
        if without:
            _patch(median, part, np.stack([mask[rows] for mask in without]) > 0)
        off = np.where(part > median, part - median, median - part).max(axis=-1)
        noise = 1.4826 * np.partition(off, middle, axis=0)[middle]
        empty.append(median)
        limit.append(np.clip(NOISES * noise, LEAST_CONTRAST, MOST_CONTRAST).astype(np.uint8))
    return Scene(np.concatenate(empty), np.concatenate(limit))


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
    import cv2

    data = messages.compressed(message.kind, message.raw, message.wire) if factor > 1 else None
    if data is not None and data.startswith(b"\xff\xd8"):
        # a JPEG is unpacked to a smaller picture in a third of the time
        flag = getattr(cv2, f"IMREAD_REDUCED_COLOR_{factor}") | cv2.IMREAD_IGNORE_ORIENTATION
        messages.picture_of(message.kind, message.raw, message.wire)
        found = cv2.imdecode(np.frombuffer(data, np.uint8), flag)
        if found is None or found.shape[:2] != tuple(-(-side // factor) for side in size):
            raise ValueError("its JPEG or PNG data are damaged")
        return np.asarray(found, np.uint8)
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
    blue, green, red = cv2.split(off)
    return (cv2.max(cv2.max(blue, green), red) > scene.limit).astype(np.uint8)


def _light(picture: Picture, empty: Picture) -> Picture:
    """Grey levels (1, 256, 3) that those of the picture have in the scene's light: a gain and an offset by channel."""
    levels, table = np.arange(256.0), np.empty((1, 256, 3), np.uint8)
    for channel in range(3):
        a, b = (p[::LIGHT_STEP, ::LIGHT_STEP, channel].ravel().astype(float) for p in (picture, empty))
        gain, offset, keep = 1.0, 0.0, (a > 5) & (a < 250) & (b > 5) & (b < 250)
        # two passes: what moves is no change of the light
        for _ in range(2):
            if keep.sum() < 100:
                break
            x, y = a[keep], b[keep]
            gain = float(np.cov(x, y)[0, 1] / x.var()) if x.std() > 10 else 1.0
            offset = float(np.median(y - gain * x))
            miss = np.abs(b - gain * a - offset)
            keep &= miss <= max(3 * 1.4826 * float(np.median(miss[keep])), 2.0)
        table[0, :, channel] = np.clip(np.rint(gain * levels + offset), 0, 255)
    return table


def groups(mask: Mask, join_px: float, least: int, near: Mask | None = None) -> Ints:
    """Boxes (N, 4) of pixels (first column and row, those after the last) around groups of what is 1 in a mask.

    Pieces up to `join_px` apart are one group; a group has at least `least` pixels, or touches what is 1 in `near`.
    """
    import cv2

    if not mask.any():
        return np.zeros((0, 4), int)
    # only where there is something
    columns, rows = (np.flatnonzero(mask.any(axis=axis)) for axis in (0, 1))
    u, v = int(columns[0]), int(rows[0])
    part = mask[v : rows[-1] + 1, u : columns[-1] + 1]
    reach = max(int(join_px), 1) | 1
    count, labels, _, _ = cv2.connectedComponentsWithStats(cv2.dilate(part, np.ones((reach, reach), np.uint8)))
    labels = np.where(part > 0, labels, 0)
    sizes = np.bincount(labels.ravel(), minlength=count)
    touching = np.zeros(count, bool)
    if near is not None:
        beside = near[v : rows[-1] + 1, u : columns[-1] + 1] > 0
        touching[np.unique(labels[beside & (part > 0)])] = True
    found = []
    for group in np.flatnonzero((sizes >= least) | touching):
        if group:
            inside = labels == group
            across, down = (np.flatnonzero(inside.any(axis=axis)) for axis in (0, 1))
            found.append((u + across[0], v + down[0], u + across[-1] + 1, v + down[-1] + 1))
    return np.array(found, int).reshape(-1, 4)


def in_ellipse(mask: Mask, box: Floats) -> tuple[Bools, Mask]:
    """Which pixels of the ellipse in a box (4,) lie in the mask's picture, as a bool array of the box's part of it, and
    that part of the mask."""
    from dior.release import head_blur

    rows, columns = head_blur.inside((*np.floor(box[:2]), *np.ceil(box[2:])), *mask.shape)
    at = np.arange(rows.start, rows.stop), np.arange(columns.start, columns.stop)
    return head_blur.ellipse(box, *at), mask[rows, columns]
