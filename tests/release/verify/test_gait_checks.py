"""The gait of a walk agrees with itself: what the step wrote does, and each thing that is changed alone does not."""

import numpy as np
import pytest

from dior.release.suspect import RedLight, without_gait
from dior.release.verify import gait_checks
from dior.release.verify.evidence import Setup, Walk
from dior.tables import tables
from tests.gait.test_gait import noisy, walker, written  # noqa: F401

FILES = {"gait": "out", "gait_events": "events", "gait_steps": "steps", "skeletons_3d": "skeleton"}
TABLES = {"gait": "gait_parameters"}


@pytest.fixture(scope="module")
def found(tmp_path_factory, walker):  # noqa: F811
    """The tables of a walk by kind."""
    folder = tmp_path_factory.mktemp("walk")
    points, covariance = noisy(walker)
    written(folder, points, covariance=covariance)
    return {kind: tables.read(folder / f"{file}.parquet", TABLES.get(kind, kind)) for kind, file in FILES.items()}


def problems(found, lights=()):
    whole = {kind: {"": table} for kind, table in found.items()}
    rig = Setup({}, {}, {}, {}, {}, tuple(lights))
    return gait_checks.check(Walk("S01", "walk_1", whole, {}, rig, False, {}, {}, {}))


def test_what_the_step_writes_agrees(found):
    assert not problems(found) and len(found["gait_steps"]["value"]) > 50
    assert not problems({"skeletons_3d": found["skeletons_3d"]}), "an older release has no gait"


def test_of_a_walk_without_gait_nothing_is_wrong(tmp_path, walker):  # noqa: F811
    for name, points in (("nobody", np.full((60, 33, 3), np.nan)), ("nothing", np.zeros((0, 33, 3)))):
        (tmp_path / name).mkdir()
        written(tmp_path / name, points)
        read = {kind: tables.read(tmp_path / name / f"{file}.parquet", TABLES.get(kind, kind)) for kind, file in
                FILES.items()}  # fmt: skip
        assert not problems(read), name


@pytest.mark.parametrize(
    "kind, column, said",
    [
        ("gait_events", "time_s", "stamps that are not those of time_s"),
        ("gait_events", "stamp_ns", "stamps that are not those of time_s"),
        ("gait_events", "instant", "instants that are not the nearest ones"),
        ("gait_events", "low_s", "intervals that are not time_s and"),
        ("gait_steps", "start_s", "steps or strides that no strikes of gait_events bound"),
        ("gait_steps", "value", "values that are not the means of gait_steps"),
        ("gait_steps", "high", "intervals that are not value and"),
        ("gait", "value", "values that are not the means of gait_steps"),
        ("gait", "sigma", "intervals that are not value and"),
    ],
)
def test_a_number_that_is_changed_alone_is_found(found, kind, column, said):
    own = found[kind][column].copy()
    own[3] += 50_000_000 if column == "stamp_ns" else 2 if column == "instant" else 0.01
    lines = [text for _, text in problems(found | {kind: found[kind] | {column: own}})]
    assert any(said in text for text in lines), lines


def test_steps_of_events_that_are_left_out_are_found(found):
    reason = found["gait_events"]["reason"].copy()
    reason[reason == ""] = "turn"
    lines = [text for _, text in problems(found | {"gait_events": found["gait_events"] | {"reason": reason}})]
    assert any("no strikes of gait_events bound" in text for text in lines)


def test_of_a_suspect_walk_nothing_may_be_left(found):
    light = RedLight("S01", "walk_1", "", "the 3D has the wrong size", "")
    assert [path.split("/")[0] for path, _ in problems(found, [light])] == ["gait_events", "gait_steps", "gait"]
    hidden = {}
    for kind, table in found.items():
        name = TABLES.get(kind, kind)
        if kind.startswith("gait"):
            arrow = without_gait(tables.to_arrow(name, table))
            assert arrow.schema.equals(tables.to_arrow(name, table).schema, check_metadata=True)
            hidden[kind] = {key: np.array(arrow[key].to_pylist()) for key in arrow.column_names}
            hidden[kind] |= {key: hidden[kind][key].astype(float) for key in ("value",) if key in hidden[kind]}
    assert not problems(found | hidden, [light]) and len(hidden["gait"]["value"])


def test_a_table_that_lacks_is_found(found):
    left = {kind: table for kind, table in found.items() if kind != "gait_events"}
    (one,) = problems(left)
    assert one[0] == "gait_events/S01/walk_1.parquet" and "is not in the release" in one[1]
