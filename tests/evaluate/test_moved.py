"""A camera that was turned between two walks is named with the walk, and one that stood still is not."""

import numpy as np
import pytest

from benchmarks import bumps
from dior.body.names import MLKIT_33
from dior.evaluate import moved
from dior.geometry import camera as cam
from dior.geometry import camera_tables
from dior.geometry import covariance as cov
from dior.tables import tables
from tests.cases import some
from tests.rig import ring

HIPS = MLKIT_33.index("left_hip"), MLKIT_33.index("right_hip")


def walk(seed, count=80):
    """Somebody who walks in a circle: points (T, 33, 3) m of a body of fixed shape."""
    shape = np.random.default_rng(7).uniform((-0.3, -0.3, 0.05), (0.3, 0.3, 1.7), (33, 3))
    shape[list(HIPS)] = [(0.0, 0.15, 0.9), (0.0, -0.15, 0.9)]
    turn = np.linspace(0, 2 * np.pi, count) + seed
    c, s, zero, one = np.cos(turn), np.sin(turn), np.zeros(count), np.ones(count)
    R = np.stack([c, -s, zero, s, c, zero, zero, zero, one], axis=-1).reshape(-1, 3, 3)
    return shape @ np.swapaxes(R, 1, 2) + np.stack([np.sin(turn), -np.cos(turn), zero], axis=-1)[:, None]


def seen(cameras, seed, noise=1.0, bias=0.0):
    points = walk(seed)
    uv = np.stack([cam.project(c, points)[0] for c in cameras])
    offsets = bias * np.random.default_rng(3).standard_normal((len(cameras), 1, 33, 2))
    return uv + offsets + noise * np.random.default_rng([seed, 1]).standard_normal(uv.shape)


def normals(stood, true, **kwargs):
    out = []
    for seed, cameras in enumerate(true):
        uv = seen(cameras, seed, **kwargs)
        out.append(moved.normal(stood, uv, np.ones(uv.shape[:3]), MLKIT_33))
    return out


def turned(cameras, which, degrees):
    step = np.zeros(6)
    step[1] = np.radians(degrees)
    return [cov.moved(c, step) if i == which else c for i, c in enumerate(cameras)]


@pytest.mark.parametrize("bias", [0.0, 4.0])
@pytest.mark.parametrize("first", [1, 3])
def test_a_bump_is_found_where_it_was(first, bias):
    rig = ring(3)
    true = [turned(rig, 1, 0.3 if i >= first else 0.0) for i in range(5)]
    change = moved.find_change(normals(rig, true, bias=bias))
    assert (change.camera, change.first) == (1, first)
    assert change.turn_deg == pytest.approx(0.3, abs=0.04)


@pytest.mark.parametrize(("degrees", "said"), [(0.12, False), (0.3, True)])
def test_of_two_walks_which_do_not_tell_how_walks_differ_less_is_believed(monkeypatch, degrees, said):
    known = np.radians([0, degrees, 0]), np.radians(0.005) ** 2 * np.eye(3), 40.0
    monkeypatch.setattr(moved, "turn", lambda before, after, camera: known)
    one = moved.Normal(np.zeros(1), np.zeros((3, 1, 3, 3)), np.zeros((3, 1, 3)))
    assert (moved.find_change([one, one]) is not None) == said
    assert moved.find_change([one, one, one]) is not None


def test_the_camera_that_explains_most_is_named_though_another_that_gives_way_is_told_more_surely(monkeypatch):
    told = {0: (0.44, 0.02, 37.0), 1: (0.50, 0.20, 42.0), 2: (0.30, 0.20, 20.0)}  # degrees, sigma, px^2

    def turn(before, after, camera):
        degrees, sigma, gain = told[camera]
        return np.radians([0, degrees, 0]), np.radians(sigma) ** 2 * np.eye(3), gain

    monkeypatch.setattr(moved, "turn", turn)
    one = moved.Normal(np.zeros(1), np.zeros((3, 1, 3, 3)), np.zeros((3, 1, 3)))
    change = moved.find_change([one, one])
    assert (change.camera, change.first, change.others) == (1, 1, (0,))
    [(scope, *_, text)] = moved._findings("field", ["a", "b", "c"], ["w1", "w2"], change)
    assert scope == "field/b" and text.startswith("b (or a: that explains nearly as much) was turned by 0.50 degrees")
    told[0] = (0.44, 0.2, 37.0)
    assert moved.find_change([one, one]) is None


@pytest.mark.parametrize("bias", [0.0, 4.0])
def test_cameras_that_stand_still_raise_no_alarm(bias):
    rig = ring(3)
    # a calibration that is wrong throughout is no motion
    assert moved.find_change(normals(turned(rig, 2, 0.3), [rig] * 5, bias=bias)) is None


def test_one_walk_tells_nothing():
    rig = ring(3)
    assert moved.find_change(normals(rig, [rig])) is None


def test_run_names_camera_and_sequence(tmp_path):
    rig = ring(3)
    names, sequences = [c.name for c in rig], ["walk_1", "walk_2", "walk_3"]
    camera_tables.write_cameras(tmp_path / "cameras.parquet", rig, "field")
    for seed, sequence in enumerate(sequences):
        uv = seen(turned(rig, 0, 0.4 if seed else 0.0), seed)
        write(tmp_path, sequence, names, uv)
    run(tmp_path, names, sequences)
    (text,) = tables.read(tmp_path / "findings.parquet", "findings")["text"]
    assert (
        text.startswith("cam01 ")
        and "was turned by 0.4" in text
        and "between walk_1 and walk_2" in text
        and "cam01@walk_2.yaml" in text
    )
    table = tables.read(tmp_path / "turns.parquet", "camera_turns")
    assert len(table["camera"]) == 9
    first = (table["camera"] == "cam01") & (table["sequence"] == "walk_1")
    assert table["turn_y"][first] == pytest.approx(-0.4, abs=0.05)


@pytest.mark.parametrize(
    ("adjusted", "aside"),
    [([], ["field"]), (["w1"], ["w3", "w4"]), (["w4"], ["w1", "w2"]), (["w2", "w3"], ["field"])],
)
def test_a_bump_draws_labels_aside_where_the_cameras_were_not_adjusted(adjusted, aside):
    change = moved.Change(1, 2, 0.5, 10.0)
    found = moved._findings("field", ["a", "b"], ["w1", "w2", "w3", "w4"], change, adjusted=adjusted)
    assert [scope for scope, *_ in found] == [f"{where}/b" for where in aside]
    assert len({text for *_, text in found}) == 1


def run(folder, names, sequences):
    moved.run(
        session="field", sequences=sequences, names=names, cameras=[folder / "cameras.parquet"],
        detections=[folder / f"{s}.detections.parquet" for s in sequences],
        timelines=[folder / f"{s}.timeline.parquet" for s in sequences],
        swaps=[folder / f"{s}.swaps.parquet" for s in sequences],
        min_score=0.3, adjusted=[], out=folder / "turns.parquet", findings=folder / "findings.parquet",
    )  # fmt: skip


def test_a_bump_that_shows_in_a_walk_is_one_fault(tmp_path):
    rig = ring(3)
    names, sequences = [c.name for c in rig], ["walk_1", "walk_2"]
    camera_tables.write_cameras(tmp_path / "cameras.parquet", rig, "field")
    for seed, sequence in enumerate(sequences):
        write(tmp_path, sequence, names, seen(turned(rig, 0, 3.0 if seed else 0.0), seed))
    run(tmp_path, names, sequences)
    (text,) = tables.read(tmp_path / "findings.parquet", "findings")["text"]
    assert text.endswith("; that it does not belong to the others in walk_2 is the same fault")


def test_detections_that_were_exchanged_are_no_turn(tmp_path):
    rig = ring(3)
    names, sequences = [c.name for c in rig], ["walk_1", "walk_2"]
    camera_tables.write_cameras(tmp_path / "cameras.parquet", rig, "field")
    for seed, sequence in enumerate(sequences):
        uv = seen(rig, seed)
        write(tmp_path, sequence, names, uv[[1, 0, 2]] if seed else uv)
    run(tmp_path, names, sequences)
    assert not len(tables.read(tmp_path / "findings.parquet", "findings")["text"])
    table = tables.read(tmp_path / "turns.parquet", "camera_turns")
    assert np.array_equal(np.isnan(table["turn_y"]), [True] * 6)


def write(folder, sequence, names, uv):
    views, count, joints = uv.shape[:3]
    frame = np.tile(np.repeat(np.arange(count), joints), views)
    stamps = np.arange(count) * 33_333_333
    tables.write(
        folder / f"{sequence}.detections.parquet",
        "detections",
        {
            "camera": np.repeat(names, count * joints).astype(object),
            "frame": frame,
            "stamp_ns": stamps[frame],
            "person": np.zeros(len(frame), int),
            "joint": np.tile(np.array(MLKIT_33, object), views * count),
            "u": uv[..., 0].ravel(),
            "v": uv[..., 1].ravel(),
            "score": np.ones(len(frame)),
        },
    )
    instant = np.tile(np.arange(count), views)
    by_camera = {"camera": np.repeat(names, count).astype(object), "instant": instant, "stamp_ns": stamps[instant]}
    tables.write(
        folder / f"{sequence}.timeline.parquet",
        "timeline",
        by_camera | {"frame_before": instant, "frame_after": instant, "weight": np.zeros(len(instant))},
    )
    tables.write(
        folder / f"{sequence}.swaps.parquet",
        "swaps",
        by_camera | {"frame": instant, "swapped": np.zeros(len(instant), bool), "part": [""] * len(instant)},
    )


def test_a_wild_residual_pulls_no_harder_than_two_usual_ones():
    miss = np.zeros((1, 5, 1, 2))
    miss[0, :, 0, 0] = [1.0, 1.0, -1.0, 2.0, 50.0]
    bounded = moved._bounded(miss, np.ones((5, 1), bool))
    assert bounded[0, :, 0, 0] == pytest.approx([1.0, 1.0, -1.0, 2.0, 2.0])


def test_what_noise_alone_makes_is_no_bump():
    rig = ring(3)
    assert all(moved.find_change(normals(rig, [rig] * count, noise=30.0)) is None for count in (2, 3, 4))


def test_walks_that_differ_among_themselves_by_as_much_are_no_bump():
    rig = ring(3)
    true = [turned(rig, 1, degrees) for degrees in (0.2, -0.2, 0.2, -0.2, 0.2)]
    assert moved.find_change(normals(rig, true)) is None


def test_a_bump_between_walks_that_share_few_headings_is_no_scatter():
    """Walk 3 shares its headings mostly with walk 4, which was bumped as well."""
    cells, degrees = 40, np.array([0.0, 0.3, 0.0])
    first = np.arange(cells) < cells // 2

    def normal(here, elsewhere, bumped):
        count = np.where(first, here, elsewhere).astype(float)
        g = count[None, :, None] * np.radians(degrees) * bumped
        return moved.Normal(count, count[None, :, None, None] * np.eye(3), g)

    walks = [normal(100, 0, 0), normal(100, 100, 0), normal(100, 0, 1), normal(1000, 100, 1)]
    change = moved.find_change(walks)
    assert change.first == 2 and change.turn_deg == pytest.approx(0.3)


@pytest.mark.parametrize("walks", some([2, 4], 2))
def test_walks_in_two_directions_as_a_real_detector_sees_them_are_no_bump(walks):
    assert [bumps.session("real", seed, 0.0, 150, walks)[0] for seed in range(3)] == [None] * 3
