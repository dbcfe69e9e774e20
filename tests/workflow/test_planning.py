"""What the benchmark of planning reads out of a project: the longest chain, and what jobs of a kind take."""

import json
import re

import pytest

from benchmarks.planning import FIXES, Job, jobs_of, longest, make_as_if_run, means, mended, snakemake
from dior.project import project
from dior.simulate import config, settings


def test_the_longest_chain_is_the_one_that_takes_longest():
    jobs = [
        Job("frames", "w", (), ("f",)),
        Job("mocap", "w", ("f",), ("m",)),
        Job("detections", "w", ("f",), ("d",)),
        Job("clocks", "w", ("m", "d", "a file of somebody's"), ("c",)),
        Job("page", "w", ("c",), ("p",)),
    ]
    taken = {("frames", "w"): 1.0, ("mocap", "w"): 3.0, ("detections", "w"): 2.0, ("clocks", "w"): 1.0}
    assert [job.step for job in longest(jobs, taken, "c")] == ["frames", "mocap", "clocks"]


def test_what_a_job_takes_is_what_its_kind_took_and_the_simulation_nothing(tmp_path):
    for step, unit, seconds in (
        ("clocks", "indoor_01.cam01", 1.0),
        ("clocks", "indoor_02.cam01", 2.0),
        ("clocks", "outdoor_01", 6.0),
        ("simulate", "indoor_01", 50.0),
    ):
        path = tmp_path / f"logs/{step}/{unit}.timing.json"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps({"cpu_s": seconds}))
    assert means(tmp_path) == {
        ("clocks", "indoor"): 1.5, ("clocks", "outdoor"): 6.0, ("clocks", ""): 3.0,
        ("simulate", "indoor"): 0.0, ("simulate", ""): 0.0,
    }  # fmt: skip
    assert Job("locate", "lab_2.cam02", (), ()).kind == ("locate", "lab")


def test_a_project_of_empty_files_has_nothing_left_to_do(tmp_path):
    made = {"subjects": 1, "sequences": 1, "duration_s": 2.0, "environments": ["indoor"]}
    config.write(settings.from_dict(made), tmp_path / "config")
    make_as_if_run(tmp_path)
    assert "Job stats" not in snakemake(tmp_path, "-n", "all")[0]
    assert {"clocks", "locate", "page", "report"} <= {job.step for job in jobs_of(tmp_path)}


@pytest.mark.slow
def test_a_clock_that_is_typed_runs_what_is_of_its_camera(tmp_path):
    made = {"subjects": 1, "sequences": 2, "duration_s": 2.0}
    config.write(settings.from_dict(made), tmp_path / "config")
    path = tmp_path / "config/offsets/indoor_01.yaml"
    path.parent.mkdir()
    path.write_text("cam01: {offset_s: 0.02}\n")
    make_as_if_run(tmp_path)

    def would_run():
        return {*re.findall(r"^ +log: logs/(\w+)/(\S+)\.log", snakemake(tmp_path, "-n", "all")[0], re.MULTILINE)}

    def of(*steps):
        return {f"{step} {unit}" for step, unit in would_run() if step in steps}

    path.write_text("# by the clap\ncam01: {offset_s: 0.02}\ncam03: {offset_s: 0.1}\n")
    of_cam03 = {"locate lab.cam03", "clocks indoor_01.cam03", "clocks indoor_02.cam03"}
    assert of("locate", "clocks", "adjust") == of_cam03
    # outdoors a long-range camera's clock is for itself
    path.write_text("cam01: {offset_s: 0.02}\n")
    (tmp_path / "config/offsets/outdoor_01.yaml").write_text("cam04: {offset_s: 0.1}\n")
    steps = {step for step, _ in would_run()}
    assert {"align", "follow"} <= steps and not {"adjust", "clocks", "triangulate", "locate"} & steps


def test_every_fix_is_one_and_is_taken_back(tmp_path):
    config.write(settings.from_dict({"subjects": 2, "sequences": 1, "duration_s": 2.0}), tmp_path / "config")

    def texts():
        return {path: path.read_bytes() for path in (tmp_path / "config").rglob("*") if path.is_file()}

    before = texts()
    for fix in FIXES.values():
        with mended(tmp_path, fix):
            # one file, and the project is still one
            assert len({*texts().items()} ^ {*before.items()}) in (1, 2) and project.load(tmp_path)
        assert texts() == before
