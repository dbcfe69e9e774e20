"""AlphaPose: its models, its scores above 1, and the shapes of its tracker's number."""

import re

import pytest

from dior.errors import DiorError
from dior.ingest.readers import alphapose
from tests.ingest import formats
from tests.ingest.formats import scene


@pytest.mark.parametrize("count, joints", formats.ALPHAPOSE_COUNTS.items())
@pytest.mark.parametrize("idx", [1, 1.0, [1.0], [[1.0]], None])
def test_alphapose_counts_and_idx(tmp_path, count, joints, idx):
    found = scene(count)
    found[0][0][0, 2] = 1.3
    people = alphapose.read(formats.alphapose(tmp_path, found, idx=idx))
    assert people.joints == joints
    assert people.score[0, 0] == 1.0 and people.score.max() <= 1.0


def test_the_cameras_number_behind_that_of_the_picture_is_no_frame(tmp_path):
    path = formats.alphapose(tmp_path, scene(17))
    path.write_text(re.sub(r"cam01_(\d+)", r"\1_cam01", path.read_text()))
    with pytest.raises(DiorError, match="000000_cam01.jpg and 000001_cam01.jpg are both frame 1"):
        alphapose.read(path)
