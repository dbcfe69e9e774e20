"""Clocks of a real, genlocked recording, ../shared/data/real_outdoor: they should be zero, and a shift should be found.

usage: python -m benchmarks.clocks_real [DATA]      (DATA: ../shared/data/real_outdoor)

100 pictures at 60 Hz of a person on a beam, four cameras at their reference poses. The stamps of one camera are made
0, 8.3 or 50 ms too late in turn; printed is the worst error of all clocks of OpenPose's and ML Kit's detections, how
many 95 % intervals hold it, and how many cannot be told.

Then the indoor way: the 3D of cam01-cam03 by a detector is taken for motion capture, and cam04, of which it knows
nothing, gets stamps that are as much too late, and 0.4 s. `beyond`: what is found beyond that of right stamps. 1.7 s
tell no drift.
"""

import sys
from pathlib import Path

import numpy as np

from benchmarks import real_outdoor as recording
from dior.calibrate.clock import from_cameras, from_mocap
from dior.clocks import clock as clocks

LATE_S = (0.0, 0.0083, 0.05)
AS_MOCAP_S = (*LATE_S, 0.4)
MIN_SCORE = 0.3
TOOLS = "OpenPose", "ML Kit"


def detections(data, tool):
    """Pixels (V, 100, J, 2) with NaN of the four cameras, and the joints."""
    uv, score, joints = recording.detected(data, tool)
    return np.where((score > MIN_SCORE)[..., None], uv, np.nan), joints


def errors(data, tool, view, late_s):
    """Rows (camera, error s, sigma s, why not), the stamps of camera number `view` being `late_s` too late."""
    cameras = recording.rig(data)
    uv, joints = detections(data, tool)
    t = np.arange(recording.FRAMES) / recording.FPS
    late = np.where(np.arange(len(cameras)) == view, late_s, 0.0)
    seen = [from_cameras.TimedDetections(t + own, one, 2.5 / recording.FPS) for own, one in zip(late, uv, strict=True)]
    told = from_cameras.from_detections(cameras, seen, joints, t, recording.FPS)
    rows = []
    for camera, own in zip(cameras[1:], late[1:], strict=True):
        clock, _, _, why = told[camera.name]
        true = late[0] - own
        rows.append((camera.name, clock.offset_s + 1e-6 * clock.drift_ppm * clock.middle_s - true, clock.given[0], why))
    return rows


def table(data):
    print("real_outdoor, reference cameras: clocks against cam01, ms (limit: 3, or an interval that holds)")
    print(f"{'detector':<10}{'late, ms':>9}{'clocks':>8}{'unknown':>9}{'worst':>8}{'sigma':>7}{'in 95 %':>9}")
    for tool in TOOLS:
        for late_s in LATE_S:
            views = range(len(recording.CAMERAS)) if late_s else [0]
            rows = [row for view in views for row in errors(data, tool, view, late_s)]
            told = np.array([row[1:3] for row in rows if not row[3]]).reshape(-1, 2)
            text = f"{tool:<10}{1000 * late_s:>9.1f}{len(told):>8}{len(rows) - len(told):>9}"
            if len(told):
                error, sigma = told.T
                inside = (np.abs(error) < clocks.NORMAL_95 * sigma).mean()
                text += f"{1000 * np.abs(error).max():>8.2f}{1000 * np.median(sigma):>7.2f}{inside:>9.0%}"
            print(text, flush=True)
            if not late_s:
                print("          " + "; ".join(f"{n} {1000 * e:+.2f} ± {1960 * s:.2f} {w}" for n, e, s, w in rows))


def as_mocap(data):
    cameras = recording.rig(data)
    t = np.arange(recording.FRAMES) / recording.FPS
    print("cam04 against the 3D of cam01-cam03, as if that were motion capture, ms")
    print(f"{'3D by':<10}{'cam04 by':<10}{'late':>7}{'found':>9}{'± 95 %':>9}{'beyond':>9}  why not")
    for source in TOOLS:
        points, _, joints = recording.robust_points(data, cameras, source)
        joints = recording.shared_names(joints)
        for tool in TOOLS:
            uv, names = detections(data, tool)
            names = recording.shared_names(names)
            walker = from_mocap.walker_of(t, points, joints, [name for name in names if name in joints])
            own, first = uv[3][:, [names.index(name) for name in walker.names]], None
            for late_s in AS_MOCAP_S:
                clock, _, _, why = from_mocap.from_detections(cameras[3], walker, own, t + late_s)
                found = -clock.late_s
                first = found if first is None else first
                half, beyond = clocks.NORMAL_95 * clock.given[0], found - first - late_s
                print(
                    f"{source:<10}{tool:<10}{1000 * late_s:>7.1f}{1000 * found:>9.1f}{1000 * half:>9.1f}"
                    f"{1000 * beyond:>9.1f}  {why}"
                )


def main():
    data = Path(sys.argv[1]) if len(sys.argv) > 1 else recording.ROOT.parent / "shared/data/real_outdoor"
    table(data)
    as_mocap(data)


if __name__ == "__main__":
    main()
