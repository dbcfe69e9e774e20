"""What is held out is held out."""

import pytest

from dior.errors import DiorError
from dior.reid import split


def sheet(subjects=3, walks=2, sessions=("lab", "field")):
    return {
        f"{session}_{who}_{take}": {"subject": f"S{who}", "session": session, "session_order": str(take)}
        for session in sessions
        for who in range(subjects)
        for take in range(walks)
    }


def test_the_last_walk_of_a_session_is_held_out():
    rows = sheet()
    found = split.of(rows)
    assert set(found.test) == {f"{s}_{w}_1" for s in ("lab", "field") for w in range(3)}
    assert set(found.train) == set(rows) - set(found.test) and not found.unused


def test_a_held_out_session_is_in_no_training():
    rows = sheet()
    found = split.of(rows, ["field"])
    assert {rows[name]["session"] for name in found.train} == {"lab"}
    assert {rows[name]["session"] for name in found.test} == {"field"}


def test_who_is_only_in_the_held_out_session_is_not_tested():
    rows = sheet() | {"field_9_0": {"subject": "S9", "session": "field", "session_order": "9"}}
    found = split.of(rows, ["field"])
    assert found.unused == ("field_9_0",) and "field_9_0" not in found.test + found.train


def test_a_gallery_that_is_too_small_is_refused():
    with pytest.raises(DiorError, match="no subject has two walks in one session"):
        split.of(sheet(walks=1))
    with pytest.raises(DiorError, match="1 subject would be left"):
        split.of(sheet(subjects=1))
    with pytest.raises(DiorError, match="0 subjects would be left"):
        split.of(sheet(), ["lab", "field"])
    nested = {f"{s}_{w}": {"subject": w, "session": s} for s, ws in (("a", "PQ"), ("b", "RT")) for w in ws}
    with pytest.raises(DiorError, match="no subject is both"):
        split.of(nested, ["b"])
    with pytest.raises(DiorError, match="no session 'feild' to test with.*field"):
        split.of(sheet(), ["feild"])


def test_the_last_walk_is_the_one_with_the_highest_number():
    rows = {
        f"{s}_{n}": {"subject": s, "session": "lab", "session_order": str(n)} for s in ("A", "B") for n in (2, 9, 10)
    }
    assert set(split.of(rows).test) == {"A_10", "B_10"}
