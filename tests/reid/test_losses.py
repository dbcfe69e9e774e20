"""The losses by hand."""

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="PyTorch is not installed: pip install -r requirements-reid.txt")

from dior.reid import losses  # noqa: E402


def unit(angles):
    return torch.tensor([[np.cos(a), np.sin(a)] for a in np.deg2rad(angles)], dtype=torch.float64)


def test_the_contrast_is_the_mean_log_share_of_the_right_ones():
    z, who = unit([0, 5, 9, 20]), torch.tensor([0, 0, 1, 1])
    near = (z @ z.T).numpy() / 0.01
    expected = []
    for a in range(4):
        others = [b for b in range(4) if b != a]
        share = np.exp([near[a, b] - near[a, others].max() for b in others])
        expected.append(np.log(share[others.index(a ^ 1)] / share.sum()))
    assert float(losses.contrast(z, who)) == pytest.approx(-0.01 / 0.07 * np.mean(expected), rel=1e-9)


def test_the_contrast_of_distances_is_the_mean_log_share_by_how_far_they_are():
    angles, who = np.deg2rad([0, 5, 9, 20]), torch.tensor([0, 0, 1, 1])
    near = -2 * np.sin(np.abs(angles[:, None] - angles) / 2) / 0.01
    expected = []
    for a in range(4):
        others = [b for b in range(4) if b != a]
        share = np.exp(near[a, others] - near[a, others].max())
        expected.append(np.log(share[others.index(a ^ 1)] / share.sum()))
    # of any length
    z = unit([0, 5, 9, 20]) * torch.tensor([1.0, 2.0, 0.5, 3.0])[:, None]
    assert float(losses.distance_contrast(z, who)) == pytest.approx(-np.mean(expected), rel=1e-6)


def test_well_separated_people_lose_nothing():
    z, who = unit([0, 0.1, 180, 180.1]), torch.tensor([0, 0, 1, 1])
    assert float(losses.contrast(z, who)) < 1e-6 and float(losses.triplets(z, who)) == 0


def test_triplets_count_hard_pairs_by_the_margin():
    angles, who = [0.0, 30.0, 20.0, 120.0], torch.tensor([0, 0, 1, 1])
    z = unit(angles)

    def far(a, b):
        return 2 * np.sin(np.deg2rad(abs(angles[a] - angles[b])) / 2)

    lost = []
    for a in range(4):
        own = a ^ 1
        others = [b for b in range(4) if b not in (a, own)]
        cosine = {b: np.cos(np.deg2rad(angles[a] - angles[b])) for b in range(4)}
        if cosine[own] - 0.1 < max(cosine[b] for b in others):
            lost += [far(a, own) - far(a, b) + 0.01 for b in others if cosine[b] + 0.1 > cosine[own]]
    lost = [x for x in lost if x > 0]
    assert lost and float(losses.triplets(z, who)) == pytest.approx(np.mean(lost), rel=1e-6)


def test_equal_embeddings_have_a_slope():
    z = unit([0, 0, 0, 0]).requires_grad_()
    for loss in set(losses.OF.values()):
        loss(z, torch.tensor([0, 0, 1, 1])).backward()
        assert torch.isfinite(z.grad).all()
