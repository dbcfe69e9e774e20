"""The demo's recordings as a lab's own, in the layouts that labs have: what is typed, and the labels."""

import numpy as np
import pytest

from benchmarks import own_data, videos
from dior.project import project
from tests.end_to_end.workflow import snakemake

pytestmark = pytest.mark.slow
# as of videos beside bags
SAME_PX = {"videos": 0.3}


@pytest.fixture(scope="module")
def demo(tmp_path_factory):
    """A small simulated capture, labelled."""
    folder = tmp_path_factory.mktemp("demo")
    videos.simulated(folder, videos.SMALL)
    snakemake(folder, "all")
    return folder


@pytest.mark.parametrize("layout", own_data.LAYOUTS)
def test_what_nobody_else_knows_is_all_that_is_typed(demo, tmp_path, layout):
    made, typed = own_data.own(demo, tmp_path, layout)
    lens = 0 if layout == "videos" else 2
    # who walks outdoors, two heights, two consents, four places
    assert own_data.table(typed)[1] == 1 + 4 + lens + 4 * 3 <= own_data.MOST_VALUES
    ours, theirs = project.load(made), project.load(demo)
    assert sorted(ours.sequences) == sorted(theirs.sequences) == ["indoor_01", "outdoor_01"]
    for session, other in own_data.SESSIONS.items():
        assert {name: camera["role"] for name, camera in ours.cameras(session).items()} == {
            name: camera["role"] for name, camera in theirs.cameras(other).items()
        }
        assert ours.window(session) == theirs.window(other)
    assert all((made / path).exists() for name in ours.sequences for path in ours.recordings(name).values())


@pytest.mark.parametrize("layout", ["bags", "videos"])
def test_the_labels_are_the_demos(demo, tmp_path, layout):
    made, _ = own_data.own(demo, tmp_path, layout)
    snakemake(made, "all")
    of_each = list(videos.apart(demo, made))
    assert len(of_each) == 8
    for sequence, camera, off, lost in of_each:
        assert np.nanmax(off) <= SAME_PX.get(layout, 0.0) and not lost, (sequence, camera)
