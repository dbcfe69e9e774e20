"""Hand-drawn boxes around the person in a long-range picture.

INPUTS   `boxes/<sequence>.<camera>.csv`: `frame,u_min,v_min,u_max,v_max`, px, and where several people drew, `drawer`.
         A row with no edge is no box: where it names a drawer, nobody was seen by them; where it does not, it is one of
         `to_mark` that is not drawn yet, or one where nobody is seen.
OUTPUT   frames and edges; which of them are kept back: no step that fits anything to boxes uses those, so that they may
         judge what came of it; in which fit each of the others is left out; recorded px

The boxes of the drawer who is named first are the ones that steps use; those of the others only judge.
"""

import hashlib
from pathlib import Path
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dior.arrays import AnyPath, Bools, Floats, Ints
from dior.errors import DiorError, Faults, nearest
from dior.project.pixels import in_picture
from dior.project.plain_text import rows_of

# no picture is this large
FAR_PX = 1e6
COLUMNS = ("frame", "u_min", "v_min", "u_max", "v_max")
DRAWER = "drawer"  # a further column, which may be there
# frames (B,) and edges (B, 4) px of boxes
Boxes: TypeAlias = tuple[Ints, Floats]
# width and height px of pictures
Size: TypeAlias = tuple[int, int]
NONE: Boxes = (np.zeros(0, np.int64), np.zeros((0, 4)))
# chosen: one box in so many is kept back, and none where a sequence has fewer than so many of a camera
ONE_IN, FEWEST = 5, 15
FOLDS = 5  # chosen: fits in which a part of the boxes is left out; each has four fifths of them
# chosen: edges are drawn at something that stands with an sd of 1 px at most, or else with the sd that they show; of a
# hundred boxes none is further off than `OFF_LINE` of these, and fewer than `SEVERAL` that are were drawn amiss
NEAR_LINE_PX, OFF_LINE, SEVERAL = 3.0, 4.0, 3


def read(path: AnyPath, frames: ArrayLike, size: Size | None = None) -> Boxes:
    """Boxes as frames (B,) and edges (B, 4) px in the order u_min, v_min, u_max, v_max, sorted by frame: those of the
    drawer who is named first. As `read_drawers`.
    """
    return next(iter(read_drawers(path, frames, size).values()), NONE)


def read_drawers(path: AnyPath, frames: ArrayLike, size: Size | None = None) -> dict[str, Boxes]:
    """By drawer, in the order of their first boxes, frames (B,) and edges (B, 4) px sorted by frame; "" is one of whom
    no name is given.

    `frames`: the frames of the recording, `size` of its pictures, where they are known. Raises DiorError for all rows
    together, naming file and line: malformed, a box that is inside out, has no area or lies beside the picture, a frame
    that the recording does not have, a second box of one frame by the same drawer, a drawer who is written in two ways.
    """
    path = Path(path)
    lines = rows_of(path, path)
    if not lines:
        raise DiorError(f"{path}: is empty; its first line must be '{','.join(COLUMNS)}'")
    header = tuple(lines[0][1])
    if header not in (COLUMNS, (*COLUMNS, DRAWER)):
        allowed = (*COLUMNS, DRAWER)
        wrong = next((f", not '{word}'{nearest(word, allowed)}" for word in header if word not in allowed), "")
        raise DiorError(f"{path}: the first line must be '{','.join(COLUMNS)}', and '{DRAWER}' may follow{wrong}")
    known = set(np.asarray(frames).tolist())
    drawn: dict[str, dict[int, list[float]]] = {}
    spelt: dict[str, str] = {}
    faults = Faults()
    for number, words in lines[1:]:
        where = f"{path}, line {number}"
        with faults.kept():
            box = _row(words, header, where)
            if box is None:
                continue
            frame, edges = box
            if frame not in known:
                raise DiorError(
                    f"{where}: frame {frame} is not in the recording, whose frames are "
                    f"{min(known, default=0)} to {max(known, default=-1)}; frames count from 0"
                )
            if size:
                _check_beside(edges, size, where)
            drawer = words[-1] if DRAWER in header else ""
            first = spelt.setdefault(drawer.casefold(), drawer)
            if first != drawer:
                raise DiorError(
                    f"{where}: the drawers '{first}' and '{drawer}' differ by capitals alone; write one person in one "
                    "way"
                )
            boxes = drawn.setdefault(drawer, {})
            if frame in boxes:
                by = f" of drawer '{drawer}'" if drawer else ""
                raise DiorError(
                    f"{where}: frame {frame} has a second box{by}; keep the one of the subject, or name in the column "
                    f"'{DRAWER}' who drew which"
                )
            boxes[frame] = edges
    faults.tell()
    return {drawer: _sorted(boxes) for drawer, boxes in drawn.items()}


def without_edges(path: AnyPath) -> dict[str, list[int]]:
    """By drawer, "" where none is named, the frames of the rows that have no edge, ascending; of a file that
    `read_drawers` reads."""
    lines = rows_of(path, path)
    found: dict[str, set[int]] = {}
    for _, words in lines[1:]:
        if not any(words[1 : len(COLUMNS)]) and words[0].isdecimal():
            found.setdefault(words[-1] if DRAWER in lines[0][1] else "", set()).add(int(words[0]))
    return {drawer: sorted(frames) for drawer, frames in found.items()}


def _check_beside(edges: list[float], size: Size, where: str) -> None:
    """A box may stick out of the picture, but nobody sees a body most of which is outside."""
    middle = (np.array(edges[:2]) + edges[2:]) / 2
    if not in_picture(middle, *size):
        raise DiorError(
            f"{where}: the middle of the box, ({middle[0]:g}, {middle[1]:g}), is outside of the {size[0]}x{size[1]} "
            "picture; was it drawn in pictures of another size?"
        )


def _sorted(boxes: dict[int, list[float]]) -> Boxes:
    ordered = sorted(boxes)
    return np.array(ordered, np.int64), np.array([boxes[f] for f in ordered], float).reshape(-1, 4)


def line_of(edges: Floats) -> float:
    """Where (px) something that hides a part of everybody ends, by the edges (B,) px towards it; NaN of none."""
    there = edges[np.isfinite(edges)]
    return float(np.median(there)) if len(there) else np.nan


def at_line(edges: Floats, line: float) -> Bools:
    """Which edges (B,) px are those of what hides a part of the body at `line`, and not the body's own."""
    off = np.abs(edges - line)
    near, wider = 0.0, NEAR_LINE_PX
    while wider > near:
        near, there = wider, off <= wider
        wider = OFF_LINE * float(np.sqrt((off[there] ** 2).mean())) if there.any() else 0.0
    drawn = np.isfinite(off)
    return drawn if (drawn & ~there).sum() < SEVERAL else there


def kept_back(frames: ArrayLike) -> Bools:
    """Which of the boxes of one sequence and camera, by their `frames` (B,), judge and are not fitted to: (B,) bool.

    By a hash of the frame's number, so that a box that is added or taken away changes nothing about the others.
    """
    numbers = np.asarray(frames)
    if len(numbers) < FEWEST:
        return np.zeros(len(numbers), bool)
    return _lots(numbers) % ONE_IN == 0


def folds(frames: ArrayLike) -> Ints:
    """In which of FOLDS fits each of the boxes of one sequence and camera, by their `frames` (B,), is left out: (B,).

    By the order of the same hashes, so that the parts are equal.
    """
    return np.argsort(np.argsort(_lots(np.asarray(frames)))) % FOLDS


def _lots(frames: Ints) -> NDArray[np.uint64]:
    digests = (hashlib.sha256(f"kept back {number}".encode()).digest() for number in frames.tolist())
    return np.array([int.from_bytes(digest[:8], "big") for digest in digests], np.uint64)


def _row(words: list[str], header: tuple[str, ...], where: str) -> tuple[int, list[float]] | None:
    if len(words) != len(header):
        raise DiorError(f"{where}: has {len(words)} values, not the {len(header)} of '{','.join(header)}'")
    words = words[: len(COLUMNS)]
    if not any(words[1:]):
        return None
    try:
        frame, edges = int(words[0]), [float(word) for word in words[1:]]
    except ValueError:
        raise DiorError(f"{where}: '{','.join(words):.80}' is not a whole frame number and four numbers") from None
    if not all(abs(edge) <= FAR_PX for edge in edges):
        raise DiorError(f"{where}: an edge of the box at {','.join(words[1:])} is in no picture")
    u_min, v_min, u_max, v_max = edges
    if u_min == u_max or v_min == v_max:
        raise DiorError(f"{where}: the box has no area (u {u_min} to {u_max}, v {v_min} to {v_max}); draw it again")
    if u_min > u_max or v_min > v_max:
        raise DiorError(f"{where}: the box is inside out (u_min {u_min} u_max {u_max}, v_min {v_min} v_max {v_max})")
    return frame, edges
