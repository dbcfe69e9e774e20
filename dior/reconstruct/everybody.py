"""Everybody in the close cameras' pictures at the instants of a sequence, the seeds by hand, and what is said of both.

INPUTS   tables `detections` and `detected_people`, timeline; config/people/<sequence>.yaml where a person pointed at
         the subject: `seeds: [{camera: cam01, frame: 120, u: 640, v: 360}]`
OUTPUTS  `which_person.Seen` and `which_person.Seed`s for the choice, and its findings
A camera without rows in `detected_people` has one body only, which `detections` has.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dior.arrays import AnyPath, Floats, Ints, Table
from dior.body import people_seen
from dior.body.which_person import OWN, STRANGER, UNDECIDED, Choice, Seed, Seen
from dior.clocks.axis import blend
from dior.errors import DiorError, nearest
from dior.project import schema_check
from dior.tables import tables

MOST = 4  # people at once in a view; chosen: all sets of one person of each view are tried. The longest there stay
# chosen: body sizes from a detection within which a point by hand is meant for it
POINTED = 0.75
SAID = 5  # stretches that a finding lists; chosen: more are for the table
SHORT_S = 0.2  # a shorter stretch of somebody else is not worth a warning of its own; chosen


def at_instants(
    detections: Table, everybody: Table | None, timeline: Table, cameras: Sequence[str], min_score: float, fps: float
) -> Seen:
    """`Seen` by the cameras. A score below `min_score` is missing; nothing is interpolated between two tracks."""
    parts: list[tuple[Floats, Ints]] = []
    names: list[str] = []
    for name in cameras:
        values, names = tables.grid(tables.of_camera(detections, name), "u", "v", "score")
        mine = None if everybody is None else tables.of_camera(everybody, name)
        if mine is None or not len(mine["frame"]):
            slots, track = values[None], np.where(np.isfinite(values[..., 0]).any(axis=1), 0, -1)[None]
        else:
            slots, track = _slots(mine, len(values), len(names))
        slots = slots.copy()
        slots[..., :2][~(slots[..., 2] >= min_score)] = np.nan
        line = tables.of_camera(timeline, name)
        before, after, weight = line["frame_before"], line["frame_after"], line["weight"]
        at = np.stack([blend(one, before, after, weight) for one in slots])
        whose = np.where(before >= 0, track[:, before], -1)
        apart = (weight > 0) & (whose != track[:, after])
        at[apart] = np.nan
        parts.append((at, np.where(apart, -1, whose)))
    each = max(len(at) for at, _ in parts)
    uv = np.stack([_filled(at[..., :2], each, np.nan) for at, _ in parts])
    score = np.stack([_filled(at[..., 2], each, np.nan) for at, _ in parts])
    score = np.where(np.isfinite(uv).all(axis=-1), score, 0.0)
    return Seen(uv, score, np.stack([_filled(track, each, -1) for _, track in parts]), names, fps)


def _filled(values: NDArray[Any], each: int, missing: float) -> NDArray[Any]:
    """Values (K, ...) as (each, ...)."""
    return np.concatenate([values, np.full((each - len(values), *values.shape[1:]), missing, values.dtype)])


def _slots(people: Table, frames: int, joints: int) -> tuple[Floats, Ints]:
    """Tracks side by side, those that are not there at one time in one slot: (K, F, J, 3) u, v, score, track (K, F)."""
    frame, track = (people[key].reshape(-1, joints)[:, 0] for key in ("frame", "track"))
    values = np.stack([people[key].reshape(-1, joints) for key in ("u", "v", "score")], axis=-1)
    slots, whose = np.full((MOST, frames, joints, 3), np.nan), np.full((MOST, frames), -1)
    numbers, lengths = np.unique(track, return_counts=True)
    for number in numbers[np.argsort(-lengths, kind="stable")].tolist():
        rows = np.flatnonzero(track == number)
        span = slice(int(frame[rows].min()), int(frame[rows].max()) + 1)
        free = np.flatnonzero((whose[:, span] < 0).all(axis=1))
        if len(free):
            slots[free[0], frame[rows]] = values[rows]
            whose[free[0], frame[rows]] = number
    most = int((whose >= 0).any(axis=1).sum())
    return slots[:most], whose[:most]


def picked(seen: Seen, choice: Choice) -> tuple[Floats, Floats]:
    """Pixels (V, T, J, 2) and scores (V, T, J) of the chosen people, NaN and 0 where there is none."""
    return of_picked(seen, np.where(choice.state == OWN, choice.pick, -1))


def of_picked(seen: Seen, pick: Ints) -> tuple[Floats, Floats]:
    """The same of the people at the places `pick` (V, T), -1 for none."""
    at = np.maximum(pick, 0)[:, None, :, None]
    none = pick < 0
    score = np.where(none[..., None], 0.0, np.take_along_axis(seen.score, at, axis=1)[:, 0])
    uv = np.take_along_axis(seen.uv, at[..., None], axis=1)[:, 0]
    return np.where(none[..., None, None], np.nan, uv), score


def of_subject(
    detections: Table, everybody: Table | None, seen: Seen, choice: Choice | None, cameras: Sequence[str], frames: Ints
) -> Table:
    """The table `detections` with the chosen people, nobody where none is the subject; `frames` (V, T)."""
    if choice is None:
        return detections
    out = {key: values.copy() for key, values in detections.items()}
    joints = len(seen.names)
    for view, name in enumerate(cameras):
        rows = np.flatnonzero(detections["camera"] == name).reshape(-1, joints)
        here = np.flatnonzero(frames[view] >= 0)
        at = np.searchsorted(frames[view, here], np.arange(len(rows))).clip(max=len(here) - 1)
        pick = np.where(choice.state == OWN, choice.pick[view], -1)
        chosen = np.where(pick >= 0, seen.track[view, np.maximum(pick, 0), np.arange(len(pick))], -1)
        wanted = chosen[here[at]] if len(here) else np.full(len(rows), -1)
        mine = None if everybody is None else tables.of_camera(everybody, name)
        # one body only: its rows are there already
        several = mine is not None and len(mine["frame"]) > 0
        lost = (rows if several else rows[wanted < 0]).ravel()
        out["person"][lost] = -1
        for key in ("u", "v", "score"):
            out[key][lost] = np.nan
        if mine is not None and several:
            keep = np.flatnonzero(wanted[mine["frame"]] == mine["track"])
            to = rows[mine["frame"][keep], keep % joints]
            for key in ("person", "u", "v", "score"):
                out[key][to] = mine[key][keep]
    return out


def seeds_of(path: AnyPath | None, seen: Seen, cameras: Sequence[str], frames: Ints) -> list[Seed]:
    """The `Seed`s of a file; `frames` (V, T): each instant's picture.

    Raises DiorError for a camera that is no close one, a picture that is none, and a point at which nobody is.
    """
    if path is None:
        return []
    out = []
    for number, seed in enumerate(schema_check.check(schema_check.read_yaml(path), "people", path)["seeds"], 1):
        where = f"{path}: seed {number}"
        if seed["camera"] not in cameras:
            known = ", ".join(cameras)
            raise DiorError(
                f"{where}: '{seed['camera']}' is not one of the close cameras {known}{nearest(seed['camera'], cameras)}"
            )
        view = list(cameras).index(seed["camera"])
        here = np.flatnonzero(frames[view] >= 0)
        if not len(here) or not frames[view, here].min() <= seed["frame"] <= frames[view, here].max():
            last = f"{frames[view, here].min()} to {frames[view, here].max()}" if len(here) else "none"
            raise DiorError(f"{where}: {seed['camera']} has no frame {seed['frame']} at any instant, but {last}")
        t = int(here[np.abs(frames[view, here] - seed["frame"]).argmin()])
        uv, there = seen.uv[view, :, t], seen.score[view, :, t] > 0
        size = people_seen.sizes(uv, there)
        off = np.linalg.norm(uv - (seed["u"], seed["v"]), axis=-1)
        off = np.where(there, off, np.inf).min(axis=1)
        near = np.where(np.isfinite(size), off / size, np.inf)
        if near.min() > POINTED:
            raise DiorError(
                f"{where}: nobody was detected near ({seed['u']:g}, {seed['v']:g}) in frame {seed['frame']} of "
                f"{seed['camera']}; point at the middle of the subject in a picture in which the detector found them"
            )
        out.append(Seed(view, t, int(near.argmin())))
    return out


def findings(
    sequence: str, choice: Choice, cameras: Sequence[str], frames: Ints, fps: float, measured: bool
) -> list[tuple[str, str, str, str]]:
    """What is to be said of a `Choice`; `frames` (V, T), `measured`: the subject's height is known."""
    out = []
    file = f"config/people/{sequence}.yaml"
    for state, code, sentence in (
        (STRANGER, "somebody_else", "only somebody else is seen, so that nothing is labelled (rejected)"),
        (UNDECIDED, "who_is_subject", "it cannot be told who is the subject, so that nothing is labelled (suspect)"),
    ):
        found = [one for one in choice.stretches if one.state == state]
        worth = [one for one in found if state == UNDECIDED or one.last - one.first + 1 >= SHORT_S * fps]
        if not worth:
            continue
        worth.sort(key=lambda one: one.first - one.last)
        shown = "; ".join(
            _stretch(one.first, one.last, one.off_m, one.taller_m, cameras, frames) for one in worth[:SAID]
        )
        more = f" and {len(worth) - SAID} shorter stretches" if len(worth) > SAID else ""
        view, t = _picture(worth[0].first, worth[0].last, frames)
        if state == UNDECIDED:
            height = "" if measured else "enter height_m in config/subjects.tsv, or "
            advice = f"{height}point at the subject"
        else:
            advice = "if that is the subject, point at them"
        text = (
            f"{shown}{more}: {sentence}; {advice} on the page Who of `dior studio`, or in {file}, such as "
            f"`seeds: [{{camera: {cameras[view]}, frame: {frames[view, t]}, u: <u>, v: <v>}}]` with the pixel of their "
            "middle"
        )
        out.append((sequence, "warning", code, text))
    if not any(one.state == UNDECIDED for one in choice.stretches):
        text = f"{choice.people} people were followed in the close cameras; one of them is the subject throughout"
        out.append((sequence, "info", "others_told_apart", text))
    return out


def _picture(first: int, last: int, frames: Ints) -> tuple[int, int]:
    """A view and an instant near the middle of a stretch that have a picture."""
    there = np.argwhere(frames[:, first : last + 1] >= 0)
    if not len(there):
        return 0, first
    view, t = there[np.abs(there[:, 1] - (last - first) / 2).argmin()]
    return int(view), int(t) + first


def _stretch(first: int, last: int, off_m: float, taller_m: float, cameras: Sequence[str], frames: Ints) -> str:
    view, _ = _picture(first, last, frames)
    there = frames[view, first : last + 1]
    there = there[there >= 0]
    text = f"frames {there.min()} to {there.max()} of {cameras[view]}" if len(there) else f"instants {first} to {last}"
    if np.isfinite(off_m):
        text += f", {off_m:.2f} m from the subject"
        if np.isfinite(taller_m):
            text += f" and {100 * abs(taller_m):.0f} cm {'taller' if taller_m > 0 else 'smaller'}"
    return text
