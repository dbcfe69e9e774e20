import numpy as np
import pytest

from dior.body.names import COCO_17, HALPE_26, WHOLEBODY_133
from dior.errors import DiorError
from dior.ingest.readers import caliscope
from dior.ingest.readers.recognise import recognise
from tests.ingest import formats
from tests.ingest.formats import scene
from tests.ingest.test_detections_formats import run

# a file that caliscope 0.11.8 wrote itself: ImagePoints.to_csv of what _accumulate_points made of two cameras
WRITTEN = """\
sync_index,cam_id,frame_index,frame_time,object_id,keypoint_id,img_loc_x,img_loc_y,obj_loc_x,obj_loc_y,obj_loc_z
0,0,3,0.000000,0,0,1.250000,2.000000,,,
0,0,3,0.000000,0,5,3.000000,4.000000,,,
0,0,3,0.000000,0,25,5.000000,6.123457,,,
0,1,3,0.000000,0,0,1.250000,2.000000,,,
0,1,3,0.000000,0,5,3.000000,4.000000,,,
0,1,3,0.000000,0,25,5.000000,6.123457,,,
1,0,4,0.033333,0,0,1.250000,2.000000,,,
1,0,4,0.033333,0,5,3.000000,4.000000,,,
1,0,4,0.033333,0,25,5.000000,6.123457,,,
1,1,4,0.033333,0,0,1.250000,2.000000,,,
1,1,4,0.033333,0,5,3.000000,4.000000,,,
1,1,4,0.033333,0,25,5.000000,6.123457,,,
"""


def test_a_file_that_it_wrote_itself(tmp_path):
    (tmp_path / "xy.csv").write_text(WRITTEN)
    people = caliscope.read(tmp_path / "xy.csv", "cam01")
    assert people.joints == HALPE_26 and people.frame.tolist() == [3, 4]
    assert np.flatnonzero(np.isfinite(people.uv[0, :, 0])).tolist() == [0, 5, 25]
    assert people.uv[1, 25].tolist() == [5.0, 6.123457] and people.score[0, 5] == 1


def test_each_camera_has_the_rows_of_its_number(tmp_path):
    found = scene(26)
    path = formats.caliscope(tmp_path, found, (1, 2, 10))
    for shift, camera in enumerate(("cam01", "lab1_cam_2", "kamera10")):
        people = caliscope.read(path, camera)
        np.testing.assert_allclose(people.uv[0], found[0][0][:, :2] + (10 * shift, 0))
    for camera in ("cam03", "left"):
        with pytest.raises(
            DiorError, match=rf"its cameras are 1, 2, 10, and the number at the end of '{camera}' is none"
        ):
            caliscope.read(path, camera)


def test_one_file_for_all_cameras_through_the_step(tmp_path):
    table, _ = run(tmp_path, formats.caliscope(tmp_path, scene(26), (1, 2)), cameras=("cam01", "cam02"))
    u = table["u"].reshape(2, 4, 26)
    np.testing.assert_allclose(u[1] - u[0], np.where(np.isfinite(u[0]), 10, np.nan), atol=1e-4)
    with pytest.raises(DiorError, match=r"which needs a \{camera\} in it"):
        run(tmp_path, formats.coco(tmp_path, scene(17)), cameras=("cam01", "cam02"))


@pytest.mark.parametrize("count, joints", [(17, COCO_17), (26, HALPE_26), (133, WHOLEBODY_133)])
def test_models_by_their_last_keypoint(tmp_path, count, joints):
    assert caliscope.read(formats.caliscope(tmp_path, scene(count))).joints == joints


@pytest.mark.parametrize(
    "old, new, text",
    [
        ("frame_index", "frame", "no column frame_index; it is of an older caliscope"),
        ("\n7,3,0,0.000000,0,0,", "\n7,3,0,0.000000,0,133,", "it has keypoints 0 to 133, which are of no model"),
        ("\n7,3,0,0.000000,0,0,", "\n7,3,0,0.000000,0,1,", "a keypoint of a picture is there twice"),
        ("\n7,3,0,", "\n7,3,0.5,", "is no whole number"),
        ("\n7,3,0,", "\n7,3,", "line 2 has 10 columns, not 11"),
    ],
)
def test_rows_that_are_something_else(tmp_path, old, new, text):
    path = formats.caliscope(tmp_path, scene(26))
    path.write_text(path.read_text().replace(old, new, 1))
    with pytest.raises(DiorError, match=text):
        caliscope.read(path)


def test_the_real_file_of_an_older_version_is_refused_in_these_words(shared):
    path = shared / "charuco" / "xy_CHARUCO.csv"
    assert recognise(path) == "caliscope"
    with pytest.raises(DiorError, match="xy_CHARUCO.csv: there is no column frame_index; it is of an older caliscope"):
        caliscope.read(path)


@pytest.mark.parametrize("ids, cameras", [((2,), ("cam01", "cam02")), ((1, 2), ("cam01", "side1"))])
def test_two_cameras_with_the_rows_of_one_are_refused(tmp_path, ids, cameras):
    path = formats.caliscope(tmp_path, scene(26), ids)
    with pytest.raises(DiorError, match=rf"{cameras[0]} and {cameras[1]} have the same rows of .*xy_RTMPOSE.csv; it"):
        run(tmp_path, path, cameras=cameras)
