"""The clock of an indoor camera from hand marks: how far off, and whether its interval holds.

usage: python -m benchmarks.clocks_marks [SEEDS] [SECONDS]      (20 seeds, walks of 20 s)

Every seed is a person, a walk (straight, across and circling in turn) and four cameras; each camera is located anew
from ten and from three marked frames, one of each tenth or third of the walk, with up to 16 markers each, clicked with
1 px. The frames are those in which one foot passes the other, as docs/formats.md asks for, or those in which most
markers show. Nothing is known of the clocks,
which are up to 0.6 s apart after a start of 0.40 to 0.53 s. `ideal` has exact stamps and lenses, `real` has 50 ppm of
drift, jitter, drops, lenses that are 0.3 % off, markers on soft tissue and gaps in the mocap. The error is that of the
camera's time in the middle of the marked frames' span, the sigma that of the tables, drift included.
"""

import os
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks import steps
from dior.calibrate import locate
from dior.calibrate.marks import marks as hand_marks
from dior.clocks import clock
from dior.errors import DiorError
from dior.geometry import camera_tables
from dior.ingest import mocap
from dior.simulate import config, scene, simulate_mocap, truth
from dior.simulate import settings as levels
from dior.simulate.motion import motion_of
from dior.tables import tables
from dior.tables.files import write_text

SEEDS, SECONDS = 20, 20.0
WALKS = ("straight", "across", "circling")
FRAMES = (10, 3)
CHOICES = ("feet pass", "most markers")
PASSING_M = 0.25  # ankles that far apart on the floor, or less
RANSAC_PX = 8.0
CLOCKS = {"ideal": {"apart_s": 0.6}, "real": {"apart_s": 0.6, "drift_ppm": 50.0}}


def errors(seed, level, seconds=SECONDS, roll_deg=0.0):
    """Rows (walk, camera, marked frames, how they are chosen, error s, sigma s) of a seed; NaN where it is refused."""
    walk_name = WALKS[seed % len(WALKS)]
    settings = levels.from_dict(
        {
            "preset": level, "seed": seed, "subjects": 1, "sequences": 1, "environments": ["indoor"],
            "duration_s": seconds, "walks": [walk_name], "clocks": CLOCKS[level], "gallery": False,
            "roll_deg": roll_deg,
        }
    )  # fmt: skip
    walk = levels.sequences(settings)[0]
    motion = motion_of(settings, walk)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        views = {camera: truth.view(settings, walk, motion, camera) for camera in levels.CAMERAS}
        tables.write(folder / f"frames/{walk.name}.parquet", "frames", steps._frames(views))
        simulate_mocap.write_c3d(folder / "mocap.c3d", settings, walk, motion)
        mocap.run(
            sequence=walk.name, subject=walk.subject, c3d=folder / "mocap.c3d",
            frames=folder / f"frames/{walk.name}.parquet", trigger_log=None, out=folder / "mocap.parquet",
        )  # fmt: skip
        return [
            (walk_name, camera, frames, choice, *_error(folder, settings, walk, seen, frames, choice))
            for camera, seen in views.items()
            for frames in FRAMES
            for choice in CHOICES
        ]


def _passing(settings, walk, seen):
    """How near the feet are to each other (P,), 0 to 1."""
    motion = motion_of(settings, walk)
    markers = motion.at(seen.seconds)[1]
    left, right = (markers[:, motion.names.index(name), :2] for name in ("LANK", "RANK"))
    return np.exp(-(((left - right) / PASSING_M) ** 2).sum(axis=1))


def _error(folder, settings, walk, seen, frames, choice):
    camera = seen.camera.name
    worth = _passing(settings, walk, seen) if choice == "feet pass" else None
    write_text(folder / "camera.yaml", f"role: close\ntopic: /{camera}/image\nlocate: marks\n")
    write_text(folder / "marks.csv", config.marks(settings, walk, seen, frames, worth))
    lens = replace(seen.camera, intrinsics=scene.reported(settings, walk.session, seen.camera), wTc=None, locate="")
    camera_tables.write_cameras(folder / "lens.parquet", [lens], walk.session)
    made = {key: folder / f"{key}.parquet" for key in ("out_clocks", "out_clock_gains", "out_clock_costs")}
    try:
        locate.run(
            session=walk.session, camera=camera, camera_file=folder / "camera.yaml",
            intrinsics=folder / "lens.parquet", given=locate.ByHand(folder / "marks.csv", [walk.name], offsets=[]),
            recorded=locate.Recorded([folder / "mocap.parquet"], [folder / f"frames/{walk.name}.parquet"]),
            ransac_px=RANSAC_PX,
            written=locate.Written(
                out=folder / "camera.parquet", out_covariance=folder / "covariance.parquet",
                out_marks=folder / "marks.parquet", findings=folder / "findings.parquet", **made,
            ),
        )  # fmt: skip
    except DiorError as error:
        print(f"seed {settings.seed}, {camera}, {frames} frames, {choice}: {error}", file=sys.stderr)
        return np.nan, np.nan
    found = clock.read([made["out_clocks"]], [made["out_clock_gains"]], walk.name)[camera]
    if found.source != "estimated":
        return np.nan, np.nan
    covariance = camera_tables.read_camera_covariance(folder / "covariance.parquet", [camera])
    sigma, sigma_drift = found.sigma([camera], covariance)
    own = tables.of_camera(tables.read(folder / f"frames/{walk.name}.parquet", "frames"), camera)
    marked = hand_marks.read(folder / "marks.csv").frame
    stamps = own["stamp_ns"][np.isin(own["frame"], marked)]
    middle = (stamps.min() + stamps.max()) / 2e9 - _start(folder, walk) / 1e9
    true = middle * (1 + 1e-6 * seen.clock.drift_ppm) + seen.clock.offset_s
    error = middle * (1 + 1e-6 * found.drift_ppm) + found.offset_s - true
    return error, np.hypot(sigma, 1e-6 * sigma_drift * (middle - found.middle_s))


def _start(folder, walk):
    return tables.read(folder / f"frames/{walk.name}.parquet", "frames", ["stamp_ns"])["stamp_ns"].min()


def table(seeds=SEEDS, seconds=SECONDS):
    """Print a row per level, number of frames and walk; yield (error s, sigma s) of every clock that was found."""
    print(f"pose and clock from marks, {seeds} seeds, walks of {seconds:g} s; errors of the time in the middle, ms")
    print(
        f"{'level':<7}{'frames':>7} {'chosen':<14}{'walk':>10}{'clocks':>8}{'refused':>9}{'median':>8}{'p95':>7}"
        f"{'worst':>8}{'sigma':>7}{'in 95 %':>9}{'rms e/s':>9}"
    )
    for level in CLOCKS:
        with ProcessPoolExecutor(os.cpu_count()) as pool:
            rows = [
                row
                for each in pool.map(errors, range(1, seeds + 1), [level] * seeds, [seconds] * seeds)
                for row in each
            ]
        for frames, choice in ((frames, choice) for choice in CHOICES for frames in FRAMES):
            for walk in (*WALKS, "all"):
                own = [row[4:] for row in rows if row[2:4] == (frames, choice) and walk in (row[0], "all")]
                _print(f"{level:<7}{frames:>7} {choice:<14}{walk:>10}", np.array(own).reshape(-1, 2))
        yield from (row[4:] for row in rows if np.isfinite(row[4]))


def _print(what, own):
    error, sigma = own[np.isfinite(own[:, 0])].T
    if not len(error):
        return
    ms, ratio = 1000 * np.abs(error), error / sigma
    print(
        f"{what}{len(error):>8}{len(own) - len(error):>9}{np.median(ms):>8.2f}"
        f"{np.percentile(ms, 95):>7.2f}{ms.max():>8.2f}{1000 * np.median(sigma):>7.2f}"
        f"{(np.abs(ratio) < clock.NORMAL_95).mean():>9.1%}{np.sqrt((ratio**2).mean()):>9.2f}",
        flush=True,
    )


def main():
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else SEEDS
    found = np.array(list(table(seeds, float(sys.argv[2]) if len(sys.argv) > 2 else SECONDS))).reshape(-1, 2)
    ratio = found[:, 0] / found[:, 1]
    print(
        f"all {len(found)}: {(np.abs(ratio) < clock.NORMAL_95).mean():.1%} in their 95 % intervals, "
        f"rms(error/sigma) {np.sqrt((ratio**2).mean()):.2f}"
    )


if __name__ == "__main__":
    main()
