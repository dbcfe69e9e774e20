"""The report's figures of all sequences, each a function from numbers to an SVG file. Same numbers, same bytes."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from dior.arrays import Floats
from dior.report.colours import COLOURS, DARK, GREY, GRID, RED, WHITE, colours_of
from dior.report.svg import legend, new_figure, save_svg, short

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# value, low, high of its interval (NaN: unknown), n
Value: TypeAlias = tuple[float, float, float, int]

# chosen: of an axis of shares that hardly differ, so that it does not make much of nothing
FEWEST_PERCENT = 5.0


def strip(
    path: Path,
    points: list[tuple[str, str, float, int]],
    label: str,
    intervals: Mapping[str, tuple[float, float]] | None = None,
    total: Value | None = None,
) -> None:
    """Figures by group, a row each: one dot per value, a dark bar at the mean weighted by n, which stands beside it.

    `points`: (group, colour group, value, n) tuples; `label` names the axis with its unit; `intervals`: group -> (low,
    high) of its mean; `total`: (value, low, high, n) of all, drawn last. More colour groups than colours are all grey.
    """
    groups = sorted({p[0] for p in points})
    kinds = sorted({p[1] for p in points})
    several = 1 < len(kinds) <= len(COLOURS)
    colours = colours_of(kinds) if several else dict.fromkeys(kinds, COLOURS[0] if len(kinds) == 1 else GREY)
    means: dict[str, Value] = {}
    for group in groups:
        n = np.array([p[3] for p in points if p[0] == group])
        mean = float(np.dot(n, [p[2] for p in points if p[0] == group]) / n.sum())
        means[group] = mean, *(intervals or {}).get(group, (np.nan, np.nan)), int(n.sum())
    if total:
        means["all"] = total
    figure, axis = new_figure(height=1.1 + _row_height(len(means)) * len(means))
    for at, group in enumerate(groups):
        members = sorted((p for p in points if p[0] == group), key=lambda p: p[1])
        spread = (np.arange(len(members)) - (len(members) - 1) / 2) * min(0.12, 0.55 / len(members))
        for shift, (_, kind, value, _) in zip(spread, members, strict=True):
            axis.plot(value, at + shift, "o", ms=5, color=colours[kind], alpha=0.85, mec=WHITE, mew=0.5)
    for at, (mean, low, high, _) in enumerate(means.values()):
        axis.vlines(mean, at - 0.32, at + 0.32, color=DARK, lw=1.8, zorder=1)
        if np.isfinite([low, high]).all():
            axis.hlines(at + 0.36, low, high, color=DARK, lw=1.2)
            axis.vlines([low, high], at + 0.3, at + 0.42, color=DARK, lw=1.2)
    _rows(axis, list(means), [f"{mean:.3g}" for mean, *_ in means.values()], [one[3] for one in means.values()])
    axis.set_xlim(0, 1.04 * max(axis.dataLim.x1, *(one[0] for one in means.values())))
    axis.set_xlabel(label)
    if several:
        legend(figure, colours)
    save_svg(figure, path)


def _row_height(rows: int) -> float:
    """Inches of a row; chosen: room for dots beside each other where there are few, a page for many."""
    return 0.42 if rows <= 8 else 0.3


def _rows(axis: "Axes", names: list[str], values: list[str], counts: list[int]) -> None:
    """A row each of a horizontal plot, from above: its name on the left, what it shows and of how many on the right."""
    at = range(len(names))
    axis.set_yticks(at, names, fontsize=9)
    axis.set_ylim(len(names) - 0.4, -0.6)
    axis.tick_params(axis="y", length=0)
    axis.grid(axis="y", visible=False)
    right = axis.secondary_yaxis("right")
    right.spines[:].set_visible(False)
    texts = [f"{value} (n {short(n)})".strip() for value, n in zip(values, counts, strict=True)]
    right.set_yticks(at, texts, fontsize=9)
    right.tick_params(length=0)


def distribution(path: Path, series: Mapping[str, tuple[Floats, Floats, int]], label: str) -> None:
    """Cumulative distributions of values per picture. `series`: name -> (values (V,) in order, share (V,) of all below
    each, number of all)."""
    figure, axis = new_figure()
    q = np.linspace(0, 1, 201)
    curves = {name: (np.interp(q, share, values), n) for name, (values, share, n) in series.items()}
    end = max(float(np.interp(0.99, share, values)) for values, share, _ in series.values())
    for (name, (x, n)), colour in zip(sorted(curves.items()), COLOURS * 4, strict=False):
        shown = x <= end
        # the ends of a curve lie on the frame
        axis.plot(x[shown], 100 * q[shown], color=colour, lw=1.8, label=f"{name} (n {short(n)})", clip_on=False)
    axis.set_xlim(0, end or 1)
    axis.set_ylim(0, 100)
    axis.set_xlabel(label)
    axis.set_ylabel("share of the pictures, %")
    above(figure, axis)
    save_svg(figure, path)


def above(figure: "Figure", axis: "Axes", columns: int = 2) -> None:
    """The legend of an axis above all axes of the figure, where it covers nothing."""
    figure.legend(*axis.get_legend_handles_labels(), loc="outside upper left", ncols=columns, handlelength=1.4,
                  handletextpad=0.4, columnspacing=1.2)  # fmt: skip


def before_after(path: Path, pairs: Mapping[str, tuple[float, float, int]], label: str) -> None:
    """What became of values, a row each in the order given. `pairs`: name -> (before, after, n)."""
    figure, axis = new_figure(height=1.1 + 0.34 * len(pairs))
    at = np.arange(len(pairs))
    before, after = (np.array([pair[i] for pair in pairs.values()]) for i in (0, 1))
    axis.hlines(at, after, before, color=GREY, lw=1.4)
    axis.plot(before, at, "o", ms=6, color=GREY, label="before")
    axis.plot(after, at, "o", ms=6, color=COLOURS[0], label="after")
    texts = [f"{one:.3g} \u2192 {other:.3g}" for one, other in zip(before, after, strict=True)]
    _rows(axis, list(pairs), texts, [pair[2] for pair in pairs.values()])
    axis.set_xlim(0, 1.04 * max(before.max(), after.max()))
    axis.set_xlabel(label)
    above(figure, axis)
    save_svg(figure, path)


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
    figure, axis = new_figure(height=1.15 + _row_height(len(groups)) * len(groups))
    apart = min(0.22, 0.8 / len(series))
    for nth, ((name, values), colour) in enumerate(zip(series.items(), COLOURS, strict=False)):
        at = np.array([groups.index(group) for group in values]) + apart * (nth - (len(series) - 1) / 2)
        value, low, high = scale * np.array([v[:3] for v in values.values()], float).T.reshape(3, -1)
        axis.hlines(at, low, high, color=colour, lw=1.6)
        # a share of 100 % lies on the frame
        axis.plot(value, at, "osD^"[nth % 4], ms=5.5, color=colour, mec=WHITE, mew=0.6, label=name, clip_on=False)
    counts = [max((values[g][3] for values in series.values() if g in values), default=0) for g in groups]
    axis.tick_params(axis="y", length=0)
    axis.set_yticks(range(len(groups)), [f"{g} (n {short(n)})" for g, n in zip(groups, counts, strict=True)],
                    fontsize=9)  # fmt: skip
    axis.set_ylim(len(groups) - 0.5, -0.5)
    axis.grid(axis="y", visible=False)
    for edge in np.arange(len(groups) - 1) + 0.5:
        axis.axhline(edge, color=GRID, lw=0.8, zorder=0)
    if limit:
        # before the axis is cut to what is drawn, so that the limit is on it
        axis.axvline(limit[0] * scale, color=RED, lw=1, ls=(0, (4, 3)), zorder=0)
        figure.text(1, 1, limit[1], color=RED, fontsize=9, ha="right", va="top")
    if percent:
        _shares(axis)
    else:
        _from_zero(axis)
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


def _shares(axis: "Axes") -> None:
    """Limits of an axis of per cent around what is drawn, at least FEWEST_PERCENT apart, within 0 and 100."""
    low, high = axis.dataLim.intervalx
    more = max(0.08 * (high - low), (FEWEST_PERCENT - (high - low)) / 2)
    low, high = max(0.0, low - more), min(100.0, high + more)
    axis.set_xlim(min(low, max(0.0, high - FEWEST_PERCENT)), max(high, min(100.0, low + FEWEST_PERCENT)))


def bars(path: Path, values: Mapping[str, Value], label: str, percent: bool = False) -> None:
    """Horizontal bars with intervals, values and n written out. `values`: name -> (value, low, high, n)."""
    scale = 100 if percent else 1
    figure, axis = new_figure(height=0.9 + 0.36 * len(values))
    at = np.arange(len(values))
    value, low, high = scale * np.array([v[:3] for v in values.values()], float).T
    axis.barh(at, value, 0.62, color=COLOURS[4])
    axis.hlines(at, low, high, color=DARK, lw=1.6)
    _rows(axis, list(values), [f"{one:.1f}" for one in value], [one[3] for one in values.values()])
    axis.set_xlim(0, 100 if percent else 1.04 * np.nanmax(np.fmax(value, high)))
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
        axis.plot(
            ranks, 100 * np.array(shares), color=colours[method], ls=styles[name], lw=1.8, label=label, clip_on=False
        )
    last = max(map(len, series.values()))
    axis.set_xlim(1, last)
    axis.set_xticks([1, *range(5, last + 1, 5)])
    axis.set_ylim(0, 100)
    axis.set_xlabel("rank")
    axis.set_ylabel("found among so many, %")
    figure.legend(*axis.get_legend_handles_labels(), loc="outside upper left", ncols=2, handlelength=2.2)
    save_svg(figure, path)
