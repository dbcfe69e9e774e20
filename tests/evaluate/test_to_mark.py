"""What is drawn for a person to mark: enough, of everybody, seen, and the same each time."""

from collections import Counter

import numpy as np
import pytest

from dior.evaluate import checks, to_mark
from dior.evaluate.grids import label_grids
from dior.project import boxes
from dior.tables import tables

JOINTS = ("LASI", "RASI", "C7")


def write_labels(folder, sequence, camera, subject, frames=200, status=None):
    path = folder / f"{sequence}.{camera}.parquet"
    count = frames * len(JOINTS)
    status = np.full((frames, len(JOINTS)), "ok", object) if status is None else status
    columns = {
        **{k: np.full(count, v, object) for k, v in (("subject", subject), ("sequence", sequence), ("camera", camera))},
        "joint": np.tile(np.array(JOINTS, object), frames),
        "frame": np.repeat(np.arange(frames), len(JOINTS)),
        "stamp_ns": np.repeat(np.arange(frames), len(JOINTS)),
        "u": np.full(count, 1.0),
        "v": np.full(count, 2.0),
        "status": status.ravel(),
    }
    tables.write(path, "labels_2d", columns)
    return path


@pytest.fixture
def indoor(tmp_path):
    """Two subjects with two cameras, the first with three walks and the second with one."""
    walks = (("a", "S1"), ("b", "S1"), ("c", "S1"), ("d", "S2"))
    return [write_labels(tmp_path, walk, camera, who) for walk, who in walks for camera in ("cam01", "cam02")]


def drawn(folder):
    return {path.name: path.read_text().splitlines() for path in sorted(folder.rglob("*.csv"))}


def test_a_hundred_labels_of_every_subject_and_camera_alike(indoor):
    found = to_mark.labels(indoor)
    rows = [
        (path.name.split(".")[1], "S2" if path.name[0] == "d" else "S1", *row) for path in found for row in found[path]
    ]
    assert len(rows) == len(set((path.name, *row) for path in found for row in found[path])) == 100
    assert set(Counter(row[:2] for row in rows).values()) == {25}
    assert len({row[2] for row in rows}) > 60 and {row[3] for row in rows} == set(JOINTS)


def test_only_labels_that_can_be_seen(tmp_path):
    status = np.full((200, 3), "ok", object)
    status[:, 0], status[:100, 1], status[100:, 2] = "occluded", "out_of_frame", "missing_3d"
    found = to_mark.labels([write_labels(tmp_path, "a", "cam01", "S1", status=status)])
    (rows,) = found.values()
    assert len(rows) == 100
    assert all((joint == "RASI" and frame >= 100) or (joint == "C7" and frame < 100) for frame, joint in rows)


def test_fewer_labels_than_asked_for_are_all_drawn(tmp_path):
    (rows,) = to_mark.labels([write_labels(tmp_path, "a", "cam01", "S1", frames=3)]).values()
    assert rows == [(f, j) for f in range(3) for j in JOINTS]


def test_frames_to_box_are_spread_over_the_frames_with_labels(tmp_path):
    status = np.full((200, 3), "out_of_frame", object)
    status[50:150, 1] = "ok"
    frames = to_mark.frames(write_labels(tmp_path, "a", "cam04", "S1", status=status))
    assert len(frames) == 20 and [(f - 50) // 5 for f in frames] == list(range(20))
    assert len({(f - 50) % 5 for f in frames}) > 2


def test_same_draw_each_time_and_hardly_another_with_one_more_sequence(indoor, tmp_path):
    far = [write_labels(tmp_path, "e", "cam04", "S1")]
    to_mark.run(indoor=indoor, long_range=far, out=tmp_path / "1")
    to_mark.run(indoor=indoor[::-1], long_range=far, out=tmp_path / "2")
    assert drawn(tmp_path / "1") == drawn(tmp_path / "2")
    before = to_mark.labels(indoor)
    after = to_mark.labels([*indoor, write_labels(tmp_path, "f", "cam01", "S1")])
    kept = sum(row in after.get(path, []) for path, rows in before.items() for row in rows)
    assert kept >= 75, "of the 25 of S1 in cam01, about a quarter make place"


def test_empty_rows_do_not_count_and_filled_ones_do(indoor, tmp_path):
    """A file is used as it was written, half filled in."""
    far = write_labels(tmp_path, "e", "cam04", "S1")
    to_mark.run(indoor=indoor, long_range=[far], out=tmp_path / "to_mark")
    path = tmp_path / "to_mark/checks/a.cam01.csv"
    grid = label_grids([indoor[0]])["cam01"]
    assert np.isnan(checks.check_points(path, "a", grid)).all()
    header, first, *others = path.read_text().splitlines()
    assert first.endswith(",,")
    path.write_text("\n".join([header, first[:-2] + ",4,6", *others]) + "\n")
    errors = checks.error_columns(grid, checks.check_points(path, "a", grid), "close")["error"]
    np.testing.assert_allclose(errors, [5.0])
    path = tmp_path / "to_mark/boxes/e.cam04.csv"
    header, first, *others = path.read_text().splitlines()
    path.write_text("\n".join([header, first.replace(",,,,", ",1,2,3,4"), *others]) + "\n")
    frames, edges = boxes.read(path, np.arange(200))
    assert len(others) == 19 and frames.tolist() == [int(first.split(",")[0])] and edges.tolist() == [[1, 2, 3, 4]]


def test_half_a_mark_is_refused(indoor, tmp_path):
    path = tmp_path / "a.cam01.csv"
    path.write_text("sequence,frame,joint,u,v\na,0,C7,5,\n")
    with pytest.raises(checks.DiorError, match="line 2"):
        checks.check_points(path, "a", label_grids([indoor[0]])["cam01"])
    path.write_text("frame,u_min,v_min,u_max,v_max\n1,5,,,\n")
    with pytest.raises(checks.DiorError, match="line 2"):
        boxes.read(path, np.arange(200))
