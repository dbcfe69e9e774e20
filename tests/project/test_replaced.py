"""What a file or folder holds is told by its length and ends, never by its time."""

import os

import pytest

from dior.project import replaced


@pytest.fixture(autouse=True)
def forgetful():
    """Each test plans anew."""
    replaced.state.cache_clear()


def state(path):
    replaced.state.cache_clear()
    return replaced.state(str(path))


def flip(path, at):
    """Change one byte and keep length and times."""
    times = path.stat()
    content = bytearray(path.read_bytes())
    content[at] ^= 1
    path.write_bytes(content)
    os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))


@pytest.mark.parametrize("size", [1, replaced.END, replaced.END + 1, 3 * replaced.END])
@pytest.mark.parametrize("at", [0, -1])
def test_a_byte_at_either_end_counts_and_the_time_does_not(tmp_path, size, at):
    path = tmp_path / "a.bag"
    path.write_bytes(b"x" * size)
    before = state(path)
    os.utime(path, (0, 0))
    assert state(path) == before and before.startswith(f"{size} ")
    flip(path, at)
    assert state(path) != before


def test_a_short_file_counts_whole_and_of_a_long_one_the_middle_does_not(tmp_path):
    path = tmp_path / "a.bag"
    path.write_bytes(b"x" * 2 * replaced.END)
    before = state(path)
    flip(path, replaced.END)
    assert state(path) != before
    path.write_bytes(b"x" * 3 * replaced.END)
    before = state(path)
    flip(path, replaced.END + 1)
    assert state(path) == before


def test_a_file_that_grew_or_is_not_there(tmp_path):
    path = tmp_path / "a.bag"
    assert state(path) == replaced.MISSING
    path.write_bytes(b"")
    empty = state(path)
    path.write_bytes(b"x")
    assert len({empty, state(path), replaced.MISSING}) == 3
    (tmp_path / "link").symlink_to(tmp_path / "nowhere")
    assert state(tmp_path / "link") == replaced.MISSING


def test_in_a_folder_names_lengths_and_some_files_count(tmp_path):
    folder = tmp_path / "openpose"
    (folder / "deep").mkdir(parents=True)
    empty = state(folder)
    names = [*(folder / f"{i:03d}.json" for i in range(100)), folder / "deep/a.json"]
    for path in names:
        path.write_text("{}")
    seen = [state(folder)]
    assert seen[0] not in (empty, replaced.MISSING)
    for path in names:
        os.utime(path, (0, 0))
    assert state(folder) == seen[0]
    flip(names[0], 0)
    seen.append(state(folder))
    names[50].write_text("{ }")
    seen.append(state(folder))
    names[51].rename(folder / "other.json")
    seen.append(state(folder))
    names[-1].unlink()
    seen.append(state(folder))
    assert len(set(seen)) == len(seen)
    # one of 100 that is not opened
    flip(folder / "001.json", 0)
    assert state(folder) == seen[-1]
