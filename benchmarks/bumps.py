"""A camera that is bumped by 0.3 degrees after half of two, four or six walks: is it found, and is a clean session left
alone?

usage: python -m benchmarks.bumps [SESSIONS] [FRAMES]      (20 sessions of walks of 150 pictures)

Three cameras of benchmarks/scene.py, walks across, along and running in turn; the axis of the bump and the camera are
drawn. The cameras' poses are the true ones of before, the intrinsics those of the level. `right camera` counts those,
too, of which the finding says that it may be either.
"""

import sys

import numpy as np

from benchmarks import scene
from dior.evaluate import moved
from dior.geometry import covariance as cov
from dior.reconstruct.swaps import exchange, find_exchanged
from dior.simulate.settings import WALKS

BUMP_DEG, SEQUENCES = 0.3, (2, 4, 6)


def session(level, seed, bump_deg, frames, walks):
    """The `moved.Change` that is found in a session, or None, and the camera that was bumped."""
    stood = [scene.camera(f"cam{i + 1:02d}", azimuth) for i, azimuth in enumerate(scene.AZIMUTHS)]
    random = np.random.default_rng([seed, 5])
    axis = random.standard_normal(3)
    step = np.concatenate([np.radians(bump_deg) * axis / np.linalg.norm(axis), np.zeros(3)])
    which = int(random.integers(len(stood)))
    found = []
    for take in range(walks):
        true = [cov.moved(c, step) if take >= walks // 2 and i == which else c for i, c in enumerate(stood)]
        walk = scene.make(level, seed, frames, true, WALKS[take % len(WALKS)], take)
        rig = [given.at(c.wTc) for given, c in zip(walk.given, stood, strict=True)]
        swapped = find_exchanged(rig, walk.uv, walk.score, walk.names, scene.FPS)
        uv, score = (exchange(values, swapped, walk.names) for values in (walk.uv, walk.score))
        found.append(moved.normal(rig, uv, score, walk.names))
    return moved.find_change(found), which


def main():
    sessions = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    frames = int(sys.argv[2]) if len(sys.argv) > 2 else 150
    print(f"{sessions} sessions (seeds 0-{sessions - 1}) of walks of {frames} pictures, bumped by {BUMP_DEG} degrees")
    print(
        f"{'detector':<10}{'walks':>6}{'found':>8}{'right sequence':>16}{'right camera':>14}{'turn, deg':>11}"
        f"{'false alarms':>14}"
    )
    for level in ("ideal", "real"):
        for walks in SEQUENCES:
            bumped = [session(level, seed, BUMP_DEG, frames, walks) for seed in range(sessions)]
            clean = [session(level, seed, 0.0, frames, walks)[0] for seed in range(sessions)]
            found = [(change, which) for change, which in bumped if change]
            place = sum(change.first == walks // 2 for change, _ in found)
            camera = sum(which in (change.camera, *change.others) for change, which in found)
            turn = np.median([change.turn_deg for change, _ in found]) if found else np.nan
            alarms = sum(change is not None for change in clean)
            print(f"{level:<10}{walks:>6}{len(found):>8}{place:>16}{camera:>14}{turn:>11.2f}{alarms:>14}", flush=True)


if __name__ == "__main__":
    main()
