"""Who: what is said of a walk, everybody in a picture, and the seed that is written."""

import numpy as np
import pytest
import yaml

from dior.simulate import config
from dior.tables import tables
from tests.check.recorded import COUNT
from tests.end_to_end.workflow import snakemake
from tests.studio import browser, keystrokes

WALK = {"walk": "out_1"}
FILE = "config/people/out_1.yaml"
JOINTS = ("nose", "left_shoulder", "right_shoulder", "left_hip", "right_hip", "left_ankle", "right_ankle")
# of a body whose middle is at (0, 0)
BODY = np.array([(0, -10), (-3, -6), (3, -6), (-2, 0), (2, 0), (-2, 10), (2, 10)], float)
# by track, where the two are in both cameras: the second is to the left
MIDDLES = {0: (45.0, 24.0), 1: (15.0, 20.0)}


def told(client, walk="out_1"):
    answer = client.get("/api/who", params={"walk": walk})
    assert answer.status_code == 200, answer.text
    return answer.json()


def people_at(client, frame, camera="cam01"):
    return client.get("/api/who/people", params=WALK | {"camera": camera, "frame": frame}).json()


def put(client, before, after, walk="out_1"):
    return client.post("/api/who", json={"walk": walk, "before": before, "after": after})


def seed(u, v, frame=12, camera="cam01"):
    return {"camera": camera, "frame": frame, "u": u, "v": v}


@pytest.fixture
def two(project):
    """Two people in both close cameras of out_1, the second in the frames 10 to 29 only, as a run left them."""
    cameras = ("cam01", "cam02")
    rows = [
        (camera, frame, track, joint, *(BODY[j] + middle))
        for camera in cameras
        for frame in range(COUNT)
        for track, middle in MIDDLES.items()
        if track == 0 or 10 <= frame < 30
        for j, joint in enumerate(JOINTS)
    ]
    names = ("camera", "frame", "track", "joint", "u", "v")
    columns = {name: [row[i] for row in rows] for i, name in enumerate(names)}
    columns |= {"person": columns["track"], "score": [0.9] * len(rows)}
    own = [i for i, row in enumerate(rows) if row[2] == 0]
    first = {name: [values[i] for i in own] for name, values in columns.items() if name != "track"}
    (project / "results/detections").mkdir(parents=True)
    tables.write(project / "results/detections/out_1.people.parquet", "detected_people", columns)
    tables.write(project / "results/detections/out_1.parquet", "detections", first | {"stamp_ns": [0] * len(own)})


def say(project, *findings):
    (project / "results/triangulate").mkdir(parents=True, exist_ok=True)
    path = project / "results/triangulate/out_1.findings.parquet"
    tables.write_findings(path, [("out_1", "info", code, text) for code, text in findings])


def test_before_any_run_a_walk_with_one_body_needs_nobody_named(client):
    found = told(client)
    assert (found["state"], found["most"], found["seeds"]) == ("alone", 1, [])
    [one] = people_at(client, 3)
    # the landmarks of tests/check/recorded.py lie on a line
    assert one["box"] == [20.0, 10.0, 52.0, 42.0] and (one["u"], one["v"]) == (36.0, 26.0)
    assert told(client, "in_1")["state"] == "mocap"


def test_everybody_in_a_picture_from_left_to_right(client, two):
    found = told(client)
    assert (found["state"], found["most"]) == ("unknown", 2) and found["start"]["camera"] == "cam01"
    assert 10 <= found["start"]["frame"] < 30
    assert [one["track"] for one in people_at(client, 12)] == [1, 0]
    assert people_at(client, 12)[0]["box"] == [12.0, 10.0, 18.0, 30.0]
    assert [one["track"] for one in people_at(client, 5)] == [0]
    assert people_at(client, COUNT) == []


@pytest.mark.parametrize(
    ("codes", "state"),
    [
        (["who_is_subject"], "open"),
        (["who_is_subject", "somebody_else"], "open"),
        (["somebody_else", "others_told_apart"], "look"),
        (["others_told_apart"], "told"),
        (["many_swaps"], "unknown"),
    ],
)
def test_what_the_last_run_says_of_several_people(client, project, two, codes, state):
    say(project, *((code, f"{code}, in words") for code in codes))
    found = told(client)
    assert found["state"] == state
    assert [code in found["words"] for code in codes] == [code != "many_swaps" for code in codes]


def test_a_click_is_a_seed_which_its_reader_takes_for_that_person(client, project, two):
    assert put(client, None, [seed(16.0, 21.5)]).status_code == 200
    assert yaml.safe_load((project / FILE).read_text()) == {"seeds": [seed(16.0, 21.5)]}
    found = told(client)
    assert (found["state"], found["tracks"], found["problem"]) == ("named", [1], "")
    both = [seed(16.0, 21.5), seed(44.0, 20.0, camera="cam02")]
    assert put(client, [seed(16.0, 21.5)], both).status_code == 200
    assert told(client)["tracks"] == [1, 0]
    # what is taken back leaves no file, since an empty one would be refused
    assert put(client, both, []).status_code == 200
    assert not (project / FILE).exists() and told(client)["state"] == "unknown"


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (seed(16.0, 21.5, frame=5), "nobody was detected near"),
        (seed(16.0, 21.5, frame=COUNT), "has no frame 40"),
        (seed(16.0, 21.5, camera="cam03"), "not one of the close cameras"),
        ({"camera": "cam01", "frame": 12, "u": 16.0}, "v"),
        ({"camera": "cam01", "frame": 1.5, "u": 16.0, "v": 20.0}, "frame"),
    ],
)
def test_what_no_step_would_take_is_refused_and_nothing_is_written(client, project, two, wrong, words):
    answer = put(client, None, [wrong])
    assert answer.status_code == 422 and words in answer.json()["error"] and FILE in answer.json()["error"]
    assert not (project / FILE).exists()


def test_seeds_of_an_indoor_walk_are_refused(client, project):
    answer = put(client, None, [seed(16.0, 21.5)], "in_1")
    assert answer.status_code == 422 and "motion capture" in answer.json()["error"]


def test_two_pages_are_told_and_a_comment_stays(client, project, two):
    (project / "config/people").mkdir(exist_ok=True)
    (project / FILE).write_text("# by Ann, who knows them\nseeds:\n- {camera: cam01, frame: 12, u: 16, v: 21.5}\n")
    assert put(client, None, [seed(45.0, 24.0)]).status_code == 409
    assert put(client, told(client)["seeds"], [seed(45.0, 24.0)]).status_code == 200
    text = (project / FILE).read_text()
    assert text.startswith("# by Ann, who knows them\n") and told(client)["tracks"] == [0]


def test_a_seed_by_hand_at_which_nobody_is_is_said(client, project, two):
    (project / "config/people").mkdir(exist_ok=True)
    (project / FILE).write_text("seeds:\n- {camera: cam01, frame: 2, u: 2, v: 2}\n")
    found = told(client)
    assert found["state"] == "named" and "nobody was detected near (2, 2)" in found["problem"]


def test_a_camera_that_came_after_the_last_run_is_named(client, project, two):
    path = project / "results/detections/out_1.parquet"
    tables.write(path, "detections", tables.of_camera(tables.read(path, "detections"), "cam02"))
    answer = client.get("/api/who", params=WALK)
    assert answer.status_code == 422 and "no detections of cam01 in out_1" in answer.json()["error"]


# two people who walk in one recording, and a detector that finds both
TWO = {
    "subjects": 1, "sequences": 1, "environments": ["outdoor"], "duration_s": 3.0, "gallery": False, "width": 640,
    "height": 360, "fx": 320.0, "long_range_fx": 380.0, "bystander": 0.6, "bystander_walks": True,
    "detector": {"everybody": True},
}  # fmt: skip


@pytest.mark.slow
def test_the_subject_is_named_by_a_click_and_by_a_key_and_the_step_takes_them(chromium, tmp_path):
    project = tmp_path / "two"
    config.run(practice=project, settings=TWO)
    path = project / "config/people/outdoor_01.yaml"
    with browser.served(project) as address, browser.page(chromium, address, "/who") as page:
        page.wait_for_selector("#pictures[data-ready]", timeout=120_000)
        assert "Several people" in page.inner_text("#state")
        figures = {camera: page.locator(f"[data-camera={camera}]") for camera in ("cam01", "cam02", "cam03")}
        several = [camera for camera, one in figures.items() if one.locator("figcaption button").count() == 2]
        assert len(several) >= 2
        # who the second person is, by the truth of the capture; by mouse in one camera
        clicked, by_key = several[:2]
        middle = {camera: true_middle(project, camera, figures[camera]) for camera in several}
        image = figures[clicked].locator("img")
        size = image.bounding_box()
        u, v = middle[clicked].tolist()
        image.click(position={"x": (u + 0.5) * size["width"] / 640, "y": (v + 0.5) * size["height"] / 360})
        keystrokes.until(lambda: page.locator("#seeds button").count() == 1)
        [first] = yaml.safe_load(path.read_text())["seeds"]
        assert first["camera"] == clicked and abs(first["u"] - u) < 1 and abs(first["v"] - v) < 1
        # and by the keyboard in another
        buttons = figures[by_key].locator("figcaption button")
        boxes = figures[by_key].locator("rect")
        off = [abs(float(boxes.nth(i).get_attribute("x")) + float(boxes.nth(i).get_attribute("width")) / 2
                   - middle[by_key][0]) for i in range(2)]  # fmt: skip
        buttons.nth(int(np.argmin(off))).focus()
        page.keyboard.press("Enter")
        keystrokes.until(lambda: page.locator("#seeds button").count() == 2)
        page.keyboard.press("z")
        keystrokes.until(lambda: page.locator("#seeds button").count() == 1)
        page.keyboard.press("y")
        keystrokes.until(lambda: page.locator("#seeds button").count() == 2)
        assert "done" in page.inner_text("#walks")
    # the step takes whom was pointed at: the detections that it chose are theirs
    snakemake(project, "results/triangulate/outdoor_01.parquet")
    chosen = tables.read(project / "results/triangulate/outdoor_01.detections.parquet", "detections")
    second = tables.read(project / "recordings/truth/outdoor_01/second_labels_2d.parquet", "labels_2d")
    for camera in (clicked, by_key):
        uv, names = tables.grid(tables.of_camera(chosen, camera), "u", "v")
        true, joints = tables.grid(tables.of_camera(second, camera), "u", "v")
        assert names == joints
        off = np.linalg.norm(uv - true[: len(uv)], axis=-1)
        # noise of 2 px in u and in v
        assert np.isfinite(off).any(axis=1).mean() > 0.4 and np.nanmax(off) < 15


def true_middle(project, camera, figure):
    """The middle of the second person's hips (px) in the picture that is shown."""
    table = tables.read(project / "recordings/truth/outdoor_01/second_labels_2d.parquet", "labels_2d")
    uv, names = tables.grid(tables.of_camera(table, camera), "u", "v")
    frame = int(figure.get_attribute("data-frame"))
    return uv[frame, [names.index("left_hip"), names.index("right_hip")]].mean(axis=0)
