"""Is the camera that does not belong to the others named? Walks of 8 s in memory, with one fault each.

usage: python -m benchmarks.culprit [KIND|all] [RIG|all] [LEVEL|both] [SEEDS]      (20 seeds)
       python -m benchmarks.culprit labels [LEVEL|both] [SEEDS]                    (20 seeds)

pose         one pose is turned by 3 degrees about an axis drawn by chance
session      one camera has the pose of another session: put up at the same place again, 10 cm and 3 degrees off
exchanged    the detections of two cameras have changed places
clean        nothing is wrong; anything that is said is a false alarm
two_cameras  two cameras of the rig, one pose wrong: it cannot be told which
c3d          the motion capture is that of another walk of the same person

two_cameras is for the rigs in memory, c3d for the lab.

around, L, side, four: cameras of benchmarks/wrong_worlds.py and four around, each 10 cm and 3 degrees off its even
place; all pictures are taken at the same moments. `capture`: the field of the simulator with all that level `real` has
(bystander, wall, clocks, lost pictures), its clocks estimated with the fault in it (benchmarks/steps.py). `lab`: the
same indoors, four cameras at their true places, judged by the motion capture (`calibrate.clocks`, `report.lights`).

`alone`: the culprit and nothing else is named; `first`: it is the first of a set that cannot be told apart; `in set`;
`unclear`: it is said that it cannot be told; `none`: nothing is said; `wrong`: somebody else is named. `most`: how many
times as far apart the views of clean walks are than under the best reading (limit `culprit.EXPLAINS`).

`labels`: of captures of three close cameras of which one pose is wrong and `culprit_camera` names it, how far off the
labels are of the camera that is named and of the others, px, how many of them are inside their 95 % ellipses, and how
many joints have a label; and the same of these captures without the fault. `report.red_labels` rests on it: the labels
of the others are released.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import sys
import tempfile
from collections import Counter
from dataclasses import replace
from unittest.mock import patch

import numpy as np

from benchmarks import scene, steps, worlds, wrong_worlds
from dior.body.names import swap_index
from dior.calibrate import clocks
from dior.clocks import clock as on_axis
from dior.errors import DiorError
from dior.geometry import camera_tables, covariance, culprit
from dior.ingest import mocap
from dior.reconstruct import triangulate
from dior.report import lights
from dior.tables import tables

KINDS = ("pose", "session", "exchanged", "clean", "two_cameras", "c3d")
RIGS = {**wrong_worlds.RIGS, "four": (0.0, 90.0, 180.0, 270.0)}
FRAMES, OFF_DEG, OFF_M, LEAST_SCORE = 240, 3.0, 0.1, 0.3
INSIDE = 5.991  # chi-square with 2 degrees of freedom, 95 %
OUTCOMES = ("alone", "first", "in set", "unclear", "none", "wrong")


def turned(camera, random):
    """The camera turned by `OFF_DEG` about any axis."""
    axis = random.normal(size=3)
    return covariance.moved(camera, np.r_[np.radians(OFF_DEG) * axis / np.linalg.norm(axis), 0, 0, 0])


def put_up_again(camera, random):
    return covariance.moved(camera, np.r_[np.radians(OFF_DEG) * random.normal(size=3), OFF_M * random.normal(size=3)])


def faulty(kind, cameras, seed):
    """Cameras with the fault of a kind, whose detections (V,) each one has, and which cameras are wrong."""
    random = np.random.default_rng([seed, KINDS.index(kind)])
    cameras, of = list(cameras), np.arange(len(cameras))
    if kind == "exchanged":
        pair = np.sort(random.permutation(len(cameras))[:2])
        of[pair] = pair[::-1]
        return cameras, of, tuple(pair.tolist())
    if kind == "clean":
        return cameras, of, ()
    view = int(random.integers(len(cameras)))
    cameras[view] = (put_up_again if kind == "session" else turned)(cameras[view], random)
    return cameras, of, (view,)


def judged(kind, rig, level, seed):
    """`culprit.Verdict` and which cameras are wrong, of a walk in memory."""
    with patch.dict(wrong_worlds.RIGS, RIGS):
        placed = wrong_worlds.rig(rig, seed)
    walk = scene.make(level, seed, FRAMES, placed[:2] if kind == "two_cameras" else placed)
    cameras, of, wrong = faulty(kind, walk.given, seed)
    uv = np.where((walk.score >= LEAST_SCORE)[..., None], walk.uv, np.nan)[of]
    crossed = np.repeat(uv[:, None], len(cameras), axis=1)
    return culprit.judge(cameras, crossed, swap_index(walk.names)), wrong


def given_with_fault(made, name, kind, seed):
    """Cameras and detections of a walk with the fault of a kind, as they are written for the steps, and which cameras
    are wrong."""
    session = made.project.session_of(name)
    close = made.project.close(session)
    given = [
        replace(made.views[name][one].placed.camera, intrinsics=lens_of(made, session, one).intrinsics) for one in close
    ]
    cameras, of, wrong = faulty(kind, given, seed)
    camera_tables.write_cameras(made.made("adjust", session), cameras, session)
    detected = exchanged(tables.read(made.made("detections", name), "detections"), close, of)
    tables.write(made.made("detections", name), "detections", detected)
    return cameras, detected, wrong


def judged_capture(kind, level, seed):
    """The same of a simulated capture, its clocks estimated with the fault in it."""
    with tempfile.TemporaryDirectory() as folder:
        made = steps.recorded(
            folder, preset=level, seed=seed, subjects=1, sequences=1, environments=["outdoor"], duration_s=8.0,
            gallery=False,
        )  # fmt: skip
        session = worlds.outdoors(made)
        (name,), close = made.project.sequences_of(session), made.project.close(session)
        cameras, detected, wrong = given_with_fault(made, name, kind, seed)
        steps._clocks(made, name, [made.made("adjust", session)], [])
        crossed, joints = triangulate.crossed(
            detected, tables.read(made.made("timeline", name), "timeline"), close, LEAST_SCORE
        )
        return culprit.judge(cameras, crossed, swap_index(joints)), wrong


def said_indoors(kind, level, seed):
    """The findings of the step `clocks` on an indoor walk, and the scope of the right one, "" for none."""
    with tempfile.TemporaryDirectory() as folder:
        made = steps.recorded(
            folder, preset=level, seed=seed, subjects=1, sequences=2, environments=["indoor"], duration_s=8.0,
            gallery=False,
        )  # fmt: skip
        name, other = made.project.sequences
        session = made.project.session_of(name)
        close = made.project.close(session)
        _, _, wrong = given_with_fault(made, name, "clean" if kind == "c3d" else kind, seed)
        if kind == "c3d":
            c3d = made.folder / f"data/{other}/mocap.c3d"
            mocap.run(
                sequence=name, subject=made.project.subject_of(name), c3d=c3d, frames=made.made("frames", name),
                trigger_log=None, out=made.made("mocap", name),
            )  # fmt: skip
        # no pictures are drawn
        nothing = (on_axis.Clock(0.0), clocks.NONE, clocks.NONE, "nothing tells it")
        with (
            patch.object(type(made.project), "clocked", lambda *_: close),
            patch.object(clocks, "_by_pictures", lambda *_: nothing),
        ):
            steps._clocks(made, name, [made.made("adjust", session)], [])
        rows = tables.read_findings(made.made("clocks", name, ".findings"))
        said = [scope for scope, _, code, _ in lights.by_mocap(rows) if code in culprit.CODES]
        right = name if kind == "c3d" else "/".join((name, *(close[i] for i in wrong))) if wrong else ""
        return said, right


def labelled(level, seed, kind):
    """(errors px and whether inside its ellipse of each label in the picture, share of joints with a label) of the
    cameras of a capture that are wrong and of the others, and whether that is what `triangulate` says."""
    with tempfile.TemporaryDirectory() as folder:
        made = steps.recorded(
            folder, preset=level, seed=seed, subjects=1, sequences=1, environments=["outdoor"], duration_s=8.0,
            gallery=False,
        )  # fmt: skip
        session = worlds.outdoors(made)
        (name,), close = made.project.sequences_of(session), made.project.close(session)
        steps.adjusted(made, session)
        rig, spread = made.made("adjust", session), made.made("adjust", session, ".covariance")
        placed = camera_tables.read_cameras(rig)
        cameras, _, wrong = faulty(kind, [placed[one] for one in close], seed)
        camera_tables.write_cameras(rig, cameras, session)
        steps._clocks(made, name, [rig], [spread])
        steps.skeleton(made, session, name, close)
        found = tables.read(made.made("triangulate", name, ".findings"), "findings")
        said = [scope for scope, code in zip(found["scope"], found["code"], strict=True) if code == "culprit_camera"]
        parts = {True: [], False: []}
        steps._reproject(made, name, close)
        for i, camera in enumerate(close):
            table = tables.read(steps.labels_of(made, name, camera), "labels_2d")
            parts[i in faulty("pose", cameras, seed)[2]].append(of_truth(table, made.views[name][camera]))
        return parts, said == ["/".join((name, *(close[i] for i in wrong)))]


def of_truth(table, seen):
    """(errors px (N,), inside (N,) of a camera's labels in the picture against its `truth.View`, share of joints)."""
    values, joints = tables.grid(table, "u", "v", "sigma_u", "sigma_v", "rho_uv")
    where, shown = [seen.joints.index(joint) for joint in joints], seen.clock.messages
    off = values[..., :2] - seen.uv[shown][:, where]
    there = np.isin(seen.status[shown][:, where], ("ok", "occluded")) & np.isfinite(off).all(axis=-1)
    (u, v), (sigma_u, sigma_v, rho) = off[there].T, values[there][:, 2:].T
    a, b = u / sigma_u, v / sigma_v
    return np.hypot(u, v), (a**2 - 2 * rho * a * b + b**2) / (1 - rho**2) < INSIDE, np.isfinite(off[..., 0]).mean()


def main_labels(level, seeds):
    print(
        f"seeds 1-{seeds}\n{'level':<7}{'fault':<7}{'labels of':<12}{'captures':>9}{'px':>7}{'inside':>8}{'joints':>8}"
    )
    for grade in ("ideal", "real") if level == "both" else (level,):
        found = {}
        for seed in range(1, seeds + 1):
            try:
                each = {kind: labelled(grade, seed, kind) for kind in ("clean", "pose")}
            except DiorError as error:
                print(f"{grade} {seed} is refused before: {error}", file=sys.stderr)
                continue
            if each["pose"][1]:
                for kind, (parts, _) in each.items():
                    for mine, values in parts.items():
                        found.setdefault((kind, mine), []).append(values)
        for (kind, mine), captures in sorted(found.items()):
            px, inside, joints = (
                np.concatenate([np.atleast_1d(one[i]) for parts in captures for one in parts]) for i in range(3)
            )
            whose = "the culprit" if mine else "the others"
            print(
                f"{grade:<7}{kind:<7}{whose:<12}{len(captures):>9}{px.mean():>7.2f}{inside.mean():>8.1%}"
                f"{joints.mean():>8.1%}",
                flush=True,
            )


def outcome_indoors(said, right):
    if not said:
        return "none"
    named = {word for scope in said for word in scope.split("/")}
    return "alone" if named == set(right.split("/")) else "in set" if set(right.split("/")) <= named else "wrong"


def lens_of(made, session, camera):
    return camera_tables.read_cameras(made.made("intrinsics", f"{session}/{camera}"))[camera]


def exchanged(detected, names, of):
    """The table `detections` with each camera's rows those of `names[of]`, frame by frame, as files that were
    exchanged are read: a frame that the other one has not is empty, what is beyond the camera's pictures is lost."""
    out = {key: values.copy() for key, values in detected.items()}
    for view, other in enumerate(of):
        to, source = (np.flatnonzero(detected["camera"] == names[i]) for i in (view, other))
        count = min(len(to), len(source))
        for key in ("person", "u", "v", "score"):
            out[key][to[:count]] = detected[key][source[:count]]
            out[key][to[count:]] = -1 if key == "person" else np.nan
    return out


def outcome(verdict, wrong):
    """One of `OUTCOMES`."""
    named = [one.cameras for one in verdict.readings]
    if not named:
        return "unclear" if verdict.apart else "none"
    if wrong not in named:
        return "wrong"
    return "alone" if len(named) == 1 else "first" if named[0] == wrong else "in set"


def main():
    if sys.argv[1:2] == ["labels"]:
        level, seeds = [*sys.argv[2:], *("both", "20")[len(sys.argv) - 2 :]]
        main_labels(level, int(seeds))
        return
    kinds, rigs, level, seeds = [*sys.argv[1:], *("all", "all", "both", "20")[len(sys.argv) - 1 :]]
    heads = "".join(f"{one:>9}" for one in (*OUTCOMES, "most"))
    print(f"seeds 1-{seeds}\n{'kind':<13}{'rig':<9}{'level':<7}{heads}")
    for kind in KINDS if kinds == "all" else kinds.split(","):
        if kind == "c3d" and rigs != "lab":
            continue
        for rig in RIGS if rigs == "all" else rigs.split(","):
            for grade in ("ideal", "real") if level == "both" else (level,):
                count, most = Counter(), 0.0
                for seed in range(1, int(seeds) + 1):
                    try:
                        if rig == "lab":
                            count[outcome_indoors(*said_indoors(kind, grade, seed))] += 1
                            continue
                        made = judged_capture(kind, grade, seed) if rig == "capture" else judged(kind, rig, grade, seed)
                    except DiorError as error:
                        print(f"{kind} {rig} {grade} {seed} is refused before: {error}", file=sys.stderr)
                        continue
                    count[outcome(*made)] += 1
                    if made[0].others and kind == "clean":
                        most = max(most, made[0].error_px / min(one.least_px for one in made[0].others))
                row = "".join(f"{count[one] or '-':>9}" for one in OUTCOMES)
                print(f"{kind:<13}{rig:<9}{grade:<7}{row}" + (f"{most:>9.2f}" if most else ""), flush=True)


if __name__ == "__main__":
    main()
