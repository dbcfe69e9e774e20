"""The step on a simulated capture: wrong calibrations are refused by name, others get the errors that they have."""

import numpy as np
import pytest

from benchmarks import steps, worlds
from benchmarks.wrong_worlds import KINDS
from dior.calibrate import reference
from dior.calibrate.bundle.given_poses import PoseErrors
from dior.errors import DiorError
from dior.geometry import camera_tables
from dior.geometry.camera import inverse_pose, project
from dior.tables import tables
from tests.cases import some


@pytest.fixture(scope="module")
def capture(tmp_path_factory):
    folder, walks = tmp_path_factory.mktemp("capture"), {"subjects": 1, "sequences": 1, "duration_s": 4.0}
    return steps.recorded(folder, preset="ideal", seed=1, gallery=False, environments=["outdoor"], **walks)


def true(capture):
    session = worlds.outdoors(capture)
    walk = capture.project.sequences_of(session)[0]
    return [capture.views[walk][name].placed.camera for name in capture.project.close(session)]


def test_right_poses_are_left_as_they_are_with_small_errors(capture):
    found, cameras, covariance = worlds.reference_run(capture)
    assert [(severity, code) for severity, code, _ in found] == [("info", "reference_uncertainty")]
    for camera in true(capture):
        np.testing.assert_allclose(cameras[camera.name].wTc, camera.wTc, atol=1e-9)
    turn, shift = worlds.reference_sigmas(covariance)
    assert 0 < np.degrees(turn) < 0.2 and 0 < shift < 0.02


def test_the_yamls_sigmas_are_taken(capture):
    found, _, covariance = worlds.reference_run(capture, sigma_m=0.004, sigma_deg=0.5)
    assert found == []
    np.testing.assert_allclose(worlds.reference_sigmas(covariance), (np.radians(0.5), 0.004))


@pytest.mark.parametrize(
    "kind", some(["millimetres", "inverted", "camera 0", "left-handed x", "Y up"], "millimetres", "Y up")
)
def test_a_wrong_calibration_is_refused_by_name(capture, kind):
    change, words = KINDS[kind]
    with pytest.raises(DiorError, match="the reference calibration calibration.toml ") as error:
        worlds.reference_run(capture, change)
    session = worlds.outdoors(capture)
    assert str(error.value).startswith(f"session {session}, ") and words in str(error.value)


@pytest.mark.slow
@pytest.mark.parametrize(("level", "seed"), [("ideal", 2), ("real", 3)])
def test_every_kind_is_refused_by_name_and_no_right_one(level, seed, tmp_path):
    walks = {"subjects": 1, "sequences": 1, "duration_s": 8.0, "environments": ["outdoor"]}
    capture = steps.recorded(tmp_path, preset=level, seed=seed, gallery=False, **walks)
    worlds.reference_run(capture)
    for change, words in (KINDS[kind] for kind in KINDS if kind != "clean" and not kind.startswith("1.")):
        with pytest.raises(DiorError, match=words):
            worlds.reference_run(capture, change)


@pytest.mark.slow
def test_what_the_sentence_says_mends_it(capture):
    millimetres, inverted, first = (KINDS[kind][0] for kind in ("millimetres", "inverted", "camera 0"))
    for change, keys in ((millimetres, {"units": "mm"}), (inverted, {"convention": "wTc"})):
        _, cameras, _ = worlds.reference_run(capture, change, **keys)
        for camera in true(capture):
            np.testing.assert_allclose(cameras[camera.name].wTc, camera.wTc, atol=1e-9)
    found, cameras, _ = worlds.reference_run(capture, first, world="from_walk")
    assert found[0][:2] == ("info", "reference_world")
    relative = [inverse_pose(cameras[c.name].wTc) @ cameras[true(capture)[0].name].wTc for c in true(capture)]
    for camera, found_pose in zip(true(capture), relative, strict=True):
        np.testing.assert_allclose(found_pose, inverse_pose(camera.wTc) @ true(capture)[0].wTc, atol=1e-9)
        # as high as they stand, as level as they stand
        assert abs(cameras[camera.name].centre[2] - camera.centre[2]) < 0.1
        up, own = cameras[camera.name].wRc[2], camera.wRc[2]
        assert np.degrees(np.arccos(np.clip(up @ own, -1, 1))) < 1.5


def test_three_marked_points_give_the_world(capture, tmp_path):
    """Of a calibration in the first camera's world; a fourth point that is measured wrongly is a warning."""
    places = {"post": (0, 0, 0), "corner": (1, 0, 0), "bag": (0.2, 1.2, 0), "wrong": (-0.5, 0.5, 0.3)}
    walk = capture.project.sequences_of(worlds.outdoors(capture))[0]
    files = []
    for camera in true(capture):
        rows = ["sequence,frame,joint,u,v,x,y,z", "elsewhere,0,post,1,1,9,9,9"]
        for name, xyz in places.items():
            u, v = project(camera, np.array(xyz, float))[0]
            rows.append(f"{walk},0,{name},{u},{v},{','.join(map(str, xyz))}")
        files.append(tmp_path / f"{camera.name}@{walk}.marks.csv")
        files[-1].write_text("\n".join(rows[:-1]) + "\n")
    first = KINDS["camera 0"][0]
    found, cameras, _ = worlds.reference_run(capture, first, marks=files, world="from_marks")
    assert found[0][:2] == ("info", "reference_world") and "3 marked points (post, corner, bag)" in found[0][2]
    for camera in true(capture):
        np.testing.assert_allclose(cameras[camera.name].wTc, camera.wTc, atol=1e-6)
    for file, camera in zip(files, true(capture), strict=True):
        u, v = project(camera, np.array(places["wrong"], float))[0]
        file.write_text(file.read_text() + f"{walk},1,wrong,{u},{v},-0.5,0.5,0.5\n")
    found, _, _ = worlds.reference_run(capture, first, marks=files, world="from_marks")
    assert found[0][:2] == ("warning", "reference_world") and "wrong is furthest off, by " in found[0][2]
    with pytest.raises(DiorError, match="from_marks` needs 3 points"):
        worlds.reference_run(capture, first, world="from_marks")


def test_without_a_walk_nothing_but_the_yaml_tells_the_errors(capture, tmp_path):
    session = worlds.outdoors(capture)
    name = capture.project.close(session)[0]

    def run(**keys):
        files = worlds.referenced(capture, session, **keys)[:1]
        reference.run(
            session=session, cameras=[capture.made("referenced", f"{session}/{name}")], camera_files=files,
            marks=[], marked=[],
            walk=reference.WalkFiles("", "", None, None, None, None), choices=reference.Choices(0.3, 15.0, 2.5),
            out=tmp_path / "out.parquet", out_covariance=tmp_path / "covariance.parquet",
            findings=tmp_path / "findings.parquet",
        )  # fmt: skip
        return tables.read(tmp_path / "findings.parquet", "findings")

    found = run()
    assert found["code"].tolist() == ["reference_uncertainty_unknown"] and "reference.sigma_m" in found["text"][0]
    assert found["scope"].tolist() == [f"{session}/{name}"] and found["severity"].tolist() == ["warning"]
    unknown = camera_tables.read_camera_covariance(tmp_path / "covariance.parquet", [name], with_lenses=True)
    assert np.isnan(unknown).all()
    assert not len(run(sigma_m=0.01, sigma_deg=0.1)["code"])
    known = camera_tables.read_camera_covariance(tmp_path / "covariance.parquet", [name], with_lenses=True)
    np.testing.assert_allclose(np.sqrt(np.diag(known))[[0, 5]], (np.radians(0.1), 0.01))
    with pytest.raises(DiorError, match="from_walk` needs an outdoor walk"):
        run(world="from_walk")


def test_a_way_is_as_long_as_what_is_known_of_it():
    assert reference.extent(np.array([np.nan, 1.0, -2.0, np.nan, 0.5])) == 3.0
    assert reference.extent(np.full(3, np.nan)) == 0.0


@pytest.mark.slow
def test_a_world_of_a_short_walk_is_warned_of(capture, monkeypatch):
    monkeypatch.setattr(reference, "LEAST_WAY_M", 100.0)
    found, _, _ = worlds.reference_run(capture, KINDS["camera 0"][0], world="from_walk")
    assert found[0][:2] == ("warning", "reference_world") and "lean of the body" in found[0][2]


def test_one_sigma_of_the_yaml_goes_before_the_walks():
    walk = PoseErrors(0.01, 0.02)
    assert reference.errors_of({"sigma_m": 0.5}, walk) == PoseErrors(0.01, 0.5)
    assert reference.errors_of({"sigma_m": 0.5}, None) is None and reference.errors_of({}, walk) == walk
