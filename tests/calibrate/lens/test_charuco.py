"""PnP and triangulation against a real ChArUco recording with metric truth (caliscope, BSD-2).

The reference cameras of that recording look down on a board whose world has its own origin, so the floor does not
count here: world points are shifted up by 10 m.
"""

import csv
import tomllib

import numpy as np
import pytest

from dior.calibrate.locate import locate
from dior.calibrate.place import reference_pose
from dior.errors import DiorError
from dior.geometry.camera import Camera, Intrinsics, inverse_pose, project, undistort
from dior.geometry.triangulation import triangulate

UP = np.array([0, 0, 10.0])
CENTRE = np.array([0.15, 0.13, 0, 1])


def rows(path, *columns):
    with open(path, newline="") as stream:
        return np.array([[float(row[c] or "nan") for c in columns] for row in csv.DictReader(stream)])


@pytest.fixture(scope="module")
def board(shared):
    """Cameras by id, observations (sync, camera, corner, u, v, board xyz) and corners (sync, corner, world xyz)."""
    folder = shared / "charuco"
    array = tomllib.loads((folder / "camera_array.toml").read_text())["cameras"]
    cameras = {}
    for key, entry in array.items():
        K = np.array(entry["matrix"])
        lens = Intrinsics(*entry["size"], K[0, 0], K[1, 1], K[0, 2], K[1, 2], "plumb_bob", tuple(entry["distortions"]))
        wTc = reference_pose(folder / "camera_array.toml", f"cameras.{key}")
        wTc[:3, 3] += UP
        cameras[int(key)] = Camera(f"cam{key}", lens, wTc)
    seen = rows(
        folder / "xy_CHARUCO.csv", "sync_index", "cam_id", "keypoint_id", "img_loc_x", "img_loc_y",
        "obj_loc_x", "obj_loc_y", "obj_loc_z",
    )  # fmt: skip
    corners = rows(folder / "xyz_CHARUCO.csv", "sync_index", "keypoint_id", "x_coord", "y_coord", "z_coord")
    corners[:, 2:] += UP
    return cameras, seen, corners


def turn_deg(a, b):
    return np.degrees(np.arccos(np.clip((np.trace(a[:3, :3].T @ b[:3, :3]) - 1) / 2, -1, 1)))


@pytest.mark.slow
def test_the_board_located_by_pnp_in_two_cameras_is_at_the_same_place(board):
    """PnP per frame gives the camera in the board's frame; through the known cameras all must agree on the board.

    A board is a plane: to few of its corners two poses may fit, which is refused, as nothing tells which is right.
    """
    cameras, seen, _ = board
    distances, turns, residuals, refused = [], [], [], 0
    for sync in np.unique(seen[:, 0])[::3]:
        poses = []
        for number, camera in cameras.items():
            mine = seen[(seen[:, 0] == sync) & (seen[:, 1] == number)]
            if len(mine) < 10:
                continue
            try:
                found = _in_board(camera, mine[:, 5:8], mine[:, 3:5])
            except DiorError as error:
                assert "nearly in a plane and two poses fit" in str(error)
                refused += 1
                continue
            residuals.append(found[1])
            poses.append(camera.wTc @ inverse_pose(found[0]))
        for other in poses[1:]:
            distances.append(np.linalg.norm((other @ CENTRE - poses[0] @ CENTRE)[:3]))
            turns.append(turn_deg(other, poses[0]))
    assert len(distances) > 15 and refused <= 0.1 * len(residuals), (refused, len(residuals))
    assert np.concatenate(residuals).mean() < 1.0
    assert np.median(distances) < 0.015 and np.median(turns) < 1.5


def _in_board(camera, points, uv):
    """The camera's pose in the board's frame, and the residuals."""
    found = locate(camera, points + UP, uv, 8.0, camera.name)
    wTc = found.wTc.copy()
    wTc[:3, 3] -= UP
    return wTc, found.residual_px


def test_pnp_on_all_corners_recovers_each_reference_camera(board):
    cameras, seen, corners = board
    world = {(sync, corner): xyz for sync, corner, *xyz in corners}
    for number, camera in cameras.items():
        mine = [row for row in seen if row[1] == number and (row[0], row[2]) in world]
        xyz = np.array([world[row[0], row[2]] for row in mine])
        uv = np.array([row[3:5] for row in mine])
        found = locate(camera, xyz, uv, 8.0, camera.name)
        assert np.linalg.norm(found.wTc[:3, 3] - camera.centre) < 0.01
        assert turn_deg(found.wTc, camera.wTc) < 0.5
        assert found.inlier.mean() > 0.95


def test_triangulation_with_the_reference_cameras(board):
    cameras, seen, _ = board
    keys = sorted({(row[0], row[2]) for row in seen})
    where = {key: i for i, key in enumerate(keys)}
    uv = np.full((len(cameras), len(keys), 2), np.nan)
    board_xyz = np.full((len(keys), 3), np.nan)
    for row in seen:
        uv[int(row[1]), where[row[0], row[2]]] = row[3:5]
        board_xyz[where[row[0], row[2]]] = row[5:8]
    order = [cameras[i] for i in range(len(cameras))]
    xy = np.stack([undistort(camera.intrinsics, seen) for camera, seen in zip(order, uv, strict=True)])
    points = triangulate(np.stack([inverse_pose(c.wTc) for c in order]), xy, np.ones(xy.shape[:-1]))
    error = np.stack([project(camera, points)[0] for camera in order]) - uv
    rmse = np.sqrt(np.nanmean(error**2) * 2)
    assert 1.6 <= rmse <= 1.7

    sync = np.array([key[0] for key in keys])
    a, b = np.triu_indices(len(keys), 1)
    pair = (sync[a] == sync[b]) & np.isfinite(points[a]).all(axis=1) & np.isfinite(points[b]).all(axis=1)
    measured = np.linalg.norm(points[a] - points[b], axis=1)[pair]
    true = np.linalg.norm(board_xyz[a] - board_xyz[b], axis=1)[pair]
    scale = (measured * true).sum() / (true**2).sum()
    assert 0.99 <= scale <= 1.00
    assert np.median(np.abs(measured / scale - true)) < 1e-3
