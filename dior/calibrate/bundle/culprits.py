"""Why an adjustment came to nothing: two cameras whose detections were exchanged, one whose detections are others', or
clocks that are further off than they are searched.

INPUTS   placed cameras, what they have of the window's sequences, an adjustment to a sample of it
OUTPUTS  a sentence that names them, or nothing

An adjustment moves innocent cameras to make up for exchanged detections, so that what it says of them is no use. It is
tried again with each exchange, and without each camera; what is right ends at the errors of a detector, and leaves the
cameras where they were measured: in a rig that is nearly even, two exchanges are nearly a turn of the world.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import TypeAlias

import numpy as np

from dior.arrays import Floats
from dior.calibrate.bundle import starts
from dior.calibrate.bundle.in_adjustment import Sequences
from dior.errors import DiorError
from dior.geometry.camera import Camera
from dior.geometry.culprit import AGREE_PX, ALIKE, EXPLAINS

# the cost (px at fx 1680, `starts.cost`) of an adjustment of the cameras (V,) of these indices to a sample of their
# detections, and by how much they left the places that were measured (squared, in their sigma, summed); raises
# DiorError where there is none
Cost: TypeAlias = Callable[[Sequence[int], Sequences], tuple[float, float]]
# chosen: cameras that leave their places by so much more than the best ones, or than measuring errs, squared and in
# sigmas, are in another world
STRAINED = 12.0


@dataclass(frozen=True)
class Tried:
    """The adjustment with a change: what it ends with (`Cost`), the cameras' indices, and the sequence's, None for all
    of them."""

    cost_px: float
    strain: float
    cameras: tuple[int, ...]
    sequence: int | None = None


def sentence(cameras: Sequence[Camera], timed: Sequences, sequences: Sequence[str], cost: Cost) -> str:
    """What the detections of which cameras are, or ""; `sequences` of the window by name."""
    views = range(len(cameras))
    given, _ = _cost(cost, views, timed)
    which: list[int | None] = [None] if len(sequences) == 1 else [None, *range(len(sequences))]
    tried = [
        Tried(*_cost(cost, views, exchanged(timed, pair, only)), pair, only)
        for only in which
        for pair in combinations(views, 2)
    ]
    kind = "exchanged"
    usual = 3.0 * len(cameras)
    found = _best(tried, given, usual)
    if not found and len(views) > 2:
        kind = "others"
        rest = [[i for i in views if i != view] for view in views]
        tried = [Tried(*_cost(cost, kept, timed), (view,)) for view, kept in zip(views, rest, strict=True)]
        found = _best(tried, given, usual)
    if not found:
        return ""
    names = [camera.name for camera in cameras]
    ways = " or ".join(_words(one, names, sequences, kind) for one in found)
    ends = ", ".join(f"{one.cost_px:.1f}" for one in found)
    return (
        f"{ways}: the adjustment of a sample then ends at {ends} px instead of {given:.1f} px (at fx 1680)"
        + ("" if len(found) == 1 else ", so that it cannot be told which")
        + "; look at their files of detections first"
    )


def far_off(timed: Sequences, sequences: Sequence[str], cost: Cost, start: Callable[[Sequences], Floats]) -> str:
    """Which clocks are further off than they are searched, or ""; `start`: the clocks (S, V, 2) that an adjustment
    starts with."""
    wide, views = timed.searched_far(), range(len(timed.names))
    values, (given, strain), usual = start(wide), _cost(cost, views, timed), 3.0 * len(views)
    found = [
        (sequence, name, values[i, v, 0], own.most_s)
        for i, sequence in enumerate(sequences)
        for v, (name, own) in enumerate(zip(timed.names, timed.recorded[i].seen, strict=True))
        if abs(values[i, v, 0]) > own.most_s and not timed.held[i, v]
    ]
    tried = Tried(*_cost(cost, views, wide), ())
    # where other people are among the detections, the cameras' places tell more than what they end at
    placed = tried.cost_px <= min(given, AGREE_PX) and tried.strain <= usual + STRAINED < strain
    if not found or not (placed or _best([tried], given, usual)):
        return ""
    each = ", ".join(f"{name} in {sequence} {late_s:+.1f} s" for sequence, name, late_s, _ in found)
    return (
        f"clocks are further off that of {timed.names[timed.reference]} than the {max(one[3] for one in found):.1f} s "
        f"that are searched, {each}: the adjustment of a sample then ends at {tried.cost_px:.1f} px instead of "
        f"{given:.1f} px (at fx 1680); give what they are as offset_s in config/offsets/{found[0][0]}.yaml"
    )


def exchanged(timed: Sequences, pair: tuple[int, int], only: int | None = None) -> Sequences:
    """With the detections of two cameras in each other's place, frame by frame; in one sequence `only`, or in all."""
    a, b = pair
    recorded = []
    for i, own in enumerate(timed.recorded):
        seen = list(own.seen)
        if only is None or i == only:
            seen[a], seen[b] = own.seen[a].with_pixels(own.seen[b].uv), own.seen[b].with_pixels(own.seen[a].uv)
        recorded.append(replace(own, seen=tuple(seen)))
    return replace(timed, recorded=tuple(recorded))


def without(timed: Sequences, kept: Sequence[int]) -> Sequences:
    """Of the cameras `kept` only; the first of these by name is the time axis of the others."""
    names = tuple(timed.names[i] for i in kept)
    held = timed.held[:, kept].copy()
    held[:, names.index(min(names))] = True
    recorded = tuple(replace(own, seen=tuple(own.seen[i] for i in kept)) for own in timed.recorded)
    return replace(timed, recorded=recorded, names=names, given=timed.given[:, kept], held=held)


def _cost(cost: Cost, views: Sequence[int], timed: Sequences) -> tuple[float, float]:
    try:
        return cost(views, timed if len(views) == len(timed.names) else without(timed, views))
    except (DiorError, np.linalg.LinAlgError):
        return starts.CAPPED_PX, np.inf


def _best(tried: Sequence[Tried], given: float, usual: float) -> list[Tried]:
    """Those that end at the errors of a detector, far below what was given, and at the measured places, where
    measuring strains them by `usual`; the best first."""
    limit = min(AGREE_PX, given / EXPLAINS, ALIKE * min(one.cost_px for one in tried))
    good = [one for one in tried if one.cost_px <= limit and one.strain <= usual + STRAINED]
    least = min((one.strain for one in good), default=0.0)
    return sorted((one for one in good if one.strain <= least + STRAINED), key=lambda one: one.cost_px)


def _words(one: Tried, names: Sequence[str], sequences: Sequence[str], kind: str) -> str:
    of = f" of {sequences[one.sequence]}" if one.sequence is not None else ""
    if kind == "exchanged":
        a, b = (names[i] for i in one.cameras)
        return f"the detections{of} of {a} and {b} are exchanged"
    return f"the detections of {names[one.cameras[0]]} are not of what the other cameras see, or its place is wrong"
