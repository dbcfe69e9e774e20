import os
import subprocess
import sys
import time

import pytest

from dior.errors import DiorError
from dior.tables import files
from dior.tables.files import folder_written_whole, write_text, written_whole


def test_a_file_is_there_whole_or_not_at_all(tmp_path):
    write_text(tmp_path / "a" / "b.txt", "eins\n")
    with pytest.raises(RuntimeError), written_whole(tmp_path / "a" / "b.txt") as part:
        part.write_text("zwei")
        raise RuntimeError
    assert (tmp_path / "a/b.txt").read_text() == "eins\n"
    assert [path.name for path in (tmp_path / "a").iterdir()] == ["b.txt"]


def killed(folder, name, code):
    """Kill a process that writes the file or folder `name` when it has run `code`; returns what is there then."""
    text = f"""
from dior.tables.files import folder_written_whole, written_whole
import time
with {code[0]}({str(folder / name)!r}) as part:
    {code[1]}
    print("written", flush=True)
    time.sleep(60)
"""
    writer = subprocess.Popen([sys.executable, "-c", text], stdout=subprocess.PIPE)
    assert writer.stdout.readline() == b"written\n"
    found = sorted(path.name for path in folder.iterdir())
    writer.kill()
    # not waited for yet: it is a zombie, which writes no more
    return writer, found


FILE, FOLDER = ("written_whole", "part.write_text('half')"), ("folder_written_whole", "(part / 'a').write_text('half')")


@pytest.mark.parametrize("code", [FILE, FOLDER])
def test_what_a_killed_writer_left_is_gone_after_the_next_in_that_folder(tmp_path, code):
    writer, found = killed(tmp_path, "a.bag", code)
    time.sleep(0.1)
    assert len(found) == 1 and found[0].startswith(".a.") and ".part" in found[0]
    with written_whole(tmp_path / "b.bag") as part:
        assert part.suffix == ".bag" and not part.exists()
        assert list(tmp_path.iterdir()) == []
        part.write_text("whole")
    writer.wait()
    assert [path.name for path in tmp_path.iterdir()] == ["b.bag"]


def test_what_a_living_writer_writes_is_left_alone_and_so_is_what_names_none(tmp_path):
    (tmp_path / ".release-who.part.tar").touch()
    with written_whole(tmp_path / "a.txt") as first:
        first.write_text("half")
        text = f"from dior.tables.files import write_text; write_text({str(tmp_path / 'a.txt')!r}, 'other')"
        subprocess.run([sys.executable, "-c", text], check=True)
        assert first.read_text() == "half" and (tmp_path / "a.txt").read_text() == "other"
    assert (tmp_path / "a.txt").read_text() == "half"
    assert sorted(path.name for path in tmp_path.iterdir()) == [".release-who.part.tar", "a.txt"]


@pytest.mark.parametrize("name", ["a" * 247 + ".parquet", "\u00e4" * 124 + ".csv"])
def test_a_name_may_be_as_long_as_the_disk_lets_it(tmp_path, name):
    write_text(tmp_path / name, "whole")
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_who_is_dead(tmp_path, monkeypatch):
    """A process that has the number of another, or another start of the computer; one elsewhere after a day."""
    own = files._beside(tmp_path / "a", "a", "part")
    computer, boot, pid, started, _ = own.name.split(".")[2].split("-")

    def dead(*writer, age_s=0.0):
        path = tmp_path / f".a.{'-'.join(map(str, writer))}-1.part"
        path.touch()
        os.utime(path, (time.time() - age_s,) * 2)
        return files._is_dead(files._LEFT.fullmatch(path.name), path)

    assert not dead(computer, boot, pid, started) and not dead(computer, boot, pid, started, age_s=1e6)
    assert dead(computer, boot, pid, int(started) + 1) and dead(computer, "000000", pid, started)
    assert not dead("000000", boot, pid, started, age_s=3600) and dead("000000", boot, pid, started, age_s=1e5)


def test_two_that_write_one_file_at_once_leave_one_of_them_whole(tmp_path):
    """Each run writes 80 times; a reader in between never finds half of one, and nothing else is left."""
    text = """
import sys
from dior.tables.files import folder_written_whole, write_text
for i in range(80):
    write_text(sys.argv[1] + "/a.txt", sys.argv[2] * 20000)
    with folder_written_whole(sys.argv[1] + "/b") as part:
        for name in "xyz":
            (part / name).write_text(sys.argv[2])
"""
    runs = [subprocess.Popen([sys.executable, "-c", text, str(tmp_path), letter]) for letter in "AB"]
    seen = set()
    while any(run.poll() is None for run in runs):
        try:
            seen.add((tmp_path / "a.txt").read_text())
        except FileNotFoundError:
            continue
    assert [run.returncode for run in runs] == [0, 0]
    assert seen <= {"A" * 20000, "B" * 20000}
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.txt", "b"]
    assert len({(tmp_path / "b" / name).read_text() for name in "xyz"}) == 1


def test_a_folder_is_there_whole_or_as_it_was(tmp_path):
    with folder_written_whole(tmp_path / "a") as folder:
        write_text(folder / "old.txt", "eins")
    with pytest.raises(RuntimeError), folder_written_whole(tmp_path / "a") as folder:
        write_text(folder / "new.txt", "zwei")
        raise RuntimeError
    assert [path.name for path in tmp_path.rglob("*")] == ["a", "old.txt"]
    with folder_written_whole(tmp_path / "a") as folder:
        write_text(folder / "new.txt", "zwei")
    assert [path.name for path in tmp_path.rglob("*")] == ["a", "new.txt"]


def test_a_folder_in_the_place_of_a_file_and_one_without_a_name(tmp_path):
    for path in (tmp_path, "."):
        with pytest.raises(DiorError, match="is a folder; give the name of the file"), files.written_whole(path):
            pass
    with pytest.raises(DiorError, match="give the name of a folder in it"), files.folder_written_whole("."):
        pass
    assert list(tmp_path.iterdir()) == []
