"""The same people written as every tool writes them."""

import json

import numpy as np

from dior.body.names import COCO_17, COCO_18, HALPE_26, HALPE_136, MLKIT_33

WIDTH, HEIGHT = 640, 480


def scene(joints, frames=(0, 1, 2, 3), seed=1):
    """frame -> [points (J, 3) u, v, score], one person, two in frame 1; joint 3 of frame 2 is missing (NaN)."""
    random, found = np.random.default_rng(seed), {}
    shape = random.uniform(0, 1, (joints, 2)) * (60, 170)
    for frame in frames:
        people = [shape + (100 + 3 * frame, 100)] + ([0.5 * shape + (400, 200)] if frame == 1 else [])
        score = random.uniform(0.3, 0.9, (len(people), joints, 1))
        found[frame] = list(np.concatenate([people, score], axis=-1).round(3))
    if 2 in found:
        found[2][0][3] = np.nan
    return found


def flat(points):
    return np.nan_to_num(points).ravel().tolist()


def fractions(points):
    """(J, 2) as fractions of the picture, (0, 0) where missing."""
    return np.nan_to_num((points[:, :2] + 0.5) / (WIDTH, HEIGHT))


def _write(path, text):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    return path


def mlkit(folder, found):
    lines = []
    for frame, people in found.items():
        landmarks = [
            {"type": i, "x": u, "y": v, "z": -1.5, "inFrameLikelihood": s}
            for i, (u, v, s) in enumerate(people[0].tolist()) if np.isfinite(u)
        ]  # fmt: skip
        lines.append(
            json.dumps({"frame": frame, "stamp_ns": 1_708_000_000_000_000_000 + frame, "landmarks": landmarks})
        )
    return _write(folder / "mlkit.jsonl", "\n".join(lines) + "\n")


def openpose(folder, found):
    for frame, people in found.items():
        content = {"version": 1.3, "people": [{"person_id": [-1], "pose_keypoints_2d": flat(one)} for one in people]}
        _write(folder / "openpose" / f"{frame:012d}_keypoints.json", json.dumps(content))
    return folder / "openpose"


def _landmark(point, fraction):
    return {"x": fraction[0], "y": fraction[1], "z": -0.1, "visibility": point[2], "presence": 0.99}


def _landmarks(one):
    with_null = zip(np.nan_to_num(one).tolist(), ((one[:, :2] + 0.5) / (WIDTH, HEIGHT)).tolist(), strict=True)
    return [_landmark(point, [None if x != x else x for x in fraction]) for point, fraction in with_null]


def mediapipe_tasks(folder, found):
    lines = [
        json.dumps({"frame": frame, "pose_landmarks": [_landmarks(one) for one in people], "segmentation_masks": None})
        for frame, people in found.items()
    ]
    return _write(folder / "tasks.jsonl", "\n".join(lines))


def mediapipe_web(folder, found):
    entries = [
        {"frame": frame, "landmarks": [_landmarks(one) for one in people], "worldLandmarks": []}
        for frame, people in found.items()
    ]
    return _write(folder / "web.json", json.dumps(entries, indent=1))


def mediapipe_solutions(folder, found):
    for frame, people in found.items():
        content = {"pose_landmarks": {"landmark": _landmarks(people[0])}} if frame % 2 else {
            "landmark": _landmarks(people[0])
        }  # fmt: skip
        _write(folder / "solutions" / f"cam01_{frame:06d}.json", json.dumps(content))
    return folder / "solutions"


def mediapipe_text(folder, found):
    for frame, people in found.items():
        text = "# proto-message: LandmarksDetectionResult\n"
        for one in people:
            rows = zip(((one[:, :2] + 0.5) / (WIDTH, HEIGHT)).tolist(), one[:, 2].tolist(), strict=True)
            text += "landmarks {\n" + "".join(
                f"  landmark {{\n    x: {x}\n    y: {y}\n    z: -1e-2\n    visibility: {s}\n    presence: 0.9\n  }}\n"
                for (x, y), s in rows
            ) + "}\n"  # fmt: skip
        _write(folder / "text" / f"cam01_{frame:06d}.pbtxt", text)
    return folder / "text"


def results(found, name, **more):
    return [
        {"image_id": name(frame), "category_id": 1, "keypoints": flat(one), "score": 2.9 + index, **more}
        for frame, people in found.items()
        for index, one in enumerate(people)
    ]


def alphapose(folder, found, **more):
    more = more or {"box": [1.0, 2.0, 3.0, 4.0], "idx": [[1.0]]}
    return _write(folder / "alphapose-results.json", json.dumps(results(found, lambda f: f"cam01_{f:06d}.jpg", **more)))


def alphapose_cmu(folder, found):
    content = {
        f"{frame}.jpg": {"version": "AlphaPose v0.3", "bodies": [{"joints": flat(one)} for one in people]}
        for frame, people in found.items()
    }
    return _write(folder / "cmu.json", json.dumps(content))


def alphapose_open(folder, found):
    content = {
        f"{frame}.jpg": {"version": 0.1, "people": [{"pose_keypoints_2d": flat(one)} for one in people]}
        for frame, people in found.items()
    }
    return _write(folder / "open.json", json.dumps(content))


def coco(folder, found):
    return _write(folder / "results.json", json.dumps(results(found, int)))


def _yolo_row(one, columns):
    points = fractions(one)
    if columns == 56:
        points = np.column_stack([points, np.nan_to_num(one[:, 2], nan=0.4)])
    return " ".join(["0", "0.5", "0.5", "0.2", "0.4", *(f"{x:.9g}" for x in points.ravel())])


def yolo(folder, found, columns=56):
    for frame, people in found.items():
        _write(folder / "yolo" / f"walk2_{frame}.txt", "\n".join(_yolo_row(one, columns) for one in people) + "\n")
    return folder / "yolo"


def yolo_39(folder, found):
    return yolo(folder, found, 39)


def yolo_stream(folder, found, columns=56):
    rows = [f"{frame} {_yolo_row(one, columns)}" for frame, people in found.items() for one in people]
    return _write(folder / "stream.txt", "\n".join(rows) + "\n")


def yolo_stream_39(folder, found):
    return yolo_stream(folder, found, 39)


def mlkit_csv(folder, found):
    rows = []
    for frame, people in found.items():
        cells = np.insert(people[0][:, :2], 2, -3.0, axis=1).ravel().tolist()
        rows.append(",".join([f"cam01_{frame:06d}.jpg", "squats_up", *map(str, cells)]))
    return _write(folder / "samples.csv", "\r\n".join(rows) + "\r\n")


# writer -> (key of READERS, joints, has a second person, has scores)
WRITERS = {
    mlkit: ("mlkit", MLKIT_33, False, True),
    openpose: ("openpose", COCO_18, True, True),
    mediapipe_tasks: ("mediapipe", MLKIT_33, True, True),
    mediapipe_web: ("mediapipe", MLKIT_33, True, True),
    mediapipe_solutions: ("mediapipe", MLKIT_33, False, True),
    mediapipe_text: ("mediapipe", MLKIT_33, True, True),
    alphapose: ("alphapose", HALPE_26, True, True),
    alphapose_cmu: ("alphapose", COCO_18, True, True),
    alphapose_open: ("alphapose", COCO_18, True, True),
    coco: ("coco", COCO_17, True, True),
    yolo: ("yolo", COCO_17, True, True),
    yolo_39: ("yolo", COCO_17, True, False),
    yolo_stream: ("yolo", COCO_17, True, True),
    yolo_stream_39: ("yolo", COCO_17, True, False),
    mlkit_csv: ("mlkit_csv", MLKIT_33, False, False),
}
ALPHAPOSE_COUNTS = {17: COCO_17, 26: HALPE_26, 136: HALPE_136}
