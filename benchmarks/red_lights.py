"""Does a red light take labels of a clean capture out of a release? Captures with an indoor and an outdoor walk.

usage: python -m benchmarks.red_lights [LEVEL|both] [FIRST] [LAST]      (seeds 1 to 20)

Each capture is simulated and labelled anew (benchmarks/steps.py), walks of 8 s, measured by `evaluate` with its boxes
and marks, and asked for what is wrong with its labels (`report.red_labels`) by these figures and by the findings of
`triangulate`, `clocks` and `world`. Each line above a sum is a false alarm. Of recordings as such (`audit`) and of
cameras that were bumped (`moved`) nothing is asked: the captures have one walk a session, and no bags.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import sys
import tempfile

from benchmarks import steps, worlds
from dior.errors import DiorError
from dior.evaluate import evaluate
from dior.report import red_labels
from dior.tables import tables

SECONDS = 8.0


def reds(made, name):
    """What is wrong with the labels of a walk of a labelled capture."""
    project, session = made.project, made.project.session_of(name)
    indoor, close = project.indoor(name), project.close(session)
    table = tables.read(_evaluated(made, name), "metrics")
    figures = red_labels.by_camera(table)
    cameras = {
        one: red_labels.Judged(seen.camera.intrinsics.fx, figures[name, one]) for one, seen in made.views[name].items()
    }
    worlds.said(made, name)
    found = [
        finding
        for step in ("clocks", "world", *(() if indoor else ("triangulate", "refine")))
        for finding in tables.read_findings(made.made(step, name, ".findings"))
    ]
    return red_labels.of_walk(name, session, cameras, () if indoor else close, found)


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
        ),
        yardsticks=evaluate.Yardsticks(
            {one: made.folder / path for one, path in project.boxes(name).items()},
            [path.with_suffix(".left_out.parquet") for path in placed], marks, {},
            made.folder / "data/truth" / name,
        ),
        out=made.made("evaluate", name), out_frames=made.made("evaluate", name, ".frames"),
        out_checks=made.made("evaluate", name, ".checks"),
    )  # fmt: skip
    return made.made("evaluate", name)


def main():
    level, first, last = [*sys.argv[1:], *("both", "1", "20")[len(sys.argv) - 1 :]]
    for grade in ("ideal", "real") if level == "both" else (level,):
        walks = recordings = wrong = 0
        for seed in range(int(first), int(last) + 1):
            with tempfile.TemporaryDirectory() as folder:
                try:
                    made = steps.labelled(
                        folder, preset=grade, seed=seed, subjects=1, sequences=1, duration_s=SECONDS, gallery=False
                    )
                except DiorError as error:
                    print(f"{grade} {seed} is refused before: {error}", file=sys.stderr)
                    continue
                for name in made.project.sequences:
                    found = reds(made, name)
                    walks, recordings = walks + 1, recordings + len(made.views[name])
                    wrong += len(found)
                    for red in found:
                        print(f"  {grade} {seed} {name} {red.camera or 'all'}: {red.reason}", flush=True)
        print(
            f"{grade}, seeds {first}-{last}: {wrong} red lights in {walks} walks, {recordings} recordings", flush=True
        )


if __name__ == "__main__":
    main()
