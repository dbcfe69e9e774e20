"""The real detections, written again by hand in each format that has their joints: the same table."""

from functools import partial

import numpy as np
import pytest

from dior.body.names import BODY_25B, COCO_17, HALPE_26, MLKIT_33, WHOLEBODY_133
from dior.ingest.readers import mlkit, openpose
from dior.tables import tables
from tests.ingest import formats
from tests.ingest.test_detections import CAMERAS, run_real

# writer, joints it writes, whether it has scores
OF_OPENPOSE = {
    "openpose of 17": (formats.pose2sim, COCO_17, True),
    "openpose of 26": (formats.pose2sim, HALPE_26, True),
    "openpose of 133": (formats.pose2sim, WHOLEBODY_133, True),
    "mmpose, pictures": (formats.mmpose, COCO_17, True),
    "mmpose, video": (formats.mmpose_video, HALPE_26, True),
    "mmpose, demo": (formats.mmpose_demo, HALPE_26, True),
    "yolo, pictures": (formats.yolo_json, COCO_17, True),
    "yolo, list": (formats.yolo_json_list, COCO_17, True),
    "yolo, validated": (formats.yolo_validated, COCO_17, True),
    "deeplabcut": (partial(formats.deeplabcut, names=BODY_25B), BODY_25B, True),
    "caliscope": (formats.caliscope, HALPE_26, False),
}


def written_again(tmp_path, people, writer, joints):
    """What `detections` names: of each camera the people of dict camera -> `People`, missing joints being NaN."""
    for camera, mine in people.items():
        found = {int(frame): [] for frame in mine.ran}
        there = [mine.joints.index(joint) if joint in mine.joints else -1 for joint in joints]
        points = np.concatenate([mine.uv, mine.score[..., None]], axis=-1)
        points[np.isnan(points[..., 0])] = np.nan
        points = np.concatenate([points, np.full((len(points), 1, 3), np.nan)], axis=1)[:, there]
        for frame, one in zip(mine.frame.tolist(), points, strict=True):
            found[frame].append(one)
        path = writer(tmp_path / camera, found)
    return tmp_path / "{camera}" / path.name


def grid(table, joints, *columns):
    found, names = tables.grid(table, *columns)
    return found[:, [names.index(joint) for joint in joints]]


@pytest.mark.parametrize("name", OF_OPENPOSE)
def test_real_openpose(shared, tmp_path, name):
    folder = shared / "real_outdoor" / "openpose_single"
    writer, joints, scored = OF_OPENPOSE[name]
    people = {camera: openpose.read(folder / camera) for camera in CAMERAS}
    expected, _ = run_real(shared, tmp_path, folder / "{camera}")
    table, findings = run_real(shared, tmp_path, written_again(tmp_path, people, writer, joints))
    shared_joints = [joint for joint in joints if joint in BODY_25B]
    a, b = (grid(one, shared_joints, "u", "v", *["score"] * scored) for one in (table, expected))
    np.testing.assert_allclose(a, b, atol=2e-4)
    assert np.isfinite(a).any(axis=(0, 2)).all()
    # the picture of cam03 in which there is nobody
    silent = name in ("yolo, validated", "caliscope")
    (text,) = findings["text"]
    assert text.startswith(
        "cam03: the detector was not run on 1" if silent else "cam03: the detector found nobody in 1"
    )


def test_real_mlkit_as_deeplabcut(shared, tmp_path):
    files = {camera: shared / "real_outdoor" / "mlkit" / f"{camera}.jsonl" for camera in CAMERAS}
    people = {camera: mlkit.read(path) for camera, path in files.items()}
    expected, _ = run_real(shared, tmp_path, shared / "real_outdoor" / "mlkit" / "{camera}.jsonl")
    pattern = written_again(tmp_path, people, partial(formats.deeplabcut, names=MLKIT_33), MLKIT_33)
    table, _ = run_real(shared, tmp_path, pattern)
    for key in ("joint", "frame", "person", "stamp_ns"):
        np.testing.assert_array_equal(table[key], expected[key])
    for key in ("u", "v", "score"):
        np.testing.assert_array_equal(table[key], expected[key])
