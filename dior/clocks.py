"""A camera's clock in a sequence: offset and drift on its time axis (dior/sampling.py), and how certain they are.

The error of a picture's time is that of the clock in the middle of the recording, plus that of the drift times the time
from there; these two are nearly independent. Both depend on the cameras' poses that the clock was estimated with: a
camera that is aimed a little too far ahead of a walker seems late. `given` is the covariance with the cameras as they
are, `gains` what a camera's error (`dior.covariance`: turn rad, shift m) adds.
"""

from dataclasses import dataclass, field

import numpy as np

from dior import tables

NORMAL_95 = 1.96
SHIFTS = ("turn_x", "turn_y", "turn_z", "shift_x", "shift_y", "shift_z")


@dataclass(frozen=True)
class Clock:
    """`offset_s`, `drift_ppm` as in `dior.sampling.seconds`; `source` of table `offsets`, `method` that found it.

    `given` (2,) standard errors with the cameras as given: of the time in the middle of the recording (s), `middle_s`
    after t0, and of the drift (ppm); NaN where not known, 0 for the reference camera. `gains`: camera name ->
    (2, 6), what an error of that camera adds to either.
    """

    offset_s: float
    drift_ppm: float = 0.0
    source: str = "assumed_zero"
    method: str = ""
    middle_s: float = 0.0
    given: tuple = (np.nan, np.nan)
    gains: dict = field(default_factory=dict)

    def sigma(self, names=(), joint=None):
        """Standard errors (2,) of the time in the middle (s) and the drift (ppm), with those of the cameras' poses.

        `joint` (6N, 6N): covariance of the cameras called `names`. NaN where a camera of `gains` has none.
        """
        variance = np.array(self.given) ** 2
        if not self.gains:
            return np.sqrt(variance)
        if joint is None or any(name not in names for name in self.gains):
            return np.full(2, np.nan)
        gain = np.zeros((2, len(names), 6))
        for name, own in self.gains.items():
            gain[:, list(names).index(name)] = own
        gain = gain.reshape(2, -1)
        return np.sqrt(variance + np.einsum("ij,jk,ik->i", gain, joint, gain))


def write(path, path_gains, sequence, clocks, names=(), joint=None):
    """Write tables `offsets` and `clock_gains` of the clocks of a sequence: dict camera -> `Clock`.

    `names`, `joint`: the cameras' covariance as of `Clock.sigma`.
    """
    sigma = np.array([clock.sigma(names, joint) for clock in clocks.values()]).reshape(-1, 2)
    offset = np.array([clock.offset_s for clock in clocks.values()])
    tables.write(
        path,
        "offsets",
        {
            "sequence": [sequence] * len(clocks),
            "camera": list(clocks),
            "offset_s": offset,
            "drift_ppm": [clock.drift_ppm for clock in clocks.values()],
            "middle_s": [clock.middle_s for clock in clocks.values()],
            "sigma_s": sigma[:, 0],
            "sigma_drift_ppm": sigma[:, 1],
            "low": offset - NORMAL_95 * sigma[:, 0],
            "high": offset + NORMAL_95 * sigma[:, 0],
            "given_sigma_s": [clock.given[0] for clock in clocks.values()],
            "given_sigma_drift_ppm": [clock.given[1] for clock in clocks.values()],
            "source": [clock.source for clock in clocks.values()],
            "method": [clock.method for clock in clocks.values()],
        },
    )
    rows = [
        (camera, quantity, by, *gain)
        for camera, clock in clocks.items()
        for by, gains in clock.gains.items()
        for quantity, gain in zip(("time", "drift"), gains, strict=True)
    ]
    columns = zip(*rows, strict=True) if rows else ([] for _ in range(3 + len(SHIFTS)))
    named = dict(zip(("camera", "quantity", "by", *SHIFTS), map(list, columns), strict=True))
    tables.write(path_gains, "clock_gains", {"sequence": [sequence] * len(rows), **named})


def read(paths, paths_gains=()):
    """Clocks by camera of tables `offsets` (and `clock_gains`) of one sequence; a later path goes first."""
    gains = {}
    for path in paths_gains:
        table = tables.read(path, "clock_gains")
        for i in range(len(table["camera"])):
            own = gains.setdefault(table["camera"][i], {}).setdefault(table["by"][i], np.zeros((2, 6)))
            own[int(table["quantity"][i] == "drift")] = [table[key][i] for key in SHIFTS]
    found = {}
    for path in paths:
        table = tables.read(path, "offsets")
        for i, camera in enumerate(table["camera"]):
            found[camera] = Clock(
                float(table["offset_s"][i]),
                float(table["drift_ppm"][i]),
                table["source"][i],
                table["method"][i],
                float(table["middle_s"][i]),
                (float(table["given_sigma_s"][i]), float(table["given_sigma_drift_ppm"][i])),
                gains.get(camera, {}),
            )
    return found
