"""Marks of a frame that are wrong as a whole: whether it is named, and how far off the labels are.

usage: python -m benchmarks.odd_frames [SEEDS]      (20 seeds, walks of 20 s)

Every seed is a person, a walk and four cameras, as in benchmarks.clocks_marks, located from 10, 3 and 2 marked frames:
`none` as they are clicked, `shift` with the middle frame scrolled by (15, 9) px, `scale` with its pixels times 1.02,
`number` with its frame number 3 too large. `silent`, `left out`, `said`: captures without a finding, with the frame
left out, with a finding only; `other`: those of which another frame is named; `refused`: the step ends with an error.
The error is that of labels on the walk, px, and e/s its rms in sigmas of the camera: the worst of the silent, and the
median of all.
"""

import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks import clocks_marks, steps
from dior.calibrate import locate
from dior.calibrate.marks import marks as hand_marks
from dior.errors import DiorError
from dior.geometry import covariance
from dior.geometry.camera import project
from dior.ingest import mocap
from dior.simulate import config, scene, simulate_mocap, truth
from dior.simulate import settings as levels
from dior.simulate.motion import motion_of
from dior.tables import tables
from dior.tables.files import write_text

FAULTS = ("none", "shift", "scale", "number")
FRAMES = (10, 3, 2)
LATE = 3  # pictures


def wrong(marks, kind):
    """The marks with the fault on their middle frame, and the number that this frame has then."""
    frame = np.unique(marks.frame)[len(np.unique(marks.frame)) // 2]
    own = marks.frame == frame
    if kind == "shift":
        return replace(marks, uv=marks.uv + own[:, None] * np.array([15.0, 9.0])), frame
    if kind == "scale":
        return replace(marks, uv=np.where(own[:, None], 1.02 * marks.uv, marks.uv)), frame
    if kind == "number":
        return replace(marks, frame=marks.frame + LATE * own), frame + LATE
    return marks, frame


def rows(seed, level):
    """Rows (fault, frames, what was said, label error px, error over sigma) of a seed."""
    settings = levels.from_dict(
        {
            "preset": level, "seed": seed, "subjects": 1, "sequences": 1, "environments": ["indoor"],
            "duration_s": clocks_marks.SECONDS, "walks": [clocks_marks.WALKS[seed % len(clocks_marks.WALKS)]],
            "clocks": clocks_marks.CLOCKS[level], "gallery": False,
        }
    )  # fmt: skip
    walk = levels.sequences(settings)[0]
    body = motion_of(settings, walk)
    views = [truth.view(settings, walk, body, camera) for camera in levels.CAMERAS]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        frames = folder / f"{walk.name}.parquet"
        tables.write(frames, "frames", steps._frames({seen.camera.name: seen for seen in views}))
        simulate_mocap.write_c3d(folder / "mocap.c3d", settings, walk, body)
        mocap.run(
            sequence=walk.name, subject=walk.subject, c3d=folder / "mocap.c3d", frames=frames, trigger_log=None,
            out=folder / "mocap.parquet",
        )  # fmt: skip
        motions, pictures = dict([hand_marks.read_motion(folder / "mocap.parquet")]), tables.read(frames, "frames")
        for seen in views:
            own = tables.of_camera(pictures, seen.camera.name)
            for count in FRAMES:
                worth = clocks_marks._passing(settings, walk, seen)
                write_text(folder / "marks.csv", config.marks(settings, walk, seen, count, worth))
                marks = hand_marks.read(folder / "marks.csv")
                lens = replace(
                    seen.camera, intrinsics=scene.reported(settings, walk.session, seen.camera), wTc=None, locate=""
                )
                for kind in FAULTS:
                    told = _told(lens, *wrong(marks, kind), motions, walk.name, own, seen.camera)
                    yield (kind, count, *told)


def _told(lens, marks, frame, motions, walk, own, true):
    stamps, clock = {walk: (own["frame"], own["stamp_ns"])}, {walk: (0.0, 0.0, "assumed_zero")}
    try:
        solved = locate.with_clocks(lens, marks, "marks.csv", motions, stamps, clock, clocks_marks.RANSAC_PX, lens.name)
    except DiorError:
        return "refused", np.nan, np.nan
    said = {code: text for _, _, code, text in solved.findings if code.startswith("frame_")}
    what = "silent"
    if said:
        named = any(f"frame {frame} of" in text for text in said.values())
        what = ("left out" if "frame_rejected" in said else "said") if named else "other"
    return what, *_error(lens.at(solved.located.wTc), solved.covariance, motions[walk], true)


def _error(camera, spread, motion, true):
    points = motion.xyz[::40].reshape(-1, 3)
    points = points[np.isfinite(points).all(axis=1)]
    off = project(camera, points)[0] - project(true, points)[0]
    by = np.concatenate([covariance.projection(camera, points)[1], covariance.by_lens(camera, points)], axis=2)
    variance = np.trace(by @ spread @ np.swapaxes(by, 1, 2), axis1=1, axis2=2)
    square = (off**2).sum(axis=1)
    return float(np.sqrt(np.nanmean(square))), float(np.sqrt(np.nanmean(square / variance)))


def main():
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else clocks_marks.SEEDS
    words = ("silent", "left out", "said", "other", "refused")
    print(
        f"{'level':<7}{'fault':<8}{'frames':>6}"
        + "".join(f"{w:>10}" for w in words)
        + f"{'silent px':>11}{'e/s':>7}{'median px':>11}{'e/s':>7}"
    )
    for level in clocks_marks.CLOCKS:
        found = [row for seed in range(1, seeds + 1) for row in rows(seed, level)]
        for kind in FAULTS:
            for count in FRAMES:
                own = [row[2:] for row in found if row[:2] == (kind, count)]
                numbers = "".join(f"{sum(row[0] == word for row in own):>10}" for word in words)
                silent = np.array([row[1:] for row in own if row[0] == "silent"] or [(np.nan, np.nan)])
                solved = np.array([row[1:] for row in own if row[0] != "refused"] or [(np.nan, np.nan)])
                print(
                    f"{level:<7}{kind:<8}{count:>6}{numbers}{silent[:, 0].max():>11.2f}{silent[:, 1].max():>7.1f}"
                    f"{np.median(solved[:, 0]):>11.2f}{np.median(solved[:, 1]):>7.1f}",
                    flush=True,
                )


if __name__ == "__main__":
    main()
