"""What the parity tests share: ../shared/reid, its deterministic weights and inputs (its spec.md, section 8)."""

import json
from pathlib import Path

import numpy as np
import pytest

FOLDER = Path(__file__).resolve().parents[3] / "shared/reid"
NAMES = ("gaitgraph", "gaitmixer", "gaitformer")


def reference(name):
    """Content of a file of ../shared/reid; the test is skipped where it is absent."""
    path = FOLDER / name
    if not path.is_file():
        pytest.skip(f"reference embeddings are not there: {path}")
    return json.loads(path.read_text())


def weights_file(name):
    path = FOLDER / "weights" / name
    if not path.is_file():
        pytest.skip(f"released weights are not there: {path}")
    return path


def hashed(shapes):
    """Weights by rule B: name -> (shape) to name -> float64 array; the graph is left out."""
    made = {}
    for i, name in enumerate(sorted(shapes)):
        shape = shapes[name]
        k = np.arange(int(np.prod(shape)), dtype=np.int64)
        u = ((k * 2654435761 + i * 2246822519 + 374761393) % 2**32) / 2**32 * 2 - 1
        last = name.rsplit(".", 1)[-1]
        if last == "A":
            continue
        if last == "num_batches_tracked":
            value = np.zeros_like(u)
        elif last == "edge":
            value = 1 + 0.2 * u
        elif last.endswith("pos_embed") or last == "temporal_cls_token":
            value = 0.5 * u
        elif last == "running_mean" or last == "bias":
            value = 0.1 * u
        elif last == "running_var":
            value = 1 + 0.5 * u
        elif len(shape) >= 2:
            value = u * np.sqrt(6 / (k.size / shape[0]))
        else:
            value = 1 + 0.2 * u
        made[name] = value.reshape(shape)
    return made


def cosine(shape):
    return np.cos(0.1 * np.arange(np.prod(shape))).reshape(shape)


def walk(name, frames, people=2):
    """The deterministic walk as the network's input."""
    n, t, v = np.meshgrid(np.arange(people), np.arange(frames), np.arange(17), indexing="ij")
    x = 160 + 40 * np.cos(0.1 * t + 0.7 * v + n)
    y = 60 + 8 * v + 5 * np.sin(0.2 * t + 0.3 * v + n)
    c = 0.9 + 0.05 * np.cos(0.3 * t + v + n)
    return np.stack([x, y, c], axis=1)[:, None] if name == "gaitgraph" else np.stack([x, y], axis=-1) / 320
