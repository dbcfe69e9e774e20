"""Whoever changes a release on purpose makes the checksums anew; what is changed alone is found, and named."""

import json
import re

import cv2
import numpy as np
import pytest

from dior.body.names import COCO_17, MLKIT_33
from dior.cli import main
from dior.evaluate import bootstrap
from dior.evaluate.grids import LabelGrid
from dior.geometry.camera import Camera, Intrinsics, pose
from dior.geometry.multiview import look_at
from dior.label import reproject
from dior.release import citation
from dior.release.verify import evidence, figures, pictures, projections, sample
from dior.tables import tables
from tests.release import made_up

LABELS = "labels_2d/zebra-0001/walk_2.cam02.parquet"
FRAMES = "frames/zebra-0001/walk_2.cam02.parquet"


@pytest.fixture
def verified(capsys):
    def lines(folder):
        code = main.main(["verify", str(folder)])
        found = capsys.readouterr().out.splitlines()
        assert code == (0 if "checksums right" in found[0] else 1)
        return [] if code == 0 else [line.removeprefix("dior-0.1.0/") for line in found]

    return lines


def edited(folder, name, kind, change):
    """A table after `change` of its columns, and the checksums made anew."""
    table = tables.read(folder / name, kind)
    made_up.write(folder, name, kind, table | change(table))


def test_one_label_that_moved_by_3_px(made, verified):
    def moved(table):
        u = table["u"].copy()
        u[7] += 3
        return {"u": u}

    edited(made, LABELS, "labels_2d", moved)
    assert verified(made) == [
        f"{LABELS}: 1 labels are not where the 3D, the camera and its clock put them: frame 2, joint left_hip is off "
        "by 3 px; 1 of 4 frames, first 2"
    ]


def test_a_label_that_moved_by_the_least_that_a_float32_can_move(made, verified):
    """Half a unit in the last place is rounding; two units are none, a ten-thousandth of a pixel at u = 1000."""

    def moved(table):
        u = table["u"].copy()
        u[7] = np.nextafter(np.nextafter(u[7], np.float32(99)), np.float32(99))
        return {"u": u}

    edited(made, LABELS, "labels_2d", moved)
    (line,) = verified(made)
    assert line.startswith(f"{LABELS}: 1 labels are not where")


def test_a_depth_and_a_point_that_moved(made, verified):
    edited(made, LABELS, "labels_2d", lambda table: {"depth": table["depth"] + np.float32(0.01)})
    assert verified(made) == [f"{LABELS}: 11 depths are not those of the 3D, first frame 0, joint nose"]
    edited(made, LABELS, "labels_2d", lambda table: {"depth": table["depth"] - np.float32(0.01)})
    path = "skeletons_3d/zebra-0001/walk_2.parquet"
    edited(made, path, "skeletons_3d", lambda table: {"x": table["x"] + np.float32(0.001)})
    lines = verified(made)
    assert [line.split(":")[0] for line in lines] == [LABELS.replace("cam02", "cam01"), LABELS]
    assert all("all frames with 3D" in line for line in lines)


def test_a_stamp_that_moved_everywhere(made, verified):
    """In all tables that have it, by 5 ms; whoever walks has moved in that time."""

    def late(table):
        stamps = np.array(table["stamp_ns"])
        stamps[table["frame"] == 2] += 5_000_000
        return {"stamp_ns": stamps}

    edited(made, LABELS, "labels_2d", late)
    edited(made, "boxes/zebra-0001/walk_2.cam02.parquet", "released_boxes", late)
    edited(made, FRAMES, "released_frames", late)
    (line,) = verified(made)
    assert line.startswith(f"{LABELS}: 3 labels are not where") and "first 2" in line


@pytest.mark.parametrize(
    ("columns", "who"),
    [
        (made_up.cameras(fx=[20.0, 20.5, 20.0, 20.0]), {"walk_2.cam02", "walk_3.cam02"}),
        (made_up.cameras(cx=[21.0, 20.0, 20.0, 20.0]), {"walk_2.cam01", "walk_3.cam01"}),
        (made_up.cameras(wTc=[np.eye(4).ravel()] * 3 + [pose(np.eye(3), (0, 0.1, 0)).ravel()]), {"walk_1.cam02"}),
    ],
)
def test_a_camera_that_was_changed(made, verified, columns, who):
    made_up.write(made, "cameras.parquet", "released_cameras", columns)
    assert {line.split("/")[2].split(".parquet")[0] for line in verified(made)} == who


def test_two_cameras_that_were_exchanged(made, verified):
    """With a lens of its own each: the rows of cameras.parquet, or the labels, under each other's name."""
    edited(made, "cameras.parquet", "released_cameras", lambda table: {"cx": np.array([20.0, 20.0, 20.0, 25.0])})
    for walk in ("walk_1",):
        name = f"labels_2d/zebra-0001/{walk}.cam02.parquet"
        edited(made, name, "labels_2d", lambda table: {"u": (table["u"].astype(float) + 5.0).astype(np.float32)})
    assert all("figures" in line or "status" in line for line in verified(made)), "the labels are right again"
    edited(made, "cameras.parquet", "released_cameras", lambda table: {"cx": np.array([20.0, 20.0, 25.0, 20.0])})
    assert [line.split(":")[0] for line in verified(made)] == [
        f"labels_2d/zebra-0001/walk_1.{camera}.parquet" for camera in made_up.CAMERAS
    ]


def test_a_clock_that_was_changed(made, verified):
    made_up.write(made, "clocks.parquet", "released_clocks", made_up.clocks(offset_s=[0.5, 0.5, 0.5, 0.5001, 0.5, 0.5]))
    (line,) = verified(made)
    assert line.startswith(f"{LABELS}: ") and "clock" in line


def replaced(folder, name, old, new):
    text = (folder / name).read_text()
    changed = re.sub(old, new, text, flags=re.MULTILINE)
    assert changed != text
    (folder / name).write_text(changed)
    made_up.remade(folder)


@pytest.mark.parametrize(
    ("name", "old", "new", "problem"),
    [
        ("metrics.csv", r"^(coverage,,zebra-0001,walk_2,cam02,long_range,nose),1.0", r"\1,0.5",
         "metrics.csv: has figures that are not those of the tables: 1, first coverage zebra-0001 walk_2 cam02 "
         "long_range nose is 0.5 of 4, the tables give 1 of 4"),
        ("metrics.csv", r"^in_box_share,,zebra-0001,walk_2,cam02.*\n", "",
         "metrics.csv: lacks figures that the tables give: 1, first in_box_share zebra-0001 walk_2 cam02 long_range"),
        ("metrics.csv", r"^(coverage,,zebra-0001,walk_2),cam02", r"\1,cam01",
         "metrics.csv: lacks figures that the tables give: 4, first coverage zebra-0001 walk_2 cam02 long_range"),
        ("metrics.csv", r"^(coverage,,,,,,),[0-9.]+", r"\1,0.99",
         "metrics.csv: has pooled figures that are not those of their rows: 1, first coverage is 0.99 (0.916667 to "
         "0.916667) of 72, its rows give 0.916667 (0.916667 to 0.916667) of 72"),
        ("metrics.csv", r"^coverage,,,,cam02,long_range.*\n", "",
         "metrics.csv: lacks pooled figures: 1, first coverage cam02 long_range"),
        ("README.md", r"^(\| coverage \|  \|  \| all \|) \S+", r"\1 99.0",
         "README.md: 1 of its figures are not those of metrics.csv, first coverage all: 99.0 % 72, not 91.7 % 72"),
        ("README.md", "cc0-1.0", "cc-by-4.0",
         'README.md: its front matter does not say license: "cc0-1.0", which provenance.json does'),
        ("README.md", "of 3 walks", "of 4 walks",
         "README.md: has no line with the counts of '2D and 3D skeleton labels of 3 walks of 2 subjects (1 indoor, 2 "
         "outdoor): 60 labels inside the picture on 24 frames. Some cameras are so far away that no detector works on "
         "their pictures.'"),
        ("README.md", r"title = \{\{made up\}\}", "title = {{mine}}",
         "README.md: cites another title, author, version, year or DOI than provenance.json has"),
        ("README.md", "^# made up", "# mine",
         "README.md: has no line '# made up', by which title, version, authors and licence are those of "
         "provenance.json"),
        ("LICENSE", "CC0-1.0", "CC-BY-4.0", "LICENSE: is not the text of CC0-1.0, which provenance.json says"),
        ("CITATION.cff", 'version: "0.1.0"', 'version: "0.2.0"',
         'CITATION.cff: does not say version: "0.1.0", which provenance.json does'),
        ("croissant.json", "zero/1.0", "by/4.0",
         'croissant.json: says license "https://creativecommons.org/publicdomain/by/4.0/legalcode"; provenance.json '
         'has "https://creativecommons.org/publicdomain/zero/1.0/legalcode"'),
        ("croissant.json", "of 3 walks", "of 4 walks",
         "croissant.json: its description has other counts than"),
        ("croissant.json", '"name": "depth"', '"name": "distance"',
         "croissant.json: does not describe the table labels_2d with its columns and their types"),
        ("provenance.json", '"spline"', '"none"', "provenance.json: its config_sha256 is not that of its settings"),
        ("provenance.json", '"walk_3": ', '"walk_9": ', "provenance.json: tells nothing of sequence 'walk_3'"),
    ],
)  # fmt: skip
def test_texts_that_are_not_those_of_the_tables(made, verified, name, old, new, problem):
    replaced(made, name, old, new)
    lines = verified(made)
    assert any(line.startswith(problem) for line in lines), lines
    # a figure that is wrong in metrics.csv is so in the card, whose rows are of it
    assert {line.split(":")[0] for line in lines} <= {name, "README.md"}


def test_metrics_that_cannot_be_read(made, verified):
    replaced(made, "metrics.csv", r"^(coverage,,,,,,),[0-9.]+", r"\1,much")
    assert any(
        re.fullmatch(r"metrics.csv: is not as dior writes it: line \d+ has no value or no count", line)
        for line in verified(made)
    )


def test_a_licence_of_ones_own(made, verified):
    """A file with a byte order mark and Windows line ends is released without either."""
    content = json.loads((made / "provenance.json").read_text())
    about = made_up.ABOUT | {"license": "Lab-DUA", "license_file": "x"}
    source = b"\xef\xbb\xbfYou may.\r\nYou must not.\r\n"
    told = {f"release.{key}": value for key, value in about.items()}
    told["release.license_file"] = f"sha256:{made_up.hashlib.sha256(source).hexdigest()}"
    content["config"] |= told
    content["config_sha256"] = made_up.hashlib.sha256(
        json.dumps(content["config"], sort_keys=True).encode()
    ).hexdigest()
    (made / "provenance.json").write_text(json.dumps(content))
    (made / "LICENSE").write_text("You may.\nYou must not.\n")
    (made / "CITATION.cff").write_text(citation.text(about))
    for name, old, new in (
        ("README.md", '^license: "cc0-1.0"$', 'license: other\nlicense_name: "lab-dua"\nlicense_link: LICENSE'),
        ("README.md", r"\[CC0-1.0\]\(\S+\)\.", "Lab-DUA, see LICENSE."),
        ("croissant.json", "https://creativecommons.org/publicdomain/zero/1.0/legalcode", "Lab-DUA"),
    ):
        replaced(made, name, old, new)
    assert verified(made) == []
    replaced(made, "LICENSE", "not", "")
    assert verified(made) == ["LICENSE: is not the file with the text of Lab-DUA whose checksum provenance.json has"]


def test_a_released_pooling_is_that_of_the_step(whole):
    """`figures` pools without pandas; the step's own rows, to six digits, are the same."""
    rows = list(figures.read((whole / "metrics.csv").read_bytes()))
    stated = {tuple(row[key] for key in figures.KEY): row for row in rows}
    assert len({key[0] for key in stated}) == 9 and not list(figures._pooled(stated))
    means = figures._means([row for row in rows if row["sequence"] and row["camera"]])
    assert means.keys() == stated.keys()
    low, high = bootstrap.of_mean(np.array([20.0, 40.0]), np.array([24, 48]))
    assert (low, high) == pytest.approx((20 / 24, 20 / 24))


def test_left_and_right_may_have_been_exchanged():
    """What was exchanged is not in the release: a figure may lie between that of nothing and that of the best."""
    joints = ["left_hip", "right_hip"]
    uv = np.array([[[0.0, 0.0], [10.0, 0.0]]])
    grid = LabelGrid("cam01", np.array([0]), np.array([0]), joints, uv, np.ones((1, 2), bool), np.zeros((1, 2), bool))
    detected = {
        "joint": np.array(joints, object), "frame": np.array([0, 0]), "u": np.array([11.0, 1.0]),
        "v": np.zeros(2), "score": np.ones(2),
    }  # fmt: skip
    low, high = figures._reprojection(grid, detected, 0.3)
    assert low.tolist() == [[1, 1]] and high.tolist() == [[11, 9]]
    one = figures._expected(low, high)
    assert (one.low, one.high, one.n_low) == (1, 10, 2)
    assert figures._agrees({"value": 1.0, "n": 2}, one) and not figures._agrees({"value": 0.99, "n": 2}, one)
    low, high = figures._reprojection(grid, detected | {"score": np.array([0.1, 1.0])}, 0.3)
    one = figures._expected(low, high)
    assert (one.n_low, one.n_high) == (0, 2), "which of the two is compared nobody knows"
    for n, value in ((1, 1.0), (1, 9.0), (2, 5.0)):
        assert figures._agrees({"value": value, "n": n}, one)


@pytest.mark.parametrize("model", ["plumb_bob", "rational_polynomial", "inverse_brown_conrady"])
def test_labels_through_any_lens_are_recomputed_to_the_last_digit(model):
    """Random walkers, lenses and clocks, labels before, behind and beside the camera; stamps that were shifted."""
    rng = np.random.default_rng(1)
    for shift in (0, 1_700_000_000 * 10**9 - 315_532_800 * 10**9):
        lens = Intrinsics(1280, 720, 640.0, 641.0, 640.5, 359.2, model, tuple(rng.normal(0, 0.01, 8)))
        centre = rng.normal(0, 0.5, 3)
        camera = Camera("cam01", lens, pose(look_at(centre, (0.0, 0.0, 1.0)), centre))
        count, each = 40, len(COCO_17)
        stamps = 1_700_000_000 * 10**9 - shift + np.rint(np.arange(count) * 1e9 / 30).astype(np.int64)
        points = rng.normal(0, 2, (count, each, 3)).astype(np.float32)
        points[rng.random((count, each)) < 0.1] = np.nan
        skeleton = {
            "joint": np.array(list(COCO_17) * count, object), "stamp_ns": np.repeat(stamps, each),
            "instant": np.repeat(np.arange(count), each),
            **{axis: points[..., i].ravel() for i, axis in enumerate("xyz")},
            "status": np.where(np.isfinite(points[..., 0]), "ok", "missing_3d").ravel().astype(object),
        }  # fmt: skip
        clock = (0.0213, -12.5)
        when = stamps[3:-3] - 9_000_000
        at, joints = projections.at_stamps(skeleton, when, clock)
        uv, depth, status = reproject.labels(camera, at, joints)
        labels = {
            "joint": np.array(list(COCO_17) * len(when), object), "frame": np.repeat(np.arange(len(when)), each),
            "stamp_ns": np.repeat(when, each), "status": status.ravel().astype(object),
            "depth": depth.ravel().astype(np.float32),
            **{axis: uv[..., i].ravel().astype(np.float32) for i, axis in enumerate("uv")},
        }  # fmt: skip
        assert {"missing_3d", "behind_camera", "out_of_frame", "ok"} <= set(status.ravel())
        assert list(projections.of_labels(labels, skeleton, camera, clock)) == []
        labels["stamp_ns"] = labels["stamp_ns"] + 100_000
        assert list(projections.of_labels(labels, skeleton, camera, clock)), "0.1 ms"


# a walk for the checks of pictures: a bright person on a floor of noise, 48 pictures
COUNT, HIGH, WIDE = 48, 72, 128


def place(frame, way=1):
    return 8 + 2 * (frame if way > 0 else COUNT - 1 - frame)


def recording(way=1, seed=0, still=False, wind=0, order=None, alike=0.0, body=220):
    """(labels, frames, pictures as JPEG): the person is at `place`, and 20 px tall.

    `alike`: how much of the background every recording has; `body`: grey level of the person.
    """
    rng = np.random.default_rng(seed)
    own, common = (one.integers(60, 120, (9, 16), np.uint8) for one in (rng, np.random.default_rng(99)))
    floor = cv2.resize(own * (1 - alike) + common * alike, (WIDE, HIGH), interpolation=cv2.INTER_CUBIC)
    images = []
    for frame in range(COUNT):
        picture = floor + rng.normal(0, 2, (HIGH, WIDE))
        left = place(0 if still else frame, way)
        picture[26:46, left : left + 9] = body
        if wind:
            picture[:, ::2] += rng.normal(0, wind, (HIGH, WIDE // 2))
        ok, data = cv2.imencode(".jpg", picture.clip(0, 255).astype(np.uint8), [cv2.IMWRITE_JPEG_QUALITY, 95])
        assert ok
        images.append(data.tobytes())
    frames = {"frame": np.arange(COUNT), "width": np.full(COUNT, WIDE), "height": np.full(COUNT, HIGH)}
    at = np.array([place(0 if still else frame, way) for frame in range(COUNT)], np.float32)
    labels = {
        "joint": np.array(["head", "foot"] * COUNT, object), "frame": np.repeat(np.arange(COUNT), 2),
        "u": np.stack([at + 4, at + 4], 1).ravel(), "v": np.tile(np.float32([27, 44]), COUNT),
        "status": np.full(2 * COUNT, "ok", object),
    }  # fmt: skip
    return labels, frames, [images[i] for i in order] if order else images


def problems_of(tmp_path, decode=True, **recordings):
    """What the check says of a walk's recordings by camera, and the suspects."""
    files, kept, of = {}, {}, {"labels_2d": {}, "frames": {}}
    for camera, (labels, frames, images) in recordings.items():
        name = f"frames/who-0001/walk.{camera}.parquet"
        image = np.empty(COUNT, object)
        image[:] = images
        columns = {"subject": ["who-0001"] * COUNT, "image": image, **frames}
        tables.write(tmp_path / f"{camera}.parquet", "released_frames", columns)
        path = tmp_path / f"{camera}.parquet"
        files[name] = pictures.File(path, 0, path.stat().st_size)
        some = sample.Sample(COUNT)
        for row, data in enumerate(images):
            some.add(row, data)
        kept[camera] = some.pictures()
        of["labels_2d"][camera], of["frames"][camera] = labels, frames
    rig = evidence.Setup({}, {}, {}, {}, {})
    walk = evidence.Walk("who-0001", "walk", of, files, rig, decode, kept, {}, {})
    return pictures.check(walk), walk.suspects


def exchanged(i, j):
    order = list(range(COUNT))
    order[i], order[j] = j, i
    return order


def test_two_pictures_that_were_exchanged(tmp_path):
    found, _ = problems_of(tmp_path, cam01=recording(order=exchanged(5, 33)))
    assert found == [
        (
            "frames/who-0001/walk.cam01.parquet",
            "the pictures of frames 5 and 33 are exchanged: what moves in each of them is where the labels of the "
            "other are",
        )
    ]


def test_pictures_in_their_order_raise_no_alarm(tmp_path):
    """Neither does a subject who stands still, nor a picture in which everything moves, nor light that changes."""
    for camera in (
        recording(), recording(still=True), recording(wind=60), recording(still=True, wind=60),
        recording(order=exchanged(20, 21)),
    ):  # fmt: skip
        for decode in (False, True):
            assert problems_of(tmp_path, decode, cam01=camera)[0] == []


def of_suspects(suspects):
    walk = type("Walk", (), {"suspects": suspects, "beside": {}})()
    return pictures.exchanged(pictures.Evidence({}, {}, [walk], {}, evidence.Setup({}, {}, {}, {}, {})))


def test_recordings_in_which_nobody_moves_are_not_those_of_each_other(tmp_path):
    quiet = {"cam01": recording(seed=1, still=True), "cam02": recording(seed=2, way=-1, still=True)}
    found, suspects = problems_of(tmp_path, True, **quiet)
    assert len(suspects) == 2 and found == [] == of_suspects(suspects)


@pytest.mark.parametrize("alike", [0.0, 0.7])
def test_a_picture_of_another_camera(tmp_path, alike):
    """Also where the cameras stand in one room, and see much the same."""
    look = {"alike": alike, "body": 220 if alike == 0 else 115}
    first, second = recording(seed=1, **look), recording(seed=2, way=-1, **look)
    assert problems_of(tmp_path, cam01=first, cam02=second) == ([], {})
    first[2][30] = second[2][30]
    found, _ = problems_of(tmp_path, cam01=first, cam02=second)
    assert found == [
        ("frames/who-0001/walk.cam01.parquet", "1 pictures look like those of camera cam02, first frame 30")
    ]


def test_the_pictures_of_two_cameras_exchanged(tmp_path):
    """Every picture: no background tells, but the person walks where the other camera's labels are."""
    first, second = recording(seed=1), recording(seed=2, way=-1)
    first = (*first[:2], second[2])
    second = (*second[:2], recording(seed=1)[2])
    found, suspects = problems_of(tmp_path, False, cam01=first, cam02=second)
    assert found == [] and sorted(suspects) == ["cam01", "cam02"]
    assert [(path[-13:-8], text[:49]) for path, text in of_suspects(suspects)] == [
        ("cam01", "its pictures are those of frames/who-0001/walk.ca"),
        ("cam02", "its pictures are those of frames/who-0001/walk.ca"),
    ]


def test_the_sample_holds_the_picture_that_is_unlike_its_neighbours():
    some = sample.Sample(300)
    sizes = np.random.default_rng(0).integers(990, 1010, 300)
    sizes[[100, 211]] = 1100, 900
    for row, size in enumerate(sizes):
        some.add(row, bytes(int(size)))
    rows = [row for row, _ in some.pictures()]
    assert {0, 100, 211, 299} <= set(rows) and rows == sorted(rows)
    assert len(rows) <= sample.SPREAD + sample.OUTLIERS
    assert sample.Sample(0).pictures() == [] and MLKIT_33


def test_what_nobody_has_foreseen_is_a_sentence(made, verified, monkeypatch):
    from dior.release.verify import checks

    def broken(of):
        raise ValueError("what\nis this")

    monkeypatch.setattr(checks, "OF_WALK", (broken,))
    assert verified(made)[0] == "labels_2d/apple-0002/walk_3: cannot be recomputed: what is this"
