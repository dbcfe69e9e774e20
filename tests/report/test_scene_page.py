"""The page "3D with time", opened from disk in Chromium: what its slider, links and buttons do."""

import base64
import re

import cv2
import numpy as np
import pytest

from dior.ingest import bags
from dior.report import scene_file, viewer, viewer_files
from dior.tables import tables
from tests.report import chromium, walks

READY = "document.querySelector('main')?.dataset.ready === 'yes'"
FRAMES = 90


@pytest.fixture(scope="module")
def given(tmp_path_factory):
    return walks.write(tmp_path_factory.mktemp("walk"), frames=FRAMES)


@pytest.fixture(scope="module")
def made(given, tmp_path_factory):
    """The page; all that it needs is beside it."""
    out = tmp_path_factory.mktemp("report")
    beside = out / "assets" / walks.SEQUENCE
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(bags, "read_to_show", walks.pictures)
        viewer.run(**given, out=beside / "scene.js", out_pictures=beside / "pictures")
    return walks.write_page(out)


@pytest.fixture(scope="module")
def browser():
    with chromium.opened() as page:
        page.size(1200)
        yield page


def at(page):
    """The instant that is shown, as the slider, the words and the link have it; the three agree."""
    slider, words, link = page.run(
        "[document.querySelector('#slider').value, document.querySelector('#number').textContent, "
        "document.querySelector('#slider').getAttribute('aria-valuetext')]"
    )
    assert words == f"frame {slider}" and link.startswith(f"{words}, ")
    return int(slider)


def click(page, selector):
    page.run(f"document.querySelector('{selector}').click()")


def choose(page, selector, value):
    page.run(f"{{ const one = document.querySelector('{selector}'); one.value = '{value}';"
             " one.dispatchEvent(new Event('change')); }")  # fmt: skip


def test_three_js_has_the_parts_that_are_used_and_no_others():
    used = set(re.findall(r"\bTHREE\.(\w+)", (viewer_files.STATIC / "viewer.js").read_text()))
    (listed, other) = re.findall(r"export \{(.*?)\}", (viewer_files.STATIC / "three.entry.js").read_text(), re.DOTALL)
    assert used == {*listed.replace(",", " ").split(), *other.split()}
    assert "Permission is hereby granted" in (viewer_files.STATIC / "three.min.js").read_text()


def test_it_opens_from_disk_and_asks_for_nothing_else(browser, made):
    browser.open(made, ready=READY)
    browser.until("Array.from(document.querySelectorAll('.off')).every((words) => words.textContent)")
    assert at(browser) == 0 and not browser.said
    assert {url.split(":")[0] for url in browser.asked if url != "about:blank"} == {"file"}
    assert any(url.endswith("cam04.0.webp") for url in browser.asked)


def test_a_link_leads_to_a_frame_and_to_a_camera_s_own(browser, made):
    browser.open(made, "#frame=45", READY)
    assert at(browser) == 45 and browser.run("location.hash") == "#frame=45"
    # cam03's stamps are 4 ms later; its worst picture is there as a whole
    browser.open(made, "#camera=cam03&frame=16", READY)
    assert at(browser) == 16
    assert browser.run("document.querySelector('figure.named').dataset.camera") == "cam03"
    assert browser.run("document.querySelector('figure.named a').href").endswith("/pictures/cam03.frame_16.webp")
    assert browser.run("document.querySelector('figure.named .now').textContent") == "frame 16"
    assert "0.537 s" in browser.run("document.querySelector('figure.named .off').textContent")
    browser.run("location.hash = '#frame=5'")
    browser.until("document.querySelector('#slider').value === '5'")
    assert not browser.run("document.querySelector('figure.named') !== null")
    browser.run("location.hash = '#camera=cam09&frame=5'")
    browser.until("document.querySelector('#note').textContent.includes('cam09')")


def test_without_a_link_it_begins_where_there_is_somebody(browser, made):
    browser.open(made, "#frame=45", READY)
    browser.run("viewer.walk.numbers.joints.fill(-32768, 0, 7 * 3 * viewer.walk.joints)")
    browser.run("location.hash = ''")
    browser.until("document.querySelector('#slider').value === '7'")


def test_slider_buttons_and_keys_move_all_at_once(browser, made):
    browser.open(made, "#frame=40", READY)
    browser.run("document.querySelector('#slider').focus()")
    browser.press("ArrowRight")
    assert at(browser) == 41
    browser.until("location.hash === '#frame=41'")
    click(browser, "#on")
    click(browser, "#on")
    click(browser, "#back")
    assert at(browser) == 42
    click(browser, "#worst-on")
    assert at(browser) == 45 and browser.run("document.querySelector('#worst [aria-current]').hash") == "#frame=45"
    click(browser, "#picture-on")
    assert at(browser) == 60
    browser.run("document.querySelector('#stage canvas').focus()")
    browser.press("ArrowLeft")
    assert at(browser) == 59 and browser.run("document.querySelector('.now').textContent") == "frame 59"
    assert "shown: frame 60, 2.000 s, 0.03 s after" in browser.run("document.querySelector('.off').textContent")


def test_it_plays_and_stops_at_the_end(browser, made):
    browser.open(made, "#frame=80", READY)
    click(browser, "#play")
    assert browser.run("document.querySelector('#play').textContent") == "Pause"
    browser.until(f"document.querySelector('#slider').value === '{FRAMES - 1}'")
    browser.until("document.querySelector('#play').textContent === 'Play'")
    browser.until(f"location.hash === '#frame={FRAMES - 1}'")


def test_the_browser_has_the_numbers_of_the_tables(browser, given, made):
    browser.open(made, ready=READY)
    table = tables.read(given["skeleton"], "skeletons_3d")
    values, joints = tables.grid(table, "x", "y", "z", "sigma_x", "sigma_y", "sigma_z", "rho_xy", "rho_xz", "rho_yz")
    instant, joint = 57, joints.index("right_ankle")
    *point, x, y, z, xy, xz, yz = values[instant, joint].astype(float)
    assert browser.run(f"viewer.walk.point({instant}, {joint})") == pytest.approx(point, abs=0.00051)
    factor = np.reshape(browser.run(f"viewer.walk.factor({instant}, {joint})"), (3, 3))
    rho = np.array([[1, xy, xz], [xy, 1, yz], [xz, yz, 1]])
    assert factor @ factor.T == pytest.approx(np.outer((x, y, z), (x, y, z)) * rho, rel=0.06, abs=2e-6)
    assert browser.run(f"viewer.walk.point(25, {joints.index('left_wrist')})") is None


def test_rays_are_those_of_the_pictures_of_an_instant(browser, made):
    arrays = scene_file.arrays_of(made.parents[1] / f"assets/{walks.SEQUENCE}/scene.js")
    # what is behind a missing joint goes as far as the middle of the body
    rays = sum(int((arrays[f"cam0{i} rays"][0, :, 0] != scene_file.NONE).sum()) for i in range(1, 5))
    browser.open(made, "#frame=0", READY)
    choose(browser, "#rays", "all")
    assert browser.run("document.querySelector('#lit').textContent") == f"{rays} rays" and rays > 90
    choose(browser, "#rays", "nose")
    assert browser.run("document.querySelector('#lit').textContent") == "4 rays"
    click(browser, "#on")
    click(browser, "#on")
    click(browser, "#on")
    assert "no picture" in browser.run("document.querySelector('#lit').textContent")


def colours(page):
    """How many colours the 3D has."""
    box = page.run("(({x, y, width, height}) => ({x, y, width, height, scale: 1}))"
                   "(document.querySelector('#stage').getBoundingClientRect())")  # fmt: skip
    png = base64.b64decode(page.call("Page.captureScreenshot", format="png", clip=box)["data"])
    return len(np.unique(cv2.imdecode(np.frombuffer(png, np.uint8), 1).reshape(-1, 3), axis=0))


def test_it_draws_and_flies_to_a_camera_and_back(browser, made):
    browser.open(made, "#frame=0", READY)
    assert colours(browser) > 50
    centre = browser.run("scene.cameras[3].centre")
    click(browser, "[data-camera=cam04] button")
    there = f"Math.hypot(...viewer.space.eye.position.toArray().map((value, i) => value - {centre}[i])) < 1e-3"
    browser.until(there)
    assert browser.run("viewer.space.eye.fov") < 6 and colours(browser) > 20
    click(browser, "#home")
    browser.until("viewer.space.eye.fov === 40")


@pytest.mark.parametrize(("width", "dark"), [(390, True), (1024, False), (1440, True)])
def test_it_fits_a_phone_and_a_desk_in_light_and_dark(browser, made, width, dark):
    browser.size(width, dark=dark)
    browser.open(made, ready=READY)
    assert browser.run("document.documentElement.scrollWidth") == width
    paper = browser.run("getComputedStyle(document.body).backgroundColor")
    assert (paper == "rgb(20, 24, 29)") == dark
