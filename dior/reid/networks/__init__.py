"""Skeleton gait networks, with the parameter names of their authors' code (PyTorch).

`build(name)` gives a network in evaluation mode that makes embeddings (N, 128) of COCO-17 sequences.
GaitGraph: Teepe et al., ICIP 2021; GaitMixer and GaitFormer: Pinyoanuntapong et al., ICASSP 2023: the paper's three,
whose embeddings are of length 1. GaitGraph2: Teepe et al., CVPRW 2022. PyTorch is optional (requirements-reid.txt) and
imported only here and below.
"""

from types import ModuleType
from typing import TYPE_CHECKING

from dior.arrays import AnyPath
from dior.errors import DiorError, nearest

if TYPE_CHECKING:
    from torch import nn

NAMES = ("gaitgraph", "gaitmixer", "gaitformer", "gaitgraph2")
FRAMES, EMBEDDING = 60, 128
INSTALL = "pip install -r requirements-reid.txt"


def no_file(key: str, path: AnyPath) -> str:
    """What is said of weights that a key of config.yaml names and that are not there."""
    return (
        f"config/config.yaml: '{key}' names {path}, where there is no file; it is relative to the folder that holds "
        "config/ (docs/reid.md says where weights come from)"
    )


def torch() -> ModuleType:
    """The module torch. Raises DiorError with what to install where it is missing."""
    try:
        import torch
    except ImportError:
        raise DiorError(f"re-identification by networks needs PyTorch, which is not installed: {INSTALL}") from None
    return torch


def build(name: str) -> "nn.Module":
    """The network of that name, random weights, in evaluation mode."""
    torch()
    from dior.reid.networks.gaitformer import GaitFormer
    from dior.reid.networks.gaitgraph import GaitGraph
    from dior.reid.networks.gaitgraph2 import GaitGraph2
    from dior.reid.networks.gaitmixer import GaitMixer

    kinds: dict[str, type[nn.Module]] = dict(zip(NAMES, (GaitGraph, GaitMixer, GaitFormer, GaitGraph2), strict=True))
    if name not in kinds:
        raise DiorError(f"there is no network '{name}'{nearest(name, NAMES)}")
    return kinds[name]().eval()
