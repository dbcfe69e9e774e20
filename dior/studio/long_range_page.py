"""Long range: a far camera is turned and moved by eye until the skeleton is on the person in a dozen pictures at once.

INPUTS   the camera's YAML (`tape`, `nudge`, `align`), the 3D of the session's walks, boxes, clocks; results/align
OUTPUTS  `nudge:` and `tape.roll_deg` of the YAML, or its `align:`; lines px, shares and offsets px for the page

A pose is by eye (`calibrate.align.aligned_pose` of what the page says), of the last run, or what `dior align` makes of
the boxes from there.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from dior.arrays import Bools, Floats, Ints
from dior.calibrate import align
from dior.clocks.clock import NORMAL_95, Clock
from dior.errors import DiorError, many
from dior.evaluate import labels_in_boxes
from dior.evaluate.grids import LabelGrid
from dior.geometry import camera as cam
from dior.geometry import camera_tables
from dior.geometry.camera import Camera
from dior.project import boxes as hand_boxes
from dior.project.camera_file import camera_settings
from dior.project.contents import Project
from dior.project.yaml_file import read_yaml
from dior.report import beside_boxes
from dior.studio import skeletons
from dior.studio.hand_files import change_values
from dior.studio.pages import in_memory, one_of, page, sent, within, workspace_of
from dior.studio.workspace import Workspace, state_of
from dior.tables import tables

PICTURES = 12  # chosen: as many as are seen at once, each as large as a hand
FEWEST_BOXES = 4  # as many as `boxes_fit` asks for
ROLL = "roll_deg"
NUDGE = ("azimuth_deg", "elevation_deg", "distance_m")
# chosen: beyond these it is no correction but another camera
MOST = {"azimuth_deg": 180.0, "elevation_deg": 90.0, "distance_m": 1000.0, ROLL: 360.0}
POSES = ("eye", "run", "fit")


@dataclass(frozen=True, eq=False)
class Scene:
    """A walk in the camera's pictures: `points` (F, J, 3) m of the `joints` in the pictures `frames` (F,), which are
    shown, and `boxed_points` (B, J, 3) in those with a box, `boxed` (B,), whose edges are `boxes` (B, 4) px; the
    `clock` they are taken by, and the crops (F, 4) px that show the person."""

    walk: str
    version: str
    joints: list[str]
    frames: Ints
    points: Floats
    boxed: Ints
    boxes: Floats
    boxed_points: Floats
    clock: Clock
    crops: Floats


@dataclass(frozen=True, eq=False)
class View:
    """A camera without its pose, what its file at `path` says (`content`), its `scenes`, where the last run has it
    (`run`), and what walks lack (`without`)."""

    path: str
    content: dict[str, Any]
    lens: Camera
    scenes: tuple[Scene, ...]
    run: Camera | None
    without: tuple[str, ...]


def long_range(request: Request) -> Response:
    """The page."""
    return page(request, "long_range.html.j2")


def cameras(request: Request) -> Response:
    """Long-range cameras by session, with how each is located."""
    project = workspace_of(request).project()
    return JSONResponse([
        {"session": session, "camera": name, "locate": one["locate"]}
        for session in project.sessions
        for name, one in project.cameras(session).items()
        if one["role"] == "long_range" or one["locate"] == "align"
    ])  # fmt: skip


def told(request: Request) -> Response:
    """Of one camera: its file, its pictures with their boxes, and how the workflow uses the nudge."""
    workspace = workspace_of(request)
    session, camera = _camera(workspace.project(), request.query_params)
    try:
        view = _views(request)[session, camera] = view_of(workspace, session, camera)
    except skeletons.NotYet as error:
        return JSONResponse({"lacks": str(error)})
    path, content = view.path, view.content
    away = by_eye(path, content, view.lens).centre - np.array(content["tape"].get("target_m", (0, 0, 0)))
    return JSONResponse({
        "file": path,
        "nudge": content.get("nudge"),
        "tape": content["tape"],
        "align": content.get("align"),
        "proposed": content.get("align") or proposed(view),
        "run": view.run is not None,
        "says": says(content, view),
        "range_m": round(float(np.hypot(*away[:2])), 1),
        "width": view.lens.intrinsics.width,
        "height": view.lens.intrinsics.height,
        "clocks": [_clock_in_words(scene) for scene in view.scenes],
        "without": view.without,
        "pictures": [
            {
                "walk": scene.walk, "camera": camera, "frame": int(frame), "version": scene.version,
                "crop": np.round(crop, 1).tolist(),
                "box": next(iter(scene.boxes[scene.boxed == frame].tolist()), None),
            }
            for scene in view.scenes
            for frame, crop in zip(scene.frames, scene.crops, strict=True)
        ],
    })  # fmt: skip


def drawn(request: Request) -> Response:
    """The skeleton in all pictures, and how it lies in the boxes, with a pose: eye (with four numbers), run or fit."""
    words = request.query_params
    workspace = workspace_of(request)
    project = workspace.project()
    # what is made of files is looked at when the page is opened, not at each of the many steps of a nudge
    key = _camera(project, words)
    view = _views(request).get(key)
    if view is None or not all(scene.walk in project.sequences for scene in view.scenes):
        view = _views(request)[key] = view_of(workspace, *key)
    return JSONResponse(in_pictures(view, _posed(request, view, words)))


async def fit(request: Request) -> Response:
    """What `dior align` makes of the boxes, from the nudge that is sent; nothing is written."""
    words, workspace = await sent(request), workspace_of(request)

    def found() -> dict[str, Any]:
        session, camera = _camera(workspace.project(), words)
        view = view_of(workspace, session, camera)
        path, content = view.path, view.content
        how = content.get("align") or proposed(view)
        if not how:
            raise DiorError(
                f"no walk of {session} has {FEWEST_BOXES} boxes or more of {camera}: draw them on the page Boxes"
            )
        before = by_eye(path, _nudged(content, words), view.lens)
        fitted, said = fit_to_boxes(workspace, session, camera, _nudged(content, words) | {"align": how})
        _fits(request)[session, camera] = fitted
        moved = moves_px(view, before, fitted)
        return {"align": how, "said": said, "moves_px": round(moved, 2)} | in_pictures(view, fitted)

    return JSONResponse(await run_in_threadpool(found))


async def save(request: Request) -> Response:
    """Change keys at the top of the camera's file: {changes: [{key, before, after}]}, of nudge, tape and align."""
    words, workspace = await sent(request), workspace_of(request)

    def written() -> dict[str, Any]:
        project = workspace.project()
        session, camera = _camera(project, words)
        path, _ = _file(project, session, camera)
        changes = words.get("changes")
        given = [one if isinstance(one, dict) else {} for one in (changes if isinstance(changes, list) else [])]
        keys = [one_of("key", one.get("key"), ("nudge", "tape", "align")) for one in given]
        values = [(one.get("before"), one.get("after")) for one in given]
        change_values(path, [(key, *each) for key, each in zip(keys, values, strict=True)], checked)
        content = read_yaml(path)
        return {"file": path, **{key: content.get(key) for key in ("nudge", "tape", "align")}}

    return JSONResponse(await run_in_threadpool(written))


def checked(draft: Path) -> None:
    """Raises DiorError for a camera's file that the step align would refuse."""
    settings = camera_settings(draft, needs="align")
    align.aligned_pose(draft, settings["tape"], settings["nudge"])


def by_eye(path: str, content: Mapping[str, Any], lens: Camera) -> Camera:
    """The camera by the tape and the nudge of its file."""
    return lens.at(align.aligned_pose(path, content["tape"], content.get("nudge") or {}), "align")


def in_pictures(view: View, camera: Camera) -> dict[str, Any]:
    """What the page draws and says of a pose: `pictures`, the lines of each, and `figures` of the boxes."""
    shown = [one for scene in view.scenes for one in skeletons.lines(camera, scene.points, scene.joints)]
    return {"pictures": shown, "figures": figures(view, camera)}


def figures(view: View, camera: Camera) -> dict[str, Any]:
    """How the labels of a pose lie in the hand boxes: in all, `walks` by walk; {} without boxes.

    `inside`, `expected`, `held_back`: shares as `evaluate.labels_in_boxes` has them; `off`: px to the right and below
    as `report.beside_boxes`, with standard errors `sigma`; `words`: the same as a sentence; `onto`: the nudge by which
    a camera that is placed by eye would have the labels on the boxes, as changes of degrees.
    """
    values: dict[str, list[Floats]] = {}
    walks, offsets = [], []
    for scene in view.scenes:
        if not len(scene.boxed):
            continue
        grid = label_grid(camera, scene)
        found = {name: each for name, _, each in labels_in_boxes.figures(grid, scene.boxes, cam.occluded_edge(camera))}
        offset = _offset(grid, found)
        offsets += [offset] if offset else []
        for name in ("in_box_share", "in_box_expected", "held_back_share"):
            values.setdefault(name, []).append(found[name].ravel())
        walks.append({"walk": scene.walk, "boxes": len(scene.boxed), "inside": _share(found["in_box_share"])})
    if not walks:
        return {}
    inside, expected, held_back = (_share(np.concatenate(each)) for each in values.values())
    told: dict[str, Any] = {"walks": walks, "inside": inside, "expected": expected, "held_back": held_back}
    together = beside_boxes.together(offsets)
    if together:
        onto = beside_boxes.nudge(together, camera, {})
        off, sigma = np.round(together.uv, 2).tolist(), np.round(together.sigma, 2).tolist()
        told |= {"off": off, "sigma": sigma, "words": lie(together), "onto": onto}
    return told


def lie(offset: beside_boxes.Offset) -> str:
    """Where labels lie beside the boxes, as a sentence."""
    if any(offset.told):
        side = beside_boxes.words(offset)
        return f"The labels lie {side}{'' if side.endswith(('above', 'below')) else ' of'} the boxes."
    half = NORMAL_95 * max(offset.sigma)
    count = many(offset.n, "picture")
    return f"The labels lie on the boxes, as well as {count} with boxes can tell: to ± {half:.1f} px."


def label_grid(camera: Camera, scene: Scene) -> LabelGrid:
    """The labels of the pictures that have boxes."""
    uv = cam.project(camera, scene.boxed_points)[0]
    inside: Bools = cam.in_frame(camera.intrinsics, uv)
    missing = np.asarray(~np.isfinite(scene.boxed_points).all(axis=-1))
    shown = np.where(inside[..., None], uv, np.nan)
    return LabelGrid(camera.name, scene.boxed, scene.boxed, scene.joints, shown, inside, missing)


def _offset(grid: LabelGrid, found: Mapping[str, Floats]) -> beside_boxes.Offset | None:
    boxes = labels_in_boxes.label_boxes(grid)
    height_px = float(np.nanmedian(boxes[:, 3] - boxes[:, 1])) if np.isfinite(boxes).any() else np.nan
    by_metric = {}
    for name in ("box_offset_u", "box_offset_v"):
        there = np.isfinite(found[name][:, 0])
        by_metric[name] = grid.stamp_ns[there], found[name][there, 0], np.ones(there.sum(), int)
    return beside_boxes.of_recording(by_metric, height_px)


def _share(values: Floats) -> float | None:
    known = values[np.isfinite(values)]
    return round(float(known.mean()), 4) if len(known) else None


def moves_px(view: View, before: Camera, after: Camera) -> float:
    """How far the labels are apart with two poses: mean px of all joints in the pictures."""
    apart = []
    for scene in view.scenes:
        points = np.concatenate([scene.points, scene.boxed_points])
        each = np.linalg.norm(cam.project(after, points)[0] - cam.project(before, points)[0], axis=-1)
        apart.append(each[np.isfinite(each)])
    return float(np.concatenate(apart).mean()) if sum(map(len, apart)) else math.nan


def proposed(view: View) -> dict[str, Any] | None:
    """A section `align:` of all walks that have boxes, None without any."""
    walks = [scene.walk for scene in view.scenes if len(scene.boxed) >= FEWEST_BOXES]
    return {"from": "boxes", "sequences": walks, "fit": "range"} if walks else None


def says(content: Mapping[str, Any], view: View) -> str:
    """What the workflow does with the nudge of this camera."""
    how = content.get("align")
    if not how:
        text = (
            "The file has no align:, so the tape and the nudge alone place this camera. The next run has the labels "
            "where you leave them here; how far off they may be is then not known."
        )
        return text + (
            " There are boxes: dior align can fit the camera to them instead, and then tells the error."
            if proposed(view) else " Boxes would let dior align do it, and tell the error."
        )  # fmt: skip
    sigma = content["tape"].get("sigma_m", 0.05)
    roll = (
        "Its roll starts from tape.roll_deg." if ROLL in content["tape"] else "Without tape.roll_deg any roll is tried."
    )
    return (
        f"The file has align:, so every run fits this camera to the {how['from']} of {', '.join(how['sequences'])}, "
        "and the nudge is only where that fit begins: azimuth and elevation change next to nothing in the labels, and "
        f"distance_m moves the place that the tape is believed to have measured, within its sigma_m of {sigma:g} m. "
        f"{roll} To place the camera by eye, take align: out of the file."
    )


def view_of(workspace: Workspace, session: str, camera: str) -> View:
    """The `View` of a camera, kept until something that it is made of changes. Raises NotYet without any 3D."""
    project = workspace.project()
    walks = project.sequences_of(session)
    path, content = _file(project, session, camera)
    lens = workspace.lens(session, camera)
    files = [skeletons.offsets_file(walk) for walk in walks] + [project.final_cameras(session, camera)]
    for walk in walks:
        clock = skeletons.clock_file(project, walk, camera)
        files += [project.skeleton_table(walk), clock, *project.boxes(walk).values(), *project.mocap(walk)]
        files += project.picture_files(walk)
    key = state_of(files), id(lens), repr(content)

    def make() -> View:
        run = skeletons.pose_of_run(project, session, camera)
        start, scenes, without = run or by_eye(path, content, lens), [], []
        each = max(1, -(-PICTURES // len(walks)))
        for walk in walks:
            try:
                scenes.append(_scene(workspace, walk, camera, start, each))
            except DiorError as error:
                without.append(str(error))
        if not any(len(scene.frames) for scene in scenes):
            raise skeletons.NotYet(
                without[0] if without else f"no walk of {session} has 3D in the pictures of {camera}"
            )
        return View(path, content, lens, _a_dozen(scenes), run, tuple(without))

    found: View = workspace.kept(("long_range", session, camera), key, make)
    return found


def _scene(workspace: Workspace, walk: str, camera: str, start: Camera, count: int) -> Scene:
    project = workspace.project()
    body, table = skeletons.body_of(workspace, walk), workspace.frames(walk, camera)
    clock = skeletons.clock_of(workspace, walk, camera)
    numbers = table["frame"]
    points = body.at(table["stamp_ns"], clock.offset_s, clock.drift_ppm)
    path = project.boxes(walk).get(camera)
    size = int(table["width"][0]), int(table["height"][0])
    boxed, boxes = hand_boxes.read(path, numbers, size) if path else hand_boxes.NONE
    person = skeletons.around(start, points)
    middle = np.stack([person[:, 0] + person[:, 2], person[:, 1] + person[:, 3]], axis=-1) / 2
    # half of the joints or more, and where the start has them in the picture, if that is anywhere
    known = np.isfinite(points).all(axis=-1).mean(axis=1) >= 0.5
    there = known & cam.in_frame(start.intrinsics, middle)
    chosen = spread(np.flatnonzero(there if there.any() else known), np.searchsorted(numbers, boxed), count)
    crops = person[chosen]
    for i, frame in enumerate(numbers[chosen]):
        if frame in boxed:
            crops[i] = boxes[boxed == frame][0]
    lens = start.intrinsics
    crops = np.where(np.isfinite(crops), crops, (0, 0, lens.width, lens.height))
    version = workspace.version(walk)
    at = np.searchsorted(numbers, boxed)
    return Scene(walk, version, body.joints, numbers[chosen], points[chosen], boxed, boxes, points[at], clock, crops)


def spread(there: Ints, wanted: Ints, count: int) -> Ints:
    """`count` of the pictures `there` (N,), evenly, but each the nearest one that is `wanted`, where one is near."""
    if len(there) <= count:
        return there
    slots = np.linspace(0, len(there) - 1, 2 * count + 1).round().astype(int)[1::2]
    half = (there[-1] - there[0]) / (2 * count)
    wanted = wanted[np.isin(wanted, there)]
    found = []
    for at in there[slots].tolist():
        near = wanted[np.abs(wanted - at) <= half]
        found.append(int(near[np.abs(near - at).argmin()]) if len(near) else at)
    return np.unique(found)


def _a_dozen(scenes: Iterable[Scene]) -> tuple[Scene, ...]:
    """The same, with PICTURES pictures shown at most, of as many walks as there can be."""
    all_of_them = list(scenes)
    order = [(nth, k) for k, scene in enumerate(all_of_them) for nth in range(len(scene.frames))]
    kept = {(k, nth) for nth, k in sorted(order)[:PICTURES]}
    found = []
    for k, scene in enumerate(all_of_them):
        mine = np.array([(k, nth) in kept for nth in range(len(scene.frames))], bool)
        found.append(replace(scene, frames=scene.frames[mine], points=scene.points[mine], crops=scene.crops[mine]))
    return tuple(found)


def fit_to_boxes(
    workspace: Workspace, session: str, camera: str, content: Mapping[str, Any]
) -> tuple[Camera, list[dict[str, str]]]:
    """The camera as `dior align` places it with that content of its file, and what it found. Raises DiorError as it."""
    import yaml

    project = workspace.project()
    path = project.camera_file(session, camera)
    how = content["align"]
    walks = list(how["sequences"])
    for walk in walks:
        one_of("sequence of align", walk, project.sequences_of(session))
    outdoors = any(not project.indoor(walk) for walk in walks)
    names = project.close(session) if outdoors else []
    close = [one for one in project.camera_tables(session, names) if Path(one).is_file()]
    spreads = dict.fromkeys(project.covariance_table(session, name) for name in names)
    boxes = [project.boxes(walk)[camera] for walk in walks if camera in project.boxes(walk)]
    marks = project.marks_file(session, camera)
    with TemporaryDirectory(prefix="dior_studio_") as name:
        folder = Path(name)
        draft, lens = folder / f"{camera}.yaml", folder / "lens.parquet"
        draft.write_text(yaml.safe_dump(dict(content)), encoding="utf-8")
        camera_tables.write_cameras(lens, [workspace.lens(session, camera)], session)
        frames = [folder / f"{walk}.parquet" for walk in walks]
        for walk, out in zip(walks, frames, strict=True):
            tables.write(out, "frames", workspace.frames(walk, camera))
        bodies = [Path(project.skeleton_table(walk)) for walk in walks]
        missing = [str(body) for body in bodies if not body.is_file()]
        if missing:
            raise DiorError(f"{missing[0]} is not there: `dior run` makes it first")
        try:
            align.run(
                session=session, camera=camera, camera_file=draft, intrinsics=lens,
                filmed=align.Walks(bodies, frames),
                given=align.ByHand(
                    [Path(one) for walk in walks for one in project.offsets(walk)], [*map(Path, boxes)],
                    Path(marks) if how["from"] == "marks" else None,
                ),
                data_root=Path(project.data_root),
                triangulated_by=align.CloseCameras(
                    [*map(Path, close)], [Path(one) for one in spreads if one and Path(one).is_file()]
                ),
                out=folder / "camera.parquet", out_covariance=folder / "covariance.parquet",
                out_without=folder / "left_out.parquet", findings=folder / "findings.parquet",
            )  # fmt: skip
        except DiorError as error:
            raise DiorError(str(error).replace(str(draft), path)) from None
        found = tables.read(folder / "findings.parquet", "findings")
        said = [
            {"severity": severity, "text": text}
            for severity, text in zip(found["severity"].tolist(), found["text"].tolist(), strict=True)
        ]
        return camera_tables.read_cameras(folder / "camera.parquet")[camera], said


def _posed(request: Request, view: View, words: Mapping[str, Any]) -> Camera:
    kind = one_of("pose", words.get("pose", "eye"), POSES)
    if kind == "eye":
        return by_eye(view.path, _nudged(view.content, words), view.lens)
    found = view.run if kind == "run" else _fits(request).get((words["session"], words["camera"]))
    if found is None:
        raise DiorError("the last run has not placed it" if kind == "run" else "there is no fit yet")
    return found


def _nudged(content: Mapping[str, Any], words: Mapping[str, Any]) -> dict[str, Any]:
    """The content of a camera's file with the nudge and the roll that a page names; those that it does not stay."""
    given = {name: within(name, words[name], most) for name, most in MOST.items() if name in words}
    nudge = (content.get("nudge") or {}) | {name: given[name] for name in NUDGE if name in given}
    tape = content["tape"] | ({ROLL: given[ROLL]} if ROLL in given else {})
    return {**content, "tape": tape, "nudge": nudge}


def _file(project: Project, session: str, camera: str) -> tuple[str, dict[str, Any]]:
    """A camera's file and what is in it. Raises NotYet for one that is not located by align."""
    path = project.camera_file(session, camera)
    content = read_yaml(path)
    if content.get("locate") != "align":
        raise skeletons.NotYet(f"{path}: a nudge counts with `locate: align` alone; here it is {content.get('locate')}")
    return path, content


def _camera(project: Project, words: Mapping[str, Any]) -> tuple[str, str]:
    session = one_of("session", words.get("session", ""), project.sessions)
    return session, one_of("camera", words.get("camera", ""), project.cameras(session))


def _clock_in_words(scene: Scene) -> str:
    clock = scene.clock
    if clock.source == "assumed_zero":
        return f"{scene.walk}: the clock is not known yet; the pictures are taken at their stamps"
    half = NORMAL_95 * clock.given[0]
    spread = f" ± {1e3 * half:.0f}" if np.isfinite(half) and half else ""
    by = "by hand" if clock.source == "manual" else "of the last run"
    again = "" if clock.source == "manual" else "; the next run finds it again, with the pose that it has then"
    return f"{scene.walk}: {1e3 * clock.late_s:+.0f}{spread} ms, {by}{again}"


def _views(request: Request) -> dict[tuple[str, str], View]:
    found: dict[tuple[str, str], View] = in_memory(request, "long_range_views")
    return found


def _fits(request: Request) -> dict[tuple[str, str], Camera]:
    found: dict[tuple[str, str], Camera] = in_memory(request, "long_range_fits")
    return found


ROUTES = [
    Route("/long-range", long_range),
    Route("/api/long-range/cameras", cameras),
    Route("/api/long-range", told),
    Route("/api/long-range/drawn", drawn),
    Route("/api/long-range/fit", fit, methods=["POST"]),
    Route("/api/long-range/save", save, methods=["POST"]),
]
