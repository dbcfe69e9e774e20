"""Labels that a red light says are wrong are found where they are, and so is a light that is not told."""

import shutil

import numpy as np
import pytest

from dior.cli import main
from dior.release import layout
from dior.tables import tables
from tests.release import made as project
from tests.release import made_up
from tests.release.verify.test_verify import evaluated

LABELS = "labels_2d/zebra-0001/walk_2.cam02.parquet"
# with what YAML, HTML and Markdown take for their own
WHY = r"the boxes are of the _coat_ & no | line \\ of <b>mine</b> &amp; others  (A. P.)"
PLACE = "rows have a place although lights.parquet says that it is wrong, and that nobody accepts it"


@pytest.fixture
def problems(capsys):
    def lines(folder):
        code = main.main(["verify", str(folder)])
        found = capsys.readouterr().out.splitlines()
        return [] if code == 0 else [line.removeprefix("dior-0.1.0/") for line in found]

    return lines


def lit(folder, *rows):
    """`lights.parquet` of these rows, sequence, camera and who accepts it; the checksums made anew."""
    who = [made_up.WALKS[sequence][0] for sequence, *_ in rows]
    columns = {"subject": who, "reason": ["it was turned"] * len(rows)}
    columns |= dict(zip(("sequence", "camera", "accepted"), map(list, zip(*rows, strict=True)), strict=True))
    made_up.write(folder, "lights.parquet", "released_lights", columns)


def test_a_label_that_is_there_although_its_light_is_red(made, problems):
    lit(made, ("walk_2", "cam02", ""))
    assert problems(made) == [f"{LABELS}: 12 {PLACE}, first frame 0, joint nose"]


def test_of_a_walk_everything_is_looked_at(made, problems):
    lit(made, ("walk_2", "", ""))
    names = [LABELS.replace("cam02", name) for name in ("cam01", "cam02")] + ["skeletons_3d/zebra-0001/walk_2.parquet"]
    assert [line.split(": ")[0] for line in problems(made)] == names and all(PLACE in line for line in problems(made))


def test_of_a_suspect_row_nothing_is_left(made, problems):
    """A sigma tells how large the person is, and the depth where they were."""
    table = tables.read(made / LABELS, "labels_2d")
    nothing = {key: np.full(len(table["u"]), np.nan) for key in ("u", "v", "depth")}
    lit(made, ("walk_2", "cam02", ""))
    made_up.write(made, LABELS, "labels_2d", table | nothing | {"status": ["suspect"] * len(table["u"])})
    assert problems(made) == [f"{LABELS}: 12 {PLACE}, first frame 0, joint nose"], "sigma_u is"


def test_a_light_of_nobody_or_twice(made, problems):
    lit(made, ("walk_2", "cam09", ""), ("walk_2", "cam02", WHY), ("walk_2", "cam02", WHY))
    assert problems(made) == [
        "lights.parquet: recording 'zebra-0001 walk_2 cam09' is not in labels_2d/",
        "lights.parquet: walk_2 cam02 is there 2 times",
    ]


@pytest.fixture(scope="module")
def accepted(tmp_path_factory):
    """A release with red figures: walk_1.cam01 is off its hand check, and suspect; walk_2 is beside its detections and
    boxes, and walk_3 beside its detections, which are accepted."""
    arguments = project.project(tmp_path_factory.mktemp("accepted"))
    arguments["config"]["release"]["faces"] = "shown"
    path = arguments["project"] / "config/sessions/field/session.yaml"
    path.write_text(path.read_text() + f"labels_accepted: {{walk_2: '{WHY}', walk_3: '{WHY}'}}\n")
    return project.build(evaluated(arguments))


@pytest.fixture
def forged(accepted, tmp_path):
    return shutil.copytree(accepted, tmp_path / "dior-0.1.0")


def test_a_release_with_lights_is_whole(accepted, problems):
    rows = layout.rows_of(tables.read(accepted / "lights.parquet", "released_lights"))
    assert [(row["sequence"], row["camera"], row["accepted"]) for row in rows] == [
        *[("walk_3", camera, WHY) for camera in ("", "cam01", "cam03")],
        ("walk_1", "cam01", ""),
        *[("walk_2", camera, WHY) for camera in ("", "cam01", "cam02", "cam03")],
    ]
    labels = tables.read(accepted / "labels_2d/zebra-0001/walk_1.cam01.parquet", "labels_2d")
    assert set(labels["status"]) == {"suspect"}
    assert problems(accepted) == []


def edited(folder, keep=lambda table: table["sequence"] != "", **columns):
    table = tables.read(folder / "lights.parquet", "released_lights")
    made_up.write(folder, "lights.parquet", "released_lights", tables.rows(table | columns, keep(table)))


def test_a_red_figure_that_is_not_told(forged, problems):
    edited(forged, lambda table: table["camera"] != "cam02")
    found, word = problems(forged)
    assert word == "provenance.json: tells of another acceptance of walk_2 than lights.parquet"
    assert found.startswith("lights.parquet: does not tell of camera cam02 of walk_2, although the figures are red: ")


def test_suspect_labels_without_a_light_are_missing_ones(forged, problems):
    edited(forged, lambda table: table["sequence"] != "walk_1")
    assert any("walk_1.cam01.parquet: 6 labels are not where the 3D" in line for line in problems(forged))


def test_a_word_that_was_not_given(forged, problems):
    table = tables.read(forged / "lights.parquet", "released_lights")
    other = (table["sequence"] == "walk_2") & (table["camera"] == "cam02")
    edited(forged, accepted=np.where(other, "I was never asked", table["accepted"]).astype(object))
    assert problems(forged) == [
        "README.md: does not tell of walk_2 cam02 what lights.parquet does: I was never asked",
        "provenance.json: tells of another acceptance of walk_2 than lights.parquet",
    ]


def test_pictures_of_a_red_light_are_looked_for(tmp_path):
    """In a release that covers heads; where somebody has looked, the cover of what has no place is not judged."""
    from tests.release.verify import test_head_checks as heads

    found, about, said = heads.release.__wrapped__(tmp_path)
    lights = {"subject": ["p1"], "sequence": ["walk"], "camera": [""], "reason": ["too large"], "accepted": [""]}
    about["lights"] = ("released_lights", lights)
    assert said() == ["has pictures although a light is red: too large"]
    lights["camera"] = ["cam02"]
    assert said() == []
    lights["camera"], about["cameras"][1]["heads_checked"] = ["cam01"], ["looked at all of them"]
    found[f"labels_2d/{heads.RECORDING}"][1]["sigma_u"][:] = np.nan
    found["skeletons_3d/p1/walk.parquet"][1]["x"][:] = np.nan
    assert said() == []
    lights["accepted"] = [WHY]
    assert any("nobody knows where the head is" in text for text in said())
