"""The simulated 2D detector, level `ideal`: the true landmarks and white noise; nobody in the long-range picture.

OUTPUT   ML Kit JSON lines, a line per picture: `{"frame", "stamp_ns", "landmarks": [...]}`, pixels; of several people
         MediaPipe's: `{"frame", "pose_landmarks": [[...], ...]}`, fractions of the picture
"""

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from dior.arrays import Bools, Floats
from dior.geometry.camera import Camera, Intrinsics
from dior.simulate.clocks import Clock
from dior.simulate.truth import Detected, View
from dior.tables.files import write_text

# chosen: of a person who is mostly outside, detectors find nobody
LEAST_IN_PICTURE = 0.5
SCORE_IN, SCORE_OUT = 0.99, 0.05
# ML Kit finds nobody in people smaller than this; the paper's long-range views are 20-25 px
SMALLEST_PX = 60.0


def detect(seen: View, noise_px: float, random: np.random.Generator) -> Detected:
    """What the detector makes of a `truth.View`."""
    uv, depth, status = (seen.landmark(values) for values in (seen.uv, seen.depth, seen.status))
    inside = (status == "ok") | (status == "occluded")
    noise = noise_px * random.standard_normal(uv.shape)
    never = np.zeros(inside.shape, bool)
    return Detected(
        uv=uv + noise,
        score=np.where(inside, SCORE_IN, SCORE_OUT),
        z=relative_depth(seen.camera, depth),
        found=detectable(uv, inside),
        noise=noise,
        bias=np.zeros(uv.shape),
        swapped=never,
        guessed=never,
        wrong_together=never,
        bystander=never,
    )


def detectable(uv: Floats, inside: Bools) -> Bools:
    """Whether (F,) a person with landmarks uv (F, 33, 2) is large enough and enough of them is `inside` (F, 33)."""
    with np.errstate(invalid="ignore"):
        tall = np.fmax.reduce(uv[..., 1], axis=1) - np.fmin.reduce(uv[..., 1], axis=1) >= SMALLEST_PX
    return (inside.mean(axis=1) >= LEAST_IN_PICTURE) & tall & np.isfinite(uv).all(axis=(1, 2))


def relative_depth(camera: Camera, depth: Floats) -> Floats:
    """ML Kit's z (F, 33): depth (F, 33) m behind the middle of the hips, in pixels at their distance."""
    middle = depth[:, 23:25].mean(axis=1, keepdims=True)
    return (depth - middle) * camera.intrinsics.fx / middle


def write_mlkit(path: Path, clock: Clock, detected: Detected) -> None:
    """Write one camera's detections as ML Kit JSON lines, a line per recorded message of its `clocks.Clock`."""
    lines = []
    uv, z, score = detected.uv.round(2).tolist(), detected.z.round(2).tolist(), detected.score.tolist()
    for frame, picture in enumerate(clock.messages.tolist()):
        landmarks = [
            {"type": i, "x": x, "y": y, "z": z[picture][i], "inFrameLikelihood": score[picture][i]}
            for i, (x, y) in enumerate(uv[picture] if detected.found[picture] else [])
        ]
        lines.append(json.dumps({"frame": frame, "stamp_ns": int(clock.stamp_ns[picture]), "landmarks": landmarks}))
    write_text(path, "\n".join(lines) + "\n")


def write_mediapipe(path: Path, clock: Clock, lens: Intrinsics, people: Sequence[Detected]) -> None:
    """Write one camera's detections of some people as MediaPipe's JSON lines, a line per recorded message.

    The people of a picture come in no order that tells who they are: from left to right.
    """
    size = np.array([lens.width, lens.height])
    fractions = [((one.uv + 0.5) / size).round(7).tolist() for one in people]
    z, score = [(one.z / lens.width).round(7).tolist() for one in people], [one.score.tolist() for one in people]
    lines = []
    for frame, picture in enumerate(clock.messages.tolist()):
        found = [who for who, one in enumerate(people) if one.found[picture]]
        found.sort(key=lambda who: people[who].uv[picture, :, 0].mean())
        poses = [
            [
                {"x": x, "y": y, "z": z[who][picture][i], "visibility": score[who][picture][i]}
                for i, (x, y) in enumerate(fractions[who][picture])
            ]
            for who in found
        ]
        lines.append(json.dumps({"frame": frame, "pose_landmarks": poses}))
    write_text(path, "\n".join(lines) + "\n")
