"""Boxes: a sample of frames of a long-range camera, enlarged around what moves, in which a person draws the walker.

INPUTS   the recording; config/boxes/<walk>.<camera>.csv as far as it is drawn; labels of the last run, where there are
         any: only which frames have some, since boxes are what labels are judged by
OUTPUTS  that file. A row without edges that names a drawer: nobody was seen by them. Where no row says anything about a
         frame, or one without edges and without a drawer, it is not drawn yet.
"""

import math
import os
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from dior.arrays import Floats
from dior.errors import DiorError
from dior.evaluate import to_mark
from dior.ingest import moving
from dior.project import boxes
from dior.project.plain_text import rows_of
from dior.release.look import reader
from dior.studio.hand_files import Change, change_rows
from dior.studio.pages import number_of, page, recording_in, recording_of, sent, workspace_of
from dior.studio.workspace import Workspace

# chosen: of 15 boxes or more one in five is kept back, so that 20 are left to place a camera by
COUNT, MOST = 25, 1000
EDGES = boxes.COLUMNS[1:]
NO_EDGES = ("",) * len(EDGES)
# chosen: fewer pixels are noise, as in dior/calibrate/outline/silhouettes.py; pieces this far apart are one body
LEAST_PX, JOIN_PX = 12, 5
# chosen: what is larger than that share of the picture is light, or what the camera's own movement shows
LARGEST = 0.25
GROUPS = 12  # chosen: the largest so many are told
LONGEST_NAME = 40
# what a drawer says of a frame: nothing yet, nobody is there (no edge), or the four edges px
Drawn: TypeAlias = list[float] | None


def page_of_boxes(request: Request) -> Response:
    """The page."""
    return page(request, "boxes.html.j2")


def told(request: Request) -> Response:
    """What a drawer has to draw in the pictures of a camera, and has drawn: `frames` with `box`, as `Drawn`; `drawers`
    of the file with how many boxes each has, the one whose boxes the steps use first."""
    walk, camera = recording_of(request)
    drawer, count = _name(request.query_params.get("drawer", "")), number_of(request, "count", COUNT)
    workspace = workspace_of(request)
    drawn, without = read(workspace, walk, camera)
    labels = workspace.result(f"results/reproject/{walk}.{camera}.parquet", "labels_2d", ["frame", "status"])
    every = workspace.frames(walk, camera)["frame"] if labels is None else to_mark.labelled(labels)
    had = {frame for frames, _ in drawn.values() for frame in frames.tolist()}
    had.update(frame for frames in without.values() for frame in frames)
    own: dict[int, Drawn] = {frame: [] for frame in without.get(drawer, [])} if drawer else {}
    numbers, edges = drawn.get(drawer, boxes.NONE)
    own |= dict(zip(numbers.tolist(), edges.tolist(), strict=True))
    sample = to_mark.spread(every, f"{walk}.{camera}", min(max(count, 1), MOST), had)
    return JSONResponse({
        "file": path_of(walk, camera),
        "labelled": labels is not None,
        "drawers": [{"name": name, "boxes": len(frames)} for name, (frames, _) in drawn.items()],
        "named": sorted({*drawn, *without} - {""}),
        "frames": [{"frame": frame, "box": own.get(frame)} for frame in sample],
    })  # fmt: skip


async def draw(request: Request) -> Response:
    """Write what a drawer says of one frame: `before` as the page has read it, and `after`, both as `Drawn`."""
    content = await sent(request)
    await run_in_threadpool(write, workspace_of(request), content)
    return JSONResponse({})


def moves(request: Request) -> Response:
    """Boxes px around what stands out in a picture from the scene as it is most of the time, the largest first."""
    walk, camera = recording_of(request)
    frame, workspace = number_of(request, "frame"), workspace_of(request)
    return JSONResponse(moving_in(workspace, walk, camera, frame).tolist())


def path_of(walk: str, camera: str) -> str:
    """The file of the boxes of one camera in one walk."""
    return f"config/boxes/{walk}.{camera}.csv"


def read(workspace: Workspace, walk: str, camera: str) -> tuple[dict[str, boxes.Boxes], dict[str, list[int]]]:
    """By drawer, the boxes of a file and the frames of its rows without edges; nothing where there is no file."""
    path = workspace.project().boxes(walk).get(camera)
    if path is None:
        return {}, {}
    frames = workspace.frames(walk, camera)
    return boxes.read_drawers(path, frames["frame"], _size(frames)), boxes.without_edges(path)


def write(workspace: Workspace, content: dict[str, Any]) -> None:
    """Change the row of a frame and a drawer as the page has sent it. Raises DiorError and Conflict."""
    project = workspace.project()
    walk, camera = recording_in(project, content)
    frame, drawer = content.get("frame"), _name(content.get("drawer"))
    frames = workspace.frames_with(walk, camera, frame)
    before, after = (_cells(content.get(word)) for word in ("before", "after"))
    if after == NO_EDGES and not drawer:
        raise DiorError(
            "give your name or a letter first: a row without edges and without a name is one that is not drawn yet"
        )
    _, without = read(workspace, walk, camera)
    left_open = frame in without.get("", [])
    if not drawer and before is None and left_open:
        before = NO_EDGES
    named = bool(drawer) or boxes.DRAWER in _header(path_of(walk, camera))
    changes = [Change((str(frame), drawer) if named else (str(frame),), before, after)]
    if drawer and left_open and after is not None:
        # the row that asked for it
        changes.append(Change((str(frame), ""), NO_EDGES, None))
    change_rows(
        path_of(walk, camera),
        [boxes.COLUMNS[0], boxes.DRAWER] if named else boxes.COLUMNS[:1],
        EDGES,
        changes,
        lambda draft: boxes.read_drawers(draft, frames["frame"], _size(frames)),
        [*boxes.COLUMNS, boxes.DRAWER] if named else boxes.COLUMNS,
    )


def moving_in(workspace: Workspace, walk: str, camera: str, frame: int) -> Floats:
    """`moves` of one picture: (N, 4) px."""
    table = workspace.frames_with(walk, camera, frame)
    factor, scene = workspace.scene(walk, camera)
    read_pictures = reader(table, Path(workspace.project().data_root))
    picture = next((one for _, one in read_pictures(np.array([frame]), factor)), None)
    if picture is None or scene is None:
        return np.zeros((0, 4))
    found = moving.groups(moving.standing_out(picture, scene), JOIN_PX / factor, math.ceil(LEAST_PX / factor**2))
    wide, high = (found[:, 2:] - found[:, :2]).T
    found = found[(wide < LARGEST * picture.shape[1]) & (high < LARGEST * picture.shape[0])]
    order = np.argsort(-np.prod(found[:, 2:] - found[:, :2], axis=1), kind="stable")
    # the edges of pixels, whose middles are whole numbers
    return found[order[:GROUPS]] * float(factor) - 0.5


def _header(path: str) -> list[str]:
    """The columns of a file, none where it is not there."""
    lines = rows_of(path, path) if os.path.isfile(path) else []
    return lines[0][1] if lines else []


def _size(frames: dict[str, Any]) -> boxes.Size:
    return int(frames["width"][0]), int(frames["height"][0])


def _name(word: object) -> str:
    """The drawer's name, "" for none. Raises DiorError."""
    name = word.strip() if isinstance(word, str) else ""
    if len(name) > LONGEST_NAME or not name.isprintable():
        raise DiorError(f"the drawer's name has at most {LONGEST_NAME} letters, in one line; a letter is enough")
    return name


def _cells(drawn: object) -> tuple[str, ...] | None:
    """The cells of a row that says `Drawn`. Raises DiorError."""
    if drawn is None:
        return None
    numbers = isinstance(drawn, list) and all(isinstance(one, (int, float)) and math.isfinite(one) for one in drawn)
    if not isinstance(drawn, list) or not numbers or len(drawn) not in (0, len(EDGES)):
        raise DiorError("what the page sent is no box: four numbers, none for nobody")
    return tuple(str(float(one)) for one in drawn) or NO_EDGES


ROUTES = [
    Route("/boxes", page_of_boxes),
    Route("/api/boxes", told),
    Route("/api/boxes", draw, methods=["POST"]),
    Route("/api/boxes/moving", moves),
]
