"""Embeddings of sequences, by the paths that the networks' authors take when they test.

INPUTS   sequences (F, 17, 2) px, adapted; F at least 60
OUTPUTS  embeddings (N, 128)
GaitGraph: the 60 frames in the middle, with a confidence. GaitMixer, GaitFormer: three windows of 60 frames around the
middle, each also backwards; the mean of the six. (GaitGraph's own augmentation flips an axis of length one, so that it
changes nothing and is left out.)
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from dior.arrays import Floats
from dior.progress import reporting
from dior.reid import networks
from dior.reid.networks import FRAMES

if TYPE_CHECKING:
    import torch
    from torch import nn

# px, the width of CASIA-B's pictures, by which the authors of GaitMixer divide
PICTURE = 320.0
# the released network's own mean of the confidences that it was trained with: neither good nor bad news
CONFIDENCE = 0.86
BATCH = 16  # sequences; chosen: memory of a small machine


def windows(frames: int) -> tuple[int, int, int]:
    """First frames of the windows of a sequence, as the authors of GaitMixer cut it."""
    middle = int(frames / 2 - FRAMES / 2)
    return middle, max(middle - 20, 0), min(middle + 80, frames) - FRAMES


def embeddings(name: str, network: "nn.Module", sequences: Sequence[Floats], confidence: float = CONFIDENCE) -> Floats:
    """Embeddings (N, 128) of N sequences (F, 17, 2) px, F at least 60, computed in float32 on the network's device."""
    torch = networks.torch()
    for uv in sequences:
        if len(uv) < FRAMES:
            raise ValueError(f"a sequence has {len(uv)} frames, fewer than {FRAMES}")
    batches = [sequences[i : i + BATCH] for i in range(0, len(sequences), BATCH)]
    found = [np.empty((0, networks.EMBEDDING))]
    with torch.inference_mode():
        for batch in reporting(batches, len(batches), "batches of sequences", name):
            made = _of_middle(network, batch, confidence) if name == "gaitgraph" else _of_windows(network, batch)
            found.append(made.cpu().numpy().astype(float))
    return np.concatenate(found)


def middle(uv: Floats, confidence: float | Floats) -> Floats:
    """The 60 frames in the middle of a sequence (F, 17, 2) px as GaitGraph's input (1, 3, 60, 17)."""
    first = int(len(uv) / 2 - FRAMES / 2)
    part = uv[first : first + FRAMES]
    full = np.concatenate([part, np.full((*part.shape[:2], 1), confidence)], axis=-1)
    return np.moveaxis(full, -1, 0)[None]


def _of_middle(network: "nn.Module", sequences: Sequence[Floats], confidence: float) -> "torch.Tensor":
    return network(_tensor(network, np.stack([middle(uv, confidence) for uv in sequences])))


def _of_windows(network: "nn.Module", sequences: Sequence[Floats]) -> "torch.Tensor":
    """Mean (N, 128) over the six windows; what is done to single frames is done once for all that show them."""
    import torch

    starts = [windows(len(uv)) for uv in sequences]
    shown = [uv[min(own) : max(own) + FRAMES] / PICTURE for uv, own in zip(sequences, starts, strict=True)]
    joints = network.spatial(_tensor(network, np.concatenate(shown)[None]))[0].split([len(part) for part in shown])
    cut = []
    for part, own in zip(joints, starts, strict=True):
        for first in own:
            window = part[first - min(own) :][:FRAMES]
            cut += [window, window.flip(0)]
    return network.temporal(torch.stack(cut)).view(len(sequences), -1, networks.EMBEDDING).mean(dim=1)


def _tensor(network: "nn.Module", values: Floats) -> "torch.Tensor":
    import torch

    return torch.from_numpy(values.astype(np.float32)).to(next(network.parameters()).device)


def distances(name: str, found: Floats) -> Floats:
    """Distances (N, N) of embeddings (N, 128) as the authors take them: GaitGraph Euclidean, the others cosine."""
    if name != "gaitgraph":
        unit = found / np.linalg.norm(found, axis=1, keepdims=True)
        return 1 - unit @ unit.T
    squares = (found**2).sum(axis=1)
    return np.sqrt(np.maximum(squares[:, None] + squares - 2 * found @ found.T, 0.0))
