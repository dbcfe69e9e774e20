"""The gait of a walk must agree with itself and with the stamps of its 3D.

INPUTS   a `Walk` (evidence.py). OUTPUTS: problems as (path, sentence)
Parameters of a walk are means of its steps and strides, these begin and end with strikes that are used, events lie on
the stamps of the 3D. Which events there are is not found anew: what finds them may be another in the next version.
Numbers are stored as they were computed, in float64.
"""

from collections.abc import Iterator

import numpy as np

from dior.arrays import Table
from dior.release.verify.evidence import Walk
from dior.release.verify.walk_checks import Problem, first
from dior.tables.gait_parameters import OF_WALK, STEP, STRIDE, SYMMETRY
from dior.tables.words import FOOT

KINDS = ("gait", "gait_events", "gait_steps")
# of a value, which another machine may sum in another order
SAME = 1e-9
# ns, to which seconds of a walk are rounded
ROUNDED_NS = 1
# half of a normal distribution's 95 % interval
IN_95 = 1.96
# the keys of a row that tell which it is
EVENT, STEPS, PARAMETER = ("foot", "event"), ("parameter", "foot", "start_s"), ("parameter", "side")


def check(walk: Walk) -> list[Problem]:
    """Compare the tables of the gait of a walk, where it has them."""
    there = [kind for kind in KINDS if walk.of(kind)]
    if not there:
        return []
    if lacks := [kind for kind in KINDS if kind not in there]:
        return [
            (walk.path(kind), "is not in the release, which has the rest of the gait of that walk") for kind in lacks
        ]
    gait, events, steps = (walk.of(kind)[""] for kind in KINDS)
    if walk.rig.suspect(walk.sequence):
        found = [*_suspect(gait, events, steps)]
    else:
        found = [("gait_events", text) for text in _events(events, walk.of("skeletons_3d")[""])]
        found += [("gait_steps", text) for text in _steps(steps, events)]
        found += [("gait", text) for text in _means(gait, events, steps)]
    return [(walk.path(kind), text) for kind, text in found]


def _suspect(gait: Table, events: Table, steps: Table) -> Iterator[Problem]:
    why = "although lights.parquet says that the 3D is wrong, and that nobody accepts it"
    for kind, table, key in (("gait_events", events, "foot"), ("gait_steps", steps, "foot")):
        if len(table[key]):
            yield kind, f"has rows {why}"
    for text in first(np.isfinite(gait["value"]) | (gait["reason"] != "suspect"), f"values {why}", gait, PARAMETER):
        yield "gait", text


def _events(events: Table, skeleton: Table) -> Iterator[str]:
    if not len(events["time_s"]):
        return
    stamps, at = np.unique(skeleton["stamp_ns"], return_index=True)
    if not len(stamps):
        yield "has events, and skeletons_3d has nothing"
        return
    own = stamps[0] + np.rint(events["time_s"] * 1e9).astype(np.int64)
    yield from first(
        np.abs(own - events["stamp_ns"]) > ROUNDED_NS, "stamps that are not those of time_s", events, EVENT
    )
    yield from first(np.r_[False, np.diff(events["time_s"]) < 0], "events that go back", events, EVENT)
    instants = skeleton["instant"][at]
    row = np.searchsorted(instants, events["instant"]).clip(max=len(instants) - 1)
    off = np.abs(stamps[row] - own)
    nearest = np.abs(stamps - own[:, None]).min(axis=1)
    wrong = (instants[row] != events["instant"]) | (off > nearest + ROUNDED_NS)
    yield from first(wrong, "instants that are not the nearest ones", events, EVENT)
    yield from _intervals(events, "time_s", "sigma_s", "low_s", "high_s", EVENT)


def _intervals(table: Table, value: str, sigma: str, low: str, high: str, keys: tuple[str, ...]) -> Iterator[str]:
    """Rows whose ends are not those of the 95 % interval that value and sigma have; both missing is as good."""
    half = IN_95 * table[sigma]
    wrong = ~_same(table[low], table[value] - half) | ~_same(table[high], table[value] + half)
    yield from first(wrong, f"intervals that are not {value} and {IN_95} {sigma} to either side", table, keys)
    yield from first(table[sigma] < 0, f"values of {sigma} below 0", table, keys)


def _same(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.isclose(a, b, rtol=SAME, atol=SAME, equal_nan=True)


def _steps(steps: Table, events: Table) -> Iterator[str]:
    used = (events["event"] == "heel_strike") & (events["reason"] == "")
    strikes = {foot: set(events["time_s"][used & (events["foot"] == foot)].tolist()) for foot in FOOT}
    rows = list(zip(*(steps[key].tolist() for key in ("parameter", "foot", "start_s", "end_s")), strict=True))
    wrong = []
    for name, foot, start, end in rows:
        begins = foot if name in STRIDE else FOOT[1 - FOOT.index(foot)] if foot in FOOT else ""
        wrong.append(start not in strikes.get(begins, ()) or end not in strikes.get(foot, ()))
    yield from first(np.array(wrong, bool), "steps or strides that no strikes of gait_events bound", steps, STEPS)
    timed = np.isin(steps["parameter"], ("step_time", "stride_time"))
    off = timed & ~_same(steps["value"], steps["end_s"] - steps["start_s"])
    yield from first(off, "times that are not from start_s to end_s", steps, STEPS)
    yield from _intervals(steps, "value", "sigma", "low", "high", STEPS)


def _means(gait: Table, events: Table, steps: Table) -> Iterator[str]:
    expected = _expected(steps)
    if len(gait["value"]):
        expected["left_out", "both"] = float((events["reason"] != "").sum())
    keys = list(zip(gait["parameter"].tolist(), gait["side"].tolist(), strict=True))
    for key in sorted(expected.keys() - set(keys)):
        yield f"has no row of {' '.join(key)}, of which gait_steps has values"
    told = np.array([expected.get(key, np.nan) for key in keys])
    derived = np.isin(gait["parameter"], (*STEP, *STRIDE, *OF_WALK, "left_out", *(f"{n}_asymmetry" for n in SYMMETRY)))
    wrong = derived & ~_same(gait["value"], told)
    yield from first(wrong, "values that are not the means of gait_steps", gait, PARAMETER)
    both = np.isfinite(gait["value"]) == (gait["reason"] != "")
    yield from first(both, "rows with a value and a reason for none, or with neither", gait, PARAMETER)
    with_sigma = np.isfinite(gait["sigma"])
    yield from _intervals({k: v[with_sigma] for k, v in gait.items()}, "value", "sigma", "low", "high", PARAMETER)


def _expected(steps: Table) -> dict[tuple[str, str], float]:
    """(parameter, side) -> what its steps and strides give."""
    found: dict[tuple[str, str], float] = {}
    for name in (*STEP, *STRIDE):
        own = steps["parameter"] == name
        means = {foot: steps["value"][own & (steps["foot"] == foot)] for foot in FOOT}
        sides = {foot: float(values.mean()) for foot, values in means.items() if len(values)}
        found |= {(name, foot): value for foot, value in sides.items()}
        if sides:
            found[name, "both"] = float(np.mean([*sides.values()]))
    if ("step_time", "both") in found:
        found["cadence", "both"] = 60 / found["step_time", "both"]
        if ("step_length", "both") in found:
            found["walk_ratio", "both"] = found["step_length", "both"] / found["cadence", "both"]
    for name in SYMMETRY:
        if all((name, foot) in found for foot in FOOT):
            left, right = (found[name, foot] for foot in FOOT)
            found[f"{name}_asymmetry", "both"] = 2 * (left - right) / (left + right)
    return found
