"""How far apart two videos began, by a flash of light that both saw.

INPUTS   the brightness and the times of the pictures of two videos
OUTPUTS  a lag (s), or that it cannot be told

A flash (a camera's, a lamp that is switched on for a moment, a film's slate with a light) makes a few pictures brighter
than those before and after. What gets brighter for longer is the exposure's doing, or somebody who passes; what does so
all the time is flicker. A flash is all over the picture, where what passes near the lens is in a part of it; when that
is gone the exposure is still for it, so that nothing is a flash which comes just behind something dark. Light that
comes back between two legs before the lens, or two black pictures, is no flash either: it is no brighter than usual.
One flash tells a lag; of several the pattern has to fit one way only. A flash is in a picture or in the next, so that a
lag is as good as a picture is long.
"""

from dataclasses import dataclass

import numpy as np

from dior.arrays import Bools, Floats, Ints

# chosen: a flash of xenon takes a millisecond, a lamp switched on and off by hand a fifth of a second; exposure
# controls, and people who pass, take longer
LONGEST_S = 0.2
# so many more pictures have a part of it, and are none of it; what times are rounded by is no picture
BESIDE, ROUNDED = 2, 0.01
# chosen: of the fields of a picture; in so many a flash is, each by a share of the mean; what is in fewer is none, and
# what is in a number between leaves open which are flashes
MOST_FIELDS, FEW_FIELDS, OF_MEAN = 0.7, 0.5, 0.25
# chosen: of 255; black cloth and what is white already do not get brighter, and are not asked where others are enough
BLACK, WHITE, ENOUGH = 24.0, 240.0, 0.25
# chosen: of 255; a white sleeve waved before the lens makes 5 or so
LEAST = 8.0
# chosen: times as much as pictures usually stand out: flicker, which does so in every second one, tells nothing
CLEAR = 10.0
# chosen: of its peak, within two pictures, as a rolling shutter may have parts of a flash in both; and above the usual
SUDDEN = 0.5
# chosen: what makes less than half of this darker, such as somebody who passes before the lens, leaves the median alone
AROUND_S = 2.0
MOST = 20  # chosen: of more flashes a pattern fits by chance, and they are none that somebody made for this
# chosen: of the flashes that both could have seen; cameras that face away miss some, but two of three are alike by
# chance too often (`python -m benchmarks.videos flash`)
FEWEST_SHARED, ALL_OF = 0.6, 3


@dataclass(frozen=True, eq=False)
class Flashes:
    """When in the file flashes began, `at_s` (N,); `first_s`, `last_s`: its first and last picture, `period_s` from one
    to the next."""

    at_s: Floats
    first_s: float
    last_s: float
    period_s: float


def flashes(light: Floats | None, pts_ns: Ints) -> Flashes | None:
    """The `Flashes` in pictures of brightness `light` (F,), or (F, B) in B fields of each, 0 to 255; None where there
    are none, too many, or where something else is half as bright as would be one.

    `pts_ns` (F,): times in the file.
    """
    from scipy.ndimage import grey_opening, median_filter

    if light is None or len(light) < 3:
        return None
    fields = light.reshape(len(light), -1)
    light = fields.mean(axis=1)
    seconds = pts_ns / 1e9
    period = float(np.median(np.diff(seconds)))
    # pulses that are shorter are opened away
    size = int(np.ceil(LONGEST_S / period - ROUNDED)) + BESIDE
    above = light - grey_opening(light, size, mode="nearest")
    # a recording may begin or end within a change that lasts
    above[:size] = above[len(above) - size :] = 0.0
    least = max(LEAST, CLEAR * float(np.median(above)))
    usual = median_filter(light, max(3, round(AROUND_S / period)), mode="nearest")
    above[light - usual < SUDDEN * above] = 0.0
    begins, doubtful = (_rises(light, above, above > share * least, size) for share in (1.0, 0.5))
    begins, doubtful = (
        one[(_raised(fields, one, size) >= share) & ~_behind_dark(light, above, usual, one, size)]
        for one, share in ((begins, MOST_FIELDS), (doubtful, FEW_FIELDS))
    )
    if not 0 < len(begins) <= MOST or len(doubtful) > len(begins):
        return None
    return Flashes(seconds[begins], float(seconds[0]), float(seconds[-1]), period)


def _rises(light: Floats, above: Floats, bright: Bools, size: int) -> Ints:
    """Where runs begin in a mask (F,) of pictures, of which the brightness (F,) grows suddenly."""
    begins = np.flatnonzero(bright & ~np.r_[False, bright[:-1]])
    return begins[[light[i : i + 2].max() - light[i - 1] > SUDDEN * above[i : i + size].max() for i in begins]]


def _raised(fields: Floats, begins: Ints, size: int) -> Floats:
    """Share (N,) of the fields (F, B), neither black nor white, in which the pictures from `begins` (N,) on are
    brighter than the one before."""
    shares = []
    for i in begins.tolist():
        means = fields[i : i + size].mean(axis=1)
        before = fields[i - 1]
        rise = fields[i + int(np.argmax(means))] - before
        asked = (before > BLACK) & (before < WHITE)
        asked = asked if asked.mean() >= ENOUGH else np.ones(len(rise), bool)
        shares.append(float((rise > OF_MEAN * rise.mean())[asked].mean()))
    return np.array(shares)


def _behind_dark(light: Floats, above: Floats, usual: Floats, begins: Ints, size: int) -> Bools:
    """Whether (N,) it was darker than usual for a moment just before `begins` (N,), by as much as it is bright."""
    from scipy.ndimage import grey_closing

    below = np.minimum(grey_closing(light, size, mode="nearest"), usual) - light
    each = [below[max(i - size, 0) : i].max() > SUDDEN * above[i : i + size].max() for i in begins.tolist()]
    return np.array(each, bool)


def lag(one: Flashes, other: Flashes, about_s: float, most_s: float) -> float | None:
    """Time in the file of `one` less that in the file of `other` at which the same flashes, of those up to `most_s`
    from `about_s`; None where it cannot be told."""
    same = one.period_s + other.period_s
    tried = np.unique(one.at_s[:, None] - other.at_s)
    tried = tried[np.abs(tried - about_s) <= most_s]
    if not len(tried):
        return None
    shared = [_shared(one, other, late_s, same) for late_s in tried.tolist()]
    counts = np.array([len(each) for each in shared])
    best = int(np.argmax(counts))
    late_s = float(np.median(shared[best]))
    alike = (counts == counts[best]) & (np.abs(tried - late_s) > same)
    seen = min(_within(one.at_s, other, late_s), _within(other.at_s + late_s, one, 0.0))
    return None if alike.any() or counts[best] < max(FEWEST_SHARED * seen, min(seen, ALL_OF)) else late_s


def sigma_s(one: Flashes, other: Flashes) -> float:
    """Standard error of a lag."""
    return max(one.period_s, other.period_s)


def _shared(one: Flashes, other: Flashes, late_s: float, same_s: float) -> Floats:
    """The lags (N,) of the flashes that are the same ones at a lag."""
    apart = one.at_s[:, None] - other.at_s
    near = apart[np.arange(len(apart)), np.abs(apart - late_s).argmin(axis=1)]
    return np.asarray(near[np.abs(near - late_s) <= same_s])


def _within(at_s: Floats, other: Flashes, late_s: float) -> int:
    """How many of the moments are within the recording of the other at a lag."""
    return int(((at_s - late_s >= other.first_s) & (at_s - late_s <= other.last_s)).sum())
