"""What dior makes of a real recording with known answers, ../shared/data/real_outdoor (its README), step by step.

usage: python -m benchmarks.real_outdoor [DATA]      (DATA: ../shared/data/real_outdoor)

Prints each figure beside the limit and, where there is one, what plain triangulation gets.
"""

import subprocess
import sys
import tempfile
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from dior.body.names import swap_index
from dior.calibrate import place
from dior.calibrate.bundle import adjustment, bundle, given_poses, in_adjustment, outcome, starts
from dior.calibrate.bundle.window import Recorded
from dior.calibrate.clock.from_cameras import TimedDetections
from dior.calibrate.outline import boxes_fit, seen_edges
from dior.errors import DiorError
from dior.geometry import covariance
from dior.geometry.camera import Camera, Intrinsics, inverse_pose, pose, project, undistort
from dior.geometry.multiview import look_at
from dior.geometry.triangulation import triangulate, triangulated
from dior.ingest.readers import mlkit, openpose
from dior.label import uncertainty
from dior.reconstruct import detector_noise, refine, robust
from dior.reconstruct.swaps import exchange, find_exchanged, find_mistaken_limbs
from dior.reconstruct.triangulate import by_rays
from dior.tables import tables

ROOT = Path(__file__).resolve().parents[1]
CAMERAS = ("cam01", "cam02", "cam03", "cam04")
SWAPPED = [*range(41, 62), 65, *range(67, 75), 77, 78, 81]
FRAMES, FPS = 100, 60.0
# of the config: scores that count, the adjustment's loss, gaps; and how well a lens from a file is known
CONFIDENT, HUBER_PX, MAX_GAP, BRIDGED_S, LENS_SIGMA = 0.4, 15.0, 1.5, 0.2, 0.003
# chi squared with two degrees of freedom
IN_95, IN_50 = 5.991, 1.386
NOISES_PX = np.arange(0.0, 40.0, 0.1)
BOXED_FRAMES = range(0, FRAMES, 5)
# the latter so that the person is as tall as one 60 m from a camera of the paper
SHRUNK = 16, 38
BOXED = {"left_big_toe": "left_foot_index", "right_big_toe": "right_foot_index"}


def rig(data):
    """The four cameras at the reference calibration."""
    import tomllib

    path = data / "reference/calibration_qualisys.toml"
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


def detected(data, tool, names=CAMERAS):
    """Pixels (V, 100, J, 2) and scores (V, 100, J) of OpenPose or ML Kit, and the joints."""
    if tool == "OpenPose":
        return stack(openpose, [data / f"openpose_single/{name}" for name in names])
    return stack(mlkit, [data / f"mlkit/{name}.jsonl" for name in names])


def shared_names(joints):
    """Joints of OpenPose by the names that ML Kit has for them."""
    return [BOXED.get(name, name) for name in joints]


def robust_points(data, cameras, tool="ML Kit"):
    """3D (100, J, 3) of a detector in cam01-cam03 by the default method, what was exchanged (3, 100, J), the joints."""
    close = cameras[:3]
    uv, score, joints = detected(data, tool, CAMERAS[:3])
    score = np.where(score >= 0.3, score, 0.0)
    score = np.where(robust.strangers(close, uv, score, FPS, swap_index(joints))[..., None], 0.0, score)
    swapped = find_exchanged(close, uv, score, joints, FPS)
    uv, score = exchange(uv, swapped, joints), exchange(score, swapped, joints)
    sigma = detector_noise.estimated(close, uv, score, FPS, joints).sigma
    score = np.where(find_mistaken_limbs(close, uv, score, sigma, joints, FPS), 0.0, score)
    found = robust.triangulate(close, uv, score, FPS, sigma)
    return np.where((found.scaled <= 45.0)[..., None], found.points, np.nan), swapped, joints


def print_unseen_camera(data, cameras):
    uv, _, joints = stack(mlkit, [data / f"mlkit/{name}.jsonl" for name in CAMERAS[:3]])
    close = cameras[:3]
    cTw = [inverse_pose(c.wTc) for c in close]
    xy = np.stack([undistort(c.intrinsics, view) for c, view in zip(close, uv, strict=True)])
    plain = triangulate(cTw, xy, np.ones(xy.shape[:-1]))
    points, swapped, _ = robust_points(data, cameras)
    print("ML Kit, 3D of cam01-cam03 projected into cam04 (limit: mean 22.5, median 19.5, coverage 0.98)")
    print(f"  plain DLT               {cam04_score(plain, cameras, joints)}")
    print(f"  the paper's rays        {cam04_score(by_rays(close, uv), cameras, joints)}")
    print(f"  robust                  {cam04_score(points, cameras, joints)}")
    some = swapped.any(axis=2)
    true = np.zeros(some.shape, bool)
    true[1, SWAPPED] = True
    found, false = (some & true).sum(), (some & ~true).sum()
    print(f"  exchanged frames found  {found} of {true.sum()} (limit 30), false {false} (limit 2)")


def observed_by_mlkit(data, names):
    """Pixels, scores and joints of ML Kit in these cameras, without doubtful ones."""
    uv, score, joints = stack(mlkit, [data / f"mlkit/{name}.jsonl" for name in names])
    return uv, np.where(score >= CONFIDENT, score, 0.0), joints


def pose_errors(cameras, uv, score, joints):
    """`given_poses.PoseErrors` of the reference poses, as the step `reference` finds them by this walk."""
    seen = np.where((score > 0)[..., None], uv, np.nan)
    timed = tuple(TimedDetections(np.arange(FRAMES) / FPS, one, MAX_GAP / FPS) for one in seen)
    window = {"first": 0, "count": FRAMES, "step": 1}
    by_hand = [[(0.0, 0.0, "manual")] * len(cameras)]
    names = [camera.name for camera in cameras]
    walk = in_adjustment.of([Recorded(timed, tuple(joints), FPS)], [window], names, by_hand, 2)
    return given_poses.of(cameras, walk, HUBER_PX, np.full(len(cameras), LENS_SIGMA))


def labels_of(makers, uv, score, noise, joints, camera, errors, lens_sigma):
    """Labels (100, J, 2) px of a camera and their covariance, of the 3D that `makers` give, smoothed as by `refine`."""
    found = robust.triangulate(makers, uv, score, FPS, noise.sigma)
    points = np.where((found.scaled <= 45.0)[..., None], found.points, np.nan)
    weights = np.where(found.used, score, 0.0) / noise.sigma
    time_s, constant_share = robust.error_correlation(makers, uv, score, found, FPS, noise)
    spread = robust.covariance(makers, points, weights, noise.own)
    points, spread, _, _ = refine.refined(points, spread, joints, FPS, time_s, constant_share, BRIDGED_S)
    rig = [*makers, camera]
    poses = np.kron(np.eye(len(rig)), errors.covariance())
    lenses = lens_sigma**2 * np.eye(3 * len(rig))
    joint = covariance.joined(poses, np.zeros((len(poses), len(lenses))), lenses)
    names = [one.name for one in rig]
    return project(camera, points)[0], uncertainty.of_labels(camera, points, spread, makers, names, joint)


def distances(off, spread, noise_px):
    """Squared Mahalanobis distances (N,) of `off` (..., 2) px, of labels' covariance widened by a detector's noise."""
    known = np.isfinite(off).all(axis=-1) & np.isfinite(spread).all(axis=(-1, -2))
    wide = spread[known] + noise_px**2 * np.eye(2)
    return np.einsum("ni,nij,nj->n", off[known], np.linalg.inv(wide), off[known])


def least_noise(parts, share, quantile):
    """The least detector's noise (px in u and in v) with which that share of all parts, (off, spread), is inside."""
    for noise_px in NOISES_PX:
        if np.mean(np.concatenate([distances(*part, noise_px) for part in parts]) <= quantile) >= share:
            return noise_px
    return np.nan


def print_ellipses(data, cameras):
    """Do the labels' ellipses hold in the unseen camera? The labels without sigma, and the share inside.

    The detector's noise is taken from the close cameras, each labelled by the other two: the scatter about each
    camera's own offset, beyond that of the 3D. A constant offset of a camera is its pose's, for which its sigma is to
    stand. cam04 is read after that.
    """
    close = cameras[:3]
    uv, score, joints = observed_by_mlkit(data, CAMERAS[:3])
    errors = pose_errors(close, uv, score, joints)
    swapped = find_exchanged(close, uv, score, joints, FPS)
    uv, score = exchange(uv, swapped, joints), exchange(score, swapped, joints)
    noise = detector_noise.estimated(close, uv, score, FPS, joints)
    score = np.where(find_mistaken_limbs(close, uv, score, noise.sigma, joints, FPS), 0.0, score)
    scatter, whole = [], []
    for view in range(3):
        rest = [i for i in range(3) if i != view]
        own = [close[i] for i in rest], uv[rest], score[rest], noise.of_views(rest), joints, close[view]
        labels, spread = labels_of(*own, errors, LENS_SIGMA)
        off = np.where((score[view] > 0)[..., None], uv[view] - labels, np.nan)
        whole.append((off, spread))
        scatter.append(
            (off - np.nanmedian(off, axis=(0, 1)), labels_of(*own, given_poses.PoseErrors(0.0, 0.0), 0.0)[1])
        )
    noise_px, all_px = least_noise(scatter, 0.5, IN_50), least_noise(whole, 0.95, IN_95)
    print("reference cameras: 95 % ellipses of the labels, poses' errors by the walk of cam01-cam03")
    print(f"  poses known to {np.degrees(errors.turn_rad):.2f} degrees and {1000 * errors.shift_m:.0f} mm")
    held = np.mean(np.concatenate([distances(*part, noise_px) for part in whole]) <= IN_95)
    print(
        f"  cam01-cam03, each by the other two: the detector's noise is {noise_px:.1f} px, {held:.1%} are inside with "
        f"it; with offsets taken for noise, so that 95 % are, it is {all_px:.1f} px"
    )
    labels, spread = labels_of(close, uv, score, noise, joints, cameras[3], errors, LENS_SIGMA)
    theirs, confident, _ = observed_by_mlkit(data, CAMERAS[3:])
    off = np.where((confident[0] > 0)[..., None], theirs[0] - labels, np.nan)
    without = (np.isfinite(labels).all(axis=-1) & ~np.isfinite(spread).all(axis=(-1, -2))).sum()
    sd = np.sqrt(np.nanmedian(np.diagonal(spread, axis1=-2, axis2=-1), axis=(0, 1)))
    print(
        f"  cam04: {np.isfinite(labels[..., 0]).sum()} labels, {without} without sigma (limit 0), sd {sd.round(1)} px"
    )
    shares = {}
    for name, px in (("as they are", 0.0), ("with that noise", noise_px), ("with offsets too", all_px)):
        hit = distances(off, spread, px) <= IN_95
        shares[px] = hit.mean()
        limit = " (limit 85-99 %)" if px == noise_px else ""
        print(f"    {name:<17} {hit.mean():.1%} of {len(hit)} confident detections inside{limit}")
    return int(without), float(shares[noise_px])


def from_boxes(data, cameras, points, joints, shrunk=1):
    """cam04, its pictures made smaller by so much, fitted to 20 boxes of its OpenPose joints, in whole pixels where it
    is shrunk, from where it stands and looking at where the person is: the true camera, the start, `Fitted`, and the
    joints that both have, pixels (100, J, 2) and their places in `joints`."""
    uv, score, theirs = detected(data, "OpenPose", CAMERAS[3:])
    # the joints that both detectors have: ML Kit has no crown and no neck, OpenPose no hands
    names = shared_names(theirs)
    other = [i for i, name in enumerate(names) if name in joints]
    own = [joints.index(names[i]) for i in other]
    seen = np.where((score[0] > 0.3)[..., None], uv[0], np.nan)[:, other] / shrunk
    drawn = np.round(seen) if shrunk > 1 else seen
    edges = np.full((FRAMES, 4), np.nan)
    edges[BOXED_FRAMES] = np.concatenate([np.nanmin(drawn, axis=1), np.nanmax(drawn, axis=1)], axis=1)[BOXED_FRAMES]
    true = replace(cameras[3], intrinsics=smaller(cameras[3].intrinsics, shrunk))
    target = np.nanmean(points, axis=(0, 1))
    start = true.at(pose(look_at(true.centre, target), true.centre))
    fitted = boxes_fit.fit(
        start,
        seen_edges.Freedom(shift=(0.2, 0.2, 0.2)),
        seen_edges.EdgeObservations(
            points[:, own], edges, np.full((FRAMES, len(own), 2), np.nan), np.arange(FRAMES) / FPS, np.zeros(FRAMES)
        ),
        "real_outdoor",
    )
    return true, start, fitted, seen, own


def smaller(lens, by):
    """The lens of pictures that are made smaller."""
    size = lens.width // by, lens.height // by
    return replace(
        lens, width=size[0], height=size[1], fx=lens.fx / by, fy=lens.fy / by, cx=(lens.cx + 0.5) / by - 0.5,
        cy=(lens.cy + 0.5) / by - 0.5,
    )  # fmt: skip


def print_unseen_from_boxes(data, cameras):
    points, _, joints = robust_points(data, cameras)
    true, start, fitted, _, _ = from_boxes(data, cameras, points, joints)
    others = np.where(np.isin(np.arange(FRAMES), BOXED_FRAMES)[:, None, None], np.nan, points)
    print("cam04 from boxes on frames 0, 5, ... 95, the other 80 (limit: mean 25, median 22)")
    for name, camera in (("reference", true), ("start: tape, look-at", start), ("from 20 boxes", fitted.camera)):
        print(f"  {name:<24}{cam04_score(others, [*cameras[:3], camera], joints)}")
    turn = Rotation.from_matrix(true.wRc.T @ fitted.camera.wRc).magnitude()
    print(
        f"  centre {1000 * np.linalg.norm(fitted.camera.centre - true.centre):.0f} mm and {np.degrees(turn):.2f} "
        f"degrees from the reference, margins {fitted.values[7]:.1f}, {fitted.values[8]:.1f} px, "
        f"edges {fitted.sd_px:.1f} px sd"
    )


def print_long_range(data, cameras):
    """cam04 as a long-range camera: its pictures shrunk, its detections at full size as the truth."""
    for tool, shrunk in product(("OpenPose", "ML Kit"), SHRUNK):
        points, _, joints = robust_points(data, cameras, tool)
        joints = shared_names(joints)
        true, start, fitted, seen, own = from_boxes(data, cameras, points, joints, shrunk)
        tall = np.nanmedian(np.nanmax(seen[..., 1], axis=1) - np.nanmin(seen[..., 1], axis=1))
        print(
            f"cam04 shrunk by {shrunk}, the person {tall:.0f} px tall, 3D by {tool}: labels against its full-size "
            "OpenPose detections, px of the small picture"
        )
        held_back = ~np.isin(np.arange(FRAMES), BOXED_FRAMES)
        for name, camera in (("reference", true), ("start: tape, look-at", start), ("from 20 boxes", fitted.camera)):
            off = np.linalg.norm(project(camera, points[:, own])[0] - seen, axis=-1)[held_back]
            off = off[np.isfinite(off)]
            print(f"  {name:<24}n {len(off)} mean {off.mean():.2f} median {np.median(off):.2f} px")


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
        done = adjustment.adjust(start, seen, priors, 15.0, 12.0, "real_outdoor")
        name = "reference extrinsics" if seed is None else f"5 cm, 2 degrees off, seed {seed}"
        before, after = np.nanmean(done.before_px), np.nanmean(done.after_px)
        print(f"  {name:<32}{before:>8.2f} -> {after:.2f} px, {done.iterations} iterations")


def print_starts(data, cameras):
    """From cameras that look at a target known within 30 cm, and from the keypoints alone."""
    uv, score, _ = stack(openpose, [data / f"openpose_single/{name}" for name in CAMERAS])
    seen = np.where((score > 0.4)[..., None], uv, np.nan)[:, 1::2].reshape(4, -1, 2)
    seen = seen[:, np.isfinite(seen).all(axis=-1).sum(axis=0) >= 3]
    found = starts.epipolar(cameras, seen)
    angles = ", ".join(f"{outcome.shift_and_turn(a, b)[1]:.1f}" for a, b in zip(cameras, found, strict=True))
    print(f"epipolar start, degrees from the reference (limit 1.3-4.4): {angles}")
    target = np.median(np.nan_to_num(triangulated(cameras, seen)), axis=0)
    ends = []
    for seed in range(20):
        random = np.random.default_rng([seed, 7])
        aim = target + 0.3 * random.uniform(-1, 1, 3)
        looking = [c.at(pose(look_at(c.centre, aim), c.centre), "tape") for c in cameras]
        priors = [bundle.Prior(c.centre, 0.05, c.wRc, np.radians(30.0)) for c in looking]
        off = [outcome.shift_and_turn(a, b)[1] for a, b in zip(cameras, looking, strict=True)]
        try:
            done = adjustment.adjust(looking, seen, priors, 15.0, 12.0, "real_outdoor")
            ends.append(np.nanmean(done.after_px))
        except DiorError as error:
            print(f"  seed {seed}: refused, {error}")
            ends.append(np.nan)
    ends = np.array(ends)
    print(
        f"look-at starts (the last {min(off):.0f}-{max(off):.0f} degrees off): {(ends <= 9).sum()} of 20 reach 9 px "
        f"(limit 15), {(ends > 10).sum()} accepted above 10 px (limit 0), {np.isnan(ends).sum()} refused; worst "
        f"{np.nanmax(ends):.2f} px"
    )


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
    print_ellipses(data, cameras)
    print_unseen_from_boxes(data, cameras)
    print_long_range(data, cameras)
    print_adjustment(data, cameras)
    print_starts(data, cameras)


if __name__ == "__main__":
    main()
