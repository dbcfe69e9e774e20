"""Stamps that are counted from a person's first picture."""

import numpy as np
import pyarrow as pa
import pytest

from dior.errors import DiorError
from dior.release import shift_stamps
from dior.tables import tables

FIRST, DAY = 315_532_800 * 10**9, 86_400 * 10**9
NOON = 1_700_000_000_123_456_789


def frames(path, stamp_ns):
    tables.write(path, "frames", {"camera": ["cam01"] * len(stamp_ns), "stamp_ns": np.array(stamp_ns, np.int64)})
    return path


def test_the_first_picture_of_all_walks_is_the_origin_and_distances_stay(tmp_path):
    walks = [frames(tmp_path / "b.parquet", [NOON + DAY, NOON + DAY + 5]), frames(tmp_path / "a.parquet", [NOON + 7])]
    ns = shift_stamps.shift_ns(walks)
    assert ns == NOON + 7 - FIRST
    table = tables.to_arrow("skeletons_3d", {"stamp_ns": np.array([NOON + 7, NOON - 3, -1, NOON + DAY])})
    found = shift_stamps.shifted(table, ns)
    assert found["stamp_ns"].to_pylist() == [FIRST, FIRST - 10, None, FIRST + DAY - 7]
    assert found.schema.equals(table.schema, check_metadata=True)


def test_what_cannot_be_hidden_is_refused(tmp_path):
    with pytest.raises(DiorError, match="no picture in .*empty.parquet"):
        shift_stamps.shift_ns([frames(tmp_path / "empty.parquet", [])])
    table = pa.table({"stamp_ns": pa.array([NOON - 4000 * DAY])})
    with pytest.raises(DiorError, match="11.0 years before the person's first walk"):
        shift_stamps.shifted(table, NOON - FIRST)
