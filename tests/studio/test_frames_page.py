"""Pictures of recordings, before anything has been run."""

from concurrent.futures import ThreadPoolExecutor

import cv2
import numpy as np

from dior.ingest import bags, messages
from dior.studio import pictures
from dior.studio.workspace import Workspace
from dior.tables import tables
from tests.check import recorded
from tests.check.recorded import COUNT, SIZE
from tests.ingest import bagfiles
from tests.project.test_project import edit
from tests.studio import browser

CAM = {"walk": "out_1", "camera": "cam01"}


def decoded(content):
    return cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_COLOR)


def test_walks_and_recordings_are_listed(client):
    walks = {one["walk"]: one for one in client.get("/api/walks").json()}
    assert set(walks) == {"in_1", "out_1", "out_2"} and walks["in_1"]["indoor"]
    assert walks["out_1"]["cameras"] == {"cam01": "close", "cam02": "close", "cam03": "long_range"}
    told = client.get("/api/recording", params=CAM).json()
    assert (told["height"], told["width"]) == SIZE and len(told["seconds"]) == COUNT
    assert told["seconds"][:2] == [0.0, 0.0333]


def test_a_picture_is_the_recorded_bytes(client, project):
    answer = client.get("/picture", params=CAM | {"frame": 3})
    assert answer.headers["content-type"] == "image/jpeg"
    topic = "/cam01/color/image_raw/compressed"
    message = [*bags.messages_of(project / "data/out_1/a.bag", {topic})][3]
    assert answer.content == messages.compressed(message.kind, message.raw, message.wire)
    assert decoded(answer.content).shape[:2] == SIZE


def test_a_browser_does_not_turn_a_picture(client, project):
    plain = bagfiles.encoded(bagfiles.picture(90, SIZE), ".jpg").tobytes()
    # Exif of a camera that was held upright: orientation 6, a quarter turn
    exif = b"Exif\0\0MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0"
    turned = plain[:2] + b"\xff\xe1" + (len(exif) + 2).to_bytes(2, "big") + exif + plain[2:]
    assert decoded(turned).shape[:2] == SIZE[::-1]
    content = {"format": "jpeg", "data": np.frombuffer(turned, np.uint8)}
    stamps = [bagfiles.T0 + i * recorded.STEP for i in range(2)]
    sent = [bagfiles.Sent(recorded.LAB, one, one, bagfiles.PACKED, content) for one in stamps]
    (project / "data/in_1/a.bag").unlink()
    bagfiles.write(project / "data/in_1/a", sent, "ros1")
    own = {"walk": "in_1", "camera": "cam01", "frame": 1}
    assert client.get("/picture", params=own).content == plain
    assert decoded(client.get("/picture.png", params=own).content).shape[:2] == SIZE


def test_a_recording_that_is_another_by_now_is_shown(client, project):
    before = client.get("/picture", params=CAM | {"frame": 3}).content
    bag = project / "data/out_1/a.bag"
    bag.unlink()
    topics = [recorded.COLOUR.format(1), recorded.FAR]
    stamps = [bagfiles.T0 + i * recorded.STEP for i in range(COUNT)]
    bagfiles.write(
        bag.with_suffix(""),
        [bagfiles.packed(topic, one, bagfiles.picture(200), ".jpg") for one in stamps for topic in topics],
        "ros1",
    )
    assert client.get("/picture", params=CAM | {"frame": 3}).content != before


def test_a_png_has_the_same_pixels(client):
    whole = client.get("/picture", params=CAM | {"frame": 3}).content
    answer = client.get("/picture.png", params=CAM | {"frame": 3})
    assert "out_1.cam01.3.png" in answer.headers["content-disposition"] and answer.content.startswith(pictures.PNG)
    assert (decoded(answer.content) == decoded(whole)).all()


def test_cameras_at_one_moment_are_the_nearest_in_time(client):
    # cam02 began 0.2 s later: its frame 0 is at the time of frame 6 of cam01
    found = client.get("/api/moment", params=CAM | {"frame": 8}).json()
    assert {name: one["frame"] for name, one in found.items()} == {"cam01": 8, "cam02": 2, "cam03": 8}
    assert found["cam02"]["later_ms"] == 0.0


def test_a_frame_that_is_not_there_is_named(client):
    answer = client.get("/picture", params=CAM | {"frame": COUNT})
    assert answer.status_code == 422
    assert answer.json()["error"] == f"cam01 has no frame {COUNT} in out_1, whose last is {COUNT - 1}"


def test_a_bag_that_vanishes_is_said_and_the_others_go_on(client, project):
    assert client.get("/picture", params=CAM | {"frame": 3}).status_code == 200
    (project / "data/out_1/a.bag").rename(project / "data/elsewhere.bag")
    answer = client.get("/picture", params=CAM | {"frame": 4})
    assert answer.status_code == 422 and "a.bag" in answer.json()["error"]
    assert client.get("/picture", params=CAM | {"walk": "out_2", "frame": 4}).status_code == 200
    (project / "data/elsewhere.bag").rename(project / "data/out_1/a.bag")
    assert client.get("/picture", params=CAM | {"frame": 4}).status_code == 200


def test_labels_of_the_last_run_are_given_with_their_sigmas(client, project):
    assert client.get("/api/drawn", params=CAM | {"frame": 3}).json() == {"labels": [], "bones": [], "detections": []}
    joints, count = ["left_hip", "left_knee", "nose"], 3
    columns = {name: [0] * count for name in tables.columns_of("labels_2d")}
    columns |= {name: ["x"] * count for name in ("subject", "sequence", "camera")}
    columns |= {"joint": joints, "frame": [3] * 3, "status": ["ok"] * 3, "source": ["mocap"] * 3}
    columns |= {"u": [1.5, 2, np.nan], "v": [3, 4, np.nan], "sigma_u": [0.5, np.nan, np.nan]}
    (project / "results/reproject").mkdir(parents=True)
    tables.write(project / "results/reproject/out_1.cam01.parquet", "labels_2d", columns)
    told = client.get("/api/drawn", params=CAM | {"frame": 3}).json()
    assert [one["joint"] for one in told["labels"]] == ["left_hip", "left_knee"]
    assert told["labels"][0]["sigma_u"] == 0.5 and told["labels"][1]["sigma_u"] is None
    assert told["bones"] == [["left_hip", "left_knee"]]
    assert client.get("/api/drawn", params=CAM | {"frame": 4}).json()["labels"] == []


def test_small_pictures_are_small(monkeypatch, client):
    monkeypatch.setattr(pictures, "SMALL_PX", 16)
    assert decoded(client.get("/picture", params=CAM | {"frame": 3, "small": 1}).content).shape[:2] == (12, 16)


def test_a_project_whose_marks_are_missing_can_be_looked_at(client, project):
    (project / "config/sessions/lab/cam01.marks.csv").unlink()
    assert client.get("/picture", params={"walk": "in_1", "camera": "cam01", "frame": 0}).status_code == 200


def test_a_file_that_is_changed_elsewhere_is_read_again(client, project):
    sheet = project / "config/sequences.tsv"
    header, *rows = (line.split("\t") for line in sheet.read_text().splitlines())
    at = header.index("exclude_reason")
    rows = [[*row[:at], "fell" if row[0] == "out_2" else row[at], *row[at + 1 :]] for row in rows]
    sheet.write_text("".join("\t".join(row) + "\n" for row in [header, *rows]))
    assert {one["walk"] for one in client.get("/api/walks").json()} == {"in_1", "out_1"}
    assert client.get("/picture", params=CAM | {"walk": "out_2", "frame": 0}).status_code == 422


def test_frames_in_a_browser(project, chromium):
    """One quick page: it opens, keys go through the frames, nothing is said in the console."""
    with browser.served(project) as address, browser.page(chromium, address, "/frames?walk=out_1&camera=cam01") as one:
        browser.until_shown(one, 0)
        one.keyboard.press("ArrowRight")
        browser.until_shown(one, 1)
        one.keyboard.press("End")
        browser.until_shown(one, COUNT - 1)
        assert one.locator("#number").input_value() == str(COUNT - 1)
        one.wait_for_url(f"**frame={COUNT - 1}")
        one.reload()
        browser.until_shown(one, COUNT - 1)
        one.locator("#moment button").nth(1).click()
        one.wait_for_url("**camera=cam02**")


def test_the_address_follows_a_dragged_slider_seldom(project, chromium):
    """A browser asks for the icon at each change of the address: over a slow line that kept the pictures waiting."""
    with browser.served(project) as address, browser.page(chromium, address, "/frames?walk=out_1&camera=cam01") as one:
        browser.until_shown(one, 0)
        one.evaluate("""() => {
          window.changes = 0;
          const own = history.replaceState.bind(history);
          history.replaceState = (...given) => { window.changes++; own(...given); };
          const slider = document.querySelector("#frame");
          for (let i = 0; i <= 50; i++) {
            slider.value = slider.max * (i / 50);
            slider.dispatchEvent(new Event("input"));
          }
        }""")
        one.wait_for_url(f"**frame={COUNT - 1}")
        assert one.evaluate("window.changes") <= 3


def test_scripts_are_kept_by_a_browser_and_answers_are_not(client):
    script = client.get("/static/studio.js")
    assert script.headers["cache-control"] == "no-cache"
    assert client.get("/static/studio.js", headers={"if-none-match": script.headers["etag"]}).status_code == 304
    assert client.get("/api/walks").headers["cache-control"] == "no-store"


def test_a_camera_that_cannot_be_read_is_named_where_the_others_can(client, project):
    edit(project, "sessions/field/cam02.yaml", "/cam02/color", "/cam02/colour")
    answer = client.get("/api/moment", params=CAM | {"camera": "cam02", "frame": 3})
    assert answer.status_code == 422 and "/cam02/colour" in answer.json()["error"]
    assert set(client.get("/api/moment", params=CAM | {"frame": 8}).json()) == {"cam01", "cam03"}


def test_a_picture_that_many_ask_for_is_kept_once(project):
    with Workspace() as workspace:
        shared = pictures.Pictures(workspace)
        workspace.frames("out_1", "cam01")
        with ThreadPoolExecutor(8) as pool:
            for frame in range(COUNT):
                assert len({*pool.map(lambda _: shared.read("out_1", "cam01", frame), range(8))}) == 1  # noqa: B023
        assert shared._size == sum(len(content) for _, content in shared._kept.values())


def test_pictures_are_kept_up_to_so_many_bytes(project, monkeypatch):
    monkeypatch.setattr(pictures, "MOST_KEPT", 3000)
    with Workspace() as workspace:
        shared = pictures.Pictures(workspace)
        for frame in range(COUNT):
            shared.read("out_1", "cam01", frame)
        assert 0 < shared._size <= 3000 and list(shared._kept)[-1] == ("out_1", "cam01", COUNT - 1, False)
        monkeypatch.setattr(pictures, "MOST_KEPT", 1)
        # one that is larger than all that is kept is shown all the same
        assert shared.read("out_1", "cam01", 0) and not shared._kept and not shared._size


def test_pictures_are_shown_while_others_are_asked_for_and_something_is_saved(client):
    """Twenty at once."""
    marks = {"walk": "in_1", "camera": "cam01", "session": "lab"}

    def one(number):
        if number % 10 == 0:
            u = [10 + number, 10 + number + 10]
            change = {"key": ["in_1", 3, "LASI"], "before": [u[0], 20], "after": [u[1], 20]}
            return client.post("/api/marks/change", json=marks | {"changes": [change]}).status_code
        return client.get("/picture", params=CAM | {"frame": number % COUNT}).status_code

    with ThreadPoolExecutor(20) as pool:
        answers = [*pool.map(one, range(40))]
    assert {answers[number] for number in range(40) if number % 10} == {200}
    # the first is saved; each of the others as it came after the one before, or is told of it
    assert answers[0] == 200 and {*answers[::10]} <= {200, 409}
