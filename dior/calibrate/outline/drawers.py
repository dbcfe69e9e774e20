"""What several people have drawn apart: by how much an edge is further out in every box of one of them.

INPUTS   boxes of each drawer, by frame. OUTPUTS: the mean difference of their middles; the habit that follows; findings

Who draws more air above the head than below the feet, in every box, tilts the camera, and left against right turns it
(`seen_edges.Freedom`): no number of his boxes tells it, another person's do. If both draw each edge further out by the
habit h (sd), the middles of their boxes lie apart by h (sd) in each axis. So the prior of h, `align.habit_px`, and each
other drawer's two differences give an estimate of h; the prior counts as much as one other drawer, since two numbers
alone would often be small by chance. Recorded px.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np

from dior.arrays import Floats
from dior.project.boxes import NONE, Boxes

FEWEST = 4  # chosen: pictures that both have drawn, below which their difference says little of a habit
PRIOR_COUNTS = 2  # chosen: squares that `habit_px` counts as; each other drawer has one in u and one in v
FAR = 3.0  # sd of what the prior expects: 0.3 % of drawers who draw the same thing are further apart
# sequence by sequence, the boxes of each drawer
Drawn = Iterable[Mapping[str, Boxes]]


@dataclass(frozen=True, eq=False)
class Apart:
    """Of K pairs of drawers, by `names` of the second one: the middle of the box minus that of the first one's, `mean`
    (K, 2) px in u and v over `count` (K,) pictures, with its standard error `sigma` (K, 2)."""

    names: tuple[str, ...] = ()
    mean: Floats = field(default_factory=lambda: np.zeros((0, 2)))
    sigma: Floats = field(default_factory=lambda: np.zeros((0, 2)))
    count: tuple[int, ...] = ()


def apart(drawn: Drawn) -> Apart:
    """`Apart` by the pictures that another drawer and the one whose boxes are used have both drawn."""
    steps: dict[tuple[str, str], list[Floats]] = {}
    for by_drawer in drawn:
        used, *others = by_drawer or [""]
        frames, edges = by_drawer.get(used, NONE)
        for name in others:
            _, mine, theirs = np.intersect1d(frames, by_drawer[name][0], return_indices=True)
            step = by_drawer[name][1][theirs] - edges[mine]
            middle = (step[:, :2] + step[:, 2:]) / 2
            # who is the other in one walk may be the one whose boxes are used in the next: still one difference
            if (name, used) in steps:
                steps[name, used].append(-middle)
            else:
                steps.setdefault((used, name), []).append(middle)
    each = {pair: np.concatenate(parts) for pair, parts in steps.items()}
    each = {pair: step for pair, step in each.items() if len(step) >= FEWEST}
    if not each:
        return Apart()
    return Apart(
        tuple(name for _, name in each),
        np.array([step.mean(axis=0) for step in each.values()]),
        np.array([step.std(axis=0, ddof=1) / np.sqrt(len(step)) for step in each.values()]),
        tuple(len(step) for step in each.values()),
    )


def habit(prior_px: float, found: Apart) -> float:
    """Standard deviation (px) of what an edge is drawn further out in every box, by `prior_px` and what is found."""
    squares = np.maximum(found.mean**2 - found.sigma**2, 0.0)
    return float(np.sqrt((PRIOR_COUNTS * prior_px**2 + squares.sum()) / (PRIOR_COUNTS + squares.size)))


def findings(scope: str, found: Apart, prior_px: float, habit_px: float) -> list[tuple[str, str, str, str]]:
    """(scope, severity, code, text) of each other drawer."""
    out = []
    for name, mean, sigma, count in zip(found.names, found.mean, found.sigma, found.count, strict=True):
        text = (
            f"the boxes of another drawer lie {mean[0]:+.2f} ± {1.96 * sigma[0]:.2f} px to the right and "
            f"{mean[1]:+.2f} ± {1.96 * sigma[1]:.2f} px below in {count} pictures that both drew (± is a 95 % interval)"
        )
        if (np.abs(mean) > FAR * np.hypot(prior_px, sigma)).any():
            text += f", further than a habit of {prior_px:g} px explains; are both drawn around the same person?"
            out.append((scope, "warning", "drawers_differ", f"{text} (drawer {name})"))
        else:
            text += f"; an edge is taken as further out in every box by {habit_px:.2f} px, where {prior_px:g} was given"
            out.append((scope, "info", "drawers_compared", f"{text} (drawer {name})"))
    return out
