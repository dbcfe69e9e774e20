"""Qualisys' calibration: two cameras of the file that Pose2Sim's demonstration has for the recording of real_outdoor.

`../shared/data/real_outdoor/reference` has what Pose2Sim made of it: an independent reading of the poses, and the lens
by Qualisys' own coefficients.
"""

import numpy as np
import pytest

from dior.calibrate.intrinsics import from_file
from dior.calibrate.place import reference_pose
from dior.errors import DiorError
from tests.calibrate.readers import rigs

TEXT = """<?xml version='1.0' encoding='ASCII'?>
<calibration created="sometimes ago" qtm-version="none" type="regular" wandLength="none">
  <results min-max-diff="0." std-dev="0."/>
  <cameras>
    <camera active="1" avg-residual="0.402000" model="none" point-count="999999999" serial="cam01" viewrotation="0">
      <fov_marker bottom="1919" left="0" right="1087" top="0"/>
      <fov_marker_max bottom="1919" left="0" right="1087" top="0"/>
      <fov_video bottom="1919" left="0" right="1087" top="0"/>
      <fov_video_max bottom="1919" left="0" right="1087" top="0"/>
      <transform r11="0.5536380477336265" r12="0.8046719867383512" r13="0.2144479094331626" r21="-0.4345300743838753" \
r22="0.05946489349975602" r23="0.8986921279821063" r31="0.7104002579937896" r32="-0.5907342212870501" \
r33="0.3825762057979294" x="1460.2323709212087" y="-1909.1590482454608" z="1896.5058524092062"/>
      <intrinsic centerPointU="34110.316406" centerPointV="60680.792969" focalLengthU="107599.671875" \
focalLengthV="107588.828125" focallength="9.314096596679686" radialDistortion1="-0.046183" \
radialDistortion2="0.139983" radialDistortion3="0.000000" sensorMaxU="69568" sensorMaxV="122816" \
sensorMinU="0.000000" sensorMinV="0.000000" skew="0.000000" tangentalDistortion1="0.000608" \
tangentalDistortion2="0.00069"/>
    </camera>
    <camera active="1" avg-residual="0.450323" model="none" point-count="999999999" serial="cam03" viewrotation="0">
      <fov_video bottom="1919" left="0" right="1087" top="0"/>
      <transform r11="-0.740641130147863" r12="-0.6704153360235378" r13="-0.044654154988568895" \
r21="0.25251118212268814" r22="-0.3393170985114385" r23="0.9061467925015139" r31="-0.6226466246887545" \
r32="0.6598539110153292" r33="0.4205995683324882" x="-3216.86586729648" y="2231.1786368869416" \
z="2088.19103027083"/>
      <intrinsic centerPointU="32845.335938" centerPointV="61120.328125" focalLengthU="107622.296875" \
focalLengthV="107616.632813" focallength="9.316055073242188" radialDistortion1="-0.046705" \
radialDistortion2="0.137622" radialDistortion3="0.000000" sensorMaxU="69568" sensorMaxV="122816" \
sensorMinU="0.000000" sensorMinV="0.000000" skew="0.000000" tangentalDistortion1="-0.000542" \
tangentalDistortion2="-0.000517"/>
    </camera>
  </cameras>
</calibration>
"""


def written(folder, old="", new="", count=1):
    assert old in TEXT
    path = folder / "Calib.qca.txt"
    path.write_text(TEXT.replace(old, new, count) if old else TEXT)
    return path


@pytest.mark.parametrize("name", ["cam01", "cam03"])
def test_pose_and_lens_are_those_of_the_toml_that_was_made_of_it(tmp_path, shared, name):
    path, folder = written(tmp_path), shared / "real_outdoor/reference"
    key = name.replace("cam", "cam_")
    rigs.same_pose(reference_pose(path, name), reference_pose(folder / "calibration.toml", key))
    theirs = from_file(folder / "calibration_qualisys.toml", key)
    rigs.same_lens(path, name, theirs.distortion, (1088, 1920), theirs.K)


def test_the_place_is_as_written_and_the_camera_looks_into_the_room(tmp_path):
    wTc = reference_pose(written(tmp_path), "cam01")
    np.testing.assert_allclose(wTc[:3, 3], [1.4602323709, -1.9091590482, 1.8965058524], atol=1e-9)
    forward = wTc[:3, 2]
    assert forward @ -wTc[:3, 3] > 0 and forward[2] < 0, "towards the origin, from above"
    assert wTc[2, 1] < 0, "OpenCV's y is down"


def test_pictures_of_a_part_of_the_sensor(tmp_path):
    """The centre counts from their corner; the unit is still told by the whole sensor."""
    part = '<fov_video bottom="1819" left="64" right="1023" top="100"/>'
    path = written(tmp_path, '<fov_video bottom="1919" left="0" right="1087" top="0"/>', part)
    whole, lens = from_file(written(tmp_path / "..", ""), "cam01"), from_file(path, "cam01")
    assert (lens.width, lens.height) == (960, 1720)
    assert (whole.cx - lens.cx, whole.cy - lens.cy, lens.fx) == (64, 100, whole.fx)


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ('sensorMaxU="69568" sensorMaxV="122816"', 'sensorMaxU="1087" sensorMaxV="1919"', "not the 1/64 px .*Theia3D"),
        ('sensorMaxU="69568" sensorMaxV="122816"', 'sensorMaxU="139136" sensorMaxV="245632"', "not the 1/64 px"),
        ('r11="0.55', 'r11="0.65', "no rotation matrix"),
        ('z="1896.5058524092062"', "", "`z` is missing"),
        ('x="1460.2323709212087"', 'x="nan"', "`x` has a value that is not finite"),
        ('active="1"', 'active="0"', "QTM did not calibrate this camera"),
        ('active="1"', 'active="False"', "QTM did not calibrate this camera"),
        ('active="1"', 'active="1" calibrated="0"', "QTM did not calibrate this camera"),
        ('active="1"', 'active="1" calibrated="FALSE"', "QTM did not calibrate this camera"),
        ('active="1"', 'active="1" calibrated="false"', "QTM did not calibrate this camera"),
    ],
)
def test_what_is_refused(tmp_path, old, new, sentence):
    path = written(tmp_path, old, new)
    with pytest.raises(DiorError, match=sentence) as caught:
        reference_pose(path, "cam01")
    assert "Calib.qca.txt [cam01]" in str(caught.value)
    reference_pose(path, "cam03")


def test_a_skew_is_refused_and_so_is_another_unit(tmp_path):
    with pytest.raises(DiorError, match="the skew 0.25 zero"):
        from_file(written(tmp_path, 'skew="0.000000"', 'skew="16"'), "cam01")
    for said in ({"units": "m"}, {"convention": "wTc"}):
        with pytest.raises(DiorError, match="by its format, and"):
            reference_pose(written(tmp_path), "cam01", **said)
