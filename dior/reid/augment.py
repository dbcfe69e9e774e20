"""Sequences as they could have been: what the networks' authors do to theirs in training.

INPUTS   a sequence (F, 17, 2), px of a picture in which people are as large as in CASIA-B; a random generator
OUTPUTS  60 frames of it
"""

import numpy as np

from dior.arrays import Floats, Ints
from dior.reid.networks import FRAMES

# half of the sequences are mirrored, half run backwards; noise of every point, and of a joint in all frames, px. As in
# the scripts of the networks' authors
EVEN = 0.5
POINT_PX, JOINT_PX = 0.05, 0.25


def augmented(uv: Floats, random: np.random.Generator) -> Floats:
    """60 frames (60, 17, 2) of a sequence (F, 17, 2), F at least 60: mirrored or not, backwards or not, from a random
    place, with noise of every point and of every joint throughout."""
    uv = np.array(uv, float)
    if random.random() < EVEN:
        uv[..., 0] = 2 * uv[..., 0].mean(axis=1, keepdims=True) - uv[..., 0]
    if random.random() < EVEN:
        uv = uv[::-1]
    first = int(random.integers(0, len(uv) - FRAMES + 1))
    part = uv[first : first + FRAMES]
    part = part + POINT_PX * random.standard_normal(part.shape)
    return part + JOINT_PX * random.standard_normal(part.shape[1:])


def confidences(value: float, random: np.random.Generator) -> Floats:
    """Confidences (60, 17) around a value, with the noise of a point."""
    return value + POINT_PX * random.standard_normal((FRAMES, 17))


def batch(subjects: Ints, people: int, each: int, random: np.random.Generator) -> Ints:
    """Indices of `each` sequences of `people` subjects (fewer where there are fewer), drawn from `subjects` (N,).

    A subject with fewer sequences has some of them twice.
    """
    names = np.unique(subjects)
    chosen = random.permutation(names)[:people]
    picked = []
    for name in chosen:
        own = np.flatnonzero(subjects == name)
        picked.append(random.choice(own, each, replace=len(own) < each))
    return np.concatenate(picked)
