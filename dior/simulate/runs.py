"""Runs: stretches of neighbouring samples in which something is wrong."""

import numpy as np

from dior.arrays import Ints


def runs(random: np.random.Generator, count: int, share: float, lengths: tuple[int, int]) -> Ints:
    """Number (count,) of the run that each sample belongs to, -1 for none; runs are counted from 0.

    `share` of the samples are in runs on average; a run is `lengths` = (shortest, longest) samples long, each length
    as likely. At least one sample lies between two runs; the last may be cut off by the end.
    """
    out = np.full(count, -1)
    if not share:
        return out
    shortest, longest = (int(n) for n in lengths)
    # the gaps are geometric (1 or more) with the mean that gives the share
    gap = max((shortest + longest) / 2 * (1 - share) / share, 1.0)
    # a recording begins anywhere: in a run or, more often, between two
    at = -int(random.integers(0, shortest + longest)) if random.random() < share else int(random.geometric(1 / gap)) - 1
    number = 0
    while at < count:
        length = int(random.integers(shortest, longest + 1))
        if at + length > 0:
            out[max(at, 0) : at + length] = number
            number += 1
        at += length + int(random.geometric(1 / gap))
    return out
