"""A camera that is bumped by 0.3 degrees after the third of six walks: is it found, and is a clean session left alone?

usage: python -m benchmarks.bumps [SESSIONS] [FRAMES]      (20 sessions of walks of 300 pictures)

Three cameras of benchmarks/scene.py, walks across, along and running in turn; the axis of the bump and the camera are
drawn. The cameras' poses are the true ones of before, the intrinsics those of the level.
"""

import sys

import numpy as np

from benchmarks import scene
from dior.evaluate import moved
from dior.geometry import covariance as cov
from dior.reconstruct.swaps import exchange, find_exchanged
from dior.simulate.settings import WALKS

BUMP_DEG, SEQUENCES, FIRST = 0.3, 6, 3


def session(level, seed, bump_deg, frames):
    """The `moved.Change` that is found in a session, or None, and the camera that was bumped."""
    stood = [scene.camera(f"cam{i + 1:02d}", azimuth) for i, azimuth in enumerate(scene.AZIMUTHS)]
    random = np.random.default_rng([seed, 5])
    axis = random.standard_normal(3)
    step = np.concatenate([np.radians(bump_deg) * axis / np.linalg.norm(axis), np.zeros(3)])
    which = int(random.integers(len(stood)))
    found = []
    for take in range(SEQUENCES):
        true = [cov.moved(c, step) if take >= FIRST and i == which else c for i, c in enumerate(stood)]
        walk = scene.make(level, seed, frames, true, WALKS[take % len(WALKS)], take)
        rig = [given.at(c.wTc) for given, c in zip(walk.given, stood, strict=True)]
        swapped = find_exchanged(rig, walk.uv, walk.score, walk.names, scene.FPS)
        uv, score = (exchange(values, swapped, walk.names) for values in (walk.uv, walk.score))
        found.append(moved.normal(rig, uv, score, walk.names))
    return moved.find_change(found), which


def main():
    sessions = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    frames = int(sys.argv[2]) if len(sys.argv) > 2 else 300
    print(f"{sessions} sessions (seeds 0-{sessions - 1}) of {SEQUENCES} walks of {frames} pictures")
    print(
        f"{'detector':<10}{'found':>8}{'right sequence':>16}{'right camera':>14}{'turn, deg':>11}{'false alarms':>14}"
    )
    for level in ("ideal", "real"):
        bumped = [session(level, seed, BUMP_DEG, frames) for seed in range(sessions)]
        clean = [session(level, seed, 0.0, frames)[0] for seed in range(sessions)]
        found = [(change, which) for change, which in bumped if change]
        right = sum(change.first == FIRST for change, _ in found), sum(c.camera == which for c, which in found)
        turn = np.median([change.turn_deg for change, _ in found]) if found else np.nan
        alarms = sum(change is not None for change in clean)
        print(f"{level:<10}{len(found):>8}{right[0]:>16}{right[1]:>14}{turn:>11.2f}{alarms:>14}", flush=True)


if __name__ == "__main__":
    main()
