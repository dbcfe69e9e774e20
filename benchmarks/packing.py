"""How fast a release is packed, and how long the labels of a dataset of DIOR's size take.

`python -m benchmarks.packing [bytes|labels] [GB]` (both; default 2 GB) in a temporary folder of up to three times that:
bytes   the tarball of a subject with files of bytes that, like JPEG, do not compress, beside `cp` plus sync and beside
        SHA-256 of the same files, in turns; its speed must be at least 70 % of the slower of the two.
labels  a release of 112 walks seen by 4 cameras in 3600 frames each (33 joints outdoors, 39 markers indoors, 3D,
        detections, no pictures) and all its tarballs; must take less than 2 minutes on 2 cores. Then verify.
Wall seconds; where other jobs are running (the load is printed), CPU seconds tell more.
"""

import hashlib
import json
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from dior.body.names import MLKIT_33
from dior.geometry import camera_tables
from dior.geometry.camera import Camera, Intrinsics
from dior.project import project as projects
from dior.release import checksums, package, tarballs
from dior.release.verify import verify
from dior.simulate import config, settings
from dior.tables import tables

ROUNDS = 5
WHO = "zebra-0001"
SHARDS = 8
LEAST_RATIO, MOST_S = 0.7, 120
# 112 walks
PEOPLE, WALKS, FRAMES = 14, 4, 3600
MARKERS = tuple(f"marker_{i:02d}" for i in range(39))


def bytes_of_pictures(folder, size):
    """A release of one subject with `size` bytes of pictures."""
    rng = np.random.default_rng(0)
    for i in range(SHARDS):
        path = folder / f"frames/{WHO}/walk_{i:02d}.cam01.parquet"
        path.parent.mkdir(parents=True, exist_ok=True)
        with open(path, "wb") as stream:
            for _ in range(size // SHARDS >> 20):
                stream.write(rng.bytes(1 << 20))
    (folder / "README.md").write_text("a release\n")
    checksums.write(folder)
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


def measure_bytes(root, size):
    """Print medians over rounds in which the ways take turns."""
    folder, out = bytes_of_pictures(root / "dior-0.1.0", size), root / "out"
    took = {name: [] for name in WAYS}
    for _ in range(ROUNDS):
        for name, way in WAYS.items():
            began = time.monotonic()
            way(folder, out)
            took[name].append(time.monotonic() - began)
            shutil.rmtree(out) if out.is_dir() else out.unlink(missing_ok=True)
    median = {name: statistics.median(times) for name, times in took.items()}
    for name, seconds in median.items():
        print(f"{name:<14}{seconds:>8.2f} s{size / seconds / 1e6:>8.0f} MB/s")
    ratio = max(median["cp and sync"], median["SHA-256"]) / median["tarball"]
    print(f"tarball at {100 * ratio:.0f} % of the slower of the two (at least {100 * LEAST_RATIO:.0f} %)")


def wander(rng, *shape, step):
    """float32 (..., frames first): a random walk, as labels are, which zstd finds little in."""
    return np.cumsum(rng.normal(0, step, shape), axis=0).astype(np.float32)


KINDS = (
    "labels", "pixels", "covers", "skeletons", "frames", "detections", "clocks", "quantiles", "provenance",
)  # fmt: skip


class Sources:
    """The tables of a project of DIOR's size, as the steps leave them; `results` is their folder."""

    def __init__(self, root):
        config.write(settings.from_dict({"subjects": PEOPLE, "sequences": WALKS}), root / "config")
        self.project, self.results = projects.load(root), root / "results"
        self.rng = np.random.default_rng(0)
        self.files = {name: [] for name in KINDS}
        for sequence in self.project.sequences:
            self._walk(sequence)

    def _table(self, what, step, unit, name, columns):
        path = self.results / f"{step}/{unit}.parquet"
        tables.write(path, name, columns)
        self.files[what].append(path)

    def _walk(self, sequence):
        who, cameras = self.project.subject_of(sequence), self.project.cameras_of(sequence)
        joints = MARKERS if self.project.indoor(sequence) else MLKIT_33
        stamps = 10**18 + np.arange(FRAMES) * 10**9 // 30
        words = {"subject": who, "sequence": sequence}
        for camera in cameras:
            unit = f"{sequence}.{camera}"
            self._table(
                "labels", "reproject", unit, "labels_2d", self._labels(words | {"camera": camera}, joints, stamps)
            )
            shown = {**words, "camera": camera}
            self._table("pixels", "pixels", unit, "released_frames", self._pictures(shown, stamps))
        self._table("skeletons", "refine", sequence, "skeletons_3d", self._skeleton(words, joints, stamps))
        each = {"camera": tables.Repeated(cameras, np.repeat(np.arange(len(cameras)), FRAMES))}
        numbers = {"frame": np.tile(np.arange(FRAMES), len(cameras)), "stamp_ns": np.tile(stamps, len(cameras))}
        self._table("frames", "frames", sequence, "frames", each | numbers)
        self._table("detections", "detections", sequence, "detections", self._detections(cameras[:3], stamps))
        none = {"sequence": [sequence] * len(cameras), "camera": cameras, "offset_s": np.zeros(len(cameras))}
        self._table("clocks", "clocks", sequence, "offsets", none | {"source": ["reference"] * len(cameras)})
        path = self.results / f"provenance/{sequence}.json"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps({"bag_1": {"sha256": "0" * 64, "bytes": 1}}))
        self.files["provenance"].append(path)

    def _labels(self, words, joints, stamps):
        shape = (FRAMES, len(joints))
        floats = {key: wander(self.rng, *shape, step=1).ravel() for key in ("rho_uv", "depth")}
        floats |= {key: wander(self.rng, *shape, step=1).ravel() % 700 for key in ("u", "v")}
        floats |= {key: np.abs(wander(self.rng, *shape, step=0.01)).ravel() for key in ("sigma_u", "sigma_v")}
        return {
            **repeated(words, FRAMES * len(joints)),
            **grid("frame", joints, stamps),
            **floats,
            "status": tables.Repeated(["ok", "occluded"], self.rng.integers(0, 2, FRAMES * len(joints))),
            "source": tables.Repeated(["mocap"], np.zeros(FRAMES * len(joints), int)),
        }

    def _skeleton(self, words, joints, stamps):
        n = FRAMES * len(joints)
        names = "x y z sigma_x sigma_y sigma_z rho_xy rho_xz rho_yz residual_px".split()
        floats = {key: wander(self.rng, FRAMES, len(joints), step=0.01).ravel() for key in names}
        status = {"n_views": np.full(n, 3), "status": tables.Repeated(["ok"], np.zeros(n, int))}
        return {**repeated(words, n), **grid("instant", joints, stamps), **floats, **status}

    def _pictures(self, words, stamps):
        none = {
            "image": np.full(FRAMES, None, object),
            "no_image": tables.Repeated(["no_consent"], np.zeros(FRAMES, int)),
        }
        size = {"height": np.full(FRAMES, 720), "width": np.full(FRAMES, 1280)}
        return {**repeated(words, FRAMES), "frame": np.arange(FRAMES), "stamp_ns": stamps, **size, **none}

    def _detections(self, cameras, stamps):
        n, each = FRAMES * len(MLKIT_33), len(cameras)
        one = grid("frame", MLKIT_33, stamps)
        floats = {key: wander(self.rng, n * each, step=1) for key in ("u", "v", "score")}
        return {
            "camera": tables.Repeated(cameras, np.repeat(np.arange(each), n)),
            "joint": tables.Repeated(MLKIT_33, np.tile(one["joint"].index, each)),
            **{key: np.tile(one[key], each) for key in ("frame", "stamp_ns")},
            "person": np.zeros(n * each, int),
            **floats,
        }

    def cameras(self):
        """A table of cameras for each session."""
        lens, paths = Intrinsics(1280, 720, 640.0, 640.0, 639.5, 359.5), []
        for session in self.project.sessions:
            paths.append(self.results / f"cameras/{session}.parquet")
            rig = self.project.cameras(session).items()
            camera_tables.write_cameras(
                paths[-1], [Camera(n, lens, np.eye(4), how["role"], "tape") for n, how in rig], session
            )
        return paths


def repeated(words, length):
    return {key: tables.Repeated([word], np.zeros(length, int)) for key, word in words.items()}


def grid(key, joints, stamps):
    """The columns of complete rows, by frame or instant and joint."""
    count, each = len(stamps), len(joints)
    return {
        "joint": tables.Repeated(joints, np.tile(np.arange(each), count)),
        key: np.repeat(np.arange(count), each),
        "stamp_ns": np.repeat(stamps, each),
    }


@contextmanager
def told(what):
    """Print what a block took."""
    wall, cpu = time.monotonic(), time.process_time()
    yield
    wall, cpu = time.monotonic() - wall, time.process_time() - cpu
    print(f"{what:<22}{wall:>8.1f} s{cpu:>8.1f} CPU s", flush=True)


def measure_labels(root):
    sources = Sources(root)
    out = root / "results/release/dior-0.1.0"
    began = time.monotonic()
    with told("package"):
        package.run(
            project=root, config=None, of_walks=package.WalkFiles(**sources.files),
            of_cameras=package.CameraFiles(marks=[], cameras=sources.cameras(), covariances=[]), metrics=[],
            findings=[], gallery=None, steps={}, out=out,
        )  # fmt: skip
    with told("tarballs"):
        for part in [*sources.project.released_subjects, checksums.METADATA]:
            tarballs.run(release=out, subject=part, out=out.with_name(f"{out.name}-{part}.tar"))
    size = sum(path.stat().st_size for path in out.rglob("*") if path.is_file())
    seconds = time.monotonic() - began
    print(
        f"labels of {len(sources.project.sequences)} walks, {size / 1e9:.2f} GB: {seconds:.0f} s (at most {MOST_S} s)"
    )
    with told("verify"):
        verify.run(paths=[out])


def main():
    kinds = [word for word in sys.argv[1:] if word in ("bytes", "labels")] or ["bytes", "labels"]
    size = next((int(float(word) * 1e9) for word in sys.argv[1:] if word not in kinds), 2 * 10**9)
    print(f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    for kind in kinds:
        with tempfile.TemporaryDirectory(prefix="dior-packing-") as name:
            measure_bytes(Path(name), size) if kind == "bytes" else measure_labels(Path(name))


if __name__ == "__main__":
    main()
