"""Cameras in a TOML calibration as Pose2Sim, caliscope and others write them: a section per camera.

INPUTS   a TOML file
OUTPUTS  the section of a camera, found by its key, the last part of its key or its entry `name`
"""

import tomllib
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

from dior.arrays import AnyPath
from dior.errors import DiorError, nearest


def section(path: AnyPath, name: str, keys: Collection[str]) -> dict[str, Any]:
    """The section of the camera `name` among those that hold one of `keys`.

    Raises DiorError for a missing or broken file, an unknown name (with the nearest) and a name of several sections.
    """
    try:
        content = tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise DiorError(f"{path}: there is no such file; check the camera's YAML and data_root") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise DiorError(f"{path}: not readable as TOML ({error})") from None
    found = {key: table for key, table in _tables("", content) if set(keys) & set(table)}
    matching = [
        key for key, table in found.items() if name in (key, key.rpartition(".")[2], str(table.get("name", "")))
    ]
    if not matching:
        known = [*found, *(str(table["name"]) for table in found.values() if "name" in table)]
        raise DiorError(f"{path}: no camera '{name}'{nearest(name, known)}; it has {', '.join(found) or 'none'}")
    if len(matching) > 1:
        raise DiorError(f"{path}: '{name}' is the name of {len(matching)} sections: {', '.join(matching)}")
    return found[matching[0]]


def _tables(prefix: str, content: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    for key, value in content.items():
        if isinstance(value, dict):
            yield prefix + key, value
            yield from _tables(f"{prefix}{key}.", value)
