"""The rows of the table `frames` for cameras that are recorded on videos or as folders of pictures.

INPUTS   by camera a video or folder, its stream, a CSV of stamps, a rate
OUTPUTS  `Film`s: rows of `frames`, and what the table's metadata tell of the stamps and of the pictures that are lost
"""

import json
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from dior.arrays import Floats, Ints, Table
from dior.errors import DiorError
from dior.ingest import bags, containers, picture_folders, video_audio, video_flash, video_stamps
from dior.ingest.video_stamps import VideoStamps
from dior.ingest.video_starts import METADATA, MOST_SIGMAS
from dior.ingest.videos import VideoIndex

# first and last stamp (ns) of a camera, its name, and what it is recorded on
Span: TypeAlias = tuple[int, int, str, str]
# what a start is by that was compared with another camera's
MOVED = ("sound", "flash")


@dataclass(frozen=True)
class Recorded:
    """What cameras are recorded on that are in no bag.

    `videos`: the video or folder of pictures of each camera that is in no bag; `sidecars`: CSV files with the stamps of
    their pictures; `rates`: pictures per second by camera, where the times in the file are not to be believed.
    """

    videos: dict[str, Path] = field(default_factory=dict)
    sidecars: dict[str, Path] = field(default_factory=dict)
    rates: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Film:
    """A camera's recording on `path`; `key` (F,) is by what a picture is found (`bag_reader.Message.receive_ns`).

    `by_rate`: its times are by a rate that a person gave.
    """

    camera: str
    path: Path
    topic: str
    index: VideoIndex
    key: Ints
    stamps: VideoStamps
    by_rate: bool = False

    def span(self) -> Span:
        """Between which stamps the recording may lie."""
        slack = round(MOST_SIGMAS * 1e9 * self.stamps.start_sigma_s)
        first, last = int(self.stamps.stamp_ns.min()), int(self.stamps.stamp_ns.max())
        return first - slack, last + slack, self.camera, self.path.name

    def table(self, bag: str) -> Table:
        """Rows of `frames`; `bag` is the path as the table has it."""
        count = len(self.key)
        sigma = np.full(count, self.stamps.sigma_s or np.nan)
        return {
            "camera": np.full(count, self.camera, object),
            "frame": np.arange(count, dtype=np.int32),
            "stamp_ns": self.stamps.stamp_ns,
            "restored_s": np.full(count, np.nan),
            "restored_sigma_s": sigma,
            "receive_ns": self.key,
            "bag": np.full(count, bag, object),
            "topic": np.full(count, self.topic, object),
            "nth": np.zeros(count, np.int32),
            "height": self.index.height.astype(np.int32),
            "width": self.index.width.astype(np.int32),
        }

    def lost(self) -> list[tuple[int, int, str]]:
        """(frame before, stamp_ns, reason) of the pictures that cannot be read."""
        pts_ns, stamp_ns = self.index.pts_ns, self.stamps.stamp_ns
        found = []
        for at, reason in self.index.lost:
            before = max(int(np.searchsorted(pts_ns, at)) - 1, 0)
            found.append((before, int(stamp_ns[before]) + at - int(pts_ns[before]), reason))
        return found


def films(sequence: str, topics: Mapping[str, str], recorded: Recorded, others_ns: int | None) -> dict[str, Film]:
    """`Film`s by camera of the streams `topics`. `others_ns`: first stamp of the cameras that are in bags.

    Raises DiorError for what is not there, cannot be read, or has neither stamps nor a rate.
    """
    found = {camera: _film(f"{sequence}, {camera}", camera, topics[camera], recorded) for camera in sorted(topics)}
    stamps = video_stamps.together({camera: film.stamps for camera, film in found.items()}, others_ns)
    found = {camera: replace(film, stamps=stamps[camera]) for camera, film in found.items()}
    if not any(film.stamps.start_sigma_s for film in found.values()):
        return found
    # a file whose times are not to be believed does not tell when its sound was
    beside = others_ns is not None
    return by_flash(by_sound(found, [camera for camera in found if camera not in recorded.rates], beside), beside)


def by_sound(found: Mapping[str, Film], cameras: Collection[str], beside: bool = False) -> dict[str, Film]:
    """The films, those of `cameras` whose start is uncertain moved to where their sound is that of another. `beside`:
    there are cameras that are no films."""
    heard = {camera: containers.heard(found[camera].path) for camera in cameras}
    return _moved(found, heard, video_audio, "sound", beside)


def by_flash(found: Mapping[str, Film], beside: bool = False) -> dict[str, Film]:
    """The films, those whose start is uncertain, and which no sound told, moved to where they saw the same flash;
    `beside` as of `by_sound`."""
    seen = {camera: video_flash.flashes(film.index.light, film.index.pts_ns) for camera, film in found.items()}
    if any(len(one.at_s) > 1 for one in seen.values() if one):
        # which of several it was that a camera saw alone is not told, and two may each have seen another
        seen = {camera: one if one and len(one.at_s) > 1 else None for camera, one in seen.items()}
    return _moved(found, seen, video_flash, "flash", beside)


def _moved(
    found: Mapping[str, Film], signs: Mapping[str, Any], kind: Any, source: str, beside: bool
) -> dict[str, Film]:
    """The films moved by signs that cameras have, the best known first; `kind`: the module that compares the signs.

    Where none of them is good against other cameras, of which there are some, or some `beside`, the moved ones are near
    each other and as far from these as before.
    """
    order = sorted(signs, key=lambda camera: (found[camera].stamps.start_sigma_s, camera))
    order = [camera for camera in order if signs[camera]]
    settled = [camera for camera in order if _compared(found[camera].stamps)]
    alone = not settled and (beside or any(_compared(film.stamps) for film in found.values()))
    settled = settled or order[:1]
    out = dict(found)
    for camera in [camera for camera in order if camera not in settled]:
        for other in settled:
            moved = _moved_to(out[camera], signs[camera], out[other], signs[other], kind)
            if moved is not None:
                apart_s = out[camera].stamps.apart_sigma_s if alone else moved.stamps.apart_sigma_s
                out[camera] = replace(moved, stamps=replace(moved.stamps, source=source, apart_sigma_s=apart_s))
                settled.append(camera)
                break
    if len(settled) > 1 and not alone and not _compared(out[settled[0]].stamps):
        first, second = (out[camera].stamps for camera in settled[:2])
        out[settled[0]] = replace(out[settled[0]], stamps=replace(first, apart_sigma_s=second.apart_sigma_s))
    return out


def _compared(stamps: VideoStamps) -> bool:
    """Whether a start is exact, or good against another camera's."""
    return stamps.source in MOVED or not stamps.start_sigma_s or stamps.apart_sigma_s < stamps.start_sigma_s


def _moved_to(film: Film, sign: Any, other: Film, others: Any, kind: Any) -> Film | None:
    """A film moved to where its sign is that of `other`; None where that cannot be told."""
    # of the stamps less the times in the files
    off_ns = [int(one.stamps.stamp_ns[0] - one.index.pts_ns[0]) for one in (film, other)]
    apart_s = (off_ns[0] - off_ns[1]) / 1e9
    sigma_s = float(np.hypot(film.stamps.start_sigma_s, other.stamps.start_sigma_s))
    late_s = kind.lag(others, sign, apart_s, MOST_SIGMAS * sigma_s)
    if late_s is None:
        return None
    known_s = kind.sigma_s(others, sign)
    stamps = replace(
        film.stamps.later(round(1e9 * (late_s - apart_s))),
        start_sigma_s=float(np.hypot(other.stamps.start_sigma_s, known_s)), apart_sigma_s=known_s,
    )  # fmt: skip
    return replace(film, stamps=stamps)


def _film(where: str, camera: str, topic: str, recorded: Recorded) -> Film:
    path, sidecar = recorded.videos[camera], recorded.sidecars.get(camera)
    rate = _rate(where, recorded.rates.get(camera))
    if not path.exists():
        raise DiorError(f"{where}: there is no {path}; check `videos` in sequences.tsv and `data_root`")
    is_video = containers.is_video(path)
    if path.is_file() and not path.stat().st_size:
        raise DiorError(f"{where}: {path} is empty; copy it again from where it was recorded")
    if not is_video and not path.is_dir():
        raise DiorError(
            f"{where}: {path} is no video and no folder of pictures; name bags in `bags`, not in `videos`; mp4, "
            f"mov, avi, mkv and webm are read, and `ffmpeg -i {path.name} -c copy {path.stem}.mp4` makes one of others"
        )
    if not is_video and not picture_folders.files(path):
        raise DiorError(
            f"{where}: there is no picture in the folder {path}; those that end in "
            f"{', '.join(picture_folders.SUFFIXES)} are read"
        )
    if not is_video:
        topic = picture_folders.TOPIC
    index = containers.video_index(path, topic) if is_video else _of_folder(path)
    key = index.pts_ns if is_video else np.arange(len(index.pts_ns))
    if np.isfinite(rate):
        index = _timed(index, index.number / rate)
    elif not is_video and not sidecar:
        raise DiorError(
            f"{where}: {path} is a folder of pictures, which have no time; give `fps` under `video:` in the camera's "
            "YAML, or a CSV of their stamps (`stamps` in sequences.tsv)"
        )
    given = video_stamps.read_sidecar(sidecar, path) if sidecar else None
    timed = "`video.fps`" if np.isfinite(rate) else "the video" if is_video else ""
    stamps = video_stamps.stamps_of(index, given, f"{where}: {sidecar}", "video" if is_video else "folder", timed)
    if not timed:
        without = [int(number) for number in index.number if int(number) not in (given.stamp_ns if given else {})]
        if without:
            raise DiorError(
                f"{where}: {sidecar} has no stamps for {len(without)} of the {len(key)} pictures of {path}, of which "
                f"frame {without[0]} is the first; a number that the names leave out counts as a frame, too"
            )
        index = _timed(index, (stamps.stamp_ns - stamps.stamp_ns[0]) / 1e9)
    return Film(camera, path, topic, index, key, stamps, bool(np.isfinite(rate)))


def _rate(where: str, given: str | None) -> float:
    """Pictures per second, NaN where none are given. Raises DiorError for what is no rate."""
    try:
        rate = float(given if given is not None else "nan")
    except ValueError:
        rate = 0.0
    if given is not None and not 0 < rate < np.inf:
        raise DiorError(f"{where}: the rate '{given}' is no number of pictures per second above 0, such as 29.97")
    return rate


def _timed(index: VideoIndex, at_s: Floats) -> VideoIndex:
    """The index with other times (F,) s of its pictures, the lost ones between them by their numbers."""
    every = np.arange(len(index.number) + len(index.lost))
    missing = np.setdiff1d(every, index.number)
    # beyond the last picture at the mean rate
    period = (at_s[-1] - at_s[0]) / max(index.number[-1] - index.number[0], 1)
    beyond = np.maximum(missing - index.number[-1], 0) - np.maximum(index.number[0] - missing, 0)
    lost_s = np.interp(missing, index.number, at_s) + period * beyond
    reasons = [reason for _, reason in index.lost]
    lost = tuple((round(1e9 * at), reason) for at, reason in zip(lost_s.tolist(), reasons, strict=True))
    return replace(index, pts_ns=np.rint(1e9 * at_s).astype(np.int64), lost=lost, tick_s=0.0)


def _of_folder(path: Path) -> VideoIndex:
    """`VideoIndex` of a folder of pictures, their times being their numbers; those that the names leave out are
    lost."""
    index = bags.index(path, [picture_folders.TOPIC])
    number = picture_folders.numbers(path)
    lost = tuple((int(at), "not_sent") for at in np.setdiff1d(np.arange(number[-1] + 1), number))
    return VideoIndex(number, number, index["height"], index["width"], lost, 0.0, None)


def metadata(found: Mapping[str, Film]) -> dict[str, str]:
    """What the metadata of `frames` say of the cameras that are recorded on videos; none where there are none."""
    said = {
        camera: {
            "source": film.stamps.source,
            "start_sigma_s": film.stamps.start_sigma_s,
            "apart_sigma_s": film.stamps.apart_sigma_s,
            "note": film.stamps.note,
            "by_rate": film.by_rate,
            "tick_s": film.index.tick_s if film.stamps.sigma_s else 0.0,
            "lost": film.lost(),
        }
        for camera, film in sorted(found.items())
    }
    return {METADATA: json.dumps(said)} if said else {}
