"""An indoor camera whose pose is turned by 0.3 degrees, by its detections against the motion capture: is it named, and
is a right one left alone?

usage: python -m benchmarks.turned [SEEDS] [SECONDS]      (20 seeds, walks of 10 s)

Captures of benchmarks/clocks_detections.py, four cameras, poses and lenses true but for the turn: to the side or up, of
a camera that is drawn. `beside` is how far the middle of a right camera's detections is at most from the others', m.
"""

import sys

import numpy as np

from benchmarks.clocks_detections import recorded, seen_by
from dior.body.names import MLKIT_33
from dior.calibrate.clock import from_mocap
from dior.evaluate.turned import turned
from dior.geometry import covariance

TURN_DEG = 0.3


def aside(level, seed, seconds):
    """Camera -> `turned.Aside` with its pose right and with it turned, and the camera that is drawn."""
    settings, walk, motion, views, found = recorded(level, "indoor", seed, seconds, apart_s=0.02)
    ticks = np.arange(int((seconds + 1) * settings.mocap_hz)) / settings.mocap_hz
    walker = from_mocap.walker_of(ticks, motion.at(ticks)[1], list(motion.names), list(MLKIT_33))
    order = [MLKIT_33.index(name) for name in walker.names]
    t0 = min(view.clock.stamp_ns[0] for view in views.values())
    axis = np.eye(6)[seed % 2]  # of the camera: x is up and down, y to the side
    step = np.radians(TURN_DEG) * axis * (-1) ** (seed // 2)
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


def main():
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    seconds = float(sys.argv[2]) if len(sys.argv) > 2 else 10.0
    print(f"{seeds} captures of {seconds:g} s, one camera of four turned by {TURN_DEG} degrees")
    print(f"{'detector':<10}{'named':>7}{'right camera':>14}{'false alarms':>14}{'beside, m':>11}")
    for level in ("ideal", "real"):
        named = right = alarms = 0
        most = 0.0
        for seed in range(1, seeds + 1):
            clean, moved, who = aside(level, seed, seconds)
            said = [scope for scope, *_ in turned("walk", moved)]
            named, right = named + bool(said), right + (said == [f"walk/{who}"])
            alarms, most = alarms + bool(turned("walk", clean)), max(most, beside(clean))
        print(f"{level:<10}{named:>7}{right:>14}{alarms:>14}{most:>11.4f}", flush=True)


if __name__ == "__main__":
    main()
