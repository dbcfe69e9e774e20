"""The long-range camera placed from 30 hand boxes, 60 m away, from a start 1 degree and 2 m off: errors of its labels.

usage: python -m benchmarks.long_range [SEEDS]      (SEEDS: 20)

The error of a label is that of the camera alone: the true joints projected by the found and by the true camera. The 3D
that the boxes are fitted to is the true one or that of three close cameras, `ideal` and `real` detectors. An edge of a
box has an error of 1 px sd. `error/sigma` and `inside` tell whether the stated intervals are honest: the rms over the
seeds of a label's error in units of its sigma, and how often a 95 % ellipse holds the truth.
"""

import sys
from functools import cache

import numpy as np

from benchmarks import scene
from dior import covariance
from dior.calibrate import boxes_fit
from dior.camera import Camera, Intrinsics, in_frame, pose, project
from dior.geometry import look_at_angles, rotation_x, rotation_z
from dior.reconstruct.swaps import exchange, find_exchanged
from dior.views import DROP_FACTOR, by_dropping, usual_error

FRAMES, BOXES = 600, 30
RANGE_M, FX = 60.0, 760.0
START_DEG, START_M = 1.0, 2.0
EDGE_SD_PX = 1.0
CHI2_95 = 5.991


def long_range(seed):
    """A true camera: it misses the middle of the walkway by half a degree, and is tilted a little."""
    random = np.random.default_rng([seed, 1])
    centre = np.array([0.0, RANGE_M, 1.9])
    azimuth, elevation = look_at_angles(centre, (0, 0, 1)) + np.radians(0.5) * random.standard_normal(2)
    wRc = rotation_z(azimuth) @ rotation_x(elevation) @ rotation_z(np.radians(0.3) * random.standard_normal())
    return Camera("cam04", Intrinsics(1280, 720, FX, FX, 639.5, 359.5), pose(wRc, centre), "long_range")


def off(camera, seed):
    """A start: the range 2 m off and the aim 1 degree, in a random direction; upright."""
    random = np.random.default_rng([seed, 2])
    forward = camera.wRc[:, 2]
    azimuth, elevation = look_at_angles(camera.centre, camera.centre + forward)
    angle = random.uniform(0, 2 * np.pi)
    azimuth += np.radians(START_DEG) * np.cos(angle)
    elevation += np.radians(START_DEG) * np.sin(angle)
    centre = camera.centre + START_M * random.choice([-1, 1]) * np.array([0.0, 1.0, 0.0])
    return camera.at(pose(rotation_z(azimuth) @ rotation_x(elevation), centre))


@cache
def capture(level, seed):
    """The walk, the given long-range camera, its true pixels and the 3D of the close cameras (T, J, 3)."""
    walk = ("across", "along")[seed % 2]
    around = [scene.camera(f"cam{i + 1:02d}", azimuth) for i, azimuth in enumerate(scene.AZIMUTHS)]
    made = scene.make(level, seed, FRAMES, [*around, long_range(seed)], walk)
    close, uv = made.given[:3], made.uv[:3]
    score = np.where(made.score[:3] >= 0.3, made.score[:3], 0.0)
    swapped = find_exchanged(close, uv, score, list(made.names))
    uv, score = exchange(uv, swapped, list(made.names)), exchange(score, swapped, list(made.names))
    limit = min(45.0, DROP_FACTOR * usual_error(close, uv, score))
    points, _, _, good = by_dropping(close, uv, score, limit, 45.0)
    return made, np.where(good[..., None], points, np.nan)


def boxes(uv, shown, margin, seed):
    """Boxes (F, 4) px drawn around joints uv (F, J, 2) that are `shown` (F, J)."""
    random = np.random.default_rng([seed, 3])
    low = np.where(shown[..., None], uv, np.inf).min(axis=1)
    high = np.where(shown[..., None], uv, -np.inf).max(axis=1)
    tight = np.concatenate([low, high], axis=1)
    outwards = margin + EDGE_SD_PX * random.standard_normal(tight.shape)
    return np.where(np.isfinite(tight), tight + outwards * boxes_fit.OUTWARDS, np.nan)


def fitted(level, seed, margin, true_3d, occluder=False, count=BOXES):
    made, points = capture(level, seed)
    points = made.points if true_3d else points
    frames = np.linspace(0, FRAMES - 1, count).round().astype(int)
    uv = made.true_uv[3][frames]
    shown = in_frame(made.cameras[3].intrinsics, uv)
    if occluder:
        # a wall that is level with the hips in the picture
        hips = uv[:, 23:25, 1].mean()
        shown = shown & (uv[..., 1] < hips)
    drawn = boxes(uv, shown, margin, seed)
    if occluder:
        random = np.random.default_rng([seed, 3])
        drawn[:, 3] = hips + margin + EDGE_SD_PX * random.standard_normal(drawn.shape)[:, 3]
    seen = boxes_fit.Seen(
        points[frames], drawn, np.full((count, 33, 2), np.nan), made.seconds[frames], np.zeros(count, int)
    )
    freedom = boxes_fit.Freedom(shift=(START_M, 0.0, 0.0))
    return boxes_fit.fit(off(made.given[3], seed), freedom, seen, f"{level} {seed}")


def label_errors(level, seed, fit):
    """Errors (T, J, 2) px of the camera's labels, and their covariance (T, J, 2, 2)."""
    made, _ = capture(level, seed)
    points = made.points[::60]
    error = project(fit.camera, points)[0] - made.true_uv[3][::60]
    _, by_camera = covariance.projection(fit.camera, points)
    return error, by_camera @ fit.pose_covariance @ np.swapaxes(by_camera, -1, -2)


def line(level, seeds, name, **how):
    mean, chi2, distances = [], [], []
    for seed in range(seeds):
        fit = fitted(level, seed, **how)
        error, spread = label_errors(level, seed, fit)
        mean.append(np.linalg.norm(error, axis=-1).mean())
        chi2.append(np.einsum("...i,...ij,...j", error, np.linalg.inv(spread), error).ravel())
        distances.append(fit)
    chi2 = np.concatenate(chi2)
    hidden = sum(fit.hidden == "v_max" for fit in distances)
    print(
        f"  {name:<44}{np.mean(mean):>7.2f}{np.max(mean):>7.2f}{np.sqrt(chi2.mean() / 2):>10.2f}"
        f"{(chi2 < CHI2_95).mean():>8.1%}{hidden:>8}"
    )


def main():
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    for level in ("ideal", "real"):
        print(f"{level}: {seeds} seeds, {BOXES} boxes   label px mean  worst  error/sigma  inside  occluder")
        for true_3d in (True, False):
            for margin in (0.0, 1.0, 3.0):
                name = f"{'true 3D' if true_3d else 'three close cameras'}, drawn {margin:g} px large"
                line(level, seeds, name, margin=margin, true_3d=true_3d)
            line(level, seeds, "  half the body hidden, 0 px", margin=0.0, true_3d=true_3d, occluder=True)


if __name__ == "__main__":
    main()
