"""Damaged files: the tool of benchmarks.fuzz notices what it is to notice, and no reader of dior gives it cause to."""

import os
import time

import pytest

from benchmarks import fuzz
from benchmarks.fuzz_readers import READERS, Reader
from dior.errors import DiorError


def of(monkeypatch, count, read):
    """What the tool says of a reader that takes file number i as `read(i, path)` does."""
    monkeypatch.setattr(fuzz, "LIMIT_MB", 50)
    monkeypatch.setattr(fuzz, "LIMIT_S", 0.3)
    monkeypatch.setattr(fuzz, "PATIENCE_S", 10.0)
    monkeypatch.setattr(fuzz, "damaged", lambda reader, seed, i: (f"{i}.txt", b""))
    monkeypatch.setitem(READERS, "mine", Reader(lambda: {"a.txt": b"1"}, lambda path, _: read(int(path.stem), path)))
    return fuzz.fuzzed("mine", count, 1)


@pytest.mark.slow
def test_each_kind_of_fault_is_noticed_and_ends_nothing(monkeypatch):
    kept = []

    def busy():
        end = time.process_time() + 0.5
        while time.process_time() < end:
            pass

    def refuse(path):
        raise DiorError(f"{path}: no")

    def refuse_another(path):
        raise DiorError("another.txt: no")

    ways = [
        lambda path: None, refuse, refuse_another, lambda path: int("x"), lambda path: busy(), lambda path: os._exit(3),
        lambda path: kept.append(bytearray(os.urandom(1) * (80 << 20))), lambda path: time.sleep(60), lambda path: None,
    ]  # fmt: skip
    found = of(monkeypatch, len(ways), lambda i, path: ways[i](path))
    assert (found.read, found.refused) == (4, 1), "those that are slow or large are read"
    assert {kind.split(" at ")[0]: files for kind, files in found.faults.items()} == {
        "a refusal that does not name the file": [2],
        "ValueError": [3],
        "slow": [4, 7],
        "a crash (exit code 3)": [5],
        "memory": [6],
    }
    assert found.megabytes > 50 and "test_fuzz.py" in " ".join(found.faults)


@pytest.mark.parametrize("reader", READERS)
def test_a_file_is_the_same_each_time_and_hardly_one_is_whole(reader):
    files = [fuzz.damaged(reader, 1, i) for i in range(12)]
    assert files == [fuzz.damaged(reader, 1, i) for i in range(12)]
    assert files != [fuzz.damaged(reader, 2, i) for i in range(12)]
    samples = READERS[reader].samples()
    assert sum(content == samples[name] for name, content in files) < 4


@pytest.mark.parametrize("reader", READERS)
def test_whole_files_are_read(tmp_path, reader):
    """Or what is done to them would show nothing."""
    for name, content in READERS[reader].samples().items():
        path = fuzz.prepared(READERS[reader], tmp_path / "files", name, content)
        READERS[reader].read(path, tmp_path / "files")


@pytest.mark.slow
@pytest.mark.parametrize("reader", READERS)
def test_damaged_files_are_read_or_refused_in_a_sentence(reader):
    """`python -m benchmarks.fuzz` takes 5000 of each."""
    found = fuzz.fuzzed(reader, 150, 23)
    assert not found.faults, found.examples
    assert found.read and found.refused
