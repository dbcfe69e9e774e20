"""Stamps that are counted from a person's first picture."""

from types import SimpleNamespace

import numpy as np
import pyarrow as pa
import pytest

from dior.errors import DiorError
from dior.release import people_tables, shift_stamps
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


def test_missing_stamps_stay_missing_and_each_has_its_own_persons_shift():
    found = shift_stamps.shifted_stamps(np.array([NOON, -1, NOON + 5]), np.array([NOON - FIRST, 7, NOON + 3 - FIRST]))
    assert found.tolist() == [FIRST, -1, FIRST + 2]


def test_all_walks_of_a_person_have_the_persons_shift(tmp_path):
    """S01 walked on two days and S02 in between: S01's second walk is a day after the first one."""
    begins = {"walk_1": NOON, "walk_2": NOON + DAY, "walk_3": NOON + 7}
    of = {"S01": ["walk_1", "walk_2"], "S02": ["walk_3"]}
    row = {"session": "field", "session_order": "1"}
    project = SimpleNamespace(
        released_sequences=list(begins), released_subjects=list(of), config={"release": {"shift_stamps": True}},
        sequence=lambda name: row | {"sequence": name, "subject": "S02" if name == "walk_3" else "S01"},
        pseudonym=lambda who: f"person-{who}", cameras_of=lambda name: ["cam01"], sequences_of_subject=of.get,
    )  # fmt: skip
    tables_of = {name: frames(tmp_path / f"{name}.parquet", [at, at + 5]) for name, at in begins.items()}
    walks = people_tables.released_walks(project, tables_of)
    assert {name: walk["shift_ns"] for name, walk in walks.items()} == {
        "walk_1": NOON - FIRST, "walk_2": NOON - FIRST, "walk_3": NOON + 7 - FIRST,
    }  # fmt: skip
