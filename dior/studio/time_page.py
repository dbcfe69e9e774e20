"""Time: a camera's clock, by the skeleton in its pictures and by what other lags cost; the estimate, or one by hand.

INPUTS   the clocks, what each lag costs and the findings of the last run; the 3D and the camera's pose; config/offsets.
         Indoors before any run: what `dior locate` makes of the marks
OUTPUTS  config/offsets/<walk>.yaml; lines px at a clock that the page names
"""

import math
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from dior.arrays import Floats, Ints, Table
from dior.calibrate import locate
from dior.clocks import by_hand, lag
from dior.clocks import clock as on_axis
from dior.clocks.axis import seconds
from dior.clocks.clock import Clock
from dior.errors import DiorError
from dior.geometry import camera as cam
from dior.geometry import camera_tables
from dior.geometry.camera import Camera
from dior.project import schema_check
from dior.project.yaml_file import read_yaml
from dior.report import clocks as told_clocks
from dior.studio import skeletons
from dior.studio.hand_files import change_value
from dior.studio.pages import in_memory, number_of, page, recording_of, sent, within, workspace_of
from dior.studio.skeletons import Body
from dior.studio.workspace import Workspace, state_of
from dior.tables import tables

PICTURES = 6  # chosen: as many as there is room for below the picture
DRAWN = ("offset_s", "drift_ppm")


@dataclass(frozen=True, eq=False)
class Found:
    """What is known of a camera in a walk: its pose; the `clock` of the last run or by marks, None where there is none;
    `told`: what the report says of it (`report.clocks.SequenceClocks`); `findings`: severity and text."""

    camera: Camera
    clock: Clock | None
    told: told_clocks.SequenceClocks | None
    findings: tuple[tuple[str, str], ...]


@dataclass(frozen=True, eq=False)
class View:
    """A walk in a camera's pictures (`rows` of table frames): its 3D, the pictures with the fastest feet (F,), and the
    crops (F, 4) px that show them."""

    found: Found
    body: Body
    rows: Table
    chosen: Ints
    crops: Floats


def time(request: Request) -> Response:
    """The page."""
    return page(request, "time.html.j2")


def told(request: Request) -> Response:
    """Of one camera in one walk: its clock, what other lags cost, what was found, and the pictures to look at."""
    walk, camera = recording_of(request)
    workspace = workspace_of(request)
    project = workspace.project()
    try:
        view = _views(request)[walk, camera] = view_of(workspace, walk, camera)
    except skeletons.NotYet as error:
        return JSONResponse({"lacks": str(error)})
    found, rows = view.found, view.rows
    given = by_hand_of(walk, camera)
    used = skeletons.clock_by_hand(project, walk, camera) or found.clock or Clock(0.0)
    words = found.told.rows[0] if found.told else None
    late = found.told.clocks[camera] if found.told else None
    curve = found.told.costs.get(camera) if found.told else None
    best = estimate(found.clock, curve)
    version = workspace.version(walk)
    return JSONResponse({
        "file": skeletons.offsets_file(walk),
        "axis": "the motion capture" if project.indoor(walk) else "the first close camera",
        "outdoors": not project.indoor(walk),
        "reference": found.clock is not None and found.clock.source == "reference",
        "given": given,
        "used": {"offset_s": round(used.offset_s, 6), "drift_ppm": round(used.drift_ppm, 2)},
        "estimate": best and {key: round(value, 6) for key, value in best.items()},
        "middle_s": round(found.clock.middle_s if found.clock else 0.0, 3),
        "interval": [round(one, 2) for one in late[1:3]] if late and np.isfinite(late[1:3]).all() else None,
        "words": words,
        "curve": curve and {"lag_ms": _plain(curve[0], 2), "cost_px": _plain(curve[1], 4)},
        "findings": [{"severity": severity, "text": text} for severity, text in found.findings],
        "source": view.body.source,
        "width": int(rows["width"][0]),
        "height": int(rows["height"][0]),
        "pictures": [
            {
                "walk": walk, "camera": camera, "frame": int(rows["frame"][at]), "version": version,
                "crop": np.round(crop, 1).tolist(),
            }
            for at, crop in zip(view.chosen, view.crops, strict=True)
        ],
    })  # fmt: skip


def drawn(request: Request) -> Response:
    """The skeleton by a clock, `offset_s` and `drift_ppm`, in the pictures to look at and in the one of `frame`."""
    words = request.query_params
    # the walk may be one of the project no longer
    key = recording_of(request)
    view = _views(request).get(key)
    if view is None:
        view = _views(request)[key] = view_of(workspace_of(request), *key)
    frame = number_of(request, "frame", 0)
    workspace_of(request).frames_with(*key, frame)
    offset_s, drift_ppm = (within(name, words.get(name, 0), schema_check.largest("offsets", name)) for name in DRAWN)
    shown = lines_at(view, np.append(view.chosen, frame), offset_s, drift_ppm)
    return JSONResponse({"pictures": shown[:-1], "frame": shown[-1]})


async def save(request: Request) -> Response:
    """Give a clock by hand, or take it away: {walk, camera, before, after}, as config/offsets has it or null."""
    words, workspace = await sent(request), workspace_of(request)

    def written() -> dict[str, Any]:
        project = workspace.project()
        walk, camera = str(words.get("walk")), str(words.get("camera"))
        if walk not in project.sequences or camera not in project.cameras_of(walk):
            raise DiorError(f"the project has no camera '{camera:.40}' in a walk '{walk:.40}'")
        path = skeletons.offsets_file(walk)

        def check(draft: Path) -> None:
            clock = by_hand.by_hand(draft, project.cameras_of(walk)).get(camera)
            if clock is not None:
                _check_reaches(workspace, draft, walk, camera, clock)

        change_value(path, camera, words.get("before"), words.get("after"), check)
        return {"file": path, "given": by_hand_of(walk, camera)}

    return JSONResponse(await run_in_threadpool(written))


def _check_reaches(workspace: Workspace, path: Path, walk: str, camera: str, clock: Clock) -> None:
    """Refuse a clock by which no picture of the camera is of the time of the walk's 3D; without any 3D there is no way
    to tell."""
    try:
        body = skeletons.body_of(workspace, walk)
    except skeletons.NotYet:
        return
    times = seconds(workspace.frames(walk, camera)["stamp_ns"], body.t0_ns, clock.offset_s, clock.drift_ppm)
    begin, end = body.track.seconds[[0, -1]].tolist()
    if not ((times >= begin) & (times <= end)).any():
        raise DiorError(
            f"{path}: with offset_s {clock.offset_s:g} no picture of '{camera}' is of the {end - begin:.1f} s of which "
            f"there is 3D of {walk}; give a smaller one"
        )


def lines_at(view: View, rows: Ints, offset_s: float, drift_ppm: float) -> list[dict[str, list[list[float]]]]:
    """The skeleton in pictures `rows` (F,) at the times that a clock gives them."""
    points = view.body.at(view.rows["stamp_ns"][rows], offset_s, drift_ppm)
    return skeletons.lines(view.found.camera, points, view.body.joints)


def estimate(clock: Clock | None, curve: told_clocks.Curve | None) -> dict[str, float] | None:
    """The clock that the recording tells: offset s and drift ppm. Where one by hand stood in its way, the lag of the
    least cost is it; None where nothing tells."""
    if clock is not None and clock.source == "estimated":
        return {"offset_s": clock.offset_s, "drift_ppm": clock.drift_ppm}
    if curve is None or not np.isfinite(curve[1]).any():
        return None
    return {"offset_s": lag.lowest(*curve) / 1e3, "drift_ppm": 0.0}


def by_hand_of(walk: str, camera: str) -> dict[str, Any] | None:
    """What config/offsets says of a camera, as it is written there."""
    found: dict[str, Any] | None = _given(walk).get(camera)
    return found


def _given(walk: str) -> dict[str, Any]:
    path = skeletons.offsets_file(walk)
    content = read_yaml(path) if Path(path).is_file() else {}
    return content if isinstance(content, dict) else {}


def view_of(workspace: Workspace, walk: str, camera: str) -> View:
    """The `View` of a camera in a walk. Raises NotYet where there is no 3D or no pose."""
    found = found_of(workspace, walk, camera)
    body, rows = skeletons.body_of(workspace, walk), workspace.frames(walk, camera)
    clock = skeletons.clock_by_hand(workspace.project(), walk, camera) or found.clock or Clock(0.0)
    points = body.at(rows["stamp_ns"], clock.offset_s, clock.drift_ppm)
    feet = [i for i, joint in enumerate(body.joints) if skeletons.FEET.fullmatch(joint)] or range(len(body.joints))
    chosen = fastest(found.camera, points[:, list(feet)], rows["stamp_ns"], PICTURES)
    crops = skeletons.around(found.camera, points[chosen][:, list(feet)])
    return View(found, body, rows, chosen, crops)


def fastest(camera: Camera, points: Floats, stamps_ns: Ints, count: int) -> Ints:
    """The `count` pictures (rows) in which one of the points (F, J, 3) m is fastest, px/s, all of them being in the
    picture; no two of them nearer than half of what they would be if they were spread evenly."""
    uv = cam.project(camera, points)[0]
    moved = np.linalg.norm(np.diff(uv, axis=0), axis=-1) / np.maximum(np.diff(stamps_ns)[:, None] / 1e9, 1e-3)
    speed = np.full(len(uv), -np.inf)
    inside = np.asarray(cam.in_frame(camera.intrinsics, uv).all(axis=1))
    known = np.isfinite(moved).any(axis=1) & inside[1:]
    speed[1:][known] = np.nanmax(moved[known], axis=1)
    apart, found = len(uv) / (2 * count), list[int]()
    for at in np.argsort(-speed, kind="stable").tolist():
        if len(found) == count or not np.isfinite(speed[at]):
            break
        if all(abs(at - other) >= apart for other in found):
            found.append(at)
    return np.array(sorted(found), int)


def found_of(workspace: Workspace, walk: str, camera: str) -> Found:
    """`Found` of the last run, or where that has not placed the camera, of its marks."""
    project = workspace.project()
    session = project.session_of(walk)
    offsets, findings = (skeletons.clock_file(project, walk, camera, kind) for kind in ("", ".findings"))
    costs = [skeletons.clock_file(project, walk, camera, ".costs")]
    costs += [f"results/locate/{session}/{camera}.clock_costs.parquet"]
    placed = project.final_cameras(session, camera)
    if Path(placed).is_file():

        def make() -> Found:
            pose = skeletons.pose_of_run(project, session, camera)
            if pose is None:
                raise skeletons.NotYet(f"{placed} has no pose of {camera}; its findings say why")
            return _found(pose, walk, offsets, [one for one in costs if Path(one).is_file()], findings)

        key = state_of([placed, offsets, findings, *costs])
        found: Found = workspace.kept(("clock", walk, camera), key, make)
        return found
    if project.cameras(session)[camera]["locate"] != "marks" or not project.indoor(walk):
        raise skeletons.NotYet(f"{camera} has no pose yet ({placed}): `dior run` places it first")
    return _by_marks(workspace, walk, camera)


def _found(camera: Camera, walk: str, offsets: str | Path, costs: list[Any], findings: str | Path) -> Found:
    said = tables.read(findings, "findings") if Path(findings).is_file() else None
    keys = ("scope", "severity", "code", "text")
    rows = list(zip(*(said[key].tolist() for key in keys), strict=True)) if said else []
    known = Path(offsets).is_file()
    clocks = on_axis.read([offsets], sequence=walk) if known else {}
    told = told_clocks.read(walk, [camera.name], [offsets], costs, rows) if known else None
    own = tuple((severity, text) for scope, severity, _, text in rows if scope == f"{walk}/{camera.name}")
    return Found(camera, clocks.get(camera.name), told, own)


def _by_marks(workspace: Workspace, walk: str, camera: str) -> Found:
    """What `dior locate` makes of a camera's marks."""
    project = workspace.project()
    session = project.session_of(walk)
    walks, marks = project.marks_sequences(session, camera), project.marks_file(session, camera)
    if not walks:
        raise skeletons.NotYet(f"{camera} of {session} has no marks yet: mark joints on the page Marks")
    settings, path = project.config["locate"], project.camera_file(session, camera)
    offsets = [one for each in walks for one in project.offsets(each)]

    def make() -> Found:
        with TemporaryDirectory(prefix="dior_studio_") as name:
            folder = Path(name)
            lens = folder / "lens.parquet"
            camera_tables.write_cameras(lens, [workspace.lens(session, camera)], session)
            for each in walks:
                tables.write(folder / f"{each}.parquet", "frames", workspace.frames(each, camera))
            kinds = ("camera", "covariance", "clocks", "gains", "costs", "marks", "findings")
            out = {kind: folder / f"out.{kind}.parquet" for kind in kinds}
            locate.run(
                session=session, camera=camera, camera_file=Path(path), intrinsics=lens,
                given=locate.ByHand(Path(marks), walks, [*map(Path, offsets)]),
                recorded=locate.Recorded(
                    [workspace.motion_file(each) for each in project.marks_mocap(session, camera)],
                    [folder / f"{each}.parquet" for each in walks],
                ),
                ransac_px=settings["ransac_px"], written=locate.Written(*out.values()),
            )  # fmt: skip
            pose = camera_tables.read_cameras(out["camera"])[camera]
            return _found(pose, walk, out["clocks"], [out["costs"]], out["findings"])

    files = [path, marks, *offsets]
    files += [one for each in walks for one in (*project.picture_files(each), *project.mocap(each))]
    found: Found = workspace.kept(("by_marks", walk, camera), (state_of(files), repr(settings)), make)
    return found


def _plain(values: Floats, digits: int) -> list[float | None]:
    return [round(one, digits) if math.isfinite(one) else None for one in values.tolist()]


def _views(request: Request) -> dict[tuple[str, str], View]:
    found: dict[tuple[str, str], View] = in_memory(request, "time_views")
    return found


ROUTES = [
    Route("/time", time),
    Route("/api/time", told),
    Route("/api/time/drawn", drawn),
    Route("/api/time/save", save, methods=["POST"]),
]
