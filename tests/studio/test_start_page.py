"""What the first page says is left to do, and the button that runs the workflow."""

import json
import shutil
import time

import pytest

from dior.project.project import load
from dior.studio import start_page
from dior.tables import tables
from tests.project.test_project import edit
from tests.studio import browser


def tasks(root):
    return {(task.what, task.where): task for task in start_page.tasks(load(root))}


def test_marks_and_boxes_are_counted(project):
    found = tasks(project)
    marks, boxes = found["Mark markers", "lab cam01"], found["Draw boxes", "out_1 cam03"]
    rows = (project / "config/sessions/lab/cam01.marks.csv").read_text().splitlines()[1:]
    assert marks.says.startswith(f"{len(rows)} marks on ") and marks.state == "weak"
    header, *_ = (project / "config/boxes/out_1.cam03.csv").read_text().splitlines()
    drawn = [header, *(f"{frame},1,2,3,4" for frame in range(12)), "12,,,,"]
    (project / "config/boxes/out_1.cam03.csv").write_text("\n".join(drawn))
    assert boxes.state != "done"
    again = tasks(project)["Draw boxes", "out_1 cam03"]
    assert (again.state, again.says) == ("weak", "12 drawn; 20 to 30 are asked")
    more = [f"{frame},1,2,3,4" for frame in range(13, 21)]
    (project / "config/boxes/out_1.cam03.csv").write_text("\n".join([*drawn, *more]))
    assert tasks(project)["Draw boxes", "out_1 cam03"].state == "done"


def test_a_file_that_is_broken_is_a_task_with_its_error(project):
    with open(project / "config/sessions/lab/cam01.marks.csv", "a") as stream:
        stream.write("in_1,x,LASI,1,2\n")
    task = tasks(project)["Mark markers", "lab cam01"]
    assert task.state == "missing" and "frame is 'x'" in task.says


def test_what_the_last_run_asks_is_a_task(project):
    (project / "results/follow").mkdir(parents=True)
    found = [
        ("out_1/cam03", "warning", "clock_unknown", "two lags fit"),
        ("out_1/cam03", "info", "clock_unknown", "no"),
    ]
    tables.write_findings(project / "results/follow/out_1.cam03.findings.parquet", found)
    task = tasks(project)["Set the clock", "out_1 cam03"]
    assert task.says == "two lags fit"
    (project / "results/report").mkdir()
    session = load(project).session_of("out_1")
    levels = {f"{session}/cam03": {"level": "look"}, "lab/cam01": {"level": "good"}}
    (project / "results/report/history.json").write_text(json.dumps({"now": levels, "before": {}}))
    lit = [task for task in start_page.tasks(load(project)) if task.what == "Look at the labels"]
    assert [task.where for task in lit] == [f"{session} cam03"] and lit[0].says.startswith("amber")


def test_what_a_killed_run_left_does_not_hide_the_other_tasks(client, project):
    (project / "results/follow").mkdir(parents=True)
    (project / "results/follow/out_1.cam03.findings.parquet").write_bytes(b"PAR1 and no more")
    page = client.get("/").text
    assert "Run it again" in page and "out_1.cam03.findings.parquet" in page and "Draw boxes" in page


def test_values_that_are_still_to_do_are_listed_by_file(client, project):
    (project / "config/sessions/lab/cam01.marks.csv").unlink()
    page = client.get("/").text
    assert "Mark markers" in page and "TODO" not in page and "needs the file" not in page
    path = project / "config/sessions/lab/cam01.yaml"
    path.write_text(path.read_text() + "distortion_model: TODO\n")
    page = client.get("/").text
    assert "config/sessions/lab/cam01.yaml</code>" in page and 'data-key="distortion_model"' in page


@pytest.mark.parametrize(
    ("kind", "task"), [("boxes, sequences: [out_1]", "Draw boxes"), ("marks, sequences: [out_1]", "")]
)
def test_what_a_camera_is_aligned_to_and_is_not_made_yet_is_no_fault(client, project, kind, task):
    (project / "config/boxes/out_1.cam03.csv").unlink()
    edit(project, "sessions/field/cam03.yaml", "nudge: {azimuth_deg: 0.2}", f"align: {{from: {kind}}}")
    page = client.get("/").text
    assert "needs the file" not in page and task in page
    assert not client.get("/api/check").json()["faults"]


def test_what_is_between_backticks_is_code_and_nothing_else_is(client):
    told = client.get("/api/marks", params={"walk": "`<b>`"}, headers={"accept": "text/html"}).text
    assert "<code>&lt;b&gt;</code>" in told and "<b>" not in told


def test_check_says_what_else_is_wrong(client, project):
    (project / "config/sessions/lab/cam01.marks.csv").unlink()
    (project / "data/out_1/mlkit/cam01.jsonl").unlink()
    told = client.get("/api/check").json()
    assert [one["walk"] for one in told["faults"]] == ["out_1"] and "cam01.jsonl" in told["faults"][0]["text"]


def test_only_runs_of_dior_can_be_asked_for(client):
    for words in ({}, {"do": "rm"}, {"do": ["run"]}, {"do": "run --config x=1"}):
        answer = client.post("/api/run", json=words)
        assert answer.status_code == 422
    assert client.get("/api/run").json()["state"] == "none"
    assert client.post("/api/run", content=b"[1]").status_code == 422
    assert client.post("/api/run", content=b"{").status_code == 422
    assert client.post("/api/run", json={"do": "end"}).status_code == 422


def ended(client):
    for _ in range(600):
        told = client.get("/api/run").json()
        if told["state"] != "running":
            return told
        time.sleep(0.2)
    raise AssertionError(told)


def test_a_dry_run_says_what_would_run(client):
    client.post("/api/run", json={"do": "dry"})
    told = ended(client)
    assert told["state"] == "done" and told["dry"] and any("frames" in line for line in told["lines"])


@pytest.mark.slow
def test_the_button_runs_the_workflow_to_its_end(practice, chromium, tmp_path):
    project = tmp_path / "capture"
    shutil.copytree(practice, project)
    browser.solved(project, "marks")
    with browser.served(project) as address, browser.page(chromium, address) as one:
        assert one.locator("text=Draw boxes").count() == 1
        one.locator("#run").click()
        one.wait_for_selector("#going[data-state='running']")
        one.wait_for_selector("#going[data-state='done']", timeout=900_000)
        assert "steps. Done." in one.locator("#steps").inner_text()
        one.locator("#outcome", has_text="recordings are good").wait_for()
        assert (project / "results/report/index.html").is_file()


def test_a_value_that_is_wrong_is_said_and_can_be_mended_on_the_page(client, project):
    path = project / "config/sessions/field/cam01.yaml"
    text = path.read_text()
    assert "position_m: [" in text
    line = next(i for i, one in enumerate(text.splitlines(), 1) if "position_m: [" in one)
    begin = text.index("position_m: [") + len("position_m: ")
    path.write_text(text[:begin] + "TODO" + text[text.index("]", begin) + 1 :])
    told = {"path": "config/sessions/field/cam01.yaml", "line": line, "key": "tape.position_m"}
    left = path.read_text()
    for wrong in ("nowhere", "1.5, 2", "nan, 1, 2", "TODO"):
        answer = client.post("/api/fill", json=told | {"value": wrong})
        assert answer.status_code == 422 and "position_m" in answer.json()["error"]
        assert path.read_text() == left
    answer = client.post("/api/fill", json=told | {"value": " 4.0, 2.5, -1.5 "}).json()
    assert answer == {"value": "[4.0, 2.5, -1.5]", "wrong": []} and "position_m: [4.0, 2.5, -1.5]" in path.read_text()
    assert client.post("/api/fill", json=told | {"value": "[5, 2.5, 1.5]"}).json()["wrong"] == []
    assert "position_m: [5, 2.5, 1.5]" in path.read_text()
    path.write_text(path.read_text().replace("[5,", "[6,"))
    assert client.post("/api/fill", json=told | {"value": "[7, 2.5, 1.5]"}).status_code == 409


@pytest.mark.parametrize(
    ("path", "key", "wrong", "right"),
    [
        ("config/subjects.tsv", "height_m", ["167", "-5", "nan", "1,67", "abc", "TODO: ask"], "1.67"),
        ("config/subjects.tsv", "consent_release", ["maybe"], "yes"),
        ("config/sequences.tsv", "subject", ["S99", "TODO"], None),
        ("config/sequences.tsv", "environment", ["underwater"], None),
    ],
)
@pytest.mark.parametrize("others", [False, True])
def test_what_the_steps_would_refuse_is_not_written(client, project, path, key, wrong, right, others):
    header, *lines = (project / path).read_text().splitlines()
    at = header.split("\t").index(key)
    cells = lines[0].split("\t")
    right, cells[at] = right or cells[at], "TODO"
    (project / path).write_text("\n".join([header, "\t".join(cells), *lines[1:]]) + "\n")
    if others:
        # the rest cannot be read yet
        edit(project, "sessions/lab/session.yaml", "\n", "\nlab: TODO\n")
        edit(project, "config.yaml", "data_root: ", "data_root: TODO ")
    left = (project / path).read_text()
    told = {"path": path, "line": 2, "key": key}
    for value in wrong:
        answer = client.post("/api/fill", json=told | {"value": value})
        assert answer.status_code == 422 and key in answer.json()["error"], (value, answer.json())
        assert (project / path).read_text() == left
    assert client.post("/api/fill", json=told | {"value": right}).status_code == 200
    assert (project / path).read_text() == left.replace("TODO", right)


@pytest.mark.slow
def test_after_a_run_the_report_is_there_and_the_last_lines_are_seen(practice, chromium, tmp_path):
    project = shutil.copytree(practice, tmp_path / "capture")
    report = project / "results/report"
    run = {"state": "running", "done": 1, "total": 2, "dry": False, "elsewhere": "", "lines": ["a line"] * 200}
    with browser.served(project) as address, browser.page(chromium, address) as one:
        one.route("**/api/run", lambda route: route.fulfill(json=run))
        one.reload()
        one.wait_for_selector("#going[data-state='running']")
        report.mkdir(parents=True)
        (report / "index.html").write_text("a report")
        (report / "verdict.txt").write_text("All recordings are good.")
        run |= {"state": "done", "done": 2, "lines": ["a line"] * 300}
        # without the page being loaded again
        one.locator("#outcome a", has_text="Open the report").wait_for()
        assert "All recordings are good." in one.locator("#outcome").inner_text()
        left = one.locator("#lines").evaluate("(box) => box.scrollHeight - box.clientHeight - box.scrollTop")
        assert left < 2
