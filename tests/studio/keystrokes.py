"""A person at a page: what is pressed, moved and clicked, and how long that takes a practised one.

The keystroke-level model (Card, Moran and Newell 1980) with its figures: a key 0.28 s (somebody who does not type for a
living), pointing 1.1 s, a click 0.2 s, a thought 1.2 s (here rounded down from 1.35). A key that is held repeats 30
times a second after half a second.
"""

import time
from dataclasses import dataclass, field

import cv2
import numpy as np

from dior.simulate import config, scene, settings, truth
from dior.simulate.motion import motion_of
from tests.studio import browser, marking

KEY_S, MOVE_S, CLICK_S, THOUGHT_S = 0.28, 1.1, 0.2, 1.2
HELD_S, REPEATS_HZ = 0.5, 30.0
WALK, CAMERA, SCALE = "outdoor_01", "cam04", 8
INDOORS = ("cam01", "cam02", "cam03", "cam04")
# chosen: px of the screen that a click is beside its aim; px between markers that are told apart where the person is
# enlarged
AIM_PX, APART_PX = 2.0, 5.0
A_FRAME, FRAMES = 8, 6  # chosen: marks that are placed on a frame before going on; frames at most
STEP = 0.25  # px of an arrow key


@dataclass
class Person:
    """Who works at a Playwright `page`."""

    page: object
    keys: int = 0
    moves: int = 0
    clicks: int = 0
    thoughts: int = 0
    held_s: float = field(default=0.0)

    def press(self, key, times=1):
        for _ in range(times):
            self.page.keyboard.press(key)
        self.keys += times

    def hold(self, key, repeats):
        """Hold a key until it has repeated so often."""
        *modifiers, last = key.split("+")
        for each in modifiers:
            self.page.keyboard.down(each)
        for _ in range(repeats + 1):
            self.page.keyboard.down(last)
        for each in [last, *modifiers]:
            self.page.keyboard.up(each)
        self.keys += 1
        self.held_s += HELD_S + repeats / REPEATS_HZ

    def drag(self, start, end):
        self.page.mouse.move(*start)
        self.page.mouse.down()
        self.page.mouse.move(*end, steps=4)
        self.page.mouse.up()
        self.moves += 2
        self.clicks += 1

    def click(self, place):
        self.page.mouse.click(*place)
        self.moves += 1
        self.clicks += 1

    def think(self):
        self.thoughts += 1

    @property
    def seconds(self):
        pressed = self.keys * KEY_S + self.held_s
        return pressed + self.moves * MOVE_S + self.clicks * CLICK_S + self.thoughts * THOUGHT_S

    def __str__(self):
        counts = f"{self.keys} keys, {self.moves} moves, {self.clicks} clicks, {self.thoughts} thoughts"
        return f"{counts}: {self.seconds:.0f} s"


def true_boxes():
    """By frame the box px around what is drawn of the body in the practice capture, without any error."""
    used = settings.from_dict(config.ONE_OF_EACH)
    walk = settings.sequence_named(used, WALK)
    motion = motion_of(used, walk)
    seen = truth.view(used, walk, motion, scene.LONG_RANGE)
    frames = np.arange(len(seen.seconds))
    tight = config.tight_boxes(used, walk, motion.height, seen, frames)
    numbers = np.asarray(seen.clock.frame_numbers)[frames]
    return {int(number): box for number, box in zip(numbers, tight, strict=True) if np.isfinite(box).all()}


def until(what, seconds=60.0):
    """Wait until `what()` is true."""
    end = time.monotonic() + seconds
    while not what():
        assert time.monotonic() < end, "it does not become true"
        time.sleep(0.05)


def frame_shown(page):
    """The frame that the page Boxes is ready at."""
    # the scene is made first, of 21 pictures
    page.wait_for_selector("#picture[data-ready]:not([data-ready=''])", timeout=120_000)
    return int(page.get_attribute("#picture", "data-ready"))


def as_seen(page, frame):
    """A function for the place on the screen (x, y) of a pixel (u, v), by the picture alone as it is on the screen.

    The edges of the enlarged pixels are found, and where these pixels are in the recorded picture.
    """
    place = page.locator("#picture").bounding_box()
    shot = cv2.imdecode(np.frombuffer(page.locator("#picture").screenshot(), np.uint8), cv2.IMREAD_COLOR)
    address = page.evaluate("(frame) => `/picture?walk=outdoor_01&camera=cam04&frame=${frame}`", frame)
    answer = page.request.get(page.url.partition("/boxes")[0] + address)
    whole = cv2.imdecode(np.frombuffer(answer.body(), np.uint8), cv2.IMREAD_COLOR)
    inner = shot[SCALE:-SCALE, SCALE:-SCALE].astype(int)
    first = []
    for axis in (1, 0):
        step = np.abs(np.diff(inner, axis=axis)).sum(axis=(2, 1 - axis))
        first.append(SCALE + 1 + int(np.argmax([step[k::SCALE].sum() for k in range(SCALE)])))
    half = SCALE // 2
    pixels = shot[first[1] + half : -SCALE : SCALE, first[0] + half : -SCALE : SCALE]
    off = cv2.matchTemplate(whole, pixels, cv2.TM_SQDIFF)
    row, column = np.unravel_index(int(off.argmin()), off.shape)

    def on_screen(u, v):
        x = place["x"] + first[0] + SCALE * (u - column + 0.5)
        return x, place["y"] + first[1] + SCALE * (v - row + 0.5)

    return on_screen


def box_on_screen(page):
    """The edges of the box as it is drawn on the screen: x and y of two corners."""
    place = page.locator("#picture").bounding_box()
    x, y, wide, high = page.evaluate(
        "() => ['x', 'y', 'width', 'height'].map((name) => Number(document.querySelector('#picture svg .box')."
        "getAttribute(name)))"
    )
    return np.array([x, y, x + wide, y + high]) + [place["x"], place["y"]] * 2


def draw_with_keys(person, frame, wanted):
    """Bring the box that is offered to the edges `wanted` px by arrow keys, as seen on the screen."""
    on_screen = as_seen(person.page, frame)
    aim = np.array([*on_screen(*wanted[:2]), *on_screen(*wanted[2:])])
    person.think()
    off = (aim - box_on_screen(person.page)) / SCALE
    wider = off[2:] - off[:2]
    for shift, (du, dv) in (("", off[:2]), ("Shift+", wider)):
        for distance, minus, plus in ((du, "ArrowLeft", "ArrowRight"), (dv, "ArrowUp", "ArrowDown")):
            key, steps = shift + (plus if distance > 0 else minus), round(abs(distance) / STEP)
            if steps > 8:
                # held down it goes in steps of four
                person.hold(key, (steps - 1) // 4)
                steps = (steps - 1) % 4
            person.press(key, steps)
    if not off.any() or np.abs(off).max() < STEP / 2:
        # an offer that lies well has to be touched
        person.press("ArrowLeft")
        person.press("ArrowRight")


def draw_with_mouse(person, frame, wanted):
    """Drag a box."""
    on_screen = as_seen(person.page, frame)
    person.think()
    person.drag(on_screen(*wanted[:2]), on_screen(*wanted[2:]))


def boxes(chromium, project, draw, count=25):
    """`Person` who has drawn so many boxes of a practice project that has none; the name is given before."""
    true, path = true_boxes(), project / f"config/boxes/{WALK}.{CAMERA}.csv"
    with browser.served(project) as address, browser.page(chromium, address, "/boxes?drawer=ann") as page:
        person = Person(page)
        for _ in range(count):
            frame = frame_shown(page)
            draw(person, frame, true[frame])
            person.press("Enter")
        # the page goes on while it writes
        until(lambda: path.exists() and len(path.read_text().splitlines()) == count + 1)
    return person


def marks(chromium, project, camera):
    """`Person` who has marked an indoor camera as the page asks, on the frames that it offers, and whether it has said
    that this is enough. Each click is up to 2 px of the screen beside the marker, and snaps."""
    truth, rng, enough, placed = marking.truth_of(project, camera), np.random.default_rng(5), False, 0
    address = f"/marks?session=lab&camera={camera}"
    with browser.served(project) as served, browser.page(chromium, served, address) as page:
        person = Person(page)
        marking.ready(page)
        for _ in range(FRAMES):
            before = marking.frame_of(page)
            person.think()
            person.press("f")
            marking.until(page, f"document.querySelector('#number').value !== '{before}'")
            frame = marking.frame_of(page)
            browser.until_shown(page, frame)
            marking.answered(page)
            grey = marking.picture_of(page, frame, camera)
            here = 0
            while here < A_FRAME and (name := marking.asked(page)) and not enough:
                # where on the body it sits is looked up for each
                person.think()
                if not marking.clear(truth, frame, name, grey, APART_PX):
                    person.press("x")
                    continue
                far, angle = AIM_PX * np.sqrt(rng.uniform()), rng.uniform(0, 2 * np.pi)
                far /= page.evaluate("window.dior.picture.scale")
                u, v = truth[frame, name] + far * np.array([np.cos(angle), np.sin(angle)])
                person.click(page.evaluate(marking.PLACE, [float(u), float(v)]))
                here, placed = here + 1, placed + 1
                marking.saved(page, placed)
                marking.answered(page)
                enough = "This is enough" in page.inner_text("#answer")
            if enough:
                break
    return person, enough


def print_marks(project_of):
    """Print what the marks of four indoor cameras take; `project_of(name)`: a practice project that has none."""
    project, total = project_of("marked"), 0.0
    with browser.opened() as chromium:
        for camera in INDOORS:
            person, enough = marks(chromium, project, camera)
            total += person.seconds
            count = len(marking.rows_of(project, camera))
            print(f"{count} marks of {camera}{'' if enough else ', not enough yet'}: {person}")
    print(f"marks of {len(INDOORS)} cameras: {total / 60:.1f} minutes")


def print_boxes(project_of):
    """Print what 25 boxes take, by mouse and by keys; `project_of(name)`: a practice project that has none."""
    with browser.opened() as chromium:
        for name, draw in (("dragged", draw_with_mouse), ("by keys", draw_with_keys)):
            print(f"25 boxes {name}: {boxes(chromium, project_of(name), draw)}")
