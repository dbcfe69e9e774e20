"""Pictures are looked at where a release tells that they are covered."""

import cv2
import numpy as np
import pytest

from dior.release import head_blur, jpeg, jpeg_covers
from dior.release.verify import cover_checks
from dior.release.verify.evidence import Setup, Walk
from dior.release.verify.folder_or_tarball import File
from dior.tables import tables
from tests.cases import slow

# two heads and three others: some overlap, one is a few pixels, one reaches out of the picture
COVERS = [
    ("head", (60, 20, 100, 76)), ("other", (80, 60, 140, 110)), ("other", (84, 6, 96, 26)), ("head", (20, 90, 27, 98)),
    ("other", (140, -10, 180, 40)),
]  # fmt: skip
SIZE = (120, 160)


def picture(contrast=60.0, seed=0):
    """Something with edges and texture of about the size of a face's features, BGR (h, w, 3)."""
    random = np.random.default_rng(seed)
    rough = cv2.resize(random.standard_normal((40, 54, 3)), SIZE[::-1], interpolation=cv2.INTER_CUBIC)
    return (128 + contrast * rough).clip(0, 255).astype(np.uint8)


def table(covers, frames=0):
    edges = np.array([box for _, box in covers], float).reshape(-1, 4)
    what = np.array([what for what, _ in covers], object)
    return {"frame": np.full(len(covers), frames), "what": what} | dict(zip(cover_checks.EDGES, edges.T, strict=True))


def covered(image, covers, how):
    """As `pixels` does it: the heads last."""
    out = image.copy()
    for what, box in sorted(covers, key=lambda cover: cover[0] == "head"):
        head_blur.cover(out, np.array(box, float), how, whole=what == "other")
    return out


@pytest.mark.parametrize("quality", [95, slow(85), 50])
@pytest.mark.parametrize("how", ["blurred", "pixelated", "filled"])
def test_a_cover_is_told_from_what_is_below_it(how, quality):
    image, shows = picture(), lambda one, covers: cover_checks.shows(jpeg.encoded(one, quality), table(covers), how)
    assert not shows(covered(image, COVERS, how), COVERS)
    for i, cover in enumerate(COVERS):
        assert shows(covered(image, COVERS[:i] + COVERS[i + 1 :], how), [cover]), cover


@pytest.mark.parametrize("how", ["blurred", "pixelated", "filled"])
def test_covers_in_the_blocks_of_a_recorded_picture(how):
    """Of tables that no encoder here has, coarse ones, too, and of a grey picture."""
    coloured, grey = jpeg.encoded(picture(), 50), cv2.imencode(".jpg", picture()[..., 0], [1, 50])[1].tobytes()
    odd = bytearray(coloured)
    for at in (i for i in range(len(odd)) if odd[i : i + 2] == b"\xff\xdb"):
        odd[at + 5 : at + 69] = [min(255, step + 40) for step in odd[at + 5 : at + 69]]
    for data in (coloured, grey, bytes(odd)):
        sound = [
            jpeg_covers.Cover(box, what == "other") for what, box in sorted(COVERS, key=lambda one: one[0] == "head")
        ]
        assert not cover_checks.shows(jpeg_covers.covered(data, sound, how), table(COVERS), how)
    for what, box in COVERS:
        left = [one for one in sound if one.box != box]
        bare = jpeg_covers.covered(coloured, left, how)
        assert cover_checks.shows(bare, table([(what, box)]), how), box


def test_another_way_to_cover_is_told_as_well():
    """A Gaussian blur that leaves a face, and cells that are too small."""
    cover, image = COVERS[:1], picture()
    for other in (cv2.GaussianBlur(image, (0, 0), 2.0), cv2.resize(image[::5, ::5], SIZE[::-1], interpolation=0)):
        assert cover_checks.shows(jpeg.encoded(other), table(cover), "blurred")


def test_noise_below_what_encoding_leaves_is_no_head():
    assert not cover_checks.shows(jpeg.encoded(picture(0.5)), table(COVERS), "blurred")


def walk(folder, images, settings, decode=False):
    """A `Walk` with one camera, whose pictures are `images` and of which COVERS are covered."""
    count = len(images)
    data = [jpeg.encoded(image) for image in images]
    named = {"subject": ["p1"] * count, "sequence": ["walk"] * count, "camera": ["cam01"] * count}
    frames = {"frame": np.arange(count), "stamp_ns": np.arange(count)}
    images = np.empty(count, object)
    images[:] = data
    size = {"height": [SIZE[0]] * count, "width": [SIZE[1]] * count}
    pictures = named | frames | size | {"image": images, "no_image": [""] * count}
    covers = {key: np.tile(value, count) for key, value in table(COVERS).items()}
    covers |= {key: np.repeat(values, len(COVERS)) for key, values in (named | frames).items()}
    files = {}
    for kind, name, columns in (("frames", "released_frames", pictures), ("covers", "released_covers", covers)):
        path = f"{kind}/p1/walk.cam01.parquet"
        tables.write(folder / path, name, columns)
        files[path] = File(folder / path, 0, (folder / path).stat().st_size)
    read = {"frames": {"cam01": tables.read(folder / files_of(files, "frames"), "released_frames", ["frame"])}}
    read["covers"] = {"cam01": {}}
    kept = {"cam01": [(row, data[row]) for row in range(0, count, 2)]}
    return Walk("p1", "walk", read, files, Setup({}, {}, {}, {}, settings), decode, kept, {}, {})


def files_of(files, kind):
    return next(path for path in files if path.startswith(kind))


def test_pictures_of_a_recording_are_counted(tmp_path):
    images = [covered(picture(seed=i), COVERS, "blurred") for i in range(6)]
    images[3] = picture(seed=3)
    blurred = {"release.faces": "blurred"}
    path = "frames/p1/walk.cam01.parquet"
    said = "1 pictures that show more than a cover leaves, where `covers` says that they are covered, first frame "
    # of the pictures that are looked at, every second, all are covered
    assert cover_checks.check(walk(tmp_path / "a", images, blurred)) == []
    assert cover_checks.check(walk(tmp_path / "b", images, blurred, decode=True)) == [(path, f"{said}3")]
    images[4] = picture(seed=4)
    assert cover_checks.check(walk(tmp_path / "c", images, blurred)) == [(path, f"{said}4")]
    # masks are blurred where faces are shown
    assert cover_checks.check(walk(tmp_path / "d", images, {"release.faces": "shown"})) == [(path, f"{said}4")]
    assert cover_checks.check(walk(tmp_path / "e", images, {})) == []
