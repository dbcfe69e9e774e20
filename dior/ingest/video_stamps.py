"""When the pictures of a video were taken: by a CSV file beside it, else by the video's own times from its start on.

INPUTS   `videos.VideoIndex`; a CSV file with stamps where there is one
OUTPUTS  `VideoStamps`: stamps (ns since the Unix epoch) with how well their start is known
Layouts of the CSV, known by the header:

- `frame,stamp_ns`: frame from 0 as shown, ns since the Unix epoch. It may name a few frames, one at least: the others
  are by the video's times between and beside these;
- caliscope (0.11.8, caliscope/recording/synchronized_timestamps.py): `cam_id,frame_time`, before that `port`; seconds
  of all cameras, whose n-th is frame n. The camera is the number in the video's name (cam_1.mp4);
- FreeMoCap (skellycam, commit 95012c6, .../timestamps/camera_timestamps/*.timestamps.csv): `recording_frame_number`
  and `timestamp.utc.seconds` of one camera; before that (skellycam 2025.9.1097, skellycam/opencv/video_recorder) a
  column without a name and one called 0, in ns.

Seconds that cannot be since 1970 (a computer's uptime) count from `NO_DATE_NS`. Times in coarse steps (Matroska: 1 ms)
that are those of a regular rate, rounded, are put back onto it.
"""

import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from decimal import Decimal
from pathlib import Path

import numpy as np

from dior.arrays import AnyPath, Ints
from dior.errors import DiorError
from dior.ingest.stamps import JUMP_NS, MOST_OUT_OF_ORDER
from dior.ingest.videos import VideoIndex
from dior.project.plain_text import check_delimiter, each_row

# chosen: of a step, more than half of which no rounding is off
MOST_ROUNDED = 0.55
# where a recording begins of which nothing says when it was made: the first of January 2000, UTC
NO_DATE_NS = 946_684_800 * 10**9
# chosen: three years; no computer runs that long, and nobody recorded in 1973
LONGEST_UPTIME_NS = 10**8 * 10**9
# chosen: the years 2010 to 2040
DATES_NS = (1_262_304_000 * 10**9, 2_208_988_800 * 10**9)
# chosen: a file's time of creation is in whole seconds, and a recorder takes its time between the file and a picture
CREATED_SIGMA_S = 1.0
# chosen: recorders that people start one after the other
NO_START_SIGMA_S = 5.0
# chosen: half an hour of pictures of a dozen cameras
MOST_BYTES = 1 << 27
# columns of a frame's number, of its time, what the time is in, and the column of the camera
LAYOUTS = (
    ("frame", "stamp_ns", "ns", ""),
    ("", "frame_time", "s", "cam_id"),
    ("", "frame_time", "s", "port"),
    ("recording_frame_number", "timestamp.utc.seconds", "s", ""),
)
OLD_SKELLYCAM = ["", "0"]
# what a time may be in, of 1 ns
UNITS = {"ns": 1, "us": 10**3, "ms": 10**6, "s": 10**9}
# chosen: crystals are off by far less, and the next setting of a camera (24, 30, 50 or 60 Hz) is rarely nearer
MOST_RATE_RATIO = 1.5
# chosen: pictures per second that no camera takes of a walker, and below which a unit is believed
LEAST_HZ, MOST_HZ, USUAL_HZ = 0.1, 10_000.0, 1000.0
INT64_MAX = (1 << 63) - 1
FROM_0 = "frames count from 0, the first picture being frame 0"


@dataclass(frozen=True, eq=False)
class VideoStamps:
    """Stamps (F,) ns of a video's pictures.

    `sigma_s`: of one against the others, by the step of the video's time; `start_sigma_s`: of all of them together, and
    `apart_sigma_s` of that against other cameras'; `source`: what the start is by, sidecar, created, sound, flash or
    none; `undated`: the start is an arbitrary one; `note`: what a person should look at in the file with stamps.
    """

    stamp_ns: Ints
    sigma_s: float
    start_sigma_s: float
    apart_sigma_s: float
    source: str
    undated: bool = False
    note: str = ""

    def later(self, by_ns: int) -> "VideoStamps":
        """The same, all of them moved."""
        return replace(self, stamp_ns=self.stamp_ns + by_ns)


@dataclass(frozen=True)
class Sidecar:
    """Stamps (ns) by frame, from the column `time` in `unit`; `by_place`: the file numbers no frames, its n-th row is
    frame n."""

    stamp_ns: dict[int, int]
    time: str = "stamp_ns"
    unit: str = "ns"
    by_place: bool = False


def stamps_of(
    index: VideoIndex, sidecar: Sidecar | None, where: str, what: str = "video", timed: str = "the video"
) -> VideoStamps:
    """`VideoStamps` of the pictures of `index`, those of a video or a folder, `what`; `timed`: who says when they were
    shown, empty where nobody does.

    Raises DiorError, beginning with `where`, for a sidecar of another recording, of another unit or counted from 1.
    """
    regular_ns = regular(index.pts_ns, 1e9 * index.tick_s)
    if regular_ns is not None:
        index = replace(index, pts_ns=regular_ns, tick_s=0.0)
    # a time is rounded to its step
    tick_s = index.tick_s / 12**0.5
    if sidecar is None:
        known = index.created_ns is not None
        start_ns = (index.created_ns if known else NO_DATE_NS) or 0
        sigma_s, source = (CREATED_SIGMA_S, "created") if known else (NO_START_SIGMA_S, "none")
        return VideoStamps(start_ns + index.pts_ns - index.pts_ns[0], tick_s, sigma_s, sigma_s, source, not known)
    given = sidecar.stamp_ns
    note = _check_frames(sidecar, len(index.pts_ns) + len(index.lost), where, what)
    whole = np.array([given.get(int(number), -1) for number in index.number], np.int64)
    _check_rate(index, whole, sidecar, where, timed)
    if (whole >= 0).all():
        return VideoStamps(whole, 0.0, 0.0, 0.0, "sidecar")
    at = np.flatnonzero(whole >= 0)
    if not len(at):
        raise DiorError(f"{where} names none of the video's pictures that can be read")
    first = whole[at[0]] - index.pts_ns[at[0]]
    # as whole numbers: the ns since 1970 are too many for a float
    off = np.interp(index.pts_ns, index.pts_ns[at], (whole[at] - index.pts_ns[at] - first).astype(float))
    return VideoStamps(index.pts_ns + first + np.rint(off).astype(np.int64), tick_s, 0.0, 0.0, "sidecar", note=note)


def _check_frames(sidecar: Sidecar, count: int, where: str, what: str) -> str:
    """What a person should look at in the frames that a sidecar names of `count` pictures. Raises DiorError where they
    are none of these."""
    frames = sorted(sidecar.stamp_ns)
    if sidecar.by_place and len(frames) != count:
        raise DiorError(
            f"{where} has {len(frames)} stamps, and the {what} has {count} pictures; a row of such a file "
            "is told by its place alone; is it of another one? Else write frame,stamp_ns"
        )
    from_1 = len(frames) > 1 and frames == list(range(1, len(frames) + 1))
    if from_1:
        raise DiorError(
            f"{where} names the frames 1 to {frames[-1]} of the {what}'s {count} pictures, and {FROM_0}; "
            "subtract 1 from each"
        )
    beyond = [frame for frame in frames if not 0 <= frame < count]
    if beyond:
        raise DiorError(
            f"{where} names frame {beyond[0]}, and the {what} has {count} pictures, frames 0 to {count - 1}; is it "
            "of another one?"
        )
    return f"names frame 1 as the first, and {FROM_0}; is it counted from 1?" if frames[0] == 1 else ""


def _check_rate(index: VideoIndex, stamp_ns: Ints, sidecar: Sidecar, where: str, timed: str) -> None:
    """Refuse stamps (F,) ns, -1 where there are none, of another unit or rate than the pictures' times, or, where
    nobody says these, than any camera's."""
    at = np.flatnonzero(stamp_ns >= 0)
    if len(at) < 2:
        return
    steps = np.diff(stamp_ns[at]).astype(float)
    pictures = np.diff(index.number[at]).astype(float)
    own = np.diff(index.pts_ns[at]).astype(float) if timed else pictures
    # a recording that paused is not slower; stamps in whole seconds do not tell steps
    step = float(np.median(steps / own))
    slow = step if step > 0 else float(steps.sum() / own.sum())
    back = np.diff(stamp_ns[at])
    if not back.any():
        raise DiorError(
            f"{where}: {sidecar.time} is the same for all {len(at)} pictures; did a spreadsheet round it, or is it "
            f"not in {sidecar.unit}?"
        )
    if (back < 0).mean() > MOST_OUT_OF_ORDER or back.min() < -JUMP_NS or slow <= 0:
        number = index.number[at[int(np.argmin(back)) + 1]]
        raise DiorError(
            f"{where}: {sidecar.time} goes back, the furthest by {-back.min() / 1e9:.3g} s at frame {number}; is it in "
            "the order of the pictures?"
        )
    if not timed:
        rate_hz = 1e9 / slow
        if LEAST_HZ <= rate_hz <= MOST_HZ:
            return
        unit, said = _usual(rate_hz, sidecar), ""
    else:
        if 1 / MOST_RATE_RATIO <= slow <= MOST_RATE_RATIO:
            return
        # whole seconds tell a short recording's length badly
        loose = 30.0 if step <= 0 else MOST_RATE_RATIO
        off = {unit: slow / _ratio(sidecar.unit, unit) for unit in UNITS if unit != sidecar.unit}
        unit = next((unit for unit, by in off.items() if 1 / loose < by < loose), "")
        own_hz = 1e9 / float(np.median(own / pictures))
        rate_hz = own_hz / slow
        unit = unit or ("" if LEAST_HZ <= rate_hz <= MOST_HZ else _usual(rate_hz, sidecar))
        said = f", and {timed} {own_hz:.4g}"
    if unit:
        fix = f"they are in {unit}, and {sidecar.time} is in {sidecar.unit}; write them in {sidecar.unit}"
    else:
        fix = (
            "is it of another recording? Of a video in slow motion `video: {fps: ...}` in the camera's YAML is the rate"
        )
    raise DiorError(f"{where}: the column {sidecar.time} has {rate_hz:.4g} pictures per second{said}; {fix}")


def _usual(rate_hz: float, sidecar: Sidecar) -> str:
    """The unit in which a rate is one of a camera's; none: empty."""
    others = (unit for unit in UNITS if LEAST_HZ < rate_hz * _ratio(sidecar.unit, unit) < USUAL_HZ)
    return next(others, "")


def _ratio(unit: str, other: str) -> float:
    return UNITS[unit] / UNITS[other]


def regular(pts_ns: Ints, tick_ns: float) -> Ints | None:
    """Times (F,) ns at a regular rate, pictures left out among them, of which `pts_ns` (F,) are roundings to whole
    ticks; None where they are not."""
    if len(pts_ns) < 3 or not tick_ns:
        return None
    steps = np.diff(pts_ns)
    number = np.r_[0, np.cumsum(np.maximum(np.rint(steps / np.median(steps)), 1))]
    since = (pts_ns - pts_ns[0]).astype(float)
    line = np.polyval(np.polyfit(number, since, 1), number)
    if np.abs(since - line).max() > MOST_ROUNDED * tick_ns:
        return None
    return np.asarray(pts_ns[0] + np.rint(line).astype(np.int64))


def together(found: Mapping[str, VideoStamps], others_ns: int | None) -> dict[str, VideoStamps]:
    """The stamps of several cameras, those without a date moved to where the others begin, or `others_ns`, the first
    stamp of cameras that are no videos."""
    dated = [int(one.stamp_ns[0]) for one in found.values() if not one.undated]
    dated += [] if others_ns is None else [others_ns]
    if not dated:
        return dict(found)
    return {
        camera: one.later(min(dated) - int(one.stamp_ns[0])) if one.undated else one for camera, one in found.items()
    }


def is_sidecar(head: bytes) -> bool:
    """Whether a file that begins with `head` has the columns of one of `LAYOUTS`."""
    line = head.split(b"\n", 1)[0].decode("utf-8", "replace")
    header = [name.strip().strip('"') for name in line.split(",")]
    return header == OLD_SKELLYCAM or any({*filter(None, (*one[:2], one[3]))} <= {*header} for one in LAYOUTS)


def read_sidecar(path: AnyPath, video: Path) -> Sidecar:
    """The stamps of a video's pictures. Raises DiorError for a file of no layout, and for broken rows."""
    rows = each_row(path, path, most_bytes=MOST_BYTES)
    _, header = next(rows, (1, []))
    if not header:
        raise DiorError(f"{path}: the file is empty; its first line must be frame,stamp_ns")
    number, time, unit, camera = _layout(path, header)
    if header == OLD_SKELLYCAM:
        header = [number, time]
    wanted = _number_in(video) if camera else ""
    found: list[tuple[int, int]] = []
    for line, cells in rows:
        row = dict(zip(header, cells, strict=False))
        try:
            if camera and int(row[camera]) != int(wanted):
                continue
            frame = int(row[number]) if number else len(found)
            stamp_ns = int(Decimal(row[time]) * UNITS[unit])
        except (KeyError, ValueError, ArithmeticError):
            raise DiorError(f"{path} line {line}: is not {', '.join(filter(None, (camera, number, time)))}") from None
        if max(abs(frame), abs(stamp_ns)) > INT64_MAX - NO_DATE_NS:
            raise DiorError(f"{path} line {line}: has a number that is too large for a frame or for {time} in {unit}")
        found.append((frame, stamp_ns))
    if not found:
        whose = f" of {camera} {wanted}, the number in the name of {video.name}" if camera else ""
        raise DiorError(f"{path}: it has no stamps{whose}")
    if camera:
        found = list(enumerate(sorted(stamp for _, stamp in found)))
    stamps = dict(found)
    if len(stamps) < len(found):
        raise DiorError(f"{path}: it has frames twice")
    if len(stamps) == 1:
        _check_one_stamp(min(stamps.values()), time, unit, path)
    if min(stamps.values()) < LONGEST_UPTIME_NS:
        stamps = {frame: stamp + NO_DATE_NS for frame, stamp in stamps.items()}
    if min(stamps.values()) <= 0:
        raise DiorError(f"{path}: it has stamps before 1970")
    return Sidecar(stamps, time, unit, not number)


def _check_one_stamp(stamp_ns: int, time: str, unit: str, path: AnyPath) -> None:
    """Refuse a stamp that is a date in another unit: of several the rate tells."""
    for other, scale in UNITS.items():
        if other != unit and DATES_NS[0] <= stamp_ns // UNITS[unit] * scale < DATES_NS[1]:
            raise DiorError(
                f"{path}: its one stamp is {stamp_ns // UNITS[unit]}, a date if it is in {other}, and {time} is in "
                f"{unit}; write it in {unit} since 1970, or two frames or more of a clock that counts from elsewhere"
            )


def _layout(path: AnyPath, header: list[str]) -> tuple[str, str, str, str]:
    """The one of `LAYOUTS` that the header of a file is of. Raises DiorError for none."""
    check_delimiter(header, path)
    twice = [name for name, count in Counter(filter(None, header)).items() if count > 1]
    if twice:
        raise DiorError(f"{path}: column '{twice[0]}' is there twice; delete one")
    if header == OLD_SKELLYCAM:
        return LAYOUTS[0]
    lower = [name.lower() for name in header]
    for layout in LAYOUTS:
        names = [name for name in (layout[3], layout[0], layout[1]) if name]
        if {*names} <= {*header}:
            return layout
        if {*names} <= {*lower}:
            other = next(name for name in names if name not in header)
            raise DiorError(f"{path}: unknown column '{header[lower.index(other)]}'; did you mean '{other}'?")
    raise DiorError(
        f"{path}: its columns are {', '.join(header)[:200]}, which are stamps of no layout that is read; write "
        "frame,stamp_ns: a frame's number from 0 and ns since 1970"
    )


def _number_in(video: Path) -> str:
    """The last number in a video's name. Raises DiorError where there is none."""
    numbers = re.findall(r"\d+", video.stem)
    if not numbers:
        raise DiorError(f"{video}: its name has no number, by which the stamps of several cameras tell whose they are")
    return str(numbers[-1])
