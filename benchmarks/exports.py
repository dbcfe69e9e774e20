"""Exports of a release: CPU time and bytes per picture or instant of each format, and of all in one call.

usage: python -m benchmarks.exports RELEASE      (a release folder, e.g. results/release/dior-0.1.0)

Each format is built in a process of its own, whose start-up (no format at all) is taken off; the best of three. What a
dataset of the paper's size would take is that times its 1 649 919 pictures; the 3D is counted by instants of the
release's walks, four pictures each (DIOR has four cameras a place).
"""

import resource
import subprocess
import sys
import tempfile
from pathlib import Path

from dior.release import exports
from dior.release.exports import recordings

DIOR_PICTURES = 847_193 + 802_726
BEST_OF = 3


def seconds(release, formats, out):
    """CPU seconds of `dior exports`, the best of three."""
    command = [
        sys.executable,
        "-m",
        "dior.cli.main",
        "exports",
        "--release",
        release,
        "--formats",
        *formats,
        "--out",
        out,
    ]
    best = float("inf")
    for _ in range(BEST_OF):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run(list(map(str, command)), check=True, stderr=subprocess.DEVNULL)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        best = min(best, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    return best


def main(folder):
    release = recordings.read(folder)
    pictures = sum(len(recordings.labels_of(recording).frame) for recording in release.recordings)
    instants = sum(len(recordings.body_of(walk).stamp_ns) for walk in release.walks)
    print(f"{len(release.recordings)} recordings, {pictures} pictures; {len(release.walks)} walks, {instants} instants")
    print("format        us each  bytes each  of            DIOR's size, minutes")
    with tempfile.TemporaryDirectory(dir=Path(folder).parent) as place:
        out = Path(place) / "out"
        start = seconds(folder, [], out)
        for formats in [[name] for name in exports.FORMATS] + [[n for n in exports.FORMATS if n != "webdataset"]]:
            spent = max(seconds(folder, formats, out) - start, 0.0)
            size = sum(path.stat().st_size for path in out.rglob("*") if path.is_file())
            of_walks = set(formats) <= set(exports.BY_WALK)
            count = instants if of_walks else pictures
            whole = spent / count * DIOR_PICTURES / 60 * (instants / pictures if of_walks else 1)
            name = formats[0] if len(formats) == 1 else "all but wds"
            what = "instants" if of_walks else "pictures"
            print(f"{name:12s} {1e6 * spent / count:8.1f} {size / count:11.0f}  {what:12s} {whole:8.2f}")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
