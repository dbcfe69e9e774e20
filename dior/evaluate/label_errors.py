"""How large the errors of labels are, for a headline over many recordings: by their own sigmas and by yardsticks.

INPUTS   `labels_2d`, the cameras' focal lengths, grids of measured errors
OUTPUT   `label_quantiles`: of each recording and metric, values in the middles of equal parts, so that recordings can
         be pooled and a quantile of all be told, which means of quantiles cannot
Pixels are recorded pixels; a sigma is that of one axis, the root mean square of the two.
"""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np

from dior.arrays import Floats, Table
from dior.geometry.camera import Camera
from dior.tables import tables

# chosen: the 95th percentile of one recording lies between two of them, and that of many is told to about a percent
PARTS = 40
MIDDLES = (np.arange(PARTS) + 0.5) / PARTS


def sigmas(paths: Iterable[Path], cameras: Mapping[str, Camera]) -> dict[str, tuple[Floats, Floats]]:
    """camera -> sigma (F, J) in px and in m at the person, of labels in the picture; NaN where it is not known."""
    columns = ["camera", "joint", "frame", "sigma_u", "sigma_v", "depth", "status"]
    found = {}
    for path in paths:
        whole = tables.read(path, "labels_2d", columns)
        for camera in tables.ordered_unique(whole["camera"]):
            table = tables.of_camera(whole, camera)
            u, v, depth = np.moveaxis(tables.grid(table, "sigma_u", "sigma_v", "depth")[0].astype(float), -1, 0)
            inside = np.isin(table["status"], ("ok", "occluded")).reshape(u.shape)
            px = np.where(inside, np.sqrt((u**2 + v**2) / 2), np.nan)
            fx = cameras[camera].intrinsics.fx if camera in cameras else np.nan
            found[camera] = px, px * depth / fx
    return found


def quantile_columns(metric: str, values: Floats, camera: str, role: str) -> Table:
    """Columns of `label_quantiles` of the known `values`, whatever their shape; none where nothing is known."""
    known = values[np.isfinite(values)]
    count = PARTS if known.size else 0
    return {
        "metric": np.full(count, metric, object),
        "camera": np.full(count, camera, object),
        "role": np.full(count, role, object),
        "share": MIDDLES[:count],
        "value": np.quantile(known, MIDDLES) if count else np.zeros(0),
        "n": np.full(count, known.size),
    }


def pooled_quantile(values: Floats, counts: Sequence[int], share: float) -> float:
    """The value that `share` of all lie below, of `values` (R, PARTS) of recordings with `counts` (R,) labels; NaN of
    none."""
    if not len(values):
        return np.nan
    order = np.argsort(values, axis=None, kind="stable")
    weight = np.repeat(np.asarray(counts, float) / PARTS, PARTS)[order]
    at = np.searchsorted((np.cumsum(weight) - weight / 2) / weight.sum(), share)
    return float(values.ravel()[order[min(int(at), len(order) - 1)]])


def radius(sigma: Floats, counts: Sequence[int], share: float = 0.95) -> float:
    """Radius that `share` of the labels of all recordings lie within of where they should be, by their `sigma`
    (R, PARTS): errors of either axis are normal with it. NaN of none.
    """
    known = np.asarray(sigma, float)
    if not known.size or not known.max() > 0:
        return np.nan
    weight = np.repeat(np.asarray(counts, float) / PARTS, PARTS)
    variance = np.maximum(known.ravel() ** 2, 1e-18)
    low, high = 0.0, 10.0 * float(known.max())
    # halving so often ends below a millionth of the largest
    for _ in range(40):
        middle = (low + high) / 2
        within = np.average(-np.expm1(-(middle**2) / (2 * variance)), weights=weight)
        low, high = (middle, high) if within < share else (low, middle)
    return high
