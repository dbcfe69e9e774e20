"""Kinds of C3D that laboratories have, as small files of our own bytes: each is read right, or refused in one sentence
that says what to do."""

import os
import re
import signal
import time

import ezc3d
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from dior.errors import DiorError
from dior.ingest import c3d_check, c3d_points, mocap
from dior.tables import tables
from tests.ingest.c3d_files import PLACES, c3d_bytes, person
from tests.ingest.test_mocap import T0, run

LABELS = list(PLACES)
FRAMES = 40
POINTS = 1000 * person(LABELS, FRAMES)
# samples and channels of a frame
ANALOGS = np.random.default_rng(17).normal(0, 1, (FRAMES, 10, 6))
SHORT = np.int16


def file_of(folder, labels=LABELS, points=POINTS, name="a.c3d", **how):
    (folder / name).write_bytes(c3d_bytes(list(labels), points, **how))
    return folder / name


def is_the_person(got, frames=FRAMES, tolerance=1e-6):
    """All markers where they are."""
    assert got.markers == tuple(marker for marker in mocap.PLUG_IN_GAIT_39 if marker in PLACES) and len(PLACES) == 24
    np.testing.assert_allclose(got.points, person(got.markers, frames), atol=tolerance)
    return True


def refused(path, *args, **how):
    """The sentence that refuses the file; it names it."""
    with pytest.raises(DiorError) as caught:
        mocap.read(path, *args, **how)
    sentence = str(caught.value)
    assert sentence.startswith(f"{path}: ") and "\n" not in sentence
    return sentence.removeprefix(f"{path}: ")


@pytest.mark.parametrize("processor", ["intel", "dec"])
@pytest.mark.parametrize("scale", [-1.0, 0.1])
def test_processors_floats_and_integers_beside_analog_channels(tmp_path, processor, scale):
    got = mocap.read(file_of(tmp_path, processor=processor, scale=scale, analogs=10 * ANALOGS))
    assert is_the_person(got, tolerance=1e-6 if scale < 0 else 0.06e-3)
    assert (got.rate, got.first_frame) == (100.0, 1)


def test_mips_is_refused_with_the_way_out(tmp_path):
    assert "byte order of MIPS" in refused(file_of(tmp_path, processor="mips"))


EMPTY = {
    "FORCE_PLATFORM:USED": SHORT(0),
    "FORCE_PLATFORM:CORNERS": np.zeros((0, 4, 3), np.float32),
    "FORCE_PLATFORM:CAL_MATRIX": np.zeros((0, 6, 6), np.float32),
    "SEG:TYPE_GROUPS": np.zeros((0, 2, 20), SHORT),
    "SEG:NAMES": [],
    "SEG:NOTE": "",
}


@pytest.mark.parametrize("name", list(EMPTY))
def test_parameters_that_are_empty(tmp_path, name):
    """Capture systems without force plates write CORNERS 3x4x0, CAL_MATRIX 6x6x0 and TYPE_GROUPS 20x2x0."""
    path = file_of(tmp_path, more={name: EMPTY[name]})
    assert name.encode().split(b":")[1] in path.read_bytes()
    assert is_the_person(mocap.read(path))


@pytest.mark.parametrize(
    "how, says",
    [
        ({"analogs": ANALOGS, "analog_rate": 999.9}, "60 analog samples .* by its header, and .* 54 .*its header fits"),
        ({"more": {"POINT:USED": SHORT(30)}}, "24 points .* by its header, and 30 points .*its header fits"),
        ({"more": {"POINT:SCALE": 0.1}}, "of 4 bytes by its header, and .* of 2 bytes .*its header fits"),
        ({"more": {"POINT:USED": SHORT(30)}, "header": {"points": 29}}, "with 40 frames neither fits"),
        ({"more": {"ANALOG:USED": SHORT(9)}, "analogs": ANALOGS}, "60 analog .* 90 .*its header fits"),
        ({"header": {"start": 9}}, "block 9 by its header, and by POINT:DATA_START where they fit"),
        ({"header": {"start": 999}}, "block 999 by its header, and by POINT:DATA_START where they fit"),
        ({"more": {"POINT:FRAMES": SHORT(10)}}, "10 of its 40 frames; POINT:FRAMES is wrong"),
        ({"header": {"last": 60000}, "more": {"POINT:FRAMES": np.uint16(60000)}}, "40 of its 60000 frames; it is cut"),
        ({"more": {"POINT:USED": SHORT(0)}}, "POINT:USED is 0"),
        ({"more": {"POINT:RATE": float("nan")}}, "POINT:RATE is nan"),
        ({"more": {"POINT:RATE": 1e-9}}, "POINT:RATE is 1e-09"),
    ],
)
def test_a_file_that_is_not_what_it_says(tmp_path, how, says):
    """What would be read as garbage: the size of a frame by the header, by ezc3d and by the file's size."""
    assert re.search(says, refused(file_of(tmp_path, **how)))


@pytest.mark.parametrize(
    "how",
    [
        {"header": {"points": 3}},
        {"header": {"scale": 0.1}},
        {"header": {"analogs": 5}},
        {"header": {"last": 10}},
        {"more": {"POINT:DATA_START": SHORT(9)}},
        {"more": {"POINT:RATE": 0.0}},
        {"without": ("POINT:FRAMES",)},
        {"without": [f"ANALOG:{name}" for name in ("USED", "GEN_SCALE", "OFFSET", "SCALE", "LABELS", "RATE")]},
    ],
)
def test_what_the_file_says_elsewhere_makes_up_for_it(tmp_path, how):
    assert is_the_person(mocap.read(file_of(tmp_path, **how)))


def test_a_trimmed_file_counts_as_the_capture_does(tmp_path):
    assert mocap.read(file_of(tmp_path, first=148)).first_frame == 148
    # some writers count from 0
    path = file_of(tmp_path, first=0)
    assert mocap.read(path).first_frame == 1 and is_the_person(mocap.read(path))


def test_a_header_that_counts_other_frames_than_those_stored_has_no_first_one(tmp_path):
    path = file_of(tmp_path, header={"first": 148, "last": 200})
    assert mocap.read(path).first_frame == 0 and is_the_person(mocap.read(path))
    (tmp_path / "trigger.jsonl").write_text(f'{{"event": "start", "name": "a", "start_ns": {T0}}}\n')
    with pytest.raises(DiorError, match=r"a\.c3d: its header's first and last frame are not those of the 40 frames"):
        run(tmp_path, path, trigger_log=tmp_path / "trigger.jsonl")
    assert len(run(tmp_path, path)["x"]) == FRAMES * len(PLACES)


LONG = {"TRIAL:ACTUAL_START_FIELD": np.uint16([1, 0]), "TRIAL:ACTUAL_END_FIELD": np.uint16([70_000 - 65536, 1])}
LATE = {
    "TRIAL:ACTUAL_START_FIELD": np.uint16([70_001 - 65536, 1]),
    "TRIAL:ACTUAL_END_FIELD": np.uint16([140_000 - 131072, 2]),
}


@pytest.mark.parametrize(
    "more, header, first",
    [
        (LONG, {}, 1),
        ({"POINT:LONG_FRAMES": 70_000.0}, {}, 1),
        ({"POINT:FRAMES": np.uint16(65535), **LATE}, {"first": 65535, "last": 65535}, 70_001),
    ],
)
def test_more_frames_than_the_header_can_count(tmp_path, more, header, first):
    points = np.ones((70_000, 4, 3))
    about = c3d_check.layout(file_of(tmp_path, LABELS[:4], points, rate=1000.0, more=more, header=header))
    assert (about.first, about.frames) == (first, 70_000)


def test_a_long_capture_is_read_to_its_end(tmp_path):
    labels = ["LKNE", "LANK", "LASI", "RASI"]
    points = 1000 * person(labels, 66_001, rate=1000.0)
    more = {"TRIAL:ACTUAL_START_FIELD": np.uint16([1, 0]), "TRIAL:ACTUAL_END_FIELD": np.uint16([66_001 - 65536, 1])}
    got = mocap.read(file_of(tmp_path, labels, points, rate=1000.0, more=more))
    assert got.points.shape == (66_001, 4, 3)
    np.testing.assert_allclose(got.points[-1], person(got.markers, 66_001, 1000.0)[-1], atol=1e-4)


def test_labels_beyond_255_points(tmp_path):
    labels = [f"x{i}" for i in range(258)] + LABELS
    assert is_the_person(mocap.read(file_of(tmp_path, labels, 1000 * person(labels, 3))), frames=3)


def test_points_that_are_missing(tmp_path):
    points = POINTS.copy()
    points[3, LABELS.index("LKNE")] = np.nan
    got = mocap.read(file_of(tmp_path, points=points))
    assert np.argwhere(np.isnan(got.points[..., 0])).tolist() == [[3, got.markers.index("LKNE")]]
    for nothing in (np.nan, 0.0):
        assert "no frame has any of its markers" in refused(file_of(tmp_path, points=nothing * POINTS))


@pytest.mark.parametrize("spelled", ["{}", " {} ", "{}\0\0", "{}.", "S01:{}", "S01: {} "])
def test_labels_with_signs_around_them_and_in_small_letters(tmp_path, spelled):
    for case in (str, str.lower):
        labels = [spelled.format(case(label)) for label in LABELS]
        assert is_the_person(mocap.read(file_of(tmp_path, labels)))


def test_a_label_that_is_spelled_right_goes_before_one_in_small_letters(tmp_path):
    labels = [*LABELS, "lkne"]
    points = np.concatenate([POINTS, POINTS[:, :1]], axis=1)
    assert is_the_person(mocap.read(file_of(tmp_path, labels, points)))


def test_a_label_twice(tmp_path):
    points = np.concatenate([POINTS, POINTS[:, :1]], axis=1)
    sentence = refused(file_of(tmp_path, [*LABELS, "LASI"], points))
    assert "the points 13 ('LASI') and 25 ('LASI') are all the marker LASI" in sentence


TWO = [f"{name}:{label}" for name in ("Anna", "Ben") for label in LABELS]
TWO_POINTS = np.concatenate([POINTS, POINTS + (0, 3000, 0)], axis=1)


def test_two_subjects_in_one_file(tmp_path):
    path = file_of(tmp_path, TWO, TWO_POINTS)
    sentence = refused(path, subject="S01")
    assert "of 2 subjects, with as many prefixes; set `mocap: {prefix: {<subject>: <prefix>}}` in session" in sentence
    assert "Anna" not in sentence and "Ben" not in sentence, "a log keeps no name"
    assert is_the_person(mocap.read(path, subject="S01", prefix="Anna"))
    assert is_the_person(mocap.read(path, subject="anna"))
    ben = mocap.read(path, subject="S01", prefix="Ben")
    np.testing.assert_allclose(ben.points, person(ben.markers, FRAMES) + (0, 3, 0), atol=1e-6)
    assert "behind the prefix that `mocap.prefix` in session.yaml gives" in refused(path, prefix="Cleo")
    with_dash = file_of(tmp_path, [label.replace(":", "_") for label in TWO], TWO_POINTS)
    assert is_the_person(mocap.read(with_dash, prefix="Anna_"))


def test_units_that_are_empty_or_no_unit(tmp_path):
    for units, says in (((), "is empty"), (("",), "is empty"), (("furlong",), "is 'furlong', not one of mm, cm, m")):
        path = file_of(tmp_path, units=units)
        assert f"POINT:UNITS {says}; set `mocap: {{units: mm}}`" in refused(path)
        assert is_the_person(mocap.read(path, units="mm"))


@pytest.mark.parametrize("right, scale", [("m", 1e-3), ("cm", 0.1)])
def test_metres_that_are_called_millimetres(tmp_path, right, scale):
    path = file_of(tmp_path, points=POINTS * scale)
    assert f"{scale:g} times as large as a person" in (sentence := refused(path))
    assert f"not mm; set `mocap: {{units: {right}}}`" in sentence
    assert is_the_person(mocap.read(path, units=right))


@pytest.mark.parametrize(
    "up, turn", [("y", ((1, 0, 0), (0, 0, 1), (0, -1, 0))), ("x", ((0, 0, 1), (0, 1, 0), (-1, 0, 0)))]
)
def test_another_axis_is_up(tmp_path, up, turn):
    path = file_of(tmp_path, points=POINTS @ np.array(turn).T)
    assert f"not stand along the z axis, but along {up}; set `mocap: {{up: {up}}}`" in refused(path)
    assert is_the_person(mocap.read(path, up=up))
    upside_down = file_of(tmp_path, points=POINTS * (1, -1, -1))
    assert "leans by 180" in (sentence := refused(upside_down)) and "export it with Z up" in sentence


def test_the_settings_reach_the_table(tmp_path):
    y_up = np.stack([TWO_POINTS[..., 0], TWO_POINTS[..., 2], -TWO_POINTS[..., 1]], axis=-1) / 1000
    people, session_file = tmp_path / "subjects.tsv", tmp_path / "session.yaml"
    people.write_text("subject\tpseudonym\theight_m\theight_sigma_m\tconsent_release\nS01\tzebra-0001\t1.7\t\tyes\n")
    session_file.write_text("cameras: [cam01]\nmocap: {prefix: {S01: Anna}}\n")
    c3d = file_of(tmp_path, TWO, y_up, units=())
    table = run(tmp_path, c3d, subject="zebra-0001", units="m", up="y", people=people, session_file=session_file)
    xyz, joints = tables.grid(table, "x", "y", "z")
    np.testing.assert_allclose(xyz, person(joints, FRAMES), atol=1e-6)


def test_what_no_body_does(tmp_path):
    points = POINTS.copy()
    points[10, LABELS.index("LKNE"), 1] += 900
    assert "LKNE is 1." in (sentence := refused(file_of(tmp_path, points=points, first=101)))
    assert "in most frames 0.41 m, in frame 111; correct its label there" in sentence
    points[:, LABELS.index("LKNE"), 1] = POINTS[:, LABELS.index("LKNE"), 1] + 300 * (np.arange(FRAMES) % 3)
    assert "and 12 others; the file is damaged" in refused(file_of(tmp_path, points=points))
    # a marker without another one on the same part
    labels = [label if label in ("LASI", "LKNE", "RKNE", "C7") else f"x{label}" for label in LABELS]
    points = POINTS.copy()
    points[20, LABELS.index("C7"), 0] += 280
    sentence = refused(file_of(tmp_path, labels, points))
    assert "C7 moves at 29 m/s, as no body does, in frame 21 and 1 others; correct its label there" in sentence


def test_a_path_with_letters_of_any_language(tmp_path):
    folder = tmp_path / "Größe — 歩行 'ü' \"x\""
    folder.mkdir()
    assert is_the_person(mocap.read(file_of(folder, name="Läufer 1.c3d")))


def test_bytes_behind_the_data_do_no_harm(tmp_path):
    path = file_of(tmp_path)
    path.write_bytes(path.read_bytes() + bytes(5000))
    assert is_the_person(mocap.read(path))


# analog samples without channels: nothing of the file's size speaks against it, and ezc3d makes room for each
HUGE = {"ANALOG:RATE": 1e9}


def test_a_file_for_which_ezc3d_takes_too_much_memory(tmp_path, monkeypatch):
    monkeypatch.setattr(c3d_points, "MEMORY_MB", 64)
    assert "or needs more than 65 MB for its 0.0 MB" in refused(file_of(tmp_path, more=HUGE))
    monkeypatch.setattr(ezc3d, "c3d", lambda path: bytearray(200 * 2**20))
    assert "or needs more than 66 MB for its 0.0 MB" in refused(file_of(tmp_path, analogs=ANALOGS))


def test_a_file_for_which_ezc3d_takes_too_long_or_crashes(tmp_path, monkeypatch):
    path = file_of(tmp_path)
    monkeypatch.setattr(c3d_points, "SECONDS", 1)
    monkeypatch.setattr(ezc3d, "c3d", lambda path: [None for _ in iter(lambda: time.process_time() < 20, False)])
    assert "takes ezc3d more than 1 s" in refused(path)
    monkeypatch.setattr(ezc3d, "c3d", lambda path: os.kill(os.getpid(), signal.SIGSEGV))
    assert "ezc3d, which reads it, crashes" in refused(path)


@pytest.fixture(scope="module")
def content():
    return c3d_bytes(LABELS, POINTS, analogs=ANALOGS, more=EMPTY)


def damaged(content, data):
    """The file with a bit flipped, and cut off here or there."""
    changed = bytearray(content)
    at = data.draw(st.integers(0, 1).flatmap(lambda head: st.integers(0, 3000 if head else len(content) - 1)))
    changed[at] ^= 1 << data.draw(st.integers(0, 7))
    return changed[: data.draw(st.sampled_from([len(content), len(content), len(content) - 1, at]))]


FUZZ = settings(deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture])


@settings(FUZZ, max_examples=150)
@given(data=st.data())
def test_a_flipped_bit_or_a_cut_is_noticed_or_leaves_a_layout(content, tmp_path, data):
    (tmp_path / "bad.c3d").write_bytes(damaged(content, data))
    try:
        about = c3d_check.layout(tmp_path / "bad.c3d")
    except ValueError as error:
        assert "\n" not in str(error)
    else:
        assert about.frames * len(about.labels) <= len(content)


@pytest.mark.slow
@settings(FUZZ, max_examples=500)
@given(data=st.data())
def test_a_flipped_bit_or_a_cut_is_read_or_refused_in_one_sentence(content, tmp_path, data):
    (tmp_path / "bad.c3d").write_bytes(damaged(content, data))
    begun = time.perf_counter()
    try:
        read = mocap.read(tmp_path / "bad.c3d")
    except DiorError as error:
        assert "bad.c3d" in str(error) and "\n" not in str(error)
    else:
        assert read.points.size <= len(content)
        assert np.nanmax(np.abs(read.points)) < 1000
    assert time.perf_counter() - begun < 20
