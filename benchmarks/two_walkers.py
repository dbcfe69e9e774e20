"""Two people on one walkway, seen by three or four close cameras, in memory and with known truth.

Kinds of captures (`KINDS`): who is there, and whom the detectors give.
"""

from dataclasses import dataclass, replace

import numpy as np

from benchmarks import scene
from dior.body.names import MLKIT_33
from dior.ingest import people as tracking
from dior.ingest.people import People
from dior.simulate import bystander, detector, detector_real, truth
from dior.simulate import settings as levels
from dior.simulate.body import SHANK, THIGH, TRUNK, Body
from dior.simulate.gait import Walker
from dior.tables import tables

FPS, SECONDS = 30.0, 10.0
# of `benchmarks.everyone` alone: the other walks across the subject's way, and passes at this distance or more, m
CROSSING, PASSES_M = "crossing", 0.45
# the place of a kind is part of its seeds
_ALL = (
    *("clean", "together", "another", "one_camera", "mostly_one_camera", "same_build", "two_cameras"),
    *(CROSSING, "proportions", "facing"),
)
KINDS = tuple(kind for kind in _ALL if kind != CROSSING)
# Of people of one height the length of thigh, shank and trunk together, as a share of it. Chosen: what is left are the
# neck, the head and the foot, of which the first two are about 0.17 of the height
BONES_SD = 0.01
# chosen: m, on how much of the walk the second person is beside the subject
BESIDE_M = (0.9, 1.3)
OTHER_WALK = 1000  # added to the seed of the detector in another walk
AWAY_S = 3.0  # how long the subject is away, and another walks
HEIGHT_SIGMA_M = 0.01


@dataclass(frozen=True, eq=False)
class Capture:
    """V cameras, T pictures of each at the same moments, 33 landmarks.

    `points` (2, T, 33, 3) m of the subject and of the other, `there` (2, T) when they are in the pictures; `people`:
    what each camera's detector gives; `owner`: per camera (P,), whose (0, 1) the rows of `people` are; `height_m` as
    measured, and `body`, of the subject.
    """

    cameras: tuple
    seconds: np.ndarray
    points: np.ndarray
    there: np.ndarray
    people: tuple
    owner: tuple
    height_m: float
    body: Body
    names: tuple = MLKIT_33


def make(kind, level, seed, views=None, taller=None):
    """`Capture` of a kind, or CROSSING, by 3 `views`; `facing` by 2.

    `taller`: by how much the other is taller than the subject, m, else drawn.
    """
    random = np.random.default_rng([seed, _ALL.index(kind), levels.LEVELS.index(level)])
    views = views or (2 if kind == "facing" else 3)
    turn = random.uniform(0, 360)
    around = turn + np.arange(views) * 360 / views + random.uniform(-12, 12, views)
    cameras = [
        scene.camera(f"cam{i + 1:02d}", angle, random.uniform(4.8, 5.6), random.uniform(1.3, 1.7))
        for i, angle in enumerate(around.tolist())
    ]
    height = random.uniform(1.66, 1.84)
    if taller is None:
        taller = random.choice([-1, 1]) * random.uniform(0.04, 0.10)
    if kind in ("same_build", "two_cameras"):
        taller = 0.0
    count = round(SECONDS * FPS)
    seconds = np.arange(count) / FPS
    direction, start = random.uniform(0, np.pi), random.uniform(0, 8)
    speed = random.uniform(1.0, 1.2)
    beside = random.uniform(*BESIDE_M) * random.choice([-1, 1])
    aside = beside * np.array([-np.sin(direction), np.cos(direction), 0.0])
    phase = random.uniform(-0.4, 0.4)
    builds = BONES_SD * random.standard_normal(2) if kind == "proportions" else np.zeros(2)
    bodies = [_body(tall, more) for tall, more in zip((height, height + taller), builds.tolist(), strict=True)]
    own = Walker(bodies[0], speed=speed, direction=direction, start=start, until=SECONDS + 1)
    other = Walker(
        bodies[1], speed=speed * random.uniform(0.97, 1.03), direction=direction, start=start + phase,
        until=SECONDS + 1,
    )  # fmt: skip
    points = np.stack([own.at(seconds)[0], other.at(seconds)[0] + aside])
    if kind == "another":
        points[1] = other.at(seconds)[0] + aside
    while kind == CROSSING:
        across = replace(other, direction=direction + np.pi / 2, start=random.uniform(0, 8))
        points[1] = across.at(seconds)[0]
        hips = points[:, :, 23:25, :2].mean(axis=2)
        if np.linalg.norm(hips[0] - hips[1], axis=1).min() >= PASSES_M:
            break
    there = np.ones((2, count), bool)
    if kind == "clean":
        there[1] = False
    if kind == "another":
        begin = round(random.uniform(1.5, SECONDS - AWAY_S - 1.5) * FPS)
        there[1] = (np.arange(count) >= begin) & (np.arange(count) < begin + round(AWAY_S * FPS))
        there[0] = ~there[1]
    given = _given(kind, random, views, there)
    found = [_detected(level, seed, who, cameras, points[who], (height, height + taller)[who]) for who in range(2)]
    people, owner = zip(*[_people(found, given[:, v], v, seconds) for v in range(views)], strict=True)
    measured = height + HEIGHT_SIGMA_M * random.standard_normal()
    return Capture(tuple(cameras), seconds, points, there, people, owner, measured, bodies[0])


def alone(capture, level, seed):
    """`Capture` of another walk of the subject, by the same cameras: elsewhere, another way, nobody else there."""
    random = np.random.default_rng([seed, len(_ALL), levels.LEVELS.index(level)])
    walker = Walker(
        capture.body, speed=random.uniform(1.0, 1.2), direction=random.uniform(0, np.pi), start=random.uniform(0, 8),
        until=SECONDS + 1,
    )  # fmt: skip
    own = walker.at(capture.seconds)[0]
    found = [_detected(level, seed + OTHER_WALK, 0, capture.cameras, own, capture.body.height)]
    given = np.ones((1, len(capture.seconds)), bool)
    views = range(len(capture.cameras))
    people, owner = zip(*[_people(found, given, view, capture.seconds) for view in views], strict=True)
    return replace(capture, points=own[None], there=given, people=people, owner=owner)


def _body(height, more):
    """A body whose thigh, shank and trunk are longer by a share `more` of the height, each as its length."""
    longer = 1 + more / (THIGH + SHANK + TRUNK)
    return Body(height, thigh_share=longer * THIGH, shank_share=longer * SHANK, trunk_share=longer * TRUNK)


def _given(kind, random, views, there):
    """Whom each camera's detector gives (2, V, T), of those who are there."""
    given = np.repeat(there[:, None], views, axis=1)
    count = there.shape[1]
    if kind in ("one_camera", "mostly_one_camera", "two_cameras"):
        wrong = random.permutation(views)[: 2 if kind == "two_cameras" else 1]
        share = {"one_camera": 0.35, "mostly_one_camera": 0.7, "two_cameras": 1.0}[kind]
        begin = round(random.uniform(0, 1 - share) * count)
        taken = (np.arange(count) >= begin) & (np.arange(count) < begin + round(share * count))
        given[1] = False
        given[1][wrong] = taken
        given[0] &= ~given[1]
    return given


def _detected(level, seed, who, cameras, points, height):
    """What the detector of a level makes of one person in every camera, `truth.Detected` each."""
    settings = levels.from_dict(
        {"preset": level, "seed": seed, "subjects": 1, "sequences": 2, "duration_s": SECONDS, "bystander": 0.0,
         "occluder": False, "environments": ["outdoor"], "detector": {"level": level}}
    )  # fmt: skip
    walk = replace(levels.sequences(settings)[who], walk="across")
    motion = _Tall(height)
    seconds = np.arange(len(points)) / FPS
    seen = {c.name: scene._view(settings, walk, motion, c, seconds, points) for c in cameras}
    if level == "real":
        nobody = {c.name: bystander.seen(settings, walk, c, seconds) for c in cameras}
        return list(detector_real.detect(settings, walk, height, seen, nobody).values())
    noise = settings.detector.noise_px
    return [detector.detect(one, noise, truth.detector_generator(settings, walk, name)) for name, one in seen.items()]


@dataclass(frozen=True)
class _Tall:
    height: float


def _people(found, given, view, seconds):
    """`People` of one camera and whose they are, from `found` of both people and whom the detector gives (2, T)."""
    frame, person, uv, score, whose = [], [], [], [], []
    for t in range(len(seconds)):
        n = 0
        for who in range(len(found)):
            done = found[who][view]
            if given[who, t] and done.found[t]:
                frame.append(t), person.append(n), whose.append(who)
                uv.append(done.uv[t]), score.append(done.score[t])
                n += 1
    ran = np.arange(len(seconds))
    stamps = np.full(len(seconds), -1)
    people = People(MLKIT_33, np.array(frame), np.array(person), np.array(uv), np.array(score), ran, stamps)
    return people, np.array(whose)


def stamps(capture):
    return np.round(capture.seconds * 1e9).astype(np.int64)


def followed(capture):
    """What the per-camera choice makes of a capture: uv (V, T, J, 2), score (V, T, J) and whose it is (V, T) or -1."""
    uv, score, whose = [], [], []
    for people, owner in zip(capture.people, capture.owner, strict=True):
        row = tracking.follow(people, stamps(capture)).row
        uv.append(np.where((row >= 0)[:, None, None], people.uv[row], np.nan))
        score.append(np.where((row >= 0)[:, None], people.score[row], 0.0))
        whose.append(np.where(row >= 0, owner[row], -1))
    return np.stack(uv), np.stack(score), np.stack(whose)


def write_timeline(path, cameras, stamps_ns):
    """Write a `timeline` in which every instant is a picture of each of `cameras`."""
    count, views = len(stamps_ns), len(cameras)
    frame = np.repeat(np.arange(count), views)
    columns = {"instant": frame, "frame_before": frame, "frame_after": frame, "weight": np.zeros(count * views)}
    columns |= {"camera": np.tile(np.array(cameras, object), count), "stamp_ns": np.repeat(stamps_ns, views)}
    tables.write(path, "timeline", columns)
