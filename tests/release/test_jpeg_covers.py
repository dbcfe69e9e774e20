"""Covers in JPEG files: everything outside of their blocks stays as recorded, nothing inside is left."""

import cv2
import numpy as np
import pytest
import turbojpeg

from dior.ingest.jpeg import EOI, SOI, segments
from dior.release import head_blur, jpeg, jpeg_covers, transform
from dior.release.jpeg_covers import Cover
from tests.release.test_jpeg import COMMENT, EXIF, dirty, segment

# (height, width) px: whole MCUs of every sampling, and none of any
SIZES = [(96, 160), (91, 141)]
SAMPLINGS = {"420": 0x221111, "422": 0x211111, "440": 0x121111, "411": 0x411111, "444": 0x111111}
# a head in the middle, one of a few pixels, one across the lower right corner; two others that overlap with a head
COVERS = [
    Cover((30.0, 60.0, 52.0, 85.0), True),
    Cover((45.0, 20.0, 60.0, 40.0), True),
    Cover((40.0, 16.0, 76.0, 62.0), False),
    Cover((103.0, 9.0, 108.0, 15.0), False),
    Cover((120.0, 70.0, 150.0, 110.0), False),
]
HOWS = ("blurred", "pixelated", "filled")


def scene(size, seed=0):
    """Something with edges and texture, BGR (h, w, 3)."""
    rough = np.random.default_rng(seed).standard_normal((size[0] // 8, size[1] // 8, 3))
    rough = cv2.resize(rough, size[::-1], interpolation=cv2.INTER_CUBIC)
    return (128 + 50 * rough).clip(0, 255).astype(np.uint8)


def file_of(picture, quality=80, sampling=0x221111, *flags):
    how = (cv2.IMWRITE_JPEG_QUALITY, quality, cv2.IMWRITE_JPEG_SAMPLING_FACTOR, sampling, *flags)
    return cv2.imencode(".jpg", picture, how)[1].tobytes()


def decoded(data):
    return cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR).astype(int)


def coefficients(data):
    """Of each component the quantised coefficients (R, C, 64)."""
    found = []
    count = len(jpeg.frame_of(data).components)
    assert transform.changed(data, count, lambda parts: found.extend(part.copy() for part in parts))
    return found


def touched(data, covers):
    """Of each component the blocks (R, C) of which a pixel is in a cover, and those pixels (h, w)."""
    frame = jpeg.frame_of(data)
    inside = np.zeros((frame.height, frame.width), bool)
    for cover in covers:
        box = head_blur.inside(cover.box, *inside.shape)
        one = head_blur.ellipse(cover.box, *(np.arange(side) for side in inside.shape))[box]
        inside[box] |= cover.whole | one
    found = []
    for component, part in zip(frame.components, coefficients(data), strict=True):
        down, across = (8 * step for step in frame.step(component))
        whole = np.zeros((part.shape[0] * down, part.shape[1] * across), bool)
        whole[: frame.height, : frame.width] = inside
        found.append(whole.reshape(part.shape[0], down, part.shape[1], across).any(axis=(1, 3)))
    return found, inside


def check(data, covers=COVERS, how="blurred"):
    """Cover, and compare all coefficients and pixels outside."""
    out = jpeg_covers.covered(data, covers, how)
    blocks, _ = touched(data, covers)
    for before, after, own in zip(coefficients(data), coefficients(out), blocks, strict=True):
        assert (before[~own] == after[~own]).all()
        assert (before[own] != after[own]).any(axis=1).mean() > 0.9
    frame = jpeg.frame_of(data)
    assert jpeg.frame_of(out) == frame
    assert {marker for marker, _ in segments(out)} <= jpeg.KEPT and out.startswith(SOI) and out.endswith(EOI)
    return out


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("sampling", SAMPLINGS)
@pytest.mark.parametrize("how", HOWS)
def test_all_but_the_blocks_of_the_covers_is_as_recorded(size, sampling, how):
    data = file_of(scene(size), 80, SAMPLINGS[sampling])
    out = check(data, how=how)
    near = np.zeros(size, np.uint8)
    for component, blocks in zip(jpeg.frame_of(data).components, touched(data, COVERS)[0], strict=True):
        pixels = np.kron(blocks, np.ones([8 * step for step in jpeg.frame_of(data).step(component)], bool))
        near |= pixels[: size[0], : size[1]]
    # decoders smooth chroma from sample to sample, which are 4 px at most
    near = cv2.dilate(near, np.ones((9, 9)))
    assert near.mean() < 0.7 and (decoded(out) == decoded(data))[near == 0].all()
    # it looks as if the whole had been decoded, covered and encoded again
    picture = decoded(data).astype(np.uint8)
    for cover in COVERS:
        head_blur.cover(picture, cover.box, how, cover.whole)
    again = decoded(jpeg.encoded(picture, 80, SAMPLINGS[sampling]))
    assert np.abs(decoded(out) - again).mean() < 4


@pytest.mark.parametrize(
    "flags", [(cv2.IMWRITE_JPEG_PROGRESSIVE, 1), (cv2.IMWRITE_JPEG_RST_INTERVAL, 3), (cv2.IMWRITE_JPEG_OPTIMIZE, 1)]
)
def test_other_ways_to_write_the_coefficients(flags):
    data = file_of(scene(SIZES[1]), 80, 0x221111, *flags)
    # the same coefficients give the same file
    assert check(data) == check(file_of(scene(SIZES[1])))


def test_arithmetic_coding():
    rgb = np.ascontiguousarray(scene(SIZES[1])[..., ::-1])
    plain, arithmetic = (turbojpeg.compress(rgb, 80, turbojpeg.SAMP.Y420, arithmetic=coded) for coded in (False, True))
    assert 0xC9 in {marker for marker, _ in segments(arithmetic)}
    assert check(arithmetic) == check(plain)


@pytest.mark.parametrize("how", HOWS)
def test_grey_stays_grey(how):
    data = file_of(scene(SIZES[1])[..., 0])
    assert len(jpeg.frame_of(check(data, how=how)).components) == 1


def test_nothing_but_the_picture_is_left():
    data = file_of(scene(SIZES[0]))
    jfif = segment(0xE0, b"JFIF\0\1\2\1\0\x48\0\x48\0\0")
    found = jpeg_covers.covered(dirty(data, jfif, EXIF, COMMENT) + b"Alice" * 9, COVERS, "blurred")
    assert found == jpeg_covers.covered(data, COVERS, "blurred") and b"Alice" not in found and b"JFIF" not in found
    assert jpeg.bare(found) == (found, True)


def test_what_is_below_does_not_change_a_byte():
    """Whole blocks covered: two pictures that differ in them alone are the same afterwards."""
    box = (16, 32, 80, 96)
    one, other = (scene(SIZES[0], seed) for seed in (0, 1))
    other[box[1] : box[3], : box[0]], other[: box[1]], other[:, box[2] :] = (
        one[box[1] : box[3], : box[0]], one[: box[1]], one[:, box[2] :],
    )  # fmt: skip
    data = [file_of(picture) for picture in (one, other)]
    found = [jpeg_covers.covered(each, [Cover(tuple(map(float, box)), True)], "filled") for each in data]
    assert data[0] != data[1] and found[0] == found[1]
    for part, step in zip(coefficients(found[0]), (8, 16, 16), strict=True):
        assert not part[box[1] // step : box[3] // step, box[0] // step : box[2] // step].any()


def test_a_cover_leaves_no_more_than_its_cells():
    """Two pictures with the same means of cells are the same afterwards."""
    one = scene(SIZES[0])
    other = one.copy()
    for v in range(32, 96, 16):
        for u in range(16, 80, 16):
            other[v : v + 16, u : u + 16] = one[v : v + 16, u : u + 16][::-1, ::-1]
    for how in ("blurred", "pixelated"):
        found = [
            coefficients(jpeg_covers.covered(file_of(picture, 90), [Cover((16.0, 32.0, 80.0, 96.0), True)], how))
            for picture in (one, other)
        ]
        assert max(np.abs(a.astype(int) - b).max() for a, b in zip(*found, strict=True)) <= 1
        assert np.mean([(a != b).mean() for a, b in zip(*found, strict=True)]) < 1e-3
    # of a pixelated one the blocks are even
    luma = found[0][0][4:12, 2:10]
    assert luma[..., 0].any() and not luma[..., 1:].any()


@pytest.mark.parametrize("quality", [50, 80, 95])
def test_an_edge_of_a_cover_tells_as_little_as_in_a_picture_that_is_encoded_again(quality):
    """Pictures that differ in an ellipse alone: how far the blocks that are partly in it are apart afterwards."""
    cover = Cover((40.0, 16.0, 76.0, 62.0), False)
    inside = head_blur.ellipse(cover.box, *(np.arange(side) for side in SIZES[1]))
    core = cv2.erode(inside.astype(np.uint8), np.ones((15, 15))) > 0
    now, then = [], []
    for seed in range(4):
        picture = np.where(inside[..., None], scene(SIZES[1], seed), scene(SIZES[1], 10))
        data = file_of(picture, quality, 0x111111)
        now.append(decoded(jpeg_covers.covered(data, [cover], "filled")))
        again = decoded(data).astype(np.uint8)
        head_blur.cover(again, cover.box, "filled")
        then.append(decoded(jpeg.encoded(again, quality, 0x111111)))
    spread = [np.std(pictures, axis=0) for pictures in (now, then)]
    assert (now[0][core] == head_blur.GREY).all() and not spread[0][core].any()
    assert spread[0].mean() < 1.05 * spread[1].mean()


@pytest.mark.parametrize("sampling", ["420", "444"])
def test_nothing_is_left_beyond_the_edges_of_the_picture(sampling):
    """The last blocks go on where the picture has ended, with the head's own edge as the encoder wrote it."""
    size = (91, 141)
    picture = np.full((*size, 3), 100, np.uint8)
    picture[60:, 110:] = scene(size)[60:, 110:]
    out = jpeg_covers.covered(
        file_of(picture, 95, SAMPLINGS[sampling]), [Cover((104.0, 56.0, 170.0, 120.0), True)], "filled"
    )
    for part in coefficients(out):
        assert not part[-2:, -2:].any()


def test_covers_that_share_blocks_are_encoded_once():
    """As if all samples were decoded, covered one after the other, and encoded again."""
    data = file_of(scene(SIZES[0])[..., 0], 20)
    table = jpeg.frame_of(data).components[0].table
    samples = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_GRAYSCALE)
    for cover in COVERS:
        three = np.repeat(samples[..., None], 3, axis=2)
        head_blur.cover(three, cover.box, "filled", cover.whole)
        samples = three[..., 0]
    expected = jpeg_covers._quantised(samples[None].astype(float) - 128, table)[0]
    own = touched(data, COVERS)[0][0]
    assert (coefficients(jpeg_covers.covered(data, COVERS, "filled"))[0][own] == expected[own]).all()


def test_covers_outside_of_the_picture():
    data = file_of(scene(SIZES[0]))
    out = jpeg_covers.covered(
        data, [Cover((-30.0, 4.0, 0.0, 20.0), False), Cover((160.0, 0.0, 170.0, 10.0), True)], "filled"
    )
    assert all((a == b).all() for a, b in zip(coefficients(data), coefficients(out), strict=True))


def test_same_bytes():
    data = file_of(scene(SIZES[1]))
    first = jpeg_covers.covered(data, COVERS, "blurred")
    jpeg_covers._bases.cache_clear(), jpeg_covers._masks.cache_clear()
    assert jpeg_covers.covered(data, COVERS, "blurred") == first


def with_byte(data, marker, at, value):
    """The file with a byte of a marker's segment changed."""
    found = bytearray(data)
    found[data.index(bytes([0xFF, marker])) + at] = value
    return bytes(found)


def frames_that_are_not_taken():
    data = file_of(scene(SIZES[0]))
    names = with_byte(with_byte(with_byte(data, 0xC0, 10, ord("R")), 0xC0, 13, ord("G")), 0xC0, 16, ord("B"))
    first = data.index(b"\xff\xdb")
    return {
        "12 bits": with_byte(data, 0xC0, 4, 12),
        "lossless": with_byte(data, 0xC0, 1, 0xC3),
        "components called R, G, B": names,
        "another table": with_byte(data, 0xC0, 12, 3),
        "samples of no whole pixels": with_byte(with_byte(data, 0xC0, 11, 0x31), 0xC0, 14, 0x21),
        "no samples": with_byte(data, 0xC0, 14, 0),
        "scans of one component": with_byte(data, 0xDA, 4, 1),
        "Adobe": dirty(data, segment(0xEE, b"Adobe\0d\0\0\0\0\0")),
        "no table": data[:first] + data[first + 138 :],
        "CMYK": cmyk(True),
        "CMYK without Adobe": cmyk(False),
    }


def cmyk(adobe):
    from io import BytesIO

    from PIL import Image

    out = BytesIO()
    Image.fromarray(np.dstack([scene(SIZES[0]), scene(SIZES[0], 1)[..., :1]]), "CMYK").save(out, "JPEG")
    parts = [part for marker, part in segments(out.getvalue()) if adobe or marker != jpeg.ADOBE]
    return b"".join([SOI, *parts, EOI])


@pytest.mark.parametrize("name", sorted(frames_that_are_not_taken()))
def test_what_the_whole_picture_is_decoded_for(name):
    assert jpeg_covers.covered(frames_that_are_not_taken()[name], COVERS, "blurred") is None


def test_damage_is_not_made_up():
    data = file_of(scene(SIZES[0]))
    middle = len(data) * 2 // 3
    for broken in (data[:middle], data[:middle] + EOI):
        assert jpeg_covers.covered(broken, COVERS, "blurred") is None
    for broken in (b"", b"\x89PNG\r\n\x1a\n", data[:100]):
        with pytest.raises(ValueError):
            jpeg_covers.covered(broken, COVERS, "blurred")


def test_without_the_library(monkeypatch):
    monkeypatch.setattr(transform, "library", lambda: None)
    assert jpeg_covers.covered(file_of(scene(SIZES[0])), COVERS, "blurred") is None


def test_no_picture_gets_out_without_its_covers(monkeypatch):
    """What goes wrong while the coefficients are changed ends everything; so does a component that is not shown."""
    data = file_of(scene(SIZES[0]))
    monkeypatch.setattr(jpeg_covers, "_cover", lambda *_: np.zeros(3)[5])
    with pytest.raises(IndexError):
        jpeg_covers.covered(data, COVERS, "blurred")
    assert transform.changed(data, 4, lambda parts: None) is None
