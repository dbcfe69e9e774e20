"""The gait of a walk as its page shows it: the parameters of both sides with their intervals, and when feet stood.

INPUTS   tables `gait_parameters` and `gait_events` of a walk
OUTPUT   `Gait`: rows of the page's table, sentences, and what `walk_plots.gait` draws; nothing is drawn here
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from dior.arrays import Floats, Table
from dior.errors import many
from dior.tables import tables
from dior.tables.words import FOOT, SIDE

# what is shown: words for people, unit, by how much of it the table's unit is, digits
SHOWN = {
    "stride_speed": ("walking speed", "m/s", 1, 2),
    "cadence": ("cadence", "steps/min", 1, 1),
    "step_time": ("step time", "s", 1, 3),
    "stride_time": ("stride time", "s", 1, 3),
    "step_length": ("step length", "cm", 100, 1),
    "step_length_toe": ("step length as Plug-in-Gait has it", "cm", 100, 1),
    "stride_length": ("stride length", "cm", 100, 1),
    "step_width": ("step width", "cm", 100, 1),
    "stance_share": ("stance", "% of the stride", 100, 1),
    "swing_share": ("swing", "% of the stride", 100, 1),
    "double_support_share": ("double support", "% of the stride", 100, 1),
    "single_support_share": ("single support", "% of the stride", 100, 1),
    "walk_ratio": ("walk ratio", "mm/(step/min)", 1000, 2),
    "step_time_asymmetry": ("asymmetry of the step time", "%", 100, 1),
    "step_length_asymmetry": ("asymmetry of the step length", "%", 100, 1),
    "belt_speed": ("treadmill", "m/s", 1, 2),
}
# s; chosen: of a longer walk the stances would be too narrow to see
LONGEST_S = 20.0


@dataclass(frozen=True, eq=False)
class Lane:
    """A foot's stances that are used and that are left out, (S, 2) and (L, 2) s; its events that are used: `seconds`,
    `low`, `high` (E,) s and which are strikes (E,)."""

    used: Floats
    left_out: Floats
    seconds: Floats
    low: Floats
    high: Floats
    strike: Floats


@dataclass(frozen=True, eq=False)
class Gait:
    """Of one walk: `rows` of the table (name, unit, left, right, both, n), sentences, and a `Lane` by foot."""

    rows: list[dict[str, str]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    lanes: Mapping[str, Lane] = field(default_factory=dict)


def read(parameters: Path, events: Path) -> Gait | None:
    """`Gait` of the tables of a walk, None where no step was measured."""
    by_name = _by_name(tables.read(parameters, "gait_parameters"))
    table = tables.read(events, "gait_events")
    rows = [_row(name, by_name) for name in SHOWN if np.isfinite(by_name.get((name, "both"), _NONE)[0])]
    if not rows:
        return None
    return Gait(rows, _notes(by_name), {foot: _lane(tables.rows(table, table["foot"] == foot)) for foot in FOOT})


_NONE = (np.nan, np.nan, 0, "")


def _by_name(table: Table) -> dict[tuple[str, str], tuple[float, float, int, str]]:
    """(parameter, side) -> value, half of its 95 % interval, count, reason."""
    half = (table["high"] - table["low"]) / 2
    cells = zip(table["value"].tolist(), half.tolist(), table["n"].tolist(), table["reason"].tolist(), strict=True)
    return dict(zip(zip(table["parameter"].tolist(), table["side"].tolist(), strict=True), cells, strict=True))


def _row(name: str, by_name: Mapping[tuple[str, str], tuple[float, float, int, str]]) -> dict[str, str]:
    words, unit, factor, digits = SHOWN[name]
    row = {"name": words, "unit": unit, "n": str(by_name[name, "both"][2])}
    for side in SIDE:
        value, half, *_ = by_name.get((name, side), _NONE)
        # rounded up: no interval is shown as nothing
        within = f" ± {np.ceil(factor * half * 10**digits) / 10**digits:.{digits}f}" if np.isfinite(half) else ""
        row[side] = f"{factor * value:.{digits}f}{within}" if np.isfinite(value) else ""
    return row


def _notes(by_name: Mapping[tuple[str, str], tuple[float, float, int, str]]) -> list[str]:
    turns, left_out = (int(by_name[name, "both"][0]) for name in ("turns", "left_out"))
    notes = []
    if left_out:
        where = f"in {many(turns, 'turn')}, " if turns else ""
        notes.append(f"{many(left_out, 'event')} left out: {where}of somebody who stands, or where the 3D ends.")
    if by_name["double_support_share", "both"][3] == "running":
        notes.append("This is running: both feet are never on the floor together.")
    return notes


def _lane(table: Table) -> Lane:
    """Of the events of one foot, in the order of time."""
    strike, fine = table["event"] == "heel_strike", table["reason"] == ""
    first = np.flatnonzero(strike[:-1] & ~strike[1:])
    stances = np.stack([table["time_s"][first], table["time_s"][first + 1]], axis=-1)
    used = fine[first] & fine[first + 1]
    seconds, low, high = (table[key][fine] for key in ("time_s", "low_s", "high_s"))
    return Lane(stances[used], stances[~used], seconds, low, high, strike[fine])


def span(lanes: Mapping[str, Lane]) -> tuple[float, float]:
    """The time (s) that is drawn: all of the walk, or of a long one from the first event that is used on."""
    ends = np.concatenate([one for lane in lanes.values() for one in (lane.used.ravel(), lane.left_out.ravel())])
    used = np.concatenate([lane.seconds for lane in lanes.values()])
    ends = np.concatenate([ends, used])
    first, last = float(ends.min()), float(ends.max())
    if last - first > LONGEST_S:
        first = float(used.min())
        last = min(last, first + LONGEST_S)
    return first, last
