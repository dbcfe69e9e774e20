"""Every format: what was written is what is read, in pixels, recognised or named; and the real samples."""

import json
import shutil

import numpy as np
import pytest

from dior.body.names import COCO_17, HALPE_136, MLKIT_33, WHOLEBODY_133, swap_index
from dior.errors import DiorError
from dior.ingest import detections
from dior.ingest.readers import READERS, alphapose, mediapipe, mlkit, mlkit_csv
from dior.ingest.readers.recognise import recognise
from dior.tables import tables
from tests.ingest import formats
from tests.ingest.formats import HEIGHT, WIDTH, WRITERS, scene

FRAMES = 4
each_writer = pytest.mark.parametrize("writer", WRITERS, ids=lambda writer: writer.__name__)


def run(tmp_path, path, format="auto", count=FRAMES, cameras=("cam01",), first_frame=0, period_ns=1):
    frame = np.tile(np.arange(count), len(cameras))
    columns = {
        "camera": np.repeat(np.array(cameras, object), count), "frame": frame,
        "stamp_ns": 1_708_000_000_000_000_000 + period_ns * frame, "width": np.full(len(frame), WIDTH),
        "height": np.full(len(frame), HEIGHT),
    }  # fmt: skip
    tables.write(tmp_path / "frames.parquet", "frames", columns)
    detections.run(
        looked_at=[],
        sequence="walk", pattern=str(path), cameras=list(cameras), format=format, frames=tmp_path / "frames.parquet",
        out=tmp_path / "out.parquet", findings=tmp_path / "out.findings.parquet", first_frame=first_frame,
    )  # fmt: skip
    found = tables.read(tmp_path / "out.findings.parquet", "findings")
    return tables.read(tmp_path / "out.parquet", "detections"), dict(zip(found["code"], found["text"], strict=True))


@each_writer
def test_what_was_written_is_read(tmp_path, writer):
    name, joints, two, scored = WRITERS[writer]
    found = scene(len(joints))
    path = writer(tmp_path, found)
    assert recognise(path) == name
    reader = READERS[name]
    people = reader.read(path)
    assert people.joints == joints and people.ran.tolist() == [0, 1, 2, 3]
    assert people.frame.tolist() == ([0, 1, 1, 2, 3] if two else [0, 1, 2, 3])
    assert people.person.tolist() == ([0, 0, 1, 0, 0] if two else [0, 0, 0, 0])
    expected = np.array([one for frame in found for one in found[frame][: 1 + two]])
    scale, shift = ((WIDTH, HEIGHT), 0.5) if reader.fractions else (1, 0)
    np.testing.assert_allclose(people.uv * scale - shift, expected[..., :2], atol=1e-5)
    missing = np.isnan(expected[..., 0])
    assert missing.sum() == 1
    np.testing.assert_allclose(people.score[~missing], expected[~missing][:, 2] if scored else 1.0, rtol=1e-6)
    assert (people.score[missing] == 0).all()


@each_writer
def test_the_table_is_in_pixels_whether_recognised_or_named(tmp_path, writer):
    name, joints, two, _ = WRITERS[writer]
    found = scene(len(joints))
    path = writer(tmp_path, found)
    table, findings = run(tmp_path, path)
    named, _ = run(tmp_path, path, name)
    assert all(np.array_equal(table[key], named[key], equal_nan=table[key].dtype.kind == "f") for key in table)
    grid, names = tables.grid(table, "u", "v")
    assert tuple(names) == joints
    expected = np.array([found[frame][0][:, :2] for frame in range(FRAMES)])
    np.testing.assert_allclose(grid, expected, atol=1e-3)
    assert set(findings) == ({"several_people"} if two else set())


@each_writer
def test_a_wrong_guess_is_refused_and_says_what_it_is(tmp_path, writer):
    name, joints, _, _ = WRITERS[writer]
    path = writer(tmp_path, scene(len(joints)))
    for other in READERS:
        if other != name:
            with pytest.raises(
                DiorError, match=rf"walk, cam01: the (file|folder) .* is {READERS[name].tool} output, not"
            ):
                run(tmp_path, path, other)


@pytest.mark.parametrize("count, joints", formats.ALPHAPOSE_COUNTS.items())
@pytest.mark.parametrize("idx", [1, 1.0, [1.0], [[1.0]], None])
def test_alphapose_counts_and_idx(tmp_path, count, joints, idx):
    found = scene(count)
    found[0][0][0, 2] = 1.3
    people = alphapose.read(formats.alphapose(tmp_path, found, idx=idx))
    assert people.joints == joints
    assert people.score[0, 0] == 1.0 and people.score.max() <= 1.0


def test_full_body_names_are_paired():
    for joints in (HALPE_136, WHOLEBODY_133):
        swap = swap_index(joints)
        assert (swap[swap] == np.arange(len(joints))).all() and len(set(joints)) == len(joints)
        in_the_middle = [name for name, other in zip(joints, swap, strict=True) if joints[other] == name]
        assert set(in_the_middle) <= {"nose", "head", "neck", "mid_hip"} | {
            name for name in joints if name[:4] == "face"
        }
        assert sum(name.startswith("face") for name in in_the_middle) == 10


def test_coco_scores_of_one_throughout_give_way_to_the_persons(tmp_path):
    found = scene(17)
    for people in found.values():
        for one in people:
            one[:, 2] = 1
    content = [one | {"score": 0.7} for one in formats.results(found, int)]
    path = tmp_path / "results.json"
    path.write_text(json.dumps(content))
    people = READERS["coco"].read(path)
    assert people.joints == COCO_17
    assert set(people.score[np.isfinite(people.uv[..., 0])].tolist()) == {0.7}


def test_yolo_other_classes_and_extra_columns(tmp_path):
    path = formats.yolo(tmp_path, scene(17))
    file = path / "walk2_1.txt"
    rows = file.read_text().splitlines()
    for name in path.iterdir():
        name.write_text("\n".join(f"{row} 0.9 7" for row in name.read_text().splitlines()))
    file.write_text("\n".join(["5" + rows[0][1:] + " 0.9 7", rows[1] + " 0.9 7"]))
    people = READERS["yolo"].read(path)
    assert people.frame.tolist() == [0, 1, 2, 3]


def test_yolo_a_file_for_a_folder_and_a_folder_for_a_file(tmp_path):
    """Both have rows of 57 or 58 columns: the frame before, or the box's confidence and the track at the end."""
    folder, stream = formats.yolo(tmp_path, scene(17)), formats.yolo_stream(tmp_path, scene(17))
    one = tmp_path / "one.txt"
    for end in ("", " 0.9", " 0.9 7"):
        one.write_text("".join(f"{row}{end}\n" for row in (folder / "walk2_0.txt").read_text().splitlines()))
        with pytest.raises(
            DiorError, match=r"one\.txt: line 1 has .*; is it the file of one picture\? Then name the fold"
        ):
            run(tmp_path, one)
    (tmp_path / "whole").mkdir()
    shutil.copy(stream, tmp_path / "whole" / "walk2_0.txt")
    with pytest.raises(DiorError, match="rows that begin with the frame belong in one file, not in a folder"):
        run(tmp_path, tmp_path / "whole")


def test_a_picture_without_person_is_told_apart_where_the_format_does(tmp_path):
    found = scene(17)
    del found[2]
    _, findings = run(tmp_path, formats.coco(tmp_path, found))
    assert "1 of 4 frames, or found nobody there: COCO results output does not tell" in findings["detector_not_run"]
    path = formats.mediapipe_tasks(tmp_path, scene(33, (0, 3)))
    path.write_text(path.read_text() + '\n{"frame": 1, "pose_landmarks": []}\n{"frame": 2, "pose_landmarks": null}')
    _, findings = run(tmp_path, path)
    assert "nobody in 2 of 4" in findings["nobody_found"] and "detector_not_run" not in findings


def test_frames_counted_from_one(tmp_path):
    path = formats.yolo(tmp_path, scene(17, (1, 2, 3)))
    _, findings = run(tmp_path, path)
    assert "if the tool counts from 1, all of them are a frame late" in findings["frames_from_one"]
    with pytest.raises(DiorError, match="frame 3 but the recording has frames 0 to 2.*are they counted from 1"):
        run(tmp_path, path, count=3)
    table, findings = run(tmp_path, path, count=3, first_frame=1)
    expected = [one[0][:, 0] for one in scene(17, (1, 2, 3)).values()]
    np.testing.assert_allclose(table["u"].reshape(3, 17), expected, atol=1e-3)
    assert set(findings) == {"several_people"}
    with pytest.raises(DiorError, match="has frame 3 but the recording has frames 1 to 2; the .* recording$"):
        run(tmp_path, path, count=2, first_frame=1)
    _, findings = run(tmp_path, formats.yolo_stream(tmp_path, scene(17, (2, 3))), count=3, first_frame=1)
    assert set(findings) == {"detector_not_run"}
    with pytest.raises(DiorError, match="it begins with frame 1, and `detector.first_frame` in config.yaml says .* 2"):
        run(tmp_path, path, first_frame=2)


def test_frames_by_the_stamps_where_the_tool_wrote_no_frame(tmp_path):
    found = scene(33, (3, 0, 2))
    stamps = {frame: 1_708_000_000_000 + 10 * frame for frame in found}
    lines = formats.mlkit(tmp_path, found).read_text().splitlines()
    for key, scale, path in (("stamp_ns", 10**6, "mlkit.jsonl"), ("timestamp_ms", 1, "tasks.jsonl")):
        if key == "timestamp_ms":
            lines = formats.mediapipe_tasks(tmp_path, found).read_text().splitlines()
        given = [{key: scale * stamps[f]} for f in found]
        content = [
            {k: v for k, v in json.loads(line).items() if k not in ("frame", "stamp_ns")} | stamp
            for line, stamp in zip(lines, given, strict=True)
        ]
        path = tmp_path / path
        path.write_text("\n".join(map(json.dumps, content)))
        table, findings = run(tmp_path, path, period_ns=10**7)
        u = table["u"].reshape(4, 33)
        assert np.isnan(u[1]).all() and "not run on 1 of 4" in findings["detector_not_run"]
        for frame in found:
            np.testing.assert_allclose(u[frame], found[frame][0][:, 0], atol=1e-3)
        content[1][key] += 5 * scale + scale // 2 + 1
        path.write_text("\n".join(map(json.dumps, content)))
        with pytest.raises(DiorError, match="at which there is no picture|two stamps in .* are those of frame"):
            run(tmp_path, path, count=1, period_ns=10**7)
        content[1] |= {key: content[0][key]}
        path.write_text("\n".join(map(json.dumps, content)))
        with pytest.raises(DiorError, match="two stamps in .* are those of frame 3"):
            run(tmp_path, path, period_ns=10**7)
        content[1] |= {"frame": 1}
        path.write_text("\n".join(map(json.dumps, content)))
        with pytest.raises(DiorError, match="have none; write it with each|has no 'frame'|has no \"frame\""):
            run(tmp_path, path)


def test_fractions_taken_for_pixels_and_pixels_for_fractions(tmp_path):
    found = scene(18)
    path = formats.openpose(tmp_path, {f: [one / (WIDTH, HEIGHT, 1) for one in people] for f, people in found.items()})
    with pytest.raises(DiorError, match="walk, cam01: the coordinates in .* which is fractions, but OpenPose output"):
        run(tmp_path, path)
    found = {f: [one * (WIDTH, HEIGHT, 1) for one in people] for f, people in scene(33).items()}
    with pytest.raises(DiorError, match="which is pixels, but MediaPipe output is read as fractions"):
        run(tmp_path, formats.mediapipe_tasks(tmp_path, found))


def test_fractions_need_the_picture_size(tmp_path):
    path = formats.yolo(tmp_path, scene(17))
    columns = {"camera": np.full(4, "cam01", object), "frame": np.arange(4), "stamp_ns": np.arange(4)}
    tables.write(tmp_path / "frames.parquet", "frames", columns)
    with pytest.raises(DiorError, match="the size of the pictures is not known"):
        detections.run(
            looked_at=[],
            sequence="walk", pattern=str(path), cameras=["cam01"], format="auto", frames=tmp_path / "frames.parquet",
            out=tmp_path / "out.parquet", findings=tmp_path / "f.parquet",
        )  # fmt: skip


def test_mlkit_lines_of_several_forms_agree_with_plain_json(tmp_path):
    """Lines that are stripped to their numbers, and those that cannot be, in one file of several blocks."""
    random, lines = np.random.default_rng(5), []
    for frame in range(200):
        landmarks = [
            {"type": i, "x": x, "y": y, "z": z, "inFrameLikelihood": s}
            for i, (x, y, z, s) in enumerate((random.uniform(-100, 1000, (33, 4)) * (1, 1, 1, 1e-3)).round(4).tolist())
        ]
        if frame % 7 == 1:
            landmarks = landmarks[::-1][:20]
        if frame % 7 == 2:
            landmarks = []
        if frame % 7 == 3:
            landmarks[5]["x"] = 1.25e2
            landmarks[6] = dict(reversed(landmarks[6].items()))
        text = json.dumps({"frame": frame, "stamp_ns": 1_708_000_000_000_000_001 + frame, "landmarks": landmarks})
        lines.append(text.replace("125.0", "1.25e2") if frame % 7 == 3 else text)
    path = tmp_path / "mixed.jsonl"
    for chosen in (lines, [one for one in lines if "1.25e2" not in one and one.count("type") in (0, 33)]):
        path.write_text("\n".join(chosen))
        people = mlkit.read(path)
        expected = np.full((len(chosen), 33, 3), np.nan)
        content = [json.loads(one) for one in chosen]
        for row, one in enumerate(content):
            for p in one["landmarks"]:
                expected[row, p["type"]] = p["x"], p["y"], p["inFrameLikelihood"]
        seen = np.isfinite(expected[..., 0]).any(axis=1)
        np.testing.assert_array_equal(people.uv, expected[seen][..., :2])
        np.testing.assert_array_equal(people.score, np.clip(np.nan_to_num(expected[seen][..., 2]), 0, 1))
        assert people.ran.tolist() == [one["frame"] for one in content]
        assert people.stamp_ns.tolist() == [one["stamp_ns"] for one in content]


def write_compactly(folder, found):
    """As OpenPose itself writes: no blanks, more keys after the pose."""
    folder.mkdir()
    for frame, people in found.items():
        content = {
            "version": 1.3,
            "people": [
                {"person_id": [-1], "pose_keypoints_2d": one, "face_keypoints_2d": [], "pose_keypoints_3d": []}
                for one in people
            ],
        }
        (folder / f"{frame}.json").write_text(json.dumps(content, separators=(",", ":")))


def test_openpose_files_of_several_forms_agree_with_plain_json(tmp_path):
    """Files that are cut at what they share, and those that cannot be, in several blocks."""
    random, found = np.random.default_rng(6), {}
    for frame in range(300):
        count = 0 if frame % 9 == 4 else 1 + frame % 3
        found[frame] = (random.uniform(1, 1000, (count, 54)) * 10.0 ** random.integers(-6, 1, (count, 1))).tolist()
    found[150][0] = []
    write_compactly(tmp_path / "cam01", found)
    (tmp_path / "cam01/160.json").write_text(json.dumps({"people": [{"pose_keypoints_2d": found[160][0]}]}))
    found[160] = found[160][:1]
    people = READERS["openpose"].read(tmp_path / "cam01")
    rows = [(frame, i, one) for frame, all_of in found.items() for i, one in enumerate(all_of) if one]
    assert people.frame.tolist() == [frame for frame, _, _ in rows]
    assert people.person.tolist() == [i for _, i, _ in rows]
    points = np.array([one for _, _, one in rows]).reshape(-1, 18, 3)
    np.testing.assert_array_equal(people.uv, points[..., :2])
    np.testing.assert_array_equal(people.score, np.clip(points[..., 2], 0, 1))


@pytest.mark.parametrize("old, new", [("1.5,", "1.5,1.5,"), ("1.5,", "1.5],[1.5,"), ("1.5", "1.5x"), ("}]}", "}]")])
def test_openpose_damage_between_good_files_is_found(tmp_path, old, new):
    write_compactly(tmp_path / "cam01", {frame: [[1.5] * 54] for frame in range(300)})
    file = tmp_path / "cam01/200.json"
    text = file.read_text()
    place = len(text) // 2
    damaged = text[:place] + text[place:].replace(old, new, 1)
    assert damaged != text
    file.write_text(damaged)
    with pytest.raises(DiorError, match=r"cam01/200\.json: "):
        READERS["openpose"].read(tmp_path / "cam01")


def test_a_digit_within_a_key_is_no_number(tmp_path):
    """`"x1": 5` is another key: what is stripped to its numbers must not read 15."""
    whole = formats.mlkit(tmp_path, {f: people for f, people in scene(33).items() if f != 2}).read_text().splitlines()
    path = tmp_path / "digit.jsonl"
    path.write_text("\n".join([whole[0], whole[1].replace('"type": 4, "x"', '"type": 4, "x1"')]))
    people = mlkit.read(path)
    assert np.isnan(people.uv[1, 4]).all() and np.isfinite(people.uv[1, 5]).all()


def test_real_mediapipe_text(shared, tmp_path):
    path = shared / "detections" / "mediapipe_pose_landmarks.pbtxt"
    assert recognise(path) == "mediapipe"
    people = mediapipe.read(path)
    assert people.joints == MLKIT_33 and people.frame.tolist() == [0] and np.isfinite(people.uv).all()
    np.testing.assert_allclose(people.uv[0, [0, 32]], [[0.46507242, 0.41610304], [0.30121577, 0.94473803]])
    np.testing.assert_allclose(people.score[0, [0, 32]], [0.99998844, 0.97545445])
    table, _ = run(tmp_path, path)
    np.testing.assert_allclose(table["u"][0], 0.46507242 * WIDTH - 0.5, rtol=1e-6)
    np.testing.assert_allclose(table["v"][0], 0.41610304 * HEIGHT - 0.5, rtol=1e-6)
    (tmp_path / "folder").mkdir()
    for frame in (1, 3):
        shutil.copy(path, tmp_path / "folder" / f"cam01_{frame:04d}.pbtxt")
    assert mediapipe.read(tmp_path / "folder").frame.tolist() == [1, 3]


def test_real_mlkit_csv(shared, tmp_path):
    path = shared / "detections" / "mlkit_fitness_pose_samples.csv"
    assert recognise(path) == "mlkit_csv"
    names, classes, points = mlkit_csv.poses(path)
    assert points.shape == (812, 33, 3) and np.isfinite(points).all() and len(set(names)) == 812
    counts = {name: classes.count(name) for name in sorted(set(classes))}
    assert counts == {"pushups_down": 195, "pushups_up": 201, "squats_down": 225, "squats_up": 191}
    np.testing.assert_array_equal(points[0, 0], [1251.0012, 384.75177, -1716.2709])
    # z counts from the hips, which is how the file shows that x, y, z have one unit
    assert np.abs(points[:, 23:25, 2].mean(axis=1)).max() < 3
    with pytest.raises(DiorError, match="pictures of .* recordings .* keep the rows of one"):
        mlkit_csv.read(path)
    one = [line for line in path.read_text().splitlines() if "__8ghtQpeWov8__" in line]
    (tmp_path / "one.csv").write_text("\n".join(one))
    people = mlkit_csv.read(tmp_path / "one.csv")
    assert len(people.frame) == 10 and (people.score == 1).all()
