"""PnP from marks: exact without noise, for every lens model, with wrong marks, and what it refuses."""

import re
from dataclasses import replace

import numpy as np
import pytest

from dior.calibrate.locate import ByHand, Recorded, Written, locate, run
from dior.clocks import clock
from dior.errors import DiorError
from dior.geometry import camera_tables
from dior.geometry.camera import inverse_pose, project
from dior.tables import tables
from tests.rig import D455, camera, ring

RATIONAL = (0.2, -0.4, 0.001, -0.0005, 0.1, 0.3, -0.3, 0.05)
CENTRE = (3.0, -2.0, 1.6)


def scene(count=12, model="plumb_bob", distortion=D455, seed=0):
    """A camera, points on a body (N, 3) and their exact pixels (N, 2)."""
    rng = np.random.default_rng(seed)
    view = camera("cam01", CENTRE, distortion=distortion, model=model)
    points = rng.uniform((-0.6, -0.4, 0.1), (0.6, 0.4, 1.8), (count, 3))
    return view, points, project(view, points)[0]


def assert_at(wTc, expected, atol):
    np.testing.assert_allclose(wTc, expected, atol=atol)


@pytest.mark.parametrize(
    ("model", "distortion"),
    [("plumb_bob", D455), ("rational_polynomial", RATIONAL), ("inverse_brown_conrady", D455), ("plumb_bob", ())],
)
@pytest.mark.parametrize("count", [5, 12, 40])
def test_exact_marks_give_the_exact_pose(model, distortion, count):
    view, points, uv = scene(count, model, distortion)
    found = locate(view, points, uv, 8.0, "marks")
    assert_at(found.wTc, view.wTc, 1e-6)
    assert found.inlier.all() and found.residual_px.max() < 1e-5


def test_four_exact_marks_are_enough():
    view, points, uv = scene(4)
    assert_at(locate(view, points, uv, 8.0, "marks").wTc, view.wTc, 1e-6)


def test_marks_in_a_plane():
    view, points, _ = scene(10)
    points[:, 2] = 0.0
    assert_at(locate(view, points, project(view, points)[0], 8.0, "marks").wTc, view.wTc, 1e-6)


@pytest.mark.parametrize("seed", range(10))
def test_gross_outliers_are_told_apart(seed):
    view, points, uv = scene(12, seed=seed)
    rng = np.random.default_rng(seed)
    wrong = rng.choice(12, 3, replace=False)
    uv = uv + rng.normal(0, 1.0, uv.shape)
    uv[wrong] += rng.choice([-1, 1], (3, 2)) * rng.uniform(25, 80, (3, 2))
    found = locate(view, points, uv, 8.0, "marks")
    assert set(np.flatnonzero(~found.inlier)) == set(wrong)
    assert np.linalg.norm(found.wTc[:3, 3] - CENTRE) < 0.15


def test_one_pixel_of_noise_keeps_the_labels_within_half_a_pixel():
    errors = []
    for seed in range(10):
        view, points, uv = scene(40, seed=seed)
        noisy = uv + np.random.default_rng(seed).normal(0, 1.0, uv.shape)
        found = locate(view, points, noisy, 8.0, "marks")
        errors.append(np.linalg.norm(project(view.at(found.wTc), points)[0] - uv, axis=1).mean())
    assert np.mean(errors) < 0.5


@pytest.mark.slow
def test_the_standard_error_is_that_of_many_trials():
    view, points, uv = scene(20)
    found = [
        locate(view, points, uv + np.random.default_rng(seed).normal(0, 1.0, uv.shape), 8.0, "marks")
        for seed in range(40)
    ]
    centres = np.array([f.wTc[:3, 3] for f in found])
    largest = np.sqrt(np.linalg.eigvalsh(np.cov(centres.T))[-1])
    assert np.median([f.sigma_m for f in found]) == pytest.approx(largest, rel=0.35)


def test_the_same_marks_give_the_same_bytes():
    view, points, uv = scene(12)
    uv = uv + np.random.default_rng(1).normal(0, 2.0, uv.shape)
    assert locate(view, points, uv, 8.0, "m").wTc.tobytes() == locate(view, points, uv, 8.0, "m").wTc.tobytes()


@pytest.mark.parametrize("count", [0, 3])
def test_fewer_than_four_marks(count):
    view, points, uv = scene(max(count, 1))
    with pytest.raises(DiorError, match=f"cam01.marks.csv: {count} usable marks, but at least 4"):
        locate(view, points[:count], uv[:count], 8.0, "cam01.marks.csv")


def test_no_consensus():
    view, points, _ = scene(12)
    uv = np.random.default_rng(3).uniform((0, 0), (1280, 720), (12, 2))
    with pytest.raises(DiorError, match="marks agree on a pose within 8 px"):
        locate(view, points, uv, 8.0, "marks")


def test_marks_on_a_line_leave_the_pose_open():
    view, _, _ = scene()
    points = np.array([0.1, -0.2, 0.2]) + np.linspace(0, 1, 8)[:, None] * (0.2, 0.1, 1.4)
    with pytest.raises(DiorError, match="all on a line, which leaves the pose open"):
        locate(view, points, project(view, points)[0], 8.0, "marks")


def test_a_camera_below_the_floor():
    low = camera("cam01", (3.0, -2.0, -0.5))
    _, points, _ = scene()
    with pytest.raises(DiorError, match="0.50 m below the floor"):
        locate(low, points, project(low, points)[0], 8.0, "marks")


def session(folder, wrong=False, frames=(0, 3)):
    """Files of a session with one sequence whose markers move, and marks on two frames."""
    view = ring(1)[0]
    rng = np.random.default_rng(5)
    names = [f"M{i:02d}" for i in range(10)]
    start = rng.uniform((-0.5, -0.5, 0.1), (0.5, 0.5, 1.7), (10, 3))
    t0, rate, ticks = 1_708_000_000_000_000_000, 100, 60
    xyz = start + np.arange(ticks)[:, None, None] / rate * np.array([1.2, 0.3, 0.1])
    grid = {
        "subject": ["S01"] * ticks * 10, "sequence": ["indoor_01"] * ticks * 10, "joint": names * ticks,
        "instant": np.repeat(np.arange(ticks), 10), "stamp_ns": np.repeat(t0 + np.arange(ticks) * 10**7, 10),
        "status": ["ok"] * ticks * 10, **dict(zip("xyz", xyz.reshape(-1, 3).T, strict=True)),
    }  # fmt: skip
    tables.write(folder / "mocap.parquet", "skeletons_3d", grid)
    stamps = t0 + np.round(np.arange(10) / 30 * 1e9).astype(int)
    (folder / "frames").mkdir(exist_ok=True)
    tables.write(
        folder / "frames/indoor_01.parquet",
        "frames",
        {"camera": ["cam01"] * 10, "frame": np.arange(10), "stamp_ns": stamps},
    )
    (folder / "indoor_01.yaml").write_text("cam01: {offset_s: 0.0123}\n")
    (folder / "cam01.yaml").write_text("role: close\ntopic: /cam01/image\nlocate: marks\n")
    camera_tables.write_cameras(folder / "lens.parquet", [view.at(np.full((4, 4), np.nan))], "lab")
    lines = ["sequence,frame,joint,u,v"]
    for frame in frames:
        at = start + (frame / 30 + 0.0123) * np.array([1.2, 0.3, 0.1])
        for name, (u, v) in zip(names, project(view, at)[0], strict=True):
            lines.append(f"indoor_01,{frame},{name},{u:.4f},{v:.4f}")
    if wrong:
        cells = lines[4].split(",")
        lines[4] = ",".join([*cells[:3], f"{float(cells[3]) + 40:.4f}", cells[4]])
    (folder / "cam01.marks.csv").write_text("\n".join(lines) + "\n")
    return view


def located(folder):
    run(
        session="lab", camera="cam01", camera_file=folder / "cam01.yaml", intrinsics=folder / "lens.parquet",
        given=ByHand(folder / "cam01.marks.csv", ["indoor_01"], [folder / "indoor_01.yaml"]),
        recorded=Recorded([folder / "mocap.parquet"], [folder / "frames/indoor_01.parquet"]), ransac_px=8.0,
        written=Written(
            out=folder / "cam.parquet", out_covariance=folder / "covariance.parquet",
            out_clocks=folder / "clocks.parquet", out_clock_gains=folder / "clock_gains.parquet",
            out_clock_costs=folder / "clock_costs.parquet", out_marks=folder / "marks.parquet",
            findings=folder / "findings.parquet",
        ),
    )  # fmt: skip
    return (
        camera_tables.read_cameras(folder / "cam.parquet")["cam01"],
        tables.read(folder / "marks.parquet", "marks"),
        tables.read(folder / "findings.parquet", "findings"),
    )


def test_the_step_on_two_frames_of_a_moving_body_with_an_offset(tmp_path):
    view = session(tmp_path)
    found, marks, findings = located(tmp_path)
    # the mocap table keeps 32-bit metres, the marks file 0.0001 px
    assert_at(found.wTc, view.wTc, 2e-5)
    assert found.locate == "marks" and marks["inlier"].all() and marks["residual_px"].max() < 1e-3
    assert findings["code"].tolist() == ["pose_from_marks"] and "20 of 20 marks on 2 frames" in findings["text"][0]


def test_the_step_writes_the_covariance_and_says_what_to_mark_next(tmp_path):
    view = session(tmp_path)
    path = tmp_path / "cam01.marks.csv"
    lines = path.read_text().splitlines()
    # without the highest and the lowest marker the rest leave the tilt open most
    path.write_text("\n".join(line for line in lines if ",M0" not in line or line.split(",")[2] < "M06") + "\n")
    _, marks, findings = located(tmp_path)
    covariance = camera_tables.read_camera_covariance(tmp_path / "covariance.parquet", ["cam01"])
    assert np.linalg.eigvalsh(covariance).min() > 0
    said = dict(zip(findings["code"], findings["text"], strict=True))
    named = re.search(r"(M\d\d) on frame (\d) of indoor_01 would help most, to ([0-9.]+) px", said["next_mark"])
    assert named[1] in ("M06", "M07", "M08", "M09") and named[2] in "03"
    before = float(re.search(r"label is ([0-9.]+) px", said["next_mark"])[1])
    assert float(named[3]) < before
    assert view.name == "cam01" and len(marks["joint"]) == 12


def test_the_step_keeps_the_wrong_mark_as_outlier_and_names_it(tmp_path):
    view = session(tmp_path, wrong=True)
    found, marks, findings = located(tmp_path)
    assert_at(found.wTc, view.wTc, 2e-5)
    assert np.flatnonzero(~marks["inlier"]).tolist() == [3]
    assert marks["residual_px"][3] == pytest.approx(40, abs=0.01)
    assert findings["code"].tolist() == ["mark_rejected", "pose_from_marks"]
    assert findings["severity"][0] == "warning"
    assert "line 5: M03 on frame 0 of indoor_01 is 40.0 px from" in findings["text"][0]


@pytest.mark.parametrize("named", ["plumb_bob", "inverse_brown_conrady"])
def test_the_marks_of_a_realsense_tell_its_lens_model(tmp_path, named):
    """The marks are those of a plumb_bob lens; what a person names is the other or the same."""
    view = session(tmp_path)
    assert view.intrinsics.model == "plumb_bob" and any(view.intrinsics.distortion)
    lens = replace(view, intrinsics=replace(view.intrinsics, model=named)).at(np.full((4, 4), np.nan))
    camera_tables.write_cameras(tmp_path / "lens.parquet", [lens], "lab")
    _, _, findings = located(tmp_path)
    assert "lens_models" not in findings["code"]
    text = (tmp_path / "cam01.yaml").read_text()
    (tmp_path / "cam01.yaml").write_text(text.replace("/cam01/image", "cam01/color/image_raw"))
    _, _, findings = located(tmp_path)
    severity, code, text = (findings[key][-1] for key in ("severity", "code", "text"))
    assert "px as " in text and f"px off with the lens as {named}" in text
    wanted = ("info", "lens_models") if named == "plumb_bob" else ("warning", "lens_model_doubtful")
    assert (severity, code) == wanted and ("check `distortion_model`" in text) == (named != "plumb_bob")


def test_the_step_writes_the_clocks_of_what_is_given_by_hand(tmp_path):
    session(tmp_path)
    located(tmp_path)
    found = clock.read([tmp_path / "clocks.parquet"], [tmp_path / "clock_gains.parquet"], "indoor_01")["cam01"]
    assert (found.offset_s, found.source, found.method) == (0.0123, "manual", "") and np.isnan(found.sigma()).all()


def test_the_step_assumes_zero_where_the_marks_tell_no_time(tmp_path):
    """A body that does not change shape looks the same at any time to a camera that stands further on."""
    session(tmp_path)
    (tmp_path / "indoor_01.yaml").unlink()
    _, marks, findings = located(tmp_path)
    assert findings["code"].tolist() == ["clock_assumed_zero", "pose_from_marks"] and marks["inlier"].all()
    found = clock.read([tmp_path / "clocks.parquet"], [tmp_path / "clock_gains.parquet"])["cam01"]
    assert (found.offset_s, found.source) == (0.0, "assumed_zero")
    lags = tables.read(tmp_path / "clock_costs.parquet", "clock_costs")
    assert len(lags["lag_s"]) == 201 and np.nanmax(lags["cost_px"]) < 0.01


def test_a_wrong_offset_shows_in_the_residuals(tmp_path):
    session(tmp_path)
    (tmp_path / "indoor_01.yaml").write_text("cam01: {offset_s: 0.0}\n")
    view = ring(1)[0]
    found, _, _ = located(tmp_path)
    # 1.24 m/s for 12.3 ms: the camera is 15 mm off
    assert np.linalg.norm(found.centre - view.centre) == pytest.approx(0.0153, abs=0.002)


def test_the_step_is_byte_stable(tmp_path):
    session(tmp_path, wrong=True)
    names = (
        "cam.parquet",
        "covariance.parquet",
        "clocks.parquet",
        "clock_gains.parquet",
        "clock_costs.parquet",
        "marks.parquet",
        "findings.parquet",
    )
    located(tmp_path)
    first = [(tmp_path / name).read_bytes() for name in names]
    located(tmp_path)
    assert first == [(tmp_path / name).read_bytes() for name in names]


def test_inverse_of_the_pose_is_what_opencv_gives():
    import cv2

    view, points, uv = scene(12, distortion=())
    _, rotation, translation = cv2.solvePnP(points, uv, view.intrinsics.K, None)
    cTw = np.eye(4)
    cTw[:3, :3], cTw[:3, 3] = cv2.Rodrigues(rotation)[0], translation.ravel()
    assert_at(inverse_pose(locate(view, points, uv, 8.0, "m").wTc), cTw, 1e-5)


def test_a_mark_beyond_the_limit_is_left_out_though_it_is_no_gross_error():
    view, points, uv = scene(20)
    uv[6] += (0.0, 12.0)
    found = locate(view, points, uv, 8.0, "marks")
    assert np.flatnonzero(~found.inlier).tolist() == [6]
    assert_at(found.wTc, view.wTc, 1e-6)
    assert locate(view, points, uv, 16.0, "marks").inlier.all()


def test_the_standard_errors_are_by_the_degrees_of_freedom_of_centre_and_turn():
    view, points, uv = scene(9)
    found = locate(view, points, uv + np.random.default_rng(2).normal(0, 1.0, uv.shape), 20.0, "marks")
    spread = np.linalg.inv(found.jacobian.T @ found.jacobian) * (found.residual_px**2).sum() / (18 - 6)
    for sigma, block in ((found.sigma_m, spread[3:, 3:]), (np.radians(found.sigma_deg), spread[:3, :3])):
        assert sigma == pytest.approx(np.sqrt(np.linalg.eigvalsh(block)[-1]), rel=1e-6)


def wrong_lens(lens, random, sigma=0.003):
    f, x, y = sigma * random.standard_normal(3)
    focal = {"fx": lens.fx * (1 + f), "fy": lens.fy * (1 + f)}
    return replace(lens, **focal, cx=lens.cx + x * lens.fx, cy=lens.cy + y * lens.fx, sigma=sigma)


@pytest.mark.slow
def test_a_lens_that_is_wrong_widens_the_labels_by_what_it_does_to_them():
    """60 lenses that are 0.3 % off: 100 marks on a body in the middle of the room, labels up to 3 m from there. Chi2 of
    two coordinates is 2 on average; without the lens it is more."""
    from dior.calibrate.marks import clock_from_marks
    from dior.geometry import covariance
    from dior.label import uncertainty

    view, marked, exact = scene(100)
    shown = marked[:16] + np.repeat([[-2.5, -1.5, 0.0], [1.0, 2.0, 0.0]], 8, axis=0)
    chi2 = {True: [], False: []}
    for seed in range(60):
        random = np.random.default_rng(seed)
        wrong = replace(view, intrinsics=wrong_lens(view.intrinsics, random))
        found = locate(wrong, marked, exact + random.normal(0, 1.0, exact.shape), 20.0, "m")
        own = wrong.at(found.wTc)
        at, each = marked[found.inlier], np.arange(found.inlier.sum())
        for with_lens in (True, False):
            sigma = wrong.intrinsics.sigma * with_lens
            by_lens = sigma * covariance.by_lens(own, at).reshape(-1, 3)
            full, _, across = clock_from_marks.uncertainty(
                found.jacobian, np.zeros(len(at)), found.miss, each, each, by_lens
            )
            joint = covariance.joined(full[:6, :6], sigma * across, sigma**2 * np.eye(3))
            points = shown[:, None]
            spread = uncertainty.of_labels(own, points, np.zeros((16, 1, 3, 3)), [], ["cam01"], joint)[:, 0]
            off = project(own, shown)[0] - project(view, shown)[0]
            chi2[with_lens].append(np.einsum("ni,ni->n", off, np.linalg.solve(spread, off[..., None])[..., 0]).mean())
    assert 1.2 < np.mean(chi2[True]) < 2.4 and np.mean(chi2[False]) > 3.2


def test_the_step_writes_what_the_lens_does(tmp_path):
    view = session(tmp_path)
    camera_tables.write_cameras(
        tmp_path / "lens.parquet", [replace(view, wTc=None, intrinsics=replace(view.intrinsics, sigma=0.003))], "lab"
    )
    found, *_ = located(tmp_path)
    joint = camera_tables.read_camera_covariance(tmp_path / "covariance.parquet", ["cam01"], with_lenses=True)
    np.testing.assert_allclose(np.diag(joint)[6:], 0.003**2)
    assert np.abs(joint[:6, 6:]).max() > 0 and np.linalg.eigvalsh(joint[6:, 6:]).min() > 0
    assert found.intrinsics.sigma == 0.003
