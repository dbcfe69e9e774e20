"""The demo's recordings as a lab's own: what a person still types after `dior init --from`, and whether the labels are
the demo's.

usage: python -m benchmarks.own_data [bags | cameras | one | ros2 | flat | videos ...]     (all but none: bags)

A small capture is simulated and labelled; its recordings are put into a folder without truth and config, laid out as
labs do. `dior init --from` makes a project of them, what is TODO is filled in with what its people know (a tape, who
walked, what they agreed to), marks and boxes are the demo's, and it is labelled.

bags      a bag per computer, as the demo has them
cameras   a bag per camera
one       one bag of all cameras per walk
ros2      folders of ROS 2, one per computer
flat      one folder, dates in the names of the files
videos    mp4 with stamps beside them, and lenses in a TOML file
"""

import re
import shutil
import sys
import tempfile
from pathlib import Path

import numpy as np

from benchmarks.videos import SMALL, apart, run, simulated
from dior.init import init
from dior.project import pseudonyms, todos
from dior.project.schema_check import read_sheet, read_yaml
from tests.init import layouts

LAYOUTS = ("bags", "cameras", "one", "ros2", "flat", "videos")
# the demo's sessions by what ours are called
SESSIONS = {"indoor": "lab", "outdoor": "field"}
# of two walks and eight cameras, marks and boxes aside
MOST_VALUES = 45


def filled(project, demo):
    """Fill in what is TODO in a project as the demo's people know it; returns (file, key, how many values) of each."""
    typed = []
    walks, _ = read_sheet(demo / "config/sequences.tsv", "sequences", "sequence")
    people, _ = read_sheet(demo / "config/subjects.tsv", "subjects", "subject")
    for todo in todos.found(project):
        path = project / todo.path
        lines = path.read_text().split("\n")
        line = lines[todo.line - 1]
        if path.suffix == ".tsv":
            header = next(one for one in lines if one and not one.startswith("#")).split("\t")
            row = dict(zip(header, line.split("\t"), strict=True))
            known = walks[row["sequence"]] if "sequence" in row else people.get(row["subject"], [*people.values()][0])
            cells = [known[todo.key] if column == todo.key else cell for column, cell in row.items()]
            lines[todo.line - 1] = "\t".join(cells)
            typed.append((todo.path, todo.key, 1))
        else:
            values = _of_yaml(todo, demo)
            for value in values:
                lines[todo.line - 1] = lines[todo.line - 1].replace(todos.WORD, str(value), 1)
            typed.append((todo.path, todo.key, sum(len(value) if isinstance(value, list) else 1 for value in values)))
        path.write_text("\n".join(lines))
    pseudonyms.run(project)
    for session, theirs in SESSIONS.items():
        for path in (demo / f"config/sessions/{theirs}").glob("*.marks.csv"):
            shutil.copy(path, project / f"config/sessions/{session}")
    shutil.copytree(demo / "config/boxes", project / "config/boxes")
    return typed


def _of_yaml(todo, demo):
    """What a person writes for a TODO of a YAML file."""
    if todo.key.startswith("lenses."):
        return ["plumb_bob"]
    _, _, session, camera = todo.path.split("/")
    told = read_yaml(demo / f"config/sessions/{SESSIONS[session]}/{camera}")
    for key in todo.key.split("."):
        told = told[key]
    return [told]


def own(demo, folder, layout):
    """A project below `folder` of the demo's recordings in a layout, filled in; returns it and what was typed."""
    recordings, project = folder / "recordings", folder / "project"
    layouts.WAYS[layout](demo / "results/simulate", recordings)
    init.run(project, as_from=recordings)
    return project, filled(project, demo)


def table(typed):
    """What a person types, by file and key, as lines; and how many values that are."""
    lines = [f"  {'file':<44}{'key':<28}{'values':>6}"]
    lines += [f"  {path:<44}{re.sub(r'realsense_', '', key):<28}{count:>6}" for path, key, count in typed]
    total = sum(count for _, _, count in typed)
    return [*lines, f"  {'all':<72}{total:>6} [at most {MOST_VALUES}]"], total


def main():
    words = sys.argv[1:] or ["bags"]
    if unknown := [word for word in words if word not in LAYOUTS]:
        sys.exit(f"there is no layout {unknown[0]}; they are {', '.join(LAYOUTS)}")
    with tempfile.TemporaryDirectory() as name:
        demo = Path(name) / "demo"
        simulated(demo, SMALL)
        run(demo)
        for word in words:
            project, typed = own(demo, Path(name) / word, word)
            print(f"recordings as '{word}': what a person types for two walks and eight cameras, marks and boxes aside")
            print("\n".join(table(typed)[0]))
            run(project)
            print("  labels beside the demo's")
            for sequence, camera, off, lost in apart(demo, project):
                print(
                    f"    {sequence}.{camera}{np.isfinite(off).sum():>8} labels{np.nanmax(off):>9.4f} px at most; "
                    f"{lost} only in the demo"
                )


if __name__ == "__main__":
    main()
