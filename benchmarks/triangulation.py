"""Triangulation against the truth: accuracy and speed beside the peers, exchanged sides, error bars, smoothing.

usage: python -m benchmarks.triangulation [1 2 3 4]      (the tables to print; all by default)

1  errors and time per point with and without 5 % gross outliers; limits 21.5 mm, 39 mm, 2 us at `ideal`
2  legs exchanged in one view, and a limb taken for the other in two views; limits: recall 95 %, false 0.5 %
3  the covariance of the points: rms(error / sigma) 0.8-1.25, 95 % ellipsoids hold 90-98 %
4  triangulated and refined: errors, covariance and lag
Tables 1 and 2: one walk of two minutes; 3 and 4: `SEEDS` walks. Times are those of the
processor, in one thread, as Snakemake gives a job.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import sys
import time

import numpy as np

from benchmarks import scene
from dior import camera as cam
from dior import geometry
from dior.reconstruct import robust
from dior.reconstruct.triangulate import by_rays

LEVELS = ("ideal", "real")
FRAMES = 3600
OUTLIERS = 0.05
RUNS = 7
PEER_POINTS = 2000  # of the slow peers only so many points are timed
SEEDS = range(12)
SHORT = 400
IN_95 = 7.815  # chi squared, three degrees of freedom


def score_of(uv, score):
    return np.where(np.isfinite(uv).all(axis=-1), score, 0.0)


def dlt(cameras, uv, score):
    xy = np.stack([cam.undistort(c.intrinsics, view) for c, view in zip(cameras, uv, strict=True)])
    return geometry.triangulate([cam.inverse_pose(c.wTc) for c in cameras], xy, score)


def rays(cameras, uv, score):
    return by_rays(cameras, uv)


def opencv(cameras, uv, score):
    """Mean of the points of all pairs of views; OpenCV has no more than two."""
    from itertools import combinations

    import cv2

    P = [c.intrinsics.K @ cam.inverse_pose(c.wTc)[:3] for c in cameras]
    found = []
    for a, b in combinations(range(len(cameras)), 2):
        X = cv2.triangulatePoints(P[a], P[b], uv[a].reshape(-1, 2).T, uv[b].reshape(-1, 2).T)
        found.append((X[:3] / X[3]).T)
    return np.mean(found, axis=0).reshape(*uv.shape[1:-1], 3)


def ours(cameras, uv, score):
    return robust.triangulate(cameras, uv, score, scene.FPS).points


def aniposelib(cameras, uv, score):
    from aniposelib.cameras import Camera, CameraGroup

    group = CameraGroup([_anipose_camera(Camera, c) for c in cameras])
    return group.triangulate(uv.reshape(len(cameras), -1, 2)).reshape(*uv.shape[1:-1], 3)


def aniposelib_ransac(cameras, uv, score):
    from aniposelib.cameras import Camera, CameraGroup

    group = CameraGroup([_anipose_camera(Camera, c) for c in cameras])
    return group.triangulate_ransac(uv.reshape(len(cameras), -1, 2))[0].reshape(*uv.shape[1:-1], 3)


def _anipose_camera(kind, camera):
    import cv2

    cTw = cam.inverse_pose(camera.wTc)
    lens = camera.intrinsics
    return kind(
        matrix=lens.K,
        dist=np.array(lens.distortion[:5]),
        size=(lens.width, lens.height),
        rvec=cv2.Rodrigues(cTw[:3, :3])[0].ravel(),
        tvec=cTw[:3, 3],
        name=camera.name,
    )


def pose2sim(cameras, uv, score):
    """Its weighted DLT of the best cameras: cameras left out until the mean error is below its 15 px."""
    from itertools import combinations

    from Pose2Sim.common import reprojection, weighted_triangulation

    P = [c.intrinsics.K @ cam.inverse_pose(c.wTc)[:3] for c in cameras]
    flat = uv.reshape(len(cameras), -1, 2)
    out = np.full((flat.shape[1], 3), np.nan)
    for i in range(len(out)):
        best = np.inf
        for left in range(len(cameras), 1, -1):
            for kept in combinations(range(len(cameras)), left):
                at = [P[v] for v in kept], [flat[v, i, 0] for v in kept], [flat[v, i, 1] for v in kept]
                Q = weighted_triangulation(*at, [1.0] * left)
                u, v = zip(*(reprojection([p], Q) for p in at[0]), strict=True)
                error = np.mean(np.hypot(np.ravel(u) - at[1], np.ravel(v) - at[2]))
                if error < best:
                    best, out[i] = error, Q[:3]
            if best < 15.0:
                break
    return out.reshape(*uv.shape[1:-1], 3)


FAST = {"plain DLT, batched": dlt, "the paper's rays, batched": rays, "OpenCV, mean of pairs": opencv, "dior": ours}
SLOW = {"aniposelib": aniposelib, "aniposelib RANSAC": aniposelib_ransac, "Pose2Sim, best cameras": pose2sim}


def errors_mm(points, truth, among):
    error = 1000 * np.linalg.norm(points - truth, axis=-1)[among]
    known = np.isfinite(error)
    return error[known].mean(), np.percentile(error[known], 95), known.mean()


def print_accuracy():
    print(f"1. {FRAMES} x 33 points, medians of {RUNS} runs (limit with outliers at ideal: 21.5 mm, 39 mm, 2 us)")
    for level in LEVELS:
        s = scene.make(level, frames=FRAMES)
        # exchanged sides are table 2's
        sound = ~(s.swapped | s.wrong).any(axis=0) & np.isfinite(s.uv).all(axis=(0, -1))
        for share in (0.0, OUTLIERS):
            uv, _ = scene.with_outliers(s.uv, share)
            score = score_of(uv, s.score)
            print(f"   {level}, {share:.0%} outliers")
            print(f"   {'':<28}{'mean mm':>9}{'p95 mm':>8}{'known':>8}{'us/point':>10}{'of DLT':>8}")
            spent, found = {name: [] for name in FAST}, {}
            for _ in range(RUNS):
                for name, method in FAST.items():
                    start = time.process_time()
                    found[name] = method(s.cameras, uv, score)
                    spent[name].append((time.process_time() - start) / score[0].size * 1e6)
            usual = np.median(spent["plain DLT, batched"])
            for name, times in spent.items():
                _print_row(name, errors_mm(found[name], s.points, sound), np.median(times), usual)
            rows = slice(0, PEER_POINTS // score.shape[2])
            for name, method in SLOW.items():
                try:
                    start = time.process_time()
                    points = method(s.cameras, uv[:, rows], score[:, rows])
                except ImportError:
                    print(f"   {name:<28}not installed")
                    continue
                each = (time.process_time() - start) / score[0, rows].size * 1e6
                _print_row(name, errors_mm(points, s.points[rows], sound[rows]), each, usual)


def _print_row(name, errors, each, usual):
    print(f"   {name:<28}{errors[0]:>9.2f}{errors[1]:>8.1f}{errors[2]:>8.1%}{each:>10.2f}{each / usual:>8.2f}")


def print_covariance():
    print(
        f"3. Covariance of the points, true cameras, seeds {SEEDS[0]}-{SEEDS[-1]}, {SHORT} frames (0.8-1.25, 90-98 %)"
    )
    for level in LEVELS:
        z, inside, each = [], [], []
        for seed in SEEDS:
            s = scene.make(level, seed, SHORT)
            score = score_of(s.uv, s.score)
            found = robust.triangulate(s.cameras, s.uv, score, scene.FPS)
            covariance = robust.covariance(
                s.cameras, found.points, np.where(found.used, score, 0) / found.sigma[:, None]
            )
            sound = ~(s.swapped | s.wrong).any(axis=0)
            a, b = standardised(found.points - s.points, covariance, sound)
            z.append(a), inside.append(b), each.append(np.sqrt((a**2).mean()))
        z, inside = np.concatenate(z), np.concatenate(inside)
        spread = f"seeds {min(each):.2f}-{max(each):.2f}"
        print(f"   {level:<8}rms(error / sigma) {np.sqrt((z**2).mean()):.3f} ({spread}), inside {inside.mean():.1%}")


def standardised(error, covariance, among):
    """Errors over sigma (N, 3), and whether each is in the 95 % ellipsoid (N,), of the known ones."""
    known = among & np.isfinite(covariance).all(axis=(-1, -2)) & np.isfinite(error).all(axis=-1)
    e, C = error[known], covariance[known]
    square = np.einsum("ni,ni->n", e, np.linalg.solve(C, e[..., None])[..., 0])
    return e / np.sqrt(np.diagonal(C, axis1=-2, axis2=-1)), square < IN_95


TABLES = {"1": print_accuracy, "3": print_covariance}


def main():
    for name in sys.argv[1:] or TABLES:
        TABLES[name]()


if __name__ == "__main__":
    main()
