"""The authors' paths from a sequence to its embedding."""

import numpy as np
import pytest

from dior.reid import embed, networks
from tests.reid import parity

SEQUENCE = 320 * parity.walk("gaitmixer", 300)[0]


def test_windows_are_those_of_the_authors():
    assert embed.windows(300) == (120, 100, 140)
    assert embed.windows(60) == (0, 0, 0)
    assert embed.windows(61) == (0, 0, 1)
    assert embed.windows(120) == (30, 10, 50)


def test_gaitgraph_sees_the_middle_with_a_confidence():
    given = embed.given("gaitgraph", embed.middle(SEQUENCE), 1.0)
    assert given.shape == (1, 3, 60, 17)
    assert (given[0, :2] == np.moveaxis(SEQUENCE[120:180], -1, 0)).all() and (given[0, 2] == 1).all()


@pytest.mark.parametrize("name", ["gaitmixer", "gaitformer"])
@pytest.mark.parametrize("frames", [300, 97, 60])
def test_the_others_see_three_windows_both_ways(name, frames):
    torch = pytest.importorskip("torch", reason="PyTorch is not installed: pip install -r requirements-reid.txt")
    torch.manual_seed(1)
    network, uv = networks.build(name), SEQUENCE[:frames]
    parts = np.stack([uv[first : first + 60] for first in embed.windows(frames)]) / 320
    with torch.inference_mode():
        each = network(torch.tensor(np.concatenate([parts, parts[:, ::-1]]), dtype=torch.float32)).numpy()
    assert np.abs(embed.embeddings(name, network, [uv])[0] - each.mean(axis=0)).max() < 1e-6


def test_a_short_sequence_is_refused():
    pytest.importorskip("torch", reason="PyTorch is not installed: pip install -r requirements-reid.txt")
    with pytest.raises(ValueError, match="59 frames"):
        embed.embeddings("gaitmixer", None, [SEQUENCE[:59]])


@pytest.mark.parametrize("name", parity.NAMES)
def test_embeddings_do_not_depend_on_the_batch(name, monkeypatch):
    torch = pytest.importorskip("torch", reason="PyTorch is not installed: pip install -r requirements-reid.txt")
    torch.manual_seed(1)
    network = networks.build(name)
    sequences = [SEQUENCE, SEQUENCE[:200], SEQUENCE[50:130] * 0.9]
    found = embed.embeddings(name, network, sequences)
    assert found.shape == (3, 128)
    monkeypatch.setattr(embed, "BATCH", 2)
    assert np.abs(embed.embeddings(name, network, sequences) - found).max() < 1e-5
    assert np.abs(embed.embeddings(name, network, sequences[1:2]) - found[1:2]).max() < 1e-5
    # the mean of six unit vectors is shorter than one
    lengths = np.linalg.norm(found, axis=1)
    assert lengths == pytest.approx(np.ones(3)) if name == "gaitgraph" else (lengths < 1 + 1e-6).all()


def test_distances_are_those_of_the_authors():
    found = np.array([[3.0, 0.0], [0.0, 2.0], [1.0, 0.0]])
    assert embed.distances("gaitmixer", found) == pytest.approx(np.array([[0, 1, 0], [1, 0, 1], [0, 1, 0]]))
    assert embed.distances("gaitgraph", found)[0] == pytest.approx([0, np.sqrt(13), 2])
