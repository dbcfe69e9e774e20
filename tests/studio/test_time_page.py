"""A camera's clock by eye: the skeleton at the times that a clock gives, and what is written of it."""

import numpy as np
import pytest

from dior.body.names import COCO_17
from dior.calibrate.outline.tracks import BodyTrack
from dior.clocks.clock import Clock
from dior.geometry.camera import Camera, Intrinsics
from dior.geometry.tape import look_at_pose
from dior.studio import time_page as page
from dior.studio.skeletons import Body
from tests.studio import browser

F, FPS, SPEED = 600.0, 30.0, 1.2
T0 = 1_700_000_000_000_000_000
OUT = {"walk": "out_1", "camera": "cam02"}


def camera():
    tape = {"position_m": [0.0, 6.0, 1.0], "target_m": [0.0, 0.0, 1.0]}
    return Camera("cam02", Intrinsics(1280, 720, F, F, 639.5, 359.5), look_at_pose("cam02.yaml", tape))


def view(count=60):
    """A body that glides to the left of the camera at SPEED, 6 m before it, for two seconds at 100 Hz."""
    seconds = np.arange(-20, 240) / 100
    body = np.zeros((len(COCO_17), 3)) + (0, 0, 1) + np.linspace(-0.2, 0.2, len(COCO_17))[:, None] * (1, 0, 1)
    points = body + seconds[:, None, None] * np.array([SPEED, 0, 0])
    stamps = T0 + (1e9 * np.arange(count) / FPS).astype(np.int64)
    rows = {"frame": np.arange(count), "stamp_ns": stamps}
    found = page.Found(camera(), Clock(0.0), None, ())
    walk = Body(BodyTrack(seconds, points), T0, list(COCO_17), "made up")
    return page.View(found, walk, rows, np.array([10, 20]), np.zeros((2, 4)))


def test_a_millisecond_moves_the_skeleton_by_what_is_walked_in_it():
    at = [page.lines_at(view(), np.array([30]), offset, 0.0)[0]["left"] for offset in (0.0, 0.001, 0.033)]
    here, later, much_later = (np.array(one) for one in at)
    # x grows to the left of a camera that looks from +y: the pixels fall
    per_s = np.array([-SPEED * F / 6, 0, -SPEED * F / 6, 0])
    assert np.allclose(later - here, 0.001 * per_s, atol=0.011)
    assert np.allclose(much_later - here, 0.033 * per_s, atol=0.011)


def test_a_drift_counts_from_the_first_picture():
    plain, drifted = (page.lines_at(view(), np.array([0, 59]), 0.0, ppm) for ppm in (0.0, 1e4))
    assert drifted[0] == plain[0]
    moved = np.array(drifted[1]["right"]) - np.array(plain[1]["right"])
    assert np.allclose(moved[:, 0], -SPEED * F / 6 * 59 / FPS * 0.01, atol=0.011)


def test_the_pictures_are_those_in_which_feet_are_fastest():
    count = 60
    x = np.zeros(count)
    # steps of different length, each in one picture
    for at, step in ((10, 0.5), (12, 0.45), (30, 0.3), (50, 0.2)):
        x[at:] += step
    points = np.stack([x - 0.7, 0 * x, 0 * x + 1], axis=-1)[:, None]
    stamps = T0 + (1e9 * np.arange(count) / FPS).astype(np.int64)
    # 12 is too near to 10
    assert page.fastest(camera(), points, stamps, 3).tolist() == [10, 30, 50]
    points[30] = np.nan
    assert 30 not in page.fastest(camera(), points, stamps, 3)
    assert page.fastest(camera(), points + (90, 0, 0), stamps, 3).tolist() == []


def test_the_estimate_is_the_runs_or_where_one_by_hand_stood_there_the_least_cost():
    assert page.estimate(Clock(0.012, 5.0, "estimated"), None) == {"offset_s": 0.012, "drift_ppm": 5.0}
    lags = np.arange(-100.0, 101, 10)
    curve = lags, 3 + (lags - 13) ** 2 / 1e3
    assert page.estimate(Clock(0.5, 0.0, "manual"), curve)["offset_s"] == pytest.approx(0.013)
    assert page.estimate(Clock(0.0), None) is None
    assert page.estimate(None, (lags, np.full(len(lags), np.nan))) is None


def put(client, before, after, **more):
    return client.post("/api/time/save", json=OUT | {"before": before, "after": after} | more)


def test_a_clock_is_given_and_taken_away_and_the_others_stay(client, project):
    path = project / "config/offsets/out_1.yaml"
    path.parent.mkdir(exist_ok=True)
    text = "# by Ben, by the flash\ncam01: {offset_s: 0.02}  # sure\n"
    path.write_text(text)
    given = {"offset_s": 0.012, "drift_ppm": 0.0, "sigma_s": 0.005}
    assert put(client, None, given).json() == {"file": "config/offsets/out_1.yaml", "given": given}
    assert path.read_text() == text + "cam02: {offset_s: 0.012, drift_ppm: 0.0, sigma_s: 0.005}\n"
    answer = put(client, None, given | {"offset_s": 0.5})
    assert answer.status_code == 409 and answer.json()["conflicts"][0]["theirs"] == given
    assert put(client, given, given | {"offset_s": -0.5}).status_code == 200
    assert put(client, given | {"offset_s": -0.5}, None).json()["given"] is None
    assert path.read_text() == text


def test_the_last_clock_by_hand_leaves_a_file_that_a_run_takes(client, project):
    given = {"offset_s": 0.012}
    assert put(client, None, given).status_code == 200 and put(client, given, None).status_code == 200
    assert client.get("/api/walks").status_code == 200
    assert page.skeletons.clock_by_hand(client.app.state.workspace.project(), "out_1", "cam02") is None


@pytest.mark.parametrize(
    ("after", "word"), [({"offset_s": "x"}, "offset_s"), ({"drift_ppm": 1}, "offset_s"), ({"offset_s": 0, "x": 1}, "x")]
)
def test_what_the_schema_refuses_is_not_written(client, project, after, word):
    answer = put(client, None, after)
    assert answer.status_code == 422 and word in answer.json()["error"]
    assert answer.json()["error"].startswith("config/offsets/out_1.yaml")
    assert not (project / "config/offsets/out_1.yaml").exists()


def test_cameras_and_walks_that_are_not_there_are_named(client):
    assert "no camera 'cam9'" in put(client, None, {"offset_s": 0}, camera="cam9").json()["error"]
    assert client.get("/api/time", params={"walk": "out_9", "camera": "cam02"}).status_code == 422


def test_without_a_run_the_page_says_what_is_missing(client):
    answer = client.get("/api/time", params=OUT)
    assert "`dior run` places it first" in answer.json()["lacks"]
    assert client.get("/time").status_code == 200


@pytest.mark.slow
def test_a_clock_is_overridden_and_accepted_again(ran, chromium):
    """By keys; the file is then as it was, with its comment."""
    path = ran / "config/offsets/indoor_01.yaml"
    path.parent.mkdir(exist_ok=True)
    text = "# by the flash\ncam03: {offset_s: 0.5190, sigma_s: 0.002}  # sure\n"
    path.write_text(text)
    here = "/time?walk=indoor_01&camera=cam02"
    with browser.served(ran) as address, browser.page(chromium, address, here, 1024, 768) as one:
        one.wait_for_selector("#crops[data-count]")
        was = one.locator("#offset").input_value()
        assert one.locator("#crops .piece").count() == page.PICTURES
        for key in (">", ".", ".", ","):
            one.keyboard.press(key)
        assert float(one.locator("#offset").input_value()) == pytest.approx(float(was) + 11)
        one.keyboard.press("o")
        one.wait_for_selector("#counts:has-text('By hand')")
        [line] = [line for line in path.read_text().splitlines() if line.startswith("cam02")]
        assert f"offset_s: {(float(was) + 11) / 1e3:.4f}".rstrip("0") in line and "sigma_s: 0.005" in line
        assert path.read_text().startswith(text)
        one.reload()
        one.wait_for_selector("#crops[data-count]")
        assert float(one.locator("#offset").input_value()) == pytest.approx(float(was) + 11)
        one.keyboard.press("a")
        one.wait_for_selector("#counts:has-text('The estimate counts')")
        assert path.read_text() == text and one.locator("#offset").input_value() == was
        assert one.locator("#curve path").count() == 1


@pytest.mark.parametrize(
    ("given", "word"),
    [
        ({"offset_s": 1e12}, "offset_s"),
        ({"offset_s": 21.0}, "no picture of 'cam01'"),
        ({"offset_s": 0.0, "sigma_s": 1e9}, "sigma_s"),
        ({"offset_s": 0.0, "drift_ppm": 1e6}, "drift_ppm"),
    ],
)
def test_a_clock_that_cannot_be_is_refused_and_not_written(client, project, given, word):
    (project / "config/offsets/in_1.yaml").unlink(missing_ok=True)
    answer = put(client, None, given, walk="in_1", camera="cam01")
    assert answer.status_code == 422 and word in answer.json()["error"]
    assert answer.json()["error"].startswith("config/offsets/in_1.yaml")
    assert not (project / "config/offsets/in_1.yaml").exists()
    assert put(client, None, {"offset_s": 0.1, "sigma_s": 1}, walk="in_1", camera="cam01").status_code == 200
