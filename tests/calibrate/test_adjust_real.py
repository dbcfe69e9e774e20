"""The adjustment on a real four-camera capture, from good, perturbed and wrong starts, as files and as a step."""

import json
import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dior.body.names import BODY_25B
from dior.calibrate.adjust import Choices, Measured, Walks, Written, run
from dior.calibrate.bundle import window
from dior.calibrate.bundle.adjustment import LENS_SIGMA
from dior.calibrate.bundle.outcome import shift_and_turn
from dior.calibrate.place import reference_pose
from dior.errors import DiorError
from dior.geometry import camera_tables
from dior.geometry.camera import Camera, Intrinsics, pose
from dior.geometry.multiview import look_at
from dior.tables import tables
from tests.cases import slow

NAMES = [f"cam{i:02d}" for i in range(1, 5)]
T0 = 1_708_000_000_000_000_000
SEQUENCE = "beam"
GENLOCKED = "".join(f"{name}: {{offset_s: 0.0, drift_ppm: 0}}\n" for name in NAMES)
WINDOW = {SEQUENCE: {"first": 1, "count": 50, "step": 2}}


@pytest.fixture(scope="module")
def capture(shared, tmp_path_factory):
    """A folder with the tables of the recording (OpenPose, one person) and the cameras of its reference calibration."""
    import tomllib

    folder, source = tmp_path_factory.mktemp("real_outdoor"), shared / "real_outdoor"
    calibration = tomllib.loads((source / "reference/calibration_qualisys.toml").read_text())
    cameras, rows = [], []
    for name in NAMES:
        entry = calibration[f"cam_{name[3:]}"]
        K = np.array(entry["matrix"])
        lens = Intrinsics(
            *map(int, entry["size"]),
            K[0, 0],
            K[1, 1],
            K[0, 2],
            K[1, 2],
            "plumb_bob",
            tuple(entry["distortions"]),
            LENS_SIGMA,
        )
        wTc = reference_pose(source / "reference/calibration_qualisys.toml", f"cam_{name[3:]}")
        cameras.append(Camera(name, lens, wTc, "close", "reference"))
        keypoints = np.full((100, 25, 3), np.nan)
        for path in sorted((source / "openpose_single" / name).glob("*.json")):
            people = json.loads(path.read_text())["people"]
            if people and people[0]:
                frame = int(re.findall(r"\d+", path.stem)[-1])
                keypoints[frame] = np.reshape(people[0]["pose_keypoints_2d"], (25, 3))
        rows.append(keypoints.reshape(-1, 3))
    stamps = T0 + np.round(np.arange(100) / 60 * 1e9).astype(np.int64)
    detections = {
        "camera": np.repeat(NAMES, 2500), "frame": np.tile(np.repeat(np.arange(100), 25), 4),
        "stamp_ns": np.tile(np.repeat(stamps, 25), 4), "joint": np.tile(BODY_25B, 400),
        **dict(zip(("u", "v", "score"), np.concatenate(rows).T, strict=True)),
    }  # fmt: skip
    tables.write(folder / f"detections/{SEQUENCE}.parquet", "detections", detections)
    frames = {"camera": np.repeat(NAMES, 100), "frame": np.tile(np.arange(100), 4), "stamp_ns": np.tile(stamps, 4)}
    tables.write(folder / f"frames/{SEQUENCE}.parquet", "frames", frames)
    return folder, cameras


def adjusted(folder, cameras, out, tape_sigma=None, sections=None, clocks=GENLOCKED):
    """Run the step from `cameras`; returns the adjusted ones, the metrics and the findings."""
    files, offsets = [], out / f"{SEQUENCE}.yaml"
    offsets.parent.mkdir(parents=True, exist_ok=True)
    offsets.write_text(clocks)
    for camera in cameras:
        camera_tables.write_cameras(out / f"place/{camera.name}.parquet", [camera], "field")
        yaml = out / f"{camera.name}.yaml"
        text = "reference: {file: calibration.toml, name: cam_01}\n"
        if camera.locate == "tape":
            position = ", ".join(f"{x:.6f}" for x in camera.centre)
            text = f"tape: {{position_m: [{position}], sigma_m: {tape_sigma}}}\n"
        yaml.write_text(f"role: close\ntopic: /{camera.name}/image\nlocate: {camera.locate}\n{text}")
        files.append(yaml)
    run(
        session="field", cameras=[out / f"place/{camera.name}.parquet" for camera in cameras], camera_files=files,
        walks=Walks(
            [folder / f"detections/{SEQUENCE}.parquet"], [folder / f"frames/{SEQUENCE}.parquet"], [offsets],
            WINDOW if sections is None else sections,
        ),
        choices=Choices(
            min_score=0.4, min_views=3, huber_px=15.0, max_mean_px=12.0, max_gap=1.5
        ),
        measured=Measured(known={}, marks=[], marked=[], tags=[]), physics={},
        written=Written(
            out / "adjust.parquet", out / "covariance.parquet", out / "metrics.parquet", out / "findings.parquet"
        ),
    )  # fmt: skip
    return (
        camera_tables.read_cameras(out / "adjust.parquet"),
        tables.read(out / "metrics.parquet", "metrics"),
        tables.read(out / "findings.parquet", "findings"),
    )


def mean_px(metrics, name):
    return metrics["value"][(metrics["metric"] == name) & (metrics["camera"] == "")][0]


def looking_at(cameras, target):
    return [camera.at(pose(look_at(camera.centre, target), camera.centre), "tape") for camera in cameras]


def test_about_a_thousand_joints_are_used(capture):
    folder, cameras = capture
    seen = window.observations(
        cameras, tables.read(folder / f"detections/{SEQUENCE}.parquet", "detections"),
        tables.read(folder / f"frames/{SEQUENCE}.parquet", "frames"), dict.fromkeys(NAMES, (0.0, 0.0, "")),
        WINDOW[SEQUENCE], 0.4, 3, 1.5, "beam",
    )  # fmt: skip
    assert seen.uv.shape == (4, 1001, 2) and seen.count == 50


@pytest.mark.slow
def test_from_the_reference_extrinsics(capture, tmp_path):
    folder, cameras = capture
    found, metrics, findings = adjusted(folder, cameras, tmp_path)
    # 14.3 px of plain linear points (README of the data); points by the pixels' own equations are nearer
    assert 13.7 <= mean_px(metrics, "adjust_error_before") <= 14.2
    assert mean_px(metrics, "adjust_error_after") <= 9.0
    assert len(metrics["value"]) == 10 and (metrics["unit"] == "px").all()
    per_camera = metrics["value"][(metrics["metric"] == "adjust_error_after") & (metrics["camera"] != "")]
    assert per_camera.shape == (4,) and per_camera.max() < 11
    for camera in cameras:
        assert shift_and_turn(camera, found[camera.name])[0] < 0.06
    assert findings["code"].tolist() == [
        "adjust_window",
        "adjusted",
        "adjust_disagreeing",
        "adjust_uncertainty",
        *["camera_moved"] * 4,
    ]
    assert "1001 joints at 50 of 50 instants of beam" in findings["text"][0]


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(5))
def test_from_five_centimetres_and_two_degrees(capture, tmp_path, seed):
    folder, cameras = capture
    rng = np.random.default_rng(seed)
    perturbed = []
    for camera in cameras:
        axis, direction = (v / np.linalg.norm(v) for v in rng.normal(size=(2, 3)))
        turn = Rotation.from_rotvec(np.radians(2) * axis).as_matrix()
        perturbed.append(camera.at(pose(camera.wRc @ turn, camera.centre + 0.05 * direction)))
    _, metrics, _ = adjusted(folder, perturbed, tmp_path)
    assert mean_px(metrics, "adjust_error_before") > 25
    assert mean_px(metrics, "adjust_error_after") <= 9.0


@pytest.mark.slow
def test_cameras_that_look_at_the_origin_end_well_or_not_at_all(capture, tmp_path):
    """The true axes miss the origin by 6-19 degrees, a local minimum is near; it must never be passed on."""
    folder, cameras = capture
    try:
        found, metrics, _ = adjusted(folder, looking_at(cameras, (0, 0, 0)), tmp_path, 0.05)
    except DiorError as error:
        assert "local minimum" in str(error) or "no progress" in str(error)
        return
    assert mean_px(metrics, "adjust_error_after") <= 9.0
    for camera in cameras:
        assert shift_and_turn(camera, found[camera.name])[0] < 0.1


@pytest.mark.slow
@pytest.mark.parametrize("target", [(0, 0, 5), (3.59, 3.65, 3.29)])
def test_look_at_starts_with_a_local_minimum_are_brought_back_by_the_keypoints(capture, tmp_path, target):
    folder, cameras = capture
    found, metrics, findings = adjusted(folder, looking_at(cameras, target), tmp_path, 0.05)
    assert mean_px(metrics, "adjust_error_after") <= 9.0
    # by another start, or by one that is turned as the people stand
    assert {"adjust_starts", "camera_rolled"} & set(findings["code"].tolist())
    for camera in cameras:
        assert shift_and_turn(camera, found[camera.name])[1] < 3


@pytest.mark.slow
def test_a_look_at_start_that_ends_at_fifteen_pixels_is_refused(capture, tmp_path):
    """One camera's height is 1 m wrong and its tape is believed to 0.1 mm: the others cannot make up for it."""
    folder, cameras = capture
    placed = looking_at(cameras, (0, 0, 1))
    placed[0] = placed[0].at(pose(look_at(placed[0].centre, (0, 0, 1)), placed[0].centre + (0.0, 0.0, 1.0)))
    with pytest.raises(DiorError, match=r"ends at a mean of 1[45]\.\d px .*above the limit of 12.0 px"):
        adjusted(folder, placed, tmp_path, 0.0001)


@pytest.mark.slow
def test_a_far_move_is_a_warning(capture, tmp_path):
    folder, cameras = capture
    placed = looking_at(cameras, (0, 0, 1))
    placed[1] = placed[1].at(pose(placed[1].wRc, placed[1].centre + (0.4, 0.0, 0.0)))
    _, _, findings = adjusted(folder, placed, tmp_path, 0.05)
    far = findings["text"][findings["code"] == "camera_moved_far"]
    assert any(text.startswith("cam02 moved 0.") and "measure it again" in text for text in far)


def test_a_window_outside_of_the_recording_is_refused(capture, tmp_path):
    folder, cameras = capture
    with pytest.raises(DiorError, match="no joint is seen by enough cameras in the window"):
        adjusted(folder, cameras, tmp_path, sections={SEQUENCE: {"first": 500, "count": 10, "step": 1}})


def test_a_sequence_without_files_gives_the_nearest(capture, tmp_path):
    folder, cameras = capture
    with pytest.raises(DiorError, match="session field, bean: no detections are given for it.*did you mean 'beam'"):
        adjusted(folder, cameras, tmp_path, sections={"bean": WINDOW[SEQUENCE]})


@pytest.mark.slow
def test_the_step_is_byte_stable(capture, tmp_path):
    folder, cameras = capture
    for name in ("a", "b"):
        adjusted(folder, cameras, tmp_path / name)
    for name in ("adjust.parquet", "covariance.parquet", "metrics.parquet", "findings.parquet"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


def shifted(folder, out, camera, by_s):
    """The tables of the recording with one camera's stamps shifted."""
    for kind in ("detections", "frames"):
        table = dict(tables.read(folder / f"{kind}/{SEQUENCE}.parquet", kind))
        table["stamp_ns"] = table["stamp_ns"] + np.where(table["camera"] == camera, int(by_s * 1e9), 0)
        tables.write(out / f"{kind}/{SEQUENCE}.parquet", kind, table)
    return out


def told(findings, code):
    return [f"{s}: {t}" for s, c, t in zip(*(findings[k] for k in ("scope", "code", "text")), strict=True) if c == code]


@pytest.mark.slow
@pytest.mark.parametrize("by_s", [slow(0.0), 0.05])
def test_clocks_that_nobody_gave_are_found(capture, tmp_path, by_s):
    """Genlocked: what a camera's stamps are shifted by is what comes out, and the others' clocks are near zero."""
    folder, cameras = capture
    moved_by = {}
    _, metrics, findings = adjusted(
        shifted(folder, tmp_path / "in", "cam03", by_s), cameras, tmp_path / "out", clocks="{}\n"
    )
    for text in told(findings, "adjust_clock"):
        name, value, within = re.match(rf"{SEQUENCE}/(cam..): .* ([+-][.\d]+) ms ± ([.\d]+) ms from", text).groups()
        moved_by[name] = float(value), float(within)
    assert sorted(moved_by) == NAMES[1:]
    for name, (value, within) in moved_by.items():
        assert abs(value + 1000 * by_s * (name == "cam03")) < min(1.5 * within, 25.0)
    assert mean_px(metrics, "adjust_error_after") <= 9.0


@pytest.mark.slow
def test_a_clock_given_by_hand_that_is_wrong_by_three_pictures_is_named(capture, tmp_path):
    folder, cameras = capture
    _, _, findings = adjusted(shifted(folder, tmp_path / "in", "cam03", 0.05), cameras, tmp_path / "out")
    (text,) = told(findings, "clock_contradicts")
    assert text.startswith(f"{SEQUENCE}/cam03: the clock given by hand is ") and "says +0.0 ms in the middle" in text
