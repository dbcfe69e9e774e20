"""Detections of Google's ML Kit (BlazePose) as JSON lines, one per picture.

INPUTS   {"frame", "stamp_ns", "landmarks": [{"type", "x", "y", "z", "inFrameLikelihood"}]}; pixels; `landmarks: []` is
         nobody, a missing line is a picture that the detector never saw. ML Kit finds one person at most. Where no
         line has a "frame", the stamps tell the picture.
OUTPUTS  `People` with the joints `skeletons.MLKIT_33`.
"""

from array import array
from itertools import chain
from typing import Annotated, Any

import msgspec
import numpy as np

from dior.arrays import AnyPath, Floats
from dior.body.names import MLKIT_33
from dior.errors import DiorError
from dior.formats import DetectionFormat, Sample
from dior.ingest.people import People, gathered
from dior.ingest.readers.common import from_json, number
from dior.project.plain_text import unmarked

KEYS = ("x", "y", "inFrameLikelihood")
# chosen: some hundred lines are decoded at a time
BLOCK_BYTES = 1 << 18
DESCRIPTIONS = (
    DetectionFormat(
        key="mlkit",
        tool="ML Kit, JSON lines",
        file="a file",
        joints="33",
        frame="`frame`, or else `stamp_ns`",
        score="`inFrameLikelihood`",
        nobody="`landmarks: []`; a missing line: not run",
        refused="a line that is no JSON; `frame` in some lines only; a frame twice; a `type` that is not 0 to 32, or "
        "twice in a line",
        samples=(
            Sample(
                "ML Kit JSON lines",
                "4 cameras x 100 frames x 33 landmarks, all of them",
                "real: BlazePose run on Pose2Sim's demo session, `real_outdoor/mlkit`",
            ),
        ),
    ),
)


class _Landmark(msgspec.Struct, gc=False):
    type: Annotated[int, msgspec.Meta(ge=0, lt=len(MLKIT_33))]
    x: float = np.nan
    y: float = np.nan
    inFrameLikelihood: float = np.nan


class _Picture(msgspec.Struct, gc=False):
    landmarks: list[_Landmark]
    frame: int | None = None
    stamp_ns: Annotated[int, msgspec.Meta(ge=-(2**63), le=2**63 - 1)] = -1


_LINES = msgspec.json.Decoder(_Picture)


def read(path: AnyPath) -> People:
    """All detections of the file. Raises DiorError for lines that are no such JSON and for a frame given twice.

    Lines that are exactly as ML Kit's are decoded many at a time; where one of them is not (it may hold null or NaN, or
    be broken), each is looked at by itself, so that an error can say which line it is.
    """
    frame: list[Any] = []
    stamp_ns: list[int] = []
    points: list[Floats] = []
    before = 0
    with open(path, "rb") as stream:
        # whole lines
        while text := stream.read(BLOCK_BYTES) + stream.readline():
            text = text if before else unmarked(text, path)
            try:
                block = _columns(_numbered(_LINES.decode_lines(text)))
            except (msgspec.MsgspecError, RecursionError):
                block = _strictly(text.split(b"\n"), path, before)
            frame += block[0]
            stamp_ns += block[1]
            points.append(block[2])
            before += text.count(b"\n")
    if not frame:
        raise DiorError(f"{path} is empty; run the detector")
    if 0 < frame.count(None) < len(frame):
        raise DiorError(f"{path}: some lines have a 'frame' and others have none; write it with each")
    by_stamp = frame[0] is None
    frame = list(range(len(frame))) if by_stamp else frame
    return gathered(path, MLKIT_33, frame, np.concatenate(points), frame, stamp_ns, by_stamp)


def _numbered(pictures: list[_Picture]) -> list[_Picture]:
    """The same. Raises MsgspecError where one has neither frame nor stamp, or where not all have what one has."""
    without = sum(picture.frame is None for picture in pictures)
    if without and (without < len(pictures) or any(picture.stamp_ns < 0 for picture in pictures)):
        raise msgspec.ValidationError
    return pictures


def _columns(pictures: list[_Picture]) -> tuple[list[Any], list[int], Floats]:
    """(frames, stamps, points) of decoded lines. Raises MsgspecError for a landmark that is twice in one of them."""
    landmarks = list(chain.from_iterable([picture.landmarks for picture in pictures]))
    row = np.repeat(np.arange(len(pictures)), [len(picture.landmarks) for picture in pictures])
    kind = np.array([one.type for one in landmarks], int)
    if np.bincount(row * len(MLKIT_33) + kind, minlength=1).max() > 1:
        raise msgspec.ValidationError
    points = np.full((len(pictures), len(MLKIT_33), 3), np.nan)
    # a list of attributes goes into an array.array several times as fast as numpy takes it
    points[row, kind, 0] = array("d", [one.x for one in landmarks])
    points[row, kind, 1] = array("d", [one.y for one in landmarks])
    points[row, kind, 2] = array("d", [one.inFrameLikelihood for one in landmarks])
    return [picture.frame for picture in pictures], [picture.stamp_ns for picture in pictures], points


def _strictly(lines: list[bytes], path: AnyPath, before: int) -> tuple[list[Any], list[int], Floats]:
    """(frames, stamps, points) of lines, `before` of which came before them. Raises DiorError that names the line."""
    frames: list[Any] = []
    stamps: list[int] = []
    points: list[Floats] = []
    for count, line in enumerate(lines, before + 1):
        if not line.strip():
            continue
        where = f"{path}: line {count}"
        content = from_json(line, where, "ML Kit")
        keys = content.keys() if isinstance(content, dict) else ()
        # no frame is needed where every line before had a stamp instead
        by_stamp = "stamp_ns" in keys and not any(number is not None for number in frames)
        for key in ("landmarks",) if by_stamp else ("frame", "landmarks"):
            if key not in keys:
                raise DiorError(f"{where} has no '{key}'")
        try:
            # a number that is not whole is found out with the frames of all lines
            stamp = content.get("stamp_ns")
            stamps.append(-1 if stamp is None else int(np.int64(stamp + 0)))
            frames.append(content.get("frame"))
            points.append(_landmarks(content["landmarks"], where))
        except (TypeError, AttributeError, KeyError, OverflowError, ValueError) as error:
            raise DiorError(f"{where} is no picture's landmarks as ML Kit writes them ({error!r:.80})") from None
    return frames, stamps, np.array(points).reshape(-1, len(MLKIT_33), 3)


def _landmarks(landmarks: Any, where: str) -> Floats:
    points = np.full((len(MLKIT_33), 3), np.nan)
    if not isinstance(landmarks, list):
        raise TypeError(f"landmarks {landmarks!r:.40}")
    there: set[int] = set()
    for one in landmarks:
        kind = one.get("type")
        if isinstance(kind, bool) or not isinstance(kind, int) or not 0 <= kind < len(MLKIT_33):
            raise DiorError(f"{where} has a landmark whose type is not 0 to {len(MLKIT_33) - 1}")
        if kind in there:
            raise DiorError(f"{where} has the type {kind} twice; ML Kit finds one person, so are two in the line?")
        there.add(kind)
        points[kind] = [number(one.get(key)) for key in KEYS]
    return points
