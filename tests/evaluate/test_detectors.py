"""Detection and success of other detectors on made-up output: all, none, exactly 20 %, and the way back from a zoom."""

import json

import numpy as np
import pytest

from dior.errors import DiorError
from dior.evaluate import detectors, zoom
from dior.tables import tables

FRAMES, START_NS = 10, 1_700_000_000_000_000_000
BOX = (630.0, 350.0, 642.0, 370.0)
INSIDE, OUTSIDE = (635.0, 360.0), (600.0, 360.0)


@pytest.fixture
def capture(tmp_path):
    """Frames and labels of a long-range camera; the label box of every picture is BOX, the last has no labels."""
    stamps = START_NS + np.arange(FRAMES) * 33_333_333
    corners = np.array([BOX[:2], BOX[2:], (BOX[0], BOX[3])])
    uv = np.tile(corners, (FRAMES, 1, 1))
    status = np.full((FRAMES, 3), "ok", dtype=object)
    status[-1] = "out_of_frame"
    columns = {
        "camera": np.full(FRAMES * 3, "cam04", object),
        "joint": np.tile(np.array(["nose", "left_hip", "right_hip"], object), FRAMES),
        "frame": np.repeat(np.arange(FRAMES), 3),
        "stamp_ns": np.repeat(stamps, 3),
        "u": uv[..., 0].ravel(),
        "v": uv[..., 1].ravel(),
        "status": status.ravel(),
    }
    tables.write(tmp_path / "labels.parquet", "labels_2d", columns)
    frames = {
        "camera": np.full(FRAMES, "cam04", object),
        "frame": np.arange(FRAMES),
        "stamp_ns": stamps,
        "receive_ns": stamps,
        "width": np.full(FRAMES, 1280),
        "height": np.full(FRAMES, 720),
    }
    tables.write(tmp_path / "frames.parquet", "frames", frames)
    return tmp_path


def person(inside, outside=0, place=INSIDE, elsewhere=OUTSIDE):
    """17 COCO keypoints: `inside` of them at `place`, `outside` of them elsewhere, the others missing."""
    points = [place] * inside + [elsewhere] * outside + [(0.0, 0.0)] * (17 - inside - outside)
    return [number for u, v in points for number in (u, v, 0.9 if (u, v) != (0.0, 0.0) else 0.0)]


def measure(folder, people, zoom=1, tool="somebody", content=None):
    """Run on COCO output with `people`: frame -> list of keypoint lists. Returns figures by metric, and the frames."""
    path = folder / "out.json"
    results = [{"image_id": f, "keypoints": k, "score": 1.0} for f, each in people.items() for k in each]
    path.write_text(json.dumps(results) if content is None else content)
    return run(folder, path, zoom, tool)


def run(folder, path, zoom=1, tool="somebody", **more):
    row = {"camera": "cam04", "tool": tool, "zoom": str(zoom), "path": str(path)} | more
    detectors.run(
        sequence="walk", subject="S1", rows=[row], roles={"cam04": "long_range"}, frames=folder / "frames.parquet",
        labels=[folder / "labels.parquet"], out=folder / "m.parquet", out_frames=folder / "f.parquet",
        findings=folder / "g.parquet",
    )  # fmt: skip
    found = tables.read(folder / "m.parquet", "metrics")
    assert set(found["tool"]) == {tool if zoom == 1 else f"{tool} {zoom}x"} and set(found["role"]) == {"long_range"}
    figures = dict(zip(found["metric"], zip(found["value"].tolist(), found["n"].tolist(), strict=True), strict=True))
    return figures, tables.read(folder / "f.parquet", "detector_frames")


def test_all(capture):
    found, frames = measure(capture, {f: [person(17)] for f in range(FRAMES)})
    assert found == {"detected_share": (1.0, 10), "success_share": (1.0, 9)}
    assert frames["success"].tolist() == [1] * 9 + [-1], "a picture without labels cannot be judged"
    assert frames["keypoints"].tolist() == [17] * 10 and frames["keypoints_in_box"].tolist() == [17] * 9 + [-1]


def test_a_tool_that_counts_from_one(capture):
    with pytest.raises(
        DiorError, match="are they counted from 1. Then `first_frame` in config/detectors.tsv should be 1"
    ):
        measure(capture, {f + 1: [person(17)] for f in range(FRAMES)})
    _, frames = run(capture, capture / "out.json", first_frame="1")
    assert frames["success"].tolist() == [1] * 9 + [-1]


def test_none_is_a_result_and_no_error(capture):
    found, frames = measure(capture, {})
    assert found == {"detected_share": (0.0, 10), "success_share": (0.0, 9)}
    assert set(frames["people"]) == {0}


def test_found_but_never_the_subject(capture):
    found, _ = measure(capture, {f: [person(0, 17)] for f in range(0, FRAMES, 2)})
    assert found == {"detected_share": (0.5, 10), "success_share": (0.0, 9)}


@pytest.mark.parametrize(
    "inside, outside, success",
    [(1, 4, True), (2, 8, True), (3, 12, True), (1, 5, False), (2, 9, False), (3, 13, False), (3, 14, False),
     (1, 0, True), (0, 1, False)],
)  # fmt: skip
def test_exactly_20_percent_of_the_detected_keypoints_is_a_success(capture, inside, outside, success):
    """Missing keypoints are not detected: 1 of 5 is 20 %, though 17 were asked for."""
    found, frames = measure(capture, {0: [person(inside, outside)]})
    assert found["success_share"] == ((1 / 9 if success else 0.0), 9)
    assert (frames["keypoints"][0], frames["keypoints_in_box"][0]) == (inside + outside, inside)


def test_edges_belong_to_the_box(capture):
    at = [person(17, place=BOX[:2]), person(17, place=BOX[2:]), person(17, place=(BOX[0] - 0.01, 360))]
    _, frames = measure(capture, {f: [one] for f, one in enumerate(at)})
    assert frames["success"].tolist()[:3] == [1, 1, 0]


def test_of_several_people_the_one_with_the_largest_share_counts(capture):
    found, frames = measure(capture, {0: [person(0, 17), person(2, 3), person(3, 14)], 1: [person(0, 5)] * 2})
    assert frames["people"].tolist()[:3] == [3, 2, 0]
    assert frames["success"].tolist()[:3] == [1, 0, 0]
    assert (frames["keypoints"][0], frames["keypoints_in_box"][0]) == (5, 2)
    assert found["detected_share"] == (0.2, 10)


def test_zoomed_pixels_go_back_to_where_they_were_recorded(capture):
    """The central 320x180 of 1280x720 begins at pixel (480, 270)."""
    piece = np.array(INSIDE) - (480, 270)
    found, frames = measure(capture, {f: [person(17, place=tuple(piece))] for f in range(FRAMES)}, zoom=4)
    assert found["success_share"] == (1.0, 9) and set(frames["zoom"]) == {4}
    edges = [tuple(np.array(BOX[:2]) - (480, 270) + d) for d in ((0, 0), (-0.01, 0), (0, -0.01))]
    _, frames = measure(capture, {f: [person(17, place=at)] for f, at in enumerate(edges)}, zoom=4)
    assert frames["success"].tolist()[:3] == [1, 0, 0]


def test_fractions_of_a_zoomed_picture_count_from_its_edge(capture):
    """u = 480 + x 320 - 0.5: the fraction of a pixel's centre is half a pixel more than its number."""
    folder = capture / "yolo"
    folder.mkdir()
    for frame, shift in enumerate((-0.02, 0.02)):
        x, y = (BOX[2] + shift - 480 + 0.5) / 320, (360 - 270 + 0.5) / 180
        numbers = [0, 0.5, 0.5, 0.1, 0.2, *[number for _ in range(17) for number in (f"{x:.7f}", f"{y:.7f}", 0.9)]]
        (folder / f"frame_{frame:06d}.txt").write_text(" ".join(map(str, numbers)) + "\n")
    _, frames = run(capture, folder, zoom=4)
    assert frames["success"].tolist()[:2] == [1, 0], "a fiftieth of a pixel inside and outside of the right edge"


def test_a_tool_that_tells_what_it_saw_is_judged_on_that_alone(capture):
    """ML Kit: `landmarks: []` is nobody, a missing line was not run."""
    seen = [{"frame": f, "landmarks": []} for f in range(3)]
    marks = [{"type": t, "x": INSIDE[0], "y": INSIDE[1], "z": 0, "inFrameLikelihood": 0.1} for t in range(33)]
    seen.append({"frame": 3, "landmarks": marks})
    path = capture / "mlkit.jsonl"
    path.write_text("".join(json.dumps(one) + "\n" for one in seen))
    found, frames = run(capture, path, tool="mlkit")
    assert found == {"detected_share": (0.25, 4), "success_share": (0.25, 4)}
    assert frames["people"].tolist() == [0, 0, 0, 1] + [-1] * 6 and frames["success"].tolist()[4:] == [-1] * 6
    text = tables.read(capture / "g.parquet", "findings")["text"].tolist()
    assert text == ["cam04: mlkit was not run on 6 of 10 pictures"]


def test_a_folder_of_empty_files_is_nobody_on_those(capture):
    folder = capture / "yolo"
    folder.mkdir()
    for frame in range(4):
        (folder / f"frame_{frame:06d}.txt").write_text("")
    found, _ = run(capture, folder)
    assert found == {"detected_share": (0.0, 4), "success_share": (0.0, 4)}


@pytest.mark.parametrize(
    "people, zoom, content, words",
    [
        ({0: [person(17)]}, 4, None, "outside of the 320x180"),
        ({FRAMES: [person(17)]}, 1, None, "has frame 10"),
        ({}, 1, "", "is empty"),
        ({}, 1, "hello", "output of none of"),
    ],
)
def test_output_that_cannot_be_is_refused(capture, people, zoom, content, words):
    with pytest.raises(DiorError, match=words) as caught:
        measure(capture, people, zoom, content=content)
    assert "walk, cam04, somebody" in str(caught.value)


@pytest.mark.parametrize(
    "size, by, piece",
    [
        ((1280, 720), 4, (480, 270, 320, 180)),
        ((1280, 720), 1, (0, 0, 1280, 720)),
        ((641, 361), 4, (240, 135, 160, 90)),
        ((3, 3), 4, (1, 1, 1, 1)),
    ],
)
def test_the_piece_lies_in_the_middle(size, by, piece):
    assert zoom.window(*size, by) == piece
    u, v, width, height = piece
    assert (
        abs((u + (width - 1) / 2) - (size[0] - 1) / 2) <= 0.5 and abs((v + (height - 1) / 2) - (size[1] - 1) / 2) <= 0.5
    )
