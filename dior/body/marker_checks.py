"""Do the markers sit on a body? A file that is read wrongly, or says the wrong unit or vertical, gives numbers all the
same.

INPUTS   Plug-in-Gait markers of one recording (T, M, 3), NaN where missing, and their names
OUTPUTS  figures, and what no body does, None where nothing is; of parts without markers nothing is known

A limit catches what no body does, never a movement that is unusual.
"""

import warnings
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from dior.arrays import Floats, Ints
from dior.body.names import mirrored

# markers on one rigid part of the body, and how far they are apart on an adult of 1.7 m. Only the power of ten is taken
# from it, so a third and three times as much pass. Knee to ankle, shoulder to elbow, elbow to wrist: 0.246, 0.186 and
# 0.146 of the stature (Drillis and Contini 1966, in Winter, Biomechanics, fig. 4.1); chosen: the others, as measured on
# real walks
_LEFT_AND_MIDDLE = {
    ("LKNE", "LANK"): 0.42,
    ("LANK", "LHEE"): 0.08,
    ("LHEE", "LTOE"): 0.20,
    ("LASI", "RASI"): 0.24,
    ("LPSI", "RPSI"): 0.09,
    ("LASI", "LPSI"): 0.20,
    ("C7", "T10"): 0.22,
    ("C7", "CLAV"): 0.15,
    ("CLAV", "STRN"): 0.15,
    ("LSHO", "LELB"): 0.32,
    ("LELB", "LWRA"): 0.25,
    ("LELB", "LWRB"): 0.25,
    ("LFHD", "RFHD"): 0.12,
    ("LBHD", "RBHD"): 0.12,
    ("LFHD", "LBHD"): 0.14,
}
RIGID = _LEFT_AND_MIDDLE | {
    (mirrored(a), mirrored(b)): length for (a, b), length in _LEFT_AND_MIDDLE.items() if mirrored(a) not in (b, a)
}
# skin moves a marker by up to 3 cm against the bone (Leardini et al., Gait & Posture 21 (2005) 212-225), and a pair
# changes by up to 3 cm on clean walks, real and simulated. Chosen: more than twice what both ends can do
STRETCH_M = 0.15
# twice the fastest sprinter's 12.3 m/s (Graubner and Nixdorf, New Studies in Athletics 26 (2011) 19-53): the swinging
# foot is about twice as fast as the body. Walks and jogs have 4-6
SPEED_M_S = 25.0
# from the floor up; arms may be anywhere
LEVELS = (
    "LANK RANK LHEE RHEE LTOE RTOE".split(),
    "LKNE RKNE LTIB RTIB LTHI RTHI".split(),
    "LASI RASI LPSI RPSI".split(),
    "C7 T10 CLAV STRN RBAK LSHO RSHO".split(),
    "LFHD RFHD LBHD RBHD".split(),
)
# chosen: a body that leans by less is upright, and one that leans by less than the second stands along an axis
UPRIGHT_DEG, ALONG_DEG = 60.0, 30.0


class Odd(NamedTuple):
    """Where markers do what no body does: what they do at `frame` (index), the worst of `frames` frames."""

    text: str
    frame: int
    frames: int


def power_of_ten(markers: Floats, names: Sequence[str]) -> int | None:
    """Power of ten by which the body is too large, 0 where it has a body's size; None where its parts disagree."""
    found = [np.median(apart) / RIGID[pair] for pair, _, apart in _pairs(markers, names)]
    ratios = np.array([ratio for ratio in found if ratio > 0])
    if not len(ratios):
        return 0
    power = np.log10(ratios)
    whole = round(float(np.median(power)))
    # chosen: half a power of ten is where the next unit begins, a whole one is another unit
    return whole if np.all(np.abs(power - whole) < 1) else None


def axis_up(markers: Floats, names: Sequence[str]) -> Floats:
    """Direction (3,) from the lowest part of the body with markers to the highest, of length 1; NaN with one part."""
    parts = [[i for i, name in enumerate(names) if name in level] for level in LEVELS]
    seen = [part for part in parts if part and np.isfinite(markers[:, part]).any()]
    if len(seen) < 2:
        return np.full(3, np.nan)
    with warnings.catch_warnings():
        # frames without any marker of a part are NaN
        warnings.simplefilter("ignore", RuntimeWarning)
        low, high = (np.nanmean(markers[:, part], axis=1) for part in (seen[0], seen[-1]))
        along = np.nanmedian(high - low, axis=0)
        return along / np.linalg.norm(along)


def stretched(markers: Floats, names: Sequence[str]) -> Odd | None:
    """The pair (m) on a rigid part that changes its length most, beyond `STRETCH_M`."""
    odd = []
    for (a, b), frames, apart in _pairs(markers, names):
        usual = np.median(apart)
        off = np.abs(apart - usual)
        if off.max() > STRETCH_M:
            worst = off.argmax()
            text = f"{a} is {apart[worst]:.3g} m from {b}, in most frames {usual:.2f} m,"
            odd.append((off.max(), Odd(text, int(frames[worst]), int((off > STRETCH_M).sum()))))
    return max(odd, key=lambda one: one[0])[1] if odd else None


def flying(markers: Floats, names: Sequence[str], rate: float) -> Odd | None:
    """The marker (m, at `rate` Hz) that moves fastest, beyond `SPEED_M_S`."""
    odd = []
    for i, name in enumerate(names):
        frames = np.flatnonzero(np.isfinite(markers[:, i]).all(axis=-1))
        if len(frames) < 2:
            continue
        speed = np.linalg.norm(np.diff(markers[frames, i], axis=0), axis=-1) / np.diff(frames) * rate
        if speed.max() > SPEED_M_S:
            worst = speed.argmax()
            text = f"{name} moves at {speed[worst]:.3g} m/s, as no body does,"
            odd.append((speed.max(), Odd(text, int(frames[worst + 1]), int((speed > SPEED_M_S).sum()))))
    return max(odd, key=lambda one: one[0])[1] if odd else None


def _pairs(markers: Floats, names: Sequence[str]) -> Iterator[tuple[tuple[str, str], Ints, Floats]]:
    """Of each rigid pair: its names, the frames (K,) that have both, and how far apart the two are in them (K,)."""
    where = {name: i for i, name in enumerate(names)}
    for a, b in RIGID:
        if a in where and b in where:
            apart = np.linalg.norm(markers[:, where[a]] - markers[:, where[b]], axis=-1)
            frames = np.flatnonzero(np.isfinite(apart))
            if len(frames):
                yield (a, b), frames, apart[frames]
