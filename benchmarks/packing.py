"""How fast a release is packed, and how long the labels of a dataset of DIOR's size take.

`python -m benchmarks.packing [GB]` (default 2) in a temporary folder, three times that size:
1. the tarball of a subject with files of bytes that, like JPEG, do not compress, beside `cp` plus sync and beside
   SHA-256 of the same files, in turns; the tarball's speed must be 70 % of the slower of the two or more.
"""

import hashlib
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from dior.release import sums, tarballs

ROUNDS = 5
WHO = "zebra-0001"
SHARDS = 8
LIMIT = 0.7


def release(folder, size):
    """A release of one subject with `size` bytes of pictures."""
    rng = np.random.default_rng(0)
    for i in range(SHARDS):
        path = folder / f"frames/{WHO}/walk_{i:02d}.cam01.parquet"
        path.parent.mkdir(parents=True, exist_ok=True)
        with open(path, "wb") as stream:
            for _ in range(size // SHARDS >> 20):
                stream.write(rng.bytes(1 << 20))
    (folder / "README.md").write_text("a release\n")
    sums.write(folder)
    subprocess.run(["sync", *folder.rglob("*")], check=True)
    return folder


def copied(folder, out):
    """`cp` and then sync of what was copied."""
    subprocess.run(["cp", "-r", folder, out], check=True)
    subprocess.run(["sync", *out.rglob("*")], check=True)


def hashed(folder, out):
    for path in sorted(folder.rglob("*.parquet")):
        with open(path, "rb") as stream:
            hashlib.file_digest(stream, "sha256")


def packed(folder, out):
    tarballs.run(release=folder, subject=WHO, out=out)


WAYS = {"cp and sync": copied, "SHA-256": hashed, "tarball": packed}


def seconds(folder, out):
    """Medians over alternating rounds, by way."""
    took = {name: [] for name in WAYS}
    for _ in range(ROUNDS):
        for name, way in WAYS.items():
            began = time.monotonic()
            way(folder, out)
            took[name].append(time.monotonic() - began)
            shutil.rmtree(out) if out.is_dir() else out.unlink(missing_ok=True)
    return {name: statistics.median(times) for name, times in took.items()}


def main():
    size = int(float(sys.argv[1] if sys.argv[1:] else 2) * 1e9)
    with tempfile.TemporaryDirectory(prefix="dior-packing-") as name:
        folder = release(Path(name) / "dior-0.1.0", size)
        took = seconds(folder, Path(name) / "out")
    for name, median in took.items():
        print(f"{name:<14}{median:>8.2f} s{size / median / 1e6:>8.0f} MB/s")
    ratio = max(took["cp and sync"], took["SHA-256"]) / took["tarball"]
    print(f"tarball at {100 * ratio:.0f} % of the slower of the two (at least {100 * LIMIT:.0f} %)")


if __name__ == "__main__":
    main()
