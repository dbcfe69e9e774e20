"""Videos and folders of pictures, written here (`videofiles.py`): index, pictures, damage, turned and several streams.

OpenCV, which reads videos with an FFmpeg of its own, is the judge of how a turned picture is shown.
"""

import sys
from fractions import Fraction

import cv2
import numpy as np
import pytest

from dior.calibrate.lens import board
from dior.errors import DiorError
from dior.ingest import audit, bags, containers, frames, messages, picture_folders, video_starts, videos
from dior.ingest.video_frames import Recorded
from dior.tables import tables
from tests.ingest import bagfiles, videofiles
from tests.ingest.videofiles import GREYS, SIZE, grey_of, numbered, write

av = pytest.importorskip("av", reason="pip install -e '.[video]'")

COUNT = 46
# name -> what is written; the second and fourth have B-frames, the third a time of its own for each picture
KINDS = {
    "plain.mp4": {"b_frames": 0},
    "b_frames.mp4": {},
    "variable.mp4": {"times": [Fraction(int(t), 3000) for t in np.cumsum(np.arange(COUNT) % 3 * 50 + 70)]},
    "hevc.mp4": {"codec": "libx265"},
    "open_gop.mp4": {"b_frames": 3, "coder": {"x264-params": "open-gop=1:b-adapt=0"}},
    "fragmented.mp4": {"options": {"movflags": "frag_keyframe+empty_moov"}},
    "film.mov": {},
    "film.mkv": {},
    "film.avi": {"codec": "mjpeg"},
    "b_frames.avi": {},
}


def indexed(folder, name, topic="video0", **others):
    """The `frames` table of one camera on the video `name`, and what its metadata tell of it."""
    out = folder / "frames.parquet"
    recorded = Recorded(videos={"cam01": folder / name}, **others)
    frames.run(sequence="walk", bags=[], data_root=folder, topics={"cam01": topic}, out=out, recorded=recorded)
    return tables.read(out, "frames"), video_starts.told(out)["cam01"]


def made(folder, name, count=COUNT, **how):
    write(folder / name, [numbered(i) for i in range(count)], **how)
    return folder / name


def number_of(picture):
    """Which picture it is, of those whose greys differ, by the grey of its left half."""
    grey = float(np.median(picture[16:, 4 : picture.shape[1] // 2 - 4]))
    # FFmpeg's conversion makes greys 1 to 4 darker, OpenCV's of the same file, too
    return min(range(GREYS), key=lambda number: abs(grey_of(number) - 2.5 - grey))


@pytest.mark.parametrize("name", KINDS)
def test_pictures_are_those_that_were_shown_in_their_order_and_a_seek_finds_the_same(tmp_path, name):
    how = KINDS[name]
    made(tmp_path, name, **how)
    table, told = indexed(tmp_path, name)
    times = how.get("times") or [Fraction(i, 30) for i in range(COUNT)]
    assert table["frame"].tolist() == list(range(COUNT)) and not told["lost"]
    off_s = np.diff(table["stamp_ns"]) / 1e9 - np.diff(np.array(times, float))
    assert np.abs(off_s).max() < 2e-5, "times in steps of 1 ms of a regular rate are put back onto it, too"
    assert (table["height"] == SIZE[0]).all() and (table["width"] == SIZE[1]).all()
    inorder = dict(bags.read_pictures(table, tmp_path))
    assert [number_of(inorder[i]) for i in range(COUNT)] == [i % GREYS for i in range(COUNT)]
    for chosen in (*([i] for i in range(16, COUNT)), [0, COUNT - 1], [19, 20, 21, 44]):
        some = tables.rows(table, np.array(chosen))
        for row, picture in bags.read_pictures(some, tmp_path):
            assert (picture == inorder[chosen[row]]).all()


def test_pictures_far_apart_are_found_without_decoding_what_is_between(tmp_path, monkeypatch):
    """Also in a file with a key frame every 10 pictures and one without any but the first."""
    from dior.ingest import videos

    decoded = []
    each = videos._frames
    monkeypatch.setattr(
        videos, "_frames", lambda *given: (decoded.append(frame.pts) or frame for frame in each(*given))
    )
    for name, key_every, most in (("often.mp4", 10, 60), ("once.mp4", 1000, 300)):
        made(tmp_path, name, count=300, key_every=key_every)
        table, _ = indexed(tmp_path, name)
        decoded.clear()
        chosen = np.array([5, 100, 200, 299])
        found = dict(bags.read_pictures(tables.rows(table, chosen), tmp_path))
        assert [number_of(found[i]) for i in range(4)] == [number % GREYS for number in chosen]
        assert len(decoded) <= most


@pytest.mark.parametrize("rotation", [90, 180, -90])
def test_a_turned_picture_is_given_as_opencv_shows_it_or_as_it_is_stored(tmp_path, rotation):
    path = made(tmp_path, "turned.mp4", rotation=rotation)
    shown, _ = indexed(tmp_path, path.name)
    first = next(picture for _, picture in bags.read_pictures(tables.rows(shown, np.array([0])), tmp_path))
    video = cv2.VideoCapture(str(path))
    expected = video.read()[1]
    assert first.shape == expected.shape == (shown["height"][0], shown["width"][0], 3)
    assert (first == expected).all()
    stored, _ = indexed(tmp_path, path.name, "video0/stored")
    assert (stored["height"][0], stored["width"][0]) == SIZE
    first = next(picture for _, picture in bags.read_pictures(tables.rows(stored, np.array([0])), tmp_path))
    assert number_of(first) == 0 and first[4, 4, 0] > 200 > first[4, 4, 2] + 100


def edited(path, first, last, timescale_of=videofiles.TICK):
    """Cut an mp4 as editors do without encoding anew: its edit list shows the pictures `first` to `last` alone."""
    data = bytearray(path.read_bytes())
    at = data.index(b"elst") + 4
    version, entries = data[at], int.from_bytes(data[at + 4 : at + 8], "big")
    assert (version, entries) == (0, 1)
    movie = data.index(b"mvhd") + 4
    movie_hz = int.from_bytes(data[movie + 12 : movie + 16], "big")
    begin = int.from_bytes(data[at + 12 : at + 16], "big") + round(Fraction(first, 30) / timescale_of)
    data[at + 8 : at + 12] = round(Fraction(last + 1 - first, 30) * movie_hz).to_bytes(4, "big")
    data[at + 12 : at + 16] = begin.to_bytes(4, "big")
    path.write_bytes(data)


def test_an_edit_list_is_applied_and_what_it_leaves_out_is_not_lost(tmp_path):
    path = made(tmp_path, "cut.mp4")
    edited(path, 23, 40)
    table, told = indexed(tmp_path, path.name)
    found = dict(bags.read_pictures(table, tmp_path))
    assert [number_of(found[i]) for i in range(len(found))] == [i % GREYS for i in range(23, 41)]
    assert not told["lost"] and table["receive_ns"][0] == 0
    some = tables.rows(table, np.array([16]))
    assert [number_of(picture) for _, picture in bags.read_pictures(some, tmp_path)] == [39 % GREYS]


def test_of_several_streams_the_one_asked_for_is_read(tmp_path):
    made(tmp_path, "two.mkv", tracks=2)
    first, second = (indexed(tmp_path, "two.mkv", topic)[0] for topic in ("video0", "video1"))
    assert len(first["frame"]) == len(second["frame"]) == COUNT and set(second["topic"]) == {"video1"}
    with pytest.raises(DiorError, match=r"two\.mkv: it has 2 video streams, and no video2; `video\.stream`"):
        indexed(tmp_path, "two.mkv", "video2")


@pytest.mark.parametrize(("name", "how"), [("cut.mp4", {"options": {"movflags": "faststart"}}), ("cut.mkv", {})])
def test_of_a_file_that_is_cut_off_the_beginning_is_read_and_every_lost_picture_has_a_reason(tmp_path, name, how):
    noise = np.random.default_rng(0).integers(0, 255, (30, *SIZE, 3), np.uint8)
    path = tmp_path / name
    write(path, [noise[i % 30] for i in range(COUNT)], **how)
    path.write_bytes(path.read_bytes()[: int(0.6 * path.stat().st_size)])
    table, told = indexed(tmp_path, name)
    assert 10 < len(table["frame"]) < COUNT - 5
    assert len(table["frame"]) + len(told["lost"]) == COUNT
    assert {reason for _, _, reason in told["lost"]} == {"cut_off"}
    out = {key: tmp_path / f"{key}.parquet" for key in ("out", "out_dropped", "findings")}
    audit.run(sequence="walk", frames=tmp_path / "frames.parquet", data_root=tmp_path, **out)
    dropped = tables.read(out["out_dropped"], "dropped_frames")
    assert dropped["reason"].tolist() == ["cut_off"] * len(told["lost"])
    expected = table["stamp_ns"][0] + 1e9 / 30 * np.arange(len(table["frame"]), COUNT)
    assert np.abs(dropped["stamp_ns"] - expected).max() < 2e6
    assert tables.read(out["out"], "stamp_audit")["lost"].tolist() == [len(told["lost"])]


def test_a_picture_whose_bytes_are_damaged_is_lost_and_the_others_keep_their_numbers(tmp_path):
    path = made(tmp_path, "hurt.mp4", b_frames=0, key_every=1, codec="libx264")
    with av.open(str(path)) as container:
        packet = [one for one in container.demux(video=0) if one.size][20]
        at, size = packet.pos, packet.size
    data = bytearray(path.read_bytes())
    data[at : at + size] = bytes(size)
    path.write_bytes(data)
    (tmp_path / "stamps.csv").write_text(
        "frame,stamp_ns\n" + "".join(f"{i},{10**18 + i * 33_333_333 + i % 2}\n" for i in range(COUNT))
    )
    table, told = indexed(tmp_path, path.name, sidecars={"cam01": tmp_path / "stamps.csv"})
    assert told["lost"] == [[19, 10**18 + 20 * 33_333_333 + 2, "not_decoded"]] and len(table["frame"]) == COUNT - 1
    assert (table["stamp_ns"] - 10**18).tolist() == [i * 33_333_333 + i % 2 for i in range(COUNT) if i != 20]
    table, told = indexed(tmp_path, path.name, rates={"cam01": "50"})
    began = int(table["stamp_ns"][0])
    assert told["lost"] == [[19, began + 400_000_000, "not_decoded"]], "at the rate that is given, too"
    assert table["stamp_ns"][20] == began + 420_000_000


def test_audit_of_a_whole_video_warns_of_nothing(tmp_path):
    for name in ("b_frames.mp4", "variable.mp4", "film.mkv", "film.avi"):
        made(tmp_path, name, **KINDS[name])
        indexed(tmp_path, name)
        out = {key: tmp_path / f"{key}.parquet" for key in ("out", "out_dropped", "findings")}
        audit.run(sequence="walk", frames=tmp_path / "frames.parquet", data_root=tmp_path, **out)
        found = tables.read_findings(out["findings"])
        assert {severity for _, severity, _, _ in found} == {"info"}
        assert "video_stamps" in {code for _, _, code, _ in found}
        assert np.isnan(tables.read(out["out"], "stamp_audit")["lag_ms"]).all(), "there is no other clock"


def test_a_folder_of_pictures_is_read_by_number_with_a_rate_or_stamps(tmp_path):
    folder = tmp_path / "cam01"
    folder.mkdir()
    for i in range(12):
        cv2.imwrite(str(folder / f"{i}.png"), numbered(i))
    with pytest.raises(DiorError, match=r"cam01 is a folder of pictures, which have no time; give `fps`"):
        indexed(tmp_path, "cam01")
    table, told = indexed(tmp_path, "cam01", rates={"cam01": "50"})
    assert set(np.diff(table["stamp_ns"])) == {20_000_000} and told["source"] == "none"
    found = dict(bags.read_pictures(table, tmp_path))
    assert [number_of(found[i]) for i in range(12)] == list(range(12)), "10.png comes after 9.png"
    (tmp_path / "s.csv").write_text("frame,stamp_ns\n" + "".join(f"{i},{10**18 + i**2 * 10**6}\n" for i in range(12)))
    table, _ = indexed(tmp_path, "cam01", sidecars={"cam01": tmp_path / "s.csv"})
    assert (table["stamp_ns"] - 10**18).tolist() == [i**2 * 10**6 for i in range(12)]
    kind, wire, raw = next((m.kind, m.wire, m.raw) for m in containers.messages(folder, {"/pictures"}, {3}))
    assert messages.compressed(kind, raw, wire) == (folder / "3.png").read_bytes(), "as it is, for the release"


def named(folder, names):
    """A folder with small pictures of the `names`."""
    folder.mkdir()
    for i, name in enumerate(names):
        (folder / name).write_bytes(cv2.imencode(f".{name[-3:].lower()}", numbered(i))[1].tobytes())
    return folder


def test_pictures_missing_between_the_numbers_of_a_folder_are_lost_and_keep_their_time(tmp_path):
    folder = named(tmp_path / "cam01", [f"img_{i:04d}.jpg" for i in (*range(1, 6), *range(8, 21))])
    (folder / "._img_0001.jpg").write_bytes(b"x")
    (folder / ".img_0002.jpg").write_bytes(b"x")
    table, told = indexed(tmp_path, "cam01", rates={"cam01": "25"})
    since = (table["stamp_ns"] - table["stamp_ns"][0]) // 40_000_000
    assert since.tolist() == [*range(5), *range(7, 20)] and told["by_rate"]
    began = int(table["stamp_ns"][0])
    assert told["lost"] == [[4, began + i * 40_000_000, "not_sent"] for i in (5, 6)]
    out = {key: tmp_path / f"{key}.parquet" for key in ("out", "out_dropped", "findings")}
    audit.run(sequence="walk", frames=tmp_path / "frames.parquet", data_root=tmp_path, **out)
    assert tables.read(out["out"], "stamp_audit")["lost"].tolist() == [2]
    texts = [text for _, _, code, text in tables.read_findings(out["findings"]) if code == "video_stamps"]
    assert len(texts) == 1 and "at the rate that `video.fps` gives" in texts[0] and "own times" not in texts[0]
    (tmp_path / "s.csv").write_text("frame,stamp_ns\n" + "".join(f"{i},{10**18 + i * 10**7}\n" for i in range(18)))
    with pytest.raises(DiorError, match=r"s\.csv has no stamps for 2 of the 18 pictures of .*cam01, .*frame 18 is the"):
        indexed(tmp_path, "cam01", sidecars={"cam01": tmp_path / "s.csv"})
    (tmp_path / "s.csv").write_text("frame,stamp_ns\n" + "".join(f"{i},{10**18 + i * 10**7}\n" for i in since))
    table, told = indexed(tmp_path, "cam01", sidecars={"cam01": tmp_path / "s.csv"})
    assert told["lost"] == [[4, 10**18 + i * 10**7, "not_sent"] for i in (5, 6)]


@pytest.mark.parametrize(
    ("names", "words"),
    [
        (["img_0001.jpg", "img_0002.jpg", "img_0002.png"], r"img_0002\.png: has the number of img_0002\.jpg; remove"),
        (
            ["img_0001.jpg", "img_0003.jpg", "img_0003 (1).jpg"],
            r"img_0003 \(1\)\.jpg: its name has no number like that",
        ),
        (["1.jpg", "2.jpg", "background.jpg"], r"background\.jpg: its name has no number like that of 1\.jpg"),
        (["1.jpg", "2.jpg", "900.jpg"], r"cam01: more numbers are missing .* between 2\.jpg and 900\.jpg"),
    ],
)
def test_a_picture_that_does_not_fit_among_the_numbers_of_a_folder_is_refused_by_name(tmp_path, names, words):
    named(tmp_path / "cam01", names)
    with pytest.raises(DiorError, match=words):
        indexed(tmp_path, "cam01", rates={"cam01": "25"})


def test_a_damaged_picture_of_a_folder_is_named_by_its_file(tmp_path):
    folder = named(tmp_path / "cam01", ["1.png", "2.png", "3.png"])
    whole = (folder / "2.png").read_bytes()
    for data, words in (
        (b"", "is empty"),
        (b"RIFF0000WEBP", "the picture has no readable picture"),
        (whole[:60], r"the picture has .*\(its PNG data are cut off\); remove it or copy it again"),
    ):
        (folder / "2.png").write_bytes(data)
        with pytest.raises(DiorError, match=rf"cam01/2\.png: {words}"):
            indexed(tmp_path, "cam01", rates={"cam01": "25"})
    (folder / "2.png").write_bytes(whole)
    table, _ = indexed(tmp_path, "cam01", rates={"cam01": "25"})
    (folder / "2.png").write_bytes(whole[:40] + bytes(60))
    with pytest.raises(DiorError, match=r"cam01/2\.png: the picture cannot be decoded"):
        list(bags.read_pictures(table, tmp_path))


def test_what_is_empty_or_of_another_container_is_told_what_is_read(tmp_path):
    (tmp_path / "a.mp4").write_bytes(b"")
    with pytest.raises(DiorError, match=r"a\.mp4 is empty; copy it again"):
        indexed(tmp_path, "a.mp4")
    made(tmp_path, "b.ts", count=3)
    with pytest.raises(DiorError, match=r"mkv and webm are read, and `ffmpeg -i b\.ts -c copy b\.mp4`"):
        indexed(tmp_path, "b.ts")
    (tmp_path / "cam01").mkdir()
    (tmp_path / "cam01" / "1.bmp").write_bytes(b"BM")
    with pytest.raises(
        DiorError, match=r"no picture in the folder .*cam01; those that end in \.jpeg, \.jpg, \.png are"
    ):
        indexed(tmp_path, "cam01", rates={"cam01": "25"})


@pytest.mark.parametrize(
    ("names", "numbers"),
    [
        ([f"{i}.jpg" for i in range(0, 50, 10)], [0, 1, 2, 3, 4]),
        (["0.jpg", "33.jpg", "67.jpg", "100.jpg"], [0, 1, 2, 3]),
        (["9.59.58.jpg", "9.59.59.jpg", "10.00.03.jpg"], [0, 1, 2]),
        (["a.jpg", "b.jpg"], [0, 1]),
        (["img_1.jpg", "IMG_2.JPG", "img_4.jpg"], [0, 1, 3]),
        (["cam2_0.jpg", "cam2_2.jpg", "cam2_6.jpg"], [0, 1, 3]),
    ],
)
def test_names_that_step_by_a_constant_or_are_times_have_no_gaps(tmp_path, names, numbers):
    assert picture_folders.numbers(named(tmp_path / "cam01", names)).tolist() == numbers


@pytest.mark.parametrize("rate", ["30,0", "0", "-30", "inf", "nan"])
def test_a_rate_that_is_none_is_one_sentence(tmp_path, rate):
    named(tmp_path / "cam01", ["1.jpg", "2.jpg"])
    with pytest.raises(DiorError, match=f"walk, cam01: the rate '{rate}' is no number of pictures per second above 0"):
        indexed(tmp_path, "cam01", rates={"cam01": rate})


def test_a_camera_in_a_video_begins_with_those_in_bags(tmp_path):
    topic = "/cam01/image_raw/compressed"
    sent = [bagfiles.packed(topic, bagfiles.T0 + i * 10**9 // 30, numbered(i)) for i in range(5)]
    bag = bagfiles.write(tmp_path / "pc1", sent, "ros1")
    made(tmp_path, "cam02.mkv", count=5)
    out = tmp_path / "frames.parquet"
    topics, recorded = {"cam01": topic, "cam02": "video0"}, Recorded(videos={"cam02": tmp_path / "cam02.mkv"})
    frames.run(sequence="walk", bags=[bag], data_root=tmp_path, topics=topics, out=out, recorded=recorded)
    table = tables.read(out, "frames")
    assert list(zip(table["camera"], table["bag"], strict=True)) == (
        [("cam01", "pc1.bag")] * 5 + [("cam02", "cam02.mkv")] * 5
    )
    assert table["stamp_ns"][5] == table["stamp_ns"][0] == bagfiles.T0
    assert set(video_starts.told(out)) == {"cam02"}
    found = dict(bags.read_pictures(table, tmp_path))
    assert [number_of(found[i]) for i in range(5, 10)] == list(range(5))


def test_a_board_may_be_on_a_video(tmp_path):
    path = made(tmp_path, "board.mp4", count=130)
    found = list(board.pictures(path, "", "cam01"))
    assert len(found) == board.MOST_PICTURES and found[0][1].shape == SIZE


@pytest.mark.slow
@pytest.mark.parametrize("name", ["film.mp4", "film.mkv", "film.avi"])
def test_damaged_files_are_read_or_refused_in_a_sentence(tmp_path, name):
    """Bytes that are flipped, left out or zero, anywhere and in the head."""
    path = made(tmp_path, name, codec="mjpeg" if name.endswith("avi") else "libx264")
    whole, random = path.read_bytes(), np.random.default_rng(0)
    for trial in range(150):
        data = bytearray(whole)
        at = random.integers(0, len(data) if trial % 2 else 2000, 3)
        if trial % 3 == 0:
            del data[int(at[0]) : int(at[0]) + 50]
        elif trial % 3 == 1:
            data[int(at[0]) : int(at[0]) + 200] = bytes(200)
        for i in at:
            data[min(i, len(data) - 1)] ^= int(random.integers(1, 256))
        path.write_bytes(data)
        try:
            table, _ = indexed(tmp_path, name)
            assert sum(1 for _ in bags.read_pictures(table, tmp_path)) == len(table["frame"])
        except DiorError as error:
            assert name in str(error) or "walk" in str(error)


def test_what_is_no_video_is_said(tmp_path):
    (tmp_path / "a.mp4").write_bytes(b"\0\0\0\x18ftypisom" + bytes(200))
    with pytest.raises(DiorError, match=r"a\.mp4: the video is truncated or was not closed .*untrunc"):
        indexed(tmp_path, "a.mp4")
    with pytest.raises(DiorError, match=r"there is no .*b\.mp4; check `videos`"):
        indexed(tmp_path, "b.mp4")
    (tmp_path / "c.bag").write_bytes(b"#ROSBAG V2.0\n")
    with pytest.raises(DiorError, match=r"c\.bag is no video and no folder of pictures; name bags in `bags`"):
        indexed(tmp_path, "c.bag")


def test_a_missing_pyav_is_one_sentence(tmp_path, monkeypatch):
    made(tmp_path, "a.mp4", count=3)
    monkeypatch.setitem(sys.modules, "av", None)
    with pytest.raises(DiorError, match=r"a video needs PyAV; install it: pip install -e '\.\[video\]'"):
        indexed(tmp_path, "a.mp4")


def test_the_time_of_creation_is_that_of_the_first_picture_or_with_android_of_the_last():
    from dior.ingest import videos

    pts_ns, at = np.array([0, 10, 20]) * 10**9, 1_714_557_600 * 10**9
    told = {"creation_time": "2024-05-01T10:00:00.000000Z"}
    assert videos._began(told, pts_ns) == at
    assert videos._began({"creation_time": "2024-05-01T12:00:00+02:00"}, pts_ns) == at
    assert videos._began(told | {"com.android.version": "14"}, pts_ns) == at - 20 * 10**9
    for nothing in ({}, {"creation_time": "1904-01-01T00:00:00Z"}, {"creation_time": "today"}):
        assert videos._began(nothing, pts_ns) is None


@pytest.mark.parametrize("form", ["yuyv422", "uyvy422", "rgb24", "bgra", "gray", "yuv420p", "gbrp"])
def test_the_light_of_a_picture_is_its_brightness_whatever_the_planes(form):
    import av

    for grey in (80, 200):
        picture = np.full((50, 66, 3), grey, np.uint8)
        light = videos._light(av.VideoFrame.from_ndarray(picture, "bgr24").reformat(format=form))
        # of yuv black is 16 and white 235
        assert light.shape == (64,) and light == pytest.approx(grey, abs=14) and np.ptp(light) <= 1
