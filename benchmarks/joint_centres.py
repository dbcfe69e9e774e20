"""Joint centres from markers against Plug-in-Gait's own, and what a clock would gain by them.

usage: python -m benchmarks.joint_centres [SEEDS] [SECONDS]      (3 seeds, walks of 15 s)

First a real walk whose file holds the joint centres that Plug-in-Gait made of the same markers, with the subject's
measured widths and leg length (../shared/data/mocap/overground_events_100hz.c3d): the median distance of those that
COCO-17 is made of (exports, re-identification), of the markers nearest to a joint (clocks), and of what is taken to say
what a body hides. Then clocks of indoor cameras from detections, as in `clocks_detections`: once from the nearest
markers, whose distance from the joint is fitted, once from hips, knees and ankles as COCO-17 has them.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import sys
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from benchmarks import clocks_detections
from dior.body import joint_centres, visibility
from dior.body.coco17 import coco17
from dior.body.names import COCO_17, PLUG_IN_GAIT_39
from dior.ingest.mocap_files import c3d

WALK = Path(__file__).resolve().parents[2] / "shared" / "data" / "mocap" / "overground_events_100hz.c3d"
CENTRES = {"hip": "FEP", "knee": "FEO", "ankle": "TIO"}
SEEDS, SECONDS = 3, 15.0


def points_of(path):
    """The rate (Hz) of a file, its points (T, 3) by name, mm or degrees, and the names of the markers among them."""
    file = c3d.read(path)
    points = file.points(range(len(file.labels)))
    at = {name: points[:, i] for i, name in enumerate(file.labels)}
    return file.rate, at, [name for name in file.labels if name in PLUG_IN_GAIT_39]


def plug_in_gait(path):
    """Markers (T, M, 3) m, their names, and Plug-in-Gait's joint centres (T, 3) m by joint."""
    _, at, names = points_of(path)
    sides = {"left": "L", "right": "R"}
    true = {f"{side}_{joint}": at[sides[side] + point] / 1000 for side in sides for joint, point in CENTRES.items()}
    return np.stack([at[name] for name in names], axis=1) / 1000, names, true


def distances_mm(markers, names, true):
    """{which: {joint: median distance mm}} of each way to a joint."""
    hidden = visibility.body_points(markers, names)
    ways = {
        "COCO-17": dict(zip(COCO_17, np.moveaxis(coco17(markers, names)[0], 1, 0), strict=True)),
        "nearest markers": dict(
            zip(COCO_17, np.moveaxis(joint_centres.joints(markers, names, COCO_17)[0], 1, 0), strict=True)
        ),
        "hidden by the body": hidden,
    }
    return {
        way: {
            joint: float(1000 * np.nanmedian(np.linalg.norm(found[joint] - centre, axis=-1)))
            for joint, centre in true.items()
        }
        for way, found in ways.items()
    }


@contextmanager
def centres_for_clocks():
    """Clocks that start from COCO-17's hips, knees and ankles."""
    of_markers = joint_centres.joints

    def joints(markers, names, wanted):
        points, axes = of_markers(markers, names, wanted)
        better = coco17(markers, names)[0]
        for j, name in enumerate(wanted):
            if name in COCO_17 and name.endswith(tuple(CENTRES)):
                points[:, j] = better[:, COCO_17.index(name)]
        return points, axes

    joint_centres.joints = joints
    try:
        yield
    finally:
        joint_centres.joints = of_markers


def clocks(seeds, seconds):
    for level in ("ideal", "real"):
        for what, centres in (("nearest markers", False), ("joint centres", True)):
            rows = []
            for seed in range(seeds):
                if centres:
                    with centres_for_clocks():
                        rows += clocks_detections.indoors(seed, level, seconds)
                else:
                    rows += clocks_detections.indoors(seed, level, seconds)
            off, sigma = (1000 * np.array([row[i] for row in rows]) for i in (1, 2))
            print(
                f"   {level:<7}{what:<18}{len(rows):>7}{np.median(np.abs(off)):>10.2f}{np.sqrt(np.mean(off**2)):>7.2f}"
                f"{np.median(sigma):>8.2f}",
                flush=True,
            )


def main():
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else SEEDS
    seconds = float(sys.argv[2]) if len(sys.argv) > 2 else SECONDS
    if WALK.is_file():
        found = distances_mm(*plug_in_gait(WALK))
        joints = list(next(iter(found.values())))
        print("from Plug-in-Gait's, mm  " + "".join(f"{joint:>13}" for joint in joints))
        for way, row in found.items():
            print(f"   {way:<22}" + "".join(f"{row[joint]:>13.0f}" for joint in joints))
    print(f"clocks, {seeds} seeds, {seconds:g} s   cameras  median ms    rms   sigma")
    clocks(seeds, seconds)


if __name__ == "__main__":
    main()
