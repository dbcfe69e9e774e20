"""How fast the pages of the studio answer, on the capture that one practises on, over loopback and over a slow line.

usage: python -m benchmarks.studio [pictures] [keystrokes] [nudge] [live]      (all four)

`frame`: a 1280x720 picture of a bag from asking to its last byte, drawn by chance from all cameras; at most 100 ms
(p90) on an idle machine. `again`: one that was asked for before. `small`: one as it is shown while one moves through
the recording. `index`: the first question to a camera, which reads the recording through.
`line`: in Chromium, over a line of 10 Mbit/s and 40 ms (its own throttle): pictures that are shown a second while the
slider is dragged through the recording, and how long after it stops the whole picture is there. It needs Chromium and
Playwright.
`keystrokes`: what a practised person needs for 25 boxes and for the marks of four cameras, until the page says that
they are enough, by the keystroke-level model, of what a browser test has pressed and moved
(tests/studio/keystrokes.py). `nudge`: from a key to the skeletons that it has moved, in a dozen pictures of a
long-range camera; at most 50 ms (p90) on an idle machine. `live`: what the page Marks is answered while the marks of a
camera become more, from the fourth on: `pose` with the clock that is known so far, at most 300 ms (p90) on an idle
machine, and `clock` from then until the clock has been searched, too, with what would help most.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import json
import shutil
import sys
import tempfile
import time
import urllib.request
from functools import partial
from http.cookiejar import CookieJar
from pathlib import Path
from urllib.parse import urlencode

import numpy as np

from tests.studio import browser, keystrokes, nudging

KINDS = ("pictures", "keystrokes", "nudge", "live")
DRAWN, FRAMES = 100, 290  # of 300 pictures of a camera some may be lost
LINE = {"offline": False, "latency": 40, "downloadThroughput": 10e6 / 8, "uploadThroughput": 10e6 / 8}
DRAGGED_S = 4.0
MARKED, MOST_MARKS = "cam01", 40


def report(name, seconds):
    ms = 1000 * np.array(seconds)
    print(f"{name:6}  median {np.median(ms):6.1f} ms   p90 {np.percentile(ms, 90):6.1f} ms   worst {ms.max():6.1f} ms")


def asker(address):
    """A function (path, **words) that asks the server: seconds, and the answer's bytes."""
    base = address.partition("/?")[0]
    opener = urllib.request.build_opener(urllib.request.HTTPCookieProcessor(CookieJar()))
    opener.open(address).read()

    def timed(path, **words):
        begun = time.perf_counter()
        content = opener.open(f"{base}{path}?{urlencode(words)}").read()
        return time.perf_counter() - begun, content

    return timed


def answers(address):
    """The times of the server's answers."""
    timed = asker(address)
    cameras = [(walk, f"cam0{number}") for walk in ("indoor_01", "outdoor_01") for number in range(1, 5)]
    report("index", [timed("/api/recording", walk=walk, camera=camera)[0] for walk, camera in cameras])
    generator = np.random.default_rng(1)
    numbers = generator.permutation(len(cameras) * FRAMES)[:DRAWN]
    wanted = [(*cameras[number // FRAMES], number % FRAMES) for number in numbers.tolist()]
    for name, small in (("frame", 0), ("again", 0), ("small", 1)):
        times = [timed("/picture", walk=w, camera=c, frame=f, small=small) for w, c, f in wanted]
        report(name, [one for one, _ in times])
        print(f"        {np.mean([len(content) for _, content in times]) / 1e3:.0f} kB each")


def over_a_line(address):
    """Pictures a second while the slider is dragged, and the wait for the whole one."""
    with browser.opened() as chromium:
        context = chromium.new_context(viewport={"width": 1440, "height": 900})
        page = context.new_page()
        page.goto(address)
        context.new_cdp_session(page).send("Network.emulateNetworkConditions", LINE)
        page.goto(address.partition("/?")[0] + "/frames?walk=indoor_01&camera=cam01")
        browser.until_shown(page, 0)
        shown, waited = page.evaluate(
            """(seconds) => new Promise((done) => {
              const slider = document.querySelector("#frame"), place = document.querySelector("#picture");
              const seen = new Set();
              new MutationObserver(() => seen.add(place.dataset.frame)).observe(place, { attributes: true });
              const begun = performance.now();
              const timer = setInterval(() => {
                const part = (performance.now() - begun) / 1000 / seconds;
                slider.value = Math.min(part, 1) * slider.max;
                slider.dispatchEvent(new Event("input"));
                if (part < 1) return;
                clearInterval(timer);
                const [count, stopped] = [seen.size, performance.now()];
                slider.dispatchEvent(new Event("change"));
                const whole = setInterval(() => {
                  if (place.dataset.frame !== slider.value || place.dataset.small !== "false") return;
                  clearInterval(whole);
                  done([count, performance.now() - stopped]);
                }, 5);
              }, 16);
            })""",
            DRAGGED_S,
        )
        rate = shown / DRAGGED_S
        print(f"line    {rate:.1f} pictures a second while dragged, the whole one after {waited:.0f} ms")
        context.close()


def nudged(folder, practice):
    """The times from a key to the skeletons that it has moved."""
    project = copied(folder, practice, "nudged")
    browser.solved(project, "marks", "boxes")
    browser.run(project)
    with browser.served(project) as address, browser.opened() as chromium:
        with browser.page(chromium, address, "/long-range") as page:
            nudging.opened(page)
            report("nudge", [ms / 1000 for ms in nudging.redraws(page)])


def live(project):
    """The times of the answers to growing marks of a camera."""
    path = project / f"config/sessions/lab/{MARKED}.marks.csv"
    header, *rows = (project / f"solution/sessions/lab/{MARKED}.marks.csv").read_text().splitlines()
    own, pose, clock = {"walk": "indoor_01", "camera": MARKED}, [], []
    with browser.served(project) as address:
        timed = asker(address)
        timed("/api/marks/pose", **own, frame=0)  # what is read once
        for count in range(4, min(len(rows), MOST_MARKS) + 1):
            path.write_text("\n".join([header, *rows[:count]]) + "\n")
            frame = rows[count - 1].split(",")[1]
            seconds, content = timed("/api/marks/pose", **own, frame=frame)
            pose.append(seconds)
            if json.loads(content)["unfinished"]:
                clock.append(timed("/api/marks/pose", **own, frame=frame, full=1)[0])
    report("pose", pose)
    report("clock", clock)


def copied(folder, practice, name):
    return Path(shutil.copytree(practice, Path(folder) / name))


def main():
    kinds = sys.argv[1:] or KINDS
    if not set(kinds) <= set(KINDS):
        sys.exit(__doc__)
    with tempfile.TemporaryDirectory() as folder:
        practice = browser.practice(Path(folder) / "practice")
        if "pictures" in kinds:
            with browser.served(copied(folder, practice, "pictures")) as address:
                answers(address)
                over_a_line(address)
        if "keystrokes" in kinds:
            keystrokes.print_boxes(partial(copied, folder, practice))
            keystrokes.print_marks(partial(copied, folder, practice))
        if "nudge" in kinds:
            nudged(folder, practice)
        if "live" in kinds:
            live(copied(folder, practice, "live"))


if __name__ == "__main__":
    main()
