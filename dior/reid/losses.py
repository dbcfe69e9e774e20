"""What a network is trained to make small, as the authors of each did.

INPUTS   embeddings z (N, 128), and of whom each is (N,): torch tensors; unit ones but for GaitGraph2's
OUTPUTS  a scalar
"""

import torch
from torch.nn import functional

# GaitGraph (spec of its scripts): temperature of the contrast, and the one that its size is told in
TEMPERATURE, BASE_TEMPERATURE = 0.01, 0.07
# GaitMixer: how much further another person must be, and how close a pair must come to count
MARGIN, NEAR = 0.01, 0.1
# of a squared distance, since the root has no slope at 0
LEAST = 1e-8


def contrast(z: torch.Tensor, subjects: torch.Tensor) -> torch.Tensor:
    """Supervised contrastive loss (Khosla et al., NeurIPS 2020, the sum outside of the logarithm).

    Every embedding against all others, those of the same subject being right.
    """
    return TEMPERATURE / BASE_TEMPERATURE * _surprise(z @ z.T / TEMPERATURE, subjects)


def distance_contrast(z: torch.Tensor, subjects: torch.Tensor) -> torch.Tensor:
    """The same over the Euclidean distances of embeddings of any length, made 1 first; without the second temperature
    (GaitGraph2: pytorch-metric-learning's SupConLoss with its LpDistance)."""
    unit = functional.normalize(z, dim=1)
    return _surprise(-_far(unit @ unit.T) / TEMPERATURE, subjects)


def _surprise(near: torch.Tensor, subjects: torch.Tensor) -> torch.Tensor:
    """Minus the mean log share of the right ones, by the logits (N, N) of each embedding against each."""
    own = torch.eye(len(near), dtype=torch.bool, device=near.device)
    right = (subjects[:, None] == subjects) & ~own
    log_share = near - torch.logsumexp(near.masked_fill(own, -torch.inf), dim=1, keepdim=True)
    some = right.any(dim=1)
    each = (log_share * right).sum(dim=1)[some] / right.sum(dim=1)[some]
    return -each.mean()


def _far(near: torch.Tensor) -> torch.Tensor:
    """Euclidean distances of unit vectors by their products."""
    return torch.sqrt(torch.clamp(2 - 2 * near, min=LEAST))


def triplets(z: torch.Tensor, subjects: torch.Tensor) -> torch.Tensor:
    """Triplet margin loss over the pairs that are hard for their anchor, the mean of those that are not 0.

    Pairs as in the multi-similarity loss (Wang et al., CVPR 2019): of one subject where another is nearer or about as
    near, of two where one of the own is further or about as far (cosine); distances Euclidean.
    """
    near = z @ z.T
    own = torch.eye(len(z), dtype=torch.bool, device=z.device)
    same = (subjects[:, None] == subjects) & ~own
    other = subjects[:, None] != subjects
    hardest_other = near.masked_fill(~other, -torch.inf).amax(dim=1, keepdim=True)
    hardest_same = near.masked_fill(~same, torch.inf).amin(dim=1, keepdim=True)
    same, other = same & (near - NEAR < hardest_other), other & (near + NEAR > hardest_same)
    far = _far(near)
    lost = torch.relu(far[:, :, None] - far[:, None, :] + MARGIN) * (same[:, :, None] & other[:, None, :])
    return lost.sum() / (lost > 0).sum().clamp(min=1)


OF = {"gaitgraph": contrast, "gaitmixer": triplets, "gaitformer": triplets, "gaitgraph2": distance_contrast}
