"""Nobody is in two parts, and the parts stay as they are as far as they can when people come and go."""

import hashlib
from collections import Counter

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dior.release import splits

NAMES = st.sets(st.text("abcdefgh0123456789", min_size=8, max_size=12), min_size=1, max_size=60)
ORDER = ("test", "val", "train")


def walk(subject, name, order, outfit, session="field"):
    return {
        "subject": subject,
        "sequence": name,
        "session": session,
        "released_session": session,
        "session_order": str(order),
        "outfit": outfit,
        "cameras": ["cam01", "cam02"],
    }


ROLES = {(session, camera): role for session in ("field", "lab") for camera, role in
         (("cam01", "close"), ("cam02", "long_range"))}  # fmt: skip


def rows(walks):
    columns = splits.columns({walk["sequence"]: walk for walk in walks}, ROLES)
    return list(zip(*columns.values(), strict=True))


@settings(deadline=None, max_examples=60)
@given(NAMES, st.integers(1, 3))
def test_no_subject_leaks(names, count):
    walks = [walk(name, f"{name}_{i}", i, "own") for name in names for i in range(count)]
    parts = {}
    listed = [row for row in rows(walks) if row[0] == "subject"]
    for _, part, subject, _, _ in listed:
        parts.setdefault(subject, set()).add(part)
    assert set(parts) == names and {len(found) for found in parts.values()} == {1}
    assert len({row[2:] for row in listed}) == len(listed) == 2 * count * len(names), "each recording is there once"


@settings(deadline=None, max_examples=60)
@given(NAMES, st.text("xyz", min_size=8, max_size=9))
def test_one_more_person_moves_nobody_far(names, newcomer):
    before, after = splits.by_subject(names), splits.by_subject(names | {newcomer})
    moved = Counter((before[name], after[name]) for name in names if before[name] != after[name])
    assert max(moved.values(), default=0) <= 1 and len(moved) <= 2
    if len(names) > 2:
        assert ("train", "test") not in moved and ("test", "train") not in moved


@pytest.mark.parametrize(("people", "expected"), [(1, (0, 0, 1)), (2, (1, 0, 1)), (3, (1, 1, 1)), (58, (12, 6, 40))])
def test_the_shares(people, expected):
    parts = Counter(splits.by_subject([f"person-{i:04}" for i in range(people)]).values())
    assert tuple(parts[part] for part in ORDER) == expected


def test_who_was_recorded_when_does_not_matter():
    names = [f"person-{i:04}" for i in range(20)]
    assert splits.by_subject(names) == splits.by_subject(names[::-1])


def test_a_name_that_comes_first_is_not_tested_for_that():
    """What people are called, perhaps in the order of their recordings, says nothing of the part that they are in."""
    names = [f"person-{i:04}" for i in range(20)]
    order = sorted(names, key=lambda name: hashlib.sha256(name.encode()).hexdigest())
    parts = splits.by_subject(names)
    assert [parts[name] for name in order] == ["test"] * 4 + ["val"] * 2 + ["train"] * 14
    assert [name for name in names if parts[name] == "test"] != names[:4]


def test_by_range_and_by_outfit():
    found = rows([
        walk("pa", "b_1", 2, "coat"), walk("pa", "a_2", 10, "shirt"), walk("pa", "c_3", 1, "coat", "lab"),
        walk("pb", "d_4", 3, ""),
    ])  # fmt: skip
    assert {row[1:] for row in found if row[0] == "range" and row[4] == "cam02"} == {
        ("probe", "pa", "b_1", "cam02"), ("probe", "pa", "a_2", "cam02"), ("probe", "pa", "c_3", "cam02"),
        ("probe", "pb", "d_4", "cam02"),
    }  # fmt: skip
    assert {row[1] for row in found if row[0] == "range" and row[4] == "cam01"} == {"gallery"}
    outfits = {row[3]: row[1] for row in found if row[0] == "outfit"}
    assert outfits == {"b_1": "gallery", "c_3": "gallery", "a_2": "probe"}, "d_4 has no outfit"
    assert found == sorted(found)
