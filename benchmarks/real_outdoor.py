"""What dior makes of a real recording with known answers, ../shared/data/real_outdoor (its README), step by step.

usage: python -m benchmarks.real_outdoor [DATA]      (DATA: ../shared/data/real_outdoor)

Prints each figure beside the limit and, where there is one, what plain triangulation gets.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from dior import tables
from dior.calibrate import adjust, bundle, place
from dior.camera import Camera, Intrinsics, inverse_pose, project, undistort
from dior.geometry import triangulate
from dior.ingest.readers import mlkit, openpose
from dior.reconstruct import robust
from dior.reconstruct.swaps import exchange, find_exchanged, find_taken
from dior.reconstruct.triangulate import by_rays
from dior.skeletons import swap_index

ROOT = Path(__file__).resolve().parents[1]
CAMERAS = ("cam01", "cam02", "cam03", "cam04")
SWAPPED = [*range(41, 62), 65, *range(67, 75), 77, 78, 81]
FRAMES, FPS = 100, 60.0


def rig(data):
    """The four cameras at the reference calibration."""
    import tomllib

    path = data / "reference/calibration.toml"
    entries = tomllib.loads(path.read_text())
    cameras = []
    for name in CAMERAS:
        entry = entries[name.replace("cam", "cam_")]
        (fx, _, cx), (_, fy, cy), _ = entry["matrix"]
        size = (int(side) for side in entry["size"])
        lens = Intrinsics(*size, fx, fy, cx, cy, "plumb_bob", tuple(entry["distortions"]))
        cameras.append(Camera(name, lens, place.reference_pose(path, entry["name"])))
    return cameras


def observed(people, joints):
    """Pixels (100, J, 2) and scores (100, J) of files with one person a picture."""
    uv, score = np.full((FRAMES, len(joints), 2), np.nan), np.zeros((FRAMES, len(joints)))
    uv[people.frame] = people.uv
    score[people.frame] = np.nan_to_num(people.score)
    return uv, score


def stack(reader, paths):
    found = [reader.read(path) for path in paths]
    uv, score = zip(*(observed(people, found[0].joints) for people in found), strict=True)
    return np.stack(uv), np.stack(score), list(found[0].joints)


def cam04_score(points, cameras, joints):
    """The line of ../shared/tools/score_real_outdoor.py for points (100, J, 3) projected into cam04."""
    uv = project(cameras[3], points)[0]
    count, each = uv.shape[:2]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "labels.parquet"
        columns = {
            "camera": np.full(count * each, "cam04", object),
            "joint": np.tile(np.array(joints, object), count),
            "frame": np.repeat(np.arange(count), each),
            "u": uv[..., 0].ravel(),
            "v": uv[..., 1].ravel(),
        }
        tables.write(path, "labels_2d", columns)
        tool = ROOT.parent / "shared/tools/score_real_outdoor.py"
        return subprocess.run([sys.executable, tool, path], capture_output=True, text=True, check=True).stdout.strip()


def print_unseen_camera(data, cameras):
    uv, score, joints = stack(mlkit, [data / f"mlkit/{name}.jsonl" for name in CAMERAS[:3]])
    close = cameras[:3]
    cTw = [inverse_pose(c.wTc) for c in close]
    xy = np.stack([undistort(c.intrinsics, view) for c, view in zip(close, uv, strict=True)])
    print("ML Kit, 3D of cam01-cam03 projected into cam04 (limit: mean 22.5, median 19.5, coverage 0.98)")
    print(f"  plain DLT               {cam04_score(triangulate(cTw, xy, np.ones_like(score)), cameras, joints)}")
    print(f"  the paper's rays        {cam04_score(by_rays(close, uv), cameras, joints)}")
    score = np.where(score >= 0.3, score, 0.0)
    score = np.where(robust.strangers(close, uv, score, FPS, swap_index(joints))[..., None], 0.0, score)
    swapped = find_exchanged(close, uv, score, joints)
    true = np.zeros(swapped.shape[:2], bool)
    true[1, SWAPPED] = True
    uv, score = exchange(uv, swapped, joints), exchange(score, swapped, joints)
    sigma = robust.noise(close, uv, score, FPS)
    score = np.where(find_taken(close, uv, score, sigma, joints), 0.0, score)
    found = robust.triangulate(close, uv, score, FPS, sigma)
    points, good = found.points, found.scaled <= 45.0
    print(f"  robust                  {cam04_score(np.where(good[..., None], points, np.nan), cameras, joints)}")
    some = swapped.any(axis=2)
    found, false = (some & true).sum(), (some & ~true).sum()
    print(f"  exchanged frames found  {found} of {true.sum()} (limit 30), false {false} (limit 2)")


def print_adjustment(data, cameras):
    uv, score, _ = stack(openpose, [data / f"openpose_single/{name}" for name in CAMERAS])
    seen = np.where((score > 0.4)[..., None], uv, np.nan)[:, 1::2].reshape(4, -1, 2)
    seen = seen[:, np.isfinite(seen).all(axis=-1).sum(axis=0) >= 3]
    print("OpenPose, four cameras adjusted on frames 1, 3, ... 99 (limit: 9 px mean)")
    for seed in (None, 0, 1, 2, 3, 4):
        start = (
            cameras if seed is None else [perturbed(c, np.random.default_rng([seed, i])) for i, c in enumerate(cameras)]
        )
        priors = [bundle.Prior(c.centre, 0.05, c.wRc, np.radians(2.0)) for c in start]
        done = adjust.adjust(start, seen, priors, 15.0, 12.0, "real_outdoor")
        name = "reference extrinsics" if seed is None else f"5 cm, 2 degrees off, seed {seed}"
        before, after = np.nanmean(done.before_px), np.nanmean(done.after_px)
        print(f"  {name:<32}{before:>8.2f} -> {after:.2f} px, {done.iterations} iterations")


def perturbed(camera, random, metres=0.05, degrees=2.0):
    """A camera moved and turned by that much in a random direction."""
    import cv2

    step, axis = (v / np.linalg.norm(v) for v in random.normal(size=(2, 3)))
    wTc = camera.wTc.copy()
    wTc[:3, :3] = wTc[:3, :3] @ cv2.Rodrigues(axis * np.radians(degrees))[0]
    wTc[:3, 3] += metres * step
    return camera.at(wTc)


def main():
    data = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT.parent / "shared/data/real_outdoor"
    cameras = rig(data)
    print_unseen_camera(data, cameras)
    print_adjustment(data, cameras)


if __name__ == "__main__":
    main()
