"""How fast detections are read: the real files of ../shared/data/real_outdoor, repeated, from the page cache.

usage: python -m benchmarks.ingest_detections [DATA]      (DATA: ../shared/data/real_outdoor)

Megabytes of the files per second of processor time, so that what else runs on the machine counts little, and per second
of the clock; the best of several rounds. OpenPose writes a file per picture, and those of this recording are 1.3 kB
small: what only opening and reading them takes is printed beside it.
"""

import os
import re
import sys
import tempfile
import time
from pathlib import Path

from dior.ingest.readers import mlkit, openpose

ROOT = Path(__file__).resolve().parents[1]
CAMERAS = ("cam01", "cam02", "cam03", "cam04")
LIMIT = 150
LINES, FILES, ROUNDS = 36_000, 20_000, 5


def write_mlkit(data, path):
    """The four cameras' lines in turn as one long recording; returns its size, bytes."""
    lines = [line for camera in CAMERAS for line in (data / f"mlkit/{camera}.jsonl").read_text().splitlines()]
    head = re.compile(r'"frame": \d+, "stamp_ns": \d+')
    with open(path, "w") as stream:
        for frame in range(LINES):
            line = lines[frame % len(lines)]
            stream.write(
                head.sub(f'"frame": {frame}, "stamp_ns": {1_708_000_000 * 10**9 + frame}', line, count=1) + "\n"
            )
    return path.stat().st_size


def write_openpose(data, folder):
    """The four cameras' files in turn as one long recording; returns their size, bytes."""
    texts = [file.read_bytes() for camera in CAMERAS for file in sorted((data / "openpose" / camera).glob("*.json"))]
    folder.mkdir()
    for frame in range(FILES):
        (folder / f"cam01_{frame:012d}_keypoints.json").write_bytes(texts[frame % len(texts)])
    return sum(len(texts[frame % len(texts)]) for frame in range(FILES))


def only_read(folder):
    for name in os.listdir(folder):
        file = os.open(f"{folder}/{name}", os.O_RDONLY)
        os.read(file, openpose.READ_AT_ONCE)
        os.close(file)


def rates(function, path, size):
    """(MB per second of processor time, of the clock), the best of ROUNDS."""
    measured = []
    for _ in range(ROUNDS):
        clock, processor = time.perf_counter(), time.process_time()
        function(path)
        measured.append((time.process_time() - processor, time.perf_counter() - clock))
    return tuple(size / 1e6 / min(times) for times in zip(*measured, strict=True))


def print_detections(data):
    """Print a row per format: MB/s, beside the limit."""
    with tempfile.TemporaryDirectory() as folder:
        lines, files = Path(folder) / "mlkit.jsonl", Path(folder) / "openpose"
        rows = [("ML Kit JSON lines", mlkit.read, lines, write_mlkit(data, lines), LIMIT)]
        size = write_openpose(data, files)
        rows += [
            ("OpenPose", openpose.read, files, size, LIMIT),
            ("  opening and reading only", only_read, files, size, ""),
        ]
        print(f"{'detections, MB/s':<32}{'per core':>10}{'clock':>10}{'at least':>10}")
        for name, function, path, size, limit in rows:
            processor, clock = rates(function, path, size)
            print(f"{name:<32}{processor:>10.0f}{clock:>10.0f}{limit:>10}")


if __name__ == "__main__":
    print_detections(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT.parent / "shared/data/real_outdoor")
