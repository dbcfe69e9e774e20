"""Files of every format with the mistakes that calibrations have: a walk names them, or the right words refuse."""

from itertools import pairwise

import numpy as np
import pytest

from dior.body import wrong_world
from dior.body.wrong_world import Person
from dior.calibrate.place import reference_pose
from dior.errors import DiorError
from dior.geometry.camera import inverse_pose, pose
from tests.body.test_wrong_world import HEIGHT, person, seen
from tests.calibrate.readers import rigs, written
from tests.rig import ring

WRITERS = written.WRITERS
# no lens, so that the walk tells of the poses alone, and one that every format has words for
CAMERAS = ring(4, radius=6.0, distortion=())
Y_UP = pose([[1, 0, 0], [0, 0, 1], [0, -1, 0]], (0, 0, 0))
each_writer = pytest.mark.parametrize("writer", WRITERS, ids=lambda writer: writer.__name__)


def scaled(by):
    return lambda cameras: [camera.at(pose(camera.wRc, by * camera.centre)) for camera in cameras]


MISTAKES = {
    "millimetres": (scaled(1000), "is in millimetres, not metres"),
    "metres": (scaled(0.001), "is too small by 1000"),
    "inverted": (lambda cameras: [camera.at(inverse_pose(camera.wTc)) for camera in cameras], "inverted"),
    "Y up": (lambda cameras: [camera.at(Y_UP @ camera.wTc) for camera in cameras], "has Y up, not Z"),
    "camera 0": (
        lambda cameras: [camera.at(inverse_pose(cameras[0].wTc) @ camera.wTc) for camera in cameras],
        "as the origin of its world",
    ),
}


def read(found, units, world):
    return [
        camera.at(reference_pose(*found[camera.name], units=units, world=world))
        for camera in CAMERAS
        if camera.name in found
    ]


def judged(cameras, world):
    points, names = person()
    there = [camera for camera in CAMERAS if camera.name in {one.name for one in cameras}]
    person_ = Person("p1", HEIGHT)
    faults, _ = wrong_world.of_poses(cameras, seen(there, points), names, person_, vertical=world == "as_given")
    return [fault.text for fault in faults]


@each_writer
def test_the_same_cameras(tmp_path, writer):
    """To 1e-6 m and 1e-6 rad, or, where the format has no floor, where they stand to each other."""
    units, world = WRITERS[writer]
    found = writer(tmp_path, CAMERAS)
    got = read(found, units, world)
    base = np.eye(4) if world == "as_given" or writer is written.opencap else inverse_pose(CAMERAS[0].wTc)
    for one in got:
        rigs.same_pose(one.wTc, base @ next(camera for camera in CAMERAS if camera.name == one.name).wTc)
    assert judged(got, world) == []


@each_writer
def test_the_same_lenses(tmp_path, writer):
    lens = CAMERAS[0].intrinsics
    distorted = CAMERAS if writer is written.vicon else ring(4, radius=6.0, distortion=(-0.05, 0.06, -6e-4, 5e-4))
    for camera in distorted[:2]:
        (tmp_path / camera.name).mkdir()
        path, name = writer(tmp_path / camera.name, distorted)[camera.name]
        # Vicon writes one focal length
        K = (
            lens.K
            if writer is not written.vicon
            else np.array([[lens.fx, 0, lens.cx], [0, lens.fx, lens.cy], [0, 0, 1]])
        )
        rigs.same_lens(path, name, camera.intrinsics.distortion, (lens.width, lens.height), K)


def links_inverted(cameras):
    """Cameras of a chain of which every link leads the other way."""
    found, cTw = [cameras[0].at(np.eye(4))], np.eye(4)
    for before, camera in pairwise(cameras):
        cTw = inverse_pose(before.wTc) @ camera.wTc @ cTw
        found.append(camera.at(inverse_pose(cTw)))
    return found


@each_writer
@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_named(tmp_path, writer, mistake):
    units, world = WRITERS[writer]
    change, words = MISTAKES[mistake]
    if mistake == "inverted" and writer in (written.kalibr, written.opencv_pair):
        change = links_inverted
    found = writer(tmp_path, change(CAMERAS))
    if world == "from_walk":
        with pytest.raises(DiorError, match="so that its Z is no vertical .* set `reference.world: from_walk`"):
            read(found, units, "as_given")
    texts = judged(read(found, units, world), world)
    if world == "from_walk" and mistake in ("Y up", "camera 0"):
        # the walk gives the floor and the vertical
        assert texts == []
    else:
        assert texts and words in " ".join(texts), texts
