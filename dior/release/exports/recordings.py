"""What a finished release holds, as the exports need it: its walks, and its recordings (a walk as one camera sees it).

INPUTS   a release folder: sequences, splits, cameras, labels_2d, skeletons_3d and frames (dior/tables/schemas/)
OUTPUTS  `Release` with its walks and recordings in order; labels, bodies and pictures of one of them in memory
Nothing is read but the release, so that what is not in it is in no export.
"""

import json
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dior.arrays import AnyPath, Floats, Ints
from dior.errors import DiorError
from dior.geometry import camera_tables
from dior.geometry.camera import Camera
from dior.release.exports.writing import plain
from dior.tables import tables
from dior.tables.words import LABEL_STATUS

SUBJECT_SPLIT = "subject"
# pictures in memory at once; chosen: it bounds the memory
AT_A_TIME = 64


@dataclass(frozen=True)
class ReleasedWalk:
    """One sequence of a subject (a pseudonym). `outfit` and `walk` are free text, possibly empty. `nth`: counted from 1
    over the subject's walks in that environment and outfit."""

    subject: str
    sequence: str
    session: str
    environment: str
    outfit: str
    walk: str
    nth: int
    skeleton: Path


@dataclass(frozen=True)
class Recording:
    """One camera of a walk; `parts`: in which part of each split it is."""

    walk: ReleasedWalk
    camera: Camera
    labels: Path
    frames: Path
    parts: dict[str, str] = field(default_factory=dict)

    @property
    def name(self) -> str:
        return f"{self.walk.sequence}.{self.camera.name}"

    @property
    def part(self) -> str:
        """Its part of the split by subject, `all` where the release has none."""
        return self.parts.get(SUBJECT_SPLIT, "all")


@dataclass(frozen=True)
class Release:
    """A release folder: walks by (subject, order of recording), recordings by walk and camera."""

    folder: Path
    walks: tuple[ReleasedWalk, ...]
    recordings: tuple[Recording, ...]


@dataclass(frozen=True, eq=False)
class Labels:
    """Labels of F pictures and J joints: `frame`, `stamp_ns` (F,), `uv`, `sigma` (F, J, 2) px, `depth` (F, J) m, NaN
    where there is none; `status` (F, J): indices into `LABEL_STATUS`."""

    joints: tuple[str, ...]
    frame: Ints
    stamp_ns: Ints
    uv: Floats
    sigma: Floats
    depth: Floats
    status: NDArray[np.int8]


@dataclass(frozen=True, eq=False)
class Body:
    """A walk in 3D: `stamp_ns` (I,), `points` (I, J, 3) m in the world, Z up, NaN where there is none."""

    joints: tuple[str, ...]
    stamp_ns: Ints
    points: Floats


def read(folder: AnyPath) -> Release:
    """The `Release` in a folder. Raises DiorError for a folder that is none and for a walk without its tables."""
    folder = Path(folder)
    if not (folder / "sequences.parquet").is_file():
        raise DiorError(f"{folder}: no release (it has no sequences.parquet); build it with the rule `package`")
    rig = camera_tables.read_released_cameras(folder / "cameras.parquet")
    parts = _parts(folder / "splits.parquet")
    walks = _walks(folder)
    recordings = []
    for walk in walks:
        for path in sorted((folder / "labels_2d" / walk.subject).glob(f"{walk.sequence}.*.parquet")):
            name = path.name.removeprefix(f"{walk.sequence}.").removesuffix(".parquet")
            camera = rig.get((walk.session, name))
            if camera is None or camera.wTc is None:
                raise DiorError(f"{path}: cameras.parquet gives no pose of camera {name} in session {walk.session}")
            frames = folder / "frames" / walk.subject / path.name
            own = parts.get((walk.subject, walk.sequence, name), {})
            recordings.append(Recording(walk, camera, path, frames, own))
    for walk in walks:
        if not any(recording.walk == walk for recording in recordings):
            raise DiorError(f"{folder}: sequence {walk.sequence} of {walk.subject} has no labels; build it again")
    return Release(folder, tuple(walks), tuple(recordings))


def _walks(folder: Path) -> list[ReleasedWalk]:
    rows = tables.read(folder / "sequences.parquet", "sequences")
    order = sorted(
        range(len(rows["sequence"])),
        key=lambda i: (rows["subject"][i], rows["session"][i], rows["session_order"][i], rows["sequence"][i]),
    )
    seen: dict[tuple[str, str, str], int] = {}
    walks = []
    for i in order:
        row = {key: rows[key][i] for key in ("subject", "sequence", "session", "environment", "outfit", "walk")}
        # outfits whose letters are the same give the same name of a file, so they are counted as one
        kind = row["subject"], row["environment"], plain(row["outfit"])
        seen[kind] = seen.get(kind, 0) + 1
        path = folder / "skeletons_3d" / row["subject"] / f"{row['sequence']}.parquet"
        walks.append(ReleasedWalk(**row, nth=seen[kind], skeleton=path))
    return walks


def _parts(path: Path) -> dict[tuple[str, str, str], dict[str, str]]:
    """(subject, sequence, camera) -> split -> part."""
    found: dict[tuple[str, str, str], dict[str, str]] = {}
    if path.is_file():
        t = tables.read(path, "splits")
        for row in zip(*(t[key] for key in ("subject", "sequence", "camera", "split", "part")), strict=True):
            found.setdefault(row[:3], {})[row[3]] = row[4]
    return found


def settings_of(folder: Path) -> dict[str, Any]:
    """The `release:` section of the config that a release was made with, as provenance.json has it; {} without one."""
    path = folder / "provenance.json"
    if not path.is_file():
        return {}
    settings = json.loads(path.read_text(encoding="utf-8")).get("config", {})
    return {key.removeprefix("release."): value for key, value in settings.items() if key.startswith("release.")}


def labels_of(recording: Recording) -> Labels:
    """`Labels` of a recording. Raises DiorError where rows are missing."""
    columns = ("joint", "frame", "stamp_ns", "u", "v", "sigma_u", "sigma_v", "depth", "status")
    t = tables.read_coded(recording.labels, "labels_2d", list(columns))
    joints, shape = _complete(t["joint"], recording.labels)
    code = [LABEL_STATUS.index(word) for word in t["status"].words]

    def pair(u: str, v: str) -> Floats:
        return np.stack([t[u], t[v]], axis=-1).astype(float).reshape(*shape, 2)

    return Labels(
        joints,
        t["frame"].reshape(shape)[:, 0],
        t["stamp_ns"].reshape(shape)[:, 0],
        pair("u", "v"),
        pair("sigma_u", "sigma_v"),
        t["depth"].astype(float).reshape(shape),
        np.array(code, np.int8)[t["status"].index].reshape(shape),
    )


def body_of(walk: ReleasedWalk) -> Body:
    """`Body` of a walk. Raises DiorError where rows are missing."""
    t = tables.read_coded(walk.skeleton, "skeletons_3d", ["joint", "stamp_ns", "x", "y", "z"])
    joints, shape = _complete(t["joint"], walk.skeleton)
    points = np.stack([t[axis] for axis in "xyz"], axis=-1).astype(float).reshape(*shape, 3)
    return Body(joints, t["stamp_ns"].reshape(shape)[:, 0], points)


def _complete(joint: tables.Repeated, path: Path) -> tuple[tuple[str, ...], tuple[int, int]]:
    """The joints of complete rows sorted by (frame or instant, joint), and the shape (frames, joints)."""
    count = len(joint.index) if not len(joint.index) else len(set(joint.index.tolist()))
    if not count or len(joint.index) % count:
        raise DiorError(f"{path}: not every frame has a row for every joint; build the release again")
    rows = joint.index.reshape(-1, count)
    if (rows != rows[0]).any() or len(set(rows[0].tolist())) != count:
        raise DiorError(f"{path}: the joints are not in the same order in every frame; build the release again")
    return tuple(joint.words[i] for i in rows[0]), rows.shape


def pictures_of(recording: Recording) -> Iterator[tuple[int, bytes]]:
    """Yield (frame, JPEG bytes) of the released pictures of a recording; a few at a time are in memory."""
    if not recording.frames.is_file():
        return
    for t in tables.read_in_parts(recording.frames, "released_frames", ["frame", "image"], AT_A_TIME):
        for frame, jpeg in zip(t["frame"].tolist(), t["image"], strict=True):
            if jpeg is not None:
                yield frame, jpeg


def missing_pictures(recording: Recording) -> dict[int, str]:
    """Why there is no picture, by frame; without reading the pictures."""
    if not recording.frames.is_file():
        return {}
    t = tables.read(recording.frames, "released_frames", ["frame", "no_image"])
    return {int(frame): why for frame, why in zip(t["frame"], t["no_image"], strict=True) if why}
