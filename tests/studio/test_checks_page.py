"""The page Hand checks: the sample without its labels, what is written, and where it goes on."""

import numpy as np
import pytest

from dior.evaluate import checks, to_mark
from dior.studio import checks_page
from dior.tables import tables
from tests.check.recorded import COUNT, SIZE
from tests.evaluate.test_to_mark import JOINTS
from tests.studio import browser

FILE = "config/checks/in_1.cam01.csv"


@pytest.fixture
def labelled(project):
    """The indoor walk with labels of three joints on each frame, as the step `reproject` leaves them."""
    count = COUNT * len(JOINTS)
    frame, joint = np.repeat(np.arange(COUNT), len(JOINTS)), np.tile(np.array(JOINTS, object), COUNT)
    columns = {"subject": np.full(count, "S01", object), "source": np.full(count, "mocap", object)}
    columns |= {"sequence": np.full(count, "in_1", object), "camera": np.full(count, "cam01", object)}
    columns |= {"joint": joint, "frame": frame, "stamp_ns": frame, "status": np.full(count, "ok", object)}
    columns |= {"u": 20 + 5.0 * (np.arange(count) % 3), "v": 10 + 8.0 * (np.arange(count) % 3)}
    (project / "results/reproject").mkdir(parents=True)
    tables.write(project / "results/reproject/in_1.cam01.parquet", "labels_2d", columns)
    return project


def sample(client):
    told = client.get("/api/checks").json()
    return told["points"], told["at"]


def write(client, point, before, after):
    own = {name: point[name] for name in ("walk", "camera", "frame", "joint")}
    return client.post("/api/checks/change", json=own | {"before": before, "after": after})


def test_the_sample_is_that_of_the_step_and_tells_no_label(client, labelled):
    points, at = sample(client)
    [(_, drawn)] = to_mark.labels([labelled / "results/reproject/in_1.cam01.parquet"]).items()
    assert [(one["frame"], one["joint"]) for one in points] == drawn and len(drawn) == 100 and at == 0
    assert not {"u", "v", "label"} & set(points[0]) and points[0]["clicked"] is None
    to_mark.run(indoor=[labelled / "results/reproject/in_1.cam01.parquet"], long_range=[], out=checks_page.DRAWN.parent)
    assert sample(client)[0] == points


def test_points_are_written_as_the_evaluation_reads_them_and_it_goes_on_there(client, labelled):
    points, _ = sample(client)
    assert write(client, points[0], None, [20.5, 11]).status_code == 200
    assert write(client, points[1], None, []).status_code == 200
    assert (labelled / FILE).read_text().splitlines() == [
        "sequence,frame,joint,u,v",
        f"in_1,{points[0]['frame']},{points[0]['joint']},20.50,11.00",
        f"in_1,{points[1]['frame']},{points[1]['joint']},,",
    ]
    found = checks.points(labelled / FILE, "in_1", range(COUNT), JOINTS, SIZE[::-1])
    assert found == {(points[0]["frame"], points[0]["joint"]): (20.5, 11.0)}
    points, at = sample(client)
    assert at == 2 and points[0]["clicked"] == [20.5, 11.0] and points[1]["clicked"] == []
    # second thoughts
    assert write(client, points[1], [], [30, 12]).status_code == 200
    assert write(client, points[0], [20.5, 11], None).status_code == 200
    points, at = sample(client)
    assert at == 0 and points[0]["clicked"] is None and points[1]["clicked"] == [30.0, 12.0]


def test_what_somebody_else_wrote_is_a_conflict(client, labelled):
    points, _ = sample(client)
    write(client, points[0], None, [20, 11])
    answer = write(client, points[0], None, [22, 11])
    assert answer.status_code == 409 and answer.json()["conflicts"][0]["theirs"] == ["20.00", "11.00"]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"after": [64, 3]}, "outside of the 64x48 picture"),
        ({"after": [3]}, "no two pixels"),
        ({"joint": "LASSI"}, "did you mean 'LASI'"),
        ({"frame": COUNT}, f"no frame {COUNT}"),
    ],
)
def test_what_is_no_point_is_refused(client, labelled, change, said):
    own = {"walk": "in_1", "camera": "cam01", "frame": 3, "joint": "LASI", "before": None, "after": [3, 3]}
    answer = client.post("/api/checks/change", json=own | change)
    assert answer.status_code == 422 and said in answer.json()["error"]
    assert not (labelled / FILE).exists()


def test_without_labels_it_says_what_is_missing(client):
    answer = client.get("/api/checks")
    assert answer.status_code == 200 and "dior run" in answer.json()["lacks"]


def test_the_view_does_not_tell_where_the_label_is(client, labelled):
    """Its middle is beside the person's, another way for each joint, and as far from the label as from anything."""
    where = {"walk": "in_1", "camera": "cam01"}
    found = [
        client.get("/api/checks/view", params=where | {"frame": frame, "joint": joint}).json()
        for frame in range(COUNT)
        for joint in JOINTS
    ]
    assert found[0] == client.get("/api/checks/view", params=where | {"frame": 0, "joint": JOINTS[0]}).json()
    middles = np.array([[one["u"], one["v"]] for one in found]).reshape(COUNT, len(JOINTS), 2)
    # the person is from (20, 10) to (30, 26); each joint has the same mean view
    np.testing.assert_allclose(middles.mean(axis=0), [[25, 18]] * 3, atol=1.2)
    assert middles.std(axis=(0, 1)).min() > 2 and np.abs(middles - (25, 18)).max() <= 4.1
    assert {one["height"] for one in found} == {25.6}


@pytest.mark.parametrize(
    ("clicked", "at"),
    [
        ([], 0),
        ([None, None], 0),
        ([[1, 2], [], None, [3, 4]], 2),
        # a file that was copied, with a row for each
        ([[1, 2], [], [3, 4], [], []], 3),
        ([[], []], 0),
        ([[1, 2], [3, 4]], 2),
    ],
)
def test_where_it_goes_on(clicked, at):
    assert checks_page.resume(clicked) == at


@pytest.mark.slow
def test_points_are_clicked_accepted_gone_back_to_and_gone_on_with(labelled, chromium):
    def points_of_file():
        return (labelled / FILE).read_text().splitlines()[1:] if (labelled / FILE).exists() else []

    def shown(one, point):
        one.wait_for_selector(f"#picture[data-point='{point}']")

    with browser.served(labelled) as address:
        with browser.page(chromium, address, "/checks") as one:
            shown(one, 0)
            assert one.locator("#accept").is_disabled() and "Point 1 of 100" in one.locator("#progress").inner_text()
            box = one.locator("#picture").bounding_box()
            one.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
            one.keyboard.press("ArrowRight")
            one.keyboard.press("Enter")
            shown(one, 1)
            one.wait_for_selector("#picture[data-saved='1']")
            [first] = points_of_file()
            one.keyboard.press("x")
            shown(one, 2)
            one.wait_for_selector("#picture[data-saved='2']")
            assert points_of_file()[0] == first and points_of_file()[1].endswith(",,")
            one.keyboard.press("Backspace")
            shown(one, 1)
            one.keyboard.press("ArrowDown")
            one.keyboard.press("Enter")
            shown(one, 2)
            one.wait_for_selector("#picture[data-saved='3']")
            assert not points_of_file()[1].endswith(",,")
            # each decision is taken back, and made again
            one.keyboard.press("Control+z")
            one.wait_for_selector("#picture[data-saved='4']")
            shown(one, 1)
            assert points_of_file()[1].endswith(",,")
            one.keyboard.press("Control+z")
            one.wait_for_selector("#picture[data-saved='5']")
            assert len(points_of_file()) == 1
            one.keyboard.press("Control+y")
            one.wait_for_selector("#picture[data-saved='6']")
            one.keyboard.press("Control+y")
            one.wait_for_selector("#picture[data-saved='7']")
            shown(one, 2)
            assert len(points_of_file()) == 2 and not points_of_file()[1].endswith(",,")
            # what cannot be written stays on the page, and comes with the next
            good = (labelled / FILE).read_text()
            (labelled / FILE).write_text(good + "in_1,0,neck,abc,1\n")
            one.keyboard.press("x")
            one.locator("#said .error", has_text="Not written: ").wait_for()
            assert "1 point not saved" in one.locator("#progress").inner_text()
            (labelled / FILE).write_text(good)
            one.keyboard.press("x")
            one.wait_for_selector("#picture[data-saved='9']")
            assert len(points_of_file()) == 4 and not one.locator("#said .error").count()
            assert all("422" in text for text in one.said), one.said
            one.said.clear()
            one.keyboard.press("Control+z")
            one.wait_for_selector("#picture[data-saved='10']")
            one.keyboard.press("Control+z")
            one.wait_for_selector("#picture[data-saved='11']")
        with browser.page(chromium, address, "/checks") as one:
            shown(one, 2)
            assert "2 clicked, 0 not seen" in one.locator("#progress").inner_text()


@pytest.mark.parametrize("cells", ["nan,5", "5,inf", "x,5", "5"])
def test_a_row_that_is_no_pixel_is_said(client, labelled, cells):
    point = sample(client)[0][0]
    (labelled / FILE).parent.mkdir(exist_ok=True)
    (labelled / FILE).write_text(f"sequence,frame,joint,u,v\nin_1,{point['frame']},{point['joint']},{cells}\n")
    answer = client.get("/api/checks")
    assert answer.status_code == 422 and FILE in answer.json()["error"]


def test_a_row_with_more_digits_can_be_changed(client, labelled):
    point = sample(client)[0][0]
    (labelled / FILE).parent.mkdir(exist_ok=True)
    (labelled / FILE).write_text(f"sequence,frame,joint,u,v\nin_1,{point['frame']},{point['joint']},10.123,20.4567\n")
    point = sample(client)[0][0]
    assert write(client, point, point["clicked"], [11, 21]).status_code == 200
    assert ",11.00,21.00" in (labelled / FILE).read_text()
