"""Embeddings of sequences, by the paths that the networks' authors take when they test.

INPUTS   sequences (F, 17, 2) px, adapted; F at least 60
OUTPUTS  embeddings (N, 128)
GaitGraph: the 60 frames in the middle, with a confidence. GaitMixer, GaitFormer: three windows of 60 frames around the
middle, each also backwards; the mean of the six. (GaitGraph's own augmentation flips an axis of length one, so that it
changes nothing and is left out.)
"""

import numpy as np

from dior.reid import networks
from dior.reid.networks import FRAMES

PICTURE = 320.0
# the released network's own mean of the confidences that it was trained with: neither good nor bad news
CONFIDENCE = 0.86
BATCH = 64


def windows(frames):
    """First frames of the windows of a sequence, as the authors of GaitMixer cut it."""
    middle = int(frames / 2 - FRAMES / 2)
    return middle, max(middle - 20, 0), min(middle + 80, frames) - FRAMES


def given(name, uv, confidence=CONFIDENCE):
    """The network's inputs (W, ...) for one sequence (F, 17, 2) px, F at least 60."""
    if len(uv) < FRAMES:
        raise ValueError(f"a sequence has {len(uv)} frames, fewer than {FRAMES}")
    if name == "gaitgraph":
        first = int(len(uv) / 2 - FRAMES / 2)
        part = uv[first : first + FRAMES]
        full = np.concatenate([part, np.full((*part.shape[:2], 1), confidence)], axis=-1)
        return np.moveaxis(full, -1, 0)[None, None]
    parts = [uv[first : first + FRAMES] / PICTURE for first in windows(len(uv))]
    return np.stack(parts + [part[::-1] for part in parts])


def embeddings(name, network, sequences, confidence=CONFIDENCE):
    """Embeddings (N, 128) of N sequences (F, 17, 2) px, computed in float32."""
    torch = networks.torch()
    each = [given(name, uv, confidence) for uv in sequences]
    if not each:
        return np.empty((0, networks.EMBEDDING))
    device = next(network.parameters()).device
    stacked = np.concatenate(each).astype(np.float32)
    with torch.inference_mode():
        parts = [
            network(torch.from_numpy(stacked[i : i + BATCH]).to(device)).cpu().numpy()
            for i in range(0, len(stacked), BATCH)
        ]
    out = np.concatenate(parts).astype(float)
    return out.reshape(len(each), -1, out.shape[1]).mean(axis=1)


def distances(name, found):
    """Distances (N, N) of embeddings (N, 128) as the authors take them: GaitGraph Euclidean, the others cosine."""
    if name != "gaitgraph":
        unit = found / np.linalg.norm(found, axis=1, keepdims=True)
        return 1 - unit @ unit.T
    squares = (found**2).sum(axis=1)
    return np.sqrt(np.maximum(squares[:, None] + squares - 2 * found @ found.T, 0.0))
