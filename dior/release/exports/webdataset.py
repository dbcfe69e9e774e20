"""WebDataset: the released pictures with their labels, in tar files that are read from front to back.

OUTPUTS  webdataset/dior-<number>.tar, one per recording: <key>.jpg and <key>.json per picture; webdataset/shards.csv
A picture that was not released (see its `no_image` in the release) has no sample.
"""

import json
import tarfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from dior.errors import DiorError
from dior.release.exports import coco, recordings
from dior.release.exports.poses import AddRecording, Pose
from dior.release.exports.recordings import Recording, Release
from dior.release.exports.writing import add_to_tar, write_csv
from dior.tables.words import LABEL_STATUS

ABOUT = """\
`webdataset/dior-<number>.tar`: a shard per recording (`webdataset/shards.csv` says which) with a sample per released
picture: `jpg`, byte for byte that of the release, and `json`: the `image` and the `annotation` as in the export `coco`
(null where no joint is in the picture; their ids count within the shard), and `labels`: every joint of the release as
[u, v, status], also those that are no COCO keypoints. The key is <subject>/<sequence>_<camera>_<frame>.

`webdataset.WebDataset("webdataset/dior-{000000..000015}.tar").decode("pil").to_tuple("jpg", "json")`
"""
COLUMNS = "shard samples subject sequence camera part".split()


@contextmanager
def writer(folder: Path, release: Release) -> Iterator[AddRecording]:
    """Yield `add(recording, pose)`; `shards.csv` is written when the context ends."""
    folder.mkdir()
    rows: list[tuple[Any, ...]] = []

    def add(recording: Recording, pose: Pose, no_image: dict[int, str]) -> None:
        walk = recording.walk
        shard = f"dior-{len(rows):06d}.tar"
        samples = 0
        with tarfile.open(folder / shard, "w", format=tarfile.USTAR_FORMAT) as tar:
            for key, jpeg, label in _samples(recording, pose, no_image):
                add_to_tar(tar, f"{key}.jpg", jpeg)
                add_to_tar(tar, f"{key}.json", json.dumps(label, separators=(",", ":")).encode())
                samples += 1
        if not samples:
            (folder / shard).unlink()
            return
        rows.append((shard, samples, walk.subject, walk.sequence, recording.camera.name, recording.part))

    yield add
    write_csv(folder / "shards.csv", COLUMNS, rows)


def _samples(recording: Recording, pose: Pose, no_image: dict[int, str]) -> Iterator[tuple[str, bytes, dict[str, Any]]]:
    """(key, JPEG bytes, label) of every picture that was released."""
    images, annotations = coco.rows(recording, pose, no_image)
    by_image = {annotation["image_id"]: annotation for annotation in annotations}
    labels = recordings.labels_of(recording)
    row = {frame: i for i, frame in enumerate(labels.frame.tolist())}
    uv = coco.with_null(labels.uv)
    for frame, jpeg in recordings.pictures_of(recording):
        if frame not in row:
            raise DiorError(f"{recording.frames}: frame {frame} has no labels; build the release again")
        image, i = images[row[frame]], row[frame]
        every = {
            joint: [u, v, LABEL_STATUS[status]]
            for joint, (u, v), status in zip(labels.joints, uv[i], labels.status[i].tolist(), strict=True)
        }
        key = f"{recording.walk.subject}/{recording.walk.sequence}_{recording.camera.name}_{frame:06d}"
        yield key, jpeg, {"image": image, "annotation": by_image.get(image["id"]), "labels": every}
