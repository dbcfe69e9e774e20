"""Detections made here: a pose network run on the pictures of one camera.

INPUTS   the sequence's `frames` table, its bags below data_root, and the network: MediaPipe's `.task` file (see
         detect_task.py), or an ONNX file with one input (N, 3, H, W), RGB, normalised by ImageNet's mean and deviation,
         and either two outputs (N, K, W * ratio), (N, K, H * ratio) (SimCC, as RTMPose has it) or one (N, K, h, w)
         (heat maps); K keypoints of `skeletons.BY_COUNT`.
OUTPUTS  JSON in COCO's results format, recorded pixels, which `detections` reads like any other; an ONNX network gives
         one person a picture at most. A picture in which nobody is found is not in it.
"""

import json
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from dior.arrays import AnyPath, Floats
from dior.body.names import BY_COUNT
from dior.errors import DiorError
from dior.ingest import bags as rosbag
from dior.ingest import detect_task
from dior.ingest.detect_task import Finder, Picture
from dior.progress import reporting
from dior.tables import tables
from dior.tables.files import write_text

Box: TypeAlias = tuple[float, float, float, float]

# chosen: of a network that takes any number of pictures
BATCH = 16
# ImageNet's, RGB of 0 to 255, as PyTorch's and OpenMMLab's networks are trained with
MEAN = np.array([123.675, 116.28, 103.53], np.float32)
DEVIATION = np.array([58.395, 57.12, 57.375], np.float32)
# chosen: somebody is found where that many joints have that score; the box around them, enlarged, is looked at again
SCORE, JOINTS = 0.3, 4
# RTMPose's top-down padding of a box (mmpose, GetBBoxCenterScale)
AROUND = 1.25


@dataclass(frozen=True, eq=False)
class Network:
    """`infer` takes float32 (n, 3, height, width), n up to `batch`, and gives a list of arrays."""

    infer: Callable[[NDArray[np.float32]], list[NDArray[np.float32]]]
    width: int
    height: int
    batch: int
    where: str


def run(
    *,
    sequence: str,
    camera: str,
    frames: Path,
    data_root: Path,
    model: Path,
    crop: Literal["whole", "person"],
    out: Path,
) -> None:
    """Write the detections of one camera. See the module's docstring.

    `crop` whole looks once at the whole picture, person again at the box of who was found there; MediaPipe has its own
    way and takes no notice. Raises DiorError where the network or what runs it is missing, and for a network of another
    kind.
    """
    where = f"{sequence}, {camera}"
    if not model or not Path(model).is_file():
        raise DiorError(
            f"detector.model '{model or ''}': there is no such file; name the ONNX or {detect_task.SUFFIX} file of a "
            "pose network"
        )
    by_task = str(model).endswith(detect_task.SUFFIX)
    finder = detect_task.finder(model) if by_task else network_finder(load(model), crop)
    pictures = tables.of_camera(tables.read(frames, "frames"), camera)
    total = len(pictures["frame"])
    if not total:
        raise DiorError(f"{where}: {frames} has no frame of this camera")
    found = {}
    for row, people in reporting(finder(rosbag.read_pictures(pictures, data_root)), total, "pictures", where):
        found[int(pictures["frame"][row])] = people
    results = [_result(frame, one) for frame in sorted(found) for one in found[frame]]
    if not results:
        raise DiorError(f"{where}: {model} found nobody in any of {total} pictures; is it a pose network?")
    write_text(out, "[\n" + ",\n".join(map(json.dumps, results)) + "\n]\n")


def network_finder(network: Network, crop: str) -> Finder:
    """A function from (row, picture) pairs to (row, people) pairs, people being points (K, 3) of one or nobody."""

    def people(pictures: Iterable[tuple[int, Picture]]) -> Iterator[tuple[int, list[Floats]]]:
        box: Box | None = None
        for rows, batch in _batches(pictures, network.batch):
            points = look(network, batch, [whole(picture) for picture in batch])
            if crop == "person":
                boxes = []
                for one, picture in zip(points, batch, strict=True):
                    box = person_box(one) if is_somebody(one) else box
                    boxes.append(whole(picture) if box is None else box)
                points = look(network, batch, boxes)
            for row, one in zip(rows, points, strict=True):
                yield row, [one] if is_somebody(one) else []

    return people


def load(model: AnyPath) -> Network:
    """The network of an ONNX file. Raises DiorError where ONNX Runtime is missing or the network of another kind."""
    try:
        import onnxruntime
    except ImportError:
        raise DiorError("`detections: detect` needs onnxruntime; install it: pip install -e '.[detect]'") from None
    options = onnxruntime.SessionOptions()
    # Snakemake says by this variable how many cores a job has; 0 is all
    options.intra_op_num_threads = int(os.environ.get("OMP_NUM_THREADS") or 0)
    try:
        session = onnxruntime.InferenceSession(str(model), options, providers=onnxruntime.get_available_providers())
    # ONNX Runtime's exceptions have no base of their own
    except Exception as error:
        reason = str(error).splitlines()[0]
        raise DiorError(f"detector.model {model}: not a network that ONNX Runtime reads ({reason:.200})") from None
    inputs, outputs = session.get_inputs(), session.get_outputs()
    shape = inputs[0].shape if len(inputs) == 1 else []
    sized = len(shape) == 4 and shape[1] == 3 and all(isinstance(side, int) for side in shape[2:])
    if not sized or inputs[0].type != "tensor(float)" or len(outputs) not in (1, 2):
        raise DiorError(
            f"detector.model {model}: has {len(inputs)} inputs, the first {shape}, and {len(outputs)} outputs, where a "
            "pose network has one float input (N, 3, H, W) of a fixed size and one (heat maps) or two (SimCC) outputs"
        )
    name = inputs[0].name
    batch = shape[0] if isinstance(shape[0], int) else BATCH
    return Network(lambda values: session.run(None, {name: values}), shape[3], shape[2], batch, str(model))


def _batches(pictures: Iterable[tuple[int, Picture]], size: int) -> Iterator[tuple[list[int], list[Picture]]]:
    """Lists of up to `size` (rows, pictures)."""
    rows: list[int] = []
    batch: list[Picture] = []
    for row, picture in pictures:
        rows.append(row)
        batch.append(picture)
        if len(rows) == size:
            yield rows, batch
            rows, batch = [], []
    if rows:
        yield rows, batch


def look(network: Network, pictures: Sequence[Picture], boxes: Sequence[Box]) -> Floats:
    """Keypoints (n, K, 3) u, v, score, px, within boxes (n, 4) u_min, v_min, u_max, v_max of BGR pictures."""
    maps = [to_picture(box, network.width, network.height) for box in boxes]
    values = np.stack([_input(picture, one, network) for picture, one in zip(pictures, maps, strict=True)])
    # a network whose batch has a fixed size gets it, filled up
    short = network.batch - len(values) if network.batch != BATCH else 0
    outputs = network.infer(np.concatenate([values, np.zeros((short, *values.shape[1:]), np.float32)]))
    points = decode([output[: len(values)] for output in outputs], network)
    # from the network's pixels to the picture's
    for one, (scale, du, dv) in zip(points, maps, strict=True):
        one[:, :2] = one[:, :2] * scale + (du, dv)
    return points


def to_picture(box: Box, width: int, height: int) -> tuple[float, float, float]:
    """(scale, du, dv): a network's pixel (x, y) is the picture's (scale x + du, scale y + dv); the box fits within."""
    u_min, v_min, u_max, v_max = box
    scale = max((u_max - u_min + 1) / width, (v_max - v_min + 1) / height)
    return scale, (u_min + u_max) / 2 - scale * (width - 1) / 2, (v_min + v_max) / 2 - scale * (height - 1) / 2


def _input(picture: Picture, mapping: tuple[float, float, float], network: Network) -> NDArray[np.float32]:
    import cv2

    scale, du, dv = mapping
    affine = np.array([[scale, 0.0, du], [0.0, scale, dv]])
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    crop = cv2.warpAffine(picture, affine, (network.width, network.height), flags=flags)
    return ((crop[..., ::-1] - MEAN) / DEVIATION).transpose(2, 0, 1)


def decode(outputs: Sequence[NDArray[np.float32]], network: Network) -> Floats:
    """Keypoints (n, K, 3) x, y, score in the network's pixels from its outputs. Raises DiorError for other shapes."""
    shapes = [output.shape for output in outputs]
    simcc = len(outputs) == 2 and all(len(shape) == 3 for shape in shapes) and shapes[0][1] == shapes[1][1]
    if not (simcc or (len(outputs) == 1 and len(shapes[0]) == 4)) or shapes[0][1] not in BY_COUNT:
        known = ", ".join(map(str, sorted(BY_COUNT)))
        raise DiorError(f"detector.model {network.where}: outputs of shape {shapes} are no heads for {known} keypoints")
    return from_simcc(outputs[0], outputs[1], network) if simcc else from_heat_maps(outputs[0], network)


def from_simcc(x: NDArray[np.float32], y: NDArray[np.float32], network: Network) -> Floats:
    """Keypoints (n, K, 3) from SimCC's rows (n, K, width * ratio), (n, K, height * ratio) (Li et al., ECCV 2022)."""
    at = [
        values.argmax(axis=-1) * size / values.shape[-1] for values, size in ((x, network.width), (y, network.height))
    ]
    return np.stack([*at, np.minimum(x.max(axis=-1), y.max(axis=-1))], axis=-1).astype(float)


def from_heat_maps(maps: NDArray[np.float32], network: Network) -> Floats:
    """Keypoints (n, K, 3) from heat maps (n, K, h, w): the highest place and a quarter towards its higher neighbour."""
    count, joints, height, width = maps.shape
    flat = maps.reshape(count, joints, -1)
    at = flat.argmax(axis=-1)
    row, column = np.unravel_index(at, (height, width))
    bordered = np.pad(maps, ((0, 0), (0, 0), (1, 1), (1, 1)), mode="edge")
    n, k = np.ogrid[:count, :joints]
    aside = np.sign(bordered[n, k, row + 1, column + 2] - bordered[n, k, row + 1, column])
    along = np.sign(bordered[n, k, row + 2, column + 1] - bordered[n, k, row, column + 1])
    x, y = (column + aside / 4) * network.width / width, (row + along / 4) * network.height / height
    return np.stack([x, y, flat.max(axis=-1)], axis=-1).astype(float)


def whole(picture: Picture) -> Box:
    """The box of a whole picture: the centres of its first and last pixel."""
    height, width = picture.shape[:2]
    return 0.0, 0.0, width - 1.0, height - 1.0


def is_somebody(points: Floats) -> bool:
    """Whether keypoints (K, 3) are of a person."""
    return int((points[:, 2] >= SCORE).sum()) >= min(JOINTS, len(points))


def person_box(points: Floats) -> Box:
    """The enlarged box of the keypoints (K, 3) that were found."""
    found = points[points[:, 2] >= SCORE, :2]
    middle, half = (found.max(axis=0) + found.min(axis=0)) / 2, np.ptp(found, axis=0) / 2
    return *(middle - AROUND * half), *(middle + AROUND * half)


def _result(frame: int, points: Floats) -> dict[str, Any]:
    flat = np.column_stack([points[:, :2].round(2), points[:, 2:].round(4)]).ravel()
    return {
        "image_id": frame,
        "category_id": 1,
        "keypoints": flat.tolist(),
        "score": round(float(points[:, 2].mean()), 4),
    }
