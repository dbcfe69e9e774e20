"""What is still to be filled in is named at once, and nothing else is said before it is."""

import pytest

from dior.errors import DiorError
from dior.project import project, todos
from dior.project.todos import Todo
from tests.project.test_project import edit, root  # noqa: F401


@pytest.fixture
def asking(root):  # noqa: F811
    """The project with seven values that are not filled in, and five words that are no such values."""
    edit(root, "subjects.tsv", "1.72\t0.01\tyes", "TODO\tTODO\tyes")
    edit(root, "subjects.tsv", "apple-0002\t", "apple-0002\tTODO")
    edit(root, "sequences.tsv", "sequence\t", "# TODO: who is who?\nsequence\t")
    edit(root, "sequences.tsv", "9\tS01", "9\tTODO: S01 or S02")
    edit(root, "sequences.tsv", "11\tS01", "11\tTODO")
    edit(root, "sessions/field/cam01.yaml", "tape: {", "# TODO: by tape\ntape: {target_m: [TODO, TODO, TODO], ")
    edit(root, "sessions/field/cam02.yaml", "role: close", "role: TODO")
    edit(root, "config.yaml", "A test", "Not TODO")
    return root


def test_every_one_is_found_by_file_line_and_key(asking):
    folder = "config/sessions/field/"
    assert todos.found(asking) == [
        Todo("config/sequences.tsv", 4, "subject"), Todo("config/subjects.tsv", 2, "height_m"),
        Todo("config/subjects.tsv", 2, "height_sigma_m"), Todo("config/subjects.tsv", 3, "height_m"),
        Todo(f"{folder}cam01.yaml", 5, "tape.target_m"), Todo(f"{folder}cam02.yaml", 1, "role"),
    ]  # fmt: skip


def test_a_project_with_any_is_not_read_and_all_are_told(asking):
    edit(asking, "sessions/field/session.yaml", "cameras", "kameras")
    with pytest.raises(DiorError) as told:
        project.load(asking)
    assert str(told.value).splitlines() == [
        "config/sequences.tsv: still TODO: subject (line 4)",
        "config/subjects.tsv: still TODO: height_m (lines 2 and 3), height_sigma_m (line 2)",
        "config/sessions/field/cam01.yaml: still TODO: tape.target_m (line 5)",
        "config/sessions/field/cam02.yaml: still TODO: role (line 1)",
    ]


def test_a_reason_that_is_to_do_leaves_no_walk_out(root):  # noqa: F811
    edit(root, "sequences.tsv", "11\tS01", "11\tTODO")
    edit(root, "sequences.tsv", "\train", "\tTODO: why?")
    assert todos.found(root) == [Todo("config/sequences.tsv", 5, "exclude_reason")]


def test_what_is_broken_is_left_to_who_reads_it(root):  # noqa: F811
    (root / "config/config.yaml").write_text("TODO: [\n")
    (root / "config/gallery.tsv").write_text("# TODO\n")
    assert todos.found(root) == []
    with pytest.raises(DiorError, match=r"config/config.yaml.*not valid YAML"):
        project.load(root)


def test_lines_for_people_may_be_anywhere_in_a_sheet(root):  # noqa: F811
    before = project.load(root)
    edit(root, "subjects.tsv", "subject\t", '# height_m: "in metres", such as 1.72; or nothing\n\nsubject\t')
    edit(root, "subjects.tsv", "S02", "  # the next one\tcame late\nS02")
    assert project.load(root) == before
    edit(root, "subjects.tsv", "zebra-0001", "z")
    with pytest.raises(DiorError, match=r"config/subjects.tsv line 4: 'pseudonym' is 'z'"):
        project.load(root)
