"""`dior assess` on datasets that are right, and that are wrong on purpose: what is named, and with which size?

usage: python -m benchmarks.assess [SEEDS] [LEVEL|both] [SECONDS]      (10 seeds, both levels, walks of 10 s)

Three cameras that stand unevenly around a walker (`scene`), his true 3D as the motion capture, detections of either
level; a third of the seeds walks a circle. `right`: how many of the right datasets something is said of (false alarms).
Of each mistake: how often it is named, how often nothing else is said, and its size as it was found, the middle and the
worst; `held`: how many of the 95 % intervals of size hold the truth.
"""

import sys
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from benchmarks import scene
from dior.assess import judge, lens
from dior.assess.recording import Motion, Recording, View

MIN_SCORE = 0.3
# azimuth, distance, height: no two cameras see the same
RIG = ((0.0, 5.0, 1.5), (95.0, 4.2, 1.5), (230.0, 6.0, 2.2))
LATE_S, DRIFT, SCALE, FOCAL = 0.4, 0.01, 1.1, 1.05


def recording(level, seed, frames=300, walk="across"):
    """A right dataset."""
    cameras = [scene.camera(f"cam{i + 1:02d}", *place) for i, place in enumerate(RIG)]
    made = scene.make(level, seed=seed, frames=frames, cameras=cameras, walk=walk)
    uv = np.where((made.score >= MIN_SCORE)[..., None], made.uv, np.nan)
    views = tuple(View(c, made.seconds, own, scene.FPS) for c, own in zip(made.given, uv, strict=True))
    return Recording("walk", made.names, views, Motion(made.seconds, made.points, made.names))


def judged(one):
    return judge.judged(one)


def late(view, late_s):
    """The view with times that are too early, so that `late_s` has to be added."""
    return replace(view, elapsed=view.elapsed - late_s)


def drifting(view, drift):
    """The view with a clock to which `drift` has to be added for each of its seconds."""
    middle = view.elapsed.mean()
    return replace(view, elapsed=middle + (view.elapsed - middle) / (1 + drift))


def _one(recording, index, change):
    views = [change(view) if i == index else view for i, view in enumerate(recording.views)]
    return replace(recording, views=tuple(views))


def _exchanged(recording):
    a, b, c = recording.views
    return replace(recording, views=(replace(b, camera=a.camera), replace(a, camera=b.camera), c))


def _scaled(recording):
    return replace(recording, motion=recording.motion.at(SCALE * recording.motion.xyz))


@dataclass(frozen=True)
class Mistake:
    """`make(recording)`: the dataset with it; `expected`: what it is about and the code; its `size`, and `within` how
    much of it that is to be found."""

    make: Callable
    expected: tuple
    size: float
    within: float


WRONG = {
    "offset": Mistake(lambda r: _one(r, 1, lambda v: late(v, LATE_S)), ("cam02", "offset"), LATE_S, 0.003),
    "drift": Mistake(lambda r: _one(r, 1, lambda v: drifting(v, DRIFT)), ("cam02", "drift"), DRIFT, 0.0006),
    "exchanged": Mistake(_exchanged, ("", "exchanged"), 2.0, 0.0),
    "scale": Mistake(_scaled, ("", "world_scale"), 1 / SCALE, 0.01),
    "lens": Mistake(
        lambda r: _one(r, 1, lambda v: replace(v, camera=lens.bent(v.camera, 1 / FOCAL, 0.0))),
        ("cam02", "lens"),
        FOCAL,
        0.01,
    ),
}  # fmt: skip


def size_of(found, name):
    """The size of a mistake as it was found."""
    return size_and_half(found, name)[0]


def size_and_half(found, name):
    row = found.rows[1]
    if name == "offset":
        return row.timing.late_s, row.timing.half_s
    if name == "drift":
        return row.timing.drift, row.timing.half_drift
    if name == "lens":
        return row.lens.focal, row.lens.half_focal
    if name == "exchanged":
        text = next((fault.text for fault in found.faults if fault.code == "exchanged"), "")
        return float(("cam01" in text) + ("cam02" in text) - 9 * ("cam03" in text)), 0.0
    said = next((fault.text for fault in found.faults if fault.code == "world_scale"), "")
    if not said:
        return np.nan, np.nan
    words = said.split()
    return float(words[words.index("times") + 1]), float(words[words.index("±") + 1])


def said(found):
    own = [("", fault.code) for fault in found.faults]
    return own + [(row.camera, fault.code) for row in found.rows for fault in row.faults]


def main(seeds=10, level="both", seconds=10.0):
    for one in ("ideal", "real") if level == "both" else (level,):
        made = [
            recording(one, seed, round(seconds * scene.FPS), "circling" if seed % 3 == 2 else "across")
            for seed in range(seeds)
        ]
        alarms = {seed: judged(own).verdict for seed, own in enumerate(made) if judged(own).wrong}
        print(f"{one}: right {len(alarms)} of {seeds} false", flush=True)
        for seed, text in alarms.items():
            print(f"  seed {seed}: {text}")
        for name, mistake in WRONG.items():
            found = [judged(mistake.make(own)) for own in made]
            exact = sum(set(said(own)) == {mistake.expected} for own in found)
            named = sum(mistake.expected in said(own) for own in found)
            sizes = np.array([size_and_half(own, name) for own in found if mistake.expected in said(own)]).reshape(
                -1, 2
            )
            off = np.abs(sizes[:, 0] - mistake.size)
            text = f"  {name}: named {named}, nothing else {exact} of {seeds}"
            if len(sizes):
                text += f"; true {mistake.size:.4g}, found {np.median(sizes[:, 0]):.4g}, worst off {off.max():.2g}"
                text += f", held {int((off <= sizes[:, 1] + 1e-9).sum())}"
            print(text, flush=True)


if __name__ == "__main__":
    words = sys.argv[1:]
    main(
        int(words[0]) if words else 10,
        words[1] if len(words) > 1 else "both",
        float(words[2]) if len(words) > 2 else 10.0,
    )
