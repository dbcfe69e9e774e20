"""Whether the heads in a release's pictures are covered, as far as its own tables can tell.

INPUTS   the files of a release (folder_or_tarball.py) whose checksum is right, and its tables about everything
OUTPUTS  problems as (path, sentence)
The head is put into the pictures again from the 3D, the camera, the clock and the labels' uncertainty, and must lie
under the cover that `covers` tells; uncertainty, figures and lights must be what `dior.release.heads` asks for, unless
the camera's `heads_checked` says who looked. Whether the covers are in the pictures is for cover_checks.py; what else
moves in them is not looked at again: that needs them as they were.
"""

import csv
import io
import json
from typing import TypeAlias

import numpy as np

from dior.arrays import Floats, Table
from dior.geometry import camera_tables
from dior.release import heads
from dior.release.heads import EDGES
from dior.release.suspect import without_place
from dior.release.verify import walk_checks
from dior.release.verify.evidence import lights_of
from dior.release.verify.folder_or_tarball import File
from dior.release.verify.walk_checks import PARTS, Broken, Problem
from dior.report import red_labels
from dior.tables import tables

Key: TypeAlias = tuple[str, ...]


def problems(files: dict[str, File], about: dict[str, Table]) -> list[Problem]:
    """`files`: by path; `about`: the tables at the top of the release by name. Nothing is said where one is missing."""
    if not {"cameras", "clocks", "sequences"} <= set(about) or faces(files) in ("", "shown"):
        return []
    figures = _figures(files)
    found: list[Problem] = []
    for path in sorted(name for name in files if name.startswith("frames/") and name.count("/") == 2):
        try:
            found += [(path, text) for text in _of_recording(path, files, about, figures)]
        except Broken as error:
            found.append((path, str(error)))
    return found


def faces(files: dict[str, File]) -> str:
    """What the release says that was done to faces, "" where it does not say."""
    if "provenance.json" not in files:
        return ""
    try:
        return str(json.loads(files["provenance.json"].read())["config"]["release.faces"])
    except (ValueError, KeyError, TypeError):
        return ""


def _figures(files: dict[str, File]) -> Table:
    """metrics.csv as a table; no rows where it is missing or another table."""
    names = ("sequence", "camera", "metric", "joint", "tool", "value")
    text = files["metrics.csv"].read().decode("utf-8", "replace") if "metrics.csv" in files else ""
    rows = [row for row in csv.DictReader(io.StringIO(text)) if all(row.get(name) is not None for name in names)]
    table = {name: np.array([row[name] for row in rows], object) for name in names}
    return table | {"value": np.array([float(value or "nan") for value in table["value"]])}


def _of_recording(path: str, files: dict[str, File], about: dict[str, Table], figures: Table) -> list[str]:
    """What is wrong with the covers in the pictures of one recording, whose `frames` are at `path`."""
    _, who, name = path.split("/")
    sequence, camera = name.split(".")[:2]
    needed = [f"covers/{who}/{name}", f"labels_2d/{who}/{name}", f"skeletons_3d/{who}/{sequence}.parquet"]
    frames = walk_checks.read(files[path], PARTS["frames"], ("frame", "stamp_ns", "no_image"))[0]
    shown = frames["no_image"] == ""
    if not shown.any():
        return []
    if needed[0] not in files:
        return ["has pictures, but there is no table of what is covered in them"]
    if not set(needed) <= set(files):
        return []
    covers, labels, body = (
        walk_checks.read(files[one], PARTS[part], columns)[0]
        for one, part, columns in zip(
            needed, ("covers", "labels_2d", "skeletons_3d"), (None, heads.LABELLED, None), strict=True
        )
    )
    session = _row(about["sequences"], sequence=sequence)["session"][0]
    rig = _row(about["cameras"], session=session, camera=camera)
    red_lights = lights_of(about)
    if not rig["heads_checked"][0]:
        for light in red_lights:
            if light.sequence == sequence and light.camera in ("", camera):
                return [f"has pictures although a light is red: {light.reason}"]
    elif {"", camera} & without_place(red_lights, sequence):
        # where the head is, nobody can say without a place
        return []
    clock = _row(about["clocks"], sequence=sequence, camera=camera)
    placed = next(iter(camera_tables.of_released(rig).values()))
    if placed.wTc is None or not len(body["joint"]):
        return []
    known = heads.of_tables(frames, placed, body, labels, clock["offset_s"][0], clock["drift_ppm"][0])
    if known is None:
        return []
    least, status = known.boxes(heads.KEPT_SIGMAS)
    bare = shown & (status == "ok") & ~heads.hold(_heads_covered(covers, frames), least)
    sentences = walk_checks.first(bare, "pictures in which the head is not under its cover", frames)
    sentences += walk_checks.first(
        shown & (status == "unknown"), "pictures in which nobody knows where the head is", frames
    )
    if rig["heads_checked"][0]:
        return sentences
    sentences += walk_checks.first(
        shown & heads.doubtful(known), "pictures whose labels have no sigma, or one of more than half a head", frames
    )
    own = red_labels.by_camera(figures).get((sequence, camera))
    red = heads.reasons(own, placed.intrinsics.fx, [], placed.role) if own else ""
    return sentences + ([f"has pictures although its figures are red: {red}"] if red else [])


def _row(table: Table, **where: str) -> Table:
    """The one row of a table in which the columns have these values. Raises Broken where there is none."""
    mine = np.all([table[key] == value for key, value in where.items()], axis=0)
    if mine.sum() != 1:
        raise Broken(f"is about {' '.join(map(str, where.values()))}, of which there is not one row in another table")
    return tables.rows(table, mine)


def _heads_covered(covers: Table, frames: Table) -> Floats:
    """Edges (F, 4) of the head's cover by picture, NaN where there is none."""
    head = tables.rows(covers, covers["what"] == "head")
    edges = np.full((len(frames["frame"]), 4), np.nan)
    rows = np.searchsorted(frames["frame"], head["frame"]).clip(max=len(edges) - 1)
    right = frames["frame"][rows] == head["frame"]
    edges[rows[right]] = np.stack([head[key] for key in EDGES], axis=1)[right]
    return edges
