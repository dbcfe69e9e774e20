"""The long-range camera placed from 30 hand boxes, 60 m away, from a start 1 degree and 2 m off: errors of its labels.

usage: python -m benchmarks.long_range [SEEDS]      (SEEDS: 20)

The error of a label is that of the camera alone: the true joints projected by the found and by the true camera. The 3D
that the boxes are fitted to is the true one or that of three close cameras, `ideal` and `real` detectors. An edge of a
box has an error of 1 px sd. `error/s` and `inside` tell whether the stated intervals are honest: the rms over the seeds
of a label's error in units of its sigma, and how often a 95 % ellipse holds the truth. `hidden`: in how many the fit
takes an edge for an occluder's. `moved`: by how much the labels differ from those of the same capture without occluder
or sun, in the mean; `bias`: that of all seeds together. Half of the edges of 30 boxes are gone with an occluder, which
costs precision; exact boxes and silhouettes show what is left of that.
"""

import sys
from functools import cache, partial

import numpy as np

from benchmarks import scene
from dior.calibrate.outline import boxes_fit, seen_edges, silhouettes
from dior.calibrate.outline.walks import SILHOUETTE_MARGIN_PX
from dior.geometry import covariance
from dior.geometry.camera import Camera, Intrinsics, in_frame, pose, project
from dior.geometry.disagreeing_views import DROP_FACTOR, by_dropping, usual_error
from dior.geometry.multiview import look_at_angles, rotation_x, rotation_z
from dior.reconstruct.swaps import exchange, find_exchanged
from dior.simulate import backdrop, draw
from dior.simulate import settings as levels

FRAMES, BOXES, PICTURES = 600, 30, 75
NOISE_GREY = 2.0
RANGE_M, FX = 60.0, 760.0
START_DEG, START_M = 1.0, 2.0
EDGE_SD_PX = 1.0
CHI2_95 = 5.991
WALKS = ("across", "along")


def long_range(seed):
    """A true camera: it misses the middle of the walkway by half a degree, and is tilted a little."""
    random = np.random.default_rng([seed, 1])
    centre = np.array([0.0, RANGE_M, 1.9])
    azimuth, elevation = look_at_angles(centre, (0, 0, 1)) + np.radians(0.5) * random.standard_normal(2)
    wRc = rotation_z(azimuth) @ rotation_x(elevation) @ rotation_z(np.radians(0.3) * random.standard_normal())
    return Camera("cam04", Intrinsics(1280, 720, FX, FX, 639.5, 359.5), pose(wRc, centre), "long_range")


def off(camera, seed):
    """A start: the range 2 m off and the aim 1 degree, in a random direction; upright."""
    random = np.random.default_rng([seed, 2])
    forward = camera.wRc[:, 2]
    azimuth, elevation = look_at_angles(camera.centre, camera.centre + forward)
    angle = random.uniform(0, 2 * np.pi)
    azimuth += np.radians(START_DEG) * np.cos(angle)
    elevation += np.radians(START_DEG) * np.sin(angle)
    centre = camera.centre + START_M * random.choice([-1, 1]) * np.array([0.0, 1.0, 0.0])
    return camera.at(pose(rotation_z(azimuth) @ rotation_x(elevation), centre))


@cache
def capture(level, seed, walk=None):
    """The walk, the given long-range camera, its true pixels and the 3D of the close cameras (T, J, 3)."""
    walk = walk or WALKS[seed % 2]
    around = [scene.camera(f"cam{i + 1:02d}", azimuth) for i, azimuth in enumerate(scene.AZIMUTHS)]
    made = scene.make(level, seed, FRAMES, [*around, long_range(seed)], walk)
    close, uv = made.given[:3], made.uv[:3]
    score = np.where(made.score[:3] >= 0.3, made.score[:3], 0.0)
    swapped = find_exchanged(close, uv, score, list(made.names), scene.FPS)
    uv, score = exchange(uv, swapped, list(made.names)), exchange(score, swapped, list(made.names))
    limit = min(45.0, DROP_FACTOR * usual_error(close, uv, score))
    points, _, _, good = by_dropping(close, uv, score, limit, 45.0)
    return made, np.where(good[..., None], points, np.nan)


def boxes(uv, shown, margin, seed, sd=EDGE_SD_PX):
    """Boxes (F, 4) px drawn around joints uv (F, J, 2) that are `shown` (F, J)."""
    random = np.random.default_rng([seed, 3])
    low = np.where(shown[..., None], uv, np.inf).min(axis=1)
    high = np.where(shown[..., None], uv, -np.inf).max(axis=1)
    tight = np.concatenate([low, high], axis=1)
    outwards = margin + sd * random.standard_normal(tight.shape)
    return np.where(np.isfinite(tight), tight + outwards * boxes_fit.OUTWARDS, np.nan)


@cache
def pictures(seed, occluder, sun):
    """Edges (F, 4) px of the silhouettes in rendered and compressed pictures of both walks, and their rows."""
    import cv2

    drawn = levels.from_dict({"seed": seed, "occluder": occluder, "sun": sun})
    random = np.random.default_rng([seed, 4])
    rows = np.linspace(0, FRAMES - 1, PICTURES).round().astype(int)
    made = [capture("ideal", seed, walk)[0] for walk in WALKS]
    both = np.concatenate([m.true_uv[3] for m in made])
    u0, v0, u1, v1 = silhouettes.window(both, (1280, 720), 60)
    camera = made[0].cameras[3]
    empty = backdrop.background(drawn, camera, "outdoor")
    wall = backdrop.in_front(drawn, camera, "outdoor")
    pieces = []
    for m in made:
        outlines = draw.outlines(camera, draw.figure(m.points[rows], m.height_m), m.height_m, "shirt", "S01")
        for i in range(PICTURES):
            picture = empty.copy()
            draw.paint(picture, outlines, i)
            piece = picture[v0:v1, u0:u1]
            if wall is not None:
                piece = np.where(wall[v0:v1, u0:u1], empty[v0:v1, u0:u1], piece)
            piece = piece + NOISE_GREY * random.standard_normal((v1 - v0, u1 - u0, 1))
            jpeg = cv2.imencode(".jpg", np.clip(piece, 0, 255).astype(np.uint8), [cv2.IMWRITE_JPEG_QUALITY, 85])[1]
            pieces.append(cv2.imdecode(jpeg, cv2.IMREAD_COLOR))
    tall = np.median(np.ptp(both[..., 1], axis=1))
    edges = silhouettes.edges(pieces, tall, silhouettes.empty_scene(pieces[::2]))
    return edges + np.array([u0, v0, u0, v0]), rows


def by_pictures(level, seed, true_3d=False, occluder=False, sun=False):
    edges, rows = pictures(seed, occluder, sun)
    made, points = zip(*(capture(level, seed, walk) for walk in WALKS), strict=True)
    points = np.concatenate([m.points if true_3d else p for m, p in zip(made, points, strict=True)])
    names = list(made[0].names)
    points = np.concatenate([points, silhouettes.crown(points, names)[:, None]], axis=1)
    flesh = silhouettes.flesh([*names, "crown"], np.nanmedian(points[:, -1, 2]))
    rows = np.concatenate([rows, FRAMES + rows])
    nothing = np.full((len(rows), points.shape[1], 2), np.nan)
    seconds = np.tile(made[0].seconds, 2)[rows]
    seen = seen_edges.EdgeObservations(points[rows], edges, nothing, seconds, rows // FRAMES, flesh_m=flesh)
    freedom = seen_edges.Freedom(shift=(START_M, 0.0, 0.0), margin_px=SILHOUETTE_MARGIN_PX)
    return boxes_fit.fit(off(made[0].given[3], seed), freedom, seen, f"{level} {seed}")


def fitted(level, seed, margin, true_3d, occluder=False, count=BOXES, sd=EDGE_SD_PX):
    made, points = capture(level, seed)
    points = made.points if true_3d else points
    frames = np.linspace(0, FRAMES - 1, count).round().astype(int)
    uv = made.true_uv[3][frames]
    shown = in_frame(made.cameras[3].intrinsics, uv)
    if occluder:
        # a wall that is level with the hips in the picture
        hips = uv[:, 23:25, 1].mean()
        shown = shown & (uv[..., 1] < hips)
    drawn = boxes(uv, shown, margin, seed, sd)
    if occluder:
        random = np.random.default_rng([seed, 3])
        drawn[:, 3] = hips + margin + sd * random.standard_normal(drawn.shape)[:, 3]
    seen = seen_edges.EdgeObservations(
        points[frames], drawn, np.full((count, 33, 2), np.nan), made.seconds[frames], np.zeros(count, int)
    )
    freedom = seen_edges.Freedom(shift=(START_M, 0.0, 0.0))
    return boxes_fit.fit(off(made.given[3], seed), freedom, seen, f"{level} {seed}")


def label_errors(level, seed, fit):
    """Errors (T, J, 2) px of the camera's labels, and their covariance (T, J, 2, 2)."""
    made, _ = capture(level, seed)
    points = made.points[::60]
    error = project(fit.camera, points)[0] - made.true_uv[3][::60]
    _, by_camera = covariance.projection(fit.camera, points)
    return error, by_camera @ fit.pose_covariance @ np.swapaxes(by_camera, -1, -2)


def line(level, seeds, name, fit, reference=None):
    """Print the labels' errors of `fit(seed)`, whether its intervals hold them, and how far from `reference(seed)`."""
    mean, chi2, hidden, shift, moved = [], [], 0, [], []
    for seed in range(seeds):
        found = fit(seed)
        error, spread = label_errors(level, seed, found)
        mean.append(np.linalg.norm(error, axis=-1).mean())
        chi2.append(np.einsum("...i,...ij,...j", error, np.linalg.inv(spread), error).ravel())
        hidden += bool(found.hidden)
        if reference:
            step = error - label_errors(level, seed, reference(seed))[0]
            moved.append(np.linalg.norm(step, axis=-1).mean())
            shift.append(step.mean(axis=(0, 1)))
    chi2 = np.concatenate(chi2)
    text = f"  {name:<44}{np.mean(mean):>7.2f}{np.max(mean):>7.2f}{np.sqrt(chi2.mean() / 2):>10.2f}"
    text += f"{(chi2 < CHI2_95).mean():>8.1%}{hidden:>7}"
    if reference:
        text += f"{np.mean(moved):>8.2f}{np.linalg.norm(np.mean(shift, axis=0)):>8.2f}"
    print(text, flush=True)


def main():
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    for level in ("ideal", "real"):
        print(f"{level}, {seeds} seeds: errors of labels, px")
        print(f"  {BOXES} boxes, edges 1 px sd{'':<22}   mean  worst error/s  inside hidden   moved   bias")
        for true_3d in (True, False):
            whose = "true 3D" if true_3d else "three close cameras"
            for margin in (0.0, 1.0) if true_3d else (0.0, 1.0, 3.0):
                line(level, seeds, f"{whose}, drawn {margin:g} px large", _drawn(level, margin, true_3d))
            plain, hidden = _drawn(level, 0.0, true_3d), _drawn(level, 0.0, true_3d, occluder=True)
            line(level, seeds, f"{whose}, half the body hidden", hidden, plain)
            exact = {"sd": 0.0, "count": 4 * BOXES}
            plain, hidden = (_drawn(level, 0.0, true_3d, occluder=o, **exact) for o in (False, True))
            line(level, seeds, f"{whose}, hidden, {4 * BOXES} exact boxes", hidden, plain)
        print(f"  silhouettes in {2 * PICTURES} pictures of two walks")
        plain = partial(by_pictures, level)
        line(level, seeds, "the whole body", plain)
        line(level, seeds, "half the body behind a wall", partial(by_pictures, level, occluder=True), plain)
        line(level, seeds, "a saturated sun in the picture", partial(by_pictures, level, sun=True), plain)


def _drawn(level, margin, true_3d, **how):
    return partial(fitted, level, margin=margin, true_3d=true_3d, **how)


if __name__ == "__main__":
    main()
