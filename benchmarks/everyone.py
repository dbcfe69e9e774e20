"""Two people in one recording, both labelled: is each within the errors of one alone?

usage: python -m benchmarks.everyone [KIND|all] [LEVEL|both] [SEEDS] [FIRST]      (2 seeds, from 0)

together    another walks beside the subject throughout, 0.9 to 1.3 m away
another     the subject leaves, another walks in for 3 s, the subject comes back
crossing    another walks across the subject's way and passes at 0.45 m or more
same_build  as `together`, both of one height: nothing tells who is the subject
two_views   as `crossing`, with two close cameras alone
stands      a capture of dior/simulate: another stands beside the walkway for nine tenths of the time
walks       the same, and walks on a loop beside the subject's

In the first five nobody hides anybody: the detections of each are what they are alone. In the last two the people hide
each other, and pictures are lost, late and of clocks that drift where the level is `real`. Walks of 10 s (8 s of
captures), three close cameras and a long-range one 60 m away, at poses and with clocks that are known; the steps
`triangulate`, `refine` and `people` as they are. `alone`: the same person in a recording without anybody else. Mean
errors of the labels that are known: of the 3D (mm), in the close pictures and in the long-range ones (px). `labelled`:
of the joints at instants at which the detectors of two views gave the person, those with 3D; `alone` likewise.
`suspect`: of the same, those left open. `mixed`: instants at which what has one person's number is at the other. `ids`:
numbers that were given to the two people of a capture, in the mean; `not he`: captures in which the other is marked as
the subject, which is for `benchmarks.which_person` to judge.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import sys
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks import long_range, steps, two_walkers, which_person
from dior.body.names import MLKIT_33
from dior.clocks import clock
from dior.geometry import camera_tables
from dior.geometry.camera import project
from dior.ingest import detections
from dior.ingest.people import People
from dior.label import people
from dior.reconstruct import refine, timeline, triangulate
from dior.simulate import bystander, simulate, truth
from dior.simulate import settings as levels
from dior.simulate.detector import write_mediapipe
from dior.simulate.motion import motion_of
from dior.tables import tables

IN_MEMORY = ("together", "another", "crossing", "same_build", "two_views")
CAPTURES = {"stands": {"bystander": 0.9}, "walks": {"bystander": 0.9, "bystander_walks": True}}
KINDS = (*IN_MEMORY, *CAPTURES)
WHO = ("subject", "other")
MAX_GAP_S, MAX_GAP = 0.2, 1.5
COLUMNS = ("mm", "close_px", "far_px", "labelled", "suspect")


@dataclass(frozen=True, eq=False)
class Truth:
    """`points` (2, T, 33, 3) m of the subject and the other at the instants, NaN where they are not there; `uv` by
    camera (2, F, 33, 2) px in its pictures; `two` (2, T): two views' detectors gave the person; `far`: the long-range
    cameras."""

    points: np.ndarray
    uv: dict
    two: np.ndarray
    far: tuple


def made(kind, level, seed):
    """`two_walkers.Capture` of a kind in memory."""
    if kind == "two_views":
        return two_walkers.make("crossing", level, seed, views=2)
    return two_walkers.make(kind, level, seed)


def alone(capture, who):
    """The capture with one of the two only, who is the subject then."""
    found = tuple(_only(one, own == who) for one, own in zip(capture.people, capture.owner, strict=True))
    owner = tuple(np.zeros(len(one.frame), int) for one in found)
    there = np.stack([capture.there[who], np.zeros_like(capture.there[who])])
    return replace(capture, people=found, owner=owner, points=capture.points[[who, 1 - who]], there=there)


def _only(found, keep):
    person = np.zeros(int(keep.sum()), int)
    return People(found.joints, found.frame[keep], person, found.uv[keep], found.score[keep], found.ran, found.stamp_ns)


def in_memory(folder, capture, seed):
    """`Truth` of a capture, labelled in a folder."""
    which_person.labelled(folder, capture)
    cameras = [*capture.cameras, long_range.long_range(seed)]
    names, stamps = [camera.name for camera in cameras], two_walkers.stamps(capture)
    count = len(stamps)
    each = {"frame": np.arange(count), "stamp_ns": stamps, "height": np.full(count, 720), "width": np.full(count, 1280)}
    frames = {key: np.tile(values, len(names)) for key, values in each.items()}
    tables.write(folder / "frames.parquet", "frames", frames | {"camera": np.repeat(np.array(names, object), count)})
    everybody(folder, cameras, {name: clock.Clock(0.0, given=(0.0, 0.0)) for name in names})
    points = np.where(capture.there[..., None, None], capture.points, np.nan)
    seen = np.zeros((2, len(capture.cameras), count), bool)
    for view, (found, owner) in enumerate(zip(capture.people, capture.owner, strict=True)):
        for who in range(2):
            seen[who, view, found.frame[owner == who]] = True
    return Truth(
        points, {camera.name: project(camera, points)[0] for camera in cameras}, seen.sum(axis=1) >= 2, names[-1:]
    )


def _told(folder):
    return triangulate.Told(folder / "people.parquet", folder / "subjects.tsv")


def everybody(folder, cameras, clocks):
    """The tables of the step `people` in a folder that has those of `triangulate`."""
    refine.run(
        sequence="walk_1", subject=which_person.SUBJECT, skeleton=folder / "skeleton.parquet", max_gap_s=MAX_GAP_S,
        out=folder / "refined.parquet", findings=folder / "refined.findings.parquet",
    )  # fmt: skip
    names = [camera.name for camera in cameras]
    camera_tables.write_cameras(folder / "cameras.parquet", cameras)
    camera_tables.write_camera_covariance(folder / "covariance.parquet", names, np.zeros((6 * len(names),) * 2))
    clock.write(folder / "clocks.parquet", folder / "gains.parquet", "walk_1", clocks)
    people.run(
        sequence="walk_1", subject=which_person.SUBJECT,
        rig=people.SequenceCameras(
            labelled=names, makers=[camera.name for camera in cameras if camera.role == "close"],
            cameras=[folder / "cameras.parquet"], covariance=[folder / "covariance.parquet"],
            clocks=[folder / "clocks.parquet"], clock_gains=[folder / "gains.parquet"],
        ),
        recorded=people.Recorded(
            folder / "detections.parquet", folder / "timeline.parquet", folder / "frames.parquet"
        ),
        told=_told(folder),
        skeleton=folder / "refined.parquet", method="robust", limits=which_person.LIMITS, smoothing="smooth",
        max_gap_s=MAX_GAP_S,
        out=folder / "everybody.parquet", out_labels=folder / "labels.parquet",
        findings=folder / "everybody.findings.parquet",
    )  # fmt: skip


def simulated(folder, kind, level, seed, who):
    """`Truth` of a simulated capture, labelled in a folder, with the people `who` (0 the subject, 1 the other) in it.

    Of one alone, that one is the subject.
    """
    used = levels.from_dict(
        {"preset": level, "seed": seed, "subjects": 1, "sequences": 1, "environments": ["outdoor"], "duration_s": 8.0,
         "gallery": False, "detector": {"level": level, "everybody": True}, **CAPTURES[kind]}
    )  # fmt: skip
    (walk,) = levels.sequences(used)
    motion, views = motion_of(used, walk), _views(used, walk, who)
    of_one = next(iter(views.values()))
    cameras = [seen.camera for seen in of_one.values()]
    close = [camera.name for camera in cameras if camera.role == "close"]
    clocks = {
        name: clock.Clock(seen.clock.offset_s, seen.clock.drift_ppm, given=(0.0, 0.0)) for name, seen in of_one.items()
    }
    nobody = simulate.observe(replace(used, bystander=0.0), walk, motion)[1]
    heights = motion.height, bystander.at(used, walk, np.zeros(1)).height
    names = walk.name, f"{walk.name} second"
    found = {
        one: simulate._detected(used, replace(walk, name=names[one]), heights[one], own, nobody)
        for one, own in views.items()
    }
    for name, seen in of_one.items():
        each = [detected[name] for detected in found.values()]
        write_mediapipe(folder / f"{name}.jsonl", seen.clock, seen.camera.intrinsics, each)
    tables.write(folder / "frames.parquet", "frames", steps._frames(of_one))
    camera_tables.write_cameras(folder / "cameras.parquet", cameras)
    clock.write(folder / "clocks.parquet", folder / "gains.parquet", "walk_1", clocks)
    detections.run(
        looked_at=[], sequence="walk_1", pattern=str(folder / "{camera}.jsonl"), cameras=close, format="mediapipe",
        frames=folder / "frames.parquet", out=folder / "detections.parquet", out_people=folder / "people.parquet",
        findings=folder / "detections.findings.parquet",
    )  # fmt: skip
    timeline.run(
        sequence="walk_1", frames=folder / "frames.parquet", cameras=close, clocks=[folder / "clocks.parquet"],
        mocap=None, max_gap=MAX_GAP, out=folder / "timeline.parquet",
    )  # fmt: skip
    which_person.write_height(folder, heights[who[0]])
    triangulate.run(
        sequence="walk_1", subject=which_person.SUBJECT, cameras=[folder / "cameras.parquet"], names=close,
        detections=folder / "detections.parquet", timeline=folder / "timeline.parquet", method="robust",
        limits=which_person.LIMITS, out=folder / "skeleton.parquet", out_swaps=folder / "swaps.parquet",
        findings=folder / "findings.parquet", told=_told(folder),
    )  # fmt: skip
    everybody(folder, cameras, clocks)
    return _truth_of(folder, used, walk, views, found, close, who)


def _views(used, walk, who):
    """Person -> camera -> `truth.View`; who is not in it hides nobody."""
    motion = motion_of(used, walk)
    both = simulate.observe(used, walk, motion)
    bare = simulate.observe(replace(used, bystander=0.0), walk, motion)[0]
    views = {}
    if 0 in who:
        views[0] = both[0] if 1 in who else bare
    if 1 in who:
        views[1] = {}
        for name, own in both[0].items():
            # far away nobody hides anything
            subject = own if 0 in who else replace(own, landmarks=own.landmarks + 1000.0)
            views[1][name] = truth.second_view(used, walk, subject, motion.height, both[1][name])
    return views


def _truth_of(folder, used, walk, views, found, close, who):
    line = tables.read(folder / "timeline.parquet", "timeline")
    stamps = line["stamp_ns"][:: len(close)]
    frames = tables.read(folder / "frames.parquet", "frames")
    seconds = (stamps - frames["stamp_ns"].min()) / 1e9
    points = np.full((2, len(stamps), len(MLKIT_33), 3), np.nan)
    other = bystander.at(used, walk, seconds)
    for number, one in enumerate(who):
        points[number] = other.landmarks if one else motion_of(used, walk).at(seconds)[0]
        if one:
            points[number][~other.present] = np.nan
    uv, two = {}, np.zeros((2, len(stamps)), int)
    for name, seen in next(iter(views.values())).items():
        shown = seen.clock.messages
        each = [views[one][name].landmark(views[one][name].uv)[shown] for one in who]
        uv[name] = np.stack([*each, np.full_like(each[0], np.nan)][:2])
        if name in close:
            mine = tables.of_camera(line, name)
            for number, one in enumerate(who):
                here = found[one][name].found[shown]
                at = (mine["frame_before"], mine["frame_after"])
                two[number] += (at[0] >= 0) & here[at[0]] & here[at[1]]
    return Truth(points, uv, two >= 2, tuple(name for name in uv if name not in close))


def judged(folder, known):
    """Sums and counts (2, 5, 2) of COLUMNS by person, and counts (3,): instants that are mixed, ids, and whether the
    other is marked as the subject."""
    body = tables.read(folder / "everybody.parquet", "people_3d")
    labels = tables.read(folder / "labels.parquet", "people_2d")
    sums = np.zeros((2, len(COLUMNS), 2))
    sums[:, 3, 1] = sums[:, 4, 1] = known.two.sum(axis=1) * len(MLKIT_33)
    mixed, not_he = 0, False
    ids = sorted(set(body["person"]))
    for one in ids:
        table = tables.rows(body, body["person"] == one)
        points, _ = tables.grid(table, "x", "y", "z")
        status = table["status"].reshape(points.shape[:2])
        off = np.linalg.norm(points[None] - known.points, axis=-1)
        there = np.isfinite(points).all(axis=-1)
        # whose an instant is: of whom most joints are nearer
        nearer = np.where(there, np.argmin(np.nan_to_num(off, nan=np.inf), axis=0), -1)
        votes = np.stack([(nearer == who).sum(axis=1) for who in range(2)])
        owner = int(votes.sum(axis=1).argmax())
        not_he |= owner == 1 and set(table["is_subject"]) == {"yes"}
        mixed += int((votes[1 - owner] > votes[owner]).sum())
        here = known.two[owner][:, None]
        error = off[owner][np.isfinite(off[owner])]
        sums[owner, 0] += error.sum() * 1000, len(error)
        sums[owner, 3, 0] += (there & here).sum()
        sums[owner, 4, 0] += ((status == "suspect") & here).sum()
        mine = tables.rows(labels, labels["person"] == one)
        for camera, uv in known.uv.items():
            error = np.linalg.norm(tables.grid(tables.of_camera(mine, camera), "u", "v")[0] - uv[owner], axis=-1)
            error = error[np.isfinite(error)]
            sums[owner, 2 if camera in known.far else 1] += error.sum(), len(error)
    return sums, np.array([mixed, len(ids), not_he])


def one(kind, level, seed):
    """Sums of both together and of each alone, and counts (3,) of `judged`, of a capture."""

    def of(who):
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            if kind in CAPTURES:
                return judged(folder, simulated(folder, kind, level, seed, who))
            capture = made(kind, level, seed)
            capture = capture if len(who) > 1 else alone(capture, who[0])
            return judged(folder, in_memory(folder, capture, seed))

    sums, counts = of((0, 1))
    return sums, np.stack([of((who,))[0][0] for who in range(2)]), counts


def main():
    given = [*sys.argv[1:], *("all", "both", "2", "0")[len(sys.argv) - 1 :]]
    kinds = KINDS if given[0] == "all" else given[0].split(",")
    grades = levels.LEVELS if given[1] == "both" else given[1].split(",")
    first, count = int(given[3]), int(given[2])
    print(f"seeds {first}-{first + count - 1}; each: together (alone)")
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
