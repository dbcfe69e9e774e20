"""A camera's clock in a sequence: offset and drift on its time axis (dior/clocks/axis.py), and how certain they are.

The error of a picture's time is that of the clock in the middle of the recording, plus that of the drift times the time
from there; these two are nearly independent. Both depend on the cameras' poses that the clock was estimated with: a
camera that is aimed a little too far ahead of a walker seems late. `given` is the covariance with the cameras as they
are, `gains` what a camera's error (`dior.geometry.covariance`: turn rad, shift m) adds.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeAlias

import numpy as np

from dior.arrays import AnyPath, Floats, Table
from dior.tables import tables

NORMAL_95 = 1.96
# a crystal's rate before anything is compared, 1 sigma: they are sold to 10, 50 or 100 ppm, and of 20 000 computers on
# the internet half were off by more than 78 ppm (Mills, Computer Network Time Synchronization, 2006, on NTP's clocks)
DRIFT_SD_PPM = 50.0
# and its time: clocks that the network keeps, or that a person starts on a count, are apart by less
OFFSET_SD_S = 1.0  # chosen: half of the window of the lag search, where nothing says that it is wider
# a clock by hand is doubted that is so many standard errors from the estimate (0.3 % of correct ones are), and so far,
# which is 2 mm of walking; chosen
CONTRADICTS, CONTRADICTS_S = 3.0, 0.002
SHIFTS = ("turn_x", "turn_y", "turn_z", "shift_x", "shift_y", "shift_z")


@dataclass(frozen=True)
class ClockFiles:
    """The files that a step writes of the clocks of a sequence.

    `out`: table `offsets`; `out_gains`: table `clock_gains`; `out_costs`: table `clock_costs`; `findings`: table
    `findings`.
    """

    out: Path
    out_gains: Path
    out_costs: Path
    findings: Path


@dataclass(frozen=True, eq=False)
class Clock:
    """`offset_s`, `drift_ppm` as in `dior.clocks.axis.seconds`; `source` of table `offsets`, `method` that found it.

    `given` (2,) standard errors with the cameras as given: of the time in the middle of the recording (s), `middle_s`
    after t0, and of the drift (ppm); NaN where not known, 0 for the reference camera. `gains`: camera name ->
    (2, 6), what an error of that camera adds to either.
    """

    offset_s: float
    drift_ppm: float = 0.0
    source: str = "assumed_zero"
    method: str = ""
    middle_s: float = 0.0
    given: tuple[float, float] = (np.nan, np.nan)
    gains: dict[str, Floats] = field(default_factory=dict)

    @property
    def late_s(self) -> float:
        """The camera's lag (s) in the middle of the recording; `offset_s` is that at t0."""
        return self.offset_s + 1e-6 * self.drift_ppm * self.middle_s

    def covariance(self, names: Sequence[str] = (), joint: Floats | None = None) -> Floats:
        """Covariance (2, 2) of the time in the middle (s) and the drift (ppm), with the errors of the cameras' poses.

        `joint` (6N, 6N): covariance of the cameras called `names`. NaN where a camera of `gains` has none.
        """
        own = np.diag(np.array(self.given) ** 2)
        if not self.gains:
            return own
        if joint is None or any(name not in names for name in self.gains):
            return np.full((2, 2), np.nan)
        gain = np.zeros((2, len(names), 6))
        for name, by_camera in self.gains.items():
            gain[:, list(names).index(name)] = by_camera
        flat = gain.reshape(2, -1)
        return np.asarray(own + flat @ joint @ flat.T, float)

    def sigma(self, names: Sequence[str] = (), joint: Floats | None = None) -> Floats:
        """Standard errors (2,) of the time in the middle (s) and the drift (ppm); arguments as of `covariance`."""
        return np.sqrt(np.diagonal(self.covariance(names, joint)))

    def sigma_offset(self, names: Sequence[str] = (), joint: Floats | None = None) -> float:
        """Standard error (s) of `offset_s`, to which the drift leads back from the middle; arguments as there."""
        spread = self.covariance(names, joint)
        if not self.middle_s:
            return float(np.sqrt(spread[0, 0]))
        back = np.array([1.0, -1e-6 * self.middle_s])
        return float(np.sqrt(back @ spread @ back))


def doubtful_s(sigma_s: float) -> float:
    """How far (s) a clock that a person gave may be from the estimate, whose standard error is `sigma_s`."""
    return max(CONTRADICTS * sigma_s, CONTRADICTS_S)


# a clock, the lags (s) that were tried and their costs, and why it is not known or ""
Estimate: TypeAlias = tuple[Clock, Floats, Floats, str]


def write(
    path: AnyPath,
    path_gains: AnyPath,
    sequence: str,
    clocks: Mapping[str, Clock],
    names: Sequence[str] = (),
    joint: Floats | None = None,
) -> None:
    """Write tables `offsets` and `clock_gains` of the clocks of a sequence: dict camera -> `Clock`.

    `names`, `joint`: the cameras' covariance as of `Clock.sigma`.
    """
    write_all(path, path_gains, {sequence: clocks}, names, joint)


def write_all(
    path: AnyPath,
    path_gains: AnyPath,
    clocks: Mapping[str, Mapping[str, Clock]],
    names: Sequence[str] = (),
    joint: Floats | None = None,
) -> None:
    """The same of several sequences: dict sequence -> dict camera -> `Clock`."""
    each = [(sequence, camera, clock) for sequence, own in clocks.items() for camera, clock in own.items()]
    sigma = np.array([clock.sigma(names, joint) for _, _, clock in each]).reshape(-1, 2)
    half = NORMAL_95 * np.array([clock.sigma_offset(names, joint) for _, _, clock in each])
    offset = np.array([clock.offset_s for _, _, clock in each])
    late = np.array([clock.late_s for _, _, clock in each])
    tables.write(
        path,
        "offsets",
        {
            "sequence": [sequence for sequence, _, _ in each],
            "camera": [camera for _, camera, _ in each],
            "offset_s": offset,
            "drift_ppm": [clock.drift_ppm for _, _, clock in each],
            "sigma_s": half / NORMAL_95,
            "sigma_drift_ppm": sigma[:, 1],
            "low": offset - half,
            "high": offset + half,
            "middle_s": [clock.middle_s for _, _, clock in each],
            "late_s": late,
            "late_sigma_s": sigma[:, 0],
            "late_low": late - NORMAL_95 * sigma[:, 0],
            "late_high": late + NORMAL_95 * sigma[:, 0],
            "given_sigma_s": [clock.given[0] for _, _, clock in each],
            "given_sigma_drift_ppm": [clock.given[1] for _, _, clock in each],
            "source": [clock.source for _, _, clock in each],
            "method": [clock.method for _, _, clock in each],
        },
    )
    rows = [
        (sequence, camera, quantity, by, *gain)
        for sequence, camera, clock in each
        for by, gains in clock.gains.items()
        for quantity, gain in zip(("time", "drift"), gains, strict=True)
    ]
    keys = ("sequence", "camera", "quantity", "by", *SHIFTS)
    columns = zip(*rows, strict=True) if rows else ([] for _ in keys)
    tables.write(path_gains, "clock_gains", dict(zip(keys, map(list, columns), strict=True)))


def read(
    paths: Iterable[AnyPath], paths_gains: Iterable[AnyPath] = (), sequence: str | None = None
) -> dict[str, Clock]:
    """Clocks by camera of tables `offsets` (and `clock_gains`) of one sequence; a later path goes first.

    `sequence` is the one that counts in tables of several.
    """
    gains: dict[str, dict[str, Floats]] = {}
    for path in paths_gains:
        table = tables.read(path, "clock_gains")
        for i in _of(table, sequence):
            own = gains.setdefault(table["camera"][i], {}).setdefault(table["by"][i], np.zeros((2, 6)))
            own[int(table["quantity"][i] == "drift")] = [table[key][i] for key in SHIFTS]
    found = {}
    for path in paths:
        table = tables.read(path, "offsets")
        for i in _of(table, sequence):
            camera = table["camera"][i]
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


def _of(table: Table, sequence: str | None) -> list[int]:
    return [i for i, name in enumerate(table["sequence"]) if sequence in (None, name)]
