"""Files written here as the tools write them, and the real ones."""

import json
import shutil

import numpy as np
import pytest

from dior.body.names import BODY_25, BODY_25B, COCO_18, MLKIT_33
from dior.errors import DiorError
from dior.ingest import detections, on_pictures
from dior.ingest.readers import mlkit, openpose
from dior.tables import tables

T0 = 1_708_000_000_000_000_000
PERIOD = 33_333_333
# where a standing body's joints are, px; the front view of somebody 170 px tall
PLACES = {
    "nose": (0, 10), "neck": (0, 30), "head": (0, 0), "eye": (4, 7), "ear": (8, 9), "shoulder": (20, 30),
    "elbow": (25, 60), "wrist": (27, 88), "hip": (12, 90), "mid_hip": (0, 90), "knee": (13, 130), "ankle": (13, 165),
    "big_toe": (15, 172), "small_toe": (18, 172), "heel": (13, 170),
}  # fmt: skip


def stamp(frame):
    return T0 + PERIOD * frame


def body(joints, middle=(300.0, 100.0), scale=1.0):
    """Joints (J, 2) of the standing body; the subject's right is on the left of the picture."""
    places = []
    for joint in joints:
        side, _, part = joint.partition("_")
        u, v = PLACES[part] if side in ("left", "right") else PLACES[joint]
        places.append((-u if side == "right" else u, v))
    return scale * np.array(places, float) + middle


def person(joints, score=0.5, **kwargs):
    points = np.column_stack([body(joints, **kwargs), np.full(len(joints), score)])
    return {"person_id": [-1], "pose_keypoints_2d": points.ravel().tolist(), "face_keypoints_2d": []}


def landmarks(u=100.0):
    return [
        {"type": i, "x": u + i, "y": 200.0 + 3 * i, "z": -1.0, "inFrameLikelihood": 0.5 + i / 100} for i in range(33)
    ]


def line(frame, found=None, **kwargs):
    found = landmarks() if found is None else found
    return json.dumps({"frame": frame, "stamp_ns": stamp(frame), "landmarks": found} | kwargs)


def write_lines(path, lines):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(lines) + "\n")


def write_openpose(folder, files):
    """`files`: name -> people."""
    folder.mkdir(parents=True)
    for name, found in files.items():
        (folder / name).write_text(json.dumps({"version": 1.3, "people": found}))


def run(tmp_path, pattern, cameras=("cam01",), format="auto", count=5, how=None, **columns):
    frame = np.tile(np.arange(count), len(cameras))
    tables.write(tmp_path / "frames.parquet", "frames", {
        "camera": np.repeat(np.array(cameras, object), count), "frame": frame, "stamp_ns": stamp(frame),
    } | columns)  # fmt: skip
    detections.run(
        sequence="walk", pattern=str(tmp_path / pattern), cameras=list(cameras), format=format,
        frames=tmp_path / "frames.parquet", out=tmp_path / "out.parquet", findings=tmp_path / "out.findings.parquet",
        **({"looked_at": []} | (how or {})),
    )  # fmt: skip
    found = tables.read(tmp_path / "out.findings.parquet", "findings")
    return tables.read(tmp_path / "out.parquet", "detections"), dict(zip(found["code"], found["text"], strict=True))


def test_mlkit_table_is_complete_and_sorted(tmp_path):
    for camera in ("cam02", "cam01"):
        write_lines(tmp_path / f"{camera}.jsonl", [line(3), line(0), line(1, []), line(4)])
    table, findings = run(tmp_path, "{camera}.jsonl", ("cam02", "cam01"))
    assert len(table["u"]) == 2 * 5 * 33
    assert tables.ordered_unique(table["camera"]) == ["cam01", "cam02"]
    grid, joints = tables.grid(tables.of_camera(table, "cam01"), "u", "v", "score", "person", "stamp_ns")
    assert tuple(joints) == MLKIT_33
    for frame in (0, 3, 4):
        np.testing.assert_allclose(grid[frame, :, 0], 100 + np.arange(33), rtol=1e-6)
        np.testing.assert_allclose(grid[frame, :, 1], 200 + 3 * np.arange(33), rtol=1e-6)
        np.testing.assert_allclose(grid[frame, :, 2], 0.5 + np.arange(33) / 100, rtol=1e-6)
        assert (grid[frame, :, 3] == 0).all()
    for frame in (1, 2):
        assert np.isnan(grid[frame, :, :3]).all() and (grid[frame, :, 3] == -1).all()
    assert table["stamp_ns"].reshape(2, 5, 33)[1, :, 7].tolist() == [stamp(frame) for frame in range(5)]
    assert "found nobody in 1 of 5 frames" in findings["nobody_found"]
    assert "not run on 1 of 5 frames" in findings["detector_not_run"]


def test_mlkit_landmarks_are_placed_by_type_and_missing_ones_are_null(tmp_path):
    some = list(reversed(landmarks()))[:30]
    write_lines(tmp_path / "cam01.jsonl", [line(0, some)])
    table, _ = run(tmp_path, "{camera}.jsonl")
    grid, _ = tables.grid(table, "u", "score")
    np.testing.assert_allclose(grid[0, 3:, 0], 103 + np.arange(30), rtol=1e-6)
    assert np.isnan(grid[0, :3]).all()


def test_same_input_same_bytes(tmp_path):
    write_lines(tmp_path / "cam01.jsonl", [line(frame) for frame in range(5)])
    run(tmp_path, "{camera}.jsonl")
    first = (tmp_path / "out.parquet").read_bytes()
    run(tmp_path, "{camera}.jsonl")
    assert (tmp_path / "out.parquet").read_bytes() == first


@pytest.mark.parametrize("name, joints", [("BODY_25", BODY_25), ("BODY_25B", BODY_25B), ("COCO_18", COCO_18)])
@pytest.mark.parametrize("view", [1.0, 0.2, -0.6])
def test_openpose_models_are_told_apart(tmp_path, name, joints, view):
    """From the front, nearly from the side and from behind."""
    one = person(joints)
    one["pose_keypoints_2d"][::3] = [300 + view * (u - 300) for u in one["pose_keypoints_2d"][::3]]
    one["pose_keypoints_2d"][12:15] = [0, 0, 0]
    write_openpose(tmp_path / "cam01", {f"cam01.{frame:04d}.json": [one] for frame in range(5)})
    table, findings = run(tmp_path, "{camera}")
    grid, found = tables.grid(table, "u", "v", "score")
    assert tuple(found) == joints and findings == {}
    expected = body(joints)
    expected[:, 0] = 300 + view * (expected[:, 0] - 300)
    expected[4] = np.nan
    np.testing.assert_allclose(grid[2, :, :2], expected, rtol=1e-6)
    assert np.isnan(grid[:, 4]).all() and grid[2, 0, 2] == 0.5


def test_openpose_nobody_in_all_its_spellings_and_frame_numbers(tmp_path):
    empty = person(BODY_25)
    empty["pose_keypoints_2d"] = [0] * 75
    files = {
        "run2_000000000004_keypoints.json": [person(BODY_25)],
        "run2_000000000000_keypoints.json": [],
        "run2_000000000001_keypoints.json": [{}],
        "run2_000000000002_keypoints.json": [empty, person(BODY_25)],
    }
    write_openpose(tmp_path / "cam01", files)
    table, findings = run(tmp_path, "{camera}", format="openpose")
    grid, _ = tables.grid(table, "u", "person")
    assert grid[:, 0, 1].tolist() == [-1, -1, 1, -1, 0]
    assert "nobody in 2 of 5" in findings["nobody_found"] and "not run on 1 of 5" in findings["detector_not_run"]


def test_openpose_subject_among_several(tmp_path):
    subject, other = person(BODY_25), person(BODY_25, middle=(700.0, 100.0), scale=0.6, score=0.4)
    files = {f"{frame}.json": [other, subject] if frame % 2 else [subject, other] for frame in range(12)}
    write_openpose(tmp_path / "cam01", files | {"12.json": [other]})
    table, findings = run(tmp_path, "{camera}", count=13)
    grid, _ = tables.grid(table, "person")
    assert grid[:, 0, 0].tolist() == [0, 1] * 6 + [-1]
    assert "more than one person in 12 of 13 frames" in findings["several_people"]
    assert "ambiguous in 0" in findings["several_people"]
    assert "in 1 of 13 frames only somebody else" in findings["subject_left_out"]


def test_detections_that_do_not_lie_on_the_pictures_pass_where_somebody_has_looked(tmp_path, monkeypatch):
    def off(*_):
        raise on_pictures.OffPictures("walk, cam01: the detections fit the pictures when mirrored")

    monkeypatch.setattr(on_pictures, "check", off)
    write_lines(tmp_path / "cam01.jsonl", [line(0), line(1)])
    with pytest.raises(DiorError, match="mirrored. If you have looked and they are right, say so in `detections_ch"):
        run(tmp_path, "{camera}.jsonl", how={"data_root": tmp_path})
    _, findings = run(tmp_path, "{camera}.jsonl", how={"data_root": tmp_path, "looked_at": ["cam01"]})
    assert "mirrored. `detections_checked` lets them pass" in findings["detections_off_pictures"]


def test_missing_file_names_the_path_tried(tmp_path):
    write_lines(tmp_path / "mlkit" / "cam01.jsonl", [line(0)])
    with pytest.raises(DiorError, match=r"walk, cam02: there are no detections at .*mlkit/cam02\.jsonl"):
        run(tmp_path, "mlkit/{camera}.jsonl", ("cam01", "cam02"))


def test_wrong_detector_format(tmp_path):
    write_openpose(tmp_path / "cam01", {"0.json": [person(BODY_25)]})
    with pytest.raises(DiorError, match=r"walk, cam01: the folder .*cam01 is OpenPose output, not mlkit"):
        run(tmp_path, "{camera}", format="mlkit")
    with pytest.raises(DiorError, match=r"walk, cam01: the file .*0\.json is OpenPose output, not mlkit"):
        run(tmp_path, "{camera}/0.json", format="mlkit")
    with pytest.raises(DiorError, match=r"OpenPose output, but `detections` must name the folder"):
        run(tmp_path, "{camera}/0.json")
    write_lines(tmp_path / "cam01.jsonl", [line(0)])
    with pytest.raises(DiorError, match=r"walk, cam01: the file .*cam01\.jsonl is ML Kit output, not openpose"):
        run(tmp_path, "{camera}.jsonl", format="openpose")
    (tmp_path / "cam01.csv").write_text("frame,u,v\n")
    with pytest.raises(DiorError, match="output of none of ML Kit, OpenPose, MediaPipe"):
        run(tmp_path, "{camera}.csv")
    with pytest.raises(DiorError, match=r"cam01\.csv is something else, not mlkit"):
        run(tmp_path, "{camera}.csv", format="mlkit")
    with pytest.raises(DiorError, match=r"'openpos' is not one of .*did you mean 'openpose'"):
        run(tmp_path, "{camera}", format="openpos")


def test_empty_detections(tmp_path):
    write_lines(tmp_path / "cam01.jsonl", [line(frame, []) for frame in range(5)])
    with pytest.raises(DiorError, match=r"walk, cam01: no person found in any of 5 frames .*right camera and format"):
        run(tmp_path, "{camera}.jsonl")
    write_openpose(tmp_path / "cam01", {f"{frame}.json": [{}] for frame in range(3)})
    with pytest.raises(DiorError, match=r"walk, cam01: no person found in any of 3 frames"):
        run(tmp_path, "{camera}")
    (tmp_path / "cam01.jsonl").write_text("\n")
    with pytest.raises(DiorError, match=r"cam01\.jsonl is empty; run the detector"):
        run(tmp_path, "{camera}.jsonl")
    shutil.rmtree(tmp_path / "cam01")
    (tmp_path / "cam01").mkdir()
    with pytest.raises(DiorError, match=r"the folder .* is empty"):
        run(tmp_path, "{camera}", format="openpose")


def test_detections_of_another_recording(tmp_path):
    write_lines(tmp_path / "cam01.jsonl", [line(0), line(3, stamp_ns=stamp(3) + PERIOD)])
    with pytest.raises(DiorError, match=r"walk, cam01: .* gives frame 3 the stamp .* belong to another recording"):
        run(tmp_path, "{camera}.jsonl")
    write_lines(tmp_path / "cam01.jsonl", [line(0), line(3, stamp_ns=stamp(3) + PERIOD // 3)])
    run(tmp_path, "{camera}.jsonl")
    write_lines(tmp_path / "cam01.jsonl", [line(0), line(5)])
    with pytest.raises(DiorError, match=r"walk, cam01: .* has frame 5 but the recording has frames 0 to 4"):
        run(tmp_path, "{camera}.jsonl")


def test_a_detector_has_the_stamps_of_the_headers_also_where_they_were_restored(tmp_path):
    early = {"restored_s": np.where(np.arange(5) == 3, 0.6, np.nan)}
    write_lines(tmp_path / "cam01.jsonl", [line(0), line(3, stamp_ns=stamp(3) - 600_000_000)])
    table, _ = run(tmp_path, "cam01.jsonl", **early)
    assert (table["stamp_ns"][table["frame"] == 3] == stamp(3)).all()
    write_lines(tmp_path / "cam01.jsonl", [line(2, stamp_ns=stamp(2) - 600_000_000)])
    with pytest.raises(DiorError, match="gives frame 2 the stamp"):
        run(tmp_path, "cam01.jsonl", **early)


def test_of_a_video_the_detectors_stamps_may_begin_elsewhere_but_not_go_on_otherwise(tmp_path):
    film = {"topic": ["video0"] * 5}
    write_lines(tmp_path / "cam01.jsonl", [line(i, stamp_ns=stamp(i) + 10**12) for i in range(4)])
    run(tmp_path, "cam01.jsonl", **film)
    with pytest.raises(DiorError, match="gives frame 0 the stamp"):
        run(tmp_path, "cam01.jsonl")
    write_lines(
        tmp_path / "cam01.jsonl",
        [line(i, stamp_ns=stamp(i) + 10**12) for i in (0, 1, 2)] + [line(4, stamp_ns=stamp(2))],
    )
    with pytest.raises(DiorError, match="gives frame 4 the stamp"):
        run(tmp_path, "cam01.jsonl", **film)


@pytest.mark.parametrize(
    "lines, text",
    [
        ([line(0), line(1)[:-30]], "line 2: not the JSON of ML Kit .*interrupted"),
        ([line(0), line(0)], "frame 0 is there twice"),
        ([line(0), '{"stamp_ns": 1, "landmarks": []}'], "line 2 has no 'frame'"),
        ([line(0), '{"frame": 1, "stamp_ns": 1}'], "line 2 has no 'landmarks'"),
        ([line(0, [{"type": 33, "x": 1.0, "y": 2.0, "inFrameLikelihood": 1.0}])], "line 1 has a landmark whose type"),
    ],
)
def test_broken_mlkit_lines(tmp_path, lines, text):
    write_lines(tmp_path / "cam01.jsonl", lines)
    with pytest.raises(DiorError, match=rf"cam01\.jsonl: {text}"):
        mlkit.read(tmp_path / "cam01.jsonl")


@pytest.mark.parametrize(
    "files, text",
    [
        ({"1.json": [person(BODY_25)], "a1.json": []}, "1.json and a1.json are both frame 1"),
        ({"pose.json": [person(BODY_25)]}, "pose.json: the file name holds no frame number"),
        ({"1.json": [person(BODY_25)], "2.json": [person(COCO_18)]}, "2.json: 18 keypoints where .* have 25"),
        ({"1.json": [{"pose_keypoints_2d": [1.0, 2.0, 0.5]}]}, "1.json: 3 numbers per person"),
        ({"1.json": 7}, "1.json: not a JSON file of OpenPose"),
    ],
)
def test_broken_openpose_files(tmp_path, files, text):
    write_openpose(tmp_path / "cam01", files)
    with pytest.raises(DiorError, match=text):
        openpose.read(tmp_path / "cam01")


def test_openpose_with_too_few_points_to_tell_the_model(tmp_path):
    one = person(BODY_25)
    one["pose_keypoints_2d"][3:] = [0] * 72
    write_openpose(tmp_path / "cam01", {"1.json": [one]})
    with pytest.raises(DiorError, match="could be BODY_25 or BODY_25B"):
        openpose.read(tmp_path / "cam01")


CAMERAS = ("cam01", "cam02", "cam03", "cam04")


def run_real(shared, tmp_path, pattern, cameras=CAMERAS):
    frame = np.tile(np.arange(100), len(cameras))
    tables.write(tmp_path / "frames.parquet", "frames", {
        "camera": np.repeat(np.array(cameras, object), 100), "frame": frame,
        "stamp_ns": T0 + np.rint(frame * 1e9 / 60).astype(np.int64),
    })  # fmt: skip
    detections.run(
        looked_at=[], sequence="beam", pattern=str(pattern), cameras=list(cameras), format="auto",
        frames=tmp_path / "frames.parquet", out=tmp_path / "out.parquet", findings=tmp_path / "out.findings.parquet",
    )  # fmt: skip
    findings = tables.read(tmp_path / "out.findings.parquet", "findings")
    return tables.read(tmp_path / "out.parquet", "detections"), findings


def test_real_mlkit_keeps_every_frame(shared, tmp_path):
    table, findings = run_real(shared, tmp_path, shared / "real_outdoor" / "mlkit" / "{camera}.jsonl")
    assert len(table["u"]) == 4 * 100 * 33 and np.isfinite(table["u"]).all()
    assert not len(findings["code"])
    first = json.loads((shared / "real_outdoor/mlkit/cam01.jsonl").read_text().splitlines()[0])["landmarks"]
    np.testing.assert_allclose(table["u"][:33], [one["x"] for one in first], rtol=1e-6)


def test_real_openpose_picks_the_person_that_the_publisher_picked(shared, tmp_path):
    """The people of each file are shuffled first: as published, the right one always comes first.

    cam01 frame 37 holds the subject in two halves; cam03 frame 52 holds somebody whom the publisher left out.
    """
    rng = np.random.default_rng(0)
    for camera in CAMERAS:
        (tmp_path / "shuffled" / camera).mkdir(parents=True)
        for path in sorted((shared / "real_outdoor/openpose" / camera).glob("*.json")):
            content = json.loads(path.read_text())
            content["people"] = [content["people"][i] for i in rng.permutation(len(content["people"]))]
            (tmp_path / "shuffled" / camera / path.name).write_text(json.dumps(content))
    table, findings = run_real(shared, tmp_path, tmp_path / "shuffled" / "{camera}")
    single, of_single = run_real(shared, tmp_path, shared / "real_outdoor/openpose_single/{camera}")
    same = {}
    for camera in CAMERAS:
        a, joints = tables.grid(tables.of_camera(table, camera), "u", "v", "score")
        b, expected = tables.grid(tables.of_camera(single, camera), "u", "v", "score")
        assert tuple(joints) == tuple(expected) == BODY_25B
        same[camera] = sum(np.array_equal(x, y, equal_nan=True) for x, y in zip(a, b, strict=True))
    assert same == {"cam01": 99, "cam02": 100, "cam03": 99, "cam04": 100}
    several = {s: t for s, t in zip(findings["scope"], findings["text"], strict=True) if "more than one" in t}
    assert sorted(several) == ["beam/cam01", "beam/cam02"]
    assert "100 of 100 frames" in several["beam/cam01"] and "ambiguous in 1" in several["beam/cam01"]
    assert of_single["text"].tolist() == ["cam03: the detector found nobody in 1 of 100 frames"]
