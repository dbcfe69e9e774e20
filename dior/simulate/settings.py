"""The `simulate:` section of config.yaml: what is recorded, by which cameras, with which errors.

Lengths are metres, times seconds, angles degrees, picture quantities pixels; the defaults are the demo.
"""

import hashlib
from dataclasses import dataclass, field, fields
from pathlib import Path

import numpy as np

from dior.errors import DiorError, nearest

CAMERAS = ("cam01", "cam02", "cam03", "cam04")
COMPUTERS = {"pc1": ("cam01", "cam02"), "pc2": ("cam03", "cam04")}
SESSIONS = {"indoor": "lab", "outdoor": "field"}
WALKS = ("across", "along")
OUTFITS = ("shirt", "jacket")
LEVELS = ("ideal",)


@dataclass(frozen=True)
class Detector:
    level: str = "ideal"  # ideal: white noise, nothing missed
    noise_px: float = 2.0  # standard deviation of a landmark in u and in v


@dataclass(frozen=True)
class Settings:
    """All keys of the `simulate:` section."""

    seed: int = 1  # every random number of the capture derives from it
    subjects: int = 2  # number of people
    sequences: int = 2  # walks of each person in each environment
    environments: tuple = ("indoor", "outdoor")  # indoor: with motion capture; outdoor: with a long-range camera
    duration_s: float = 10.0  # length of a recording
    fps: float = 30.0  # pictures per second of every camera
    mocap_hz: float = 100.0  # rate of the motion capture
    mocap_noise_mm: float = 0.2  # standard deviation of a marker coordinate
    width: int = 1280  # picture width
    height: int = 720  # picture height
    fx: float = 640.0  # focal length of the close cameras (D455 at 1280x720)
    long_range_fx: float = 760.0  # focal length of the long-range camera; a person is 20-25 px tall at 60 m
    long_range_m: float = 60.0  # distance of the long-range camera from the middle of the walkway
    tape_sigma_m: float = 0.05  # error of a tape-measured coordinate
    long_range_tape_sigma_m: float = 0.3  # the same along the range of the long-range camera
    aim_sd_deg: float = 2.0  # how far the axis of a close camera misses the tape target, per angle
    mark_noise_px: float = 1.0  # error of a hand mark in u and in v
    box_margin_px: float = 3.0  # how much too large a hand-drawn box is, on each edge
    box_sd_px: float = 1.0  # random error of each edge of a box
    nudge_sd_deg: float = 0.02  # what is left of the long-range camera's aim after nudging by hand
    nudge_sd_m: float = 0.1  # the same of its distance
    jpeg_quality: int = 85  # of the recorded pictures
    motion: str | None = None  # path of a C3D whose walk is used instead of the parametric walker
    detector: Detector = field(default_factory=Detector)


def from_dict(values):
    """`Settings` from the parsed section. Raises DiorError for an unknown key or a value of the wrong kind."""
    given = _checked(Settings, dict(values or {}), "simulate")
    given["detector"] = Detector(**_checked(Detector, dict(given.get("detector") or {}), "simulate.detector"))
    if "environments" in given:
        given["environments"] = tuple(given["environments"])
    settings = Settings(**given)
    for environment in settings.environments:
        if environment not in SESSIONS:
            raise DiorError(f"simulate.environments: '{environment}' is unknown{nearest(environment, SESSIONS)}")
    if settings.detector.level not in LEVELS:
        raise DiorError(
            f"simulate.detector.level: '{settings.detector.level}' is unknown{nearest(settings.detector.level, LEVELS)}"
        )
    for key in ("subjects", "sequences", "duration_s", "fps", "mocap_hz", "width", "height", "fx", "long_range_fx"):
        if not getattr(settings, key) > 0:
            raise DiorError(f"simulate.{key} is {getattr(settings, key)}: it must be above 0")
    return settings


def _checked(cls, values, where):
    kinds = {f.name: f.type for f in fields(cls)}
    for key, value in values.items():
        if key not in kinds:
            raise DiorError(f"{where} has no key '{key}'{nearest(key, kinds)}")
        wanted = {int: int, float: (int, float), str: str}.get(kinds[key])
        if wanted and (isinstance(value, bool) or not isinstance(value, wanted)):
            raise DiorError(f"{where}.{key}: '{value}' is not of type {kinds[key].__name__}")
    return values


@dataclass(frozen=True)
class Sequence:
    """One simulated walk."""

    name: str
    environment: str
    session: str
    subject: str
    outfit: str
    walk: str


def sequences(settings):
    """All walks of the capture: subject by subject in each environment."""
    found = []
    for environment in settings.environments:
        for i in range(settings.subjects * settings.sequences):
            person, take = divmod(i, settings.sequences)
            found.append(
                Sequence(
                    f"{environment}_{i + 1:02d}",
                    environment,
                    SESSIONS[environment],
                    f"S{person + 1:02d}",
                    OUTFITS[take % len(OUTFITS)],
                    WALKS[take % len(WALKS)],
                )
            )
    return found


def sequence_named(settings, name):
    """The walk of that name. Raises DiorError with the nearest name."""
    known = {sequence.name: sequence for sequence in sequences(settings)}
    if name not in known:
        raise DiorError(f"the simulated capture has no sequence '{name}'{nearest(name, known)}")
    return known[name]


def generator(settings, *names):
    """A random generator of its own for every purpose, so that adding one thing does not move another."""
    digest = hashlib.sha256("\0".join(map(str, names)).encode()).digest()
    return np.random.default_rng([settings.seed, *np.frombuffer(digest[:16], "<u4").tolist()])


def pictures_per_camera(settings):
    """Number of pictures that each camera records of a sequence."""
    return int(round(settings.duration_s * settings.fps))


def motion_path(settings):
    """The C3D of `motion`, or None. Raises DiorError where it is missing."""
    if settings.motion is None:
        return None
    path = Path(settings.motion)
    if not path.is_file():
        raise DiorError(f"simulate.motion: there is no file {path}")
    return path
