"""Header stamps that are wrong for a while: restored to where they were, or the recording is refused."""

import numpy as np
import pytest

from dior.errors import DiorError
from dior.ingest.stamps import restored
from dior.simulate import clocks, settings

T0, PERIOD, COUNT = 1_708_000_000_000_000_000, 33_333_333, 300
# of a recording of 300: first picture, how many, and by how much (s) the header's clock is off in them
GLITCHES = {
    "early": (140, 20, -0.6),
    "late": (140, 20, 0.6),
    "early by whole periods": (140, 20, -20 / 30),
    "early by little more than a period": (140, 20, -0.04),
    "one early": (140, 1, -0.6),
    "one late": (140, 1, 0.6),
    "first early": (0, 20, -0.6),
    "first late": (0, 20, 0.6),
    "last early": (280, 20, -0.6),
    "last late": (280, 20, 0.6),
    "early by seconds": (140, 20, -3.0),
    "late by seconds": (140, 20, 3.0),
}
SET = {
    "back": (150, 150, -0.6),
    "forward": (150, 150, 0.6),
    "back by seconds": (150, 150, -5.0),
    "and set back": (100, 130, -0.6),
}


def recording(lag_ms=(3.0, 8.0), seed=0):
    header = T0 + PERIOD * np.arange(COUNT)
    return header, header + (1e6 * np.random.default_rng(seed).uniform(*lag_ms, COUNT)).astype(np.int64)


def wrong(header, first, count, by_s):
    out = header.copy()
    out[first : first + count] += round(1e9 * by_s)
    return out


@pytest.mark.parametrize("kind", GLITCHES)
def test_a_glitch_is_restored_and_named(kind):
    header, receive = recording()
    first, count, by_s = GLITCHES[kind]
    found = restored(wrong(header, *GLITCHES[kind]), receive, "walk, cam01")
    np.testing.assert_allclose((found.stamp_ns - header) / 1e9, 0, atol=1e-6)
    [glitch] = found.glitches
    assert (glitch.first, glitch.last) == (first, first + count - 1)
    assert glitch.early_s == pytest.approx(-by_s, abs=1e-6) and 0 < glitch.sigma_s < 1e-4
    assert (
        np.flatnonzero(found.shift_ns).tolist()
        == list(range(first, first + count))
        == np.flatnonzero(found.sigma_s).tolist()
    )


def test_two_glitches_are_two():
    header, receive = recording()
    found = restored(wrong(wrong(header, 40, 10, -0.5), 200, 5, 0.4), receive, "")
    assert [(one.first, one.last) for one in found.glitches] == [(40, 49), (200, 204)]
    np.testing.assert_allclose((found.stamp_ns - header) / 1e9, 0, atol=1e-6)


def test_lost_pictures_beside_a_glitch_move_it_by_no_picture():
    header, receive = recording()
    kept = np.delete(np.arange(COUNT), [137, 138, 139, 150, 161])
    given = wrong(header, 140, 20, -0.6)[kept]
    found = restored(given, receive[kept], "")
    np.testing.assert_allclose((found.stamp_ns - header[kept]) / 1e9, 0, atol=1e-6)


@pytest.mark.parametrize("kind", SET)
def test_a_clock_that_is_set_for_good_is_refused(kind):
    header, receive = recording()
    word, by = ("forward", SET[kind][2]) if SET[kind][2] > 0 else ("back", -SET[kind][2])
    with pytest.raises(
        DiorError, match=f"walk, cam01: the header clock was set {word} by {by:.1f} s after picture {SET[kind][0] - 1} "
    ):
        restored(wrong(header, *SET[kind]), receive, "walk, cam01")


def test_where_the_receive_stamps_tell_nothing_only_a_place_that_fits_is_taken():
    """20 pictures fill a hole of 20; at the end of the recording there is no hole."""
    header, _ = recording()
    receive = np.sort(header + (1e9 * np.random.default_rng(0).exponential(0.4, COUNT)).astype(np.int64))
    found = restored(wrong(header, 140, 20, -0.6), receive, "walk")
    np.testing.assert_allclose((found.stamp_ns - header) / 1e9, 0, atol=1e-6)
    with pytest.raises(
        DiorError, match="walk: the header stamps of pictures 280 to 299 .* do not tell what they should"
    ):
        restored(wrong(header, 280, 20, -0.6), receive, "walk")


def test_at_an_irregular_rate_the_lag_tells_it_and_how_well():
    rng = np.random.default_rng(1)
    header = T0 + np.cumsum(rng.uniform(20e6, 50e6, COUNT)).astype(np.int64)
    receive = header + rng.integers(3_000_000, 8_000_000, COUNT)
    found = restored(wrong(header, 140, 20, -0.6), receive, "")
    assert np.abs(found.stamp_ns - header).max() < 4e6 and found.sigma_s.max() >= 0.0015


@pytest.mark.parametrize("swapped", [[20, 22, 21], [20, 22, 23, 21], [20, 23, 21, 22]])
def test_a_picture_that_was_received_after_a_later_one_keeps_its_stamp(swapped):
    order = np.array([*range(20), *swapped, *range(20 + len(swapped), COUNT)])
    header, receive = recording()
    receive[order[20:24]] += np.array([0, 1, 40, 41]) * 10**6
    header, receive = header[order], np.maximum.accumulate(receive[order])
    assert restored(header, receive, "").glitches == ()


def test_a_network_that_is_slow_and_a_recorder_that_lost_pictures_are_no_glitch():
    """A second of waiting, pictures lost while it was full, and all that waited at once; in the middle and at first."""
    header, receive = recording()
    for begin in (0, 150):
        late = receive.copy()
        late[begin : begin + 30] = np.maximum(late[begin : begin + 30], late[begin + 30])
        for lost in (range(begin + 8, begin + 8), range(begin + 8, begin + 25), range(begin + 20, begin + 45)):
            kept = np.delete(np.arange(COUNT), list(lost))
            assert restored(header[kept], late[kept], "").glitches == ()


def test_a_message_that_is_there_twice_and_waited_behind_others_keeps_its_stamp():
    """Four pictures at once and then the second of them again; the network was slow."""
    order = np.array([*range(24), 21, *range(24, COUNT)])
    header, receive = recording()
    receive[20:24] = receive[23]
    receive = receive[order]
    receive[24] += 1_000_000
    assert restored(header[order], receive, "").glitches == ()


def test_pictures_with_the_stamps_of_others_at_the_end_are_restored():
    """20 whole periods early, as if they were there twice."""
    header, receive = recording()
    found = restored(wrong(header, 280, 20, -20 * PERIOD / 1e9), receive, "")
    assert (found.stamp_ns == header).all()


@pytest.mark.parametrize("level", ["ideal", "real"])
def test_simulated_recordings_are_left_alone_and_their_glitches_restored(level):
    """Late arrivals, late stamps, drops and repeats are none."""
    for seed in range(2):
        given = settings.from_dict({"preset": level, "subjects": 1, "sequences": 1, "duration_s": 10.0, "seed": seed})
        for walk in settings.sequences(given):
            for clock in clocks.clocks_of(given, walk)[0].values():
                header, receive = clock.stamp_ns[clock.messages], clock.receive_ns[clock.messages]
                assert restored(header, receive, "").glitches == ()
                for first, count, by_s in GLITCHES.values():
                    first = min(first, len(header) - count)
                    found = restored(wrong(header, first, count, by_s), receive, "")
                    late = np.abs(found.stamp_ns - header) / 1e9
                    assert len(found.glitches) == 1 and (late < np.maximum(4 * found.sigma_s, 1e-6)).all()
