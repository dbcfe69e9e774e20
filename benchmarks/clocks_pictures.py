"""Clocks from pictures without detections: indoor cameras against the motion capture, the long-range camera against the
3D of the close ones.

usage: python -m benchmarks.clocks_pictures [SEEDS]      (SEEDS: 20; the long-range camera's part alone:
                                                          python -m benchmarks.long_range clocks [SEEDS] [FIRST])

Clocks are off by up to 0.6 s. `median`, `worst`: error (ms) of the time in the middle of the recording; `inside`: share
of the 95 % intervals that hold it; `error/s`: its rms in units of the stated error; `sigma`: the median of that;
`refused`: how often nothing was said; `mean`: of the errors, with its standard error.

Indoors a located camera 5 m away sees 60 s (its place is known to 5 mm and 0.05 degrees, which the intervals count),
drifts by 50 ppm, and its pictures are rendered, made noisy and compressed. The long-range camera is 60 m away and
placed by 30 boxes of each of two walks of 20 s, drawn around the rendered body with errors of 1 px on each edge, with
its clocks left open; the 3D is that of three close cameras after `refine`, without which noise looks like swings of the
limbs. The `label` columns are the mean error (px) of its labels at the true joints with true clocks in every step and
with those that were found.
"""

import sys
from dataclasses import replace

import numpy as np

from benchmarks import long_range, scene
from dior.calibrate.outline import boxes_fit, clock_from_pictures, long_range_clock, seen_edges, tracks
from dior.calibrate.outline.walks import margins
from dior.clocks.clock import DRIFT_SD_PPM, OFFSET_SD_S
from dior.geometry import covariance
from dior.geometry.camera import project
from dior.simulate import backdrop, draw
from dior.simulate import settings as levels
from dior.simulate.motion import motion_of

INDOOR_WALKS = ("straight", "across", "along", "circling", "running")
LASTS_S, FPS, MOCAP_HZ = 60.0, 30.0, 100.0
APART_S, DRIFT_PPM = 0.6, 50.0
PLACE_M, TURN_DEG = 0.005, 0.05
NOISE_GREY = 2.0
LONG_WALKS = (("across", "along"), ("straight", "circling"))
LONG_FRAMES, BOXES = 600, 30
MARGINS = margins({}, "boxes")[:2]
WAYS = (("plain", "body"), ("dressed", "body"), ("plain", "joints"))  # the body, and what its boxes are compared with
GRIP = 45  # frames of a walk that the shifted clock may need beyond its ends


def indoor(level, seed, lasts_s=LASTS_S):
    """Error (s) of the time in the middle, its standard error, and why it was refused, for one indoor recording."""
    import cv2

    random = np.random.default_rng([seed, 11])
    walk = INDOOR_WALKS[seed % len(INDOOR_WALKS)]
    settings = levels.from_dict(
        {
            "preset": level,
            "seed": seed,
            "subjects": 1,
            "sequences": 1,
            "environments": ["indoor"],
            "duration_s": lasts_s,
            "walks": [walk],
            "clocks": {"apart_s": APART_S},
        }
    )
    sequence = levels.sequences(settings)[0]
    motion = motion_of(settings, sequence)
    true = scene.camera("cam01", float(random.uniform(0, 360)))
    offset, drift = random.uniform(-APART_S, APART_S) + 1.0, DRIFT_PPM * random.choice([-1, 1])
    stamps = np.arange(int(lasts_s * FPS)) / FPS
    shown = clock_from_pictures.chosen(len(stamps))
    moments = stamps[shown]
    taken = moments * (1 + 1e-6 * drift) + offset
    table = _mocap(motion, settings, lasts_s + 2.0, random)
    track, _, flesh_m = clock_from_pictures.body(table)
    factor = clock_from_pictures.shrinking(true, track)
    empty = backdrop.background(settings, true, "indoor")
    landmarks = motion.at(taken)[0]
    outlines = draw.outlines(true, draw.figure(landmarks, motion.height), motion.height, "shirt", "S01")
    small = []
    grain = NOISE_GREY * random.standard_normal((8, *empty.shape[:2], 1), dtype=np.float32)
    for i in range(len(shown)):
        picture = empty.copy()
        draw.paint(picture, outlines, i)
        noisy = picture + np.roll(grain[i % 8], random.integers(1000), axis=1)
        jpeg = cv2.imencode(".jpg", np.clip(noisy, 0, 255).astype(np.uint8), [cv2.IMWRITE_JPEG_QUALITY, 85])[1]
        small.append(clock_from_pictures.shrunk(cv2.imdecode(jpeg, cv2.IMREAD_COLOR), factor))
    known = np.concatenate([np.radians(TURN_DEG) * np.ones(3), PLACE_M * np.ones(3)])
    given = covariance.moved(true, known * random.standard_normal(6))
    lens = replace(given.intrinsics, fx=true.intrinsics.fx * (1 + settings.intrinsics_error))
    given = replace(given, intrinsics=replace(lens, fy=lens.fx))
    edges = clock_from_pictures.edges_of(small, factor, *clock_from_pictures.stance(given, track))
    found = clock_from_pictures.from_edges(given, track, flesh_m, moments, edges)
    middle = found.clock.middle_s
    error = found.clock.offset_s + 1e-6 * (found.clock.drift_ppm - drift) * middle - offset
    return error, found.clock.sigma(["cam01"], np.diag(known**2))[0], found.refused


def _mocap(motion, settings, lasts_s, random):
    """Columns of `skeletons_3d` of the markers, with noise and gaps."""
    ticks = np.arange(int(lasts_s * MOCAP_HZ))
    points = motion.at(ticks / MOCAP_HZ)[1] + settings.mocap_noise_mm / 1000 * random.standard_normal(
        (len(ticks), len(motion.names), 3)
    )
    if settings.mocap_gaps:
        low, high = settings.mocap_gap_ticks
        for j in range(len(motion.names)):
            for start in np.flatnonzero(random.random(len(ticks)) < settings.mocap_gaps * 2 / (low + high)):
                points[start : start + int(random.integers(low, high)), j] = np.nan
    flat = points.reshape(-1, 3)
    return {
        "joint": np.array(list(motion.names) * len(ticks), dtype=object),
        "stamp_ns": np.repeat(np.round(ticks / MOCAP_HZ * 1e9).astype(np.int64), len(motion.names)),
        **{axis: flat[:, i] for i, axis in enumerate("xyz")},
    }


def long_range_clocks(level, seed, worn="plain", around="body"):
    """Per walk: error (s), standard error and refusal; and the mean label error px with true and with found clocks."""
    random = np.random.default_rng([seed, 12])
    walks = in_turn(seed)
    late = random.uniform(-APART_S, APART_S, len(walks))
    made = [long_range.smoothed(level, seed, walk) for walk in walks]
    rows = tuple(np.linspace(GRIP, LONG_FRAMES - 1 - GRIP, BOXES).round().astype(int).tolist())
    parts, followed = [], []
    for k, (walk, (seen, points)) in enumerate(zip(walks, made, strict=True)):
        edges = long_range.drawn(long_range.body(seed, rows, worn, walk), seed + 1000 * k, margin=0.0)
        whole, flesh_m, outline_m = long_range.outlined(points, around)
        parts.append((tracks.BodyTrack(seen.seconds, whole), seen.seconds[list(rows)], edges))
    kind = {"bias_m": long_range.BIAS_M[level], "flesh_m": flesh_m, "outline_m": outline_m}
    start = long_range.off(made[0][0].given[3], seed)
    labels = []
    for clocks in (np.zeros(len(walks)), late):
        known = not clocks.any()
        camera, spread = _aligned(start, parts, kind, clocks, known, f"{level} {seed}")
        errors = []
        for k, (seen, _) in enumerate(made):
            track, moments, edges = parts[k]
            own = moments - clocks[k]
            where = 0.0
            if not known:
                found = long_range_clock.estimate(camera, _seen([(track, own, edges)], kind), "boxes", MARGINS)
                clock = found.clock
                where = clock.offset_s + 1e-6 * clock.drift_ppm * clock.middle_s
                followed.append((where - clocks[k], clock.sigma([camera.name], spread)[0], found.refused))
            at = seen.seconds[GRIP:-GRIP:30]
            moved = tracks.BodyTrack(seen.seconds, seen.points).at(at - clocks[k] + where)
            errors.append(np.linalg.norm(project(camera, moved)[0] - seen.true_uv[3][GRIP:-GRIP:30], axis=-1))
        labels.append(float(np.nanmean(np.concatenate(errors))))
    return followed, *labels


def _seen(parts, kind, held=False):
    points = [track.at(moments) for track, moments, _ in parts]
    walk = np.repeat(np.arange(len(parts)), [len(moments) for _, moments, _ in parts])
    every = np.concatenate(points)
    return seen_edges.EdgeObservations(
        every, np.concatenate([edges for *_, edges in parts]), np.full((*every.shape[:2], 2), np.nan),
        np.concatenate([moments for _, moments, _ in parts]), walk,
        tracks=() if held else tuple(track for track, *_ in parts), **kind,
    )  # fmt: skip


def _aligned(start, parts, kind, clocks, held, where):
    """The camera placed by the boxes of both walks, and its covariance (6, 6)."""
    shifted = [(track, moments - late, edges) for (track, moments, edges), late in zip(parts, clocks, strict=True)]
    open_clocks = 0 if held else len(parts)
    freedom = long_range.freedom(clock_s=(OFFSET_SD_S,) * open_clocks, drift_ppm=(DRIFT_SD_PPM,) * open_clocks)
    fitted = boxes_fit.fit(start, freedom, _seen(shifted, kind, held), where)
    return fitted.camera, fitted.pose_covariance


def line(name, done, labels=()):
    """Print one row of `done`, [(error, sigma, refused)]; returns the (error, sigma) that were not refused."""
    kept = [(error, sigma) for error, sigma, refused in done if not refused]
    error, sigma = np.array(kept).T
    text = f"  {name:<34}{1e3 * np.median(np.abs(error)):>8.1f}{1e3 * np.abs(error).max():>8.1f}"
    text += f"{(np.abs(error) < 1.96 * sigma).mean():>9.1%}{np.sqrt(np.mean((error / sigma) ** 2)):>9.2f}"
    text += f"{1e3 * np.median(sigma):>9.1f}{len(done) - len(kept):>9}{1e3 * error.mean():>+8.1f}"
    text += f" ±{1e3 * error.std(ddof=1) / np.sqrt(len(error)):>4.1f}" if len(error) > 1 else f"{'':>6}"
    if len(labels):
        text += "".join(f"{value:>9.3f}" for value in np.mean(labels, axis=0))
    print(text, flush=True)
    return kept


HEAD = f"  {'':<34}  median   worst   inside  error/s    sigma  refused     mean ± "


def table(seeds):
    """Print the rows; returns all (error s, sigma s)."""
    print(f"Indoor camera, silhouettes in at most {clock_from_pictures.PICTURES} pictures of {LASTS_S:g} s, ms\n{HEAD}")
    pooled = []
    for level in long_range.LEVELS:
        pooled += line(f"{level}, {len(seeds)} recordings", [indoor(level, seed) for seed in seeds])
    return pooled + long_range_table(seeds)


def long_range_table(seeds):
    """Print the rows of the long-range camera; returns all (error s, sigma s)."""
    print(f"Long-range camera, {BOXES} boxes of each of two walks, ms\n{HEAD}    label: true, found")
    pooled = []
    for level in long_range.LEVELS:
        done = {way: [] for way in WAYS}
        for seed in seeds:
            for worn, around in WAYS:
                done[worn, around].append(long_range_clocks(level, seed, worn, around))
            for kept in (long_range.capture, long_range.smoothed, long_range.body):
                kept.cache_clear()
        for (worn, around), each in done.items():
            clocks, labels = [one for own, *_ in each for one in own], [labels for _, *labels in each]
            kept = line(f"{level}, {worn}, {around}, {len(clocks)} walks", clocks, labels)
            pooled += kept if around == "body" else []
            for pair in LONG_WALKS if around == "body" else ():
                for k, walk in enumerate(pair):
                    own = [one[0][k] for seed, one in zip(seeds, each, strict=True) if in_turn(seed) == pair]
                    if own:
                        line(f"  {walk}, {len(own)} walks", own)
    return pooled


def in_turn(seed):
    """The two walks of a seed."""
    return LONG_WALKS[seed % len(LONG_WALKS)]


if __name__ == "__main__":
    table(range(int(sys.argv[1]) if len(sys.argv) > 1 else 20))
