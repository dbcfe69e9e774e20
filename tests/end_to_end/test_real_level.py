"""The whole workflow on a tiny capture of level `real`: nothing crashes, and nothing is invented without a word."""

from collections import Counter

import numpy as np
import pytest

from dior.project import project as projects
from dior.simulate import config as simulated
from dior.simulate import settings
from dior.simulate.clocks import clocks_of
from dior.tables import tables
from tests.end_to_end.results import figure, metrics
from tests.end_to_end.workflow import snakemake

SEQUENCES = {"indoor_01": 39, "outdoor_01": 33}
CAMERAS = ("cam01", "cam02", "cam03", "cam04")
# a picture half as wide, so noise half as large
SETTINGS = {
    "preset": "real", "subjects": 1, "sequences": 1, "duration_s": 5.0, "width": 640, "height": 360, "fx": 320.0,
    "long_range_fx": 380.0, "mark_noise_px": 0.5, "detector": {"noise_sd_px": [1.25, 1.75]},
    "gallery": False, "clocks": {"dropped": 0.03, "duplicated": 0.02},
}  # fmt: skip


pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    folder = tmp_path_factory.mktemp("real_level")
    simulated.write(settings.from_dict(SETTINGS), folder / "config")
    # of half a person 11 px tall nobody can see that it is half, but whoever draws the boxes knows the wall
    camera = folder / "config/sessions/field/cam04.yaml"
    camera.write_text(camera.read_text().replace("fit: range", "fit: range, occluder: below"))
    audits = [f"results/audit/{sequence}.parquet" for sequence in SEQUENCES]
    snakemake(folder, "results/evaluate/metrics.csv", *audits)
    return folder


def test_labels_are_near_the_truth(project):
    rows = metrics(project)
    by_sequence = {"subject": projects.load(project).subject_of("indoor_01"), "role": "close"}
    assert figure(rows, "error_to_truth_2d", sequence="indoor_01", **by_sequence) < 0.4
    assert figure(rows, "error_to_truth_2d", sequence="outdoor_01", **by_sequence) < 3.0
    # measured: 0.42
    assert figure(rows, "error_to_truth_2d", role="long_range") < 0.6
    # the wall hides the legs, which the boxes cannot judge
    share = figure(rows, "in_box_share", role="long_range")
    assert share > 0.95 and share > figure(rows, "in_box_expected", role="long_range") - 0.03


def test_every_label_without_a_pixel_has_its_reason_and_no_other_has(project):
    missing = Counter()
    for sequence, joints in SEQUENCES.items():
        frames = tables.read(project / f"results/frames/{sequence}.parquet", "frames")
        for camera in CAMERAS:
            labels = tables.read(project / f"results/reproject/{sequence}.{camera}.parquet", "labels_2d")
            assert len(labels["frame"]) == joints * (frames["camera"] == camera).sum()
            null = np.isnan(labels["u"]) | np.isnan(labels["v"])
            without = np.isin(labels["status"], ("missing_3d", "behind_camera"))
            assert (null == without).all()
            missing[sequence] += int(null.sum())
    assert all(missing[sequence] > 0 for sequence in SEQUENCES)


def test_every_joint_without_a_place_has_its_reason(project):
    joints = tables.read(project / "results/triangulate/outdoor_01.parquet", "skeletons_3d")
    null = np.isnan(joints["x"])
    assert null.any()
    assert (null == np.isin(joints["status"], ("too_few_views", "rejected"))).all()
    assert (joints["n_views"][joints["status"] == "too_few_views"] < 2).all()


def test_every_detection_that_is_missing_was_missed_or_left_out_with_a_word(project):
    """No picture has a detection that the detector did not give; those left out are counted in the findings."""
    given = tables.read(project / "results/simulate/truth/outdoor_01/detections.parquet", "simulated_detections")
    found = tables.read(project / "results/detections/outdoor_01.parquet", "detections")
    findings = tables.read(project / "results/detections/outdoor_01.findings.parquet", "findings")
    for camera in CAMERAS[:3]:
        nobody = tables.of_camera(given, camera)["missed"].reshape(-1, 33)[:, 0]
        empty = np.isnan(tables.of_camera(found, camera)["u"]).reshape(-1, 33).all(axis=1)
        assert (empty >= nobody).all()
        text = " ".join(findings["text"][np.char.endswith(findings["scope"].astype(str), camera)])
        for count in {int(nobody.sum()), int((empty & ~nobody).sum())} - {0}:
            assert str(count) in text, f"{camera}: {count} is not in: {text}"


def test_every_picture_that_was_lost_or_repeated_is_in_the_audit(project):
    configured = settings.from_dict(SETTINGS)
    counted = Counter()
    for walk in settings.sequences(configured):
        dropped = tables.read(project / f"results/audit/{walk.name}.dropped.parquet", "dropped_frames")
        clocks, _ = clocks_of(configured, walk)
        for camera, clock in clocks.items():
            reasons = Counter(dropped["reason"][dropped["camera"] == camera].tolist())
            lost = (np.rint(np.diff(clock.seconds) * configured.fps) - 1).sum()
            assert reasons["not_sent"] + reasons["recorder_behind"] == lost, (walk.name, camera)
            assert reasons["same_stamp"] == clock.twice.sum(), (walk.name, camera)
            counted += reasons
    assert counted["not_sent"] > 10 and counted["same_stamp"] > 10
