"""Placement by a tag drawn into pictures here, and the detector on the real markers."""

import cv2
import numpy as np
import pytest

from dior.calibrate import place
from dior.calibrate.marks import apriltag
from dior.errors import DiorError
from dior.geometry import camera_tables
from dior.geometry.camera import Camera, Intrinsics, angle_deg, inverse_pose, pose, project
from dior.geometry.multiview import rotation_z
from dior.ingest import bags
from dior.tables import tables
from tests.cases import slow
from tests.ingest.test_bags import T0, TOPIC, compressed, encoded, write_bag
from tests.rig import camera

# tag 0 of 36h11 as AprilTag's own pictures show it, inside its black border
OFFICIAL = ["110101", "011101", "011000", "101000", "010110", "000100"]
FLAT = {"family": "36h11", "id": 0, "size_m": 0.4, "position_m": [0, 0, 0], "normal": [0, 0, 1], "up": [0, 1, 0]}
UPRIGHT = FLAT | {"position_m": [0.1, 0.2, 1.0], "normal": [1, 0, 0], "up": [0, 0, 1]}


def printed(size=25):
    """The official picture of tag 0 with its border and a white margin; 10 x 10 cells of `size` px."""
    cells = np.ones((10, 10))
    cells[1:9, 1:9] = 0
    cells[2:8, 2:8] = [[int(bit) for bit in row] for row in OFFICIAL]
    return np.kron(cells * 225 + 15, np.ones((size, size))).astype(np.uint8)


def photograph(view, tag, rng, noise=2.0):
    """A picture of the tag as `view` takes it, each pixel the mean of 3 x 3 rays, with OpenCV's own undistortion."""
    lens, wTm, paper = view.intrinsics, apriltag.tag_pose(tag, "tag"), printed()
    u, v = np.meshgrid((np.arange(3 * lens.width) - 1) / 3, (np.arange(3 * lens.height) - 1) / 3)
    corners = apriltag.marker_points(1.6 * tag["size_m"]) @ wTm[:3, :3].T + wTm[:3, 3]
    uv = project(view, corners)[0]
    near = (np.abs(u - uv[:, 0].mean()) < np.ptp(uv[:, 0])) & (np.abs(v - uv[:, 1].mean()) < np.ptp(uv[:, 1]))
    seen = np.stack([u[near], v[near]], axis=-1)[:, None]
    xy = cv2.undistortPoints(seen, lens.K, np.array(lens.distortion[:5])).reshape(-1, 2)
    mTc = inverse_pose(wTm) @ view.wTc
    rays = np.c_[xy, np.ones(len(xy))] @ mTc[:3, :3].T
    across, up = (mTc[:3, 3] - rays * (mTc[2, 3] / rays[:, 2])[:, None])[:, :2].T / (tag["size_m"] / 8 * 10) + 0.5
    on_paper = (across >= 0) & (across < 1) & (up > 0) & (up <= 1)
    row, column = (np.where(on_paper, at, 0) * 250 for at in (1 - up, across))
    fine = np.full(u.shape, 120.0)
    fine[near] = np.where(on_paper, paper[row.astype(int), column.astype(int)], 120)
    grey = fine.reshape(lens.height, 3, lens.width, 3).mean(axis=(1, 3))
    grey += noise * rng.normal(size=grey.shape)
    return cv2.cvtColor(np.clip(grey, 0, 255).astype(np.uint8), cv2.COLOR_GRAY2BGR)


def recorded(folder, pictures):
    """A bag with the pictures and the frames table of it."""
    messages = [(TOPIC, T0 + i, compressed(T0 + i, encoded(p))) for i, p in enumerate(pictures)]
    bag = write_bag(folder / "a.bag", messages)
    rows = bags.index(bag, [TOPIC])
    n = len(pictures)
    rows |= {"bag": ["a.bag"] * n, "camera": ["cam01"] * n, "frame": np.arange(n)}
    tables.write(folder / "frames.parquet", "frames", rows)
    return folder / "frames.parquet"


@pytest.mark.parametrize(
    ("tag", "centre", "target", "limit_m", "limit_deg"),
    [
        (FLAT, (2.2, -1.2, 1.5), (0, 0, 0.6), 0.005, 0.1),
        slow(FLAT, (-2.0, 1.5, 1.3), (0, 0, 0.4), 0.005, 0.1),
        (UPRIGHT, (4.1, 1.9, 1.6), (0, 0, 1), 0.02, 0.3),
    ],
)
def test_a_camera_is_placed_where_it_is(tmp_path, tag, centre, target, limit_m, limit_deg):
    view = camera("cam01", centre, target)
    rng = np.random.default_rng(1)
    frames = recorded(tmp_path, [photograph(view, tag, rng)] * 2)
    unplaced = Camera("cam01", view.intrinsics)
    wTc, findings, marks = apriltag.place(unplaced, tag, frames, tmp_path, None, "field, cam01")
    assert np.linalg.norm(wTc[:3, 3] - centre) < limit_m
    assert angle_deg(wTc[:3, :3], view.wRc) < limit_deg
    assert findings[0][:2] == ("info", "pose_from_tag") and "in 2 of 2 pictures" in findings[0][2]
    assert marks["joint"][:2] == ["tag_0_top_left", "tag_0_top_right"] and len(marks["u"]) == 8
    np.testing.assert_allclose(np.stack([marks["u"], marks["v"]], axis=1), _truth(view, tag, 2), atol=0.15)


def _truth(view, tag, pictures):
    """Where the corners of a tag are seen, on each of as many pictures."""
    return np.tile(project(view, apriltag.world_points(tag, "tag"))[0], (pictures, 1))


def test_the_corners_that_adjust_reads_are_the_mean_of_the_still_pictures(tmp_path):
    """Of five pictures the tag was carried in one; on the others a corner scatters by 1 px."""
    view = camera("cam01", (2.2, -1.2, 1.5), (0, 0, 0.6))
    off = np.array([-1.2, -0.4, 0.4, 1.2, 40.0])
    truth, count = _truth(view, FLAT, 5), np.arange(20)
    table = {
        "session": ["field"] * 20, "camera": ["cam01"] * 20, "sequence": ["walk"] * 20, "frame": count // 4,
        "joint": ["tag"] * 20, "u": truth[:, 0] + off[count // 4], "v": truth[:, 1],
        **dict(zip("xyz", np.tile(apriltag.world_points(FLAT, "tag"), (5, 1)).T, strict=True)),
        "residual_px": abs(off[count // 4]), "inlier": count < 16,
    }  # fmt: skip
    tables.write(tmp_path / "marks.parquet", "marks", table)
    seen = apriltag.corners_of(tables.read(tmp_path / "marks.parquet", "marks"))
    np.testing.assert_allclose(seen.uv, truth[:4])
    np.testing.assert_allclose(seen.world, apriltag.world_points(FLAT, "tag"))
    assert seen.sigma_px == pytest.approx(np.sqrt(np.mean(off[:4] ** 2)))


def test_the_step_writes_the_placed_camera_and_warns_of_another_tape(tmp_path):
    view = camera("cam01", (2.2, -1.2, 1.5), (0, 0, 0.6))
    rng = np.random.default_rng(2)
    empty = np.full((720, 1280, 3), 120, np.uint8)
    frames = recorded(tmp_path, [photograph(view, FLAT, rng), empty, photograph(view, FLAT, rng)])
    camera_tables.write_cameras(tmp_path / "lens.parquet", [Camera("cam01", view.intrinsics)], "field")
    yaml = tmp_path / "cam01.yaml"
    yaml.write_text(
        f"role: close\ntopic: {TOPIC}\nlocate: apriltag\ntape: {{position_m: [1.2, 2.2, 1.5]}}\n"
    )  # fmt: skip
    place.run(
        session="field", camera="cam01", camera_file=yaml, tag=FLAT, intrinsics=tmp_path / "lens.parquet",
        frames=frames, data_root=tmp_path, out=tmp_path / "out.parquet", out_marks=tmp_path / "marks.parquet",
        findings=tmp_path / "findings.parquet",
    )  # fmt: skip
    placed = camera_tables.read_cameras(tmp_path / "out.parquet")["cam01"]
    assert placed.locate == "apriltag" and np.linalg.norm(placed.centre - view.centre) < 0.005
    found = tables.read(tmp_path / "findings.parquet", "findings")
    assert found["code"].tolist() == ["pose_from_tag", "tag_against_tape"] and "2 of 3 pictures" in found["text"][0]
    assert set(found["scope"]) == {"field/cam01"}
    marks = tables.read(tmp_path / "marks.parquet", "marks")
    assert marks["inlier"].all() and marks["frame"].tolist() == [0] * 4 + [2] * 4


def test_no_tag_in_any_picture(tmp_path):
    frames = recorded(tmp_path, [np.full((720, 1280, 3), 120, np.uint8)] * 3)
    with pytest.raises(DiorError, match=r"field, cam01: tag 0 .* none of the 3 pictures .* 40 cm .* beyond 4 m"):
        apriltag.place(camera("cam01", (2, 0, 1)), FLAT, frames, tmp_path, None, "field, cam01")


@pytest.mark.parametrize("roll_deg", range(0, 360, 30))
def test_a_flat_tag_is_told_apart_by_the_fit_whatever_the_roll(roll_deg):
    """One of the two poses of a tag on the floor often has the camera upside down: it may be."""
    for centre in ((3, 0.5, 1.5), (-2, -3, 1.2), (0.3, 4, 2)):
        view = camera("cam01", centre, (0, 0, 1), distortion=())
        view = view.at(pose(view.wRc @ rotation_z(np.radians(roll_deg)), view.centre))
        corners = project(view, apriltag.marker_points(0.4))[0].round(1)
        found = apriltag.solutions(view, corners, 0.4)
        wTc, why = apriltag.choose(found, np.eye(4), 0.3, "cam01")
        assert np.linalg.norm(wTc[:3, 3] - centre) < 0.15 and "the other fits to" in why
        assert angle_deg(wTc[:3, :3], view.wRc) < 2


def test_what_is_up_tells_poses_apart_that_fit_as_well():
    view = camera("cam01", (3, 0.5, 1.5), (0, 0, 1), distortion=())
    found = apriltag.solutions(view, project(view, apriltag.marker_points(0.4))[0], 0.4)
    # corners so uncertain that both fit
    wTc, why = apriltag.choose(found, np.eye(4), 5.0, "cam01")
    assert np.linalg.norm(wTc[:3, 3] - view.centre) < 0.15 and "upside down" in why


def test_an_ambiguous_pose_is_refused():
    """A small upright tag seen from the front: it may be turned to either side."""
    wTm = apriltag.tag_pose(UPRIGHT, "tag")
    view = camera("cam01", (7, 0.9, 1.1), (0.1, 0.2, 1.0), distortion=())
    points = apriltag.marker_points(0.2) @ wTm[:3, :3].T + wTm[:3, 3]
    found = apriltag.solutions(view, project(view, points)[0] + [[0.1, 0], [0, 0.1], [-0.1, 0], [0, 0]], 0.2)
    with pytest.raises(DiorError, match="two poses fit the tag, to .* px, .* degrees apart"):
        apriltag.choose(found, wTm, 0.3, "cam01")


def test_a_camera_below_the_floor_is_refused():
    view = camera("cam01", (2, 0, 1.0), (0, 0, 0))
    found = apriltag.solutions(view, project(view, apriltag.marker_points(0.4))[0], 0.4)
    buried = apriltag.tag_pose(FLAT | {"position_m": [0, 0, -3]}, "tag")
    with pytest.raises(DiorError, match="m below the floor; check tag.position_m"):
        apriltag.choose(found, buried, 0.3, "cam01")


def test_uncertainty_is_the_scatter_of_noisy_corners():
    view, rng = camera("cam01", (2.2, -1.2, 1.5), (0, 0, 0.6)), np.random.default_rng(0)
    clean = project(view, apriltag.marker_points(0.4))[0]
    centres = []
    for _ in range(200):
        found = apriltag.solutions(view, clean + 0.3 * rng.normal(size=(4, 2)), 0.4)
        centres.append(apriltag.choose(found, np.eye(4), 0.3, "cam01")[0][:3, 3])
    sigma_m, sigma_deg = apriltag.uncertainty(view, np.eye(4), 0.4, 0.3)
    assert sigma_m == pytest.approx(np.std(centres, axis=0).max(), rel=0.25)
    assert 0 < sigma_deg < 2


@pytest.mark.parametrize("change", [{"up": [0, 0, 1]}, {"normal": [0, 0, 0]}, {"up": [0, 1, 0.2]}])
def test_a_tag_without_a_right_angle_is_refused(change):
    with pytest.raises(DiorError, match="right angle"):
        apriltag.tag_pose(FLAT | change, "field")


def test_detections_that_moved_are_left_out():
    corners = np.tile(apriltag.marker_points(100)[:, :2], (6, 1, 1)) + np.linspace(0, 1, 6)[:, None, None]
    corners[2, 1] += 8
    assert apriltag.still(corners).tolist() == [True, True, False, True, True, True]


def test_real_markers(shared):
    bag = shared / "bags/aruco_images.bag"
    topic = "/raspicam_node/image/compressed"
    info = bags.read_camera_info([bag], topic)
    lens = Intrinsics(info.width, info.height, info.K[0], info.K[4], info.K[2], info.K[5], info.model, info.D)
    rows = bags.index(bag, [topic]) | {"bag": np.array([bag.name], object)}
    [(_, picture)] = bags.read_pictures(rows, bag.parent)
    markers = apriltag.detector("5X5_250")(picture)
    assert sorted(markers) == [100, 103, 106, 107, 110, 111, 112]
    best = [apriltag.solutions(Camera("cam01", lens), corners, 0.14)[0] for corners in markers.values()]
    errors = [solution.rms_px for solution in best]
    ranges = [np.linalg.norm(solution.cTm[:3, 3]) for solution in best]
    assert max(errors) < 0.64
    assert min(ranges) == pytest.approx(1.01, abs=0.03) and max(ranges) == pytest.approx(3.39, abs=0.08)
