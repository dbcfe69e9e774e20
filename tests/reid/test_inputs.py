"""From 3D and cameras to what a network is given."""

import numpy as np
import pytest

from dior.body.names import COCO_17, MLKIT_33, PLUG_IN_GAIT_39
from dior.clocks import clock
from dior.clocks.clock import Clock
from dior.errors import DiorError
from dior.geometry import camera as cam
from dior.geometry import camera_tables
from dior.geometry.multiview import look_at
from dior.reid import inputs
from dior.simulate.body import Body
from dior.simulate.gait import Walker
from dior.tables import tables

FPS, FRAMES, START = 30.0, 120, 1_700_000_000_000_000_000


def walking(frames=FRAMES):
    return Walker(Body(1.75), until=6.0).at(np.arange(frames) / FPS)


def skeleton(path, points, names, status="ok"):
    count, each = points.shape[:2]
    known = np.isfinite(points).all(axis=-1)
    tables.write(
        path,
        "skeletons_3d",
        {
            "subject": np.full(count * each, "S01", object),
            "sequence": np.full(count * each, "walk", object),
            "joint": np.tile(np.array(names, object), count),
            "instant": np.repeat(np.arange(count), each),
            "stamp_ns": np.repeat(START + np.rint(np.arange(count) * 1e9 / FPS).astype(np.int64), each),
            **{axis: points[..., i].ravel() for i, axis in enumerate("xyz")},
            **{f"sigma_{axis}": np.where(known, 0.01, np.nan).ravel() for axis in "xyz"},
            **{f"rho_{axes}": np.where(known, 0.0, np.nan).ravel() for axes in ("xy", "xz", "yz")},
            "n_views": np.full(count * each, 3),
            "status": np.where(known, status, "too_few_views").ravel().astype(object),
        },
    )
    return path


def camera(name="cam01", width=1280):
    centre = np.array([0.0, -5.0, 1.5])
    lens = cam.Intrinsics(width, 720, 600.0, 600.0, (width - 1) / 2, 359.5)
    return cam.Camera(name, lens, cam.pose(look_at(centre, (0.0, 0.0, 1.0)), centre), "close")


def made(folder, points, names, offset_s=0.0, pictures=None):
    """The tables that `inputs.run` writes of one camera."""
    pictures = np.arange(FRAMES) if pictures is None else pictures
    stamps = START + np.rint(pictures * 1e9 / FPS).astype(np.int64)
    count = len(pictures)
    camera_tables.write_cameras(folder / "camera.parquet", [camera()], "lab")
    tables.write(
        folder / "frames.parquet",
        "frames",
        {"camera": np.full(count, "cam01", object), "frame": np.arange(count), "stamp_ns": stamps}
        | {"height": np.full(count, 720), "width": np.full(count, 1280)},
    )
    clock.write(folder / "clocks.parquet", folder / "gains.parquet", "walk", {"cam01": Clock(offset_s)})
    inputs.run(
        sequence="walk", subject="S01", names=["cam01"], skeleton=skeleton(folder / "skeleton.parquet", points, names),
        cameras=[folder / "camera.parquet"], frames=folder / "frames.parquet", clocks=[folder / "clocks.parquet"],
        source="triangulated", out=folder / "out.parquet", out_skeleton=folder / "out.skeleton.parquet",
    )  # fmt: skip
    return folder / "out.parquet", folder / "out.skeleton.parquet"


def test_a_detectors_joints_are_taken_by_name(tmp_path):
    landmarks, _ = walking()
    labels, body = made(tmp_path, landmarks, MLKIT_33)
    track = inputs.camera_walks(labels, {"cam01": 1280})["cam01"]
    expected, _ = cam.project(camera(), landmarks[:, [MLKIT_33.index(name) for name in COCO_17]])
    assert track.fps == 30 and track.width == 1280
    assert np.abs(track.uv - expected).max() < 1e-3
    table = tables.read(body, "skeletons_3d")
    xyz, joints = tables.grid(table, "x", "y", "z")
    assert tuple(joints) == COCO_17 and np.abs(xyz[:, 11] - landmarks[:, MLKIT_33.index("left_hip")]).max() < 1e-6
    assert (table["sigma_x"] > 0).all()


def test_markers_become_joint_centres(tmp_path):
    landmarks, markers = walking()
    labels, body = made(tmp_path, markers, PLUG_IN_GAIT_39)
    uv = inputs.camera_walks(labels, {"cam01": 1280})["cam01"].uv
    expected, depth = cam.project(camera(), landmarks[:, [MLKIT_33.index(name) for name in COCO_17]])
    off = np.linalg.norm(uv - expected, axis=-1) * depth / 600.0
    for name, most in (("left_knee", 0.04), ("right_ankle", 0.04), ("left_hip", 0.06), ("right_wrist", 0.03)):
        assert np.nanmean(off[:, COCO_17.index(name)]) < most, name
    # a joint that is derived has no sigma
    assert np.isnan(tables.read(body, "skeletons_3d")["sigma_x"]).all()


def test_the_cameras_clock_is_minded(tmp_path):
    landmarks, _ = walking()
    labels, _ = made(tmp_path, landmarks, MLKIT_33, offset_s=10 / FPS)
    uv = inputs.camera_walks(labels, {"cam01": 1280})["cam01"].uv
    expected, _ = cam.project(camera(), landmarks[:, [MLKIT_33.index(name) for name in COCO_17]])
    assert np.abs(uv[:-10] - expected[10:]).max() < 1e-2
    assert np.isnan(uv[-9:]).all()


def test_lost_pictures_leave_a_gap_and_repeated_ones_none(tmp_path):
    landmarks, _ = walking()
    pictures = np.delete(np.arange(FRAMES), [50, 51, 52])
    pictures = np.insert(pictures, 10, pictures[10])
    labels, _ = made(tmp_path, landmarks, MLKIT_33, pictures=pictures)
    track = inputs.camera_walks(labels, {"cam01": 1280})["cam01"]
    assert len(track.uv) == FRAMES
    assert np.flatnonzero(np.isnan(track.uv).any(axis=(1, 2))).tolist() == [50, 51, 52]


def test_what_cannot_be_made_is_said(tmp_path):
    with pytest.raises(DiorError, match="walk: no joint of COCO-17 can be made of .*skeleton.parquet .tail"):
        made(tmp_path, np.zeros((FRAMES, 1, 3)), ["tail"])


def track(frames, missing=()):
    uv = np.random.default_rng(1).uniform(0, 700, (frames, 17, 2))
    for first, last, joint in missing:
        uv[first:last, joint] = np.nan
    return inputs.CameraWalk(uv, FPS, 1280)


def test_short_gaps_are_bridged_and_long_ones_are_not():
    uv = np.zeros((20, 2, 2))
    uv[:, 0, 0], uv[:, 1, 1] = np.arange(20), 2 * np.arange(20)
    holed = uv.copy()
    holed[3:6, 0] = holed[10:15, 1] = holed[:2, 1] = np.nan
    out = inputs.filled(holed, 3)
    assert np.abs(out[3:6, 0] - uv[3:6, 0]).max() < 1e-9
    assert np.isnan(out[10:15, 1]).all() and np.isnan(out[:2, 1]).all()
    assert np.isnan(holed[3:6, 0]).all()


def test_a_swing_is_bridged_as_it_goes_on():
    seconds = np.arange(90) / FPS
    uv = 100 * np.sin(2 * np.pi * 0.9 * seconds)[:, None, None] * np.ones((1, 1, 2))
    holed = uv.copy()
    holed[30:40] = holed[60:70] = np.nan
    assert np.abs(inputs.filled(holed, 10) - uv).max() < 12


def test_the_sequence_in_the_middle_is_taken():
    given = track(1000)
    found, why = inputs.cut(given)
    assert why == "" and len(found) == 1 and (found[0] == given.uv[350:650]).all()
    # the middle has a gap: the nearest 300 whole frames
    found, why = inputs.cut(track(1000, [(400, 420, 3)]))
    assert why == "" and (found[0] == track(1000).uv[420:720]).all()


def test_a_recording_gives_several_sequences_on_request():
    found, why = inputs.cut(track(900), chunks=3)
    assert why == "" and [len(part) for part in found] == [300, 300, 300]
    assert (np.concatenate(found) == track(900).uv).all()
    found, why = inputs.cut(track(900, [(300 + 30 * k, 320 + 30 * k, 0) for k in range(10)]), chunks=3)
    assert (
        len(found) == 2
        and why == "at most 300 pictures in a row with all joints, gaps up to 0.4 s bridged; 61 are needed"
    )


def test_a_shorter_sequence_is_taken_down_to_the_authors_limit():
    assert len(inputs.cut(track(200))[0][0]) == 200
    assert len(inputs.cut(track(61))[0][0]) == 61
    assert inputs.cut(track(60)) == ([], "60 pictures; 61 are needed")
    found, why = inputs.cut(track(200, [(25 * k, 25 * k + 15, k) for k in range(8)]))
    assert found == [] and why.startswith("at most 10 pictures in a row")


def test_adaptations():
    uv = track(100).uv
    assert inputs.adapted(uv, 1280, "as_is") is uv
    assert (inputs.adapted(uv, 1280, "scaled") == uv / 4).all()
    landmarks, _ = walking()
    person, _ = cam.project(camera(), landmarks[:, [MLKIT_33.index(name) for name in COCO_17]])
    out = inputs.adapted(person, 1280, "canonical")
    tall = np.median(out[:, [15, 16], 1].mean(axis=1) - out[:, 0, 1])
    assert tall == pytest.approx(106) and out.mean(axis=(0, 1)) == pytest.approx([165, 101])
    # the same for a camera with another lens, at another place in the picture
    assert np.abs(inputs.adapted(3 * person + 17, 1280, "canonical") - out).max() < 1e-9
    with pytest.raises(DiorError, match="upside down"):
        inputs.adapted(-person, 1280, "canonical")
    with pytest.raises(DiorError, match="no adaptation 'scale'.*scaled"):
        inputs.adapted(uv, 1280, "scale")
