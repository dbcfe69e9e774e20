import pytest

from dior.tables.files import folder_written_whole, write_text, written_whole


def test_a_file_is_there_whole_or_not_at_all(tmp_path):
    write_text(tmp_path / "a" / "b.txt", "eins\n")
    with pytest.raises(RuntimeError), written_whole(tmp_path / "a" / "b.txt") as part:
        part.write_text("zwei")
        raise RuntimeError
    assert (tmp_path / "a/b.txt").read_text() == "eins\n"
    assert [path.name for path in (tmp_path / "a").iterdir()] == ["b.txt"]


def test_what_a_killed_writer_left_is_gone_after_the_next(tmp_path):
    (tmp_path / ".b.part.bag").write_text("half")
    with written_whole(tmp_path / "b.bag") as part:
        assert part.suffix == ".bag" and not part.exists()
        part.write_text("whole")
    assert [path.name for path in tmp_path.iterdir()] == ["b.bag"]


def test_a_folder_is_there_whole_or_as_it_was(tmp_path):
    with folder_written_whole(tmp_path / "a") as folder:
        write_text(folder / "old.txt", "eins")
    with pytest.raises(RuntimeError), folder_written_whole(tmp_path / "a") as folder:
        write_text(folder / "new.txt", "zwei")
        raise RuntimeError
    assert [path.name for path in tmp_path.rglob("*")] == ["a", "old.txt"]
    (tmp_path / ".a.part").mkdir()
    write_text(tmp_path / ".a.part" / "killed.txt", "half")
    with folder_written_whole(tmp_path / "a") as folder:
        write_text(folder / "new.txt", "zwei")
    assert [path.name for path in tmp_path.rglob("*")] == ["a", "new.txt"]
