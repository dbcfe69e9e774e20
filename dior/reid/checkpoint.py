"""Weights of a network from a checkpoint file, read without running anything that is in it.

INPUTS   a checkpoint as torch.save writes it since 2020: a zip of a pickle and the numbers of every tensor
OUTPUTS  the network with these weights, or the tensors by name

A pickle can call any function by its name, so plain torch.load of a file from somewhere else runs what its author
likes. Here a name means one of a few harmless things or the file is refused: containers, tensors, and the leftovers of
a training (optimiser, schedule, options), which become objects that do nothing.
"""

import io
import math
import pickle
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, TypeAlias

import numpy as np
from numpy.typing import NDArray

from dior.arrays import AnyPath
from dior.errors import DiorError
from dior.reid import networks

if TYPE_CHECKING:
    from torch import nn

# by name
Tensors: TypeAlias = Mapping[str, NDArray[Any]]
# what the tensors are made of: torch's name -> numpy's
STORAGES = {
    **{"DoubleStorage": "<f8", "FloatStorage": "<f4", "HalfStorage": "<f2", "LongStorage": "<i8"},
    **{"IntStorage": "<i4", "ShortStorage": "<i2", "CharStorage": "i1", "ByteStorage": "u1", "BoolStorage": "?"},
}
# leftovers of a training that may be named and do nothing here; a dot at the end means all of the module
IDLE = (
    *("argparse.Namespace", "builtins.getattr", "evaluate._evaluate_casia_b"),
    *("torch.optim.", "torch.cuda.amp.", "torch.amp.", "copyreg._reconstructor", "builtins.object"),
)
PREFIXES = ("module.", "backbone.", "1.")
# bytes; chosen: far above any of these networks, far below what fills a machine's memory
LARGEST_PICKLE, LARGEST_TENSOR = 50_000_000, 500_000_000
# chosen: rounding of float32 in a graph's weights, which are below 1
SAME_GRAPH = 1e-6


class _Locked(type):
    """A class that a pickle cannot change."""

    def __setattr__(cls, name: str, value: object) -> NoReturn:
        raise pickle.UnpicklingError(f"it changes {cls.__name__}")


class _Idle(metaclass=_Locked):
    """Stands for anything that is not needed: it takes what it is given and does nothing."""

    __slots__ = ()

    def __new__(cls, *_: object, **__: object) -> "_Idle":
        return object.__new__(cls)

    def __init__(self, *_: object, **__: object) -> None:
        pass

    def __call__(self, *_: object, **__: object) -> "_Idle":
        return self

    def __setstate__(self, _: object) -> None:
        pass

    def __setitem__(self, *_: object) -> None:
        pass

    def append(self, _: object) -> None:
        pass

    def extend(self, _: object) -> None:
        pass

    def __hash__(self) -> int:
        return 0


class _Numbers(np.ndarray):
    """A tensor, which an optimiser's state may have as a key."""

    __hash__ = object.__hash__  # type: ignore[assignment]  # by identity, as torch's tensors

    def __setstate__(self, _: object) -> None:
        pass


class _Tensor(metaclass=_Locked):
    """torch._utils._rebuild_tensor_v2: a view of a storage (offset, shape, strides), copied."""

    __slots__ = ()

    # a pickle calls it for the array alone
    def __new__(  # type: ignore[misc]
        cls, storage: object, offset: int, shape: tuple[int, ...], strides: tuple[int, ...], *_: object
    ) -> _Numbers:
        if not isinstance(storage, np.ndarray):
            raise pickle.UnpicklingError("a tensor without numbers")
        last = offset + sum((n - 1) * step for n, step in zip(shape, strides, strict=True))
        empty = 0 in shape
        if min((offset, *shape, *strides)) < 0 or (not empty and last >= len(storage)):
            raise pickle.UnpicklingError("a tensor that is larger than its storage")
        if math.prod(shape) > len(storage):
            raise pickle.UnpicklingError("a tensor that repeats its storage")
        size = storage.itemsize
        view = np.lib.stride_tricks.as_strided(storage[offset:], shape, [size * step for step in strides])
        return view.copy().view(_Numbers)


class _Parameter(metaclass=_Locked):
    """torch._utils._rebuild_parameter: the tensor itself."""

    __slots__ = ()

    def __new__(cls, tensor: object, *_: object) -> object:  # type: ignore[misc]
        return tensor


class _Dict(dict[Any, Any]):
    """OrderedDict, defaultdict or dict of a pickle; what else is told of it is left out."""

    def __init__(self, *given: Any) -> None:
        super().__init__(given[0] if given and isinstance(given[0], (list, tuple, dict)) else ())

    def __setstate__(self, _: object) -> None:
        pass


class _Unpickler(pickle.Unpickler):
    def __init__(self, text: bytes, storage: Callable[[str, str, int], NDArray[Any]]) -> None:
        super().__init__(io.BytesIO(text), encoding="utf-8")
        self._storage = storage
        self._storages: dict[Any, NDArray[Any]] = {}

    def find_class(self, module: str, name: str) -> Any:
        module = "builtins" if module == "__builtin__" else module
        known = {
            "torch._utils._rebuild_tensor_v2": _Tensor,
            "torch._utils._rebuild_parameter": _Parameter,
            "collections.OrderedDict": _dict(),
            "collections.defaultdict": _dict(),
            "builtins.dict": _dict(),
        }
        full = f"{module}.{name}"
        if module == "torch" and name in STORAGES:
            return name
        if full in known:
            return known[full]
        if any(full == word or word.endswith(".") and full.startswith(word) for word in IDLE):
            return _Idle
        raise pickle.UnpicklingError(f"it names {full}, which no checkpoint of a network needs")

    def persistent_load(self, which: Any) -> NDArray[Any]:
        kind, storage, key, _, count = which
        if kind != "storage" or storage not in STORAGES:
            raise pickle.UnpicklingError(f"an unknown kind of numbers ({kind}, {storage})")
        if key not in self._storages:
            self._storages[key] = self._storage(str(key), STORAGES[storage], count)
        return self._storages[key]


def _dict() -> type:
    """A class of its own for every name, so that nothing a pickle does to it lasts."""
    return _Locked("Dict", (_Dict,), {})


def read(path: AnyPath) -> Tensors:
    """Tensors by name (numpy) of a checkpoint: the weights, without the prefixes that wrappers put before them.

    Raises DiorError for a file that is missing, truncated, of another kind, or names code; none of it is run.
    """
    path = Path(path)
    if not path.is_file():
        raise DiorError(f"{path}: there is no such checkpoint")
    if not zipfile.is_zipfile(path):
        raise DiorError(
            f"{path}: not a checkpoint as torch.save writes it (a zip file), or truncated; get it again, or load and "
            "save it with a newer PyTorch if it is from before 2020"
        )
    try:
        with zipfile.ZipFile(path) as file:
            found = _content(file)
    except DiorError:
        raise
    # a made-up pickle can fail in any way
    except Exception as error:
        raise DiorError(f"{path}: refused, not a readable checkpoint: {error or type(error).__name__}") from None
    weights = {_plain(k): np.asarray(v) for k, v in _weights(found).items() if isinstance(v, np.ndarray)}
    if not weights:
        raise DiorError(f"{path}: holds no weights of a network (neither a state dict nor one under 'model')")
    return weights


def _content(file: zipfile.ZipFile) -> Any:
    names = file.namelist()
    pickles = [name for name in names if name.rsplit("/", 1)[-1] == "data.pkl"]
    if len(pickles) != 1:
        raise pickle.UnpicklingError(f"{len(pickles)} pickles in it, not one")
    folder = pickles[0][: -len("data.pkl")]
    if f"{folder}byteorder" in names and file.read(f"{folder}byteorder") != b"little":
        raise pickle.UnpicklingError("its numbers are big-endian; save it on another machine")

    def storage(key: str, kind: str, count: int) -> NDArray[Any]:
        return np.frombuffer(_member(file, f"{folder}data/{key}", LARGEST_TENSOR), kind, count)

    return _Unpickler(_member(file, pickles[0], LARGEST_PICKLE), storage).load()


def _member(file: zipfile.ZipFile, name: str, largest: int) -> bytes:
    size = file.getinfo(name).file_size
    if size > largest:
        raise pickle.UnpicklingError(f"{name} is {size} bytes long, more than any of these networks needs")
    return file.read(name)


def _weights(found: Any) -> dict[Any, Any]:
    for key in ("model", "state_dict"):
        if isinstance(found, dict) and isinstance(found.get(key), dict):
            return found[key]
    return found if isinstance(found, dict) else {}


def _plain(name: object) -> str:
    name = str(name)
    for prefix in PREFIXES:
        name = name.removeprefix(prefix)
    return name


def load(name: str, path: AnyPath) -> "nn.Module":
    """The network of that name with the weights of a checkpoint, in evaluation mode (float32)."""
    network = networks.build(name)
    fill(network, read(path), name, path)
    return network


def fill(network: "nn.Module", weights: Tensors, name: str, path: AnyPath) -> None:
    """Put tensors by name (numpy) into a network. Raises DiorError where one is missing, left over or misshapen."""
    torch = networks.torch()
    wanted = network.state_dict()
    weights = dict(weights)
    for key in filter(_is_graph, wanted):
        _check_graph(weights.setdefault(key, wanted[key].numpy()), wanted[key].numpy(), path)
    problem = _difference(weights, {key: tuple(value.shape) for key, value in wanted.items()})
    if problem:
        raise DiorError(f"{path}: not weights of {name}: {problem}{_other(name, weights)}")
    for key, value in weights.items():
        if not np.isfinite(value).all():
            raise DiorError(f"{path}: {key} has values that are no numbers; get the checkpoint again")
    network.load_state_dict({key: torch.from_numpy(np.array(value)) for key, value in weights.items()}, strict=True)


def _is_graph(key: str) -> bool:
    return key.rsplit(".", 1)[-1] == "A"


def _check_graph(given: NDArray[Any], expected: NDArray[Any], path: AnyPath) -> None:
    if given.shape != expected.shape or np.abs(given - expected).max() > SAME_GRAPH:
        raise DiorError(f"{path}: made for another skeleton than COCO-17 (its graph A differs)")


def _difference(weights: Tensors, shapes: Mapping[str, tuple[int, ...]]) -> str:
    """What keeps tensors from fitting a network of these shapes, or ""."""
    missing = [key for key in shapes if key not in weights]
    if missing:
        return f"{len(missing)} of {len(shapes)} tensors are missing, the first is {missing[0]}"
    extra = [key for key in weights if key not in shapes]
    if extra:
        return f"{len(extra)} tensors are not of this network, the first is {extra[0]}"
    wrong = [key for key, shape in shapes.items() if weights[key].shape != shape]
    if wrong:
        return f"{wrong[0]} has the shape {weights[wrong[0]].shape}, not {shapes[wrong[0]]}"
    return ""


def _other(name: str, weights: Tensors) -> str:
    """`; they fit gaitmixer` where another network takes them."""
    for other in networks.NAMES:
        shapes = {key: tuple(value.shape) for key, value in networks.build(other).state_dict().items()}
        own = {key: value for key, value in weights.items() if key in shapes or not _is_graph(key)}
        if other != name and not _difference(own, shapes):
            return f"; they fit {other}"
    return ""
