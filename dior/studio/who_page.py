"""Who: where several people are in the pictures, a person points at the subject once in each close camera.

INPUTS   the recordings; detections of the last run, or as the files have them; what the last run says of who is who
OUTPUTS  config/people/<walk>.yaml, which the step `triangulate` reads (`dior/reconstruct/everybody.py`): the same
         function reads here what it will be
"""

import os
from pathlib import Path
from typing import Any

import numpy as np
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from dior.arrays import Ints
from dior.body.which_person import Seed, Seen
from dior.errors import DiorError
from dior.project.schema_check import check, read_yaml
from dior.reconstruct import everybody
from dior.reconstruct.timeline import nearest_frames
from dior.studio.hand_files import change_value
from dior.studio.pages import number_of, one_of, page, recording_of, sent, walk_of, workspace_of
from dior.studio.workspace import Workspace

# what the last run says of a walk with several people: the state of the page, by the finding's code
CODES = {"who_is_subject": "open", "somebody_else": "look", "others_told_apart": "told"}


def page_of_who(request: Request) -> Response:
    """The page."""
    return page(request, "who.html.j2")


def told(request: Request) -> Response:
    """Of one walk: its `state` (mocap, named, alone, told, look, open, unknown), the `words` of the last run, `seeds`
    of the file, and of each the `track` that it is taken for; `start`: a camera and a frame with as many people as can
    be; `most`: people at once in one picture."""
    walk, workspace = walk_of(request), workspace_of(request)
    project = workspace.project()
    close = project.close(project.session_of(walk))
    answer = {"walk": walk, "close": close, "file": path_of(walk), "words": "", "problem": "", "seeds": seeds(walk)}
    if project.indoor(walk):
        return JSONResponse(answer | {"state": "mocap", "tracks": [], "start": None, "most": 0})
    state, answer["words"] = said(workspace, walk)
    seen, frames = everybody_in(workspace, walk)
    tracks: list[int] = []
    if answer["seeds"]:
        try:
            pointed = everybody.seeds_of(path_of(walk), seen, close, frames)
            tracks = [int(seen.track[one.view, one.person, one.t]) for one in pointed]
        except DiorError as error:
            answer["problem"] = str(error)
    there = (seen.track >= 0).sum(axis=1)
    at = _busiest(there)
    if answer["seeds"]:
        state = "named"
    elif not len(workspace.detected(walk)[1]["frame"]):
        state = "alone"
    start = {"camera": close[0], "frame": at}
    return JSONResponse(answer | {"state": state, "tracks": tracks, "start": start, "most": int(there.max())})


def people(request: Request) -> Response:
    """Everybody who was detected in a picture, from left to right: `track`, `box` px around the joints, and the joint
    `u`, `v` that is nearest to its middle."""
    walk, camera = recording_of(request)
    workspace, frame = workspace_of(request), number_of(request, "frame")
    seen, frames = everybody_in(workspace, walk)
    close = workspace.project().close(workspace.project().session_of(walk))
    view = close.index(one_of("close camera", camera, close))
    here = np.flatnonzero(frames[view] == frame)
    found = [_person(seen, view, int(here[0]), slot) for slot in range(seen.uv.shape[1])] if len(here) else []
    return JSONResponse(sorted((one for one in found if one), key=lambda one: (one["box"][0], one["track"])))


async def point(request: Request) -> Response:
    """Write other seeds of a walk: `before` as the page has read them and `after`, lists of camera, frame, u, v."""
    content = await sent(request)
    await run_in_threadpool(write, workspace_of(request), content)
    return JSONResponse({})


def path_of(walk: str) -> str:
    """The file in which a person pointed at the subject of a walk."""
    return f"config/people/{walk}.yaml"


def seeds(walk: str) -> list[dict[str, Any]]:
    """The seeds of a walk's file, none where it is not there. Raises DiorError as their reader."""
    path = path_of(walk)
    found: list[dict[str, Any]] = check(read_yaml(path), "people", path)["seeds"] if os.path.exists(path) else []
    return found


def said(workspace: Workspace, walk: str) -> tuple[str, str]:
    """The state of a walk by the findings of the last run, and their text; unknown where nothing was run."""
    found = workspace.result(f"results/triangulate/{walk}.findings.parquet", "findings")
    if found is None:
        return "unknown", ""
    texts = dict(zip(found["code"].tolist(), found["text"].tolist(), strict=True))
    here = [code for code in CODES if code in texts]
    return (CODES[here[0]], " ".join(texts[code] for code in here)) if here else ("unknown", "")


def everybody_in(workspace: Workspace, walk: str) -> tuple[Seen, Ints]:
    """`Seen` by the close cameras in each of their pictures, which are the instants, and the frames (V, T), -1 after
    the last one."""
    detected, others = workspace.detected(walk)
    project = workspace.project()
    close = project.close(project.session_of(walk))
    lacking = sorted(set(close) - set(detected["camera"]))
    if lacking:
        raise DiorError(f"the last run has no detections of {lacking[0]} in {walk}; run the workflow again")
    counts = [int(detected["frame"][detected["camera"] == camera].max()) + 1 for camera in close]
    each = np.arange(max(counts))
    frame = np.concatenate([np.where(each < count, each, -1) for count in counts])
    line = {
        "camera": np.repeat(np.array(close, object), len(each)),
        "frame_before": frame,
        "frame_after": frame,
        "weight": np.zeros(len(frame)),
    }
    seen = everybody.at_instants(detected, others, line, close, project.config["detector"]["min_score"], 1.0)
    return seen, nearest_frames(line, close)


def write(workspace: Workspace, content: dict[str, Any]) -> None:
    """Put other seeds into the file of a walk. Raises DiorError, also where nobody is at one of them, and Conflict."""
    project = workspace.project()
    walk = one_of("walk", content.get("walk"), project.sequences)
    if project.indoor(walk):
        raise DiorError(f"'{walk}' is indoor, where the motion capture says where the subject is")
    before, after = (content.get(word) or None for word in ("before", "after"))
    close = project.close(project.session_of(walk))
    seen, frames = everybody_in(workspace, walk)

    def read(draft: Path) -> list[Seed]:
        return everybody.seeds_of(draft, seen, close, frames)

    change_value(path_of(walk), "seeds", before, after, read)


def _person(seen: Seen, view: int, t: int, slot: int) -> dict[str, Any] | None:
    """Somebody in a picture; None where nobody is in that slot."""
    uv, there = seen.uv[view, slot, t], seen.score[view, slot, t] > 0
    if not there.any():
        return None
    low, high = uv[there].min(axis=0), uv[there].max(axis=0)
    off = np.linalg.norm(uv - (low + high) / 2, axis=-1)
    nearest = uv[int(np.where(there, off, np.inf).argmin())]
    return {
        "track": int(seen.track[view, slot, t]),
        "box": np.round([*low, *high], 1).tolist(),
        "u": round(float(nearest[0]), 1),
        "v": round(float(nearest[1]), 1),
    }


def _busiest(there: Ints) -> int:
    """The instant with the most people, by their number (V, T), in the middle of all such instants."""
    total = there.sum(axis=0)
    most = np.flatnonzero(total == total.max())
    return int(most[len(most) // 2])


ROUTES = [
    Route("/who", page_of_who),
    Route("/api/who", told),
    Route("/api/who", point, methods=["POST"]),
    Route("/api/who/people", people),
]
