"""A small capture in tables: a lab and a field session, three sequences, evaluated as the pipeline does it."""

from types import SimpleNamespace

import numpy as np
import pytest

from dior.body.names import MLKIT_33
from dior.clocks import clock as on_axis
from dior.evaluate import evaluate, metrics
from dior.geometry import camera_tables
from dior.geometry.camera import Camera, Intrinsics, pose, project
from dior.geometry.multiview import look_at, rotation_z
from dior.tables import tables

FRAMES = 90
START_NS = 1_700_000_000_000_000_000
LENS = Intrinsics(1280, 720, 640.0, 640.0, 640.0, 360.0)
FAR_LENS = Intrinsics(1280, 720, 760.0, 760.0, 640.0, 360.0)
# (forward, left, up) m of the middle and of the left joints, standing
BODY = {
    "nose": (0.1, 0, 1.62), "eye_inner": (0.09, 0.02, 1.65), "eye": (0.09, 0.035, 1.65),
    "eye_outer": (0.08, 0.05, 1.65),
    "ear": (0, 0.08, 1.63), "mouth": (0.09, 0.03, 1.57), "shoulder": (0, 0.19, 1.42), "elbow": (-0.03, 0.25, 1.13),
    "wrist": (0.05, 0.26, 0.88), "pinky": (0.06, 0.27, 0.8), "index": (0.07, 0.26, 0.79), "thumb": (0.09, 0.24, 0.82),
    "hip": (0, 0.1, 0.93), "knee": (0.03, 0.1, 0.5), "ankle": (-0.03, 0.1, 0.09), "heel": (-0.07, 0.1, 0.04),
    "foot_index": (0.12, 0.11, 0.02),
}  # fmt: skip


def standing():
    """(33, 3) m: forward, left, up."""
    points = [
        np.array(BODY[name.removeprefix("left_").removeprefix("right_")])
        * (1, -1 if name.startswith("right") else 1, 1)
        for name in MLKIT_33
    ]
    return np.array(points, float)


def walk(frames=FRAMES):
    """(F, 33, 3) m: to and fro on a 4 m walkway along x, limbs swinging."""
    t = np.arange(frames) / 30
    phase = 2 * np.pi * t
    x = 2 * np.sin(2 * np.pi * t / 6)
    heading = np.where(np.cos(2 * np.pi * t / 6) > 0, 0.0, np.pi)
    body = np.repeat(standing()[None], frames, axis=0)
    left = np.array([name.startswith("left") for name in MLKIT_33])
    limb = np.where(body[0, :, 2] < 0.6, 0.3, 0.0) * np.where(left, 1, -1)
    body[..., 0] += np.sin(phase)[:, None] * limb
    turned = np.stack([b @ rotation_z(a).T for b, a in zip(body, heading, strict=True)])
    return turned + np.stack([x, 0 * x, 0 * x], axis=-1)[:, None]


def rig(far):
    """Three close cameras, and a fourth that is close or 60 m away."""
    places = [(5.0, -4.0, 1.6), (0.0, -5.5, 1.5), (-4.5, 4.0, 1.7), (60.0, 10.0, 2.0) if far else (4.5, 4.5, 1.6)]
    return [
        Camera(
            f"cam{i + 1:02d}",
            FAR_LENS if far and i == 3 else LENS,
            pose(look_at(place, (0, 0, 1.0)), place),
            "long_range" if far and i == 3 else "close",
            "tape",
        )
        for i, place in enumerate(places)
    ]


def repeat(words, count):
    return np.repeat(np.array(words, dtype=object), count)


def label_columns(subject, sequence, camera, uv, frames, stamps, status=None):
    count, joints = uv.shape[:2]
    status = np.full((count, joints), "ok", dtype=object) if status is None else status
    return {
        "subject": repeat([subject], count * joints),
        "sequence": repeat([sequence], count * joints),
        "camera": repeat([camera], count * joints),
        "joint": np.tile(np.array(MLKIT_33, dtype=object), count),
        "frame": np.repeat(frames, joints),
        "stamp_ns": np.repeat(stamps, joints),
        "u": uv[..., 0].ravel(),
        "v": uv[..., 1].ravel(),
        "status": status.ravel(),
        "source": repeat(["triangulated"], count * joints),
    }


def skeleton_columns(subject, sequence, points):
    count, joints = points.shape[:2]
    return {
        "subject": repeat([subject], count * joints),
        "sequence": repeat([sequence], count * joints),
        "joint": np.tile(np.array(MLKIT_33, dtype=object), count),
        "instant": np.repeat(np.arange(count), joints),
        "stamp_ns": np.repeat(START_NS + np.arange(count) * 33_333_333, joints),
        "x": points[..., 0].ravel(),
        "y": points[..., 1].ravel(),
        "z": points[..., 2].ravel(),
        "n_views": np.full(count * joints, 3),
        "residual_px": np.ones(count * joints),
        "status": repeat(["ok"], count * joints),
    }


def stacked(parts):
    return {key: np.concatenate([np.asarray(part[key]) for part in parts]) for key in parts[0]}


def picture(camera, frame):
    """A grey picture with a gradient, different for every camera and frame."""
    y, x = np.mgrid[:720, :1280]
    shade = 90 + 60 * y / 720 + 20 * np.sin(x / 40 + frame) + int(camera[-1]) * 5
    return np.repeat(shade[..., None], 3, axis=2).astype(np.uint8)


CONFIG = """data_root: data
release:
  version: 0.1.0
  title: A small capture
  license: CC-BY-NC-4.0
  authors: [Someone]
"""


def write_project(root, sequences):
    config = root / "config"
    config.mkdir(parents=True)
    (config / "config.yaml").write_text(CONFIG)
    header = "sequence session_order subject session environment outfit walk bags mocap detections trigger_log"
    columns = [*header.split(), "exclude_reason", "truth"]
    lines = ["\t".join(columns)]
    for i, (sequence, subject, session) in enumerate(sequences):
        indoor = session == "lab"
        row = dict.fromkeys(columns, "") | {
            "sequence": sequence,
            "session_order": str(i + 1),
            "subject": subject,
            "session": session,
            "environment": "indoor" if indoor else "outdoor",
            "outfit": "own",
            "walk": "line",
            "bags": "a.bag",
            "mocap": "a.c3d" if indoor else "",
            "detections": "" if indoor else "mlkit/{camera}.jsonl",
        }
        lines.append("\t".join(row[c] for c in columns))
    (config / "sequences.tsv").write_text("\n".join(lines) + "\n")
    people = [f"{s}\tpseudonym{s}\t1.7\t0.01\tyes" for s in sorted({s for _, s, _ in sequences})]
    (config / "subjects.tsv").write_text(
        "subject\tpseudonym\theight_m\theight_sigma_m\tconsent_release\n" + "\n".join(people) + "\n"
    )
    for session in ("lab", "field"):
        folder = config / "sessions" / session
        folder.mkdir(parents=True)
        cameras = rig(session == "field")
        window = "adjust: {outdoor_01: {}}\n" if session == "field" else ""
        (folder / "session.yaml").write_text(f"cameras: [{', '.join(c.name for c in cameras)}]\n{window}")
        for camera in cameras:
            place = [round(float(x), 3) for x in camera.centre]
            locate = "align" if camera.role == "long_range" else "tape" if session == "field" else "marks"
            (folder / f"{camera.name}.marks.csv").write_text("sequence,frame,joint,u,v\n")
            (folder / f"{camera.name}.yaml").write_text(
                f"role: {camera.role}\ntopic: /{camera.name}/color/image_raw/compressed\nintrinsics: camera_info\n"
                f"distortion_model: plumb_bob\nlocate: {locate}\n"
                f"tape: {{position_m: {place}, sigma_m: 0.05, target_m: [0, 0, 1]}}\n"
            )


SEQUENCES = (("indoor_01", "S01", "lab"), ("outdoor_01", "S01", "field"), ("outdoor_02", "S02", "field"))


def frame_columns(camera, stamps):
    """Columns of `frames` of a camera whose pictures, of `stamps`, come as they are taken."""
    count = len(stamps)
    return {
        "camera": repeat([camera], count),
        "frame": np.arange(count),
        "stamp_ns": stamps,
        "receive_ns": stamps,
        "bag": repeat(["a.bag"], count),
        "topic": repeat(["t"], count),
        "nth": np.zeros(count, int),
        "height": np.full(count, 720),
        "width": np.full(count, 1280),
    }


def write_sequence(root, number, sequence, subject, session):
    """The tables of a sequence under `<root>/results` and its figures; cam03 loses pictures and has gaps."""
    results, rng = root / "results", np.random.default_rng(number)
    points, cameras = walk(), rig(session == "field")
    frames = np.arange(FRAMES)
    labels, true, found, index = [], [], [], []
    for camera in cameras:
        stamps = START_NS + frames * 33_333_333
        if camera.name == "cam03":
            stamps = stamps + 5 * 33_333_333 * (frames > 40)
        uv = project(camera, points)[0]
        true.append(label_columns(subject, sequence, camera.name, uv, frames, stamps))
        status = np.full(uv.shape[:2], "ok", dtype=object)
        if camera.name == "cam03":
            status[60:75, :10] = "missing_3d"
        ours = np.where((status == "ok")[..., None], uv + rng.normal(0, 1.0 + number, uv.shape), np.nan)
        path = results / f"reproject/{sequence}.{camera.name}.parquet"
        tables.write(path, "labels_2d", label_columns(subject, sequence, camera.name, ours, frames, stamps, status))
        labels.append(path)
        seen = uv + rng.normal(0, 3, uv.shape)
        seen[50, 15:17] += 40
        columns = label_columns(subject, sequence, camera.name, seen, frames, stamps)
        someone = camera.role == "close"
        found.append(
            {k: columns[k] for k in ("camera", "frame", "stamp_ns", "joint")}
            | {k: columns[k] if someone else np.full(uv[..., 0].size, np.nan) for k in ("u", "v")}
            | {"score": np.full(uv[..., 0].size, 0.9 if someone else np.nan)}
            | {"person": np.full(uv[..., 0].size, 0 if someone else -1)}
        )
        index.append(frame_columns(camera.name, stamps))
    truth = root / f"data/truth/{sequence}"
    tables.write(truth / "labels_2d.parquet", "labels_2d", stacked(true))
    tables.write(truth / "skeletons_3d.parquet", "skeletons_3d", skeleton_columns(subject, sequence, points))
    tables.write(results / f"frames/{sequence}.parquet", "frames", stacked(index))
    skeleton = results / f"triangulate/{sequence}.parquet"
    noisy = points + rng.normal(0, 0.01, points.shape)
    tables.write(skeleton, "skeletons_3d", skeleton_columns(subject, sequence, noisy))
    detections, boxes = None, {}
    if session == "field":
        detections = results / f"detections/{sequence}.parquet"
        tables.write(detections, "detections", stacked(found))
        boxes = {"cam04": root / f"config/boxes/{sequence}.cam04.csv"}
        write_boxes(boxes["cam04"], project(cameras[3], points)[0], every=10)
    poses = results / f"place/{sequence}.parquet"
    camera_tables.write_cameras(poses, cameras)
    evaluate.run(
        sequence=sequence,
        subject=subject,
        labels=labels,
        skeleton=skeleton,
        cameras=[poses],
        roles={camera.name: camera.role for camera in cameras},
        detected=evaluate.Detected(detections, 0.3, None, []),
        yardsticks=evaluate.Yardsticks(boxes, [], [], {}, truth),
        out=results / f"evaluate/{sequence}.parquet",
        out_frames=results / f"evaluate/{sequence}.frames.parquet",
        out_checks=results / f"evaluate/{sequence}.checks.parquet",
        out_quantiles=results / f"evaluate/{sequence}.quantiles.parquet",
        findings=results / f"evaluate/{sequence}.findings.parquet",
    )
    return SimpleNamespace(labels=labels, detections=detections, boxes=boxes, skeleton=skeleton)


def write_boxes(path, uv, every, margin=3.0):
    path.parent.mkdir(parents=True, exist_ok=True)
    lines = ["frame,u_min,v_min,u_max,v_max"]
    for frame in range(0, len(uv), every):
        low, high = uv[frame].min(axis=0) - margin, uv[frame].max(axis=0) + margin
        lines.append(f"{frame},{low[0]:.2f},{low[1]:.2f},{high[0]:.2f},{high[1]:.2f}")
    path.write_text("\n".join(lines) + "\n")


@pytest.fixture(scope="session")
def capture(tmp_path_factory):
    """`root`, and by sequence `labels`, `detections`, `boxes`, `skeleton`; `cameras`, `findings`, `metrics` files."""
    return write_capture(tmp_path_factory.mktemp("capture"))


def write_capture(root):
    write_project(root, SEQUENCES)
    made = {s[0]: write_sequence(root, i, *s) for i, s in enumerate(SEQUENCES)}
    cameras = []
    for session in ("lab", "field"):
        cameras.append(root / f"results/cameras/{session}.parquet")
        camera_tables.write_cameras(cameras[-1], rig(session == "field"), session)
    covariances, turns = write_certainty(root / "results")
    clocks, clock_costs = write_clocks(root / "results")
    findings = root / "results/findings.parquet"
    tables.write_findings(
        findings,
        [
            ("outdoor_01/cam02", "info", "left_right_swapped", "left and right exchanged at 33 of 90 instants"),
            ("outdoor_02/cam02", "warning", "gap", "no detections between 1.2 s and 1.9 s"),
            ("outdoor_02", "error", "made_up", "something is <wrong> here"),
        ],
    )
    adjusted = root / "results/adjust/field.metrics.parquet"
    tables.write(adjusted, "metrics", adjust_columns())
    csv = root / "results/evaluate/metrics.csv"
    each = [root / f"results/evaluate/{s[0]}.parquet" for s in SEQUENCES]
    metrics.run(inputs=[adjusted, *each], checks=[path.with_suffix(".checks.parquet") for path in each], out=csv)
    return SimpleNamespace(
        root=root,
        sequences=made,
        cameras=cameras,
        covariances=covariances,
        turns=turns,
        clocks=clocks,
        clock_costs=clock_costs,
        findings=[findings],
        metrics=csv,
        quantiles=[root / f"results/evaluate/{s[0]}.quantiles.parquet" for s in SEQUENCES],
        frame_metrics=[root / f"results/evaluate/{s[0]}.frames.parquet" for s in SEQUENCES],
        skeletons=[one.skeleton for one in made.values()],
    )


def write_certainty(results):
    """`camera_covariance` of the field's cameras and `camera_turns` of its close ones."""
    names = ["cam01", "cam02", "cam03", "cam04"]
    sigma = np.concatenate([np.repeat([np.radians(0.05 * (i + 1)), 0.01 * 3**i], 3) for i in range(4)])
    covariance = results / "cameras/field.covariance.parquet"
    camera_tables.write_camera_covariance(covariance, names, np.diag(sigma**2), "field")
    turns, random = results / "moved/field.parquet", np.random.default_rng(5)
    count = 2 * 3
    columns = {key: 0.05 * random.standard_normal(count) for key in ("turn_x", "turn_y", "turn_z")}
    columns |= {key: np.full(count, 0.03) for key in ("sigma_x", "sigma_y", "sigma_z")}
    words = {"session": repeat(["field"], count), "camera": np.array(names[:3] * 2, object)}
    words["sequence"] = repeat(["outdoor_01", "outdoor_02"], 3)
    tables.write(turns, "camera_turns", words | columns)
    return [covariance], [turns]


# ms late, source, method of the cameras' clocks; what marks told is in a table of costs of its own
CLOCKS = {
    "indoor_01": {
        "cam01": (499.0, "estimated", "detections"),
        "cam02": (483.0, "estimated", "detections"),
        "cam03": (519.0, "estimated", "detections"),
        "cam04": (485.0, "estimated", "marks"),
    },
    "outdoor_01": {
        "cam01": (0.0, "reference", ""),
        "cam02": (9.0, "estimated", "cameras"),
        "cam03": (50.0, "manual", ""),
        "cam04": (0.0, "assumed_zero", ""),
    },
    "outdoor_02": {
        "cam01": (0.0, "reference", ""),
        "cam02": (-4.0, "estimated", "cameras"),
        "cam03": (6.0, "estimated", "cameras"),
        "cam04": (-28.0, "estimated", "boxes"),
    },
}
LAGS_S = np.arange(-60, 61) / 30
LEAST_PX, RISE = 1.5, 40.0  # px, px/s: a residual that is least at the true offset


def write_clocks(results):
    """`offsets` and `clock_costs` of each sequence; cam03 of outdoor_01 is 50 ms late by hand, in truth it is not."""
    errors = {"reference": (0.0, 0.0), "estimated": (0.002, 40.0), "manual": (0.0, 0.0)}
    offsets, costs, marked = [], [], []
    for sequence, cameras in CLOCKS.items():
        offsets.append(results / f"clocks/{sequence}.parquet")
        clocks = {
            camera: on_axis.Clock(ms / 1e3, 12.0, source, method, 1.5, errors.get(source, (np.nan, np.nan)))
            for camera, (ms, source, method) in cameras.items()
        }
        on_axis.write(offsets[-1], results / f"clocks/{sequence}.gains.parquet", sequence, clocks)
        searched = {c: 0.0 if one[1] == "manual" else one[0] for c, one in cameras.items() if one[1] != "reference"}
        told = [camera for camera in searched if cameras[camera][2] != "marks"]
        costs.append(results / f"clocks/{sequence}.costs.parquet")
        tables.write(costs[-1], "clock_costs", cost_columns(sequence, {c: searched[c] for c in told}))
        for camera in searched.keys() - set(told):
            marked.append(results / f"locate/lab/{camera}.clock_costs.parquet")
            tables.write(marked[-1], "clock_costs", cost_columns(sequence, {camera: searched[camera]}))
    return offsets, costs + marked


def cost_columns(sequence, best):
    """Columns of `clock_costs`. `best`: camera -> ms at which it is least."""
    return {
        "sequence": repeat([sequence], len(best) * len(LAGS_S)),
        "camera": repeat(list(best), len(LAGS_S)),
        "lag_s": np.tile(LAGS_S, len(best)),
        "cost_px": np.concatenate([LEAST_PX + RISE * np.abs(LAGS_S - ms / 1e3) for ms in best.values()]),
    }


def adjust_columns():
    cameras = ["", "cam01", "cam02", "cam03"]
    values = {"adjust_error_before": [12.0, 11.0, 12.5, 12.5], "adjust_error_after": [4.0, 3.8, 4.2, 4.0]}
    return {
        "metric": repeat(list(values), 4),
        "camera": np.array(cameras * 2, dtype=object),
        "value": np.concatenate(list(values.values())),
        "unit": repeat(["px"], 8),
        "n": np.array([3000, 1000, 1000, 1000] * 2),
    }
