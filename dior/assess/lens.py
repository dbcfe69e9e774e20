"""Whether a camera's lens is the one that the dataset says: its focal length and the bend of its edges.

INPUTS   a `View` with its times put right, the joints in 3D
OUTPUTS  `Lens`
Pose and lens are fitted together to how the residuals change as the joints move through the picture (`clock.fit`, what
is constant for a joint and a side of the body left to the detector). What nothing tells keeps what is given, by priors.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from dior.arrays import Floats
from dior.assess.recording import View
from dior.calibrate.clock import fit
from dior.calibrate.clock.from_mocap import WalkerJoints, tracks_of
from dior.clocks.clock import NORMAL_95
from dior.geometry import camera as cam
from dior.geometry import covariance
from dior.geometry.camera import REFERENCE_FX, Camera

# chosen, 1 sigma of what may be wrong: rad, m, of the focal length, of k1
PRIOR_SD = np.repeat([0.1, 0.3, 0.2, 0.3], [3, 3, 1, 1])
ROUNDS = 6  # chosen: Gauss-Newton's steps; they are small after three
STEP_K1 = 1e-4  # of the numerical derivative
# chosen: an interval has to leave out 0 by this factor, since a detector's errors are no noise
SURE = 1.5
# chosen: at fx 1680, in the middle of the picture's edge, and of the focal length: lenses of one kind differ by as much
LEAST_PX, LEAST_FOCAL = 2.0, 0.005
# chosen: an interval that moves the edge by more tells nothing of a lens: 2 % of the focal length, a k1 of 0.05 or so
UNTOLD_PX = 20.0


@dataclass(frozen=True)
class Lens:
    """`focal`: by what the focal length is to be multiplied, `k1`: what is to be added to the first coefficient;
    `half_focal` and `half_k1`: half of the 95 % intervals, NaN where too little is seen; `edge_px`: how far what is
    sure of both moves the middle of a picture's edge, 0 where nothing is; `focal_wrong`, `k1_wrong`: which is sure;
    `focal_untold`, `k1_untold`: of which the interval leaves too much open, of a lens that is not wrong."""

    focal: float = 1.0
    half_focal: float = np.nan
    k1: float = 0.0
    half_k1: float = np.nan
    edge_px: float = 0.0
    focal_wrong: bool = False
    k1_wrong: bool = False
    focal_untold: bool = True
    k1_untold: bool = True

    @property
    def wrong(self) -> bool:
        return self.focal_wrong or self.k1_wrong


def of_view(view: View, walker: WalkerJoints, times: Floats) -> Lens:
    """`Lens` of a view at `times` (F,) s on the axis of the 3D."""
    camera, at = view.camera, fit.runs(times, 80.0, 3)
    theta = np.zeros(len(PRIOR_SD))
    solved = None
    for _ in range(ROUNDS):
        tracks = tracks_of(camera, walker, view.uv[at], times[at], float(times.mean()), np.zeros(2))
        tracks = replace(tracks, by_clock=_by_lens(camera, walker, times[at], tracks))
        solved = fit.solve(tracks, theta, PRIOR_SD**-2.0)
        if solved is None:
            return Lens()
        theta = theta + np.clip(solved.step, -0.5 * PRIOR_SD, 0.5 * PRIOR_SD)
        camera = bent(covariance.moved(view.camera, theta[:6]), np.exp(theta[6]), theta[7])
        if (np.abs(solved.step) < 0.1 * np.sqrt(np.diagonal(solved.given))).all():
            break
    assert solved is not None
    half = NORMAL_95 * np.sqrt(np.diagonal(solved.given))[6:]
    found = Lens(float(np.exp(theta[6])), float(half[0]), float(theta[7]), float(half[1]))
    # what is left of each where the interval, widened, is given the benefit
    left = np.maximum(np.abs(theta[6:]) - SURE * half, 0.0)
    focal_wrong = bool(left[0] > LEAST_FOCAL)
    k1_wrong = edge_px(view.camera, bent(view.camera, 1.0, float(np.sign(theta[7]) * left[1]))) > LEAST_PX
    changed = bent(view.camera, found.focal if focal_wrong else 1.0, found.k1 if k1_wrong else 0.0)
    edge = edge_px(view.camera, changed)
    wrong = focal_wrong or k1_wrong
    focal_off, k1_off = bent(view.camera, 1 + found.half_focal, 0.0), bent(view.camera, 1.0, found.half_k1)
    return replace(
        found,
        edge_px=edge,
        focal_wrong=focal_wrong,
        k1_wrong=k1_wrong,
        focal_untold=not wrong and edge_px(view.camera, focal_off) > UNTOLD_PX,
        k1_untold=not wrong and edge_px(view.camera, k1_off) > UNTOLD_PX,
    )


def untold(lenses: Sequence[Lens]) -> str:
    """What cannot be told of some lenses, and how far it is known; "" where all can."""
    focal = [one.half_focal for one in lenses if one.focal_untold]
    k1 = [one.half_k1 for one in lenses if one.k1_untold]
    return ", ".join(_known(what, halves) for what, halves in (("focal length", focal), ("k1", k1)) if halves)


def _known(what: str, halves: Sequence[float]) -> str:
    if np.isnan(halves).any():
        return f"{what} not known"
    low, high = f"{min(halves):.3f}", f"{max(halves):.3f}"
    return f"{what} known to ± {low}" + (f" to {high}" if high != low else "")


def bent(camera: Camera, focal: float, k1: float) -> Camera:
    """The camera with `focal` times the focal length and `k1` more of its first coefficient."""
    lens = camera.intrinsics
    first, *rest = lens.distortion
    sign = -1 if lens.model == "inverse_brown_conrady" else 1
    new = replace(lens, fx=focal * lens.fx, fy=focal * lens.fy, distortion=(first + sign * k1, *rest))
    return replace(camera, intrinsics=new)


def edge_px(camera: Camera, other: Camera) -> float:
    """How far (px at fx 1680) two lenses put the middle of the picture's longer edge apart."""
    lens = camera.intrinsics
    xy = np.array([[lens.width / 2 / lens.fx, 0.0], [0.0, lens.height / 2 / lens.fy]])
    apart = np.linalg.norm(cam.distort(lens, xy) - cam.distort(other.intrinsics, xy), axis=1)
    return float(np.nanmax(apart, initial=0.0)) * REFERENCE_FX / lens.fx


def _by_lens(camera: Camera, walker: WalkerJoints, times: Floats, tracks: fit.ResidualTracks) -> Floats:
    """Derivatives (B, T, 2, 8) of the pixels by turn, shift, log of the focal length and k1."""
    from dior.clocks.axis import blend, bracket

    where = bracket(walker.t, times, 2.5 * float(np.median(np.diff(walker.t))))
    points = blend(walker.points, *where)
    by_camera = covariance.projection(camera, points)[1]
    by_focal = covariance.by_lens(camera, points)[..., :1]
    by_k1 = (cam.project(bent(camera, 1.0, STEP_K1), points)[0] - cam.project(camera, points)[0])[..., None] / STEP_K1
    return np.swapaxes(np.concatenate([by_camera, by_focal, by_k1], axis=-1), 0, 1)
