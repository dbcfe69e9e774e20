"""Pictures that the transports ffmpeg and theora put into bags: those that were sent, each with its own stamp, from any
place."""

from dataclasses import replace

import numpy as np
import pytest

from dior.errors import DiorError
from dior.ingest import audit, bags, frames, messages
from dior.tables import tables
from tests.ingest import theora_sample
from tests.ingest.bagfiles import T0, info, packed, packets, picture, theora, write

pytest.importorskip("av")
TOPIC, COUNT, PERIOD = "/cam01/image_raw/ffmpeg", 23, 33_000_000
STAMPS = [T0 + PERIOD * i for i in range(COUNT)]
IMAGES = [picture(20 + 10 * i) for i in range(COUNT)]


def sent(**how):
    return packets(TOPIC, STAMPS, IMAGES, **how)


def indexed(folder, bag, topics=None):
    out = folder / "frames.parquet"
    topics = topics or {"cam01": TOPIC}
    frames.run(sequence="walk", bags=bag if isinstance(bag, list) else [bag], data_root=folder, topics=topics, out=out)
    return tables.read(out, "frames")


def greys(table, folder):
    """By row the brightness of the left half of each picture, which is what was sent up to the codec."""
    found = {row: image for row, image in bags.read_pictures(table, folder)}
    for image in found.values():
        assert image.shape == (48, 64, 3) and image[:, 40:].mean() < 4
    return {row: float(np.median(image[:, 4:28, :2])) for row, image in found.items()}


@pytest.mark.parametrize(
    "form, how",
    [
        ("ros1", {}),
        ("db3", {}),
        ("mcap zstd", {}),
        ("db3 message", {}),
        ("mcap", {"encoder": "libx265"}),
        ("mcap", {"encoder": "libsvtav1"}),
        ("mcap", {"encoder": "libvpx"}),
        ("mcap", {"encoder": "libvpx-vp9"}),
        ("mcap", {"gop": 100}),
    ],
)
def test_every_picture_with_its_own_stamp(tmp_path, form, how):
    table = indexed(tmp_path, write(tmp_path / "walk", sent(**how), form))
    assert table["stamp_ns"].tolist() == STAMPS
    assert set(table["height"]) == {48} and set(table["width"]) == {64}
    found = greys(table, tmp_path)
    np.testing.assert_allclose([found[i] for i in range(COUNT)], [20 + 10 * i for i in range(COUNT)], atol=3)
    # any of them alone is the same one
    for rows in ([7], [21, 3], [22], [0, 14]):
        some = greys(tables.rows(table, np.array(rows)), tmp_path)
        assert some == {place: found[row] for place, row in enumerate(rows)}


def test_a_recording_that_begins_between_key_frames(tmp_path):
    """What comes before the first key frame is made of pictures that nobody has."""
    table = indexed(tmp_path, write(tmp_path / "walk", sent()[3:], "mcap"))
    assert table["stamp_ns"].tolist() == STAMPS[5:]
    assert greys(table, tmp_path)[0] == pytest.approx(70, abs=3)


def test_pictures_behind_a_lost_or_damaged_packet_are_left_out_up_to_the_next_key_frame(tmp_path):
    made = sent()
    del made[7]
    table = indexed(tmp_path, write(tmp_path / "lost", made, "db3"))
    there = [i for i in range(COUNT) if i not in (7, 8, 9)]
    assert table["stamp_ns"].tolist() == [STAMPS[i] for i in there]
    found = greys(table, tmp_path)
    np.testing.assert_allclose([found[row] for row in range(len(there))], [20 + 10 * i for i in there], atol=3)
    made = sent()
    made[7].content["data"] = np.zeros(9, np.uint8)
    table = indexed(tmp_path, write(tmp_path / "zeros", made, "db3"))
    assert table["stamp_ns"].tolist() == [STAMPS[i] for i in there]


def test_the_audit_has_a_reason_for_every_picture_that_is_missing(tmp_path):
    """Two before the first key frame, one that was never there, and two behind it."""
    made = sent()[3:]
    del made[7 - 3]
    indexed(tmp_path, write(tmp_path / "walk", made, "mcap"))
    audit.run(
        sequence="walk", frames=tmp_path / "frames.parquet", data_root=tmp_path, out=tmp_path / "a.parquet",
        out_dropped=tmp_path / "d.parquet", findings=tmp_path / "f.parquet",
    )  # fmt: skip
    lost = tables.read(tmp_path / "d.parquet", "dropped_frames")
    (said,) = tables.read(tmp_path / "f.parquet", "findings")["text"]
    assert said == (
        "walk: 5 pictures lost (25.0%) in 2 gaps, the longest 0.13 s; 4 of them cannot be decoded, the first after "
        "frame 0: before a key frame (2), behind packets that are missing by their count (`pts`), up to the next key "
        "frame (2)"
    )
    found = list(zip(lost["stamp_ns"], lost["reason"], strict=True))
    expected = {3: "not_decoded", 4: "not_decoded", 7: "not_sent", 8: "not_decoded", 9: "not_decoded"}
    assert found == [(STAMPS[i], reason) for i, reason in expected.items()]
    (row,) = zip(*(tables.read(tmp_path / "a.parquet", "stamp_audit")[key] for key in ("lost", "lag_ms")), strict=True)
    assert row == (5, 4.0)


def test_an_encoder_that_begins_anew(tmp_path):
    """Its count begins at 0 again, at a key frame."""
    later = 10**9
    again = [replace(one, receive_ns=one.receive_ns + later, stamp_ns=one.stamp_ns + later) for one in sent()]
    table = indexed(tmp_path, write(tmp_path / "walk", [*sent(), *again], "mcap"))
    assert table["stamp_ns"].tolist() == [*STAMPS, *(stamp + later for stamp in STAMPS)]
    found = greys(table, tmp_path)
    assert [round(found[i] - found[i + COUNT]) for i in range(COUNT)] == [0] * COUNT


def test_beside_pictures_of_another_camera_and_with_the_lens_beside_it(tmp_path):
    other = "/cam02/image_raw/compressed"
    jpeg = [packed(other, stamp, image, ".jpg") for stamp, image in zip(STAMPS, IMAGES, strict=True)]
    bag = write(tmp_path / "walk", [*sent(), *jpeg, info("/cam01/camera_info", T0)], "ros1")
    table = indexed(tmp_path, bag, {"cam01": TOPIC, "cam02": other})
    assert table["camera"].tolist() == ["cam01"] * COUNT + ["cam02"] * COUNT
    rows = np.array([3, 9, COUNT + 4])
    assert len(greys(tables.rows(table, rows), tmp_path)) == 3
    assert bags.read_camera_info([bag], TOPIC).width == 64
    # a picture that is sent again is told as of any other topic
    assert bags.repeated(bag, [TOPIC]) == set()


@pytest.mark.parametrize("empty", [5, 7], ids=["key frame", "other"])
def test_an_empty_packet_is_a_lost_one(tmp_path, empty):
    """It is the picture before again with theora alone, and what comes after it is made of it."""
    made = sent()
    made[empty].content["data"] = np.zeros(0, np.uint8)
    table = indexed(tmp_path, write(tmp_path / "walk", made, "mcap"))
    there = [i for i in range(COUNT) if not empty <= i < 10]
    assert table["stamp_ns"].tolist() == [STAMPS[i] for i in there]
    found = greys(table, tmp_path)
    np.testing.assert_allclose([found[row] for row in range(len(there))], [20 + 10 * i for i in there], atol=3)


def test_another_encoder_in_the_middle_has_a_decoder_of_its_own(tmp_path):
    made = [*sent()[:10], *packets(TOPIC, STAMPS[10:], IMAGES[10:], encoder="libx265")]
    table = indexed(tmp_path, write(tmp_path / "walk", made, "mcap"))
    assert table["stamp_ns"].tolist() == STAMPS
    found = greys(table, tmp_path)
    np.testing.assert_allclose([found[i] for i in range(COUNT)], [20 + 10 * i for i in range(COUNT)], atol=3)
    assert greys(tables.rows(table, np.array([21, 3])), tmp_path) == {0: found[21], 1: found[3]}


def test_an_encoder_that_begins_anew_and_whose_first_packet_is_lost(tmp_path):
    later = 10**9
    again = [replace(one, receive_ns=one.receive_ns + later, stamp_ns=one.stamp_ns + later) for one in sent()[1:]]
    table = indexed(tmp_path, write(tmp_path / "walk", [*sent(), *again], "mcap"))
    assert table["stamp_ns"].tolist() == [*STAMPS, *(stamp + later for stamp in STAMPS[5:])]


@pytest.mark.parametrize("encoding", ["huffyuv", "h264;gray;bayer_rggb8;bayer_rggb8"])
def test_another_encoder_is_refused_by_its_name(tmp_path, encoding):
    made = sent()
    for one in made:
        one.content["encoding"] = encoding
    with pytest.raises(
        DiorError, match=rf"walk.*{TOPIC}: its encoding is '{encoding}', .* republish`, from its transport"
    ):
        indexed(tmp_path, write(tmp_path / "walk", made, "mcap"))


def test_what_the_newer_plugin_calls_its_encoding(tmp_path):
    made = sent()
    for one in made:
        one.content["encoding"] = "h264;yuv420p;bgr8;bgr8"
    assert len(indexed(tmp_path, write(tmp_path / "walk", made, "mcap"))["frame"]) == COUNT


def test_nothing_that_can_be_decoded(tmp_path):
    bag = write(tmp_path / "walk", sent(gop=100)[1:], "mcap")
    with pytest.raises(
        DiorError, match=rf"walk: {TOPIC}: no picture can be decoded from its 22 packets; .* of h264, as"
    ):
        indexed(tmp_path, bag)
    made = sent()
    for one in made:
        one.content["encoding"] = "HEVC"
    with pytest.raises(
        DiorError, match="no picture can be decoded from its 23 packets; .* of hevc, as its encoding says"
    ):
        indexed(tmp_path, write(tmp_path / "other", made, "mcap"))


def test_pictures_that_are_sent_in_another_order_are_refused(tmp_path):
    with pytest.raises(DiorError, match=rf"walk: {TOPIC}: its packets are in another order than its pictures"):
        indexed(tmp_path, write(tmp_path / "walk", sent(b_frames=2, gop=8), "mcap"))


@pytest.mark.parametrize("at", [7, 9], ids=["within a group", "over a key frame"])
def test_a_packet_that_overtakes_another_costs_its_group(tmp_path, at):
    made = sent()
    one, other = made[at : at + 2]
    made[at] = replace(other, receive_ns=one.receive_ns)
    made[at + 1] = replace(one, receive_ns=other.receive_ns)
    table = indexed(tmp_path, write(tmp_path / "walk", made, "mcap"))
    lost = (7, 8, 9) if at == 7 else (9, 11, 12, 13, 14)
    found = sorted(greys(table, tmp_path).values())
    np.testing.assert_allclose(found, [20 + 10 * i for i in range(COUNT) if i not in lost], atol=3)


@pytest.mark.parametrize("at", [5, 7], ids=["key frame", "other"])
def test_a_packet_that_comes_twice_counts_once(tmp_path, at):
    made = sent()
    made.insert(at + 1, replace(made[at], receive_ns=made[at].receive_ns + 1000))
    table = indexed(tmp_path, write(tmp_path / "walk", made, "mcap"))
    assert table["stamp_ns"].tolist() == STAMPS
    found = greys(table, tmp_path)
    np.testing.assert_allclose([found[i] for i in range(COUNT)], [20 + 10 * i for i in range(COUNT)], atol=3)


def test_of_a_count_with_steps_key_frames_alone_are_pictures_and_it_is_said(tmp_path):
    """As when two of three packets were dropped, of which the decoder would make wrong pictures."""
    made = sent()
    for one in made:
        one.content["pts"] *= 3
    table = indexed(tmp_path, write(tmp_path / "walk", made, "mcap"))
    assert table["stamp_ns"].tolist() == STAMPS[::5]
    audit.run(
        sequence="walk", frames=tmp_path / "frames.parquet", data_root=tmp_path, out=tmp_path / "a.parquet",
        out_dropped=tmp_path / "d.parquet", findings=tmp_path / "f.parquet",
    )  # fmt: skip
    said = tables.read(tmp_path / "f.parquet", "findings")
    assert (said["severity"][0], said["code"][0]) == ("warning", "pictures_lost")
    assert said["text"][0].startswith("walk: 18 pictures lost (78.3%) in 5 gaps")
    assert "missing by their count (`pts`)" in said["text"][0]


def test_something_of_another_type_under_the_topic_of_packets(tmp_path):
    other = [packed(TOPIC, STAMPS[i], IMAGES[i]) for i in range(10, COUNT)]
    with pytest.raises(DiorError, match=rf"walk: the message of {TOPIC} received at \d+ ns is no {messages.PACKET} \("):
        indexed(tmp_path, write(tmp_path / "walk", [*sent()[:10], *other], "mcap"))


def test_two_types_under_the_topic_of_packets(tmp_path):
    from dior.ingest import containers

    both = [(TOPIC, messages.PACKET, 9), (TOPIC, messages.COMPRESSED, 4)]
    with pytest.raises(DiorError, match=rf"{TOPIC} holds messages of several types \(ffmpeg.*, sensor_msgs"):
        containers._check_one_kind(both, {TOPIC}, tmp_path / "walk")
    containers._check_one_kind(both[:1] + [("/other", messages.COMPRESSED, 4)], {TOPIC}, tmp_path / "walk")


def test_a_message_that_is_cut_off(tmp_path):
    raw = b"\0\1\0\0" + bytes(9)
    with pytest.raises(ValueError):
        messages.decoded(messages.PACKET, raw, "cdr")


IN_THEORA = "/cam01/image_raw/theora"
THEIRS = [T0 + PERIOD * i for i in range(theora_sample.COUNT)]


def theora_greys(table, folder):
    """By row the brightness of the left half; all of 0 to 255 is used."""
    found = dict(bags.read_pictures(table, folder))
    assert {image.shape for image in found.values()} == {(*theora_sample.SIZE, 3)}
    assert max(image[:, 34:].max() for image in found.values()) < 12
    return [float(np.median(found[row][:, 2:26])) for row in sorted(found)]


def of_theora(folder, messages_, form="mcap"):
    return indexed(folder, write(folder / "walk", messages_, form), {"cam01": IN_THEORA})


@pytest.mark.parametrize("form", ["ros1", "db3", "mcap zstd"])
def test_theora(tmp_path, form):
    table = of_theora(tmp_path, theora(IN_THEORA, THEIRS), form)
    assert table["stamp_ns"].tolist() == THEIRS
    expected = [30 + 15 * i for i in range(theora_sample.COUNT)]
    np.testing.assert_allclose(theora_greys(table, tmp_path), expected, atol=4)
    rows = np.array([12, 6])
    np.testing.assert_allclose(theora_greys(tables.rows(table, rows), tmp_path), [210, 120], atol=4)


def test_theora_from_its_middle_and_with_a_packet_lost(tmp_path):
    made = theora(IN_THEORA, THEIRS)
    # a recorder that comes later gets the headers of ROS 1, under the stamp of the first picture
    late = [*made[:3], *made[5:]]
    del late[late.index(made[3 + 6])]
    table = of_theora(tmp_path, late)
    assert table["stamp_ns"].tolist() == [THEIRS[i] for i in (5, 10, 11, 12)]
    np.testing.assert_allclose(theora_greys(table, tmp_path), [105, 180, 195, 210], atol=4)
    with pytest.raises(DiorError, match=rf"{IN_THEORA}: no picture can be .*, and theora's three headers before it"):
        of_theora(tmp_path / "without", made[3:])


@pytest.mark.parametrize("begins", [0, 1])
def test_theoras_headers_sent_again_cost_nothing(tmp_path, begins):
    """As to a subscriber of ROS 1 that comes later."""
    made = theora(IN_THEORA, THEIRS)
    again = [replace(one, receive_ns=made[5].receive_ns + 1 + i) for i, one in enumerate(made[:3])]
    for one in made:
        one.content["b_o_s"] *= begins
    table = of_theora(tmp_path, [*made[:6], *again, *made[6:]])
    assert table["stamp_ns"].tolist() == THEIRS
    expected = [30 + 15 * i for i in range(theora_sample.COUNT)]
    np.testing.assert_allclose(theora_greys(table, tmp_path), expected, atol=4)


def test_theoras_headers_of_another_stream_begin_anew(tmp_path):
    """A setup that is another one, and one that lacks."""
    made = theora(IN_THEORA, THEIRS)
    other = [replace(made[i], receive_ns=made[5].receive_ns + 1 + i, content=dict(made[i].content)) for i in (0, 1)]
    other[0].content["data"] = made[0].content["data"].copy()
    other[0].content["data"][-1] ^= 1
    table = of_theora(tmp_path, [*made[:6], *other, *made[6:]])
    assert table["stamp_ns"].tolist() == THEIRS[:3]


def test_theoras_empty_packet_is_the_picture_before_again(tmp_path):
    made = theora(IN_THEORA, THEIRS)
    made[3 + 7].content["data"] = np.zeros(0, np.uint8)
    del made[3 + 8 : 3 + 10]
    table = of_theora(tmp_path, made)
    there = [0, 1, 2, 3, 4, 5, 6, 7, 10, 11, 12]
    assert table["stamp_ns"].tolist() == [THEIRS[i] for i in there]
    grey = theora_greys(table, tmp_path)
    assert grey[7] == grey[6] and grey[8] == pytest.approx(180, abs=4)
    assert bags.repeated(tmp_path / "walk", [IN_THEORA]) == {(IN_THEORA, THEIRS[7] + 4_000_000, 0)}
    alone = dict(bags.read_pictures(tables.rows(table, np.array([7])), tmp_path))
    assert float(np.median(alone[0][:, 2:26])) == grey[6]


def test_a_stream_of_theora_that_begins_anew(tmp_path):
    made = theora(IN_THEORA, THEIRS)
    again = [replace(one, receive_ns=one.receive_ns + 10**9, stamp_ns=one.stamp_ns + 10**9) for one in made]
    table = of_theora(tmp_path, [*made, *again])
    assert table["stamp_ns"].tolist() == [*THEIRS, *(stamp + 10**9 for stamp in THEIRS)]
    grey = theora_greys(table, tmp_path)
    assert grey[: theora_sample.COUNT] == grey[theora_sample.COUNT :]
