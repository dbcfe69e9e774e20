"""The `simulate:` section of config.yaml: what is recorded, by which cameras, with which errors.

Lengths are metres, times seconds, angles degrees, picture quantities pixels; the defaults are the demo.
"""

import hashlib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, get_origin

import numpy as np

from dior.errors import DiorError, nearest

CAMERAS = ("cam01", "cam02", "cam03", "cam04")
COMPUTERS = {"pc1": ("cam01", "cam02"), "pc2": ("cam03", "cam04")}
SESSIONS = {"indoor": "lab", "outdoor": "field"}
WALKS = ("across", "along", "running", "straight", "circling")
OUTFITS = ("shirt", "jacket")
LEVELS = ("ideal", "real")
PEOPLE = ("same", "heights", "different")
FIGURES = ("plain", "dressed")
AROUND = ("body", "joints")


@dataclass(frozen=True)
class Detector:
    """Errors of the 2D detector; all but `level`, `noise_px` and `everybody` count at level `real` only."""

    level: str = "ideal"  # ideal: white noise, nothing missed; real: all of the below
    noise_px: float = 2.0  # ideal: standard deviation of a landmark in u and in v
    noise_sd_px: tuple[float, float] = (2.5, 3.5)  # real: range of a joint's standard deviation in u and in v
    noise_time_s: float = 0.15  # time after which the autocorrelation of the noise is 1/e
    noise_dof: float = 5.0  # degrees of freedom of its innovations (Student t), more than 2
    bias: float = 0.01  # rms length of a joint's constant offset for a side of the body, body heights
    guess_bias: float = 0.02  # the same, added where the joint is hidden
    guess_sd: float = 0.01  # slow noise added where the joint is hidden, body heights in u and in v
    score_seen: tuple[float, float] = (0.85, 0.99)  # range of the scores of joints that are seen
    score_guessed: tuple[float, float] = (0.3, 0.8)  # the same of joints that are hidden
    wrong_together: float = 0.02  # share of the time in which two views take one limb for the other
    wrong_frames: tuple[int, int] = (5, 20)  # how long that lasts, pictures
    swapped: float = 0.05  # share of the pictures in which left and right are exchanged
    swapped_frames: tuple[int, int] = (5, 40)  # how long that lasts, pictures
    swapped_legs: float = 0.4  # share of those runs in which only the legs are exchanged
    missed: float = 0.02  # share of the pictures in which nobody is found
    missed_frames: tuple[int, int] = (1, 5)  # how long that lasts, pictures
    taken: float = 0.2  # share of the bystander's pictures in which he is found instead of the subject
    taken_frames: tuple[int, int] = (3, 15)  # how long that lasts, pictures
    everybody: bool = False  # all people of a picture are found, with the same errors, and not one of them; any level


@dataclass(frozen=True)
class Clocks:
    """Errors of the stamps, and pictures that are lost or recorded twice. Each camera runs free in any case."""

    start_delay_s: tuple[float, float] = (0.40, 0.53)  # the cameras start this long after the motion capture
    apart_s: float = 0.02  # the cameras' clocks differ by up to this, either way
    drift_ppm: float = 0.0  # standard deviation of a camera's drift
    jitter_ms: float = 0.0  # standard deviation of a header stamp
    late_stamps: float = 0.0  # share of the header stamps that are late
    late_stamp_ms: float = 8.0  # by how much on average (exponential, less than a picture period)
    late_arrivals: float = 0.0  # share of the messages that reach the recorder late
    late_arrival_ms: float = 60.0  # by how much on average (exponential); those behind it queue
    dropped: float = 0.0  # share of the pictures that are not in the bag
    duplicated: float = 0.0  # share of the recorded messages that are there twice


# what a preset changes; the defaults are `ideal`
PRESETS: dict[str, dict[str, Any]] = {
    "ideal": {},
    "real": {
        "mocap_hz": 120.0,
        "mocap_gaps": 0.02,
        "soft_tissue_mm": [5.0, 10.0],
        "intrinsics_error": 0.003,
        "walks": ["across", "along", "running"],
        "bystander": 0.3,
        "occluder": True,
        "sun": True,
        "gallery": True,
        "detector": {"level": "real"},
        "clocks": {
            "drift_ppm": 20.0,
            "jitter_ms": 0.5,
            "late_stamps": 0.005,
            "late_arrivals": 0.01,
            "dropped": 0.01,
            "duplicated": 0.003,
        },
    },
}


@dataclass(frozen=True)
class Settings:
    """All keys of the `simulate:` section."""

    preset: str = "ideal"  # where the values of keys that are not given come from
    seed: int = 1  # every random number of the capture derives from it
    subjects: int = 2  # number of people
    sequences: int = 2  # walks of each person in each environment
    sessions: int = 1  # days in each environment, with other cameras; everybody comes on one of them
    people: str = "heights"  # same: one body and gait; heights: differ in height and speed; different: in all
    figure: str = "plain"  # how the body is drawn; dressed: stouter, with hair, thick shoes and a bag
    environments: tuple[str, ...] = (
        "indoor",
        "outdoor",
    )  # indoor: with motion capture; outdoor: with a long-range camera
    duration_s: float = 10.0  # length of a recording
    fps: float = 30.0  # pictures per second of every camera
    mocap_hz: float = 100.0  # rate of the motion capture
    mocap_noise_mm: float = 0.2  # standard deviation of a marker coordinate
    mocap_gaps: float = 0.0  # share of the ticks at which a marker is not seen
    mocap_gap_ticks: tuple[int, int] = (5, 40)  # length of such a gap
    soft_tissue_mm: tuple[float, float] = (0.0, 0.0)  # range of a marker's rms movement against the skeleton
    intrinsics_error: float = 0.0  # by how much the focal length in CameraInfo is wrong, as a share
    walks: tuple[str, ...] = ("across", "along")  # walk patterns, in turn
    bystander: float = 0.0  # share of a recording in which a second person stands by
    bystander_walks: bool = False  # the second person walks to and fro beside the walkway
    occluder: bool = False  # outdoors a wall hides the lower half of the body from the long-range camera
    sun: bool = False  # the sun stands in the long-range picture
    markers: bool = False  # the markers of the motion capture are drawn, so that they can be clicked
    gallery: bool = False  # pictures of each subject and outfit from all around
    width: int = 1280  # picture width
    height: int = 720  # picture height
    fx: float = 640.0  # focal length of the close cameras (D455 at 1280x720)
    long_range_fx: float = 760.0  # focal length of the long-range camera; a person is 20-25 px tall at 60 m
    long_range_m: float = 60.0  # distance of the long-range camera from the middle of the walkway
    tape_sigma_m: float = 0.05  # error of a tape-measured coordinate
    long_range_tape_sigma_m: float = 0.3  # the same along the range of the long-range camera
    aim_sd_deg: float = 2.0  # how far the axis of a close camera misses the tape target, per angle
    roll_deg: float = 0.0  # by how much the cameras in `rolled` are turned about their axis, 180 is upside down
    rolled: tuple[str, ...] = CAMERAS  # which cameras `roll_deg` is of
    mark_noise_px: float = 1.0  # error of a hand mark in u and in v
    box_around: str = "body"  # body: a person draws boxes around what is seen of the body; joints: a machine's
    box_margin_px: float = 3.0  # how much too large a hand-drawn box is, on each edge
    box_sd_px: float = 1.0  # random error of each edge of a box
    box_habit_px: float = 0.0  # sd of what each side is drawn further out than the others, the same in every box
    jpeg_quality: int = 85  # of the recorded pictures
    motion: str | None = None  # path of a C3D whose walk is used instead of the parametric walker
    detector: Detector = field(default_factory=Detector)
    clocks: Clocks = field(default_factory=Clocks)


SECTIONS = {"detector": Detector, "clocks": Clocks}
SHARES = ("mocap_gaps", "bystander")
POSITIVE = (
    "subjects",
    "sequences",
    "sessions",
    "duration_s",
    "fps",
    "mocap_hz",
    "width",
    "height",
    "fx",
    "long_range_fx",
)


def from_dict(values: Mapping[str, Any] | None) -> Settings:
    """`Settings` from the parsed section, with the preset's values where it says nothing.

    Raises DiorError for an unknown key or word, a value of the wrong kind and one out of its limits.
    """
    values = dict(values or {})
    preset = values.get("preset", "ideal")
    _known(preset, PRESETS, "simulate.preset")
    given = _checked(Settings, PRESETS[preset] | values, "simulate")
    for name, cls in SECTIONS.items():
        own = PRESETS[preset].get(name, {}) | dict(values.get(name) or {})
        given[name] = cls(**_checked(cls, own, f"simulate.{name}"))
    settings = Settings(**given)
    for environment in settings.environments:
        _known(environment, SESSIONS, "simulate.environments")
    for walk in settings.walks:
        _known(walk, WALKS, "simulate.walks")
    _known(settings.people, PEOPLE, "simulate.people")
    _known(settings.figure, FIGURES, "simulate.figure")
    _known(settings.box_around, AROUND, "simulate.box_around")
    _known(settings.detector.level, LEVELS, "simulate.detector.level")
    for camera in settings.rolled:
        _known(camera, CAMERAS, "simulate.rolled")
    for key in POSITIVE:
        if not getattr(settings, key) > 0:
            raise DiorError(f"simulate.{key} is {getattr(settings, key)}: it must be above 0")
    for shown, value in _shares(settings):
        if not 0 <= value < 1:
            raise DiorError(f"simulate.{shown} is {value}: a share must be at least 0 and below 1")
    return settings


def _known(word: str, words: Iterable[str], where: str) -> None:
    if word not in words:
        raise DiorError(f"{where}: '{word}' is unknown{nearest(word, words)}")


def _shares(settings: Settings) -> Iterator[tuple[str, float]]:
    detector = ("wrong_together", "swapped", "missed", "taken")
    clocks = ("late_stamps", "late_arrivals", "dropped", "duplicated")
    yield from ((key, getattr(settings, key)) for key in SHARES)
    yield from ((f"detector.{key}", getattr(settings.detector, key)) for key in detector)
    yield from ((f"clocks.{key}", getattr(settings.clocks, key)) for key in clocks)


def _checked(cls: type[Any], values: Mapping[str, Any], where: str) -> dict[str, Any]:
    kinds = {f.name: f.type for f in fields(cls)}
    found = {}
    for key, value in values.items():
        if key not in kinds:
            raise DiorError(f"{where} has no key '{key}'{nearest(key, kinds)}")
        kind: Any = kinds[key]
        many = get_origin(kind) is tuple
        wanted: Any = {int: int, float: (int, float), str: str, bool: bool}.get(kind, (list, tuple) if many else None)
        if wanted and (isinstance(value, bool) and kind is not bool or not isinstance(value, wanted)):
            raise DiorError(f"{where}.{key}: '{value}' is not of type {'list' if many else kind.__name__}")
        found[key] = tuple(value) if many else value
        if many and not isinstance(value[0] if value else None, str):
            _check_range(found[key], f"{where}.{key}")
    return found


def _check_range(value: tuple[Any, ...], where: str) -> None:
    numbers = all(isinstance(x, (int, float)) and not isinstance(x, bool) for x in value)
    if len(value) != 2 or not numbers or value[0] > value[1]:
        raise DiorError(f"{where} is {list(value)}: a range is two numbers, the smaller first")


@dataclass(frozen=True)
class Sequence:
    """One simulated walk."""

    name: str
    environment: str
    session: str
    subject: str
    outfit: str
    walk: str


def sequences(settings: Settings) -> list[Sequence]:
    """All walks of the capture: subject by subject in each environment."""
    found = []
    for environment in settings.environments:
        for i in range(settings.subjects * settings.sequences):
            person, take = divmod(i, settings.sequences)
            day = person % settings.sessions
            found.append(
                Sequence(
                    f"{environment}_{i + 1:02d}",
                    environment,
                    SESSIONS[environment] + (f"_{day + 1}" if day else ""),
                    f"S{person + 1:02d}",
                    OUTFITS[take % len(OUTFITS)],
                    settings.walks[i % len(settings.walks)],
                )
            )
    return found


def place_of(session: str) -> str:
    """Where a session is, on whichever day: `lab` or `field`."""
    return session.partition("_")[0]


def person(settings: Settings, subject: str) -> str:
    """Whose body and gait a subject has."""
    return "everybody" if settings.people == "same" else subject


def sequence_named(settings: Settings, name: str) -> Sequence:
    """The walk of that name. Raises DiorError with the nearest name."""
    known = {sequence.name: sequence for sequence in sequences(settings)}
    if name not in known:
        raise DiorError(f"the simulated capture has no sequence '{name}'{nearest(name, known)}")
    return known[name]


def detections_path(settings: Settings, sequence: str) -> str:
    """Where the detections of a walk lie below data_root, with {camera} in it: ML Kit's, who finds one person at most,
    or MediaPipe's."""
    return f"{sequence}/{'mediapipe' if settings.detector.everybody else 'mlkit'}/{{camera}}.jsonl"


def generator(settings: Settings, *names: object) -> np.random.Generator:
    """A random generator of its own for every purpose, so that adding one thing does not move another."""
    digest = hashlib.sha256("\0".join(map(str, names)).encode()).digest()
    return np.random.default_rng([settings.seed, *np.frombuffer(digest[:16], "<u4").tolist()])


def pictures_per_camera(settings: Settings) -> int:
    """Number of pictures that each camera records of a sequence."""
    return int(round(settings.duration_s * settings.fps))


def motion_path(settings: Settings) -> Path | None:
    """The C3D of `motion`, or None. Raises DiorError where it is missing."""
    if settings.motion is None:
        return None
    path = Path(settings.motion)
    if not path.is_file():
        raise DiorError(f"simulate.motion: there is no file {path}")
    return path
