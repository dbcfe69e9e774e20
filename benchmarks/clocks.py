"""Clocks: how far off they are, and whether their intervals hold; whether one that is wrong is named.

usage: python -m benchmarks.clocks [SEEDS] [PART ...]      (20 seeds, all parts)

The parts detections, marks, pictures and cameras are benchmarks of their own, `clocks_<part>`, too. `wrong`: of three
cameras by hand-given clocks one is a picture off; is it named, and no other? `real`: ../shared/data/real_outdoor.
"""

import sys

import numpy as np

from benchmarks import (
    clocks_cameras,
    clocks_detections,
    clocks_marks,
    clocks_pictures,
    clocks_real,
    real_outdoor,
    scene,
)
from dior.calibrate import clocks
from dior.calibrate.clock import from_cameras
from dior.clocks import clock as on_axis

PARTS = ("detections", "marks", "pictures", "cameras", "wrong", "real")
FRAMES = 600


def wrong(seeds):
    """Print how often a camera that is a whole picture off is named, and how often a right one is."""
    print(f"one of three cameras a picture wrong by config/offsets, walks of {FRAMES / scene.FPS:g} s, {seeds} seeds")
    print(f"{'level':<8}{'named':>8}{'wrongly named':>15}{'reprojection error, px: right':>31}{'wrong':>8}")
    for level in ("ideal", "real"):
        named, wrongly, right, worse = 0, 0, [], []
        for seed in range(seeds):
            made, late = scene.make(level, seed, FRAMES), 1 + seed % 2
            by_hand = {c.name: on_axis.Clock(0.0, 0.0, "manual", given=(0.0, 0.0)) for c in made.given[1:]}
            off = made.given[late].name
            by_hand[off] = on_axis.Clock(1 / scene.FPS, 0.0, "manual", given=(0.0, 0.0))
            uv = np.where((made.score > 0.3)[..., None], made.uv, np.nan)
            seen = [from_cameras.TimedDetections(made.seconds, one, 2.5 / scene.FPS) for one in uv]
            told = from_cameras.from_detections(list(made.given), seen, list(made.names), made.seconds, scene.FPS)
            names = [c.name for c in made.given]
            said = clocks.findings_of("walk", told, by_hand, names, None, 1 / scene.FPS, False)
            doubted = {scope.split("/")[1] for scope, _, code, _ in said if code == "clock_contradicts"}
            named += off in doubted
            wrongly += len(doubted - {off})
            right.append(_error(made, uv, late, 0))
            worse.append(_error(made, uv, late, 1))
        print(f"{level:<8}{named:>5}/{seeds}{wrongly:>15}{np.mean(right):>31.2f}{np.mean(worse):>8.2f}", flush=True)


def _error(made, uv, late, pictures):
    """Median reprojection error px with one camera `pictures` late."""
    from dior.geometry.camera import reprojection_errors
    from dior.geometry.triangulation import triangulated

    uv = np.stack([np.roll(one, pictures * (view == late), axis=0) for view, one in enumerate(uv)])[:, 1:]
    uv = uv.reshape(len(uv), -1, 2)
    return np.nanmedian(reprojection_errors(made.given, triangulated(made.given, uv), uv))


def main():
    words = sys.argv[1:]
    seeds = int(words.pop(0)) if words and words[0].isdigit() else 20
    parts = words or PARTS
    made = {
        "detections": clocks_detections.table, "marks": clocks_marks.table, "pictures": clocks_pictures.table,
        "cameras": clocks_cameras.table,
    }  # fmt: skip
    pooled = []
    for part in parts:
        if part == "wrong":
            wrong(seeds)
        elif part == "real":
            clocks_real.table(real_outdoor.ROOT.parent / "shared/data/real_outdoor")
        else:
            pooled += list(made[part](range(seeds) if part == "pictures" else seeds))
        print()
    if pooled:
        error, sigma = np.array(pooled).T
        ratio = error / sigma
        print(
            f"all {len(ratio)} clocks: {(np.abs(ratio) < on_axis.NORMAL_95).mean():.1%} in their 95 % intervals (limit "
            f"90-98), rms(error/sigma) {np.sqrt((ratio**2).mean()):.2f} (0.8-1.25)"
        )


if __name__ == "__main__":
    main()
