"""A small project whose steps have run: four walks of three people, one of whom did not agree to the release."""

import csv
from dataclasses import fields

import cv2
import numpy as np
import yaml

from dior.gait import gait
from dior.geometry import camera_tables
from dior.geometry.camera import Camera, Intrinsics
from dior.release import package, provenance
from dior.tables import tables

RELEASE = {
    "version": "0.1.0",
    "title": 'Walks: a "test"',
    "license": "CC-BY-NC-4.0",
    "authors": ["Person, A.", "The Lab"],
}
# sequence, subject, session, environment, outfit
WALKS = (
    ("walk_1", "Realname", "lab", "indoor", "coat"),
    ("walk_2", "Realname", "field", "outdoor", "shirt"),
    ("walk_3", "Secondname", "field", "outdoor", "coat"),
    ("walk_4", "Refuser", "field", "outdoor", "coat"),
)
PSEUDONYM = {"Realname": "zebra-0001", "Secondname": "apple-0002", "Refuser": "mango-0003"}
CONSENT = {"Realname": "yes", "Secondname": "TRUE", "Refuser": "no"}
ROLES = {"cam01": "close", "cam02": "long_range", "cam03": "close"}
JOINTS = ("nose", "left_hip")
FRAMES = 3
SEQUENCES = (
    "sequence session_order subject session environment outfit walk bags mocap detections trigger_log "
    "exclude_reason truth"
).split()


def write_config(root, release=None):
    """Write config/ but for the sheets."""
    config = root / "config"
    files = {"config.yaml": yaml.safe_dump({"data_root": "data", "release": RELEASE | (release or {})})}
    for session in ("lab", "field"):
        files[f"sessions/{session}/session.yaml"] = f"cameras: [{', '.join(ROLES)}]\n"
        for i, (camera, role) in enumerate(ROLES.items()):
            files[f"sessions/{session}/{camera}.yaml"] = (
                f"role: {role}\ntopic: /host/{camera}/image\nlocate: reference\n"
                f"tape: {{position_m: [{i}, 4, 1.5]}}\n"
                f"reference: {{file: poses.toml, name: {camera}, convention: cTw}}\n"
            )
    files["boxes/walk_2.cam02.csv"] = "frame,u_min,v_min,u_max,v_max\n2,1,2,3,4.5\n0,,,,\n1,5,6,7,8\n"
    files["boxes/walk_4.cam02.csv"] = "frame,u_min,v_min,u_max,v_max\n1,5,6,7,8\n"
    files["checks/walk_1.cam01.csv"] = "sequence,frame,joint,u,v\nwalk_1,1,nose,10,20.5\nwalk_1,2,nose,,\n"
    for name, text in files.items():
        path = config / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)


def sheets(root, consent, truth="", walks=WALKS):
    """Write the sheets; walk_5 is excluded. Everybody agreed to be processed."""
    lines = []
    for i, (name, who, session, environment, outfit) in enumerate(walks):
        mocap, detections = ("a.c3d", "") if environment == "indoor" else ("", "mlkit/{camera}.jsonl")
        row = [name, str(i), who, session, environment, outfit, "line", f"{name}/host.bag", mocap, detections]
        lines.append([*row, "", "", truth])
    lines.append(
        ["walk_5", "9", "Realname", "field", "outdoor", "", "", "x", "", "x/{camera}.jsonl", "", "lens cap on", truth],
    )
    (root / "config/sequences.tsv").write_text("\n".join("\t".join(line) for line in [SEQUENCES, *lines]) + "\n")
    names = [*PSEUDONYM, *sorted({who for _, who, *_ in walks} - set(PSEUDONYM))]
    people = [
        f"{who}\t{PSEUDONYM.get(who, f'p-{who}-000')}\t{'1.72' if who == 'Realname' else ''}\t\t{consent[who]}\tyes"
        for who in names
    ]
    columns = "subject\tpseudonym\theight_m\theight_sigma_m\tconsent_release\tconsent_processing"
    (root / "config/subjects.tsv").write_text("\n".join([columns, *people]) + "\n")


def labels(path, who, name, camera):
    n = FRAMES * len(JOINTS)
    columns = {
        "subject": [who] * n,
        "sequence": [name] * n,
        "camera": [camera] * n,
        "joint": list(JOINTS) * FRAMES,
        "frame": np.repeat(np.arange(FRAMES), len(JOINTS)),
        "stamp_ns": np.repeat(np.arange(FRAMES) * 10**8, len(JOINTS)),
        "u": np.arange(n, dtype=float),
        "v": np.full(n, np.nan),
        "sigma_u": 0.1 * (int(name[-1]) + np.arange(n, dtype=float)),
        "sigma_v": np.where(np.arange(n) == 2, np.nan, 0.25),
        "status": np.array(["ok", "out_of_frame"] * FRAMES, dtype=object),
        "source": ["mocap"] * n,
    }
    tables.write(path, "labels_2d", columns, metadata={"made_by": f"/home/{who}"})


def skeleton(path, who, name):
    columns = {"subject": [who] * 2, "sequence": [name] * 2, "joint": list(JOINTS), "instant": [0, 0],
               "stamp_ns": [0, 0], "x": [1.0, np.nan], "status": ["ok", "too_few_views"]}  # fmt: skip
    tables.write(path, "skeletons_3d", columns)


def walked(results, who, name):
    """The tables of the gait, of which there is none in such a skeleton; returns their paths."""
    out = [results / f"gait/{name}{part}.parquet" for part in ("", ".events", ".steps")]
    gait.run(
        sequence=name, subject=who, skeleton=results / f"mocap/{name}.parquet", out=out[0], out_events=out[1],
        out_steps=out[2], findings=results / f"gait/{name}.findings.parquet",
    )  # fmt: skip
    return out


def frames(path, name):
    n = FRAMES * len(ROLES)
    columns = {
        "camera": np.repeat(list(ROLES), FRAMES).astype(object),
        "frame": list(range(FRAMES)) * len(ROLES),
        "stamp_ns": [i * 10**8 for i in range(FRAMES)] * len(ROLES),
        "receive_ns": [7, 8, 9] * len(ROLES),
        "bag": [f"{name}/host.bag"] * n,
        "topic": ["/host/image"] * n,
        "nth": [0] * n,
        "height": [36] * n,
        "width": [64] * n,
    }
    tables.write(path, "frames", columns)


def pixels(path, who, name, camera, count=FRAMES):
    """Pictures of one grey each; the last frame has none."""
    grey = [np.full((36, 64, 3), 40 * i + 20, np.uint8) for i in range(count - 1)]
    pictures = [*(cv2.imencode(".jpg", picture)[1].tobytes() for picture in grey), None]
    columns = {
        "subject": [who] * count,
        "sequence": [name] * count,
        "camera": [camera] * count,
        "frame": np.arange(count),
        "stamp_ns": np.arange(count) * 10**8,
        "height": [36] * count,
        "width": [64] * count,
        "image": pictures,
        "no_image": [*[""] * (count - 1), "head_unknown"],
    }
    tables.write(path, "released_frames", columns)


def covers(path, who, name, camera):
    """A head in the first picture, and something else in the second."""
    columns = {"subject": [who] * 2, "sequence": [name] * 2, "camera": [camera] * 2, "frame": [0, 1],
               "stamp_ns": [0, 10**8], "what": ["head", "other"]}  # fmt: skip
    edges = zip(("u_min", "v_min", "u_max", "v_max"), (8.0, 8.0, 16.0, 16.0), strict=True)
    tables.write(path, "released_covers", columns | {key: [value] * 2 for key, value in edges})


def clocks(path, name):
    """cam01 is the reference, cam02 is 20 ms late and has no known error."""
    columns = {"sequence": [name] * 3, "camera": list(ROLES), "offset_s": [0.0, 0.02, -0.01],
               "drift_ppm": [0.0, 5.0, 0.0], "sigma_s": [0.0, np.nan, 0.001],
               "source": ["reference", "estimated", "manual"], "method": ["", "boxes", ""]}  # fmt: skip
    tables.write(path, "offsets", columns)


def detections(path):
    close = [camera for camera, role in ROLES.items() if role == "close"]
    n = FRAMES * len(close)
    columns = {
        "camera": np.repeat(close, FRAMES).astype(object),
        "frame": list(range(FRAMES)) * len(close),
        "stamp_ns": [i * 10**8 for i in range(FRAMES)] * len(close),
        "person": [0, 0, -1] * len(close),
        "joint": ["nose"] * n,
        "u": np.arange(n, dtype=float),
        "v": np.arange(n, dtype=float),
        "score": np.ones(n),
    }
    tables.write(path, "detections", columns, metadata={"tool": "/home/host/mlkit"})


def marks(path):
    """Marks of cam01 of the field on a released walk and on that of the one who refused."""
    columns = {
        "session": ["field"] * 3,
        "camera": ["cam01"] * 3,
        "sequence": ["walk_2", "walk_4", "walk_2"],
        "frame": [2, 1, 0],
        "joint": ["nose"] * 3,
        **{key: [1.5, 2.5, 3.5] for key in ("u", "v", "x", "y", "z", "residual_px")},
        "inlier": [False, True, True],
    }
    tables.write(path, "marks", columns)


def figure(path, sequence, subject, value, n, metric="coverage"):
    columns = {"metric": [metric], "subject": [subject], "sequence": [sequence], "camera": ["cam01"], "role": ["close"],
               "value": [value], "unit": ["share"], "n": [n]}  # fmt: skip
    tables.write(path, "metrics", columns)


def rig(path, session):
    """Poses of the three cameras and, beside them, the joint covariance of the two close ones."""
    lens = Intrinsics(64, 36, 640.0, 640.0, 31.5, 17.5)
    cameras = [Camera(name, lens, np.eye(4), ROLES[name], "reference") for name in reversed(ROLES)]
    camera_tables.write_cameras(path, cameras, session)
    covariance = np.diag(np.arange(1.0, 13.0))
    covariance[0, 6] = covariance[6, 0] = 0.5
    camera_tables.write_camera_covariance(
        path.with_suffix(".covariance.parquet"), ["cam01", "cam03"], covariance, session
    )


def project(root, walks=WALKS):
    """Write a project below `root` and return the flags of the step by name."""
    write_config(root)
    sheets(root, CONSENT, walks=walks)
    results = root / "results"
    lists = (
        "labels",
        "pixels",
        "covers",
        "skeletons",
        "gait",
        "frames",
        "detections",
        "metrics",
        "cameras",
        "covariances",
        "clocks",
        "quantiles",
    )
    found = {name: [] for name in (*lists, "provenance")}

    def add(kind, path):
        found[kind].append(results / path)
        return found[kind][-1]

    for i, (name, real, _, environment, _) in enumerate(walks):
        who = PSEUDONYM[real]
        for camera in ROLES:
            labels(add("labels", f"reproject/{name}.{camera}.parquet"), who, name, camera)
            pixels(add("pixels", f"pixels/{name}.{camera}.parquet"), who, name, camera)
            covers(add("covers", f"pixels/{name}.{camera}.covers.parquet"), who, name, camera)
        skeleton(add("skeletons", f"mocap/{name}.parquet"), who, name)
        found["gait"] += walked(results, who, name)
        frames(add("frames", f"frames/{name}.parquet"), name)
        clocks(add("clocks", f"clocks/{name}.parquet"), name)
        if environment == "outdoor":
            detections(add("detections", f"detections/{name}.parquet"))
        figure(add("metrics", f"evaluate/{name}.parquet"), name, who, (0.5, 0.8, 0.9, 0.0)[i], (10, 10, 20, 1000)[i])
        bag = root / f"data/{name}/host.bag"
        bag.parent.mkdir(parents=True)
        bag.write_text(f"the bag of {name}")
        provenance.run(sequence=name, recordings={"bag_1": bag}, out=add("provenance", f"provenance/{name}.json"))
    for session in sorted({session for _, _, session, *_ in walks}):
        rig(add("cameras", f"place/{session}.parquet"), session)
        found["covariances"].append(found["cameras"][-1].with_suffix(".covariance.parquet"))
    figure(add("metrics", "adjust/field.metrics.parquet"), "", "", 8.0, 5, "adjust_error_after")
    marks(results / "locate/field/cam01.marks.parquet")
    return {
        "project": root,
        "config": yaml.safe_load((root / "config/config.yaml").read_text()),
        **found,
        "marks": [results / "locate/field/cam01.marks.parquet"],
        "findings": [],
        "gallery": None,
        "steps": {"label.reproject": "0123abcd"},
        "out": results / "release/dior-0.1.0",
    }


def build(given, **changes):
    """Run the step with the flags `given` and `changes`; returns the folder of the release."""
    left = {**given, **changes}
    groups = {"of_walks": package.WalkFiles, "of_cameras": package.CameraFiles}
    grouped = {name: of(**{field.name: left.pop(field.name) for field in fields(of)}) for name, of in groups.items()}
    package.run(**grouped, **left)
    return left["out"]


def files(folder):
    """Content by path of all files in a folder."""
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def run_by_a_spreadsheet(folder):
    """(file, cell) of the cells of CSV and TSV files in a folder that a spreadsheet would take for a formula."""
    found = []
    for path in sorted((*folder.rglob("*.csv"), *folder.rglob("*.tsv"))):
        with path.open(newline="") as stream:
            for row in csv.reader(stream, delimiter="\t" if path.suffix == ".tsv" else ","):
                found += [(path.name, cell) for cell in row if cell[:1] in tuple("=+-@\t\r") and not number(cell)]
    return found


def number(cell):
    try:
        return bool(float(cell)) or True
    except ValueError:
        return False
