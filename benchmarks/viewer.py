"""How large the page is that shows a walk in 3D over time, and how soon a browser has it: 3600 instants, 8 cameras.

usage: python -m benchmarks.viewer [CAMERAS] [FOLDER]      (FOLDER for the tables and the pages; kept when given)

The tables and the pictures are made up (tests/report/walks.py). The time to open is that of Debian's Chromium without a
graphics card, from asking for the file until the slider works.
"""

import sys
import tempfile
import time
from pathlib import Path

from dior.ingest import bags
from dior.report import viewer
from tests.report import chromium, walks

FRAMES, CAMERAS = 3600, 8
LIMIT_BYTES, LIMIT_OPEN_S = 3e6, 3.0
READY = "document.querySelector('main')?.dataset.ready === 'yes'"


def made(folder, cameras):
    """The page and the CPU seconds that the step took."""
    given = walks.write(folder / "tables", cameras, FRAMES)
    out = folder / "report"
    beside = out / "assets" / walks.SEQUENCE
    bags.read_to_show = walks.pictures
    begun = time.process_time()
    viewer.run(**given, out=beside / "scene.js", out_pictures=beside / "pictures")
    taken = time.process_time() - begun
    return walks.write_page(out), taken


def size(folder):
    """(bytes, files) below a folder."""
    files = [path for path in folder.rglob("*") if path.is_file()]
    return sum(path.stat().st_size for path in files), len(files)


def opened(page, ready="document.readyState === 'complete'"):
    """Lines of the table on a page in Chromium: its elements, the time until it is ready, the memory of its scripts."""
    if chromium.program() is None:
        return ["| no Chromium here to open it with | | |"]
    with chromium.opened() as browser:
        browser.size(1440)
        browser.open(page, ready=ready)
        # once to start the browser, once to measure
        begun = time.perf_counter()
        browser.open(page, ready=ready)
        taken = time.perf_counter() - begun
        assert not browser.said, browser.said
        heap, elements = browser.call("Runtime.getHeapUsage"), browser.run("document.querySelectorAll('*').length")
    memory = heap["usedSize"] + heap.get("backingStorageSize", 0)
    return [
        f"| {page.name}, {page.stat().st_size / 1e3:.1f} kB, its elements | {elements} | |",
        f"| time to open | {taken:.2f} s | {LIMIT_OPEN_S:.0f} s |",
        f"| memory of its scripts | {memory / 1e6:.0f} MB | |",
    ]


def main(cameras=CAMERAS, folder=None):
    """Print the measured table."""
    if folder is None:
        with tempfile.TemporaryDirectory() as made_up:
            main(cameras, made_up)
        return
    page, cpu = made(Path(folder), int(cameras))
    out = page.parents[1]
    beside = out / "assets" / walks.SEQUENCE
    (own, files), (pictures, _), (shared, count) = size(beside), size(beside / "pictures"), size(out / "viewer")
    print(f"| a walk of {FRAMES} instants, {cameras} cameras | measured | limit |")
    print("|---|---|---|")
    print(f"| its files, {files} | {own / 1e6:.2f} MB | {LIMIT_BYTES / 1e6:.0f} MB |")
    print(f"| of these scene.js | {(own - pictures) / 1e6:.2f} MB | |")
    print(f"| shared by all walks, {count} files | {shared / 1e6:.2f} MB | |")
    print("\n".join(opened(page, READY)))
    print(f"| the step, CPU, without decoding pictures | {cpu:.1f} s | |")


if __name__ == "__main__":
    main(*sys.argv[1:3])
