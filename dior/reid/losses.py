"""What a network is trained to make small, as the authors of each did.

INPUTS   unit embeddings z (N, 128), and of whom each is (N,): torch tensors. OUTPUTS  a scalar
"""

import torch

# GaitGraph (spec of its scripts): temperature of the contrast, and the one that its size is told in
TEMPERATURE, BASE_TEMPERATURE = 0.01, 0.07
# GaitMixer: how much further another person must be, and how close a pair must come to count
MARGIN, NEAR = 0.01, 0.1


def contrast(z: torch.Tensor, subjects: torch.Tensor) -> torch.Tensor:
    """Supervised contrastive loss (Khosla et al., NeurIPS 2020, the sum outside of the logarithm).

    Every embedding against all others, those of the same subject being right.
    """
    near = z @ z.T / TEMPERATURE
    own = torch.eye(len(z), dtype=torch.bool, device=z.device)
    right = (subjects[:, None] == subjects) & ~own
    log_share = near - torch.logsumexp(near.masked_fill(own, -torch.inf), dim=1, keepdim=True)
    some = right.any(dim=1)
    each = (log_share * right).sum(dim=1)[some] / right.sum(dim=1)[some]
    return -(TEMPERATURE / BASE_TEMPERATURE) * each.mean()


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
    # no slope at distance 0
    far = torch.sqrt(torch.clamp(2 - 2 * near, min=1e-8))
    lost = torch.relu(far[:, :, None] - far[:, None, :] + MARGIN) * (same[:, :, None] & other[:, None, :])
    return lost.sum() / (lost > 0).sum().clamp(min=1)


OF = {"gaitgraph": contrast, "gaitmixer": triplets, "gaitformer": triplets}
