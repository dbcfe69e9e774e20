"""The index of all pictures of a sequence.

INPUTS   the sequence's bags (one per recording computer, possibly split in time, possibly overlapping), or a video or
         folder of pictures per camera, with a CSV of stamps; and which clocks are given by hand
OUTPUTS  `frames` table: cameras in the order of their names, frames numbered from 0 per camera as they were recorded,
         header stamps (ns) that were wrong for a while restored (stamps.py);
         with bag, topic, receive stamp and nth it takes to read a picture back (`bags.read_pictures`). A picture that
         several bags recorded is one frame, of the first of them in the sheet; the table's metadata `recorded_twice`
         says how many were left out, per camera. One that a single bag holds twice is the camera's doing and stays.
Of a video `bag` is its path, `topic` the stream (`videos`), `receive_ns` the picture's time in the file, the stamp is
as `video_stamps` has it and `restored_sigma_s` what the step of the file's time leaves open. The metadata `videos`
tells by camera what its stamps are by, how well their start is known, and which pictures cannot be read. Of packets of
a video in a bag (`packets`) and of damaged pictures the metadata NOT_DECODED tells by camera and bag the stamps of
those that give no picture, and why.
"""

import json
import os
from collections import Counter
from collections.abc import Collection, Iterable, Iterator
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path

import numpy as np

from dior.arrays import Bools, Ints, Table
from dior.errors import DiorError
from dior.ingest import bags as rosbag
from dior.ingest import packets, stamps, video_frames
from dior.ingest.bag_reader import Lost
from dior.tables import tables

# chosen: a recorder that splits its bags leaves less than that between them; lags vary by less from one to the next, by
# so many pictures of each
SPLIT_NS, MOST_LAG_NS, ACROSS = 1_000_000_000, 20_000_000, 30

NOT_DECODED = "not_decoded"
NONE: list[str] = []
NOTHING: dict[str, str] = {}
IN_BAGS = video_frames.Recorded()


def run(
    *,
    sequence: str,
    bags: list[Path],
    data_root: Path,
    topics: dict[str, str],
    out: Path,
    by_hand: list[str] = NONE,
    in_bags: dict[str, str] = NOTHING,
    recorded: video_frames.Recorded = IN_BAGS,
) -> None:
    """Index `bags` (paths) for the cameras of `topics` (dict camera -> image topic). See the module's docstring.

    `by_hand`: cameras whose clocks a person gave, which may therefore be of any other time; `in_bags`: by camera what
    the names of its bags hold, where other cameras have the same topic in other bags; `recorded`: what the cameras are
    recorded on that are in no bag.
    """
    filmed = {camera: topic for camera, topic in topics.items() if camera in recorded.videos}
    topics = {camera: topic for camera, topic in topics.items() if camera not in filmed}
    full_names = [rosbag.full_name(topic) for camera, topic in topics.items() if camera not in in_bags]
    for what, values in (("bag", [os.path.normpath(bag) for bag in bags]), ("topic", full_names)):
        twice = [value for value, count in Counter(values).items() if count > 1]
        if twice:
            raise DiorError(f"{sequence}: {what} {twice[0]} is given twice")
    if not bags and not filmed:
        raise DiorError(f"{sequence}: no bag is given; fill in `bags` or `videos` in sequences.tsv")
    if not topics and not filmed:
        raise DiorError(f"{sequence}: no camera is given; write a <camera>.yaml for each into its session")
    there = {bag: rosbag.topics_of(bag) for bag in bags}
    holders = {
        camera: rosbag.holding(_named(there, in_bags.get(camera, ""), sequence, camera), topic, f"{sequence}, {camera}")
        for camera, topic in topics.items()
    }
    indexes: dict[str, dict[str, Table]] = {camera: {} for camera in topics}
    not_decoded: dict[str, dict[str, list[tuple[int, str]]]] = {}
    began: list[int] = []
    for bag in bags:
        wanted = {camera: topics[camera] for camera, holding in holders.items() if bag in holding}
        _check_one_camera(wanted, f"{sequence}: {bag}")
        if wanted:
            lost: list[Lost] = []
            index = rosbag.index(bag, list(wanted.values()), lost)
            _check_complete(bag, there[bag], index, list(wanted.values()), lost)
            began.append(int(index["stamp_ns"].min()))
            for camera, topic in wanted.items():
                indexes[camera][_relative(bag, data_root)] = index
                if own := [(stamp_ns, why) for name, stamp_ns, why in lost if name == rosbag.full_name(topic)]:
                    not_decoded.setdefault(camera, {})[_relative(bag, data_root)] = own
    films = video_frames.films(sequence, filmed, recorded, min(began, default=None))
    check_overlap(sequence, [*_spans(topics, indexes), *(films[camera].span() for camera in sorted(films))], by_hand)
    parts: dict[str, Table] = {}
    recorded_twice = dict.fromkeys(filmed, 0)
    for camera, topic in topics.items():
        parts[camera], recorded_twice[camera] = _of_camera(sequence, camera, topic, indexes[camera])
    for camera, film in films.items():
        where = f"{sequence}, {camera}"
        parts[camera] = film.table(_relative(film.path, data_root))
        _check_one_size(sequence, camera, parts[camera])
        check_usable(parts[camera]["stamp_ns"], parts[camera]["receive_ns"], where)
    columns = {
        key: np.concatenate([parts[camera][key] for camera in sorted(parts)]) for key in tables.columns_of("frames")
    }
    metadata = {"recorded_twice": json.dumps(recorded_twice, sort_keys=True)}
    if not_decoded:
        metadata[NOT_DECODED] = json.dumps(not_decoded, sort_keys=True)
    tables.write(out, "frames", columns, metadata | video_frames.metadata(films))


def _named(there: dict[Path, rosbag.Topics], word: str, sequence: str, camera: str) -> dict[Path, rosbag.Topics]:
    """The bags whose names hold `word`."""
    found = {bag: topics for bag, topics in there.items() if word in bag.name}
    if not found:
        raise DiorError(
            f"{sequence}, {camera}: no bag has '{word}' in its name, which `bag` of the camera's YAML says; they are "
            f"{', '.join(bag.name for bag in there)}"
        )
    return found


def _check_one_camera(topics: dict[str, str], where: str) -> None:
    """Refuse two cameras (dict camera -> topic) that would be the same pictures of a bag."""
    owner: dict[str, str] = {}
    for camera, topic in topics.items():
        other = owner.setdefault(rosbag.full_name(topic), camera)
        if other != camera:
            raise DiorError(
                f"{where}: {other} and {camera} are both its topic {topic}; give `bag`, what the names of their bags "
                "hold, in the YAML of each"
            )


def _spans(topics: dict[str, str], indexes: dict[str, dict[str, Table]]) -> Iterator[video_frames.Span]:
    """First and last stamp of each camera that is in bags."""
    for camera, topic in sorted(topics.items()):
        picked = {bag: index["stamp_ns"][index["topic"] == topic] for bag, index in indexes[camera].items()}
        stamps_ns = np.concatenate(list(picked.values()))
        # what has no stamps at all is refused for that
        if len(stamps_ns) and stamps_ns.min() > 0:
            bags = ", ".join(Path(bag).name for bag, own in picked.items() if len(own))
            yield int(stamps_ns.min()), int(stamps_ns.max()), camera, bags


def check_overlap(sequence: str, spans: Iterable[video_frames.Span], given: Collection[str]) -> None:
    """Refuse recordings of which one part ended before the other began, unless their clocks are `given` by hand.

    `spans`: first and last stamp (ns) of each camera, its name and its files. A camera that overlaps with no other may
    do so through a third.
    """
    spans = [span for span in spans if span[2] not in given]
    spans.sort()
    end = 0
    for i, (first, last, *_) in enumerate(spans):
        if i and first > end:
            before, after = (
                f"{', '.join(one[2] for one in part)} ({'; '.join(dict.fromkeys(one[3] for one in part))})"
                for part in (spans[:i], spans[i:])
            )
            raise DiorError(
                f"{sequence}: the recordings do not overlap: that of {before} ended {(first - end) / 1e9:.1f} s before "
                f"that of {after} began ({_utc(end)} and {_utc(first)} UTC by the header stamps). Is a bag of another "
                "walk among the `bags` in sequences.tsv, or was a computer's clock set wrong? In that case give "
                f"offset_s of {' and '.join(one[2] for one in spans[i:])} in config/offsets/{sequence}.yaml"
            )
        end = max(end, last)


def _utc(ns: int) -> str:
    return f"{datetime.fromtimestamp(ns // 10**9, UTC):%Y-%m-%d %H:%M:%S}"


def _relative(bag: Path, data_root: Path) -> str:
    return Path(os.path.relpath(bag, data_root)).as_posix()


def _check_complete(
    bag: Path, there: dict[str, tuple[str, int]], index: Table, topics: list[str], lost: list[Lost]
) -> None:
    """Refuse a bag that says it holds other messages than are there, those without a picture (`lost`) among them."""
    for topic in topics:
        kind, said = there[rosbag.full_name(topic)]
        found = int((index["topic"] == topic).sum()) + sum(name == rosbag.full_name(topic) for name, *_ in lost)
        # what comes before a key frame is no picture
        if said != found and kind not in packets.KINDS:
            raise DiorError(f"{bag}: it says it holds {said} messages of {topic}, but there are {found}; copy it again")


def _of_camera(sequence: str, camera: str, topic: str, indexes: dict[str, Table]) -> tuple[Table, int]:
    """Rows of one camera from the indexes of all bags, in recorded order, and how many were left out."""
    where, parts = f"{sequence}, {camera}", []
    for bag, index in indexes.items():
        part = tables.rows(index, index["topic"] == topic)
        part = tables.rows(part, np.argsort(part["receive_ns"], kind="stable"))
        parts.append(part | _restored(part, where) | {"bag": np.full(len(part["topic"]), bag, object)})
    _check_between(parts, where)
    table = {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}
    number = np.repeat(np.arange(len(parts)), [len(part["topic"]) for part in parts])
    # within a bag as recorded; what another bag has in between is between by its stamp, as two recorders' clocks differ
    latest = np.concatenate([np.maximum.accumulate(part["stamp_ns"]) for part in parts])
    order = np.lexsort((np.arange(len(number)), number, latest))
    order = order[_of_first_bag(*(each[order] for each in (stamps.header_ns(table), table["stamp_ns"], number)))]
    left_out, table = len(number) - len(order), tables.rows(table, order)
    _check_one_size(sequence, camera, table)
    check_usable(table["stamp_ns"], table["receive_ns"], where)
    table["camera"] = np.full(len(order), camera, object)
    table["frame"] = np.arange(len(order), dtype=np.int32)
    return table, left_out


def _restored(part: Table, where: str) -> Table:
    """The columns about stamps of one camera in one bag, in recorded order."""
    if (part["stamp_ns"] <= 0).any():
        # `check_usable` says so
        nothing = np.full(len(part["stamp_ns"]), np.nan)
        return {"restored_s": nothing, "restored_sigma_s": nothing}
    found = stamps.restored(part["stamp_ns"], part["receive_ns"], where)
    wrong = found.shift_ns != 0
    columns = {"restored_s": found.shift_ns / 1e9, "restored_sigma_s": found.sigma_s}
    return {"stamp_ns": found.stamp_ns} | {key: np.where(wrong, each, np.nan) for key, each in columns.items()}


def _of_first_bag(header_ns: Ints, stamp_ns: Ints, bag: Ints) -> Bools:
    """Mask (N,) of the rows whose picture no bag of a lower number `bag` (N,) has: the same header, and the same time.

    A header's clock that goes back gives a stamp to two pictures.
    """
    steps = np.diff(np.unique(header_ns))
    near = np.median(steps) / 2 if len(steps) else 0
    order = np.lexsort((stamp_ns, header_ns))
    another = (np.diff(header_ns[order]) != 0) | (np.diff(stamp_ns[order]) > near)
    picture = np.empty(len(order), int)
    picture[order] = np.r_[0, np.cumsum(another)]
    first = np.full(len(order), np.iinfo(int).max)
    np.minimum.at(first, picture, bag)
    return np.asarray(bag == first[picture])


def _check_between(parts: list[Table], where: str) -> None:
    """Refuse a header clock that was set between one bag (rows in recorded order) and the next."""
    parts = sorted((part for part in parts if len(part["stamp_ns"]) > 1), key=lambda part: int(part["receive_ns"][0]))
    for one, other in pairwise(parts):
        received = int(other["receive_ns"][0] - one["receive_ns"][-1])
        period = np.median(np.diff(one["stamp_ns"]))
        back = int(one["stamp_ns"].max() - other["stamp_ns"].min())
        # two recorders have clocks of their own, and then the same pictures where they overlap
        if received < 0 or np.isin(one["stamp_ns"], other["stamp_ns"]).any():
            continue
        # a network can only add to a lag
        lags = (np.percentile(lag, 20) for lag in (_lag(one)[-ACROSS:], _lag(other)[:ACROSS]))
        by = -np.diff(list(lags))[0]
        told = received < SPLIT_NS and abs(by) > max(period, MOST_LAG_NS)
        if back > period / 2 or told:
            # the lags of many do not tell of the first one or two, which may be too few to be restored
            by = by if told else -back - (period if received < SPLIT_NS else 0)
            raise DiorError(
                f"{where}: the header clock was set {'back' if by < 0 else 'forward'} by {abs(by) / 1e9:.1f} s between "
                f"{one['bag'][-1]} and {other['bag'][0]}, so stamps before and after it mean different times; give the "
                "bags as two sequences"
            )


def _lag(part: Table) -> Ints:
    return np.asarray(part["receive_ns"] - part["stamp_ns"])


def _check_one_size(sequence: str, camera: str, table: Table) -> None:
    width, height = table["width"], table["height"]
    other = (width != width[0]) | (height != height[0])
    if other.any():
        i = int(np.argmax(other))
        raise DiorError(
            f"{sequence}, {camera}: frame {i} ({table['bag'][i]}) is {width[i]}x{height[i]} where frame 0 "
            f"({table['bag'][0]}) is {width[0]}x{height[0]}; a camera must keep one resolution in a recording"
        )


def check_usable(stamp_ns: Ints, receive_ns: Ints, where: str) -> None:
    """Refuse stamps (F,) of one camera that no step can work with.

    Raises DiorError, beginning with `where`: fewer than two pictures, header stamps that are zero, all the same, set
    back by more than a second while recording, or in another order than the pictures came in.
    """
    if len(stamp_ns) < 2:
        raise DiorError(f"{where}: {len(stamp_ns)} picture is no recording; exclude the sequence or drop the camera")
    if stamp_ns.min() <= 0:
        raise DiorError(
            f"{where}: {int((stamp_ns <= 0).sum())} of {len(stamp_ns)} header stamps are zero, so the driver did not "
            "stamp its pictures; receive stamps are no replacement without a look at their lag: write them into the "
            "headers of a copy of the bag if some 10 ms do not matter, and exclude the sequence if they do"
        )
    if stamp_ns[0] == stamp_ns[-1]:
        raise DiorError(f"{where}: all {len(stamp_ns)} header stamps are the same; the driver stamps its start only")
    recorded = np.argsort(receive_ns, kind="stable")
    steps = np.diff(stamp_ns[recorded])
    worst = int(np.argmin(steps))
    if steps[worst] < -stamps.JUMP_NS:
        raise DiorError(
            f"{where}: the header clock was set back by {-steps[worst] / 1e9:.1f} s after picture {worst} of the "
            "recording, so stamps before and after it mean different times; split the bag there and give the parts as "
            "two sequences"
        )
    back = float((steps < 0).mean())
    if back > stamps.MOST_OUT_OF_ORDER:
        raise DiorError(
            f"{where}: {back:.0%} of the header stamps are earlier than the one before in the recording; the driver "
            "does not stamp in the order of the pictures, or two cameras publish to one topic"
        )
