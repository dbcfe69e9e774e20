"""What GaitMixer and GaitFormer share: pre-norm transformer blocks, and the stage that mixes the joints of a frame."""

import torch
from torch import nn
from torch.nn import functional

DIM, HEADS, MLP, BLOCKS, JOINTS = 32, 8, 64, 4, 17
EPS = 1e-6


class Attention(nn.Module):
    def __init__(self) -> None:
        super().__init__()
        self.qkv = nn.Linear(DIM, 3 * DIM)
        self.proj = nn.Linear(DIM, DIM)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        n, tokens, _ = x.shape
        q, k, v = self.qkv(x).view(n, tokens, 3, HEADS, DIM // HEADS).permute(2, 0, 3, 1, 4)
        mixed = functional.scaled_dot_product_attention(q, k, v)
        return self.proj(mixed.transpose(1, 2).reshape(n, tokens, DIM))


class Mlp(nn.Module):
    def __init__(self) -> None:
        super().__init__()
        self.fc1 = nn.Linear(DIM, MLP)
        self.fc2 = nn.Linear(MLP, DIM)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        return self.fc2(functional.gelu(self.fc1(x)))


class Block(nn.Module):
    """(N, tokens, 32) -> the same."""

    def __init__(self) -> None:
        super().__init__()
        self.norm1 = nn.LayerNorm(DIM, eps=EPS)
        self.attn = Attention()
        self.norm2 = nn.LayerNorm(DIM, eps=EPS)
        self.mlp = Mlp()

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        x = x + self.attn(self.norm1(x))
        return x + self.mlp(self.norm2(x))


def blocks() -> nn.ModuleList:
    return nn.ModuleList([Block() for _ in range(BLOCKS)])


class SpatialNetwork(nn.Module):
    """The joints of every frame as tokens; a subclass mixes the times: `temporal` (N, T, 17, 32) -> (N, 128).

    What is done to a frame does not depend on others, so that windows which overlap can share it.
    """

    def __init__(self) -> None:
        super().__init__()
        self.spatial_pos_embed = nn.Parameter(torch.zeros(1, JOINTS, DIM))
        self.spatial_joint_to_embedding = nn.Linear(2, DIM)
        self.spatial_blocks = blocks()
        self.spatial_norm = nn.LayerNorm(DIM, eps=EPS)

    def spatial(self, x: torch.Tensor) -> torch.Tensor:
        """x (N, T, 17, 2) -> (N, T, 17, 32)."""
        n, t, v, _ = x.shape
        y = self.spatial_joint_to_embedding(x.reshape(n * t, v, 2)) + self.spatial_pos_embed
        for block in self.spatial_blocks:
            y = block(y)
        return self.spatial_norm(y).view(n, t, v, DIM)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        return self.temporal(self.spatial(x))
