"""Triangulation against the truth: accuracy and speed beside the peers, exchanged sides, error bars, smoothing.

usage: python -m benchmarks.triangulation [1 2 3 4 5]      (the tables to print; all by default)

1  errors and time per point with and without 5 % gross outliers; limits 21.5 mm, 39 mm, 2 us at `ideal`
2  legs exchanged in one view, and a limb taken for the other in two views; limits: recall 95 %, false 0.5 %
3  the covariance of the points: rms(error / sigma) 0.8-1.25, 95 % ellipsoids hold 90-98 %
4  triangulated and refined: errors, covariance and lag
5  labels of cameras 2, 4.5 and 8 m from the walkway, all of them as they are: do 95 % ellipses hold at all depths, seen
   and hidden (90-98 %), intervals by walks
Tables 1 and 2: one walk of two minutes; 3 to 5: `SEEDS` walks. Times are those of the
processor, in one thread, as Snakemake gives a job.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import sys
import time

import numpy as np

from benchmarks import scene
from dior.body.names import LIMBS, is_leg, swap_index
from dior.evaluate import bootstrap
from dior.geometry import camera as cam
from dior.geometry import triangulation
from dior.geometry.covariance import projection
from dior.reconstruct import detector_noise, refine, robust, swaps
from dior.reconstruct.gates import implausible
from dior.reconstruct.triangulate import by_rays
from dior.simulate.runs import runs

LEVELS = ("ideal", "real")
FRAMES = 3600
OUTLIERS = 0.05
RUNS = 7
PEER_POINTS = 2000  # of the slow peers only so many points are timed
SEEDS = range(12)
SHORT = 400
GATES = (12.0, 8.0, 0.4)  # m/s of a joint and of the body, change of a bone, as in the config
MIN_SCORE = 0.3  # as in the config
IN_95, IN_95_PX = 7.815, 5.991  # chi squared, three and two degrees of freedom
NEAR_FAR = ((20.0, 2.0), (140.0, 4.5), (250.0, 8.0))  # degrees and m of table 5's cameras
DEPTHS = {"< 2 m": 0.0, "2-3 m": 2.0, "3-4 m": 3.0, "4-6 m": 4.0, "> 6 m": 6.0}


def score_of(uv, score):
    return np.where(np.isfinite(uv).all(axis=-1) & (score >= MIN_SCORE), score, 0.0)


def dlt(cameras, uv, score):
    xy = np.stack([cam.undistort(c.intrinsics, view) for c, view in zip(cameras, uv, strict=True)])
    return triangulation.triangulate([cam.inverse_pose(c.wTc) for c in cameras], xy, score)


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


def print_swaps():
    print(f"2. {FRAMES} frames, one fault at a time (limits: recall 95 %, false 0.5 % of the views' frames)")
    print(f"   {'':<42}{'recall':>8}{'false':>8}{'mm of the hit joints':>24}{'unknown':>9}{'us/point':>10}")
    for level in LEVELS:
        none = {"swapped": 0.0, "wrong_together": 0.0} if level == "real" else {}
        s = scene.make(level, frames=FRAMES, **none)
        for name, fault in (
            ("legs exchanged in one view", legs_exchanged),
            ("limb of the other side in two views", limbs),
        ):
            uv, hit = fault(s, np.random.default_rng(7))
            score = score_of(uv, s.score)
            before = robust.triangulate(s.cameras, uv, score, scene.FPS)
            start = time.process_time()
            exchanged = swaps.find_exchanged(s.cameras, uv, score, s.names, scene.FPS)
            uv, score = swaps.exchange(uv, exchanged, s.names), swaps.exchange(score, exchanged, s.names)
            sigma = detector_noise.estimated(s.cameras, uv, score, scene.FPS, s.names).sigma
            taken = swaps.find_mistaken_limbs(s.cameras, uv, score, sigma, s.names, scene.FPS)
            each = (time.process_time() - start) / score[0].size * 1e6
            kept = np.where(taken, 0.0, score)
            after = robust.triangulate(s.cameras, uv, kept, scene.FPS, sigma)
            covariance = robust.covariance(s.cameras, after.points, np.where(after.used, kept, 0) / sigma)
            points = np.where(np.isfinite(covariance).all(axis=(-1, -2))[..., None], after.points, np.nan)
            jumps = implausible(points, covariance, list(s.names), scene.FPS, *GATES)
            # a limb that jumps onto the other one is not believed either
            found = exchanged if fault is legs_exchanged else taken | jumps
            truly, told = hit.any(axis=2), (exchanged | taken).any(axis=2)
            seen = hit & (score_of(uv, s.score) > 0)
            joints = hit.any(axis=0)
            errors = [1000 * np.linalg.norm(r.points - s.points, axis=-1)[joints] for r in (before, after)]
            known = np.isfinite(errors[1]) & (after.used.sum(axis=0) >= 2)[joints] & ~jumps[joints]
            recall, false = (found & seen).sum() / seen.sum(), (told & ~truly).mean()
            left = f"{np.nanmean(errors[1][known]):.0f}" if known.any() else "none left"
            print(
                f"   {f'{level}, {name}':<42}{recall:>8.1%}{false:>8.2%}"
                f"{f'{np.nanmean(errors[0]):.0f} -> {left}':>24}{1 - known.mean():>9.1%}{each:>10.2f}"
            )


def legs_exchanged(s, random):
    """Pixels with left and right legs exchanged in one view in 5 % of the frames, in runs, and where (V, T, J)."""
    run = runs(random, FRAMES, OUTLIERS, (5, 40))
    view = random.integers(len(s.cameras), size=FRAMES)
    legs = np.array([is_leg(name) for name in s.names])
    hit = np.zeros(s.uv.shape[:3], bool)
    for number in range(run.max() + 1):
        hit[view[number], run == number] = legs
    return swaps.exchange(s.uv, hit, s.names), hit


def limbs(s, random):
    """Pixels with a limb on that of the other side in two views at once in 5 % of the frames, and where (V, T, J)."""
    run = runs(random, FRAMES, OUTLIERS, (5, 20))
    right, limb = random.integers(len(s.cameras), size=FRAMES), random.integers(len(LIMBS), size=FRAMES)
    hit = np.zeros(s.uv.shape[:3], bool)
    for number in range(run.max() + 1):
        joints = [s.names.index(name) for name in LIMBS[limb[number]][0] if name in s.names]
        hit[np.ix_(np.arange(len(s.cameras)) != right[number], run == number, joints)] = True
    return np.where(hit[..., None], s.true_uv[:, :, swap_index(s.names)] + s.uv - s.true_uv, s.uv), hit


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
            covariance = robust.covariance(s.cameras, found.points, np.where(found.used, score, 0) / found.sigma)
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


def print_refined():
    print(f"4. Triangulated and refined, seeds {SEEDS[0]}-{SEEDS[-1]}, {SHORT} frames, the joints known to both")
    print(
        f"   {'':<22}{'mean mm':>9}{'p95 mm':>8}{'rms(error/sigma)':>18}{'inside 95 %':>13}{'lag ms':>8}{'s/walk':>8}"
    )
    for level in LEVELS:
        rows = {"triangulated": [], "refined": [], "gaps bridged": []}
        spent = 0.0
        for seed in SEEDS:
            s = scene.make(level, seed, SHORT)
            points, covariance, time_s, stays = reconstructed(s)
            start = time.process_time()
            path, spread, filled, _ = refine.refined(
                points, covariance, list(s.names), scene.FPS, time_s, stays, max_gap_s=0.2
            )
            spent += (time.process_time() - start) / len(SEEDS)
            known = np.isfinite(points).all(axis=-1)
            for name, p, C, among in (
                ("triangulated", points, covariance, known),
                ("refined", path, spread, known),
                ("gaps bridged", path, spread, filled),
            ):
                error = 1000 * np.linalg.norm(p - s.points, axis=-1)[among]
                rows[name].append((error, *standardised(p - s.points, C, among), lag_ms(p, s.points)))
        for name, parts in rows.items():
            error, z, inside = (np.concatenate([part[i] for part in parts]) for i in range(3))
            if not len(error):
                continue
            lag = "" if name == "gaps bridged" else f"{np.mean([part[3] for part in parts]):.2f}"
            seconds = f"{spent:.2f}" if name == "refined" else ""
            print(
                f"   {level + ', ' + name:<22}{error.mean():>9.2f}{np.percentile(error, 95):>8.1f}"
                f"{np.sqrt((z**2).mean()):>18.3f}{inside.mean():>13.1%}{lag:>8}{seconds:>8}"
            )


def print_by_place():
    print(f"5. Labels near and far, true cameras, seeds {SEEDS[0]}-{SEEDS[-1]}, {SHORT} frames (90-98 %)")
    print(f"   {'':<20}{'labels':>9}{'inside 95 %':>13}{'interval':>16}{'rms(error/sigma)':>18}{'error, px':>11}")
    for level in LEVELS:
        sums = {}
        for seed in SEEDS:
            s = scene.make(level, seed, SHORT, [scene.camera(f"cam{i + 1:02d}", *at) for i, at in enumerate(NEAR_FAR)])
            points, covariance, time_s, stays = reconstructed(s)
            path, spread, _, _ = refine.refined(
                points, covariance, list(s.names), scene.FPS, time_s, stays, max_gap_s=0.2
            )
            for cell, counts in by_place(s, path, spread).items():
                sums.setdefault(cell, []).append(counts)
        for cell in ("all", "seen", "hidden", *DEPTHS):
            rows = np.array(sums[cell])
            n, inside, square, error = rows.sum(axis=0)
            low, high = bootstrap.of_mean(rows[:, 1], rows[:, 0])
            print(
                f"   {f'{level}, {cell}':<20}{int(n):>9}{inside / n:>13.1%}{f'{low:.1%}-{high:.1%}':>16}"
                f"{np.sqrt(square / n):>18.2f}{error / n:>11.2f}"
            )


def by_place(s, path, spread):
    """{cell: (labels, inside, sum of (error / sigma)^2, sum of errors px)} of the labels of a scene's own cameras."""
    sound = ~(s.swapped | s.wrong).any(axis=0)
    found = {}
    for camera, true, status in zip(s.cameras, s.true_uv, s.status, strict=True):
        uv, depth = cam.project(camera, path)
        by_point, _ = projection(camera, path)
        C, off = by_point @ spread @ np.swapaxes(by_point, -1, -2), uv - true
        known = sound & np.isfinite(off).all(axis=-1) & np.isfinite(C).all(axis=(-1, -2))
        known &= np.isin(status, ("ok", "occluded"))
        off, C, hidden = off[known], C[known], status[known] == "occluded"
        distance = np.einsum("ni,nij,nj->n", off, np.linalg.inv(C), off)
        z = off / np.sqrt(np.diagonal(C, axis1=-2, axis2=-1))
        each = np.stack([np.ones(len(off)), distance <= IN_95_PX, (z**2).mean(axis=1), np.linalg.norm(off, axis=1)])
        near = np.digitize(depth[known], list(DEPTHS.values())[1:])
        cells = {"all": hidden | True, "seen": ~hidden, "hidden": hidden}
        for cell, use in (cells | {name: near == i for i, name in enumerate(DEPTHS)}).items():
            found[cell] = found.get(cell, 0.0) + each[:, use].sum(axis=1)
    return found


def reconstructed(s):
    """What the step triangulate makes of a scene: points, covariance, and how the noise lasts."""
    score = score_of(s.uv, s.score)
    other = robust.strangers(s.cameras, s.uv, score, scene.FPS, swap_index(s.names))
    score = np.where(other[..., None], 0.0, score)
    exchanged = swaps.find_exchanged(s.cameras, s.uv, score, s.names, scene.FPS)
    uv, score = swaps.exchange(s.uv, exchanged, s.names), swaps.exchange(score, exchanged, s.names)
    noise = detector_noise.estimated(s.cameras, uv, score, scene.FPS, s.names)
    sigma = noise.sigma
    score = np.where(swaps.find_mistaken_limbs(s.cameras, uv, score, sigma, s.names, scene.FPS), 0.0, score)
    found = robust.triangulate(s.cameras, uv, score, scene.FPS, sigma)
    covariance = robust.covariance(s.cameras, found.points, np.where(found.used, score, 0) / sigma, noise.own)
    points = np.where(np.isfinite(covariance).all(axis=(-1, -2))[..., None], found.points, np.nan)
    bad = implausible(points, covariance, list(s.names), scene.FPS, *GATES)
    points = np.where(bad[..., None], np.nan, points)
    return points, covariance, *robust.error_correlation(s.cameras, uv, score, found, scene.FPS, noise)


def lag_ms(points, truth):
    """By how much the points follow the truth (ms): the shift in time that the errors ask for, by least squares."""
    speed = np.gradient(truth, axis=0) * scene.FPS
    error = points - truth
    good = np.isfinite(error)
    return -1000 * (error[good] * speed[good]).sum() / (speed[good] ** 2).sum()


TABLES = {"1": print_accuracy, "2": print_swaps, "3": print_covariance, "4": print_refined, "5": print_by_place}


def main():
    if unknown := set(sys.argv[1:]) - TABLES.keys():
        sys.exit(f"no table {', '.join(sorted(unknown))}; there are {', '.join(TABLES)}")
    for name in sys.argv[1:] or TABLES:
        TABLES[name]()


if __name__ == "__main__":
    main()
