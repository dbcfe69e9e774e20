"""How long the report of a dataset of DIOR's size takes, how large it is, and how soon a browser has its pages: 112
sequences of 4 cameras, no pictures.

usage: python -m benchmarks.report [FOLDER]      (FOLDER for the made-up tables and the report; kept when given)

The tables are made up: 3600 pictures a camera, 33 joints, indoor walks with hand checks, outdoor ones with boxes and
two detectors. Contact sheets are grey, so that the size is that of all but the pictures.
"""

import os
import resource
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from benchmarks.viewer import opened
from dior.body.names import MLKIT_33
from dior.evaluate import label_errors, metrics, statistics
from dior.geometry import camera_tables
from dior.geometry.camera import Camera, Intrinsics, pose
from dior.geometry.multiview import look_at
from dior.project.schema_check import columns_of
from dior.report import report
from dior.tables import tables
from dior.tables.files import write_text

LIMIT_S, LIMIT_BYTES = 120.0, 100e6
SUBJECTS, WALKS, FRAMES = 14, 4, 3600
START_NS, STEP_NS = 1_700_000_000_000_000_000, 33_333_333
OF_SEQUENCES = ("frame_metrics", "quantiles", "skeletons", "audits", "dropped", "frames", "clocks", "clock_costs")
LENS = Intrinsics(1280, 720, 640.0, 640.0, 640.0, 360.0)
CAMERAS = ("cam01", "cam02", "cam03", "cam04")
# (value, unit, n) of the made-up figures of a camera recording
CLOSE = {"reprojection_error": (5.0, "px", FRAMES * 33)}
CHECKS = {"check_error": (4.0, "px", 9)}
FAR = {
    "in_box_share": (0.95, "share", 600), "in_box_expected": (0.96, "share", 600), "box_iou": (0.8, "share", 20),
    "box_offset_u": (0.5, "px", 20), "box_offset_v": (-0.5, "px", 20), "box_width_difference": (-2.0, "px", 20),
    "box_height_difference": (-3.0, "px", 20),
}  # fmt: skip
FOUND = {"detected_share": (0.4, "share", FRAMES), "success_share": (0.3, "share", FRAMES)}


def sequences():
    """(sequence, subject, session, environment) of every walk."""
    return [
        (f"{env}_{s:02d}_{w}", f"S{s:02d}", f"{place}_{1 + s % 2}", env)
        for s in range(1, SUBJECTS + 1)
        for env, place in (("indoor", "lab"), ("outdoor", "field"))
        for w in range(1, WALKS + 1)
    ]


def rig(far):
    """Four cameras; the last of a field is 60 m away."""
    places = [(5.0, -4.0, 1.6), (0.0, -5.5, 1.5), (-4.5, 4.0, 1.7), (60.0, 10.0, 2.0) if far else (4.5, 4.5, 1.6)]
    return [
        Camera(
            name, LENS, pose(look_at(place, (0, 0, 1.0)), place), "long_range" if far and i == 3 else "close", "tape"
        )
        for i, (name, place) in enumerate(zip(CAMERAS, places, strict=True))
    ]


def write(root):
    """The project's sheets and tables; the arguments of the report step."""
    rng = np.random.default_rng(1)
    _write_sheets(root)
    results, files = root / "results", {k: [] for k in OF_SEQUENCES}
    cameras, covariances, overlays, rows = [], [], [], []
    for session in ("lab_1", "lab_2", "field_1", "field_2"):
        cameras.append(results / f"cameras/{session}.parquet")
        camera_tables.write_cameras(cameras[-1], rig(session.startswith("field")), session)
        covariances.append(results / f"cameras/{session}.covariance.parquet")
        known = np.diag(np.tile(np.repeat([1e-3, 1e-2], 3), len(CAMERAS)) ** 2)
        camera_tables.write_camera_covariance(covariances[-1], CAMERAS, known, session)
    findings = results / "findings.parquet"
    tables.write_findings(
        findings, [(f"{s}/cam02", "warning", "gap", "no detections between 1.2 s and 1.9 s") for s, *_ in sequences()]
    )
    for sequence, subject, _, env in sequences():
        for key, (path, name, columns) in _tables(rng, results, sequence, subject, env).items():
            tables.write(path, name, columns)
            files[key].append(path)
        rows += _rows(rng, sequence, subject, env)
        for camera in CAMERAS:
            overlays.append(root / f"report/assets/{sequence}/{camera}.jpg")
            overlays[-1].parent.mkdir(parents=True, exist_ok=True)
            overlays[-1].write_bytes(b"\xff\xd8\xff\xd9")
    csv = results / "metrics.csv"
    write_text(csv, metrics.as_csv(metrics.merged(rows)))
    counted = results / "statistics.csv"
    statistics.run(root=root, labels=[], skeletons=files["skeletons"], frames=files["frames"],
                   dropped=files["dropped"], gallery=None, out=counted)  # fmt: skip
    times = {kind: files[kind] for kind in ("audits", "dropped", "frames", "clocks", "clock_costs")}
    return {
        "root": root, "title": "DIOR size",
        "evaluated": report.Evaluated(csv, files["frame_metrics"], files["quantiles"], counted, recognition=[]),
        "findings": [findings], "scene": report.Scene(cameras, covariances, turns=[], skeletons=files["skeletons"]),
        "times": report.Times(**times), "media": report.Media(overlays, clips=[], scenes=[]), "effort": None,
        "out": root / "report", "out_timing": root / "timing.csv",
    }  # fmt: skip


def _write_sheets(root):
    config = root / "config"
    (config / "sessions").mkdir(parents=True)
    (config / "config.yaml").write_text(
        "data_root: data\nrelease: {version: 0.1.0, title: DIOR size, license: CC-BY-NC-4.0, authors: [Someone]}\n"
    )
    sheet = columns_of("sequences")
    lines, order = ["\t".join(sheet)], {}
    for sequence, subject, session, env in sequences():
        order[session] = order.get(session, 0) + 1
        row = {"sequence": sequence, "session_order": str(order[session]), "subject": subject, "session": session,
               "environment": env, "outfit": "own", "walk": "line", "bags": "a.bag",
               "mocap": "a.c3d" if env == "indoor" else "",
               "detections": "mlkit/{camera}.jsonl" if env == "outdoor" else ""}  # fmt: skip
        lines.append("\t".join(row.get(c, "") for c in sheet))
    (config / "sequences.tsv").write_text("\n".join(lines) + "\n")
    people = [f"S{s:02d}\tperson{s:04d}\t1.7\t0.01\tyes" for s in range(1, SUBJECTS + 1)]
    (config / "subjects.tsv").write_text(
        "subject\tpseudonym\theight_m\theight_sigma_m\tconsent_release\n" + "\n".join(people) + "\n"
    )
    for session in ("lab_1", "lab_2", "field_1", "field_2"):
        folder, far = config / "sessions" / session, session.startswith("field")
        folder.mkdir()
        adjust = f"adjust: {{outdoor_0{1 + (session == 'field_1')}_1: {{}}}}\n" if far else ""
        (folder / "session.yaml").write_text(f"cameras: [{', '.join(CAMERAS)}]\n{adjust}")
        for camera in rig(far):
            place = [round(float(x), 3) for x in camera.centre]
            locate = "align" if camera.role == "long_range" else "tape" if far else "marks"
            (folder / f"{camera.name}.marks.csv").write_text("sequence,frame,joint,u,v\n")
            (folder / f"{camera.name}.yaml").write_text(
                f"role: {camera.role}\ntopic: /{camera.name}/color/image_raw/compressed\nintrinsics: camera_info\n"
                f"distortion_model: plumb_bob\nlocate: {locate}\n"
                f"tape: {{position_m: {place}, sigma_m: 0.05, target_m: [0, 0, 1]}}\n"
            )


def _repeat(words, count):
    return np.repeat(np.array(words, dtype=object), count)


def _role(camera, env):
    return "long_range" if env == "outdoor" and camera == "cam04" else "close"


def _tables(rng, results, sequence, subject, env):
    """argument of the report -> (path, table, columns) of one sequence; every camera loses 1 % of its pictures."""
    stamps, receives, values = [], [], []
    for _ in CAMERAS:
        kept = np.sort(rng.choice(int(FRAMES * 1.01), FRAMES, replace=False))
        stamps.append(START_NS + kept * STEP_NS + rng.integers(0, 400_000, FRAMES))
        receives.append(stamps[-1] + rng.gamma(2, 5e6, FRAMES).astype(int))
    frame = np.tile(np.arange(FRAMES), 4)
    stamp_ns, camera = np.concatenate(stamps), _repeat(CAMERAS, FRAMES)
    size = 4 * FRAMES
    index = {
        "camera": camera, "frame": frame, "stamp_ns": stamp_ns, "receive_ns": np.concatenate(receives),
        "bag": _repeat(["a.bag"], size), "topic": _repeat(["t"], size), "nth": np.zeros(size, int),
        "height": np.full(size, 720), "width": np.full(size, 1280),
    }  # fmt: skip
    lost = np.arange(30)
    dropped = {
        "camera": _repeat(CAMERAS[:3], 10), "frame": lost * 100, "stamp_ns": START_NS + lost * 100 * STEP_NS,
        "reason": _repeat(["not_sent", "recorder_behind", "same_picture"], 10),
    }  # fmt: skip
    audit = {"camera": np.array(CAMERAS, dtype=object), "bag": _repeat(["a.bag"], 4)}
    for name in tables.columns_of("stamp_audit")[2:]:
        audit[name] = np.full(4, 3)
    by_picture = {"coverage": 33, "in_picture_share": 33} | ({"reprojection_error": 33} if env == "outdoor" else {})
    values = {name: rng.uniform(0.9, 1, size) if name != "reprojection_error" else rng.gamma(4, 1, size)
              for name in by_picture}  # fmt: skip
    names = list(by_picture)
    frames = {
        "metric": _repeat(names, size), "subject": _repeat([subject], size * len(names)),
        "sequence": _repeat([sequence], size * len(names)), "camera": np.tile(camera, len(names)),
        "role": np.tile(_repeat([_role(c, env) for c in CAMERAS], FRAMES), len(names)),
        "frame": np.tile(frame, len(names)), "stamp_ns": np.tile(stamp_ns, len(names)),
        "value": np.concatenate(list(values.values())), "n": np.full(size * len(names), 33),
    }  # fmt: skip
    t = np.arange(FRAMES) / 30
    walk = np.stack([3 * np.sin(t / 3), 0.5 * np.cos(t / 3), 1 + 0 * t], axis=-1)
    points = (walk[:, None] + rng.normal(0, 0.3, (1, 33, 3))).reshape(-1, 3)
    skeleton = {
        "subject": _repeat([subject], len(points)), "sequence": _repeat([sequence], len(points)),
        "joint": np.tile(np.array(MLKIT_33, dtype=object), FRAMES), "instant": np.repeat(np.arange(FRAMES), 33),
        "stamp_ns": np.repeat(START_NS + np.arange(FRAMES) * STEP_NS, 33), **dict(zip("xyz", points.T, strict=True)),
        "status": _repeat(["ok"], len(points)),
    }  # fmt: skip
    lags, late = np.linspace(-2, 2, 241), rng.normal(0, 0.02, 4)
    costs = {
        "sequence": _repeat([sequence], 4 * 241), "camera": _repeat(CAMERAS, 241), "lag_s": np.tile(lags, 4),
        "cost_px": (1 + 20 * np.abs(lags - late[:, None])).ravel(),
    }  # fmt: skip
    clocks = dict.fromkeys(tables.columns_of("offsets"), np.full(4, 0.003)) | {
        "sequence": _repeat([sequence], 4), "camera": np.array(CAMERAS, dtype=object), "offset_s": late,
        "late_s": late, "late_low": late - 0.006, "late_high": late + 0.006, "source": _repeat(["estimated"], 4),
        "method": _repeat(["detections"], 4),
    }  # fmt: skip
    spread = {"label_sigma": rng.gamma(4, 0.1, 4 * FRAMES), "label_sigma_m": rng.gamma(4, 0.001, 4 * FRAMES)}
    parts = [label_errors.quantile_columns(name, values, one, _role(one, env)) for one in CAMERAS for name, values in
             spread.items()]  # fmt: skip
    quantiles = {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}
    quantiles |= {
        "subject": _repeat([subject], len(quantiles["n"])),
        "sequence": _repeat([sequence], len(quantiles["n"])),
    }
    return {
        "quantiles": (results / f"evaluate/{sequence}.quantiles.parquet", "label_quantiles", quantiles),
        "clocks": (results / f"clocks/{sequence}.parquet", "offsets", clocks),
        "clock_costs": (results / f"clocks/{sequence}.costs.parquet", "clock_costs", costs),
        "frame_metrics": (results / f"evaluate/{sequence}.frames.parquet", "frame_metrics", frames),
        "skeletons": (results / f"refine/{sequence}.parquet", "skeletons_3d", skeleton),
        "audits": (results / f"audit/{sequence}.parquet", "stamp_audit", audit),
        "dropped": (results / f"audit/{sequence}.dropped.parquet", "dropped_frames", dropped),
        "frames": (results / f"frames/{sequence}.parquet", "frames", index),
    }


def _rows(rng, sequence, subject, env):
    found = []
    for camera in CAMERAS:
        role = _role(camera, env)
        where = {"subject": subject, "sequence": sequence, "camera": camera, "role": role}
        far = role == "long_range"
        own = {"coverage": (0.97, "share", FRAMES * 33)} | (CHECKS if env == "indoor" else FAR if far else CLOSE)
        measured = [("", "", own)] + [(tool, "", FOUND) for tool in ("mlkit", "mlkit 4x") if far]
        measured += [("", joint, CLOSE) for joint in MLKIT_33 if env == "outdoor" and not far]
        for tool, joint, values in measured:
            for metric, (value, unit, n) in values.items():
                value = value * rng.uniform(0.9, 1.04) if unit == "share" else value + rng.normal(0, 0.5)
                found.append(
                    dict.fromkeys(metrics.COLUMNS, "")
                    | where
                    | {"metric": metric, "tool": tool, "joint": joint, "value": value, "low": np.nan, "high": np.nan}
                    | {"unit": unit, "n": n}
                )
    return found


def measure(root):
    """(clock s, bytes of the report, files, peak memory bytes) of the report step."""
    arguments = write(root)
    begun = time.perf_counter()
    report.run(**arguments)
    taken = time.perf_counter() - begun
    files = [p for p in arguments["out"].rglob("*") if p.is_file()]
    peak = 1024 * max(resource.getrusage(who).ru_maxrss for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return taken, sum(p.stat().st_size for p in files), len(files), peak


def main(folder=None):
    """Print the measured table."""
    if folder is None:
        with tempfile.TemporaryDirectory() as made:
            return main(made)
    taken, size, files, peak = measure(Path(folder))
    print(f"| {len(sequences())} sequences, {4 * len(sequences())} camera recordings | measured | limit | ratio |")
    print("|---|---|---|---|")
    print(f"| report, clock | {taken:.1f} s | {LIMIT_S:.0f} s | {taken / LIMIT_S:.2f} |")
    print(f"| size, {files} files | {size / 1e6:.1f} MB | {LIMIT_BYTES / 1e6:.0f} MB | {size / LIMIT_BYTES:.2f} |")
    for page in ("index.html", f"sequences/{sequences()[-1][0]}.html"):
        print("\n".join(opened(Path(folder) / "report" / page)))
    print(f"\n{os.cpu_count()} cores, peak memory {peak / 1e6:.0f} MB")


if __name__ == "__main__":
    main(*sys.argv[1:2])
