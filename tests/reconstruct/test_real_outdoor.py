"""The known answers of real_outdoor (its README): robust triangulation of real detections."""

import importlib.util
import itertools
import json

import numpy as np
import pytest

from benchmarks import real_outdoor as benchmark
from dior.body.names import BODY_25B, MLKIT_33
from dior.geometry import camera as cam
from dior.geometry import disagreeing_views
from dior.geometry.camera import inverse_pose, reprojection_errors, undistort
from dior.geometry.triangulation import triangulate
from dior.reconstruct.swaps import exchange, find_swaps

FPS = 60.0
SWAPPED = [*range(41, 62), 65, *range(67, 75), 77, 78, 81]


@pytest.fixture(scope="module")
def rig(shared):
    return cameras_of(shared / "real_outdoor/reference/calibration_qualisys.toml")


def cameras_of(path):
    """cam01-cam04 of a calibration, read here independently of the package's readers."""
    import tomllib

    import cv2

    cameras = []
    for entry in (e for e in tomllib.loads(path.read_text()).values() if "matrix" in e):
        K = np.array(entry["matrix"])
        lens = cam.Intrinsics(1088, 1920, K[0, 0], K[1, 1], K[0, 2], K[1, 2], "plumb_bob", tuple(entry["distortions"]))
        cTw = cam.pose(cv2.Rodrigues(np.array(entry["rotation"]))[0], entry["translation"])
        cameras.append(cam.Camera(entry["name"].replace("_", ""), lens, cam.inverse_pose(cTw)))
    return cameras


def mlkit(shared, camera):
    uv, score = np.full((100, 33, 2), np.nan), np.zeros((100, 33))
    for line in (shared / f"real_outdoor/mlkit/{camera}.jsonl").read_text().splitlines():
        row = json.loads(line)
        for p in row["landmarks"]:
            uv[row["frame"], p["type"]] = p["x"], p["y"]
            score[row["frame"], p["type"]] = p["inFrameLikelihood"]
    return uv, score


def openpose(shared, camera):
    uv, score = np.full((100, 25, 2), np.nan), np.zeros((100, 25))
    for path in sorted((shared / f"real_outdoor/openpose_single/{camera}").glob("*.json")):
        people = json.loads(path.read_text())["people"]
        if people and people[0]:
            values = np.array(people[0]["pose_keypoints_2d"]).reshape(-1, 3)
            seen = values[:, 2] > 0
            uv[int(path.stem.split(".")[-1]), seen] = values[seen, :2]
            score[int(path.stem.split(".")[-1]), seen] = values[seen, 2]
    return uv, score


def stack(reader, shared, rig):
    return map(np.stack, zip(*[reader(shared, c.name) for c in rig], strict=True))


def test_the_exchanged_frames_of_cam02_are_found(shared, rig):
    uv, score = stack(mlkit, shared, rig[:3])
    found = find_swaps(rig[:3], uv, score, MLKIT_33, FPS)
    true = np.zeros((3, 100), bool)
    true[1, SWAPPED] = True
    assert (found & true).sum() >= 30
    assert (found & ~true).sum() <= 2


def unseen_score(shared, camera, points):
    """mean, median and coverage of points (100, 33, 3) projected into cam04."""
    spec = importlib.util.spec_from_file_location("score", shared.parent / "tools/score_real_outdoor.py")
    tool = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tool)
    words = tool.score(cam.project(camera, points)[0]).split()
    return {words[i]: float(words[i + 1]) for i in (0, 2, 4, 6)}


def test_the_unseen_camera_is_labelled(shared, rig):
    """By the default method and the right lens: 20.3 px mean, 17.9 px median (`python -m benchmarks.real_outdoor`)."""
    points, _, _ = benchmark.robust_points(shared / "real_outdoor", rig)
    figures = unseen_score(shared, rig[3], points)
    assert figures["mean"] <= 20.4 and figures["median"] <= 18.4 and figures["coverage"] >= 0.98


@pytest.mark.slow
def test_the_ellipses_of_the_unseen_camera_hold(shared, rig):
    """Every label has a sigma; 98.1 % of the unseen camera's detections are inside."""
    without, share = benchmark.print_ellipses(shared / "real_outdoor", rig)
    assert without == 0 and 0.85 <= share <= 0.99


def test_the_unseen_camera_is_labelled_by_dropping(shared):
    """At most 22.5 px mean and 19.5 px median on cam04 with the published lens; plain DLT has 72 and 26."""
    rig = cameras_of(shared / "real_outdoor/reference/calibration.toml")
    uv, score = stack(mlkit, shared, rig[:3])
    score = np.where(score >= 0.3, score, 0.0)
    swapped = find_swaps(rig[:3], uv, score, MLKIT_33, FPS)
    uv, score = exchange(uv, swapped, MLKIT_33), exchange(score, swapped, MLKIT_33)
    limit = min(45.0, disagreeing_views.DROP_FACTOR * disagreeing_views.usual_error(rig[:3], uv, score))
    points, _, _, good = disagreeing_views.by_dropping(rig[:3], uv, score, limit, 45.0)
    points[~good] = np.nan
    figures = unseen_score(shared, rig[3], points)
    assert figures["mean"] <= 22.5 and figures["median"] <= 19.5 and figures["coverage"] >= 0.98


def plain_dropping(rig, uv, weights, limit_px):
    """Points (T, J, 3) as the publisher makes them: plain linear equations, and one camera fewer while the mean error
    of the best subset is above the limit."""
    cTw = [inverse_pose(camera.wTc) for camera in rig]
    xy = np.stack([undistort(camera.intrinsics, view) for camera, view in zip(rig, uv, strict=True)])
    points, done = np.full((*uv.shape[1:3], 3), np.nan), np.zeros(uv.shape[1:3], bool)
    for size in range(len(rig), 1, -1):
        best = np.full(done.shape, np.inf)
        for kept in itertools.combinations(range(len(rig)), size):
            own = [weights[i] for i in kept]
            found = triangulate([cTw[i] for i in kept], xy[list(kept)], np.stack(own))
            error = reprojection_errors([rig[i] for i in kept], found, uv[list(kept)]).mean(axis=0)
            better = ~done & (np.stack(own) > 0).all(axis=0) & (error < best)
            points[better], best[better] = found[better], error[better]
        done |= best <= limit_px
    return points


def test_dropping_agrees_with_the_publishers_skeleton(shared):
    """Plain confidence-weighted triangulation, cameras dropped at 15 px: median below 1 mm. Equations weighted by the
    depths are the pixels' own: they leave less. It was made with 1/64 of the lens."""
    rig = cameras_of(shared / "real_outdoor/reference/calibration.toml")
    names, theirs = read_trc(shared / "real_outdoor/reference/skeleton.trc")
    uv, score = stack(openpose, shared, rig)
    weights = np.where(score >= 0.3, score, 0.0)
    plain = plain_dropping(rig, uv, weights, 15.0)
    points, error, used, _ = disagreeing_views.by_dropping(rig, uv, weights, 15.0, 15.0)
    at = [BODY_25B.index(name) for name in names]
    assert np.isfinite(plain[:, at]).mean() > 0.99
    assert np.nanmedian(np.linalg.norm(plain[:, at] - theirs, axis=-1)) < 1e-3
    assert np.nanmedian(np.linalg.norm(points[:, at] - theirs, axis=-1)) < 5e-3
    missed = np.where(used, reprojection_errors(rig, plain, uv), np.nan)
    assert np.nanmean(error[:, at]) < np.nanmean(missed[:, :, at])


def read_trc(path):
    """Joint names as in BODY_25B and points (100, J, 3) in the Z-up world; the file's axes are its (Y, Z, X)."""
    lines = path.read_text().splitlines()
    labels = [word for word in lines[3].split("\t")[2:] if word.strip()]
    parts = {"BigToe": "big_toe", "SmallToe": "small_toe"}
    names = [
        word.lower()
        if word.lower() in BODY_25B
        else {"L": "left_", "R": "right_"}[word[0]] + parts.get(word[1:], word[1:].lower())
        for word in labels
    ]
    cells = [line.split("\t")[2 : 2 + 3 * len(names)] for line in lines[5:] if line.strip()]
    values = np.array([[float(cell) if cell.strip() else np.nan for cell in row] for row in cells])
    return names, values.reshape(-1, len(names), 3)[..., [2, 0, 1]]
