"""The same people written as every tool writes them."""

import json

import numpy as np

from dior.body.names import COCO_17, COCO_18, HALPE_26, HALPE_136, MLKIT_33, WHOLEBODY_133

WIDTH, HEIGHT = 640, 480
T0 = 1_708_000_000_000_000_000


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


def mlkit(folder, found, period_ns=1.0):
    lines = []
    for frame, people in found.items():
        landmarks = [
            {"type": i, "x": u, "y": v, "z": -1.5, "inFrameLikelihood": s}
            for i, (u, v, s) in enumerate(people[0].tolist()) if np.isfinite(u)
        ]  # fmt: skip
        lines.append(json.dumps({"frame": frame, "stamp_ns": T0 + round(period_ns * frame), "landmarks": landmarks}))
    return _write(folder / "mlkit.jsonl", "\n".join(lines) + "\n")


def openpose(folder, found):
    for frame, people in found.items():
        content = {"version": 1.3, "people": [{"person_id": [-1], "pose_keypoints_2d": flat(one)} for one in people]}
        _write(folder / "openpose" / f"{frame:012d}_keypoints.json", json.dumps(content))
    return folder / "openpose"


def pose2sim(folder, found):
    """As save_to_openpose of Pose2Sim 0.10.49 writes them, what is missing being NaN there."""
    empty = ("face_keypoints_2d", "hand_left_keypoints_2d", "hand_right_keypoints_2d", "pose_keypoints_3d")
    for frame, people in found.items():
        each = [
            {"person_id": [-1], "pose_keypoints_2d": one.ravel().tolist(), **{key: [] for key in empty}}
            for one in people
        ]
        _write(folder / "pose2sim" / f"cam01_{frame:06d}.json", json.dumps({"version": 1.3, "people": each}))
    return folder / "pose2sim"


def pose2sim_whole_body(folder, found):
    return pose2sim(folder, found)


def _instances(people):
    """As split_instances of mmpose 1.3.2 gives them; its box is a list in a list."""
    return [
        {
            "keypoints": np.nan_to_num(one[:, :2]).tolist(),
            "keypoint_scores": np.nan_to_num(one[:, 2]).tolist(),
            "bbox": [[1.0, 2.0, 3.0, 4.0]],
            "bbox_score": 0.9,
        }
        for one in people
    ]


def mmpose(folder, found):
    for frame, people in found.items():
        _write(folder / "mmpose" / f"cam01_{frame:06d}.json", json.dumps(_instances(people), indent="  "))
    return folder / "mmpose"


def mmpose_video(folder, found):
    content = [{"frame_id": frame, "instances": _instances(people)} for frame, people in found.items()]
    return _write(folder / "mmpose.json", json.dumps(content, indent="  "))


def mmpose_demo(folder, found, names=HALPE_26):
    spelled = {i: "hip" if name == "mid_hip" else name for i, name in enumerate(names)}
    content = {
        "meta_info": {"dataset_name": "halpe26", "num_keypoints": len(names), "keypoint_id2name": spelled},
        "instance_info": [{"frame_id": frame, "instances": _instances(people)} for frame, people in found.items()],
    }
    return _write(folder / "demo.json", json.dumps(content, indent="\t"))


def _yolo_results(people):
    """As Results.summary of ultralytics 8.4.190 gives them; to_json writes it without blanks."""
    return json.dumps(
        [
            {
                "name": "person",
                "class": 0,
                "confidence": 0.9,
                "box": {"x1": 1.0, "y1": 2.0, "x2": 3.0, "y2": 4.0},
                "keypoints": {
                    "x": np.nan_to_num(one[:, 0] + 0.5).round(5).tolist(),
                    "y": np.nan_to_num(one[:, 1] + 0.5).round(5).tolist(),
                    "visible": np.nan_to_num(one[:, 2], nan=0.4).tolist(),
                },
            }
            for one in people
        ],
        separators=(",", ":"),
    )


def yolo_json(folder, found):
    for frame, people in found.items():
        _write(folder / "yolo_json" / f"cam01_{frame}.json", _yolo_results(people))
    return folder / "yolo_json"


def yolo_json_list(folder, found):
    return _write(folder / "yolo.json", "[" + ", ".join(_yolo_results(people) for people in found.values()) + "]")


def yolo_json_lines(folder, found):
    return _write(folder / "yolo.jsonl", "".join(_yolo_results(people) + "\n" for people in found.values()))


def yolo_validated(folder, found):
    """As `save_json` of a validation by ultralytics 8.4.190 writes them."""
    content = [
        {
            "image_id": f"cam.{frame}",
            "file_name": f"cam.{frame}.jpg",
            "category_id": 1,
            "bbox": [1.0, 2.0, 3.0, 4.0],
            "score": 0.7,
            "keypoints": flat(one + (0.5, 0.5, 0)),
        }
        for frame, people in found.items()
        for one in people
    ]
    return _write(folder / "predictions.json", json.dumps(content))


def _table(rows):
    return "".join(",".join(map(str, row)) + "\n" for row in rows)


def _cells(one):
    return ["" if x != x else x for x in one.ravel().tolist()]


def deeplabcut(folder, found, names=COCO_17):
    """As to_csv of pandas writes what create_df_from_prediction of deeplabcut 3.0.2 makes."""
    width = 3 * len(names)
    header = [
        ["scorer", *["DLC_Resnet50"] * width],
        ["bodyparts", *[name for name in names for _ in range(3)]],
        ["coords", *["x", "y", "likelihood"] * len(names)],
    ]
    nobody = np.full((len(names), 3), np.nan)
    rows = [[frame, *_cells([*people, nobody][0])] for frame, people in found.items()]
    return _write(folder / "DLC.csv", _table([*header, *rows]))


def deeplabcut_of_several(folder, found, names=COCO_17):
    width = 3 * len(names)
    header = [
        ["scorer", *["DLC_Resnet50"] * (2 * width + 3)],
        ["individuals", *["one"] * width, *["two"] * width, *["single"] * 3],
        ["bodyparts", *[name for _ in range(2) for name in names for _ in range(3)], *["door"] * 3],
        ["coords", *["x", "y", "likelihood"] * (2 * len(names) + 1)],
    ]
    nobody = np.full((len(names), 3), np.nan)
    rows = [
        [frame, *(cell for one in [*people, nobody, nobody][:2] for cell in _cells(one)), 5.0, 6.0, 0.9]
        for frame, people in found.items()
    ]
    return _write(folder / "DLC_el.csv", _table([*header, *rows]))


def caliscope(folder, found, cameras=(3,)):
    """As caliscope 0.11.8 writes xy_<tracker>.csv."""
    header = "sync_index cam_id frame_index frame_time object_id keypoint_id img_loc_x img_loc_y".split()
    rows = [
        [frame + 7, camera, frame, f"{frame / 30:.6f}", person, i, f"{u + 10 * n:.6f}", f"{v:.6f}", "", "", ""]
        for frame, people in found.items()
        for n, camera in enumerate(cameras)
        for person, one in enumerate(people)
        for i, (u, v, _) in enumerate(one.tolist())
        if u == u
    ]
    return _write(folder / "xy_RTMPOSE.csv", _table([[*header, "obj_loc_x", "obj_loc_y", "obj_loc_z"], *rows]))


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
    pose2sim: ("openpose", HALPE_26, True, True),
    pose2sim_whole_body: ("openpose", WHOLEBODY_133, True, True),
    mmpose: ("mmpose", COCO_17, True, True),
    mmpose_video: ("mmpose", HALPE_26, True, True),
    mmpose_demo: ("mmpose", HALPE_26, True, True),
    yolo_json: ("yolo_json", COCO_17, True, True),
    yolo_json_list: ("yolo_json", COCO_17, True, True),
    yolo_json_lines: ("yolo_json", COCO_17, True, True),
    yolo_validated: ("coco", COCO_17, True, True),
    deeplabcut: ("deeplabcut", COCO_17, False, True),
    deeplabcut_of_several: ("deeplabcut", COCO_17, True, True),
    caliscope: ("caliscope", HALPE_26, True, False),
}
ALPHAPOSE_COUNTS = {17: COCO_17, 26: HALPE_26, 136: HALPE_136}
