"""YOLO's rows: other classes, columns behind the keypoints, a picture's file and a stream taken for each other."""

import shutil

import pytest

from dior.errors import DiorError
from dior.ingest.readers import yolo
from tests.ingest import formats
from tests.ingest.formats import scene
from tests.ingest.test_detections_formats import run


def test_yolo_other_classes_and_extra_columns(tmp_path):
    path = formats.yolo(tmp_path, scene(17))
    file = path / "walk2_1.txt"
    rows = file.read_text().splitlines()
    for name in path.iterdir():
        name.write_text("\n".join(f"{row} 0.9 7" for row in name.read_text().splitlines()))
    file.write_text("\n".join(["5" + rows[0][1:] + " 0.9 7", rows[1] + " 0.9 7"]))
    people = yolo.read(path)
    assert people.frame.tolist() == [0, 1, 2, 3]


def test_yolo_a_file_for_a_folder_and_a_folder_for_a_file(tmp_path):
    """Both have rows of 57 or 58 columns: the frame before, or the box's confidence and the track at the end."""
    folder, stream = formats.yolo(tmp_path, scene(17)), formats.yolo_stream(tmp_path, scene(17))
    one = tmp_path / "one.txt"
    for end in ("", " 0.9", " 0.9 7"):
        one.write_text("".join(f"{row}{end}\n" for row in (folder / "walk2_0.txt").read_text().splitlines()))
        with pytest.raises(
            DiorError, match=r"one\.txt: line 1 has .*; is it the file of one picture\? Then name the fold"
        ):
            run(tmp_path, one)
    (tmp_path / "whole").mkdir()
    shutil.copy(stream, tmp_path / "whole" / "walk2_0.txt")
    with pytest.raises(DiorError, match="rows that begin with the frame belong in one file, not in a folder"):
        run(tmp_path, tmp_path / "whole")
