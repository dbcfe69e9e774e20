"""Which camera is far away, by what was detected in it."""

import numpy as np
import pytest

from dior.errors import DiorError
from dior.ingest.glance import Stream
from dior.init import roles
from dior.init.cameras import Filmed
from dior.init.roles import Seen
from tests.init import small

NOBODY, FAR, NEAR = Seen(3, 100, 30.0, 0, 99), Seen(100, 100, 25.0, 0, 99), Seen(100, 100, 200.0, 0, 99)


def camera(name, topic="/x"):
    return Filmed(name, "bag", Stream(topic, "", 40, None, None, 48, 64, None), ())


def found(outdoors=True, **seen):
    names = sorted({"a", "b", "c", *seen})
    told = {name: [one] for name, one in seen.items() if one}
    return {
        name: one.role for name, one in roles.roles_of([camera(name) for name in names], told, outdoors, {}).items()
    }


@pytest.mark.parametrize("one", [NOBODY, FAR, None, Seen(0, 100, np.nan, 0, 99)])
def test_nobody_tiny_people_or_no_detections_tell_the_far_camera(one):
    assert found(a=NEAR, b=NEAR, c=one) == {"a": "close", "b": "close", "c": "long_range"}


def test_people_who_are_small_in_all_cameras_are_near():
    assert set(found(a=FAR, b=FAR, c=FAR).values()) == {"close"}


def test_without_any_detections_a_name_tells_or_it_is_asked():
    assert found() == {"a": "TODO", "b": "TODO", "c": "TODO"}
    assert found(outdoors=False) == {"a": "close", "b": "close", "c": "close"}
    assert found(far_away=None)["far_away"] == "long_range"


def test_nobody_in_any_camera_tells_nothing():
    assert set(found(a=NOBODY, b=NOBODY, c=NOBODY).values()) == {"TODO"}


def test_detections_are_measured(tmp_path):
    small.mlkit(tmp_path / "a.jsonl", height_px=30.0)
    small.mlkit(tmp_path / "b.jsonl", nobody=True)
    assert roles.seen(tmp_path / "a.jsonl", "mlkit", camera("a")) == Seen(40, 40, 30.0, 0, 39)
    nobody = roles.seen(tmp_path / "b.jsonl", "mlkit", camera("b"))
    assert nobody.somebody == 0 and nobody.pictures == 40 and np.isnan(nobody.height_px)
    (tmp_path / "a.jsonl").write_text("{")
    with pytest.raises(DiorError, match="a.jsonl"):
        roles.seen(tmp_path / "a.jsonl", "mlkit", camera("a"))


def test_of_a_camera_whose_detections_cannot_be_read_it_is_asked():
    told = {name: [NEAR] for name in ("a", "b")}
    of = roles.roles_of([camera(name) for name in ("a", "b", "c")], told, True, {"c": "c.jsonl is empty"})
    assert [one.role for one in of.values()] == ["close", "close", "TODO"] and "c.jsonl is empty" in of["c"].reason
