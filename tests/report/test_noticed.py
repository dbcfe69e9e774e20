"""What went wrong has words of its own: a swapped detector, a failed sequence, a missing camera, a high error."""

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from dior.reconstruct import triangulate
from dior.report import lights
from dior.tables import tables
from tests.report.conftest import SEQUENCES
from tests.report.test_report import pages_of, write

CAMERAS = ["cam01", "cam02"]
WALKS = ("walk_1", "walk_2", "walk_3")
OUTDOOR = dict.fromkeys(WALKS, "outdoor")


def row(metric, sequence, camera="", value=1.0, role="close"):
    return {"metric": metric, "sequence": sequence, "camera": camera, "role": role, "joint": "", "value": value}


def codes(found):
    return [(scope, severity, code) for scope, severity, code, _ in found]


def test_nothing_is_said_of_what_is_there():
    errors = [row("reprojection_error", name, value=value) for name, value in zip(WALKS, (3, 4, 5), strict=True)]
    assert lights.noticed("walk_1", CAMERAS, CAMERAS, CAMERAS) == lights.standing_out(errors, OUTDOOR) == []


def test_a_failed_sequence():
    found = lights.noticed("walk_2", CAMERAS, CAMERAS, [])
    assert codes(found) == [("walk_2", "error", "sequence_failed")] and "exclude_reason" in found[0][3]


def test_a_missing_camera():
    found = lights.noticed("walk_1", CAMERAS, {"cam01"}, {"cam01"})
    assert codes(found) == [("walk_1/cam02", "error", "camera_missing")] and "no picture of it" in found[0][3]


@pytest.mark.parametrize(("value", "stands_out"), [(7.9, False), (8.1, True)])
def test_high_error_is_one_of_a_sequence_among_others(value, stands_out):
    errors = [row("reprojection_error", name, value=e) for name, e in zip(WALKS, (3, 5, value), strict=True)]
    found = lights.standing_out(errors, OUTDOOR)
    assert codes(found) == ([("walk_3", "warning", "high_error")] if stands_out else [])
    assert not stands_out or "labels are 8.10 px from the detections, where those of the other" in found[0][3]
    # two walks are too few to say which one is wrong
    assert lights.standing_out(errors[1:], OUTDOOR) == []


@pytest.mark.parametrize(
    ("share", "finding"),
    [(0.0, []), (0.3, [("walk/cam02", "info", "left_right_swapped")]),
     (0.9, [("walk/cam02", "warning", "detector_swapped")])],
)  # fmt: skip
def test_a_swapped_detector(share, finding):
    swapped = np.zeros((2, 100), bool)
    swapped[1, : int(100 * share)] = True
    found = triangulate._findings("walk", ["cam01", "cam02"], swapped, np.full((100, 33), "ok"))
    assert codes(found) == finding
    assert share < 0.5 or "the detector is swapped: left and right exchanged at 90 of 100 instants" in found[0][3]


def cards(report):
    """What the pages of a report say: by sequence the words above its cameras, and those of each camera."""
    found = {}
    for path in sorted((report / "sequences").glob("*[0-9].html")):
        text = path.read_text().split("<h2>Findings</h2>")[0]
        head, *cells = text.split('<div class="cell ')
        words = {re.search(r"</span> (\w+) <small>", cell)[1]: cell for cell in cells}
        found[path.stem] = SimpleNamespace(head=head, cells=words)
    return found


def changed(tmp_path, name, table, keep):
    """A copy of a table with the rows that are kept."""
    path = tmp_path / name / table.name
    rows = tables.read(table, name)
    tables.write(path, name, tables.rows(rows, keep(rows)))
    return path


@pytest.mark.slow
def test_the_page_has_the_words_of_each(capture, tmp_path):
    """indoor_01 failed; outdoor_01 lacks cam03, and cam02's detector is swapped; outdoor_02 has a high error."""
    out, pages = tmp_path / "report", pages_of(capture, tmp_path / "report")
    failed, lacking, high = (pages[name] for name in ("indoor_01", "outdoor_01", "outdoor_02"))
    nothing = lambda rows: np.zeros(len(rows["camera"]), bool)  # noqa: E731
    without = lambda rows: rows["camera"] != "cam03"  # noqa: E731
    for own, keep in ((failed, nothing), (lacking, without)):
        own["measured"] = replace(
            own["measured"],
            metrics=changed(tmp_path, "metrics", own["measured"].metrics, keep),
            frame_metrics=changed(tmp_path, "frame_metrics", own["measured"].frame_metrics, keep),
        )
    kinds = {"audit": "stamp_audit", "dropped": "dropped_frames", "frames": "frames"}
    lacking["times"] = replace(
        lacking["times"],
        **{kind: changed(tmp_path, name, getattr(lacking["times"], kind), without) for kind, name in kinds.items()},
    )
    far = tables.read(high["measured"].metrics, "metrics")
    far["value"] = np.where(far["metric"] == "reprojection_error", 41.5, far["value"])
    tables.write(tmp_path / "far.parquet", "metrics", far)
    high["measured"] = replace(high["measured"], metrics=tmp_path / "far.parquet")
    swapped = np.repeat([[False], [True]], 90, axis=1)
    found = triangulate._findings("outdoor_01", ["cam01", "cam02"], swapped, np.full((90, 33), "ok"))
    tables.write_findings(tmp_path / "findings.parquet", found)
    lacking["findings"] = [tmp_path / "findings.parquet"]
    write(capture, out, pages)
    told = cards(out)
    assert set(told) == {name for name, _, _ in SEQUENCES}
    assert "the sequence failed: none of its cameras has labels" in told["indoor_01"].head
    assert "the detector is swapped: left and right exchanged at 90 of 90" in told["outdoor_01"].cells["cam02"]
    assert "the camera is missing" in told["outdoor_01"].cells["cam03"]
    assert "labels are 41.5 px from the detections (limit" in told["outdoor_02"].cells["cam01"]
    index = (out / "index.html").read_text()
    assert "the sequence failed" in index and "the camera is missing" in index
    for words, places in (("the sequence failed", 1), ("detector is swapped", 1), ("camera is missing", 1)):
        assert sum(words in cell for c in told.values() for cell in (c.head, *c.cells.values())) == places
