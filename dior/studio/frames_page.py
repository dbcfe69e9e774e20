"""Frames: any picture of any camera, by frame, by time, or all cameras at one moment, with labels if there are any."""

from typing import Any

import numpy as np
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from dior.arrays import Table
from dior.body import names
from dior.errors import DiorError
from dior.studio.pages import in_memory, number_of, page, recording_of, workspace_of
from dior.studio.pictures import Pictures, kind_of
from dior.studio.workspace import Workspace
from dior.tables import tables

# a picture does not change; its address has a word for the state of its file
KEPT = "private, max-age=3600"
LABELS = ["joint", "frame", "u", "v", "sigma_u", "sigma_v", "rho_uv", "status"]


def frames(request: Request) -> Response:
    """The page."""
    return page(request, "frames.html.j2")


def walks(request: Request) -> Response:
    """All walks with their cameras, for the lists to choose from."""
    project = workspace_of(request).project()
    return JSONResponse([
        {
            "walk": walk,
            "session": project.session_of(walk),
            "indoor": project.indoor(walk),
            "cameras": {name: one["role"] for name, one in project.cameras(project.session_of(walk)).items()},
        }
        for walk in project.sequences
    ])  # fmt: skip


def recording(request: Request) -> Response:
    """Of one camera in one walk: the size of its pictures, and when each was taken, s after the first."""
    walk, camera = recording_of(request)
    workspace = workspace_of(request)
    table = workspace.frames(walk, camera)
    stamps = table["stamp_ns"]
    return JSONResponse({
        "width": int(table["width"][0]),
        "height": int(table["height"][0]),
        "seconds": np.round((stamps - stamps[0]) / 1e9, 4).tolist(),
        "version": workspace.version(walk),
    })  # fmt: skip


def picture(request: Request) -> Response:
    """One picture: JPEG, or PNG where that was recorded; `small=1` for one that is quick to send."""
    walk, camera = recording_of(request)
    frame, small = number_of(request, "frame"), number_of(request, "small", 0)
    content = pictures_of(request).read(walk, camera, frame, bool(small))
    return Response(content, media_type=kind_of(content), headers={"cache-control": KEPT})


def png(request: Request) -> Response:
    """The picture as a PNG to save, pixel for pixel as decoded."""
    import cv2

    walk, camera = recording_of(request)
    frame = number_of(request, "frame")
    content = np.frombuffer(pictures_of(request).read(walk, camera, frame), np.uint8)
    decoded = cv2.imdecode(content, cv2.IMREAD_COLOR)
    if decoded is None:
        raise DiorError(f"{walk}: frame {frame} of {camera} cannot be decoded, its data are damaged; save another")
    done, found = cv2.imencode(".png", decoded)
    if not done:
        raise DiorError("the picture could not be written as PNG")
    name = f"{walk}.{camera}.{frame}.png"
    return Response(
        found.tobytes(), media_type="image/png", headers={"content-disposition": f'attachment; filename="{name}"'}
    )


def moment(request: Request) -> Response:
    """By camera the frame that was taken nearest to one of a camera, and how much later, ms by the header stamps and
    the clocks that the last run found."""
    walk, camera = recording_of(request)
    frame = number_of(request, "frame")
    workspace = workspace_of(request)
    # raises where this one cannot be read; of the others those that can
    workspace.frames_with(walk, camera, frame)
    stamps = workspace.stamps(walk)
    clocks = _clocks(workspace, walk)
    times = {name: table["stamp_ns"] + round(1e9 * clocks.get(name, 0.0)) for name, table in stamps.items()}
    at = times[camera][frame]
    nearest = {name: int(np.abs(own - at).argmin()) for name, own in times.items()}
    return JSONResponse({
        name: {"frame": number, "later_ms": round(float(times[name][number] - at) / 1e6, 1)}
        for name, number in nearest.items()
    })  # fmt: skip


def drawn(request: Request) -> Response:
    """What the last run says of one picture: labels with sigmas, and detections; pixels as recorded."""
    walk, camera = recording_of(request)
    frame, workspace = number_of(request, "frame"), workspace_of(request)
    labels = workspace.result(f"results/reproject/{walk}.{camera}.parquet", "labels_2d", LABELS)
    found = workspace.result(f"results/detections/{walk}.parquet", "detections", None)
    told: dict[str, Any] = {"labels": [], "bones": [], "detections": []}
    if labels is not None:
        own = tables.rows(labels, (labels["frame"] == frame) & np.isfinite(labels["u"]))
        told["labels"] = _points(own, ["u", "v", "sigma_u", "sigma_v", "rho_uv"])
        told["bones"] = [
            [own["joint"][a], own["joint"][b]] for a, b in names.bones_of(own["joint"].tolist())
        ]  # fmt: skip
    if found is not None:
        mine = (found["camera"] == camera) & (found["frame"] == frame) & np.isfinite(found["u"])
        told["detections"] = _points(tables.rows(found, mine), ["u", "v", "score"])
    return JSONResponse(told)


def _points(table: Table, columns: list[str]) -> list[dict[str, Any]]:
    sides = [names.mirrored(joint) == joint for joint in table["joint"]]
    return [
        {"joint": joint, "side": "middle" if middle else "left" if joint[0] in "lL" else "right"}
        | {name: None if np.isnan(table[name][i]) else round(float(table[name][i]), 3) for name in columns}
        for i, (joint, middle) in enumerate(zip(table["joint"].tolist(), sides, strict=True))
    ]


def _clocks(workspace: Workspace, walk: str) -> dict[str, float]:
    """offset_s by camera as the last run found them, of those that are there."""
    found: dict[str, float] = {}
    project = workspace.project()
    for path in project.clock_tables(walk, project.cameras_of(walk)):
        table = workspace.result(path, "offsets", ["camera", "offset_s"])
        if table is not None:
            found |= dict(zip(table["camera"].tolist(), table["offset_s"].tolist(), strict=True))
    return found


def pictures_of(request: Request) -> Pictures:
    """The pictures that all pages share."""
    found: Pictures = in_memory(request, "pictures", lambda: Pictures(workspace_of(request)))
    return found


ROUTES = [
    Route("/frames", frames),
    Route("/api/walks", walks),
    Route("/api/recording", recording),
    Route("/api/moment", moment),
    Route("/api/drawn", drawn),
    Route("/picture", picture),
    Route("/picture.png", png),
]
