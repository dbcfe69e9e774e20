"""Figures with answers known beforehand: labels that equal the detections, boxes with a known share, exact pooling."""

import numpy as np
import pytest

from dior.errors import DiorError
from dior.evaluate import checks, evaluate, grids, metrics, reprojection, truth
from dior.geometry import camera_tables
from dior.geometry.multiview import rotation_x, rotation_z
from dior.project import boxes
from dior.tables import tables
from tests.rig import camera

JOINTS = ("nose", "left_hip", "right_hip")
START_NS = 1_700_000_000_000_000_000


def columns(uv, frames, **more):
    """Columns of a complete table of `uv` (F, J, 2)."""
    count, each = uv.shape[:2]
    return {
        "camera": np.full(count * each, "cam01", dtype=object),
        "joint": np.tile(np.array(JOINTS[:each], dtype=object), count),
        "frame": np.repeat(frames, each),
        "stamp_ns": START_NS + np.repeat(frames, each) * 33_333_333,
        "u": uv[..., 0].ravel(),
        "v": uv[..., 1].ravel(),
    } | {key: np.ravel(value) for key, value in more.items()}


def write_labels(path, uv, status=None, frames=None, **more):
    status = np.full(uv.shape[:2], "ok", dtype=object) if status is None else status
    frames = np.arange(len(uv)) if frames is None else frames
    tables.write(path, "labels_2d", columns(uv, frames, status=status, **more))
    return path


def label_grid(path, uv, **options):
    return grids.label_grids([write_labels(path, uv, **options)])["cam01"]


def detections(uv, score, frames=None):
    frames = np.arange(len(uv)) if frames is None else frames
    return columns(uv, frames, score=np.broadcast_to(score, uv.shape[:2]))


@pytest.fixture
def uv():
    """Pixels (5, 3, 2) that float32 holds exactly."""
    return np.arange(30, dtype=float).reshape(5, 3, 2) * 4 + 100


def read_metrics(path):
    table = tables.read(path, "metrics")
    keys = zip(table["metric"], table["camera"], table["joint"], strict=True)
    return dict(zip(keys, zip(table["value"], table["n"], strict=True), strict=True))


def run(tmp_path, labels, **given):
    """`given`: fields of Detected and Yardsticks, or skeleton and roles."""
    inputs = {"skeleton": None, "roles": {"cam01": "close"}, "detections": None, "min_score": 0.3, "swaps": None}
    inputs |= {"boxes": {}, "left_out": [], "marks": [], "checks": {}, "truth": None} | given
    poses = [tmp_path / "cameras.parquet"]
    camera_tables.write_cameras(*poses, [camera(name, (60, 0, 2), (0, 0, 1)) for name in inputs["boxes"]])
    evaluate.run(
        sequence="walk", subject="S1", labels=[labels], skeleton=inputs["skeleton"], cameras=poses,
        roles=inputs["roles"],
        detected=evaluate.Detected(inputs["detections"], inputs["min_score"], inputs["swaps"], []),
        yardsticks=evaluate.Yardsticks(*(inputs[key] for key in ("boxes", "left_out", "marks", "checks", "truth"))),
        out=tmp_path / "walk.parquet", out_frames=tmp_path / "walk.frames.parquet",
        out_checks=tmp_path / "walk.checks.parquet", out_quantiles=tmp_path / "walk.quantiles.parquet",
        findings=tmp_path / "walk.findings.parquet",
    )  # fmt: skip
    return read_metrics(tmp_path / "walk.parquet")


def test_labels_equal_to_the_detections_have_no_error(tmp_path, uv):
    grid = label_grid(tmp_path / "l.parquet", uv)
    assert (reprojection.errors(grid, detections(uv, 0.9), 0.3) == 0).all()


def test_a_shift_of_3_and_4_is_an_error_of_5(tmp_path, uv):
    grid = label_grid(tmp_path / "l.parquet", uv)
    np.testing.assert_allclose(reprojection.errors(grid, detections(uv + (3, 4), 0.9), 0.3), 5)


def test_unsure_detections_and_other_frames_do_not_count(tmp_path, uv):
    grid = label_grid(tmp_path / "l.parquet", uv)
    score = np.full((5, 3), 0.9)
    score[0, 1] = 0.2
    score[1, 1] = np.nan
    error = reprojection.errors(grid, detections(uv, score, frames=np.array([0, 1, 2, 4, 9])), 0.3)
    assert np.isnan(error[0, 1]) and np.isnan(error[1, 1])
    assert np.isnan(error[3]).all(), "frame 3 has no detections"
    assert np.isfinite(error[4]).all() and np.isfinite(error).sum() == 10


def test_joints_are_matched_by_name(tmp_path, uv):
    table = detections(uv[:, ::-1], 0.9)
    table["joint"] = np.tile(np.array(JOINTS[::-1], dtype=object), 5)
    grid = label_grid(tmp_path / "l.parquet", uv)
    assert (reprojection.errors(grid, table, 0.3) == 0).all()


def test_exchanged_detections_are_compared_the_right_way_round(tmp_path, uv):
    wrong = uv.copy()
    wrong[2:4] = wrong[2:4][:, [0, 2, 1]]
    table = detections(wrong, 0.9)
    labels = write_labels(tmp_path / "l.parquet", uv)
    assert (reprojection.errors(label_grid(tmp_path / "l.parquet", uv), table, 0.3)[2:4, 1:] > 0).all()
    path = tmp_path / "swaps.parquet"
    swapped = {"frame": np.array([0, 2, 3, -1]), "swapped": np.array([False, True, True, True])}
    names = {"camera": np.full(4, "cam01", dtype=object), "instant": np.arange(4), "stamp_ns": np.arange(4)}
    tables.write(path, "swaps", names | swapped)
    tables.write(tmp_path / "d.parquet", "detections", table | {"person": np.zeros(15, int)})
    found = run(tmp_path, labels, swaps=path, detections=tmp_path / "d.parquet")
    assert found["reprojection_error", "cam01", ""] == (0.0, 15)


def test_markers_are_not_compared_with_keypoints(tmp_path, uv):
    table = detections(uv, 0.9)
    grid = label_grid(tmp_path / "l.parquet", uv)
    assert reprojection.comparable(grid, table)
    table["joint"] = np.tile(np.array(["LASI", "RASI", "C7"], dtype=object), 5)
    assert not reprojection.comparable(grid, table)


def test_run_gives_means_with_counts_by_camera_joint_and_picture(tmp_path, uv):
    moved = uv.copy()
    moved[:, 0] += (3, 4)
    moved[0, 1] += (0, 10)
    path = tmp_path / "d.parquet"
    tables.write(path, "detections", detections(moved, 0.9))
    status = np.full((5, 3), "ok", dtype=object)
    status[4] = "missing_3d"
    labels = write_labels(tmp_path / "l.parquet", np.where((status == "ok")[..., None], uv, np.nan), status)
    found = run(tmp_path, labels, detections=path)
    assert found["reprojection_error", "cam01", ""] == (pytest.approx(30 / 12), 12)
    assert found["reprojection_error", "cam01", "nose"] == (pytest.approx(5), 4)
    assert found["reprojection_error", "cam01", "left_hip"] == (pytest.approx(2.5), 4)
    assert found["coverage", "cam01", ""] == (pytest.approx(0.8), 15)
    frames = tables.read(tmp_path / "walk.frames.parquet", "frame_metrics")
    error = frames["metric"] == "reprojection_error"
    np.testing.assert_allclose(frames["value"][error], [5, 5 / 3, 5 / 3, 5 / 3])
    assert frames["frame"][error].tolist() == [0, 1, 2, 3] and set(frames["sequence"]) == {"walk"}


def test_long_range_labels_are_not_compared_with_detections(tmp_path, uv):
    path = tmp_path / "d.parquet"
    tables.write(path, "detections", detections(uv, 0.9))
    labels = write_labels(tmp_path / "l.parquet", uv)
    found = run(tmp_path, labels, detections=path, roles={"cam01": "long_range"})
    assert ("reprojection_error", "cam01", "") not in found


BOXES = "frame,u_min,v_min,u_max,v_max\n"


def test_share_in_boxes_counts_in_frame_labels_of_boxed_frames(tmp_path):
    uv = np.array([[[10, 10], [20, 20], [30, 30]], [[10, 10], [20, 20], [30, 30]], [[0, 0]] * 3], float)
    status = np.full((3, 3), "ok", dtype=object)
    status[0, 2], status[1, 1] = "out_of_frame", "occluded"
    path = tmp_path / "b.csv"
    path.write_text(BOXES + "1,20,20,30,30\n0,10,10,11,11\n")  # edges belong to the box; frame 2 has none
    labels = write_labels(tmp_path / "l.parquet", uv, status)
    found = run(tmp_path, labels, boxes={"cam01": path}, roles={"cam01": "long_range"})
    assert found["in_box_share", "cam01", ""] == (pytest.approx(3 / 5), 5)


def test_other_drawers_and_fits_without_a_box_have_figures_of_their_own(tmp_path):
    uv = np.tile(np.array([[10, 10], [20, 30], [14, 20]], float), (6, 1, 1))
    path = tmp_path / "b.csv"
    own = "".join(f"{frame},10,10,20,30,zoe\n" for frame in range(4))
    # max draws everything 2 px further left, kim 4 px further down: labels lie 2 px right, or 4 px above
    others = "".join(f"{frame},8,10,18,30,max\n" for frame in range(2)) + "".join(
        f"{frame},10,14,20,34,kim\n" for frame in range(2)
    )
    path.write_text(BOXES.strip() + ",drawer\n" + own + others)
    without = {"sequence": ["walk", "walk", "other"], "camera": ["cam01"] * 3, "frame": [0, 1, 2]}
    tables.write(tmp_path / "w.parquet", "left_out_boxes", without | {"shift_u": [1.0, 3.0, 9.0], "shift_v": [0.0] * 3})
    found = run(
        tmp_path, write_labels(tmp_path / "l.parquet", uv), boxes={"cam01": path}, roles={"cam01": "long_range"},
        left_out=[tmp_path / "w.parquet"],
    )  # fmt: skip
    assert found["in_box_share", "cam01", ""] == (1.0, 12)
    assert found["left_out_offset_u", "cam01", ""] == (pytest.approx(2 / 20), 2)
    assert found["left_out_share", "cam01", ""] == (pytest.approx(2 / 3), 6)
    assert found["other_drawer_offset_u", "cam01", ""] == (pytest.approx(1 / 20), 4)
    assert found["other_drawer_offset_v", "cam01", ""] == (pytest.approx(-2 / 20), 4)
    assert found["other_drawer_share", "cam01", ""] == (pytest.approx(2 / 3), 12)
    frames = tables.read(tmp_path / "walk.frames.parquet", "frame_metrics")
    assert "left_out_share" in frames["metric"] and "other_drawer_share" not in frames["metric"]


@pytest.mark.parametrize(
    "text, words",
    [
        ("", "is empty"),
        ("frame,u_min,v_min,u_max,v_mx\n", "v_max"),
        (BOXES + "1,2,3,4\n", "line 2: has 4 values"),
        (BOXES + "1,1,1,2,2\n0,a,3,4,5\n", "line 3: '0,a,3,4,5'"),
        (BOXES + "1.5,1,3,4,5\n", "line 2"),
        (BOXES + "1,1,nan,4,5\n", "line 2"),
        (BOXES + "\n1,9,3,4,5\n", "line 3: the box is inside out"),
        (BOXES + "1,1,9,4,5\n", "line 2: the box is inside out"),
        (BOXES + "1,1,3,4,5\n5,1,3,4,5\n", "line 3: frame 5 is not in the recording, whose frames are 0 to 4"),
        (BOXES + "-1,1,3,4,5\n", "line 2: frame -1"),
        (BOXES + "1,1,3,4,5\n1,1,3,4,5\n", "line 3: frame 1 has a second box"),
    ],
)
def test_bad_boxes_are_refused_with_file_and_line(tmp_path, text, words):
    path = tmp_path / "walk.cam01.csv"
    path.write_text(text)
    with pytest.raises(DiorError) as caught:
        boxes.read(path, np.arange(5))
    assert words in str(caught.value) and "walk.cam01.csv" in str(caught.value)


def test_boxes_of_an_unknown_camera_are_refused(tmp_path, uv):
    labels = write_labels(tmp_path / "l.parquet", uv)
    with pytest.raises(DiorError, match="cam1.*did you mean 'cam01'"):
        run(tmp_path, labels, boxes={"cam1": tmp_path / "b.csv"})


def test_rigid_alignment_removes_a_motion_but_not_a_scale():
    rng = np.random.default_rng(0)
    true = rng.normal(size=(20, 3, 3))
    moved = true @ (rotation_z(0.4) @ rotation_x(0.2)).T + (1, 2, 3)
    moved[3, 1] = np.nan
    plain, aligned = truth.errors_3d(moved, true)
    assert np.nanmin(plain) > 0.5 and np.isnan(aligned[3, 1])
    np.testing.assert_allclose(aligned[np.isfinite(aligned)], 0, atol=1e-12)
    centred = true - true.mean(axis=(0, 1))
    _, aligned = truth.errors_3d(1.1 * centred + (5.0, -3.0, 1.0), centred)
    np.testing.assert_allclose(aligned, 0.1 * np.linalg.norm(centred, axis=-1), atol=1e-9)


def write_skeleton(path, points, start=0, shift_ns=0):
    count, each = points.shape[:2]
    table = {
        "joint": np.tile(np.array(JOINTS, dtype=object), count),
        "instant": np.repeat(np.arange(start, start + count), each),
        "stamp_ns": START_NS + shift_ns + np.repeat(np.arange(start, start + count), each) * 10_000_000,
        "status": np.full(count * each, "ok", dtype=object),
    } | {axis: points[..., i].ravel() for i, axis in enumerate("xyz")}
    tables.write(path, "skeletons_3d", table)
    return path


def test_errors_to_the_truth(tmp_path, uv):
    folder = tmp_path / "truth"
    points = np.arange(45, dtype=float).reshape(5, 3, 3) ** 2 / 100
    status = np.full((5, 3), "ok", dtype=object)
    status[0, 0] = "out_of_frame"
    write_labels(folder / "labels_2d.parquet", uv)
    write_skeleton(folder / "skeletons_3d.parquet", points)
    skeleton = write_skeleton(tmp_path / "s.parquet", points[2:] + (0, 0.03, 0.04), start=2)
    found = run(tmp_path, write_labels(tmp_path / "l.parquet", uv + (3, 4), status), skeleton=skeleton, truth=folder)
    assert found["error_to_truth_2d", "cam01", ""] == (pytest.approx(5), 14)
    assert found["error_to_truth_3d", "", ""] == (pytest.approx(0.05, abs=1e-6), 9)
    assert found["error_to_truth_3d_aligned", "", ""] == (pytest.approx(0, abs=1e-6), 9)


def test_other_instants_than_the_truths_are_refused(tmp_path, uv):
    folder = tmp_path / "truth"
    points = np.ones((5, 3, 3))
    write_labels(folder / "labels_2d.parquet", uv)
    write_skeleton(folder / "skeletons_3d.parquet", points)
    skeleton = write_skeleton(tmp_path / "s.parquet", points, shift_ns=3_000_000_000)
    with pytest.raises(DiorError, match="walk.*3.000 s"):
        run(tmp_path, write_labels(tmp_path / "l.parquet", uv), skeleton=skeleton, truth=folder)


def test_marks_of_this_sequence_and_hand_checks(tmp_path, uv):
    marks = tmp_path / "cam01.marks.parquet"
    tables.write(
        marks,
        "marks",
        {
            "camera": np.full(3, "cam01", dtype=object),
            "sequence": np.array(["walk", "walk", "other"], dtype=object),
            "frame": np.arange(3),
            "joint": np.full(3, "nose", dtype=object),
            "residual_px": np.array([1.0, 2.0, 50.0]),
            "inlier": np.array([True, False, True]),
        },
    )
    path = tmp_path / "walk.cam01.csv"
    u, v = uv[2, 1]
    path.write_text(f"sequence,frame,joint,u,v\nwalk,2,left_hip,{u + 6},{v - 8}\nwalk,0,nose,100,104\n")
    found = run(tmp_path, write_labels(tmp_path / "l.parquet", uv), marks=[marks], checks={"cam01": path})
    assert found["mark_error", "cam01", ""] == (pytest.approx(1.5), 2)
    assert found["check_error", "cam01", ""] == (pytest.approx(5), 2)


@pytest.mark.parametrize(
    "row, words",
    [
        ("walk,9,nose,1,2", "frame 9 is not in the recording"),
        ("walk,1,left_hp,1,2", "did you mean 'left_hip'"),
        ("walk,1,nose,x,2", "line 2"),
        ("other,1,nose,1,2", "'other', not 'walk'"),
        ("walk,1", "line 2"),
        ("walk,1,nose,64,2", "line 2: (64, 2) is outside of the 64x48 picture"),
        ("walk,1,nose,x,2\nwalk,1,nose,1,2\nwalk,1,nose,1,3", "line 4: nose of frame 1 is there already"),
    ],
)
def test_bad_checks_are_refused(tmp_path, uv, row, words):
    path = tmp_path / "walk.cam01.csv"
    path.write_text(f"sequence,frame,joint,u,v\n{row}\n")
    with pytest.raises(DiorError) as caught:
        checks.check_points(path, "walk", label_grid(tmp_path / "l.parquet", uv), (64, 48))
    assert words in str(caught.value)


def test_share_of_swapped_instants(tmp_path, uv):
    path = tmp_path / "swaps.parquet"
    swapped = np.array([True, False, False, False])
    table = {"camera": np.full(4, "cam01", dtype=object), "instant": np.arange(4), "stamp_ns": np.arange(4)}
    tables.write(path, "swaps", table | {"swapped": swapped})
    found = run(tmp_path, write_labels(tmp_path / "l.parquet", uv), swaps=path)
    assert found["swapped_share", "cam01", ""] == (0.25, 4)


def row(metric="reprojection_error", value=1.0, n=1, **key):
    return {
        **dict.fromkeys(metrics.COLUMNS, ""), "metric": metric, "value": value, "n": n, "low": np.nan, "high": np.nan,
        "unit": "px", "subject": "S1", "sequence": "a", "camera": "cam01", "role": "close", **key,
    }  # fmt: skip


def by_key(rows):
    return {(r["subject"], r["sequence"], r["camera"], r["role"], r["joint"]): r for r in rows}


def test_pooled_means_are_means_over_all_values():
    values = [np.array([1.0, 2, 6]), np.array([10.0]), np.array([4.0, 5])]
    keys = [{}, {"camera": "cam02"}, {"subject": "S2", "sequence": "b"}]
    rows = [row(value=v.mean(), n=v.size, **key) for v, key in zip(values, keys, strict=True)]
    found = by_key(metrics.merged(rows))
    assert found["", "", "", "", ""]["value"] == pytest.approx(np.concatenate(values).mean(), rel=1e-15)
    assert found["", "", "", "", ""]["n"] == 6
    assert found["S1", "", "", "close", ""]["value"] == pytest.approx(19 / 4, rel=1e-15)
    assert found["S2", "", "", "", ""]["value"] == 4.5
    assert found["S1", "a", "", "close", ""]["n"] == 4
    assert found["S1", "a", "cam02", "close", ""]["value"] == 10


def test_joints_are_not_counted_twice_and_roles_stay_apart():
    rows = [row(value=2.0, n=2), row(value=1.0, n=1, joint="nose"), row(value=3.0, n=1, joint="left_hip")]
    rows += [row(value=8.0, n=2, camera="cam04", role="long_range")]
    found = by_key(metrics.merged(rows))
    assert (found["", "", "", "", ""]["value"], found["", "", "", "", ""]["n"]) == (5.0, 4)
    assert found["", "", "", "long_range", ""]["value"] == 8.0
    assert found["", "", "", "close", "nose"]["value"] == 1.0


def test_a_figure_given_twice_is_refused():
    with pytest.raises(DiorError, match="sequence a, camera cam01"):
        metrics.merged([row(), row()])


def test_rows_of_no_sequence_are_kept_but_not_pooled():
    rows = [row("adjust_error_before", 12.0, 10, subject="", sequence="", role=""), row()]
    found = [r for r in metrics.merged(rows) if r["metric"] == "adjust_error_before"]
    assert [(r["camera"], r["value"], r["n"]) for r in found] == [("cam01", 12.0, 10)]


def test_csv_has_fixed_numbers_and_stable_bytes(tmp_path):
    path = tmp_path / "a.parquet"
    columns = {
        k: [r[k] for r in [row(value=1 / 3, n=3), row(value=2e-7, n=1, camera="cam02")]] for k in metrics.COLUMNS
    }
    tables.write(path, "metrics", columns)
    metrics.run(inputs=[path], checks=[], out=tmp_path / "1.csv")
    metrics.run(inputs=[path], checks=[], out=tmp_path / "2.csv")
    text = (tmp_path / "1.csv").read_text()
    assert text == (tmp_path / "2.csv").read_text()
    assert text.splitlines()[0] == "metric,tool,subject,sequence,camera,role,joint,value,low,high,unit,n"
    assert "reprojection_error,,S1,a,cam01,close,,0.333333,,,px,3" in text.splitlines()
    assert "reprojection_error,,S1,a,cam02,close,,2e-07,,,px,1" in text.splitlines()
    assert metrics.read(tmp_path / "1.csv")[0]["n"] == 4


def test_the_quantiles_of_the_hand_checks_are_the_median_and_the_95th_percentile():
    checks = {"error": np.arange(101.0), "subject": ["S01"] * 101, "sequence": ["w"] * 101, "camera": ["cam01"] * 101}
    found = metrics.quantile_rows(checks | {"role": ["close"] * 101})
    whole = {
        row["metric"]: row["value"] for row in found if not row["subject"] and not row["role"] and not row["camera"]
    }
    assert whole == {"check_error_median": 50.0, "check_error_p95": 95.0}
