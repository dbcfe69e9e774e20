"""The real data of ../shared/data in every format that dior reads: by how much what is read differs from what was.

usage: python -m benchmarks.formats [DATA] [--tools PYTHON]

DATA: ../shared/data. Its detections (real_outdoor: OpenPose and BlazePose), calibration (real_outdoor's with the right
lens) and motion capture (mocap/*.c3d) are written again in each format, read as any lab's, and compared: detections and
markers as the tables of their steps, px and m; poses in m and rad; lenses in px of K and by their coefficients. Who
wrote: `tool` is the tool's own code, `here` that of the tests, by its documentation. PYTHON is that of an environment
with caliscope and aniposelib in it (`pip install caliscope aniposelib`), whose versions of OpenCV are not dior's.
Ends with 1 where something differs by more than LIMITS.
"""

import argparse
import json
import subprocess
import sys
import tempfile
from dataclasses import replace
from functools import partial
from pathlib import Path

import ezc3d
import numpy as np

from dior.body.names import BODY_25B, COCO_17, COCO_18, HALPE_26, HALPE_136, MLKIT_33, WHOLEBODY_133
from dior.calibrate.intrinsics import from_file
from dior.calibrate.place import reference_pose
from dior.geometry.camera import Camera, inverse_pose
from dior.ingest import detections
from dior.ingest.readers import READERS, mlkit, openpose
from dior.tables import tables
from tests.calibrate.readers import written
from tests.ingest import formats
from tests.ingest.mocap_files import test_real_in_each_format as mocap_again
from tests.ingest.readers import test_real_in_each_format as again
from tests.ingest.test_mocap import run as run_mocap

ROOT = Path(__file__).resolve().parents[1]
CAMERAS = ("cam01", "cam02", "cam03", "cam04")
WIDTH, HEIGHT, FRAMES = 1088, 1920, 100
# what a format rounds to: px of five digits after the point in fractions of 1920, and what a table's float32 has; m and
# rad of the issue; half of the last of three digits of mm, and float32
LIMITS = {"px": 5e-4, "m": 1e-6, "rad": 1e-6, "px of K": 1e-6, "of a coefficient": 1e-9, "m of a marker": 1.1e-6}
# beside those of `formats.WRITERS`: other numbers of joints that a format has
MORE = {
    "openpose, BODY_25B": (formats.openpose, BODY_25B),
    "openpose, COCO": (formats.pose2sim, COCO_17),
    "mmpose, WholeBody": (formats.mmpose_video, WHOLEBODY_133),
    "mmpose, Halpe full body": (formats.mmpose, HALPE_136),
    "alphapose, COCO": (formats.alphapose, COCO_17),
    "alphapose, Halpe full body": (formats.alphapose, HALPE_136),
    "coco, COCO-18": (formats.coco, COCO_18),
    "coco, Halpe": (formats.coco, HALPE_26),
    "coco, ML Kit": (formats.coco, MLKIT_33),
    "deeplabcut, BODY_25B": (partial(formats.deeplabcut, names=BODY_25B), BODY_25B),
    "deeplabcut, ML Kit": (partial(formats.deeplabcut, names=MLKIT_33), MLKIT_33),
}
# what each tool is asked to write, in an environment of its own: the cameras on standard input, the path as argument
BY_TOOL = {
    "caliscope": """
import json, sys, numpy as np
from caliscope.cameras.camera_array import CameraArray, CameraData
given = json.load(sys.stdin)
CameraArray({i: CameraData(cam_id=i, size=tuple(c["size"]), matrix=np.array(c["K"]), distortions=np.array(c["D"]),
    rotation=np.array(c["R"]), translation=np.array(c["t"])) for i, c in enumerate(given)}).to_toml(sys.argv[1])
""",
    "aniposelib": """
import json, sys, numpy as np
from aniposelib.cameras import Camera, CameraGroup
given = json.load(sys.stdin)
CameraGroup([Camera(matrix=c["K"], dist=c["D"], size=c["size"], rvec=c["rvec"], tvec=c["t"], name=c["name"])
    for c in given]).dump(sys.argv[1])
""",
}


def of_detections(data, folder):
    """(format, who wrote, {what: worst difference}) of every format of detections."""
    # as fractions of the real pictures
    formats.WIDTH, formats.HEIGHT = WIDTH, HEIGHT
    people = {
        "openpose": {camera: openpose.read(data / "openpose_single" / camera) for camera in CAMERAS},
        "mlkit": {camera: mlkit.read(data / "mlkit" / f"{camera}.jsonl") for camera in CAMERAS},
    }
    expected = {
        "openpose": table(folder, data / "openpose_single" / "{camera}"),
        "mlkit": table(folder, data / "mlkit" / "{camera}.jsonl"),
    }
    cases = {f"{name}, {writer.__name__}": (writer, joints) for writer, (name, joints, *_) in formats.WRITERS.items()}
    for name, (writer, joints) in (cases | MORE).items():
        source = "mlkit" if set(joints) == set(MLKIT_33) else "openpose"
        key = name.partition(",")[0]
        given = {camera: seen(mine) for camera, mine in people[source].items()}
        if READERS[key].silent or writer in (formats.mlkit, formats.mediapipe_solutions, formats.mlkit_csv):
            given = {camera: replace(mine, ran=np.unique(mine.frame)) for camera, mine in given.items()}
        if writer is formats.mlkit:
            writer = partial(writer, period_ns=1e9 / 60)
        pattern = again.written_again(folder / name.replace(", ", "_").replace(" ", "_"), given, writer, joints)
        got = table(folder, pattern)
        shared = [joint for joint in joints if joint in people[source]["cam01"].joints]
        a, b = (again.grid(one, shared, "u", "v") for one in (got, expected[source]))
        gone = np.isnan(a) != np.isnan(b)
        yield name, "here", {"px": np.inf if gone.any() else float(np.nanmax(np.abs(a - b)))}


def seen(people):
    """The same, without points at (0, 0), which most formats have for what is missing."""
    return replace(people, uv=people.uv.copy(), score=people.score.copy())


def table(folder, pattern):
    """What the step `detections` makes of the files that `pattern` names."""
    frame = np.tile(np.arange(FRAMES), len(CAMERAS))
    columns = {
        "camera": np.repeat(np.array(CAMERAS, object), FRAMES), "frame": frame,
        "stamp_ns": formats.T0 + np.rint(frame * 1e9 / 60).astype(np.int64),
        "width": np.full(len(frame), WIDTH), "height": np.full(len(frame), HEIGHT),
    }  # fmt: skip
    tables.write(folder / "frames.parquet", "frames", columns)
    detections.run(
        looked_at=[], sequence="beam", pattern=str(pattern), cameras=list(CAMERAS), format="auto",
        frames=folder / "frames.parquet", out=folder / "out.parquet", findings=folder / "findings.parquet",
    )  # fmt: skip
    return tables.read(folder / "out.parquet", "detections")


def of_calibrations(data, folder, tools):
    """The same of every format of calibrations."""
    path = data / "reference" / "calibration_qualisys.toml"
    keys = {camera: camera.replace("cam", "cam_") for camera in CAMERAS}
    cameras = [Camera(name, from_file(path, key), reference_pose(path, key)) for name, key in keys.items()]
    own = {"opencv", "opencv_xml", "opencv_json", "opencv_pair"}
    writers = {writer.__name__: (writer, *how) for writer, how in written.WRITERS.items()}
    writers |= {
        f"opencv_{ending}": (partial(written.opencv, ending=ending), "m", "as_given") for ending in ("xml", "json")
    }
    writers["ros_info"] = (written.ros_info, "", "")
    for name, (writer, units, world) in writers.items():
        (folder / name).mkdir()
        found = writer(folder / name, cameras)
        yield name, "tool" if name in own else "here", compared(cameras, found, units, world, name != "vicon")
    for name, script in BY_TOOL.items() if tools else ():
        path = folder / f"{name}.toml"
        subprocess.run([tools, "-c", script, path], input=json.dumps(plain(cameras)), text=True, check=True)
        names = {c.name: (path, str(i) if name == "caliscope" else c.name) for i, c in enumerate(cameras)}
        units = "m" if name == "aniposelib" else ""
        yield f"{name}, its own writer", "tool", compared(cameras, names, units, "as_given", True)


def plain(cameras):
    from scipy.spatial.transform import Rotation

    return [
        {
            "name": camera.name,
            "size": [camera.intrinsics.width, camera.intrinsics.height],
            "K": camera.intrinsics.K.tolist(),
            "D": list(camera.intrinsics.distortion[:5]),
            "R": camera.wRc.T.tolist(),
            "rvec": Rotation.from_matrix(camera.wRc.T).as_rotvec().tolist(),
            "t": inverse_pose(camera.wTc)[:3, 3].tolist(),
        }
        for camera in cameras
    ]


def compared(cameras, found, units, world, with_lens):
    """Worst differences of what is read of cameras from the files `found`; Vicon's have another lens."""
    worst = {}

    def note(what, value):
        worst[what] = max(worst.get(what, 0.0), float(value))

    there = [camera for camera in cameras if camera.name in found]
    base = None
    for camera in there:
        if world:
            wTc = reference_pose(*found[camera.name], units=units, world=world)
            # of a world that begins with a camera: where they stand to each other
            base = wTc @ inverse_pose(camera.wTc) if base is None and world == "from_walk" else base
            off = inverse_pose(camera.wTc if base is None else base @ camera.wTc) @ wTc
            note("m", np.linalg.norm(off[:3, 3]))
            note("rad", np.linalg.norm(off[:3, :3] - np.eye(3)) / np.sqrt(2))
        if with_lens:
            lens = from_file(*found[camera.name])
            note("px of K", np.abs(lens.K - camera.intrinsics.K).max())
            short = 4 if found[camera.name][0].name == "camchain.yaml" else 5
            pairs = zip(lens.distortion[:short], camera.intrinsics.distortion[:short], strict=True)
            note("of a coefficient", max(abs(a - b) for a, b in pairs))
    return worst


def of_mocap(data, folder):
    """The same of every format of motion capture, for both real walks."""
    for real in sorted(data.glob("*_100hz.c3d")):
        for name in ("a", "b"):
            (folder / real.stem / name).mkdir(parents=True)
        expected = run_mocap(folder / real.stem / "a", real)
        about = mocap_again.layout(real)
        labels, points = mocap_again.content(real)
        writers = {**mocap_again.WRITERS, "c3d": written_c3d}
        for name, writer in writers.items():
            path = writer(folder / real.stem / "b" / "a.txt", labels, points, about.rate, about.first)
            got = run_mocap(folder / real.stem / "b", path)
            gone = any(not np.array_equal(got[key], expected[key]) for key in ("joint", "instant", "status"))
            worst = max(np.nanmax(np.abs(got[key] - expected[key])) for key in "xyz")
            who = "tool" if writer is written_c3d else "here"
            yield f"{name}, {real.stem}", who, {"m of a marker": np.inf if gone else float(worst)}


def written_c3d(path, labels, points, rate, first):
    """By ezc3d."""
    file = ezc3d.c3d()
    file["parameters"]["POINT"]["RATE"]["value"] = [rate]
    file["parameters"]["POINT"]["UNITS"]["value"] = ["mm"]
    file["parameters"]["POINT"]["LABELS"]["value"] = labels
    xyz = 1000 * points.transpose(2, 1, 0)
    file["data"]["points"] = np.concatenate([xyz, np.ones_like(xyz[:1])])
    file["header"]["points"]["first_frame"] = first
    path = path.with_suffix(".c3d")
    file.write(str(path))
    return path


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", nargs="?", type=Path, default=ROOT.parent / "shared" / "data")
    parser.add_argument("--tools", metavar="PYTHON", help="of an environment with caliscope and aniposelib")
    given = parser.parse_args()
    beyond = 0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        outdoor = given.data / "real_outdoor"
        kinds = {
            "detections": of_detections(outdoor, folder),
            "calibrations": of_calibrations(outdoor, folder, given.tools),
            "motion capture": of_mocap(given.data / "mocap", folder),
        }
        for kind, rows in kinds.items():
            print(f"{kind}\n{'format':44} {'written by':10} worst difference")
            for form, who, worst in rows:
                far = [what for what, value in worst.items() if not value <= LIMITS[what]]
                beyond += bool(far)
                said = ", ".join(f"{value:.1e} {what}" for what, value in worst.items())
                print(f"{form:44} {who:10} {said}{'   <- too far' if far else ''}", flush=True)
            print()
    sys.exit(bool(beyond))


if __name__ == "__main__":
    main()
