import numpy as np
import pytest

from dior.body.names import MLKIT_33
from dior.body.visibility import hidden
from dior.clocks import clock as clocks
from dior.errors import DiorError
from dior.geometry import camera as cam
from dior.geometry import camera_tables
from dior.label import reproject, uncertainty
from dior.reconstruct.triangulate import columns, write_skeleton
from dior.tables import tables
from tests.rig import camera

T0 = 1_700_000_000_000_000_000
JOINTS = ("nose", "left_hip")


def skeleton(path, points, rate=100, status=None):
    stamps = T0 + np.round(np.arange(len(points)) / rate * 1e9).astype(np.int64)
    status = np.full(points.shape[:2], "ok", object) if status is None else status
    unknown = np.full(points.shape[:2], -1)
    known = columns(JOINTS, stamps, points, status, unknown, np.full(points.shape[:2], np.nan))
    write_skeleton(path, "S01", "walk_1", known)


def inputs(folder, camera_, points, frame_times, offset_s=0.0, drift_ppm=0.0, width=1280, **kwargs):
    skeleton(folder / "skeleton.parquet", points, **kwargs)
    camera_tables.write_cameras(folder / "cameras.parquet", [camera_])
    count = len(frame_times)
    stamps = T0 + np.round(np.asarray(frame_times) * 1e9).astype(np.int64)
    tables.write(
        folder / "frames.parquet",
        "frames",
        {
            "camera": ["cam01"] * count,
            "frame": np.arange(count),
            "stamp_ns": stamps,
            "receive_ns": stamps,
            "bag": ["a.bag"] * count,
            "topic": ["/t"] * count,
            "nth": np.zeros(count, int),
            "height": np.full(count, 720),
            "width": np.full(count, width),
        },
    )
    clock = clocks.Clock(offset_s, drift_ppm, "manual", given=(0.0, 0.0))
    clocks.write(folder / "clocks.parquet", folder / "gains.parquet", "walk_1", {"cam01": clock})


def run(folder, name="cam01", covariance=()):
    reproject.run(
        sequence="walk_1",
        subject="S01",
        labelled=[name],
        cameras=[folder / "cameras.parquet"],
        makers=[],
        covariance=list(covariance),
        skeleton=folder / "skeleton.parquet",
        frames=folder / "frames.parquet",
        clocks=[folder / "clocks.parquet"],
        clock_gains=[folder / "gains.parquet"],
        source="mocap",
        out=[folder / "labels.parquet"],
    )
    return tables.read(folder / "labels.parquet", "labels_2d")


def moving(count, rate=100):
    t = np.arange(count) / rate
    path = np.stack([0.5 - t, 0.2 * t, 1 + 0 * t], axis=-1)
    return np.stack([path, path + [0, 0.1, 0.2]], axis=1)


def test_a_label_is_taken_at_the_pictures_own_stamp_plus_offset(tmp_path):
    c = camera("cam01", (4.0, 0.0, 1.5))
    times = np.array([0.0, 0.0333, 0.3021])
    inputs(tmp_path, c, moving(100), times, offset_s=0.123, drift_ppm=200.0)
    table = run(tmp_path)
    at = times * (1 + 200e-6) + 0.123
    world = np.stack([0.5 - at, 0.2 * at, 1 + 0 * at], axis=-1)
    expected, depth = cam.project(c, np.stack([world, world + [0, 0.1, 0.2]], axis=1))
    uv, _ = tables.grid(table, "u", "v")
    assert uv == pytest.approx(expected, abs=2e-3)
    assert table["depth"].reshape(3, 2) == pytest.approx(depth, abs=1e-5)
    assert set(table["status"]) == {"ok"} and set(table["source"]) == {"mocap"}
    assert np.isnan(table["sigma_u"]).all()


def test_every_status_has_its_meaning(tmp_path):
    c = camera("cam01", (4.0, 0.0, 1.0), target=(0, 0, 1))
    points = np.zeros((60, 2, 3)) + [0, 0, 1]
    points[10:20, 0] = np.nan
    points[20:30, 0] = [9, 0, 1]
    points[30:40, 0] = [0, 0, 4]
    status = np.full((60, 2), "ok", object)
    status[10:20, 0] = "too_few_views"
    status[40:50, 0] = "gap_filled"
    inputs(tmp_path, c, points, np.array([0.05, 0.15, 0.25, 0.35, 0.45, 0.7]), status=status)
    table = run(tmp_path)
    assert table["status"].reshape(6, 2)[:, 0].tolist() == [
        "ok", "missing_3d", "behind_camera", "out_of_frame", "ok", "missing_3d"
    ]  # fmt: skip
    assert table["source"].reshape(6, 2)[:, 0].tolist() == ["mocap", "", "mocap", "mocap", "interpolated", ""]
    u = table["u"].reshape(6, 2)[:, 0]
    assert np.isnan(u[[1, 2, 5]]).all() and np.isfinite(u[[0, 3, 4]]).all()


def test_a_picture_beside_what_is_left_open_is_left_open(tmp_path):
    """Ten instants of 10 ms are suspect; before them one is missing for another reason."""
    points = moving(60)
    points[19:30] = np.nan
    status = np.full((60, 2), "ok", object)
    status[19], status[20:30] = "too_few_views", "suspect"
    times = np.array([0.185, 0.189, 0.195, 0.25, 0.295, 0.305])
    inputs(tmp_path, camera("cam01", (4.0, 0.0, 1.5)), points, times, status=status)
    table = run(tmp_path)
    words = ["missing_3d", "missing_3d", "suspect", "suspect", "suspect", "ok"]
    assert table["status"].reshape(6, 2)[:, 0].tolist() == words
    assert np.isnan(table["u"].reshape(6, 2)[:5]).all() and set(table["source"][:10]) == {""}


def test_nothing_is_made_up_across_a_gap(tmp_path):
    points = moving(60)
    points[20] = np.nan
    inputs(tmp_path, camera("cam01", (4.0, 0.0, 1.5)), points, np.array([0.189, 0.195, 0.205, 0.211]))
    assert run(tmp_path)["status"].reshape(4, 2)[:, 0].tolist() == ["ok", "missing_3d", "missing_3d", "ok"]


def test_wrong_inputs_are_named(tmp_path):
    inputs(tmp_path, camera("cam01", (4.0, 0.0, 1.5)), moving(60), np.array([0.1, 0.2]), width=640)
    with pytest.raises(DiorError, match="walk_1, camera cam01: the pictures are 640x720"):
        run(tmp_path)
    with pytest.raises(DiorError, match="camera cam07: .*gives no pose"):
        run(tmp_path, "cam07")


def test_a_clocks_error_is_in_the_sigma(tmp_path):
    c = camera("cam01", (4.0, 0.0, 1.5))
    inputs(tmp_path, c, moving(100), np.array([0.1, 0.2, 0.3]))
    camera_tables.write_camera_covariance(tmp_path / "covariance.parquet", ["cam01"], np.zeros((6, 6)), "lab")
    late = clocks.Clock(0.0, 0.0, "estimated", "detections", given=(0.004, 0.0))
    clocks.write(tmp_path / "clocks.parquet", tmp_path / "gains.parquet", "walk_1", {"cam01": late})
    table = run(tmp_path, covariance=[tmp_path / "covariance.parquet"])
    uv, _ = tables.grid(table, "u", "v", "sigma_u", "sigma_v")
    # a joint that moves so far in 0.1 s moves 4 % of that in 4 ms
    moved = np.abs(uv[2, :, :2] - uv[0, :, :2]) / 2
    assert uv[1, :, 2:] == pytest.approx(0.04 * moved, rel=0.02, abs=1e-3)


def test_clocks_that_are_all_late_alike_move_no_label_of_their_own_3d():
    rig = [camera(f"cam0{i}", (4 * np.cos(a), 4 * np.sin(a), 1.5)) for i, a in enumerate((0.0, 2.0, 4.0))]
    points, velocity = np.array([[[0.0, 0.0, 1.0]]]), np.array([[[1.0, 0.5, 0.0]]])
    names, nothing = [c.name for c in rig], np.zeros((1, 1, 3, 3))
    # one clock that all owe to the same error of a camera
    owed = np.zeros((2, 6))
    owed[0, 0] = 1.0
    known = {name: clocks.Clock(0.0, given=(0.0, 0.0), gains={"cam00": owed}) for name in names}
    joint = np.zeros((18, 18))
    joint[0, 0] = 1e-6
    args = rig[1], points, nothing, rig, names, joint
    alike = uncertainty.of_labels(*args, uncertainty.Timing(known, velocity, np.zeros(1)))
    still = uncertainty.of_labels(*args)
    assert alike == pytest.approx(still, abs=1e-12) and still.max() > 0
    own = known | {"cam01": clocks.Clock(0.0, given=(0.01, 0.0))}
    assert (
        uncertainty.of_labels(*args, uncertainty.Timing(own, velocity, np.zeros(1)))[0, 0, 0, 0]
        > still[0, 0, 0, 0] + 0.1
    )


def test_a_clocks_error_counts_by_the_speed_at_the_time_by_the_clock(tmp_path):
    """A joint that is faster and faster across the picture: 0.5 s later it goes 1.5 m/s instead of 1."""
    c, t = camera("cam01", (0.0, 5.0, 1.0), distortion=()), np.arange(200) / 100
    path = np.stack([0.5 * t**2 - 0.5, 0 * t, 0 * t + 1], axis=-1)
    inputs(tmp_path, c, np.repeat(path[:, None], 2, axis=1), np.array([1.0]), offset_s=0.5)
    camera_tables.write_camera_covariance(tmp_path / "covariance.parquet", ["cam01"], np.zeros((6, 6)), "lab")
    late = clocks.Clock(0.5, 0.0, "estimated", "detections", given=(0.004, 0.0))
    clocks.write(tmp_path / "clocks.parquet", tmp_path / "gains.parquet", "walk_1", {"cam01": late})
    table = run(tmp_path, covariance=[tmp_path / "covariance.parquet"])
    assert table["sigma_u"] == pytest.approx([c.intrinsics.fx / 5 * 1.5 * 0.004] * 2, rel=0.02)


def test_what_is_out_of_the_picture_is_not_called_hidden():
    from dior.simulate.body import Body
    from dior.simulate.bystander import standing

    body = standing(Body(1.75), np.zeros(2), 0.0)[None]
    beside = camera("cam01", (-5.0, 0.0, 1.5), target=(0.0, -5.0, 1.5))
    uv, _, status = reproject.labels(beside, body, MLKIT_33)
    outside = ~cam.in_frame(beside.intrinsics, uv)
    assert hidden(beside, body, MLKIT_33)[outside].any() and set(status[outside]) == {"out_of_frame"}
