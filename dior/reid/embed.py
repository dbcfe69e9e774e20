"""Embeddings of sequences, by the paths that the networks' authors take when they test.

INPUTS   sequences (F, 17, 2) px, adapted; F at least 60
OUTPUTS  embeddings (N, E): E is WIDTHS' or 128
GaitGraph: the 60 frames in the middle, with a confidence. GaitMixer, GaitFormer: three windows of 60 frames around the
middle, each also backwards; the mean of the six. (GaitGraph's own augmentation flips an axis of length one, so that it
changes nothing and is left out.) GaitGraph2: the middle, the same backwards, and with left and right exchanged; the
three embeddings one after the other, of length 1 together.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from dior.arrays import Floats
from dior.progress import reporting
from dior.reid import channels, networks
from dior.reid.networks import FRAMES

if TYPE_CHECKING:
    import torch
    from torch import nn

# px, the width of CASIA-B's pictures, by which the authors of GaitMixer divide
PICTURE = 320.0
# the released network's own mean of the confidences that it was trained with: neither good nor bad news
CONFIDENCE = 0.86
# networks that are given confidences
SURE = ("gaitgraph", "gaitgraph2")
EUCLIDEAN = ("gaitgraph", "gaitgraph2")
# numbers of an embedding where they are not 128
WIDTHS = {"gaitgraph2": 3 * networks.EMBEDDING}
BATCH = 16  # sequences; chosen: memory of a small machine


def windows(frames: int) -> tuple[int, int, int]:
    """First frames of the windows of a sequence, as the authors of GaitMixer cut it."""
    middle = int(frames / 2 - FRAMES / 2)
    return middle, max(middle - 20, 0), min(middle + 80, frames) - FRAMES


def embeddings(name: str, network: "nn.Module", sequences: Sequence[Floats], confidence: float = CONFIDENCE) -> Floats:
    """Embeddings (N, E) of N sequences (F, 17, 2) px, F at least 60, computed in float32 on the network's device."""
    torch = networks.torch()
    for uv in sequences:
        if len(uv) < FRAMES:
            raise ValueError(f"a sequence has {len(uv)} frames, fewer than {FRAMES}")
    batches = [sequences[i : i + BATCH] for i in range(0, len(sequences), BATCH)]
    found = [np.empty((0, WIDTHS.get(name, networks.EMBEDDING)))]
    with torch.inference_mode():
        for batch in reporting(batches, len(batches), "batches of sequences", name):
            found.append(_of(name, network, batch, confidence).cpu().numpy().astype(float))
    return np.concatenate(found)


def _of(name: str, network: "nn.Module", sequences: Sequence[Floats], confidence: float) -> "torch.Tensor":
    if name == "gaitgraph":
        return network(_tensor(network, np.stack([given(name, middle(uv), confidence) for uv in sequences])))
    if name == "gaitgraph2":
        return _of_three(name, network, sequences, confidence)
    return _of_windows(network, sequences)


def middle(uv: Floats) -> Floats:
    """The 60 frames in the middle of a sequence (F, 17, 2)."""
    first = int(len(uv) / 2 - FRAMES / 2)
    return uv[first : first + FRAMES]


def given(name: str, uv: Floats, confidence: float | Floats) -> Floats:
    """What a network is given of 60 frames (60, 17, 2) px; `confidence` of every joint, or (60, 17, 1)."""
    if name == "gaitgraph":
        full = np.concatenate([uv, np.broadcast_to(confidence, (*uv.shape[:2], 1))], axis=-1)
        return np.moveaxis(full, -1, 0)[None]
    if name == "gaitgraph2":
        return channels.gaitgraph2(uv, confidence)
    return uv / PICTURE


def _of_three(name: str, network: "nn.Module", sequences: Sequence[Floats], confidence: float) -> "torch.Tensor":
    """Embeddings (N, 384) of the middle, of it backwards, and of it with left and right exchanged."""
    from torch.nn import functional

    parts = [part for uv in map(middle, sequences) for part in (uv, uv[::-1], uv[:, channels.EXCHANGED])]
    made = network(_tensor(network, np.stack([given(name, part, confidence) for part in parts])))
    return functional.normalize(made.view(len(sequences), -1), dim=1)


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
    """Distances (N, N) of embeddings (N, E) as the authors take them: GaitGraph's and GaitGraph2's are Euclidean, the
    others' cosine."""
    if name not in EUCLIDEAN:
        unit = found / np.linalg.norm(found, axis=1, keepdims=True)
        return 1 - unit @ unit.T
    squares = (found**2).sum(axis=1)
    return np.sqrt(np.maximum(squares[:, None] + squares - 2 * found @ found.T, 0.0))
