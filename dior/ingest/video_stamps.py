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
from collections.abc import Mapping
from dataclasses import dataclass, replace
from decimal import Decimal, InvalidOperation
from pathlib import Path

import numpy as np

from dior.arrays import AnyPath, Ints
from dior.errors import DiorError
from dior.ingest.videos import VideoIndex
from dior.project.plain_text import each_row

# chosen: of a step, more than half of which no rounding is off
MOST_ROUNDED = 0.55
# where a recording begins of which nothing says when it was made: the first of January 2000, UTC
NO_DATE_NS = 946_684_800 * 10**9
# chosen: three years; no computer runs that long, and nobody recorded in 1973
LONGEST_UPTIME_NS = 10**8 * 10**9
# chosen: a file's time of creation is in whole seconds, and a recorder takes its time between the file and a picture
CREATED_SIGMA_S = 1.0
# chosen: recorders that people start one after the other
NO_START_SIGMA_S = 5.0
# chosen: half an hour of pictures of a dozen cameras
MOST_BYTES = 1 << 27
# columns of a frame's number, of its time, what the time is in of 1 ns, and of the camera
LAYOUTS = (
    ("frame", "stamp_ns", 1, ""),
    ("", "frame_time", 10**9, "cam_id"),
    ("", "frame_time", 10**9, "port"),
    ("recording_frame_number", "timestamp.utc.seconds", 10**9, ""),
)
OLD_SKELLYCAM = ["", "0"]


@dataclass(frozen=True, eq=False)
class VideoStamps:
    """Stamps (F,) ns of a video's pictures.

    `sigma_s`: of one against the others, by the step of the video's time; `start_sigma_s`: of all of them together, and
    `apart_sigma_s` of that against other cameras'; `source`: sidecar, created, sound or none, what the start is by;
    `undated`: the start is an arbitrary one.
    """

    stamp_ns: Ints
    sigma_s: float
    start_sigma_s: float
    apart_sigma_s: float
    source: str
    undated: bool = False

    def later(self, by_ns: int) -> "VideoStamps":
        """The same, all of them moved."""
        return replace(self, stamp_ns=self.stamp_ns + by_ns)


def stamps_of(index: VideoIndex, sidecar: Mapping[int, int] | None, where: str) -> VideoStamps:
    """`VideoStamps` of the pictures of `index`; `sidecar`: stamps (ns) by frame. Raises DiorError, beginning with
    `where`, for a sidecar of another recording."""
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
    count = len(index.pts_ns) + len(index.lost)
    beyond = [frame for frame in sidecar if not 0 <= frame < count]
    if beyond:
        raise DiorError(f"{where} names frame {beyond[0]}, and the video has {count} pictures; is it of another one?")
    whole = np.array([sidecar.get(int(number), -1) for number in index.number], np.int64)
    if (whole >= 0).all():
        return VideoStamps(whole, 0.0, 0.0, 0.0, "sidecar")
    at = np.flatnonzero(whole >= 0)
    if not len(at):
        raise DiorError(f"{where} names none of the video's pictures that can be read")
    first = whole[at[0]] - index.pts_ns[at[0]]
    # as whole numbers: the ns since 1970 are too many for a float
    off = np.interp(index.pts_ns, index.pts_ns[at], (whole[at] - index.pts_ns[at] - first).astype(float))
    return VideoStamps(index.pts_ns + first + np.rint(off).astype(np.int64), tick_s, 0.0, 0.0, "sidecar")


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


def read_sidecar(path: AnyPath, video: Path) -> dict[int, int]:
    """Stamps (ns) by frame of the video's pictures. Raises DiorError for a file of no layout, and for broken rows."""
    rows = each_row(path, path, most_bytes=MOST_BYTES)
    _, header = next(rows, (1, [""]))
    if header == OLD_SKELLYCAM:
        header = list(LAYOUTS[0][:2])
    layout = next((one for one in LAYOUTS if {*one} - {"", one[2]} <= {*header}), None)
    if layout is None:
        raise DiorError(
            f"{path}: its columns are {', '.join(header)[:200]}, which are stamps of no layout that is read; write "
            "frame,stamp_ns: a frame's number from 0 and ns since 1970"
        )
    number, time, unit, camera = layout
    wanted = _number_in(video) if camera else ""
    found: list[tuple[int, int]] = []
    for line, cells in rows:
        row = dict(zip(header, cells, strict=False))
        try:
            if camera and int(row[camera]) != int(wanted):
                continue
            frame = int(row[number]) if number else len(found)
            found.append((frame, int(Decimal(row[time]) * unit)))
        except (KeyError, ValueError, InvalidOperation, OverflowError):
            raise DiorError(f"{path} line {line}: is not {', '.join(filter(None, (camera, number, time)))}") from None
    if not found:
        whose = f" of {camera} {wanted}, the number in the name of {video.name}" if camera else ""
        raise DiorError(f"{path}: it has no stamps{whose}")
    if camera:
        found = list(enumerate(sorted(stamp for _, stamp in found)))
    stamps = dict(found)
    if len(stamps) < len(found):
        raise DiorError(f"{path}: it has frames twice")
    if min(stamps.values()) < LONGEST_UPTIME_NS:
        stamps = {frame: stamp + NO_DATE_NS for frame, stamp in stamps.items()}
    if min(stamps.values()) <= 0:
        raise DiorError(f"{path}: it has stamps before 1970")
    return stamps


def _number_in(video: Path) -> str:
    """The last number in a video's name. Raises DiorError where there is none."""
    numbers = re.findall(r"\d+", video.stem)
    if not numbers:
        raise DiorError(f"{video}: its name has no number, by which the stamps of several cameras tell whose they are")
    return str(numbers[-1])
