"""Hand checks: the seeded sample of labels that the evaluation asks a person for, clicked without seeing the labels.

INPUTS   results/evaluate/to_mark/checks/, or else the same draw from results/reproject/ (dior/evaluate/to_mark.py)
OUTPUTS  config/checks/<walk>.<camera>.csv, a row for each point that was looked at; empty where it cannot be seen
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from dior.arrays import Table
from dior.body import names
from dior.calibrate.marks import marks as hand_marks
from dior.errors import DiorError
from dior.evaluate import checks, to_mark
from dior.project.contents import Project
from dior.project.plain_text import rows_of
from dior.studio import body_figure
from dior.studio.hand_files import Change, cells_of, change_rows
from dior.studio.pages import (
    in_memory,
    number_of,
    one_of,
    page,
    pixel_of,
    recording_in,
    recording_of,
    sent,
    workspace_of,
)
from dior.studio.skeletons import NotYet
from dior.studio.workspace import Workspace, state_of

DRAWN = Path("results/evaluate/to_mark/checks")
KEYS, OTHERS = ("sequence", "frame", "joint"), ("u", "v")
# chosen: of the person's height, how high the view is, and how far its middle may be off the person's
VIEW, OFFSET = 1.6, 0.25


@dataclass(frozen=True)
class Point:
    """A label of the sample: of a joint in a picture."""

    walk: str
    camera: str
    frame: int
    joint: str


def page_of_checks(request: Request) -> Response:
    """The page."""
    return page(request, "checks.html.j2", figure=body_figure.drawn())


def points(request: Request) -> Response:
    """The sample with what is clicked so far, and the point to go on with; no label."""
    workspace = workspace_of(request)
    try:
        drawn = _sample(workspace, in_memory(request, "sample"))
    except NotYet as error:
        return JSONResponse({"lacks": str(error)})
    clicked = {point: _clicked(point, rows) for (_, rows, own) in _files(drawn) for point in own}
    return JSONResponse({
        "points": [
            {
                "walk": point.walk, "camera": point.camera, "frame": point.frame, "joint": point.joint,
                "words": body_figure.words(point.joint) or point.joint.replace("_", " "),
                "side": names.side_of(point.joint), "clicked": clicked[point],
            }
            for point in drawn
        ],
        "at": resume([clicked[point] for point in drawn]),
    })  # fmt: skip


def resume(clicked: Sequence[Sequence[float] | None]) -> int:
    """Where to go on: the first point without a row (None), or else after the last one with a pixel: a file that was
    copied has a row for each, empty ones ([]) among them."""
    for i, one in enumerate(clicked):
        if one is None:
            return i
    return 1 + max((i for i, one in enumerate(clicked) if one), default=-1)


def view(request: Request) -> Response:
    """What to show of a picture: the middle u, v and the height of a piece with the person in it, the same each time.

    It depends on the person and the joint's name, not on where the joint's label is.
    """
    walk, camera = recording_of(request)
    frame, joint = number_of(request, "frame"), request.query_params.get("joint", "")
    found = _labels(workspace_of(request), walk, camera, ["frame", "u", "v"])
    own = (found["frame"] == frame) & np.isfinite(found["u"]) & np.isfinite(found["v"])
    if not own.any():
        return JSONResponse({"u": None, "v": None, "height": None})
    low, high = (way(np.stack([found["u"][own], found["v"][own]]), axis=1) for way in (np.min, np.max))
    height = float(high[1] - low[1])
    seed = np.random.default_rng([to_mark.SEED, crc32(f"{walk}.{camera}.{frame}.{joint}".encode())])
    middle = (low + high) / 2 + OFFSET * height * seed.uniform(-1, 1, 2)
    return JSONResponse({
        "u": round(float(middle[0]), 1), "v": round(float(middle[1]), 1), "height": round(VIEW * height, 1),
    })  # fmt: skip


async def change(request: Request) -> Response:
    """Write a point: [u, v], [] where it cannot be seen, or null to take it out; with what was there before."""
    content = await sent(request)
    return await run_in_threadpool(_change, workspace_of(request), content)


def _change(workspace: Workspace, content: dict[str, Any]) -> Response:
    project = workspace.project()
    walk, camera = recording_in(project, content)
    frame = content.get("frame")
    table = workspace.frames_with(walk, camera, frame)
    joint = one_of("joint", content.get("joint"), set(_labels(workspace, walk, camera, ["joint"])["joint"]))
    size = int(table["width"][0]), int(table["height"][0])
    after = pixel_of(content.get("after"))
    if after:
        hand_marks.check_inside(f"{joint} on frame {frame} of {walk}", np.array(after), *size)

    def check(draft: Path) -> None:
        checks.points(draft, walk, range(len(table["frame"])), size=size)

    key = walk, str(frame), joint
    before = pixel_of(content.get("before"))
    # as the file has it, which others may have written with more digits
    had = None if before is None else tuple(map(str, before)) or ("", "")
    changed = Change(key, had, cells_of(after))
    change_rows(_file(walk, camera), KEYS, OTHERS, [changed], check)
    return JSONResponse({"written": True})


def _file(walk: str, camera: str) -> str:
    return f"config/checks/{walk}.{camera}.csv"


def _sample(workspace: Workspace, kept: dict[object, list[Point]]) -> list[Point]:
    """The points in their order. Raises NotYet where there are no labels yet."""
    project = workspace.project()
    written = sorted(DRAWN.glob("*.csv"))
    paths = written or _indoor(project)
    if not paths:
        raise NotYet("There are no indoor labels to check yet: `dior run` makes them.")
    state = state_of(map(str, paths))
    if state not in kept:
        kept.clear()
        found = _written(written) if written else to_mark.labels(paths)
        kept[state] = [
            Point(walk, camera, frame, joint)
            for path, rows in found.items()
            for walk, camera in [path.stem.rsplit(".", 1)]
            for frame, joint in rows
        ]
    known = {(walk, camera) for walk in project.sequences for camera in project.cameras_of(walk)}
    return [point for point in kept[state] if (point.walk, point.camera) in known]


def _indoor(project: Project) -> list[Path]:
    """Tables of labels of the indoor walks."""
    paths = [path for walk in project.sequences if project.indoor(walk) for path in project.label_tables(walk)]
    return [Path(path) for path in paths if Path(path).is_file()]


def _written(paths: Sequence[Path]) -> dict[Path, list[tuple[int, str]]]:
    """(frame, joint) by file, as the step `to_mark` wrote them."""
    found = {}
    for path in paths:
        rows = [dict(zip(checks.REQUIRED, cells, strict=False)) for _, cells in rows_of(path, path)[1:]]
        found[path] = [(int(row["frame"]), row["joint"]) for row in rows]
    return found


def _files(drawn: Sequence[Point]) -> list[tuple[str, Mapping[tuple[str, str, str], tuple[str, str]], list[Point]]]:
    """By file of config/checks its path, its rows as text, and the points of the sample that it is for."""
    by_file: dict[str, list[Point]] = {}
    for point in drawn:
        by_file.setdefault(_file(point.walk, point.camera), []).append(point)
    return [(path, _rows(path), own) for path, own in by_file.items()]


def _rows(path: str) -> dict[tuple[str, str, str], tuple[str, str]]:
    if not Path(path).is_file():
        return {}
    (_, header), *lines = rows_of(path, path) or [(1, [])]
    rows = [dict(zip(header, cells, strict=False)) for _, cells in lines]
    return {
        (row.get("sequence", ""), row.get("frame", ""), row.get("joint", "")): (row.get("u", ""), row.get("v", ""))
        for row in rows
    }


def _clicked(point: Point, rows: Mapping[tuple[str, str, str], tuple[str, str]]) -> list[float] | None:
    """[u, v], [] for an empty row, None for none."""
    cells = rows.get((point.walk, str(point.frame), point.joint))
    if cells is None:
        return None
    try:
        found = [float(one) for one in cells] if any(cells) else []
    except ValueError:
        found = [np.nan]
    if not np.isfinite(found).all():
        raise DiorError(f"{_file(point.walk, point.camera)}: '{','.join(cells):.40}' is no pixel")
    return found


def _labels(workspace: Workspace, walk: str, camera: str, columns: list[str]) -> Table:
    found = workspace.result(f"results/reproject/{walk}.{camera}.parquet", "labels_2d", columns)
    if found is None:
        raise DiorError(f"there are no labels of {camera} in {walk} yet: the workflow has to run first")
    return found


ROUTES = [
    Route("/checks", page_of_checks),
    Route("/api/checks", points),
    Route("/api/checks/view", view),
    Route("/api/checks/change", change, methods=["POST"]),
]
