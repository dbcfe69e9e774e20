"""GaitFormer: attention over the joints of a frame, then over the times of each joint.

INPUT   (N, 60, 17, 2): x and y, both divided by 320. OUTPUT  unit embeddings (N, 128).
"""

import torch
from torch import nn
from torch.nn import functional

from dior.reid.networks.transformer import DIM, EPS, JOINTS, SpatialNetwork, blocks

FRAMES, EMBEDDING = 60, 128


class GaitFormer(SpatialNetwork):
    def __init__(self) -> None:
        super().__init__()
        self.temporal_pos_embed = nn.Parameter(torch.zeros(1, FRAMES + 1, DIM))
        self.temporal_cls_token = nn.Parameter(torch.randn(1, 1, DIM))
        self.temporal_blocks = blocks()
        self.temporal_norm = nn.LayerNorm(DIM, eps=EPS)
        self.head = nn.Sequential(nn.LayerNorm(JOINTS * DIM, eps=1e-5), nn.Linear(JOINTS * DIM, EMBEDDING))

    def temporal(self, x: torch.Tensor) -> torch.Tensor:
        n, t = x.shape[:2]
        if t != FRAMES:
            raise ValueError(f"GaitFormer takes {FRAMES} frames, not {t}")
        y = x.transpose(1, 2).reshape(n * JOINTS, t, DIM)
        y = torch.cat([self.temporal_cls_token.expand(n * JOINTS, 1, DIM), y], dim=1) + self.temporal_pos_embed
        for block in self.temporal_blocks:
            y = block(y)
        y = self.temporal_norm(y)[:, 0].reshape(n, JOINTS * DIM)
        return functional.normalize(self.head(y), dim=1)
