"""Networks of which there are no reference embeddings: their sizes by their authors' tables, and what has to hold."""

import numpy as np
import pytest

from dior.reid import channels, checkpoint, embed, networks
from tests.reid import parity

torch = pytest.importorskip("torch", reason="PyTorch is not installed: pip install -r requirements-reid.txt")

NEWER = ("gaitgraph2",)
SEQUENCE = 320 * parity.walk("gaitmixer", 120)[0]


def conv(inside, outside, kernel=1):
    return inside * outside * kernel + outside


def norm(channels):
    return 2 * channels


def bottleneck(inside, outside, stride, reduction=8):
    """ResGCN's block (Song et al., ACM MM 2020, and its code): 1x1 down, graph or time, 1x1 up; spatial, temporal."""
    narrow = outside // reduction
    ends = conv(inside, narrow) + norm(narrow) + conv(narrow, outside) + norm(outside)
    spatial = (
        ends + conv(narrow, 3 * narrow) + norm(narrow) + (inside != outside) * (conv(inside, outside) + norm(outside))
    )
    ends = conv(outside, narrow) + norm(narrow) + conv(narrow, outside) + norm(outside)
    temporal = ends + conv(narrow, narrow, 9) + norm(narrow) + (stride > 1) * (conv(outside, outside) + norm(outside))
    return EDGE + spatial + temporal


# four hops of 17 joints
EDGE = 4 * 17 * 17


def initial(inside):
    return norm(inside) + EDGE + conv(inside, 3 * 64) + norm(64) + conv(64, 64, 9) + norm(64)


def resgcn(branches, channels, widths, stream):
    branch = initial(channels) + sum(bottleneck(*width) for width in widths)
    return branches * branch + sum(bottleneck(*width) for width in stream) + conv(256, 128)


def of_gaitgraph2():
    """n21-r8: structure 1, 1, 1, 1 in bottlenecks of an eighth (tteepe/GaitGraph2, configs/casia_b.yaml)."""
    return resgcn(3, 5, [(64, 32, 1)], [(96, 128, 2), (128, 256, 2)])


SIZES = {"gaitgraph2": of_gaitgraph2}


def parameters(name):
    return sum(p.numel() for p in networks.build(name).parameters())


def test_the_sums_of_the_tables_are_right_for_a_released_network():
    """319 530: of the authors' checkpoint of GaitGraph, n39-r8 (../shared/reid/spec.md)."""
    stream = [(32, 128, 2), (128, 128, 1), (128, 256, 2), (256, 256, 1)]
    assert resgcn(1, 3, [(64, 64, 1), (64, 32, 1)], stream) == 319_530 == parameters("gaitgraph")


@pytest.mark.parametrize("name", NEWER)
def test_a_network_has_as_many_parameters_as_its_table(name):
    assert parameters(name) == SIZES[name]()


def hashed(name):
    """The network with made-up weights, in float64: those of the start leave whole paths at 0."""
    network = networks.build(name)
    shapes = {key: tuple(value.shape) for key, value in network.state_dict().items()}
    checkpoint.fill(network, parity.hashed(shapes), name, "rule B")
    return network.double()


def inputs(name, people=3):
    walks = 320 * parity.walk("gaitmixer", 60, people)
    return torch.tensor(np.stack([embed.given(name, uv, 0.86) for uv in walks]), dtype=torch.float64)


@pytest.mark.parametrize("name", NEWER)
def test_a_sequence_is_embedded_as_it_is_among_others_in_any_order(name):
    network, given = hashed(name), inputs(name)
    with torch.no_grad():
        found = network(given)
        assert found.shape == (3, networks.EMBEDDING) and torch.isfinite(found).all()
        assert (found[0] - found[1]).abs().max() > 1e-4
        assert (network(given[[2, 0, 1]]) - found[[2, 0, 1]]).abs().max() < 1e-9
        assert (network(given[1:2]) - found[1:2]).abs().max() < 1e-9


@pytest.mark.parametrize("name", NEWER)
def test_every_parameter_is_learned(name):
    network = hashed(name)
    weights = torch.linspace(-1, 1, 3 * networks.EMBEDDING, dtype=torch.float64).view(3, -1)
    (network(inputs(name)) * weights).sum().backward()
    still = [key for key, p in network.named_parameters() if p.grad is None or not p.grad.abs().max() > 0]
    assert not still


@pytest.mark.parametrize("name", NEWER)
def test_the_same_seed_gives_the_same_network(name):
    made = []
    for seed in (1, 1, 2):
        torch.manual_seed(seed)
        made.append(torch.cat([p.flatten() for p in networks.build(name).parameters()]))
    assert torch.equal(made[0], made[1]) and not torch.equal(made[0], made[2])


@pytest.mark.parametrize("name", NEWER)
def test_embeddings_do_not_depend_on_the_batch(name, monkeypatch):
    network, sequences = hashed(name).float(), [SEQUENCE, SEQUENCE[:97], SEQUENCE[20:90] * 0.9]
    found = embed.embeddings(name, network, sequences)
    assert found.shape == (3, embed.WIDTHS.get(name, networks.EMBEDDING))
    monkeypatch.setattr(embed, "BATCH", 2)
    assert embed.embeddings(name, network, sequences[::-1]) == pytest.approx(found[::-1], abs=1e-4)
    assert embed.embeddings(name, network, []).shape == (0, found.shape[1])


def test_gaitgraph2_sees_the_middle_backwards_and_with_sides_exchanged():
    network = hashed("gaitgraph2").float()
    there, back, exchanged = embed.embeddings(
        "gaitgraph2", network, [SEQUENCE, SEQUENCE[::-1], SEQUENCE[:, channels.EXCHANGED]]
    ).reshape(3, 3, -1)
    assert np.linalg.norm(there) == pytest.approx(1, abs=1e-5)

    def same(a, b):
        return np.abs(a / np.linalg.norm(a) - b / np.linalg.norm(b)).max() < 1e-4

    assert same(back[0], there[1]) and same(back[1], there[0])
    assert same(exchanged[0], there[2]) and same(exchanged[2], there[0])
    assert not same(there[0], there[1]) and not same(there[0], there[2])


def test_a_checkpoint_of_lightning_is_gaitgraph2s(tmp_path):
    network = hashed("gaitgraph2").float()
    state = {f"backbone.{key}": value for key, value in network.state_dict().items()}
    torch.save({"epoch": 3, "state_dict": state}, tmp_path / "last.ckpt")
    loaded = checkpoint.load("gaitgraph2", tmp_path / "last.ckpt")
    assert all(torch.equal(a, b) for a, b in zip(loaded.parameters(), network.parameters(), strict=True))
