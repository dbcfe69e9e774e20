"""How well poses are known that somebody else found: by how far the walk would move them.

INPUTS   cameras as given, the joints that they see (`window.Recorded`), intrinsics' sigmas
OUTPUTS  standard errors of a turn (rad, each axis) and a shift (m, each axis), the same for every camera

The cameras of a calibration are taken for equally good, each off by a turn and a shift of its own. A small adjustment
around the given poses (`reduced`, with priors that hold only what the pixels do not tell) says by how much they
disagree with the joints, and how much of that is the detector's doing (`uncertainty`, with its constant errors). The
two standard errors follow by likelihood from the directions that the pixels know: what moves, turns and scales the
world as a whole shows in no pixel, and moves no label. Few cameras and a short walk leave them uncertain, so that what
calibrations are usually good to counts as well, and their mean over what is likely is taken, not the likeliest, which
may be zero (Gelman et al., Bayesian Data Analysis, 3rd ed., section 5.4).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dior.arrays import Floats
from dior.body.proportions import SIDES
from dior.calibrate.bundle import bundle, facts, in_adjustment, reduced, uncertainty
from dior.geometry import disagreeing_views
from dior.geometry.camera import REFERENCE_FX, Camera
from dior.geometry.rotation import rotvec
from dior.geometry.triangulation import triangulated

# chosen: what holds the cameras beside the pixels while they are adjusted; larger errors than these are no calibration
HELD_M, HELD_RAD = 0.1, np.radians(2.0)
# chosen: how well a calibration by boards or wands is known before anything is seen, 0.1 degrees and 5 mm, or five
# times less or more; it decides where a short walk tells little
USUAL_RAD, USUAL_M, TIMES = np.radians(0.1), 0.005, 5.0
# chosen: what is tried, from below what anybody reaches to what holds
TURNS = np.radians(np.geomspace(0.003, 3.0, 31))
SHIFTS = np.geomspace(0.0005, 0.3, 29)
# chosen: a direction of which the pixels tell less than a tenth of what holds it says nothing about the variances
LEAST_KNOWN = 10.0
# chosen: joints that take part; a calibration of which fewer are seen is not judged
FEWEST_JOINTS = 100
# the joints of a face, a hand or a foot err together: one of each has a say. On the real recording of one person the
# variances are alike then, whichever cameras and detector they are found from, and with all joints they are not
# (`python -m benchmarks.real_outdoor`)
APART = ("nose",) + tuple(
    f"{side}_{part}" for side in SIDES for part in ("shoulder", "elbow", "wrist", "hip", "knee", "ankle", "foot_index")
)
# chosen: turns of clocks and pixels, where clocks are not given
CLOCK_TURNS = 3


@dataclass(frozen=True)
class PoseErrors:
    """Standard errors of a camera's turn `turn_rad` and shift `shift_m` about and along each axis."""

    turn_rad: float
    shift_m: float

    def covariance(self) -> Floats:
        """(6, 6) of one camera's error (`dior.geometry.covariance`)."""
        return np.diag([self.turn_rad**2] * 3 + [self.shift_m**2] * 3)


def of(
    cameras: Sequence[Camera], timed: in_adjustment.Sequences, huber_px: float, lens_sigma: Floats
) -> PoseErrors | None:
    """`PoseErrors` of given poses; None where too few joints are seen. `huber_px` at fx 1680, `lens_sigma` (V,)."""
    values = timed.at_middle(timed.given)
    if not timed.held.all():
        views = len(cameras)
        values = timed.start(cameras, np.full(views, HELD_RAD), np.full(views, HELD_M))
        for _ in range(CLOCK_TURNS):
            values, _ = timed.fitted(cameras, values)
    uv, tracks, _ = timed.observations(values)
    kept = np.where(disagreeing_views.agreeing(cameras, uv)[..., None], uv, np.nan)
    points = triangulated(cameras, kept)
    own = np.array([name in APART for name in tracks.names])
    known = own[tracks.joint] if own.any() else np.ones(len(tracks.joint), bool)
    known &= np.isfinite(points).all(axis=1) & (np.isfinite(kept).all(axis=-1).sum(axis=0) >= 2)
    if known.sum() < FEWEST_JOINTS:
        return None
    kept, points, tracks = kept[:, known], points[known], tracks.only(known)
    focal = np.array([c.intrinsics.fx for c in cameras])
    each = np.broadcast_to((huber_px * focal / REFERENCE_FX / bundle.HUBER)[:, None], kept.shape[:2])
    ideal = np.stack([bundle.ideal_pixels(c.intrinsics, seen) for c, seen in zip(cameras, kept, strict=True)])
    held = [facts.placed(view, bundle.Prior(c.centre, HELD_M, c.wRc, HELD_RAD)) for view, c in enumerate(cameras)]
    solved = reduced.solve(cameras, reduced.Observed(ideal, each, len(points)), points, held)
    spread = uncertainty.of(solved, tracks, lens_sigma)
    return variances(moves(cameras, solved.cameras), solved.normal, spread.covariance)


def moves(before: Sequence[Camera], after: Sequence[Camera]) -> Floats:
    """(6V,) by what turn (rad, about its own axes) and shift (m) each camera has moved."""
    turns = [rotvec(a.wRc.T @ b.wRc) for a, b in zip(before, after, strict=True)]
    shifts = [b.centre - a.centre for a, b in zip(before, after, strict=True)]
    return np.concatenate([np.concatenate(pair) for pair in zip(turns, shifts, strict=True)])


def variances(moved: Floats, normal: Floats, covariance: Floats) -> PoseErrors:
    """`PoseErrors` by how far an adjustment that held every pose by `HELD_RAD` and `HELD_M` has moved them.

    `moved` (6V,), `normal` (6V, 6V) of the adjustment and `covariance` (6V, 6V) of its cameras' errors, both with what
    held them. The gradient of the pixels' cost at the given poses, `-normal @ moved`, is that of the poses' errors
    through the pixels' own normal matrix, and of the pixels' errors.
    """
    views = len(moved) // 6
    scale = np.tile([HELD_RAD] * 3 + [HELD_M] * 3, views)
    N, C = normal * np.outer(scale, scale), covariance / np.outer(scale, scale)
    H, B = N - np.eye(len(N)), N @ C @ N - np.eye(len(N))
    values, vectors = np.linalg.eigh((H + H.T) / 2)
    told = values > LEAST_KNOWN
    Q, gradient = vectors[:, told], N @ (moved / scale)
    # in units of the directions' own information, so that they are alike
    Q = Q / values[told]
    y, noise = Q.T @ gradient, Q.T @ ((B + B.T) / 2) @ Q
    turn = np.tile([1.0] * 3 + [0.0] * 3, views)
    by_turn, by_shift = ((Q.T @ H * part) @ H @ Q for part in (turn, 1 - turn))
    likelihood = np.zeros((len(TURNS), len(SHIFTS)))
    for i, a in enumerate(TURNS / HELD_RAD):
        for j, b in enumerate(SHIFTS / HELD_M):
            S = a * a * by_turn + b * b * by_shift + noise
            sign, size = np.linalg.slogdet(S)
            likelihood[i, j] = -0.5 * (size + y @ np.linalg.solve(S, y)) if sign > 0 else -np.inf
    usual = [(np.log(tried / at) / np.log(TIMES)) ** 2 / 2 for tried, at in ((TURNS, USUAL_RAD), (SHIFTS, USUAL_M))]
    likelihood -= usual[0][:, None] + usual[1]
    weight = np.exp(likelihood - likelihood.max())
    weight /= weight.sum()
    return PoseErrors(float(weight.sum(axis=1) @ TURNS), float(weight.sum(axis=0) @ SHIFTS))
