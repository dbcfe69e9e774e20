"""Is the right person labelled where there are two? Captures in memory, triangulated as the step does it.

usage: python -m benchmarks.which_person [KIND|all] [LEVEL|both] [SEEDS] [METRES] [tape]      (20 seeds)
       python -m benchmarks.which_person sizes [LEVEL|both] [SEEDS]

clean              nobody else; a warning is a false alarm
together           a detector of several people; another walks beside the subject throughout
another            the subject leaves, another walks in for 3 s, the subject comes back
one_camera         a detector of one person; one camera follows the other for 35 % of the time
mostly_one_camera  the same for 70 %
same_build         as `together`, both of one height: nothing can decide
two_cameras        two cameras of three follow the other throughout, both of one height: nothing can decide
proportions        as `together`; of one height, people's legs and trunk together differ by 1 % of it
facing             as `together`, with two cameras alone, that face each other

Walks of 10 s, mostly three cameras; the other is 4 to 10 cm taller or smaller, or METRES (- for by chance). The
subject's height is measured, and there is another walk of theirs, by the same cameras and in which nobody else is seen
(step `bodies`); with `tape` there is none. `right`: of the labels, those at the subject's joints; `kept`: of the joints
at instants at which two views have the subject, those with a label; `stranger`: labels at the other; `suspect`: the
share of joints that is left open; `warned`: captures with a warning. `sizes`: by how much one body's statures differ,
in the halves of a walk and in two walks, as mean square and over what is expected. `before`: the same counts where the
choice is made in each camera alone, of the first 5 seeds, since it takes as long again.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import sys
import tempfile
from pathlib import Path
from unittest.mock import patch

import numpy as np

from benchmarks import two_walkers
from dior.body import people_followed, which_person
from dior.geometry import camera_tables
from dior.ingest import detections, people
from dior.reconstruct import bodies, everybody, triangulate
from dior.simulate import settings as levels
from dior.tables import tables

LIMITS = triangulate.Limits(0.3, 45.0, 12.0, 8.0, 0.4)
SUBJECT = "p0123456789"
# a label is the subject's where it is this near, or nearer than to the other
NEAR_M = 0.3
BEFORE = 5
# what the steps before have made, and the tables in it
FILES = {
    "detections.parquet": "detections",
    "people.parquet": "detected_people",
    "timeline.parquet": "timeline",
}


def labelled(folder, capture, seeds=None, alone=None):
    """The step's points (T, 33, 3) m, NaN without one, status (T, 33) and findings {code: text} of a capture.

    `alone`: capture of the subject's other walk.
    """
    folder = Path(folder)
    told = alone and told_by(folder, alone)
    names = write_inputs(folder, capture)
    write_height(folder, capture.height_m)
    triangulate.run(
        sequence="walk_1", subject=SUBJECT, cameras=[folder / "cameras.parquet"], names=names,
        detections=folder / "detections.parquet", timeline=folder / "timeline.parquet", method="robust", limits=LIMITS,
        out=folder / "skeleton.parquet", out_swaps=folder / "swaps.parquet", findings=folder / "findings.parquet",
        told=triangulate.Told(folder / "people.parquet", folder / "subjects.tsv", told, seeds),
    )  # fmt: skip
    table = tables.read(folder / "skeleton.parquet", "skeletons_3d")
    points, _ = tables.grid(table, "x", "y", "z")
    found = tables.read(folder / "findings.parquet", "findings")
    said = dict(zip(found["code"], found["text"], strict=True))
    return points, table["status"].astype(str).reshape(points.shape[:2]), said


def told_by(folder, alone):
    """The step's table `bodies` of a walk of the subject."""
    names = write_inputs(folder, alone)
    for file in FILES:
        (folder / file).rename(folder / f"walk_0.{file}")
    bodies.run(
        session="outdoor", cameras=[folder / "cameras.parquet"], names=names, subjects={"walk_0": SUBJECT},
        walks=bodies.Walks(*([folder / f"walk_0.{file}"] for file in FILES), seeds=[]),
        min_score=LIMITS.min_score, out=folder / "bodies.parquet",
    )  # fmt: skip
    return folder / "bodies.parquet"


def write_inputs(folder, capture):
    """What the steps before have made of a capture; names of the cameras."""
    names = [camera.name for camera in capture.cameras]
    stamps = two_walkers.stamps(capture)
    camera_tables.write_cameras(folder / "cameras.parquet", list(capture.cameras))
    subject, others = [], []
    for name, found in zip(names, capture.people, strict=True):
        subject.append(detections._columns(name, stamps, found, people.follow(found, stamps)))
        others.append(detections._everybody(name, found, people.tracks(found, stamps)))
    tables.write(folder / "detections.parquet", "detections", detections._concatenated(subject))
    tables.write(folder / "people.parquet", "detected_people", detections._concatenated(others))
    two_walkers.write_timeline(folder / "timeline.parquet", names, stamps)
    return names


def write_height(folder, height_m):
    """Write the sheet of people with the subject's height."""
    (folder / "subjects.tsv").write_text(
        "subject\tpseudonym\theight_m\theight_sigma_m\tconsent_release\tconsent_pictures\n"
        f"S01\t{SUBJECT}\t{height_m:.3f}\t{two_walkers.HEIGHT_SIGMA_M}\tyes\tyes\n"
    )


def judged(capture, points, status):
    """Labels, those of them at the subject; joints at instants at which two views have the subject, those of them with
    a label; labels at the other person; joints that are suspect."""
    ok = status == "ok"
    with np.errstate(invalid="ignore"):
        off = np.linalg.norm(points[None] - capture.points, axis=-1)
    off = np.where(capture.there[..., None], off, np.inf)
    right = ok & ((off[0] <= NEAR_M) | (off[0] <= off[1]) & np.isfinite(off[0]))
    two = np.broadcast_to(in_two_views(capture)[:, None], ok.shape)
    return np.array(
        [ok.sum(), right.sum(), two.sum(), (ok & two).sum(), (ok & ~right).sum(), (status == "suspect").sum()]
    )


def in_two_views(capture):
    """Where (T,) the detectors of two views gave the subject."""
    seen = np.zeros((len(capture.cameras), len(capture.seconds)), bool)
    for view, (found, owner) in enumerate(zip(capture.people, capture.owner, strict=True)):
        seen[view, found.frame[owner == 0]] = True
    return seen.sum(axis=0) >= 2


WARNINGS = ("somebody_else", "who_is_subject")


def one(kind, level, seed, taller=None, with_before=False, tape=False):
    """Counts (`judged`) of a capture, what was said by code, and the counts where each camera chooses alone.

    `tape`: there is no other walk of the subject.
    """
    capture = two_walkers.make(kind, level, seed, taller=taller)
    alone = None if tape else two_walkers.alone(capture, level, seed)
    with tempfile.TemporaryDirectory() as folder:
        points, status, said = labelled(folder, capture, alone=alone)
        now, before = judged(capture, points, status), np.zeros(6, int)
        if with_before:
            with patch.object(which_person, "choose", lambda *_: None):
                before = judged(capture, *labelled(folder, capture)[:2])
    return now, said, before


def sizes(levels_asked, seeds):
    """Print how far apart the statures of one person are who is alone in two walks."""
    for grade in levels_asked:
        halves, walks = [], []
        for seed in range(seeds):
            capture = two_walkers.make("clean", grade, seed)
            one, other = (_bodies(each) for each in (capture, two_walkers.alone(capture, grade, seed)))
            middle = len(one) // 2
            halves.append(_apart(*map(people_followed.size_of, (one[:middle], one[middle:]))))
            walks.append(_apart(*map(people_followed.size_of, (one, other)), bodies.ACROSS_M))
        for name, each in (("halves of a walk", halves), ("two walks", walks)):
            metres, share = np.sqrt(np.mean(np.square(each), axis=0))
            print(f"{grade:<7}{name:<18}{1e3 * metres:>6.1f} mm rms{share:>6.2f} of what is expected", flush=True)


def _bodies(capture):
    """Sightings of the one person of a capture."""
    with tempfile.TemporaryDirectory() as folder:
        names = write_inputs(Path(folder), capture)
        read = (tables.read(Path(folder) / file, name) for file, name in FILES.items())
        seen = everybody.at_instants(*read, names, LIMITS.min_score, two_walkers.FPS)
    return [
        body for path in which_person.everybody_around(capture.cameras, seen).people[0].paths for body in path.together
    ]


def _apart(one, other, across_m=0.0):
    """Difference of two sizes, m, and over what is expected."""
    apart = one.stature_m - other.stature_m
    return apart, apart / np.sqrt(one.variance_to(other) + across_m**2)


def main():
    kind = sys.argv[1] if len(sys.argv) > 1 else "all"
    level = sys.argv[2] if len(sys.argv) > 2 else "both"
    seeds = int(sys.argv[3]) if len(sys.argv) > 3 else 20
    taller = float(sys.argv[4]) if len(sys.argv) > 4 and sys.argv[4] != "-" else None
    tape = "tape" in sys.argv[5:]
    if kind == "sizes":
        return sizes(levels.LEVELS if level == "both" else [level], seeds)
    print(f"seeds 0-{seeds - 1}, {two_walkers.SECONDS:g} s each" + (f", {taller:+.2f} m" if taller else ""))
    print(
        f"{'kind':<19}{'level':<7}{'right':>8}{'kept':>8}{'stranger':>10}{'suspect':>9}{'warned':>8}"
        f"{'before: right':>15}{'kept':>8}{'stranger':>10}"
    )
    for which in two_walkers.KINDS if kind == "all" else kind.split(","):
        for grade in levels.LEVELS if level == "both" else level.split(","):
            each = [one(which, grade, seed, taller, seed < BEFORE, tape) for seed in range(seeds)]
            now, before = sum(e[0] for e in each), sum(e[2] for e in each)
            total = seeds * round(two_walkers.SECONDS * two_walkers.FPS) * 33
            warned = sum(any(code in said for code in WARNINGS) for _, said, _ in each)
            print(
                f"{which:<19}{grade:<7}{_share(now[1], now[0]):>8}{_share(now[3], now[2]):>8}{now[4]:>10}"
                f"{_share(now[5], total):>9}{warned:>8}{_share(before[1], before[0]):>15}"
                f"{_share(before[3], before[2]):>8}{before[4]:>10}",
                flush=True,
            )


def _share(part, whole):
    return f"{part / whole:.1%}" if whole else "-"


if __name__ == "__main__":
    main()
