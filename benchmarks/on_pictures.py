"""Detections that do not lie on the pictures: how many are refused with their cause, and how many good ones are not.

usage: python -m benchmarks.on_pictures [SEEDS] [LEVEL ...]      (20 seeds, ideal and real)

Every seed is a walk of 10 s indoors and one outdoors, of which the close cameras are looked at, each alone: the
pictures that the step would read are rendered and compressed in memory. `clean` is what the detector gives; then it is
spoilt, or taken from the next seed's walk. A camera counts as named where the sentence has the cause (a slip of frames
within two of it), as refused where it has another, as unsure where the step says that it cannot tell this, and as
untold where it does not. A walk is refused where one of its cameras is, and named where all that are refused are named.
`cpu` is of one camera, reading the bag and decoding excepted.
"""

import re
import sys
import time
from collections import Counter
from functools import lru_cache

import cv2
import numpy as np

from dior.body.names import MLKIT_33
from dior.errors import DiorError
from dior.ingest import on_pictures
from dior.simulate import settings as levels
from dior.simulate import simulate
from dior.simulate.motion import motion_of

SEEDS, FACTOR, SIZE = 20, 4, (1280, 720)
CORNER = np.array(SIZE) - 1.0


def shifted(uv, frames):
    out = np.full(uv.shape, np.nan)
    out[max(frames, 0) : len(uv) + min(frames, 0)] = uv[max(-frames, 0) : len(uv) - max(frames, 0)]
    return out


FAULTS = {
    "clean": (lambda uv, _: uv, ()),
    "turned by 180": (lambda uv, _: CORNER - uv, ("turned by 180 degrees",)),
    "half-size pictures": (lambda uv, _: (uv + 0.5) / 2 - 0.5, ("multiplied by 2:",)),
    "mirrored": (lambda uv, _: CORNER * (1, 0) + uv * (-1, 1), ("mirrored left to right",)),
    "6 frames late": (lambda uv, _: shifted(uv, 6), tuple(f"taken {k} frames earlier" for k in (4, 5, 6, 7, 8))),
    "another walk's": (lambda _, other: other, ("another camera or recording",)),
}
# what the step says where it cannot tell at all, and where it cannot tell the fault
CANNOT = "it cannot be told whether"
UNSURE = {
    "clean": (), "turned by 180": (CANNOT, "turned by 180 degrees"), "half-size pictures": (CANNOT, "multiplied by 2,"),
    "mirrored": (CANNOT, "mirrored left to right"), "6 frames late": (CANNOT, "some frames earlier or later"),
    "another walk's": (CANNOT,),
}  # fmt: skip


@lru_cache(2)
def _detected(seed, level, environment):
    """By close camera: a function that paints a frame, and the detections (F, J, 2) px, NaN where none or unsure."""
    settings = levels.from_dict(
        {
            "preset": level, "seed": seed, "subjects": 1, "sequences": 1, "environments": [environment],
            "duration_s": 10.0, "gallery": False, "walks": [levels.WALKS[seed % 3]],
        }
    )  # fmt: skip
    walk = levels.sequences(settings)[0]
    motion = motion_of(settings, walk)
    views, others = simulate.observe(settings, walk, motion)
    found = simulate.detected(settings, walk, motion.height, views, others)
    return {
        name: (
            simulate.painter(settings, walk, motion.height, seen, others[name]),
            np.where((found[name].found[:, None] & (found[name].score >= 0.3))[..., None], found[name].uv, np.nan),
        )
        for name, seen in views.items()
        if seen.placed.camera.role == "close"
    }


def verdicts(seed, level, environment):
    """Of each close camera of a walk, by fault: code ("" of an error) and text of the finding; and seconds of CPU."""
    others = _detected(seed + 1, level, environment)
    for name, (paint, uv) in _detected(seed, level, environment).items():
        other = np.full(uv.shape, np.nan)
        both = min(len(uv), len(others[name][1]))
        other[:both] = others[name][1][:both]
        yield name, _of_camera(paint, uv, other)


def _of_camera(paint, clean, other):
    kept, out = {}, {}
    for fault, (spoil, _) in FAULTS.items():
        uv = spoil(clean, other)
        there = np.flatnonzero(np.isfinite(uv).all(axis=-1).sum(axis=1) >= on_pictures.FEWEST_JOINTS)
        shown = on_pictures.chosen(uv, there, on_pictures.SLIPS[-1] // 2)
        for i in shown.tolist():
            if i not in kept:
                kept[i] = cv2.imdecode(paint(i), cv2.IMREAD_REDUCED_COLOR_4)
        start = time.process_time()
        try:
            few = [kept[i] for i in shown.tolist()]
            said = on_pictures.verdict(uv, MLKIT_33, SIZE, shown, few, FACTOR, "")[0][1:]
        except DiorError as error:
            said = "", str(error)
        out[fault] = said, time.process_time() - start
    return out


def judged(fault, said):
    """How a camera counts by the code and the text of the step, which refuses without a code."""
    code, text = said
    if code:
        slip = re.search("and not ([0-9]+) frames or more off", text)
        cannot = code == "detections_unsure" and any(words in text for words in UNSURE[fault])
        return "unsure" if cannot or (fault == "6 frames late" and slip and int(slip[1]) > 6) else "untold"
    return "named" if any(words in text for words in FAULTS[fault][1]) else "refused"


def table(seeds=SEEDS, chosen=levels.LEVELS):
    """Print a row per level and fault, over cameras and over walks."""
    print(
        f"{'level':<7}{'fault':<20}{'cameras':>8}{'named':>7}{'refused':>9}{'unsure':>8}{'untold':>8}{'walks':>7}"
        f"{'refused':>9}{'named':>7}{'cpu, s':>8}"
    )
    for level in chosen:
        cameras, walks, cpu = {fault: Counter() for fault in FAULTS}, {fault: Counter() for fault in FAULTS}, []
        for seed in range(1, seeds + 1):
            for environment in ("outdoor", "indoor"):
                each = dict(verdicts(seed, level, environment))
                for fault in FAULTS:
                    found = [judged(fault, one[fault][0]) for one in each.values()]
                    cameras[fault].update(found)
                    told = {*found} & {"named", "refused"}
                    walks[fault].update(told and {"refused", *(("named",) if told == {"named"} else ())})
                    walks[fault]["all"] += 1
                    cpu += [one[fault][1] for one in each.values()]
                    for name, one in each.items():
                        if judged(fault, one[fault][0]) not in (("untold",) if fault == "clean" else ("named",)):
                            print(f"seed {seed}, {environment}, {name}, {fault}: {one[fault][0]}", file=sys.stderr)
        for fault in FAULTS:
            own, both = cameras[fault], walks[fault]
            print(
                f"{level:<7}{fault:<20}{own.total():>8}{own['named']:>7}{own['refused']:>9}{own['unsure']:>8}"
                f"{own['untold']:>8}{both['all']:>7}{both['refused']:>9}{both['named']:>7}{np.mean(cpu):>8.2f}",
                flush=True,
            )


if __name__ == "__main__":
    table(int(sys.argv[1]) if len(sys.argv) > 1 else SEEDS, sys.argv[2:] or levels.LEVELS)
