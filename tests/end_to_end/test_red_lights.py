"""A capture with one wrong pose, through the workflow: what its red light says is wrong is not released as good."""

import json
import re

import numpy as np
import pytest

from benchmarks import worlds
from dior.cli import main
from dior.geometry import covariance
from dior.release import layout
from dior.simulate import config, scene, settings
from dior.tables import tables
from tests.end_to_end.workflow import planned, snakemake

SMALL = {
    "subjects": 1, "sequences": 1, "duration_s": 5.0, "width": 640, "height": 360, "fx": 320.0, "gallery": False,
    "environments": ["outdoor"],
}  # fmt: skip
NAMES = ("cam01", "cam02", "cam03", "cam04")
WHY = "labels drawn over the pictures lie on the body (A. Person)"


def write(folder, axis):
    """A project whose close cameras stand where somebody's calibration says, cam02 turned by 3 degrees about an axis of
    its own. About these axes the views agree well enough for labels to be made."""
    made = settings.from_dict(SMALL)
    config.write(made, folder / "config")
    close = [one.camera for one in scene.cameras_of(made, "field").values() if one.camera.role == "close"]
    turn = np.radians(3) * np.array(axis) / np.linalg.norm(axis)
    turned = [covariance.moved(one, np.r_[turn, 0, 0, 0]) if one.name == "cam02" else one for one in close]
    data = folder / "results/simulate"
    data.mkdir(parents=True)
    (data / "calibration.toml").write_text(worlds.calibration(turned))
    for name in NAMES[:3]:
        path = folder / f"config/sessions/field/{name}.yaml"
        placed = f"{{file: calibration.toml, name: {name}, convention: cTw, sigma_m: 0.005, sigma_deg: 0.1}}"
        path.write_text(path.read_text().replace("locate: tape", "locate: reference") + f"reference: {placed}\n")
    path = folder / "config/sessions/field/session.yaml"
    path.write_text(re.sub(r"adjust:.*(\n  .*)*", "adjust: {}", path.read_text()))
    snakemake(folder, "release")
    return folder


def labels(folder, where="results/release/dior-0.1.0/labels_2d/*"):
    found = {name: next(folder.glob(f"{where}/outdoor_01.{name}.parquet")) for name in NAMES}
    return {name: tables.read(path, "labels_2d") for name, path in found.items()}


def suspect(table):
    return set(table["status"]) <= {"suspect", "missing_3d"} and np.isnan(table["u"]).all()


def verified(folder):
    return main.main(["verify", str(folder / "results/release/dior-0.1.0")]) == 0


@pytest.mark.slow
def test_a_wrong_pose_is_not_released_as_good(tmp_path):
    folder = write(tmp_path, (1.0, 0.0, 2.0))
    made = labels(folder, "results/reproject")
    assert all(np.isfinite(table["u"]).mean() > 0.95 for table in made.values()), "a lab sees its numbers"
    released = labels(folder)
    assert [name for name in NAMES if suspect(released[name])] == ["cam02"]
    for name in set(NAMES) - {"cam02"}:
        np.testing.assert_array_equal(released[name]["u"], made[name]["u"])
    assert verified(folder)
    session = folder / "config/sessions/field/session.yaml"
    session.write_text(session.read_text() + f'labels_accepted: {{outdoor_01/cam02: "{WHY}"}}\n')
    assert set(planned(folder, "release")) <= {"package", "exports", "tarballs", "release"}
    snakemake(folder, "release")
    np.testing.assert_array_equal(labels(folder)["cam02"]["u"], made["cam02"]["u"])
    out = folder / "results/release/dior-0.1.0"
    (row,) = layout.rows_of(tables.read(out / "lights.parquet", "released_lights"))
    assert (row["camera"], row["accepted"]) == ("cam02", WHY) and "does not belong to the other cameras" in row[
        "reason"
    ]
    assert WHY in (out / "README.md").read_text()
    assert json.loads((out / "provenance.json").read_text())["sequences"]["outdoor_01"]["accepted"] == {"cam02": WHY}
    assert verified(folder)


@pytest.mark.slow
def test_where_nobody_can_tell_which_pose_it_is_all_of_it_is_in_doubt(tmp_path):
    folder = write(tmp_path, (0.0, 1.0, 1.0))
    assert all(np.isfinite(table["u"]).mean() > 0.95 for table in labels(folder, "results/reproject").values())
    assert all(map(suspect, labels(folder).values()))
    out = folder / "results/release/dior-0.1.0"
    (points,) = out.glob("skeletons_3d/*/*.parquet")
    assert np.isnan(tables.read(points, "skeletons_3d")["x"]).all()
    assert not [one for one in (out.with_name(f"{out.name}-exports") / "coco").glob("*.json")
                if json.loads(one.read_text())["annotations"]]  # fmt: skip
    assert verified(folder)
