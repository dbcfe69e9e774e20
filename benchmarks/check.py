"""How long `dior check` takes for a large project: 112 walks of two minutes of eight cameras.

usage: python -m benchmarks.check [FORM ...]      (ros1, mcap, db3; default: ros1)

A walk has 3600 pictures of each camera, 30 a second, and as many CameraInfo: in a bag per camera, 896 in all, and then
in one bag per walk. The pictures have 128x72 px, some hundred bytes of JPEG; a bag is cut into a chunk per eight of
them, as rosbag cuts those of 100 kB a picture, so that its index is as long as a real one. Half of the walks are
indoors with a C3D, all have ML Kit's detections. Each file is written once and linked for the other walks: the disk's
cache holds it, and what is measured is the processor's part. Wall and CPU seconds of the whole command, its start
included.
"""

import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from dior.project.schema_check import columns_of
from tests.check import recorded
from tests.ingest.bagfiles import T0, encoded, info, packed, write

ROOT = Path(__file__).resolve().parents[1]
WALKS, CAMERAS, PICTURES, STEP_NS = 112, 8, 3600, 33_333_333
SIZE, IN_A_CHUNK = (72, 128), 8
NAMES = [f"cam{number:02d}" for number in range(1, CAMERAS + 1)]
SHEET = (
    "sequence session_order subject session environment outfit walk bags mocap detections trigger_log exclude_reason"
)


def bag(path, names, form):
    """A bag of some cameras, each with its lens."""
    shown = encoded(np.zeros((*SIZE, 3), np.uint8), ".jpg")
    stamps = [T0 + i * STEP_NS for i in range(PICTURES)]
    sent = (
        one
        for stamp in stamps
        for name in names
        for one in (_picture(f"/{name}/image/compressed", stamp, shown), _lens(f"/{name}/camera_info", stamp))
    )
    return write(path, sent, form, chunk=IN_A_CHUNK * (len(shown) + 600))


def _picture(topic, stamp, shown):
    one = packed(topic, stamp, np.zeros((2, 2, 3), np.uint8))
    one.content["data"] = shown
    return one


def _lens(topic, stamp):
    return info(topic, stamp, recorded.NO_DISTORTION, size=SIZE)


def linked(source, target):
    """The same file or folder under another name."""
    target.parent.mkdir(parents=True, exist_ok=True)
    if source.is_file():
        os.link(source, target)
    else:
        target.mkdir()
        for file in source.iterdir():
            os.link(file, target / file.name)


def project(folder, bags):
    """A project whose walks have these `bags`, each a path that is linked."""
    masters = folder / "masters"
    recorded.detections(masters / "mlkit.jsonl", count=PICTURES)
    recorded.c3d(masters / "mocap.c3d")
    rows = ["\t".join(columns_of("sequences"))]
    for number in range(WALKS):
        walk, indoor = f"walk_{number:03d}", number % 2 == 0
        for path in bags:
            linked(path, folder / "data" / walk / path.name)
        for name in NAMES:
            linked(masters / "mlkit.jsonl", folder / "data" / walk / "mlkit" / f"{name}.jsonl")
        linked(masters / "mocap.c3d", folder / "data" / walk / "mocap.c3d")
        place = ["lab", "indoor"] if indoor else ["field", "outdoor"]
        named = ";".join(f"{walk}/{path.name}" for path in bags)
        files = [named, f"{walk}/mocap.c3d" if indoor else "", f"{walk}/mlkit/{{camera}}.jsonl", "", ""]
        rows.append("\t".join([walk, str(number), "S01", *place, "", "", *files]))
    texts = {"sequences.tsv": "\n".join(rows), "config.yaml": "data_root: data"}
    texts["subjects.tsv"] = "subject\tpseudonym\theight_m\theight_sigma_m\tconsent_release\nS01\tzebra-0001\t\t\tyes"
    for session, first, adjust in (
        ("lab", "walk_000", ""),
        ("field", "walk_001", "\nadjust: {walk_001: {count: 100}}"),
    ):
        texts[f"sessions/{session}/session.yaml"] = f"cameras: [{', '.join(NAMES)}]{adjust}"
        for at, name in enumerate(NAMES):
            where = f"role: close\nlocate: tape\ntape: {{position_m: [{at + 3}, 0, 1.5]}}"
            if session == "lab":
                where = "role: close\nlocate: marks"
                marks = "".join(f"{first},{frame},LASI,10,20\n" for frame in (3, 900, 1800, 3599))
                texts[f"sessions/{session}/{name}.marks.csv"] = f"sequence,frame,joint,u,v\n{marks}"
            texts[f"sessions/{session}/{name}.yaml"] = f"topic: /{name}/image/compressed\n{where}"
    for name, text in texts.items():
        path = folder / "config" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f"{text}\n")


def checked(folder):
    """(wall s, CPU s) of the best of three calls; prints what the first says."""
    times = []
    for number in range(3):
        begun, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
        command = [sys.executable, "-m", "dior", "check", str(folder)]
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        cpu_s = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        times.append((time.perf_counter() - begun, cpu_s))
        if done.returncode:
            sys.exit(done.stdout + done.stderr)
        if not number:
            print("  " + done.stdout.splitlines()[1])
    return min(times)


def main():
    for form in sys.argv[1:] or ["ros1"]:
        for what, groups in (("a bag per camera", [[name] for name in NAMES]), ("a bag per walk", [NAMES])):
            with tempfile.TemporaryDirectory() as temporary:
                folder = Path(temporary)
                (folder / "bags").mkdir()
                bags = [bag(folder / "bags" / group[0], group, form) for group in groups]
                project(folder, bags)
                print(f"{form}, {what}: {len(bags) * WALKS} bags")
                wall_s, cpu_s = checked(folder)
                print(f"  {wall_s:.1f} s, {cpu_s:.1f} s of CPU", flush=True)


if __name__ == "__main__":
    main()
