import json
import time
from types import SimpleNamespace

import pytest

from dior.cli import main
from dior.errors import DiorError
from dior.evaluate import timing
from dior.tables import tables


def job(step, cpu_s, frames=None, **where):
    return {"step": step, "session": None, "sequence": None, "camera": None, "frames": frames, "cores": 1} | where | {
        "cpu_s": cpu_s, "wall_s": 2 * cpu_s
    }  # fmt: skip


def test_what_a_job_used_is_written_beside_its_log(tmp_path, monkeypatch):
    monkeypatch.setenv(timing.FOLDER, str(tmp_path / "logs"))
    monkeypatch.setenv("OMP_NUM_THREADS", "2")
    table = tmp_path / "frames.parquet"
    tables.write(table, "frames", {"camera": ["cam01"] * 3 + ["cam02"]})
    arguments = {"sequence": "walk", "camera": "cam01", "frames": table}
    timing.write("reproject", arguments, time.monotonic() - 5)
    used = json.loads((tmp_path / "logs/reproject/walk.cam01.timing.json").read_text())
    assert used["frames"] == 3 and used["cores"] == 2 and 5 <= used["wall_s"] < 6 and used["cpu_s"] > 0
    timing.write("audit", arguments | {"camera": None}, time.monotonic())
    assert json.loads((tmp_path / "logs/audit/walk.timing.json").read_text())["frames"] == 4


def test_nothing_is_written_by_hand_or_by_a_job_that_failed(tmp_path, monkeypatch):
    monkeypatch.delenv(timing.FOLDER, raising=False)
    timing.write("audit", {"sequence": "walk_1"}, time.monotonic())
    monkeypatch.setenv(timing.FOLDER, str(tmp_path / "logs"))
    missing = [word for flag in ("frames", "data-root", "out") for word in (f"--{flag}", str(tmp_path / flag))]
    missing += [word for flag in ("out-dropped", "findings") for word in (f"--{flag}", str(tmp_path / flag))]
    assert main.main(["audit", "--sequence", "walk_1", *missing]) == 1
    assert not (tmp_path / "logs").exists()


@pytest.mark.parametrize(
    ("step", "arguments", "name"),
    [
        ("locate", {"session": "lab", "camera": "cam01"}, "lab.cam01"),
        ("intrinsics", {"session": "lab", "sequence": "walk", "camera": "cam01"}, "lab.cam01"),
        ("triangulate", {"sequence": "walk", "subject": "A"}, "walk"),
        ("tarballs", {"subject": "zebra-0001"}, "zebra-0001"),
        ("simulate_mocap", {"sequence": "walk"}, "walk"),
        ("overlays", {"sequence": "walk", "roles": {"cam02": "close"}}, "walk.cam02"),
        ("evaluate", {"sequence": "walk", "roles": {"cam01": "close", "cam02": "close"}}, "walk"),
        ("metrics", {}, "metrics"),
    ],
)
def test_a_job_is_called_as_its_log_is(step, arguments, name):
    assert timing.unit(step, arguments) == name


def test_jobs_are_added_up_by_step():
    jobs = [job("frames", 1.0, 100), job("frames", 3.0, 300), job("adjust", 2.0), job("simulate", 50.0, 400)]
    rows = {row["step"]: row for row in timing.by_step(jobs, 500)}
    assert (rows["frames"]["jobs"], rows["frames"]["frames"], rows["frames"]["cpu_s"]) == (2, 400, 4.0)
    assert rows["frames"]["cpu_s_per_frame"] == 0.01 and rows["frames"]["wall_s"] == 8.0
    assert rows["adjust"]["frames"] == 500 and rows["adjust"]["cpu_s_per_frame"] == 0.004
    assert rows["all"] == {
        "step": "all", "jobs": 3, "frames": 500, "cpu_s": 6.0, "wall_s": 12.0, "cpu_s_per_frame": 0.012
    }  # fmt: skip
    assert timing.as_csv(timing.by_step([], 0)).splitlines()[1] == "all,0,0,0,0,"


def test_what_is_left_of_other_sequences_is_not_counted(tmp_path):
    kept = [job("frames", 1.0, sequence="walk"), job("adjust", 1.0, session="field"), job("metrics", 1.0)]
    gone = [job("frames", 1.0, sequence="old"), job("locate", 1.0, session="attic"), job("tarballs", 1.0)]
    kept += [job("tarballs", 2.0), job("tarballs", 3.0)]
    names = ["walk", "field", "metrics", "zebra-0001", "metadata", "old", "attic.cam01", "apple-0002"]
    for name, one in zip(names, kept + gone, strict=True):
        path = tmp_path / one["step"] / f"{name}.timing.json"
        path.parent.mkdir(exist_ok=True)
        path.write_text(json.dumps(one))
    found = timing.collect(tmp_path, ["walk"], ["field"], ["zebra-0001"])
    assert sorted(map(json.dumps, found)) == sorted(map(json.dumps, kept))


def test_the_time_of_a_job_is_its_own_and_its_childrens(tmp_path, monkeypatch):
    used = {timing.resource.RUSAGE_SELF: (1.0, 0.5), timing.resource.RUSAGE_CHILDREN: (2.0, 0.25)}
    monkeypatch.setattr(
        timing.resource,
        "getrusage",
        lambda who: SimpleNamespace(ru_utime=used[who][0], ru_stime=used[who][1]),
    )
    monkeypatch.setenv(timing.FOLDER, str(tmp_path))
    timing.write("metrics", {}, time.monotonic())
    assert json.loads((tmp_path / "metrics/metrics.timing.json").read_text())["cpu_s"] == 3.75


@pytest.mark.parametrize("text", ["", "{", "[]", "null", '{"step": "frames"}', "\xff", '"cpu_s"'])
def test_a_damaged_note_of_the_costs_is_one_sentence(tmp_path, text):
    path = tmp_path / "frames/walk.timing.json"
    path.parent.mkdir()
    path.write_text(text, encoding="latin-1")
    with pytest.raises(DiorError, match="walk.timing.json: is not what a job notes of its costs; delete it"):
        timing.collect(tmp_path, ["walk"], [])
