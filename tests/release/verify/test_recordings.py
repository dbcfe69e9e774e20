"""`dior verify --inputs`: recordings that are not what the labels were made from are named, each."""

import pytest

from dior.cli import main
from tests.release import made as project


@pytest.fixture
def root(tmp_path):
    project.project(tmp_path)
    return tmp_path


def verified(root, capsys):
    code = main.main(["verify", "--inputs", str(root)])
    return code, capsys.readouterr()


def test_recordings_that_are_as_they_were(root, capsys):
    code, said = verified(root, capsys)
    assert (code, said.out) == (0, f"{root}: 4 recordings are what the labels were made from\n")


def test_each_that_was_changed_or_is_gone_is_named(root, capsys):
    changed, lost = root / "data/walk_2/host.bag", root / "data/walk_3/host.bag"
    changed.write_bytes(changed.read_bytes()[::-1])
    lost.unlink()
    code, said = verified(root, capsys)
    first, second = said.out.splitlines()
    assert code == 1 and "2 problems" in said.err
    assert first.startswith(f"walk_2, bag_1: {changed} is not what the labels were made from")
    assert first.endswith("delete results/{frames,mocap,detections,provenance}/walk_2.* and run again")
    assert second == f"walk_3, bag_1: {lost} is gone"


def test_a_project_without_checksums_says_what_makes_them(root, capsys):
    for path in (root / "results/provenance").iterdir():
        path.unlink()
    code, said = verified(root, capsys)
    assert code == 1 and "has no checksums to compare with; the target `release` makes them" in said.err


def test_nothing_to_look_at_is_an_error(capsys):
    assert main.main(["verify"]) == 1
    assert "name a release folder" in capsys.readouterr().err
