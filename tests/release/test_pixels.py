"""The released pictures of a camera: covered, without anything beside them, and null with a reason."""

import cv2
import numpy as np
import pyarrow.parquet as pq
import pytest

from dior.errors import DiorError
from dior.ingest import frames
from dior.release import head_blur, jpeg, pixels, transform
from dior.tables import tables
from tests.ingest import bagfiles
from tests.release.test_jpeg import COMMENT, EXIF, dirty

TOPIC = "/cam01/image_raw/compressed"
SIZE = (48, 64)
STEP = 33_000_000


def scene(seed):
    small = np.random.default_rng(seed).integers(0, 256, (6, 8, 3), np.uint8)
    return cv2.resize(small, SIZE[::-1], interpolation=cv2.INTER_CUBIC)


@pytest.fixture
def recording(tmp_path):
    """Seven pictures: three JPEG with EXIF, a PNG, two damaged since they were indexed, one JPEG; the arguments of the
    step."""
    sent = [bagfiles.packed(TOPIC, bagfiles.T0 + i * STEP, scene(i), ".png" if i == 3 else ".jpg") for i in range(7)]
    for i in (0, 1, 2):
        data = dirty(sent[i].content["data"].tobytes(), EXIF, COMMENT) + b"behind the end"
        sent[i].content["data"] = np.frombuffer(data, np.uint8)
    index = tmp_path / "frames.parquet"
    bag = bagfiles.write(tmp_path / "pc1", sent, "ros1")
    frames.run(sequence="walk", bags=[bag], data_root=tmp_path, topics={"cam01": TOPIC}, out=index)
    bag.unlink()
    sent[4].content["data"] = sent[4].content["data"][:-40]
    sent[5].content["data"] = np.concatenate([sent[5].content["data"][:-2], np.frombuffer(b"\xff\xc4\0\5ab", np.uint8)])
    bagfiles.write(tmp_path / "pc1", sent, "ros1")
    given = {"sequence": "walk", "subject": "P01", "camera": "cam01", "frames": index, "data_root": tmp_path}
    given |= {"heads": _heads(tmp_path / "heads.parquet", "ok out_of_frame unknown ok ok out_of_frame ok".split())}
    given |= {"covers": _covers(tmp_path / "others.parquet", {}), "out_covers": tmp_path / "covers.parquet"}
    given |= {"faces": "filled", "consent": "yes", "shift": {}, "masks": [], "out": tmp_path / "out.parquet"}
    return sent, given | {"findings": tmp_path / "findings.parquet"}


BOX = (10, 4, 34, 36)


def _heads(path, status):
    edges = np.where([[word == "ok"] * 4 for word in status], BOX, np.nan)
    columns = dict(zip(("u_min", "v_min", "u_max", "v_max"), edges.T, strict=True))
    tables.write(path, "heads", {"frame": np.arange(len(status)), "status": status, **columns})
    return path


def _covers(path, boxes):
    """Table of what else is to be covered, `boxes` by frame."""
    edges = np.array([box for each in boxes.values() for box in each], float).reshape(-1, 4)
    frame = np.repeat(np.array([*boxes], int), [len(each) for each in boxes.values()])
    tables.write(path, "other_covers", {"frame": frame, **dict(zip(EDGES, edges.T, strict=True))})
    return path


EDGES = ("u_min", "v_min", "u_max", "v_max")


def decoded(data):
    return cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)


def test_pictures_of_a_camera(recording):
    sent, given = recording
    pixels.run(**given)
    table = tables.read(given["out"], "released_frames")
    assert table["no_image"].tolist() == ["", "", "head_unknown", "", "not_readable", "not_readable", ""]
    assert [image is None for image in table["image"]] == [False, False, True, False, True, True, False]
    assert set(table["subject"]) == {"P01"} and table["frame"].tolist() == list(range(7))
    assert table["stamp_ns"].tolist() == [bagfiles.T0 + i * STEP for i in range(7)]
    # no head: as recorded, without what is beside the picture
    assert table["image"][1] == jpeg.bare(sent[1].content["data"].tobytes())[0]
    for i in (0, 1, 3, 6):
        assert {marker for marker, _ in jpeg.segments(table["image"][i])} <= jpeg.KEPT
        assert b"Alice" not in table["image"][i] and table["image"][i].endswith(jpeg.EOI)
    # a head, in JPEG and PNG: grey inside, the picture outside (but for the blocks of the JPEG that hold both)
    inside = head_blur.ellipse(BOX, np.arange(SIZE[0]), np.arange(SIZE[1]))
    for i in (0, 3, 6):
        found = decoded(table["image"][i]).astype(int)
        assert np.abs(found[inside] - head_blur.GREY).mean() < 12
        assert np.abs(found[:, 48:] - scene(i).astype(int)[:, 48:]).mean() < 4
    (text,) = tables.read(given["findings"], "findings")["text"]
    assert text.startswith("2 of 7 pictures cannot be read") and "frame 4" in text


def test_a_recorded_picture_keeps_what_no_cover_touches(recording, monkeypatch):
    sent, given = recording
    pixels.run(**given)
    kept = tables.read(given["out"], "released_frames")["image"]
    # the blocks of 16 x 16 px that the ellipse is in, and what decoders smooth across their edge
    for i in (0, 6):
        same = decoded(kept[i]) == decoded(sent[i].content["data"].tobytes())
        assert same[:, 50:].all() and not same[8:32, 16:28].all()
    # where the library is not, the whole picture is decoded, as that of a PNG always is
    monkeypatch.setattr(transform, "library", lambda: None)
    given["out"].unlink()
    pixels.run(**given)
    again = tables.read(given["out"], "released_frames")
    assert again["no_image"].tolist() == ["", "", "head_unknown", "", "not_readable", "not_readable", ""]
    for i in (0, 6):
        assert kept[i] != again["image"][i]
        assert np.abs(decoded(kept[i]).astype(int) - decoded(again["image"][i])).mean() < 4
    assert [kept[i] == again["image"][i] for i in (1, 3)] == [True, True]


def test_a_picture_is_not_lost_because_memory_is_short(recording, monkeypatch):
    _, given = recording
    monkeypatch.setattr(pixels, "released", lambda *_: np.empty(2**50))
    with pytest.raises(MemoryError):
        pixels.run(**given)
    assert not given["out"].exists()


def test_what_else_moves_is_covered_whole_and_told(recording, tmp_path):
    _, given = recording
    other = (40, 8, 70, 30)
    pixels.run(**given | {"covers": _covers(tmp_path / "some.parquet", {1: [other], 2: [other], 3: [other, BOX]})})
    table = tables.read(given["out"], "released_frames")
    for i in (1, 3):
        found = decoded(table["image"][i]).astype(int)
        assert np.abs(found[8:30, 40:] - head_blur.GREY).mean() < 12
    covers = tables.read(given["out_covers"], "released_covers")
    rows = list(zip(covers["frame"].tolist(), covers["what"], *(covers[key].tolist() for key in EDGES), strict=True))
    assert rows == [
        (0, "head", *BOX), (1, "other", *other), (3, "head", *BOX), (3, "other", *other), (3, "other", *BOX),
        (6, "head", *BOX),
    ]  # fmt: skip
    assert set(covers["subject"]) == {"P01"} and set(covers["camera"]) == {"cam01"}
    assert covers["stamp_ns"].tolist() == [bagfiles.T0 + i * STEP for i in (0, 1, 3, 3, 3, 6)]


@pytest.mark.parametrize("word", ["uncertain", "red", "unseen", "beside"])
def test_a_picture_whose_head_is_not_surely_covered_is_not_released(recording, tmp_path, word):
    _, given = recording
    pixels.run(**given | {"heads": _heads(tmp_path / "doubt.parquet", [word] * 7)})
    table = tables.read(given["out"], "released_frames")
    assert set(table["no_image"]) == {f"head_{word}"} and all(image is None for image in table["image"])
    assert not len(tables.read(given["out_covers"], "released_covers")["frame"])


def test_same_bytes_and_no_picture_in_the_statistics(recording):
    _, given = recording
    pixels.run(**given)
    first = given["out"].read_bytes()
    given["out"].unlink()
    pixels.run(**given)
    assert given["out"].read_bytes() == first
    group = pq.ParquetFile(given["out"]).metadata.row_group(0)
    columns = {group.column(i).path_in_schema: group.column(i) for i in range(group.num_columns)}
    assert columns["image.bytes"].statistics is None and columns["image.bytes"].compression == "UNCOMPRESSED"


def test_row_groups_are_small_and_in_order(recording, monkeypatch):
    _, given = recording
    monkeypatch.setattr(pixels, "GROUP", 3)
    pixels.run(**given)
    file = pq.ParquetFile(given["out"])
    assert [file.metadata.row_group(i).num_rows for i in range(file.num_row_groups)] == [3, 3, 1]
    assert tables.read(given["out"], "released_frames")["frame"].tolist() == list(range(7))


def test_without_consent_no_bag_is_opened(recording):
    _, given = recording
    pixels.run(**given | {"consent": "no", "heads": None, "covers": None, "data_root": given["data_root"] / "gone"})
    table = tables.read(given["out"], "released_frames")
    assert set(table["no_image"]) == {"no_consent"} and all(image is None for image in table["image"])


def test_shown_faces_are_passed_on(recording):
    sent, given = recording
    pixels.run(**given | {"faces": "shown", "heads": None, "covers": None})
    table = tables.read(given["out"], "released_frames")
    for i in (0, 1, 2, 6):
        assert table["image"][i] == jpeg.bare(sent[i].content["data"].tobytes())[0]


@pytest.mark.parametrize("faces", ["filled", "shown"])
def test_a_privacy_mask_is_covered_in_all_pictures_whatever_happens_to_faces(recording, faces):
    sent, given = recording
    whole = given if faces == "filled" else given | {"heads": None, "covers": None}
    pixels.run(**whole | {"faces": faces, "masks": [[30, 8, 59.2, 29.5], [-0.5, -0.5, 2, 2]]})
    table, covers = tables.read(given["out"], "released_frames"), tables.read(given["out_covers"], "released_covers")
    edges = np.stack([covers[key] for key in EDGES], axis=1)
    shown = [i for i, image in enumerate(table["image"]) if image is not None]
    assert len(shown) > 3 and (covers["what"][(edges == (30, 8, 60, 30)).all(axis=1)] == "other").all()
    assert covers["frame"][(edges == (30, 8, 60, 30)).all(axis=1)].tolist() == shown
    assert covers["frame"][(edges == (0, 0, 3, 3)).all(axis=1)].tolist() == shown
    for i in shown:
        off = np.abs(decoded(table["image"][i]).astype(int) - scene(i)).mean(axis=2)
        assert off[8:30, 30:60].mean() > 8 and off[40:].max() < 16


def test_a_privacy_mask_outside_of_the_pictures_is_refused(recording):
    _, given = recording
    with pytest.raises(DiorError, match=r"walk, camera cam01: `privacy_masks` .* of its pictures of \d+x\d+ px"):
        pixels.run(**given | {"masks": [[5000, 0, 5010, 20]]})


def test_stamps_count_from_the_persons_first_picture(recording):
    from dior.release import shift_stamps

    _, given = recording
    pixels.run(**given | {"shift": {"frames": [str(given["frames"])]}})
    table = tables.read(given["out"], "released_frames")
    assert table["stamp_ns"].tolist() == [shift_stamps.FIRST_NS + i * STEP for i in range(7)]


def test_other_pictures_in_heads_are_refused(recording, tmp_path):
    _, given = recording
    with pytest.raises(DiorError, match="is of other pictures"):
        pixels.run(**given | {"heads": _heads(tmp_path / "other.parquet", ["ok"] * 6)})
    assert not given["out"].exists()


def test_no_picture_is_released_without_knowing_where_the_heads_are(recording):
    _, given = recording
    with pytest.raises(DiorError, match="walk, camera cam01: faces are to be filled, but no table of heads is given"):
        pixels.run(**given | {"heads": None})
    assert not given["out"].exists()
    pixels.run(**given | {"heads": None, "consent": "no"})
    assert set(tables.read(given["out"], "released_frames")["no_image"]) == {"no_consent"}
