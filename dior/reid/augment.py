"""Sequences as they could have been: what the networks' authors do to theirs in training.

INPUTS   a sequence (F, 17, 2), px of a picture in which people are as large as in CASIA-B; a random generator
OUTPUTS  60 frames of it
"""

import numpy as np

from dior.arrays import Floats, Ints
from dior.reid.channels import EXCHANGED
from dior.reid.networks import FRAMES

# half of the sequences are mirrored, half run backwards; noise of every point, and of a joint in all frames, px. As in
# the scripts of the networks' authors
EVEN = 0.5
POINT_PX, JOINT_PX = 0.05, 0.25
# GaitGraph2's script: of a joint in all frames, of every point, and of all points together in x and y; the largest, px
JOINT2_PX, POINT2_PX, MOVE2_PX = 0.1, 0.05, (3.0, 1.0)


def augmented(uv: Floats, random: np.random.Generator) -> Floats:
    """60 frames (60, 17, 2) of a sequence (F, 17, 2), F at least 60: mirrored or not, backwards or not, from a random
    place, with noise of every point and of every joint throughout."""
    uv = np.array(uv, float)
    if random.random() < EVEN:
        uv[..., 0] = 2 * uv[..., 0].mean(axis=1, keepdims=True) - uv[..., 0]
    if random.random() < EVEN:
        uv = uv[::-1]
    part = _part(uv, random)
    part = part + POINT_PX * random.standard_normal(part.shape)
    return part + JOINT_PX * random.standard_normal(part.shape[1:])


def of_gaitgraph2(uv: Floats, random: np.random.Generator) -> Floats:
    """As `augmented`, by the script of GaitGraph2: left and right are exchanged or not, in place of a mirror."""
    part = _part(uv[::-1] if random.random() < EVEN else uv, random)
    if random.random() < EVEN:
        part = part[:, EXCHANGED]
    part = part + random.uniform(-JOINT2_PX, JOINT2_PX, part.shape[1:])
    part = part + random.uniform(-POINT2_PX, POINT2_PX, part.shape)
    return part + random.uniform(-1, 1, 2) * MOVE2_PX


def _part(uv: Floats, random: np.random.Generator) -> Floats:
    """60 frames of a sequence, from a random place."""
    first = int(random.integers(0, len(uv) - FRAMES + 1))
    return uv[first : first + FRAMES]


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


# how the sequences of a network are augmented, where it is not `augmented`
OWN = {"gaitgraph2": of_gaitgraph2}
