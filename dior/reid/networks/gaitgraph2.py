"""GaitGraph2: GaitGraph's blocks with a branch each for joints, velocities and bones ("resgcn-n21-r8").

INPUT   (N, 3, 5, T, 17): `dior.reid.channels.gaitgraph2`. OUTPUT  embeddings (N, 128), of any length
Teepe et al., CVPRW 2022, and their code: depth and width by its CASIA-B configuration, three branches of five channels
by its OUMVLP-Pose script (that for CASIA-B has them in one of 15 by default, which its own test does not feed).
"""

import torch
from torch import nn

from dior.reid.networks.gaitgraph import EMBEDDING, Branch, bottlenecks, initialise, joined
from dior.reid.networks.graph import adjacency

BRANCHES, CHANNELS = 3, 5


class GaitGraph2(nn.Module):
    def __init__(self) -> None:
        super().__init__()
        graph = torch.tensor(adjacency(), dtype=torch.float32)
        self.register_buffer("A", graph)
        self.input_branches = nn.ModuleList([Branch(CHANNELS, ((64, 32, 1),), graph) for _ in range(BRANCHES)])
        self.main_stream = bottlenecks(((32 * BRANCHES, 128, 2), (128, 256, 2)), graph)
        self.fcn = nn.Linear(256, EMBEDDING)
        initialise(self, self.fcn)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        return joined(x, self.input_branches, self.main_stream, self.fcn, self.A)
