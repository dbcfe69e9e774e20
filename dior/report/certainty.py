"""How well the cameras are known: the standard errors of their poses, and whether they stood still.

INPUTS   `camera_covariance` and `camera_turns` tables of the sessions
OUTPUTS  SVG files. Same numbers, same bytes.
"""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TypeAlias

import numpy as np

from dior.arrays import AnyPath, Floats, Texts
from dior.report.colours import COLOURS, colours_of
from dior.report.svg import legend, new_figure, save_svg
from dior.tables import tables

# of a camera: sequences (S,), turn (S,) degrees in whatever direction, its standard error (S,)
Turns: TypeAlias = tuple[Texts, Floats, Floats]
WORLD_AXES = (("x", "o"), ("y", "s"), ("z", "^"))
OWN_AXES = (("up and down", "o"), ("left and right", "s"), ("roll", "^"))


def spreads(paths: Iterable[AnyPath]) -> dict[str, dict[str, Floats]]:
    """session -> camera -> standard errors (6,): turn about the camera's own axes, degrees, and position in cm."""
    found: dict[str, dict[str, Floats]] = {}
    for path in paths:
        table = tables.read(path, "camera_covariance")
        columns = (table[key] for key in ("session", "camera", "other", "covariance"))
        for session, camera, other, values in zip(*columns, strict=True):
            if camera != other:
                continue
            sigma = np.sqrt(np.diag(values.reshape(6, 6)))
            if np.isfinite(sigma).all():
                found.setdefault(session, {})[camera] = sigma * np.repeat([180 / np.pi, 100.0], 3)
    return found


def turns(paths: Iterable[AnyPath]) -> dict[str, dict[str, Turns]]:
    """session -> camera -> `Turns` since the first walk in which it is known.

    The tables have each walk against all others, in which a camera that was bumped is off in every walk. Of N walks of
    equal weight, two of these are N / (N - 1) times as far apart as the walks are from each other.
    """
    found: dict[str, dict[str, Turns]] = {}
    for path in paths:
        table = tables.read(path, "camera_turns")
        turn, sigma = (np.stack([table[f"{kind}_{axis}"] for axis in "xyz"], axis=-1) for kind in ("turn", "sigma"))
        for session in tables.ordered_unique(table["session"]):
            for camera in tables.ordered_unique(table["camera"]):
                mine = (table["session"] == session) & (table["camera"] == camera) & np.isfinite(turn).all(axis=1)
                if not mine.any():
                    continue
                since = (turn[mine] - turn[mine][0]) * (1 - 1 / mine.sum())
                length = np.linalg.norm(since, axis=1)
                along = np.linalg.norm(since / np.maximum(length, 1e-12)[:, None] * sigma[mine], axis=1)
                found.setdefault(session, {})[camera] = (table["sequence"][mine], length, along)
    return found


def poses(path: Path, sigmas: Mapping[str, Floats]) -> None:
    """Standard errors of position and direction, on logarithmic axes. `sigmas`: camera -> (6,), as of `spreads`."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

    figure, axes = new_figure(1, 2, height=1.5 + 0.3 * len(sigmas), sharey=True)
    at = np.arange(len(sigmas))
    values = np.stack(list(sigmas.values()))
    for axis, first, names, label in (
        (axes[0], 3, WORLD_AXES, "position, cm"),
        (axes[1], 0, OWN_AXES, "direction, degrees"),
    ):
        for i, (name, mark) in enumerate(names):
            axis.plot(values[:, first + i], at + 0.2 * (i - 1), mark, ms=5, color=COLOURS[i], label=name)
        axis.set_xscale("log")
        shown = values[:, first : first + 3]
        middle = np.sqrt(shown.min() * shown.max())
        # at least a decade
        axis.set_xlim(min(shown.min() / 1.4, middle / 3.2), max(shown.max() * 1.4, middle * 3.2))
        axis.xaxis.set_major_locator(LogLocator(subs=(1, 3)))
        axis.xaxis.set_minor_locator(NullLocator())
        axis.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_xlabel(label, fontsize=9)
        axis.grid(axis="y", visible=False)
        axis.legend(loc="lower left", bbox_to_anchor=(-0.04, 1), ncols=3, fontsize=8, handletextpad=0,
                    columnspacing=0.5, borderpad=0)  # fmt: skip
    axes[0].set_yticks(at, list(sigmas), fontsize=9)
    axes[0].set_ylim(len(sigmas) - 0.5, -0.5)
    save_svg(figure, path)


def stood_still(path: Path, by_camera: Mapping[str, Turns]) -> None:
    """Turn of each camera in each walk since the first one. `by_camera`: as of `turns`."""
    figure, axis = new_figure(height=2.9)
    colours = colours_of(by_camera)
    sequences = list(dict.fromkeys(name for names, _, _ in by_camera.values() for name in names))
    for i, (camera, (names, turn, sigma)) in enumerate(by_camera.items()):
        at = np.array([sequences.index(name) for name in names]) + 0.12 * (i - (len(by_camera) - 1) / 2)
        axis.errorbar(at, turn, 2 * sigma, fmt="o", ms=4, lw=1, color=colours[camera], label=camera)
    many = len(sequences) > 12
    axis.set_xticks(range(len(sequences)), [n if not many else "" for n in sequences], rotation=30, ha="right")
    axis.set_xlabel(f"{len(sequences)} walks in order of recording" if many else "")
    axis.set_ylabel("turn, degrees")
    axis.set_ylim(0, None)
    legend(figure, colours)
    save_svg(figure, path)
