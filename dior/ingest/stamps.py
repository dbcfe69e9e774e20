"""Header stamps that were wrong for a while, found and restored by the receive stamps.

INPUTS   header and receive stamps (F,) int64 ns of one camera in one bag, in recorded order
OUTPUTS  `Restored`: stamps of one clock throughout, or a DiorError that says where the header's clock was set

A header's clock that is set while recording (NTP, a driver that starts its count anew) puts pictures earlier or later
than they are; ordered by stamp they would be numbered among others. What tells is the lag, receive minus header stamp:

- a stamp that goes back between two messages, and by it into a place that another picture has;
- a lag below the usual one, which no network can do: pictures are never received before they are sent;
- the first pictures' lag above the usual one until the header's clock jumps forward between two regular arrivals.

A picture that the network was slow with has a large lag, too, but a stamp in its place: it is left alone, also where it
was received after a later one.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from dior.arrays import Bools, Floats, Ints, Table
from dior.errors import DiorError

# chosen, shares of a recording: what is wrong for longer, to its end or from its beginning, was set and not disturbed,
# and which of the clocks counts is a person's to say; and if what is wrong is too much to be told from what is right
MOST_AT_AN_END, MOST_RESTORED = 0.25, 0.4
# chosen: a normal error is beyond that many standard deviations once in a million pictures
CERTAIN_SD = 5.0
LEAST_S = 2e-3  # chosen: lags vary by more than that in any network
# chosen: a network now and then swaps two pictures; more is a driver that does not stamp them in order
MOST_OUT_OF_ORDER = 0.1
# chosen: more than a recorder's lag varies; what is less and goes back counts as pictures out of order
JUMP_NS = 1_000_000_000
ALIKE = 0.4  # chosen: share of lags that are nearest together, below a half
FEWEST_FIRST = 3  # chosen: pictures at the beginning whose lag is alike; one or two a recorder's start explains
CAUGHT_UP_S = 1.0  # chosen: within that a network that was slow has caught up
SOON = 5  # chosen: pictures among whose arrivals there is a late one, where some came at once
NEIGHBOURS = 10  # chosen: pictures before and after, by which a rate is known that drifts by no part of a period there
# chosen, of a period: above it the pictures' rate does not tell where between two others a picture belongs
IRREGULAR = 0.15


@dataclass(frozen=True)
class Glitch:
    """Pictures `first` to `last`, in recorded order, whose stamps were `early_s` too early, known to `sigma_s`."""

    first: int
    last: int
    early_s: float
    sigma_s: float


@dataclass(frozen=True, eq=False)
class Restored:
    """`stamp_ns` (F,), the `shift_ns` (F,) that was added to the header's, its standard error `sigma_s` (F,)."""

    stamp_ns: Ints
    shift_ns: Ints
    sigma_s: Floats
    glitches: tuple[Glitch, ...]


def restored(stamp_ns: Ints, receive_ns: Ints, where: str) -> Restored:
    """`Restored` from stamps (F,) in recorded order.

    Raises DiorError, beginning with `where`, where more pictures than `MOST_RESTORED`, or at an end `MOST_AT_AN_END`,
    are on another clock than the rest, and where the receive stamps do not tell what the stamps should be.
    """
    nothing = Restored(stamp_ns, np.zeros(len(stamp_ns), np.int64), np.zeros(len(stamp_ns)), ())
    header, receive = (stamp_ns - stamp_ns[:1]) / 1e9, (receive_ns - receive_ns[:1]) / 1e9
    steps = np.diff(header)
    if len(header) < 4 or not (steps > 0).any():
        return nothing
    period = _period(header)
    lag, sd = _beyond_usual(header, receive)
    found = list(_wrong(header, receive, lag, sd, period))
    if not found:
        return nothing
    longest = max(found, key=lambda block: block[1] - block[0])
    at_an_end = [last + 1 - first for first, last in found if not first or last + 1 == len(header)]
    count = sum(last + 1 - first for first, last in found)
    if count > MOST_RESTORED * len(header) or max(at_an_end, default=0) > MOST_AT_AN_END * len(header):
        first, last = longest
        # either end: what comes before the first picture is not known
        at = first if first else last + 1
        by = header[at] - header[at - 1] - (receive[at] - receive[at - 1])
        raise DiorError(
            f"{where}: the header clock was set {'back' if by < 0 else 'forward'} by {abs(by):.1f} s after picture "
            f"{at - 1} of the recording, so stamps before and after it mean different times; split the bag there and "
            "give the parts as two sequences"
        )
    good = np.ones(len(header), bool)
    for first, last in found:
        good[first : last + 1] = False
    shift, sigma, glitches = np.zeros(len(header)), np.zeros(len(header)), []
    for first, last in found:
        early, error = _early(header, lag, good, first, last, period, sd, where)
        shift[first : last + 1], sigma[first : last + 1] = early, error
        glitches.append(Glitch(first, last, early, error))
    shift_ns = np.rint(1e9 * shift).astype(np.int64)
    return Restored(stamp_ns + shift_ns, shift_ns, sigma, tuple(glitches))


def header_ns(table: Table) -> Ints:
    """Stamps (F,) ns as the headers have them, of rows of the `frames` table."""
    return np.asarray(table["stamp_ns"] - np.rint(1e9 * np.nan_to_num(table["restored_s"])).astype(np.int64))


def _beyond_usual(header: Floats, receive: Floats) -> tuple[Floats, float]:
    """Lags (F,) s beyond the usual one, which may drift, and their robust standard deviation."""
    lag = receive - header
    # those that are nearest together: of two clocks, unlike the median, that takes one
    ordered, most = np.sort(lag), int(ALIKE * len(lag))
    width = ordered[most:] - ordered[: len(lag) - most]
    start = int(np.argmin(width))
    off = lag - np.median(ordered[start : start + most + 1])
    near = np.abs(off) <= max(3 * width[start], LEAST_S)
    for _ in range(3):
        if near.sum() < 10 or not np.ptp(receive[near]):
            break
        off = lag - np.polyval(np.polyfit(receive[near], lag[near], 1), receive)
        near = np.abs(off) <= max(3 * 1.4826 * np.median(np.abs(off[near])), LEAST_S)
    return off, float(1.4826 * np.median(np.abs(off[near])))


def _wrong(header: Floats, receive: Floats, lag: Floats, sd: float, period: float) -> Iterator[tuple[int, int]]:
    """First and last picture of each run whose stamps are of another clock; in order, none within another."""
    count, done = len(header), 0
    step, arrival = np.diff(header, prepend=header[0]), np.diff(receive, prepend=receive[0])
    ahead = step - arrival
    impossible = lag < -max(period / 2, CERTAIN_SD * sd, LEAST_S)
    first = _first_early(step, arrival, lag, sd, period)
    if first:
        yield 0, first - 1
        done = first
    for i in range(done, count):
        if i < done:
            continue
        if impossible[i]:
            last = i
            while last + 1 < count and impossible[last + 1]:
                last += 1
            # a recorder that catches up gets many at once
            began = i > 0 and ahead[i] > -lag[i] / 2 and arrival[max(i - SOON, 1) : i + 1].mean() > period / 2
            ended = last + 1 < count and step[last + 1] < period + lag[last] / 2
            done = last + 1
            if began or ended:
                yield i, last
        elif i and step[i] < 0 and not impossible[i - 1]:
            last = _end_of_early(header, lag, i, period)
            if not _late_arrival(header, i, last, period):
                yield i, last
            done = last + 1


def _first_early(step: Floats, arrival: Floats, lag: Floats, sd: float, period: float) -> int:
    """How many pictures at the beginning have stamps that are too early; 0 if none."""
    least, soon = max(period, CERTAIN_SD * sd, LEAST_S), round(CAUGHT_UP_S / period)
    usual = np.flatnonzero(lag < least)
    end = FEWEST_FIRST
    while end < len(lag) and lag[:end].min() > least:
        early = float(np.percentile(lag[:end], 20))
        jumped = step[end] > period + early / 2 and lag[end : end + soon].min() < early / 2
        # pictures that wait for a network that is slow come at once
        regular = max(arrival[max(end - SOON, 1) : end].mean(), arrival[1:end].mean()) > period / 2
        if jumped and regular and lag[:end].min() > 0.75 * early:
            return end
        end += 1
        if len(usual) and end > usual[0]:
            break
    return 0


def _end_of_early(header: Floats, lag: Floats, first: int, period: float) -> int:
    """The last picture of a run that begins with a stamp that goes back."""
    step, soon = np.diff(header, prepend=header[0]), round(CAUGHT_UP_S / period)
    early, last = period - step[first], len(step) - 1
    jumped, caught = step > period + early / 2, np.diff(lag, prepend=lag[0]) < -early / 2
    for i in range(first + 1, len(step)):
        # the network may be slow with the first that are right again
        if lag[i] < early / 2 or (jumped[i] and caught[i] and lag[i : i + soon].min() < early / 2):
            last = i - 1
            break
    # what would come after the next one was right already
    while (
        last + 1 < len(step)
        and header[last] + early > header[last + 1] - period / 2
        and jumped[first + 1 : last + 1].any()
    ):
        last = first + int(np.flatnonzero(jumped[first + 1 : last + 1])[-1])
    return last


def _late_arrival(header: Floats, first: int, last: int, period: float) -> bool:
    """Whether the stamps of pictures `first` to `last` have places of their own among the others, or are those of
    messages that are there twice, and none is free where they were received: then they are right, and the network was
    late."""
    own, others = header[first : last + 1], np.delete(header, np.arange(first, last + 1))
    apart = np.abs(own[:, None] - others).min(axis=1)
    if ((apart > 0) & (apart < period / 2)).any():
        return False
    if last + 1 == len(header):
        # what is there twice may as well be early by whole periods
        return bool(apart.all())
    return header[last + 1] - header[first - 1] < (len(own) + 0.5) * period


def _early(
    header: Floats, lag: Floats, good: Bools, first: int, last: int, period: float, sd: float, where: str
) -> tuple[float, float]:
    """By how much (s) the stamps of pictures `first` to `last` are too early, and its standard error.

    The lag tells it; where the rate is regular, so does the place between the pictures before and after.
    """
    own = header[first : last + 1]
    # a network can only add to a lag
    early = float(np.percentile(lag[first : last + 1], 20))
    before, after = header[:first][good[:first]], header[last + 1 :][good[last + 1 :]]
    least = before[-1] + period - own[0] if len(before) else -np.inf
    most = after[0] - period - own[-1] if len(after) else np.inf
    free = most - least
    if free > period / 2 and sd > period:
        raise DiorError(
            f"{where}: the header stamps of pictures {first} to {last} of the recording are about {abs(early):.1f} s "
            f"off, and the receive stamps, which vary by {1e3 * sd:.0f} ms, do not tell what they should be; exclude "
            "the sequence, or give a copy of the bag without these pictures"
        )
    if free > -period / 2:
        early = min(max(early, least), most)
    jitter = _jitter(header[good], period)
    if jitter > IRREGULAR * period or (free > period / 2 and 3 * sd > period / 2):
        return early, max(sd, LEAST_S)
    near = np.concatenate([before[-NEIGHBOURS:], after[:NEIGHBOURS]])
    early += period * _wrapped((_phase(near, period) - _phase(own, period)) - early / period)
    # the lag of one or two may be the network's, and then any free place may be theirs
    doubt = free / 12**0.5 if len(own) < FEWEST_FIRST and period / 2 < free < np.inf else 0.0
    return float(early), float(np.hypot(max(jitter, 1e-6), doubt))


def _phase(header: Floats, period: float) -> float:
    """Where in its period a regular clock has its ticks, as a share of it, by the median of stamps (N,) s."""
    turns = header / period
    mean = float(np.angle(np.exp(2j * np.pi * turns).mean())) / (2 * np.pi)
    return mean + float(np.median(_wrapped(turns - mean)))


def _wrapped(turns: Any) -> Any:
    return turns - np.rint(turns)


def _period(header: Floats) -> float:
    """Period (s) of a regular clock from stamps (F,) s with gaps: by steps of more and more pictures."""
    steps = np.diff(header)
    period = float(np.median(steps[steps > 0]))
    for apart in (8, 64):
        if len(header) > 2 * apart:
            steps = header[apart:] - header[:-apart]
            steps = steps[steps > period / 2]
            period = float(np.median(steps / np.rint(steps / period)))
    return period


def _jitter(header: Floats, period: float) -> float:
    """Robust standard deviation (s) of a stamp about a regular rate, from the steps between neighbours."""
    return float(1.4826 * np.median(np.abs(_wrapped(np.diff(header) / period))) * period / np.sqrt(2))
