"""Reference calibrations with a mistake in them, and clean ones: is the mistake named, and does nothing else cry?

usage: python -m benchmarks.wrong_worlds [SEEDS] [poses] [c3d] [from_walk] [captures]      (20 seeds, all parts)

poses     a walk of 8 s seen by three cameras around, in an L and on one side, each 10 cm and 3 degrees off its even
          place; in memory (benchmarks/scene.py), with pixels as detected
c3d       the motion capture of a walk of 8 s, written anew
from_walk what `reference.world: from_walk` leaves of a tilt
captures  whole clean captures (benchmarks/steps.py)

`named`: the sentence has the words of the kind, by the poses (the step `reference`) or by the 3D (the step `world`);
`wrongly`: what is named beside it, of the clean ones a false alarm. The walker's height is `known` where subjects.tsv
has it.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import sys
import tempfile
from pathlib import Path

import numpy as np

from benchmarks import scene, steps, worlds
from dior.body import world_of_walk, wrong_world
from dior.errors import DiorError
from dior.geometry import covariance
from dior.geometry.camera import inverse_pose, pose
from dior.ingest import mocap
from dior.reconstruct import robust
from dior.simulate import settings as levels
from dior.simulate import simulate_mocap
from dior.simulate.motion import motion_of

EVERY, FRAMES = 4, 240
RIGS = {"around": scene.AZIMUTHS, "L": (0.0, 45.0, 90.0), "side": (-35.0, 0.0, 35.0)}
TURN = {
    "Y": np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]),
    "-Y": np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]),
}


def scaled(factor):
    return lambda cameras: [c.at(pose(c.wRc, factor * c.centre)) for c in cameras]


def turned(R):
    return lambda cameras: [c.at(pose(R @ c.wRc, R @ c.centre)) for c in cameras]


def of_first(cameras):
    first = inverse_pose(cameras[0].wTc)
    return [c.at(first @ c.wTc) for c in cameras]


def inverted(cameras):
    return [c.at(inverse_pose(c.wTc)) for c in cameras]


def mirrored(axis):
    """A world in which y is the other way round, and cameras of which one axis is, so that the poses are rotations."""
    S, M = np.eye(3), np.diag([1.0, -1.0, 1.0])
    S[axis, axis] = -1

    def made(cameras):
        return [c.at(pose(M @ c.wRc @ S, M @ c.centre)) for c in cameras]

    return made


def opengl(cameras):
    return [c.at(pose(c.wRc @ np.diag([1.0, -1.0, -1.0]), c.centre)) for c in cameras]


# kind -> what is done to the poses, and the words that name it
KINDS = {
    "clean": (lambda cameras: list(cameras), ""),
    "1.42 too large": (scaled(1.42), "too large by"),
    "1.5 too large": (scaled(1.5), "too large by"),
    "1.5 too small": (scaled(1 / 1.5), "too small by"),
    "millimetres": (scaled(1000.0), "in millimetres"),
    "centimetres": (scaled(100.0), "in centimetres"),
    "inverted": (inverted, "inverted poses"),
    "Y up": (turned(TURN["Y"]), "has Y up"),
    "Y down": (turned(TURN["-Y"]), "has -Y up"),
    "camera 0": (of_first, "as the origin of its world"),
    "left-handed x": (mirrored(0), "left-handed"),
    "left-handed y": (mirrored(1), "left-handed"),
    "left-handed z": (mirrored(2), "left-handed"),
    "OpenGL": (opengl, "OpenGL"),
    "mm, camera 0": (lambda cameras: scaled(1000.0)(of_first(cameras)), "in millimetres"),
}


def said(cameras, made, height):
    """The sentences about a walk by cameras: those that refuse it, else those of its 3D."""
    person = wrong_world.Person("p1", made.height_m, 0.01) if height else None
    seen = np.where((made.score >= 0.3)[..., None], made.uv, np.nan)
    found, _ = wrong_world.of_poses(cameras, seen[:, ::EVERY], made.names, person)
    if not found:
        score = np.where(np.isfinite(seen).all(axis=-1), made.score, 0.0)
        points = robust.triangulate(cameras, seen, score, scene.FPS).points
        found = wrong_world.of_person(points, made.names, made.seconds, person)
    return found


# what is done to the points (T, M, 3) of a C3D in mm, what it says of itself, and the words that name it
C3D = {
    "clean": (lambda p: p, {}, ""),
    "says m": (lambda p: p, {"UNITS": "m"}, "units: mm"),
    "says cm": (lambda p: p, {"UNITS": "cm"}, "units: mm"),
    "metres, says mm": (lambda p: p / 1000, {}, "units: m"),
    "Y up": (lambda p: p @ TURN["Y"].T, {}, "up: y"),
    "X up": (lambda p: p[..., [2, 0, 1]], {}, "up: x"),
    "upside down": (lambda p: p * (1, -1, -1), {}, "leans by 1"),
    "left-handed": (lambda p: p * (1, -1, 1), {}, "left-handed"),
    "1.42 too large": (lambda p: 1.42 * p, {}, "too large by"),
    "floor 60 cm high": (lambda p: p - (0, 0, 600), {}, "below the floor"),
    "a tenth of the rate": (lambda p: p, {"RATE": 1000.0}, "m/s"),
}


def said_of_c3d(path, change, says, height_m):
    """What is said of a C3D with other points that says something else of itself."""
    import ezc3d

    file = ezc3d.c3d(str(path))
    points = np.moveaxis(file["data"]["points"][:3], 0, -1)
    file["data"]["points"][:3] = np.moveaxis(change(points), -1, 0)
    for key, value in says.items():
        file["parameters"]["POINT"][key]["value"] = [value]
    # ezc3d makes these itself
    del file["data"]["meta_points"]
    changed = Path(path).with_name("changed.c3d")
    file.write(str(changed))
    try:
        found = mocap.read(changed)
    except DiorError as error:
        return [wrong_world.Fault("refused", str(error))]
    seconds = np.arange(len(found.points)) / found.rate
    return wrong_world.of_person(found.points, found.markers, seconds, wrong_world.Person("p1", height_m, 0.01))


def found_in_c3d(kind, seed):
    """What is said of the C3D of a seed's walk, with a fault of `C3D`."""
    change, says, _ = C3D[kind]
    made = levels.from_dict({"seed": seed, "subjects": 1, "sequences": 1, "duration_s": 8.0})
    walk = next(one for one in levels.sequences(made) if one.environment == "indoor")
    motion = motion_of(made, walk)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "walk.c3d"
        simulate_mocap.write_c3d(path, made, walk, motion)
        return said_of_c3d(path, change, says, motion.height)


def c3d(seeds):
    print("C3D, read by the step `mocap` (refused) and judged by the step `world`, height known")
    for kind, (_, _, words) in C3D.items():
        beside = {}
        named = sum(count(found_in_c3d(kind, seed), words, beside) for seed in range(1, seeds + 1))
        print(f"{kind:<24}{named:>7}   {shown(beside)}", flush=True)


def count(found, words, beside):
    """1 where the kind was named (or nothing was said of a clean one); what else was said is counted in `beside`."""
    for fault in found:
        if not words or words not in fault.text:
            beside[fault.code] = beside.get(fault.code, 0) + 1
    return int(any(words in fault.text for fault in found) if words else not found)


def shown(beside):
    return ", ".join(f"{code} {times}" for code, times in beside.items()) or "-"


def rig(name, seed):
    """Three cameras of `RIGS`, each off by 10 cm and 3 degrees of its even place."""
    random = np.random.default_rng([seed, 18])
    cameras = [scene.camera(f"cam{i + 1:02d}", azimuth) for i, azimuth in enumerate(RIGS[name])]
    errors = [np.r_[np.radians(3.0) * random.normal(size=3), 0.1 * random.normal(size=3)] for _ in cameras]
    return [covariance.moved(camera, error) for camera, error in zip(cameras, errors, strict=True)]


def poses(seeds):
    print(f"{'level':<7}{'rig':<8}{'height':<8}{'kind':<16}{'named':>7}   wrongly")
    for level, name in ((level, name) for level in ("ideal", "real") for name in RIGS):
        walks = [scene.make(level, seed, FRAMES, rig(name, seed)) for seed in range(1, seeds + 1)]
        for height, kind in ((height, kind) for height in (True, False) for kind in KINDS):
            make, words = KINDS[kind]
            beside = {}
            named = sum(count(said(make(walk.given), walk, height), words, beside) for walk in walks)
            known = "known" if height else "-"
            print(f"{level:<7}{name:<8}{known:<8}{kind:<16}{named:>7}   {shown(beside)}", flush=True)


def captures(seeds):
    """Whole captures, clocks unknown: their close cameras as a reference calibration, and all of their 3D."""
    print("clean captures: refused by `reference`, warned of by it, sequences said to be wrong by `world`")
    for level in ("ideal", "real"):
        refused, warned, wrong, walks = 0, 0, {}, 0
        for seed in range(1, seeds + 1):
            with tempfile.TemporaryDirectory() as folder:
                try:
                    made = steps.recorded(folder, preset=level, seed=seed, subjects=1, duration_s=8.0, gallery=False)
                    steps.reconstructed(made, worlds.outdoors(made))
                except DiorError as error:
                    print(f"{level} seed {seed} is refused before: {error}", file=sys.stderr)
                    continue
                for name in made.project.sequences:
                    walks += 1
                    count(worlds.said(made, name), "", wrong)
                try:
                    warned += any(severity != "info" for severity, *_ in worlds.reference_run(made)[0])
                except DiorError as error:
                    refused += 1
                    print(error)
        print(f"{level:<7}{refused:>7}{warned:>7}   {shown(wrong)} (of {walks} sequences)", flush=True)


def from_walk(seeds):
    print("the first camera as origin, the world taken from the walk: tilt (degrees) and height (m) that are left")
    for level in ("ideal", "real"):
        left = []
        for seed in range(1, seeds + 1):
            walk = scene.make(level, seed, FRAMES, rig("around", seed))
            cameras, true = of_first(walk.given), walk.given
            uv = np.where((walk.score >= 0.3)[..., None], walk.uv, np.nan)[:, ::EVERY]
            _, points = wrong_world.of_poses(cameras, uv, walk.names, vertical=False)
            bTw = world_of_walk.rebased(points, walk.names)
            ends = [(c.wTc, bTw @ given.wTc) for c, given in zip(true, cameras, strict=True)]
            tilts = [np.degrees(np.arccos(np.clip(a[2, :3] @ b[2, :3], -1, 1))) for a, b in ends]
            left.append((max(tilts), max(abs(a[2, 3] - b[2, 3]) for a, b in ends)))
        middle, most = np.median(left, axis=0), np.max(left, axis=0)
        print(f"{level:<7}median {middle[0]:.2f}, {middle[1]:.3f}   worst {most[0]:.2f}, {most[1]:.3f}", flush=True)


PARTS = {"poses": poses, "c3d": c3d, "from_walk": from_walk, "captures": captures}


def main():
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    print(f"{seeds} walks a kind, seeds 1-{seeds}")
    for part in sys.argv[2:] or PARTS:
        PARTS[part](seeds)


if __name__ == "__main__":
    main()
