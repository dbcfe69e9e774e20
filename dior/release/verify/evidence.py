"""What the checks of a release look at (checks.py), read once and passed to all of them.

INPUTS   tables at the top of a release, its provenance.json, the tables of a walk. OUTPUTS: `Setup`, `Walk`, `Evidence`
"""

import json
from dataclasses import dataclass
from typing import Any

import numpy as np

from dior.arrays import Table
from dior.errors import DiorError
from dior.geometry.camera import Camera, Intrinsics
from dior.release.suspect import RedLight, without_place
from dior.release.verify.folder_or_tarball import File
from dior.release.verify.walk_checks import WalkFindings


@dataclass(frozen=True, eq=False)
class Setup:
    """What all walks of a release share.

    `cameras`: by (session, camera), None for one without a pose or a lens; `session`, `environment`: by sequence;
    `clocks`: (offset_s, drift_ppm) by (sequence, camera); `settings`: the config by dotted key, as provenance.json has
    it, {} without; `lights`: the red ones.
    """

    cameras: dict[tuple[str, str], Camera | None]
    session: dict[str, str]
    environment: dict[str, str]
    clocks: dict[tuple[str, str], tuple[float, float]]
    settings: dict[str, Any]
    lights: tuple[RedLight, ...] = ()

    def suspect(self, sequence: str, camera: str = "") -> bool:
        """Whether the labels of a camera, or without one the 3D, must have no place."""
        return bool({"", camera} & without_place(self.lights, sequence))

    def camera(self, sequence: str, name: str) -> Camera | None:
        return self.cameras.get((self.session.get(sequence, ""), name))


@dataclass(frozen=True, eq=False)
class Walk:
    """The tables of one walk, in each of which nothing is wrong by itself.

    `tables`: by kind of part (layout.py) and camera, "" for those of all cameras, with the columns of
    `walk_checks.COLUMNS`; `files`: by path in the release; `decode`: look at every picture, not only at `pictures`, a
    sample of (row, bytes) by camera; `suspects`, `beside`: of `WalkFindings`, to be added to.
    """

    who: str
    sequence: str
    tables: dict[str, dict[str, Table]]
    files: dict[str, File]
    rig: Setup
    decode: bool
    pictures: dict[str, list[tuple[int, bytes]]]
    suspects: dict[str, Any]
    beside: dict[str, Any]

    def of(self, kind: str) -> dict[str, Table]:
        """The tables of a kind by camera; {} where the walk has none."""
        return self.tables.get(kind, {})

    def path(self, kind: str, camera: str = "") -> str:
        """Where such a table lies in the release."""
        return f"{kind}/{self.who}/{self.sequence}{'.' if camera else ''}{camera}.parquet"


@dataclass(frozen=True, eq=False)
class Evidence:
    """A release of which nothing is missing and in which no file is wrong by itself.

    `files`: by path; `tables`: those at its top by name; `walks`: what was found in each; `provenance`: its content.
    """

    files: dict[str, File]
    tables: dict[str, Table]
    walks: list[WalkFindings]
    provenance: dict[str, Any]
    rig: Setup


def provenance(files: dict[str, File]) -> dict[str, Any]:
    """The content of provenance.json, {} where it is none."""
    try:
        content = json.loads(files["provenance.json"].read())
    except (KeyError, ValueError):
        return {}
    return content if isinstance(content, dict) else {}


def rig(tables: dict[str, Table], made_of: dict[str, Any]) -> Setup | None:
    """The `Setup` of the tables at the top of a release; None where one of them is missing."""
    if not {"cameras", "clocks", "sequences"} <= set(tables):
        return None
    cameras, clocks, walks = (tables[name] for name in ("cameras", "clocks", "sequences"))
    placed = [camera_of(cameras, row) for row in range(len(cameras["camera"]))]
    settings = made_of.get("config")
    return Setup(
        dict(zip(zip(cameras["session"], cameras["camera"], strict=True), placed, strict=True)),
        dict(zip(walks["sequence"], walks["session"], strict=True)),
        dict(zip(walks["sequence"], walks["environment"], strict=True)),
        {
            (sequence, camera): (offset, drift)
            for sequence, camera, offset, drift in zip(
                *(clocks[key].tolist() for key in ("sequence", "camera", "offset_s", "drift_ppm")), strict=True
            )
        },
        settings if isinstance(settings, dict) else {},
        lights_of(tables),
    )


def lights_of(tables: dict[str, Table]) -> tuple[RedLight, ...]:
    """The red lights that a release tells of."""
    if "lights" not in tables:
        return ()
    return tuple(
        RedLight(*row) for row in zip(*(tables["lights"][key].tolist() for key in RedLight._fields), strict=True)
    )


def camera_of(table: Table, row: int) -> Camera | None:
    """The camera in a row of `released_cameras`; None without a pose or a lens that can be computed with."""
    pose = table["wTc"][row].reshape(4, 4)
    fx, fy, cx, cy = (float(table[key][row]) for key in ("fx", "fy", "cx", "cy"))
    if not np.isfinite(pose).all() or not np.isfinite([fx, fy, cx, cy]).all():
        return None
    width, height = (int(table[key][row]) for key in ("width", "height"))
    model, coefficients = table["distortion_model"][row], tuple(table["distortion"][row].tolist())
    try:
        lens = Intrinsics(width, height, fx, fy, cx, cy, model, coefficients)
    except DiorError:
        return None
    return Camera(table["camera"][row], lens, pose, table["role"][row], table["locate"][row])
