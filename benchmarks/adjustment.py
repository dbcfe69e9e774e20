"""Adjustment of close cameras from a tape, with metric facts: time, scale, 3D error, and whether the sigmas are true.

usage: python -m benchmarks.adjustment [part ...]      (parts: time facts starts sigmas; all by default)

Scene: benchmarks/scene.py, 400 frames x 33 joints x 3 cameras. Tape positions are off by 10 cm (1 sigma), drawn per
seed, the aim by 2 degrees. `ideal` and `real` detectors. Limits in brackets.
"""

import sys
import time

import numpy as np

from benchmarks import scene
from dior.body.names import MLKIT_33
from dior.calibrate.bundle import adjustment, bundle, facts, uncertainty
from dior.errors import DiorError
from dior.geometry.camera import pose, project
from dior.geometry.multiview import similarity
from dior.geometry.triangulation import triangulated

TAPE_M, AIM_DEG = 0.10, 2.0
SEEDS, CAPTURES, SHORT = 20, 40, 120
HUBER_PX, MOST_PX = 15.0, 20.0
KNEE, LONG = ("left_hip", "left_knee"), ("nose", "left_ankle")
MIN_SCORE, HEIGHT_SIGMA_M = 0.5, 0.01
CORNER_SIGMA_PX = 0.3


def placed(cameras, seed, metres=TAPE_M, degrees=AIM_DEG, exactly=False):
    """Cameras off by a tape of sigma `metres` and turned by `degrees` about any axis; `exactly`: by that distance."""
    from scipy.spatial.transform import Rotation

    out = []
    for i, camera in enumerate(cameras):
        random = np.random.default_rng([seed, i])
        step, axis = random.normal(size=(2, 3))
        step *= metres / np.linalg.norm(step) if exactly else metres
        turn = Rotation.from_rotvec(np.radians(degrees) * axis / np.linalg.norm(axis)).as_matrix()
        out.append(camera.at(pose(camera.wRc @ turn, camera.centre + step), "tape"))
    return out


def priors(cameras, sigma_m=TAPE_M):
    return [bundle.Prior(c.centre, sigma_m, c.wRc, np.radians(30)) for c in cameras]


def observed(made):
    """Pixels (V, N, 2) with a score, and the tracks of the points."""
    uv = np.where((made.score > MIN_SCORE)[..., None], made.uv, np.nan) if made.score.max() > 0 else made.uv
    count, joints = made.points.shape[:2]
    moment, joint = (grid.ravel() for grid in np.mgrid[:count, :joints])
    return uv.reshape(len(uv), -1, 2), uncertainty.Tracks(joint, moment, 0 * moment, MLKIT_33)


def run(made, seed, known=(), marked=None, start=None, prior=None):
    uv, tracks = observed(made)
    start = start or placed(made.given, seed)
    where, sigma = f"seed {seed}", lens_sigma(made)
    prior = prior or priors(start)
    return adjustment.adjust(start, uv, prior, HUBER_PX, MOST_PX, where, tracks, known, marked, sigma)


def adjusted_or_told(made, seed, known, marked):
    """`run`, or None where it is refused, which is printed."""
    try:
        return run(made, seed, known, marked)
    except DiorError as error:
        print(f"  refused: {error}")
        return None


def lens_sigma(made):
    """What is known of the intrinsics: exact at `ideal`, 0.3 % wrong at `real`."""
    exact = all(true.intrinsics == given.intrinsics for true, given in zip(made.cameras, made.given, strict=True))
    return 0.0 if exact else adjustment.LENS_SIGMA


def errors(done, made):
    """Scale - 1, mean 3D error (m) after rigid alignment without scaling, and as is."""
    truth = made.points.reshape(-1, 3)
    s, _, _ = similarity(truth, done.points)
    _, R, t = similarity(done.points, truth, scale=False)
    rigid = np.linalg.norm(done.points @ R.T + t - truth, axis=1)
    return s - 1, np.nanmean(rigid), np.nanmean(np.linalg.norm(done.points - truth, axis=1))


def keypoint(made, random, joints=LONG, sigma=0.01):
    """The mean distance of two joints over the window; 1 cm of a thigh is 2.3 %, of nose to ankle 0.7 %."""
    a, b = (made.points[:, MLKIT_33.index(name)] for name in joints)
    return facts.KeypointDistance(joints, np.linalg.norm(a - b, axis=1).mean() + random.normal(0, sigma), sigma)


def height(made, random):
    return facts.Stature(made.height_m + random.normal(0, HEIGHT_SIGMA_M), HEIGHT_SIGMA_M)


def bar(made, random, places=8, sigma_px=0.7):
    """A 1 m bar (known to 2 mm), its ends marked at several places in the pictures of all cameras."""
    middle = random.uniform((-0.8, -0.8, 0.3), (0.8, 0.8, 1.6), (places, 3))
    along = random.normal(size=(places, 3))
    along /= np.linalg.norm(along, axis=1)[:, None]
    ends = np.stack([middle - along / 2, middle + along / 2], axis=1).reshape(-1, 3)
    uv = np.stack([project(c, ends)[0] for c in made.cameras]) + random.normal(
        0, sigma_px, (len(made.cameras), 2 * places, 2)
    )
    marked = facts.Marked(uv, ("end_a", "end_b") * places, tuple(np.repeat(range(places), 2).tolist()), sigma_px)
    return facts.ScaleBar((("end_a", "end_b"),), 1.0 + random.normal(0, 0.002), 0.002), marked


def tag(made, random, world, sigma_px=CORNER_SIGMA_PX):
    seen = {c.name: project(c, world)[0] + random.normal(0, sigma_px, (4, 2)) for c in made.cameras}
    return facts.Tag(world, seen, sigma_px)


def upright(size=0.4):
    """Corners of a tag that stands at the origin and faces +x."""
    half = size / 2
    return np.array([[0, -half, size], [0, half, size], [0, half, 0], [0, -half, 0.0]]) + (0, 0, 0.1)


def flat(size=1.0):
    half = size / 2
    return np.array([[-half, half, 0], [half, half, 0], [half, -half, 0], [-half, -half, 0.0]])


def print_time(level):
    made = scene.make(level, 0)
    random = np.random.default_rng(0)
    known = [keypoint(made, random)]
    uv, _ = observed(made)
    took, plain = [], []
    for seed in range(5):
        begun = time.perf_counter()
        run(made, seed, known)
        took.append(time.perf_counter() - begun)
        start = placed(made.given, seed)
        begun = time.perf_counter()
        points = triangulated(start, uv)
        good = np.isfinite(points).all(axis=1)
        bundle.optimise(*bundle.build(start, uv[:, good], points[good], priors(start), [4.25] * 3), "plain")
        plain.append(time.perf_counter() - begun)
    ratio = np.median(np.array(took) / plain)
    print(
        f"  an adjustment {np.median(took):.2f} s (2), {ratio:.2f} of GTSAM's LM with Huber and no facts in the same "
        f"run ({np.median(plain):.2f} s)"
    )


def print_facts(level):
    around = [scene.camera(f"cam{i + 1:02d}", azimuth) for i, azimuth in enumerate((-60.0, 0.0, 60.0))]
    kinds = {
        "tape 10 cm only": lambda m, r: ([], None),
        "nose to ankle +-1 cm (0.7 %, 21 mm rigid)": lambda m, r: ([keypoint(m, r)], None),
        "hip to knee +-1 cm": lambda m, r: ([keypoint(m, r, KNEE)], None),
        "stature +-1 cm only": lambda m, r: ([height(m, r)], None),
        "scale bar 1 m +-2 mm (0.3 %)": lambda m, r: (lambda b: ([b[0]], b[1]))(bar(m, r)),
        "1 m tag on the floor (25 mm as is)": lambda m, r: ([tag(m, r, flat())], None),
        "40 cm tag upright, cameras 0, +-60 (25 mm as is)": lambda m, r: ([tag(m, r, upright())], None),
    }
    print(f"  {'facts':<52}{'rms scale %':>12}{'sigma %':>9}{'in 95 %':>9}{'rigid mm':>10}{'as is mm':>10}")
    for name, make in kinds.items():
        rows = []
        for seed in range(SEEDS):
            made = scene.make(level, seed, cameras=around if "upright" in name else None)
            known, marked = make(made, np.random.default_rng([seed, 99]))
            done = adjusted_or_told(made, seed, known, marked)
            if done is None:
                continue
            sigma = scale_sigma(done)
            rows.append((*errors(done, made), sigma))
        scale, rigid, as_is, sigma = np.array(rows).T
        inside = (np.abs(scale) < 1.96 * sigma).mean()
        print(
            f"  {name:<52}{100 * np.sqrt(np.mean(scale**2)):>12.2f}{100 * sigma.mean():>9.2f}{inside:>9.0%}"
            f"{1000 * rigid.mean():>10.1f}{1000 * as_is.mean():>10.1f}"
        )


def scale_sigma(done):
    """1 sigma of the scale, from the cameras' covariance."""
    return uncertainty.scale_sigma(done.cameras, done.uncertainty.covariance)


def camera_errors(done, made):
    """(6V,) errors of the cameras by `dior.geometry.covariance`'s definition: what moves the adjusted to the true ones.

    A turn of the whole world by 1 degree moves a camera by 0.8 mm more than its first order says, as much as the
    cameras are uncertain among themselves with white noise. So what a rigid motion and scale of the world do is taken
    to first order, what remains is measured after that motion.
    """
    s, R, t = similarity(done.points, made.points.reshape(-1, 3))
    aligned = [c.at(pose(R @ c.wRc, s * R @ c.centre + t)) for c in done.cameras]
    G = uncertainty.gauge(done.cameras)
    along = G @ np.linalg.pinv(G)
    return along @ between(done.cameras, made) + (np.eye(len(G)) - along) @ between(aligned, made)


def between(cameras, made):
    from scipy.spatial.transform import Rotation

    out = []
    for found, true in zip(cameras, made.cameras, strict=True):
        out += [Rotation.from_matrix(found.wRc.T @ true.wRc).as_rotvec(), true.centre - found.centre]
    return np.concatenate(out)


def print_sigmas(level):
    kinds = {
        "nose to ankle": lambda m, r: ([keypoint(m, r)], None),
        "scale bar": lambda m, r: (lambda b: ([b[0]], b[1]))(bar(m, r)),
        "1 m floor tag": lambda m, r: ([tag(m, r, flat())], None),
    }
    print(
        f"  {'rms of error/sigma':<20}{'mahalanobis/18':>15}{'turn x y z':>20}{'shift x y z':>20}{'probe':>8}"
        f"{'shape':>8}{'scale':>8}{'bias mm':>9}{'correlation':>12}"
    )
    found = {name: [] for name in kinds}
    for seed in range(100, 100 + CAPTURES):
        made = scene.make(level, seed, frames=SHORT)
        for name, make in kinds.items():
            known, marked = make(made, np.random.default_rng([seed, 99]))
            done = adjusted_or_told(made, seed, known, marked)
            if done is None:
                continue
            e, C = camera_errors(done, made), done.uncertainty.covariance
            each = e / np.sqrt(np.diag(C))
            found[name].append(
                (
                    e @ np.linalg.solve(C, e) / len(e), each.reshape(-1, 6), probed(done, e, C), shaped(done, e, C),
                    errors(done, made)[0] / scale_sigma(done), 1000 * done.uncertainty.bias_m,
                    done.uncertainty.autocorrelation_time,
                )
            )  # fmt: skip
    for name, rows in found.items():
        normal, each, probe, shape, scale, bias, correlated = zip(*rows, strict=True)
        rms = np.sqrt(np.mean(np.square(each), axis=(0, 1)))
        turn, shift = (" ".join(f"{x:.2f}" for x in part) for part in (rms[:3], rms[3:]))
        probe, shape, scale = (np.sqrt(np.mean(np.square(part))) for part in (probe, shape, scale))
        print(
            f"  {name:<20}{np.mean(normal):>15.2f}{turn:>20}{shift:>20}{probe:>8.2f}{shape:>8.2f}{scale:>8.2f}"
            f"{np.mean(bias):>9.1f}{np.mean(correlated):>12.1f}"
        )


def probed(done, e, C):
    """Normalised errors of points of the walkway, as far as the cameras make them."""
    from dior.geometry import covariance

    points = np.array([(-1, 0, 0.1), (-1, 0, 1.6), (0, 0, 1.0), (1, 0, 0.1), (1, 0, 1.6)], float)
    say = np.broadcast_to(np.eye(2), (len(done.cameras), len(points), 2, 2))
    _, by_cameras = covariance.triangulated(done.cameras, points, say)
    return ((by_cameras @ e) / np.sqrt(np.einsum("nac,cd,nad->na", by_cameras, C, by_cameras))).ravel()


def shaped(done, e, C):
    """Normalised errors in the plane of the gauge's complement: what no rigid motion and scale of the world can do."""
    from scipy.linalg import null_space

    free = null_space(uncertainty.gauge(done.cameras).T)
    L = np.linalg.eigh(free.T @ C @ free)
    return (L.eigenvectors.T @ free.T @ e) / np.sqrt(L.eigenvalues)


def print_starts(level):
    made = scene.make(level, 0)
    uv, _ = observed(made)
    ends, refused = [], []
    for seed in range(SEEDS):
        start = placed(made.given, 1000 + seed, 0.3, 10.0, exactly=True)
        try:
            done = run(made, seed, start=start, prior=priors(start, 0.3))
        except DiorError as error:
            refused.append(str(error))
            continue
        ends.append((np.nanmean(done.after_px), errors(done, made)[1]))
    px, rigid = np.array(ends).T
    best = px.min()
    right = (px < 1.02 * best).sum()
    print(
        f"  {SEEDS} starts 30 cm and 10 degrees off: {right} end at the best {best:.2f} px (15), {len(px) - right} "
        f"wrong ones accepted (0), {len(refused)} refused; 3D rigid {1000 * rigid.mean():.1f} mm"
    )
    for text in refused:
        print(f"  {text}")


PARTS = {"time": print_time, "facts": print_facts, "starts": print_starts, "sigmas": print_sigmas}


def main():
    wanted = sys.argv[1:] or list(PARTS)
    for part in wanted:
        for level in ("ideal", "real"):
            print(
                f"{part}, {level}, seeds 0-{SEEDS - 1}" if part != "sigmas" else f"{part}, {level}, {CAPTURES} captures"
            )
            PARTS[part](level)


if __name__ == "__main__":
    main()
