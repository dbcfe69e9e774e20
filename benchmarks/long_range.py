"""The long-range camera placed from hand boxes, 60 m away, from a start 1 degree and 2 m off: errors of its labels.

usage: python -m benchmarks.long_range [PART] [SEEDS] [FIRST]      (PART: boxes, hidden, pictures, clocks,
                                                                    yardstick or all; SEEDS: 20;
                                                                    FIRST: 0, the first of them)

Boxes are drawn around the body as it is rendered: the plain one, whose outline the fit knows to a centimetre or two,
and the dressed one, whose hair, shoes, build and bag it does not. The error of a label is that of the camera alone: the
true joints projected by the found and by the true camera, px; `u` and `v` are its mean over joints, pictures and seeds.
The 3D is that of three close cameras, `ideal` and `real` detectors. `inside` tells how often a 95 % ellipse holds the
truth: with the habit (`align.habit_px`) that this drawer has, and with the default of 0.5 px, which is too wide for one
who draws all sides alike. A habit is drawn anew for each seed, each edge further out by so many px sd in all boxes.
± is a standard error over the seeds.

`hidden`: half of the body behind a wall, in how many seeds the fit takes an edge for the wall's, and in how many it
doubts how to read the edges (`occluder_doubtful`), a false alarm where the whole body is seen; exact boxes show what is
left of the loss of half of the edges. `pictures`: silhouettes instead of boxes; `moved`: by how much the labels differ
from those of the same capture without wall or sun, in the mean; `bias`: that of all seeds together. `clocks`: the
long-range camera's part of `benchmarks.clocks_pictures`; `yardstick`: `benchmarks.yardstick`.
"""

import sys
from collections import defaultdict
from dataclasses import replace
from functools import cache, partial

import numpy as np

from benchmarks import scene
from dior.body.names import MLKIT_33, bones_of
from dior.calibrate.outline import boxes_fit, seen_edges, silhouettes
from dior.calibrate.outline.walks import SILHOUETTE_MARGIN_PX, margins
from dior.geometry import covariance
from dior.geometry.camera import Camera, Intrinsics, pose, project
from dior.geometry.disagreeing_views import DROP_FACTOR, by_dropping, usual_error
from dior.geometry.multiview import look_at_angles, rotation_x, rotation_z
from dior.reconstruct import refine, robust
from dior.reconstruct.swaps import exchange, find_exchanged
from dior.simulate import backdrop, draw
from dior.simulate import settings as levels

FRAMES, BOXES, PICTURES = 600, 30, 75
NOISE_GREY = 2.0
RANGE_M, FX = 60.0, 760.0
START_DEG, START_M = 1.0, 2.0
EDGE_SD_PX = 1.0
FEW = 10
CHI2_95 = 5.991
MOST_ERROR_PX, BRIDGED_S = 45.0, 0.2  # of the 3D, as in config.yaml
WALKS, LEVELS, FIGURES = ("across", "along"), ("ideal", "real"), ("plain", "dressed")
# standard error of what a joint of these captures is off in the mean of a walk, and a fifth more (`walks.ALIKE`)
BIAS_M = {"ideal": 0.001, "real": 0.013}


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
    close, uv, score = seen_close(made)
    limit = min(MOST_ERROR_PX, DROP_FACTOR * usual_error(close, uv, score))
    points, _, _, good = by_dropping(close, uv, score, limit, MOST_ERROR_PX)
    return made, np.where(good[..., None], points, np.nan)


def seen_close(made):
    """The close cameras and what they see, uv (3, T, J, 2) px and score (3, T, J), sides put right."""
    close, uv = made.given[:3], made.uv[:3]
    score = np.where(made.score[:3] >= 0.3, made.score[:3], 0.0)
    swapped = find_exchanged(close, uv, score, list(made.names), scene.FPS)
    return close, exchange(uv, swapped, list(made.names)), exchange(score, swapped, list(made.names))


@cache
def smoothed(level, seed, walk):
    """As `capture`, the 3D as the steps `triangulate` and `refine` make it."""
    made, _ = capture(level, seed, walk)
    close, uv, score = seen_close(made)
    noise = robust.estimated(close, uv, score, scene.FPS)
    found = robust.triangulate(close, uv, score, scene.FPS, noise.sigma)
    points = np.where((found.scaled <= MOST_ERROR_PX)[..., None], found.points, np.nan)
    time_s, share = robust.error_correlation(close, uv, score, found, scene.FPS, noise)
    spread = robust.covariance(close, points, np.where(found.used, score, 0.0) / noise.sigma, noise.own)
    return made, refine.refined(points, spread, list(made.names), scene.FPS, time_s, share, BRIDGED_S)[0]


def spread_over(count):
    """So many pictures of a walk, by their row."""
    return tuple(np.linspace(0, FRAMES - 1, count).round().astype(int).tolist())


@cache
def body(seed, rows, worn, walk=None, wall=False):
    """Boxes (F, 4) px without error of the rendered body in the pictures `rows` of a walk.

    `wall`: one that is level with the hips hides what is below.
    """
    made, _ = capture("ideal", seed, walk)
    rows, camera = list(rows), made.cameras[3]
    drawing = draw.outlines(camera, draw.figure(made.points[rows], made.height_m), made.height_m, "shirt", "S01", worn)
    hidden = None
    if wall:
        hidden = np.zeros((720, 1280, 1), bool)
        hidden[round(made.true_uv[3][rows][:, 23:25, 1].mean()) :] = True
    return draw.seen_boxes(drawing, (1280, 720), hidden)


def drawn(tight, seed, margin=1.0, sd=EDGE_SD_PX, habit=0.0):
    """Boxes (F, 4) px as somebody draws them who should draw `tight` (F, 4)."""
    outwards = margin + sd * np.random.default_rng([seed, 3]).standard_normal(tight.shape)
    outwards = outwards + habit * np.random.default_rng([seed, 5]).standard_normal(4)
    return tight + outwards * boxes_fit.OUTWARDS


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


def by_pictures(level, seed, occluder=False, sun=False):
    edges, rows = pictures(seed, occluder, sun)
    made, points = zip(*(capture(level, seed, walk) for walk in WALKS), strict=True)
    rows = np.concatenate([rows, FRAMES + rows])
    seen = observed(level, np.concatenate(points)[rows], edges, np.tile(made[0].seconds, 2)[rows % FRAMES])
    seen = replace(seen, walk=rows // FRAMES)
    freedom = seen_edges.Freedom(shift=(START_M, 0.0, 0.0), margin_px=SILHOUETTE_MARGIN_PX)
    return boxes_fit.fit(off(made[0].given[3], seed), freedom, seen, f"{level} {seed}")


def outlined(points, around="body"):
    """What edges are compared with: points (F, J, 3) m, flesh m and outline m of `seen_edges.EdgeObservations`."""
    if around == "joints":
        return points, 0.0, 0.0
    return *silhouettes.outline(points, list(MLKIT_33)), seen_edges.OUTLINE_M


def observed(level, points, edges, seconds, around="body"):
    """`seen_edges.EdgeObservations` of one walk, points (F, 33, 3), as `align` makes them."""
    points, flesh_m, outline_m = outlined(points, around)
    nothing = np.full((*points.shape[:2], 2), np.nan)
    return seen_edges.EdgeObservations(
        points, edges, nothing, seconds, np.zeros(len(edges), int), BIAS_M[level], flesh_m, outline_m=outline_m,
        bones=bones_of(MLKIT_33 if around == "body" else []).astype(int),
    )  # fmt: skip


def fitted(level, seed, worn="plain", count=BOXES, around="body", told=None, wall=False, **how):
    """`boxes_fit.Fitted` by `count` boxes; `told`: what the config says of the drawer's habit, px."""
    made, points = capture(level, seed)
    rows = spread_over(count)
    edges = drawn(body(seed, rows, worn, wall=wall), seed, **how)
    seen = observed(level, points[list(rows)], edges, made.seconds[list(rows)], around)
    return boxes_fit.fit(off(made.given[3], seed), freedom(told), seen, f"{level} {seed}")


def freedom(told=None, **clocks):
    """`seen_edges.Freedom` as `align` has it for boxes; `told`: what the config says of the drawer's habit, px."""
    margin_px, split_px, habit_px = margins({"align": {} if told is None else {"habit_px": told}}, "boxes")
    return seen_edges.Freedom(
        shift=(START_M, 0.0, 0.0), margin_px=margin_px, margin_split_px=split_px, habit_px=habit_px, **clocks
    )


def label_errors(level, seed, fit):
    """Errors (T, J, 2) px of the camera's labels, and their covariance (T, J, 2, 2)."""
    made, _ = capture(level, seed)
    points = made.points[::60]
    error = project(fit.camera, points)[0] - made.true_uv[3][::60]
    _, by_camera = covariance.projection(fit.camera, points)
    return error, by_camera @ fit.pose_covariance @ np.swapaxes(by_camera, -1, -2)


def inside(error, spread):
    """How many of the labels have the truth in their 95 % ellipse."""
    return (np.einsum("...i,...ij,...j", error, np.linalg.inv(spread), error) < CHI2_95).mean()


DRAWERS = (
    ("30 boxes, 0 px large", {"margin": 0.0}),
    ("30 boxes, 1 px large", {}),
    ("30 boxes, 3 px large", {"margin": 3.0}),
    ("10 boxes", {"count": 10}),
    ("120 boxes", {"count": 120}),
    ("30 boxes, edges 2 px sd", {"sd": 2.0}),
    ("30 boxes, habit 0.5 px", {"habit": 0.5}),
    ("30 boxes, habit 1 px", {"habit": 1.0}),
    ("30 boxes, compared with joints", {"around": "joints"}),
)


ALSO = ("30 boxes, 1 px large", "30 boxes, habit 1 px")  # also with the habit that the config has by default


def by_boxes(seeds):
    """Print the errors of the labels for each way of drawing, by detector and body."""
    found = defaultdict(list)
    for seed in seeds:
        for level in LEVELS:
            for worn in FIGURES:
                for name, how in DRAWERS:
                    error, spread = label_errors(
                        level, seed, fitted(level, seed, worn, told=how.get("habit", 0.0), **how)
                    )
                    figures = [np.linalg.norm(error, axis=-1).mean(), *error.mean(axis=(0, 1)), inside(error, spread)]
                    default = (
                        inside(*label_errors(level, seed, fitted(level, seed, worn, **how))) if name in ALSO else np.nan
                    )
                    found[level, worn, name].append([*figures, default])
        for kept in (capture, body):
            kept.cache_clear()
    for level in LEVELS:
        for worn in FIGURES:
            print(f"{level}, {worn} body, {len(seeds)} seeds, edges 1 px sd where nothing else is said")
            print(f"  {'':<32}{'mean':>12}{'worst':>7}{'u':>14}{'v':>14}{'inside':>16}{'by default':>12}")
            for name, _ in DRAWERS:
                each = np.array(found[level, worn, name])
                mean, error = each.mean(axis=0), each.std(axis=0, ddof=1) / np.sqrt(len(each))
                text = f"  {name:<32}{mean[0]:>7.2f} ±{error[0]:.2f}{each[:, 0].max():>7.2f}"
                text += "".join(f"{mean[i]:>+9.2f} ±{error[i]:.2f}" for i in (1, 2))
                text += f"{mean[3]:>10.1%} ±{error[3]:.1%}"
                print(text + (f"{mean[4]:>12.1%}" if name in ALSO else ""), flush=True)


HEAD = "     mean  worst   inside hidden doubted   moved   bias"


def line(level, seeds, name, fit, reference=None):
    """Print the labels' errors of `fit(seed)`, whether its intervals hold them, and how far from `reference(seed)`."""
    mean, held, hidden, doubted, shift, moved = [], [], 0, 0, [], []
    for seed in seeds:
        found = fit(seed)
        error, spread = label_errors(level, seed, found)
        mean.append(np.linalg.norm(error, axis=-1).mean())
        held.append(inside(error, spread))
        hidden += bool(found.camera.occluded)
        doubted += found.ahead < boxes_fit.DOUBTFUL
        if reference:
            step = error - label_errors(level, seed, reference(seed))[0]
            moved.append(np.linalg.norm(step, axis=-1).mean())
            shift.append(step.mean(axis=(0, 1)))
    text = f"  {name:<44}{np.mean(mean):>7.2f}{np.max(mean):>7.2f}{np.mean(held):>9.1%}{hidden:>7}{doubted:>8}"
    if reference:
        text += f"{np.mean(moved):>8.2f}{np.linalg.norm(np.mean(shift, axis=0)):>8.2f}"
    print(text, flush=True)


def by_half_a_body(seeds):
    for level in LEVELS:
        print(f"{level}, {len(seeds)} seeds: boxes around half a body{'':<7}{HEAD}")
        plain, hidden = (partial(fitted, level, told=0.0, wall=wall) for wall in (False, True))
        line(level, seeds, "30 boxes, the whole body", plain)
        line(level, seeds, "30 boxes, half the body hidden", hidden, plain)
        few = {"count": FEW, "margin": 3.0}
        line(level, seeds, f"{FEW} boxes, 3 px large, the whole body", partial(plain, **few))
        line(level, seeds, f"{FEW} boxes, 3 px large, half the body hidden", partial(hidden, **few))
        exact = {"sd": 0.0, "count": 4 * BOXES}
        plain, hidden = partial(plain, **exact), partial(hidden, **exact)
        line(level, seeds, f"half the body hidden, {4 * BOXES} exact boxes", hidden, plain)


def by_silhouettes(seeds):
    for level in LEVELS:
        print(f"{level}, {len(seeds)} seeds: silhouettes in {2 * PICTURES} pictures   {HEAD}")
        plain = partial(by_pictures, level)
        line(level, seeds, "the whole body", plain)
        line(level, seeds, "half the body behind a wall", partial(by_pictures, level, occluder=True), plain)
        line(level, seeds, "a saturated sun in the picture", partial(by_pictures, level, sun=True), plain)


def of_clocks(seeds):
    from benchmarks import clocks_pictures

    clocks_pictures.long_range_table(seeds)


def of_yardsticks(seeds):
    from benchmarks import yardstick

    yardstick.table(seeds)


PARTS = {"boxes": by_boxes, "hidden": by_half_a_body, "pictures": by_silhouettes, "clocks": of_clocks,
         "yardstick": of_yardsticks}  # fmt: skip


def main():
    part, count, first = (*sys.argv[1:], *("all", "20", "0")[len(sys.argv) - 1 :])
    seeds = range(int(first), int(first) + int(count))
    for name in PARTS if part == "all" else [part]:
        PARTS[name](seeds)


if __name__ == "__main__":
    main()
