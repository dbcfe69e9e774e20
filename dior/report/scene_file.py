"""scene.js, which a page loads from disk: words and numbers, small, and read by a few lines of static/viewer.js.

INPUTS   a dict, and arrays of whole numbers or float32; points (m), standard errors and correlations
OUTPUTS  a script of two lines: the dict as JSON, and base64 of a zlib stream that holds the arrays

Whole numbers are stored as differences along the first axis, which is time, modulo their width; and of all numbers
first the lowest bytes, then the next ones. Most bytes are then 0 or near it, and deflate makes a third of them.
"""

import base64
import json
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dior.arrays import Floats
from dior.errors import DiorError

WORDS, NUMBERS = "window.scene = ", "window.scene.numbers = "

# of zlib; chosen: 9 takes ten times as long for 2 % less
LEVEL = 6
# a point that is not there, in `in_steps`
NONE = -32768
# m; chosen: a tenth of what the best 3D is good to
STEP_M = 0.001
# the least standard error that `in_ratios` tells, m, and the ratio from each to the next; chosen: 0.2 mm to 40 m in a
# byte, to 2.5 %
LEAST_M, RATIO = 2e-4, 1.05
# of a correlation in whole numbers; chosen: an ellipsoid looks the same
PARTS = 32


def text_of(header: Mapping[str, Any] | None, arrays: Mapping[str, NDArray[Any]]) -> str:
    """A scene.js of a header, None for a sequence without 3D, and arrays; the header is told their `parts`."""
    if header is None:
        return f"{WORDS}null;\n"
    parts, text = packed(arrays)
    words = json.dumps({**header, "parts": parts}, sort_keys=True, separators=(",", ":"))
    return f'{WORDS}{words};\n{NUMBERS}"{text}";\n'


def header_of(path: Path) -> dict[str, Any] | None:
    """The header of a scene.js; None where there is no 3D. Raises DiorError for another file."""
    if not path.is_file():
        raise DiorError(f"{path}: there is no such file; run the step viewer")
    with path.open(encoding="utf-8") as stream:
        line = stream.readline().rstrip()
    if not line.startswith(WORDS):
        raise DiorError(f"{path}: is no scene of the step viewer; run it again")
    header: dict[str, Any] | None = json.loads(line.removeprefix(WORDS).removesuffix(";"))
    return header


def arrays_of(path: Path) -> dict[str, NDArray[Any]]:
    """The arrays of a scene.js by name; none where there is no 3D. Raises DiorError for another file."""
    header = header_of(path)
    if header is None:
        return {}
    line = path.read_text(encoding="utf-8").split("\n")[1]
    return unpacked(header["parts"], line.removeprefix(NUMBERS).strip('";'))


def packed(arrays: Mapping[str, NDArray[Any]]) -> tuple[list[dict[str, Any]], str]:
    """Name, type and shape of each array, in their order, and all of them as text."""
    parts = [{"name": name, "type": one.dtype.name, "shape": list(one.shape)} for name, one in arrays.items()]
    planes = b"".join(_planes(_differences(one)) for one in arrays.values())
    return parts, base64.b64encode(zlib.compress(planes, LEVEL)).decode()


def unpacked(parts: list[dict[str, Any]], text: str) -> dict[str, NDArray[Any]]:
    """The arrays that `packed` was given."""
    planes, found, at = zlib.decompress(base64.b64decode(text)), {}, 0
    for part in parts:
        kind, count = np.dtype(part["type"]), int(np.prod(part["shape"]))
        size = kind.itemsize * count
        rows = np.frombuffer(planes, np.uint8, size, at).reshape(kind.itemsize, count)
        values = np.ascontiguousarray(rows.T).view(kind.newbyteorder("<")).reshape(part["shape"]).astype(kind)
        found[part["name"]] = values if kind.kind == "f" else np.cumsum(values, axis=0, dtype=kind)
        at += size
    return found


def _differences(values: NDArray[Any]) -> NDArray[Any]:
    if values.dtype.kind == "f":
        return values
    return np.diff(values, axis=0, prepend=np.zeros((1, *values.shape[1:]), values.dtype))


def _planes(values: NDArray[Any]) -> bytes:
    ordered = np.ascontiguousarray(values, values.dtype.newbyteorder("<"))
    return ordered.reshape(-1, 1).view(np.uint8).T.tobytes()


def in_steps(points: Floats) -> tuple[NDArray[np.int16], list[float], float]:
    """Points (..., 3) m as int16 steps from an origin, NONE where one is missing; the origin and the step, m.

    The step is STEP_M, a multiple of it where the points lie further apart than 65 m.
    """
    known = np.all(np.isfinite(points), axis=-1)
    if not known.any():
        return np.full(points.shape, NONE, np.int16), [0.0, 0.0, 0.0], STEP_M
    low, high = points[known].min(axis=0), points[known].max(axis=0)
    origin = np.round((low + high) / 2, 3)
    step = STEP_M * max(1, int(np.ceil((high - low).max() / 2 / STEP_M / 32000)))
    steps = np.rint((np.where(known[..., None], points, origin) - origin) / step)
    return np.where(known[..., None], steps, NONE).astype(np.int16), origin.tolist(), step


def in_ratios(sigmas: Floats) -> NDArray[np.uint8]:
    """Standard errors, m, as powers of RATIO above LEAST_M, from 1; 0 where one is missing."""
    known = np.isfinite(sigmas) & (sigmas > 0)
    powers = np.rint(np.log(np.where(known, sigmas, LEAST_M) / LEAST_M) / np.log(RATIO)) + 1
    return np.where(known, np.clip(powers, 1, 255), 0).astype(np.uint8)


def in_parts(correlations: Floats) -> NDArray[np.int8]:
    """Correlations as whole PARTS, 0 where one is missing."""
    return np.rint(PARTS * np.clip(np.nan_to_num(correlations), -1, 1)).astype(np.int8)
