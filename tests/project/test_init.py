"""`dior init` writes a project that only has to be filled in."""

import shutil
from pathlib import Path

import pytest
import yaml

from dior.errors import DiorError
from dior.project import init, project
from dior.project.schema_check import check, columns_of


def filled_in(root):
    """Do what the message asks for: two more cameras, one walk, one subject."""
    config = root / "config"
    session = config / "sessions/session_01"
    for name in ("cam02", "cam03"):
        text = (session / "cam01.yaml").read_text().replace("/cam01/", f"/{name}/")
        (session / f"{name}.yaml").write_text(text.replace("[4.0,", f"[{name[-1]}.5,"))
    text = (session / "session.yaml").read_text()
    (session / "session.yaml").write_text(text.replace(", cam04", "").replace("adjust: {}", "adjust: {walk_01: {}}"))
    walk = dict(sequence="walk_01", session_order="1", subject="P1", session="session_01", environment="outdoor",
                bags="a.bag", detections="mlkit/{camera}.jsonl")  # fmt: skip
    person = dict(subject="P1", pseudonym="violet-77", height_m="1.8", consent_release="yes")
    for kind, row in (("sequences", walk), ("subjects", person)):
        with open(config / f"{kind}.tsv", "a") as stream:
            stream.write("\t".join(row.get(column, "") for column in columns_of(kind)) + "\n")


def test_what_is_written_only_has_to_be_filled_in(tmp_path):
    init.run(tmp_path / "mine")
    filled_in(tmp_path / "mine")
    loaded = project.load(tmp_path / "mine")
    assert loaded.sequences == ("walk_01",) and loaded.close("session_01") == ["cam01", "cam02", "cam03"]
    assert loaded.config["data_root"] == "data" and "simulate" not in loaded.config
    assert loaded.released_subjects == ("violet-77",) and not loaded.pictures_released("walk_01"), (
        "that is not answered yet"
    )


def test_every_file_passes_its_schema(tmp_path):
    init.run(tmp_path / "mine")
    config = tmp_path / "mine/config"
    found = sorted(path.relative_to(config).as_posix() for path in config.rglob("*") if path.is_file())
    assert found == [
        "config.yaml", "detectors.tsv", "gallery.tsv", "sequences.tsv", "sessions/session_01/cam01.yaml",
        "sessions/session_01/session.yaml", "subjects.tsv",
    ]  # fmt: skip
    for path, kind in (("config", "config"), ("sessions/session_01/session", "session"),
                       ("sessions/session_01/cam01", "camera")):  # fmt: skip
        check(yaml.safe_load((config / f"{path}.yaml").read_text()), kind, path)


@pytest.mark.parametrize("line", ["align", "nudge", "reference"])
def test_the_commented_keys_of_the_camera_are_valid_too(line):
    text = init.contents()["sessions/session_01/cam01.yaml"]
    assert f"# {line}: {{" in text
    check(yaml.safe_load(text.replace(f"# {line}: ", f"{line}: ")), "camera", "cam01.yaml")


def test_an_empty_sheet_is_a_clear_error(tmp_path):
    init.run(tmp_path)
    with pytest.raises(DiorError, match="config/sequences.tsv has no rows yet"):
        project.load(tmp_path)


def test_the_line_to_run_next_is_printed(tmp_path, capsys):
    init.run(tmp_path / "my walks")
    assert capsys.readouterr().out.endswith(f"  dior run '{tmp_path}/my walks'\n")


def test_a_config_that_is_there_is_never_overwritten(tmp_path):
    init.run(tmp_path)
    sheet = tmp_path / "config/subjects.tsv"
    sheet.write_text("mine")
    with pytest.raises(DiorError, match="exists already"):
        init.run(tmp_path)
    assert sheet.read_text() == "mine"


def test_two_projects_are_the_same_bytes(tmp_path):
    for name in ("a", "b"):
        init.run(tmp_path / name)
    shutil.rmtree(tmp_path / "b/config/sessions")
    for path in Path(tmp_path / "b/config").iterdir():
        assert path.read_bytes() == (tmp_path / "a/config" / path.name).read_bytes()
