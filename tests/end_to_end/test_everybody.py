"""The whole workflow on a tiny simulated capture with a second person, where all people are asked for."""

import json

import numpy as np
import pytest

from dior.label import people
from dior.simulate import config as simulated
from dior.simulate import settings
from dior.tables import tables
from tests.end_to_end.test_tiny import TINY
from tests.end_to_end.workflow import edit, planned, snakemake

pytestmark = pytest.mark.slow

# somebody who stands beside the walkway for a part of the time, and a detector that finds both
TWO = {
    "duration_s": 4.0, "environments": ["outdoor"], "gallery": False, "bystander": 0.6, "detector": {"everybody": True},
}  # fmt: skip
NAME, CLOSE, CAMERAS = "outdoor_01", ("cam01", "cam02", "cam03"), ("cam01", "cam02", "cam03", "cam04")


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    """A finished run with a release, of all people."""
    folder = tmp_path_factory.mktemp("everybody")
    simulated.write(settings.from_dict(TINY | TWO), folder / "config")
    assert "people" not in planned(folder, "all", "release")
    edit(folder / "config/config.yaml", "\npeople: subject\n", "\npeople: all\n")
    assert planned(folder, "all", "release")["people"] == 1
    snakemake(folder, "all", "release")
    return folder


def tables_of(folder):
    """`people_3d` and `people_2d`."""
    return (
        tables.read(folder / f"results/people/{NAME}.parquet", "people_3d"),
        tables.read(folder / f"results/people/{NAME}.labels.parquet", "people_2d"),
    )


def true(folder, name):
    return tables.read(folder / f"results/simulate/truth/{NAME}/{name}.parquet", name.removeprefix("second_"))


def test_both_are_labelled_each_where_the_truth_has_them(project):
    body, labels = tables_of(project)
    assert sorted(set(body["person"])) == sorted(set(labels["person"])) == ["person_1", "person_2"]
    second_px = {}
    for number, (word, name) in enumerate((("yes", ""), ("no", "second_"))):
        mine = people.of_person(body, number)
        assert set(mine["is_subject"]) == {word}
        there, _ = tables.grid(true(project, f"{name}skeletons_3d"), "x", "y", "z")
        found, _ = tables.grid(mine, "x", "y", "z")
        count = min(len(found), len(there))
        off = np.linalg.norm(found[:count] - there[:count], axis=-1)
        assert np.nanmean(off) < 0.08 and np.nanmax(off) < 0.5
        assert np.isfinite(off).sum() > 0.95 * np.isfinite(there[:count, :, 0]).sum()
        for camera in CAMERAS:
            uv, _ = tables.grid(tables.of_camera(people.of_person(labels, number), camera), "u", "v")
            true_uv, _ = tables.grid(tables.of_camera(true(project, f"{name}labels_2d"), camera), "u", "v")
            second_px[word, camera] = np.nanmean(np.linalg.norm(uv - true_uv, axis=-1))
    assert max(second_px.values()) < 1.5, second_px


def test_the_subjects_rows_are_those_of_the_labels(project):
    body, labels = tables_of(project)
    own = tables.read(project / f"results/refine/{NAME}.parquet", "skeletons_3d")
    for key in people.BODY:
        np.testing.assert_array_equal(people.of_person(body, 0)[key], own[key])
    for camera in CAMERAS:
        table = tables.read(project / f"results/reproject/{NAME}.{camera}.parquet", "labels_2d")
        mine = tables.of_camera(people.of_person(labels, 0), camera)
        for key in set(table) - {"subject"}:
            np.testing.assert_array_equal(mine[key], table[key])


def test_what_is_found_is_in_the_report(project):
    assert (
        "others are labelled: person_2 (not the subject)"
        in (project / f"results/report/sequences/{NAME}.html").read_text()
    )


def test_the_other_head_is_covered_in_every_released_picture_and_no_label_of_theirs_is_released(project):
    release = project / "results/release/dior-0.1.0"
    body, labels = tables_of(project)
    files = [path for path in release.rglob("*.parquet")]
    assert len(files) > 10 and not [path for path in files if "people" in path.name]
    shown = 0
    for camera in CAMERAS:
        (path,) = release.glob(f"covers/*/{NAME}.{camera}.parquet")
        covers, frames = (
            tables.read(path, "released_covers"),
            tables.read(release / "frames" / path.parent.name / path.name, "released_frames", ["frame", "no_image"]),
        )
        other = tables.rows(covers, covers["what"] == "other")
        # the middle between the ears, of the truth
        truth = tables.of_camera(true(project, "second_labels_2d"), camera)
        uv, joints = tables.grid(truth, "u", "v")
        ears = uv[:, [joints.index("left_ear"), joints.index("right_ear")]].mean(axis=1)
        labelled, names = tables.grid(tables.of_camera(people.of_person(labels, 1), camera), "u", "v")
        known = np.isfinite(labelled[:, names.index("nose"), 0])
        for frame in frames["frame"][frames["no_image"] == ""].tolist():
            u, v = ears[frame]
            if not known[frame] or not (0 <= u < 640 and 0 <= v < 360):
                continue
            mine = tables.rows(other, other["frame"] == frame)
            held = (mine["u_min"] < u) & (u < mine["u_max"]) & (mine["v_min"] < v) & (v < mine["v_max"])
            assert held.any(), (camera, frame)
            shown += 1
    assert shown > 50


def test_a_release_of_all_people_names_the_step_that_shaped_it(project):
    made_of = json.loads((project / "results/release/dior-0.1.0/provenance.json").read_text())
    assert made_of["config"]["people"] == "all" and "label.people" in made_of["code"]
