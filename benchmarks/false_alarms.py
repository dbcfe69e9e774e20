"""What is said of clean captures of two indoor and two outdoor walks: warnings, errors, lights that are red or amber.

usage: python -m benchmarks.false_alarms [LEVEL|both] [FIRST] [LAST]      (seeds 1 to 20)

Each capture is simulated and labelled anew (benchmarks/steps.py), walks of 8 s, its outdoor cameras are placed again by
their true poses as a reference calibration, and its labels are measured by `evaluate` with its boxes and marks. Each
warning and error of a step and each figure of which a camera's light is not green is printed, and counted by its code;
`red` are the labels that would be out of a release (`report.red_labels`). `true`: what the truth bears out is no false
alarm, that somebody else alone was found, that a wall may hide a part of the body, that so many detections are wrong,
that a walk towards the camera whose legs a wall hides does not tell its clock.
Of recordings as such (`audit`, benchmarks/bag_faults.py) and of pictures (`detections_on_pictures`,
benchmarks/on_pictures.py) nothing is asked.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import re
import sys
import tempfile
from collections import Counter

import numpy as np

from benchmarks import steps, worlds
from dior.errors import DiorError
from dior.evaluate import evaluate, moved
from dior.report import lights, red_labels
from dior.tables import tables

SECONDS = 8.0
ACROSS_M = 1.0  # chosen: who goes less far across the sight of the long-range camera walks along it


def said(made):
    """(code, where, text) of all that is said of a labelled capture, the code "true ..." where the truth has it so."""
    for name in made.project.sequences:
        worlds.said(made, name)
        yield from _lights(made, name)
    for session in made.project.sessions:
        if made.project.window(session):
            _moved(made, session)
    worlds.reference_run(made)
    results = made.folder / "results"
    # a folder that begins with a point holds sums
    for path in sorted(results.glob("[a-z]*/**/*.findings.parquet")):
        step = path.relative_to(results).parts[0]
        for scope, severity, code, text in tables.read_findings(path):
            if severity != "info":
                true = "true " if _borne_out(made, scope, code, text) else ""
                yield true + code, f"{step} {severity}, {scope}", text


def _moved(made, session):
    """What is said of its cameras from walk to walk."""
    names, close = made.project.sequences_of(session), made.project.close(session)
    moved.run(
        session=session, sequences=names, names=close, cameras=[made.made("adjust", session)],
        detections=[made.made("triangulate", name, ".detections") for name in names],
        timelines=[made.made("timeline", name) for name in names],
        swaps=[made.made("triangulate", name, ".swaps") for name in names],
        min_score=made.project.config["detector"]["min_score"], adjusted=sorted(made.project.window(session)),
        out=made.made("moved", session), findings=made.made("moved", session, ".findings"),
    )  # fmt: skip


def _borne_out(made, scope, code, text):
    """Whether the truth has what a finding says of the recorded pictures and detections."""
    if code == "occluder_doubtful":
        return made.settings.occluder
    first, _, camera = scope.partition("/")
    if code == "clock_unknown":
        # the long-range camera stands on the Y axis
        far = made.project.cameras(made.project.session_of(first))[camera]["role"] == "long_range"
        truth = tables.read(made.folder / f"data/truth/{first}/skeletons_3d.parquet", "skeletons_3d")
        across = np.ptp(truth["x"][truth["joint"] == "left_hip"])
        return made.settings.occluder and far and across < ACROSS_M
    if code not in ("subject_left_out", "somebody_else", "adjust_disagreeing"):
        return False
    walk = first if first in made.project.sequences else made.project.sequences_of(first)[0]
    done = tables.read(made.folder / f"data/truth/{walk}/detections.parquet", "simulated_detections")
    if code == "adjust_disagreeing":
        wrong = done["bystander"] | done["wrong_together"] | done["swapped"] | done["guessed"]
        return float(re.match("([0-9.]+)%", text)[1]) <= 100 * wrong[~done["missed"]].mean()
    others = set(zip(*(done[key][done["bystander"]].tolist() for key in ("camera", "frame")), strict=True))
    if code == "subject_left_out":
        return int(re.search("in ([0-9]+) of", text)[1]) <= sum(one == camera for one, _ in others)
    # most of them: who is whose is decided by stretches
    stretches = re.findall("frames ([0-9]+) to ([0-9]+) of ([a-z0-9]+)", text)
    return all(
        sum((one, frame) in others for frame in range(int(a), int(b) + 1)) > (int(b) - int(a)) / 2
        for a, b, one in stretches
    )


def _lights(made, name):
    """What is wrong with the labels of a walk, and its figures that are amber."""
    project, session = made.project, made.project.session_of(name)
    indoor, close = project.indoor(name), project.close(session)
    figures = red_labels.by_camera(tables.read(_evaluated(made, name), "metrics"))
    cameras = {
        one: red_labels.Judged(seen.camera.intrinsics.fx, figures[name, one]) for one, seen in made.views[name].items()
    }
    found = [
        finding
        for step in ("clocks", "world", *(() if indoor else ("triangulate", "refine")))
        for finding in tables.read_findings(made.made(step, name, ".findings"))
    ]
    for red in red_labels.of_walk(name, session, cameras, () if indoor else close, found):
        yield "red", f"{name} {red.camera or 'all'}", red.reason
    for one, judged in cameras.items():
        seen = lights.boxes_compared(judged.figures)
        for limit in lights.LIMITS:
            # the truth is known in a simulation alone
            if limit.metric in seen and not limit.metric.startswith("error_to_truth"):
                level, words = lights.of_figure(limit, seen[limit.metric], judged.fx)
                if level != "good":
                    yield f"light {limit.metric}", f"{name} {one}", f"{level}: {words}"


def _evaluated(made, name):
    """The figures of a walk, by the step that measures them; the truth as the simulation has it."""
    project, session = made.project, made.project.session_of(name)
    indoor = project.indoor(name)
    cameras = project.cameras(session)
    placed = [made.made("align", f"{session}/{one}") for one in cameras if cameras[one]["locate"] == "align"]
    marks = [made.made("locate", f"{session}/{one}", ".marks") for one in cameras if cameras[one]["locate"] == "marks"]
    evaluate.run(
        sequence=name, subject=project.subject_of(name),
        labels=[steps.labels_of(made, name, one) for one in cameras],
        skeleton=None, cameras=placed, roles={one: how["role"] for one, how in cameras.items()},
        detected=evaluate.Detected(
            None if indoor else made.made("triangulate", name, ".detections"), project.config["detector"]["min_score"],
            None if indoor else made.made("triangulate", name, ".swaps"),
            [made.made("clocks", name, ".aside")] if indoor else [],
        ),
        yardsticks=evaluate.Yardsticks(
            {one: made.folder / path for one, path in project.boxes(name).items()},
            [path.with_suffix(".left_out.parquet") for path in placed], marks, {},
            made.folder / "data/truth" / name,
        ),
        out=made.made("evaluate", name), out_frames=made.made("evaluate", name, ".frames"),
        out_checks=made.made("evaluate", name, ".checks"), out_quantiles=made.made("evaluate", name, ".quantiles"),
        findings=made.made("evaluate", name, ".findings"),
    )  # fmt: skip
    return made.made("evaluate", name)


def main():
    level, first, last = [*sys.argv[1:], *("both", "1", "20")[len(sys.argv) - 1 :]]
    for grade in ("ideal", "real") if level == "both" else (level,):
        captures, counts, walks, recordings = Counter(), Counter(), 0, 0
        for seed in range(int(first), int(last) + 1):
            with tempfile.TemporaryDirectory() as folder:
                try:
                    made = steps.labelled(
                        folder, preset=grade, seed=seed, subjects=1, duration_s=SECONDS, gallery=False
                    )
                    found = list(said(made))
                    walks, recordings = walks + len(made.views), recordings + sum(map(len, made.views.values()))
                except DiorError as error:
                    found = [("refused", "before", str(error))]
            counts.update(code for code, *_ in found)
            captures.update({code for code, *_ in found})
            for code, where, text in found:
                print(f"  {grade} {seed} {code} ({where}): {text}", flush=True)
        print(
            f"{grade}, seeds {first}-{last}: {counts['red']} red lights in {walks} walks, {recordings} recordings; all:"
        )
        for code, times in sorted(counts.items()):
            print(f"  {code:<32}{times:>5} in {captures[code]} captures", flush=True)


if __name__ == "__main__":
    main()
