"""The figures of one sequence over time, each a function from numbers to an SVG file. Same numbers, same bytes.

There is one of each per sequence: fixed margins take half the time of those that are found by drawing.
"""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dior.arrays import Floats
from dior.report.colours import COLOURS, DARK, GRID, RED, colours_of
from dior.report.gait import Lane
from dior.report.svg import WIDTH, new_figure, save_svg, short
from dior.tables.words import DROP_REASON

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


# inches: room for a title above axes and for the time below them
TITLE, TIME = 0.27, 0.5
# steps without a value over which no line is drawn; chosen: a few pictures that are lost leave the line whole
GAP = 5
# inches left of axes: at least for the numbers of the upper ones and their label
LEFT = 0.66


def _panels(heights: list[float], above: float, words: list[str], letter: float) -> "tuple[Figure, list[Axes]]":
    """Axes of `heights`, inches, below each other on one axis of time, `above` inches below the figure's upper edge.

    `words`: what stands left of the lowest axes, `letter` inches a letter.
    """
    height = above + sum(heights) + TITLE * (len(heights) - 1) + TIME
    figure, axes = new_figure(
        len(heights), 1, height, layout="none", sharex=True, squeeze=False, gridspec_kw={"height_ratios": heights}
    )
    figure.subplots_adjust(
        left=max(LEFT, 0.12 + letter * max(map(len, words), default=0)) / WIDTH, right=0.985,
        top=1 - above / height, bottom=TIME / height, hspace=TITLE * len(heights) / sum(heights),
    )  # fmt: skip
    return figure, list(axes[:, 0])


def _legend(words: Iterable[str]) -> tuple[int, float]:
    """How many columns of a legend of `words` the figure has room for, and how much room all of it takes, inches."""
    names = list(words)
    columns = max(1, min(4, int(WIDTH / (0.45 + 0.075 * max(map(len, names), default=0)))))
    return columns, 0.14 + 0.21 * -(-len(names) // columns)


def timeline(
    path: Path,
    lanes: Mapping[str, tuple[Floats, Floats, Floats]],
    errors: Mapping[str, tuple[Floats, Floats]],
    label: str,
) -> None:
    """Errors over time, and below a lane per camera: joints without a label, and pictures lost in the recording.

    `lanes`: camera -> (t (F,) s, missing (F,) share, lost (L,) s); `errors`: camera -> (t (N,) s, value (N,)); `label`
    names the error with its unit.
    """
    names = list(lanes)
    colours = colours_of(names)
    with_errors = any(len(t) for t, _ in errors.values())
    counts = [f"{name}\n{short(len(lanes[name][0]))} pictures" for name in reversed(names)]
    columns, room = _legend(errors)
    figure, axes = _panels(
        ([1.35] if with_errors else []) + [0.1 + 0.3 * len(names)],
        above=room if with_errors else TITLE,
        words=[line for count in counts for line in count.split("\n")],
        letter=0.062,
    )
    if with_errors:
        axis = axes[0]
        for name, (t, value) in errors.items():
            axis.plot(*_broken(*_binned(t, value)), color=colours[name], lw=1.2, label=name)
        axis.set_ylim(0, None)
        axis.set_ylabel(label)
    axis = axes[-1]
    for row, (name, (t, missing, lost)) in enumerate(reversed([*lanes.items()])):
        axis.axhline(row, color=GRID, lw=0.8)
        times, share = _binned(t, missing)
        axis.fill_between(times, row, row + 0.8 * share, color=colours[name], lw=0, step="mid")
        axis.plot(lost, np.full(len(lost), row - 0.12), "|", color=RED, ms=5, mew=1)
    axis.set_yticks(np.arange(len(names)) + 0.3, counts, fontsize=8)
    axis.set_ylim(-0.3, len(names))
    axis.grid(axis="y", visible=False)
    axis.set_title("joints without a label; red: lost pictures", fontsize=9)
    axis.set_xlabel("time, s")
    if with_errors:
        figure.legend(*axes[0].get_legend_handles_labels(), loc="upper left", ncols=columns, handlelength=1.2)
    save_svg(figure, path)


def stamps(
    path: Path, lags: Mapping[str, tuple[Floats, Floats]], dropped: Mapping[str, Mapping[str, list[float]]]
) -> None:
    """How late pictures were received, and which are missing or there twice.

    `lags`: camera -> (times (F,) s, lag beyond its median (F,) ms); `dropped`: camera -> reason -> times s.
    """
    colours = colours_of(list(lags))
    # the same colour for a reason in every plot
    there = {reason for by_reason in dropped.values() for reason in by_reason}
    kinds = {reason: colour for reason, colour in colours_of(DROP_REASON).items() if reason in there}
    columns, room = _legend([*lags, *kinds])
    figure, axes = _panels([1.2, 0.1 + 0.25 * len(lags)], above=TITLE + room, words=list(lags), letter=0.08)
    for camera, (t, lag) in lags.items():
        edges = np.unique(np.linspace(0, len(t), 401).astype(int))[:-1]
        axes[0].plot(t[edges], np.maximum.reduceat(lag, edges), color=colours[camera], lw=1, label=camera)
    axes[0].set_ylabel("late, ms")
    axes[0].set_title("receive minus header stamp, beyond its median", fontsize=9)
    for lane, camera in enumerate(lags):
        for reason, times in sorted(dropped.get(camera, {}).items()):
            axes[1].plot(times, np.full(len(times), lane), "|", ms=9, mew=1.4, color=kinds[reason])
    for reason, colour in kinds.items():
        axes[1].plot([], [], "|", ms=9, mew=1.4, color=colour, label=reason.replace("_", " "))
    axes[1].set_yticks(range(len(lags)), list(lags))
    axes[1].set_ylim(len(lags) - 0.4, -0.6)
    axes[1].set_xlabel("time, s")
    axes[1].set_title("missing and repeated pictures" if kinds else "no picture is missing or there twice", fontsize=9)
    figure.legend(loc="upper left", ncols=columns, handlelength=1.2)
    save_svg(figure, path)


def gait(path: Path, lanes: Mapping[str, Lane], span: tuple[float, float]) -> None:
    """When each foot stood: bars from strike to toe off, pale where no parameter is made of them, and the 95 %
    intervals of the events.

    `lanes`: `Lane` by foot; `span`: from when to when, s.
    """
    colours = dict(zip(lanes, COLOURS, strict=False))
    figure, (axis,) = _panels([0.15 + 0.42 * len(lanes)], above=0.1, words=list(lanes), letter=0.08)
    for row, (foot, lane) in enumerate(reversed([*lanes.items()])):
        axis.axhline(row, color=GRID, lw=0.8, zorder=0)
        for stances, alpha in ((lane.used, 0.75), (lane.left_out, 0.25)):
            shown = stances[(stances[:, 1] > span[0]) & (stances[:, 0] < span[1])]
            bars = [(first, last - first) for first, last in shown.tolist()]
            axis.broken_barh(bars, (row - 0.2, 0.4), color=colours[foot], alpha=alpha, lw=0, zorder=2)
        inside = (lane.seconds >= span[0]) & (lane.seconds <= span[1])
        # strikes below the bar's middle, toe offs above it: where intervals are wide both can be seen
        at = np.where(lane.strike[inside], row - 0.1, row + 0.1)
        axis.hlines(at, lane.low[inside], lane.high[inside], color=DARK, lw=1.4, zorder=3)
    axis.set_yticks(range(len(lanes)), [*lanes][::-1])
    axis.set_ylim(-0.45, len(lanes) - 0.55)
    axis.set_xlim(span[0] - 0.02 * (span[1] - span[0]), span[1] + 0.02 * (span[1] - span[0]))
    axis.grid(axis="y", visible=False)
    axis.set_xlabel("time, s")
    save_svg(figure, path)


def _broken(t: Floats, value: Floats) -> tuple[Floats, Floats]:
    """The same with a NaN where nothing is known for several steps, so that no line is drawn across."""
    steps = np.diff(t)
    gaps = 1 + np.flatnonzero(steps > GAP * np.median(steps)) if len(steps) else np.zeros(0, int)
    return np.insert(t, gaps, np.nan), np.insert(value, gaps, np.nan)


def _binned(t: Floats, value: Floats, bins: int = 240) -> tuple[Floats, Floats]:
    """Means in at most `bins` equal parts, so that an hour draws as fast as a minute."""
    if len(t) <= bins:
        return t, value
    edges = np.linspace(0, len(t), bins + 1).astype(int)[:-1]
    size = np.diff(np.append(edges, len(t)))
    return np.add.reduceat(t, edges) / size, np.add.reduceat(value, edges) / size
