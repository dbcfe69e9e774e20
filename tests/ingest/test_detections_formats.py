"""Every format: what was written is what is read, in pixels, recognised or named."""

import json

import numpy as np
import pytest

from dior.body.names import HALPE_136, WHOLEBODY_133, swap_index
from dior.errors import DiorError
from dior.ingest import detections
from dior.ingest.readers import READERS
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


def test_full_body_names_are_paired():
    for joints in (HALPE_136, WHOLEBODY_133):
        swap = swap_index(joints)
        assert (swap[swap] == np.arange(len(joints))).all() and len(set(joints)) == len(joints)
        in_the_middle = [name for name, other in zip(joints, swap, strict=True) if joints[other] == name]
        assert set(in_the_middle) <= {"nose", "head", "neck", "mid_hip"} | {
            name for name in joints if name[:4] == "face"
        }
        assert sum(name.startswith("face") for name in in_the_middle) == 10


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


@pytest.mark.parametrize("writer", [formats.mmpose_video, formats.openpose, formats.deeplabcut])
def test_scores_that_are_none(tmp_path, writer):
    def scored(times):
        return {f: [one * (1, 1, times) for one in people] for f, people in scene(17).items()}

    with pytest.raises(DiorError, match="half of its scores are above 20; are they percent"):
        run(tmp_path, writer(tmp_path / "percent", scored(100)))
    with pytest.raises(DiorError, match="no joint in .* has a score above 0"):
        run(tmp_path, writer(tmp_path / "none", scored(0)))
    # the peaks of networks that give no probability
    run(tmp_path, writer(tmp_path / "peaks", scored(12)))
