"""The cameras' clocks: when a picture is taken, what its header says, when the recorder gets it, and what is lost.

`t = (stamp_ns - t0_ns)/1e9 (1 + 1e-6 drift_ppm) + offset_s` holds for the moment of exposure on the camera's clock:
seconds after the first stored frame of the C3D, outdoors the time of the first close camera. A header stamp differs
from that moment by the errors of `settings.Clocks`.
"""

from dataclasses import dataclass

import numpy as np

from dior.arrays import Bools, Floats, Ints
from dior.simulate.settings import CAMERAS, Sequence, Settings, generator, pictures_per_camera

# November 2023, and the field a day after the lab: any date would do
START_NS = 1_700_000_000_000_000_000
DAY_NS = 86_400_000_000_000
# chosen, picture periods: stamps keep their order, as jitter and lateness together are less than one
MOST_JITTER, MOST_LATE = 0.08, 0.8


@dataclass(frozen=True, eq=False)
class Clock:
    """The recorded pictures (P,) of one camera in one sequence, in the order of their header stamps.

    Header and receive stamps int64 ns, true times s, whether the message is recorded twice; offset and drift.
    """

    stamp_ns: Ints
    receive_ns: Ints
    seconds: Floats
    twice: Bools
    offset_s: float
    drift_ppm: float = 0.0

    @property
    def messages(self) -> Ints:
        """Picture (F,) of every recorded message, in the order of frame numbers: a repeated one is a frame twice."""
        return np.repeat(np.arange(len(self.twice)), 1 + self.twice)

    @property
    def frame_numbers(self) -> Ints:
        """Frame number (P,) of every picture, the first of two."""
        return np.arange(len(self.twice)) + np.cumsum(self.twice) - self.twice


def clocks_of(settings: Settings, sequence: Sequence) -> tuple[dict[str, Clock], int]:
    """`Clock` of every camera, and t0_ns: the earliest picture stamp of the sequence."""
    draw = generator(settings, "start", sequence.name)
    index = int(sequence.name.rsplit("_", 1)[1])
    day = 0 if sequence.environment == "indoor" else 1
    start = START_NS + day * DAY_NS + index * 300_000_000_000 + int(draw.integers(0, 1_000_000_000))
    delay = draw.uniform(*settings.clocks.start_delay_s)
    recorded = {}
    for i, name in enumerate(CAMERAS):
        exposed, receive, own, drift = _free_running(settings, sequence, name, start)
        offset = delay + own if sequence.environment == "indoor" else own if i else 0.0
        # outdoors the first close camera is the clock of the sequence
        drift = drift if sequence.environment == "indoor" or i else 0.0
        recorded[name] = (*_recorded(settings, sequence, name, exposed, receive), round(float(offset), 4), drift)
    t0 = int(min(stamps[0] for _, stamps, *_ in recorded.values()))
    return {
        name: Clock(stamps, receive, seconds(exposed, t0, offset, drift), twice, offset, drift)
        for name, (exposed, stamps, receive, twice, offset, drift) in recorded.items()
    }, t0


def seconds(exposed_ns: Ints, t0_ns: int, offset_s: float, drift_ppm: float) -> Floats:
    """Scene time (F,), s, of moments on a camera's clock."""
    return (exposed_ns - t0_ns) / 1e9 * (1 + 1e-6 * drift_ppm) + offset_s


def _free_running(settings: Settings, sequence: Sequence, name: str, start: int) -> tuple[Ints, Ints, float, float]:
    """Exposures and undisturbed arrivals (F,) ns on the camera's clock, its own start s and its drift ppm."""
    count = pictures_per_camera(settings)
    draw = generator(settings, "clock", sequence.name, name)
    phase = draw.uniform(0.0, 1.0 / settings.fps)
    exposed = start + np.round((phase + np.arange(count) / settings.fps) * 1e9).astype(np.int64)
    transport = draw.integers(3_000_000, 8_000_000, count)
    own = draw.uniform(-settings.clocks.apart_s, settings.clocks.apart_s)
    drift = settings.clocks.drift_ppm * generator(settings, "drift", sequence.name, name).standard_normal()
    return exposed, exposed + transport, own, round(float(drift), 1) + 0.0  # not -0.0


def _recorded(
    settings: Settings, sequence: Sequence, name: str, exposed: Ints, receive: Ints
) -> tuple[Ints, Ints, Ints, Bools]:
    """What the bag has: exposures, header and receive stamps (ns) and whether the message is there twice."""
    errors, count, period = settings.clocks, len(exposed), 1e9 / settings.fps
    draw = generator(settings, "stamps", sequence.name, name)
    most = MOST_JITTER * period
    jitter = np.clip(draw.standard_normal(count) * errors.jitter_ms * 1e6, -most, most)
    late = np.minimum(draw.exponential(errors.late_stamp_ms * 1e6, count), MOST_LATE * period)
    late *= draw.random(count) < errors.late_stamps
    queued = draw.exponential(errors.late_arrival_ms * 1e6, count) * (draw.random(count) < errors.late_arrivals)
    kept, twice = draw.random(count) >= errors.dropped, draw.random(count) < errors.duplicated
    stamps = exposed + np.round(jitter + late).astype(np.int64)
    # one message waits behind the other
    arrivals = np.maximum.accumulate(receive + np.round(late + queued).astype(np.int64))
    return exposed[kept], stamps[kept], arrivals[kept], twice[kept]
