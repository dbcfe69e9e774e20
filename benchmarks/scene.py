"""A walker seen by cameras around, in memory and with known truth: what the benchmarks of the geometry share.

The figures of ../shared/peers.md were measured in such a scene: 3 cameras at azimuths 0, 120 and 240 degrees, 5 m away,
fx 640, one walker, 2 px of white noise, all pictures taken at the same moments. `real` has the errors of the detector
of the same name in dior/simulate (design, section 9), and intrinsics that are 0.3 % off.
"""

from dataclasses import dataclass, replace

import numpy as np

from dior.body.names import MLKIT_33
from dior.geometry.camera import Camera, Intrinsics, pose
from dior.geometry.multiview import look_at
from dior.simulate import bystander, detector, detector_real, draw, scene, truth
from dior.simulate import settings as levels
from dior.simulate.body import body_of
from dior.simulate.clocks import Clock
from dior.simulate.motion import motion_of

AZIMUTHS = (0.0, 120.0, 240.0)
DISTANCE_M, HEIGHT_M, FX, FPS = 5.0, 1.5, 640.0, 30.0
OUTLIER_PX = (30.0, 80.0)


@dataclass(frozen=True)
class Scene:
    """V cameras, T moments, J = 33 landmarks.

    `cameras`: the true ones; `given`: the same poses with the intrinsics that the bag reports. `points` (T, J, 3) m,
    `uv` (V, T, J, 2) px as detected, NaN where nobody was, `score` (V, T, J), `true_uv` (V, T, J, 2), `status` the
    true status (V, T, J), `swapped` and `wrong` (V, T, J): what the detector did.
    """

    cameras: tuple
    given: tuple
    seconds: np.ndarray
    points: np.ndarray
    true_uv: np.ndarray
    status: np.ndarray
    uv: np.ndarray
    score: np.ndarray
    swapped: np.ndarray
    wrong: np.ndarray
    height_m: float
    names: tuple = MLKIT_33


def camera(name, azimuth_deg, distance_m=DISTANCE_M, height_m=HEIGHT_M, fx=FX, role="close", target=(0.0, 0.0, 1.0)):
    """An ideal 1280x720 camera that looks at the middle of the walkway."""
    angle = np.deg2rad(azimuth_deg)
    centre = np.array([distance_m * np.cos(angle), distance_m * np.sin(angle), height_m])
    return Camera(name, Intrinsics(1280, 720, fx, fx, 639.5, 359.5), pose(look_at(centre, target), centre), role)


def make(level="ideal", seed=0, frames=400, cameras=None, walk="across", take=0, motion=None, **errors):
    """`Scene` of one walk. `cameras`: true `Camera`s, else three around; `errors`: keys of the simulated detector;
    `motion`: a `Motion`, else that of the level.

    `take` counts the walks of one person with one detector, which the seed decides.
    """
    if cameras is None:
        cameras = [camera(f"cam{i + 1:02d}", azimuth) for i, azimuth in enumerate(AZIMUTHS)]
    settings = levels.from_dict(
        {
            "preset": level,
            "seed": seed,
            "subjects": 1,
            "sequences": take + 1,
            "duration_s": frames / FPS,
            "walks": [walk],
            "bystander": 0.0,
            "occluder": False,
            "detector": {"level": level, **errors},
        }
    )
    sequence = replace(levels.sequences(settings)[-1], walk=walk)
    seconds = np.arange(frames) / FPS
    motion = motion or motion_of(settings, sequence)
    landmarks, _ = motion.at(seconds)
    views = {c.name: _view(settings, sequence, motion, c, seconds, landmarks) for c in cameras}
    if level == "real":
        nobody = {c.name: bystander.seen(settings, sequence, c, seconds) for c in cameras}
        found = detector_real.detect(settings, sequence, motion.height, views, nobody)
    else:
        noise = settings.detector.noise_px
        found = {
            name: detector.detect(seen, noise, truth.detector_generator(settings, sequence, name))
            for name, seen in views.items()
        }
    each, seen = list(found.values()), list(views.values())
    nobody = ~np.stack([done.found for done in each])[..., None]
    return Scene(
        cameras=tuple(cameras),
        given=tuple(replace(c, intrinsics=scene.reported(settings, sequence.session, c)) for c in cameras),
        seconds=seconds,
        points=landmarks,
        true_uv=np.stack([v.uv for v in seen]),
        status=np.stack([v.status for v in seen]),
        uv=np.where(nobody[..., None], np.nan, np.stack([done.uv for done in each])),
        score=np.where(nobody, 0.0, np.stack([done.score for done in each])),
        swapped=np.stack([done.swapped for done in each]),
        wrong=np.stack([done.wrong_together for done in each]),
        height_m=body_of(settings, sequence.subject).height,
    )


def _view(settings, sequence, motion, placed, seconds, landmarks):
    """`truth.View` of a camera that takes its pictures at `seconds`."""
    uv, depth = scene.project(placed, landmarks)
    slack = motion.height * np.array([truth.depth_below_surface(name) for name in MLKIT_33])
    hidden = draw.hidden(placed, draw.figure(landmarks, motion.height), motion.height, landmarks, slack)
    inside = scene.in_picture(placed.intrinsics, uv)
    status = np.select([depth <= 0, ~inside, hidden], ["behind_camera", "out_of_frame", "occluded"], "ok")
    count = len(seconds)
    stamps = np.round(seconds * 1e9).astype(np.int64)
    clock = Clock(stamps, stamps, seconds, np.zeros(count, bool), 0.0)
    stands = scene.Placed(placed, tuple(placed.centre), (0.0, 0.0, 1.0), 0.0)
    return truth.View(stands, clock, seconds, landmarks, MLKIT_33, uv, depth, status)


def with_outliers(uv, share, seed=0):
    """Pixels uv (V, T, J, 2), a share of the points (T, J) off by 30-80 px in one view; and where (V, T, J)."""
    random = np.random.default_rng(seed)
    views, count, joints = uv.shape[:3]
    hit = random.random((count, joints)) < share
    view = random.integers(views, size=(count, joints))
    length, angle = random.uniform(*OUTLIER_PX, (count, joints)), random.uniform(0, 2 * np.pi, (count, joints))
    off = (length[..., None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1))[None]
    where = hit[None] & (view[None] == np.arange(views)[:, None, None])
    return np.where(where[..., None], uv + off, uv), where
