import pytest

from dior.body.names import BODY_25B, HALPE_26, MLKIT_33
from dior.body.spellings import joint_of, tidy


@pytest.mark.parametrize(
    "word, joint",
    [
        ("left_ankle", "left_ankle"), ("LAnkle", "left_ankle"), ("leftAnkle", "left_ankle"), ("ankle_l", "left_ankle"),
        ("ankle left", "left_ankle"), ("lankle", "left_ankle"), ("R.BigToe", "right_big_toe"), ("Hip", "mid_hip"),
        ("RHip", "right_hip"), ("MidHip", "mid_hip"), ("Nose", "nose"), ("LEFT_KNEE", "left_knee"),
        ("lear", "left_ear"),
    ],
)  # fmt: skip
def test_spellings_of_a_joint(word, joint):
    assert joint_of(word) == tidy(word) == joint


@pytest.mark.parametrize(
    "word, tidied",
    [("tail", "tail"), ("Shank_L", "left_shank"), ("leg", "leg"), ("rib", "rib"), ("Marker7", "marker_7")],
)
def test_what_is_no_joint_keeps_its_name_with_the_side_first(word, tidied):
    assert joint_of(word) is None and tidy(word) == tidied


def test_every_known_name_is_itself():
    for names in (MLKIT_33, BODY_25B, HALPE_26):
        assert tuple(map(tidy, names)) == names
    assert tidy("---") == ""
