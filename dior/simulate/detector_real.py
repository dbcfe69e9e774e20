"""The simulated 2D detector, level `real`: wrong in the ways in which pose networks are wrong.

INPUTS   the `truth.View` of every camera of a walk, the second person as they see him, `settings.Detector`
OUTPUTS  `Detected` of every camera: recorded pixels, and what was done to each landmark

A landmark is its true pixel, a constant offset for its side of the body, AR(1) noise and, where it is hidden, the
error of a guess. Then whole pictures go wrong, in runs: two views take one limb for the other, left and right are
exchanged, the second person is found instead, or nobody.
"""

from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dior.arrays import Bools, Floats, Ints
from dior.body.names import MLKIT_33, swap_index
from dior.geometry.camera import Camera
from dior.simulate.bystander import SecondPerson
from dior.simulate.detector import SCORE_OUT, detectable, relative_depth
from dior.simulate.runs import runs
from dior.simulate.settings import Sequence, Settings, generator, pictures_per_camera
from dior.simulate.truth import Detected, View

SIDES = ("front", "left", "back", "right")
# chosen: time after which the autocorrelation of a guess is 1/e; slower than the noise of what is seen
GUESS_TIME_S = 0.5
_MIRROR = swap_index(MLKIT_33)
_ARM, _LEG = ("elbow", "wrist", "pinky", "index", "thumb"), ("knee", "ankle", "heel", "foot_index")
LIMBS = [[MLKIT_33.index(f"{side}_{part}") for part in parts] for side in ("left", "right") for parts in (_ARM, _LEG)]
LEGS = [i for i, name in enumerate(MLKIT_33) if name.endswith(("hip", *_LEG))]


def detect(
    settings: Settings, sequence: Sequence, height: float, views: dict[str, View], others: dict[str, SecondPerson]
) -> dict[str, Detected]:
    """`Detected` by camera.

    `views` and `others`: camera -> `truth.View` and `bystander.SecondPerson`; `height` of the body, m.
    """
    wrong = _wrong_together(settings, sequence, views)
    return {
        camera: _one_camera(settings, sequence, height, seen, others[camera], wrong[camera])
        for camera, seen in views.items()
    }


def _one_camera(
    settings: Settings, sequence: Sequence, height: float, seen: View, other: SecondPerson, wrong: Bools
) -> Detected:
    errors = settings.detector
    draw = generator(settings, "real detector", sequence.name, seen.camera.name)
    uv, depth, status = (seen.landmark(values) for values in (seen.uv, seen.depth, seen.status))
    inside, hidden = (status == "ok") | (status == "occluded"), status == "occluded"
    count, seconds = len(uv), seen.clock.seconds
    size = (seen.camera.intrinsics.fx * height / depth[:, 23:25].mean(axis=1))[:, None, None]
    side = view_side(seen.landmarks, seen.camera)
    bias = _table(settings, "detector bias", errors.bias)[side]
    guess = _table(settings, "guess bias", errors.guess_bias)[side]
    guess = guess + ar1(draw, seconds, uv.shape, errors.guess_sd, GUESS_TIME_S, errors.noise_dof)
    bias = size * (bias + np.where(hidden[..., None], guess, 0.0))
    sd = draw.uniform(*errors.noise_sd_px, (len(MLKIT_33), 1))
    noise = ar1(draw, seconds, uv.shape, sd, errors.noise_time_s, errors.noise_dof)
    between = np.where(hidden[..., None], errors.score_guessed, errors.score_seen)
    score = np.where(inside, draw.uniform(between[..., 0], between[..., 1]), SCORE_OUT).round(4)
    seen_uv = np.where(wrong[..., None], uv[:, _MIRROR], uv) + bias + noise

    swap_run = runs(draw, count, errors.swapped, errors.swapped_frames)
    legs_only = draw.random(count + 1) < errors.swapped_legs
    swapped = (swap_run >= 0)[:, None] & (np.isin(np.arange(len(MLKIT_33)), LEGS) | ~legs_only[swap_run][:, None])
    swapped &= _MIRROR != np.arange(len(MLKIT_33))

    def labelled(values: NDArray[Any]) -> NDArray[Any]:
        """Values (P, 33, ...) under the names that the detector gives them."""
        return np.where(swapped.reshape(*swapped.shape, *(1,) * (values.ndim - 2)), values[:, _MIRROR], values)

    uv_out, score, noise, bias, guessed, wrong = (labelled(v) for v in (seen_uv, score, noise, bias, hidden, wrong))
    z = relative_depth(seen.camera, labelled(depth))
    able = detectable(uv, inside)
    missed = runs(draw, count, errors.missed, errors.missed_frames) >= 0
    found = Detected(
        uv_out, score, z, able & ~missed, noise, bias, swapped, guessed, wrong, np.zeros(hidden.shape, bool)
    )
    if not other.present.any():
        return found
    there = np.flatnonzero(other.present)
    there = there[detectable(other.uv[there], other.inside[there]) & able[there]]
    taken = np.zeros(count, bool)
    taken[there] = runs(draw, len(there), errors.taken, errors.taken_frames) >= 0
    strange = other.uv + ar1(draw, seconds, uv.shape, sd, errors.noise_time_s, errors.noise_dof)
    return _taken(found, taken & ~missed, seen.camera, other, strange, draw.uniform(*errors.score_seen, score.shape))


def _taken(found: Detected, taken: Bools, camera: Camera, other: SecondPerson, uv: Floats, score: Floats) -> Detected:
    """`Detected` with the second person, at pixels `uv` (P, 33, 2), in the pictures `taken` (P,)."""
    mine = ~taken[:, None]
    score = np.where(other.inside, score, SCORE_OUT).round(4)
    return Detected(
        uv=np.where(mine[..., None], found.uv, uv),
        score=np.where(mine, found.score, score),
        z=np.where(mine, found.z, relative_depth(camera, other.depth)),
        found=found.found,
        noise=np.where(mine[..., None], found.noise, np.nan),
        bias=np.where(mine[..., None], found.bias, np.nan),
        swapped=found.swapped & mine,
        guessed=found.guessed & mine,
        wrong_together=found.wrong_together & mine,
        bystander=np.broadcast_to(~mine, score.shape),
    )


def ar1(
    random: np.random.Generator, seconds: Floats, shape: tuple[int, ...], sd: float | Floats, time_s: float, dof: float
) -> Floats:
    """Noise of `shape` (F, ...) at `seconds` (F,): first-order autoregressive, autocorrelation exp(-dt/time_s).

    The innovations are Student t with `dof` degrees of freedom, scaled so that the noise has the standard deviation
    `sd`, whatever the spacing of the pictures.
    """
    scale = np.sqrt((dof - 2) / dof) * sd
    white = random.standard_t(dof, shape) * scale
    keep = np.exp(-np.diff(seconds) / time_s)
    out = np.empty(shape)
    out[0] = white[0]
    for i, (k, rest) in enumerate(zip(keep.tolist(), np.sqrt(1 - keep**2).tolist(), strict=True), 1):
        out[i] = k * out[i - 1] + rest * white[i]
    return out


def view_side(landmarks: Floats, camera: Camera) -> Ints:
    """Which side of the body (index into `SIDES`, (F,)) a camera sees; landmarks (F, 33, 3) m."""
    at = {name: landmarks[:, MLKIT_33.index(name), :2] for name in MLKIT_33[11:13] + MLKIT_33[23:25]}
    left = at["left_shoulder"] - at["right_shoulder"] + at["left_hip"] - at["right_hip"]
    to_camera = camera.centre[:2] - (at["left_hip"] + at["right_hip"]) / 2
    forward = np.stack([left[:, 1], -left[:, 0]], axis=-1)
    angle = np.arctan2((left * to_camera).sum(axis=-1), (forward * to_camera).sum(axis=-1))
    return np.round(angle / (np.pi / 2)).astype(int) % len(SIDES)


def _table(settings: Settings, name: str, rms: float) -> Floats:
    """Offsets (sides, 33, 2) with the rms length `rms`: the detector's own, the same in every camera and sequence."""
    table = generator(settings, name).standard_normal((len(SIDES), len(MLKIT_33), 2))
    return table * rms / np.sqrt(2)


def _wrong_together(settings: Settings, sequence: Sequence, views: dict[str, View]) -> dict[str, Bools]:
    """Where two views take one limb for the other: camera -> (F, 33) bool. Their rays meet, at the wrong limb."""
    errors = settings.detector
    draw = generator(settings, "wrong together", sequence.name)
    count = pictures_per_camera(settings) + int(settings.fps)
    run = runs(draw, count, errors.wrong_together, errors.wrong_frames)
    close = [name for name, seen in views.items() if seen.placed.camera.role == "close"]
    pairs = list(combinations(close, 2))
    start = min(seen.clock.seconds[0] for seen in views.values())
    limb, pair = draw.integers(len(LIMBS), size=count), draw.integers(len(pairs), size=count)
    out = {}
    for name, seen in views.items():
        tick = np.minimum(((seen.clock.seconds - start) * settings.fps).astype(int), count - 1)
        out[name] = np.zeros((len(tick), len(MLKIT_33)), bool)
        for number in np.unique(run[run >= 0]).tolist():
            if name in pairs[pair[number]]:
                out[name][np.ix_(run[tick] == number, LIMBS[limb[number]])] = True
    return out
