"""Cameras that hang upside down or are rolled by any angle: are pose and clock found from marks as for upright ones?

usage: python -m benchmarks.rolls [SEEDS] [DEGREES ...]      (5 seeds, every 30 degrees)

As benchmarks.clocks_marks, all four cameras of every seed rolled by the same angle, walks of 20 s. `refused` counts
cameras of which no clock was found, and by it no pose.
"""

import sys

import numpy as np

from benchmarks import clocks_marks

SEEDS, DEGREES = 5, range(0, 360, 30)


def table(seeds=SEEDS, degrees=DEGREES):
    """Print a row per level and roll."""
    print(f"{'level':<7}{'roll':>6}{'clocks':>8}{'refused':>9}{'median, ms':>12}{'p95':>7}{'in 95 %':>9}")
    for level in clocks_marks.CLOCKS:
        for roll_deg in degrees:
            rows = [row for seed in range(1, seeds + 1) for row in clocks_marks.errors(seed, level, roll_deg=roll_deg)]
            error, sigma = np.array([row[4:] for row in rows]).T
            found = np.isfinite(error)
            ms = 1000 * np.abs(error[found])
            held = (np.abs(error[found] / sigma[found]) < 1.96).mean()
            print(
                f"{level:<7}{roll_deg:>6}{found.sum():>8}{(~found).sum():>9}{np.median(ms):>12.2f}"
                f"{np.percentile(ms, 95):>7.2f}{held:>9.1%}",
                flush=True,
            )


if __name__ == "__main__":
    table(int(sys.argv[1]) if len(sys.argv) > 1 else SEEDS, [int(x) for x in sys.argv[2:]] or DEGREES)
