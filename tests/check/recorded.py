"""Recordings for the project of tests/project/test_project.py: an indoor walk and two outdoors, of few pictures."""

import json
import shutil
from dataclasses import replace

import numpy as np

from dior.body.names import MLKIT_33
from tests.ingest.bagfiles import T0, encoded, info, packed, picture, write
from tests.ingest.c3d_files import PLACES, c3d_bytes, person
from tests.project.test_project import edit

COUNT, STEP = 40, 33_333_333
SIZE = (48, 64)
COLOUR, FAR, LAB = "/cam0{}/color/image_raw/compressed", "/cam03/image", "/cam01/image"
NO_DISTORTION = (0.0,) * 5


def bag(path, topics, start_s=0.0, size=SIZE, count=COUNT, stamped=True, lenses=True, form="ros1"):
    """A bag of some cameras, and of their `lenses`; of ROS 1, or of another of `bagfiles.FORMATS`."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.unlink(missing_ok=True)
    shown = {"format": "jpeg", "data": encoded(picture(90, size), ".jpg")}
    sent = []
    for i in range(count):
        stamp = T0 + round(1e9 * start_s) + i * STEP
        for topic in topics:
            sent.append(replace(packed(topic, stamp, np.zeros((2, 2, 3), np.uint8)), content=shown))
            if not stamped:
                sent[-1] = replace(sent[-1], stamp_ns=0)
            if not lenses:
                continue
            lens = topic.removesuffix("/compressed").rpartition("/")[0] + "/camera_info"
            sent.append(info(lens, stamp, NO_DISTORTION, size=size))
    return write(path.with_suffix(""), sent, form, chunk=20_000)


def detections(path, first=0, count=COUNT, start_s=0.0):
    """ML Kit's lines, for a bag that began at `start_s`."""
    path.parent.mkdir(parents=True, exist_ok=True)
    body = [{"type": i, "x": 20.0 + i, "y": 10.0 + i, "inFrameLikelihood": 0.9} for i in range(len(MLKIT_33))]
    begun = T0 + round(1e9 * start_s)
    lines = [{"frame": i, "stamp_ns": begun + i * STEP, "landmarks": body} for i in range(first, first + count)]
    path.write_text("".join(json.dumps(line) + "\n" for line in lines))


def c3d(path, labels=tuple(PLACES), **more):
    path.write_bytes(c3d_bytes(list(labels), 1000 * person(labels, 130), **more))


def of_project(root, data):
    """The project in `root` (tests/project/test_project.py) with its recordings, `record`ed in the folder `data`."""
    shutil.copytree(data, root / "data")
    edit(root, "config.yaml", "triangulate:", "adjust: {min_views: 2}\ntriangulate:")
    edit(root, "sessions/lab/cam01.marks.csv", "in_1,3,LASI", "in_1,3,RASI,12,30\nin_1,9,RASI,13,31\nin_1,3,LASI")
    return root


def record(data):
    """All that the sheet names."""
    bag(data / "in_1/a.bag", [LAB])
    c3d(data / "in_1/mocap.c3d")
    captures = [{"event": "start", "name": "walk 3", "start_ns": T0}]
    (data / "in_1/trigger.jsonl").write_text("".join(json.dumps(one) + "\n" for one in captures))
    for walk in ("out_1", "out_2"):
        bag(data / walk / "a.bag", [COLOUR.format(1), FAR])
        bag(data / walk / "b.bag", [COLOUR.format(2)], 0.2)
        for camera, start_s in (("cam01", 0.0), ("cam02", 0.2)):
            detections(data / walk / "mlkit" / f"{camera}.jsonl", start_s=start_s)
