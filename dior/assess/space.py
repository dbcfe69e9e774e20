"""How far a camera's 2D lies beside the 3D in the picture, once the times are right.

INPUTS   a `View`, the joints in 3D, the times. OUTPUTS  `Beside`
"""

from dataclasses import dataclass

import numpy as np

from dior.arrays import Floats
from dior.assess.recording import View
from dior.calibrate.clock.from_mocap import WalkerJoints, aside_m
from dior.clocks.clock import Clock
from dior.evaluate.turned import TURNED_M, TURNED_SIGMAS


@dataclass(frozen=True, eq=False)
class Beside:
    """`px` (2,): how far right of and below the projected 3D the 2D lies, the joints' mean; `half_px` (2,): half
    of the 95 % interval by how the joints differ; `metres`: the same at the person."""

    px: Floats
    half_px: Floats
    metres: float
    wrong: bool


def of_view(view: View, walker: WalkerJoints, times: Floats) -> Beside | None:
    """`Beside` of a view at `times` (F,) s; None where fewer than two joints are both seen and known.

    A detector's joints lie beside those of markers, and it errs by the side from which it sees somebody: what counts as
    wrong is as for the workflow's own cameras (`evaluate.turned`).
    """
    from scipy.stats import t as student

    found, px_per_m = aside_m(view.camera, walker, view.uv, times, Clock(0.0))
    if len(found) < 2:
        return None
    off = np.array(list(found.values()))
    mean, sigma = off.mean(axis=0), off.std(axis=0, ddof=1) / np.sqrt(len(off))
    wrong = bool((np.abs(mean) > np.maximum(TURNED_M, TURNED_SIGMAS * sigma)).any())
    half = float(student.ppf(0.975, len(off) - 1)) * sigma
    return Beside(mean * px_per_m, half * px_per_m, float(np.linalg.norm(mean)), wrong)
