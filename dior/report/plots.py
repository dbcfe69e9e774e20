"""The report's figures, each a function from numbers to an SVG file. Same numbers, same bytes.

Figures are narrow, with type that can still be read when a phone scales them down.
"""

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from dior.arrays import Floats
from dior.report.colours import COLOURS, DARK, GREY, GRID, RED, colours_of
from dior.tables.files import written_whole
from dior.tables.words import DROP_REASON

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# value, low, high of its interval (NaN: unknown), n
Value: TypeAlias = tuple[float, float, float, int]

# inches; chosen: type of 10 points can still be read where a phone shows it 9 cm wide
WIDTH = 5.2
# Matplotlib knows its parameters by a Literal of all their names
STYLE: dict[Any, Any] = {
    "svg.hashsalt": "dior",
    "svg.fonttype": "path",
    # text is measured for the layout as it is drawn
    "text.hinting": "none",
    "font.family": "DejaVu Sans",
    "font.size": 10,
    "axes.titlesize": 10,
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": GREY,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": GRID,
    "grid.linewidth": 0.8,
    "legend.frameon": False,
    "legend.fontsize": 9,
}


@cache
def _pyplot() -> Any:
    import matplotlib

    matplotlib.use("Agg")
    matplotlib.rcdefaults()
    matplotlib.rcParams.update(STYLE)
    from matplotlib import pyplot

    return pyplot


def new_figure(rows: int = 1, columns: int = 1, height: float = 3.1, **options: Any) -> "tuple[Figure, Any]":
    """A figure and its axes, one or an array of them, WIDTH wide in the report's style; `height` in inches."""
    return _pyplot().subplots(rows, columns, figsize=(WIDTH, height), **{"layout": "constrained"} | options)


def save_svg(figure: "Figure", path: Path) -> None:
    """Write a figure as SVG, without date or version, and close it."""
    if layout := figure.get_layout_engine():
        layout.execute(figure)
        # else Matplotlib draws the whole figure twice
        figure.set_layout_engine(None)
    with written_whole(path) as part:
        figure.savefig(part, format="svg", metadata={"Date": None, "Creator": None})
    _pyplot().close(figure)


def strip(
    path: Path,
    points: list[tuple[str, str, float, int]],
    label: str,
    percent: bool = False,
    limit: tuple[float, str] | None = None,
    intervals: Mapping[str, tuple[float, float]] | None = None,
    total: Value | None = None,
) -> None:
    """Figures by group: one dot per row, a dark bar at the mean weighted by n.

    `points`: (group, colour group, value, n) tuples; `label` names the vertical axis with its unit; `limit`: (value,
    text) drawn as a line; `intervals`: group -> (low, high) of its mean; `total`: (value, low, high, n) of all, drawn
    last.
    """
    groups = sorted({p[0] for p in points})
    crowded = len(groups) > 6
    kinds = sorted({p[1] for p in points})
    colours = colours_of(kinds)
    figure, axis = new_figure()
    scale = 100 if percent else 1
    for at, group in enumerate(groups):
        members = [p for p in points if p[0] == group]
        spread = (np.arange(len(members)) - (len(members) - 1) / 2) * min(0.12, 0.6 / len(members))
        for shift, (_, kind, value, _) in zip(spread, sorted(members, key=lambda p: p[1]), strict=True):
            axis.plot(at + shift, value * scale, "o", ms=5, color=colours[kind], alpha=0.85, mec="white", mew=0.5)
        n = np.array([p[3] for p in members])
        mean = scale * np.dot(n, [p[2] for p in members]) / n.sum()
        low, high = (intervals or {}).get(group, (np.nan, np.nan))
        _mean(axis, at, mean, scale * low, scale * high, crowded)
    totals = [sum(p[3] for p in points if p[0] == group) for group in groups]
    if total:
        value, low, high, n_all = total
        _mean(axis, len(groups), scale * value, scale * low, scale * high, crowded)
        groups, totals = [*groups, "all"], [*totals, n_all]
    if limit:
        axis.axhline(limit[0] * scale, color=RED, lw=1, ls=(0, (4, 3)), zorder=0)
        axis.annotate(limit[1], (0.01, limit[0] * scale), xycoords=("axes fraction", "data"), va="bottom", fontsize=9,
                      color=RED)  # fmt: skip
    rotate = len(groups) > 6
    axis.set_xticks(
        range(len(groups)),
        [f"{g}\nn {_short(t)}" if not rotate else f"{g} (n {_short(t)})" for g, t in zip(groups, totals, strict=True)],
        rotation=60 if rotate else 0,
        ha="right" if rotate else "center",
    )
    axis.set_xlim(-0.6, len(groups) - 0.2)
    axis.margins(y=0.12)
    if percent:
        low = min(p[2] for p in points) * 100
        axis.set_ylim(max(0, 5 * np.floor((low - 2) / 5)), 101)
    else:
        axis.set_ylim(0, None)
    axis.set_ylabel(label)
    axis.grid(axis="x", visible=False)
    if len(kinds) > 1:
        legend(figure, colours)
    save_svg(figure, path)


def _mean(axis: "Axes", at: float, mean: float, low: float, high: float, crowded: bool) -> None:
    """A bar at a group's mean, its value, and its interval where it is known."""
    axis.plot([at - 0.32, at + 0.32], [mean, mean], color=DARK, lw=1.8, solid_capstyle="butt", zorder=1)
    # beside the bar there is room for few groups only
    place: dict[str, Any] = (
        {"xytext": (0, 9), "ha": "center", "fontsize": 7.5} if crowded else {"xytext": (3, 0), "fontsize": 9}
    )
    xy = (at if crowded else at + 0.32, mean)
    axis.annotate(f"{mean:.3g}", xy, va="center", textcoords="offset points", color=DARK,
                  annotation_clip=False, **place)  # fmt: skip
    if np.isfinite([low, high]).all():
        axis.vlines(at + 0.28, low, high, color=DARK, lw=1.2)
        axis.hlines([low, high], at + 0.24, at + 0.32, color=DARK, lw=1.2)


def legend(figure: "Figure", colours: Mapping[str, str]) -> None:
    """Names with their colours above the axes of a figure."""
    from matplotlib.lines import Line2D

    handles = [Line2D([], [], marker="o", ls="", color=c, label=name) for name, c in colours.items()]
    figure.legend(handles=handles, loc="outside upper left", ncols=min(len(handles), 4), handletextpad=0.2,
                  columnspacing=1.2)  # fmt: skip


def _short(n: float) -> str:
    return f"{n / 1e6:.3g}M" if n >= 1e6 else f"{n / 1e3:.3g}k" if n >= 1e4 else str(int(n))


def distribution(path: Path, series: Mapping[str, Floats], label: str) -> None:
    """Cumulative distributions of values per picture. `series`: name -> values (N,)."""
    figure, axis = new_figure()
    q = np.linspace(0, 1, 201)
    end = max(float(np.quantile(values, 0.99)) for values in series.values())
    for (name, values), colour in zip(sorted(series.items()), COLOURS * 4, strict=False):
        axis.plot(np.quantile(values, q), 100 * q, color=colour, lw=1.8, label=f"{name} (n {_short(len(values))})")
    axis.set_xlim(0, end * 1.02 or 1)
    axis.set_ylim(0, 100)
    axis.set_xlabel(label)
    axis.set_ylabel("share of the pictures, %")
    axis.legend(loc="lower right")
    save_svg(figure, path)


def joints(path: Path, values: Mapping[str, Mapping[str, tuple[float, int]]], label: str) -> None:
    """Means by joint as horizontal bars. `values`: group -> {joint: (value, n)}; one panel per group."""
    most = max(len(by_joint) for by_joint in values.values())
    figure, axes = new_figure(1, len(values), height=0.9 + 0.165 * most, squeeze=False)
    for axis, (group, by_joint), colour in zip(axes[0], sorted(values.items()), COLOURS * 4, strict=False):
        names = list(by_joint)
        axis.barh(range(len(names)), [by_joint[name][0] for name in names], color=colour, height=0.7)
        axis.set_yticks(range(len(names)), [name.replace("_", " ") for name in names], fontsize=7.5)
        axis.set_ylim(len(names) - 0.4, -0.6)
        axis.grid(axis="y", visible=False)
        axis.set_title(f"{group} (n {_short(sum(n for _, n in by_joint.values()))})", fontsize=9)
        axis.set_xlabel(label, fontsize=9)
    save_svg(figure, path)


def before_after(path: Path, bars: Mapping[str, tuple[float, float, int]], label: str) -> None:
    """Pairs of bars. `bars`: name -> (before, after, n)."""
    figure, axis = new_figure(height=2.9)
    at = np.arange(len(bars))
    for shift, index, colour, name in ((-0.2, 0, "#b9c0c9", "before"), (0.2, 1, COLOURS[0], "after")):
        heights = [bar[index] for bar in bars.values()]
        drawn = axis.bar(at + shift, heights, 0.36, color=colour, label=name)
        axis.bar_label(drawn, fmt="%.3g", fontsize=9, padding=2)
    axis.set_xticks(at, [f"{name}\nn {_short(bar[2])}" for name, bar in bars.items()])
    axis.set_ylabel(label)
    axis.margins(y=0.15)
    axis.grid(axis="x", visible=False)
    figure.legend(loc="outside upper left", ncols=2)
    save_svg(figure, path)


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
    figure, axes = new_figure(
        1 + with_errors, 1, height=(1.7 if with_errors else 0) + 0.75 + 0.3 * len(names), sharex=True, squeeze=False,
        gridspec_kw={"height_ratios": ([1.6] if with_errors else []) + [0.45 + 0.3 * len(names)]},
    )  # fmt: skip
    if with_errors:
        axis = axes[0, 0]
        for name, (t, value) in errors.items():
            axis.plot(*_binned(t, value), color=colours[name], lw=1.2, label=name)
        axis.set_ylim(0, None)
        axis.set_ylabel(label)
    axis = axes[-1, 0]
    for row, (name, (t, missing, lost)) in enumerate(lanes.items()):
        axis.axhline(row, color=GRID, lw=0.8)
        times, share = _binned(t, missing)
        axis.fill_between(times, row, row + 0.8 * share, color=colours[name], lw=0, step="mid")
        axis.plot(lost, np.full(len(lost), row - 0.12), "|", color=RED, ms=5, mew=1)
    counts = [f"{name}\n{_short(len(lanes[name][0]))} pictures" for name in names]
    axis.set_yticks(np.arange(len(names)) + 0.3, counts, fontsize=8)
    axis.set_ylim(-0.3, len(names))
    axis.grid(axis="y", visible=False)
    axis.set_title("joints without a label (full height: all), red: lost pictures", fontsize=9)
    axis.set_xlabel("time, s")
    if with_errors:
        figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper left", ncols=4, handlelength=1.2)
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
    ratios = (3, 0.5 + 0.5 * len(lags))
    figure, axes = new_figure(2, 1, height=2.4 + 0.25 * len(lags), sharex=True, height_ratios=ratios)
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
    figure.legend(loc="outside upper left", ncols=4, handlelength=1.2)
    save_svg(figure, path)


def _binned(t: Floats, value: Floats, bins: int = 240) -> tuple[Floats, Floats]:
    """Means in at most `bins` equal parts, so that an hour draws as fast as a minute."""
    if len(t) <= bins:
        return t, value
    edges = np.linspace(0, len(t), bins + 1).astype(int)[:-1]
    size = np.diff(np.append(edges, len(t)))
    return np.add.reduceat(t, edges) / size, np.add.reduceat(value, edges) / size


def marks(
    path: Path,
    groups: list[str],
    series: Mapping[str, Mapping[str, Value]],
    label: str,
    percent: bool = False,
    limit: tuple[float, str] | None = None,
) -> None:
    """Values with their intervals, a row per group and a mark per series; n stands below a group's name.

    `series`: name -> group -> (value, low, high, n); `label` names the axis with its unit; `limit`: (value, text).
    """
    scale = 100 if percent else 1
    figure, axis = new_figure(height=1.15 + len(groups) * (0.3 + 0.06 * len(series)))
    apart = min(0.22, 0.8 / len(series))
    for nth, ((name, values), colour) in enumerate(zip(series.items(), COLOURS, strict=False)):
        at = np.array([groups.index(group) for group in values]) + apart * (nth - (len(series) - 1) / 2)
        value, low, high = scale * np.array([v[:3] for v in values.values()], float).T.reshape(3, -1)
        axis.hlines(at, low, high, color=colour, lw=1.6)
        axis.plot(value, at, "osD^"[nth % 4], ms=5.5, color=colour, mec="white", mew=0.6, label=name)
    counts = [max((values[g][3] for values in series.values() if g in values), default=0) for g in groups]
    axis.set_yticks(range(len(groups)), [f"{g} (n {_short(n)})" for g, n in zip(groups, counts, strict=True)],
                    fontsize=9)  # fmt: skip
    axis.set_ylim(len(groups) - 0.5, -0.5)
    axis.grid(axis="y", visible=False)
    for edge in np.arange(len(groups) - 1) + 0.5:
        axis.axhline(edge, color="#eef0f2", lw=0.8, zorder=0)
    if limit:
        # before the axis is cut to what is drawn, so that the limit is on it
        axis.axvline(limit[0] * scale, color=RED, lw=1, ls=(0, (4, 3)), zorder=0)
        figure.text(1, 1, limit[1], color=RED, fontsize=9, ha="right", va="top")
    _from_zero(axis)
    if percent:
        axis.set_xlim(max(0, axis.get_xlim()[0]), 101)
    axis.set_xlabel(label)
    if len(series) > 1:
        columns = 3 if max(map(len, series)) < 18 else 2
        figure.legend(*axis.get_legend_handles_labels(), loc="outside upper left", ncols=columns, handletextpad=0.1,
                      columnspacing=1.2)  # fmt: skip
    save_svg(figure, path)


def _from_zero(axis: "Axes") -> None:
    """Signed values show where zero is; others that are not shares start there."""
    low, high = axis.get_xlim()
    if low < 0 < high:
        axis.axvline(0, color=GREY, lw=1.2, zorder=0)
    elif low > 0 and low < 0.6 * high:
        axis.set_xlim(0, high)


def bars(path: Path, values: Mapping[str, Value], label: str, percent: bool = False) -> None:
    """Horizontal bars with their values, intervals and counts written out. `values`: name -> (value, low, high, n)."""
    scale = 100 if percent else 1
    figure, axis = new_figure(height=0.9 + 0.42 * len(values))
    at = np.arange(len(values))
    value, low, high = scale * np.array([v[:3] for v in values.values()], float).T
    axis.barh(at, value, 0.62, color=COLOURS[4])
    axis.hlines(at, low, high, color=DARK, lw=1.6)
    ends = np.fmax(value, high)
    for y, end, shown, one in zip(at, ends, value, values.values(), strict=True):
        axis.annotate(f"{shown:.1f} (n {_short(one[3])})", (end, y), xytext=(5, 0), textcoords="offset points",
                      va="center", fontsize=9, annotation_clip=False)  # fmt: skip
    axis.set_yticks(at, list(values), fontsize=9)
    axis.set_ylim(len(values) - 0.4, -0.6)
    axis.set_xlim(0, 130 if percent else 1.3 * np.nanmax(ends))
    if percent:
        axis.set_xticks(range(0, 101, 20))
    axis.grid(axis="y", visible=False)
    axis.set_xlabel(label)
    save_svg(figure, path)


def cmc(path: Path, series: Mapping[tuple[str, str], list[float]]) -> None:
    """Curves of all ranks. `series`: (method, input) -> shares at rank 1, 2, ...; a colour per method, a line style per
    input."""
    figure, axis = new_figure(height=3.6)
    methods = list(dict.fromkeys(method for method, _ in series))
    inputs = list(dict.fromkeys(name for _, name in series if name))
    colours = colours_of(methods)
    styles = dict(zip(inputs, ("-", (0, (4, 2)), (0, (1, 1.5))), strict=False)) | {"": "-"}
    for (method, name), shares in series.items():
        ranks = np.arange(1, len(shares) + 1)
        label = f"{method}, {name}" if name else method
        axis.plot(ranks, 100 * np.array(shares), color=colours[method], ls=styles[name], lw=1.8, label=label)
    last = max(map(len, series.values()))
    axis.set_xlim(1, last)
    axis.set_xticks([1, *range(5, last + 1, 5)])
    axis.set_ylim(0, 101)
    axis.set_xlabel("rank")
    axis.set_ylabel("found among so many, %")
    figure.legend(*axis.get_legend_handles_labels(), loc="outside upper left", ncols=2, handlelength=2.2)
    save_svg(figure, path)
