"""When a motion capture began, by the log that `dior trigger` wrote.

INPUTS   the log (docs/formats.md), one JSON object per line; when the pictures were taken; the names of captures
OUTPUTS  the `Capture` that the pictures are of
Times are ns since the Unix epoch by the clock of the computer that ran `dior trigger`.
"""

import io
import json
import os
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, TypeGuard

from dior.errors import DiorError, nearest
from dior.project.plain_text import bytes_of

NS = 1e9
# chosen: a year of captures
MOST_BYTES = 1 << 26
# the year 2262, where int64 ends
LATEST_NS = 2**63 - 1


@dataclass(frozen=True)
class Capture:
    """`start_ns`: the packet's arrival plus its Delay; `stop_ns` the same of its stop, None where none came."""

    name: str
    start_ns: int
    stop_ns: int | None = None


def read(path: str | os.PathLike[str]) -> list[Capture]:
    """All captures of a log, in its order. A line that is torn, by a power cut for example, is left out.

    Raises DiorError where there is no such file or nothing of a trigger log in it.
    """
    path = Path(path)
    if not path.is_file():
        raise DiorError(f"{path}: there is no such trigger log; check `trigger_log` in sequences.tsv and `data_root`")
    captures: list[Capture] = []
    known = 0
    for event in map(_event, io.BytesIO(bytes_of(path, path, MOST_BYTES))):
        known += "event" in event
        name, start, stop = event.get("name"), event.get("start_ns"), event.get("stop_ns")
        if event.get("event") == "start" and isinstance(name, str) and _is_time(start):
            captures.append(Capture(name, start))
        if event.get("event") == "stop" and _is_time(stop):
            going = [i for i, capture in enumerate(captures) if capture.name == name and capture.stop_ns is None]
            if going:
                captures[going[-1]] = replace(captures[going[-1]], stop_ns=stop)
    if not known:
        raise DiorError(f"{path}: no log of `dior trigger`: no line of it is a JSON object with an `event`")
    return captures


def _is_time(ns: Any) -> TypeGuard[int]:
    return isinstance(ns, int) and 0 <= ns <= LATEST_NS


def _event(line: bytes) -> dict[str, Any]:
    try:
        event = json.loads(line)
    except (ValueError, RecursionError):
        return {}
    return event if isinstance(event, dict) else {}


def choose(
    captures: list[Capture], first_ns: int, last_ns: int, path: str | os.PathLike[str], name: str = "", c3d: str = ""
) -> Capture:
    """The `Capture` that ran while the pictures were taken, from `first_ns` to `last_ns`.

    `name`: what the sheet calls it; without it the captures that are called like the file `c3d`, if any, are looked
    at, else all. A capture whose stop is missing ends when the next begins. Raises DiorError where none ran then, and
    where another one ran for more than half as long.
    """
    if not captures:
        raise DiorError(f"{path}: no capture has begun in this trigger log; leave `trigger_log` empty in sequences.tsv")
    ends = [_end(captures, i) for i in range(len(captures))]
    asked = [i for i, capture in enumerate(captures) if capture.name == name]
    if name and not asked:
        raise DiorError(
            f"{path}: no capture of this trigger log is called '{name}'{nearest(name, {c.name for c in captures})}"
        )
    named = [i for i, c in enumerate(captures) if c.name.casefold() == Path(c3d).stem.casefold()]
    ran = {
        i: min(last_ns, ends[i]) - max(first_ns, captures[i].start_ns) for i in asked or named or range(len(captures))
    }
    best, *others = sorted(ran, key=lambda i: ran[i], reverse=True)
    if ran[best] <= 0:
        raise DiorError(
            f"{path}: {_lag(captures[best], first_ns)}, so it did not run while the pictures were taken ("
            f"{_utc(first_ns)} to {_utc(last_ns)}). Is it the log of that day, and were the clocks of the computers "
            "set? The log holds the NTP state of one of them. Leave `trigger_log` empty to do without"
        )
    if others and ran[others[0]] > ran[best] / 2:
        raise DiorError(
            f"{path}: '{captures[best].name}' ({_utc(captures[best].start_ns)}) and '{captures[others[0]].name}' "
            f"({_utc(captures[others[0]].start_ns)}) both ran while the pictures were taken; write the name of the "
            "right one behind the path in sequences.tsv, as in `trigger.jsonl#walk_03`"
        )
    return captures[best]


def _end(captures: list[Capture], i: int) -> float:
    stop_ns = captures[i].stop_ns
    if stop_ns is not None:
        return stop_ns
    later = [capture.start_ns for capture in captures if capture.start_ns > captures[i].start_ns]
    return min(later, default=float("inf"))


def _lag(capture: Capture, first_ns: int) -> str:
    lag = (capture.start_ns - first_ns) / NS
    return f"the capture '{capture.name}' began {abs(lag):.1f} s {'after' if lag > 0 else 'before'} the first picture"


def _utc(ns: int) -> str:
    return f"{datetime.fromtimestamp(ns / NS, UTC):%Y-%m-%d %H:%M:%S} UTC"
