"""The COCO-17 skeleton as a graph: which joints are neighbours, and how many steps lie between any two."""

import numpy as np

from dior.arrays import Floats, Ints

EDGES = (
    *((0, 1), (0, 2), (1, 3), (2, 4), (3, 5), (4, 6), (5, 6), (5, 7), (7, 9)),
    *((6, 8), (8, 10), (5, 11), (6, 12), (11, 12), (11, 13), (13, 15), (12, 14), (14, 16)),
)
JOINTS, MAX_HOP = 17, 3


def hops() -> Ints:
    """Length of the shortest path between any two joints, (17, 17) int."""
    step = np.eye(JOINTS, dtype=int)
    for a, b in EDGES:
        step[a, b] = step[b, a] = 1
    reached, distance = np.eye(JOINTS, dtype=int), np.where(np.eye(JOINTS) > 0, 0, JOINTS)
    for hop in range(1, JOINTS):
        reached = np.minimum(reached @ step, 1)
        distance = np.minimum(distance, np.where(reached > 0, hop, JOINTS))
    return distance


def adjacency() -> Floats:
    """Weight of joint i at joint j by the hops between them, (4, 17, 17): one over the joints within 3 hops of j."""
    distance = hops()
    near = (distance <= MAX_HOP).sum(axis=0)
    return np.stack([(distance == hop) / near for hop in range(MAX_HOP + 1)])
