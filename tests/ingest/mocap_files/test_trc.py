import numpy as np
import pytest

from dior.errors import DiorError
from dior.ingest import mocap, mocap_files
from tests.ingest.c3d_files import PLACES, person
from tests.ingest.mocap_files.texts import trc

LABELS = list(PLACES)
POINTS = person(LABELS, 12)


@pytest.mark.parametrize("unit", ["mm", "m"])
@pytest.mark.parametrize("up", ["y", "z"])
def test_units_axes_and_gaps(tmp_path, unit, up):
    points = POINTS.copy()
    points[3:5, 7] = np.nan
    got = mocap.read(trc(tmp_path / "a.trc", LABELS, points, 120.0, 40, unit, up))
    assert (got.rate, got.first_frame) == (120.0, 40)
    np.testing.assert_allclose(got.points, points[:, [LABELS.index(m) for m in got.markers]], atol=1e-5)
    assert [code for _, code, _ in got.said] == ["mocap_turned"] * (up == "y")


@pytest.mark.parametrize(
    "old, new, text",
    [
        ("\t12\t24\t", "\t13\t24\t", "it holds 12 of its 13 frames"),
        ("Frame#", "Frame", "its first lines are not PathFileType"),
        ("DataRate\t", "Rate\t", "its DataRate is '', which is no number"),
        ("\tmm\t", "\tinch\t", "Units is 'inch', not one of mm, cm, m"),
        ("\n3\t", "\n3\tx\t", "holds something that is no number"),
    ],
)
def test_what_is_no_such_file(tmp_path, old, new, text):
    path = trc(tmp_path / "a.trc", LABELS, POINTS)
    content = path.read_text()
    assert old in content
    path.write_text(content.replace(old, new, 1))
    with pytest.raises(DiorError, match=rf"a\.trc: .*{text}"):
        mocap.read(path)


def test_the_real_one_of_pose2sim_is_read_and_holds_joints_and_no_markers(shared):
    """Joints such as RAnkle are not the markers on the skin, RANK."""
    path = shared / "real_outdoor" / "reference" / "skeleton.trc"
    kind, capture = mocap_files.read(path)
    assert (kind, capture.rate, capture.units, capture.frames, len(capture.labels)) == ("trc", 60.0, "m", 100, 21)
    np.testing.assert_allclose(
        capture.points([0])[0, 0], [-0.06497214796810755, 0.9015045550714222, -1.4005886926185436]
    )
    with pytest.raises(DiorError, match=r"0 of the 39 Plug-in-Gait markers are there.*list them in config/markers.tsv"):
        mocap.read(path)
