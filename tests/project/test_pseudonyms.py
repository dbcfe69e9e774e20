"""Pseudonyms that the tool makes up."""

import re

import pytest

from dior.cli import main
from dior.errors import DiorError
from dior.project.pseudonyms import with_pseudonyms

SHEET = "subject\tpseudonym\theight_m\nAnna\t\t1.70\r\nBert\tp12345678\t\n\nCleo\nDora\t  \t1.6"


def test_empty_cells_are_filled_and_all_else_stays():
    text, count = with_pseudonyms(SHEET)
    made = re.findall(r"p[0-9a-f]{10}", text)
    assert count == len(made) == len(set(made)) == 3
    assert text == (
        f"subject\tpseudonym\theight_m\nAnna\t{made[0]}\t1.70\r\nBert\tp12345678\t\n\nCleo\t{made[1]}\nDora\t{made[2]}\t1.6"
    )
    assert with_pseudonyms(text) == (text, 0)
    assert with_pseudonyms(SHEET)[0] != text, "nobody can make them again"


def test_lines_for_people_are_left_as_they_are():
    sheet = f"# who they are\n{SHEET}\n# Emil\t\tcomes in May\n"
    text, count = with_pseudonyms(sheet)
    assert count == 3 and text.startswith("# who they are\nsubject\t") and text.endswith("\n# Emil\t\tcomes in May\n")


def test_a_sheet_without_the_column_is_told():
    with pytest.raises(DiorError, match="column 'pseudonym' is missing"):
        with_pseudonyms("subject\nAnna\n")


def test_the_command_fills_the_sheet_and_names_nobody(tmp_path, capsys):
    path = tmp_path / "config/subjects.tsv"
    assert main.main(["pseudonyms", str(tmp_path)]) == 1
    assert "config/subjects.tsv: there is no such file" in capsys.readouterr().err
    path.parent.mkdir()
    path.write_text(SHEET)
    assert main.main(["pseudonyms", str(tmp_path)]) == 0
    assert capsys.readouterr().out == "config/subjects.tsv: 3 made\n"
    before = path.read_bytes()
    assert main.main(["pseudonyms", str(tmp_path)]) == 0
    assert capsys.readouterr().out == "config/subjects.tsv: everybody has one\n" and path.read_bytes() == before
