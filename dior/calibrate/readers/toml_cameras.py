"""Cameras in TOML, a section each: Pose2Sim, anipose (aniposelib), FreeMoCap and caliscope.

INPUTS   a file
OUTPUTS  a `GivenCamera` for each section with `matrix`, `rotation` or `translation`, on whatever level; its names are
         the section's key, the last part of the key, and the entry `name`
Sources: the files that aniposelib 0.8.0 (`CameraGroup.dump`) and caliscope 0.11.8 (`CameraArray.to_toml`) write, the
writers of Pose2Sim 0.10.49 (`calibration.toml_write`) and FreeMoCap 1.8.2 (`anipose_camera_calibrator`).
`rotation` (Rodrigues vector, rad, or 3x3) and `translation` lead from the world to the camera in all of them. Pose2Sim
and caliscope write metres, and `fisheye` in each section. anipose has `metadata`, and `fisheye` for such lenses alone;
its unit is that of its board's squares, which the file does not tell. FreeMoCap's metadata has the side of the squares,
by its dialog in mm, and whether the board was taken for the floor.
"""

import re
import tomllib
from collections.abc import Iterator
from functools import partial
from typing import Any

from dior.arrays import AnyPath
from dior.calibrate.readers.given import GivenCamera, Lens, Pose, numbers, part, rotation, size
from dior.calibrate.readers.source import Source
from dior.errors import DiorError
from dior.formats import CalibrationFormat
from dior.geometry.camera import pose

# chosen: those who write such files have cameras on the first or second level
MOST_DEPTH = 8
# chosen: of a key; tomllib's time grows with its square
MOST_DOTS = 40
COEFFICIENTS = (4, 5, 8)  # of distortion, as OpenCV's models have them
OF_A_CAMERA = ("matrix", "rotation", "translation")
# of FreeMoCap's `metadata`
SQUARE, GROUND = "charuco_square_size", "groundplane_calibration"
# chosen: squares that cameras around a person see are larger; 1 is what FreeMoCap has until somebody measures it, and
# 0.058 or 5.8 were given in m or cm
LEAST_SQUARE_MM = 10.0
DESCRIPTIONS = tuple(
    CalibrationFormat(
        key="toml",
        file=file,
        name=name,
        convention="cTw, unless the YAML says wTc",
        unit=unit,
        world=world,
        lens="plumb_bob, or what `distortion_model` says; fisheye is refused",
        checked="shapes, a rotation of degrees or that mirrors, coefficients that are 1/64",
        sample=sample,
    )
    for file, name, unit, world, sample in (
        (
            "Pose2Sim TOML",
            "the section, or its `name`",
            "m, unless the YAML says another",
            "as exported; Pose2Sim's has Z up",
            "real: `real_outdoor/reference/*.toml`",
        ),
        (
            "caliscope TOML",
            "`cameras.1`, `1`",
            "m, unless the YAML says another",
            "as set in caliscope",
            "written by caliscope 0.11.8; real: `charuco/camera_array.toml`",
        ),
        (
            "anipose TOML (aniposelib)",
            "the section, or its `name`",
            "asked for: that of its board",
            "not told",
            "written by aniposelib 0.8.0",
        ),
        (
            "FreeMoCap TOML",
            "the section, or its `name`",
            "mm; asked for where `charuco_square_size` is below 10",
            "the board's floor by `groundplane_calibration`, else `from_walk` or `from_marks`",
            "written here by the source of FreeMoCap 1.8.2",
        ),
    )
)


def recognises(source: Source) -> bool:
    """Whether a file is TOML, by its first line that is neither empty nor a comment."""
    line = source.first_line
    return line.startswith("[") or re.match(r"[\w.\"'-]+\s*=", line) is not None


def cameras(source: Source) -> list[GivenCamera]:
    """The cameras of a file. Raises DiorError for a text that is no TOML."""
    text, path = source.text, source.path
    _check_keys(text, path)
    try:
        content = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        twice = re.search("twice|overwrite", str(error))
        fix = "are two files joined? keep one" if twice else "check the quotes and brackets there"
        raise DiorError(f"{path}: not readable as TOML ({error}); {fix}") from None
    except (ValueError, RecursionError) as error:
        reason = "nested too deeply" if isinstance(error, RecursionError) else "a number has thousands of digits"
        raise DiorError(f"{path}: not readable as TOML ({reason}); copy the file again") from None
    found = {key: table for key, table in _tables("", content) if set(OF_A_CAMERA) & set(table)}
    units, origin = _usual(content.get("metadata"), list(found.values()))
    return [_camera(key, table, units, origin, path) for key, table in found.items()]


def _check_keys(text: str, path: AnyPath) -> None:
    """Raise DiorError for a key such as a.b.c of very many parts."""
    for number, line in enumerate(text.splitlines(), 1):
        parts = re.split(r"[,={}\[\]]", line.partition("#")[0])
        if max(one.count(".") for one in parts) > MOST_DOTS:
            raise DiorError(f"{path} line {number}: a key of more than {MOST_DOTS} parts; is the file damaged?")


def _usual(metadata: Any, sections: list[dict[str, Any]]) -> tuple[str, str]:
    """Unit of the translations and origin of the world, "" where the tool that wrote the file does not tell them."""
    if not isinstance(metadata, dict):
        return "m", ""
    if SQUARE not in metadata:
        return ("m" if any(table.get("fisheye") is False for table in sections) else ""), ""
    side = metadata[SQUARE]
    measured = type(side) in (int, float) and side >= LEAST_SQUARE_MM
    units = "mm" if measured else ""
    return units, "" if metadata.get(GROUND) is True else f"FreeMoCap did not take its board for the floor ({GROUND})"


def _camera(key: str, table: dict[str, Any], units: str, origin: str, path: AnyPath) -> GivenCamera:
    where, named = f"{path} [{key}]", table.get("name")
    also = {key.rpartition(".")[2], *([named] if isinstance(named, str) else ())} - {key}
    lens, placed = part(partial(_lens, table, where)), part(partial(_pose, table, units, origin, where))
    return GivenCamera(key, lens, placed, tuple(sorted(also)))


def _lens(table: dict[str, Any], where: str) -> Lens:
    K = numbers(table, "matrix", [(3, 3)], where)
    width, height = size(numbers(table, "size", [(2,)], where), where)
    coefficients = numbers(table, "distortions", [(count,) for count in COEFFICIENTS], where)
    fisheye = table.get("fisheye", False)
    if not isinstance(fisheye, bool):
        raise DiorError(f"{where}: `fisheye` must be true or false without quotes, and is {fisheye!r:.40}")
    model = "equidistant (fisheye)" if fisheye else "plumb_bob"
    return Lens(width, height, K, model, tuple(coefficients.tolist()), said=fisheye)


def _pose(table: dict[str, Any], units: str, origin: str, where: str) -> Pose:
    translation = numbers(table, "translation", [(3,)], where)
    turn = numbers(table, "rotation", [(3,), (3, 3)], where)
    return Pose(pose(rotation(turn, where), translation), "cTw", units, assumed=True, origin=origin)


def _tables(prefix: str, content: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    for key, value in content.items():
        if isinstance(value, dict):
            yield prefix + key, value
            if prefix.count(".") < MOST_DEPTH:
                yield from _tables(f"{prefix}{key}.", value)
