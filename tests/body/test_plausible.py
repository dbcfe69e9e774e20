"""People who cannot be, though their pixels would be right: each gate refuses its own, and lets a walker pass."""

import numpy as np
import pytest

from dior.body import plausible
from dior.errors import DiorError
from tests.calibrate.bundle.test_facts import walker


def person(**change):
    points, tracks = walker(60, change.get("height", 1.75))
    return points.reshape(60, -1, 3), tracks.names


def seconds():
    return np.arange(60) / 30


def test_a_walker_passes_and_is_measured():
    found = plausible.check(*person(), "s", seconds=seconds())
    assert found["stature_m"] == pytest.approx(1.75) and abs(found["feet_m"]) < 1e-9 and found["lean_deg"] < 1e-6
    assert 0.5 < found["speed_m_s"] < 3


def tilted(points):
    c, s = np.cos(np.radians(50)), np.sin(np.radians(50))
    return points @ np.array([[1, 0, 0], [0, c, -s], [0, s, c]]).T


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (lambda p: 1.4 * p, r"2\.45 m tall, outside of 1-2\.2 m \(physics.stature_m\)"),
        (lambda p: 0.5 * p, r"0\.88 m tall"),
        (lambda p: p - (0, 0, 0.59), r"the feet stand 0\.59 m below the floor"),
        (lambda p: p + (0, 0, 0.4), r"0\.40 m above the floor"),
        (lambda p: p * (1, 1, -1), "feet stand|leans"),
    ],
)
def test_a_wrong_world_is_refused(wrong, message):
    points, names = person()
    with pytest.raises(DiorError, match=f"s: .*({message})"):
        plausible.check(wrong(points), names, "s")


def test_a_tilted_world_is_refused():
    points, names = person()
    with pytest.raises(DiorError, match="s: the body leans by 50 degrees"):
        plausible.check(tilted(points), names, "s", {"feet_m": 10.0})


def test_a_scale_or_clock_that_makes_people_fly_is_refused():
    points, names = person()
    with pytest.raises(DiorError, match=r"s: the person moves at \d+\.\d m/s"):
        plausible.check(points, names, "s", seconds=seconds() / 10)


def test_a_height_beyond_the_share_or_four_sigmas_is_refused():
    points, names = person()
    for height_m, sigma_m in ((1.75, 0.0), (1.60, 0.0), (1.95, 0.0), (1.40, 0.1)):
        plausible.check_height(points, names, "s", "S01", height_m, sigma_m)
    for height_m, sigma_m, share, off in (
        (1.50, 0.01, 0.15, "25 cm taller"), (1.40, 0.05, 0.15, "35 cm taller"), (1.65, 0.01, 0.05, "10 cm taller"),
        (1.95, 0.01, 0.05, "20 cm smaller"),
    ):  # fmt: skip
        with pytest.raises(DiorError, match=f"s: S01 would be {off} than config/subjects.tsv says") as caught:
            plausible.check_height(points, names, "s", "S01", height_m, sigma_m, share)
        assert f"{height_m:g}" not in str(caught.value) and "1.75" not in str(caught.value), "it goes into a log"


def test_a_person_whose_segments_are_not_seen_is_not_judged():
    plausible.check_height(np.full((5, 2, 3), np.nan), ("nose", "left_hip"), "s", "S01", 1.75)


def test_what_is_missing_passes_as_unknown():
    found = plausible.check(np.full((5, 2, 3), np.nan), ("nose", "left_hip"), "s", seconds=np.arange(5.0))
    assert all(np.isnan(value) for value in found.values())
