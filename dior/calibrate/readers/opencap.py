"""The pickle in which OpenCap keeps a camera (`cameraIntrinsicsExtrinsics.pickle`).

INPUTS   a file
OUTPUTS  its one `GivenCamera`, called as the file, or as the folder that it lies in
Sources: opencap-core (`utilsChecker.saveCameraParameters`, `calcExtrinsics`) and Pose2Sim 0.10.49
(`calibration.calib_opencap_fun`), which agree: a dict with `intrinsicMat` (3x3), `distortion` (OpenCV's five),
`imageSize` (height, width), `rotation` (3x3) and `translation` (mm) from the checkerboard's world to the camera. That
board stands, so that its world has no Z up.

A pickle is a program. Here it may only make dicts, lists, tuples, texts, numbers and plain arrays of numbers: nothing
that it names is imported or called. The unpickler is that of Python's own code and not the one in C, which takes memory
for as many objects as a file claims to have.
"""

import io
import math
import pickle
import pickletools
import struct
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np

from dior.arrays import Floats
from dior.calibrate.readers.given import GivenCamera, Lens, Pose, numbers, part, rotation, size
from dior.calibrate.readers.source import Source
from dior.errors import DiorError
from dior.formats import CalibrationFormat
from dior.geometry.camera import pose

# what pickles of protocol 2 and later begin with
BEGIN = b"\x80"
# dtypes of numbers, as numpy names them, without their byte order
NUMBERS = ("f4", "f8", "i4", "i8", "u4", "u8", "i2", "u2", "u1", "i1")
# chosen: OpenCap's have a hundred
MOST_STEPS = 10_000
MOST_AXES = 3
# what a damaged pickle makes the unpickler raise
BROKEN = (
    pickle.UnpicklingError, EOFError, ValueError, TypeError, LookupError, AttributeError, OverflowError, struct.error,
    AssertionError, ImportError, UnicodeError,
)  # fmt: skip
DESCRIPTIONS = (
    CalibrationFormat(
        key="opencap",
        file="OpenCap `cameraIntrinsicsExtrinsics.pickle`",
        name="the file, or its folder (`Cam0`)",
        convention="cTw",
        unit="mm",
        world="a board that stands: `from_walk` or `from_marks`",
        lens="plumb_bob",
        checked="nothing of the pickle is run, arrays are as long as they say",
        sample="written here by numpy 2 and as numpy 1 does, by the source of opencap-core",
    ),
)


class _Dtype:
    """Stands for numpy.dtype: its name and byte order."""

    def __init__(self, name: str = "", *_: object) -> None:
        self.name, self.order = str(name), "<"

    def __setstate__(self, state: tuple[Any, ...]) -> None:
        self.order = str(state[1])

    def of(self) -> "np.dtype[Any]":
        name = self.name.lstrip("<>=|")
        if name not in NUMBERS:
            raise ValueError(f"an array of {self.name!r}")
        return np.dtype((">" if self.order == ">" else "<") + name)


class _Array:
    """Stands for numpy.ndarray: the array that its state describes, if the bytes are as many as it says."""

    values: Floats | None = None

    def __setstate__(self, state: tuple[Any, ...]) -> None:
        _, shape, dtype, by_columns, raw = state
        self.fill(dtype.of(), shape, "F" if by_columns else "C", raw)

    def fill(self, kind: "np.dtype[Any]", shape: tuple[int, ...], order: Literal["C", "F"], raw: Any) -> None:
        flat = np.frombuffer(_bytes(raw), kind)
        # the shape is only taken where the bytes are there
        if not all(type(n) is int and 0 <= n <= len(flat) for n in shape) or math.prod(shape[:MOST_AXES]) != len(flat):
            raise ValueError("an array of another size than it says")
        self.values = flat.reshape(shape, order=order).astype(float)


def _bytes(raw: Any) -> bytes:
    return raw.encode("latin-1") if isinstance(raw, str) else bytes(raw)


def _array(*_: object) -> _Array:
    """Stands for numpy's `_reconstruct`, whatever shape it is given."""
    return _Array()


def _from_buffer(raw: Any, dtype: _Dtype, shape: tuple[int, ...], order: str) -> _Array:
    """Stands for numpy's `_frombuffer`, by which protocol 5 writes arrays."""
    array = _Array()
    array.fill(dtype.of(), shape, "F" if order == "F" else "C", raw)
    return array


def _scalar(dtype: _Dtype, raw: Any = b"") -> float:
    """Stands for numpy's `scalar`."""
    (value,) = np.frombuffer(_bytes(raw), dtype.of())
    return float(value)


def _encoded(text: str, encoding: str = "latin1") -> bytes:
    """Stands for `_codecs.encode`, by which older protocols write bytes."""
    return str(text).encode("latin-1")


_KNOWN: dict[tuple[str, str], Any] = {("numpy", "ndarray"): _Array, ("numpy", "dtype"): _Dtype}
_KNOWN |= {("_codecs", "encode"): _encoded}
# of numpy 1 and 2
for _core in ("numpy.core", "numpy._core"):
    _KNOWN |= {(f"{_core}.multiarray", "_reconstruct"): _array, (f"{_core}.multiarray", "scalar"): _scalar}
    _KNOWN |= {(f"{_core}.numeric", "_frombuffer"): _from_buffer}


class _Unpickler(pickle._Unpickler):  # Python's own code of it
    """Makes nothing but what stands in `_KNOWN`."""

    def find_class(self, module: str, name: str) -> Any:
        if (module, name) not in _KNOWN:
            raise DiorError(f"the pickle asks for {module}.{name}, which is no number; nothing of it was run")
        return _KNOWN[module, name]


def recognises(source: Source) -> bool:
    """Whether a file begins as a pickle does."""
    return source.content.startswith(BEGIN)


def cameras(source: Source) -> list[GivenCamera]:
    """The camera of a file, by the file's name or by its folder's."""
    content, path = source.content, source.path
    names = tuple(dict.fromkeys((source.stem, Path(path).absolute().parent.name)))
    try:
        # before anything is made of them: what is nested deeply would end the stack
        if any(i >= MOST_STEPS for i, _ in enumerate(pickletools.genops(content))):
            raise DiorError(f"has more than {MOST_STEPS} steps, as OpenCap's has not")
        found = _Unpickler(io.BytesIO(content)).load()
    except DiorError as error:
        raise DiorError(f"{path}: {error}") from None
    except BROKEN as error:
        raise DiorError(f"{path}: not readable as a pickle ({error}); copy the file again") from None
    if not isinstance(found, dict) or "intrinsicMat" not in found:
        raise DiorError(f"{path}: the pickle has no `intrinsicMat`, as OpenCap's of a camera has")
    plain = {key: value.values if isinstance(value, _Array) else value for key, value in found.items()}
    where = f"{path} [{names[0]}]"
    return [GivenCamera(names[0], part(partial(_lens, plain, where)), part(partial(_pose, plain, where)), names[1:])]


def _flat(content: Mapping[str, Any], key: str, counts: tuple[int, ...], where: str) -> Floats:
    """Numbers of a row or a column, flat."""
    shapes = [shape for n in counts for shape in ((n,), (1, n), (n, 1))]
    return numbers(content, key, shapes, where).ravel()


def _lens(content: Mapping[str, Any], where: str) -> Lens:
    height, width = _flat(content, "imageSize", (2,), where)
    K = numbers(content, "intrinsicMat", [(3, 3)], where)
    distortion = _flat(content, "distortion", (4, 5), where)
    return Lens(*size(np.array([width, height]), where), K, "plumb_bob", tuple(distortion.tolist()))


def _pose(content: Mapping[str, Any], where: str) -> Pose:
    turn = rotation(numbers(content, "rotation", [(3, 3)], where), where)
    origin = "its world is that of OpenCap's checkerboard, which stands"
    return Pose(pose(turn, _flat(content, "translation", (3,), where)), "cTw", "mm", origin=origin)
