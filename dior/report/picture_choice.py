"""Which pictures of a camera the report shows: the best, the median and the worst by what can be measured.

INPUTS   labels of a camera, its role, and where there are any its detections, swaps and hand boxes
OUTPUTS  frame numbers and for each a word and its figure; evenly spread ones where nothing can be measured
"""

from collections.abc import Callable

import numpy as np

from dior.arrays import Floats, Ints, Table
from dior.evaluate import reprojection
from dior.evaluate.grids import LabelGrid
from dior.report.numbers import show


def measured(
    grid: LabelGrid,
    role: str,
    detections: Table | None,
    exchanged: Table | None,
    inside: Floats | None,
    min_score: float,
) -> tuple[Floats, Callable[[float], str]] | None:
    """How bad (F,) each frame of the labels is, NaN where unknown, and a function from that to words; or None.

    A close camera: mean distance of the labels from its own detections, px, with the sides of the frames `exchanged`
    put right. A long-range one: share of the labels that are not `inside` the hand box, 1 or 0 (F, J), None without.
    """
    with np.errstate(invalid="ignore"):
        if role == "long_range" and inside is not None:
            return 1 - _mean(inside), lambda bad: f"{show(1 - bad, 'share')} in the box"
        if role == "close" and detections is not None and reprojection.comparable(grid, detections):
            errors = reprojection.errors(grid, detections, min_score, exchanged)
            return _mean(errors), lambda bad: f"{show(bad, 'px')} from the detections"
    return None


def _mean(values: Floats) -> Floats:
    """Mean (F,) of what is known in values (F, J), NaN where nothing is."""
    known = np.isfinite(values)
    count = known.sum(axis=1)
    return np.where(count > 0, np.where(known, values, 0.0).sum(axis=1) / np.maximum(count, 1), np.nan)


def by_rank(frames: Ints, bad: Floats, in_words: Callable[[float], str], count: int) -> list[tuple[int, str]]:
    """`count` (frame, words) pairs of the frames (F,), from the best to the worst by `bad` (F,), evenly by rank."""
    known = np.flatnonzero(np.isfinite(bad))
    order = known[np.lexsort((frames[known], bad[known]))]
    ranks = np.unique(np.round(np.linspace(0, len(order) - 1, min(count, len(order)))).astype(int))
    return [
        (int(frames[i]), f"{_word(rank, len(order))}{in_words(bad[i])}")
        for rank, i in zip(ranks, order[ranks], strict=True)
    ]


def _word(rank: int, count: int) -> str:
    if count == 1:
        return ""
    named = {0: "best: ", count - 1: "worst: ", round((count - 1) / 2): "median: "}
    return named.get(rank, f"{rank / (count - 1):.0%} are better: ")


def spread(frames: Ints, count: int) -> list[tuple[int, str]]:
    """`count` (frame, "") pairs of the frame numbers `frames` (F,), at the middles of equal parts."""
    count = min(count, len(frames))
    middles = ((np.arange(count) + 0.5) * len(frames) / max(count, 1)).astype(int)
    return [(int(frame), "") for frame in np.asarray(frames)[middles]]
