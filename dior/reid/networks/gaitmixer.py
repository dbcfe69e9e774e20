"""GaitMixer: attention over the joints of a frame, then long convolutions over time.

INPUT   (N, T, 17, 2): x and y, both divided by 320; T at least 31. OUTPUT  unit embeddings (N, 128).
No parameter depends on T, so that weights trained with 60 frames work with any.
"""

import torch
from torch import nn
from torch.nn import functional

from dior.reid.networks.transformer import DIM, SpatialNetwork

KERNEL, WIDTHS, EMBEDDING = 31, (DIM, 32, 64, 128, 256), 128
BATCH_EPS, DROPOUT = 1e-3, 0.01


class DepthwiseConv(nn.Module):
    """Each channel over time, then the channels of each time."""

    def __init__(self, inside: int, outside: int) -> None:
        super().__init__()
        self.depthwise = nn.Conv2d(inside, inside, (KERNEL, 1), groups=inside)
        self.pointwise = nn.Conv2d(inside, outside, 1)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        return self.pointwise(self.depthwise(x))


class TemporalBlock(nn.Module):
    """x (N, C, T, 17) -> (N, outside, T, 17); a time sees itself and the 30 before it, reflected at the start."""

    def __init__(self, inside: int, outside: int) -> None:
        super().__init__()
        self.dropout = nn.Dropout(DROPOUT)
        self.conv = DepthwiseConv(inside, outside)
        self.bn = nn.BatchNorm2d(outside, eps=BATCH_EPS)
        self.linear = nn.Linear(inside, outside) if inside != outside else None
        if inside != outside:
            self.bn_skip = nn.BatchNorm2d(outside, eps=BATCH_EPS)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        past = functional.pad(self.dropout(x), (0, 0, KERNEL - 1, 0), mode="reflect")
        return self.bn(functional.gelu(self.conv(past))) + self._skip(x)

    def _skip(self, x: torch.Tensor) -> torch.Tensor:
        if self.linear is None:
            return x
        # a linear layer over the channels where they are: nothing is moved
        y = functional.conv2d(x, self.linear.weight[:, :, None, None], self.linear.bias)
        return self.bn_skip(functional.gelu(y))


class GaitMixer(SpatialNetwork):
    def __init__(self) -> None:
        super().__init__()
        for i in range(1, len(WIDTHS)):
            setattr(self, f"conv{i}", TemporalBlock(WIDTHS[i - 1], WIDTHS[i]))
        self.head = nn.Sequential(nn.LayerNorm(WIDTHS[-1], eps=1e-5), nn.Linear(WIDTHS[-1], EMBEDDING))

    def temporal(self, x: torch.Tensor) -> torch.Tensor:
        y = x.permute(0, 3, 1, 2)
        for i in range(1, len(WIDTHS)):
            y = getattr(self, f"conv{i}")(y)
        return functional.normalize(self.head(y.mean(dim=(2, 3))), dim=1)
