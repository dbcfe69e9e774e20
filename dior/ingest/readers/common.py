"""What several readers need: the frame in a file's name, JSON that is complete, keypoint lists as numbers."""

import json
import math
import os
import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from dior.arrays import AnyPath, Floats
from dior.body.names import BY_COUNT
from dior.errors import DiorError
from dior.project.plain_text import unmarked

INTERRUPTED = "was the detector interrupted?"
# the names of the classes, which labelling tools write beside the rows of YOLO
BESIDE = ("classes.txt",)
_LAST_NUMBER = re.compile(r"([0-9]{1,18})[^0-9]*$")


def frame_of(name: str, where: str) -> int:
    """The last number in a file's name, its extension apart: `run2_000012_keypoints.json` is frame 12.

    Raises DiorError for a name without one.
    """
    found = _number_in(name)
    if not found:
        raise DiorError(f"{where}: the file name holds no frame number")
    return int(found[1])


def _number_in(name: str) -> re.Match[str] | None:
    return _LAST_NUMBER.search(name.rpartition(".")[0] or name)


def names_in(folder: AnyPath, suffixes: str | tuple[str, ...]) -> list[str]:
    """Names of the folder's files with one of `suffixes` in any case, sorted; none that is hidden, as the `._*` that
    macOS writes beside others, nor of BESIDE. Where some are numbered only these: the others are of no picture."""
    found = [
        name
        for name in sorted(os.listdir(folder))
        if name.lower().endswith(suffixes) and not name.startswith(".") and name.lower() not in BESIDE
    ]
    return [name for name in found if _number_in(name)] or found


def files_by_frame(folder: AnyPath, suffixes: str | tuple[str, ...]) -> dict[int, str]:
    """Names of the folder's files with one of `suffixes`, by frame, ascending. Raises DiorError for a frame twice."""
    found: dict[int, str] = {}
    for name in names_in(folder, suffixes):
        frame = frame_of(name, f"{folder}/{name}")
        if frame in found:
            raise DiorError(f"{folder}: {found[frame]} and {name} are both frame {frame}")
        found[frame] = name
    return dict(sorted(found.items()))


def content_of(path: AnyPath) -> bytes:
    """What a file holds, without a byte order mark. Raises DiorError for UTF-16."""
    with open(path, "rb") as stream:
        return unmarked(stream.read(), path)


def load_json(path: AnyPath, what: str) -> Any:
    """The JSON of a whole file. Raises DiorError where it is none; `what` it should be is for the message."""
    return from_json(content_of(path), path, what)


def from_json(text: bytes, where: AnyPath, what: str) -> Any:
    """The content of JSON `text` (bytes). Raises DiorError where it is none."""
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:
        reason = "it is nested too deeply" if isinstance(error, RecursionError) else error
        raise DiorError(f"{where}: not the JSON of {what} ({reason}); {INTERRUPTED}") from None


def number(value: Any) -> float:
    """A number as float; NaN for null. Raises TypeError for anything else, true and false included."""
    if value is None:
        return math.nan
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise TypeError(f"{value!r:.40} is no number")
    return float(value)


def triples(flat: Any, where: str) -> Floats:
    """A flat list x, y, score, x, ... as an array (J, 3), (0, 0, any) as NaN. Raises DiorError for anything else."""
    try:
        points = np.array([number(value) for value in flat], float)
    except (TypeError, OverflowError) as error:
        raise DiorError(f"{where}: the keypoints are no list of numbers ({error})") from None
    if len(points) % 3 or len(points) // 3 not in BY_COUNT:
        raise DiorError(
            f"{where}: {len(points)} numbers per person, which is not 3 x {', '.join(map(str, sorted(BY_COUNT)))}"
        )
    points = points.reshape(-1, 3)
    points[(points[:, :2] == 0).all(axis=1)] = np.nan
    return points


def points_of(uv: Any, scores: Any, where: str) -> Floats:
    """Pairs x, y and their scores (None: all 1) as an array (J, 3), (0, 0) as NaN. Raises DiorError for others."""
    try:
        points = np.array([[number(u), number(v), 1.0] for u, v in uv], float).reshape(-1, 3)
        if scores is not None:
            points[:, 2] = [number(score) for score in scores]
    except (TypeError, ValueError, OverflowError) as error:
        raise DiorError(f"{where}: the keypoints are no pairs of numbers with a score each ({error})") from None
    points[(points[:, :2] == 0).all(axis=1)] = np.nan
    return points


def one_model(people: Sequence[Floats], where: AnyPath) -> Floats:
    """Arrays (J, 3) of people as one (P, J, 3). Raises DiorError where they differ in length."""
    counts = sorted({len(one) for one in people})
    if len(counts) > 1:
        raise DiorError(f"{where}: people of {counts[0]} and of {counts[1]} keypoints; a file must be of one model")
    return np.stack(people)
