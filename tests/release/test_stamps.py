"""Stamps that are counted from a person's first picture."""

import numpy as np
import pyarrow as pa
import pytest

from dior import tables
from dior.errors import DiorError
from dior.release import stamps

DAY = 86_400 * 10**9
NOON = 1_700_000_000_123_456_789


def frames(path, stamp_ns):
    tables.write(path, "frames", {"camera": ["cam01"] * len(stamp_ns), "stamp_ns": np.array(stamp_ns, np.int64)})
    return path


def test_the_first_picture_of_all_walks_is_the_origin_and_distances_stay(tmp_path):
    walks = [frames(tmp_path / "b.parquet", [NOON + DAY, NOON + DAY + 5]), frames(tmp_path / "a.parquet", [NOON + 7])]
    ns = stamps.taken_off(walks)
    assert ns == NOON + 7 - DAY
    table = tables.to_arrow("skeletons_3d", {"stamp_ns": np.array([NOON + 7, NOON - 3, -1, NOON + DAY])})
    found = stamps.shifted(table, ns)
    assert found["stamp_ns"].to_pylist() == [DAY, DAY - 10, None, 2 * DAY - 7]
    assert found.schema.equals(table.schema, check_metadata=True)


def test_the_gallery_counts_too_and_files_have_no_stamp(tmp_path):
    walks = [frames(tmp_path / "a.parquet", [NOON])]
    columns = {"subject": ["S01", "S01", "S02"], "stamp_ns": np.array([-1, NOON - 60, NOON - 90])}
    tables.write(tmp_path / "gallery.parquet", "gallery", columns)
    assert stamps.taken_off(walks, tmp_path / "gallery.parquet", "S01") == NOON - 60 - DAY
    assert stamps.taken_off(walks, tmp_path / "gallery.parquet", "S03") == NOON - DAY


def test_what_cannot_be_hidden_is_refused(tmp_path):
    with pytest.raises(DiorError, match="no picture in .*empty.parquet"):
        stamps.taken_off([frames(tmp_path / "empty.parquet", [])])
    table = pa.table({"stamp_ns": pa.array([NOON - 2 * DAY])})
    with pytest.raises(DiorError, match="48.0 hours before the person's first picture"):
        stamps.shifted(table, NOON - DAY)
