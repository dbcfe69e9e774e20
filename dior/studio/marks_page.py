"""Marks: the C3D's own markers, clicked in a camera's pictures, with what they say of its pose and clock meanwhile."""

import threading
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from dior.arrays import Bools, Ints
from dior.body import names
from dior.calibrate import locate
from dior.calibrate.marks import marks as hand_marks
from dior.calibrate.marks.marks import Marks
from dior.clocks import by_hand
from dior.clocks.axis import seconds
from dior.errors import DiorError, many
from dior.studio import blobs, body_figure, frames_to_mark, live_pose
from dior.studio.frames_page import pictures_of
from dior.studio.hand_files import Change, cells_of, change_rows
from dior.studio.live_pose import Answer, Given
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
from dior.studio.workspace import Workspace, state_of

KEYS, OTHERS = ("sequence", "frame", "joint"), ("u", "v")
MOST_CHANGES = 1000  # chosen: of one request; a camera has some fifty marks
# chosen: of the markers of a frame, at least, in the picture and not hidden, for it to be offered
LEAST_SEEN = 0.3


def marks(request: Request) -> Response:
    """The page."""
    return page(request, "marks.html.j2", figure=body_figure.drawn())


def marked(request: Request) -> Response:
    """The camera's marks in all walks, and the markers of this walk."""
    walk, camera = recording_of(request)
    workspace = workspace_of(request)
    project = workspace.project()
    session = project.session_of(walk)
    path, how = project.marks_file(session, camera), project.cameras(session)[camera]["locate"]
    read = _read(path)
    # points with x, y, z of their own are in the file alone
    joints = list(dict.fromkeys([*workspace.motion(walk).joints, *read.joint[read.sequence == walk]]))
    placed = (
        "" if how == "marks" else f"{project.camera_file(session, camera)} says `locate: {how}`: marks do not place it."
    )
    return JSONResponse({
        "path": path,
        "rows": _rows(read),
        "markers": [{"name": name, "words": body_figure.words(name), "side": names.side_of(name)} for name in joints],
        "easy": [name for name in body_figure.EASY if name in joints],
        "note": placed,
    })  # fmt: skip


async def change(request: Request) -> Response:
    """Place, move or remove marks: for each its key, [u, v] before and after, or null where there is none."""
    content = await sent(request)
    return await run_in_threadpool(_change, workspace_of(request), content)


def _change(workspace: Workspace, content: dict[str, Any]) -> Response:
    project = workspace.project()
    walk, camera = recording_in(project, content)
    session = project.session_of(walk)
    wanted = content.get("changes")
    if not isinstance(wanted, list) or not 0 < len(wanted) <= MOST_CHANGES:
        raise DiorError("the page has sent no changes")
    path = project.marks_file(session, camera)
    there = _read(path)
    change_rows(path, KEYS, OTHERS, [_changed(workspace, session, camera, one, there) for one in wanted], _read)
    return JSONResponse({"rows": _rows(_read(path))})


def _changed(workspace: Workspace, session: str, camera: str, one: Any, there: Marks) -> Change:
    """A change as a page has sent it. Raises DiorError for what is no mark of a picture of the camera."""
    if not (isinstance(one, dict) and isinstance(one.get("key"), list) and len(one["key"]) == len(KEYS)):
        raise DiorError("the page has sent a change without its sequence, frame and marker")
    walk = one_of("walk", one["key"][0], workspace.project().sequences_of(session))
    frame, joint = one["key"][1], one["key"][2]
    if isinstance(frame, bool) or not isinstance(frame, int) or not isinstance(joint, str):
        raise DiorError("the page has sent a change without a frame and a marker")
    after = _pixel(one.get("after"))
    if after is not None:
        table = workspace.frames_with(walk, camera, frame)
        where = f"{joint} on frame {frame} of {walk}"
        hand_marks.check_inside(where, np.array(after), int(table["width"][0]), int(table["height"][0]))
        if not ((there.sequence == walk) & (there.frame == frame) & (there.joint == joint)).any():
            one_of("marker", joint, workspace.motion(walk).joints)
    before = _pixel(one.get("before"))
    # as the file has it, which others may have written with more digits
    return Change((walk, str(frame), joint), None if before is None else tuple(map(str, before)), cells_of(after))


def _pixel(given: Any) -> tuple[float, ...] | None:
    found = pixel_of(given)
    if found == ():
        raise DiorError("the page has sent a place that is no two pixels")
    return found


def _read(path: str | Path) -> Marks:
    """The marks of a file, none where it is not there yet."""
    if Path(path).is_file():
        return hand_marks.read(path)
    none = np.zeros(0, object)
    return Marks(none, np.zeros(0, np.int64), none, np.zeros(0, np.int64), np.zeros((0, 2)), np.zeros((0, 3)))


def _rows(read: Marks) -> list[list[Any]]:
    """[sequence, frame, joint, u, v] of each mark."""
    return [
        [sequence, frame, joint, u, v]
        for sequence, frame, joint, (u, v) in zip(
            read.sequence.tolist(), read.frame.tolist(), read.joint.tolist(), read.uv.tolist(), strict=True
        )
    ]


def snap(request: Request) -> Response:
    """The middle of the bright blob within 5 px of a pixel of a picture; the pixel itself where there is none."""
    walk, camera = recording_of(request)
    try:
        u, v = (float(request.query_params.get(name, "")) for name in "uv")
        round(u), round(v)  # no NaN and no infinity
    except (ValueError, OverflowError):
        raise DiorError("u and v are the pixel that was clicked") from None
    found = blobs.snapped(_grey(request, walk, camera, number_of(request, "frame")), u, v)
    return JSONResponse({
        "u": u if found is None else round(float(found[0]), 2),
        "v": v if found is None else round(float(found[1]), 2),
        "found": found is not None,
    })  # fmt: skip


def _grey(request: Request, walk: str, camera: str, frame: int, small: bool = False) -> Any:
    content = pictures_of(request).read(walk, camera, frame, small)
    picture = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_GRAYSCALE)
    if picture is None:
        raise DiorError(f"frame {frame} of {camera} in {walk} cannot be decoded")
    return picture


def first(request: Request) -> Response:
    """A frame to begin with, before there is a pose: of frames that are spread over the walk the one in which most
    moves, wholly inside of the picture; and the box of that, u, v of its corners."""
    walk, camera = recording_of(request)
    workspace = workspace_of(request)
    stamps = workspace.frames(walk, camera)["stamp_ns"]
    motion = workspace.motion(walk)
    times = seconds(stamps, motion.t0_ns)
    during = np.flatnonzero((times >= motion.t[0]) & (times <= motion.t[-1]))
    if not len(during):
        raise DiorError(f"no picture of {camera} is taken while the motion capture of {walk} runs, by their stamps")
    found = []
    for frame in during[frames_to_mark.spread(len(during))].tolist():
        later = int(np.searchsorted(times, times[frame] + frames_to_mark.APART_S).clip(max=len(times) - 1))
        pair = [_grey(request, walk, camera, number, small=True) for number in (frame, later)]
        found.append((frame, *frames_to_mark.movement(*pair)))
    if not found:
        found = [(int(during[0]), 0, None)]
    frame, _, box = found[frames_to_mark.liveliest(found)]
    if box is not None:
        factor = int(workspace.frames(walk, camera)["width"][0]) / pair[0].shape[1]
        box = tuple(round(factor * edge) for edge in box)
    return JSONResponse({"frame": frame, "box": box})


def pose(request: Request) -> Response:
    """What the marks say now, and what it means for one frame; `full=1`: after a search of the clocks."""
    walk, camera = recording_of(request)
    frame, full = number_of(request, "frame"), number_of(request, "full", 0)
    live: Live = in_memory(request, "live", lambda: Live(workspace_of(request)))
    return JSONResponse(live.told(walk, camera, frame, bool(full)))


class Live:
    """Answers by camera, and the offsets that the last search found. A search that a newer one has overtaken while it
    waited is not made."""

    def __init__(self, workspace: Workspace) -> None:
        self.workspace = workspace
        self._lock = threading.Lock()
        self._searching: dict[tuple[str, str], threading.Lock] = {}
        self._newest: dict[tuple[str, str], object] = {}
        self._searched: dict[tuple[str, str], tuple[object, Answer | str]] = {}

    def told(self, walk: str, camera: str, frame: int, full: bool) -> dict[str, Any]:
        """The answer for the page."""
        given, version = self._given(walk, camera)
        own = self.workspace.project().session_of(walk), camera
        if len(given.marks) < locate.FEWEST:
            # what the first pose will need is loaded before it is waited for
            import scipy.optimize
            import scipy.spatial.transform
            import scipy.special  # noqa: F401

            left = locate.FEWEST - len(given.marks)
            return {"why": f"{many(left, 'mark')} more, and the camera's pose is shown.", "unfinished": False}
        if full:
            found = self._search(own, given, version)
            if found is None:
                return {"void": True}
        else:
            kept = self._searched.get(own)
            found = kept[1] if kept is not None and kept[0] == version else None
        why = found if isinstance(found, str) else ""
        if not isinstance(found, Answer):
            known = self._searched[own][1] if own in self._searched else ""
            offsets = {name: one[0] for name, one in known.clock.items()} if isinstance(known, Answer) else {}
            try:
                answer = live_pose.at_once(given, offsets)
            except DiorError as error:
                return {"why": live_pose.refusal(error, given), "unfinished": _tells_clocks(given) and not full}
        else:
            answer = found
        unfinished = found is None and _tells_clocks(given)
        return _told(given, answer, walk, frame) | {"why": why, "unfinished": unfinished}

    def _search(self, own: tuple[str, str], given: Given, version: object) -> Answer | str | None:
        """The answer of a search, what the error says, None where it is not wanted any more."""
        with self._lock:
            searching = self._searching.setdefault(own, threading.Lock())
            self._newest[own] = version
        with searching:
            if self._newest[own] != version:
                return None
            kept = self._searched.get(own)
            if kept is not None and kept[0] == version:
                return kept[1]
            found: Answer | str
            try:
                found = live_pose.searched(given) if _tells_clocks(given) else live_pose.at_once(given, {})
            except DiorError as error:
                found = live_pose.refusal(error, given)
            self._searched[own] = version, found
            return found

    def _given(self, walk: str, camera: str) -> tuple[Given, object]:
        """What the camera is located from, and a word that is another where any of it is."""
        workspace = self.workspace
        project = workspace.project()
        session = project.session_of(walk)
        path = project.marks_file(session, camera)
        read = _read(path)
        read = read.only(np.isin(read.sequence, project.marks_sequences(session, camera)))
        walks = list(dict.fromkeys([*read.sequence, walk]))
        tables = {name: workspace.frames(name, camera) for name in walks}
        motions = {name: workspace.motion(name) for name in walks if project.mocap(name)}
        cameras = sorted(project.cameras(session))
        offsets = [path for name in walks for path in project.offsets(name)]
        lens = workspace.lens(session, camera)
        given = Given(
            lens, read, path, motions,
            {name: (table["frame"], table["stamp_ns"]) for name, table in tables.items()},
            {name: by_hand.read(next(iter(project.offsets(name)), None), cameras)[camera] for name in walks},
            project.config["locate"]["ransac_px"], f"{session}/{camera}",
            max(workspace.search_s(name, camera) for name in walks),
        )  # fmt: skip
        made = [lens, *tables.values(), *motions.values()]
        return given, (state_of([path, *offsets]), given.ransac_px, walks, [id(one) for one in made])


def _tells_clocks(given: Given) -> bool:
    """Whether a search says more than `at_once`: there are two frames, or no clock is open."""
    frames = set(zip(given.marks.sequence, given.marks.frame.tolist(), strict=True))
    return len(frames) > 1 or all(one[2] == "manual" for one in given.clock.values())


def _told(given: Given, answer: Answer, walk: str, frame: int) -> dict[str, Any]:
    """An answer for the page, with what it means on one frame."""
    used = answer.used
    here = live_pose.seen(given, answer, walk, frame)
    joints = given.motions[walk].joints
    candidates = live_pose.unmarked(given, answer, walk, frame)
    order = live_pose.ranked(given, answer, candidates)
    offered = _frame(given, answer, walk)
    everywhere = [
        one
        for name, number in dict.fromkeys(zip(used.sequence, used.frame.tolist(), strict=True))
        if name in given.motions
        for one in live_pose.unmarked(given, answer, name, number)
    ]
    best = next(iter(live_pose.ranked(given, answer, everywhere, most=1)), None)
    known = _tells_clocks(given) and answer.searched
    return {
        "residuals": [
            [sequence, number, joint, _number(residual, 2), bool(inlier)]
            for sequence, number, joint, residual, inlier in zip(
                used.sequence, used.frame.tolist(), used.joint, answer.residual_px, answer.inlier, strict=True
            )
        ],
        "predicted": [
            {"joint": joint, "u": _number(uv[0], 2), "v": _number(uv[1], 2), "hidden": bool(hidden)}
            for joint, uv, hidden in zip(joints, here.uv, here.hidden, strict=True)
            if np.isfinite(uv).all()
        ],
        "order": [mark.joint for mark, _, _ in order] + [
            mark.joint for mark in candidates if mark.joint not in {one.joint for one, _, _ in order}
        ],
        "wrong": _wrong(given, answer),
        "errors": _errors(given, answer, best) if known else None,
        "notes": list(answer.notes),
        "best": best and {
            "frame": best[0].frame, "walk": best[0].sequence, "joint": best[0].joint,
            "before": _number(best[1], 2), "after": _number(best[2], 2),
        },
        "frame": offered,
        "enough": live_pose.enough(given, answer, best),
        "frames": len(set(zip(given.marks.sequence, given.marks.frame.tolist(), strict=True))),
    }  # fmt: skip


def _errors(given: Given, answer: Answer, best: Any) -> dict[str, Any]:
    """The expected errors: pose (1 sigma), the camera's share of a label, and the clocks (95 %)."""
    return {
        "pose_mm": _number(1000 * answer.sigma_m, 1),
        "pose_deg": _number(answer.sigma_deg, 3),
        "label_px": None if best is None else _number(best[1], 2),
        "clocks": {
            name: {"late_s": round(clock.late_s, 4), "half_ms": _number(1000 * live_pose.clock_95_s(answer, name), 1)}
            for name, clock in answer.clocks.items()
        },
    }


def _wrong(given: Given, answer: Answer) -> list[dict[str, Any]]:
    """The marks that are not used, and the one that the others contradict, each with a sentence."""
    used, found = answer.used, []
    others = int(answer.inlier.sum())
    for i in np.flatnonzero(~answer.inlier).tolist():
        away = answer.residual_px[i]
        where = f"{away:.1f} px from where the other {others} put it" if np.isfinite(away) else "behind the camera"
        found.append((i, f"is {where}; it is not used."))
    if answer.suspect is not None:
        i, away, shift = answer.suspect
        text = (
            f"is {away:.1f} px from where the other {others - 1} put it, more than they scatter, and moves the camera"
        )
        found.append((i, f"{text} by {1000 * shift:.0f} mm: look at it again."))
    told = []
    for i, text in found:
        other = live_pose.taken_for(given, answer, i)
        hint = f" It lies where {other} is." if other else ""
        name = f"{used.joint[i]} on frame {used.frame[i]}"
        told.append({
            "walk": used.sequence[i], "frame": int(used.frame[i]), "joint": used.joint[i],
            "text": f"{name} {text}{hint}",
        })  # fmt: skip
    return told


def _frame(given: Given, answer: Answer, walk: str) -> dict[str, Any] | None:
    """The frame of a walk that would help most, and why: where the feet pass each other, the person is seen, and is
    furthest from where frames with marks have it."""
    motion, (_, stamps) = given.motions[walk], given.stamps[walk]
    times = seconds(stamps, motion.t0_ns, *answer.clock[walk][:2])
    passing = frames_to_mark.nearest_frames(times, frames_to_mark.feet_pass(motion))
    frames = passing if len(passing) else frames_to_mark.spread(len(times))
    marked = np.unique(given.marks.frame[given.marks.sequence == walk])
    frames = np.setdiff1d(frames, marked)
    frames = frames[_well_seen(given, answer, walk, frames)]
    if not len(frames) or not len(marked):
        return None if not len(frames) else _offered(int(frames[len(frames) // 2]), len(passing) > 0, None, 0)
    places = frames_to_mark.middle(live_pose.markers_at(given, answer.clock, walk, frames))
    there = frames_to_mark.middle(live_pose.markers_at(given, answer.clock, walk, marked))
    there = there[np.isfinite(there).all(axis=1)]
    if not len(there) or not np.isfinite(places).all(axis=1).any():
        return None
    best, away = frames_to_mark.furthest(places, there)
    return _offered(int(frames[best]), len(passing) > 0, away, len(marked))


def _offered(frame: int, passes: bool, away_m: float | None, marked: int) -> dict[str, Any]:
    return {"frame": frame, "text": frames_to_mark.sentence(frame, passes, away_m, marked)}


def _well_seen(given: Given, answer: Answer, walk: str, frames: Ints) -> Bools:
    """On which of the frames (F,) enough markers are in the picture and not hidden."""
    found = live_pose.seen_on(given, answer, walk, frames)
    clear = np.isfinite(found.uv).all(axis=-1) & ~found.hidden
    return np.asarray(clear.sum(axis=1) >= max(locate.FEWEST, LEAST_SEEN * clear.shape[1]))


def _number(value: float, digits: int) -> float | None:
    return round(float(value), digits) if np.isfinite(value) else None


ROUTES = [
    Route("/marks", marks),
    Route("/api/marks", marked),
    Route("/api/marks/change", change, methods=["POST"]),
    Route("/api/marks/snap", snap),
    Route("/api/marks/first", first),
    Route("/api/marks/pose", pose),
]
