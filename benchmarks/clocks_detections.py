"""The clock of an indoor camera from detections, and of three close cameras from each other: errors and intervals.

usage: python -m benchmarks.clocks_detections [SEEDS] [SECONDS]      (20 seeds, walks of 60 s)

Every seed is a person and a walk (straight, across with its turns, circling, in turn). Indoors four cameras against the
motion capture, outdoors three against each other, poses true and lenses as the bag reports them. Clocks are up to 0.6 s
apart with 50 ppm of drift, 0.5 ms of jitter and 1 % of the pictures lost at both levels. The error is that of the time
in the middle of the recording. Then what is doubtful: a subject who stands, 2 s of data, 40 % of the pictures lost.
"""

import os
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace

import numpy as np

from dior.body.names import MLKIT_33
from dior.calibrate.clock import from_cameras, from_mocap
from dior.clocks import clock as clocks
from dior.clocks.axis import instants
from dior.simulate import detector, detector_real, scene, simulate, truth
from dior.simulate import settings as levels
from dior.simulate.motion import motion_of

SEEDS, SECONDS = 20, 60.0
WALKS = ("straight", "across", "circling")
CLOCKS = {"apart_s": 0.6, "drift_ppm": 50.0, "dropped": 0.01, "jitter_ms": 0.5}
MIN_SCORE, MAX_GAP = 0.3, 2.5
DOUBTFUL = {"stands, 10 s": {}, "2 s": {}, "40 % drops, 10 s": {"dropped": 0.4}}
ROUNDING_M = 0.0002


def recorded(level, environment, seed, seconds, **worse):
    """Settings, the walk, its motion, views and detections by camera."""
    settings = levels.from_dict(
        {
            "preset": level, "seed": seed, "subjects": 1, "sequences": 1, "environments": [environment],
            "duration_s": seconds, "walks": [WALKS[seed % len(WALKS)]], "gallery": False, "clocks": CLOCKS | worse,
        }
    )  # fmt: skip
    walk = levels.sequences(settings)[0]
    motion = motion_of(settings, walk)
    views, others = simulate.observe(settings, walk, motion)
    if level == "real":
        return settings, walk, motion, views, detector_real.detect(settings, walk, motion.height, views, others)
    noise = settings.detector.noise_px
    found = {n: detector.detect(v, noise, truth.detector_generator(settings, walk, n)) for n, v in views.items()}
    return settings, walk, motion, views, found


def seen_by(found, stands):
    """Pixels (F, 33, 2) that count; `stands`: the first picture's, with the noise of the others."""
    uv = np.where((found.found[:, None] & (found.score > MIN_SCORE))[..., None], found.uv, np.nan)
    if not stands:
        return uv
    still = np.broadcast_to(np.nanmedian(uv[:5], axis=0), uv.shape)
    return still + np.nan_to_num(found.noise)


def indoors(seed, level, seconds, stands=False, **worse):
    """Rows (walk, error s, sigma s, why not) of four cameras against the motion capture."""
    settings, walk, motion, views, found = recorded(level, "indoor", seed, seconds, **worse)
    ticks = np.arange(int((seconds + 1) * settings.mocap_hz)) / settings.mocap_hz
    markers = motion.at(0 * ticks if stands else ticks)[1]
    markers = markers + ROUNDING_M * np.random.default_rng(seed).standard_normal(markers.shape)
    walker = from_mocap.walker_of(ticks, markers, list(motion.names), list(MLKIT_33))
    order = [MLKIT_33.index(name) for name in walker.names]
    t0, rows = min(view.clock.stamp_ns[0] for view in views.values()), []
    for name, view in views.items():
        camera = replace(view.camera, intrinsics=scene.reported(settings, walk.session, view.camera))
        uv = seen_by(found[name], stands)[:, order]
        clock, _, _, why = from_mocap.from_detections(camera, walker, uv, (view.clock.stamp_ns - t0) / 1e9)
        rows.append((walk.walk, *_error(clock, view.clock), why))
    return rows


def outdoors(seed, level, seconds, stands=False, **worse):
    """Rows (walk, error s, sigma s, why not) of the second and third camera against the first."""
    settings, walk, _, views, found = recorded(level, "outdoor", seed, seconds, **worse)
    t0, close = min(view.clock.stamp_ns[0] for view in views.values()), list(views)[:3]
    cameras = [
        replace(views[n].camera, intrinsics=scene.reported(settings, walk.session, views[n].camera)) for n in close
    ]
    seen = [
        from_cameras.TimedDetections(
            (views[n].clock.stamp_ns - t0) / 1e9, seen_by(found[n], stands), MAX_GAP / settings.fps
        )
        for n in close
    ]
    told = from_cameras.from_detections(cameras, seen, list(MLKIT_33), instants(settings.fps, seconds), settings.fps)
    return [(walk.walk, *_error(told[n][0], views[n].clock), told[n][3]) for n in close[1:]]


def _error(clock, true):
    at = clock.middle_s
    return clock.offset_s - true.offset_s + 1e-6 * at * (clock.drift_ppm - true.drift_ppm), clock.given[0]


def _rows(job):
    where, args, worse = job
    return where(*args, **worse)


def table(seeds=SEEDS, seconds=SECONDS):
    """Print a row per level, place and walk, and the doubtful ones; yield (error s, sigma s) of every clock found."""
    print(f"clocks from detections, {seeds} seeds, walks of {seconds:g} s; errors in the middle of the recording, ms")
    head = f"{'level':<7}{'against':<10}{'walk':<18}{'clocks':>7}{'refused':>9}{'median':>8}{'worst':>8}"
    print(f"{head}{'sigma':>7}{'in 95 %':>9}{'rms e/s':>9}")
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        for level in ("ideal", "real"):
            for name, where in (("mocap", indoors), ("cameras", outdoors)):
                jobs = [(where, (seed, level, seconds), {}) for seed in range(1, seeds + 1)]
                rows = [row for each in pool.map(_rows, jobs) for row in each]
                for walk in (*WALKS, "all"):
                    row(f"{level:<7}{name:<10}{walk:<18}", [r[1:] for r in rows if walk in (r[0], "all")])
                yield from (r[1:3] for r in rows if not r[3])
                for what, worse in DOUBTFUL.items():
                    lasts = 2.0 if what == "2 s" else 10.0
                    given = worse | ({"stands": True} if what.startswith("stands") else {})
                    jobs = [(where, (seed, level, lasts), given) for seed in range(1, seeds // 2 + 1)]
                    doubtful = [r for each in pool.map(_rows, jobs) for r in each]
                    row(f"{level:<7}{name:<10}{what:<18}", [r[1:] for r in doubtful])


def row(what, rows):
    """Print what came of clocks (error s, sigma s, why not)."""
    told = np.array([r[:2] for r in rows if not r[2]]).reshape(-1, 2)
    text = f"{what}{len(told):>7}{len(rows) - len(told):>9}"
    if len(told):
        error, sigma = told.T
        ratio = error / sigma
        text += f"{1000 * np.median(np.abs(error)):>8.2f}{1000 * np.abs(error).max():>8.2f}"
        text += f"{1000 * np.median(sigma):>7.2f}{(np.abs(ratio) < clocks.NORMAL_95).mean():>9.1%}"
        text += f"{np.sqrt((ratio**2).mean()):>9.2f}"
    print(text, flush=True)


def main():
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else SEEDS
    seconds = float(sys.argv[2]) if len(sys.argv) > 2 else SECONDS
    list(table(seeds, seconds))


if __name__ == "__main__":
    main()
