"""The step `clocks` on three cameras of an outdoor walk, and what it says where a person or the data contradict."""

import re

import numpy as np
import pytest

from benchmarks import scene
from dior.calibrate import clocks
from dior.clocks import clock as on_axis
from dior.errors import DiorError
from dior.geometry import camera_tables
from dior.tables import tables

T0 = 1_700_000_000_000_000_000
LATE_S = {"cam01": 0.0, "cam02": 0.2, "cam03": -0.1}


@pytest.fixture(scope="module")
def walk(tmp_path_factory):
    """Cameras, frames and detections of a walk; the stamps of cam02 are 0.2 s too small, those of cam03 too large."""
    folder, made = tmp_path_factory.mktemp("walk"), scene.make("ideal", seed=4, frames=240)
    names, count, each = [c.name for c in made.given], len(made.seconds), len(made.names)
    stamps = np.concatenate([T0 + np.round((made.seconds - LATE_S[n]) * 1e9).astype(np.int64) for n in names])
    index = {"camera": np.repeat(np.array(names, object), count), "frame": np.tile(np.arange(count), len(names))}
    size = {"height": np.full(len(stamps), 720), "width": np.full(len(stamps), 1280)}
    tables.write(folder / "frames.parquet", "frames", index | {"stamp_ns": stamps, "receive_ns": stamps} | size)
    uv = made.uv.reshape(-1, 2)
    tables.write(
        folder / "detections.parquet",
        "detections",
        {
            "camera": np.repeat(index["camera"], each),
            "frame": np.repeat(index["frame"], each),
            "stamp_ns": np.repeat(stamps, each),
            "joint": np.tile(np.array(made.names, object), len(stamps)),
            "u": uv[:, 0],
            "v": uv[:, 1],
            "score": np.ones(len(uv)),
        },
    )
    camera_tables.write_cameras(folder / "cameras.parquet", list(made.given), "field")
    camera_tables.write_camera_covariance(folder / "covariance.parquet", names, 1e-10 * np.eye(18), "field")
    return folder


def run(folder, out, by_hand="", detections="detections.parquet", **placed):
    (out / "walk.yaml").write_text(by_hand)
    poses = {"names": list(LATE_S), "covariance": [folder / "covariance.parquet"]} | placed
    clocks.run(
        sequence="walk", placed=clocks.Placed([folder / "cameras.parquet"], **poses),
        detected=clocks.Detected(folder / detections if detections else None, min_score=0.3, max_gap=2.5),
        frames=folder / "frames.parquet", indoors=clocks.Indoors(mocap=None, marked=[]),
        offsets=out / "walk.yaml" if by_hand else None, data_root=folder,
        written=on_axis.ClockFiles(*(out / f"{kind}.parquet" for kind in "cgkf")), out_aside=out / "a.parquet",
    )  # fmt: skip
    found = tables.read(out / "f.parquet", "findings")
    said = {s: (v, c, t) for s, v, c, t in zip(*(found[k] for k in ("scope", "severity", "code", "text")), strict=True)}
    return on_axis.read([out / "c.parquet"], [out / "g.parquet"]), said


def test_every_clock_is_found_and_written(walk, tmp_path):
    found, said = run(walk, tmp_path)
    assert found["cam01"].source == "reference" and "walk/cam01" not in said
    for name in ("cam02", "cam03"):
        clock = found[name]
        error = clock.offset_s + 1e-6 * clock.drift_ppm * clock.middle_s - LATE_S[name]
        assert clock.source == "estimated" and abs(error) < 0.003 and abs(error) < 4 * clock.given[0]
        # both are several pictures off, which somebody wants to know
        severity, code, text = said[f"walk/{name}"]
        assert (severity, code) == ("warning", "clock_off") and "pictures from the reference" in text
    table = tables.read(tmp_path / "c.parquet", "offsets")
    assert (table["sigma_s"][1:] >= table["given_sigma_s"][1:]).all() and table["sigma_s"][0] == 0
    assert set(tables.read(tmp_path / "k.parquet", "clock_costs")["camera"]) == {"cam02", "cam03"}


def test_a_value_by_hand_counts_and_one_that_is_a_picture_wrong_is_named(walk, tmp_path):
    good = "cam03: {offset_s: -0.1, sigma_s: 0.001}\n"
    found, said = run(walk, tmp_path, f"cam02: {{offset_s: {0.2 + 1 / 30:.4f}}}\n" + good)
    assert found["cam02"].source == found["cam03"].source == "manual"
    assert found["cam02"].offset_s == 0.2333 and found["cam03"].given == (0.001, 0.0)
    severity, code, text = said["walk/cam02"]
    assert (severity, code) == ("warning", "clock_contradicts")
    assert re.search(r"is 1\.[01] pictures off: config/offsets/walk.yaml", text)
    assert said["walk/cam03"][:2] == ("info", "clock_found")


def test_without_detections_the_clocks_are_unknown_and_said_to_be(walk, tmp_path):
    found, said = run(walk, tmp_path, detections=None)
    assert found["cam02"].source == "assumed_zero" and np.isnan(found["cam02"].given[0])
    severity, code, text = said["walk/cam02"]
    assert (severity, code) == ("warning", "clock_unknown") and "config/offsets/walk.yaml" in text


def test_a_pose_of_unknown_error_is_said(walk, tmp_path):
    _, said = run(walk, tmp_path, covariance=[])
    assert "if the cameras' poses are right" in said["walk/cam02"][2] and "nan" not in said["walk/cam02"][2]
    assert np.isnan(tables.read(tmp_path / "c.parquet", "offsets")["sigma_s"][1])


def test_wrong_inputs_are_named(walk, tmp_path):
    with pytest.raises(DiorError, match="walk.yaml: 'cam7' is not one of the cameras cam01, cam02, cam03"):
        run(walk, tmp_path, "cam7: {offset_s: 0}\n")
    with pytest.raises(DiorError, match="walk, camera cam09: .* gives no pose of it"):
        run(walk, tmp_path, names=["cam01", "cam09"])


def test_a_clock_by_hand_is_compared_in_the_middle_of_the_recording():
    """Equal at t0, but 100 ppm apart, and after ten minutes 60 ms."""
    found = on_axis.Clock(0.1, 100.0, "estimated", "cameras", 600.0, (0.001, 5.0))
    for drift, code in ((0.0, "clock_contradicts"), (100.0, "clock_found")):
        hand = {"cam02": on_axis.Clock(0.1, drift, "manual", given=(0.0, 0.0))}
        estimates = {"cam02": (found, clocks.NONE, clocks.NONE, "")}
        [(_, _, said, text)] = clocks.findings_of("walk", estimates, hand, [], None, 1 / 30, False)
        assert said == code and (said == "clock_found" or "1.8 pictures off" in text)
