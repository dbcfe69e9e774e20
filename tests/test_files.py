import pytest

from dior.files import write_text, written_whole


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
