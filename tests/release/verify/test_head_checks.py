"""What a release's own tables say of the covers of heads is looked at again."""

import json

import numpy as np
import pytest

from dior.geometry import camera_tables
from dior.release import heads
from dior.release.verify import head_checks
from dior.release.verify.folder_or_tarball import File
from dior.tables import tables
from tests.rig import ring

JOINTS = ("left_ear", "right_ear")
COUNT = 8
RECORDING = "p1/walk.cam01.parquet"
METRICS = "metric,tool,subject,sequence,camera,role,joint,value,low,high,unit,n\n"


@pytest.fixture
def release(tmp_path):
    """Columns by path, the tables about everything by name; what `problems` says of them."""
    view, n = ring(1)[0], COUNT * len(JOINTS)
    stamps = np.arange(COUNT, dtype=np.int64) * 33_333_333
    middle = np.stack([np.zeros(COUNT), np.linspace(-0.5, 0.5, COUNT), np.full(COUNT, 1.6)], axis=1)
    points = np.stack([middle + (0, side * 0.075, 0) for side in (1, -1)], axis=1)
    box, _ = heads.boxes(view, middle, np.zeros(COUNT), np.ones((COUNT, 2)))
    named = {"subject": "p1", "sequence": "walk", "camera": "cam01"}

    def of(count, **columns):
        return {key: [word] * count for key, word in named.items()} | columns

    body = of(n, joint=JOINTS * COUNT, instant=np.repeat(np.arange(COUNT), 2), stamp_ns=np.repeat(stamps, 2))
    body |= {axis: points[..., i].ravel() for i, axis in enumerate("xyz")} | {"status": ["ok"] * n}
    labels = of(n, joint=JOINTS * COUNT, frame=np.repeat(np.arange(COUNT), 2), stamp_ns=np.repeat(stamps, 2))
    edges = dict(zip(heads.EDGES, heads.on_grid(box).T, strict=True))
    found = {
        f"frames/{RECORDING}": ("released_frames", of(COUNT, frame=np.arange(COUNT), stamp_ns=stamps)),
        f"covers/{RECORDING}": (
            "released_covers",
            of(COUNT, frame=np.arange(COUNT), stamp_ns=stamps, what=["head"] * COUNT, **edges),
        ),
        f"labels_2d/{RECORDING}": ("labels_2d", labels | {"sigma_u": np.ones(n), "sigma_v": np.ones(n)}),
        "skeletons_3d/p1/walk.parquet": ("skeletons_3d", {key: body[key] for key in body if key != "camera"}),
    }
    rig = camera_tables.camera_columns([view], "lab")
    rig = {key: rig[key] for key in rig if key in tables.columns_of("released_cameras")}
    about = {
        "cameras": ("released_cameras", rig),
        "clocks": ("released_clocks", of(1, offset_s=[0.0], drift_ppm=[0.0])),
        "sequences": ("sequences", {"sequence": ["walk"], "session": ["lab"], "subject": ["p1"]}),
    }

    def problems(metrics="", faces="blurred"):
        files = {}
        for path, (kind, columns) in found.items():
            tables.write(tmp_path / path, kind, columns)
            files[path] = File(tmp_path / path, 0, (tmp_path / path).stat().st_size)
        texts = {"metrics.csv": METRICS + metrics, "provenance.json": json.dumps({"config": {"release.faces": faces}})}
        for path, text in texts.items():
            (tmp_path / path).write_text(text)
            files[path] = File(tmp_path / path, 0, len(text))
        known = {}
        for name, (kind, columns) in about.items():
            tables.write(tmp_path / f"{name}.parquet", kind, columns)
            known[name] = tables.read(tmp_path / f"{name}.parquet", kind)
        return [text for _, text in head_checks.problems(files, known)]

    return found, about, problems


def test_what_covers_the_heads_is_right(release):
    _, _, problems = release
    assert problems() == []


def test_a_cover_that_was_moved_or_left_out(release):
    found, _, problems = release
    covers = found[f"covers/{RECORDING}"][1]
    covers["u_min"][3] += 24
    assert problems() == ["1 pictures in which the head is not under its cover, first frame 3"]
    covers["what"][2:4] = ["other"] * 2
    assert problems() == ["2 pictures in which the head is not under its cover, first frame 2"]
    assert problems(faces="shown") == []
    del found[f"covers/{RECORDING}"]
    assert problems() == ["has pictures, but there is no table of what is covered in them"]


def test_a_head_that_nobody_knows(release):
    found, _, problems = release
    found["skeletons_3d/p1/walk.parquet"][1]["x"][:] = np.nan
    assert "8 pictures in which nobody knows where the head is, first frame 0" in problems()
    found[f"frames/{RECORDING}"][1]["no_image"] = ["head_unknown"] * COUNT
    assert problems() == []


@pytest.mark.parametrize("sigma", [np.nan, 30.0])
def test_labels_that_are_too_unsure(release, sigma):
    found, about, problems = release
    found[f"labels_2d/{RECORDING}"][1]["sigma_u"][:] = sigma
    assert any("labels have no sigma, or one of more than half a head" in text for text in problems())
    about["cameras"][1]["heads_checked"] = ["looked at all of them"]
    assert not any("no sigma" in text for text in problems())


def test_a_red_light(release):
    _, about, problems = release
    covered = "coverage,,p1,walk,cam01,long_range,,1.0,,,share,900\n"
    row = covered + "in_box_share,,p1,walk,cam01,long_range,,0.06,,,share,900\n"
    (text,) = problems(metrics=row)
    assert text.startswith("has pictures although its figures are red: 6.0 % of the labels")
    assert problems(metrics=row.replace("0.06", "0.96")) == []
    assert problems(metrics=row.replace("walk,cam01,long_range,,0.06", "walk,cam02,long_range,,0.06")) == []
    about["cameras"][1]["heads_checked"] = ["looked at all of them"]
    assert problems(metrics=row) == []
