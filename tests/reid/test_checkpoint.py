"""Checkpoints of all kinds, kind and unkind."""

import io
import os
import pickle
import zipfile
from collections import OrderedDict

import numpy as np
import pytest

from dior.errors import DiorError
from dior.reid import checkpoint, networks
from tests.reid import parity

torch = pytest.importorskip("torch", reason="PyTorch is not installed: pip install -r requirements-reid.txt")


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    """A checkpoint of GaitMixer, and its network."""
    path = tmp_path_factory.mktemp("checkpoint") / "mixer.pt"
    network = networks.build("gaitmixer")
    torch.save(network.state_dict(), path)
    return path, network


def same(a, b):
    return all(torch.equal(x, b.state_dict()[key]) for key, x in a.state_dict().items())


def with_pickle(path, text, members=()):
    """A zip like a checkpoint's, of this pickle."""
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("archive/data.pkl", text)
        for name, content in members:
            file.writestr(f"archive/{name}", content)
    return path


class Call:
    """Pickled, this is a call of a function."""

    def __init__(self, function, *given):
        self.call = function, given

    def __reduce__(self):
        return self.call


@pytest.mark.parametrize("wrap", ["bare", "model", "state_dict", "prefixed", "optimiser"])
def test_every_wrapping_of_weights_is_read(tmp_path, saved, wrap):
    _, network = saved
    state, path = network.state_dict(), tmp_path / "a.pt"
    if wrap == "prefixed":
        state = OrderedDict((f"module.{key}", value) for key, value in state.items())
    if wrap == "optimiser":
        adam = torch.optim.Adam(network.parameters(), lr=1e-3)
        schedule = torch.optim.lr_scheduler.OneCycleLR(adam, 1e-2, total_steps=10)
        state = {"model": state, "optimizer": adam.state_dict(), "scheduler": schedule, "epoch": 3}
    if wrap in ("model", "state_dict"):
        state = {wrap: state}
    torch.save(state, path)
    assert same(checkpoint.load("gaitmixer", path), network)


def test_a_graph_that_is_not_saved_is_known(tmp_path):
    network = networks.build("gaitgraph")
    torch.save({k: v for k, v in network.state_dict().items() if k.rsplit(".")[-1] != "A"}, tmp_path / "a.pt")
    assert same(checkpoint.load("gaitgraph", tmp_path / "a.pt"), network)
    torch.save(network.state_dict() | {"A": network.A + 0.1}, tmp_path / "b.pt")
    with pytest.raises(DiorError, match="b.pt: made for another skeleton"):
        checkpoint.load("gaitgraph", tmp_path / "b.pt")


def test_the_wrong_network_is_named(saved):
    path, _ = saved
    with pytest.raises(DiorError, match="mixer.pt: not weights of gaitformer: .* missing.*; they fit gaitmixer"):
        checkpoint.load("gaitformer", path)


def test_a_misshapen_tensor_is_named(tmp_path, saved):
    state = saved[1].state_dict() | {"head.1.bias": torch.zeros(64)}
    torch.save(state, tmp_path / "a.pt")
    with pytest.raises(DiorError, match=r"head.1.bias has the shape \(64,\), not \(128,\)"):
        checkpoint.load("gaitmixer", tmp_path / "a.pt")


def test_a_weight_that_is_no_number_is_refused(tmp_path, saved):
    torch.save(saved[1].state_dict() | {"head.1.bias": torch.full((128,), np.nan)}, tmp_path / "a.pt")
    with pytest.raises(DiorError, match="head.1.bias has values that are no numbers"):
        checkpoint.load("gaitmixer", tmp_path / "a.pt")


@pytest.mark.parametrize("share", [0.0, 0.3, 0.99])
def test_a_truncated_file_is_refused(tmp_path, saved, share):
    content = saved[0].read_bytes()
    (tmp_path / "cut.pt").write_bytes(content[: int(share * len(content))])
    with pytest.raises(DiorError, match="cut.pt: .*truncated"):
        checkpoint.load("gaitmixer", tmp_path / "cut.pt")


def test_damaged_numbers_are_refused(tmp_path, saved):
    content = bytearray(saved[0].read_bytes())
    with zipfile.ZipFile(saved[0]) as file:
        largest = max(file.infolist(), key=lambda info: info.file_size)
    at = largest.header_offset + 300
    content[at : at + 8] = bytes(255 - b for b in content[at : at + 8])
    (tmp_path / "bad.pt").write_bytes(content)
    with pytest.raises(DiorError, match="bad.pt: refused, .*CRC"):
        checkpoint.load("gaitmixer", tmp_path / "bad.pt")


@pytest.mark.parametrize("named", ["os.system", "builtins.eval", "builtins.exec", "torch.load"])
def test_a_malicious_pickle_runs_nothing(tmp_path, monkeypatch, named):
    sign = tmp_path / "was_here"
    calls = {
        "os.system": Call(os.system, f"touch {sign}"),
        "builtins.eval": Call(eval, f"open({str(sign)!r}, 'w').close()"),
        "builtins.exec": Call(exec, f"open({str(sign)!r}, 'w').close()"),
        "torch.load": Call(torch.load, str(sign)),
    }
    path = with_pickle(tmp_path / "evil.pt", pickle.dumps({"model": calls[named]}, protocol=2))
    with pytest.raises(DiorError, match="evil.pt: refused, .*it names .*, which no checkpoint of a network needs"):
        checkpoint.load("gaitmixer", path)
    assert not sign.exists()


def test_getattr_of_a_training_reaches_nothing(tmp_path):
    # getattr is allowed as a word, since the authors' checkpoint has it, but does nothing
    class Steal:
        def __reduce__(self):
            return getattr, (OrderedDict, "__subclasses__")

    text = pickle.dumps({"model": Steal()}, protocol=2)
    with pytest.raises(DiorError, match="holds no weights"):
        checkpoint.read(with_pickle(tmp_path / "a.pt", text))


def test_a_pickle_cannot_change_what_reads_it(tmp_path):
    def build(module, name):
        # PROTO 2, GLOBAL, (None, {"__new__": 1}), BUILD, STOP
        return b"\x80\x02c" + f"{module}\n{name}\n".encode() + b"N}U\x07__new__K\x01s\x86b."

    for module, name in (
        ("torch._utils", "_rebuild_tensor_v2"),
        ("argparse", "Namespace"),
        ("collections", "OrderedDict"),
    ):
        with pytest.raises(DiorError, match="a.pt: refused"):
            checkpoint.read(with_pickle(tmp_path / "a.pt", build(module, name)))


def tensor_pickle(offset, shape, strides, count):
    """A pickle of {"w": tensor} with this view of a storage of `count` numbers."""

    class Storage:
        pass

    class View:
        def __reduce__(self):
            return torch._utils._rebuild_tensor_v2, (Storage(), offset, shape, strides, False, OrderedDict())

    class Pickler(pickle.Pickler):
        def persistent_id(self, thing):
            return ("storage", torch.FloatStorage, "0", "cpu", count) if isinstance(thing, Storage) else None

    text = io.BytesIO()
    Pickler(text, protocol=2).dump({"w": View()})
    return text.getvalue()


@pytest.mark.parametrize(
    ("offset", "shape", "strides"), [(0, (11,), (1,)), (8, (4,), (1,)), (-1, (2,), (1,)), (0, (10**9,), (0,))]
)
def test_a_tensor_beyond_its_numbers_is_refused(tmp_path, offset, shape, strides):
    numbers = [("data/0", np.arange(10, dtype="<f4").tobytes())]
    whole = with_pickle(tmp_path / "whole.pt", tensor_pickle(1, (3, 3), (1, 3), 10), numbers)
    assert (checkpoint.read(whole)["w"] == np.arange(1, 10).reshape(3, 3).T).all()
    path = with_pickle(tmp_path / "a.pt", tensor_pickle(offset, shape, strides, 10), numbers)
    with pytest.raises(DiorError, match="a.pt: refused, .*storage"):
        checkpoint.read(path)


def test_something_else_is_refused(tmp_path):
    (tmp_path / "a.pt").write_text("hello")
    with pytest.raises(DiorError, match="not a checkpoint as torch.save writes it"):
        checkpoint.read(tmp_path / "a.pt")
    with zipfile.ZipFile(tmp_path / "b.zip", "w") as file:
        file.writestr("hello.txt", "hello")
    with pytest.raises(DiorError, match="0 pickles in it"):
        checkpoint.read(tmp_path / "b.zip")
    with pytest.raises(DiorError, match="there is no such checkpoint"):
        checkpoint.read(tmp_path / "c.pt")


def test_the_released_weights_are_read():
    for name, file, count in (("gaitgraph", "gaitgraph.pth", 317), ("gaitmixer", "gaitmixer.pt", 114)):
        assert len(checkpoint.read(parity.weights_file(file))) == count, name
