import json
import subprocess
import sys

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from dior.errors import DiorError
from dior.geometry import camera_tables
from dior.geometry.camera import pose
from dior.geometry.multiview import look_at
from dior.tables import buffers, tables
from dior.tables.schemas import SCHEMAS
from tests.rig import camera


def small(count=4):
    return {
        "camera": np.repeat(["cam01", "cam02"], count).astype(object),
        "frame": np.tile(np.arange(count), 2),
        "stamp_ns": np.arange(2 * count) + 10**18,
        "person": np.tile([0, -1, 0, 1][:count], 2),
        "joint": np.array(["nose"] * 2 * count, object),
        "u": np.arange(2 * count, dtype=float),
        "v": np.full(2 * count, np.nan),
        "score": np.ones(2 * count),
    }


def test_round_trip_with_nulls_units_and_same_bytes(tmp_path):
    tables.write(tmp_path / "a.parquet", "detections", small(), {"tool": "test"})
    tables.write(tmp_path / "b.parquet", "detections", small(), {"tool": "test"})
    assert (tmp_path / "a.parquet").read_bytes() == (tmp_path / "b.parquet").read_bytes()
    back = tables.read(tmp_path / "a.parquet", "detections")
    for name, values in small().items():
        np.testing.assert_array_equal(back[name], values)
    stored = pq.read_table(tmp_path / "a.parquet")
    assert stored["v"].null_count == 8 and stored["person"].null_count == 2
    assert stored.schema.field("u").metadata[b"unit"] == b"px"
    assert pa.types.is_dictionary(stored.schema.field("joint").type)
    assert tables.metadata(tmp_path / "a.parquet")["tool"] == "test"
    assert pq.ParquetFile(tmp_path / "a.parquet").metadata.row_group(0).column(0).compression == "ZSTD"
    assert list(tmp_path.glob(".*")) == []


def test_every_declared_column_has_a_type_that_can_be_written_empty(tmp_path):
    for name, schema in SCHEMAS.items():
        tables.write(tmp_path / f"{name}.parquet", name, {schema.names[0]: np.array([], object)})
        assert tables.read(tmp_path / f"{name}.parquet", name).keys() == set(schema.names)


def test_wrong_words_columns_and_files_are_refused(tmp_path):
    with pytest.raises(DiorError, match="no column 'jont' .*'joint'"):
        tables.write(tmp_path / "a.parquet", "detections", {"jont": ["nose"]})
    with pytest.raises(DiorError, match="'okay' is no status .*'ok'"):
        tables.write(tmp_path / "a.parquet", "labels_2d", {"status": ["okay"]})
    with pytest.raises(DiorError, match="'okay' is no status"):
        tables.write(tmp_path / "a.parquet", "labels_2d", {"status": tables.Repeated(["okay"], [0])})
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(DiorError, match="no such file"):
        tables.read(tmp_path / "a.parquet", "frames")
    (tmp_path / "a.parquet").write_bytes(b"PAR1 but no more")
    with pytest.raises(DiorError, match="not a readable Parquet file"):
        tables.read(tmp_path / "a.parquet", "frames")
    tables.write(tmp_path / "a.parquet", "detections", small())
    with pytest.raises(DiorError, match="holds the table 'detections', not 'frames'"):
        tables.read(tmp_path / "a.parquet", "frames")


def test_grid_needs_every_row():
    table = {"joint": np.array(["a", "b"] * 3, object), "u": np.arange(6.0)}
    values, joints = tables.grid(table, "u")
    assert values[..., 0].tolist() == [[0, 1], [2, 3], [4, 5]] and joints == ["a", "b"]
    with pytest.raises(DiorError, match="not complete"):
        tables.grid(tables.rows(table, np.arange(6) != 2), "u")


def test_repeated_text_equals_spelled_out_text(tmp_path):
    spelled = small()
    short = spelled | {"joint": tables.Repeated(["nose"], np.zeros(8))}
    tables.write(tmp_path / "a.parquet", "detections", spelled)
    tables.write(tmp_path / "b.parquet", "detections", short)
    assert (tmp_path / "a.parquet").read_bytes() == (tmp_path / "b.parquet").read_bytes()


def test_cameras_come_back_as_they_were(tmp_path):
    placed = camera("cam01", (4.0, 1.0, 1.5), role="long_range")
    unknown = placed.__class__("cam02", placed.intrinsics)
    camera_tables.write_cameras(tmp_path / "c.parquet", [placed, unknown], "field")
    back = camera_tables.read_cameras(tmp_path / "c.parquet")
    assert back["cam01"].intrinsics == placed.intrinsics and back["cam01"].role == "long_range"
    assert back["cam01"].wTc == pytest.approx(pose(look_at((4.0, 1.0, 1.5), (0, 0, 1)), (4.0, 1.0, 1.5)))
    assert back["cam02"].wTc is None


def test_reading_and_writing_does_not_import_pandas(tmp_path):
    """pyarrow's own conversions do: 0.4 s in every job."""
    import subprocess
    import sys

    code = (
        "import sys, numpy as np; from dior.tables import tables\n"
        "t = {'camera': ['a', ''], 'frame': [1, 2], 'stamp_ns': [1, 2], 'person': [0, -1], 'joint': ['n', 'n'],"
        " 'u': [1, np.nan], 'v': [1, 2], 'score': [1, 1]}\n"
        f"tables.write({str(tmp_path / 'a.parquet')!r}, 'detections', t)\n"
        f"tables.read({str(tmp_path / 'a.parquet')!r}, 'detections')\n"
        "print('pandas' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"


def test_pictures_are_bytes_or_null_and_typed_for_the_datasets_library(tmp_path):
    pictures = [b"\xff\xd8one", None, b"\xff\xd8"]
    columns = {"subject": ["pa"] * 3, "frame": [0, 1, 2], "image": pictures, "no_image": ["", "head_unknown", ""]}
    tables.write(tmp_path / "a.parquet", "released_frames", columns)
    assert tables.read(tmp_path / "a.parquet", "released_frames")["image"].tolist() == pictures
    assert pq.read_table(tmp_path / "a.parquet")["image"].to_pylist()[:2] == [
        {"bytes": pictures[0], "path": None},
        None,
    ]
    features = json.loads(tables.metadata(tmp_path / "a.parquet")["huggingface"])["info"]["features"]
    assert features["image"] == {"_type": "Image"}
    assert features["no_image"] == {"dtype": "string", "_type": "Value"}
    assert features["stamp_ns"] == {"dtype": "int64", "_type": "Value"}


def test_a_table_is_read_in_parts_that_are_the_whole(tmp_path):
    columns = {"subject": ["pa", "pb"] * 5, "frame": np.arange(10), "image": [b"x", None] * 5}
    tables.write(tmp_path / "a.parquet", "released_frames", columns)
    parts = list(tables.read_in_parts(tmp_path / "a.parquet", "released_frames", ["frame", "image", "subject"], 4))
    assert [len(part["frame"]) for part in parts] == [4, 4, 2]
    whole = tables.read(tmp_path / "a.parquet", "released_frames")
    for column in ("frame", "image", "subject"):
        assert np.concatenate([part[column] for part in parts]).tolist() == whole[column].tolist()


def test_repeated_words_are_read_as_indices(tmp_path):
    columns = {"joint": ["b", "a", "b", ""], "frame": [0, 0, 1, 1], "status": ["ok"] * 4}
    tables.write(tmp_path / "a.parquet", "labels_2d", columns)
    joint = tables.read_coded(tmp_path / "a.parquet", "labels_2d", ["joint", "frame"])["joint"]
    assert [joint.words[i] if i >= 0 else "" for i in joint.index] == columns["joint"]


def test_the_value_under_a_null_is_0_so_that_the_same_table_is_the_same_bytes():
    array = buffers.fixed(np.array([1.0, np.nan, 3.0]), pa.float64(), np.array([False, True, False]))
    assert np.frombuffer(array.buffers()[1], float).tolist() == [1.0, 0.0, 3.0]
    array = buffers.fixed(np.array([7, -5]), pa.int32(), np.array([False, True]))
    assert np.frombuffer(array.buffers()[1], np.int32).tolist() == [7, 0] and array.to_pylist() == [7, None]


def test_a_slice_of_a_column_is_read_from_its_own_first_row():
    """Parquet files are read in parts, which share their buffers."""
    array = pa.array([1, None, 3, None, 5], pa.int32())
    assert buffers.numbers(array.slice(1, 3), -1).tolist() == [-1, 3, -1]
    assert buffers.numbers(array.slice(2), -1).tolist() == [3, -1, 5]


def test_a_table_without_rows_is_read_without_pandas(tmp_path):
    """Pyarrow imports it to make an array of an empty list, which takes longer than some steps."""
    path = tmp_path / "findings.parquet"
    tables.write_findings(path, [])
    code = f"import sys; from dior.tables import tables; tables.read({str(path)!r}, 'findings'); print(*sys.modules)"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert "pyarrow" in found.split() and "pandas" not in found.split()
