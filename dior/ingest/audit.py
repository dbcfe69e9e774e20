"""Whether the stamps and pictures of a sequence can be trusted: an audit per bag and camera.

INPUTS   `frames` table of the sequence, its bags
OUTPUTS  `stamp_audit` (a row per camera and bag), `dropped_frames` (a row with its reason for every picture that is
         missing or there twice), findings, also of stamps that frames restored

Header stamps are the camera's clock, receive stamps the recorder's, int64 ns. The lag is receive minus header.
Every message is compared with the one before, by its first bytes; of each camera 12 pictures are decoded to see whether
they are black. Reasons: a gap is `recorder_behind` where the pictures around it arrived more than 2 periods later than
usual (the recorder or network could not follow), `between_bags` where the recording went on in another bag, else
`not_sent` (camera or driver left it out). `same_stamp` and `same_picture` are repeated messages. Where only the
header's clock jumps nothing is missing; that is a finding.

A video has one clock: its receive stamps count as the header's. What is in it, or in a bag, and gives no picture is
`not_decoded`, what was to come after a video's end `cut_off`; the finding `video_stamps` tells what its stamps are by.
"""

import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from dior.arrays import Bools, Floats, Ints, Table
from dior.clocks.axis import nominal_fps
from dior.errors import many
from dior.ingest import bags as rosbag
from dior.ingest import stamps, video_starts
from dior.ingest.frames import NOT_DECODED, check_usable
from dior.ingest.stamps import JUMP_NS
from dior.tables import tables
from dior.tables.words import MOST_LOST

# 1.5: half-way between one period and two. 2.0 chosen: later than pictures come while a recorder keeps up
GAP_PERIODS, BEHIND_PERIODS = 1.5, 2.0
# chosen: enough pictures for a lens cap; a level of 255 that sensor noise in the dark stays below
LOOK_AT, BLACK_LEVEL = 12, 12
# chosen: above this share of pictures a repetition is a warning
MOST_REPEATED = 0.01
REPEATED = {
    "same_stamp": "stamp of the one before",
    "same_picture": "bytes of the one before under another stamp",
}
LAGS = ("lag_ms", "lag_spread_ms", "lag_max_ms", "drift_ppm")
# by what the stamps of a video are (`video_stamps.VideoStamps`)
OWN_TIMES, RATE = "by its own times", "at the rate that `video.fps` gives"
SOURCES = {
    "sidecar": "stamps from a file beside it",
    "created": f"stamps {OWN_TIMES} from when it was created on",
    "sound": f"stamps {OWN_TIMES}, whose start is told by the sound that another camera has, too",
    "flash": f"stamps {OWN_TIMES}, whose start is told by the flash that another camera saw, too",
    "none": f"stamps {OWN_TIMES}, and nothing says when it began",
}
# chosen: what a walker moves in less is below a detector's resolution
COARSE_TICK_S = 1e-4
# chosen: 3 ms at 30 Hz, in which a walker's ankle moves about a centimetre
MOST_JITTER_PERIODS = 0.1
# chosen: crystals are off by less than 0.01 %, so 1 % is another setting
MOST_RATE_OFF = 0.01
# chosen: a drift known no better than crystals differ says nothing
MOST_DRIFT_SIGMA_PPM = 20.0


@dataclass(frozen=True, eq=False)
class Audit:
    """`row`: one row of `stamp_audit` by column; `dropped`: (frame, stamp_ns, reason) per missing or repeated picture.

    `jumps`: (frame, step of the header clock in s) of the jumps of the clock; `glitches`: stamps that were restored;
    `undecoded`: why pictures of a bag could not be decoded.
    """

    row: dict[str, Any]
    dropped: tuple[tuple[int, int, str], ...]
    jumps: tuple[tuple[int, float], ...]
    glitches: tuple[stamps.Glitch, ...] = ()
    undecoded: tuple[str, ...] = ()


def run(*, sequence: str, frames: Path, data_root: Path, out: Path, out_dropped: Path, findings: Path) -> None:
    """Audit the recording that the table `frames` indexes; its bags are below `data_root`.

    Raises DiorError for a camera whose stamps cannot be used, see `check_usable`.
    """
    table, films = tables.read(frames, "frames"), video_starts.told(frames)
    not_decoded = json.loads(tables.metadata(frames).get(NOT_DECODED, "{}"))
    repeats = _repeats(table, data_root)
    rows, dropped, found = [], [], []
    for camera in tables.ordered_unique(table["camera"]):
        audits: list[tuple[str, dict[str, Any], Audit]] = []
        own = tables.of_camera(table, camera)
        where = f"{sequence}, {camera}"
        check_usable(own["stamp_ns"], own["receive_ns"], where)
        black = _black(own, data_root)
        film = films.get(camera)
        if film:
            own = own | {"receive_ns": own["stamp_ns"]}
        for bag in tables.ordered_unique(own["bag"]):
            mine = own["bag"] == bag
            audited = audit(tables.rows(own, mine), repeats[table["camera"] == camera][mine])
            audited = of_video(audited, film["lost"]) if film else audited
            if undecoded := not_decoded.get(camera, {}).get(bag):
                of_bag = _undecoded(undecoded, own)
                audited = with_lost(audited, [(frame, stamp, NOT_DECODED) for frame, stamp, _ in of_bag])
                audited = replace(audited, undecoded=tuple(why for *_, why in of_bag))
            looked = black[mine]
            seen = {"looked_at": int((looked >= 0).sum()), "black": int((looked > 0).sum())}
            rows.append({"camera": camera, "bag": bag, **audited.row, **seen})
            audits.append((bag, rows[-1], audited))
            dropped += [(camera, *missing) for missing in audited.dropped]
        # a bag of some seconds has a large share of few pictures
        lost, pictures = (sum(row[key] for _, row, _ in audits) for key in ("lost", "pictures"))
        for bag, row, audited in audits:
            findings_of = judge(row, audited, bag, bool(film), lost / (lost + pictures))
            findings_of += _by_what(bag, film) if film else []
            found += [(f"{sequence}/{camera}", *finding) for finding in findings_of]
        dropped += [(camera, *missing) for missing in _between_bags(own)]
    tables.write(out, "stamp_audit", {key: [row[key] for row in rows] for key in tables.columns_of("stamp_audit")})
    dropped.sort()
    columns = zip(tables.columns_of("dropped_frames"), zip(*dropped, strict=True) if dropped else [()] * 4, strict=True)
    tables.write(out_dropped, "dropped_frames", dict(columns))
    tables.write_findings(findings, found)


def audit(frames: Table, repeated: Bools) -> Audit:
    """`Audit` of the pictures of one camera in one bag: rows of the `frames` table as recorded, F of them.

    `repeated` (F,) says whether a picture has the bytes of the one before it in the bag.
    """
    glitches = _glitches(frames)
    order = np.argsort(frames["stamp_ns"], kind="stable")
    frames, repeated = tables.rows(frames, order), repeated[order]
    stamps, receive, number = frames["stamp_ns"], frames["receive_ns"], frames["frame"]
    same_stamp = np.r_[False, np.diff(stamps) == 0]
    same_picture = repeated & ~same_stamp
    dropped = [(int(number[i]), int(stamps[i]), "same_stamp") for i in np.flatnonzero(same_stamp)]
    dropped += [(int(number[i]), int(stamps[i]), "same_picture") for i in np.flatnonzero(same_picture)]
    row = {
        "pictures": len(stamps),
        "same_stamp": int(same_stamp.sum()),
        "same_picture": int(same_picture.sum()),
        "out_of_order": int((np.diff(stamps[np.argsort(receive, kind="stable")]) < 0).sum()),
        "restored": int(np.isfinite(frames["restored_s"]).sum()),
        **_lag(stamps, receive),
    }
    stamps, receive, number = stamps[~same_stamp], receive[~same_stamp], number[~same_stamp]
    ahead = np.diff(stamps) - np.diff(receive)
    jumped = np.abs(ahead) > JUMP_NS
    jumps = tuple((int(number[i]), float(np.diff(stamps)[i]) / 1e9) for i in np.flatnonzero(jumped))
    # one clock throughout, so that a jump is neither a gap nor jitter
    shift = np.r_[0, np.cumsum(np.where(jumped, ahead, 0))]
    tick, first, period = _grid((stamps - stamps[0] - shift) / 1e9)
    off = (stamps - stamps[0] - shift) / 1e9 - (first + period * tick)
    steps = np.diff(tick)
    row |= {
        "nominal_hz": nominal_fps(stamps) if len(stamps) > 1 else np.nan,
        "rate_hz": 1 / period,
        "jitter_ms": float(1e3 * np.sqrt(np.mean(off**2))),
        "jitter_max_ms": float(1e3 * np.abs(off).max()),
        "lost": int((steps - 1).sum()),
        "gaps": int((steps > 1).sum()),
        "longest_gap_s": float(np.diff(stamps - shift).max() / 1e9) if len(stamps) > 1 else np.nan,
        "clock_jumps": len(jumps),
    }
    late = (receive - stamps) / 1e9 - row["lag_ms"] / 1e3 > BEHIND_PERIODS * period
    for i in np.flatnonzero(steps > 1):
        reason = "recorder_behind" if late[i] or late[i + 1] else "not_sent"
        missing = first + period * np.arange(tick[i] + 1, tick[i + 1])
        dropped += [(int(number[i]), int(stamps[0] + shift[i] + round(1e9 * at)), reason) for at in missing]
    return Audit(row, tuple(sorted(dropped)), jumps, glitches)


def of_video(audited: Audit, lost: Sequence[tuple[int, int, str]]) -> Audit:
    """The audit of a video, which has no lags, and of which pictures cannot be read: `lost` as of `with_lost`."""
    audited = with_lost(audited, lost)
    return replace(audited, row=audited.row | dict.fromkeys(LAGS, np.nan))


def with_lost(audited: Audit, lost: Sequence[tuple[int, int, str]]) -> Audit:
    """The audit where it is known of pictures that they cannot be read: `lost` (frame before, stamp_ns, reason), those
    in gaps of the stamps among them."""
    known = np.array([stamp for _, stamp, _ in lost], np.int64)
    near = 0.5e9 / audited.row["rate_hz"] if audited.row["rate_hz"] else 0.0
    others = [
        one for one in audited.dropped
        if one[2] not in ("not_sent", "recorder_behind") or not (np.abs(known - one[1]) < near).any()
    ]  # fmt: skip
    again = sum(one[2] in ("not_sent", "recorder_behind") for one in others)
    dropped = sorted([*others, *((frame, stamp, reason) for frame, stamp, reason in lost)])
    # those that come at even steps leave none between the stamps
    gaps = {frame for frame, _, reason in dropped if reason not in REPEATED}
    row = audited.row | {"lost": again + len(lost), "gaps": len(gaps)}
    return replace(audited, row=row, dropped=tuple(dropped))


def _undecoded(lost: Sequence[tuple[int, str]], own: Table) -> list[tuple[int, int, str]]:
    """(frame before, stamp_ns, why) of messages without a picture, `lost` (stamp_ns, why), those with one in another
    bag left out."""
    there = set(stamps.header_ns(own).tolist())
    before = np.maximum(np.searchsorted(own["stamp_ns"], [stamp for stamp, _ in lost]) - 1, 0)
    return [
        (int(own["frame"][i]), stamp, why) for i, (stamp, why) in zip(before, lost, strict=True) if stamp not in there
    ]


def _by_what(bag: str, film: dict[str, Any]) -> list[tuple[str, str, str]]:
    """What the stamps of a video are by: `film` as of `video_starts.told`."""
    text = f"{bag}: {SOURCES[film['source']]}"
    if film["by_rate"]:
        text = text.replace(OWN_TIMES, RATE)
    if film["start_sigma_s"]:
        text += f", to {film['start_sigma_s']:.1g} s (1 sigma)"
    if film["apart_sigma_s"] < film["start_sigma_s"]:
        text += f", and to {film['apart_sigma_s']:.1g} s against the cameras with the same sound or flash"
    if film["tick_s"] > COARSE_TICK_S:
        text += f"; its times are in steps of {1e3 * film['tick_s']:.1f} ms"
    noted = [("warning", "video_stamps", f"{bag}: the file with its stamps {film['note']}")] if film["note"] else []
    return [("info", "video_stamps", text), *noted]


def _glitches(frames: Table) -> tuple[stamps.Glitch, ...]:
    """The runs of frames whose stamps were restored, from rows as recorded."""
    by, number = frames["restored_s"], frames["frame"]
    wrong = np.isfinite(by)
    begins = wrong & np.r_[True, (by[1:] != by[:-1]) | ~wrong[:-1]]
    ends = wrong & np.r_[begins[1:] | ~wrong[1:], True]
    return tuple(
        stamps.Glitch(int(number[a]), int(number[b]), float(by[a]), float(frames["restored_sigma_s"][a]))
        for a, b in zip(np.flatnonzero(begins), np.flatnonzero(ends), strict=True)
    )


def _grid(seconds: Floats) -> tuple[Ints, float, float]:
    """Which tick (F,) of a regular clock each picture of rising `seconds` (F,) is, the time of tick 0 and the period.

    A stamp that is late by more than half a period would be taken for the next tick, and the picture before it for
    lost: of two pictures on one tick the first is moved back.
    """
    if len(seconds) < 3:
        return np.arange(len(seconds)), 0.0, float(seconds[-1]) if len(seconds) == 2 else np.nan
    period = float(np.median(np.diff(seconds)))
    tick = np.r_[0, np.cumsum(np.maximum(np.rint(np.diff(seconds) / period), 0))]
    count = np.arange(len(seconds))
    for _ in range(3):
        tick = np.minimum.accumulate((tick - count)[::-1])[::-1] + count
        line = np.polyfit(tick, seconds, 1)
        off = seconds - np.polyval(line, tick)
        near = np.abs(off - np.median(off)) <= max(3 * 1.4826 * np.median(np.abs(off - np.median(off))), 1e-6)
        period, first = np.polyfit(tick[near], seconds[near], 1) if near.sum() > 2 else line
        tick = np.rint((seconds - first) / period)
    tick = np.minimum.accumulate((tick - count)[::-1])[::-1] + count
    return (tick - tick[0]).astype(int), float(first + period * tick[0]), float(period)


def _lag(stamps: Ints, receive: Ints) -> dict[str, float]:
    """Columns about receive against header stamps (F,) ns."""
    lag = (receive - stamps) / 1e6
    low, middle, high = np.percentile(lag, [5, 50, 95])
    seconds = (stamps - stamps[0]) / 1e9
    drift, good = np.nan, np.abs(lag - middle) <= _loose(lag - middle)
    for _ in range(3):
        if good.sum() < 10 or np.ptp(seconds[good]) < 1:
            break
        line = np.polyfit(seconds[good], lag[good], 1)
        off = lag - np.polyval(line, seconds)
        sigma = 1e3 * np.std(off[good]) / (np.sqrt(good.sum()) * np.std(seconds[good]))
        # the late ones are far away and would turn the line
        drift, good = 1e3 * line[0] if sigma < MOST_DRIFT_SIGMA_PPM else np.nan, np.abs(off) <= _loose(off)
    return {
        "lag_ms": float(middle),
        "lag_spread_ms": float(high - low),
        "lag_max_ms": float(lag.max() - middle),
        "drift_ppm": float(drift),
    }


def _loose(off: Floats) -> float:
    """Three robust standard deviations of what is off by `off` (F,) ms."""
    return max(3 * 1.4826 * np.median(np.abs(off)), 1e-3)


def _between_bags(frames: Table) -> list[tuple[int, int, str]]:
    """(frame, stamp_ns, reason) of the pictures of one camera that are missing where its recording changes bags."""
    stamps = frames["stamp_ns"]
    steps = np.diff(stamps)
    period = 1e9 / nominal_fps(stamps)
    changed = (frames["bag"][1:] != frames["bag"][:-1]) & (steps > GAP_PERIODS * period)
    lost = []
    for i in np.flatnonzero(changed):
        ticks = int(max(np.rint(steps[i] / period), 2))
        missing = stamps[i] + steps[i] * np.arange(1, ticks) // ticks
        lost += [(int(frames["frame"][i]), int(stamp), "between_bags") for stamp in missing]
    return lost


def _repeats(frames: Table, data_root: Path) -> Bools:
    """Mask (N,) of the rows of a `frames` table whose message has the bytes of the one before in its bag."""
    same = np.zeros(len(frames["frame"]), bool)
    for bag in tables.ordered_unique(frames["bag"]):
        mine = np.flatnonzero(frames["bag"] == bag)
        found = rosbag.repeated(Path(data_root) / bag, tables.ordered_unique(frames["topic"][mine]))
        keys = zip(*(frames[key][mine].tolist() for key in ("topic", "receive_ns", "nth")), strict=True)
        same[mine] = [key in found for key in keys]
    return same


def _black(frames: Table, data_root: Path) -> Ints:
    """(F,) of one camera: 1 where a picture that was looked at is black, 0 where it is not, -1 where none looked."""
    chosen = np.unique(np.linspace(0, len(frames["frame"]) - 1, min(len(frames["frame"]), LOOK_AT)).round().astype(int))
    black = np.full(len(frames["frame"]), -1)
    for row, picture in rosbag.read_pictures(tables.rows(frames, chosen), data_root):
        black[chosen[row]] = np.percentile(picture[::4, ::4], 99) < BLACK_LEVEL
    return black


def _why(audited: Audit) -> str:
    """What else than gaps between the stamps says that pictures are lost, the most frequent causes first."""
    cut = sum(reason == "cut_off" for _, _, reason in audited.dropped)
    frames = [frame for frame, _, reason in audited.dropped if reason == NOT_DECODED]
    text = f"; {cut} of them behind the end of the file" if cut else ""
    if frames:
        text += f"; {len(frames)} of them cannot be decoded, the first after frame {min(frames)}"
    whys = Counter(audited.undecoded).most_common()
    return text + (": " if whys else "") + ", ".join(f"{why} ({count})" for why, count in whys)


def judge(
    row: dict[str, Any], audited: Audit, bag: str, is_video: bool = False, lost_share: float = 0.0
) -> list[tuple[str, str, str]]:
    """What a person should see of an audit, of its row in `stamp_audit`: (severity, code, text) tuples. `lost_share`:
    share of the pictures that the whole recording lost."""
    found = []
    period_ms = 1e3 / row["nominal_hz"] if row["nominal_hz"] else np.nan

    def add(bad: bool, code: str, text: str) -> None:
        found.append(("warning" if bad else "info", code, f"{bag}: {text}"))

    if row["lost"]:
        share = row["lost"] / (row["lost"] + row["pictures"])
        behind = sum(reason == "recorder_behind" for _, _, reason in audited.dropped)
        late = f", {behind} of them while the recorder was behind" if behind else ""
        gaps = f"in {many(row['gaps'], 'gap')}, the longest {row['longest_gap_s']:.2f} s"
        text = f"{many(row['lost'], 'picture')} lost ({share:.1%}) {gaps}{late}{_why(audited)}"
        add(lost_share > MOST_LOST, "pictures_lost", text)
    for code, what in REPEATED.items():
        if row[code]:
            share = row[code] / row["pictures"]
            add(share > MOST_REPEATED, code, f"{many(row[code], 'picture')} ({share:.1%}) with the {what}")
    if row["black"]:
        add(True, "black_pictures", f"{row['black']} of {row['looked_at']} pictures looked at are black")
    if row["out_of_order"]:
        add(False, "out_of_order", f"{many(row['out_of_order'], 'picture')} received after a later one")
    for one in audited.glitches:
        frames = f"frame {one.first}" if one.first == one.last else f"frames {one.first} to {one.last}"
        text = (
            f"the header clock is {abs(one.early_s):.2f} s {'early' if one.early_s > 0 else 'late'} in {frames} and "
            f"nowhere else; their stamps are restored by when they were received, to {1e3 * one.sigma_s:.1f} ms"
        )
        add(True, "stamps_restored", text)
    for frame, step in audited.jumps:
        text = f"the header clock jumps by {step:.1f} s after frame {frame}; offsets before it do not hold after it"
        found.append(("error", "clock_jump", f"{bag}: {text}, so split the sequence there"))
    if row["jitter_ms"] > MOST_JITTER_PERIODS * period_ms:
        text = f"stamps are {row['jitter_ms']:.1f} ms rms off a regular rate, at most {row['jitter_max_ms']:.1f} ms"
        # a video of a variable rate says so itself
        add(not is_video, "stamp_jitter", text)
    if abs(row["rate_hz"] / row["nominal_hz"] - 1) > MOST_RATE_OFF:
        add(False, "rate", f"{row['rate_hz']:.3f} pictures a second, not {row['nominal_hz']:g}")
    if abs(row["lag_ms"]) > JUMP_NS / 1e6:
        text = (
            f"header and receive stamps are {row['lag_ms'] / 1e3:.1f} s apart: the clocks of camera and recorder differ"
        )
        add(False, "clocks_differ", text)
    return found
