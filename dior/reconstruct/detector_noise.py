"""How far off a detector is: shares of the body's size in the picture and pixels, by joint, seen and hidden apart.

INPUTS   cameras, detections at the instants (V, T, J), their scores, the joints' names
OUTPUTS  `Noise`: sd (V, T, J) px of every detection, and what it is made of

A network knows to a share of a body where on it a joint is, however large the body is in the picture; where in the
picture that is costs pixels in addition. So the variance of a coordinate is (share x size)^2 + px^2. What the body
itself hides (`body.visibility`) is guessed, and has a share and pixels of its own. They follow from the residuals of
the sequence itself, as variance components do (Helmert; Searle, Casella and McCulloch, Variance Components, 1992):
squared residuals are a line in size^2, with the degrees of freedom that the points left over.

Residuals tell little of a single joint: an offset that a detector has learned is one measurement, however long it is
looked at. So a joint's own residuals are mixed with those of all joints, a view's with those of all views, and what is
hidden counts as what is seen until residuals say otherwise. People of one size do not tell shares from pixels: only
their sum is told then, and its parts are those of `USUAL`.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from dior.arrays import Bools, Floats, Ints
from dior.body import visibility
from dior.clocks.persistence import LASTS_S, autocorrelation
from dior.geometry.camera import Camera
from dior.geometry.rotation import cross
from dior.geometry.triangulation import Views, meet, meet_in_blocks, residuals, rig_of, views_of

# a view disagrees where the residuals are this many times what the noise makes of them; chosen: less leaves out right
# views, more believes wrong ones
DROP_FACTOR = 3.0
# of points and noise in turn, where nothing is hidden and where something is; chosen: with hidden joints as good as
# seen ones both are found to 1 % then
ROUNDS, HIDDEN_ROUNDS = 3, 6
LEAST_PX = 0.05  # no detector is better; chosen
SAMPLE = 2500  # points that the noise is estimated from: its error is then a few per cent
APART_S = 0.3  # residuals nearer in time say the same: the noise of pose networks is correlated over 0.15 s
# a joint is mixed with all joints, a view with all views, and what is hidden with what is seen, as if so many
# independent equations spoke for these; chosen: less follows chance in short walks, more makes all alike
SHRINK = 60.0
# chosen: share of the body's size and px before anything is known. ML Kit is off by 15 px of a person of 700-900 px in
# real_outdoor (design, section 9), and networks work on pictures in which a body has some 200 px
USUAL = 0.015, 2.0
# chosen: that speaks for itself as if so many equations of bodies of these sizes (px) were with it
EXPECTED_PX, EXPECTED_WORTH = np.geomspace(25.0, 800.0, 6), 2.0
STATURE_M = 1.7  # chosen: of a body whose shanks are not known (a mean adult)
LEAST_DEPTH_M = 0.5  # chosen: nobody walks nearer to a camera
# chosen: how far a pose may be off, rad and m, so far that it is told by the residuals alone
HELD = np.array([np.radians(2.0)] * 3 + [0.1] * 3)
SOME = 3  # chosen: every third joint tells how far away a body is
LEAST_FREE = 0.5  # chosen: few residuals are not believed to be the poses' alone
LOOKED_S = 0.2  # chosen: how often it is looked how large a body is and what it hides, a third of a step


@dataclass(frozen=True, eq=False)
class Noise:
    """`sigma` (V, T, J) px, in u and in v, of a detection with score 1; that of score s is 1/s of it.

    Made of `parts` (J, 2, 2): share of the body's size and px, of what is seen and of what is hidden; `size` (V, T) px
    of the body in the picture, `hidden` (V, T, J); and `of_view` (V, J), by how much a joint is worse in a view than in
    all views: its pictures may be, its lens or its pose, or one leg is always taken for the other there. `own` (V,):
    what of a view's variance is the detections' own, and not its pose's, whose error has a covariance of its own.
    """

    sigma: Floats
    parts: Floats
    size: Floats
    hidden: Bools
    of_view: Floats
    own: Floats

    def of_views(self, views: Sequence[int]) -> "Noise":
        """That of some of the views."""
        at = list(views)
        return Noise(self.sigma[at], self.parts, self.size[at], self.hidden[at], self.of_view[at], self.own[at])

    @property
    def by_size(self) -> Floats:
        """What shares of the body's size make of the variance (V, T, J); 0 where it is not known."""
        share = np.where(self.hidden, self.parts[:, 1, 0], self.parts[:, 0, 0])
        size = self.of_view[:, None] * self.size[..., None]
        return np.clip(np.nan_to_num((share * size / self.sigma) ** 2), 0.0, 1.0)


def of_parts(parts: Floats, size: Floats, hidden: Bools, of_view: Floats) -> Floats:
    """Standard deviations (V, T, J) px; arguments as in `Noise`."""
    square = of_view[:, :, None, None] ** 2 * parts**2
    share, px = square[..., 0], square[..., 1]
    size = (size**2)[..., None]
    out = size * share[:, None, :, 0] + px[:, None, :, 0]
    if hidden.any():
        out = np.where(hidden, size * share[:, None, :, 1] + px[:, None, :, 1], out)
    return np.asarray(np.sqrt(np.maximum(out, LEAST_PX**2)))


def estimated(
    cameras: Sequence[Camera], uv: Floats, score: Floats, fps: float, names: Sequence[str] | None = None
) -> Noise:
    """`Noise` of pixels uv (V, T, J, 2) with scores (V, T, J); without `names` nothing is known to be hidden.

    From a sample of the instants, of the points at which all views agree. NaN where no two views see anything.
    """
    views, joints = len(cameras), score.shape[2]
    parts, of_view = np.tile(USUAL, (joints, 2, 1)), np.ones((views, joints))
    size, hidden = bodies(cameras, uv, score, fps, names)
    rows = np.flatnonzero(((score > 0).sum(axis=0) >= 2).any(axis=1))
    every = max(1, len(rows) * joints // SAMPLE)
    rows = rows[::every]
    if not np.isfinite(size).any():
        return Noise(np.full(score.shape, np.nan), parts, size, hidden, of_view, np.ones(views))
    independent = min(1.0, every / fps / APART_S)
    said = views_of(rig_of(cameras), uv[:, rows], np.where(score > 0, score, 0.0)[:, rows])
    degrees = 2 * (said.w > 0).sum(axis=0) - 3
    at, joint = (size[:, rows], hidden[:, rows]), np.tile(np.arange(joints), len(rows))

    points, chi2 = meet(replace(said, w=said.w / of_parts(parts, *at, of_view).reshape(views, -1)))
    known = np.isfinite(chi2) & (degrees >= 1)
    # half of the points agree, whatever the others do
    count = independent * degrees[known].sum()
    ratio = np.median(chi2[known] / median_chi2(degrees[known])) if count else 1.0
    usual = np.array(USUAL) * np.sqrt((count * ratio + SHRINK) / (count + SHRINK))
    parts, own = np.tile(usual, (joints, 2, 1)), np.ones(views)
    rounds = HIDDEN_ROUNDS if hidden.any() else ROUNDS
    for turn in range(rounds):
        sigma = of_parts(parts, *at, of_view).reshape(views, -1)
        weighted = replace(said, w=said.w / sigma)
        points, chi2 = meet(weighted)
        agree = np.flatnonzero(np.isfinite(chi2) & (chi2 <= DROP_FACTOR**2 * degrees))
        if not len(agree):
            break
        left, free = residuals(weighted.at(agree), points[:, agree])
        free = np.where(weighted.w[:, agree] > 0, np.maximum(free, 0.0), 0.0)
        series = np.full((views, 2, len(joint)), np.nan)
        series[..., agree] = np.where(free[:, None] > 0, left, np.nan)
        stays = autocorrelation(series.reshape(views, 2, -1, joints), max(1, round(LASTS_S * fps / every)), axis=2)
        # a constant offset of a joint in a view is one measurement, however long it is looked at
        worth = independent / (1 + max(len(rows) * independent - 1, 0.0) * max(stays, 0.0))
        seen = Squares(
            joint[agree], np.repeat(at[0], joints, axis=1)[:, agree], at[1].reshape(views, -1)[:, agree],
            (sigma / of_view[:, joint])[:, agree] ** 2, worth * (left**2).sum(axis=1), worth * free,
        )  # fmt: skip
        if turn == rounds - 1:
            own = _own(weighted.at(agree), points[:, agree], left, seen.free, worth)
        parts = fitted(seen, usual, joints)
        beyond = seen.variance / of_parts(parts, *at, np.ones_like(of_view)).reshape(views, -1)[:, agree] ** 2
        of_view = _of_views(replace(seen, square=seen.square * of_view[:, joint[agree]] ** 2 * beyond), joints)
    return Noise(of_parts(parts, size, hidden, of_view), parts, size, hidden, of_view, own)


def _own(views: Views, points: Floats, left: Floats, free: Floats, worth: float) -> Floats:
    """What of the views' variance is left (V,) when their poses are free; arguments as of `without_poses`.

    `free` (V, N) of `Squares`, whose squares count `worth` each. The poses' unknowns take their share of it: where the
    cameras were adjusted to these detections, residuals are smaller by it, and the noise is larger than they say.
    """
    after, taken = without_poses(views, points, left)
    before, square = ((worth * (each**2).sum(axis=1)).sum(axis=1) for each in (left, after))
    scale = max(1 - taken / free.sum(), LEAST_FREE)
    return np.asarray((square + EXPECTED_WORTH) / (scale * before + EXPECTED_WORTH))


def without_poses(views: Views, points: Floats, left: Floats) -> tuple[Floats, float]:
    """Whitened residuals (V, 2, N) of points (3, N) less what other poses of the cameras explain of them, and how many
    unknowns that took.

    The poses' six unknowns each by linear least squares, the points eliminated; what moves, turns and scales the world
    as a whole explains nothing, and is held by `HELD`.
    """
    count = len(views.x)
    p = views.rig.rows[..., :3] @ points + views.rig.rows[..., 3:]
    scale, x, y = views.w / p[:, 2], p[:, 0] / p[:, 2], p[:, 1] / p[:, 2]
    by_axes = np.zeros((*scale.shape, 2, 3))  # derivative of the residual by the point in the camera's axes
    by_axes[..., 0, 0] = by_axes[..., 1, 1] = -scale
    by_axes[..., 0, 2], by_axes[..., 1, 2] = scale * x, scale * y
    J = by_axes @ views.rig.rows[:, None, :, :3]
    C = np.concatenate([-by_axes @ cross(np.moveaxis(p, 1, -1)), by_axes], axis=-1) * HELD
    r = np.moveaxis(left, 1, -1)
    # of each point: what follows the cameras when it gives way
    P = np.linalg.inv(np.einsum("vnai,vnaj->nij", J, J))
    G = P @ np.einsum("vnai,vnak->nivk", J, C).reshape(-1, 3, 6 * count)
    D = -np.einsum("vnai,nik->vnak", J, G)
    for v in range(count):
        D[v, :, :, 6 * v : 6 * v + 6] += C[v]
    D = D.reshape(-1, 6 * count)
    S = D.T @ D
    held = np.linalg.inv(S + np.eye(len(S)))
    explained = (D @ (held @ (D.T @ r.ravel()))).reshape(r.shape)
    return left - np.moveaxis(explained, -1, 1), float(np.trace(held @ S))


@dataclass(frozen=True, eq=False)
class Squares:
    """Squared residuals of N points: which `joint` (N,), and of each view (V, N) the body's `size` px, whether it is
    `hidden`, the `variance` px^2 that it was taken to have, and the `square` of its residuals over that, the sum over
    u and v, which should be `free`: of 2 equations what the point has left over."""

    joint: Ints
    size: Floats
    hidden: Bools
    variance: Floats
    square: Floats
    free: Floats


def fitted(seen: Squares, usual: Floats, joints: int) -> Floats:
    """Shares and pixels (J, 2, 2) of what is seen and of what is hidden; `usual` (2,) where little is known."""
    out = np.empty((joints, 2, 2))
    expected, worth = usual**2, EXPECTED_WORTH
    for state in range(2):
        use = (seen.hidden == bool(state)) & (seen.free > 0)
        joint = np.broadcast_to(seen.joint, use.shape)[use]
        normal, right = _equations(
            joint, seen.size[use], seen.variance[use], seen.square[use], seen.free[use], joints
        )  # fmt: skip
        each = np.full(len(EXPECTED_PX), worth / len(EXPECTED_PX))
        variance = expected[0] * EXPECTED_PX**2 + expected[1]
        beside = _equations(np.zeros(len(each), int), EXPECTED_PX, variance, each, each, 1)
        whole, told = normal.sum(axis=0) + beside[0][0], right.sum(axis=0) + beside[1][0]
        mixed = SHRINK / (seen.free[use].sum() + worth)
        out[:, state] = np.sqrt(_not_negative(normal + mixed * whole, right + mixed * told))
        expected, worth = np.maximum(_not_negative(whole[None], told[None])[0], [0.0, LEAST_PX**2]), SHRINK
    return out


def _of_views(seen: Squares, joints: int) -> Floats:
    """By how much a joint is worse in a view than in all views, (V, J): `square` is what the parts leave over."""
    square, free = (
        np.stack([np.bincount(seen.joint, own, joints) for own in each]) for each in (seen.square, seen.free)
    )
    whole = square.sum() / free.sum()
    of_view = (square.sum(axis=1) + EXPECTED_WORTH * whole) / (free.sum(axis=1) + EXPECTED_WORTH)
    out = (square + SHRINK * of_view[:, None]) / (free + SHRINK)
    return np.asarray(np.sqrt(out / np.average(out, weights=free)))


def _equations(
    joint: Ints, size: Floats, variance: Floats, square: Floats, free: Floats, joints: int
) -> tuple[Floats, Floats]:
    """Normal equations (J, 2, 2) and right sides (J, 2) of share^2 and px^2.

    `square` x `variance` = `free` x (share^2 size^2 + px^2), and the left side has the variance 2 free variance^2.
    """
    s2 = size**2
    a, b, c = (np.bincount(joint, free * x / variance**2, joints) for x in (s2 * s2, s2, np.ones_like(s2)))
    right = np.stack([np.bincount(joint, square * x / variance, joints) for x in (s2, np.ones_like(s2))], axis=-1)
    return np.stack([a, b, b, c], axis=-1).reshape(joints, 2, 2).astype(float), right.astype(float)


def _not_negative(normal: Floats, right: Floats) -> Floats:
    """Least squares solutions (J, 2) without negative numbers."""
    both = np.linalg.solve(normal, right[..., None])[..., 0]
    alone = right / np.diagonal(normal, axis1=-2, axis2=-1)
    out = np.where(both[:, [0]] < 0, alone * [0, 1], both)
    return np.asarray(np.where(both[:, [1]] < 0, alone * [1, 0], out))


def bodies(
    cameras: Sequence[Camera], uv: Floats, score: Floats, fps: float, names: Sequence[str] | None = None
) -> tuple[Floats, Bools]:
    """How tall the body is in the pictures (V, T) px, and what it hides of itself (V, T, J).

    Its stature at the depth of the median joint, of some of them without `names`. Looked at every `LOOKED_S`; between,
    sizes are interpolated, and what is hidden is as at the nearest look. NaN where the body is nowhere.
    """
    views, count, joints = score.shape
    every = max(1, round(LOOKED_S * fps))
    rows = np.arange(0, count, every)
    some = slice(None, None, 1 if names else SOME)
    rig = rig_of(cameras)
    points, _ = meet_in_blocks(views_of(rig, uv[:, rows, some], score[:, rows, some]))
    points = (points.T + rig.origin).reshape(len(rows), -1, 3)
    there = np.any(np.isfinite(points).all(axis=-1), axis=1)
    size, hidden = np.full((views, count), np.nan), np.zeros(score.shape, bool)
    if not there.any():
        return size, hidden
    middle = np.nanmedian(points[there], axis=1)
    stature = np.nan if names is None else visibility.stature_of(visibility.body_points(points, names))
    stature = stature if np.isfinite(stature) else STATURE_M
    nearest = np.minimum(np.round(np.arange(count) / every).astype(int), len(rows) - 1)
    for view, camera in enumerate(cameras):
        depth = np.maximum((middle - camera.centre) @ camera.wRc[:, 2], LEAST_DEPTH_M)
        size[view] = np.interp(np.arange(count), rows[there], camera.intrinsics.fx * stature / depth)
        if names is not None:
            hidden[view] = visibility.hidden(camera, points, names)[nearest]
    return size, hidden


def median_chi2(degrees: Floats | Ints | int) -> Floats:
    """Median of chi squared (Wilson and Hilferty 1931), good to 1 % from one degree on."""
    degrees = np.asarray(degrees)
    return np.asarray(degrees * (1 - 2 / (9 * degrees)) ** 3)
