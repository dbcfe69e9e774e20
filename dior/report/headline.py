"""How good the labels are, in one line for each kind of camera: how far nearly all of them are from the truth at most,
how that is known, and what nothing tells.

INPUTS   `label_quantiles` and the figures of the recordings, their lights
OUTPUT   `Line`s; nothing is drawn or written here
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from dior.arrays import AnyPath, Floats
from dior.errors import many
from dior.evaluate.label_errors import PARTS, pooled_quantile, radius
from dior.report.numbers import show
from dior.tables import tables

# (sequence, camera) -> metric -> (values in the middles of equal parts (PARTS,), number of labels)
Quantiles: TypeAlias = dict[tuple[str, str], dict[str, tuple[Floats, int]]]
SHARE = 0.95
# environment, role -> name of the kind of camera, in the order of the page
KINDS = {
    ("indoor", "close"): "indoors",
    ("outdoor", "close"): "outdoors, close",
    ("indoor", "long_range"): "indoors, long range",
    ("outdoor", "long_range"): "outdoors, long range",
}


@dataclass(frozen=True)
class Told:
    """A recording of a camera: its kind, (environment, role), its level of `lights.LEVELS` and figures by metric.

    `aside`: something draws its labels aside, which their sigmas do not know.
    """

    kind: tuple[str, str]
    level: str
    figures: Mapping[str, float]
    aside: bool = False


@dataclass(frozen=True)
class Line:
    """`name` of the kind, `within`: what 95 % of its labels are within, in px and at the person, "" where that is not
    known; `known`: how, and what was measured; `missing`: what nothing tells of some recordings."""

    name: str
    within: str
    at_person: str
    known: tuple[str, ...]
    missing: tuple[str, ...]


def read(paths: Iterable[AnyPath]) -> Quantiles:
    """`label_quantiles` by recording and metric."""
    found: Quantiles = {}
    for path in paths:
        table = tables.read(path, "label_quantiles")
        values, n = table["value"].reshape(-1, PARTS), table["n"].reshape(-1, PARTS)[:, 0]
        keys = (table[key].reshape(-1, PARTS)[:, 0].tolist() for key in ("sequence", "camera", "metric"))
        for (sequence, camera, metric), own, count in zip(zip(*keys, strict=True), values, n.tolist(), strict=True):
            found.setdefault((sequence, camera), {})[metric] = own, count
    return found


def lines(recordings: Mapping[tuple[str, str], Told], quantiles: Quantiles) -> list[Line]:
    """A `Line` for each kind of camera that there is.

    What is red or `aside` is left out: it is told how many recordings those are.
    """
    found = []
    for kind, name in KINDS.items():
        own = {key: told for key, told in recordings.items() if told.kind == kind and told.level != "none"}
        if own:
            found.append(_line(name, kind[1] == "long_range", own, quantiles))
    return found


def _line(name: str, far: bool, own: Mapping[tuple[str, str], Told], quantiles: Quantiles) -> Line:
    good = {key: told for key, told in own.items() if told.level != "bad" and not told.aside}
    px, n = _stacked(good, quantiles, "label_sigma")
    m, _ = _stacked(good, quantiles, "label_sigma_m")
    by_sigma = radius(px, n, SHARE)
    known, missing = [], []
    if np.isfinite(by_sigma):
        known.append("expected, by the labels' own sigmas")
    for metric, words in (
        ("error_to_truth_2d", "measured: 95 % within {} of the simulated truth"),
        ("check_error", "measured: 95 % within {} of the hand checks"),
    ):
        values, count = _stacked(good, quantiles, metric)
        if len(values):
            known.append(words.format(show(pooled_quantile(values, count, SHARE), "px")))
    shares = _in_boxes(own)
    if shares:
        known.append(shares)
    if wrong := len(own) - len(good):
        are = "is" if wrong == 1 else "are"
        missing.append(
            f"{many(wrong, 'recording')} with labels that are drawn aside, or red, {are} left out of these figures"
        )
    look = sum(told.level == "look" for told in good.values())
    if look:
        missing.append(f"{many(look, 'recording')} to look at {'is' if look == 1 else 'are'} in these figures")
    unknown = sum("label_sigma" not in quantiles.get(key, {}) for key in good)
    if unknown:
        missing.append(
            f"{many(unknown, 'recording')} of {len(own)} without a sigma: the camera's pose or clock has none"
        )
    checks = ("check_error", "in_box_share") if far else ("check_error", "reprojection_error")
    unchecked = sum(not set(checks) & set(told.figures) for told in own.values())
    if unchecked:
        by = "hand boxes" if far else "hand checks"
        theirs = "is" if unchecked == 1 else "are"
        only = f"{many(unchecked, 'recording')} {theirs} judged by what made the labels alone"
        missing.append(f"{only}; {by} would tell how far off they are")
    within = show(by_sigma, "px") if np.isfinite(by_sigma) else ""
    at_person = show(radius(m, n, SHARE), "m") if np.isfinite(by_sigma) and len(m) else ""
    return Line(name, within, at_person, tuple(known), tuple(missing))


def _stacked(keys: Iterable[tuple[str, str]], quantiles: Quantiles, metric: str) -> tuple[Floats, Sequence[int]]:
    """Values (R, PARTS) and numbers (R,) of the recordings that have the metric."""
    own = [quantiles[key][metric] for key in keys if metric in quantiles.get(key, {})]
    return np.array([values for values, _ in own]).reshape(-1, PARTS), [n for _, n in own]


def _in_boxes(own: Mapping[tuple[str, str], Told]) -> str:
    """How many labels are in the most independent boxes that there are, against perfect ones."""
    for kind, words in (
        ("left_out", "boxes left out of the fit"),
        ("held_back", "boxes kept back"),
        ("in_box", "hand boxes"),
    ):
        each = [
            (told.figures[f"{kind}_share"], told.figures[f"{kind}_expected"])
            for told in own.values()
            if f"{kind}_share" in told.figures and f"{kind}_expected" in told.figures
        ]
        if each:
            share, expected = np.mean(each, axis=0)
            return f"{100 * share:.0f} % in the {words}, where perfect labels score {100 * expected:.0f} %"
    return ""
