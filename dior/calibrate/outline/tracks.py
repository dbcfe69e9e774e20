"""The known 3D of a walk at any moment: where the joints are and how fast they go.

INPUTS   times (T,) s and points (T, J, 3) m with NaN, as of table `skeletons_3d`
OUTPUTS  points and velocities at other moments; NaN in gaps and outside
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from dior.arrays import Floats, Table
from dior.clocks.axis import SAME_TIME_S, sample, seconds
from dior.tables import tables

# chosen: a velocity is that over twice so long: shorter, and the noise of the joints is most of it
HALF_SPAN_S = 0.05


@dataclass(frozen=True, eq=False)
class BodyTrack:
    """`seconds` (T,) ascending on the axis of the sequence, `points` (T, J, 3) m."""

    seconds: Floats
    points: Floats

    def at(self, moments: Floats) -> Floats:
        """Points (F, J, 3) m at moments (F,) s, linear between the instants."""
        return sample(self.seconds, self.points, moments, self._gap_s)

    @cached_property
    def _gap_s(self) -> float:
        """How far apart the instants may be between which there is a point."""
        return 1.5 * float(np.median(np.diff(self.seconds))) if len(self.seconds) > 1 else SAME_TIME_S

    def velocity(self, moments: Floats) -> Floats:
        """Velocities (F, J, 3) m/s at moments (F,) s; 0 where they are not known."""
        step = self.at(moments + HALF_SPAN_S) - self.at(moments - HALF_SPAN_S)
        return np.nan_to_num(step / (2 * HALF_SPAN_S))


def read(skeleton: Table) -> tuple[BodyTrack, int, list[str]]:
    """`BodyTrack` of a `skeletons_3d` table (dict of arrays), its t0 in ns and its joints."""
    points, joints = tables.grid(skeleton, "x", "y", "z")
    stamps = skeleton["stamp_ns"].reshape(points.shape[:2])[:, 0]
    return BodyTrack(seconds(stamps, stamps[0]), points), int(stamps[0]), joints
