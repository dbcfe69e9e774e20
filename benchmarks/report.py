"""What the report of a dataset of DIOR's size costs, the index and the pages of sequences apart, how large it is, and
how soon a browser has it: 112 sequences of 4 cameras, no pictures.

usage: python -m benchmarks.report [FOLDER]      (FOLDER for the made-up tables and the report; kept when given)

The tables are made up: 3600 pictures a camera, 33 joints, indoor walks with hand checks, outdoor ones with boxes and
two detectors. Contact sheets are grey, so that the size is that of all but the pictures.
"""

import os
import pickle
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from benchmarks.viewer import opened
from dior.body.names import MLKIT_33
from dior.evaluate import label_errors, metrics, statistics
from dior.gait import gait
from dior.geometry import camera_tables
from dior.geometry.camera import Camera, Intrinsics, pose
from dior.geometry.multiview import look_at
from dior.project.schema_check import columns_of
from dior.report import page, report, scene_file
from dior.tables import tables
from dior.tables.files import write_text

LIMIT_S, LIMIT_INDEX, LIMIT_BYTES = 30.0, 1e6, 100e6
# jobs that are measured with their start
JOBS = 5
JOB = "run(**pickle.load(sys.stdin.buffer))"
SUBJECTS, WALKS, FRAMES = 14, 4, 3600
START_NS, STEP_NS = 1_700_000_000_000_000_000, 33_333_333
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
    """The project's sheets and tables; the arguments of the step page by sequence, and those of the step report."""
    rng = np.random.default_rng(1)
    _write_sheets(root)
    results, pages, rows = root / "results", {}, []
    poses, covariances = {}, []
    for session in ("lab_1", "lab_2", "field_1", "field_2"):
        poses[session] = results / f"cameras/{session}.parquet"
        camera_tables.write_cameras(poses[session], rig(session.startswith("field")), session)
        covariances.append(results / f"cameras/{session}.covariance.parquet")
        known = np.diag(np.tile(np.repeat([1e-3, 1e-2], 3), len(CAMERAS)) ** 2)
        camera_tables.write_camera_covariance(covariances[-1], CAMERAS, known, session)
    out = root / "report"
    names = [sequence for sequence, *_ in sequences()]
    for i, (sequence, subject, session, env) in enumerate(sequences()):
        made = _tables(rng, results, sequence, subject, env)
        for path, name, columns in made.values():
            tables.write(path, name, columns)
        own, assets = _rows(rng, sequence, subject, env), out / "assets" / sequence
        rows += own
        files = {key: path for key, (path, _, _) in made.items()}
        metrics_table, findings = (
            results / f"evaluate/{sequence}.parquet",
            results / f"audit/{sequence}.findings.parquet",
        )
        walked = [results / f"gait/{sequence}{part}.parquet" for part in ("", ".events", ".steps", ".findings")]
        gait.run(
            sequence=sequence, subject=subject, skeleton=files["skeleton"], out=walked[0], out_events=walked[1],
            out_steps=walked[2], findings=walked[3],
        )  # fmt: skip
        tables.write(metrics_table, "metrics", {key: [row[key] for row in own] for key in metrics.COLUMNS})
        gap = "no detections between 1.2 s and 1.9 s"
        tables.write_findings(findings, [(f"{sequence}/cam02", "warning", "gap", gap)])
        for camera in CAMERAS:
            write_text(assets / "sheets" / f"{camera}.jpg", "")
        write_text(assets / "scene.js", scene_file.text_of(None, {}))
        pages[sequence] = {
            "sequence": sequence, "within": [session, subject], "about": f"{subject}, {env}, {session}",
            "roles": {camera: _role(camera, env) for camera in CAMERAS}, "title": "DIOR size",
            "before": names[i - 1] if i else "", "after": names[i + 1] if i + 1 < len(names) else "",
            "measured": page.Measured(metrics_table, files["frame_metrics"], files["skeleton"], *walked[:2]),
            "findings": [findings], "cameras": [poses[session]],
            "times": page.Times(files["audit"], files["dropped"], files["frames"], [files["clocks"]],
                                [files["clock_costs"]]),
            "media": page.Media(assets / "sheets", None, assets / "scene.js"),
            "out": out / f"sequences/{sequence}.html", "out_3d": out / f"sequences/{sequence}.3d.html",
            "out_facts": assets / "facts.json", "out_plots": assets / "plots",
        }  # fmt: skip
    csv = results / "metrics.csv"
    write_text(csv, metrics.as_csv(metrics.merged(rows)))
    counted = results / "statistics.csv"
    times = [one["times"] for one in pages.values()]
    statistics.run(
        root=root, labels=[], skeletons=[one["measured"].skeleton for one in pages.values()],
        frames=[one.frames for one in times], dropped=[one.dropped for one in times], gallery=None, out=counted,
    )  # fmt: skip
    quantiles = [results / f"evaluate/{sequence}.quantiles.parquet" for sequence in names]
    return pages, {
        "root": root, "title": "DIOR size", "evaluated": report.Evaluated(csv, quantiles, counted, recognition=[]),
        "told": [one["out_facts"] for one in pages.values()], "findings": [],
        "scene": report.Scene(list(poses.values()), covariances, turns=[]), "effort": None, "out": out,
        "out_timing": root / "timing.csv",
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
        "skeleton": (results / f"refine/{sequence}.parquet", "skeletons_3d", skeleton),
        "audit": (results / f"audit/{sequence}.parquet", "stamp_audit", audit),
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


def cpu_s():
    """CPU seconds of this process so far and of its finished children."""
    own, children = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(one.ru_utime + one.ru_stime for one in (own, children))


def job(step, arguments):
    """CPU seconds of a step in a process of its own, as the workflow runs it, with what it has to import."""
    begun = cpu_s()
    command = [sys.executable, "-c", f"import pickle, sys; from dior.report.{step} import run; {JOB}"]
    subprocess.run(command, input=pickle.dumps(arguments), check=True)
    return cpu_s() - begun


def main(folder=None):
    """Print the measured table."""
    if folder is None:
        with tempfile.TemporaryDirectory() as made:
            return main(made)
    pages, arguments = write(Path(folder))
    names = list(pages)
    # the others are made in this process: what a job costs is that of a few
    jobs = [job("page", pages[name]) for name in names[:: len(names) // JOBS][:JOBS]]
    begun = cpu_s()
    for own in pages.values():
        page.run(**own)
    alone, index = (cpu_s() - begun) / len(pages), job("report", arguments)
    files = [path for path in arguments["out"].rglob("*") if path.is_file()]
    size, first = sum(path.stat().st_size for path in files), (arguments["out"] / "index.html").stat().st_size
    peak = 1024 * max(resource.getrusage(who).ru_maxrss for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    print(f"| {len(names)} sequences, {4 * len(names)} camera recordings | measured | limit |")
    print("|---|---|---|")
    print(f"| step report, CPU | {index:.1f} s | {LIMIT_S:.0f} s |")
    print(f"| a job of step page, CPU, median of {JOBS} | {np.median(jobs):.2f} s | |")
    print(f"| a sequence in it, without the start | {alone:.2f} s | |")
    print(f"| index.html | {first / 1e6:.2f} MB | {LIMIT_INDEX / 1e6:.0f} MB |")
    print(f"| size, {len(files)} files | {size / 1e6:.1f} MB | {LIMIT_BYTES / 1e6:.0f} MB |")
    for path in ("index.html", f"sequences/{names[-1]}.html"):
        print("\n".join(opened(Path(folder) / "report" / path)))
    print(f"\n{os.cpu_count()} cores, peak memory {peak / 1e6:.0f} MB")


if __name__ == "__main__":
    main(*sys.argv[1:2])
