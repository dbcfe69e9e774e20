"""What is said of formats: every reader says it, the docs say the same, and each has its test file."""

import json
import subprocess
import sys
from dataclasses import asdict
from pathlib import Path

import pytest
import yaml

from dior.calibrate.readers import files
from dior.cli import formats
from dior.cli.main import main
from dior.ingest import containers, messages, mocap_files, readers
from docs import format_tables
from tests.end_to_end.workflow import ROOT

REGISTRIES = {"calibrations": files.READERS, "detections": readers.READERS, "mocap": mocap_files.READERS}
# the rooms that hold a module for each format, the modules of each that are none, and where their tests are
ROOMS = {
    "calibrate/readers": {"files", "given", "source", "xml_text"},
    "ingest/readers": {"common", "prototext", "recognise"},
    "ingest/mocap_files": {"capture"},
}


@pytest.mark.parametrize("path", sorted(format_tables.PAGES.glob("*.md")), ids=lambda path: path.name)
def test_the_docs_say_what_the_readers_say(path):
    text = path.read_text(encoding="utf-8")
    assert format_tables.written(text) == text, "run `python -m docs.format_tables --write`"


def test_every_kind_has_its_table_in_the_docs():
    shown = {
        found[2]
        for path in format_tables.PAGES.glob("*.md")
        for found in format_tables.BLOCK.finditer(path.read_text(encoding="utf-8"))
    }
    assert shown == {*formats.KINDS, "detections samples"}


@pytest.mark.parametrize("kind", REGISTRIES)
def test_a_reader_describes_what_it_reads_by_its_own_key(kind):
    for key, reader in REGISTRIES[kind].items():
        assert reader.described and {one.key for one in reader.described} == {key}


def test_bags_and_messages_are_described_by_what_they_are_called():
    assert {one.key for one in containers.DESCRIPTIONS} == {name for name, _ in containers.FORMATS.values()}
    kinds = (messages.COMPRESSED, messages.RAW, messages.PACKET, messages.THEORA, messages.CAMERA_INFO)
    called = {kind.replace("/msg/", "/") for kind in kinds}
    assert {one.key for one in messages.DESCRIPTIONS} == called
    for encoding in messages.ENCODINGS:
        assert f"`{encoding}`" in messages.DESCRIPTIONS[1].read


def test_every_cell_says_something_that_a_table_can_hold():
    for kind, found in formats.KINDS.items():
        for one in found:
            said = asdict(one)
            samples = said.pop("samples", [])
            assert samples or "samples" not in asdict(one)
            for name, text in [*said.items(), *(pair for sample in samples for pair in sample.items())]:
                # of a file that holds no pose
                assert text or (one.key, name) in (("ros_info", "unit"), ("ros_info", "world")), (kind, one.key, name)
                assert "|" not in text and "\n" not in text and text == text.strip()


def test_what_detections_names_is_what_the_reader_takes():
    for reader in readers.READERS.values():
        (one,) = reader.described
        takes = {word for word in ("file", "folder") if f" {word}" in f" {one.file}"}
        assert takes == ({"file", "folder"} if reader.shape == "either" else {reader.shape}), one.key


def test_the_words_of_the_config_are_the_keys_of_the_readers():
    schemas = ROOT / "dior/project/schemas"
    config = yaml.safe_load((schemas / "config.schema.yaml").read_text())["properties"]["detector"]["properties"]
    assert set(config["format"]["enum"]) == {"auto", *readers.READERS}
    markers = yaml.safe_load((schemas / "markers.schema.yaml").read_text())["properties"]
    assert set(markers["format"]["enum"]) == {"", *mocap_files.READERS}


@pytest.mark.parametrize("room", ROOMS)
def test_each_reader_is_a_module_with_a_test_file(room):
    modules = {path.stem for path in (ROOT / "dior" / room).glob("*.py")} - {"__init__"} - ROOMS[room]
    tests = {path.stem.removeprefix("test_") for path in (ROOT / "tests" / room).glob("test_*.py")}
    assert modules and modules <= tests


def test_the_command_lists_all_and_tells_everything_of_a_kind(capsys):
    assert main(["formats"]) == 0
    listed = capsys.readouterr().out
    for kind, found in formats.KINDS.items():
        assert formats.TITLES[kind] in listed and all(f"  {one.key} " in listed for one in found)
    assert main(["formats", "detections"]) == 0
    whole = " ".join(capsys.readouterr().out.split())
    for one in formats.KINDS["detections"]:
        assert " ".join(one.refused.split()) in whole and all(sample.read in whole for sample in one.samples)
    assert formats.TITLES["mocap"] not in whole


def test_the_command_as_json(capsys):
    assert main(["formats", "mocap", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {"mocap": [asdict(one) for one in formats.KINDS["mocap"]]}


def test_a_kind_that_is_none_is_answered_with_those_there_are(capsys):
    assert main(["formats", "calibs"]) == 2
    assert "calibrations" in capsys.readouterr().err


def test_the_kinds_of_the_command_are_those_there_are():
    from typing import get_args, get_type_hints

    (literal, none) = get_args(get_type_hints(formats.run)["kind"])
    assert get_args(literal) == tuple(formats.KINDS) == tuple(formats.TITLES) and none is type(None)


def test_a_description_re_runs_nothing():
    from dior.tables import code_hash

    path = Path(readers.openpose.__file__)
    text = path.read_text(encoding="utf-8")
    read = code_hash._read
    changed = text.replace("OpenPose; RTMPose", "OpenPose; frames; RTMPose")
    assert changed != text and read(changed) == read(text)
    assert read(text.replace("CLEARLY_SHORTER = 0.8", "CLEARLY_SHORTER = 0.9")) != read(text)


@pytest.mark.slow
def test_the_real_data_in_every_format(shared):
    """Ends with 1 where something that is read differs from what was written."""
    words = [sys.executable, "-m", "benchmarks.formats", str(shared)]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0 and done.stdout.count(" here ") > 50, done.stdout + done.stderr
