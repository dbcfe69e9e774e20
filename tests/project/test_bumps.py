"""A session that a bump splits: which files hold for which of its sequences."""

import pytest

from dior.errors import DiorError
from dior.project import project
from tests.project.test_project import CLOSE, edit, fails, root  # noqa: F401


@pytest.fixture
def bumped(root):  # noqa: F811
    """cam01 was bumped before out_2, the second of two walks."""
    edit(root, "sessions/field/session.yaml", "out_1: {count: 100}", "out_1: {count: 100}, out_2: {count: 50}")
    (root / "config/sessions/field/cam01@out_2.yaml").write_text(CLOSE.format(name="cam01", x=4.1))
    return root


def test_the_sequences_after_a_bump_are_a_session_of_their_own(bumped):
    found = project.load(bumped)
    assert found.sessions == ("field", "field@out_2", "lab")
    assert found.session_of("out_1") == "field" and found.session_of("out_2") == "field@out_2"
    assert found.camera_file("field", "cam01") == "config/sessions/field/cam01.yaml"
    assert found.camera_file("field@out_2", "cam01") == "config/sessions/field/cam01@out_2.yaml"
    assert found.camera_file("field@out_2", "cam02") == "config/sessions/field/cam02.yaml"
    assert found.cameras("field")["cam01"]["tape"]["position_m"][0] == 4
    assert found.cameras("field@out_2")["cam01"]["tape"]["position_m"][0] == 4.1
    assert list(found.window("field")) == ["out_1"] and list(found.window("field@out_2")) == ["out_2"]


def test_a_later_bump_of_another_camera_keeps_the_first(bumped):
    edit(bumped, "sequences.tsv", "rain", "")
    edit(bumped, "sessions/field/session.yaml", "out_2: {count: 50}", "out_2: {count: 50}, out_3: {count: 9}")
    edit(bumped, "sequences.tsv", "out_3/a.bag\t\t", "out_3/a.bag\t\tmlkit/{camera}.jsonl")
    (bumped / "config/sessions/field/cam02@out_3.yaml").write_text(CLOSE.format(name="cam02", x=-4.1))
    found = project.load(bumped)
    assert found.session_of("out_3") == "field@out_3"
    assert found.camera_file("field@out_3", "cam01") == "config/sessions/field/cam01@out_2.yaml"
    assert found.camera_file("field@out_3", "cam02") == "config/sessions/field/cam02@out_3.yaml"


def test_a_camera_that_was_bumped_twice_stands_where_the_last_bump_left_it(bumped):
    edit(bumped, "sequences.tsv", "rain", "")
    edit(bumped, "sessions/field/session.yaml", "out_2: {count: 50}", "out_2: {count: 50}, out_3: {count: 9}")
    edit(bumped, "sequences.tsv", "out_3/a.bag\t\t", "out_3/a.bag\t\tmlkit/{camera}.jsonl")
    (bumped / "config/sessions/field/cam01@out_3.yaml").write_text(CLOSE.format(name="cam01", x=4.2))
    found = project.load(bumped)
    parts = ("field", "field@out_2", "field@out_3")
    places = [found.cameras(session)["cam01"]["tape"]["position_m"][0] for session in parts]
    assert found.sessions == (*parts, "lab") and places == [4, 4.1, 4.2]


def test_marks_of_a_bumped_camera_are_its_own(root):  # noqa: F811
    edit(root, "sequences.tsv", "in_1\t1\tS01\tlab", "in_1\t1\tS01\tlab")
    text = (root / "config/sequences.tsv").read_text().splitlines()
    second = text[3].replace("in_1", "in_2").replace("\t1\t", "\t2\t", 1)
    (root / "config/sequences.tsv").write_text("\n".join([*text, second]) + "\n")
    folder = root / "config/sessions/lab"
    (folder / "cam01@in_2.yaml").write_text((folder / "cam01.yaml").read_text())
    fails(root, "cam01@in_2.yaml", "needs the file config/sessions/lab/cam01@in_2.marks.csv")
    (folder / "cam01@in_2.marks.csv").write_text("sequence,frame,joint,u,v\nin_2,3,LASI,10,20\n")
    found = project.load(root)
    assert found.marks_sequences("lab@in_2", "cam01") == ["in_2"] and found.marks_sequences("lab", "cam01") == ["in_1"]


def test_a_part_needs_instants_to_adjust_with(bumped):
    edit(bumped, "sessions/field/session.yaml", ", out_2: {count: 50}", "")
    fails(bumped, "session 'field@out_2'", "adjust: {out_2")


def test_a_name_of_no_sequence_is_still_refused_in_the_window(bumped):
    edit(bumped, "sessions/field/session.yaml", "out_2: {count: 50}", "out_9: {count: 50}")
    with pytest.raises(DiorError, match="'adjust.out_9' is no sequence of session"):
        project.load(bumped)


def test_a_long_range_camera_needs_walks_of_every_part(bumped):
    edit(bumped, "sessions/field/cam03.yaml", "nudge: {azimuth_deg: 0.2}", "align: {from: boxes, sequences: [out_1]}")
    fails(bumped, "align.sequences has out_1, none of session 'field@out_2'")
    edit(bumped, "sessions/field/cam03.yaml", "[out_1]", "[out_1, out_2]")
    (bumped / "config/boxes/out_2.cam03.csv").write_text("frame,u_min,v_min,u_max,v_max\n")
    found = project.load(bumped)
    assert found.cameras("field@out_2")["cam03"]["align"]["sequences"] == ["out_2"]
