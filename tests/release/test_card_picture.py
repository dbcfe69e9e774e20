"""The picture on the card: released pictures of one person alone, the head covered, the same every time."""

from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from dior.release import card_picture, jpeg
from dior.release.verify import card_checks, folder_or_tarball
from dior.tables import tables
from tests.release import small
from tests.release.made import build

HALF = 40  # px, of the box around a head


def covers(folder, subject, sequence, camera, environment, others=()):
    """The head of each picture, in a box around the mean of the face; `others`: (frame, edges)."""
    uv, _ = small.truth(environment, camera)
    head = uv[:, :5].mean(axis=1)
    boxes = [(frame, "head", *np.rint([*(at - HALF), *(at + HALF)])) for frame, at in enumerate(head)]
    boxes += [(frame, "other", *edges) for frame, edges in others]
    columns = dict(zip(("frame", "what", *card_picture.EDGES), map(list, zip(*boxes, strict=True)), strict=True))
    own = {"subject": subject, "sequence": sequence, "camera": camera, "stamp_ns": 0}
    columns |= {key: [value] * len(boxes) for key, value in own.items()}
    path = folder / f"covers/{subject}/{sequence}.{camera}.parquet"
    tables.write(path, "released_covers", columns)
    return path


@pytest.fixture
def release(tmp_path):
    """Both people agreed to pictures, whose grey tells the frame; cam02 is far away."""
    folder = tmp_path / "dior-0.1.0"
    small.build(folder)
    grey = [cv2.imencode(".jpg", np.full((720, 1280, 3), 20 * i, np.uint8))[1].tobytes() for i in range(small.PICTURES)]
    for subject, sequence, *_, environment, _, _ in small.WALKS:
        for camera in small.CAMERAS:
            covers(folder, subject, sequence, camera, environment)
            path = folder / f"frames/{subject}/{sequence}.{camera}.parquet"
            there = {"image": [jpeg.bare(one)[0] for one in grey], "no_image": [""] * small.PICTURES}
            tables.write(path, "released_frames", tables.read(path, "released_frames") | there)
    rig = tables.read(folder / "cameras.parquet", "released_cameras")
    far = np.where(rig["camera"] == "cam02", "long_range", "close").astype(object)
    tables.write(folder / "cameras.parquet", "released_cameras", rig | {"role": far})
    return folder


def shown(folder, **cameras):
    sheet = tables.read(folder / "sequences.parquet", "sequences")
    rig = tables.read(folder / "cameras.parquet", "released_cameras") | cameras
    return card_picture.panels(card_picture.of_folder(folder), sheet, rig)


def withheld(folder, who):
    """The release after somebody did not agree to pictures."""
    for path in folder.glob(f"frames/{who}/*.parquet"):
        table = tables.read(path, "released_frames")
        count = len(table["frame"])
        none = {"image": np.full(count, None, object), "no_image": np.full(count, "no_consent", object)}
        tables.write(path, "released_frames", table | none)


def test_one_person_is_shown_by_each_kind_of_camera(release):
    found = shown(release)
    assert [(one.recording.split("/")[0], one.environment, one.role) for one in found] == [
        ("pa11", "indoor", "close"), ("pa11", "indoor", "long_range"),
        ("pa11", "outdoor", "close"), ("pa11", "outdoor", "long_range"),
    ]  # fmt: skip
    assert found[3].words.startswith("outdoor, long range, ") and found[3].words.endswith(" m")
    drawn = card_picture.drawn(card_picture.of_folder(release), found)
    for i, panel in enumerate(found):
        # the corner of a tile is what the picture of the frame is there
        assert abs(int(drawn[2, i * (card_picture.TILE[0] + 4) + 2, 0]) - 20 * panel.frame) < 3


@pytest.mark.parametrize("who", ["pa11", "pb22"])
def test_who_did_not_agree_is_not_shown(release, who):
    withheld(release, who)
    found = shown(release)
    assert len(found) == 4 and {one.recording.split("/")[0] for one in found} == {"pa11", "pb22"} - {who}
    withheld(release, ({"pa11", "pb22"} - {who}).pop())
    assert not shown(release)


def test_a_picture_without_a_covered_head_is_not_shown(release):
    (panel,) = (one for one in shown(release) if one.recording == "pa11/walk_2.cam01.parquet")
    path = release / f"covers/{panel.recording}"
    table = tables.read(path, "released_covers")

    def without(row):
        """No head in the frame, or one that reaches out of the picture, as one that is not found at the edge would."""
        return tables.rows(table, table["frame"] != row), table | {"u_min": np.where(table["frame"] == row, -1, 1.0)}

    for changed in without(panel.frame):
        tables.write(path, "released_covers", changed)
        again = [one for one in shown(release) if one.recording == panel.recording]
        assert all(one.frame != panel.frame for one in again)
    path.unlink()
    assert all(one.recording != panel.recording for one in shown(release))


def test_a_picture_in_which_more_is_covered_comes_last(release):
    panel = shown(release)[2]
    everything = [(frame, (0.0, 0.0, 1280.0, 720.0)) for frame in range(small.PICTURES) if frame != 7]
    covers(release, "pa11", "walk_2", "cam01", "outdoor", everything)
    assert shown(release)[2].frame == 7 != panel.frame


def test_a_camera_that_somebody_vouches_for_is_not_shown(release):
    rig = tables.read(release / "cameras.parquet", "released_cameras")
    checked = np.where(rig["camera"] == "cam01", "I looked", "").astype(object)
    assert {one.role for one in shown(release, heads_checked=checked)} == {"long_range"}


def test_it_is_written_alike_and_without_anything_but_the_picture(release):
    sheet, rig = (tables.read(release / f"{name}.parquet", kind) for name, kind in
                  (("sequences", "sequences"), ("cameras", "released_cameras")))  # fmt: skip
    words = card_picture.write(release, sheet, rig)
    first = (release / card_picture.FILE).read_bytes()
    assert words.startswith("indoor, close camera; ") and jpeg.bare(first) == (first, True)
    assert card_picture.write(release, sheet, rig) == words and (release / card_picture.FILE).read_bytes() == first


def verified(folder, faces="blurred"):
    files, _ = folder_or_tarball.of_folder(folder)
    top = {name: tables.read(folder / f"{name}.parquet", kind) for name, kind in
           (("sequences", "sequences"), ("cameras", "released_cameras"))}  # fmt: skip
    rig = SimpleNamespace(settings={"release.faces": faces})
    return card_checks.check(SimpleNamespace(files=files, tables=top, rig=rig))


def test_verify_draws_it_anew(release):
    path, card = release / card_picture.FILE, release / "README.md"
    card.write_text("no picture\n")
    assert verified(release) == []
    card.write_text("![Labels](card.jpg)\n")
    assert verified(release) == [("README.md", "shows card.jpg, which is not in the release")]
    test_it_is_written_alike_and_without_anything_but_the_picture(release)
    assert verified(release) == []
    ((name, text),) = verified(release, "shown")
    assert name == "card.jpg" and text.startswith("shows somebody, and nothing in the release may be shown")
    good = path.read_bytes()
    path.write_bytes(good[:2] + b"\xff\xfe\x00\x06home" + good[2:])
    assert "card.jpg" == verified(release)[0][0]
    other = cv2.imdecode(np.frombuffer(good, np.uint8), cv2.IMREAD_COLOR)
    path.write_bytes(jpeg.encoded(255 - other))
    assert verified(release) == [("card.jpg", "is not the picture that the pictures and labels of the release give")]
    path.write_bytes(good)
    card.write_text("no picture\n")
    assert verified(release) == [("README.md", "does not show card.jpg")]
    withheld(release, "pa11")
    withheld(release, "pb22")
    assert "nothing in the release may be shown" in verified(release)[0][1]


def test_without_consent_nothing_is_said_but_that(made):
    out = build(made)
    assert "\nThere is no picture here: nobody in it agreed to pictures.\n" in (out / "README.md").read_text()
    assert not (out / card_picture.FILE).exists()


def test_the_card_shows_it_unless_faces_are_shown(made, monkeypatch):
    def written(folder, *_):
        (folder / card_picture.FILE).write_bytes(b"a picture")
        return "indoor, close camera"

    monkeypatch.setattr(card_picture, "write", written)
    out = build(made)
    card = (out / "README.md").read_text()
    assert "\n![Labels over released pictures: indoor, close camera](card.jpg)\n" in card
    assert "There is no picture here" not in card and "  card.jpg\n" in (out / "SHA256SUMS").read_text()
    made["config"]["release"]["faces"] = "shown"
    assert not (build(made) / card_picture.FILE).exists()
