"""Spatiotemporal parameters of gait: per step or stride, and of a whole walk, with standard errors.

INPUTS   `Tracks` and `Events`. OUTPUTS `Values` of every step and stride, and `Pooled` of the walk.
Names and definitions as in Hollman et al., Gait & Posture 34 (2011) 111-118, and for lengths and width, which hold in
any direction, Huxham et al., Gait & Posture 23 (2006) 159-163: a step ends with the strike of its side, from that of
the other foot; its length lies along the line from the print of the other foot before to that after, its width at right
angles to that. Walk ratio: Sekiya and Nagasaki, Gait & Posture 7 (1998) 225-227. Symmetry: Robinson et al., J.
Manipulative Physiol. Ther. 10 (1987) 172-176, signed. `stride_length_toe` and `step_length_toe` are Plug-in-Gait's: the
marker behind the toes at the strikes, a step along its own side's stride (tests/gait shows that to 0.1 mm).
Every value is to first order a sum of errors of events and of prints, so that those of one walk can be averaged with
what they share: the print of one step is where the next one starts.
Metres, seconds; shares of the stride, 0 to 1; cadence steps per minute; walk ratio m per (step per minute).
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from dior.arrays import Bools, Floats
from dior.gait.events import LONGEST, RESTS, SIDE_SD_S, Events
from dior.gait.progression import STRIDE_HALF_S
from dior.gait.tracks import SIDES, Tracks, bridged, curve, known_at, velocity
from dior.tables.gait_parameters import OF_WALK, STEP, STRIDE, SYMMETRY

# what there is only where both feet are on the floor for a while
WALKING_ONLY = ("double_support_share",)
# m, of a print: how a heel at rest still moves, and skin on it; chosen on simulated walks
PRINT_SD_M = 0.002
# normal distribution
IN_95 = 1.96
# m, along an axis: how far a detector's idea of a heel is off all along, by another way left and right, of which the
# covariance of the labels has too little; chosen on simulated walks (benchmarks.gait)
DETECTED_M = 0.006
# of the rest of a variance, this share lasts for longer than a stance; chosen on simulated walks (benchmarks.gait)
SLOW = 0.5
# chosen: of a stance, where none was found whole
USUAL_STANCE_S = 0.6
# of the time in which a heel rests, so much is seen; chosen
HALF_SEEN = 0.5
# of the error that lasts for a second, this share of the standard deviation is gone by the next print of a foot, which
# stands elsewhere before the cameras; chosen on simulated walks (benchmarks.gait). Skin is where it was: what moves it
# is the gait, which is the same a stride later
FADES = 0.3


@dataclass(frozen=True, eq=False)
class Value:
    """One number, and its derivatives by the errors of events (E,) s and of prints (P, 2) m."""

    value: float
    by_event: Floats
    by_print: Floats


@dataclass(frozen=True, eq=False)
class Row:
    """A parameter of one step or stride, `side` 0 left, 1 right, `start` to `end` s; `sigma`: its standard error."""

    name: str
    side: int
    start: float
    end: float
    value: float
    sigma: float


@dataclass(frozen=True, eq=False)
class Pooled:
    """A parameter of a walk: of a side or of `both`, the mean of `count` steps or strides, its standard error, and how
    much these differ (`sd`, NaN for one). Without a value (NaN) `reason` says why."""

    name: str
    side: str
    value: float
    sigma: float
    sd: float
    count: int
    reason: str


@dataclass(frozen=True, eq=False)
class _Errors:
    """Covariances of the errors of events (E, E) s^2 and prints (P, P, 2, 2) m^2."""

    events: Floats
    prints: Floats

    def sigma(self, of: Value) -> float:
        # a step depends on a few of them
        k, p = np.flatnonzero(of.by_event), np.flatnonzero(of.by_print.any(axis=1))
        time = of.by_event[k] @ self.events[np.ix_(k, k)] @ of.by_event[k]
        place = np.einsum("pi,pqij,qj->", of.by_print[p], self.prints[np.ix_(p, p)], of.by_print[p])
        return float(np.sqrt(max(time + place, 0.0)))


def of_walk(tracks: Tracks, events: Events) -> tuple[list[Row], list[Pooled]]:
    """All parameters of a walk: `Row`s in the order of time, and `Pooled`."""
    if not len(events.seconds):
        return [], list(_pooled({}, _Errors(np.zeros((0, 0)), np.zeros((0, 0, 2, 2))), events))
    tracks = tracks.on_belt(events.belt)
    prints, errors = _prints(tracks, events)
    toes = _toes(tracks, events)
    found = sorted(
        [*_steps(toes, events, prints), *_strides(toes, events, prints)], key=lambda row: (row[3], row[2], row[1])
    )
    rows = [Row(n, side, start, end, v.value, errors.sigma(v)) for n, side, start, end, v in found]
    values: dict[tuple[str, int], list[Value]] = {}
    for name, side, _, _, value in found:
        values.setdefault((name, side), []).append(value)
    return rows, list(_pooled(values, errors, events))


def _prints(tracks: Tracks, events: Events) -> tuple[Floats, _Errors]:
    """Where the heel rests after each strike (E, 2) m, NaN at other events; and the errors."""
    count = len(events.seconds)
    prints, spread, lasts = np.full((count, 2), np.nan), np.zeros((count, 2, 2)), np.zeros((count, 2, 2))
    filled = [bridged(tracks.seconds, tracks.heel[:, side]) for side in range(len(SIDES))]
    step = (tracks.seconds[-1] - tracks.seconds[0]) / (len(tracks.seconds) - 1)
    usual = _usual_stance(events)
    for i in np.flatnonzero(events.strike).tolist():
        side = events.side[i]
        after = np.flatnonzero((events.side == side) & (np.arange(count) > i))
        # without the toe off that ends it, as long as the stances before
        end = events.seconds[after[0]] if len(after) and not events.strike[after[0]] else np.inf
        stance = end - events.seconds[i]
        # of a toe off after one that was missed
        stance = stance if stance <= LONGEST * usual else usual
        first, last = (events.seconds[i] + share * stance for share in RESTS)
        inside = (tracks.seconds >= first) & (tracks.seconds <= last) & filled[side][1]
        # half of it would be another part of the stance
        if inside.sum() * step < HALF_SEEN * (last - first):
            continue
        prints[i] = np.median(filled[side][0][inside, :2], axis=0)
        C = tracks.heel_covariance[inside, side, :2, :2].mean(axis=0)
        share = float(tracks.heel_lasting[inside, side].mean())
        share += (1 - share) * SLOW
        # a mean over a window has fewer independent errors than frames
        alike = max(step, np.sqrt(2 * np.pi) * tracks.noise_time_s)
        spread[i] = C * (1 - share) * min(1.0, alike / max(last - first, step))
        lasts[i] = C * share
    own = np.diag(events.sigma_s**2)
    same_kind = events.strike[:, None] == events.strike
    same_side = events.side[:, None] == events.side
    own = own + events.shared_s**2 * same_kind + SIDE_SD_S**2 * (same_kind & same_side)
    # what lasts, skin or a detector's idea of a heel, turns round with the walker
    pelvis = bridged(tracks.seconds, tracks.pelvis)[0]
    x, y = velocity(tracks.seconds, pelvis, events.seconds, STRIDE_HALF_S)[:, :2].T
    c, n = np.cos(np.arctan2(y, x)), np.sin(np.arctan2(y, x))
    turned = np.stack([np.stack([c, -n], axis=-1), np.stack([n, c], axis=-1)], axis=-2)
    sd = np.sqrt(np.maximum(np.trace(lasts, axis1=-2, axis2=-1) / 2, 0.0))
    sd = np.hypot(sd, DETECTED_M) if tracks.noise_time_s > 0 else sd
    fades = FADES if tracks.noise_time_s > 0 else 0.0
    alike = np.outer(sd, sd) * same_side * ((1 - fades**2) + fades**2 * np.eye(count))
    constant = alike[..., None, None] * np.einsum("pik,qjk->pqij", turned, turned)
    constant[np.arange(count), np.arange(count)] += spread + PRINT_SD_M**2 * np.eye(2)
    # a belt that is faster moves later prints further
    late = events.seconds - events.seconds.mean()
    constant += events.belt_sigma**2 * np.outer(late, late)[..., None, None] * np.eye(2)
    return prints, _Errors(own, constant)


def _usual_stance(events: Events) -> float:
    """Median (s) of the time from a strike to the toe off of the same foot."""
    stances = np.concatenate([events.stances(side) for side in range(len(SIDES))])
    return float(np.median(np.diff(events.seconds[stances]))) if len(stances) else USUAL_STANCE_S


def _time(events: Events, first: int, last: int) -> Value:
    by = np.zeros(len(events.seconds))
    by[last] += 1.0
    by[first] -= 1.0
    return Value(float(events.seconds[last] - events.seconds[first]), by, np.zeros((len(by), 2)))


def _along(prints: Floats, first: int, last: int, direction: Floats, events: Events) -> Value:
    by = np.zeros((len(prints), 2))
    by[last] += direction
    by[first] -= direction
    return Value(float((prints[last] - prints[first]) @ direction), np.zeros(len(prints)), by)


def _ratio(a: Value, b: Value) -> Value:
    value = a.value / b.value
    return Value(value, (a.by_event - value * b.by_event) / b.value, (a.by_print - value * b.by_print) / b.value)


def _plus(a: Value, b: Value, sign: float = 1.0) -> Value:
    return Value(a.value + sign * b.value, a.by_event + sign * b.by_event, a.by_print + sign * b.by_print)


def _times(a: Value, factor: float, add: float = 0.0) -> Value:
    return Value(factor * a.value + add, factor * a.by_event, factor * a.by_print)


def _mean(values: Iterable[Value]) -> Value:
    values = list(values)
    return Value(
        float(np.mean([v.value for v in values])),
        np.mean([v.by_event for v in values], axis=0),
        np.mean([v.by_print for v in values], axis=0),
    )


Found = tuple[str, int, float, float, Value]


def _chain(events: Events) -> list[tuple[int, int, bool]]:
    """Consecutive strikes of the two feet: (event before, event, whether both are to be used and nothing lacks)."""
    k = np.flatnonzero(events.strike)
    if len(k) < 2:
        return []
    gap = np.diff(events.seconds[k])
    fine: Bools = events.reason[k] == ""
    good = fine[:-1] & fine[1:] & (events.side[k][:-1] != events.side[k][1:])
    usual = np.median(gap[good]) if good.any() else 0.0
    return [(int(k[i]), int(k[i + 1]), bool(good[i] and gap[i] <= LONGEST * usual)) for i in range(len(gap))]


def _unit(vector: Floats) -> Floats:
    return vector / max(float(np.linalg.norm(vector)), 1e-9)


def _steps(toes: Floats, events: Events, prints: Floats) -> list[Found]:
    chain = _chain(events)
    found: list[Found] = []
    for i, (before, here, good) in enumerate(chain):
        if not good:
            continue
        side, start, end = int(events.side[here]), float(events.seconds[before]), float(events.seconds[here])
        found.append(("step_time", side, start, end, _time(events, before, here)))
        after = chain[i + 1][1] if i + 1 < len(chain) and chain[i + 1][2] else None
        earlier = chain[i - 1][0] if i and chain[i - 1][2] else None
        line = prints[after] - prints[before] if after is not None else np.full(2, np.nan)
        if not np.isfinite(line).all() and earlier is not None:
            line = prints[here] - prints[earlier]
        if not np.isfinite([*line, *prints[before], *prints[here]]).all():
            continue
        u = _unit(line)
        found.append(("step_length", side, start, end, _along(prints, before, here, u, events)))
        if after is not None and np.isfinite(prints[after]).all():
            # the line itself is as uncertain as its ends
            across = np.array([-u[1], u[0]]) * (1 if side == 0 else -1)
            share = float((prints[here] - prints[before]) @ u / max(np.linalg.norm(line), 1e-9))
            width = _along(prints, before, here, across, events)
            by = width.by_print.copy()
            by[before] += share * across
            by[after] -= share * across
            found.append(("step_width", side, start, end, Value(width.value, width.by_event, by)))
        if earlier is not None:
            toe = _toe_length(toes, events, before, here, earlier, prints)
            if toe is not None:
                found.append(("step_length_toe", side, start, end, toe))
    return found


def _toes(tracks: Tracks, events: Events) -> Floats:
    """The toe (E, 3) m of each event's foot at that time, NaN where it is not known."""
    found = np.full((len(events.seconds), 3), np.nan)
    for side in range(len(SIDES)):
        filled, fine = bridged(tracks.seconds, tracks.toe[:, side])
        own = (events.side == side) & known_at(tracks.seconds, fine, events.seconds)
        found[own] = curve(tracks.seconds, filled)(events.seconds[own])
    return found


def _toe_length(
    toes: Floats, events: Events, before: int, here: int, earlier: int | None, prints: Floats
) -> Value | None:
    """Plug-in-Gait's step length, or with `earlier` None the stride length from `before` to `here`; `earlier`: the
    strike of the same foot before."""
    step = toes[here] - toes[before]
    line = step if earlier is None else toes[here] - toes[earlier]
    if not np.isfinite([*step, *line]).all():
        return None
    # the toes' errors are taken as the heels'
    u = _unit(line)
    like = _along(prints, before, here, _unit(u[:2]), events)
    return Value(float(step @ u), like.by_event, like.by_print)


def _strides(toes: Floats, events: Events, prints: Floats) -> list[Found]:
    chain = _chain(events)
    found: list[Found] = []
    for (first, other, good), (_, last, also) in zip(chain[:-1], chain[1:], strict=True):
        if not (good and also):
            continue
        side, start, end = int(events.side[first]), float(events.seconds[first]), float(events.seconds[last])
        stride = _time(events, first, last)
        of: dict[str, Value] = {
            "stride_time": stride,
            "opposite_foot_contact_share": _ratio(_time(events, first, other), stride),
        }
        if np.isfinite(prints[[first, last]]).all():
            length = _along(prints, first, last, _unit(prints[last] - prints[first]), events)
            of |= {"stride_length": length, "stride_speed": _ratio(length, stride)}
        toe = _toe_length(toes, events, first, last, None, prints)
        if toe is not None:
            of["stride_length_toe"] = toe
        between = range(first + 1, last)
        own, opposite = (
            [k for k in between if not events.strike[k] and events.side[k] == s and events.reason[k] == ""]
            for s in (side, 1 - side)
        )
        if len(own) == 1:
            stance = _ratio(_time(events, first, own[0]), stride)
            of |= {"stance_share": stance, "swing_share": _times(stance, -1.0, 1.0)}
        if len(own) == 1 and len(opposite) == 1 and not events.running:
            early, late = _time(events, first, opposite[0]), _time(events, other, own[0])
            of |= {
                "double_support_share": _ratio(_plus(early, late), stride),
                "single_support_share": _ratio(_time(events, opposite[0], other), stride),
                "opposite_foot_off_share": _ratio(early, stride),
            }
        found += [(name, side, start, end, value) for name, value in of.items()]
    return found


def _pooled(values: dict[tuple[str, int], list[Value]], errors: _Errors, events: Events) -> Iterable[Pooled]:
    none = "no_events" if not len(events.seconds) else "no_steps"

    def lacking(name: str, side: str) -> Pooled:
        reason = "running" if events.running and name in WALKING_ONLY else none
        return Pooled(name, side, np.nan, np.nan, np.nan, 0, reason)

    def made(name: str, side: str, value: Value, among: list[Value]) -> Pooled:
        sd = float(np.std([v.value for v in among], ddof=1)) if len(among) > 1 else np.nan
        return Pooled(name, side, value.value, errors.sigma(value), sd, len(among), "")

    means: dict[tuple[str, int], Value] = {key: _mean(some) for key, some in values.items()}
    for name in (*STEP, *STRIDE):
        sides = [means.get((name, side)) for side in range(len(SIDES))]
        for side, mean in enumerate(sides):
            some = values.get((name, side), [])
            yield lacking(name, SIDES[side]) if mean is None else made(name, SIDES[side], mean, some)
        some = [v for side in range(len(SIDES)) for v in values.get((name, side), [])]
        yield lacking(name, "both") if not some else made(name, "both", _both(sides), some)
    yield from _of_walk(values, means, made, lacking)
    for name in SYMMETRY:
        left, right = (means.get((name, side)) for side in range(len(SIDES)))
        if left is None or right is None:
            yield lacking(f"{name}_asymmetry", "both")
            continue
        value = _times(_ratio(_plus(left, right, -1.0), _plus(left, right)), 2.0)
        count = sum(len(values[name, side]) for side in range(len(SIDES)))
        yield Pooled(f"{name}_asymmetry", "both", value.value, errors.sigma(value), np.nan, count, "")


def _both(sides: list[Value | None]) -> Value:
    """The mean of the sides' means: a side that has a step more does not count for more."""
    return _mean(v for v in sides if v is not None)


def _of_walk(
    values: dict[tuple[str, int], list[Value]],
    means: dict[tuple[str, int], Value],
    made: Callable[[str, str, Value, list[Value]], Pooled],
    lacking: Callable[[str, str], Pooled],
) -> Iterable[Pooled]:
    times, lengths = ([means.get((name, side)) for side in range(len(SIDES))] for name in ("step_time", "step_length"))
    steps = [v for side in range(len(SIDES)) for v in values.get(("step_time", side), [])]
    if not steps:
        yield from (lacking(name, "both") for name in OF_WALK)
        return
    time = _both(times)
    cadence = Value(60 / time.value, -60 / time.value**2 * time.by_event, time.by_print)
    yield made("cadence", "both", cadence, [Value(60 / v.value, v.by_event, v.by_print) for v in steps])
    if all(v is None for v in lengths):
        yield lacking("walk_ratio", "both")
        return
    ratio = _ratio(_both(lengths), cadence)
    some = [v for side in range(len(SIDES)) for v in values.get(("step_length", side), [])]
    yield Pooled("walk_ratio", "both", ratio.value, made("", "", ratio, some).sigma, np.nan, len(some), "")
