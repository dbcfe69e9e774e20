"""The simulated 2D detector, level `ideal`: the true landmarks and white noise; nobody in the long-range picture.

OUTPUT   ML Kit JSON lines, a line per picture: `{"frame", "stamp_ns", "landmarks": [...]}`, pixels
"""

import json
from dataclasses import dataclass

import numpy as np

from dior.files import write_text

LEAST_IN_PICTURE = 0.5
SCORE_IN, SCORE_OUT = 0.99, 0.05
# ML Kit finds nobody in people smaller than this; the paper's long-range views are 20-25 px
SMALLEST_PX = 60.0


@dataclass(frozen=True)
class Detected:
    """Pixels (F, 33, 2), scores (F, 33), relative depth (F, 33) px, the noise added, and where there is a person."""

    uv: np.ndarray
    score: np.ndarray
    z: np.ndarray
    noise: np.ndarray
    found: np.ndarray


def detect(seen, noise_px, random):
    """What the detector makes of a `truth.View`."""
    uv, depth, status = (seen.landmark(values) for values in (seen.uv, seen.depth, seen.status))
    inside = (status == "ok") | (status == "occluded")
    noise = noise_px * random.standard_normal(uv.shape)
    with np.errstate(invalid="ignore"):
        tall = np.nanmax(uv[..., 1], axis=1) - np.nanmin(uv[..., 1], axis=1) >= SMALLEST_PX
    found = (inside.mean(axis=1) >= LEAST_IN_PICTURE) & tall & np.isfinite(uv).all(axis=(1, 2))
    middle = depth[:, 23:25].mean(axis=1, keepdims=True)
    z = (depth - middle) * seen.camera.intrinsics.fx / middle
    return Detected(uv + noise, np.where(inside, SCORE_IN, SCORE_OUT), z, noise, found)


def write_mlkit(path, stamp_ns, detected):
    """Write one camera's detections as ML Kit JSON lines."""
    lines = []
    uv, z, score = detected.uv.round(2).tolist(), detected.z.round(2).tolist(), detected.score.tolist()
    for frame, stamp in enumerate(stamp_ns.tolist()):
        landmarks = [
            {"type": i, "x": x, "y": y, "z": z[frame][i], "inFrameLikelihood": score[frame][i]}
            for i, (x, y) in enumerate(uv[frame] if detected.found[frame] else [])
        ]
        lines.append(json.dumps({"frame": frame, "stamp_ns": stamp, "landmarks": landmarks}))
    write_text(path, "\n".join(lines) + "\n")
