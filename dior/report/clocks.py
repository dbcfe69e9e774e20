"""The cameras' clocks for the report: what each is, how well that is known, and how well other lags fit.

INPUTS   `offsets` and `clock_costs` tables of the sequences, findings
OUTPUTS  a `SequenceClocks` per sequence: rows of text and numbers to draw; SVG files. Same numbers, same bytes.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from dior.arrays import AnyPath, Floats
from dior.clocks.clock import NORMAL_95
from dior.report.colours import GREY, RED, colours_of
from dior.report.facts import Clock
from dior.report.lights import Finding
from dior.report.numbers import show
from dior.report.svg import legend, new_figure, save_svg
from dior.tables import tables

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# camera -> its clock
Known: TypeAlias = Mapping[str, Clock]
# a row of table `offsets`
Row: TypeAlias = dict[str, Any]
# lags (L,) ms and what each costs (L,) px
Curve: TypeAlias = tuple[Floats, Floats]
# where a clock comes from, where that is not the word of table `offsets`
WORDS = {"cameras": "other cameras", "boxes": "hand boxes", "manual": "by hand", "assumed_zero": "not known"}
DOUBTED = ("clock_unknown", "clock_contradicts", "clock_off", "marks_clock")
NOTHING = "\u2013"
# what the lower panel shows beyond the clocks, and how far it goes to show them; chosen: some pictures at 30 Hz
ZOOM_MS, WINDOW_MS = 120.0, 2000.0
# chosen: more names than this below a figure overlap
MOST_NAMES = 12
HEIGHT = 4.6  # inches
# ticks of a decade
STEPS = (1, 2, 3, 5, 7)


@dataclass(frozen=True, eq=False)
class SequenceClocks:
    """`clocks`: camera -> its `Clock`;
    `costs`: camera -> (lags (L,) ms, costs (L,) px); `rows`: what the page's table shows, a dict per camera; `notes`:
    (camera, text) of clocks that are not simply estimated.
    """

    clocks: dict[str, Clock]
    costs: dict[str, Curve]
    rows: tuple[dict[str, str], ...]
    notes: tuple[tuple[str, str], ...]


def read(
    sequence: str,
    cameras: Iterable[str],
    offsets: Iterable[AnyPath],
    costs: Iterable[AnyPath],
    findings: Iterable[Finding],
) -> SequenceClocks | None:
    """`SequenceClocks` of a sequence, its `cameras` in the order of the page; None where no clock is told.

    `offsets`, `costs`: files of those tables, of costs an earlier file goes first; `findings`: (scope, severity, code,
    text).
    """
    tried: dict[str, Curve] = {}
    for path in costs:
        table = tables.read(path, "clock_costs")
        of_sequence = tables.rows(table, table["sequence"] == sequence)
        for camera in tables.ordered_unique(of_sequence["camera"]):
            own = tables.of_camera(of_sequence, camera)
            tried.setdefault(camera, (1e3 * own["lag_s"], own["cost_px"]))
    said: dict[str, list[str]] = {}
    for scope, _, code, text in findings:
        if code in DOUBTED and text not in said.setdefault(scope, []):
            said[scope].append(text)
    known: dict[str, Row] = {}
    for path in offsets:
        table = tables.read(path, "offsets")
        for i, (name, camera) in enumerate(zip(table["sequence"], table["camera"], strict=True)):
            if name == sequence:
                known[camera] = {key: values[i] for key, values in table.items()}
    clocks = {camera: known[camera] for camera in cameras if camera in known}
    return _of_sequence(sequence, clocks, tried, said) if clocks else None


def _of_sequence(
    sequence: str, clocks: Mapping[str, Row], tried: Mapping[str, Curve], said: Mapping[str, list[str]]
) -> SequenceClocks:
    costs = {c: tried[c] for c in clocks if c in tried}
    doubts = {c: said.get(f"{sequence}/{c}", []) for c in clocks}
    notes = []
    for camera, one in clocks.items():
        by_hand = [f"given in config/offsets/{sequence}.yaml"] if one["source"] == "manual" else []
        notes += [(camera, "; ".join(by_hand + doubts[camera]))] if by_hand + doubts[camera] else []
    return SequenceClocks(
        {c: _clock(one) for c, one in clocks.items()},
        costs,
        tuple(_row(one, costs.get(c), bool(doubts[c])) for c, one in clocks.items()),
        tuple(notes),
    )


def _clock(one: Row) -> Clock:
    late, low, high = (1e3 * float(one[key]) for key in ("late_s", "late_low", "late_high"))
    return late, low, high, str(one["source"])


def _row(one: Row, costs: Curve | None, doubted: bool) -> dict[str, str]:
    unknown = one["source"] == "assumed_zero"
    zero = unknown or one["source"] == "reference"
    half, given = NORMAL_95 * 1e3 * one["late_sigma_s"], NORMAL_95 * 1e3 * one["given_sigma_s"]
    source = one["method"] if one["source"] == "estimated" else one["source"]
    return {
        "camera": one["camera"],
        "offset": "0" if zero else _signed(1e3 * one["late_s"], 1),
        "interval": "unknown" if unknown else NOTHING if zero else _interval(one, half),
        # what is left of it where the poses are not doubted, if that is less
        "given": f"as placed ±{given:.1f}" if given < 0.9 * half else "",
        "drift": NOTHING if zero else _drift(one["drift_ppm"], NORMAL_95 * one["sigma_drift_ppm"]),
        "residual": _residual(*costs, 1e3 * one["late_s"], zero) if costs else NOTHING,
        "source": WORDS.get(source, source),
        "light": "look" if unknown or doubted else "none" if one["source"] == "manual" else "",
    }


def _signed(value: float, digits: int) -> str:
    # adding zero takes the sign from -0
    return f"{round(value, digits) + 0.0:+.{digits}f}"


def _drift(value: float, half: float) -> str:
    return _signed(value, 0) + (f" ±{half:.0f}" if half > 0 else "")


def _residual(lags: Floats, costs: Floats, offset: float, zero: bool) -> str:
    """Without the offset and with it; only the first where there is none."""
    values = [at(lags, costs, 0.0)] if zero else [at(lags, costs, 0.0), at(lags, costs, offset)]
    return " \u2192 ".join(show(v, "px").removesuffix(" px") if np.isfinite(v) else NOTHING for v in values)


def _interval(one: Row, half: float) -> str:
    if not np.isfinite(half):
        return "unknown"
    return f"{1e3 * one['late_low']:.1f} to {1e3 * one['late_high']:.1f}" if half else "taken as exact"


def at(lags: Floats, costs: Floats, lag: float) -> float:
    """The cost at the lag nearest to `lag`; NaN where none that was tried is within a step of it."""
    if len(lags) < 2:
        return np.nan
    i = int(np.abs(lags - lag).argmin())
    return float(costs[i]) if abs(lags[i] - lag) <= abs(lags[1] - lags[0]) else np.nan


def costs(path: Path, clocked: SequenceClocks) -> None:
    """Costs over all lags that were tried and, below, near the clocks; these are marked with their intervals."""
    colours = colours_of(clocked.clocks)
    # there is one of these per sequence: fixed margins take half the time of those that are found by drawing
    figure, axes = new_figure(2, 1, height=HEIGHT, layout="none")
    rows = -(-len(colours) // 4)
    figure.subplots_adjust(left=0.115, right=0.985, bottom=0.1, top=1 - (0.3 + 0.22 * rows) / HEIGHT, hspace=0.33)
    for camera, (lags, cost) in clocked.costs.items():
        height = np.log10(np.where(cost > 0, cost, np.nan))
        for axis, mark in zip(axes, ("", "."), strict=True):
            axis.plot(lags, height, color=colours[camera], lw=1.2, marker=mark, ms=4)
    marked = {c: one for c, one in clocked.clocks.items() if one[3] in ("estimated", "manual")}
    for camera, (offset, low, high, source) in marked.items():
        for axis in axes:
            axis.axvline(offset, color=colours[camera], lw=1.1, ls=(0, (2, 2)) if source == "manual" else "-")
        if np.isfinite([low, high]).all():
            axes[1].axvspan(low, high, color=colours[camera], alpha=0.18, lw=0)
    ends = np.array([one[:3] for one in marked.values()] or [(0.0, 0.0, 0.0)])
    near = (max(np.nanmin(ends), -WINDOW_MS) - ZOOM_MS, min(np.nanmax(ends), WINDOW_MS) + ZOOM_MS)
    axes[1].set_xlim(near)
    for axis, (low, high) in zip(axes, ((-np.inf, np.inf), near), strict=True):
        shown = [cost[(lags >= low) & (lags <= high) & (cost > 0)] for lags, cost in clocked.costs.values()]
        _decades(axis, np.concatenate(shown) if shown else np.zeros(0))
        axis.set_ylabel("residual, px")
    axes[0].set_title("all offsets that were tried", fontsize=9)
    axes[1].set_title("near the clocks (lines; bands are 95 % intervals)", fontsize=9)
    axes[1].set_xlabel("offset, ms")
    handles = [axes[0].plot([], [], "o", color=colour)[0] for colour in colours.values()]
    figure.legend(handles, list(colours), loc="upper left", ncols=4, handletextpad=0.2, columnspacing=1.2)
    save_svg(figure, path)


def _decades(axis: "Axes", values: Floats) -> None:
    """Ticks and limits of an axis of log10 of `values`; Matplotlib's own logarithmic scale is slower."""
    if not len(values):
        return
    low, high = np.log10([values.min() / 1.15, values.max() * 1.15])
    ticks = [step * 10.0**k for k in range(int(np.floor(low)), int(np.ceil(high)) + 1) for step in STEPS]
    ticks = [tick for tick in ticks if low <= np.log10(tick) <= high]
    axis.set_yticks(np.log10(ticks), [f"{tick:g}" for tick in ticks])
    axis.set_ylim(low, high)


def overview(path: Path, groups: Mapping[str, Mapping[str, Known]]) -> None:
    """Clocks of all recordings in their order. `groups`: environment ("indoor", "outdoor") -> sequence ->
    `Known`.

    Indoors the motion capture starts when it likes, so the cameras' median is drawn by itself and the cameras from it.
    """
    panels: list[tuple[str, str, dict[str, float], Mapping[str, Known] | None]] = []
    for environment, by_sequence in groups.items():
        middles = {name: middle(clocked) if environment == "indoor" else 0.0 for name, clocked in by_sequence.items()}
        if environment == "indoor":
            panels.append(("indoor: median of the cameras against the motion capture", "offset, ms", middles, None))
            panels.append(("indoor: each camera from that median", "ms", middles, by_sequence))
        else:
            panels.append((f"{environment}: against the first close camera", "offset, ms", middles, by_sequence))
    colours = colours_of(dict.fromkeys(c for own in groups.values() for clocked in own.values() for c in clocked))
    figure, axes = new_figure(len(panels), 1, height=0.5 + 1.75 * len(panels), squeeze=False)
    for axis, (title, label, middles, of_cameras) in zip(axes[:, 0], panels, strict=True):
        axis.set_title(title, fontsize=9)
        axis.set_ylabel(label)
        if of_cameras is None:
            axis.plot(range(len(middles)), list(middles.values()), "o", color=GREY, ms=5)
            axis.margins(y=0.15)
        else:
            _cameras(axis, middles, of_cameras, colours)
        many = len(middles) > MOST_NAMES
        axis.set_xticks([] if many else range(len(middles)), [] if many else list(middles), fontsize=8)
        axis.set_xlim(-0.6, len(middles) - 0.4)
        axis.grid(axis="x", visible=False)
        if many:
            axis.set_xlabel(f"{len(middles)} recordings in their order", fontsize=9)
    legend(figure, colours)
    save_svg(figure, path)


def _cameras(
    axis: "Axes", middles: Mapping[str, float], by_sequence: Mapping[str, Known], colours: Mapping[str, str]
) -> None:
    """A mark per camera beside the others of its recording: round, square if given by hand, a cross if not known."""
    axis.axhline(0, color=GREY, lw=1, zorder=0)
    for i, (camera, colour) in enumerate(colours.items()):
        place = 0.7 * ((i + 0.5) / len(colours) - 0.5)
        of_camera = [
            (nth + place, clocked[camera], middles[name])
            for nth, (name, clocked) in enumerate(by_sequence.items())
            if camera in clocked and clocked[camera][3] != "reference"
        ]
        for mark, source in (("o", "estimated"), ("s", "manual")):
            own = [(x, *(value - middle for value in one[:3])) for x, one, middle in of_camera if one[3] == source]
            if own:
                x, value, low, high = np.array(own).T
                axis.vlines(x, low, high, color=colour, lw=1)
                axis.plot(x, value, mark, ms=4, color=colour)
        lost = [x for x, one, _ in of_camera if one[3] == "assumed_zero"]
        axis.plot(lost, np.zeros(len(lost)), "x", ms=6, mew=1.6, color=RED)


def middle(clocked: Known) -> float:
    """Median offset, ms, of the clocks of a sequence that are known; NaN without any."""
    known = _known(clocked)
    return float(np.median(known)) if known else np.nan


def in_words(by_sequence: Mapping[str, Known]) -> str:
    """How many clocks there are, how well they are known and how far apart, in one sentence."""
    clocks = [one for clocked in by_sequence.values() for one in clocked.values()]
    counts = {source: sum(one[3] == source for one in clocks) for source in ("estimated", "manual", "assumed_zero")}
    words = [f"{counts['estimated']} clocks are estimated"]
    words += [f"{counts['manual']} given by hand"] if counts["manual"] else []
    words += [f"{counts['assumed_zero']} not known and taken as 0"] if counts["assumed_zero"] else []
    text = ", ".join(words)
    half = [(high - low) / 2 for _, low, high, source in clocks if source == "estimated" and np.isfinite(high - low)]
    if half:
        text += f", with 95 % intervals of ±{np.median(half):.1f} ms (median; widest ±{max(half):.1f})"
    apart = max(map(least_apart, by_sequence.values()), default=0.0)
    if apart >= 1:
        text += f"; in the recording where they differ most, two are at least {apart:.0f} ms apart"
    return f"{text}."


def least_apart(clocked: Known) -> float:
    """How far apart, ms, two clocks of a recording are at least, by their 95 % intervals."""
    ends = np.array([one[1:3] for one in clocked.values() if np.isfinite(one[1:3]).all()])
    return max(0.0, float(ends[:, 0].max() - ends[:, 1].min())) if len(ends) else 0.0


def _known(clocked: Known) -> list[float]:
    return [offset for offset, _, _, source in clocked.values() if source != "assumed_zero"]
