"""Cameras in a TOML calibration as Pose2Sim, caliscope and others write them: a section per camera.

INPUTS   a TOML file
OUTPUTS  the section of a camera, found by its key, the last part of its key or its entry `name`; numbers in it
"""

import re
import tomllib
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from dior.arrays import AnyPath, Floats
from dior.errors import DiorError, nearest
from dior.project.plain_text import text_of

# chosen: a section has some hundred bytes
MOST_BYTES = 1 << 20
# chosen: those who write such files have cameras on the first or second level
MOST_DEPTH = 8
# chosen: of a key; tomllib's time grows with its square
MOST_DOTS = 40
# chosen: no focal length in px, no distortion and no place in m is larger
LARGEST = 1e7
# of a translation, by `reference.units`
METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001}


def section(path: AnyPath, name: str, keys: Collection[str]) -> dict[str, Any]:
    """The section of the camera `name` among those that hold one of `keys`.

    Raises DiorError for a missing or broken file, an unknown name (with the nearest) and a name of several sections.
    """
    if not Path(path).exists():
        raise DiorError(f"{path}: there is no such file; check the camera's YAML and data_root")
    text = text_of(path, path, MOST_BYTES)
    _check_keys(text, path)
    try:
        content = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise DiorError(f"{path}: not readable as TOML ({error}); check the quotes and brackets there") from None
    except (ValueError, RecursionError) as error:
        reason = "nested too deeply" if isinstance(error, RecursionError) else "a number has thousands of digits"
        raise DiorError(f"{path}: not readable as TOML ({reason}); copy the file again") from None
    found = {key: table for key, table in _tables("", content) if set(keys) & set(table)}
    named = {key: table["name"] for key, table in found.items() if isinstance(table.get("name"), str)}
    matching = [key for key in found if name in (key, key.rpartition(".")[2], named.get(key))]
    if not matching:
        known = [*found, *named.values()]
        raise DiorError(f"{path}: no camera '{name}'{nearest(name, known)}; it has {', '.join(found) or 'none'}")
    if len(matching) > 1:
        raise DiorError(f"{path}: '{name}' is the name of {len(matching)} sections: {', '.join(matching)}")
    return found[matching[0]]


def _check_keys(text: str, path: AnyPath) -> None:
    """Raise DiorError for a key such as a.b.c of very many parts."""
    for number, line in enumerate(text.splitlines(), 1):
        parts = re.split(r"[,={}\[\]]", line.partition("#")[0])
        if max(part.count(".") for part in parts) > MOST_DOTS:
            raise DiorError(f"{path} line {number}: a key of more than {MOST_DOTS} parts; is the file damaged?")


def numbers(section: dict[str, Any], key: str, shapes: Collection[tuple[int, ...]], where: str) -> Floats:
    """The numbers of `key`, of one of some shapes. Raises DiorError for anything else, `where` it stands first."""
    if key not in section:
        raise DiorError(f"{where}: `{key}` is missing")
    wanted = " or ".join(" x ".join(map(str, shape)) for shape in shapes)
    try:
        values = np.array(section[key], float)
    except (ValueError, TypeError, OverflowError):
        raise DiorError(f"{where}: `{key}` must be {wanted} numbers") from None
    if values.shape not in shapes:
        given = " x ".join(map(str, values.shape)) or "one"
        raise DiorError(f"{where}: `{key}` must be {wanted} numbers, and there is {given}")
    if not (np.abs(values) <= LARGEST).all():
        raise DiorError(f"{where}: `{key}` has a value that is not finite or above {LARGEST:.0e}")
    return values


def _tables(prefix: str, content: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    for key, value in content.items():
        if isinstance(value, dict):
            yield prefix + key, value
            if prefix.count(".") < MOST_DEPTH:
                yield from _tables(f"{prefix}{key}.", value)
