"""Sequences as they could have been: the same body, mirrored or not."""

import numpy as np

from dior.reid import augment, channels


def test_gaitgraph2s_sequences_have_sides_exchanged_run_backwards_and_move_a_little():
    uv = np.stack(np.broadcast_arrays(10.0 * np.arange(17), 10.0 * np.arange(60)[:, None]), axis=-1)
    backwards, exchanged = 0, 0
    for seed in range(60):
        found = augment.of_gaitgraph2(uv, np.random.default_rng(seed))
        x, y = (found - uv).mean(axis=(0, 1))
        assert found.shape == (60, 17, 2) and abs(x) < 3.1 and abs(y) < 1.1
        backwards += found[0, 0, 1] > found[-1, 0, 1]
        order = np.argsort(found[0, :, 0]).tolist()
        assert order in (list(range(17)), list(channels.EXCHANGED))
        exchanged += order != list(range(17))
    assert 18 < backwards < 42 and 18 < exchanged < 42


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
