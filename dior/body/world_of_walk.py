"""The world of a walk: the floor under the walker's feet, the vertical along the body, X along the way.

INPUTS   joints of one person in some world, (T, J, 3) m with NaN for missing, and their names
OUTPUTS  the rigid motion to the world in which the floor is Z = 0 and Z is up

For a calibration whose origin is a camera, or that has another axis up: pixels tell neither floor nor vertical.
"""

import math
from collections.abc import Sequence

import numpy as np

from dior.arrays import Floats
from dior.body import plausible, wrong_world
from dior.body.proportions import SIDES
from dior.geometry.rotation import from_rotvec

# chosen: rounds of choosing the standing feet and turning the floor under them
FLOOR_ROUNDS = 4
# chosen: a person's mean lean is off the vertical by 3 degrees, and a standing heel or toe is 2 cm off the floor's
# plane, of which a walk has about 20 that say something of their own
LEAN_SIGMA_RAD, SOLE_SIGMA_M, STANDS = math.radians(3.0), 0.02, 20


def rebased(points: Floats, joints: Sequence[str]) -> Floats:
    """bTw (4, 4): the rigid motion after which the walker's floor is Z = 0, Z is up and he walks along X.

    `points` (T, J, 3) m. The vertical is that of the plane on which the feet stand, as far as they stand on one, and of
    the body where they walk along a line. X is the way that he first walks, the origin the middle of his way.
    """
    up = wrong_world.upward(points, joints)
    turn = _to_z(up)
    for _ in range(FLOOR_ROUNDS):
        feet = _standing(points @ turn.T, joints)
        if not len(feet):
            break
        turn = _to_z(_normal(feet)) @ turn
    turned = points @ turn.T
    hips = plausible.middle(turned, joints, "hip")
    hips = hips[np.isfinite(hips).all(axis=1)]
    out = np.eye(4)
    if not len(hips):
        out[:3, :3] = turn
        return out
    way = np.linalg.svd(hips[:, :2] - hips[:, :2].mean(axis=0), full_matrices=False)[2][0]
    if (hips[len(hips) // 4, :2] - hips[0, :2]) @ way < 0:
        way = -way
    about = np.array([[way[0], way[1], 0.0], [-way[1], way[0], 0.0], [0.0, 0.0, 1.0]])
    out[:3, :3] = about @ turn
    middle = np.append((hips[:, :2].min(axis=0) + hips[:, :2].max(axis=0)) / 2, 0.0)
    height = plausible.feet(turned, joints)
    middle[2] = height if np.isfinite(height) else 0.0
    out[:3, 3] = -about @ middle
    return out


def _to_z(direction: Floats) -> Floats:
    """The shortest rotation (3, 3) that makes a direction (3,) of length 1 the Z axis."""
    axis = np.cross(direction, [0.0, 0.0, 1.0])
    size = np.linalg.norm(axis)
    if size < 1e-12:
        return np.eye(3) if direction[2] > 0 else np.diag([1.0, -1.0, -1.0])
    angle = np.arctan2(size, direction[2])
    return from_rotvec(axis / size * angle)


def _standing(points: Floats, joints: Sequence[str]) -> Floats:
    """Places (N, 3) of heels and toes in the lowest quarter of their own heights above the path."""
    feet = [plausible.joint(points, joints, f"{side}_{part}") for side in SIDES for part in plausible.FEET]
    found = []
    for one in feet:
        one = one[np.isfinite(one).all(axis=1)]
        if len(one) >= 4:
            # above a plane, so that a floor that is still tilted does not choose the places for the feet
            A = np.c_[np.ones(len(one)), one[:, :2] - one[:, :2].mean(axis=0)]
            above = one[:, 2] - A @ np.linalg.lstsq(A, one[:, 2], rcond=None)[0]
            found.append(one[above <= np.quantile(above, plausible.STANDING_SHARE)])
    return np.concatenate(found) if found else np.zeros((0, 3))


def _normal(feet: Floats) -> Floats:
    """Normal (3,) of the floor through feet (N, 3), about Z by `LEAN_SIGMA_RAD`."""
    A = np.c_[np.ones(len(feet)), feet[:, :2] - feet[:, :2].mean(axis=0)]
    weight = min(STANDS / len(feet), 1.0) / SOLE_SIGMA_M**2
    N = weight * A.T @ A + np.diag([0.0, LEAN_SIGMA_RAD**-2, LEAN_SIGMA_RAD**-2])
    plane = np.linalg.solve(N, weight * A.T @ feet[:, 2])
    normal = np.array([-plane[1], -plane[2], 1.0])
    return normal / np.linalg.norm(normal)
