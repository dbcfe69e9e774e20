"""The networks against the reference embeddings of ../shared/reid."""

import numpy as np
import pytest

from dior.reid import checkpoint, networks
from dior.reid.networks import graph
from tests.reid import parity

torch = pytest.importorskip("torch", reason="PyTorch is not installed: pip install -r requirements-reid.txt")


def embed(network, array):
    with torch.no_grad():
        return network.double()(torch.tensor(array, dtype=torch.float64)).numpy()


def with_hashed_weights(name):
    network = networks.build(name).double()
    shapes = {key: tuple(value.shape) for key, value in network.state_dict().items()}
    checkpoint.fill(network, parity.hashed(shapes), name, "rule B")
    return network


def test_the_graph_is_that_of_the_specification():
    expected = parity.reference("graph_coco17.json")
    assert (graph.hops() == expected["hop_distance_true_graph"]).all()
    assert np.abs(graph.adjacency() - expected["A"]).max() < 1e-12


@pytest.mark.parametrize("name", parity.NAMES)
def test_names_and_shapes_are_those_of_the_authors(name):
    expected = parity.reference(f"state_dict_{name}.json")
    network = networks.build(name)
    shapes = {key: list(value.shape) for key, value in network.state_dict().items()}
    assert shapes == expected["shapes"]
    assert sum(p.numel() for p in network.parameters()) == expected["total_parameters"]


@pytest.mark.parametrize("name", parity.NAMES)
def test_made_up_weights_give_the_reference_embeddings(name):
    cases = [c for c in parity.reference(f"parity_{name}.json")["cases"] if c["name"].startswith("hash_")]
    assert len(cases) >= 2
    network = with_hashed_weights(name)
    for case in cases:
        shape = case["input_shape"]
        frames = shape[3] if name == "gaitgraph" else shape[1]
        given = parity.cosine(shape) if case["name"] == "hash_cos" else parity.walk(name, frames)
        assert list(given.shape) == shape and given.sum() == pytest.approx(case["input_sum"], rel=1e-12)
        assert np.abs(embed(network, given) - np.array(case["embedding_full_float64"])).max() < 1e-7, case["name"]


@pytest.mark.parametrize(("name", "file"), [("gaitgraph", "gaitgraph.pth"), ("gaitmixer", "gaitmixer.pt")])
def test_released_weights_give_the_reference_embeddings(name, file):
    cases = [c for c in parity.reference("parity_author_checkpoints.json")["cases"] if c["model"] == name]
    assert sorted(c["T"] for c in cases) == [60, 300]
    network = checkpoint.load(name, parity.weights_file(file))
    for case in cases:
        found = embed(network, parity.walk(name, case["T"]))
        assert np.abs(found - np.array(case["embedding_float64"])).max() < 1e-6, case["T"]


@pytest.mark.parametrize("name", parity.NAMES)
def test_one_sequence_is_embedded_as_it_is_among_others(name):
    network = with_hashed_weights(name)
    both = parity.walk(name, 60)
    assert np.abs(embed(network, both[1:]) - embed(network, both)[1:]).max() < 1e-12


def test_gaitformer_takes_60_frames_only():
    with pytest.raises(ValueError, match="60 frames, not 61"):
        networks.build("gaitformer")(torch.zeros(1, 61, 17, 2))
