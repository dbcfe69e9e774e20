"""Recordings of a few dozen tiny pictures, and the files that lie beside them."""

import json

from dior.body.names import MLKIT_33
from tests.ingest import bagfiles, c3d_files

T0, S = bagfiles.T0, 10**9
COUNT, RATE_HZ = 40, 10
PICTURE = bagfiles.picture(100)


def bag(
    path, cameras, start_s=0.0, count=COUNT, topic="/{}/image_raw/compressed", form="ros1", d=(0.0,) * 5, focal_px=600
):
    """A bag of the pictures and the lens of some cameras; `path` without a suffix. Returns the bag."""
    path.parent.mkdir(parents=True, exist_ok=True)
    messages, jpeg = [], bagfiles.encoded(PICTURE, ".jpg")
    for camera in cameras:
        name = topic.format(camera)
        first = T0 + round(start_s * S)
        lens = name.removesuffix("/compressed").rpartition("/")[0] + "/camera_info"
        info = bagfiles.info(lens, first, d=d)
        info.content["k"][:5:4] = focal_px
        messages.append(info)
        for i in range(count):
            stamp = first + i * S // RATE_HZ
            messages.append(
                bagfiles.Sent(name, stamp + 4_000_000, stamp, bagfiles.PACKED, {"format": "x", "data": jpeg})
            )
    return bagfiles.write(path, sorted(messages, key=lambda one: one.receive_ns), form)


def pictures(folder, cameras, count=30):
    """A folder of pictures per camera, no two of which are the same."""
    jpeg = bagfiles.encoded(PICTURE, ".jpg").tobytes()
    for camera in cameras:
        (folder / camera).mkdir(parents=True)
        for i in range(count):
            # behind the end of a JPEG anything may stand
            (folder / f"{camera}/{i:03d}.jpg").write_bytes(jpeg + f"{folder}/{camera}".encode())


def mlkit(path, height_px=40.0, count=COUNT, first_ns=None, rate_hz=RATE_HZ, nobody=False):
    """ML Kit's lines of somebody who is so tall; `first_ns`: the stamp of the first picture, none without it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    lines = []
    for i in range(count):
        joints = [
            {"type": j, "x": 20.0 + j, "y": 2 + height_px * j / (len(MLKIT_33) - 1), "z": 0.0, "inFrameLikelihood": 0.9}
            for j in range(len(MLKIT_33))
        ]
        stamp = {} if first_ns is None else {"stamp_ns": first_ns + i * S // rate_hz}
        lines.append(json.dumps({"frame": i, **stamp, "landmarks": [] if nobody else joints}))
    path.write_text("\n".join(lines) + "\n")


def c3d(path, prefix="", labels=("LASI", "RASI", "LPSI", "RPSI", "LKNE")):
    """Motion capture of some markers."""
    path.parent.mkdir(parents=True, exist_ok=True)
    names = [f"{prefix}{label}" for label in labels]
    path.write_bytes(c3d_files.c3d_bytes(names, 1000 * c3d_files.person(names, 50)))


def outdoor(folder, walk, start_s=0.0, cameras=("cam01", "cam02"), far="cam03", **how):
    """`<walk>/pc1.bag` and `pc2.bag`, with detections: nobody in the camera `far`."""
    bag(folder / walk / "pc1", cameras, start_s, **how)
    if far:
        bag(folder / walk / "pc2", [far], start_s, **how)
    for camera in (*cameras, *([far] if far else [])):
        mlkit(folder / walk / f"mlkit/{camera}.jsonl", nobody=camera == far)
