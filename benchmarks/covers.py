"""Are covers told from what is below them, and what does covering a picture take?

usage: python -m benchmarks.covers PROJECT...      (folders of projects with a release and their recordings)
       python -m benchmarks.covers speed

By recording, of every third released picture with a cover: `covers`; `sound`: of what a cover shows, the most grey
levels beyond `cover_checks.TIMES` as much as encoding leaves over (`MORE` are allowed), and `alarms`: pictures that are
told of.
`bare`: pictures that are told of where the recorded picture is put in their place, encoded as they are; those in which
nothing but an even background is below the covers are not.

`speed`: CPU ms of a picture, the ways in turns in one run: `bare` transform (libjpeg-turbo reads and writes the
coefficients and nobody looks at them), `covered` in the coefficients, and its ratio to the bare one; `again`: decoded,
covered and encoded as a whole. Of pictures of some sizes in bytes, with a head, a far one, and a head and two others.
`reading`: a message of a bag of such pictures; `hashing`: SHA-256 of the file.
"""

import ctypes
import hashlib
import json
import os
import statistics
import sys
import tempfile
import time
from pathlib import Path

import cv2
import numpy as np
import pyarrow.parquet as pq
import yaml

from dior.ingest import bags
from dior.release import head_blur, jpeg, jpeg_covers, transform
from dior.release.jpeg_covers import Cover
from dior.release.verify import cover_checks
from dior.tables import tables

EVERY = 3
# (width, height, quality, sigma of the noise): of about 20, 50, 100 and 200 kB
PICTURES = ((640, 480, 60, 3), (1280, 720, 50, 3), (1280, 720, 75, 4), (1280, 720, 90, 5))
HEAD, FAR = Cover((400.0, 200.0, 464.0, 280.0), False), Cover((500.0, 200.0, 506.0, 207.0), False)
COVERS = {
    "a head": [HEAD],
    "a far head": [FAR],
    "a head and two others": [
        HEAD,
        Cover((40.0, 100.0, 120.0, 300.0), True),
        Cover((520.0, 240.0, 600.0, 400.0), True),
    ],
}
# ms, and of the bare transform
MOST_MS, MOST_TIMES, ROUNDS = 2.5, 1.3, 200


def beyond(data, covers, how):
    """By how much what each cover of a picture shows beside its cells is beyond what encoding these leaves, TIMES."""
    found, table = [], cover_checks.luma_table(data)
    for cover in cover_checks._covers(cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR), covers, how):
        left, means = cover.fitted(cover.part)
        coded = cover_checks.coded(cover.drawn(means), table)
        found.append(left - cover_checks.TIMES * cover.fitted(coded)[0])
    return found


def of_recording(project, release, path, how):
    """What is beyond of all covers, and the counts of pictures, of alarms and of those told of where they are bare."""
    sequence, camera = path.name.split(".")[:2]
    table = pq.read_table(path, columns=["frame", "image"])
    kept = {f: image["bytes"] for f, image in zip(*(c.to_pylist() for c in table.columns), strict=True) if image}
    kept = dict(list(kept.items())[::EVERY])
    covers = tables.read(release / "covers" / path.parent.name / path.name, "released_covers")
    by_frame = {frame: tables.rows(covers, covers["frame"] == frame) for frame in kept}
    index = tables.of_camera(tables.read(project / f"results/frames/{sequence}.parquet", "frames"), camera)
    index = tables.rows(index, np.isin(index["frame"], [frame for frame, own in by_frame.items() if len(own["frame"])]))
    data_root = project / yaml.safe_load((project / "config/config.yaml").read_text())["data_root"]
    found, counts = [], np.zeros(3, int)
    for row, picture in bags.read_pictures(index, data_root):
        frame = int(index["frame"][row])
        data, mine = kept[frame], by_frame[frame]
        found += beyond(data, mine, how)
        recorded = jpeg.encoded(picture, *jpeg.settings(data))
        counts += (1, cover_checks.shows(data, mine, how), cover_checks.shows(recorded, mine, how))
    return found, counts


def scene(wide, high, quality, noise):
    """JPEG bytes of a picture with edges and noise."""
    rng = np.random.default_rng(0)
    rough = cv2.resize(rng.integers(0, 256, (high // 40, wide // 40, 3), np.uint8), (wide, high), interpolation=2)
    noisy = (rough + rng.normal(0, noise, rough.shape)).clip(0, 255).astype(np.uint8)
    return cv2.imencode(".jpg", noisy, [cv2.IMWRITE_JPEG_QUALITY, quality])[1].tobytes()


def untouched(data):
    """The transform with nothing to do."""
    lib, out, size = transform.library(), ctypes.c_void_p(), ctypes.c_size_t()
    handle = lib.tj3Init(transform.INIT_TRANSFORM)
    lib.tj3Transform(handle, data, len(data), 1, out, size, transform._Transform(options=transform.COPY_NONE))
    found = ctypes.string_at(out.value, size.value)
    lib.tj3Free(out)
    lib.tj3Destroy(handle)
    return found


def again(data, covers):
    """Decoded, covered and encoded as a whole, as what is no JPEG of blocks is."""
    stripped, _ = jpeg.bare(data)
    picture = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION)
    for cover in covers:
        head_blur.cover(picture, cover.box, "blurred", cover.whole)
    return jpeg.encoded(picture, *jpeg.settings(stripped))


def in_turns(ways):
    """Median CPU ms of each way by name, over rounds in which they take turns."""
    took = {name: [] for name in ways}
    for way in ways.values():
        way()
    for _ in range(ROUNDS):
        for name, way in ways.items():
            began = time.process_time()
            way()
            took[name].append(1e3 * (time.process_time() - began))
    return {name: statistics.median(times) for name, times in took.items()}


def reading(data, count=200):
    """CPU ms of reading a message of a bag of such pictures."""
    from dior.ingest import frames
    from tests.ingest import bagfiles

    picture = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    with tempfile.TemporaryDirectory(prefix="dior-covers-") as name:
        root, topic = Path(name), "/cam01/image_raw/compressed"
        sent = [bagfiles.packed(topic, bagfiles.T0 + i * 33_000_000, picture[:16, :16], ".jpg") for i in range(count)]
        for message in sent:
            message.content["data"] = np.frombuffer(data, np.uint8)
        bag = bagfiles.write(root / "pc1", sent, "ros1")
        frames.run(sequence="walk", bags=[bag], data_root=root, topics={"cam01": topic}, out=root / "frames.parquet")
        rows = tables.of_camera(tables.read(root / "frames.parquet", "frames"), "cam01")
        began = time.process_time()
        read = sum(1 for _ in bags.read_messages(rows, root))
        return 1e3 * (time.process_time() - began) / read


def speed():
    cv2.setNumThreads(1)
    print(f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores; at most {MOST_MS} ms, {MOST_TIMES} of the bare")
    print(f"{'picture':<14}{'kB':>5}  {'covers':<23}{'bare':>6}{'covered':>9}{'ratio':>7}{'again':>7}")
    for wide, high, *how in PICTURES:
        data = scene(wide, high, *how)
        for name, covers in COVERS.items():
            ways = {
                "bare": lambda data=data: untouched(data),
                "covered": lambda data=data, covers=covers: jpeg_covers.covered(data, covers, "blurred"),
                "again": lambda data=data, covers=covers: again(data, covers),
            }
            ms = in_turns(ways)
            print(
                f"{f'{wide}x{high}':<14}{len(data) / 1e3:>5.0f}  {name:<23}{ms['bare']:>6.2f}{ms['covered']:>9.2f}"
                f"{ms['covered'] / ms['bare']:>7.2f}{ms['again']:>7.2f}"
            )
        hashing = in_turns({"sha": lambda data=data: hashlib.sha256(data).digest()})["sha"]
        print(f"{'':<21}reading {reading(data):.2f}, hashing {hashing:.2f}")


def main():
    if sys.argv[1:] == ["speed"]:
        return speed()
    print(f"{'recording':<28}{'pictures':>9}{'covers':>8}{'sound':>8}{'alarms':>8}{'bare':>7}")
    for project in map(Path, sys.argv[1:]):
        for about in sorted(project.glob("results/release/*/provenance.json")):
            how = json.loads(about.read_text())["config"]["release.faces"]
            for path in sorted(about.parent.glob("frames/*/*.parquet")) if how != "shown" else ():
                found, (pictures, alarms, bare) = of_recording(project, about.parent, path, how)
                if pictures:
                    name = path.name.removesuffix(".parquet")
                    print(f"{name:<28}{pictures:>9}{len(found):>8}{max(found):>8.2f}{alarms:>8}{bare / pictures:>7.0%}")


if __name__ == "__main__":
    main()
