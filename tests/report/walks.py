"""Tables of an outdoor walk with as many cameras and instants as wanted, with pictures: what `viewer.run` takes."""

import numpy as np

from dior.body.names import MLKIT_33
from dior.clocks import clock as on_axis
from dior.geometry import camera_tables
from dior.geometry.camera import Camera, pose, project
from dior.geometry.multiview import look_at
from dior.report import pages, scene_file, viewer_files
from dior.tables import tables
from dior.tables.files import write_text
from tests.report import conftest
from tests.report.conftest import START_NS, repeat, stacked

SEQUENCE, STEP_NS = "outdoor_01", 33_333_333
# a texture, which takes as many bytes as pictures of a room
TEXTURE = np.random.default_rng(5).integers(40, 215, (30, 45, 3)).astype(np.uint8)


def cameras(count):
    """Close cameras in a circle of 6 m, and the last, 60 m away."""
    angles = 2 * np.pi * np.arange(count - 1) / (count - 1) + 0.4
    places = [(6 * np.cos(a), 6 * np.sin(a), 1.6) for a in angles] + [(60.0, 10.0, 2.0)]
    return [
        Camera(
            f"cam{i + 1:02d}",
            conftest.FAR_LENS if i == count - 1 else conftest.LENS,
            pose(look_at(place, (0, 0, 1.0)), place),
            "long_range" if i == count - 1 else "close",
            "tape",
        )
        for i, place in enumerate(places)
    ]


def body(frames, rng):
    """Columns of `skeletons_3d` with errors; a wrist is missing for ten instants, and the 3D is worst at the middle."""
    points = conftest.walk(frames) + rng.normal(0, 0.002, (frames, 33, 3))
    points[20:30, MLKIT_33.index("left_wrist")] = np.nan
    columns = conftest.skeleton_columns("S01", SEQUENCE, points)
    # errors change slowly, as the person goes
    sway = np.cumsum(rng.normal(0, 0.01, (frames, 33, 3)), axis=0)
    for axis, (sigma, rho) in enumerate((("x", "xy"), ("y", "xz"), ("z", "yz"))):
        columns[f"sigma_{sigma}"] = (0.006 * np.exp(0.1 * np.sin(sway[..., axis]))).ravel()
        columns[f"rho_{rho}"] = (0.3 * np.sin(sway[..., axis])).ravel()
    residual = np.ones((frames, 33))
    residual[frames // 2] = 8.0
    return columns | {"residual_px": residual.ravel()}, points


def write(root, count=4, frames=90):
    """Write the tables; the arguments of `viewer.run` but for the outputs. Times of the cameras differ by some ms."""
    rng, rig = np.random.default_rng(3), cameras(count)
    names, labels, index, found, measured = [c.name for c in rig], [], [], [], []
    skeleton, points = body(frames, rng)
    tables.write(root / "refine.parquet", "skeletons_3d", skeleton)
    number = np.arange(frames)
    for i, camera in enumerate(rig):
        stamps = START_NS + number * STEP_NS + 2_000_000 * i
        uv = project(camera, points)[0]
        inside = (uv > 0).all(axis=-1) & (uv < (1280, 720)).all(axis=-1)
        status = np.where(np.isnan(uv[..., 0]), "missing_3d", np.where(inside, "ok", "out_of_frame")).astype(object)
        columns = conftest.label_columns("S01", SEQUENCE, camera.name, uv, number, stamps, status)
        labels.append(root / f"{camera.name}.labels.parquet")
        tables.write(labels[-1], "labels_2d", columns)
        index.append(conftest.frame_columns(camera.name, stamps))
        close = camera.role == "close"
        if close:
            seen = uv + rng.normal(0, 2, uv.shape)
            columns = conftest.label_columns("S01", SEQUENCE, camera.name, seen, number, stamps)
            own = {key: columns[key] for key in ("camera", "frame", "stamp_ns", "joint", "u", "v")}
            found.append(own | {"score": np.full(33 * frames, 0.9), "person": np.zeros(33 * frames, int)})
        value = np.full(frames, 3.0 if close else 1.0)
        value[10 + 3 * i] = 9.0 + i if close else 0.5
        metric = "reprojection_error" if close else "in_box_share"
        measured.append(
            {
                "metric": repeat([metric], frames),
                "subject": repeat(["S01"], frames),
                "sequence": repeat([SEQUENCE], frames),
                "camera": repeat([camera.name], frames),
                "role": repeat([camera.role], frames),
                "frame": number,
                "stamp_ns": stamps,
                "value": value,
                "n": np.full(frames, 33),
            }  # fmt: skip
        )
    for name, table, parts in (("frames", "frames", index), ("found", "detections", found),
                               ("measured", "frame_metrics", measured)):  # fmt: skip
        tables.write(root / f"{name}.parquet", table, stacked(parts))
    instants = {
        "instant": np.repeat(number, count), "camera": np.tile(np.array(names, object), frames),
        "stamp_ns": np.repeat(START_NS + number * STEP_NS, count), "frame_before": np.repeat(number, count),
        "frame_after": np.repeat(number, count), "weight": np.zeros(frames * count),
    }  # fmt: skip
    tables.write(root / "timeline.parquet", "timeline", instants)
    clocks = {name: on_axis.Clock(0.0, 0.0, "reference" if i == 0 else "estimated") for i, name in enumerate(names)}
    on_axis.write(root / "clocks.parquet", root / "gains.parquet", SEQUENCE, clocks)
    camera_tables.write_cameras(root / "cameras.parquet", rig, "field")
    known = np.diag(np.tile(np.repeat([1e-3, 0.02], 3), count) ** 2)
    camera_tables.write_camera_covariance(root / "covariance.parquet", names, known, "field")
    return {
        "sequence": SEQUENCE, "frames": root / "frames.parquet", "clocks": [root / "clocks.parquet"],
        "timeline": root / "timeline.parquet", "skeleton": root / "refine.parquet",
        "cameras": [root / "cameras.parquet"], "covariance": [root / "covariance.parquet"], "data_root": root,
        "labels": labels, "detections": root / "found.parquet", "frame_metrics": root / "measured.parquet",
        "min_score": 0.3,
    }  # fmt: skip


def write_page(out):
    """The page in 3D of the walk, whose scene.js is in the report `out` already, and what it shares with others."""
    scene = scene_file.header_of(out / f"assets/{SEQUENCE}/scene.js")
    template = pages.environment().get_template("scene.html.j2")
    text = template.render(title="A & B", sequence=SEQUENCE, scene=scene, before="", after="")
    write_text(out / f"sequences/{SEQUENCE}.3d.html", text)
    viewer_files.write(out)
    return out / f"sequences/{SEQUENCE}.3d.html"


def pictures(rows, data_root):
    """In place of `bags.read_to_show`: a texture that goes by, with the frame's number as a grey corner."""
    import cv2

    large = cv2.resize(TEXTURE, (1440, 960), interpolation=cv2.INTER_CUBIC)
    for row, frame in enumerate(rows["frame"].tolist()):
        picture = large[frame % 240 :][:720, frame % 160 :][:, :1280].copy()
        picture[:60, :60] = frame % 250
        yield row, picture
