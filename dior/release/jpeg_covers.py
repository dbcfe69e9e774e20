"""Covers in a JPEG file that leave everything but the blocks below them as it was recorded.

INPUTS   the bytes of a JPEG file, the boxes to cover
OUTPUTS  the file with the covers, without any segment but those of its picture
Of each component the blocks (8 x 8 samples) that a cover touches are decoded, covered as head_blur.py does it, and
encoded by their own quantisation table again; the quantised coefficients of all others stay. What a cover fills is
replaced before it is encoded, and so is what the blocks have beyond the picture's edges: no coefficient knows more of
it than the cells do. A sample of chroma that stands for several pixels is covered with any of them.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from dior.arrays import Bools, Floats
from dior.release import head_blur, jpeg, transform
from dior.release.transform import BLOCK

# what the samples are coded as differences from
MIDDLE = 128
# of a coefficient of 8-bit samples at the most: T.81, F.1.2, has no larger category
MOST = 1023
# chosen: a camera that adapts its quality has a few tables, and boxes stay for some pictures
TABLES, MASKS = 64, 64


@dataclass(frozen=True)
class Cover:
    """A box (u_min, v_min, u_max, v_max) px to cover: all of it (`whole`), or the ellipse in it."""

    box: tuple[float, float, float, float]
    whole: bool


# rows and columns of a component's blocks or samples
Place = tuple[slice, slice]


@dataclass(frozen=True, eq=False)
class _Mask:
    """Covers in the samples of a component that share blocks: the rectangle of `blocks` around them, of each cover in
    turn the part of its samples in the box and which of them are filled (`fills`), the blocks (r, c, 1) that these
    `touch`, and how many rows and columns of samples (`inside`) of the rectangle are in the picture."""

    blocks: Place
    fills: list[tuple[Place, Bools]]
    touch: Bools
    inside: tuple[int, int]


def covered(data: bytes, covers: Sequence[Cover], how: str) -> bytes | None:
    """The JPEG file with `covers`, one over the other; `how` as of `head_blur.cover`.

    None where that takes decoding the whole picture: the library is not there, or the file is damaged, or of a kind
    that `jpeg.frame_of` does not take. Raises ValueError for what is no JPEG file.
    """
    frame = jpeg.frame_of(data)
    if frame is None:
        return None
    # components that are alike are covered at once
    kinds: dict[tuple[tuple[int, int], tuple[int, ...]], list[int]] = {}
    for number, component in enumerate(frame.components):
        kinds.setdefault((frame.step(component), component.table), []).append(number)

    def change(components: list[NDArray[np.int16]]) -> None:
        for (step, table), numbers in kinds.items():
            for mask in _masks(tuple(covers), (frame.height, frame.width), step):
                _cover([components[number] for number in numbers], mask, table, how)

    return transform.changed(data, len(frame.components), change)


@lru_cache(MASKS)
def _masks(covers: tuple[Cover, ...], size: tuple[int, int], step: tuple[int, int]) -> list[_Mask]:
    """The masks of covers in a picture of `size` (height, width) px, in a component of which a sample stands for `step`
    (down, across) px. What shares blocks is one mask, for a block is encoded once."""
    found: list[tuple[Place, list[tuple[int, Place, Bools]]]] = []
    for number, cover in enumerate(covers):
        part, fill = _filled(cover, size, step)
        if not fill.size:
            continue
        blocks = _slices([(side.start // BLOCK, -(-side.stop // BLOCK)) for side in part])
        fills = [(number, part, fill)]
        while met := [one for one in found if _meet(one[0], blocks)]:
            for one in met:
                found.remove(one)
                fills += one[1]
                blocks = _slices(
                    [(min(a.start, b.start), max(a.stop, b.stop)) for a, b in zip(one[0], blocks, strict=True)]
                )
        found.append((blocks, fills))
    return [_mask(blocks, fills, size, step) for blocks, fills in found]


def _mask(blocks: Place, fills: list[tuple[int, Place, Bools]], size: tuple[int, int], step: tuple[int, int]) -> _Mask:
    """The mask of covers, with their numbers, by their samples in the whole component."""
    first = [side.start * BLOCK for side in blocks]
    down, across = (side.stop - side.start for side in blocks)
    own, filled = [], np.zeros((down * BLOCK, across * BLOCK), bool)
    for _, part, fill in sorted(fills, key=lambda one: one[0]):
        own.append((_slices([(side.start - at, side.stop - at) for side, at in zip(part, first, strict=True)]), fill))
        filled[own[-1][0]] |= fill
    touch = filled.reshape(down, BLOCK, across, BLOCK).any(axis=(1, 3))
    ends = [-(-side // by) - at for side, by, at in zip(size, step, first, strict=True)]
    return _Mask(blocks, own, np.asarray(touch)[..., None], (ends[0], ends[1]))


def _filled(cover: Cover, size: tuple[int, int], step: tuple[int, int]) -> tuple[Place, Bools]:
    """The samples of a component in a cover's box, and which of them it fills; none for one outside of the picture."""
    px = head_blur.inside(cover.box, *size)
    part = _slices([(side.start // by, -(-side.stop // by)) for side, by in zip(px, step, strict=True)])
    rows, columns = (np.arange(side.start * by, side.stop * by) for side, by in zip(part, step, strict=True))
    shape = len(rows) // step[0], len(columns) // step[1]
    if cover.whole or not all(shape):
        return part, np.ones(shape, bool)
    within = head_blur.ellipse(cover.box, rows, columns).reshape(shape[0], step[0], shape[1], step[1])
    return part, np.asarray(within.any(axis=(1, 3)))


def _slices(sides: Sequence[tuple[int, int]]) -> Place:
    return slice(*sides[0]), slice(*sides[1])


def _meet(one: Place, other: Place) -> bool:
    return all(a.start < b.stop and b.start < a.stop for a, b in zip(one, other, strict=True))


def _cover(components: list[NDArray[np.int16]], mask: _Mask, table: tuple[int, ...], how: str) -> None:
    """Cover what is in a mask, in the coefficients (R, C, 64) of components with this quantisation table, in place."""
    own = [blocks[mask.blocks] for blocks in components]
    # as a decoder shows them: what it does not show of a block is not passed on
    samples = np.rint(_samples(np.stack(own), table)).clip(-MIDDLE, MIDDLE - 1)
    for place, fill in mask.fills:
        part = samples[:, *place]
        instead = head_blur.GREY - MIDDLE if how == "filled" else head_blur.from_cells(part, how)
        np.copyto(part, instead, where=fill)
    # beyond the edges the recorder may have put anything, such as the edge's own samples
    rows, columns = mask.inside
    if rows < samples.shape[1]:
        samples[:, rows:] = samples[:, rows - 1 : rows]
    if columns < samples.shape[2]:
        samples[..., columns:] = samples[..., columns - 1 : columns]
    for blocks, again in zip(own, _quantised(samples, table), strict=True):
        np.copyto(blocks, again, where=mask.touch)


def coded(samples: NDArray[np.uint8] | Floats, table: tuple[int, ...]) -> Floats:
    """Samples (h, w) of a component, from the corner of a block on, as they are once they are encoded by a quantisation
    table."""
    high, wide = samples.shape
    whole = np.pad(samples.astype(float) - MIDDLE, ((0, -high % BLOCK), (0, -wide % BLOCK)), "edge")
    return _samples(_quantised(whole[None], table), table)[0, :high, :wide] + MIDDLE


def _samples(blocks: NDArray[np.int16], table: tuple[int, ...]) -> Floats:
    """The samples (N, 8 r, 8 c), less MIDDLE, of quantised coefficients (N, r, c, 64)."""
    count, down, across = blocks.shape[:3]
    found = blocks.reshape(-1, BLOCK**2).astype(np.float32) @ _bases(table)[0]
    found = found.reshape(count, down, across, BLOCK, BLOCK).swapaxes(2, 3)
    return found.reshape(count, down * BLOCK, across * BLOCK)


def _quantised(samples: Floats, table: tuple[int, ...]) -> NDArray[np.int16]:
    """The quantised coefficients (N, r, c, 64) of such samples."""
    count, down, across = len(samples), samples.shape[1] // BLOCK, samples.shape[2] // BLOCK
    blocks = samples.reshape(count, down, BLOCK, across, BLOCK).swapaxes(2, 3).reshape(-1, BLOCK**2)
    found = blocks @ _bases(table)[1]
    np.rint(found, out=found)
    return found.clip(-MOST, MOST, out=found).astype(np.int16).reshape(count, down, across, BLOCK**2)


@lru_cache(TABLES)
def _bases(table: tuple[int, ...]) -> tuple[Floats, Floats]:
    """(64, 64) each: what the quantised coefficients of a block are multiplied by for its samples, less MIDDLE, in
    rows, and what these are for the coefficients before rounding (T.81, A.3.3). `table`: in the file's order."""
    at = np.arange(BLOCK)
    waves = np.cos((2 * at + 1) * at[:, None] * np.pi / (2 * BLOCK)) / 2
    waves[0] /= np.sqrt(2)
    both = np.kron(waves, waves)
    steps = np.empty(BLOCK**2)
    steps[_zigzag()] = table
    return (both * steps[:, None]).astype(np.float32), (both / steps[:, None]).T.astype(np.float32)


def _zigzag() -> list[int]:
    """Where in the rows of a block the coefficients are that a file has one after the other (T.81, figure A.6)."""

    def order(at: int) -> tuple[int, int]:
        row, column = divmod(at, BLOCK)
        return row + column, row if (row + column) % 2 else column

    return sorted(range(BLOCK**2), key=order)
