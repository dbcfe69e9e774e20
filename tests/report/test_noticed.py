"""What went wrong has words of its own: a swapped detector, a failed sequence, a missing camera, a high error."""

import re
import shutil
from types import SimpleNamespace

import numpy as np
import pytest

from dior.reconstruct import triangulate
from dior.report import lights
from dior.report import report as page
from dior.tables import tables
from tests.report.conftest import SEQUENCES
from tests.report.test_report import audited, counted

CAMERAS = {"walk_1": ["cam01", "cam02"], "walk_2": ["cam01", "cam02"], "walk_3": ["cam01", "cam02"]}
OUTDOOR = dict.fromkeys(CAMERAS, "outdoor")


def row(metric, sequence, camera="", value=1.0, role="close"):
    return {"metric": metric, "sequence": sequence, "camera": camera, "role": role, "joint": "", "value": value}


def labelled(*left_out):
    return [row("coverage", s, c) for s, names in CAMERAS.items() for c in names if (s, c) not in left_out]


def codes(found):
    return [(scope, severity, code) for scope, severity, code, _ in found]


def test_nothing_is_said_of_what_is_there():
    errors = [row("reprojection_error", name, value=value) for name, value in zip(CAMERAS, (3, 4, 5), strict=True)]
    assert lights.noticed(CAMERAS, {name: set(CAMERAS[name]) for name in CAMERAS}, labelled() + errors, OUTDOOR) == []


def test_a_failed_sequence():
    found = lights.noticed(CAMERAS, {}, labelled(("walk_2", "cam01"), ("walk_2", "cam02")), OUTDOOR)
    assert codes(found) == [("walk_2", "error", "sequence_failed")] and "exclude_reason" in found[0][3]


def test_a_missing_camera():
    found = lights.noticed(CAMERAS, {"walk_1": {"cam01"}}, labelled(("walk_1", "cam02")), OUTDOOR)
    assert codes(found) == [("walk_1/cam02", "error", "camera_missing")] and "no picture of it" in found[0][3]


@pytest.mark.parametrize(("value", "stands_out"), [(7.9, False), (8.1, True)])
def test_high_error_is_one_of_a_sequence_among_others(value, stands_out):
    errors = [row("reprojection_error", name, value=e) for name, e in zip(CAMERAS, (3, 5, value), strict=True)]
    found = lights.noticed(CAMERAS, {}, labelled() + errors, OUTDOOR)
    assert codes(found) == ([("walk_3", "warning", "high_error")] if stands_out else [])
    assert not stands_out or "labels are 8.10 px from the detections, where those of the other" in found[0][3]
    # two walks are too few to say which one is wrong
    assert lights.noticed(CAMERAS, {}, labelled() + errors[1:], OUTDOOR) == []


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
    for path in sorted((report / "sequences").glob("*.html")):
        text = path.read_text().split("<h2>Findings</h2>")[0]
        head, *cells = text.split('<div class="cell ')
        words = {re.search(r"</span> (\w+) <small>", cell)[1]: cell for cell in cells}
        found[path.stem] = SimpleNamespace(head=head, cells=words)
    return found


def without_camera(path, name, camera):
    table = tables.read(path, name)
    tables.write(path, name, tables.rows(table, table["camera"] != camera))


@pytest.mark.slow
def test_the_page_has_the_words_of_each(capture, tmp_path):
    """indoor_01 failed; outdoor_01 lacks cam03, and cam02's detector is swapped; outdoor_02 has a high error."""
    originals = audited(capture)
    files = dict(originals)
    for kind, name in (("audits", "stamp_audit"), ("dropped", "dropped_frames"), ("frames", "frames")):
        (tmp_path / kind).mkdir()
        files[kind] = [tmp_path / kind / path.name for path in files[kind] if "indoor" not in path.name]
        for path in originals[kind]:
            shutil.copy(path, tmp_path / kind)
        without_camera(next(path for path in files[kind] if "outdoor_01" in path.name), name, "cam03")
    frame_metrics = [path for path in capture.frame_metrics if "indoor_01" not in path.name]
    lines = capture.metrics.read_text().splitlines()
    kept = [lines[0]]
    for line in lines[1:]:
        cells = dict(zip(lines[0].split(","), line.split(","), strict=True))
        if cells["sequence"] == "indoor_01" or (cells["sequence"], cells["camera"]) == ("outdoor_01", "cam03"):
            continue
        if cells["metric"] == "reprojection_error" and cells["sequence"] == "outdoor_02":
            cells["value"] = "41.5"
        kept.append(",".join(cells.values()))
    (tmp_path / "metrics.csv").write_text("\n".join(kept) + "\n")
    findings = tmp_path / "findings.parquet"
    swapped = np.repeat([[False], [True]], 90, axis=1)
    found = triangulate._findings("outdoor_01", ["cam01", "cam02"], swapped, np.full((90, 33), "ok"))
    tables.write_findings(findings, found)
    page.run(
        root=capture.root,
        title="What went wrong",
        evaluated=page.Evaluated(
            metrics=tmp_path / "metrics.csv",
            frame_metrics=frame_metrics,
            quantiles=[path for path in capture.quantiles if "indoor_01" not in path.name],
            statistics=counted(capture),
            recognition=[],
        ),
        findings=[findings],
        scene=page.Scene(
            cameras=capture.cameras,
            covariances=capture.covariances,
            turns=capture.turns,
            skeletons=[path for path in capture.skeletons if "indoor_01" not in path.name],
        ),
        times=page.Times(**files, clocks=capture.clocks, clock_costs=capture.clock_costs),
        media=page.Media(overlays=[], clips=[], scenes=[]),
        effort=None,
        out=tmp_path / "report",
        out_timing=tmp_path / "timing.csv",
    )
    told = cards(tmp_path / "report")
    assert set(told) == {name for name, _, _ in SEQUENCES}
    assert "the sequence failed: none of its cameras has labels" in told["indoor_01"].head
    assert "the detector is swapped: left and right exchanged at 90 of 90" in told["outdoor_01"].cells["cam02"]
    assert "the camera is missing" in told["outdoor_01"].cells["cam03"]
    assert "labels are 41.5 px from the detections (limit" in told["outdoor_02"].cells["cam01"]
    index = (tmp_path / "report/index.html").read_text()
    assert "the sequence failed" in index and "the camera is missing" in index
    for words, places in (("the sequence failed", 1), ("detector is swapped", 1), ("camera is missing", 1)):
        assert sum(words in cell for c in told.values() for cell in (c.head, *c.cells.values())) == places
