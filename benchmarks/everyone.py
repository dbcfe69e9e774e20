"""Two people in one recording, both labelled: is each within the errors of one alone? Captures in memory.

usage: python -m benchmarks.everyone [KIND|all] [LEVEL|both] [SEEDS] [FIRST]      (2 seeds, from 0)

together    another walks beside the subject throughout, 0.9 to 1.3 m away
another     the subject leaves, another walks in for 3 s, the subject comes back
crossing    another walks across the subject's way and passes at 0.45 m or more
same_build  as `together`, both of one height: nothing tells who is the subject
two_views   as `crossing`, with two close cameras alone

Walks of 10 s, three close cameras and a long-range one 60 m away, at poses that are known; the steps `triangulate`,
`refine` and `people` as they are. `alone`: the same person by the same detections, in a recording in which detectors
give nobody else. Mean errors of the labels that are known: of the 3D (mm), in the close pictures and in the long-range
ones (px). `labelled`: of the joints at instants at which two views have the person, those with 3D; `alone` likewise.
`suspect`: of the same, those left open. `mixed`: instants at which what has one person's number is at the other. `ids`:
numbers that were given to the two people of a capture, in the mean; `not he`: captures in which the other is marked as
the subject, which is for `benchmarks.which_person` to judge.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks import long_range, two_walkers, which_person
from dior.body.names import MLKIT_33
from dior.clocks import clock
from dior.geometry import camera_tables
from dior.geometry.camera import project
from dior.ingest.people import People
from dior.label import people
from dior.reconstruct import refine
from dior.simulate import settings as levels
from dior.tables import tables

KINDS = ("together", "another", "crossing", "same_build", "two_views")
WHO = ("subject", "other")
MAX_GAP_S = 0.2
COLUMNS = ("mm", "close_px", "far_px", "labelled", "suspect")


def made(kind, level, seed):
    """`two_walkers.Capture` of a kind."""
    if kind == "two_views":
        return two_walkers.make("crossing", level, seed, views=2)
    return two_walkers.make(kind, level, seed)


def alone(capture, who):
    """The capture as it is with one person only, who is the subject."""
    found = tuple(_only(one, own == who) for one, own in zip(capture.people, capture.owner, strict=True))
    order = [who, 1 - who]
    owner = tuple(np.zeros(len(one.frame), int) for one in found)
    there = np.stack([capture.there[who], np.zeros_like(capture.there[who])])
    return replace(capture, people=found, owner=owner, points=capture.points[order], there=there)


def _only(found, keep):
    person = np.zeros(int(keep.sum()), int)
    return People(found.joints, found.frame[keep], person, found.uv[keep], found.score[keep], found.ran, found.stamp_ns)


def labelled(folder, capture, seed):
    """Tables `people_3d` and `people_2d` of a capture, and the findings {code: text} of the step."""
    folder = Path(folder)
    which_person.labelled(folder, capture)
    refine.run(
        sequence="walk_1", subject=which_person.SUBJECT, skeleton=folder / "skeleton.parquet", max_gap_s=MAX_GAP_S,
        out=folder / "refined.parquet", findings=folder / "refined.findings.parquet",
    )  # fmt: skip
    cameras = [*capture.cameras, long_range.long_range(seed)]
    names = [camera.name for camera in cameras]
    stamps = two_walkers.stamps(capture)
    camera_tables.write_cameras(folder / "cameras.parquet", cameras)
    camera_tables.write_camera_covariance(folder / "covariance.parquet", names, np.zeros((6 * len(names),) * 2))
    clock.write(
        folder / "clocks.parquet", folder / "gains.parquet", "walk_1",
        {name: clock.Clock(0.0, given=(0.0, 0.0)) for name in names},
    )  # fmt: skip
    count = len(stamps)
    each = {"frame": np.arange(count), "stamp_ns": stamps, "height": np.full(count, 720), "width": np.full(count, 1280)}
    frames = {key: np.tile(values, len(names)) for key, values in each.items()}
    tables.write(folder / "frames.parquet", "frames", frames | {"camera": np.repeat(np.array(names, object), count)})
    people.run(
        sequence="walk_1", subject=which_person.SUBJECT,
        rig=people.Rig(
            labelled=names, makers=names[:-1], cameras=[folder / "cameras.parquet"],
            covariance=[folder / "covariance.parquet"], clocks=[folder / "clocks.parquet"],
            clock_gains=[folder / "gains.parquet"],
        ),
        detections=folder / "detections.parquet", everybody_seen=folder / "people.parquet",
        timeline=folder / "timeline.parquet", skeleton=folder / "refined.parquet", frames=folder / "frames.parquet",
        method="robust", limits=which_person.LIMITS, smoothing="smooth", max_gap_s=MAX_GAP_S,
        out=folder / "everybody.parquet", out_labels=folder / "labels.parquet",
        findings=folder / "everybody.findings.parquet", people=folder / "subjects.tsv",
    )  # fmt: skip
    found = tables.read(folder / "everybody.findings.parquet", "findings")
    said = dict(zip(found["code"], found["text"], strict=True))
    body, labels = folder / "everybody.parquet", folder / "labels.parquet"
    return tables.read(body, "people_3d"), tables.read(labels, "people_2d"), said


def judged(capture, seed, body, labels):
    """Sums and counts (2, 5, 2) of COLUMNS by person, instants that are mixed, how many ids there are, and whether the
    other is marked as the subject."""
    cameras = [*capture.cameras, long_range.long_range(seed)]
    sums = np.zeros((2, len(COLUMNS), 2))
    two = in_two_views(capture)
    sums[:, 3, 1] = sums[:, 4, 1] = two.sum(axis=1) * len(MLKIT_33)
    mixed, not_he = 0, False
    ids = sorted(set(body["person"]))
    for one in ids:
        table = tables.rows(body, body["person"] == one)
        points, _ = tables.grid(table, "x", "y", "z")
        status = table["status"].reshape(points.shape[:2])
        with np.errstate(invalid="ignore"):
            off = np.linalg.norm(points[None] - capture.points, axis=-1)
        known = np.isfinite(points).all(axis=-1)
        # whose an instant is: of whom most joints are nearer
        nearer = np.where(known, np.argmin(np.nan_to_num(off, nan=np.inf), axis=0), -1)
        votes = np.stack([(nearer == who).sum(axis=1) for who in range(2)])
        owner = int(votes.sum(axis=1).argmax())
        not_he |= owner == 1 and set(table["is_subject"]) == {"yes"}
        mixed += int((votes[1 - owner] > votes[owner]).sum())
        here = two[owner][:, None]
        sums[owner, 0] += off[owner][known].sum() * 1000, known.sum()
        sums[owner, 3, 0] += (known & here).sum()
        sums[owner, 4, 0] += ((status == "suspect") & here).sum()
        mine = tables.rows(labels, labels["person"] == one)
        for camera in cameras:
            uv, _ = tables.grid(tables.of_camera(mine, camera.name), "u", "v")
            error = np.linalg.norm(uv - project(camera, capture.points[owner])[0], axis=-1)
            there = np.isfinite(error)
            sums[owner, 2 if camera.role == "long_range" else 1] += error[there].sum(), there.sum()
    return sums, np.array([mixed, len(ids), not_he])


def in_two_views(capture):
    """Where (2, T) the detectors of two views gave each person."""
    seen = np.zeros((2, len(capture.cameras), len(capture.seconds)), bool)
    for view, (found, owner) in enumerate(zip(capture.people, capture.owner, strict=True)):
        for who in range(2):
            seen[who, view, found.frame[owner == who]] = True
    return seen.sum(axis=1) >= 2


def one(kind, level, seed):
    """Sums of both together and of each alone, and counts (3,) of `judged`, of a capture."""
    capture = made(kind, level, seed)
    with tempfile.TemporaryDirectory() as folder:
        body, labels, _ = labelled(folder, capture, seed)
    sums, counts = judged(capture, seed, body, labels)
    by_itself = np.zeros_like(sums)
    for who in range(2):
        single = alone(capture, who)
        with tempfile.TemporaryDirectory() as folder:
            body, labels, _ = labelled(folder, single, seed)
        by_itself[who] = judged(single, seed, body, labels)[0][0]
    return sums, by_itself, counts


def main():
    given = [*sys.argv[1:], *("all", "both", "2", "0")[len(sys.argv) - 1 :]]
    kinds = KINDS if given[0] == "all" else given[0].split(",")
    grades = levels.LEVELS if given[1] == "both" else given[1].split(",")
    first, count = int(given[3]), int(given[2])
    print(f"seeds {first}-{first + count - 1}, walks of {two_walkers.SECONDS:g} s; each: together (alone)")
    print(
        f"{'kind':<12}{'level':<7}{'who':<9}{'3D, mm':>15}{'close, px':>15}{'far, px':>15}{'labelled':>17}"
        f"{'suspect':>9}{'mixed':>7}{'ids':>6}{'not he':>8}"
    )
    for kind in kinds:
        for level in grades:
            each = [one(kind, level, seed) for seed in range(first, first + count)]
            both, single, counts = (sum(e[i] for e in each) for i in range(3))
            for who in range(2):
                shown = [f"{_mean(both[who, i]):.2f} ({_mean(single[who, i]):.2f})" for i in range(3)]
                kept = f"{100 * _mean(both[who, 3]):.1f} ({100 * _mean(single[who, 3]):.1f}) %"
                print(
                    f"{kind:<12}{level:<7}{WHO[who]:<9}{shown[0]:>15}{shown[1]:>15}{shown[2]:>15}{kept:>17}"
                    f"{_mean(both[who, 4]):>9.1%}{counts[0]:>7}{counts[1] / count:>6.1f}{counts[2]:>8}",
                    flush=True,
                )


def _mean(pair):
    return pair[0] / pair[1] if pair[1] else np.nan


if __name__ == "__main__":
    main()
