"""Checksums of recordings are those of sha256sum and tell no name."""

import hashlib
import json

import pytest

from dior.errors import DiorError
from dior.release import provenance, provenance_json


def test_files_and_folders_are_told_by_what_they_are_for(tmp_path):
    bag = tmp_path / "realname.bag"
    bag.write_bytes(b"bag")
    folder = tmp_path / "openpose"
    (folder / "deep").mkdir(parents=True)
    for name, content in (("deep/b.json", b"bb"), ("a.json", b"a")):
        (folder / name).write_bytes(content)
    out = tmp_path / "out.json"
    provenance.run(sequence="walk", recordings={"detections.cam01": folder, "bag_1": bag}, out=out)
    found = json.loads(out.read_text())
    assert found["bag_1"] == {"sha256": hashlib.sha256(b"bag").hexdigest(), "bytes": 3}
    lines = f"{hashlib.sha256(b'a').hexdigest()}  a.json\n{hashlib.sha256(b'bb').hexdigest()}  deep/b.json\n"
    assert found["detections.cam01"] == {"sha256": hashlib.sha256(lines.encode()).hexdigest(), "bytes": 3}
    assert "realname" not in out.read_text() and "json" not in out.read_text()


def test_a_recording_that_is_gone_is_named(tmp_path):
    with pytest.raises(DiorError, match="walk, mocap: .*gone.c3d does not exist"):
        provenance.run(sequence="walk", recordings={"mocap": tmp_path / "gone.c3d"}, out=tmp_path / "out.json")
    assert not (tmp_path / "out.json").exists()


def test_a_requirement_that_names_its_versions_is_told_by_its_name(monkeypatch):
    needed = ["numpy>=2,<3", "PyYAML", 'torch; extra == "reid"', "rosbags[x] ~= 0.11 ; python_version > '3'"]
    needed.append("not-made-for-this-machine>=1; platform_machine == 'elsewhere'")
    monkeypatch.setattr(provenance_json.metadata, "requires", lambda name: needed)
    assert list(provenance_json.versions()) == ["python", "PyYAML", "numpy", "rosbags"]
