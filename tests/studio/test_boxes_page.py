"""Boxes: which pictures are asked for, what is written, and a person who draws ten of them with the keyboard."""

import csv
import shutil

import numpy as np
import pytest

from dior.evaluate import to_mark
from dior.project import boxes
from dior.studio import boxes_page
from dior.studio.workspace import Workspace
from dior.tables import tables
from tests.check.recorded import COUNT, SIZE
from tests.studio import browser, keystrokes

CAM = {"walk": "out_2", "camera": "cam03"}
FILE = "config/boxes/out_2.cam03.csv"
BOX, OTHER = [10.25, 5.5, 20.0, 30.75], [11.0, 6.0, 21.0, 31.0]


def told(client, **more):
    answer = client.get("/api/boxes", params=CAM | more)
    assert answer.status_code == 200, answer.text
    return answer.json()


def said_of(client, **more):
    """By frame what a drawer has said, of what is not open."""
    return {one["frame"]: one["box"] for one in told(client, **more)["frames"] if one["box"] is not None}


def put(client, frame, before, after, drawer=""):
    row = CAM | {"frame": frame, "before": before, "after": after, "drawer": drawer}
    return client.post("/api/boxes", json=row)


def lines(project):
    return (project / FILE).read_text().splitlines()


def test_before_a_run_the_pictures_are_spread_over_the_walk(client):
    found = told(client, count=8)
    frames = [one["frame"] for one in found["frames"]]
    assert [frame // 5 for frame in frames] == list(range(8)) and not found["labelled"]
    assert [one["box"] for one in found["frames"]] == [None] * 8 and found["drawers"] == []
    assert len(told(client)["frames"]) == min(25, COUNT)
    # the same again, and in a folder with other walks
    assert frames == [one["frame"] for one in told(client, count=8)["frames"]]
    assert frames == to_mark.spread(np.arange(COUNT), "out_2.cam03", 8)


def test_after_a_run_they_have_labels_and_what_is_drawn_stays_among_them(client, project):
    drawn = told(client, count=4)["frames"][0]["frame"]
    assert put(client, drawn, None, BOX).status_code == 200
    columns = {name: [0] * 20 for name in tables.columns_of("labels_2d")}
    columns |= {name: ["x"] * 20 for name in ("subject", "sequence", "camera", "joint")} | {"source": ["mocap"] * 20}
    columns |= {"frame": list(range(20, 40)), "status": ["ok"] * 19 + ["suspect"]}
    (project / "results/reproject").mkdir(parents=True)
    tables.write(project / "results/reproject/out_2.cam03.parquet", "labels_2d", columns)
    found = told(client, count=4)
    frames = [one["frame"] for one in found["frames"]]
    assert found["labelled"] and frames[0] == drawn and len(frames) == 5 and min(frames[1:]) >= 20
    assert 39 not in frames


def test_more_pictures_keep_those_that_are_drawn():
    among = np.arange(300)
    first = to_mark.spread(among, "out_2.cam03", 25)
    had = first[:10]
    more = to_mark.spread(among, "out_2.cam03", 50, had)
    assert set(had) <= set(more) and len(more) == 50 and len(set(more)) == 50
    # of each part one, whether it was drawn before or is drawn by lot
    assert sorted(frame // 6 for frame in more) == list(range(50))
    assert to_mark.spread(among, "out_2.cam03", 25, had) == first
    assert to_mark.spread(np.zeros(0, int), "out_2.cam03", 25, [7]) == [7]


def test_a_box_is_a_row_and_is_there_when_the_page_is_loaded_again(client, project):
    assert put(client, 3, None, BOX).status_code == 200
    assert lines(project) == ["frame,u_min,v_min,u_max,v_max", "3,10.25,5.5,20.0,30.75"]
    assert said_of(client) == {3: BOX}
    assert put(client, 3, BOX, OTHER).status_code == 200
    assert said_of(client) == {3: OTHER}
    assert put(client, 3, OTHER, None).status_code == 200
    assert said_of(client) == {} and lines(project) == ["frame,u_min,v_min,u_max,v_max"]


def test_nobody_is_a_row_without_edges_that_names_who_saw_nobody(client, project):
    refused = put(client, 4, None, [])
    assert refused.status_code == 422 and "name or a letter" in refused.json()["error"]
    assert not (project / FILE).exists()
    assert put(client, 4, None, [], "ann").status_code == 200
    assert lines(project) == ["frame,u_min,v_min,u_max,v_max,drawer", "4,,,,,ann"]
    assert said_of(client, drawer="ann") == {4: []} and said_of(client, drawer="bob") == {}
    assert boxes.read_drawers(project / FILE, range(COUNT)) == {}
    assert put(client, 4, [], BOX, "ann").status_code == 200
    assert said_of(client, drawer="ann") == {4: BOX}


def test_rows_of_to_mark_are_asked_for_and_filled_in(client, project):
    (project / "config/boxes").mkdir(exist_ok=True)
    begun = "# drawn at the large screen\nframe,u_min,v_min,u_max,v_max\n2,,,,\n9,,,,\n31,,,,\n"
    (project / FILE).write_text(begun)
    found = told(client, count=3)
    assert {2, 9, 31} <= {one["frame"] for one in found["frames"]} and said_of(client) == {}
    assert put(client, 9, None, BOX).status_code == 200
    assert (project / FILE).read_text() == begun.replace("9,,,,", "9,10.25,5.5,20.0,30.75")
    # of somebody with a name the row that asked is taken away
    assert put(client, 31, None, OTHER, "ann").status_code == 200
    assert lines(project)[1:] == [
        "frame,u_min,v_min,u_max,v_max,drawer", "2,,,,,", "9,10.25,5.5,20.0,30.75,", "31,11.0,6.0,21.0,31.0,ann",
    ]  # fmt: skip


def test_two_drawers_boxes_both_stay_and_the_first_are_those_that_are_used(client, project):
    assert put(client, 3, None, BOX, "ann").status_code == 200
    assert put(client, 3, None, OTHER, "bob").status_code == 200
    assert told(client, drawer="bob")["drawers"] == [{"name": "ann", "boxes": 1}, {"name": "bob", "boxes": 1}]
    assert said_of(client, drawer="bob") == {3: OTHER} and said_of(client, drawer="ann") == {3: BOX}
    assert boxes.read(project / FILE, range(COUNT))[1].tolist() == [BOX]
    refused = put(client, 5, None, BOX, "Ann")
    assert refused.status_code == 422 and "capitals" in refused.json()["error"]


def test_two_pages_that_say_different_things_of_one_frame_are_told(client):
    assert put(client, 3, None, BOX, "ann").status_code == 200
    answer = put(client, 3, None, OTHER, "ann")
    assert answer.status_code == 409
    assert answer.json()["conflicts"] == [{
        "key": ["3", "ann"], "theirs": ["10.25", "5.5", "20.0", "30.75"], "mine": ["11.0", "6.0", "21.0", "31.0"],
    }]  # fmt: skip
    assert said_of(client, drawer="ann") == {3: BOX}
    # another frame of the same file is no conflict
    assert put(client, 4, None, OTHER, "ann").status_code == 200


@pytest.mark.parametrize(
    ("after", "words"),
    [
        ([20.0, 5.0, 10.0, 30.0], "inside out"),
        ([10.0, 5.0, 10.0, 30.0], "no area"),
        ([900.0, 5.0, 910.0, 30.0], "outside of the 64x48 picture"),
        ([1.0, 2.0, 3.0], "four numbers"),
        ([1.0, 2.0, 3.0, "x"], "four numbers"),
        ("nobody", "four numbers"),
    ],
)
def test_what_is_no_box_is_refused_and_nothing_is_written(client, project, after, words):
    answer = put(client, 3, None, after)
    assert answer.status_code == 422 and words in answer.json()["error"]
    assert not (project / FILE).exists()


def test_a_frame_and_a_name_that_cannot_be_are_refused(client):
    assert put(client, COUNT, None, BOX).status_code == 422
    assert put(client, True, None, BOX).status_code == 422
    assert put(client, 3, None, BOX, "a" * 41).status_code == 422
    assert put(client, 3, None, BOX, "a,b").status_code == 422


def test_what_moves_is_found_to_a_pixel(client, project, monkeypatch):
    """A grey scene with a dark body that is elsewhere in each picture, and a speck."""
    from dior.ingest import moving
    from dior.studio import workspace

    def reads(rows, root):
        def read(wanted, factor):
            for frame in np.asarray(wanted).tolist():
                picture = np.full((*SIZE, 3), 120, np.uint8)
                picture[20:30, frame : frame + 4] = 30
                picture[2, 60] = 250 if frame == 7 else 120
                yield frame, moving.reduced(picture, factor)

        return read

    monkeypatch.setattr(boxes_page, "reader", reads)
    monkeypatch.setattr(workspace, "reader", reads)
    assert client.get("/api/boxes/moving", params=CAM | {"frame": 7}).json() == [[6.5, 19.5, 10.5, 29.5]]
    answer = client.get("/api/boxes/moving", params=CAM | {"frame": COUNT})
    assert answer.status_code == 422 and f"no frame {COUNT}" in answer.json()["error"]


def test_the_scene_of_a_recording_is_made_once(project):
    with Workspace() as workspace:
        factor, scene = workspace.scene("out_2", "cam03")
        assert factor == 1 and scene.empty.shape == (*SIZE, 3)
        assert workspace.scene("out_2", "cam03")[1] is scene


def rows_of(path):
    with open(path, newline="") as stream:
        return {int(row["frame"]): row for row in csv.DictReader(stream)}


def edges_of(row):
    return [float(row[name]) for name in boxes.COLUMNS[1:]]


@pytest.fixture(scope="module")
def undrawn(practice, tmp_path_factory):
    """The practice capture, of which nothing is drawn and nothing was run."""
    return shutil.copytree(practice, tmp_path_factory.mktemp("boxes") / "practice")


@pytest.mark.slow
def test_ten_boxes_by_keyboard_alone_lie_on_the_body(chromium, undrawn):
    true, path = keystrokes.true_boxes(), undrawn / "config/boxes/outdoor_01.cam04.csv"
    with browser.served(undrawn) as address, browser.page(chromium, address, "/boxes") as page:
        person = keystrokes.Person(page)
        first = keystrokes.frame_shown(page)
        # what is only offered is not accepted, and nobody is said by somebody with a name
        person.press("Enter")
        page.wait_for_selector("#said p")
        assert keystrokes.frame_shown(page) == first and not path.exists()
        person.press("n")
        page.keyboard.type("ann")
        person.press("Enter")
        page.wait_for_url("**drawer=ann**")
        # the name was asked for to say that nobody is here
        keystrokes.until(lambda: path.exists() and first in rows_of(path) and keystrokes.frame_shown(page) != first)
        person.press("Control+z")
        keystrokes.until(lambda: not rows_of(path) and keystrokes.frame_shown(page) == first)
        drawn = []
        for _ in range(10):
            frame = keystrokes.frame_shown(page)
            keystrokes.draw_with_keys(person, frame, true[frame])
            person.press("Enter")
            drawn.append(frame)
        # the page goes on while it writes
        keystrokes.until(lambda: path.exists() and len(rows_of(path)) == 10)
        assert person.moves == person.clicks == 0 and drawn == sorted(set(drawn)) and drawn[0] == first
        rows = rows_of(path)
        off = np.abs([np.array(edges_of(rows[frame])) - true[frame] for frame in drawn])
        assert list(rows) == drawn and off.max() < 0.5, off.max(axis=1)
        assert {row["drawer"] for row in rows.values()} == {"ann"}
        # nobody, and back to it; then the one before is drawn anew
        eleventh = keystrokes.frame_shown(page)
        person.press("n")
        keystrokes.until(lambda: eleventh in rows_of(path) and keystrokes.frame_shown(page) != eleventh)
        assert rows_of(path)[eleventh]["u_min"] == "" and rows_of(path)[eleventh]["drawer"] == "ann"
        person.press("Backspace")
        page.wait_for_selector(f"#picture[data-ready='{eleventh}']")
        person.press("Backspace")
        page.wait_for_selector(f"#picture[data-ready='{drawn[-1]}']")
        person.press("ArrowRight", 4)
        person.press("Enter")
        keystrokes.until(lambda: keystrokes.frame_shown(page) > eleventh)
        again = keystrokes.frame_shown(page)
        before = edges_of(rows[drawn[-1]])
        keystrokes.until(lambda: edges_of(rows_of(path)[drawn[-1]]) != before)
        moved = np.array(edges_of(rows_of(path)[drawn[-1]])) - before
        assert moved.tolist() == pytest.approx([1.0, 0.0, 1.0, 0.0])
        # loaded again by the link alone, it goes on where it stopped
        page.goto(address.partition("/?")[0] + "/boxes")
        assert keystrokes.frame_shown(page) == again
        assert page.input_value("#drawer") == "ann" and "11 of 25" in page.inner_text("#count")


@pytest.mark.slow
def test_two_pages_on_one_file_are_told_and_the_person_decides(chromium, practice, tmp_path):
    project = shutil.copytree(practice, tmp_path / "two_pages")
    true, path = keystrokes.true_boxes(), project / "config/boxes/outdoor_01.cam04.csv"
    with (
        browser.served(project) as address,
        browser.page(chromium, address, "/boxes?drawer=ann") as one,
        browser.page(chromium, address, "/boxes?drawer=ann") as other,
    ):
        frame = keystrokes.frame_shown(one)
        assert keystrokes.frame_shown(other) == frame
        keystrokes.draw_with_mouse(keystrokes.Person(one), frame, true[frame])
        one.keyboard.press("Enter")
        keystrokes.until(lambda: path.exists() and frame in rows_of(path))
        assert np.abs(np.array(edges_of(rows_of(path)[frame])) - true[frame]).max() < 0.5
        wanted = true[frame] + [2, 0, 2, 0]
        keystrokes.draw_with_mouse(keystrokes.Person(other), frame, wanted)
        other.keyboard.press("Enter")
        other.get_by_role("button", name="Keep mine").wait_for()
        # the frame in question, with both
        assert keystrokes.frame_shown(other) == frame
        assert set(other.locator("#picture svg text").all_text_contents()) == {"theirs", "mine"}
        assert np.abs(np.array(edges_of(rows_of(path)[frame])) - true[frame]).max() < 0.5
        # the browser says of the answer that it was a conflict
        assert "409" in other.said.pop()
        other.get_by_role("button", name="Keep mine").click()
        keystrokes.until(lambda: edges_of(rows_of(path)[frame])[0] > true[frame][0] + 1)
        assert np.abs(np.array(edges_of(rows_of(path)[frame])) - wanted).max() < 0.5


@pytest.mark.slow
def test_twenty_five_boxes_take_a_practised_person_two_minutes(chromium, practice, tmp_path):
    project = shutil.copytree(practice, tmp_path / "counted")
    path = project / "config/boxes/outdoor_01.cam04.csv"
    person = keystrokes.boxes(chromium, project, keystrokes.draw_with_mouse)
    assert person.seconds <= 120, str(person)
    off = [np.abs(np.array(edges_of(row)) - keystrokes.true_boxes()[frame]).max()
           for frame, row in rows_of(path).items()]  # fmt: skip
    assert len(off) == 25 and max(off) < 0.5


@pytest.mark.slow
def test_what_is_said_of_a_picture_is_undone_and_made_again_and_a_box_beside_everything_is_told(
    chromium, practice, tmp_path
):
    project = shutil.copytree(practice, tmp_path / "undone")
    true, path = keystrokes.true_boxes(), project / "config/boxes/outdoor_01.cam04.csv"

    def written():
        rows = rows_of(path) if path.exists() else {}
        return {frame: row["u_min"] != "" for frame, row in rows.items()}

    with browser.served(project) as address, browser.page(chromium, address, "/boxes?drawer=ann") as page:
        person = keystrokes.Person(page)
        first = keystrokes.frame_shown(page)
        keystrokes.draw_with_mouse(person, first, true[first])
        person.press("Enter")
        keystrokes.until(lambda: written() == {first: True} and keystrokes.frame_shown(page) != first)
        assert not page.locator("#said .look").count()
        second = keystrokes.frame_shown(page)
        person.press("n")
        keystrokes.until(lambda: written() == {first: True, second: False})
        keystrokes.until(lambda: keystrokes.frame_shown(page) not in (first, second))
        third = keystrokes.frame_shown(page)
        for key, rows, frame in [
            ("Control+z", {first: True}, second),
            ("Control+z", {}, first),
            ("Control+y", {first: True}, first),
            ("Control+Shift+Z", {first: True, second: False}, second),
        ]:
            person.press(key)
            keystrokes.until(lambda rows=rows, frame=frame: (written(), keystrokes.frame_shown(page)) == (rows, frame))
        # one far from the person, who is in it by no edge
        person.press("Enter")
        page.locator("#frames button", has_text=str(third)).first.click()
        keystrokes.until(lambda: keystrokes.frame_shown(page) == third)
        aside = true[third] + [60, 0, 60, 0]
        keystrokes.draw_with_mouse(person, third, aside)
        person.press("Enter")
        page.locator("#said .look").wait_for()
        assert f"box of frame {third}" in page.inner_text("#said")
        keystrokes.until(lambda: third in written())
        page.locator("#said button", has_text="Undo").click()
        keystrokes.until(lambda: third not in written())


# screen pixels a pixel, of a picture that is looked at
SCALE = 8


@pytest.mark.slow
def test_a_box_of_another_size_than_the_others_is_told_and_not_offered_again(chromium, practice, tmp_path):
    project = shutil.copytree(practice, tmp_path / "sizes")
    browser.solved(project, "boxes")
    path = project / "config/boxes/outdoor_01.cam04.csv"
    frame = list(rows_of(path))[10]
    # the next one is left to draw
    lines = path.read_text().splitlines(True)
    path.write_text("".join(lines[:12] + lines[13:]))
    with (
        browser.served(project) as address,
        browser.page(chromium, address, f"/boxes?walk=outdoor_01&camera=cam04&frame={frame}&count=30") as page,
    ):
        assert keystrokes.frame_shown(page) == frame
        right = np.array(edges_of(rows_of(path)[frame]))
        keystrokes.draw_with_mouse(keystrokes.Person(page), frame, right + [-15, -15, 15, 15])
        page.keyboard.press("Enter")
        page.get_by_text("px tall, and the others about").wait_for()
        # on to the one that is not drawn yet
        keystrokes.until(lambda: keystrokes.frame_shown(page) != frame)
        offered = page.locator("#picture svg .offered").bounding_box()
        assert offered["height"] / SCALE < 1.3 * (right[3] - right[1])


@pytest.mark.slow
def test_boxes_that_cannot_be_written_stay_and_come_with_the_next(chromium, practice, tmp_path):
    project = shutil.copytree(practice, tmp_path / "kept")
    true, path = keystrokes.true_boxes(), project / "config/boxes/outdoor_01.cam04.csv"
    with browser.served(project) as address, browser.page(chromium, address, "/boxes?drawer=ann") as page:
        person, frames = keystrokes.Person(page), []

        def accept():
            frame = keystrokes.frame_shown(page)
            keystrokes.draw_with_mouse(person, frame, true[frame])
            person.press("Enter")
            keystrokes.until(lambda: keystrokes.frame_shown(page) != frame)
            frames.append(frame)

        accept()
        keystrokes.until(lambda: path.exists() and list(rows_of(path)) == frames)
        good = path.read_text()
        path.write_text(good + "3,abc,1,2,3,ann\n")
        accept()
        accept()
        page.locator("#said .error", has_text=f"frame {frames[2]}").wait_for()
        said = page.inner_text("#said")
        assert said.startswith("Not written: ") and f"frame {frames[1]}" in said and "abc" in said
        assert page.locator("#frames .bad").count() == 2
        path.write_text(good)
        accept()
        keystrokes.until(lambda: sorted(rows_of(path)) == frames and not page.locator("#frames .bad").count())
        assert not page.locator("#said .error").count()
        assert all("422" in text for text in page.said), page.said
        page.said.clear()


@pytest.mark.slow
def test_enter_accepts_after_the_keys_were_looked_at_with_the_mouse(chromium, practice, tmp_path):
    project = shutil.copytree(practice, tmp_path / "keys")
    path = project / "config/boxes/outdoor_01.cam04.csv"
    with browser.served(project) as address, browser.page(chromium, address, "/boxes?drawer=ann") as page:
        frame = keystrokes.frame_shown(page)
        help_ = page.locator("details", has_text="Keys and mouse")
        for _ in range(2):
            help_.locator("summary").click()
        page.locator("label", has_text="show the labels").click()
        page.locator("label", has_text="show the labels").click()
        # an arrow takes the box that is offered
        page.keyboard.press("ArrowRight")
        page.keyboard.press("Enter")
        keystrokes.until(lambda: path.exists() and list(rows_of(path)) == [frame])
        assert help_.get_attribute("open") is None
