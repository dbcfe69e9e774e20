"""A small release of the decided layout, table by table, whose parts a test can change.

Its labels are where its 3D, its cameras and its clocks put them, its figures are those of its tables, and its texts say
what its provenance.json says.
"""

import hashlib
import json

import cv2
import numpy as np
import pyarrow.parquet as pq

from dior.evaluate import evaluate
from dior.evaluate.metrics import as_csv
from dior.gait import gait
from dior.geometry import camera_tables
from dior.project import licenses
from dior.release import card as cards
from dior.release import checksums, citation, croissant, metrics_csv
from dior.report.numbers import show
from dior.tables import tables
from tests.rig import camera as camera_at

JOINTS = ("nose", "left_hip", "right_hip")
# sequence -> subject, session, environment; the cameras of a session are cam01, close, and cam02, far outdoors
WALKS = {
    "walk_1": ("zebra-0001", "lab", "indoor"),
    "walk_2": ("zebra-0001", "field", "outdoor"),
    "walk_3": ("apple-0002", "field", "outdoor"),
}
CAMERAS = ("cam01", "cam02")
FRAMES, WIDTH, HEIGHT = 4, 32, 24
STEP_NS = 10**8
# all cameras are at the origin and look along z; what they see is FAR away, m, and their clocks are LATE_NS behind
FOCAL, FAR, LATE_NS = 20.0, 2.0, 5 * 10**8
EVERYONE = ("apple-0002", "zebra-0001")


def walks(who=EVERYONE):
    return {name: walk for name, walk in WALKS.items() if walk[0] in who}


def role(session, camera):
    return "long_range" if (session, camera) == ("field", "cam02") else "close"


def stamps(count=FRAMES):
    return 10**18 + STEP_NS * np.arange(count)


def labels(name, camera, /, **changed):
    who = WALKS[name][0]
    each, n = len(JOINTS), FRAMES * len(JOINTS)
    body = skeleton(name)
    status = np.array(["ok"] * n, object)
    status[:2] = "out_of_frame", "missing_3d"
    u, v = (FOCAL * body[key].astype(np.float32).astype(float) / FAR + FOCAL for key in "xy")
    return {
        "subject": [who] * n,
        "sequence": [name] * n,
        "camera": [camera] * n,
        "joint": np.array(JOINTS * FRAMES, object),
        "frame": np.repeat(np.arange(FRAMES), each),
        "stamp_ns": np.repeat(stamps(), each),
        "u": u,
        "v": v,
        "depth": body["z"],
        "sigma_u": np.full(n, 0.5),
        "status": status,
        "source": ["triangulated"] * n,
    } | changed


def skeleton(name, /, **changed):
    n = FRAMES * len(JOINTS)
    rng = np.random.default_rng(ord(name[-1]))
    x, y = (rng.uniform(5, 20, n) - FOCAL) * FAR / FOCAL, (rng.uniform(5, 20, n) - FOCAL) * FAR / FOCAL
    status = np.array(["ok"] * n, object)
    x[:2], status[1] = ((-9 - FOCAL) * FAR / FOCAL, np.nan), "too_few_views"
    return {
        "subject": [WALKS[name][0]] * n,
        "sequence": [name] * n,
        "joint": np.array(JOINTS * FRAMES, object),
        "instant": np.repeat(np.arange(FRAMES), len(JOINTS)),
        "stamp_ns": np.repeat(stamps() + LATE_NS, len(JOINTS)),
        "x": x,
        "y": np.where(status == "ok", y, np.nan),
        "z": np.where(status == "ok", FAR, np.nan),
        "status": status,
    } | changed


def jpeg(seed=0, size=(HEIGHT, WIDTH)):
    """Bytes as the release has them: without the segment that OpenCV writes before the picture."""
    picture = np.random.default_rng(seed).integers(0, 255, (*size, 3), np.uint8)
    data = cv2.imencode(".jpg", picture)[1].tobytes()
    assert data[2:4] == b"\xff\xe0"
    return data[:2] + data[4 + int.from_bytes(data[4:6]) :]


def frames(name, camera, /, **changed):
    image = np.empty(FRAMES, object)
    image[:] = [jpeg(i) for i in range(FRAMES)]
    image[3] = None
    return {
        "subject": [WALKS[name][0]] * FRAMES,
        "sequence": [name] * FRAMES,
        "camera": [camera] * FRAMES,
        "frame": np.arange(FRAMES),
        "stamp_ns": stamps(),
        "height": [HEIGHT] * FRAMES,
        "width": [WIDTH] * FRAMES,
        "image": image,
        "no_image": ["", "", "", "head_unknown"],
    } | changed


def boxes(name, camera, /, **changed):
    edges = {
        key: [value] for key, value in zip(("u_min", "v_min", "u_max", "v_max"), (2.0, 3.0, 22.0, 21.0), strict=True)
    }
    told = {"subject": [WALKS[name][0]], "sequence": [name], "camera": [camera]}
    return {**told, "frame": [2], "stamp_ns": [int(stamps()[2])], **edges} | changed


def marks(name, /, **changed):
    told = {"subject": [WALKS[name][0]], "sequence": [name], "camera": ["cam01"], "kind": ["mark"]}
    where = {"frame": [1], "stamp_ns": [int(stamps()[1])], "joint": ["LASI"]}
    return {**told, **where, "u": [1.0], "v": [2.0], "inlier": [1]} | changed


def detections(name, camera, /, **changed):
    told = {"subject": [WALKS[name][0]], "sequence": [name], "camera": [camera]}
    return {**told, "frame": [3], "stamp_ns": [int(stamps()[3])], "person": [0], "joint": ["nose"]} | changed


def cameras(who=EVERYONE, /, **changed):
    names = sorted({(session, camera) for _, session, _ in walks(who).values() for camera in CAMERAS})
    n = len(names)
    return {
        "session": [session for session, _ in names],
        "camera": [camera for _, camera in names],
        "role": [role(*name) for name in names],
        "locate": ["tape"] * n,
        "width": [WIDTH] * n,
        "height": [HEIGHT] * n,
        **{key: [FOCAL] * n for key in ("fx", "fy", "cx", "cy")},
        "distortion_model": ["plumb_bob"] * n,
        "distortion": np.zeros((n, 8)),
        "wTc": np.tile(np.eye(4).ravel(), (n, 1)),
        "covariance": np.tile(np.eye(6).ravel(), (n, 1)),
    } | changed


def sequences(who=EVERYONE, /, **changed):
    rows = walks(who)
    return {
        "sequence": list(rows),
        "session": [session for _, session, _ in rows.values()],
        "session_order": list(range(len(rows))),
        "subject": [subject for subject, _, _ in rows.values()],
        "environment": [environment for _, _, environment in rows.values()],
    } | changed


def clocks(who=EVERYONE, /, **changed):
    rows = [(subject, name, camera) for name, (subject, *_) in walks(who).items() for camera in CAMERAS]
    return {
        **{key: [row[i] for row in rows] for i, key in enumerate(("subject", "sequence", "camera"))},
        "offset_s": [0.5] * len(rows),
        "drift_ppm": [0.0] * len(rows),
        "source": ["estimated"] * len(rows),
        "method": ["cameras"] * len(rows),
    } | changed


def splits(who=EVERYONE, /, **changed):
    rows = [
        ("subject", "test" if subject == who[0] else "train", subject, name, camera)
        for name, (subject, *_) in walks(who).items()
        for camera in CAMERAS
    ]
    return {
        key: [row[i] for row in sorted(rows)]
        for i, key in enumerate(("split", "part", "subject", "sequence", "camera"))
    } | changed


CARD = """---
pretty_name: "made up"
license: "cc0-1.0"
---
# made up

Version 0.1.0. Licence: [CC0-1.0]({url}).

{summary}

| environment | camera | role | sequences | frames | labels in the picture | share of all |
|---|---|---|---:|---:|---:|---:|
{rows}

| figure | tool | session | over | value | n |
|---|---|---|---|---:|---:|
{figures}

{cited}
"""


ABOUT = {"title": "made up", "version": "0.1.0", "license": "CC0-1.0", "license_file": "", "authors": [], "doi": "",
         "year": 0, "date": ""}  # fmt: skip


def summary(who=EVERYONE, labels_each=10):
    rows = {name: {"subject": one, "environment": place} for name, (one, _, place) in walks(who).items()}
    recordings = [role(session, camera) for _, session, _ in walks(who).values() for camera in CAMERAS]
    counted = [
        {"what": what, "environment": "", "role": which, "camera": "", "reason": "", "value": each * n}
        for what, each in (("keypoints_2d", labels_each), ("frames", FRAMES))
        for which, n in (("", len(recordings)), ("long_range", recordings.count("long_range")))
    ]
    return cards.summary(rows, counted)


def figures(folder, who=EVERYONE):
    """Rows of metrics.csv, by the step that measures the labels."""
    steps, paths = folder.parent / "steps", []
    steps.mkdir(exist_ok=True)
    for name, (subject, session, _) in walks(who).items():
        drawn = steps / f"{name}.csv"
        edges = boxes(name, "cam02")
        keys = ("frame", "u_min", "v_min", "u_max", "v_max")
        drawn.write_text(f"{','.join(keys)}\n{','.join(str(edges[key][0]) for key in keys)}\n")
        paths.append(steps / f"{name}.parquet")
        poses = steps / f"{name}.cameras.parquet"
        camera_tables.write_cameras(poses, [camera_at("cam02", (60, 0, 2), (0, 0, 1))])
        evaluate.run(
            sequence=name,
            subject=subject,
            labels=[folder / f"labels_2d/{subject}/{name}.{camera}.parquet" for camera in CAMERAS],
            skeleton=None,
            cameras=[poses],
            roles={camera: role(session, camera) for camera in CAMERAS},
            detected=evaluate.Detected(None, 0.3, None, []),
            yardsticks=evaluate.Yardsticks({"cam02": drawn}, [], [], {}, None),
            out=paths[-1],
            out_frames=steps / "frames.parquet",
            out_checks=steps / "checks.parquet",
            out_quantiles=steps / "quantiles.parquet",
            findings=steps / "findings.parquet",
        )
    return metrics_csv.released(paths, {name: {"subject": subject} for name, (subject, *_) in walks(who).items()})


def card(who=EVERYONE, labels_each=10, shown=()):
    total = {}
    for _, session, environment in walks(who).values():
        for camera in CAMERAS:
            key = (environment, camera, role(session, camera).replace("_", "-"))
            total[key] = total.get(key, 0) + 1
    rows = [
        f"| {' | '.join(key)} | {n} | {n * FRAMES} | {n * labels_each} | 0.833 |" for key, n in sorted(total.items())
    ]
    pooled = cards.pooled_figures(shown, {name: session for name, (_, session, _) in walks(who).items()})
    lines = [f"| {' | '.join(place)} | {show(value, unit)} | {n} |" for place, (value, unit, n) in pooled.items()]
    return CARD.format(
        rows="\n".join(rows),
        figures="\n".join(lines),
        url=licenses.url("CC0-1.0"),
        summary=summary(who, labels_each),
        cited=citation.bibtex(ABOUT),
    )


def write(folder, name, table, columns):
    """One table of the release, and the checksums made anew, as who changes a release on purpose would."""
    tables.write(folder / name, table, columns)
    content = json.loads((folder / "croissant.json").read_text())
    for one in content["distribution"]:
        if one.get("contentUrl") == name:
            one["sha256"] = checksums.digest(open(folder / name, "rb"))
    (folder / "croissant.json").write_text(json.dumps(content) + "\n")
    remade(folder)


def remade(folder):
    for path in folder.rglob(checksums.SUMS):
        path.unlink()
    for path in (folder / checksums.FOLDER).glob("*"):
        path.rmdir()
    checksums.write(folder)


def of_version(folder, version):
    """The release with tables of another version."""
    for path in folder.rglob("*.parquet"):
        table = pq.read_table(path)
        table = table.replace_schema_metadata({**table.schema.metadata, b"dior_table_version": version})
        pq.write_table(table, path)
    remade(folder)


def release(folder, who=EVERYONE):
    """Write the release of some of the people."""
    for name, (subject, *_) in walks(who).items():
        for camera in CAMERAS:
            recording = f"{subject}/{name}.{camera}.parquet"
            tables.write(folder / "labels_2d" / recording, "labels_2d", labels(name, camera))
            tables.write(folder / "frames" / recording, "released_frames", frames(name, camera))
            tables.write(folder / "boxes" / recording, "released_boxes", boxes(name, camera))
            tables.write(folder / "detections" / recording, "released_detections", detections(name, camera))
        tables.write(folder / f"skeletons_3d/{subject}/{name}.parquet", "skeletons_3d", skeleton(name))
        tables.write(folder / f"marks/{subject}/{name}.parquet", "released_marks", marks(name))
        _walked(folder, subject, name)
    rig = cameras(who)
    pairs = {"session": rig["session"], "camera": rig["camera"], "other": rig["camera"]}
    pairs["covariance"] = rig["covariance"]
    for name, table, columns in (
        ("cameras", "released_cameras", rig),
        ("camera_covariance", "camera_covariance", pairs),
        ("sequences", "sequences", sequences(who)),
        ("subjects", "subjects", {"subject": sorted(who), "height_m": [1.7] * len(who)}),
        ("clocks", "released_clocks", clocks(who)),
        ("splits", "splits", splits(who)),
        ("gallery", "released_gallery", {"subject": sorted(who), "angle": ["frontal"] * len(who)}),
    ):
        tables.write(folder / f"{name}.parquet", table, columns)
    shown = figures(folder, who)
    (folder / "README.md").write_text(card(who, shown=shown))
    (folder / "metrics.csv").write_text(as_csv(shown))
    (folder / "LICENSE").write_text(licenses.text(ABOUT, ""))
    (folder / "CITATION.cff").write_text(citation.text(ABOUT))
    section = ABOUT | {"faces": "shown", "shift_stamps": False}
    (folder / "croissant.json").write_text(json.dumps(croissant.content(folder, section, summary(who), False)) + "\n")
    (folder / "provenance.json").write_text(json.dumps(provenance(who)) + "\n")
    checksums.write(folder)
    return folder


def _walked(folder, subject, name):
    """The tables of the gait, of which there is none without feet."""
    out, out_events, out_steps = (
        folder / f"{kind}/{subject}/{name}.parquet" for kind in ("gait", "gait_events", "gait_steps")
    )
    beside = folder.with_name(f"{name}.findings.parquet")
    gait.run(
        sequence=name, subject=subject, skeleton=folder / f"skeletons_3d/{subject}/{name}.parquet", out=out,
        out_events=out_events, out_steps=out_steps, findings=beside,
    )  # fmt: skip
    beside.unlink()


def provenance(who=EVERYONE):
    """As provenance_json.py writes it."""
    config = {"refine.method": "spline", "triangulate.min_score": 0.3, "detector.min_score": 0.3}
    config |= {f"release.{key}": value for key, value in ABOUT.items()}
    return {
        "provenance_version": 1,
        "release": "0.1.0",
        "config": config,
        "config_sha256": hashlib.sha256(json.dumps(config, sort_keys=True).encode()).hexdigest(),
        "sessions": {
            session: {
                "session.yaml": "s",
                **{f"{camera}.yaml": camera for camera in CAMERAS},
                **({f"{camera}.marks.csv": "m" for camera in CAMERAS} if session == "lab" else {}),
            }
            for session in sorted({session for _, session, _ in walks(who).values()})
        },
        "sequences": {
            name: {
                "recordings": {
                    "bag_1": {"sha256": "b", "bytes": 1},
                    **({"mocap": {"sha256": "m", "bytes": 1}} if environment == "indoor" else {}),
                    **({"detections.cam01": {"sha256": "d", "bytes": 1}} if environment == "outdoor" else {}),
                },
                "by_hand": {f"config/boxes/{name}.cam02.csv": "x"},
            }
            for name, (_, _, environment) in walks(who).items()
        },
        "code": {"label.reproject": "r", "calibrate.adjust": "a", "calibrate.locate": "l"},
        "packages": {"numpy": "1"},
    }
