"""Who did not agree is not there: in the project, its sessions and what their poses are made of."""

import pytest

from dior.errors import DiorError
from dior.project import project
from dior.project.consent import consents
from tests.project.test_project import CLOSE, all_marked, edit, fails, root  # noqa: F401


def people(root, first, second):  # noqa: F811
    """Fill in the consents (release, pictures, processing) of S01 and S02."""
    head = "subject\tpseudonym\theight_m\theight_sigma_m\tconsent_release\tconsent_pictures\tconsent_processing\n"
    rows = [f"S01\tzebra-0001\t1.72\t0.01\t{first}", f"S02\tapple-0002\t1.8\t0.01\t{second}"]
    (root / "config/subjects.tsv").write_text(head + "\n".join(row.replace(" ", "\t") for row in rows) + "\n")


@pytest.mark.parametrize(
    ("given", "processing", "release", "pictures"),
    [
        ({}, False, False, False),
        ({"release": "yes"}, True, True, False),
        ({"release": "YES", "pictures": "1", "processing": ""}, True, True, True),
        ({"release": "no", "pictures": "yes", "processing": "true"}, True, False, False),
        ({"release": "yes", "pictures": "yes", "processing": "no"}, False, False, False),
        ({"release": "", "processing": "yes"}, True, False, False),
        ({"release": "yes", "processing": "0"}, False, False, False),
    ],
)
def test_each_consent_needs_the_one_before_it(given, processing, release, pictures):
    row = {f"consent_{purpose}": word for purpose, word in given.items()}
    found = [consents(row, purpose) for purpose in ("processing", "release", "pictures")]
    assert found == [processing, release, pictures]


def test_a_purpose_that_there_is_not():
    with pytest.raises(DiorError, match=r"no consent to 'picture' \(did you mean 'pictures'\?\)"):
        consents({}, "picture")


@pytest.mark.parametrize(
    ("column", "parts"),
    [
        ("consent_picture", ["unknown column 'consent_picture' (did you mean 'consent_pictures'?)"]),
        ("consent_teaching", ["unknown column 'consent_teaching'"]),
    ],
)
def test_a_column_of_another_purpose_is_refused(root, column, parts):  # noqa: F811
    edit(root, "subjects.tsv", "consent_processing", column)
    fails(root, "config/subjects.tsv", *parts)


def test_who_may_not_be_processed_is_not_there(root):  # noqa: F811
    """Not even among the excluded sequences, nor by what other files say about these."""
    people(root, "yes yes", "no")
    edit(root, "sequences.tsv", "out_1\t9\tS01", "out_1\t9\tS02")
    edit(root, "sequences.tsv", "out_3\t11\tS01", "out_3\t11\tS02")
    edit(root, "sequences.tsv", "out_2\t10\tS02", "out_2\t10\tS01")
    edit(root, "sessions/field/session.yaml", "out_1", "out_2")
    (root / "config/gallery.tsv").write_text(
        "subject\toutfit\tangle\tpath\tbag\ttopic\nS01\tcoat\tfront\tg/a\t\t\nS02\tcoat\tfront\tg/b\t\t\n"
    )
    (root / "config/detectors.tsv").write_text(
        "sequence\tcamera\ttool\tzoom\tpath\nout_1\tcam03\tmlkit\t1\ta\nout_2\tcam03\tmlkit\t1\ta\n"
    )
    (root / "config/offsets/out_1.yaml").write_text("cam01: {offset_s: 0.1}\n")
    loaded = project.load(root)
    assert loaded.sequences == ("out_2", "in_1") and loaded.excluded == {} and set(loaded.rows) == {"out_2", "in_1"}
    assert set(loaded.subjects) == {"zebra-0001"} and [key[0] for key in loaded.gallery] == ["zebra-0001"]
    assert [row["sequence"] for row in loaded.detectors.values()] == ["out_2"]
    assert loaded.processed_subjects == loaded.released_subjects == ("zebra-0001",) and loaded.left_out == []
    assert loaded.pictures_released("out_2") and not loaded.consents("apple-0002", "processing")
    edit(root, "subjects.tsv", "\tno", "\t")
    assert project.load(root).rows == loaded.rows, "an empty cell is no yes"


def test_a_name_of_somebody_who_withdrew_still_must_not_be_told(root):  # noqa: F811
    people(root, "yes", "no")
    edit(root, "sequences.tsv", "out_1\t9", "like-s02_1\t9")
    fails(root, "config/sequences.tsv line 3", "'like-s02_1' holds that of subject 'S02'")
    edit(root, "sequences.tsv", "like-s02_1\t9\tS01\tfield\toutdoor\t", "out_1\t9\tS01\tfield\toutdoor\tcoat of S02")
    fails(root, "config/sequences.tsv line 3", "outfit 'coat of S02' must not hold the name of subject 'S02'")


def test_nobody_who_agreed_is_one_sentence(root):  # noqa: F811
    people(root, "no", "")
    fails(root, "config/subjects.tsv: nobody agreed to be processed", "consent_processing", "consent_release")


def two_windows(root):  # noqa: F811
    edit(root, "sessions/field/session.yaml", "out_1: {count: 100}", "out_1: {count: 100}, out_2: {count: 50}")


FACTS = "keypoint_distance: [{{subject: {}, joints: [left_hip, left_knee], length_m: 0.42, sigma_m: 0.01}}]\n"


@pytest.mark.parametrize("second", ["no", "no no yes"])
def test_only_who_agreed_to_the_release_shapes_its_poses(root, second):  # noqa: F811
    """Whether the other one is processed or not there at all."""
    people(root, "yes", second)
    two_windows(root)
    path = root / "config/sessions/field/session.yaml"
    path.write_text(path.read_text() + FACTS.format("S02"))
    edit(
        root,
        "sessions/field/cam03.yaml",
        "nudge: {azimuth_deg: 0.2}",
        "align: {from: boxes, sequences: [out_1, out_2]}",
    )
    loaded = project.load(root)
    assert list(loaded.window("field")) == ["out_1"] and loaded.shaping("field") == ["out_1"]
    assert loaded.cameras("field")["cam03"]["align"]["sequences"] == ["out_1"]
    known = loaded.metric_facts("field")
    assert known["keypoint_distance"] == [] and [fact["subject"] for fact in known["heights"]] == ["zebra-0001"]
    assert loaded.left_out == [
        ("field", "1 window of the adjustment is not used: no consent"),
        ("field", "1 distance between joints is not used: no consent"),
        ("field/cam03", "1 sequence of align.sequences is not used: no consent"),
    ]
    assert (loaded.sequences == ("out_1", "out_2", "in_1")) == (second != "no")


def test_everybody_shapes_what_is_not_published(root):  # noqa: F811
    people(root, "no no yes", "no no yes")
    two_windows(root)
    loaded = project.load(root)
    assert list(loaded.window("field")) == ["out_1", "out_2"] and loaded.left_out == []


@pytest.mark.parametrize("first", ["no", "no no yes"])
def test_a_session_without_a_window_that_may_be_used_is_one_sentence(root, first):  # noqa: F811
    people(root, first, "yes")
    fails(
        root, "config/sessions/field/session.yaml: 'adjust' of session 'field' names out_1, which may not be used",
        "no consent", "name a sequence of somebody who agreed, such as out_2",
    )  # fmt: skip


def test_a_camera_that_is_aligned_to_nobody_who_agreed(root):  # noqa: F811
    people(root, "yes", "no no yes")
    (root / "config/boxes/out_2.cam03.csv").touch()
    edit(root, "sessions/field/cam03.yaml", "nudge: {azimuth_deg: 0.2}", "align: {from: boxes, sequences: [out_2]}")
    fails(root, "config/sessions/field/cam03.yaml: align.sequences", "out_2", "no consent", "such as out_1")


@pytest.mark.parametrize("second", ["no", "no no yes"])
def test_marks_in_pictures_of_who_did_not_agree_are_not_used(root, second):  # noqa: F811
    people(root, "yes", second)
    all_marked(root, "sequence,frame,joint,u,v,x,y,z\nout_2,0,post,1,2,3,4,5\nout_1,0,post,1,2,3,4,5\n")
    loaded = project.load(root)
    assert loaded.marks_sequences("field", "cam01") == loaded.clicked("field", "cam01") == ["out_1"]
    assert ("field/cam01", "1 marked sequence is not used: no consent") in loaded.left_out
    (root / "config/sessions/field/cam02.marks.csv").write_text("sequence,frame,joint,u,v,x,y,z\nout_2,0,p,1,2,3,4,5\n")
    fails(root, "config/sessions/field/cam02.marks.csv line 2: the marks", "names out_2", "no consent", "such as out_1")


def test_the_tag_lies_where_somebody_agreed(root):  # noqa: F811
    people(root, "no no yes", "yes")
    edit(root, "sessions/field/session.yaml", "adjust: {out_1", "tag: {id: 3, size_m: 0.4}\nadjust: {out_2")
    assert project.load(root).tag_sequence("field") == "out_2"
    edit(root, "sessions/field/session.yaml", "id: 3,", "id: 3, sequence: out_1,")
    fails(root, "field/session.yaml: 'tag.sequence' is 'out_1', which may not be used: no consent", "of out_2")


@pytest.fixture
def bumped(root):  # noqa: F811
    """cam01 was bumped before out_2, and out_3 was walked after that."""
    edit(root, "sequences.tsv", "out_3/a.bag\t\t\t\train", "out_3/a.bag\t\tmlkit/{camera}.jsonl\t\t")
    edit(root, "sessions/field/session.yaml", "}}", "}, out_2: {count: 50}, out_3: {count: 50}}")
    (root / "config/sessions/field/cam01@out_2.yaml").write_text(CLOSE.format(name="cam01", x=4.1))
    return root


def test_a_bump_before_somebody_who_withdrew_has_to_be_renamed(bumped):
    """The session's part would carry the name of the sequence into the release."""
    people(bumped, "yes", "no")
    shown = "config/sessions/field/cam01@out_2.yaml"
    fails(
        bumped, f"{shown}: 'out_2' is not used any more: no consent", "call this file (and its marks) cam01@out_3.yaml"
    )
    (bumped / shown).rename(bumped / "config/sessions/field/cam01@out_3.yaml")
    loaded = project.load(bumped)
    assert loaded.sessions == ("field", "field@out_3", "lab") and list(loaded.window("field@out_3")) == ["out_3"]
    assert loaded.cameras("field@out_3")["cam01"]["tape"]["position_m"][0] == 4.1


def test_the_sequences_after_a_bump_stay_apart_when_the_first_ones_withdrew(bumped):
    edit(bumped, "sequences.tsv", "out_3\t11\tS01", "out_3\t11\tS02")
    people(bumped, "no", "yes")
    edit(bumped, "sequences.tsv", "in_1\t1\tS01", "in_1\t1\tS02")
    loaded = project.load(bumped)
    assert loaded.sessions == ("field@out_2", "lab") and list(loaded.window("field@out_2")) == ["out_2", "out_3"]
    assert loaded.left_out == [], "the window of out_1 is of the other part"
