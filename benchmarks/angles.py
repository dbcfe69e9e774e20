"""Joint angles by OpenSim against those of the simulator, and against Plug-in-Gait's of a real walk.

usage: python -m benchmarks.angles [SEEDS]      (3 by default; the extra `angles` has to be installed)

Simulated: walkers of 0.8 to 1.4 m/s, turns included, for 6 s. `markers` are those of a motion capture with 0.2 mm of
noise, `skin` the same on skin that slides by 5 to 10 mm, `joints` three cameras' triangulated and refined 3D (as in
benchmarks.scene). Of every angle: the constant offset, degrees, what is left after it (rms), the sigma that is told
(root mean square), and the share of errors after the offset within 1.96 of it. Real:
../shared/data/mocap/overground_events_100hz.c3d, whose file holds Plug-in-Gait's angles. A subject's axes are nobody's
in particular: the turns of the long axes of thigh and foot depend on how markers are placed.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from benchmarks.joint_centres import WALK, points_of
from dior.body.names import PLUG_IN_GAIT_39
from dior.gait.tracks import REFINED_S
from dior.release.angles import angles
from dior.simulate.body import Body
from dior.simulate.gait import Walker
from dior.simulate.patterns import WALK as GAIT
from dior.simulate.patterns import of_person
from dior.simulate.soft_tissue import movement

SEEDS, SECONDS, HZ = 3, 6.0, 50.0
NOISE_M, SKIN_M = 0.0002, (0.005, 0.010)
KINDS = ("markers", "skin", "joints")
# of Plug-in-Gait's angles: name in the file, axis, sign
PLUG_IN_GAIT = {
    f"{name}_{end}": (f"{letter}{group}", axis)
    for end, letter in (("r", "R"), ("l", "L"))
    for name, group, axis in (
        ("hip_flexion", "HipAngles", 0),
        ("hip_adduction", "HipAngles", 1),
        ("hip_rotation", "HipAngles", 2),
        ("knee_angle", "KneeAngles", 0),
        ("ankle_angle", "AnkleAngles", 0),
    )
}


def walker(seed, seconds=SECONDS):
    """A walker whom the seed draws."""
    random = np.random.default_rng([seed, 11])
    return Walker(
        Body(float(random.uniform(1.6, 1.85))), of_person(GAIT, random), speed=float(random.uniform(0.8, 1.4)),
        half_length=1.8, start=float(random.uniform(0, 8)), until=seconds + 2.0,
    )  # fmt: skip


def simulated(kind, seed, seconds=SECONDS):
    """The 3D of a walker (`angles.Walk`) and the true angles (T,) by name."""
    who = walker(seed, seconds)
    if kind == "joints":
        return _of_cameras(who, seed, seconds)
    t = np.arange(0, seconds, 1 / HZ)
    random = np.random.default_rng([seed, 12])
    points = who.at(t)[1]
    if kind == "skin":
        stride_hz = float(who.pattern.strides(who.speed, who.body.height))
        points = points + movement(random, points.shape[1], SKIN_M, stride_hz)(t)
    points = points + NOISE_M * random.standard_normal(points.shape)
    return of_markers(HZ, points, PLUG_IN_GAIT_39), who.angles(t)


def of_markers(rate, points, names):
    """`angles.Walk` of markers, of whose errors nobody knows anything."""
    shape = points.shape[:2]
    nothing = np.full((*shape, 3, 3), np.nan)
    return angles.Walk(rate, 0, tuple(names), points, nothing, np.full(shape, np.nan), REFINED_S)


def _of_cameras(who, seed, seconds):
    from benchmarks import scene
    from benchmarks.triangulation import reconstructed
    from dior.reconstruct import refine
    from dior.simulate.motion import Motion

    every = len(PLUG_IN_GAIT_39)
    motion = Motion(PLUG_IN_GAIT_39, who.body.height, who.at, lambda t: np.ones((len(t), every), bool))
    s = scene.make("ideal", seed, int(seconds * scene.FPS), motion=motion)
    points, covariance, time_s, stays = reconstructed(s)
    path, spread, _, lasting = refine.refined(
        points, covariance, list(s.names), scene.FPS, time_s, stays, max_gap_s=0.2
    )
    return angles.Walk(scene.FPS, 0, tuple(s.names), path, spread, lasting, REFINED_S), who.angles(s.seconds)


def real(path=WALK):
    """The real walk's 3D and Plug-in-Gait's angles (T,) by name."""
    rate, at, names = points_of(path)
    true = {name: np.where(at[group] == 0, np.nan, at[group])[:, axis] for name, (group, axis) in PLUG_IN_GAIT.items()}
    return of_markers(rate, np.stack([at[name] for name in names], axis=1) / 1000, names), true


def errors(walk, true, draws=angles.DRAWS):
    """{angle: (errors (T,), sigmas (T,))} of a walk, degrees."""
    with TemporaryDirectory() as folder:
        found = angles.angles_of(walk, "walk", Path(folder), draws)
    off = {name: (found.degrees[name] - true[name] + 180) % 360 - 180 for name in true if name in found.degrees}
    return {name: (one, found.sigma[name]) for name, one in off.items()}


def print_errors(rows):
    """`rows`: what `errors` gives, of walks."""
    for name in rows[0]:
        offset, left, sigma, held = [], [], [], []
        for row in rows:
            off, told = row[name]
            known = np.isfinite(off)
            offset.append(off[known].mean())
            left.append(off[known] - offset[-1])
            sigma.append(told[known])
            held.append(np.abs(left[-1]) <= 1.96 * sigma[-1])
        left, sigma, held = (np.concatenate(one) for one in (left, sigma, held))
        print(
            f"   {name:<18}{np.mean(offset):>8.1f}{np.sqrt(np.mean(left**2)):>8.2f}"
            f"{np.sqrt(np.nanmean(sigma**2)):>8.2f}{held.mean():>8.0%}",
            flush=True,
        )


def main():
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else SEEDS
    angles.quiet_opensim()
    for kind in KINDS:
        print(f"simulated, {kind}, {seeds} seeds: offset, rms after it, sigma, degrees; in 95 %")
        print_errors([errors(*simulated(kind, seed)) for seed in range(seeds)])
    if WALK.is_file():
        print("Plug-in-Gait's of a real walk: the same")
        print_errors([errors(*real())])


if __name__ == "__main__":
    main()
