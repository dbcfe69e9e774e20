"""Clocks of the close cameras, found by turns with their poses: errors, and what they do to the 3D.

usage: python -m benchmarks.clocks_cameras [SEEDS]      (20)

Captures of benchmarks/steps.py, two walkers, 200 instants of each in the adjustment's window; walks straight,
turning and circling by turns; clocks 0.6 s apart, 50 ppm of drift, 1 % of the pictures lost, stamps that jitter by
0.5 ms; tape and aim as the simulator has them. The same cameras are adjusted with the clocks that are estimated, with
the true ones, and with every instant's nearest picture by the true ones. Limits in brackets.
"""

import sys
import tempfile
from pathlib import Path

import numpy as np

from benchmarks import steps
from dior.calibrate import adjust
from dior.calibrate.bundle import adjustment, in_adjustment, window
from dior.geometry import camera_tables
from dior.geometry.camera import pose
from dior.geometry.multiview import look_at, similarity
from dior.project import project as projects
from dior.project.camera_file import camera_settings
from dior.simulate import config
from dior.simulate import settings as levels
from dior.simulate.motion import motion_of
from dior.tables import tables

WALKS = (("straight",), ("across",), ("circling",), ("straight", "across"), ("across", "circling"))
CLOCKS = {"apart_s": 0.6, "drift_ppm": 50.0, "dropped": 0.01, "jitter_ms": 0.5}
DURATION_S = 20.0
KINDS = ("estimated", "true", "nearest picture")


def captured(folder, level, seed):
    """A `steps.Capture` of two recorded walks."""
    made = levels.from_dict(
        {
            "preset": level, "seed": seed, "subjects": 2, "sequences": 1, "environments": ["outdoor"],
            "duration_s": DURATION_S, "walks": list(WALKS[seed % len(WALKS)]), "clocks": CLOCKS,
        }
    )  # fmt: skip
    config.write(made, Path(folder) / "config")
    capture = steps.Capture(Path(folder), made, projects.load(folder))
    for walk in levels.sequences(made):
        steps._record(capture, walk)
    return capture


def placed(capture):
    """The close cameras as `place` puts them, and their priors."""
    cameras, priors = [], []
    for name in capture.project.close("field"):
        settings = camera_settings(capture.folder / f"config/sessions/field/{name}.yaml")
        lens = camera_tables.read_cameras(capture.made("intrinsics", f"field/{name}"))[name]
        at, target = (np.array(settings["tape"][key], float) for key in ("position_m", "target_m"))
        camera = lens.at(pose(look_at(at, target), at), "tape")
        cameras.append(camera)
        priors.append(adjust.prior_of(camera, settings))
    return cameras, priors


def timed(capture, cameras):
    """`in_adjustment.Sequences` of the window, and the true clocks (S, V, 2)."""
    chosen, names = capture.project.window("field"), [camera.name for camera in cameras]
    found, true = [], []
    for sequence in chosen:
        frames = tables.read(capture.made("frames", sequence), "frames")
        seen = tables.read(capture.made("detections", sequence), "detections")
        found.append(window.recorded(cameras, seen, frames, 0.4, 1.5, sequence))
        clocks = [capture.views[sequence][name].clock for name in names]
        true.append([(clock.offset_s, clock.drift_ppm) for clock in clocks])
    free = [[(0.0, 0.0, "assumed_zero")] * len(names)] * len(chosen)
    sequences = in_adjustment.of(found, list(chosen.values()), names, free, 3)
    values = np.array(true)
    for i in range(len(values)):
        values[i, :, 0] += 1e-6 * values[i, :, 1] * sequences.middle(i)
    return sequences, values


def nearest(sequences, values):
    """The joints of the picture that is nearest to each instant by the true clocks, as `Sequences.observations`."""
    parts = []
    for i, (found, chosen) in enumerate(zip(sequences.recorded, sequences.windows, strict=True)):
        queries = (chosen["first"] + chosen["step"] * np.arange(chosen["count"])) / found.fps
        uv = []
        for view, own in enumerate(found.seen):
            times = sequences.times(i, view, values[i, view])
            after = np.clip(np.searchsorted(times, queries), 1, len(times) - 1)
            index = after - (queries - times[after - 1] < times[after] - queries)
            near = np.abs(times[index] - queries) < own.max_gap_s / 2
            uv.append(np.where(near[:, None, None], own.uv[index], np.nan).reshape(-1, 2))
        uv = np.stack(uv)
        index = np.flatnonzero(np.isfinite(uv).all(axis=-1).sum(axis=0) >= 3)
        each = len(found.names)
        parts.append(window.Seen(uv[:, index], index % each, index // each, found.names, queries))
    return window.together(parts, [chosen["count"] for chosen in sequences.windows])


def error_3d(capture, points, tracks, sequences):
    """Mean distance (m) of the adjusted points from the true ones, after rigid alignment."""
    walks = {walk.name: walk for walk in levels.sequences(capture.settings)}
    true = np.full(points.shape, np.nan)
    for i, (name, chosen) in enumerate(capture.project.window("field").items()):
        times = (chosen["first"] + chosen["step"] * np.arange(chosen["count"])) / sequences.recorded[i].fps
        at = motion_of(capture.settings, walks[name]).at(times)[0]
        own = tracks.sequence == i
        before = sum(w["count"] for w in sequences.windows[:i])
        true[own] = at[tracks.moment[own] - before, tracks.joint[own]]
    _, R, t = similarity(points, true, scale=False)
    return float(np.nanmean(np.linalg.norm(points @ R.T + t - true, axis=1)))


def tried(level, seed):
    """Errors and sigmas (s) of the window's clocks, lags' errors (s), and the 3D errors (m) by `KINDS`."""
    lens = 0.003 if level == "real" else 0.0
    with tempfile.TemporaryDirectory() as folder:
        capture = captured(folder, level, seed)
        cameras, priors = placed(capture)
        sequences, values = timed(capture, cameras)
        limits = 15.0, 20.0, f"{level}, seed {seed}"
        done = adjustment.adjust(cameras, sequences, priors, *limits, lens_sigma=lens)
        points = [error_3d(capture, done.points, done.tracks, sequences)]
        for uv, tracks in (sequences.observations(values)[:2], nearest(sequences, values)):
            other = adjustment.adjust(cameras, uv, priors, *limits, tracks, lens_sigma=lens)
            points.append(error_3d(capture, other.points, tracks, sequences))
        start = sequences.start(cameras, *adjustment.how_far_off(cameras, priors))
    free = ~sequences.held
    return (
        (done.clocks - values)[free][:, 0], done.clocks_sigma[free][:, 0], (start - values)[free][:, 0],
        np.array(points),
    )  # fmt: skip


def table(seeds=20):
    """Print the rows; returns (error s, sigma s) of all clocks."""
    print(f"clocks of the window, {seeds} captures each: errors in ms (worst 3), mean 3D error in mm (5 % above true)")
    print(
        f"  {'':<7}{'lags worst':>11}{'median':>9}{'worst':>9}{'rms e/s':>9}{'in 95 %':>9}"
        + "".join(f"{kind:>18}" for kind in KINDS)
    )
    pooled = []
    for level in ("ideal", "real"):
        error, sigma, lag, points = (
            np.concatenate(x) for x in zip(*(tried(level, s) for s in range(seeds)), strict=True)
        )
        points = 1000 * points.reshape(seeds, -1).mean(axis=0)
        z = error / sigma
        print(
            f"  {level:<7}{1000 * np.abs(lag).max():>11.0f}{1000 * np.median(np.abs(error)):>9.2f}"
            f"{1000 * np.abs(error).max():>9.2f}{np.sqrt(np.mean(z**2)):>9.2f}{(np.abs(z) < 1.96).mean():>9.0%}"
            + "".join(f"{value:>18.2f}" for value in points)
        )
        pooled += zip(error.tolist(), sigma.tolist(), strict=True)
    return pooled


if __name__ == "__main__":
    table(int(sys.argv[1]) if len(sys.argv) > 1 else 20)
