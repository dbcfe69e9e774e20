"""The page Marks: what it saves and refuses, and the practice capture marked in a browser."""

import json
import re
import shutil
import subprocess
import sys

import numpy as np
import pytest

from dior.calibrate.marks import marks as hand_marks
from dior.tables import tables
from tests.project.test_project import edit
from tests.studio import browser, keystrokes
from tests.studio.marking import (
    PLACE,
    answered,
    asked,
    clear,
    frame_of,
    picture_of,
    ready,
    rows_of,
    saved,
    truth_of,
    until,
)  # fmt: skip

CAM = {"walk": "in_1", "camera": "cam01"}
FILE = "config/sessions/lab/cam01.marks.csv"


def sent(*changes):
    return {**CAM, "changes": [{"key": key, "before": before, "after": after} for key, before, after in changes]}


def changed(client, *changes):
    return client.post("/api/marks/change", json=sent(*changes))


def test_the_markers_of_the_walk_and_the_rows_of_the_file(client):
    told = client.get("/api/marks", params=CAM).json()
    assert told["path"] == FILE and told["note"] == ""
    assert ["in_1", 3, "LASI", 10.0, 20.0] in told["rows"] and len(told["rows"]) == 4
    named = {one["name"]: one for one in told["markers"]}
    assert named["LASI"]["side"] == "left" and "pelvis" in named["LASI"]["words"]
    assert set(told["easy"]) <= set(named)


def test_a_mark_is_placed_moved_removed_and_all_of_it_undone(client, project):
    before = (project / FILE).read_text()
    key = ["in_1", 12, "RASI"]
    for then, now in [(None, [20, 21]), ([20, 21], [20.25, 21]), ([20.25, 21], None)]:
        answer = changed(client, (key, then, now))
        assert answer.status_code == 200
        kept = [row[3:] for row in answer.json()["rows"] if row[:3] == key]
        assert kept == ([] if now is None else [now])
        assert (project / FILE).read_text().startswith(before)
    assert (project / FILE).read_text() == before


def test_other_rows_and_comments_and_places_stay(client, project):
    (project / FILE).write_text(
        "# by N. N.\nsequence,frame,joint,u,v,x,y,z\nin_1,3,LASI,10,20,,,\nin_1,3,post,30,31,0.5,0.25,1\n"
    )
    answer = changed(client, (["in_1", 3, "post"], [30, 31], [31, 31]), (["in_1", 4, "LASI"], None, [11, 20]))
    assert answer.status_code == 200
    assert (project / FILE).read_text() == (
        "# by N. N.\nsequence,frame,joint,u,v,x,y,z\nin_1,3,LASI,10,20,,,\nin_1,3,post,31.00,31.00,0.5,0.25,1\n"
        "in_1,4,LASI,11.00,20.00,,,\n"
    )
    assert "post" in {one["name"] for one in client.get("/api/marks", params=CAM).json()["markers"]}


def test_a_file_is_begun(client, project):
    (project / FILE).unlink()
    assert client.get("/api/marks", params=CAM).json()["rows"] == []
    assert changed(client, (["in_1", 3, "LASI"], None, [10, 20])).status_code == 200
    assert len(hand_marks.read(project / FILE)) == 1


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ((["in_1", 3, "LASI"], [10, 20], [64, 20]), "outside of the 64x48 picture"),
        ((["in_1", 40, "LASI"], None, [10, 20]), "no frame 40"),
        ((["in_1", 4, "LASSI"], None, [10, 20]), "did you mean 'LASI'"),
        ((["out_1", 4, "LASI"], None, [10, 20]), "walk is 'out_1'"),
        ((["in_1", "4", "LASI"], None, [10, 20]), "without a frame"),
        ((["in_1", 4, "LASI"], None, [10, "here"]), "no two pixels"),
        ((["in_1", 4, "LASI"], None, [10, float("nan")]), "is no JSON"),
        ((["in_1", 4], None, None), "without its sequence"),
    ],
)
def test_what_is_no_mark_is_refused_and_nothing_written(client, project, change, said):
    before = (project / FILE).read_text()
    # as a page may write what JSON does not have: NaN
    kind = {"content-type": "application/json"}
    answer = client.post("/api/marks/change", content=json.dumps(sent(change)), headers=kind)
    assert answer.status_code == 422 and said in answer.json()["error"]
    assert (project / FILE).read_text() == before


def test_a_mark_that_somebody_else_has_moved_is_a_conflict_with_both(client, project):
    key = ["in_1", 3, "LASI"]
    path = project / FILE
    path.write_text(path.read_text().replace("in_1,3,LASI,10,20", "in_1,3,LASI,15,25"))
    answer = changed(client, (key, [10, 20], [11, 20]))
    assert answer.status_code == 409 and "somebody else" in answer.json()["error"]
    [clash] = answer.json()["conflicts"]
    assert clash == {"key": ["in_1", "3", "LASI"], "theirs": ["15", "25"], "mine": ["11.00", "20.00"]}
    assert "15,25" in path.read_text()
    # mine is kept by saying what theirs is
    assert changed(client, (key, [15, 25], [11, 20])).status_code == 200


def test_a_click_goes_to_the_blob_or_stays(client):
    # the pictures of the tiny project have noise and no markers
    told = client.get("/api/marks/snap", params=CAM | {"frame": 3, "u": 20.25, "v": 21}).json()
    assert told["found"] or (told["u"], told["v"]) == (20.25, 21)
    assert client.get("/api/marks/snap", params=CAM | {"frame": 3, "u": "", "v": 1}).status_code == 422


def test_what_few_marks_say(client, project):
    (project / FILE).write_text("sequence,frame,joint,u,v\nin_1,3,LASI,10,20\n")
    told = client.get("/api/marks/pose", params=CAM | {"frame": 3}).json()
    assert told["why"].startswith("3 marks more") and not told["unfinished"]
    # marks that fit no pose are said, not an error of the page
    path = project / FILE
    path.write_text(path.read_text() + "in_1,3,RASI,60,2\nin_1,3,LPSI,1,40\nin_1,3,RPSI,33,3\n")
    answer = client.get("/api/marks/pose", params=CAM | {"frame": 3})
    assert answer.status_code == 200 and ("why" in answer.json())


# the practice capture in a browser


@pytest.fixture
def unmarked(practice, tmp_path):
    """A copy of the practice capture in which all cameras but cam01 are marked."""
    project = tmp_path / "practice"
    shutil.copytree(practice, project)
    browser.solved(project, "marks", "boxes")
    (project / "config/sessions/lab/cam01.marks.csv").unlink()
    return project


def mark_as_asked(one, truth, count, rng, before=0):
    """Place `count` markers on the frame as the page asks for them, each up to 2 px beside its true place."""
    placed = before
    while placed < before + count:
        name = asked(one)
        assert name, "the page asks for nothing"
        frame = frame_of(one)
        if not clear(truth, frame, name, picture_of(one, frame)):
            one.keyboard.press("x")
            continue
        angle, far = rng.uniform(0, 2 * np.pi), 2 * np.sqrt(rng.uniform())
        u, v = truth[frame, name] + far * np.array([np.cos(angle), np.sin(angle)])
        one.mouse.click(*one.evaluate(PLACE, [float(u), float(v)]))
        placed += 1
        saved(one, placed)
        answered(one)
    return placed


def to_next_frame(one):
    before = frame_of(one)
    one.keyboard.press("f")
    until(one, f"document.querySelector('#number').value !== '{before}'")
    browser.until_shown(one, frame_of(one))
    answered(one)


@pytest.mark.slow
def test_a_camera_is_marked_and_then_its_pose_and_clock_are_right(unmarked, chromium):
    truth, rng = truth_of(unmarked, "cam01"), np.random.default_rng(11)
    with browser.served(unmarked) as address, browser.page(chromium, address, "/marks?session=lab&camera=cam01") as one:
        ready(one)
        to_next_frame(one)
        assert "4 marks more" in one.locator("#answer").inner_text()
        mark_as_asked(one, truth, 5, rng)
        said = one.locator("#answer").inner_text()
        assert one.locator("#picture svg .predicted").count() > 10, said
        assert "one frame does not tell the clock" in said
        to_next_frame(one)
        mark_as_asked(one, truth, 4, rng, before=5)
        to_next_frame(one)
        mark_as_asked(one, truth, 3, rng, before=9)
        told = one.evaluate("fetch('/api/marks/pose?walk=indoor_01&camera=cam01&frame=0&full=1').then((r) => r.json())")
        shown = one.locator("#answer").inner_text()
    rows = rows_of(unmarked, "cam01")
    assert len(rows) == 12 and len({frame for frame, _ in rows}) == 3
    off = {key: float(np.linalg.norm(np.subtract(uv, truth[key]))) for key, uv in rows.items()}
    assert not {key: far for key, far in off.items() if far >= 1.0}
    assert max(px for *_, px, used in told["residuals"] if used) < 1.0 and all(used for *_, used in told["residuals"])
    assert not told["why"] and not told["wrong"]
    assert "Camera to" in shown and "ms (95 %)" in shown
    camera = tables.read(unmarked / "recordings/truth/indoor_01/cameras.parquet", "cameras", ["camera", "offset_s"])
    late_s = float(camera["offset_s"][camera["camera"] == "cam01"][0])
    clock = told["errors"]["clocks"]["indoor_01"]
    # half of a 95 % interval, three times
    assert abs(clock["late_s"] - late_s) < 3e-3 * clock["half_ms"]


@pytest.mark.slow
def test_keys_alone_place_move_undo_and_redo(unmarked, chromium):
    with (
        browser.served(unmarked) as address,
        browser.page(chromium, address, "/marks?session=lab&camera=cam01&frame=48") as one,
    ):
        ready(one)
        first = asked(one)
        one.keyboard.press("s")
        assert not one.locator("#snaps").is_checked()
        for key in ("Escape", "Shift+ArrowLeft", "ArrowUp", "Enter"):
            one.keyboard.press(key)
        saved(one, 1)
        [(key, placed)] = rows_of(unmarked, "cam01").items()
        assert key == (48, first) and asked(one) not in ("", first)

        def at(u, v):
            until(one, f"document.querySelector('#picture').dataset.sent === '{sends.pop(0)}'")
            assert rows_of(unmarked, "cam01") == ({(48, first): (u, v)} if u is not None else {})

        sends = list(range(2, 20))
        u, v = placed
        for press, now in [
            ("ArrowRight", (u + 0.25, v)),
            ("Shift+ArrowDown", (u + 0.25, v + 1)),
            ("Control+z", (u + 0.25, v)),
            ("Control+z", (u, v)),
            ("Control+z", (None, None)),
            ("Control+y", (u, v)),
            ("Control+y", (u + 0.25, v)),
            ("Delete", (None, None)),
            ("Control+z", (u + 0.25, v)),
        ]:
            one.keyboard.press(press)
            at(*now)
        one.keyboard.press("j")
        other = asked(one)
        one.keyboard.press("k")
        assert asked(one) != other
        # the wheel
        box = one.locator("#picture").bounding_box()
        one.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
        for _ in range(20):
            one.mouse.wheel(0, -300)
            one.wait_for_timeout(30)
        assert one.evaluate("window.dior.picture.scale") >= 16


@pytest.mark.slow
def test_two_tabs_at_the_same_mark_are_told_of_each_other(unmarked, chromium):
    path = "/marks?session=lab&camera=cam01&frame=48"
    with (
        browser.served(unmarked) as address,
        browser.page(chromium, address, path) as one,
        browser.page(chromium, address, path) as other,
    ):
        ready(one)
        ready(other)
        one.keyboard.press("s")
        one.mouse.click(*one.evaluate(PLACE, [500.0, 300.0]))
        saved(one, 1)
        name = rows_of(unmarked, "cam01").popitem()[0][1]
        other.keyboard.press("s")
        other.locator(f"#markers [data-joint={name}]").click()
        other.mouse.click(*other.evaluate(PLACE, [510.0, 310.0]))
        other.locator("#said .error").wait_for()
        assert "somebody else" in other.locator("#said").inner_text() and name in other.locator("#said").inner_text()
        theirs = rows_of(unmarked, "cam01")[48, name]
        np.testing.assert_allclose(theirs, (500, 300), atol=0.6)
        other.locator("#said button", has_text="Keep mine").click()
        until(other, "document.querySelector('#picture').dataset.sent === '2'")
        np.testing.assert_allclose(rows_of(unmarked, "cam01")[48, name], (510, 310), atol=0.6)
        # now the first one is older
        one.locator(f"#markers [data-joint={name}]").click()
        one.keyboard.press("ArrowRight")
        one.locator("#said .error").wait_for()
        one.locator("#said button", has_text="Take theirs").click()
        until(one, f"document.querySelector('#markers [data-joint={name}]').innerText.includes('marked')")
        one.keyboard.press("ArrowRight")
        until(one, "document.querySelector('#picture').dataset.sent === '3'")
        np.testing.assert_allclose(rows_of(unmarked, "cam01")[48, name], (510.25, 310), atol=0.6)
        # refused writes are said in the console, too
        assert all("409" in text for text in one.said + other.said)
        one.said.clear()
        other.said.clear()


@pytest.mark.slow
def test_a_mark_that_is_moved_runs_what_depends_on_its_camera_and_nothing_else(unmarked, chromium):
    browser.solved(unmarked, "marks")
    dior = [sys.executable, "-m", "dior", "run", str(unmarked)]
    assert subprocess.run(dior, capture_output=True).returncode == 0
    key = next(iter(rows_of(unmarked, "cam01")))
    path = f"/marks?session=lab&camera=cam01&frame={key[0]}"
    with browser.served(unmarked) as address, browser.page(chromium, address, path) as one:
        ready(one)
        one.locator(f"#markers [data-joint={key[1]}]").click()
        one.keyboard.press("ArrowRight")
        until(one, "document.querySelector('#picture').dataset.sent === '1'")
    told = subprocess.run([*dior, "-n"], capture_output=True, text=True)
    said = told.stdout + told.stderr
    plan = re.findall(r"^(\w+) +(\d+)  (.*)$", said, re.MULTILINE)
    because = {word for *_, why in plan for word in why.split("; ") if not word.startswith("after ")}
    # the minutes of this work are written on a slow machine
    assert because - {"config/effort.tsv"} == {"config/sessions/lab/cam01.marks.csv"}, said
    # of the four cameras one is located, and its labels alone are projected again
    counts = {step: count for step, count, _ in plan}
    assert counts["locate"] == counts["reproject"] == "1"
    assert not {"frames", "mocap", "intrinsics", "detections", "adjust", "triangulate"} & set(counts), said


def test_a_mark_with_more_digits_can_be_changed(client, project):
    edit(project, "sessions/lab/cam01.marks.csv", "in_1,3,RASI,12,30", "in_1,3,RASI,12.3456,30.125")
    own = {"walk": "in_1", "camera": "cam01"}
    *key, u, v = next(row for row in client.get("/api/marks", params=own).json()["rows"] if row[2] == "RASI")
    change = {"key": key, "before": [u, v], "after": [11, 21]}
    assert client.post("/api/marks/change", json=own | {"changes": [change]}).status_code == 200
    assert "in_1,3,RASI,11.00,21.00" in (project / "config/sessions/lab/cam01.marks.csv").read_text()


@pytest.mark.slow
def test_the_marks_of_a_camera_take_a_practised_person_two_and_a_half_minutes(chromium, practice, tmp_path):
    project = shutil.copytree(practice, tmp_path / "counted")
    person, enough = keystrokes.marks(chromium, project, "cam01")
    assert enough and person.seconds <= 150, str(person)
    truth = truth_of(project, "cam01")
    off = [np.linalg.norm(np.subtract(uv, truth[key])) for key, uv in rows_of(project, "cam01").items()]
    assert len(off) >= 12 and max(off) < 1.5


@pytest.mark.slow
def test_what_is_not_seen_and_a_click_beside_everything_are_told_and_taken_back(chromium, practice, tmp_path):
    project = shutil.copytree(practice, tmp_path / "slips")
    browser.solved(project, "marks")
    with browser.served(project) as address, browser.page(chromium, address, "/marks?session=lab&camera=cam01") as one:
        ready(one)
        answered(one)
        one.keyboard.press("f")
        until(one, "document.querySelector('#number').value !== '0'")
        browser.until_shown(one, frame_of(one))
        answered(one)
        # whom the body hides is not asked for, and told apart from what the person does not see
        name, rows = asked(one), len(rows_of(project, "cam01"))
        assert "hidden" not in one.locator(f"#markers [data-joint={name}]").inner_text()
        assert one.locator("#markers", has_text="hidden, it seems").count()
        one.keyboard.press("x")
        assert "you: not visible" in one.locator(f"#markers [data-joint={name}]").inner_text() and asked(one) != name
        one.keyboard.press("Control+z")
        assert "visible" not in one.locator(f"#markers [data-joint={name}]").inner_text() and asked(one) == name
        # a click on the wall
        one.keyboard.press("0")
        one.mouse.click(*one.evaluate(PLACE, [40.0, 40.0]))
        one.locator("#said .look").wait_for()
        assert re.search(rf"{name} is \d+ px from where the other marks expect it", one.locator("#said").inner_text())
        saved(one, rows + 1)
        one.keyboard.press("Control+z")
        saved(one, rows)
        assert not one.locator("#said p").count() and asked(one) == name


@pytest.mark.slow
def test_what_cannot_be_written_stays_is_said_and_comes_with_the_next_or_is_taken_back(unmarked, chromium):
    file, bad = unmarked / "config/sessions/lab/cam01.marks.csv", "indoor_01,0,LFHD,abc,12\n"
    path = "/marks?session=lab&camera=cam01&frame=48"
    with browser.served(unmarked) as address, browser.page(chromium, address, path) as one:
        ready(one)
        one.keyboard.press("s")

        def click(u, v):
            name = asked(one)
            one.mouse.click(*one.evaluate(PLACE, [u, v]))
            until(one, f"document.querySelector('#prompt strong').innerText !== '{name}'")
            return name

        first = click(500.0, 300.0)
        saved(one, 1)
        good = file.read_text()
        file.write_text(good + bad)
        kept = [click(520.0, 320.0), click(540.0, 340.0)]
        until(one, f"document.querySelector('#said .error')?.innerText.includes('{kept[1]} on frame 48')")
        said = one.locator("#said").inner_text()
        assert said.startswith("Not written: ") and "u is 'abc'" in said
        assert all(f"{name} on frame 48" in said for name in kept)
        for name in kept:
            assert "not saved" in one.locator(f"#markers [data-joint={name}]").inner_text()
        assert "2 changes of marks are not saved" in one.locator("#answer").inner_text()
        assert file.read_text() == good + bad
        file.write_text(good)
        last = click(560.0, 360.0)
        saved(one, 4)
        until(one, "!document.querySelector('#said .error')")
        assert {name for _, name in rows_of(unmarked, "cam01")} == {first, *kept, last}
        # and given up
        good = file.read_text()
        file.write_text(good + bad)
        away = click(580.0, 380.0)
        one.locator("#said button", has_text="Take it back").click()
        until(one, f"document.querySelector('#markers [data-joint={away}]').innerText.trim() === '{away}'")
        assert not one.locator("#answer .bad").count()
        file.write_text(good)
        click(600.0, 400.0)
        saved(one, 5)
        assert len(rows_of(unmarked, "cam01")) == 5
        # the browser says of answers that they are refusals
        assert all("422" in text for text in one.said), one.said
        one.said.clear()


@pytest.mark.slow
def test_a_click_before_the_answer_to_the_one_before_is_of_the_next_and_what_is_said_moves_no_picture(
    unmarked, chromium
):
    path = "/marks?session=lab&camera=cam01&frame=48"
    with browser.served(unmarked) as address, browser.page(chromium, address, path) as one:
        ready(one)
        at = one.locator("#picture").bounding_box()
        held = []
        one.route("**/api/marks/snap?*", lambda route: held.append(route))
        names = []
        for u in (500.0, 520.0, 540.0):
            names.append(asked(one))
            one.mouse.click(*one.evaluate(PLACE, [u, 300.0]))
            until(one, f"document.querySelector('#prompt strong')?.innerText !== '{names[-1]}'")
            assert "Nothing is left" not in one.inner_text("body")
        for route in held:
            route.fulfill(json={"u": 500 + 20 * held.index(route), "v": 300, "found": False})
        saved(one, 3)
        assert {name: uv[0] for (_, name), uv in rows_of(unmarked, "cam01").items()} == dict(
            zip(names, (500, 520, 540), strict=True)
        )
        one.locator("#said .look").wait_for()
        assert one.locator("#picture").bounding_box() == at
