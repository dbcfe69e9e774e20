"""Two real walks with events, and with what Plug-in-Gait made of them."""

from dataclasses import replace

import numpy as np
import pytest

from dior.gait import events, parameters, tracks
from dior.ingest import mocap

RATE = 100.0
# as the files' EVENT groups have them, s from the trial's first frame; the number of the file's first frame
WALKS = {
    "walk_100hz": (
        148,
        {
            (0, True): (2.02, 3.05, 4.05),
            (1, True): (1.53, 2.54, 3.57, 4.59),
            (0, False): (2.65, 3.66),
            (1, False): (2.12, 3.14, 4.17),
        },
    ),
    "overground_events_100hz": (
        2,
        {(1, True): (1.1945833, 2.17), (0, True): (1.71,), (0, False): (1.30,), (1, False): (1.80,)},
    ),
}
LEFT, RIGHT = 0, 1


def walk(shared, name):
    """`Tracks` and the file's own `Events`."""
    path = shared / "mocap" / f"{name}.c3d"
    if not path.is_file():
        pytest.skip(f"there is no {path}")
    read = mocap.read(path)
    first, marked = WALKS[name]
    seconds = (np.arange(len(read.points)) + first - 1) / RATE
    rows = sorted((t, side, strike) for (side, strike), times in marked.items() for t in times)
    own = events.Events(
        np.array([r[0] for r in rows]),
        np.array([r[1] for r in rows]),
        np.array([r[2] for r in rows]),
        np.zeros(len(rows)),
        np.full(len(rows), "", object),
        False,
        np.zeros(2),
    )
    return tracks.of_joints(seconds, read.points, read.markers), own


def errors_ms(found, own, seconds):
    """Errors of the events further than 10 frames from the ends of the file: of strikes and of toe offs."""
    out = {True: [], False: []}
    for when, side, strike in zip(own.seconds, own.side, own.strike, strict=True):
        if seconds[0] + 10 / RATE < when < seconds[-1] - 10 / RATE:
            of_kind = found.seconds[(found.side == side) & (found.strike == strike)]
            out[bool(strike)].append(1000 * (of_kind[np.abs(of_kind - when).argmin()] - when))
    return {kind: np.array(values) for kind, values in out.items()}


@pytest.mark.parametrize("name", WALKS)
def test_events_are_where_the_lab_has_them(shared, name):
    t, own = walk(shared, name)
    found = events.find(t)
    off = errors_ms(found, own, t.seconds)
    every = np.abs(np.concatenate(list(off.values())))
    assert np.median(every) < 20 and every.max() < 40
    # no bias that would hide in the absolute values
    assert abs(np.median(off[True])) < 10 and abs(np.median(off[False])) < 10
    assert not found.running and not found.belt.any()


@pytest.mark.parametrize("name", WALKS)
@pytest.mark.parametrize("every", [2, 4])
def test_the_frame_rate_does_not_matter(shared, name, every):
    t, _ = walk(shared, name)
    rows = {key: getattr(t, key)[::every] for key in t.__dataclass_fields__ if key != "noise_time_s"}
    full, fewer = events.find(t), events.find(replace(t, **rows))
    for strike in (True, False):
        a, b = (e.seconds[(e.strike == strike) & (e.reason == "")] for e in (full, fewer))
        assert np.abs(a[:, None] - b).min(axis=0).max() < 0.010


# strides that the files' ANALYSIS groups describe: side, its first strike, and what they say
PLUG_IN_GAIT = [
    ("walk_100hz", LEFT, 2.02, (1.03, 0.51, 0.0970874, 0.5048544, 0.6116505, 0.42, 0.21, 1.19354844, 0.57008517)),
    ("walk_100hz", RIGHT, 2.54, (1.03, 0.52, 0.1067962, 0.4951456, 0.5825242, 0.40, 0.20, 1.157305, 0.59190869)),
    (
        "overground_events_100hz", RIGHT, 1.1945833,
        (0.97541678, 0.46, 0.1080735, 0.5284067, 0.6206749, 0.41, 0.19541658, 0.96247405, 0.45966634),
    ),
]  # fmt: skip
NAMES = (
    "stride_time step_time opposite_foot_off_share opposite_foot_contact_share stance_share single_support "
    "double_support stride_length_toe step_length_toe"
).split()


def of_stride(t, used, side, first):
    """Plug-in-Gait's parameters of the stride of a side that begins at about `first` s, in the order of `NAMES`."""
    rows, _ = parameters.of_walk(t, used)
    start = min((r.start for r in rows if r.name == "stride_time" and r.side == side), key=lambda s: abs(s - first))
    of = {r.name: r.value for r in rows if r.side == side and r.start == start and r.name in parameters.STRIDE}
    end = start + of["stride_time"]
    of |= {r.name: r.value for r in rows if r.side == side and abs(r.end - end) < 1e-6 and r.name in parameters.STEP}
    of["single_support"] = of["single_support_share"] * of["stride_time"]
    of["double_support"] = of["double_support_share"] * of["stride_time"]
    return np.array([of[name] for name in NAMES])


@pytest.mark.parametrize("name, side, first, told", PLUG_IN_GAIT)
def test_parameters_of_the_files_own_events_are_plug_in_gaits(shared, name, side, first, told):
    t, own = walk(shared, name)
    off = np.abs(of_stride(t, own, side, first) - told)
    assert off[[0, 1, 5, 6]].max() < 0.005 and off[2:5].max() < 0.006
    # exact where its events lie on frames
    assert off[7:].max() < (2e-4 if name == "walk_100hz" else 0.010)


@pytest.mark.parametrize("name, side, first, told", PLUG_IN_GAIT[2:])
def test_parameters_of_our_events_are_near_plug_in_gaits(shared, name, side, first, told):
    t, _ = walk(shared, name)
    off = np.abs(of_stride(t, events.find(t), side, first) - told)
    assert off[[0, 1, 5, 6]].max() < 0.030 and off[2:5].max() < 0.03 and off[7:].max() < 0.010
