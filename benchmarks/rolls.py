"""Cameras that hang upside down or are rolled by any angle: are they found as upright ones are?

usage: python -m benchmarks.rolls [SEEDS] [DEGREES ...]      (20 seeds; every 30 degrees, of tapes 90, 180 and 270)

Of the angles each seed has one, the next seed the next.

marks: as benchmarks.clocks_marks, all four cameras of a seed rolled by its angle; walks of 20 s. `refused` counts
cameras of which no clock was found, and by it no pose.

tape: one close camera of an outdoor walk of 8 s is rolled and nobody says so; the others and the tape are as ever.
`named` counts captures in which `camera_rolled` is said of this camera, with its angle, and of no other; the errors are
those of its pose after `adjust`, and the share of all six that the 95 % region of its covariance holds.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import re
import sys
import tempfile

import numpy as np
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from benchmarks import clocks_marks, steps, worlds
from dior.errors import DiorError
from dior.geometry import camera_tables
from dior.tables import tables

SEEDS, DEGREES, QUARTERS = 20, range(0, 360, 30), (90, 180, 270)


def _by_roll(seeds, degrees, made, shown):
    """Print what `shown` makes of the rows `made` of each seed at its angle, by level and angle, and of all."""
    for level in clocks_marks.CLOCKS:
        every = []
        for i, roll_deg in enumerate(degrees):
            rows = [row for seed in range(1 + i, seeds + 1, len(degrees)) for row in made(seed, level, float(roll_deg))]
            every += rows
            if rows:
                print(f"{level:<7}{roll_deg:>6}{shown(rows)}", flush=True)
        print(f"{level:<7}{'all':>6}{shown(every)}", flush=True)


def marks(seeds, degrees):
    print(f"{'marks':<7}{'roll':>6}{'clocks':>8}{'refused':>9}{'median, ms':>12}{'p95':>7}{'in 95 %':>9}")
    _by_roll(seeds, degrees, lambda seed, level, roll: clocks_marks.errors(seed, level, roll_deg=roll), _of_marks)


def _of_marks(rows):
    error, sigma = np.array([row[4:] for row in rows]).T
    found = np.isfinite(error)
    ms, held = 1000 * np.abs(error[found]), (np.abs(error[found] / sigma[found]) < 1.96).mean()
    return f"{found.sum():>8}{(~found).sum():>9}{np.median(ms):>12.2f}{np.percentile(ms, 95):>7.2f}{held:>9.1%}"


def taped(seed, level, roll_deg):
    """Whether the roll of a camera is named (None: refused), and errors of its pose: m, degrees, in its 95 % region."""
    with tempfile.TemporaryDirectory() as folder:
        name = ("cam01", "cam02", "cam03")[seed % 3]
        made = steps.recorded(
            folder, preset=level, seed=seed, subjects=1, sequences=1, environments=["outdoor"], duration_s=8.0,
            gallery=False, roll_deg=float(roll_deg), rolled=[name],
        )  # fmt: skip
        session = worlds.outdoors(made)
        try:
            steps.adjusted(made, session)
        except DiorError as error:
            print(f"{level} {roll_deg} {seed}: {error}", file=sys.stderr)
            return None, np.nan, np.nan, False
        findings = tables.read_findings(made.made("adjust", session, ".findings"))
        said = [(scope, text) for scope, _, code, text in findings if code == "camera_rolled"]
        angles = [float(re.search(r"turned by (-?\d+) degrees", text)[1]) % 360 for _, text in said]
        right = [scope for scope, _ in said] == ([f"{session}/{name}"] if roll_deg else [])
        right &= all(abs((angle - roll_deg + 180) % 360 - 180) < 10 for angle in angles)
        if not right:
            print(f"{level} {roll_deg} {seed} {name}: {said}", file=sys.stderr)
        found = camera_tables.read_cameras(made.made("adjust", session))[name]
        true = made.views[made.project.sequences_of(session)[0]][name].placed.camera
        spread = camera_tables.read_camera_covariance(made.made("adjust", session, ".covariance"), [name])
    # as `covariance.moved` has it
    turn = Rotation.from_matrix(found.wRc.T @ true.wRc).as_rotvec()
    error = np.r_[turn, true.centre - found.centre]
    held = error @ np.linalg.solve(spread[:6, :6], error) < chi2.ppf(0.95, 6)
    return right, np.linalg.norm(error[3:]), np.degrees(np.linalg.norm(turn)), held


def tape(seeds, degrees):
    print(f"{'tape':<7}{'roll':>6}{'named':>8}{'refused':>9}{'median, m':>12}{'degrees':>9}{'in 95 %':>9}")
    _by_roll(seeds, degrees, lambda *case: [taped(*case)], _of_tape)


def _of_tape(rows):
    placed = [row for row in rows if row[0] is not None]
    named, metres, turn, held = np.array(placed).reshape(-1, 4).T
    return (
        f"{int(named.sum()):>8}{len(rows) - len(placed):>9}{np.median(metres):>12.3f}{np.median(turn):>9.2f}"
        f"{held.mean():>9.1%}"
    )


def main():
    seeds, degrees = int(sys.argv[1]) if len(sys.argv) > 1 else SEEDS, [int(each) for each in sys.argv[2:]]
    tape(seeds, degrees or QUARTERS)
    marks(seeds, degrees or DEGREES)


if __name__ == "__main__":
    main()
