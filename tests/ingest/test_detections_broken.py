"""Truncated, empty, wrong-typed and bit-flipped detections: one clear sentence or sane people, nothing else."""

import json
import os
import re
import shutil
import tracemalloc

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from dior.errors import DiorError
from dior.ingest import detections
from dior.ingest.readers import READERS
from dior.ingest.readers.recognise import recognise
from tests.ingest import formats
from tests.ingest.formats import WRITERS, scene
from tests.ingest.test_detections_formats import run

each_writer = pytest.mark.parametrize("writer", WRITERS, ids=lambda writer: writer.__name__)
often = settings(max_examples=15, deadline=2000, suppress_health_check=list(HealthCheck), derandomize=True)
CSV_WRITERS = [formats.deeplabcut, formats.deeplabcut_of_several, formats.caliscope]
JSON_WRITERS = [writer for writer in WRITERS if "text" not in writer.__name__ and writer.__name__[:4] != "yolo"]
JSON_WRITERS += [formats.yolo_json, formats.yolo_json_list, formats.yolo_json_lines, formats.yolo_validated]
JSON_WRITERS = [writer for writer in JSON_WRITERS if "csv" not in WRITERS[writer][0] and writer not in CSV_WRITERS]


@pytest.fixture
def written(tmp_path, writer):
    """(what `detections` names, one file of it, that file's bytes)."""
    path = writer(tmp_path / "whole", scene(len(WRITERS[writer][1])))
    file = sorted(path.iterdir())[1] if path.is_dir() else path
    return path, file, file.read_bytes()


def read(writer, path, size):
    """People or None where the reader refused with one sentence; nothing else may happen."""
    tracemalloc.start()
    try:
        people = READERS[WRITERS[writer][0]].read(path)
    except DiorError as error:
        assert str(path) in str(error) and "\n" not in str(error) and len(str(error)) < 600
        return None
    finally:
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert peak < 100 * size + 4_000_000
    count, joints = len(people.frame), len(people.joints)
    assert people.uv.shape == (count, joints, 2) and people.score.shape == (count, joints)
    missing = np.isnan(people.uv[..., 0])
    assert (missing == np.isnan(people.uv[..., 1])).all() and not missing.all(axis=1).any()
    assert (np.abs(people.uv[~missing]) <= 1e6).all()
    assert (people.score >= 0).all() and (people.score <= 1).all() and (people.score[missing] == 0).all()
    assert (np.diff(people.ran) > 0).all() and np.isin(people.frame, people.ran).all()
    assert (np.diff(people.frame) >= 0).all() and len(people.stamp_ns) == len(people.ran)
    return people


@each_writer
def test_truncated_anywhere(writer, written):
    path, file, whole = written

    @often
    @given(st.integers(0, len(whole.rstrip()) - 1))
    def check(length):
        file.write_bytes(whole[:length])
        people = read(writer, path, len(whole))
        # formats of lines are whole again after every line, and a last number may be short of a digit
        if people is not None and writer in JSON_WRITERS and not str(file).endswith(".jsonl"):
            raise AssertionError(f"{length} of {len(whole)} bytes were taken for the whole")

    check()


@each_writer
def test_bits_flipped(writer, written):
    path, file, whole = written

    @often
    @given(st.lists(st.integers(0, 8 * len(whole) - 1), min_size=1, max_size=8))
    def check(bits):
        damaged = np.frombuffer(whole, np.uint8).copy()
        for bit in bits:
            damaged[bit // 8] ^= 1 << bit % 8
        file.write_bytes(damaged.tobytes())
        recognise(path)
        read(writer, path, len(whole))

    check()


def spoiled(content, random, value):
    """`content` with one of its values, anywhere, replaced."""
    if isinstance(content, (list, dict)) and content and random.random() < 0.85:
        key = random.choice(list(content) if isinstance(content, dict) else range(len(content)))
        copy = content.copy()
        copy[key] = spoiled(content[key], random, value)
        return copy
    return value


VALUES = st.one_of(
    st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=5), st.lists(st.integers(), max_size=3),
    st.dictionaries(st.text(max_size=3), st.integers(), max_size=2),
    st.sampled_from([2**63, 2**64, 10**400, -1, 1e300]),
)  # fmt: skip


@pytest.mark.parametrize("writer", JSON_WRITERS, ids=lambda writer: writer.__name__)
def test_values_of_the_wrong_type(writer, written):
    path, file, whole = written
    lines = whole.decode().splitlines() if file.suffix == ".jsonl" else [whole.decode()]

    @often
    @given(st.randoms(use_true_random=False), VALUES)
    def check(random, value):
        chosen = random.randrange(len(lines))
        damaged = [json.dumps(spoiled(json.loads(x), random, value)) if i == chosen else x for i, x in enumerate(lines)]
        file.write_text("\n".join(damaged))
        read(writer, path, len(whole))

    check()


WORDS = st.one_of(
    st.text(alphabet=st.characters(codec="utf-8", exclude_characters=" \n\r"), max_size=4),
    st.sampled_from(["nan", "-inf", "1e999", "9" * 40, "-1", "0.5", "1_0", '"', "{", "}", "#"]),
)


@pytest.mark.parametrize("writer", [one for one in WRITERS if one not in JSON_WRITERS], ids=lambda one: one.__name__)
def test_words_that_are_something_else(writer, written):
    path, file, whole = written
    words = re.split(r"([\s,]+)", whole.decode())

    @often
    @given(st.integers(0, len(words) - 1), WORDS)
    def check(at, word):
        file.write_bytes("".join([*words[:at], word, *words[at + 1 :]]).encode())
        recognise(path)
        read(writer, path, len(whole))

    check()


@each_writer
def test_empty_file_and_folder(tmp_path, writer, written):
    path, file, whole = written
    file.write_bytes(b"")
    if path.is_file():
        with pytest.raises(DiorError, match=r"walk, cam01: the file .* is empty; run the detector"):
            run(tmp_path, path)
    elif writer in (formats.yolo, formats.yolo_39):
        assert 1 not in read(writer, path, len(whole)).frame
    else:
        assert read(writer, path, len(whole)) is None
    if path.is_dir():
        shutil.rmtree(path)
        path.mkdir()
        with pytest.raises(DiorError, match=r"walk, cam01: the folder .* is empty; run the detector"):
            run(tmp_path, path)


@each_writer
def test_damaged_files_through_the_whole_step(tmp_path, writer, written):
    path, file, whole = written
    random = np.random.default_rng(7)
    for _ in range(6):
        damaged = np.frombuffer(whole, np.uint8).copy()
        damaged[random.integers(0, len(whole), 3)] ^= (1 << random.integers(0, 8, 3)).astype(np.uint8)
        file.write_bytes(damaged.tobytes()[: random.integers(1, len(whole) + 1)])
        try:
            run(tmp_path, path)
        except DiorError as error:
            assert str(error).startswith(("walk, cam01", str(tmp_path))) and "\n" not in str(error)


@pytest.mark.parametrize(
    "text", [b"[" * 200_000, b'{"a":' * 100_000, b"landmarks {" * 50_000, b"0 " * 200_000, b"\xff" * 9]
)
@pytest.mark.parametrize("name", READERS)
def test_hostile_files_end_soon(tmp_path, name, text):
    as_text = name == "mediapipe" and text.startswith(b"land")
    path = tmp_path / ("1.pbtxt" if as_text else "1.txt" if name == "yolo" else "1.json")
    path.write_bytes(text)
    recognise(path)
    with pytest.raises(DiorError):
        READERS[name].read(tmp_path if READERS[name].shape == "folder" else path)


def test_what_is_no_file(tmp_path):
    """A pipe would be waited for without an end; a folder called like a file is found in the folder of another."""
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(DiorError, match=r"walk, cam01: .*pipe is neither a file nor a folder"):
        run(tmp_path, tmp_path / "pipe")
    folder = formats.openpose(tmp_path, scene(18))
    (folder / "000000000009_keypoints.json").mkdir()
    with pytest.raises(DiorError, match=r"000000000009_keypoints.json: cannot be read .Is a directory"):
        run(tmp_path, folder)


def test_a_frame_far_out_is_refused_before_anything_is_made_for_it(tmp_path):
    found = {10**15: scene(17)[0]}
    with pytest.raises(DiorError, match="has frame 1000000000000000 but the recording has frames 0 to 3"):
        run(tmp_path, formats.coco(tmp_path, found))
    assert detections.READERS is READERS
