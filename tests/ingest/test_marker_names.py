import numpy as np
import pytest

from dior.errors import DiorError
from dior.ingest import marker_names, mocap
from dior.label import reproject
from tests.ingest.c3d_files import PLACES, c3d_bytes, person
from tests.rig import ring

PLAIN = ["LASI", "RASI", "LPSI", "RPSI"]


def write_sheet(path, *rows):
    path.write_text("\n".join(["name\tmarker\tformat", *("\t".join(row) for row in rows)]) + "\n")
    return path


def found(labels, named=marker_names.NOTHING, **how):
    got = marker_names.find(labels, "a.c3d", named=named, **how)
    return {marker: labels[i] for marker, i in got.place.items()}, got.said


def test_the_sheet_goes_before_the_spelling(tmp_path):
    path = write_sheet(tmp_path / "m.tsv", ("L_FAL", "LANK", ""), ("LKNE", "LTIB", "qtm"), ("L_FAL", "LHEE", "trc"))
    assert marker_names.sheet(path, "c3d") == {"L_FAL": "LANK"}
    assert marker_names.sheet(path, "trc") == {"L_FAL": "LHEE"}
    named = marker_names.sheet(path, "qtm")
    assert named == {"L_FAL": "LANK", "LKNE": "LTIB"}
    places, said = found([*PLAIN, "LKNE", "S01:L_FAL", "LANK"], named)
    assert places["LTIB"] == "LKNE" and "LKNE" not in places and places["LANK"] == "S01:L_FAL"
    assert said == [("info", "markers_by_sheet", "2 of 6 markers have the names that config/markers.tsv gives them")]


@pytest.mark.parametrize(
    "row, text",
    [(("a", "LXXX"), "LXXX"), (("=a", "LASI"), "name"), (("a", "LASI", "c4d"), "c4d"), (("", "LASI"), "name")],
)
def test_a_wrong_sheet_names_the_line(tmp_path, row, text):
    with pytest.raises(DiorError, match=rf"config/markers\.tsv line 2.*{text}"):
        marker_names.sheet(write_sheet(tmp_path / "m.tsv", row), "c3d")


def own_sheet(path, *rows):
    path.write_text("\n".join(["name\tmarker\tjoint", *("\t".join(row) for row in rows)]) + "\n")
    return path


def test_a_marker_of_the_labs_own_is_a_further_joint(tmp_path):
    path = own_sheet(tmp_path / "m.tsv", ("L_FTC", "", "left_trochanter"), ("L_FLE", "LKNE", ""), ("gone", "", "gone"))
    named = marker_names.sheet(path, "c3d")
    labels = list(PLACES)
    points = person(labels, 5)
    points = np.concatenate([points, points[:, :1] + (0.1, 0.0, 0.0)], axis=1)
    (tmp_path / "a.c3d").write_bytes(c3d_bytes([*labels, "S01:L_FTC"], 1000 * points))
    got = mocap.read(tmp_path / "a.c3d", named=named)
    assert got.markers[-1] == "left_trochanter" and len(got.markers) == len(PLACES) + 1
    np.testing.assert_allclose(got.points[:, -1], points[:, -1], atol=1e-6)
    ((_, code, text),) = got.said
    assert code == "markers_by_sheet" and text.startswith("1 of 25 markers have")
    assert text.endswith("of which Plug-in-Gait does not have left_trochanter; gone of that sheet it has not")
    # it is projected as the others are, and the body hides it
    camera = ring(3)[0]
    uv, _, status = reproject.labels(camera, got.points, got.markers)
    assert np.isfinite(uv[:, -1]).all() and set(status[:, -1]) <= {"ok", "occluded", "out_of_frame"}
    with pytest.raises(DiorError, match="2 of the 39 Plug-in-Gait markers are there"):
        found([*PLAIN[:2], "L_FTC", "gone"], named)


@pytest.mark.parametrize(
    "row, text",
    [
        (("a", "", ""), "'a' needs either `marker`"),
        (("a", "LASI", "left_trochanter"), "'a' needs either `marker`"),
        (("a", "", "trochanter_left"), "the side of the joint .* comes first, as a word: write left_trochanter"),
        (("a", "", "r_trochanter"), "the side of the joint 'r_trochanter' .*: write right_trochanter"),
        (("a", "", "greater_trochanter_r"), "the side of the joint .*: write right_greater_trochanter"),
        (("a", "", "left_knee"), "'left_knee' of 'a' is one of a detector's"),
        (("a", "", "lasi"), "'lasi' of 'a' is one of a detector's"),
        (("a", "", "Left Thing"), "joint"),
        (("a", "", "left_hand_03"), "'left_hand_03' of 'a' is one of a detector's"),
        (("Ann:a", "", "left_trochanter"), "'Ann:a' is found in no file; leave out"),
    ],
)
def test_a_joint_that_cannot_be(tmp_path, row, text):
    with pytest.raises(DiorError, match=rf"config/markers\.tsv line 2.*{text}"):
        marker_names.sheet(own_sheet(tmp_path / "m.tsv", row), "c3d")


def test_a_name_of_the_sheet_in_other_letters():
    named = {"L_FTC": "left_trochanter", "L_FAL": "LANK", "a": "LTIB", "A": "LTHI"}
    places, said = found([*PLAIN, "l_ftc", "S01:l_fal", "a"], named)
    assert places["left_trochanter"] == "l_ftc" and places["LANK"] == "S01:l_fal" and places["LTIB"] == "a"
    ((_, code, text),) = said
    assert code == "markers_by_sheet" and text.endswith("does not have left_trochanter")
    # what is spelled as the sheet has it, or as Plug-in-Gait has it, goes before it
    assert found([*PLAIN, "l_ftc", "L_FTC"], named)[0]["left_trochanter"] == "L_FTC"
    assert found([*PLAIN, "l_fal", "LANK"], named)[0]["LANK"] == "LANK"


@pytest.mark.parametrize("word", ["L_KNE", "L.Kne", "LeftKNE", "KNE_L", "kne left"])
def test_a_guess_is_said(word):
    places, said = found([*PLAIN, word])
    assert places["LKNE"] == word
    ((severity, code, text),) = said
    assert (severity, code) == ("warning", "markers_guessed") and f"{word} for LKNE" in text


def test_only_one_label_alone_is_guessed():
    places, said = found([*PLAIN, "L_KNE", "KNE.L"])
    assert "LKNE" not in places and said == []
    places, said = found([*PLAIN, "L_KNE", "LKNE"])
    assert places["LKNE"] == "LKNE" and said == []
    places, said = found([*PLAIN, "L_KNE", "lkne*"])
    assert places["LKNE"] == "lkne*" and said == []


def test_a_subject_before_an_underscore():
    """As Motive writes it, unless it is told to write a colon."""
    places, said = found([f"Ann_{name}" for name in PLAIN])
    assert list(places) == PLAIN and said == []
    two = [f"{who}_{name}" for who in ("Ann", "Ben B") for name in PLAIN]
    assert list(found(two, subject="ben b")[0].values()) == two[4:]
    with pytest.raises(DiorError, match="its labels are of 2 subjects") as refused:
        found(two)
    assert "Ann" not in str(refused.value)
    # what is spelled right goes before it, and the sheet's names have underscores of their own
    places, _ = found([*PLAIN, "old_LASI", "Ann_L_FAL"], {"L_FAL": "LANK"})
    assert places["LASI"] == "LASI" and places["LANK"] == "Ann_L_FAL"


def test_names_of_places_that_are_no_markers_are_not_guessed():
    for word in ("LKnee", "LHipAngles", "L_FLE", "LFEO", "L", "C8", "left"):
        assert set(found([*PLAIN, word])[0]) == set(PLAIN)


def test_two_points_of_the_same_name_by_the_sheet():
    with pytest.raises(DiorError, match=r"the points 5 \('a'\) and 6 \('b'\) are all the marker LKNE"):
        found([*PLAIN, "a", "b"], {"a": "LKNE", "b": "LKNE"})


@pytest.mark.parametrize(
    "screen, up, word", [("+Y", "y", "y"), ("+Z", "z", ""), ("+Y", "z", ""), ("-Y", "z", ""), ("", "z", "")]
)
def test_a_c3d_says_which_axis_is_up(tmp_path, screen, up, word):
    """OptiTrack's have Y up; where the body stands along Z all the same, it is Z."""
    labels = list(PLACES)
    points = 1000 * person(labels, 5)
    if up == "y":
        points = points @ np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]]).T
    (tmp_path / "a.c3d").write_bytes(c3d_bytes(labels, points, more={"POINT:Y_SCREEN": [screen]} if screen else None))
    got = mocap.read(tmp_path / "a.c3d")
    np.testing.assert_allclose(got.points, person(got.markers, 5), atol=1e-6)
    assert [text.split()[1] for _, _, text in got.said] == ([word] if word else [])
