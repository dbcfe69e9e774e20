"""Every table that people make, as other programs save it: Latin-1, UTF-16, a zero byte, a quote that is not closed."""

import pytest

from dior.calibrate.marks import marks
from dior.errors import DiorError
from dior.evaluate import checks
from dior.ingest.readers import mlkit_csv
from dior.project import boxes
from dior.project.marks_file import read_marks
from dior.project.schema_check import columns_of, read_sheet

SHEETS = ("sequences", "subjects", "gallery", "detectors", "effort", "markers")
# reader: (its header, a row of it, how the columns are separated)
TABLES = {
    "boxes": (boxes.COLUMNS, "3,10,20,30,40", lambda path: boxes.read(path, range(9))),
    "marks": (marks.COLUMNS, "walk,3,LASI,10,20", marks.read),
    "marks when planned": (marks.COLUMNS, "walk,3,LASI,10,20", lambda path: read_marks(path, str(path))),
    "checks": (checks.REQUIRED, "walk,3,LASI,10,20", lambda path: checks.points(path, "walk", range(9), ["LASI"])),
    **{
        kind: (
            columns_of(kind),
            "\t".join("x" for _ in columns_of(kind)),
            lambda path, k=kind: read_sheet(path, k, "x"),
        )
        for kind in SHEETS
    },
}
DAMAGES = {
    "Latin-1": (lambda text: f"{text[:-1]}ü\n".encode("latin-1"), "line 2: the byte 0xfc"),
    "UTF-16": (lambda text: text.encode("utf-16"), "is UTF-16"),
    "a zero byte": (lambda text: text.encode() + b"\0", "line 3: holds a zero byte"),
    "a cell without an end": (lambda text: text.encode() + b"x" * 200_000, "line 3: no row of a table"),
    "an open quote": (lambda text: text.replace("\n", '\n"', 1).encode() + b"a\nb\n", "line 2: a cell opens a quote"),
    "a quote that ends": (lambda text: text.replace("\n", '\n"', 1).encode() + b'a"\n', "line 2: a cell opens a quote"),
}


@pytest.mark.parametrize("damage", DAMAGES)
@pytest.mark.parametrize("name", TABLES)
def test_how_another_program_saved_it_is_said_with_the_line(tmp_path, name, damage):
    header, row, read = TABLES[name]
    change, sentence = DAMAGES[damage]
    path = tmp_path / "table.csv"
    path.write_bytes(change(("\t" if name in SHEETS else ",").join(header) + f"\n{row}\n"))
    with pytest.raises(DiorError) as caught:
        read(path)
    assert str(caught.value).startswith((f"{path} {sentence}", f"{path}: {sentence}"))


def test_samples_of_another_program_in_latin_1(tmp_path):
    (tmp_path / "a.csv").write_bytes(b"caf\xe9.jpg,x" + b",1" * 99 + b"\n")
    with pytest.raises(DiorError, match=r"a.csv line 1: the byte 0xe9 is not UTF-8"):
        mlkit_csv.read(tmp_path / "a.csv")


def test_a_name_that_no_file_has(tmp_path):
    (tmp_path / "a.csv").write_text("0" * 100_000 + "x.jpg,x" + ",1" * 99 + "\n")
    with pytest.raises(DiorError, match=r"a.csv: the picture '0{40}...' has a name of 100005 letters"):
        mlkit_csv.read(tmp_path / "a.csv")


@pytest.mark.parametrize(
    ("name", "row", "sentence"),
    [
        ("boxes", "3,10,20,30,4e12", "table.csv, line 2: an edge of the box at 10,20,30,4e12 is in no picture"),
        ("boxes", "3,10,20,nan,40", "line 2: an edge of the box"),
        ("boxes", f"{'9' * 5000},10,20,30,40", "line 2: '9999"),
        ("boxes", f"{'9' * 30},10,20,30,40", "is not in the recording"),
        ("marks", f"walk,{'9' * 5000},LASI,10,20", "line 2: frame is '9999"),
        ("marks", f"walk,{'9' * 20},LASI,10,20", "line 2: frame is '9999"),
        ("marks", "walk,3,LASI,10,1e9", "line 2: v is 1e+09, which no mark is; is a decimal point lost?"),
        ("checks", "walk,3,LASI,10,inf", "line 2: the point at (10, inf) is in no picture"),
        ("checks", "walk,3,LASI,10,nan", "line 2: the point at (10, nan) is in no picture"),
        ("checks", "walk,3,LASI,1,2\nwalk,3,LASI,1,3", "line 3: LASI of frame 3 is there already; keep one"),
    ],
)
def test_numbers_that_are_in_no_picture(tmp_path, name, row, sentence):
    header, _, read = TABLES[name]
    path = tmp_path / "table.csv"
    path.write_text(f"{','.join(header)}\n{row}\n")
    with pytest.raises(DiorError) as caught:
        read(path)
    assert sentence in str(caught.value) and len(str(caught.value)) < 500
