"""A value of each joint, in the order of the body from the head down, left and right in one row.

INPUTS   values by joint. OUTPUT  an SVG file: a panel for each part of the body. Same numbers, same bytes.
"""

import re
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np

from dior.body import names as skeletons
from dior.report.colours import COLOURS, DARK, GRID
from dior.report.plots import Value
from dior.report.svg import legend, new_figure, save_svg, short

SIDES = {"left": COLOURS[0], "right": COLOURS[1], "middle": DARK}
# part of the body -> its joints and markers without their side, as they begin; what is none of these are `OTHERS`
PARTS = {
    "head": re.compile(r"nose|eye|ear|mouth|head|face|[FB]HD$"),
    "trunk": re.compile(r"neck|shoulder|hip|mid_hip|C7$|T10$|CLAV$|STRN$|RBAK$|SHO$|ASI$|PSI$"),
    "arms": re.compile(r"elbow|wrist|pinky|index|thumb|hand|UPA$|ELB$|FRM$|WR[AB]$|FIN$"),
    "legs": re.compile(r"knee|ankle|heel|foot|big_toe|small_toe|THI$|KNE$|TIB$|ANK$|HEE$|TOE$"),
}
OTHERS = "others"
# from the head down, of all lists of names; each of Plug-in Gait's left markers stands before its right one
ORDER = {
    name: i
    for i, name in enumerate(
        dict.fromkeys((*skeletons.MLKIT_33, *skeletons.HALPE_136, *skeletons.PLUG_IN_GAIT_39)),
    )
}


def side_and_name(joint: str) -> tuple[str, str]:
    """(one of SIDES, name without its side) of a joint or marker."""
    side = skeletons.side_of(joint)
    return side, joint if side == "middle" else joint.removeprefix(f"{side}_") if joint[0].islower() else joint[1:]


def part_of(name: str) -> str:
    """Which of PARTS a joint without its side belongs to."""
    return next((part for part, names in PARTS.items() if names.match(name)), OTHERS)


def by_part(joints: Iterable[str]) -> dict[str, dict[str, dict[str, str]]]:
    """part of the body -> name without its side -> side -> joint, from the head down."""
    found: dict[str, dict[str, dict[str, str]]] = {part: {} for part in (*PARTS, OTHERS)}
    for joint in sorted(joints, key=lambda joint: (ORDER.get(joint, len(ORDER)), joint)):
        side, name = side_and_name(joint)
        found[part_of(name)].setdefault(name, {})[side] = joint
    return {part: rows for part, rows in found.items() if rows}


def draw(path: Path, values: Mapping[str, Value], label: str) -> None:
    """Values by joint with their intervals. `values`: joint -> (value, low, high, n); `label` names the axis."""
    parts = by_part(values)
    rows = -(-len(parts) // 2)
    pairs = [list(parts)[2 * i : 2 * i + 2] for i in range(rows)]
    heights = [max(len(parts[part]) for part in pair) for pair in pairs]
    figure, axes = new_figure(
        rows, min(len(parts), 2), height=0.9 + 0.35 * rows + 0.19 * sum(heights), squeeze=False, sharex=True,
        height_ratios=heights,
    )  # fmt: skip
    for axis, part in zip(axes.flat, parts, strict=False):
        for at, by_side in enumerate(parts[part].values()):
            apart = 0 if len(by_side) == 1 else 0.18
            for side, joint in by_side.items():
                value, low, high, _ = values[joint]
                y = at + {"left": -apart, "right": apart, "middle": 0.0}[side]
                if np.isfinite([low, high]).all():
                    axis.hlines(y, low, high, color=SIDES[side], lw=1.4)
                axis.plot(value, y, "o", ms=4, color=SIDES[side])
        names = [name.replace("_", " ") for name in parts[part]]
        # as high as the panel beside it, so that rows of both are level
        most = max(len(parts[other]) for pair in pairs if part in pair for other in pair)
        axis.set_yticks(range(len(names)), names, fontsize=8)
        axis.set_ylim(most - 0.4, -0.6)
        axis.tick_params(axis="y", length=0)
        axis.grid(axis="y", color=GRID, lw=0.5)
        axis.set_title(part, fontsize=9)
    for axis in axes.flat[len(parts) :]:
        axis.axis("off")
    highest = max(np.fmax(value, high) for value, _, high, _ in values.values())
    axes[0, 0].set_xlim(0, 1.05 * highest or 1)
    n = sum(one[3] for one in values.values())
    figure.supxlabel(f"{label} (n {short(n)})", fontsize=10)
    there = {side_and_name(joint)[0] for joint in values}
    legend(figure, {side: colour for side, colour in SIDES.items() if side in there})
    save_svg(figure, path)
