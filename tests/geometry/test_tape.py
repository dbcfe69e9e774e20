"""Cameras placed by a tape measure."""

import numpy as np
import pytest

from dior.errors import DiorError
from dior.geometry import tape


def test_a_camera_in_line_with_its_target_and_the_origin_looks_at_it():
    wTc = tape.look_at_pose("cam01.yaml", {"position_m": [4.0, -2.0, 2.0], "target_m": [2.0, -1.0, 1.0]})
    np.testing.assert_allclose(wTc[:3, 2], np.array([-2.0, 1.0, -1.0]) / np.sqrt(6.0), atol=1e-12)
    np.testing.assert_allclose(wTc[:3, 3], (4.0, -2.0, 2.0))
    assert wTc[2, 0] == pytest.approx(0.0, abs=1e-12), "its rows are level"


def test_a_camera_stands_above_the_floor_however_low():
    assert tape.look_at_pose("cam01.yaml", {"position_m": [4.0, 0.0, 0.1]})[2, 3] == 0.1
    with pytest.raises(DiorError, match="cam01.yaml: the camera is 0.00 m below the floor"):
        tape.look_at_pose("cam01.yaml", {"position_m": [4.0, 0.0, 0.0], "target_m": [0.0, 0.0, 1.0]})


def test_a_camera_at_its_target_is_refused():
    with pytest.raises(DiorError, match="cam01.yaml: tape.position_m and tape.target_m are the same point"):
        tape.look_at_pose("cam01.yaml", {"position_m": [4.0, -2.0, 2.0], "target_m": [4.0, -2.0, 2.0005]})
