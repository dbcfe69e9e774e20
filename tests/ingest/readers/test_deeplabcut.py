import numpy as np
import pytest

from dior.body.names import COCO_17, MLKIT_33
from dior.errors import DiorError
from dior.ingest.readers import deeplabcut
from dior.ingest.readers.recognise import recognise
from tests.ingest import formats
from tests.ingest.formats import scene


def test_parts_are_joints_by_their_spelling_and_others_joints_of_their_own(tmp_path):
    parts = ["Nose", "LAnkle", "ankle_r", "leftKnee", "knee-right", "Shank_L"]
    people = deeplabcut.read(formats.deeplabcut(tmp_path, scene(6), parts))
    assert people.joints == ("nose", "left_ankle", "right_ankle", "left_knee", "right_knee", "left_shank")
    assert people.ran.tolist() == [0, 1, 2, 3]


def test_individuals_are_people_and_what_nobody_owns_is_left_out(tmp_path):
    found = scene(33)
    people = deeplabcut.read(formats.deeplabcut_of_several(tmp_path, found, MLKIT_33))
    assert people.joints == MLKIT_33 and people.person.tolist() == [0, 0, 1, 0, 0]
    np.testing.assert_array_equal(people.uv[2], found[1][1][:, :2])


@pytest.mark.parametrize(
    "old, new, text",
    [
        ("left_ankle", "LAnkle", None),
        ("left_ankle", "left_knee", "two parts, one of them 'left_knee', are both left_knee; rename one"),
        ("bodyparts", "parts", "its header is scorer, parts, coords, not scorer, bodyparts, coords"),
        ("coords,x", "coords,y", "the columns are not x, y, likelihood of every part"),
        ("\n1,", "\nimg01.png,", r"line 5 begins with 'img01.png', which is no picture's number; is it of a video"),
        ("\n1,", "\n0,", "frame 0 is there twice"),
        ("\n1,", "\n1,5,", "line 5 has 53 columns, not 52"),
    ],
)
def test_headers_and_rows_that_are_something_else(tmp_path, old, new, text):
    path = formats.deeplabcut(tmp_path, scene(17))
    path.write_text(path.read_text().replace(old, new))
    if text is None:
        assert deeplabcut.read(path).joints == COCO_17
        return
    with pytest.raises(DiorError, match=text):
        deeplabcut.read(path)


@pytest.mark.parametrize(("mark", "called"), [(";", "semicolons"), ("\t", "tabs")])
def test_a_file_that_a_spreadsheet_saved(tmp_path, mark, called):
    path = formats.deeplabcut(tmp_path, scene(17))
    path.write_text(path.read_text().replace(",", mark))
    assert recognise(path) == "deeplabcut"
    with pytest.raises(DiorError, match=f"give the file of DeepLabCut itself.*by commas, not by {called}"):
        deeplabcut.read(path)


def test_an_animal_is_refused(tmp_path):
    path = formats.deeplabcut(tmp_path, scene(4), ["snout", "tailbase", "left_ear", "right_ear"])
    with pytest.raises(
        DiorError, match=r"of its parts \(snout, tailbase, left_ear, right_ear\) fewer than 4 are joints"
    ):
        deeplabcut.read(path)
    text = formats.deeplabcut_of_several(tmp_path, scene(17)).read_text().splitlines()
    text[2] = text[2].replace("nose", "chin", 1)
    (tmp_path / "b.csv").write_text("\n".join(text))
    with pytest.raises(DiorError, match="its individuals have different parts"):
        deeplabcut.read(tmp_path / "b.csv")
