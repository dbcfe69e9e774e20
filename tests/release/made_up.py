"""A small release of the decided layout, table by table, whose parts a test can change."""

import json

import cv2
import numpy as np
import pyarrow.parquet as pq

from dior.release import checksums
from dior.tables import tables

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
    rng = np.random.default_rng([ord(name[-1]), ord(camera[-1])])
    status = np.array(["ok"] * n, object)
    u, v = rng.uniform(5, 20, n), rng.uniform(5, 20, n)
    status[0], u[0] = "out_of_frame", -9
    status[1], u[1], v[1] = "missing_3d", np.nan, np.nan
    return {
        "subject": [who] * n,
        "sequence": [name] * n,
        "camera": [camera] * n,
        "joint": np.array(JOINTS * FRAMES, object),
        "frame": np.repeat(np.arange(FRAMES), each),
        "stamp_ns": np.repeat(stamps(), each),
        "u": u,
        "v": v,
        "sigma_u": np.full(n, 0.5),
        "status": status,
        "source": ["triangulated"] * n,
    } | changed


def skeleton(name, /, **changed):
    n = FRAMES * len(JOINTS)
    x = np.arange(n, dtype=float)
    status = np.array(["ok"] * n, object)
    x[1], status[1] = np.nan, "too_few_views"
    return {
        "subject": [WALKS[name][0]] * n,
        "sequence": [name] * n,
        "joint": np.array(JOINTS * FRAMES, object),
        "instant": np.repeat(np.arange(FRAMES), len(JOINTS)),
        "stamp_ns": np.repeat(stamps(), len(JOINTS)),
        "x": x,
        "y": np.where(status == "ok", 1.0, np.nan),
        "z": np.where(status == "ok", 2.0, np.nan),
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
    edges = {key: [float(i)] for i, key in enumerate(("u_min", "v_min", "u_max", "v_max"))}
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
        **{key: [20.0] * n for key in ("fx", "fy", "cx", "cy")},
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
pretty_name: made up
---
| environment | camera | role | sequences | frames | labels in the picture | share of all |
|---|---|---|---:|---:|---:|---:|
{}

The end.
"""


def card(who=EVERYONE, labels_each=10):
    total = {}
    for _, session, environment in walks(who).values():
        for camera in CAMERAS:
            key = (environment, camera, role(session, camera).replace("_", "-"))
            total[key] = total.get(key, 0) + 1
    rows = [
        f"| {' | '.join(key)} | {n} | {n * FRAMES} | {n * labels_each} | 0.833 |" for key, n in sorted(total.items())
    ]
    return CARD.format("\n".join(rows))


def write(folder, name, table, columns):
    """One table of the release, and the checksums made anew, as who changes a release on purpose would."""
    tables.write(folder / name, table, columns)
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
    (folder / "README.md").write_text(card(who))
    (folder / "metrics.csv").write_text(",".join(tables.columns_of("metrics")) + "\n")
    for name in ("LICENSE", "CITATION.cff"):
        (folder / name).write_text(f"{name}\n")
    (folder / "croissant.json").write_text(json.dumps({"distribution": []}) + "\n")
    (folder / "provenance.json").write_text(json.dumps(provenance(who)) + "\n")
    checksums.write(folder)
    return folder


def provenance(who=EVERYONE):
    """As provenance_json.py writes it."""
    return {
        "provenance_version": 1,
        "release": "0.1.0",
        "config": {"release.faces": "shown", "refine.method": "spline", "triangulate.min_score": 0.3},
        "config_sha256": "c",
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
