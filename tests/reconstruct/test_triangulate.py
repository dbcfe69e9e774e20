from dataclasses import replace
from unittest.mock import patch

import numpy as np
import pytest

from benchmarks import scene
from benchmarks.two_walkers import write_timeline
from dior.body.names import MLKIT_33
from dior.errors import DiorError
from dior.geometry import camera as cam
from dior.geometry import camera_tables, covariance
from dior.reconstruct import triangulate as tri
from dior.reconstruct.timeline import nearest_frames
from dior.reconstruct.triangulate import Limits
from dior.tables import tables
from tests.reconstruct.test_swaps import observed, walker
from tests.rig import ring


def write_inputs(folder, cameras, uv, score=0.9):
    """Detections and a timeline in which instants are frames."""
    views, count, each = uv.shape[:3]
    names = [c.name for c in cameras]
    stamps = 10**18 + np.arange(count) * 33_333_333
    camera_tables.write_cameras(folder / "cameras.parquet", cameras)
    tables.write(
        folder / "detections.parquet",
        "detections",
        {
            "camera": np.repeat(names, count * each).astype(object),
            "frame": np.tile(np.repeat(np.arange(count), each), views),
            "stamp_ns": np.tile(np.repeat(stamps, each), views),
            "person": np.zeros(views * count * each, int),
            "joint": np.tile(np.array(MLKIT_33, object), views * count),
            "u": uv[..., 0].ravel(),
            "v": uv[..., 1].ravel(),
            "score": np.where(np.isfinite(uv[..., 0]), score, np.nan).ravel(),
        },
    )
    write_timeline(folder / "timeline.parquet", names, stamps)


def run(folder, names, method="robust", out_detections=None, **told):
    tri.run(
        sequence="walk_1",
        subject="S01",
        cameras=[folder / "cameras.parquet"],
        names=names,
        detections=folder / "detections.parquet",
        timeline=folder / "timeline.parquet",
        method=method,
        limits=Limits(0.3, 45.0, 12.0, 8.0, 0.4),
        out=folder / "skeleton.parquet",
        out_swaps=folder / "swaps.parquet",
        findings=folder / "findings.parquet",
        told=tri.Told(**told),
        out_detections=out_detections,
    )
    return tables.read(folder / "skeleton.parquet", "skeletons_3d")


def write_people(folder, cameras, *people):
    """Table `detected_people` of `people`, each (track, uv (V, T, J, 2)), in every camera; NaN: nobody."""
    parts = []
    for view, camera in enumerate(cameras):
        for frame in range(people[0][1].shape[1] if people else 0):
            for track, uv in people:
                if np.isfinite(uv[view, frame]).any():
                    parts.append((camera.name, frame, track, uv[view, frame]))
    each = len(MLKIT_33)
    tables.write(
        folder / "people.parquet",
        "detected_people",
        {
            "camera": np.repeat([part[0] for part in parts], each).astype(object),
            **{key: np.repeat([part[i] for part in parts], each).astype(int) for key, i in COLUMNS.items()},
            "joint": np.tile(np.array(MLKIT_33, object), len(parts)),
            "u": np.array([part[3][:, 0] for part in parts]).ravel(),
            "v": np.array([part[3][:, 1] for part in parts]).ravel(),
            "score": np.full(len(parts) * each, 0.9),
        },
    )
    return folder / "people.parquet"


COLUMNS = {"frame": 1, "person": 2, "track": 2}


def test_where_there_is_one_person_the_bytes_are_those_of_one_person(tmp_path):
    cameras, points = ring(3), walker(60)
    names = [camera.name for camera in cameras]
    uv = observed(cameras, points, 2.0)
    uv[1, 20:30] = np.nan
    write_inputs(tmp_path, cameras, uv)
    with patch.object(tri.which_person, "choose", lambda *_: None):
        run(tmp_path, names)
    files = [tmp_path / f"{name}.parquet" for name in ("skeleton", "swaps", "findings")]
    before = [file.read_bytes() for file in files]
    run(tmp_path, names, everybody_seen=write_people(tmp_path, cameras))
    assert [file.read_bytes() for file in files] == before


def two(folder, **more):
    """A walker and, 1.2 m beside, somebody of the same build; the one camera's choice is the other's."""
    cameras, points = ring(3), walker(60)
    mine, other = observed(cameras, points, 0.5), observed(cameras, points + (0.0, 1.2, 0.0), 0.5)
    write_inputs(folder, cameras, np.concatenate([mine[:2], other[2:]]))
    everybody = write_people(folder, cameras, (0, mine), (1, other))
    table = run(folder, [c.name for c in cameras], everybody_seen=everybody, **more)
    said = dict(zip(*(tables.read(folder / "findings.parquet", "findings")[c] for c in ("code", "text")), strict=True))
    return cameras, points, mine, table, said


def test_what_cannot_be_told_is_suspect_and_asks_for_a_seed(tmp_path):
    _, _, _, table, said = two(tmp_path, out_detections=tmp_path / "chosen.parquet")
    assert set(table["status"]) == {"suspect"} and np.isnan(table["x"]).all()
    assert np.isnan(tables.read(tmp_path / "chosen.parquet", "detections")["u"]).all()
    assert "frames 0 to 59" in said["who_is_subject"] and "config/people/walk_1.yaml" in said["who_is_subject"]
    assert "height_m" in said["who_is_subject"]


def test_a_seed_labels_whom_it_points_at(tmp_path):
    seeds = tmp_path / "seeds.yaml"
    cameras, points, mine, *_ = two(tmp_path)
    u, v = np.nanmean(mine[2, 30], axis=0)
    seeds.write_text(f"seeds: [{{camera: {cameras[2].name}, frame: 30, u: {u:.1f}, v: {v:.1f}}}]")
    chosen = tmp_path / "chosen.parquet"
    _, _, _, table, said = two(tmp_path, seeds=seeds, out_detections=chosen)
    written = tables.read(chosen, "detections")
    uv = np.stack([written["u"], written["v"]], axis=-1).reshape(mine.shape)
    assert np.nanmax(np.abs(uv - mine)) < 1e-3 and (written["person"] == 0).all()
    xyz, _ = tables.grid(table, "x", "y", "z")
    assert (table["status"] == "ok").mean() > 0.98 and "who_is_subject" not in said
    assert np.nanmax(np.linalg.norm(xyz - points, axis=-1)) < 0.1


@pytest.mark.parametrize(
    ("seed", "words"),
    [
        ("{camera: cam9, frame: 30, u: 1, v: 1}", "'cam9' is not one of the close cameras"),
        ("{camera: CAM, frame: 60, u: 1, v: 1}", "has no frame 60 at any instant, but 0 to 59"),
        ("{camera: CAM, frame: 30, u: -4000, v: 1}", r"nobody was detected near \(-4000, 1\) in frame 30"),
        ("{camera: CAM, frame: 30, u: 1}", "v"),
    ],
)
def test_a_seed_that_is_wrong_is_refused(tmp_path, seed, words):
    seeds = tmp_path / "seeds.yaml"
    seeds.write_text(f"seeds: [{seed.replace('CAM', ring(3)[0].name)}]")
    with pytest.raises(DiorError, match=words):
        two(tmp_path, seeds=seeds)


@pytest.mark.parametrize("method", tri.METHODS)
def test_the_step_gives_every_row_and_a_reason_for_every_null(tmp_path, method):
    cameras, points = ring(3), walker(12)
    uv = observed(cameras, points, 0.0)
    uv[1:, 4, 8] = np.nan
    uv[0, 5, 9] = np.nan
    write_inputs(tmp_path, cameras, uv)
    table = run(tmp_path, [c.name for c in cameras], method)
    xyz, joints = tables.grid(table, "x", "y", "z")
    status = table["status"].reshape(12, 33)
    assert tuple(joints) == MLKIT_33
    assert status[4, 8] == "too_few_views" and np.isnan(xyz[4, 8]).all()
    status[4, 8] = "ok"
    xyz[4, 8] = points[4, 8]
    assert (status == "ok").all()
    assert xyz == pytest.approx(points, abs=1e-4)
    assert table["n_views"].reshape(12, 33)[5, 9] == 2


def test_exchanged_frames_are_undone_and_reported(tmp_path):
    from dior.reconstruct.swaps import exchange

    cameras, points = ring(3), walker(40)
    true = np.zeros((3, 40), bool)
    true[2, 10:30] = True
    write_inputs(tmp_path, cameras, exchange(observed(cameras, points, 1.0), true, MLKIT_33))
    xyz, _ = tables.grid(run(tmp_path, [c.name for c in cameras]), "x", "y", "z")
    assert np.linalg.norm(xyz - points, axis=-1).mean() < 0.02
    swaps = tables.read(tmp_path / "swaps.parquet", "swaps")
    assert (swaps["swapped"].reshape(3, 40) == true).all()
    assert (swaps["frame"].reshape(3, 40) == np.arange(40)).all()
    findings = tables.read(tmp_path / "findings.parquet", "findings")
    assert findings["text"].tolist() == ["left and right exchanged at 20 of 40 instants"]
    assert findings["scope"].tolist() == ["walk_1/cam03"]


def test_a_low_score_is_no_detection(tmp_path):
    cameras = ring(3)
    write_inputs(tmp_path, cameras, observed(cameras, walker(3), 0.0), score=0.2)
    assert (run(tmp_path, [c.name for c in cameras])["status"] == "too_few_views").all()


def test_a_camera_without_pose_or_detections_is_named(tmp_path):
    cameras = ring(3)
    write_inputs(tmp_path, cameras, observed(cameras, walker(3), 0.0))
    with pytest.raises(DiorError, match="walk_1, camera cam09: .*no pose"):
        run(tmp_path, ["cam01", "cam09"])
    camera_tables.write_cameras(tmp_path / "cameras.parquet", [*cameras, cameras[0].at(cameras[0].wTc).__class__(
        "cam04", cameras[0].intrinsics, cameras[0].wTc)])  # fmt: skip
    with pytest.raises(DiorError, match="camera cam04: no detections"):
        run(tmp_path, ["cam01", "cam04"])
    with pytest.raises(DiorError, match="triangulate.method"):
        run(tmp_path, ["cam01", "cam02"], method="magic")


def test_points_behind_a_camera_are_not_in_front():
    cameras = ring(2)
    behind = cameras[0].centre + (cameras[0].centre - cameras[1].centre) * 0.2
    used = np.ones((2, 1), bool)
    assert not tri.in_front(cameras, behind[None], used).any()
    assert tri.in_front(cameras, np.array([[0.0, 0, 1]]), used).all()
    assert cam.project(cameras[0], behind)[1] < 0


def test_rays_that_meet_behind_a_camera_are_rejected(tmp_path):
    cameras, points = ring(3), walker(6)
    behind = 1.3 * cameras[0].centre
    points[2, 5] = behind
    in_camera = cam.inverse_pose(cameras[0].wTc) @ [*behind, 1.0]
    uv = observed(cameras, points, 0.0)
    uv[0, 2, 5] = cameras[0].intrinsics.fx * in_camera[:2] / in_camera[2] + [
        cameras[0].intrinsics.cx, cameras[0].intrinsics.cy
    ]  # fmt: skip
    write_inputs(tmp_path, cameras, uv)
    status = run(tmp_path, [c.name for c in cameras], "rays")["status"].reshape(6, 33)
    assert status[2, 5] == "rejected" and (status == "rejected").sum() == 1


def test_a_score_goes_with_its_detection_to_the_other_side(tmp_path):
    """In cam03 sides are exchanged, and what it calls the left ankle, the right one, is not seen."""
    from dior.reconstruct.swaps import exchange

    cameras, points = ring(3), walker(20)
    uv = exchange(
        observed(cameras, points, 0.5), np.array([[False], [False], [True]]) & np.ones((3, 20), bool), MLKIT_33
    )
    left, right = (MLKIT_33.index(f"{side}_ankle") for side in ("left", "right"))
    uv[2, :, left] = np.nan
    write_inputs(tmp_path, cameras, uv)
    views = run(tmp_path, [c.name for c in cameras])["n_views"].reshape(20, 33)
    assert (views[:, right] == 2).all() and (views[:, left] == 3).all()


def test_the_uncertainty_is_that_of_the_detectors_noise_and_says_what_of_it_lasts(tmp_path):
    walk = scene.make("real", 1, 90, swapped=0.0, wrong_together=0.0, missed=0.0)
    cameras = [
        covariance.moved(c, s)
        for c, s in zip(walk.cameras, 0.003 * np.random.default_rng(0).normal(size=(3, 6)), strict=True)
    ]
    write_inputs(tmp_path, cameras, walk.uv)
    table = run(tmp_path, [c.name for c in cameras])
    ok = table["status"].reshape(90, 33) == "ok"
    seen = np.full(walk.score.shape, 0.9)
    noise = tri.detector_noise.estimated(cameras, walk.uv, seen, scene.FPS, MLKIT_33)
    found = tri.robust.triangulate(cameras, walk.uv, seen, scene.FPS, noise.sigma)
    weights = np.where(found.used, seen, 0.0) / noise.sigma
    sigma = np.sqrt(tri.robust.covariance(cameras, found.points, weights, noise.own)[..., 0, 0])
    assert noise.own.min() < 0.9 and noise.hidden.any() and ok.mean() > 0.9
    assert table["sigma_x"].reshape(90, 33)[ok] == pytest.approx(sigma[ok], rel=1e-3)
    stays = tri.robust.error_correlation(cameras, walk.uv, seen, found, scene.FPS, noise)[1]
    assert table["constant_share"].reshape(90, 33)[ok] == pytest.approx(stays[ok], abs=1e-3)
    assert np.ptp(stays[ok]) > 0.01


@pytest.mark.parametrize(("limit_px", "status"), [(55.0, "rejected"), (75.0, "ok")])
def test_the_limit_of_the_error_is_that_of_a_camera_of_fx_1680(tmp_path, monkeypatch, limit_px, status):
    """Of two cameras of fx 640 one is 50 px off: 25 px each, which are 65.6 px at fx 1680."""
    cameras, points = ring(2, distortion=()), walker(12)
    cameras[1] = ring(4, distortion=())[1]
    uv = observed(cameras, points, 0.0)
    uv[0, 6, 0] += [0, 25]
    uv[1, 6, 0] -= [0, 25]
    write_inputs(tmp_path, cameras, uv)
    noise = tri.detector_noise.estimated(cameras, uv, np.ones(uv.shape[:3]), 30.0)
    known = replace(noise, sigma=np.full(uv.shape[:3], 2.0))
    monkeypatch.setattr(tri.detector_noise, "estimated", lambda *_: known)
    limits = Limits(0.3, limit_px, 1e9, 1e9, 1e9)
    tri.run(
        sequence="walk_1", subject="S01", cameras=[tmp_path / "cameras.parquet"], names=[c.name for c in cameras],
        detections=tmp_path / "detections.parquet", timeline=tmp_path / "timeline.parquet", method="robust",
        limits=limits, out=tmp_path / "s.parquet", out_swaps=tmp_path / "w.parquet", findings=tmp_path / "f.parquet",
            told=tri.Told(),
    )  # fmt: skip
    table = tables.read(tmp_path / "s.parquet", "skeletons_3d")
    assert table["residual_px"].reshape(12, 33)[6, 0] == pytest.approx(25.0, abs=1.0)
    assert table["status"].reshape(12, 33)[6, 0] == status


def test_a_swap_is_of_the_picture_that_is_nearest():
    line = {
        "camera": np.array(["cam01"] * 4, object), "frame_before": np.array([0, 1, 2, -1]),
        "frame_after": np.array([1, 2, 3, -1]), "weight": np.array([0.4, 0.6, 0.0, 0.0]),
    }  # fmt: skip
    assert nearest_frames(line, ["cam01"]).tolist() == [[0, 2, 2, -1]]


def test_the_camera_that_does_not_belong_to_the_others_is_said_first(tmp_path):
    cameras, points = ring(), walker(60)
    uv = observed(cameras, points, 1.0)
    placed = [cameras[0], covariance.moved(cameras[1], np.r_[0, np.radians(3.0), 0, 0, 0, 0]), cameras[2]]
    for given, first in ((cameras, ""), (placed, "culprit_camera")):
        write_inputs(tmp_path, given, uv)
        run(tmp_path, [c.name for c in given])
        found = tables.read(tmp_path / "findings.parquet", "findings")
        assert [code for code in found["code"] if code.startswith("culprit")] == ([first] if first else [])
    assert (found["scope"][0], found["code"][0]) == ("walk_1/cam02", "culprit_camera")


def test_detections_are_crossed_with_the_pictures_of_every_camera():
    """The second camera lost its first two pictures."""
    line = {
        "camera": np.repeat(["cam01", "cam02"], 4).astype(object),
        "frame_before": np.array([0, 1, 2, 3, -1, -1, 0, 1]),
        "frame_after": np.array([0, 1, 2, 3, -1, -1, 0, 1]),
        "weight": np.zeros(8),
    }
    detected = {
        "camera": np.repeat(["cam01", "cam02"], [4, 2]).astype(object),
        "frame": np.array([0, 1, 2, 3, 0, 1]),
        "joint": np.full(6, "nose", object),
        "u": np.array([10.0, 11, 12, 13, 20, 21]),
        "v": np.zeros(6),
        "score": np.array([0.9, 0.9, 0.9, 0.1, 0.9, 0.9]),
    }
    found, joints = tri.crossed(detected, line, ["cam01", "cam02"], 0.3)
    n = np.nan
    expected = [[[10, 11, 12, n], [n, n, 10, 11]], [[20, 21, n, n], [n, n, 20, 21]]]
    assert joints == ["nose"] and np.array_equal(found[..., 0, 0], expected, equal_nan=True)
