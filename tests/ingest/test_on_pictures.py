"""Detections against the pictures: a walker made of limbs, and what may be wrong with the detections of him."""

import numpy as np
import pytest

from benchmarks import on_pictures as benchmark
from dior.body.names import COCO_17, bones_of
from dior.errors import DiorError
from dior.ingest import moving, on_pictures
from tests.cases import some
from tests.ingest.test_bags import T0, TOPIC, compressed, encoded, write_bag

SIZE, FACTOR, COUNT = (640, 360), 2, 60
# a standing body of height 1, x to the right and y down from the crown
PLACES = {
    "nose": (0.0, 0.07), "eye": (0.02, 0.06), "ear": (0.03, 0.07), "shoulder": (0.10, 0.19), "elbow": (0.13, 0.36),
    "wrist": (0.14, 0.50), "hip": (0.06, 0.50), "knee": (0.06, 0.73), "ankle": (0.06, 0.96),
}  # fmt: skip
BODY = np.array(
    [
        np.array(PLACES[name.removeprefix("left_").removeprefix("right_")]) * (-1 if name.startswith("right") else 1, 1)
        for name in COCO_17
    ]
)
HEAD = np.array([name == "nose" or name.endswith(("_eye", "_ear")) for name in COCO_17])


def walker(speed_px=7.0, tall_px=150.0, count=COUNT, left_px=110.0, top_px=120.0):
    """Joints (F, 17, 2) px of somebody who goes to the right, with legs that swing."""
    frame = np.arange(count)[:, None]
    uv = np.broadcast_to(BODY * tall_px, (count, *BODY.shape)).copy()
    swing = 0.12 * tall_px * np.sin(0.35 * frame)
    for part, share in (("ankle", 1.0), ("knee", 0.5)):
        for side, sign in (("left", 1), ("right", -1)):
            uv[:, COCO_17.index(f"{side}_{part}"), 0] += sign * share * swing[:, 0]
    return uv + np.stack([left_px + speed_px * frame, top_px + 0 * frame], axis=-1)


def picture(uv, noise=3.0):
    """A bright body before a wall with texture, (360, 640, 3)."""
    body = on_pictures.drawn(uv, bones_of(COCO_17), HEAD, SIZE[::-1])
    wall = 90 + 40 * np.sin(np.arange(SIZE[0]) / 25) + 30 * np.cos(np.arange(SIZE[1]) / 19)[:, None]
    found = np.where(body, 230.0, wall)[..., None] + noise * np.random.default_rng(1).standard_normal((*body.shape, 3))
    return np.clip(found, 0, 255).astype(np.uint8)


def seen(uv, shown):
    """Pictures that show the body of `uv`, 2 times smaller."""
    return [moving.reduced(picture(uv[f]), FACTOR) for f in shown]


def verdict(true, given):
    there = np.flatnonzero(np.isfinite(given).all(axis=-1).sum(axis=1) >= on_pictures.FEWEST_JOINTS)
    shown = on_pictures.chosen(given, there, 7)
    return on_pictures.verdict(given, COCO_17, SIZE, shown, seen(true, shown), FACTOR, "w, cam02: cam02.json")


def noisy(uv, sd=2.0):
    return uv + sd * np.random.default_rng(3).standard_normal(uv.shape)


def shifted(uv, frames):
    """The detections `frames` later in the file."""
    out = np.full(uv.shape, np.nan)
    out[max(frames, 0) : len(uv) + min(frames, 0)] = uv[max(-frames, 0) : len(uv) - max(frames, 0)]
    return out


def test_detections_that_lie_on_the_pictures_are_fine():
    true = walker()
    ((severity, code, text),) = verdict(true, noisy(true))
    assert (severity, code) == ("info", "detections_on_pictures")
    assert "in common" in text and "frames or more off" in text


CORNER = np.array(SIZE) - 1.0
FAULTS = {
    "turned by 180 degrees": lambda uv: CORNER - uv,
    "mirrored left to right": lambda uv: CORNER * (1, 0) + uv * (-1, 1),
    "mirrored top to bottom": lambda uv: CORNER * (0, 1) + uv * (1, -1),
    "multiplied by 2": lambda uv: (uv + 0.5) / 2 - 0.5,
    "multiplied by 0.5": lambda uv: (uv + 0.5) * 2 - 0.5,
    "multiplied by 1.5": lambda uv: (uv + 0.5) / 1.5 - 0.5,
    "multiplied by 0.667": lambda uv: (uv + 0.5) * 1.5 - 0.5,
    "taken 6 frames earlier": lambda uv: shifted(uv, 6),
    "taken 6 frames later": lambda uv: shifted(uv, -6),
}


@pytest.mark.parametrize("words", some(FAULTS, *[*FAULTS][::4]))
def test_what_is_wrong_is_named(words):
    true = walker(left_px=60.0)
    said = f"w, cam02: cam02.json: the detections fit the pictures when {words}: what moves and the body then have"
    with pytest.raises(DiorError) as raised:
        verdict(true, FAULTS[words](noisy(true)))
    assert str(raised.value).startswith(said)
    if "taken" in words:
        assert f"frames {'late' if 'earlier' in words else 'early'}: number them by" in str(raised.value)


def test_detections_of_another_recording_fit_in_no_way():
    other = walker(top_px=20.0, tall_px=60.0, left_px=500.0, speed_px=-6.0)
    with pytest.raises(DiorError, match=r"nowhere near what moves .* are they of another camera or recording\?"):
        verdict(walker(), noisy(other, 1.0))


def test_a_cause_that_explains_little_is_not_said_to_be_the_only_one():
    """Somebody else's walk the other way, mirrored, lies on the walker, but badly; a mirrored one lies well."""
    true = walker(left_px=60.0)
    aside = FAULTS["mirrored left to right"](true) + (0.0, 45.0)
    with pytest.raises(
        DiorError, match=r"fit the pictures when mirrored .* or, as that is little .* of another camera"
    ):
        verdict(true, noisy(aside))
    with pytest.raises(DiorError, match=r"as they were recorded$"):
        verdict(true, FAULTS["mirrored left to right"](noisy(true)))


def test_who_walks_along_the_axis_in_the_middle_is_not_told_from_a_mirror():
    true = walker(speed_px=0.0, left_px=(SIZE[0] - 1) / 2) + np.zeros((COUNT, 1, 1))
    # nearer from picture to picture, about the middle
    middle = np.array([(SIZE[0] - 1) / 2, 120.0])
    true = middle + (true - middle) * np.linspace(0.5, 1.4, COUNT)[:, None, None]
    mirrored = FAULTS["mirrored left to right"](noisy(true))
    ((severity, code, text),) = verdict(true, mirrored)
    assert (severity, code) == ("info", "detections_unsure") and "mirrored left to right" in text
    assert "turned by 180 degrees" not in text.partition("told from")[2]


@pytest.mark.parametrize(
    ("likely", "words"), [(0, "not 1 frames or more"), (6, "not 7 frames"), (15, "cannot be told")]
)
def test_a_slip_is_told_where_it_would_show_either_way(monkeypatch, likely, words):
    """That they are later is clear, that they are earlier is not."""
    others = on_pictures.alternatives()
    t = np.where([other.frames == likely and likely > 0 for other in others], 2.0, -10.0)
    many = np.full(len(others), 9)
    found = on_pictures.Judged(0 * t, t, many, 0 * t + 0.5, 0 * t, 1.0, (0.0, -9.0, 9, 0.5, 0.0))
    monkeypatch.setattr(on_pictures, "judge", lambda *args: found)
    assert words in verdict(walker(), walker())[0][2]


def test_nothing_that_moves_tells_nothing():
    true = walker()
    still = np.broadcast_to(true[:1], true.shape)
    ((severity, code, text),) = verdict(still, noisy(still))
    assert (severity, code) == ("info", "detections_unsure") and "next to nothing moves" in text


def test_few_detections_tell_nothing(tmp_path):
    uv = np.full((COUNT, 17, 2), np.nan)
    uv[:4] = walker()[:4]
    found = on_pictures.check(uv, np.ones((COUNT, 17)), COCO_17, {}, tmp_path, "cam02.json", "w, cam02")
    assert found[0][1] == "detections_unsure" and "found in 4 pictures" in found[0][2]


@pytest.mark.slow
def test_the_pictures_of_a_bag_are_read(tmp_path):
    true = walker()
    pictures = [picture(uv) for uv in true]
    stamps = T0 + 33_333_333 * np.arange(COUNT)
    write_bag(
        tmp_path / "a.bag",
        [(TOPIC, int(t), compressed(int(t), encoded(p))) for t, p in zip(stamps, pictures, strict=True)],
    )
    rows = {
        "camera": np.full(COUNT, "cam02", object), "frame": np.arange(COUNT), "stamp_ns": stamps, "receive_ns": stamps,
        "bag": np.full(COUNT, "a.bag", object), "topic": np.full(COUNT, TOPIC, object), "nth": np.zeros(COUNT, int),
        "width": np.full(COUNT, SIZE[0]), "height": np.full(COUNT, SIZE[1]),
    }  # fmt: skip
    score = np.ones(true.shape[:2])
    assert on_pictures.check(true, score, COCO_17, rows, tmp_path, "d", "w, cam02")[0][1] == "detections_on_pictures"
    with pytest.raises(DiorError, match="turned by 180 degrees"):
        on_pictures.check(CORNER - true, score, COCO_17, rows, tmp_path, "d", "w, cam02")


@pytest.mark.slow
@pytest.mark.parametrize("level", ["ideal", "real"])
@pytest.mark.parametrize(("seed", "environment"), [(1, "outdoor"), (2, "indoor")])
def test_every_fault_of_a_walk_is_named_and_no_clean_one(seed, environment, level):
    """In one of its cameras or more, and no wrong cause in another; `python -m benchmarks.on_pictures` has 20 seeds."""
    each = dict(benchmark.verdicts(seed, level, environment))
    for fault in benchmark.FAULTS:
        said = {benchmark.judged(fault, one[fault][0]) for one in each.values()} & {"named", "refused"}
        assert said == (set() if fault == "clean" else {"named"}), (
            fault,
            {c: one[fault][0] for c, one in each.items()},
        )
