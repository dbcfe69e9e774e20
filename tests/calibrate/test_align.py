"""The long-range camera: the three nudges, each by what it does to the picture, and the fit to what was drawn."""

import re
from dataclasses import replace

import numpy as np
import pytest

from dior.body.names import MLKIT_33
from dior.calibrate.align import ByHand, CloseCameras, Walks, aligned_pose, fit_any_roll, run
from dior.errors import DiorError
from dior.geometry import camera_tables, covariance
from dior.geometry.camera import pose, project
from dior.geometry.multiview import rotation_z
from dior.geometry.tape import look_at_pose
from dior.project.boxes import folds, kept_back
from dior.simulate import draw
from dior.simulate.motion import motion_of
from dior.simulate.settings import from_dict, sequences
from dior.tables import tables
from tests.calibrate.outline import test_boxes_fit as boxed
from tests.cases import slow, some
from tests.rig import ring

TAPE = {"position_m": [3.0, 60.0, 1.5], "target_m": [0.0, 0.0, 1.0]}
BODY = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 1.9], [0.3, 0.0, 0.1]])


@pytest.mark.parametrize("roll_deg", some(range(0, 360, 30), 60, 180))
def test_boxes_find_every_roll(roll_deg):
    """From an upright start: near it, and where a quarter turn is nearer; the body goes on as seen."""
    points, start = boxed.body(40), boxed.start()
    level = boxed.true_camera()
    true = level.at(pose(level.wRc @ rotation_z(np.radians(roll_deg)), level.centre))
    seen = boxed.seen(points, boxed.boxes(project(true, points)[0], 2.0, 0.5))
    found, degrees = fit_any_roll(start, boxed.FREE, seen, "cam04", None, "none")
    assert np.linalg.norm(project(found.camera, points)[0] - project(true, points)[0], axis=-1).mean() < 0.5
    assert abs((degrees - roll_deg + 180) % 360 - 180) < 2
    assert found.pose_covariance.shape == (6, 6)


def pixels(nudge):
    camera = ring(1, distortion=())[0]
    return project(camera.at(aligned_pose("cam04.yaml", TAPE, nudge)), BODY)[0]


def test_without_nudges_it_is_the_look_at():
    np.testing.assert_allclose(aligned_pose("", TAPE, {}), look_at_pose("", TAPE), atol=1e-15)
    still = {"azimuth_deg": 0.0, "elevation_deg": 0.0, "distance_m": 0.0}
    np.testing.assert_allclose(aligned_pose("", TAPE, still), look_at_pose("", TAPE), atol=1e-15)


def test_positive_azimuth_moves_the_labels_right_by_f_tan():
    shift = pixels({"azimuth_deg": 0.5}) - pixels({})
    np.testing.assert_allclose(shift[0, 0], 640 * np.tan(np.radians(0.5)), rtol=1e-3)
    np.testing.assert_allclose(shift[:, 1], 0, atol=0.01)


def test_positive_elevation_moves_the_labels_down_by_f_tan():
    shift = pixels({"elevation_deg": 0.5}) - pixels({})
    np.testing.assert_allclose(shift[0], [0, 640 * 1.001 * np.tan(np.radians(0.5))], atol=1e-6)


def test_positive_distance_shrinks_the_labels():
    height = [np.ptp(pixels({"distance_m": d})[:2, 1]) for d in (0.0, 5.0, -5.0)]
    range_m = np.hypot(3, 60)
    np.testing.assert_allclose(height[1] / height[0], range_m / (range_m + 5), rtol=1e-3)
    np.testing.assert_allclose(height[2] / height[0], range_m / (range_m - 5), rtol=1e-3)


def test_the_centre_moves_horizontally_and_the_aim_stays():
    still, moved = (aligned_pose("", TAPE, {"distance_m": d}) for d in (0.0, 2.0))
    np.testing.assert_allclose(moved[:3, :3], still[:3, :3], atol=1e-15)
    shift = moved[:3, 3] - still[:3, 3]
    np.testing.assert_allclose(shift, 2 * np.array([3, 60, 0]) / np.hypot(3, 60), atol=1e-12)


def test_nudges_are_applied_together_as_in_the_design():
    from dior.geometry.multiview import look_at_angles, rotation_x, rotation_z

    azimuth, elevation = look_at_angles(TAPE["position_m"], TAPE["target_m"])
    wTc = aligned_pose("", TAPE, {"azimuth_deg": 1.0, "elevation_deg": -2.0, "distance_m": 3.0})
    expected = rotation_z(azimuth + np.radians(1)) @ rotation_x(elevation - np.radians(2))
    np.testing.assert_allclose(wTc[:3, :3], expected, atol=1e-15)


def test_impossible_moves_are_refused():
    with pytest.raises(DiorError, match="straight above"):
        aligned_pose("cam04.yaml", {"position_m": [0, 0, 10]}, {"distance_m": 1.0})
    with pytest.raises(DiorError, match="past its target"):
        aligned_pose("cam04.yaml", TAPE, {"distance_m": -70.0})


def run_in(folder, **files):
    given = {"skeletons": [], "frames": [], "offsets": [], "boxes": [], "marks": None, "close": [],
             "close_covariance": []} | files  # fmt: skip
    run(
        session="field", camera="cam04", camera_file=folder / "cam04.yaml", intrinsics=folder / "lens.parquet",
        filmed=Walks(given["skeletons"], given["frames"]),
        given=ByHand(given["offsets"], given["boxes"], given["marks"]),
        triangulated_by=CloseCameras(given["close"], given["close_covariance"]),
        out=folder / "out.parquet", out_covariance=folder / "covariance.parquet", data_root=folder,
        out_without=folder / "without.parquet", findings=folder / "findings.parquet",
    )  # fmt: skip
    return camera_tables.read_cameras(folder / "out.parquet")["cam04"]


def write_camera(folder, lines):
    lens = replace(ring(1, role="long_range")[0], name="cam04")
    camera_tables.write_cameras(folder / "lens.parquet", [lens.at(np.full((4, 4), np.nan))], "field")
    (folder / "cam04.yaml").write_text(f"role: long_range\ntopic: /cam04/image\nlocate: align\n{lines}\n")
    return lens


def test_run_writes_the_camera_as_nudged(tmp_path):
    tape = "tape: {position_m: [3, 60, 1.5], target_m: [0, 0, 1]}\n"
    write_camera(tmp_path, tape + "nudge: {azimuth_deg: 0.3, distance_m: 1.5}")
    camera = run_in(tmp_path)
    expected = aligned_pose("", TAPE, {"azimuth_deg": 0.3, "distance_m": 1.5})
    np.testing.assert_allclose(camera.wTc, expected, atol=1e-15)
    assert (camera.role, camera.locate) == ("long_range", "align")
    assert np.isnan(camera_tables.read_camera_covariance(tmp_path / "covariance.parquet", ["cam04"])).all()
    assert len(tables.read(tmp_path / "findings.parquet", "findings")["text"]) == 0


def recorded(folder, true, offset_s=0.25):
    """A walk of 12 s at 100 Hz, the camera's pictures at 30 Hz by a clock that is late, and 20 boxes of it."""
    t0, t = 10**18, np.arange(1200) / 100
    middle = np.stack([2.5 * np.sin(0.8 * t), 0.5 * np.cos(0.8 * t), 0 * t], axis=-1)
    swing = np.stack([0.35 * np.sin(6 * t), 0 * t, 0 * t], axis=-1)
    parts = {
        "nose": (0, 0, 1.65),
        "left_wrist": (0, 0.3, 0.9),
        "left_heel": (0, 0.1, 0.0),
        "right_heel": (0, -0.1, 0.0),
    }
    points = np.stack(
        [middle + (swing if "heel" in n else 0) * (1 if "left" in n else -1) + p for n, p in parts.items()]
    )
    points = np.moveaxis(points, 0, 1)
    count = len(t) * len(parts)
    columns = {axis: points[..., i].ravel() for i, axis in enumerate("xyz")}
    columns |= {"joint": list(parts) * len(t), "instant": np.repeat(np.arange(len(t)), len(parts))}
    columns |= {"stamp_ns": t0 + columns["instant"] * 10**7, "status": ["ok"] * count, "subject": ["S01"] * count}
    tables.write(folder / "walk.parquet", "skeletons_3d", columns | {"sequence": ["walk"] * count})
    seconds = np.arange(0, 11, 1 / 30)
    stamps = t0 + np.round((seconds - offset_s) * 1e9).astype(np.int64)
    rows = {
        "camera": ["cam04"] * len(stamps),
        "frame": np.arange(len(stamps)),
        "stamp_ns": stamps,
        "receive_ns": stamps,
    }
    rows |= {"bag": ["a.bag"] * len(stamps), "topic": ["/t"] * len(stamps), "nth": np.zeros(len(stamps), int)}
    rows |= {"height": np.full(len(stamps), 720), "width": np.full(len(stamps), 1280)}
    tables.write(folder / "frames" / "walk.parquet", "frames", rows)
    (folder / "walk.yaml").write_text(f"cam04: {{offset_s: {offset_s}, drift_ppm: 0}}\n")
    at = np.stack(
        [np.stack([np.interp(seconds, t, points[:, j, i]) for i in range(3)], axis=-1) for j in range(4)], axis=1
    )
    uv = project(true, at)[0]
    boxes = np.concatenate([uv.min(axis=1) - 2, uv.max(axis=1) + 2], axis=1)
    lines = [f"{f},{','.join(f'{x:.2f}' for x in boxes[f])}" for f in range(0, 330, 16)]
    (folder / "walk.cam04.csv").write_text("\n".join(["frame,u_min,v_min,u_max,v_max", *lines]) + "\n")
    clicks = [
        f"walk,{f},{j},{uv[f, k, 0]:.2f},{uv[f, k, 1]:.2f}" for f in (5, 100, 200, 300) for k, j in enumerate(parts)
    ]
    (folder / "cam04.marks.csv").write_text("\n".join(["sequence,frame,joint,u,v", *clicks]) + "\n")
    return {
        "skeletons": [folder / "walk.parquet"], "frames": [folder / "frames" / "walk.parquet"],
        "offsets": [folder / "walk.yaml"], "boxes": [folder / "walk.cam04.csv"],
        "marks": folder / "cam04.marks.csv",
    }, at, uv  # fmt: skip


def prepared(folder, source, lines="", offset_s=0.25):
    tape = "tape: {position_m: [0, 61, 1.9], sigma_m: 1.0, target_m: [0.4, 0, 0.7]}\n"
    around = ", around: joints" if source == "boxes" else ""
    lens = write_camera(folder, tape + f"align: {{from: {source}, sequences: [walk]{around}{lines}}}")
    true = lens.at(look_at_pose("", {"position_m": [0, 60, 1.9], "target_m": [-0.2, 0, 1.1]}))
    return true, *recorded(folder, true, offset_s)


@pytest.mark.parametrize("source", ["boxes", "marks"])
def test_run_places_the_camera_by_what_was_drawn(tmp_path, source):
    true, files, points, uv = prepared(tmp_path, source)
    camera = run_in(tmp_path, **files)
    assert np.abs(project(camera, points)[0] - uv).max() < 0.1
    spread = camera_tables.read_camera_covariance(tmp_path / "covariance.parquet", ["cam04"])
    error = camera.centre - true.centre
    assert np.isfinite(spread).all() and abs(error[1]) < 3 * np.sqrt(spread[4, 4])
    said = tables.read(tmp_path / "findings.parquet", "findings")
    assert list(said["code"]) == ["camera_aligned"] and ("2.0 ±" in said["text"][0]) == (source == "boxes")


@pytest.mark.parametrize("source", [slow("boxes"), "marks"])
def test_a_clock_that_nobody_gave_is_found_with_the_pose(tmp_path, source):
    true, files, points, uv = prepared(tmp_path, source)
    camera = run_in(tmp_path, **files | {"offsets": []})
    held = run_in(tmp_path, **files)
    assert np.abs(project(camera, points)[0] - uv).max() < 0.3
    assert np.linalg.norm(camera.centre - held.centre) < 0.3
    run_in(tmp_path, **files | {"offsets": []})
    text = tables.read(tmp_path / "findings.parquet", "findings")["text"][0]
    found = int(re.search(r"walk ([+-]\d+) ± \d+ ms", text).group(1))
    assert abs(found - 250) < 15


def test_a_clock_further_off_than_is_searched_is_named_and_turns_no_camera(tmp_path):
    true, files, points, uv = prepared(tmp_path, "boxes", offset_s=3.1)
    camera = run_in(tmp_path, **files | {"offsets": []})
    assert np.abs(project(camera, points)[0] - uv).max() < 0.3
    said = tables.read(tmp_path / "findings.parquet", "findings")
    assert (said["scope"][0], said["severity"][0], said["code"][0]) == ("walk/cam04", "warning", "clock_unknown")
    assert "its clock is +3.1 s off, more than the 2.0 s" in said["text"][0]
    assert "offset_s in config/offsets/walk.yaml" in said["text"][0] and "camera_rolled" not in said["code"]


def people(folder, worn, habit=(0.0, 0.0, 0.0, 0.0)):
    """A simulated walk with all joints, and boxes drawn 2 px large around the body as it is rendered."""
    true, files, _, _ = prepared(folder, "boxes")
    settings = from_dict({"environments": ["outdoor"], "duration_s": 11.0})
    motion = motion_of(settings, sequences(settings)[0])
    t = np.arange(1200) / 100
    points, count = motion.at(t)[0], len(t) * len(MLKIT_33)
    columns = {axis: points[..., i].ravel() for i, axis in enumerate("xyz")}
    columns |= {"joint": list(MLKIT_33) * len(t), "instant": np.repeat(np.arange(len(t)), len(MLKIT_33))}
    columns |= {"stamp_ns": 10**18 + columns["instant"] * 10**7, "status": ["ok"] * count, "subject": ["S01"] * count}
    tables.write(folder / "walk.parquet", "skeletons_3d", columns | {"sequence": ["walk"] * count})
    frames = np.arange(0, 330, 10)
    landmarks = motion.at(frames / 30)[0]
    figure = draw.figure(landmarks, motion.height)
    tight = draw.outlines(true, figure, motion.height, "shirt", "S01", worn).box
    boxes = tight + (np.array([2, 2, 2, 2]) + habit) * (-1, -1, 1, 1)
    lines = [f"{f},{','.join(f'{x:.2f}' for x in box)}" for f, box in zip(frames, boxes, strict=True)]
    (folder / "walk.cam04.csv").write_text("\n".join(["frame,u_min,v_min,u_max,v_max", *lines]) + "\n")
    return true, files, landmarks


@pytest.mark.parametrize("worn", ["plain", "dressed"])
def test_boxes_around_the_person_are_compared_with_the_outline(tmp_path, worn):
    true, files, points = people(tmp_path, worn)
    off = {}
    for around in ("joints", "body"):
        yaml = (tmp_path / "cam04.yaml").read_text()
        (tmp_path / "cam04.yaml").write_text(yaml.replace("around: joints", f"around: {around}"))
        camera = run_in(tmp_path, **files)
        off[around] = (project(camera, points)[0] - project(true, points)[0]).mean(axis=(0, 1))
    # the outline is 0.8 px further above the top landmark than below the lowest one; half of that is a tilt
    assert off["joints"][1] < -0.3 and abs(off["body"][1]) < 0.15
    assert abs(off["body"][0]) < 0.15


def test_a_habit_moves_the_labels_and_is_in_their_sigma(tmp_path):
    true, files, points = people(tmp_path, "plain", (0.0, 1.0, 0.0, -1.0))
    sigma = {}
    for habit in (0.0, 1.0):
        yaml = (tmp_path / "cam04.yaml").read_text()
        (tmp_path / "cam04.yaml").write_text(re.sub("around: joints|habit_px: [0-9.]+", f"habit_px: {habit}", yaml))
        camera = run_in(tmp_path, **files)
        spread = camera_tables.read_camera_covariance(tmp_path / "covariance.parquet", ["cam04"])
        _, J = covariance.projection(camera, points.mean(axis=(0, 1)))
        sigma[habit] = np.sqrt((J @ spread @ J.T)[1, 1])
    off = (project(camera, points)[0] - project(true, points)[0])[..., 1].mean()
    assert off == pytest.approx(-1.0, abs=0.2)
    assert sigma[1.0] ** 2 - sigma[0.0] ** 2 == pytest.approx(1 / 2, rel=0.15)
    said = tables.read(tmp_path / "findings.parquet", "findings")["text"][0]
    assert "further out in every box, by 1 px" in said


def test_boxes_that_are_kept_back_place_no_camera(tmp_path):
    _, files, _, _ = prepared(tmp_path, "boxes")
    first = run_in(tmp_path, **files)
    path = tmp_path / "walk.cam04.csv"
    rows = [line.split(",") for line in path.read_text().splitlines()]
    frames = np.array([int(row[0]) for row in rows[1:]])
    kept = kept_back(frames)
    assert 0 < kept.sum() < 10

    def with_moved(which):
        for row, moved in zip(rows[1:], which, strict=True):
            row[1:] = [str(float(edge) + 4 * moved) for edge in row[1:]]
        path.write_text("\n".join(",".join(row) for row in rows) + "\n")
        return run_in(tmp_path, **files)

    np.testing.assert_array_equal(with_moved(kept).wTc, first.wTc)
    assert np.abs(with_moved(~kept).wTc - first.wTc).max() > 1e-3


@pytest.mark.parametrize("every", [3, slow(1)])
def test_each_box_is_left_out_of_a_fit(tmp_path, every):
    """Where the labels then are is where a camera has them that is placed without these boxes."""
    _, files, points, _ = prepared(tmp_path, "boxes", ", occluder: none")
    path = tmp_path / "walk.cam04.csv"
    header, *lines = path.read_text().splitlines()
    yaml = (tmp_path / "cam04.yaml").read_text()
    (tmp_path / "cam04.yaml").write_text(yaml.replace("sigma_m: 1.0", "sigma_m: 1.0, roll_deg: 0"))
    random = np.random.default_rng(3)
    lines = [line.split(",") for line in lines[::every]]
    drawn = [[row[0], *(f"{float(x) + random.normal():.2f}" for x in row[1:])] for row in lines]

    def placed(rows):
        path.write_text("\n".join([header, *(",".join(row) for row in rows)]) + "\n")
        return run_in(tmp_path, **files)

    whole = placed(drawn)
    table = tables.read(tmp_path / "without.parquet", "left_out_boxes")
    frames = np.array([int(row[0]) for row in drawn])
    fitted = frames[~kept_back(frames)]
    assert table["frame"].tolist() == fitted.tolist() and set(table["sequence"]) == {"walk"}
    assert (len(fitted) < len(frames)) == (every == 1)
    mine = fitted[folds(fitted) == 0]
    camera = placed([row for row in drawn if int(row[0]) not in mine])
    shift = np.stack([table["shift_u"], table["shift_v"]], axis=-1)[np.isin(fitted, mine)]
    expected = (project(camera, points[mine])[0] - project(whole, points[mine])[0]).mean(axis=1)
    assert np.abs(expected).max() > 0.05
    np.testing.assert_allclose(shift, expected, atol=0.01)


def test_a_second_drawer_places_no_camera_and_tells_the_habit(tmp_path):
    _, files, points, _ = prepared(tmp_path, "boxes")
    path = tmp_path / "walk.cam04.csv"
    alone = run_in(tmp_path, **files)
    header, *lines = path.read_text().splitlines()
    rows = [line.split(",") for line in lines]
    other = [",".join([row[0], row[1], str(float(row[2]) - 4), *row[3:], "zoe"]) for row in rows[::2]]
    path.write_text("\n".join([header + ",drawer", *(f"{line},max" for line in lines), *other]) + "\n")
    camera = run_in(tmp_path, **files)
    assert np.abs(project(camera, points)[0] - project(alone, points)[0]).max() < 0.05
    said = tables.read(tmp_path / "findings.parquet", "findings")
    assert list(said["code"]) == ["camera_aligned", "drawers_differ"]
    # two squares of 0.5 px beforehand, and those of 0 and 2 px
    assert "further out in every box, by 1.1 px" in said["text"][0] and "-2.00 ± 0.00 px below" in said["text"][1]


def test_a_clock_left_open_widens_the_covariance(tmp_path):
    _, files, _, _ = prepared(tmp_path, "marks")
    spread = []
    for offsets in (files["offsets"], []):
        run_in(tmp_path, **files | {"offsets": offsets})
        spread.append(camera_tables.read_camera_covariance(tmp_path / "covariance.parquet", ["cam04"]))
    assert spread[1][1, 1] > spread[0][1, 1]


def test_the_covariance_has_blocks_with_the_close_cameras(tmp_path):
    _, files, _, _ = prepared(tmp_path, "boxes")
    close = [replace(c, role="close") for c in ring(3)]
    camera_tables.write_cameras(tmp_path / "adjust.parquet", close, "field")
    names = [c.name for c in close]
    shared = np.kron(np.ones((3, 3)), np.diag([0, 0, 0, 1e-4, 1e-4, 1e-4])) + 1e-12 * np.eye(18)
    camera_tables.write_camera_covariance(tmp_path / "close.parquet", names, shared, "field")
    files |= {"close": [tmp_path / "adjust.parquet"], "close_covariance": [tmp_path / "close.parquet"]}
    run_in(tmp_path, **files)
    table = tables.read(tmp_path / "covariance.parquet", "camera_covariance")
    assert list(table["camera"]) == ["cam04"] * 4 and list(table["other"]) == ["cam04", *names]
    joint = camera_tables.read_camera_covariance(
        [tmp_path / "covariance.parquet", tmp_path / "close.parquet"], ["cam04", *names]
    )
    assert np.linalg.eigvalsh(joint).min() > -1e-9
    # a world 1 cm higher turns the camera up by 1 cm in 60 m
    assert joint[0, 6 + 5] == pytest.approx(1e-4 / 60, rel=0.2)


@pytest.mark.parametrize("source", ["boxes", "marks"])
def test_what_lies_beside_the_picture_places_no_camera(tmp_path, source):
    _, files, _, _ = prepared(tmp_path, source)
    path = tmp_path / {"boxes": "walk.cam04.csv", "marks": "cam04.marks.csv"}[source]
    header, first, *lines = path.read_text().splitlines()
    moved = "0,1270,300,1310,400" if source == "boxes" else "walk,6,left_heel,1280,300"
    path.write_text("\n".join([header, moved, *lines]) + "\n")
    with pytest.raises(DiorError, match=r"line 2: .* is outside of the 1280x720 picture"):
        run_in(tmp_path, **files)


def test_what_is_missing_is_said(tmp_path):
    _, files, _, _ = prepared(tmp_path, "boxes")
    with pytest.raises(DiorError, match="no config/boxes file"):
        run_in(tmp_path, **files | {"boxes": []})
    marks = tmp_path / "cam04.marks.csv"
    (tmp_path / "cam04.yaml").write_text((tmp_path / "cam04.yaml").read_text().replace("boxes", "marks"))
    marks.write_text("sequence,frame,joint,u,v\nwalk,5,left_heal,600,300\n")
    with pytest.raises(DiorError, match="line 2: 'left_heal' is no joint of walk.*left_heel"):
        run_in(tmp_path, **files)
