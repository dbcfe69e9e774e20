from dataclasses import replace

import numpy as np
import pytest

from benchmarks import culprit as benchmark
from benchmarks import steps, worlds
from dior.calibrate.bundle import culprits
from dior.calibrate.bundle.in_adjustment import Sequences
from dior.calibrate.bundle.window import Recorded
from dior.calibrate.clock.from_cameras import TimedDetections
from dior.errors import DiorError
from dior.tables import tables
from tests.rig import ring

RIG = ring(3)


def timed(*files):
    """Sequences in which the pixels of camera i are the numbers `files[s][i]`; camera i has i + 2 pictures."""
    recorded = tuple(
        Recorded(
            tuple(TimedDetections(np.arange(i + 2.0), np.full((i + 2, 1, 2), one), 0.1) for i, one in enumerate(own)),
            ("nose",),
            30.0,
        )
        for own in files
    )
    names = tuple(camera.name for camera in RIG)
    held = np.tile([True, False, False], (len(files), 1))
    return Sequences(recorded, ({},) * len(files), names, np.zeros((len(files), 3, 2)), held, 2)


def cost(wrong=40.0, strained=()):
    """5 px where every camera `i` has the number i, `wrong` px else; strain of 100 of what is in `strained`."""

    def of(views, found):
        numbers = [tuple(one.uv[0, 0, 0] for one in own.seen) for own in found.recorded]
        right = all(n == views[i] for own in numbers for i, n in enumerate(own))
        alike = tuple(numbers) in strained
        return (5.0 if right or alike else wrong), 100.0 if alike else 3.0

    return of


@pytest.mark.parametrize(
    ("late_s", "ends_px", "said"),
    [(4.9, 5.0, "cam02 in walk_1 +4.9 s"), (1.9, 5.0, ""), (4.9, 25.0, ""), (4.9, 39.0, "")],
)
@pytest.mark.parametrize("given", [(40.0, 3.0), (19.0, 100.0)])
def test_a_clock_further_off_than_is_searched_is_named_with_what_it_is(late_s, ends_px, said, given):
    long = Recorded(tuple(TimedDetections(np.arange(300) / 30, np.zeros((300, 1, 2)), 0.1) for _ in RIG), ("nose",), 30)
    window = {"first": 0, "count": 300, "step": 1}
    found = replace(timed((0, 1, 2)), recorded=(long,), windows=(window,))

    def start(wide):
        assert [own.most_s for own in wide.recorded[0].seen] == pytest.approx([6.0] * 3, abs=0.1)
        return np.array([[[0.0, 0.0], [late_s, 0.0], [0.1, 0.0]]])

    def of(views, tried):
        return (ends_px, 3.0) if tried.recorded[0].seen[0].most_s > 2 else given

    text = culprits.far_off(found, ["walk_1"], of, start)
    assert bool(text) == bool(said) and said in text
    if said:
        assert "than the 2.0 s that are searched" in text and "offset_s in config/offsets/walk_1.yaml" in text


def test_files_that_were_exchanged_are_named():
    text = culprits.sentence(RIG, timed((0, 2, 1)), ["walk_1"], cost())
    assert text.startswith("the detections of cam02 and cam03 are exchanged: ")
    assert "ends at 5.0 px instead of 40.0 px" in text


def test_files_of_one_sequence_are_named_with_it():
    text = culprits.sentence(RIG, timed((0, 1, 2), (1, 0, 2)), ["walk_1", "walk_2"], cost())
    assert text.startswith("the detections of walk_2 of cam01 and cam02 are exchanged: ")


def test_a_camera_that_sees_something_else_is_named():
    text = culprits.sentence(RIG, timed((0, 7, 2)), ["walk_1"], cost())
    assert text.startswith("the detections of cam02 are not of what the other cameras see, or its place is wrong: ")


def test_nothing_is_said_where_nothing_explains_it_or_all_is_as_it_was():
    assert not culprits.sentence(RIG, timed((0, 7, 7)), ["walk_1"], cost())
    assert not culprits.sentence(RIG, timed((0, 1, 2)), ["walk_1"], cost(5.0))


def test_an_exchange_that_moves_the_cameras_from_their_places_is_none():
    of = {((1, 2, 0),)}  # after cam01 and cam02 of (2, 1, 0) have changed places
    text = culprits.sentence(RIG, timed((2, 1, 0)), ["walk_1"], cost(strained=of))
    assert text.startswith("the detections of cam01 and cam03 are exchanged: ") and " or " not in text


def test_frames_stay_with_the_pictures():
    """What is beyond a camera's pictures is lost, and what lacks is empty."""
    first, second = (one.uv[:, 0, 0] for one in culprits.exchanged(timed((0, 1, 2)), (0, 2)).recorded[0].seen[::2])
    assert np.array_equal(first, [2, 2]) and np.array_equal(second, [0, 0, np.nan, np.nan], equal_nan=True)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
def test_an_adjustment_of_exchanged_detections_says_so_first(seed, tmp_path):
    made = steps.recorded(
        tmp_path, preset="real", seed=seed, subjects=1, sequences=1, environments=["outdoor"], duration_s=8.0,
        gallery=False,
    )  # fmt: skip
    session = worlds.outdoors(made)
    (name,), close = made.project.sequences_of(session), made.project.close(session)
    detected = tables.read(made.made("detections", name), "detections")
    tables.write(made.made("detections", name), "detections", benchmark.exchanged(detected, close, [1, 0, 2]))
    with pytest.raises(DiorError, match="session field: the detections of cam01 and cam02 are exchanged: the adj"):
        steps.adjusted(made, session)
