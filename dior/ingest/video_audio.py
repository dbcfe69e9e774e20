"""How far apart two videos began, by the sound that both have.

INPUTS   the first audio tracks of videos
OUTPUTS  a lag (s), or that it cannot be told

Two microphones hear the same steps, voices and claps, each among noises of its own and with echoes of its own, by
clocks that differ by some parts in 100 000: over a minute the waves themselves no longer fit. So what is compared is
when sound sets in, in eight bands, every 4 ms. The cross-correlation is by the phases alone (Knapp and Carter 1976,
PHAT), which makes of a rhythm, whose every beat fits the next one, too, a single peak. The peak has to stand out of
what chance makes, and no other may come near it. Sound takes 3 ms per metre, so that the lag is as good as the cameras
are near each other.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dior.arrays import Floats
from dior.clocks import lag as lags
from dior.ingest import videos

RATE_HZ = 8000
FRAME, HOP = 128, 32  # samples: 16 ms, every 4 ms
BANDS, LOWEST_HZ, HIGHEST_HZ = 8, 200.0, 3800.0  # chosen: below is wind, above what encoders leave out
BEATS_HZ = 60.0  # chosen: onsets are no faster; above is the noise of 4 ms
MOST_S = 180.0  # chosen: of each track; bounds memory and time
FEWEST_S = 2.0  # chosen: less sound repeats itself too little by chance
# chosen: of a peak over the robust standard deviation of the curve, whose largest of 10 000 by chance is 4; and the
# share of it that another peak may have, so that of two scenes with steps of the same pace nothing is told (`python -m
# benchmarks.videos sound`)
CLEAR_SD, MOST_RIVAL = 10.0, 0.45
APART_S = 0.05  # chosen: echoes
# chosen: of a lag, by microphones ten metres apart and encoders that begin late
SIGMA_S = 0.03


@dataclass(frozen=True, eq=False)
class Heard:
    """Onsets (T, 8) of a track, HOP samples apart, the first at `start_s` in the file."""

    onsets: Floats
    start_s: float


def heard(path: Path) -> Heard | None:
    """What is heard in a video; None where it has no sound or too little. Raises ValueError for a broken file."""
    samples, start_s = videos.sound(path, RATE_HZ, MOST_S)
    if len(samples) < FEWEST_S * RATE_HZ or not np.any(samples):
        return None
    return Heard(onsets(samples), start_s)


def onsets(samples: Floats) -> Floats:
    """How much the sound of samples (N,) grows from one frame to the next, (T, 8), each band about 0 with sd 1."""
    frames = np.lib.stride_tricks.sliding_window_view(samples, FRAME)[::HOP]
    power = np.abs(np.fft.rfft(frames * np.hanning(FRAME), axis=1)) ** 2
    hz = np.fft.rfftfreq(FRAME, 1 / RATE_HZ)
    edges = np.geomspace(LOWEST_HZ, HIGHEST_HZ, BANDS + 1)
    bands = np.stack(
        [
            power[:, (hz >= low) & (hz <= max(high, low + RATE_HZ / FRAME))].sum(axis=1)
            for low, high in zip(edges[:-1], edges[1:], strict=True)
        ],
        axis=1,
    )
    # what is far below the usual level is silence, whose logarithm would be all noise
    level = np.log(bands + 0.1 * np.median(bands, axis=0) + 1e-12)
    rise = np.maximum(np.diff(level, axis=0), 0.0)
    rise -= rise.mean(axis=0)
    sd = rise.std(axis=0)
    return np.asarray(np.divide(rise, sd, out=np.zeros_like(rise), where=sd > 0))


def lag(one: Heard, other: Heard, about_s: float, most_s: float) -> float | None:
    """Time in the file of `one` less that in the file of `other` at which the same is heard, of those up to `most_s`
    from `about_s`; None where it cannot be told."""
    step = HOP / RATE_HZ
    count = 1 << (len(one.onsets) + len(other.onsets)).bit_length()
    a, b = (np.fft.rfft(each.onsets, count, axis=0) for each in (one, other))
    both = a * b.conj()
    size = np.abs(both)
    phases = np.divide(both, size, out=np.zeros_like(both), where=size > 0).sum(axis=1)
    phases[np.fft.rfftfreq(count, step) > BEATS_HZ] = 0
    curve = np.fft.irfft(phases, count)
    tried = np.arange(-len(other.onsets) + 1, len(one.onsets))
    seconds = tried * step + one.start_s - other.start_s
    near = np.abs(seconds - about_s) <= most_s
    seconds, curve = seconds[near], curve[tried[near]]
    if len(curve) < 3:
        return None
    best = int(np.argmax(curve))
    aside = np.abs(seconds - seconds[best]) > APART_S
    sd = 1.4826 * float(np.median(np.abs(curve - np.median(curve))))
    if not aside.any() or curve[best] < CLEAR_SD * sd or curve[aside].max() > MOST_RIVAL * curve[best]:
        return None
    return lags.lowest(seconds, -curve, best)


def sigma_s(one: Heard, other: Heard) -> float:
    """Standard error of a lag."""
    return SIGMA_S
