"""Do the labels' error ellipses hold? Many captures, each simulated and labelled anew, with true and with found clocks.

usage: python -m benchmarks.coverage [CAPTURES] [SECONDS] [true|found]      (100 captures, seeds 1-100, walks of 8 s)

A 95 % ellipse should hold 95 % of the true keypoints, and the error of a coordinate should be its sigma on average
(rms of error / sigma of 1). The labels of one capture share its cameras' errors, so that only the number of captures
counts; `spread` is the standard error of the share over captures.
"""

import os
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor

import numpy as np

from benchmarks import steps
from dior.errors import DiorError
from dior.tables import tables

INSIDE = 5.991  # chi-square with 2 degrees of freedom, 95 %
GROUPS = ("indoor", "close", "long range")
EVERY = 5  # labels of every fifth picture


def errors(seed, level, seconds, clocks):
    """Of one capture, by group: squared Mahalanobis distances, errors over sigma, errors px, sigmas px.

    None where the capture is refused.
    """
    with tempfile.TemporaryDirectory() as folder:
        try:
            made = steps.labelled(
                folder, clocks == "true", preset=level, seed=seed, subjects=1, duration_s=seconds, gallery=False
            )
        except DiorError as error:
            print(f"seed {seed} is refused: {error}", file=sys.stderr)
            return None
        found = {group: [] for group in GROUPS}
        for name, views in made.views.items():
            for camera, seen in views.items():
                role = seen.placed.camera.role
                group = "indoor" if made.project.indoor(name) else "long range" if role == "long_range" else "close"
                found[group].append(_of_labels(tables.read(steps.labels_of(made, name, camera), "labels_2d"), seen))
    return {group: np.concatenate(parts, axis=1) for group, parts in found.items()}


def _of_labels(table, seen):
    """(5, N): squared Mahalanobis distance, error over sigma in u and in v, error and sigma (rms of u and v) px."""
    values, joints = tables.grid(table, "u", "v", "sigma_u", "sigma_v", "rho_uv")
    where = [seen.joints.index(joint) for joint in joints]
    true, status = (x[seen.clock.messages][:, where] for x in (seen.uv, seen.status))
    visible = (status == "ok") | (status == "occluded")
    values, true, visible = values[::EVERY], true[::EVERY], visible[::EVERY]
    keep = visible & np.isfinite(values).all(axis=-1)
    miss, sigma, rho = (values[keep][:, :2] - true[keep]), values[keep][:, 2:4], values[keep][:, 4]
    z = miss / sigma
    distance = (z[:, 0] ** 2 - 2 * rho * z[:, 0] * z[:, 1] + z[:, 1] ** 2) / (1 - rho**2)
    size = np.sqrt((miss**2).sum(axis=1)), np.sqrt((sigma**2).sum(axis=1))
    return np.stack([distance, z[:, 0], z[:, 1], *size])


def main():
    captures = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    seconds = float(sys.argv[2]) if len(sys.argv) > 2 else 8.0
    chosen = sys.argv[3:] or ["true", "found"]
    print(f"{captures} captures a level, seeds 1-{captures}, walks of {seconds:g} s")
    print(
        f"{'clocks':<8}{'detector':<10}{'labels':<12}{'in 95 % ellipse':>16}{'spread':>8}{'rms error/sigma':>17}"
        f"{'error, px':>11}{'sigma, px':>11}"
    )
    for clocks, level in ((clocks, level) for clocks in chosen for level in ("ideal", "real")):
        with ProcessPoolExecutor(os.cpu_count()) as pool:
            each = list(
                pool.map(errors, range(1, captures + 1), [level] * captures, [seconds] * captures, [clocks] * captures)
            )
        each = [one for one in each if one]
        if len(each) < captures:
            print(f"{clocks:<8}{level:<10}{captures - len(each)} of {captures} captures were refused")
        for group in GROUPS:
            shares = [(one[group][0] <= INSIDE).mean() for one in each if one[group].size]
            pooled = np.concatenate([one[group] for one in each], axis=1)
            rms = np.sqrt((pooled[1:3] ** 2).mean())
            spread = np.std(shares) / np.sqrt(len(shares))
            print(
                f"{clocks:<8}{level:<10}{group:<12}{np.mean(shares):>16.3f}{spread:>8.3f}{rms:>17.2f}"
                f"{pooled[3].mean():>11.2f}{pooled[4].mean():>11.2f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
