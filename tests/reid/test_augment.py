"""Sequences as they could have been: the same body, mirrored or not."""

import numpy as np

from dior.reid import augment


def test_a_mirrored_body_stands_on_its_feet_and_is_mirrored_every_second_time():
    uv = np.stack([np.tile(10.0 * np.arange(17) ** 2, (60, 1)), np.tile(10.0 * np.arange(17), (60, 1))], axis=-1)
    mirrored = 0
    for seed in range(60):
        found = augment.augmented(uv, np.random.default_rng(seed))
        assert np.abs(found[..., 1] - uv[..., 1]).max() < 2
        as_it_is, other = (np.abs(found[..., 0] - u).max() for u in (uv[..., 0], 2 * uv[..., 0].mean() - uv[..., 0]))
        assert min(as_it_is, other) < 2
        mirrored += other < 2
    assert 18 < mirrored < 42
