"""Galleries written here, in folders and in a bag."""

import cv2
import numpy as np
import pytest

from dior.errors import DiorError
from dior.ingest import gallery
from dior.tables import tables
from tests.ingest.test_bags import T0, TOPIC, pictures, write_bag


def row(subject="S01", outfit="coat", angle="frontal", path="", bag="", topic=""):
    return {"subject": subject, "outfit": outfit, "angle": angle, "path": path, "bag": bag, "topic": topic}


def folder(path, names, size=(48, 64)):
    path.mkdir(parents=True)
    for name in names:
        cv2.imwrite(str(path / name), np.full((*size, 3), 90, np.uint8))


def run(tmp_path, rows):
    gallery.run(
        rows=rows, data_root=tmp_path, out=tmp_path / "out.parquet", findings=tmp_path / "findings.parquet"
    )  # fmt: skip
    found = tables.read(tmp_path / "findings.parquet", "findings")
    return tables.read(tmp_path / "out.parquet", "gallery"), list(
        zip(*(found[key] for key in ("scope", "severity", "code", "text")), strict=True)
    )


def test_folders_and_a_bag_are_indexed_and_counted(tmp_path):
    folder(tmp_path / "g/front", ["0.jpg", "90.jpg", "180.PNG", "270.jpeg", "10.jpg"])
    (tmp_path / "g/front/notes.txt").write_text("not a picture")
    write_bag(tmp_path / "down.bag", pictures([T0 + 20, T0, T0 + 10, T0 + 40, T0 + 30]))
    rows = [row(path="g/front/"), row(angle="down45", bag="down.bag", topic=TOPIC)]
    table, findings = run(tmp_path, rows)
    assert table["angle"].tolist() == ["down45"] * 5 + ["frontal"] * 5
    assert table["picture"].tolist() == [0, 1, 2, 3, 4] * 2
    assert table["file"].tolist()[5:] == [f"g/front/{n}" for n in ("0.jpg", "10.jpg", "90.jpg", "180.PNG", "270.jpeg")]
    assert table["stamp_ns"].tolist() == [T0, T0 + 10, T0 + 20, T0 + 30, T0 + 40] + [-1] * 5
    assert set(table["file"][:5]) == {"down.bag"} and set(table["height"]) == {48} and set(table["width"]) == {64}
    assert findings == [("S01", "info", "gallery", "10 gallery pictures: coat down45 5, coat frontal 5")]
    assert run(tmp_path, rows[::-1])[0]["file"].tolist() == table["file"].tolist()


def test_an_outfit_without_an_angle_and_one_with_few_pictures_are_found(tmp_path):
    names = [f"{i}.jpg" for i in range(6)]
    folder(tmp_path / "a", names)
    folder(tmp_path / "b", names)
    folder(tmp_path / "c", names[:2])
    rows = [row(path="a"), row(angle="down45", path="b"), row(outfit="shirt", path="c"), row("S02", path="a")]
    _, findings = run(tmp_path, rows)
    warned = [(scope, text) for scope, severity, _, text in findings if severity == "warning"]
    assert warned == [
        ("S01", "shirt from down45 has 0 pictures in the gallery, others 6"),
        ("S01", "shirt from frontal has 2 pictures in the gallery, others 6"),
    ]


def test_an_empty_gallery_is_an_empty_table(tmp_path):
    table, findings = run(tmp_path, [])
    assert not len(table["file"]) and findings == []


@pytest.mark.parametrize(
    ("path", "text"),
    [
        ("nowhere", "config/gallery.tsv, S01, coat, frontal: there is no folder"),
        ("empty", "holds no picture"),
        ("broken", "broken/1.jpg is no readable picture .it is empty"),
        ("huge", "huge/1.png is no readable picture .it claims to be 60000x60000 px"),
        ("damaged", "damaged/1.png is no readable picture"),
    ],
)
def test_folders_that_cannot_be_read(tmp_path, path, text):
    (tmp_path / "empty").mkdir()
    (tmp_path / "broken").mkdir()
    (tmp_path / "broken/1.jpg").write_bytes(b"")
    folder(tmp_path / "huge", ["1.png"])
    whole = (tmp_path / "huge/1.png").read_bytes()
    (tmp_path / "huge/1.png").write_bytes(whole[:16] + 2 * (60000).to_bytes(4, "big") + whole[24:])
    (tmp_path / "damaged").mkdir()
    (tmp_path / "damaged/1.png").write_bytes(whole[:40])
    with pytest.raises(DiorError, match=text):
        run(tmp_path, [row(path=path)])


def test_a_bag_without_the_topic(tmp_path):
    write_bag(tmp_path / "g.bag", pictures([T0]))
    with pytest.raises(DiorError, match="topic /other is not in"):
        run(tmp_path, [row(bag="g.bag", topic="/other")])
