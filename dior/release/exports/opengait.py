"""Pickles for OpenGait and FastPoseGait, and the lists of who is trained and tested on.

OUTPUTS  opengait/data/<subject>/<type>/<view>/<sequence>.<camera>.pkl: float32 (T, 17, 3) x, y, confidence;
         opengait/partition/<split>.json with TRAIN_SET and TEST_SET; opengait/sequences.csv: what is what
The loaders take every file of a view for another kind of data of the same frames; here there is one.
"""

import copyreg
import io
import pickle
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dior.release.exports.poses import AddRecording, Pose
from dior.release.exports.recordings import SUBJECT_SPLIT, Recording, Release
from dior.release.exports.writing import plain, write_csv, write_json

ABOUT = """\
`opengait/data/<subject>/<type>/<view>/<sequence>.<camera>.pkl`: one float32 array (T, 17, 3) per recording: x and y in
pixels of the recorded picture ((0, 0) is the centre of the top-left pixel), joints in COCO's order, and a confidence: 1
in the picture, 0 outside of it; a joint that is not known is 0, 0, 0. Pictures of which nothing is known are left out.
`type` is <environment>-<outfit>-<number of the walk>, `view` is <environment>-<camera>.
`opengait/partition/subject.json` has `TRAIN_SET` (train and val) and `TEST_SET`; the other splits have everybody in
`TEST_SET`, and [subject, type, view] of `GALLERY` and `PROBE`. `opengait/sequences.csv` says which recording is which.

`dataset_root: opengait/data`, `dataset_partition: opengait/partition/subject.json` in the `data_cfg` of a config
"""
COLUMNS = "subject type view sequence camera pictures kept".split()


@contextmanager
def writer(folder: Path, release: Release) -> Iterator[AddRecording]:
    """Yield `add(recording, pose)`; the lists are written when the context ends."""
    folder.mkdir()
    rows: list[tuple[Any, ...]] = []
    kept: list[Recording] = []

    def add(recording: Recording, pose: Pose, pictures: dict[int, str]) -> None:
        walk, array = recording.walk, of_pose(pose)
        rows.append((*names(recording), walk.sequence, recording.camera.name, len(pose.frame), len(array)))
        if not len(array):
            return
        path = folder / "data" / "/".join(names(recording)) / f"{recording.name}.pkl"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(pickled(array))
        kept.append(recording)

    yield add
    write_csv(folder / "sequences.csv", COLUMNS, rows)
    for split in sorted({split for recording in kept for split in recording.parts}):
        write_json(folder / "partition" / f"{split}.json", partition(split, kept))


def names(recording: Recording) -> tuple[str, str, str]:
    """Subject, type and view of a recording."""
    walk = recording.walk
    outfit = plain(walk.outfit)
    kind = "-".join([walk.environment, *([outfit] if outfit else []), f"{walk.nth:02d}"])
    return walk.subject, kind, f"{walk.environment}-{recording.camera.name}"


def of_pose(pose: Pose) -> NDArray[np.float32]:
    """float32 (T, 17, 3): x, y px and confidence of the pictures of which a joint is known."""
    known = np.all(np.isfinite(pose.uv), axis=-1)
    array = np.concatenate([np.where(known[..., None], pose.uv, 0.0), pose.inside[..., None]], axis=-1)
    return array[known.any(axis=1)].astype(np.float32)


def pickled(array: NDArray[np.float32]) -> bytes:
    """The bytes of a pickle that numpy 1 and 2 both read: neither finds the other's private modules."""
    stream = io.BytesIO()
    pickler = pickle.Pickler(stream, protocol=4)
    pickler.dispatch_table = copyreg.dispatch_table | {np.ndarray: _plain}
    pickler.dump(array)
    return stream.getvalue()


def _plain(array: NDArray[Any]) -> tuple[type, tuple[Any, ...]]:
    # a bytearray, so that what is read can be written to
    return np.ndarray, (array.shape, array.dtype.str, bytearray(np.ascontiguousarray(array).tobytes()))


def partition(split: str, recordings: list[Recording]) -> dict[str, Any]:
    """TRAIN_SET and TEST_SET of the split by subject; of another everybody is tested, with GALLERY and PROBE."""
    if split == SUBJECT_SPLIT:
        trained = {r.walk.subject for r in recordings if r.parts.get(split) in ("train", "val")}
        tested = {r.walk.subject for r in recordings if r.parts.get(split) == "test"}
        return {"TRAIN_SET": sorted(trained), "TEST_SET": sorted(tested)}
    gallery, probe = (
        [list(names(r)) for r in recordings if r.parts.get(split) == part] for part in ("gallery", "probe")
    )
    everybody = sorted({subject for subject, _, _ in gallery + probe})
    return {"TRAIN_SET": [], "TEST_SET": everybody, "GALLERY": gallery, "PROBE": probe}
