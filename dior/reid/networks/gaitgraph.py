"""GaitGraph: a residual graph convolution network ("resgcn-n39-r8") over the COCO-17 graph.

INPUT   (N, 1, 3, T, 17): x, y in pixels of a 320x240 picture, confidence. OUTPUT  unit embeddings (N, 128).
Any T; trained with 60. A block mixes joints (spatial), then times (temporal), in a bottleneck an eighth as wide.
"""

from collections.abc import Iterable, Sequence

import torch
from torch import nn
from torch.nn import functional

from dior.reid.networks.graph import adjacency

KERNEL, REDUCTION, HOPS = 9, 8, 3
EMBEDDING = 128


class GraphConv(nn.Module):
    """1x1 convolution for each number of hops, summed over the joints that many hops away."""

    def __init__(self, inside: int, outside: int) -> None:
        super().__init__()
        self.gcn = nn.Conv2d(inside, HOPS * outside, 1)

    def forward(self, x: torch.Tensor, weights: torch.Tensor) -> torch.Tensor:
        """x (N, C, T, 17), weights (4, 17, 17) -> (N, outside, T, 17)."""
        n, _, t, v = x.shape
        y = self.gcn(x).view(n, HOPS, -1, t, v)
        return torch.einsum("nkctv,kvw->nctw", y, weights[:HOPS])


class BasicSpatial(nn.Module):
    def __init__(self, inside: int, outside: int) -> None:
        super().__init__()
        self.conv = GraphConv(inside, outside)
        self.bn = nn.BatchNorm2d(outside)

    def forward(self, x: torch.Tensor, weights: torch.Tensor) -> torch.Tensor:
        return torch.relu(self.bn(self.conv(x, weights)))


class BasicTemporal(nn.Module):
    def __init__(self, channels: int) -> None:
        super().__init__()
        self.conv = _over_time(channels, 1)
        self.bn = nn.BatchNorm2d(channels)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        return torch.relu(self.bn(self.conv(x)))


class BottleneckSpatial(nn.Module):
    def __init__(self, inside: int, outside: int) -> None:
        super().__init__()
        narrow = outside // REDUCTION
        self.residual = nn.Identity() if inside == outside else _matched(inside, outside, 1)
        self.conv_down = nn.Conv2d(inside, narrow, 1)
        self.bn_down = nn.BatchNorm2d(narrow)
        self.conv = GraphConv(narrow, narrow)
        self.bn = nn.BatchNorm2d(narrow)
        self.conv_up = nn.Conv2d(narrow, outside, 1)
        self.bn_up = nn.BatchNorm2d(outside)

    def forward(self, x: torch.Tensor, weights: torch.Tensor) -> torch.Tensor:
        y = torch.relu(self.bn_down(self.conv_down(x)))
        y = torch.relu(self.bn(self.conv(y, weights)))
        return torch.relu(self.bn_up(self.conv_up(y)) + self.residual(x))


class BottleneckTemporal(nn.Module):
    def __init__(self, channels: int, stride: int) -> None:
        super().__init__()
        narrow = channels // REDUCTION
        self.residual = nn.Identity() if stride == 1 else _matched(channels, channels, stride)
        self.conv_down = nn.Conv2d(channels, narrow, 1)
        self.bn_down = nn.BatchNorm2d(narrow)
        self.conv = _over_time(narrow, stride)
        self.bn = nn.BatchNorm2d(narrow)
        self.conv_up = nn.Conv2d(narrow, channels, 1)
        self.bn_up = nn.BatchNorm2d(channels)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        y = torch.relu(self.bn_down(self.conv_down(x)))
        y = torch.relu(self.bn(self.conv(y)))
        return torch.relu(self.bn_up(self.conv_up(y)) + self.residual(x))


class Block(nn.Module):
    """Joints, then times; `edge` weighs the graph's links and is learned."""

    def __init__(self, spatial: nn.Module, temporal: nn.Module, graph: torch.Tensor) -> None:
        super().__init__()
        self.edge = nn.Parameter(torch.ones_like(graph))
        self.scn = spatial
        self.tcn = temporal

    def forward(self, x: torch.Tensor, graph: torch.Tensor) -> torch.Tensor:
        return self.tcn(self.scn(x, graph * self.edge))


class Branch(nn.Module):
    """The input's own blocks, the first without a bottleneck; `widths`: of the others."""

    def __init__(self, channels: int, widths: Sequence[tuple[int, int, int]], graph: torch.Tensor) -> None:
        super().__init__()
        self.register_buffer("A", graph.clone())
        self.bn = nn.BatchNorm2d(channels)
        first = Block(BasicSpatial(channels, 64), BasicTemporal(64), graph)
        self.layers = nn.ModuleList([first, *bottlenecks(widths, graph)])

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        x = self.bn(x)
        for layer in self.layers:
            x = layer(x, self.A)
        return x


class GaitGraph(nn.Module):
    def __init__(self) -> None:
        super().__init__()
        graph = torch.tensor(adjacency(), dtype=torch.float32)
        self.register_buffer("A", graph)
        self.input_branches = nn.ModuleList([Branch(3, ((64, 64, 1), (64, 32, 1)), graph)])
        widths = ((32, 128, 2), (128, 128, 1), (128, 256, 2), (256, 256, 1))
        self.main_stream = bottlenecks(widths, graph)
        self.fcn = nn.Linear(256, EMBEDDING)
        initialise(self, self.fcn)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        return functional.normalize(joined(x, self.input_branches, self.main_stream, self.fcn, self.A), dim=1)


def joined(
    x: torch.Tensor, branches: Iterable[nn.Module], stream: Iterable[nn.Module], head: nn.Module, graph: torch.Tensor
) -> torch.Tensor:
    """x (N, branches, C, T, 17), a part for each branch, through what follows them -> (N, 128), of any length."""
    y = torch.cat([branch(x[:, i]) for i, branch in enumerate(branches)], dim=1)
    for block in stream:
        y = block(y, graph)
    return head(y.mean(dim=(2, 3)))


def bottlenecks(widths: Iterable[tuple[int, int, int]], graph: torch.Tensor) -> nn.ModuleList:
    """Blocks by their channels inside and outside and their step in time."""
    return nn.ModuleList(
        [Block(BottleneckSpatial(a, b), BottleneckTemporal(b, stride), graph) for a, b, stride in widths]
    )


def _over_time(channels: int, stride: int) -> nn.Conv2d:
    return nn.Conv2d(channels, channels, (KERNEL, 1), (stride, 1), (KERNEL // 2, 0))


def _matched(inside: int, outside: int, stride: int) -> nn.Sequential:
    """What is added back where the shape changes."""
    return nn.Sequential(nn.Conv2d(inside, outside, 1, (stride, 1)), nn.BatchNorm2d(outside))


def initialise(network: nn.Module, head: nn.Linear) -> None:
    """The authors' start: Kaiming convolutions; a bottleneck adds nothing at first."""
    for name, module in network.named_modules():
        if isinstance(module, nn.Conv2d):
            nn.init.kaiming_normal_(module.weight, mode="fan_out", nonlinearity="relu")
            nn.init.zeros_(module.bias)
        if isinstance(module, nn.BatchNorm2d) and name.endswith("bn_up"):
            nn.init.zeros_(module.weight)
    nn.init.normal_(head.weight, 0.0, 0.001)
    nn.init.zeros_(head.bias)
