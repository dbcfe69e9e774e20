"""The people that a detector found in one camera, and which of them is the subject.

INPUTS   every person of every frame, as a reader of `dior.ingest.readers` gives them.
OUTPUTS  one person, or nobody, per frame.
Pixels in the recorded picture, scores 0 to 1, NaN is missing.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from dior.arrays import AnyPath, Bools, Floats, Ints
from dior.body.names import swap_index
from dior.errors import DiorError

# A person's mean joint moves 0.03 body sizes in a 30th of a second when walking, 0.05 when running, and a detector adds
# its own noise. A difference of REACH and SPEED per PERIOD_S costs 1: it grows no faster with the time passed, or
# leaving out a few frames would make any jump cheap and a bystander of a second the subject. No difference costs more
# than JUMP, so that a subject who comes back elsewhere is found again. Leaving somebody out costs SKIP per PERIOD_S:
# more than the worst score (1), so that nobody is left out for a low score alone, and little enough that a subject
# missed in every third frame is not given up for a bystander.
REACH, SPEED = 0.15, 0.03
PERIOD_S = 1 / 30
JUMP = 60.0
SKIP = 1.5
# chosen: the longest gap, counted over pictures with people, after which where the subject was still tells who it is
MEMORY_S = 1.5
# chosen: a track goes on over a step that costs at most this; 1 is what a body can do, and a detector errs beside
LINK = 2.0
# chosen: as much as a score of 0 instead of 1 for a 30th of a second
AMBIGUOUS = 1.0
# chosen: pairs of people compared at once, some megabytes of joints
BLOCK = 1 << 13
# no picture is this large; beyond it float32 loses a tenth of a pixel
FAR_PX = 1e6

# chosen: the peaks of networks that give no probability, such as RTMW, go to 10 or so
MOST_SCORE = 20.0

# as a file holds them: not checked yet
Numbers: TypeAlias = Sequence[Any] | Ints


@dataclass(frozen=True, eq=False)
class People:
    """Row per person and frame, sorted by frame, then by person.

    `joints` J names; `frame` and `person` (P,), the latter the index in the detector's output; `uv` (P, J, 2) px;
    `score` (P, J), 0 where missing; `ran` the sorted frames that the detector looked at; `stamp_ns` of those, or -1.
    `by_stamp`: the file has no frame numbers, and `frame` and `ran` are places in `stamp_ns`.
    """

    joints: tuple[str, ...]
    frame: Ints
    person: Ints
    uv: Floats
    score: Floats
    ran: Ints
    stamp_ns: Ints
    by_stamp: bool = False


def gathered(
    path: AnyPath,
    joints: Sequence[str],
    frame: Numbers,
    points: Floats,
    ran: Numbers | None = None,
    stamp_ns: Numbers | None = None,
    by_stamp: bool = False,
) -> People:
    """`People` from what a file holds, in any order.

    `frame` (P,) numbers from 0, `points` (P, J, 3) u, v, score; a coordinate that is not finite is missing. `ran` are
    the frames that the detector looked at (those of `frame` where it does not say) and `stamp_ns` their stamps;
    `by_stamp` as of `People`. A person is counted by its place among those of its frame, one without any joint is left
    out. `points` is written to and not copied: it is the largest thing that a reader has. Raises DiorError for frames
    and coordinates that cannot be, and for scores in percent.
    """
    frames = whole_numbers(path, frame)
    points = np.asarray(points, float).reshape(len(frames), len(joints), 3)
    looked_at = np.unique(frames) if ran is None else whole_numbers(path, ran)
    stamps = np.full(len(looked_at), -1, np.int64) if stamp_ns is None else np.asarray(stamp_ns, np.int64)
    for numbers in (frames, looked_at):
        if len(numbers) and numbers.min() < 0:
            raise DiorError(f"{path}: frame {numbers.min()} is negative; frames are counted from 0")
    order, of_looked_at = _order(frames), _order(looked_at)
    frames, points, looked_at, stamps = frames[order], points[order], looked_at[of_looked_at], stamps[of_looked_at]
    twice = np.flatnonzero(np.diff(looked_at) == 0)
    if len(twice):
        raise DiorError(f"{path}: frame {looked_at[twice[0]]} is there twice")
    person = np.arange(len(frames)) - np.searchsorted(frames, frames)
    uv, score = points[..., :2], points[..., 2]
    missing = ~np.isfinite(uv.sum(axis=-1))
    uv[missing], score[missing] = np.nan, 0.0
    if len(uv) and max(np.nanmax(uv, initial=0), -np.nanmin(uv, initial=0)) > FAR_PX:
        row, joint = np.argwhere((np.abs(uv) > FAR_PX).any(axis=-1))[0]
        u, v = uv[row, joint]
        raise DiorError(
            f"{path}: frame {frames[row]} has {joints[joint]} at ({u:.6g}, {v:.6g}), which is in no picture; "
            "is the file damaged?"
        )
    if np.nanmax(score, initial=0.0) > MOST_SCORE and float(np.nanmedian(score[~missing])) > MOST_SCORE:
        raise DiorError(f"{path}: half of its scores are above {MOST_SCORE:g}; are they percent? Divide them by 100")
    np.clip(np.nan_to_num(score, copy=False), 0.0, 1.0, out=score)
    seen = ~missing.all(axis=1)
    rows = slice(None) if seen.all() else seen
    return People(tuple(joints), frames[rows], person[rows], uv[rows], score[rows], looked_at, stamps, by_stamp)


def _order(numbers: Ints) -> slice | Ints:
    """An index that sorts, stable; a slice, which copies nothing, where they are in order."""
    return slice(None) if (np.diff(numbers) >= 0).all() else np.argsort(numbers, kind="stable")


def whole_numbers(path: AnyPath, numbers: Numbers) -> Ints:
    """`numbers` as int64 (N,). Raises DiorError where one is no whole number of that size."""
    try:
        exact = np.array([int(number) for number in numbers], np.int64)
    except (OverflowError, TypeError, ValueError):
        exact = None
    if exact is None or any(a != b for a, b in zip(exact.tolist(), numbers, strict=True)):
        raise DiorError(f"{path}: a frame number is no whole number; is the file damaged?")
    return exact


@dataclass(frozen=True, eq=False)
class Subject:
    """`row` of `People` per frame, -1 for nobody; frames with `several` people; frames where the choice is `ambiguous`;
    frames `left_out`: people were found but none of them is the subject. All (frames,)."""

    row: Ints
    several: Bools
    ambiguous: Bools
    left_out: Bools


def follow(people: People, stamps_ns: Ints) -> Subject:
    """The subject through a recording with picture stamps `stamps_ns` (frames,), as a `Subject`.

    The cheapest path over all frames (Viterbi), so that a gap or a bystander does not break it. A person costs 0 to 2
    per PERIOD_S: what the mean score lacks to 1 and the size to that of the largest in the frame. Two people that
    follow each other in time cost the square of their mean joint distance, in body sizes over what they could have
    moved, at most JUMP: up to 1 per PERIOD_S, since it is noise of every picture, and what is more once, since it is a
    change of person at any rate. A frame with people that is left out costs SKIP per PERIOD_S. So the same scene costs
    the same at every rate of pictures. A choice is ambiguous if the best path through another person of that frame
    costs less than AMBIGUOUS more.
    """
    count = np.bincount(people.frame, minlength=len(stamps_ns))
    row = np.full(len(stamps_ns), -1)
    ambiguous = np.zeros(len(stamps_ns), bool)
    if len(people.frame):
        looked_at = np.diff(stamps_ns[people.ran]) / 1e9
        share = float(np.median(looked_at)) / PERIOD_S if len(looked_at) else 1.0
        chosen, margin = _best_path(people, (stamps_ns - stamps_ns[0]) / 1e9, share)
        row[people.frame[chosen]] = chosen
        ambiguous[people.frame[chosen]] = margin < AMBIGUOUS
    return Subject(row, count > 1, ambiguous, (count > 0) & (row < 0))


def tracks(people: People, stamps_ns: Ints) -> Ints:
    """Number (P,) of the track of each person, counted by their beginnings: the same body from picture to picture.

    A track goes on with the nearest person that it can have reached, also over a gap of `MEMORY_S`; those that were
    seen last go first: whoever passes where another was lost is not taken for him. Who is nowhere near begins another
    one, so that a detector of one person that takes somebody else begins a track.
    """
    out = np.zeros(len(people.frame), np.int64)
    if len(out) < 2:
        return out
    looked_at = np.diff(stamps_ns[people.ran]) / 1e9
    share = float(np.median(looked_at)) / PERIOD_S if len(looked_at) else 1.0
    when, extent = ((stamps_ns - stamps_ns[0]) / 1e9)[people.frame], _extent(people.uv)
    starts = np.flatnonzero(np.diff(people.frame, prepend=-1)).tolist()
    if len(starts) == len(out) and np.diff(when).max() <= MEMORY_S:
        rows = np.arange(1, len(out))
        if (_moved(people, extent, when, share, rows, rows - 1) ** 2 <= LINK).all():
            return out
    last: list[int] = []
    for begin, end in zip(starts, [*starts[1:], len(out)], strict=True):
        recent = np.array([i for i, row in enumerate(last) if when[begin] - when[row] <= MEMORY_S], int)
        now = np.arange(begin, end)
        a, b = np.repeat(now, len(recent)), np.tile(recent, len(now))
        before = np.array(last, int)[b]
        step = _moved(people, extent, when, share, a, before) ** 2 if len(b) else np.empty(0)
        taken: dict[int, int] = {}
        for i in np.lexsort((step, -people.frame[before])).tolist():
            if step[i] <= LINK and a[i] not in taken and b[i] not in taken.values():
                taken[int(a[i])] = int(b[i])
        for row in now.tolist():
            if row not in taken:
                taken[row] = len(last)
                last.append(row)
            out[row] = taken[row]
            last[taken[row]] = row
    return out


def _best_path(people: People, seconds: Floats, share: float) -> tuple[Ints, Floats]:
    """Rows of the chosen people, and by how much the second-best person of each one's frame is worse.

    `seconds` (frames,) of the pictures; `share`: how much of PERIOD_S is between two pictures looked at.
    """
    costs, when, skip = share * _unary(people), seconds[people.frame], share * SKIP
    memory = max(round(MEMORY_S / (share * PERIOD_S)), 1)
    _, group, sizes = np.unique(people.frame, return_inverse=True, return_counts=True)
    n, last = len(group), group[-1]
    if sizes.max() == 1:
        along = _steps(people, when, share, np.arange(1, n), np.arange(n - 1))
        # leaving out k frames saves at most share k + (k + 1) max(along) and costs skip k
        if along.max(initial=0.0) <= (skip - share) / 2:
            return np.arange(n), np.full(n, np.inf)
    a, b = _pairs(group, memory)
    steps = _steps(people, when, share, a, b) + skip * (group[a] - group[b] - 1)
    before, previous = _sweep(costs, group, steps, skip, memory)
    after, _ = _sweep(costs[::-1], last - group[::-1], steps[np.lexsort((-a, -b))], skip, memory)
    through = before + after[::-1] - costs
    path = [int(np.argmin(before + skip * (last - group)))]
    while previous[path[-1]] >= 0:
        path.append(int(previous[path[-1]]))
    chosen = np.array(path[::-1])
    other = np.ones(n, bool)
    other[chosen] = False
    second = np.full(last + 1, np.inf)
    np.minimum.at(second, group[other], through[other])
    return chosen, second[group[chosen]] - through[chosen]


def _pairs(group: Ints, memory: int) -> tuple[Ints, Ints]:
    """Rows (a, b) of all people a with all people b of the `memory` frames with people before, sorted by a, then b."""
    starts = np.searchsorted(group, np.arange(group[-1] + 1))
    first, end = starts[np.maximum(group - memory, 0)], starts[group]
    a = np.repeat(np.arange(len(group)), end - first)
    return a, np.arange(len(a)) - np.repeat(np.cumsum(end - first) - (end - first), end - first) + first[a]


def _sweep(costs: Floats, group: Ints, steps: Floats, skip: float, memory: int) -> tuple[Floats, Ints]:
    """Cheapest cost (P,) of a path that ends in each person, and its predecessor (-1: it begins there).

    `costs` (P,) of the people themselves, `group` (P,) their frame among those with people, ascending; `steps` the
    cost of each of `_pairs(group, memory)`, the frames left out in between included; `skip` that of one left out.
    """
    total, previous = costs + skip * group, np.full(len(group), -1)
    starts = np.searchsorted(group, np.arange(group[-1] + 2)).tolist()
    restart, restart_from, at = np.inf, -1, 0
    for g in range(1, len(starts) - 1):
        earliest, begin, end = starts[max(0, g - memory)], starts[g], starts[g + 1]
        # the cheapest of all earlier people: the way on after a jump, however long ago
        latest = starts[g - 1] + int(total[starts[g - 1] : begin].argmin())
        restart += skip
        if total[latest] < restart:
            restart, restart_from = total[latest], latest
        for row in range(begin, end):
            ways = total[earliest:begin] + steps[at : at + begin - earliest]
            at += begin - earliest
            best = int(ways.argmin())
            way, origin = min((skip * g, -1), (ways[best], earliest + best), (restart + JUMP, restart_from))
            total[row], previous[row] = way + costs[row], origin
    return total, previous


def _unary(people: People) -> Floats:
    """Cost of each person (P,) per PERIOD_S, 0 to 2."""
    extent = _extent(people.uv)
    largest = np.zeros(people.frame.max() + 1)
    np.maximum.at(largest, people.frame, extent)
    return 2 - np.clip(people.score, 0, 1).mean(axis=1) - extent / largest[people.frame]


def _extent(uv: Floats) -> Floats:
    """Size of each person (P,), px: the diagonal of the box around the joints, at least 1."""
    low, high = np.nanmin(uv, axis=1), np.nanmax(uv, axis=1)
    return np.maximum(np.hypot(*(high - low).T), 1.0)


def _steps(people: People, when: Floats, share: float, a: Ints, b: Ints) -> Floats:
    """Cost of the step from people `b` to people `a` (N,): the square of their distance over their reach, up to 1 of it
    as noise, which counts by the time that a picture stands for.
    """
    moved = _moved(people, _extent(people.uv), when, share, a, b)
    noise = share * np.minimum((moved / max(share, 1.0)) ** 2, 1.0)
    return np.minimum(noise + np.maximum(moved**2 - 1.0, 0.0), JUMP)


def _moved(people: People, extent: Floats, when: Floats, share: float, a: Ints, b: Ints) -> Floats:
    """Distance of people `a` from people `b` (N,) over what they could have moved in the time between.

    `extent` (P,) px of all of them.

    The distance is the mean over the joints that both have, also with left and right exchanged: a detector that
    exchanges them has not found another person. Without a common joint the middles are compared.
    """
    uv, swap = people.uv, swap_index(people.joints)
    distance = np.empty(len(a))
    for part in range(0, len(a), BLOCK):
        uv_a, uv_b = uv[a[part : part + BLOCK]], uv[b[part : part + BLOCK]]
        distance[part : part + BLOCK] = np.fmin(_mean_distance(uv_a, uv_b), _mean_distance(uv_a, uv_b[:, swap]))
    apart = np.isnan(distance)
    if apart.any():
        middle_a, middle_b = (np.nanmean(uv[rows[apart]], axis=1) for rows in (a, b))
        distance[apart] = np.hypot(*(middle_a - middle_b).T)
    # the time from one slow picture to the next is no gap: a person reaches as far as at 30 Hz, in several steps
    slow = max(share, 1.0)
    periods = np.maximum((when[a] - when[b]) / PERIOD_S - (slow - 1), 1.0)
    reach = (REACH + SPEED * periods) * np.maximum(extent[a], extent[b])
    return distance / reach


def _mean_distance(uv_a: Floats, uv_b: Floats) -> Floats:
    """Mean distance (N,) px of the joints of (N, J, 2) that both have; NaN without a common one."""
    distance = np.hypot(uv_a[..., 0] - uv_b[..., 0], uv_a[..., 1] - uv_b[..., 1])
    common = np.isfinite(distance)
    with np.errstate(invalid="ignore"):
        return np.where(common, distance, 0.0).sum(axis=-1) / common.sum(axis=-1)
