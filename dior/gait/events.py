"""When heels strike and toes leave the floor.

INPUTS   `Tracks`. OUTPUTS `Events`: a row per event, with its uncertainty, and why it is not to be used, if so.
A foot swings while it is faster than the body. A heel strikes a little after its forward speed has fallen below a share
of the walking speed, a toe is off when its own rises above one, the swing between them: a foot's velocity as by
O'Connor et al., Gait & Posture 25 (2007) 469-474, the walking speed as its yardstick as by Bruening and Ridge, Gait &
Posture 39 (2014) 472-477. The shares lie where the speed changes fastest, so that noise moves the crossing least and
smoothing hardly at all (at its strike a heel is nearly at rest, and a track that was smoothed gets there late); it
holds on a treadmill and at any speed. Where heel and toe are furthest from the pelvis (Zeni et al., Gait & Posture 27
(2008) 710-714) strikes of the real walks of tests/gait come 40 ms early, and where they are accelerated most (Hreljac
and Marshall, J. Biomech. 33 (2000) 783-786) toe offs scatter by 30 ms.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from dior.arrays import Bools, Floats, Ints, Texts, runs_of
from dior.gait import progression
from dior.gait.progression import Progression
from dior.gait.tracks import (
    PELVIS_BRIDGED_S,
    SIDES,
    Tracks,
    bridged,
    curve,
    known_at,
    velocity,
    velocity_variance,
)

# s, of the times at which everything is looked at; events lie between them
STEP_S = 0.005
# forward speeds of the heel before its strike and of the toe after it is off, walking speeds, and by which share of a
# stride the strike is later and the toe off earlier; chosen on the events of two real walks (tests/gait). At its strike
# a heel moves at 0.3: lower shares scatter less there, higher ones are moved less by smoothing
STRIKE_SHARE, LATER = 0.6, 0.021
OFF_SHARE, EARLIER = 1.2, 0.010
# the same of runners' heels, which come down at another speed; chosen on simulated ones, no real one was there. Their
# toes are off when they rise with this share of the highest speed at which they do: how fast they go forward then, as
# the ankle stretches, differs among runners, while leaving the floor is to rise from it (De Witt, J. Biomech. 43 (2010)
# 3067-3069, looks at the same coordinate). Chosen: half, where noise of either moves the crossing least
STRIKE_SHARE_RUNNING, LATER_RUNNING = 0.6, 0.046
RISEN = 0.5
# a foot that swings is at least this fast at once, walking speeds; chosen: it must make up for its stance, so its
# mean is above 1.4 in any gait
SWING_SHARE = 1.25
# chosen: shorter is no swing, and a shorter break none between two
SHORTEST_S = 0.1
# strides of more than this many usual ones have one in them that was not found; chosen
LONGEST = 1.6
# who has a foot slower than this, walking speeds, for less than this share of the stride runs; chosen: real walkers
# have it for 0.56, and simulated runners for 0.43
AT_REST, RUNNING_BELOW = 0.3, 0.5
# at an end of what is known an event may be another one's half; chosen
END_S = 0.1
# of a found belt's velocity, which heels and toes that roll hide; chosen on simulated walks (benchmarks.gait)
BELT_SHARE = 0.015
# of a stance, in which the heel rests, and the toe: after the strike has ended, before they rise; chosen
RESTS, TOE_RESTS = (0.2, 0.45), (0.3, 0.55)
# s, what is left of an event without any error of a label: how one step differs from the next, and how people and the
# feet of one person differ, in when a foot has that speed. Chosen on simulated people (benchmarks.gait), walking and
# running; strikes of the two real walks scatter more, by 15 ms, with what whoever marked them did
STEP_SD_S, SIDE_SD_S, PERSON_SD_S, RUNNER_SD_S = 0.004, 0.003, 0.0065, 0.015


@dataclass(frozen=True, eq=False)
class Events:
    """Rows in the order of time: `seconds` (E,), `side` (E,) 0 left and 1 right, `strike` (E,) or else toe off.

    `sigma_s` (E,): of what an event has of its own; `shared_s`: what all events of a kind and side have alike, so that
    times from strike to strike are free of it. `reason` (E,): "" or why no parameter is made of it: `turn`, `standing`,
    `end`. `turns` (N, 2) s: when each begins and ends. `running`, and the velocity (2,) m/s of a treadmill's `belt`
    with its `belt_sigma`, where that was found.
    """

    seconds: Floats
    side: Ints
    strike: Bools
    sigma_s: Floats
    reason: Texts
    running: bool
    belt: Floats
    belt_sigma: float = 0.0
    shared_s: float = PERSON_SD_S
    turns: Floats = field(default_factory=lambda: np.zeros((0, 2)))

    def whole_sigma_s(self, clock_s: float = 0.0) -> Floats:
        """Standard error (E,) s of each event, `clock_s` that of the clock that its time is told on."""
        return np.sqrt(self.sigma_s**2 + self.shared_s**2 + SIDE_SD_S**2 + clock_s**2)

    def stances(self, side: int) -> Ints:
        """The strike and the toe off (S, 2) of each stance of a foot, rows of which both were found."""
        own = np.flatnonzero(self.side == side)
        pairs = np.stack([own[:-1], own[1:]], axis=-1)
        return pairs[self.strike[pairs[:, 0]] & ~self.strike[pairs[:, 1]]]


@dataclass(frozen=True, eq=False)
class _Foot:
    """Of one foot at all times (N,): forward speeds in walking speeds and their standard errors, m/s at which the toe
    rises and its standard error; and what is known."""

    heel: Floats
    toe: Floats
    middle: Floats
    heel_sigma: Floats
    toe_sigma: Floats
    rise: Floats
    rise_sigma: Floats
    known: Bools


def find(tracks: Tracks, belt: Floats | None = None) -> Events:
    """`Events` of a walk. `belt` (2,) m/s: velocity of a treadmill's belt; None: found, if it is one."""
    count = int(np.floor((tracks.seconds[-1] - tracks.seconds[0]) / STEP_S)) + 1 if len(tracks.seconds) > 1 else 0
    if count < round(2 * progression.STRIDE_HALF_S / STEP_S):
        return _events([], False, np.zeros(2))
    times = tracks.seconds[0] + STEP_S * np.arange(count)
    if belt is not None:
        return _found(tracks.on_belt(belt), times, np.asarray(belt, float))
    belt = progression.belt(tracks, times)
    if not belt.any():
        return _found(tracks, times, belt)
    more, sigma = _slips(tracks.on_belt(belt), _found(tracks.on_belt(belt), times, belt))
    return replace(_found(tracks.on_belt(belt + more), times, belt + more), belt_sigma=sigma)


def _slips(tracks: Tracks, events: Events) -> tuple[Floats, float]:
    """Velocity (2,) m/s that heels and toes at rest still have, what the velocity of the belt lacks; and its sigma."""
    each = []
    for track, rests in ((tracks.heel, RESTS), (tracks.toe, TOE_RESTS)):
        for side in range(len(SIDES)):
            strike, off = events.seconds[events.stances(side)].T
            if len(strike):
                along = curve(tracks.seconds, bridged(tracks.seconds, track[:, side])[0])
                first, last = (strike + share * (off - strike) for share in rests)
                spans = (along(last) - along(first))[:, :2] / (last - first)[:, None]
                each.append(np.median(spans, axis=0))
    if len(each) < 2:
        return np.zeros(2), 0.0
    sigma = float(np.std(each, axis=0, ddof=1).max() / np.sqrt(len(each)))
    return np.mean(each, axis=0), float(np.hypot(sigma, BELT_SHARE * np.linalg.norm(events.belt)))


def _found(tracks: Tracks, times: Floats, belt: Floats) -> Events:
    """`Events` in the axes of the floor."""
    count = len(times)
    going = progression.of(tracks, times)
    feet = [_foot(tracks, side, times, going) for side in range(len(SIDES))]
    swings = [_swings(foot.middle, foot.known & ~going.standing, times) for foot in feet]
    running = _running(feet, swings, times)
    strike_share, later = (STRIKE_SHARE_RUNNING, LATER_RUNNING) if running else (STRIKE_SHARE, LATER)
    usual = _usual_stride(times, swings)
    rows = []
    for side, (foot, own) in enumerate(zip(feet, swings, strict=True)):
        strides = _strides(times, own, usual)
        for (first, peak, last), stride in zip(own, strides.tolist(), strict=True):
            if running:
                off, off_sigma, earlier = _risen(times, foot.rise, peak, first), foot.rise_sigma, 0.0
            else:
                off, off_sigma, earlier = _crossing(times, foot.toe, OFF_SHARE, peak, first), foot.toe_sigma, EARLIER
            for strike, found, sigma in (
                (False, off, off_sigma),
                (True, _crossing(times, foot.heel, strike_share, peak, last), foot.heel_sigma),
            ):
                if found is None:
                    continue
                when, slope = found
                when += stride * (later if strike else -earlier)
                k = min(int(round((when - times[0]) / STEP_S)), count - 1)
                noise = sigma[k] / max(abs(slope), 1e-9)
                rows.append((when, side, strike, float(np.hypot(noise, STEP_SD_S)), _reason(k, foot, going)))
    turns = runs_of(going.turning & ~going.standing)
    return replace(_events(rows, running, belt), turns=times[0] + STEP_S * (turns - [0, 1]))


def _events(rows: list[tuple[float, int, bool, float, str]], running: bool, belt: Floats) -> Events:
    rows = sorted(rows)
    seconds, side, strike, sigma, reason = zip(*rows, strict=True) if rows else ((),) * 5
    return Events(
        np.array(seconds, float),
        np.array(side, int),
        np.array(strike, bool),
        np.array(sigma, float),
        np.array(reason, object),
        running,
        belt,
        shared_s=RUNNER_SD_S if running else PERSON_SD_S,
    )


def _foot(tracks: Tracks, side: int, times: Floats, going: Progression) -> _Foot:
    shares, sigmas, known = [], [], np.ones(len(times), bool)
    speed = np.maximum(going.speed, progression.STANDING_M_S)
    h = going.heading
    for track, covariance, lasting in (
        (tracks.heel, tracks.heel_covariance, tracks.heel_lasting),
        (tracks.toe, tracks.toe_covariance, tracks.toe_lasting),
    ):
        filled, fine = bridged(tracks.seconds, track[:, side])
        v = velocity(tracks.seconds, filled, times)
        shares.append((v[:, :2] * h).sum(axis=-1) / speed)
        frame = np.clip(np.searchsorted(tracks.seconds, times), 0, len(tracks.seconds) - 1)
        C = covariance[frame, side] * (1 - lasting[frame, side])[:, None, None]
        along = np.einsum("ti,tij,tj->t", h, C[:, :2, :2], h)
        sigmas.append(np.sqrt(velocity_variance(along, tracks.noise_time_s)) / speed)
        known &= known_at(tracks.seconds, fine, times)
    known &= known_at(tracks.seconds, bridged(tracks.seconds, tracks.pelvis, PELVIS_BRIDGED_S)[1], times)
    # the toe's, which came last
    rise, rise_sigma = v[:, 2], np.sqrt(velocity_variance(C[:, 2, 2], tracks.noise_time_s))
    return _Foot(shares[0], shares[1], (shares[0] + shares[1]) / 2, sigmas[0], sigmas[1], rise, rise_sigma, known)


def _swings(middle: Floats, known: Bools, times: Floats) -> list[tuple[int, int, int]]:
    """First index, index of the highest speed, and last index of each swing; first and last where it is searched from.

    A search goes from the highest speed as far as the middle of the stance before and after it.
    """
    shortest = round(SHORTEST_S / STEP_S)
    fast = (middle > 1.0) & known
    for first, end in runs_of(~fast).tolist():
        # a break of noise, not of what is unknown
        if end - first < shortest and known[first:end].all() and 0 < first and end < len(fast):
            fast[first:end] = True
    runs = [(a, b - 1) for a, b in runs_of(fast).tolist() if b - a >= shortest and middle[a:b].max() > SWING_SHARE]
    unknown = np.flatnonzero(~known)
    found = []
    for i, (a, b) in enumerate(runs):
        before = (runs[i - 1][1] + a) // 2 if i else 0
        after = (runs[i + 1][0] + b) // 2 if i + 1 < len(runs) else len(middle) - 1
        # never over what is unknown
        k = np.searchsorted(unknown, a)
        before = max(before, int(unknown[k - 1]) + 1 if k else 0)
        k = np.searchsorted(unknown, b)
        after = min(after, int(unknown[k]) - 1 if k < len(unknown) else after)
        found.append((before, a + int(middle[a : b + 1].argmax()), after))
    return found


def _crossing(times: Floats, share: Floats, level: float, peak: int, end: int) -> tuple[float, float] | None:
    """When `share` is at `level` nearest to `peak` on the way to `end`, and its slope there, 1/s; None if nowhere."""
    way = 1 if end > peak else -1
    part = share[peak : end + 1] if way > 0 else share[end : peak + 1][::-1]
    below = np.flatnonzero(part < level)
    if not len(below) or below[0] == 0:
        return None
    k = int(below[0])
    a, b = part[k - 1], part[k]
    when = times[peak + way * (k - 1)] + way * STEP_S * (a - level) / (a - b)
    # over 20 ms, as smooth as the velocity is
    reach = part[max(k - 3, 0) : k + 2]
    slope = (reach[-1] - reach[0]) / ((len(reach) - 1) * STEP_S) if len(reach) > 1 else (b - a) / STEP_S
    return float(when), float(way * slope)


def _risen(times: Floats, rise: Floats, peak: int, end: int) -> tuple[float, float] | None:
    """When a toe that rises fastest between `end` and `peak`, after it, had reached `RISEN` of that, and the slope of
    `rise` there, m/s^2; None if nowhere."""
    top = end + int(rise[end : peak + 1].argmax())
    return _crossing(times, rise, RISEN * rise[top], top, end) if rise[top] > 0 else None


def _usual_stride(times: Floats, swings: list[list[tuple[int, int, int]]]) -> float:
    """How long a stride takes, s: from swing to swing of a foot, where none between them was missed."""
    gaps = np.concatenate([np.diff([times[peak] for _, peak, _ in own]) for own in swings])
    # a missed swing makes a gap longer, nothing makes one shorter
    return float(np.quantile(gaps, 0.25)) if len(gaps) else 2 * progression.STRIDE_HALF_S


def _strides(times: Floats, swings: list[tuple[int, int, int]], usual: float) -> Floats:
    """How long the stride around each swing (S,) takes, s: from its highest speed to that of its neighbours."""
    if len(swings) < 2:
        return np.full(len(swings), usual)
    gaps = np.diff([times[peak] for _, peak, _ in swings])
    gaps = np.where(gaps > LONGEST * usual, usual, gaps)
    return np.asarray((np.concatenate([gaps[:1], gaps]) + np.concatenate([gaps, gaps[-1:]])) / 2)


def _reason(k: int, foot: _Foot, going: Progression) -> str:
    near = slice(max(k - round(END_S / STEP_S), 0), k + round(END_S / STEP_S) + 1)
    if near.stop > len(foot.known) or k < round(END_S / STEP_S) or not foot.known[near].all():
        return "end"
    return "standing" if going.standing[k] else "turn" if going.turning[k] else ""


def _running(feet: list[_Foot], swings: list[list[tuple[int, int, int]]], times: Floats) -> bool:
    """Whether a foot stands for less than half of a stride."""
    shares = []
    for foot, own in zip(feet, swings, strict=True):
        bounds = []
        for first, peak, last in own:
            rises = _crossing(times, foot.toe, AT_REST, peak, first)
            falls = _crossing(times, foot.heel, AT_REST, peak, last)
            bounds.append((rises[0] if rises else np.nan, falls[0] if falls else np.nan))
        for (_, strike), (off, again) in zip(bounds[:-1], bounds[1:], strict=True):
            shares.append((off - strike) / (again - strike))
    known = np.array(shares)[np.isfinite(shares)] if shares else np.zeros(0)
    return bool(len(known) and np.median(known) < RUNNING_BELOW)
