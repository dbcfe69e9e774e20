"""A camera whose pose is turned, by its detections against the 3D: is it named, and is a right one left alone?

usage: python -m benchmarks.turned [SEEDS] [SECONDS]      (20 seeds, walks of 10 s)

Captures of benchmarks/clocks_detections.py, four cameras indoors, poses and lenses true but for the turn: to the side
or up, of a camera that is drawn. `noted` and `warned`: a note or a warning names that camera; `false`: anything is said
of a right capture. `beside` is how far the middle of a right camera's detections is at most from the others', m.

Below it the cameras of ../shared/data/real_outdoor at their reference poses, against its publisher's 3D: two real
detectors, that see somebody on a beam from one side each. What is said there is said of right poses.
"""

import sys

import numpy as np

from benchmarks import clocks_real, real_outdoor
from benchmarks.clocks_detections import recorded, seen_by
from dior.body.names import MLKIT_33
from dior.calibrate.clock import from_mocap
from dior.clocks.clock import Clock
from dior.evaluate.turned import turned
from dior.geometry import covariance
from dior.ingest.mocap_files import trc

TURNS_DEG = (0.3, 1.0)
DATA = real_outdoor.ROOT.parent / "shared/data/real_outdoor"
PARTS = ("Shoulder", "Elbow", "Wrist", "Hip", "Knee", "Ankle")


def aside(level, seed, seconds, turn_deg):
    """Camera -> `turned.Aside` with its pose right and with it turned, and the camera that is drawn."""
    settings, walk, motion, views, found = recorded(level, "indoor", seed, seconds, apart_s=0.02)
    ticks = np.arange(int((seconds + 1) * settings.mocap_hz)) / settings.mocap_hz
    walker = from_mocap.walker_of(ticks, motion.at(ticks)[1], list(motion.names), list(MLKIT_33))
    order = [MLKIT_33.index(name) for name in walker.names]
    t0 = min(view.clock.stamp_ns[0] for view in views.values())
    axis = np.eye(6)[seed % 2]  # of the camera: x is up and down, y to the side
    step = np.radians(turn_deg) * axis * (-1) ** (seed // 2)
    told = []
    for right in (True, False):
        each = {}
        for name, view in views.items():
            camera = view.camera if right else covariance.moved(view.camera, step)
            uv, elapsed = seen_by(found[name], False)[:, order], (view.clock.stamp_ns - t0) / 1e9
            clock, _, _, why = from_mocap.from_detections(camera, walker, uv, elapsed)
            if not why:
                each[name] = from_mocap.aside_m(camera, walker, uv, elapsed, clock)
        told.append(each)
    who = list(views)[seed % len(views)]
    return told[0], told[0] | {who: told[1][who]} if who in told[1] else told[0], who


def beside(each):
    """How far (m) a camera's middle is at most from those of the others, to a side or up."""
    off = {name: np.mean([*own.values()], axis=0) for name, (own, _) in each.items()}
    apart = [own - np.median([off[o] for o in off if o != name], axis=0) for name, own in off.items()]
    return float(np.abs(apart).max())


def of_real(tool, data=DATA):
    """Camera -> `turned.Aside` of a real detector, poses right."""
    capture = trc.read(data / "reference/skeleton.trc")
    uv, joints = clocks_real.detections(data, tool)
    sides = {"L": "left", "R": "right"}
    names = {f"{sides[side]}_{part.lower()}": f"{side}{part}" for side in sides for part in PARTS}
    # the file's axes are the world's (Y, Z, X)
    points = capture.points([capture.labels.index(label) for label in names.values()])[..., [2, 0, 1]]
    t = np.arange(len(points)) / real_outdoor.FPS
    walker = from_mocap.WalkerJoints(t, points, np.zeros((*points.shape, 3)), np.zeros((len(t), 2)), [*names])
    order = [joints.index(name) for name in names]
    return {
        camera.name: from_mocap.aside_m(camera, walker, seen[:, order], t, Clock(0.0))
        for camera, seen in zip(real_outdoor.rig(data), uv, strict=True)
    }


def main():
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    seconds = float(sys.argv[2]) if len(sys.argv) > 2 else 10.0
    print(f"{seeds} captures of {seconds:g} s, one camera of four turned")
    print(f"{'detector':<10}{'turn, deg':>10}{'noted':>7}{'warned':>8}{'false':>7}{'beside, m':>11}")
    for level in ("ideal", "real"):
        for turn_deg in TURNS_DEG:
            said, false, most = [], 0, 0.0
            for seed in range(1, seeds + 1):
                clean, moved, who = aside(level, seed, seconds, turn_deg)
                said += [severity for scope, severity, *_ in turned("walk", moved) if scope == f"walk/{who}"]
                false, most = false + bool(turned("walk", clean)), max(most, beside(clean))
            noted, warned = said.count("info"), said.count("warning")
            print(f"{level:<10}{turn_deg:>10.1f}{noted:>7}{warned:>8}{false:>7}{most:>11.4f}", flush=True)
    print("real_outdoor, reference poses")
    for tool in ("OpenPose", "ML Kit"):
        each = of_real(tool)
        said = ", ".join(f"{severity} of {scope}" for scope, severity, *_ in turned("walk", each)) or "nothing"
        print(f"{tool:<10}{beside(each):>10.4f} m beside; said: {said}")


if __name__ == "__main__":
    main()
