"""CSV files for GaitGraph and GaitMixer, named as their CASIA-B loader reads them.

OUTPUTS  gaitgraph/dior_pose_{train,valid,train_valid,test}.csv: the name of a picture and 51 numbers per row;
         gaitgraph/sequences.csv: what the numbers in the names stand for
The loader takes <anything>/<subject>-<status>-<number>-<view>/<frame>.jpg and makes integers of all but the status,
which is nm, bg or cl. It cannot have a hole in a row: a picture of which a joint is not known is left out. GaitGraph2's
loader (GaitGraph/datasets/casia_b_pose.py) reads the same rows of one file, and trains on subjects 1 to 74 and tests
on those from 75.
"""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from dior.body.names import COCO_17
from dior.release.exports import conditions
from dior.release.exports.poses import AddRecording, Pose
from dior.release.exports.recordings import Recording, Release
from dior.release.exports.writing import write_csv

ABOUT = """\
`gaitgraph/dior_pose_<part>.csv`: a header, then a picture per row: its name and 17 times x, y, confidence in COCO's
order, in pixels of the recorded picture ((0, 0) is the centre of the top-left pixel; the released weights were trained
on pictures of 320x240). The confidence is 1 in the picture, 0 outside of it. Pictures of which a joint is not known
are left out, as the loader would do. Parts are those of the split by subject: `train`, `valid`, both together, `test`.
In `dior/<subject>-<status>-<number>-<view>/<frame>.jpg` subjects are counted by pseudonym, from 1 those of `train` and
`valid`, from 75 (as in CASIA-B) those of `test`; the status is `nm` for a subject's usual outfit, that of the first
walk without a bag, `bg` for another with a bag, `cl` for any other; the number counts the walks of that status; the
view is 18 times the number of (environment, camera), as if it were an angle of CASIA-B. `gaitgraph/sequences.csv` says
which recording is which, and how many pictures were left out.

`--train_data_path gaitgraph/dior_pose_train_valid.csv --valid_data_path gaitgraph/dior_pose_test.csv`

GaitGraph2 reads one file: `(cat dior_pose_train_valid.csv; tail -n +2 dior_pose_test.csv) > casia-b_pose_coco.csv`. Its
own evaluation takes CASIA-B's 11 views and no others; `opengait/configs/gaitgraph2.yaml` evaluates it on any.
"""
HEADER = ",".join(["image_name", *(f"{joint}_{what}" for joint in COCO_17 for what in ("x", "y", "conf"))])
ROW = ",".join(["%s"] + ["%.3f,%.3f,%d"] * 17) + "\n"
COLUMNS = "name subject sequence camera environment outfit walk pictures kept".split()
FILES = {"train": ("train", "train_valid"), "val": ("valid", "train_valid"), "test": ("test",), "all": ("all",)}
# degrees between the 11 views of CASIA-B, of which the loader makes integers
VIEW_STEP = 18
# the first subject that CASIA-B tests on
FIRST_TESTED = 75


@contextmanager
def writer(folder: Path, release: Release) -> Iterator[AddRecording]:
    """Yield `add(recording, pose)`; `sequences.csv` is written when the context ends."""
    folder.mkdir()
    known_as = names(release)
    rows: list[tuple[Any, ...]] = []
    files: dict[str, TextIO] = {}
    with ExitStack() as stack:

        def add(recording: Recording, pose: Pose, pictures: dict[int, str]) -> None:
            name, walk = known_as[recording.name], recording.walk
            lines = lines_of(name, pose)
            facts = (name, walk.subject, walk.sequence, recording.camera.name, walk.environment, walk.outfit, walk.walk)
            rows.append((*facts, len(pose.frame), len(lines)))
            for part in FILES[recording.part]:
                if part not in files:
                    path = folder / f"dior_pose_{part}.csv"
                    files[part] = stack.enter_context(open(path, "w", encoding="utf-8", newline="\n"))
                    files[part].write(HEADER + "\n")
                files[part].writelines(lines)

        yield add
    write_csv(folder / "sequences.csv", COLUMNS, rows)


def lines_of(name: str, pose: Pose) -> list[str]:
    """Lines of the CSV of the pictures of which every joint is known."""
    known = np.isfinite(pose.uv).all(axis=(1, 2))
    numbers = np.concatenate([pose.uv, pose.inside[..., None]], axis=-1)[known].reshape(-1, 51).tolist()
    frames = pose.frame[known].tolist()
    return [ROW % (f"dior/{name}/{frame:06d}.jpg", *row) for frame, row in zip(frames, numbers, strict=True)]


def names(release: Release) -> dict[str, str]:
    """<subject>-<status>-<number>-<view> of every recording, by its name."""
    number = _numbers({r.walk.subject: r.part for r in release.recordings})
    condition = conditions.of_walks(release.walks)
    count: dict[tuple[str, str], int] = {}
    walks = {}
    for walk in release.walks:
        key = walk.subject, condition[walk.sequence]
        count[key] = count.get(key, 0) + 1
        walks[walk.sequence] = f"{number[walk.subject]:03d}-{key[1]}-{count[key]:02d}"
    views = sorted({(r.walk.environment, r.camera.name) for r in release.recordings})
    return {
        r.name: f"{walks[r.walk.sequence]}-{VIEW_STEP * views.index((r.walk.environment, r.camera.name)):03d}"
        for r in release.recordings
    }


def _numbers(part: dict[str, str]) -> dict[str, int]:
    """Numbers of the people: those of the part `test` from 75, or after the others where there are so many."""
    tested, others = ([who for who in sorted(part) if (part[who] == "test") == test] for test in (True, False))
    first = max(FIRST_TESTED, len(others) + 1)
    return {who: i for i, who in enumerate(others, start=1)} | {who: i for i, who in enumerate(tested, start=first)}
