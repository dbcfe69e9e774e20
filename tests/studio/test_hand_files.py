"""Changing the files that people edit: nothing else of them changes, and nobody's work is lost."""

import pytest

from dior.errors import DiorError
from dior.studio import hand_files
from dior.studio.hand_files import Change, Conflict, change_rows, change_value, change_values, fill_in

KEYS, OTHERS = ("sequence", "frame", "joint"), ("u", "v")
TEXT = """# by Ann, on Monday
sequence,frame,joint,u,v,x,y,z

in_1,3,LASI,10.5,20,,,
# this one is blurred
in_1,3,"RASI",12,30,1,2,3
"""


def fine(path):
    path.read_text()


@pytest.fixture
def path(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.csv").write_text(TEXT)
    return "a.csv"


def read(path):
    with open(path, newline="") as stream:
        return stream.read()


def changed(path, *changes, check=fine):
    return change_rows(path, KEYS, OTHERS, [Change(*one) for one in changes], check)


def test_a_row_changes_and_all_else_stays(path):
    assert changed(path, (("in_1", "3", "LASI"), ("10.5", "20"), ("11.25", "21")))
    assert read(path) == TEXT.replace("10.5,20", "11.25,21")
    assert changed(path, (("in_1", "3", "LASI"), ("11.25", "21"), ("10.5", "20")))
    assert read(path) == TEXT


def test_columns_that_a_change_is_not_about_stay(path):
    changed(path, (("in_1", "3", "RASI"), ("12", "30"), ("13", "30")))
    assert "in_1,3,RASI,13,30,1,2,3\n" in read(path)


def test_rows_are_added_at_the_end_and_taken_away(path):
    changed(path, (("in_1", "9", "LKNE"), None, ("1", "2")))
    assert read(path) == TEXT + "in_1,9,LKNE,1,2,,,\n"
    changed(path, (("in_1", "9", "LKNE"), ("1", "2"), None))
    assert read(path) == TEXT


def test_a_file_is_begun(path):
    changed("sessions/new.csv", (("in_1", "9", "LKNE"), None, ("1", "2")))
    assert read("sessions/new.csv") == "sequence,frame,joint,u,v\nin_1,9,LKNE,1,2\n"


def test_windows_line_ends_and_a_last_line_without_one_stay(path):
    with open(path, "w", newline="") as stream:
        stream.write("sequence,frame,joint,u,v\r\nin_1,3,LASI,1,2\r\n")
    changed(path, (("in_1", "9", "LKNE"), None, ("1", "2")))
    assert read(path) == "sequence,frame,joint,u,v\r\nin_1,3,LASI,1,2\r\nin_1,9,LKNE,1,2\r\n"
    with open(path, "w", newline="") as stream:
        stream.write("sequence,frame,joint,u,v\nin_1,3,LASI,1,2")
    changed(path, (("in_1", "9", "LKNE"), None, ("1", "2")))
    assert read(path) == "sequence,frame,joint,u,v\nin_1,3,LASI,1,2\nin_1,9,LKNE,1,2\n"


def test_what_says_the_same_is_not_written(path, tmp_path):
    before = (tmp_path / path).stat().st_ino
    assert not changed(path, (("in_1", "3", "LASI"), ("10.5", "20"), ("10.50", "20.0")))
    assert (tmp_path / path).stat().st_ino == before


@pytest.mark.parametrize(
    ("before", "after"), [(("9", "9"), ("1", "1")), (None, ("1", "1")), (("9", "9"), None)]
)  # fmt: skip
def test_what_somebody_else_wrote_is_told_and_not_lost(path, before, after):
    mine = (("in_1", "3", "RASI"), ("12", "30"), ("13", "13"))
    with pytest.raises(Conflict) as raised:
        changed(path, mine, (("in_1", "3", "LASI"), before, after))
    assert raised.value.rows == [{"key": ("in_1", "3", "LASI"), "theirs": ("10.5", "20"), "mine": after}]
    assert read(path) == TEXT


def test_the_same_change_twice_is_no_conflict(path):
    for _ in range(2):
        changed(path, (("in_1", "3", "LASI"), ("10.5", "20"), ("1", "2")))
    assert "in_1,3,LASI,1,2" in read(path)


def test_other_rows_of_others_are_kept(path):
    with open(path, "a") as stream:
        stream.write("in_1,9,CLAV,5,6,,,\n")
    changed(path, (("in_1", "3", "LASI"), ("10.5", "20"), ("1", "2")))
    assert "in_1,9,CLAV,5,6" in read(path) and "in_1,3,LASI,1,2" in read(path)


def test_what_the_projects_reader_refuses_is_not_written(path):
    def refuses(draft):
        raise DiorError(f"{draft} line 4: u is 'x', not a number")

    with pytest.raises(DiorError, match=r"^a\.csv line 4"):
        changed(path, (("in_1", "3", "LASI"), ("10.5", "20"), ("x", "2")), check=refuses)
    assert read(path) == TEXT


def test_a_file_that_is_read_only_is_named(path, tmp_path):
    (tmp_path / path).chmod(0o444)
    with pytest.raises(DiorError, match="a.csv: is read-only"):
        changed(path, (("in_1", "3", "LASI"), ("10.5", "20"), ("1", "2")))
    assert read(path) == TEXT


def test_a_link_stays_a_link(path, tmp_path):
    (tmp_path / "link.csv").symlink_to(tmp_path / path)
    changed("link.csv", (("in_1", "3", "LASI"), ("10.5", "20"), ("1", "2")))
    assert (tmp_path / "link.csv").is_symlink() and "in_1,3,LASI,1,2" in read(path)


def test_a_column_that_is_not_there_is_named(path):
    with open(path, "w") as stream:
        stream.write("sequence,frame,joint,u\n")
    with pytest.raises(DiorError, match="column 'v' is missing"):
        changed(path, (("in_1", "3", "LASI"), None, ("1", "2")))


YAML = """role: long_range
# measured twice
tape: {position_m: [0, 60, 2], sigma_m: 0.3}  # by Ben
nudge:
  azimuth_deg: 0.5
  # by eye
  elevation_deg: 0
# the end
"""


@pytest.fixture
def yaml(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "cam.yaml").write_text(YAML)
    return "cam.yaml"


def test_a_value_changes_and_all_else_stays(yaml):
    before, after = {"azimuth_deg": 0.5, "elevation_deg": 0}, {"azimuth_deg": -0.25, "elevation_deg": 0.1}
    assert change_value(yaml, "nudge", before, after, fine)
    head = YAML.partition("nudge:")[0]
    assert read(yaml) == YAML.replace("azimuth_deg: 0.5", "azimuth_deg: -0.25").replace("n_deg: 0\n", "n_deg: 0.1\n")
    assert change_value(yaml, "nudge", after, None, fine)
    assert read(yaml) == head + "# the end\n"
    assert change_value(yaml, "nudge", None, after, fine)
    assert read(yaml) == head + "# the end\nnudge: {azimuth_deg: -0.25, elevation_deg: 0.1}\n"


def test_a_value_in_one_line_keeps_its_comment(yaml):
    change_value(yaml, "tape", {"position_m": [0, 60, 2], "sigma_m": 0.3}, {"position_m": [0, 61, 2]}, fine)
    assert "tape: {position_m: [0, 61, 2]}  # by Ben\n" in read(yaml)


def test_a_yaml_file_is_begun(yaml):
    change_value("offsets/in_1.yaml", "cam01", None, {"offset_s": 0.012}, fine)
    assert read("offsets/in_1.yaml") == "cam01: {offset_s: 0.012}\n"


def test_a_value_that_somebody_else_changed_is_told(yaml):
    with pytest.raises(Conflict) as raised:
        change_value(yaml, "nudge", None, {"azimuth_deg": 1}, fine)
    assert raised.value.rows[0]["theirs"] == {"azimuth_deg": 0.5, "elevation_deg": 0}
    assert read(yaml) == YAML


def test_plain_words_and_numbers(yaml):
    change_value(yaml, "role", "long_range", "close", fine)
    assert read(yaml).startswith("role: close\n# measured twice\n")
    change_value(yaml, "number", None, 3, fine)
    assert read(yaml).endswith("number: 3\n")


SHEET = "# height_m: a height\nsubject\theight_m\tconsent\nS01\tTODO\tTODO\nS02\tTODO\tyes\n"
LENSES = "# which?\nlenses: {a: TODO, b: TODO}\ntape:\n  # where it is\n  position_m: TODO  # m\n"


@pytest.mark.parametrize(
    ("name", "text", "line", "key", "value", "after"),
    [
        ("a.tsv", SHEET, 3, "height_m", "1.72", SHEET.replace("S01\tTODO", "S01\t1.72")),
        ("a.tsv", SHEET, 3, "consent", "no", SHEET.replace("TODO\tTODO", "TODO\tno")),
        ("a.tsv", SHEET, 4, "height_m", "1.8", SHEET.replace("S02\tTODO", "S02\t1.8")),
        ("a.yaml", LENSES, 2, "lenses.b", "plumb_bob", LENSES.replace("b: TODO", "b: plumb_bob")),
        ("a.yaml", LENSES, 5, "tape.position_m", "[4, 2.5, 1]", LENSES.replace("m: TODO", "m: [4, 2.5, 1]")),
    ],
)
def test_a_value_is_filled_in_where_it_is_to_do(path, tmp_path, name, text, line, key, value, after):
    (tmp_path / name).write_text(text)
    fill_in(name, line, key, value)
    assert read(name) == after
    with pytest.raises(Conflict):
        fill_in(name, line, key, "another")
    assert read(name) == after


def test_a_cell_may_be_left_empty(path, tmp_path):
    (tmp_path / "a.tsv").write_text(SHEET)
    fill_in("a.tsv", 3, "height_m", " ")
    assert read("a.tsv") == SHEET.replace("S01\tTODO", "S01\t")


@pytest.mark.parametrize("value", ["", " ", "a\tb", "a\nb", "[1, 2"])
def test_what_breaks_the_file_is_not_filled_in(path, tmp_path, value):
    (tmp_path / "a.yaml").write_text(LENSES)
    with pytest.raises(DiorError):
        fill_in("a.yaml", 5, "tape.position_m", value)
    assert read("a.yaml") == LENSES


IN_LINES = """role: long_range
tape:
  position_m: [0.000, 60.10, 1.9]  # by laser
  # as we measured it twice
  roll_deg: 2  # by eye
  sigma_m: 0.3 # a tape
# the end
locate: align
"""
IN_ONE = "tape: {position_m: [0.000, 60.10, 1.9], sigma_m: 0.3}  # by Ann\nlocate: align\n"
TAPE = {"position_m": [0.0, 60.1, 1.9], "sigma_m": 0.3}


@pytest.mark.parametrize(
    ("text", "before", "after", "becomes"),
    [
        (IN_ONE, TAPE, TAPE | {"roll_deg": 1.5}, IN_ONE.replace("0.3}", "0.3, roll_deg: 1.5}")),
        (IN_ONE, TAPE, TAPE | {"sigma_m": 0.2}, IN_ONE.replace("0.3}", "0.2}")),
        (IN_LINES, TAPE | {"roll_deg": 2}, TAPE | {"roll_deg": -2.5}, IN_LINES.replace("deg: 2 ", "deg: -2.5 ")),
        (
            IN_LINES.replace("  roll_deg: 2  # by eye\n", ""), TAPE, TAPE | {"roll_deg": 1.0},
            IN_LINES.replace("  roll_deg: 2  # by eye\n", "").replace("a tape\n", "a tape\n  roll_deg: 1.0\n"),
        ),
        ("tape: {a: 1}", {"a": 1}, {"a": 1, "b": 2.0}, "tape: {a: 1, b: 2.0}"),
        ("tape:\n  a: 1", {"a": 1}, {"a": 1, "b": 2.0}, "tape:\n  a: 1\n  b: 2.0"),
        ("a: 1\n", None, {"z": 1.0, "a": 2}, "a: 1\ntape: {z: 1.0, a: 2}\n"),
        ("tape: {}\n", {}, {"z": 1.0}, "tape: {z: 1.0}\n"),
        ("tape: {a: 1, b: 2} # c\n", {"a": 1, "b": 2}, {"a": 1}, "tape: {a: 1} # c\n"),
    ],
)  # fmt: skip
def test_entries_change_where_they_stand(tmp_path, monkeypatch, text, before, after, becomes):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "cam04.yaml").write_text(text)
    assert change_value("cam04.yaml", "tape", before, after, lambda path: path.read_text())
    assert (tmp_path / "cam04.yaml").read_text() == becomes


def test_a_column_is_added_to_the_rows_that_are_there_and_not_to_comments(path):
    change = Change(("in_1", "3", "LASI"), ("10.5", "20"), ("11", "20"))
    assert change_rows(path, KEYS, OTHERS, [change], fine, ("joint", "seen", "by"))
    assert read(path) == (
        "# by Ann, on Monday\nsequence,frame,joint,u,v,x,y,z,seen,by\n\nin_1,3,LASI,11,20,,,,,\n# this one is blurred\n"
        'in_1,3,"RASI",12,30,1,2,3,,\n'
    )


def test_a_file_is_begun_with_the_columns_that_are_named(path):
    columns = ("frame", "u", "v", "drawer")
    change_rows(
        "boxes/new.csv", ("frame", "drawer"), ("u", "v"), [Change(("7", "ann"), None, ("1", "2"))], fine, columns
    )
    assert read("boxes/new.csv") == "frame,u,v,drawer\n7,1,2,ann\n"


def test_where_the_last_row_goes_and_one_comes_no_line_is_empty(path):
    changed(path, (("in_1", "3", "RASI"), ("12", "30"), None), (("in_1", "9", "LKNE"), None, ("1", "2")))
    assert read(path).endswith("# this one is blurred\nin_1,9,LKNE,1,2,,,\n")


def test_a_yaml_file_of_which_nothing_is_left_is_removed(path, tmp_path):
    change_value("who.yaml", "seeds", None, [1], fine)
    assert change_value("who.yaml", "seeds", [1], None, fine)
    assert not (tmp_path / "who.yaml").exists()
    (tmp_path / "who.yaml").write_text("# by Ann\nseeds: [1]\n")
    change_value("who.yaml", "seeds", [1], None, fine)
    assert read("who.yaml").startswith("# by Ann")


def test_who_may_change_a_file_stays(path, tmp_path):
    (tmp_path / path).chmod(0o664)
    changed(path, (("in_1", "3", "LASI"), ("10.5", "20"), ("1", "2")))
    assert (tmp_path / path).stat().st_mode & 0o777 == 0o664


def test_values_change_together_or_not_at_all(yaml):
    before = read(yaml)
    nudge, tape = {"azimuth_deg": 0.5, "elevation_deg": 0}, {"position_m": [0, 60, 2], "sigma_m": 0.3}
    turned = ("nudge", nudge, {"azimuth_deg": 1, "elevation_deg": 0})
    with pytest.raises(Conflict) as raised:
        change_values(yaml, [turned, ("tape", {}, {"roll_deg": 1})], fine)
    assert [one["key"] for one in raised.value.rows] == [["tape"]] and read(yaml) == before
    change_values(yaml, [turned, ("tape", tape, tape | {"roll_deg": 1})], fine)
    assert "azimuth_deg: 1\n" in read(yaml) and "roll_deg: 1" in read(yaml) and "# by Ben" in read(yaml)


def test_a_file_that_is_read_only_is_not_removed_either(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.yaml").write_text("cam01: 1\n")
    (tmp_path / "a.yaml").chmod(0o444)
    with pytest.raises(DiorError, match="a.yaml: is read-only"):
        change_value("a.yaml", "cam01", 1, None, fine)
    assert read("a.yaml") == "cam01: 1\n"


@pytest.mark.parametrize("value", ["a\rb", "a\x0bb", "a\x85b", "a\u2028b", "# none", '"'])
def test_a_value_that_would_break_the_sheet_is_refused(tmp_path, monkeypatch, value):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.tsv").write_text("subject\theight_m\nS01\tTODO\nS02\t1.7\n")
    with pytest.raises(DiorError, match=r"^a\.tsv"):
        fill_in("a.tsv", 2, "height_m", value)
    assert "TODO" in read("a.tsv")


ROW = (("in_1", "3", "LASI"), ("10.5", "20"), ("11.25", "21"))


@pytest.mark.parametrize(
    "before",
    [
        "\ufeffsequence,frame,joint,u,v\r\nin_1,3,LASI,10.5,20\r\n",
        "sequence,frame,joint,u,v\r\nin_1,3,LASI,10.5,20\r\n",
        "sequence,frame,joint,u,v\rin_1,3,LASI,10.5,20\r",
        "  # a comment\n,,,,\nsequence,frame,joint,u,v\nin_1,3,LASI,10.5,20\n",
        "sequence,frame,joint,u,v\nin_1,3,LASI,10.5,20\n# a page\x0cin_1,3,LASI,9,9\n# a line\u2028in_1,3,LASI,9,9\n",
    ],
)
def test_a_file_stays_as_its_editor_writes_it(path, before):
    with open(path, "w", newline="") as stream:
        stream.write(before)
    assert changed(path, ROW)
    assert read(path) == before.replace("10.5,20", "11.25,21")


def test_what_is_added_ends_as_the_lines_before(path):
    with open(path, "w", newline="") as stream:
        stream.write("sequence,frame,joint,u,v\r\nin_1,3,LASI,10.5,20")
    changed(path, ROW, (("in_1", "4", "LASI"), None, ("1", "2")))
    assert read(path) == "sequence,frame,joint,u,v\r\nin_1,3,LASI,11.25,21\r\nin_1,4,LASI,1,2\r\n"


def test_a_header_is_put_below_a_comment_that_does_not_end(path):
    with open(path, "w") as stream:
        stream.write("# by Ann")
    changed(path, (("in_1", "4", "LASI"), None, ("1", "2")))
    assert read(path) == "# by Ann\nsequence,frame,joint,u,v\nin_1,4,LASI,1,2\n"


@pytest.mark.parametrize(
    ("before", "change", "after"),
    [
        ("\ufeffa: 1\r\n", ("a", 1, 5), "\ufeffa: 5\r\n"),
        ("a: 1\r\nb: 2\r\n", ("c", None, {"x": 1}), "a: 1\r\nb: 2\r\nc: {x: 1}\r\n"),
        ("a: 1\r\nb: 2\r\n", ("a", 1, None), "b: 2\r\n"),
        (
            "a:\r\n  x: 1  # why\r\nb: 2\r\n",
            ("a", {"x": 1}, {"x": 1, "z": 3}),
            "a:\r\n  x: 1  # why\r\n  z: 3\r\nb: 2\r\n",
        ),
    ],
)
def test_a_yaml_file_stays_as_its_editor_writes_it(tmp_path, before, change, after):
    path = str(tmp_path / "a.yaml")
    with open(path, "w", newline="", encoding="utf-8") as stream:
        stream.write(before)
    assert change_values(path, [change], fine)
    assert read(path) == after


@pytest.mark.parametrize("text", ["a:\t1\n", "---\na: 1\n...\n", "{a: 1}\n"])
def test_yaml_that_cannot_be_changed_is_said_in_a_sentence(tmp_path, text):
    path = tmp_path / "a.yaml"
    path.write_text(text)
    with pytest.raises(DiorError, match="change it by hand"):
        change_values(str(path), [("b", None, 2)], fine)
    assert path.read_text() == text


def test_a_file_that_is_protected_is_named_and_not_the_temporary_one(tmp_path, monkeypatch):
    path = tmp_path / "a.yaml"
    path.write_text("a: 1\n")

    def refused(place, text):
        raise PermissionError(1, "Operation not permitted", f"{place.parent}/.a.yaml.tmp")

    monkeypatch.setattr(hand_files, "write_text", lambda place, text: refused(place, text) if place == path else None)
    monkeypatch.setattr(hand_files, "_check", lambda *given: None)
    with pytest.raises(DiorError, match="a.yaml: cannot be written .*read-only") as told:
        hand_files.change_value(str(path), "a", 1, 2, str)
    assert ".tmp" not in str(told.value) and path.read_text() == "a: 1\n"
