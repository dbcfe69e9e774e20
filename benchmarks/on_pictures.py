"""Detections that do not lie on the pictures: how many are refused with their cause, and how many good ones are not.

usage: python -m benchmarks.on_pictures [SEEDS] [LEVEL ...]      (20 seeds, ideal and real)

Every seed is a walk of 10 s indoors and one outdoors, of which the close cameras are looked at, each alone: the
pictures that the step would read are rendered and compressed in memory. `clean` is what the detector gives; then it is
spoilt. A camera counts as named where the sentence has the cause (a slip of frames within two of it), as refused where
it has another, and as untold where nothing is refused. A walk is refused where one of its cameras is. `cpu` is of one
camera, reading the bag and decoding excepted.
"""

import sys
import time
from collections import Counter

import cv2
import numpy as np

from dior.body.names import MLKIT_33
from dior.errors import DiorError
from dior.ingest import on_pictures
from dior.simulate import detector_real, simulate, truth
from dior.simulate import settings as levels
from dior.simulate.detector import detect
from dior.simulate.motion import motion_of

SEEDS, FACTOR, SIZE = 20, 4, (1280, 720)
CORNER = np.array(SIZE) - 1.0


def shifted(uv, frames):
    out = np.full(uv.shape, np.nan)
    out[max(frames, 0) : len(uv) + min(frames, 0)] = uv[max(-frames, 0) : len(uv) - max(frames, 0)]
    return out


FAULTS = {
    "clean": (lambda uv: uv, ()),
    "turned by 180": (lambda uv: CORNER - uv, ("turned by 180 degrees",)),
    "half-size pictures": (lambda uv: (uv + 0.5) / 2 - 0.5, ("multiplied by 2:",)),
    "mirrored": (lambda uv: CORNER * (1, 0) + uv * (-1, 1), ("mirrored left to right",)),
    "6 frames late": (lambda uv: shifted(uv, 6), tuple(f"taken {k} frames earlier" for k in (4, 5, 6, 7, 8))),
    "another walk's": (lambda uv: uv[::-1], ("nowhere near",)),
}


def verdicts(seed, level, environment):
    """Of each close camera of a walk, by fault: the code of the finding or the sentence, and seconds of the CPU."""
    settings = levels.from_dict(
        {
            "preset": level, "seed": seed, "subjects": 1, "sequences": 1, "environments": [environment],
            "duration_s": 10.0, "gallery": False, "walks": [levels.WALKS[seed % 3]],
        }
    )  # fmt: skip
    walk = levels.sequences(settings)[0]
    motion = motion_of(settings, walk)
    views, others = simulate.observe(settings, walk, motion)
    if level == "real":
        found = detector_real.detect(settings, walk, motion.height, views, others)
    else:
        found = {
            name: detect(seen, settings.detector.noise_px, truth.detector_generator(settings, walk, name))
            for name, seen in views.items()
        }
    for name, seen in views.items():
        if seen.placed.camera.role == "close":
            paint = simulate.painter(settings, walk, motion.height, seen, others[name])
            yield name, _of_camera(paint, found[name])


def _of_camera(paint, detected):
    kept, out = {}, {}
    clean = np.where((detected.found[:, None] & (detected.score >= 0.3))[..., None], detected.uv, np.nan)
    for fault, (spoil, _) in FAULTS.items():
        uv = spoil(clean)
        there = np.flatnonzero(np.isfinite(uv).all(axis=-1).sum(axis=1) >= on_pictures.FEWEST_JOINTS)
        shown = on_pictures.chosen(uv, there, on_pictures.SLIPS[-1] // 2)
        for i in shown.tolist():
            if i not in kept:
                kept[i] = cv2.imdecode(paint(i), cv2.IMREAD_REDUCED_COLOR_4)
        start = time.process_time()
        try:
            said = on_pictures.verdict(uv, MLKIT_33, SIZE, shown, [kept[i] for i in shown.tolist()], FACTOR, "")[0][1]
        except DiorError as error:
            said = str(error)
        out[fault] = said, time.process_time() - start
    return out


def judged(fault, said):
    if said.startswith("detections_"):
        return "untold"
    return "named" if any(words in said for words in FAULTS[fault][1]) else "refused"


def table(seeds=SEEDS, chosen=levels.LEVELS):
    """Print a row per level and fault, over cameras and over walks."""
    print(
        f"{'level':<7}{'fault':<20}{'cameras':>8}{'named':>7}{'refused':>9}{'untold':>8}{'walks':>7}{'refused':>9}"
        f"{'cpu, s':>8}"
    )
    for level in chosen:
        cameras, walks, cpu = {fault: Counter() for fault in FAULTS}, {fault: Counter() for fault in FAULTS}, []
        for seed in range(1, seeds + 1):
            for environment in ("outdoor", "indoor"):
                each = dict(verdicts(seed, level, environment))
                for fault in FAULTS:
                    found = [judged(fault, one[fault][0]) for one in each.values()]
                    cameras[fault].update(found)
                    walks[fault][any(word != "untold" for word in found)] += 1
                    cpu += [one[fault][1] for one in each.values()]
                    if fault == "clean":
                        for name, one in each.items():
                            if judged(fault, one[fault][0]) != "untold":
                                print(f"seed {seed}, {environment}, {name}: {one[fault][0]}", file=sys.stderr)
        for fault in FAULTS:
            own, both = cameras[fault], walks[fault]
            print(
                f"{level:<7}{fault:<20}{own.total():>8}{own['named']:>7}{own['refused']:>9}{own['untold']:>8}"
                f"{both.total():>7}{both[True]:>9}{np.mean(cpu):>8.2f}",
                flush=True,
            )


if __name__ == "__main__":
    table(int(sys.argv[1]) if len(sys.argv) > 1 else SEEDS, sys.argv[2:] or levels.LEVELS)
