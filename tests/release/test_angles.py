"""`dior angles`: OpenSim's angles are the simulator's and Plug-in-Gait's; without OpenSim it says what to install."""

import sys

import numpy as np
import pytest

from benchmarks import angles as bench
from dior.body.names import COCO_17, MLKIT_33, PLUG_IN_GAIT_39
from dior.cli import main
from dior.errors import DiorError
from dior.project import project as projects
from dior.reconstruct.triangulate import columns, write_skeleton
from dior.release.angles import angles, draws, inverse, segments
from dior.release.exports import trc
from dior.simulate.body import Body
from dior.simulate.gait import Walker
from tests.project.test_project import root  # noqa: F401

HZ, T0 = 50.0, 1_700_000_000_000_000_000
TURNS = ("hip_rotation", "ankle_rotation")


@pytest.fixture(scope="module")
def walker():
    return Walker(Body(1.75), speed=1.1, half_length=20.0, start=2.0, until=6.0)


def without_opensim(monkeypatch):
    monkeypatch.setitem(sys.modules, "opensim", None)


def test_without_opensim_it_says_what_to_install(root, monkeypatch, capsys):  # noqa: F811
    without_opensim(monkeypatch)
    assert main.main(["angles", str(root), "--out", str(root / "angles")]) == 1
    said = capsys.readouterr().err
    assert said == "dior angles: `dior angles` needs OpenSim; install it: pip install -e '.[angles]'\n"
    assert not (root / "angles").exists()


@pytest.mark.parametrize("markers", [True, False])
def test_segments_are_those_of_the_body(walker, markers):
    points = trc.y_up(walker.at(np.arange(0, 4, 1 / HZ))[markers])
    found = segments.skeleton_of(points, PLUG_IN_GAIT_39 if markers else MLKIT_33)
    at = {one.name: one for one in found.segments}
    assert list(at) == [*"pelvis femur_r tibia_r foot_r femur_l tibia_l foot_l torso".split()]
    assert found.stiff is not markers and [one.above for one in found.segments][1:3] == ["pelvis", "femur_r"]
    body, near = walker.body, 0.015 if markers else 1e-6
    for end, sign in (("r", 1), ("l", -1)):
        assert at[f"femur_{end}"].joint[2] == pytest.approx(sign * body.half_hips, abs=near)
        np.testing.assert_allclose(at[f"tibia_{end}"].joint, [0, -body.thigh, 0], atol=near)
        np.testing.assert_allclose(at[f"foot_{end}"].joint, [0, -body.shank, 0], atol=near)
    # he walks along x, which stays x
    assert np.abs(found.heading).max() < np.deg2rad(8)


def test_hips_are_where_the_walk_shows_them(walker):
    """The simulator's are 98 mm behind the front of the pelvis, Bell's 45."""
    landmarks, markers = (trc.y_up(one) for one in walker.at(np.arange(0, 4, 1 / HZ)))
    at = {name: markers[:, i] for i, name in enumerate(PLUG_IN_GAIT_39)}
    before = segments._centres(at)
    after = segments._moved_hips(at, before, segments._opensim(segments.pelvis_axes(at)[1]))
    for hip, moved in after.items():
        true = landmarks[:, MLKIT_33.index(hip)]
        off = [np.linalg.norm(one - true, axis=-1).mean() for one in (before[hip], moved)]
        assert off[0] > 0.04 and off[1] < 0.02


@pytest.mark.parametrize(
    ("names", "keep", "said"),
    [
        (COCO_17, 0, "the 3D has no left ankle"),
        (MLKIT_33, 4, "nobody is known"),
        (PLUG_IN_GAIT_39, None, "the 3D has no left knee"),
    ],
)
def test_what_no_angles_can_be_made_of_is_told(walker, names, keep, said):
    landmarks, markers = (trc.y_up(one) for one in walker.at(np.arange(0, 2, 1 / HZ)))
    points = markers if names is PLUG_IN_GAIT_39 else landmarks[:, [MLKIT_33.index(name) for name in names]]
    if keep is None:
        points[:, list(names).index("LKNE")] = np.nan
    elif keep:
        points[keep:] = np.nan
    else:
        names, points = names[:-2], points[:, :-2]
    with pytest.raises(DiorError, match=said):
        segments.skeleton_of(points, names)


def test_draws_have_the_errors_that_are_told():
    frames, sd = 4000, np.array([0.01, 0.002, 0.03])
    points = np.full((frames, 2, 3), np.nan)
    points[:, 0] = 1.0
    points[:, 1] = 2.0
    covariance = np.broadcast_to(np.diag(sd**2), (frames, 2, 3, 3)).copy()
    covariance[:, 1] = np.nan
    shares = np.full((frames, 2), 0.0)
    made = draws.drawn(np.random.default_rng(1), 50.0, points, covariance, shares, 0.1) - points
    np.testing.assert_allclose(made[:, 0].std(axis=0), sd, rtol=0.15)
    # after the time that is told the correlation is exp(-1/2)
    along = made[:, 0, 2] / made[:, 0, 2].std()
    assert (along[5:] * along[:-5]).mean() == pytest.approx(np.exp(-0.5), abs=0.1)
    assert made[:, 1].std() == pytest.approx(np.hypot(0.002, 0.005), rel=0.15)
    lasting = draws.drawn(np.random.default_rng(1), 50.0, points, covariance, shares + 1.0, 0.1) - points
    assert np.ptp(lasting[:, 0], axis=0).max() < 1e-12 and np.abs(lasting[0, 0]).min() > 0
    points[7, 0] = np.nan
    again = draws.drawn(np.random.default_rng(1), 50.0, points, covariance, shares, 0.1)
    assert np.isnan(again[7, 0]).all() and np.isfinite(again[8, 0]).all()


@pytest.fixture
def opensim():
    module = pytest.importorskip("opensim")
    angles.quiet_opensim()
    return module


def left_after_offset(errors):
    """{angle: rms of the errors after their mean, degrees}"""
    return {name: float(np.nanstd(off)) for name, (off, _) in errors.items()}


@pytest.mark.parametrize(("kind", "turns"), [("markers", 3.0), ("skin", 6.0)])
def test_angles_are_the_simulators(opensim, kind, turns):
    found = bench.errors(*bench.simulated(kind, 0, 3.0), draws=3)
    assert len(found) == 18
    for name, left in left_after_offset(found).items():
        assert left < (turns if name.startswith(TURNS) else 3.0), (name, left)
    for name, (off, sigma) in found.items():
        typical = np.median(sigma)
        assert np.isfinite(off).all() and 0.3 < typical < (25 if name.startswith(TURNS) else 6), (name, typical)


def test_angles_of_joints_are_the_simulators(opensim, walker):
    t = np.arange(0, 3, 1 / HZ)
    walk = bench.of_markers(HZ, walker.at(t)[0], MLKIT_33)
    found = left_after_offset(bench.errors(walk, walker.angles(t), draws=2))
    # pelvis and trunk are tilted as one
    assert len(found) == 17 and "lumbar_extension" not in found
    assert max(found.values()) < 3.0 and found["knee_angle_l"] < 0.5


def test_sagittal_angles_are_plug_in_gaits_of_a_real_walk(opensim, shared):
    if not bench.WALK.is_file():
        pytest.skip(f"there is no {bench.WALK}")
    for name, (off, _) in bench.errors(*bench.real(), draws=2).items():
        if name.startswith(("hip_flexion", "knee")):
            assert np.isfinite(off).mean() > 0.9 and np.sqrt(np.nanmean(off**2)) < 5.0, name


def skeleton(path, points, names):
    shape = points.shape[:2]
    stamps = T0 + np.rint(np.arange(shape[0]) / HZ * 1e9).astype(np.int64)
    status = np.where(np.isfinite(points).all(axis=-1), "ok", "too_few_views").astype(object)
    path.parent.mkdir(parents=True, exist_ok=True)
    about = columns(names, stamps, points, status, np.full(shape, 3), np.zeros(shape))
    write_skeleton(path, "S01", "in_1", about)


def test_a_walk_of_a_project(opensim, root, walker, capsys):  # noqa: F811
    """Files that OpenSim reads, the same ones each time; what is missing is missing in them."""
    t = np.arange(0, 1, 1 / HZ)
    points = walker.at(t)[1] + 0.0002 * np.random.default_rng(1).standard_normal((len(t), 39, 3))
    points[20:24, PLUG_IN_GAIT_39.index("LANK")] = np.nan
    points[20:24, PLUG_IN_GAIT_39.index("LTIB")] = np.nan
    points[40:43] = np.nan
    path = root / projects.load(root).skeleton_table("in_1")
    skeleton(path, points, PLUG_IN_GAIT_39)
    for out in ("one", "two"):
        assert main.main(["angles", str(root), "in_1", "--out", str(root / out)]) == 0
    assert f"{root}/two/in_1.csv: 18 angles at 50 instants, sigma " in capsys.readouterr().out
    made = {one.name: one.read_bytes() for one in (root / "one").iterdir()}
    assert sorted(made) == [f"in_1.{end}" for end in ("csv", "mot", "osim", "trc")]
    assert made == {one.name: one.read_bytes() for one in (root / "two").iterdir()}
    head, *rows = (line.split(",") for line in made["in_1.csv"].decode().splitlines())
    assert head[:4] == ["time_s", "stamp_ns", "pelvis_rotation", "pelvis_rotation_sigma"]
    assert len(rows) == 50 and rows[5][:2] == ["0.100000", str(T0 + 100_000_000)]
    lacking = {
        name: {i for i, row in enumerate(rows) if row[head.index(name)] == ""}
        for name in ("pelvis_tilt", "knee_angle_l", "hip_rotation_l", "ankle_angle_l", "knee_angle_r")
    }
    nobody, no_shank = set(range(40, 43)), set(range(20, 24))
    assert lacking["pelvis_tilt"] == lacking["knee_angle_r"] == nobody
    assert lacking["knee_angle_l"] == lacking["hip_rotation_l"] == lacking["ankle_angle_l"] == nobody | no_shank
    table = opensim.TimeSeriesTable(str(root / "one/in_1.mot"))
    assert table.getNumRows() == 50 and table.getTableMetaDataString("inDegrees") == "yes"
    knee = table.getDependentColumn("knee_angle_r").to_numpy()
    np.testing.assert_allclose(knee[:40], [float(row[head.index("knee_angle_r")]) for row in rows[:40]], atol=1e-3)
    model = opensim.Model(str(root / "one/in_1.osim"))
    model.initSystem()
    wanted = {model.getCoordinateSet().get(i).getName() for i in range(model.getNumCoordinates())}
    assert wanted == set(table.getColumnLabels())


def test_walks_without_legs_are_left_out_and_told(opensim, root, walker, capsys):  # noqa: F811
    points = walker.at(np.arange(0, 1, 1 / HZ))[0][:, :11]
    found = projects.load(root)
    for name in found.sequences:
        skeleton(root / found.skeleton_table(name), points, MLKIT_33[:11])
    assert main.main(["angles", str(root), "--out", str(root / "none")]) == 1
    said = capsys.readouterr().err
    assert "in_1: no joint angles: the 3D has no left hip" in said and "no walk has joint angles" in said
    assert main.main(["angles", str(root), "in_9", "--out", str(root / "none")]) == 1
    assert "no sequence 'in_9' (did you mean 'in_1'?)" in capsys.readouterr().err
    assert not (root / "none").exists()


def test_the_angles_of_each_segment_are_named_once():
    names = [
        name for end in ("femur_r", "tibia_r", "foot_r", "femur_l", "torso", "pelvis") for name, _ in inverse.turns(end)
    ]
    assert len(names) == len(set(names)) == 15
