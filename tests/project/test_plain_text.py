"""Files of people and other programs, whatever is in them: the rows, or one sentence with the line and what to do."""

import gzip
import os
import tracemalloc

import pytest

from dior.errors import DiorError, one_line
from dior.project.plain_text import bytes_of, rows_of, text_of


def refused(path, content, delimiter=","):
    path.write_bytes(content)
    with pytest.raises(DiorError) as caught:
        rows_of(path, "boxes.csv", delimiter)
    return str(caught.value)


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        ("a,b\n1,ü\n".encode("latin-1"), "boxes.csv line 2: the byte 0xfc is not UTF-8, so the file is Latin-1 or "),
        ("a,b\n".encode("utf-16"), "boxes.csv: is UTF-16, as Excel's 'Unicode text' is; save it again as UTF-8"),
        ("a,b\n".encode("utf-16-be"), "boxes.csv line 1: holds a zero byte"),
        (b"a,b\n1,2\n3,\x004\n", "boxes.csv line 3: holds a zero byte"),
        (b"a,b\n1,2\n" + b"x" * 140_000 + b",2\n", "boxes.csv line 3: no row of a table (field larger than"),
        (b'a,b\n1,"2\n3,4\n5,6\n', 'boxes.csv line 2: a cell opens a quote (") and goes on up to line 4; delete'),
        (b'a,b\n1,"2\n3,4\n5",6\n', 'boxes.csv line 2: a cell opens a quote (") and goes on up to line 4; delete'),
        (b'a,b\n1,2\n"3,4', 'boxes.csv line 3: a cell opens a quote (") and goes on with commas; delete the quote'),
        (b"a,b\n" + b"," * 1000, "boxes.csv line 2: has 1001 cells, which no table has; is it another file?"),
        (b"a;b\n1;2\n", "boxes.csv: the columns must be separated by commas, not by semicolons"),
        (b"a\tb\n1\t2\n", "boxes.csv: the columns must be separated by commas, not by tabs"),
    ],
)
def test_a_table_that_is_none_is_one_sentence_with_the_line(tmp_path, content, sentence):
    assert refused(tmp_path / "boxes.csv", content).startswith(sentence)


def test_who_saves_a_sheet_again_is_told_to_keep_the_tabs(tmp_path):
    for content in ("a\tb\n1\tü\n".encode("latin-1"), "a\tb\n".encode("utf-16")):
        (tmp_path / "sheet.tsv").write_bytes(content)
        with pytest.raises(DiorError, match="save it again as UTF-8 with tabs between the columns"):
            rows_of(tmp_path / "sheet.tsv", "config/sheet.tsv", "\t")


def test_a_quote_swallows_no_cells_of_a_sheet(tmp_path):
    text = refused(tmp_path / "sheet.tsv", b'a\tb\tc\n1\t"coat\t3\n4\t5\t6\n', "\t")
    assert text.startswith('boxes.csv line 2: a cell opens a quote (") and goes on up to line 3')
    assert "with tabs" in refused(tmp_path / "sheet.tsv", b'a\tb\tc\n1\t"coat\t3"\n', "\t")


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_the_rows_and_their_lines(tmp_path, end):
    path = tmp_path / "x.csv"
    path.write_bytes('\ufeffa, b \n\n1,"2"\n,\n3,60 m "far"\n'.replace("\n", end).encode())
    assert rows_of(path, path) == [(1, ["a", "b"]), (3, ["1", "2"]), (5, ["3", '60 m "far"'])]


def test_letters_that_part_lines_elsewhere_part_none_here(tmp_path):
    path = tmp_path / "x.csv"
    path.write_text("a,b\n1,x\u2028y\x0b\n", encoding="utf-8")
    assert rows_of(path, path)[1] == (2, ["1", "x\u2028y"])


def test_what_is_no_file_is_said(tmp_path):
    path = tmp_path / "x.csv"
    for make, sentence in (
        (lambda: None, "x.csv: there is no such file"),
        (path.mkdir, "x.csv: is a folder where a file should be"),
        (lambda: os.rmdir(path) or os.mkfifo(path), "x.csv: is no plain file"),
    ):
        make()
        with pytest.raises(DiorError, match=sentence):
            text_of(path, "x.csv")
    with pytest.raises(DiorError, match=r"x.csv: there is no such file"):
        text_of(path / "below", "x.csv")


def test_what_is_too_large_is_not_read(tmp_path):
    path = tmp_path / "x.csv"
    with open(path, "wb") as stream:
        stream.truncate(1 << 40)
    with pytest.raises(DiorError, match=r"x.csv: has 1099512 MB, and at most 4 MB are read"):
        bytes_of(path, "x.csv")


def test_the_largest_table_costs_little_memory(tmp_path):
    path = tmp_path / "x.csv"
    path.write_bytes(b"a,b\n" + b"1\n" * 20_000)
    tracemalloc.start()
    assert len(rows_of(path, path)) == 20_001
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    # the largest that is read is a hundred times as large
    assert 100 * peak < 800e6


def test_an_error_is_one_line_that_can_be_printed():
    assert str(DiorError("a.parquet: no table (bad\nmagic\r\n  bytes); run again")) == (
        "a.parquet: no table (bad magic bytes); run again"
    )
    assert str(DiorError("\x1b[2Jx\0\udce9 é 歩")) == "\\x1b[2Jx\\x00\\udce9 é 歩"
    long = str(DiorError("begin " + "x" * 10_000 + "; the fix"))
    assert len(long) < 1600 and long.startswith("begin") and long.endswith("the fix")
    assert one_line("a  b\u2028c") == "a  b c"


def test_what_is_packed_is_to_be_unpacked(tmp_path):
    """Whether a table, detections or a bag."""
    from dior.ingest import bags
    from dior.ingest.readers import recognise

    path = tmp_path / "a.json.gz"
    path.write_bytes(gzip.compress(b"[]" * 40))
    for read in (lambda: text_of(path, path), lambda: bags.topics_of(path), lambda: recognise.recognise(path)):
        with pytest.raises(DiorError, match=r"a\.json\.gz: is compressed with gzip; unpack it: `gunzip -k`"):
            read()
