"""Gait events and parameters against where the simulator's feet touch the floor.

usage: python -m benchmarks.gait [SEEDS]      (20 by default)

Walkers of 0.4 to 1.6 m/s, who limp, on a treadmill, and runners: outdoors triangulated and refined from three cameras
(as in benchmarks.scene), indoors from markers. Limits: strikes and toe offs within 10 ms (`ideal`) and 20 ms (`real`)
in the median, sd of step times 18 ms and of step lengths 1 cm at `ideal`, the same of the means of walks at `real`,
intervals that hold 90-98 %. The simulator's feet have no toes, and how long these are on the floor after the ball has
left was chosen on real walks (dior/simulate/patterns.py): the bias of toe offs says nothing of real feet. Two real
walks are in tests/gait.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import sys
from dataclasses import dataclass, replace

import numpy as np

from benchmarks import scene
from benchmarks.triangulation import reconstructed
from dior.body.names import PLUG_IN_GAIT_39
from dior.gait import events, parameters, tracks
from dior.reconstruct import refine
from dior.simulate.body import Body
from dior.simulate.gait import Walker
from dior.simulate.motion import Motion
from dior.simulate.patterns import RUN, WALK, of_person
from dior.simulate.runs import runs
from dior.simulate.soft_tissue import movement

SEEDS = 20
FRAMES = 400
LEVELS = ("ideal", "real")
SPEEDS, RUNS = (0.4, 1.6), (2.0, 2.6)
CASES = ("walking", "limping", "treadmill", "running")
LIMP = 0.06
MOCAP_HZ = {"ideal": 100.0, "real": 120.0}
NOISE_M, GAPS, TISSUE_M = 0.0002, {"ideal": 0.0, "real": 0.02}, {"ideal": None, "real": (0.005, 0.010)}
NEAR_S = 0.15  # an event further from any true one is a false one
FIGURES = ("step_time", "step_length", "step_width", "stride_time", "stride_length", "stance_share")


@dataclass(frozen=True)
class Walk:
    """One person's walk: true contacts (`gait.Contacts`) and positions at any time."""

    motion: Motion
    walker: Walker
    belt: np.ndarray

    @property
    def contacts(self):
        return self.walker.contacts


def walk(case, seed):
    """`Walk` of a person that the seed draws."""
    random = np.random.default_rng([seed, CASES.index(case)])
    runs_ = case == "running"
    pattern = of_person(RUN if runs_ else WALK, random)
    if case == "limping":
        pattern = replace(pattern, second=0.5 + LIMP * random.choice((-1, 1)))
    # speeds in turn, from the slowest to the fastest
    low, high = RUNS if runs_ else SPEEDS
    speed = low + (high - low) * (seed % SEEDS) / (SEEDS - 1)
    height = float(random.uniform(1.6, 1.85))
    on_belt = case == "treadmill"
    loop = {"half_length": 40.0} if on_belt else {"half_length": 2.2, "turn_radius": 0.8 if runs_ else 0.45}
    walker = Walker(
        Body(height), pattern, speed=float(speed), direction=float(random.uniform(-0.07, 0.07)),
        start=2.0 if on_belt else float(random.uniform(0.0, 8.0)), until=FRAMES / scene.FPS + 2.0, **loop,
    )  # fmt: skip
    belt = np.zeros(2)
    origin = np.zeros(3)
    if on_belt:
        first, last = (walker.at(np.array([t]))[0][0, 23:25].mean(axis=0) for t in (0.0, 10.0))
        belt = -(last - first)[:2] / 10.0
        origin[:2] = first[:2]

    def at(t):
        shift = np.zeros((len(t), 3))
        shift[:, :2] = np.outer(t, belt)
        return tuple(points + (shift - origin)[:, None] for points in walker.at(t))

    every = len(PLUG_IN_GAIT_39)
    return Walk(Motion(PLUG_IN_GAIT_39, height, at, lambda t: np.ones((len(t), every), bool)), walker, belt)


def outdoors(level, seed, made):
    """`Tracks` of the refined skeleton."""
    s = scene.make(level, seed, FRAMES, motion=made.motion)
    points, covariance, time_s, stays = reconstructed(s)
    path, spread, _, lasting = refine.refined(
        points, covariance, list(s.names), scene.FPS, time_s, stays, max_gap_s=0.2
    )
    return tracks.of_joints(s.seconds, path, s.names, spread, lasting, tracks.REFINED_S)


def indoors(level, seed, made):
    """`Tracks` of the markers."""
    random = np.random.default_rng([seed, 7])
    seconds = np.arange(0, FRAMES / scene.FPS, 1 / MOCAP_HZ[level])
    points = made.motion.at(seconds)[1]
    if TISSUE_M[level]:
        stride_hz = float(made.walker.pattern.strides(made.walker.speed, made.motion.height))
        points = points + movement(random, points.shape[1], TISSUE_M[level], stride_hz)(seconds)
    points = points + NOISE_M * random.standard_normal(points.shape)
    for j in range(points.shape[1]):
        points[runs(random, len(points), GAPS[level], (5, 40)) >= 0, j] = np.nan
    return tracks.of_joints(seconds, points, made.motion.names)


WHERE = {"outdoors": outdoors, "indoors": indoors}


def errors_of_events(found, true, last):
    """Per kind: errors s, standard errors s, of those that count; and how many were missed and wrong."""
    out = {}
    inside = (true.seconds > 0.2) & (true.seconds < last - 0.2)
    for strike in (True, False):
        off, sigma, missed, wrong = [], [], 0, 0
        for side in (0, 1):
            own = np.flatnonzero((found.strike == strike) & (found.side == side))
            truly = true.seconds[(true.strike == strike) & (true.foot == side) & inside]
            far = np.abs(found.seconds[own, None] - true.seconds[(true.strike == strike) & (true.foot == side)])
            wrong += int((far.min(axis=1) > NEAR_S).sum())
            for when in truly:
                k = own[np.abs(found.seconds[own] - when).argmin()] if len(own) else None
                if k is None or abs(found.seconds[k] - when) > NEAR_S:
                    missed += 1
                elif found.reason[k] == "":
                    off.append(found.seconds[k] - when)
                    sigma.append(found.whole_sigma_s()[k])
        out[strike] = np.array(off), np.array(sigma), missed, wrong, len(truly)
    return out


def true_events(made, found):
    """The contacts as `Events`, to be used where the found ones are: parameters then are of the same steps."""
    c = made.contacts
    none = np.zeros(len(c.seconds))
    reason = np.full(len(c.seconds), "end", object)
    for i in range(len(reason)):
        k = np.flatnonzero((found.strike == c.strike[i]) & (found.side == c.foot[i]))
        if len(k):
            near = k[np.abs(found.seconds[k] - c.seconds[i]).argmin()]
            if abs(found.seconds[near] - c.seconds[i]) < NEAR_S:
                reason[i] = found.reason[near]
    return events.Events(c.seconds, c.foot, c.strike, none, reason, found.running, np.zeros(2))


def true_rows(made, found):
    """The parameters of true events and prints, by (name, side) and the end of the step or stride."""
    true = true_events(made, found)
    prints = np.where(true.strike[:, None], made.contacts.heel, np.nan)
    # no toes: a print of the contacts is a heel's
    toes = np.full((len(true.seconds), 3), np.nan)
    rows = [*parameters._steps(toes, true, prints), *parameters._strides(toes, true, prints)]
    out = {}
    for name, side, _, end, value in rows:
        out.setdefault((name, side), []).append((end, value.value))
    return {key: np.array(values) for key, values in out.items()}


def errors_of_rows(rows, pooled, true):
    """{name: (errors, sigmas)} of steps and strides, and {name: (errors, sigmas)} of the means of each side."""
    each, means, matched = {}, {}, {}
    for row in rows:
        ends = true.get((row.name, row.side))
        if ends is None:
            continue
        k = np.abs(ends[:, 0] - row.end).argmin()
        if abs(ends[k, 0] - row.end) < NEAR_S:
            each.setdefault(row.name, []).append((row.value - ends[k, 1], row.sigma))
            matched.setdefault((row.name, tracks.SIDES[row.side]), []).append(ends[k, 1])
    for one in pooled:
        sides = tracks.SIDES if one.side == "both" else (one.side,)
        truth = [matched[one.name, side] for side in sides if (one.name, side) in matched]
        if truth and sum(map(len, truth)) == one.count:
            name = one.name if one.side == "both" else f"{one.name} of a side"
            means.setdefault(name, []).append((one.value - np.mean([np.mean(t) for t in truth]), one.sigma))
    return each, means


def held(errors, sigma):
    return float((np.abs(errors) <= parameters.IN_95 * sigma).mean()) if len(errors) else np.nan


def print_events(case, found):
    for strike, parts in found.items():
        off, sigma = (np.concatenate([p[i] for p in parts]) for i in (0, 1))
        missed, wrong = sum(p[2] for p in parts), sum(p[3] for p in parts)
        ms = 1000 * np.abs(off)
        print(
            f"   {case:<12}{'strike' if strike else 'toe off':<10}{len(off):>7}{missed:>8}{wrong:>7}"
            f"{1000 * np.median(off):>11.1f}{np.median(ms):>12.1f}{np.percentile(ms, 95):>7.1f}"
            f"{held(off, sigma):>8.1%}",
            flush=True,
        )


def print_parameters(each, means):
    print(
        f"   {'':<34}{'steps':>6}{'mean':>9}{'sd':>9}{'held':>8}{'walks':>10}{'mean':>9}{'sd':>9}{'held':>8}"
        f"{'sides':>10}{'mean':>9}{'sd':>9}{'held':>8}"
    )
    for case in CASES:
        for name in FIGURES:
            if (case, name) not in each:
                continue
            line = f"   {case:<12}{name:<22}"
            of_side = (case, f"{name} of a side")
            for width, sums, key in ((6, each, (case, name)), (10, means, (case, name)), (10, means, of_side)):
                off, sigma = np.array(sums.get(key, [(np.nan, np.nan)])).T
                line += f"{len(off):>{width}}{off.mean():>9.4f}{off.std():>9.4f}{held(off, sigma):>8.1%}"
            print(line)


def main():
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else SEEDS
    for where, make in WHERE.items():
        for level in LEVELS:
            print(f"{where}, {level}, {seeds} seeds")
            print(f"   {'':<22} events  missed  false  median ms median |ms|    p95    held")
            each, means = {}, {}
            for case in CASES:
                found = {True: [], False: []}
                for seed in spread(seeds):
                    made = walk(case, seed)
                    t = make(level, seed, made)
                    got = events.find(t)
                    for strike, one in errors_of_events(got, made.contacts, t.seconds[-1]).items():
                        found[strike].append(one)
                    rows = errors_of_rows(*parameters.of_walk(t, got), true_rows(made, got))
                    for sums, some in zip((each, means), rows, strict=True):
                        for name, values in some.items():
                            sums.setdefault((case, name), []).extend(values)
                print_events(case, found)
            print_parameters(each, means)


def spread(seeds):
    """So many seeds, from the slowest walker to the fastest."""
    return np.unique(np.round(np.linspace(0, SEEDS - 1, seeds)).astype(int)).tolist() if seeds < SEEDS else range(seeds)


if __name__ == "__main__":
    main()
