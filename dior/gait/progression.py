"""Where a walker is going, how fast, where he turns or stands, and whether he walks on a treadmill.

INPUTS   `Tracks`. OUTPUTS `Progression` at any times. World with Z up; metres, seconds, radians.
"""

from dataclasses import dataclass

import numpy as np

from dior.arrays import Bools, Floats
from dior.gait.tracks import Tracks, bridged, velocity

# the pelvis' velocity is a difference over twice this; chosen: about a stride, so that its sway and bounce cancel
STRIDE_HALF_S = 0.45
# chosen: who turns faster walks a curve, not straight; a pelvis that sways turns by less
TURN_RAD_S = np.deg2rad(20.0)
# chosen: who is slower stands, or shifts his weight
STANDING_M_S = 0.15
# chosen: a belt is faster than this, and the walker stays where it is but for this share of its speed
BELT_M_S, STAYS = 0.25, 0.3
# chosen: m/s around which the velocities of a foot on the floor scatter
FLOOR_M_S = 0.12
# velocities that a belt is looked for among; chosen: a minute has about as many, and an hour takes no longer
MOST = 50_000


@dataclass(frozen=True, eq=False)
class Progression:
    """At some times: `speed` (N,) m/s of the pelvis, `heading` (N, 2) its direction, if he turns or stands (N,)."""

    speed: Floats
    heading: Floats
    turning: Bools
    standing: Bools


def of(tracks: Tracks, times: Floats) -> Progression:
    """`Progression` at `times` (N,) s, evenly spaced."""
    pelvis = bridged(tracks.seconds, tracks.pelvis)[0]
    v = velocity(tracks.seconds, pelvis, times, STRIDE_HALF_S)[..., :2]
    speed = np.hypot(v[:, 0], v[:, 1])
    heading = v / np.maximum(speed, 1e-9)[:, None]
    yaw = np.unwrap(np.arctan2(heading[:, 1], heading[:, 0]))
    first, last = (np.clip(times + sign * STRIDE_HALF_S, times[0], times[-1]) for sign in (-1, 1))
    rate = np.abs(np.interp(last, times, yaw) - np.interp(first, times, yaw)) / np.maximum(last - first, 1e-9)
    return Progression(speed, heading, rate > TURN_RAD_S, speed < STANDING_M_S)


def belt(tracks: Tracks, times: Floats) -> Floats:
    """Velocity (2,) m/s of the floor: zeros, or a treadmill's belt, which feet move with while the walker stays.

    The velocity that feet have most often, to which that of a foot on the floor is nearest.
    """
    still = np.zeros(2)
    feet = np.concatenate(
        [
            velocity(tracks.seconds, bridged(tracks.seconds, track[:, side])[0], times)[:, :2]
            for track in (tracks.heel, tracks.toe)
            for side in (0, 1)
        ]
    )
    feet = feet[:: -(-len(feet) // MOST)]
    pelvis = bridged(tracks.seconds, tracks.pelvis)[0]
    # starts along the axis in which feet move most, fastest backwards to fastest forwards
    centre = feet - np.median(feet, axis=0)
    axis = np.linalg.svd(centre, full_matrices=False)[2][0]
    order = np.argsort(centre @ axis)
    starts = [feet[order[round(q * (len(feet) - 1))]] for q in np.linspace(0.05, 0.95, 10)]
    best, most = still, 0.0
    for place in (still, *starts):
        for _ in range(20):
            weight = np.exp(-0.5 * ((feet - place) ** 2).sum(axis=-1) / FLOOR_M_S**2)
            place = (weight[:, None] * feet).sum(axis=0) / max(weight.sum(), 1e-9)
        dense = np.exp(-0.5 * ((feet - place) ** 2).sum(axis=-1) / FLOOR_M_S**2).sum()
        if dense > most * 1.001:
            best, most = place, dense
    drift = np.linalg.norm(pelvis[-1, :2] - pelvis[0, :2]) / (tracks.seconds[-1] - tracks.seconds[0])
    speed = float(np.linalg.norm(best))
    path = np.linalg.norm(velocity(tracks.seconds, pelvis, times, STRIDE_HALF_S)[:, :2], axis=-1)
    stays = np.median(path) < STAYS * speed and drift < STAYS * speed
    return best if speed > BELT_M_S and stays else still
