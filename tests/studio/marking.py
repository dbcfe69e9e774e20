"""The page Marks as a browser's tests go about with it: what it shows, what it asks for, and what is true."""

import csv
import time

import cv2
import numpy as np

from dior.tables import tables

PLACE = """([u, v]) => { const { picture } = window.dior, [x, y] = picture.place_of(u, v),
  box = picture.place.getBoundingClientRect(); return [box.left + x, box.top + y]; }"""


def until(one, script, most_s=90.0):
    """Wait until a script is true; the pages' policy forbids Playwright's own way."""
    begun = time.monotonic()
    while not one.evaluate(script):
        assert time.monotonic() - begun < most_s, script
        one.wait_for_timeout(30)


def ready(one):
    until(one, "document.querySelectorAll('#markers button').length > 30")
    one.wait_for_selector("#picture[data-small='false']")


def answered(one):
    until(one, "document.querySelector('#answer').dataset.busy === 'false'")


def frame_of(one):
    return int(one.locator("#number").input_value())


def asked(one):
    name = one.locator("#prompt strong")
    return name.inner_text() if name.count() else ""


def saved(one, count):
    until(one, f"document.querySelector('#picture').dataset.saved === '{count}'")


def truth_of(project, camera):
    """(frame, marker) -> pixel, of those that are seen."""
    table = tables.read(project / "recordings/truth/indoor_01/labels_2d.parquet", "labels_2d")
    own = (table["camera"] == camera) & (table["status"] == "ok")
    keys = zip(table["frame"][own].tolist(), table["joint"][own], strict=True)
    return dict(zip(keys, np.stack([table["u"][own], table["v"][own]], axis=1), strict=True))


def rows_of(project, camera):
    path = project / f"config/sessions/lab/{camera}.marks.csv"
    if not path.is_file():
        return {}
    with path.open(newline="") as lines:
        return {(int(row["frame"]), row["joint"]): (float(row["u"]), float(row["v"])) for row in csv.DictReader(lines)}


def picture_of(one, frame, camera="cam01"):
    """A picture as the page has it, in grey."""
    address = one.url.partition("/marks")[0] + f"/picture?walk=indoor_01&camera={camera}&frame={frame}"
    return cv2.imdecode(np.frombuffer(one.request.get(address).body(), np.uint8), cv2.IMREAD_GRAYSCALE)


def clear(truth, frame, name, grey, least_px=9):
    """Whether a marker is seen on a frame, and no other is so near (px) that a click beside it may be on that one.

    The body that is drawn hides some that the truth, whose limbs are thinner, calls seen.
    """
    uv = truth.get((frame, name))
    if uv is None or not (10 < uv[0] < 1270 and 10 < uv[1] < 710):
        return False
    near = [np.linalg.norm(uv - other) for (f, joint), other in truth.items() if f == frame and joint != name]
    u, v = uv.round().astype(int)
    return min(near, default=np.inf) > least_px and grey[v - 1 : v + 2, u - 1 : u + 2].max() > 220
