"""Hand-drawn boxes around the person in a long-range picture.

INPUTS   `boxes/<sequence>.<camera>.csv`: `frame,u_min,v_min,u_max,v_max`, px. A row with nothing but a frame is one of
         `to_mark` that is not drawn yet, or where nobody is seen: no box.
OUTPUT   frames and edges; which of them are kept back: no step that fits anything to boxes uses those, so that they may
         judge what came of it; recorded px
"""

import hashlib
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from dior.arrays import AnyPath, Bools, Floats, Ints
from dior.errors import DiorError, nearest
from dior.project.plain_text import rows_of

# no picture is this large
FAR_PX = 1e6
COLUMNS = ("frame", "u_min", "v_min", "u_max", "v_max")
# chosen: one box in so many is kept back, and none where a sequence has fewer than so many of a camera
ONE_IN, FEWEST = 5, 15
NEAR_LINE_PX = 3.0  # chosen: edges drawn at something that stands, sd 1 px; 3 in 1000 are further off


def read(path: AnyPath, frames: ArrayLike) -> tuple[Ints, Floats]:
    """Boxes as frames (B,) and edges (B, 4) px in the order u_min, v_min, u_max, v_max, sorted by frame.

    `frames`: the frames of the recording. Raises DiorError, naming file and line, for a malformed row, a box that is
    inside out, a frame that the recording does not have and a second box of one frame.
    """
    path = Path(path)
    lines = rows_of(path, path)
    if not lines:
        raise DiorError(f"{path}: is empty; its first line must be '{','.join(COLUMNS)}'")
    header = lines[0][1]
    if tuple(header) != COLUMNS:
        wrong = next((f", not '{word}'{nearest(word, COLUMNS)}" for word in header if word not in COLUMNS), "")
        raise DiorError(f"{path}: the first line must be '{','.join(COLUMNS)}'{wrong}")
    known = set(np.asarray(frames).tolist())
    boxes: dict[int, list[float]] = {}
    for number, words in lines[1:]:
        where = f"{path}, line {number}"
        box = _row(words, where)
        if box is None:
            continue
        frame, edges = box
        if frame not in known:
            raise DiorError(
                f"{where}: frame {frame} is not in the recording, whose frames are "
                f"{min(known, default=0)} to {max(known, default=-1)}; frames count from 0"
            )
        if frame in boxes:
            raise DiorError(f"{where}: frame {frame} has a second box; keep the one of the subject")
        boxes[frame] = edges
    ordered = sorted(boxes)
    return np.array(ordered, np.int64), np.array([boxes[f] for f in ordered], float).reshape(-1, 4)


def line_of(edges: Floats) -> float:
    """Where (px) something that hides a part of everybody ends, by the edges (B,) px of boxes towards it."""
    return float(np.nanmedian(edges))


def at_line(edges: Floats, line: float) -> Bools:
    """Which edges (B,) px are those of what hides a part of the body at `line`, and not the body's own."""
    return np.abs(edges - line) <= NEAR_LINE_PX


def kept_back(frames: ArrayLike) -> Bools:
    """Which of the boxes of one sequence and camera, by their `frames` (B,), judge and are not fitted to: (B,) bool.

    By a hash of the frame's number, so that a box that is added or taken away changes nothing about the others.
    """
    numbers = np.asarray(frames).tolist()
    if len(numbers) < FEWEST:
        return np.zeros(len(numbers), bool)
    digests = (hashlib.sha256(f"kept back {number}".encode()).digest() for number in numbers)
    return np.array([int.from_bytes(digest[:8], "big") % ONE_IN == 0 for digest in digests])


def _row(words: list[str], where: str) -> tuple[int, list[float]] | None:
    if len(words) != len(COLUMNS):
        raise DiorError(f"{where}: has {len(words)} values, not the {len(COLUMNS)} of '{','.join(COLUMNS)}'")
    if not any(words[1:]):
        return None
    try:
        frame, edges = int(words[0]), [float(word) for word in words[1:]]
    except ValueError:
        raise DiorError(f"{where}: '{','.join(words):.80}' is not a whole frame number and four numbers") from None
    if not all(abs(edge) <= FAR_PX for edge in edges):
        raise DiorError(f"{where}: an edge of the box at {','.join(words[1:])} is in no picture")
    u_min, v_min, u_max, v_max = edges
    if u_min > u_max or v_min > v_max:
        raise DiorError(f"{where}: the box is inside out (u_min {u_min} u_max {u_max}, v_min {v_min} v_max {v_max})")
    return frame, edges
