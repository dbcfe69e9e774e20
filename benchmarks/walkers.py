"""A gallery of simulated people, without a picture drawn: 3D and labels of every walk, as re-identification takes them.

What the 3D is made of goes through the steps: the C3D indoors; detections, adjustment of each session's cameras,
triangulation and refinement outdoors. Clocks, the cameras indoors and the long-range camera are the true ones, which
moves labels by less than a pixel and the 3D not at all.
"""

import os
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

from benchmarks import steps
from dior.clocks import clock as clocks
from dior.clocks.clock import Clock
from dior.errors import DiorError
from dior.geometry import camera_tables
from dior.ingest import detections, mocap
from dior.project import project as projects
from dior.reconstruct import timeline
from dior.reid import inputs
from dior.simulate import config, scene, simulate, simulate_mocap
from dior.simulate import settings as levels
from dior.simulate.clocks import clocks_of
from dior.simulate.motion import motion_of
from dior.tables import tables
from dior.tables.files import write_text

# every subject in two outfits on two walks, each with each
WALKS = ("across", "along", "along", "across")


def made(folder, **settings):
    """`steps.Capture` of a gallery in `folder`; what is there already, made with the same settings, is not made again.

    Raises DiorError for a folder with a gallery of other settings.
    """
    values = {"preset": "real", "subjects": 14, "sequences": len(WALKS), "sessions": 3, "walks": list(WALKS)}
    values |= {"people": "different", "gallery": False} | settings
    chosen, folder = levels.from_dict(values), Path(folder)
    told = folder / "settings.txt"
    if not told.is_file():
        config.write(chosen, folder / "config")
        config.write_offsets(chosen, folder / "config")
        write_text(told, repr(chosen))
    elif told.read_text() != repr(chosen):
        raise DiorError(f"{folder}: holds a gallery of other settings; give another folder, or delete this one")
    capture = steps.Capture(folder, chosen, projects.load(folder))
    outdoors = [s for s in capture.project.sessions if levels.place_of(s) == "field"]
    walks = capture.project.sequences
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        for step, names in ((_record, walks), (_adjust, outdoors), (_reconstruct, walks)):
            lacking = [name for name in names if not _last(step, capture, name).is_file()]
            list(pool.map(step, [(folder, values, name) for name in lacking]))
    return capture


def _last(step, capture, name):
    """The table that a step writes last."""
    if step is _adjust:
        return capture.made("adjust", name, ".findings")
    if step is _reconstruct:
        return capture.made("inputs", name, ".skeleton")
    return capture.made("mocap" if capture.project.indoor(name) else "timeline", name)


def _capture(job):
    folder, values, name = job
    return steps.Capture(folder, levels.from_dict(values), projects.load(folder)), name


def _record(job):
    """Detections or the C3D of one walk, its frames, timeline and true clocks."""
    capture, name = _capture(job)
    settings, data = capture.settings, capture.folder / "data"
    walk = levels.sequence_named(settings, name)
    frames, outdoor = capture.made("frames", name), walk.environment == "outdoor"
    motion = motion_of(settings, walk)
    own, _ = clocks_of(settings, walk)
    tables.write(frames, "frames", _frames(own, settings))
    known = {camera: Clock(clock.offset_s, clock.drift_ppm, "manual") for camera, clock in own.items()}
    clocks.write(capture.made("clocks", name), capture.made("clocks", name, ".gains"), name, known)
    if not outdoor:
        simulate_mocap.write_c3d(data / f"{name}/mocap.c3d", settings, walk, motion)
        mocap.run(
            sequence=name, subject=walk.subject, c3d=data / f"{name}/mocap.c3d", frames=frames, trigger_log=None,
            out=capture.made("mocap", name),
        )  # fmt: skip
        return
    views, others = simulate.observe(settings, walk, motion)
    simulate.write_detections(settings, walk, motion.height, views, others, data)
    close = capture.project.close(walk.session)
    detections.run(
        looked_at=[],
        sequence=name, pattern=str(data / f"{name}/mlkit/{{camera}}.jsonl"), cameras=close, format="mlkit",
        frames=frames, out=capture.made("detections", name), findings=capture.made("detections", name, ".findings"),
    )  # fmt: skip
    timeline.run(
        sequence=name, frames=frames, cameras=close, clocks=[capture.made("clocks", name)], mocap=None,
        max_gap=capture.project.config["time"]["max_gap"], out=capture.made("timeline", name),
    )  # fmt: skip


def _frames(own, settings):
    """The `frames` table of every camera's clock."""
    parts = []
    for camera, clock in own.items():
        shown = clock.messages
        size = {"height": settings.height, "width": settings.width}
        parts.append(
            {
                "camera": np.full(len(shown), camera, object),
                "frame": np.arange(len(shown)),
                "stamp_ns": clock.stamp_ns[shown],
                "receive_ns": clock.receive_ns[shown],
                **{key: np.full(len(shown), value) for key, value in size.items()},
            }
        )
    return {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}


def _adjust(job):
    """The close cameras of one session, from the tape and the detections, with the clocks given."""
    capture, session = _capture(job)
    for camera, placed in scene.cameras_of(capture.settings, session).items():
        lens = scene.reported(capture.settings, session, placed.camera)
        own = capture.made("intrinsics", f"{session}/{camera}")
        camera_tables.write_cameras(own, [type(placed.camera)(camera, lens, None, placed.camera.role)], session)
    steps.adjusted(capture, session)


def _reconstruct(job):
    """The 3D of one walk, and COCO-17 in every camera."""
    capture, name = _capture(job)
    session, indoor = capture.project.session_of(name), capture.project.indoor(name)
    close = capture.project.close(session)
    true = [placed.camera for placed in scene.cameras_of(capture.settings, session).values()]
    cameras = [capture.made("true", name)]
    if not indoor:
        steps.skeleton(capture, session, name, close)
        true = [camera for camera in true if camera.name not in close]
        cameras.append(capture.made("adjust", session))
    camera_tables.write_cameras(cameras[0], true, session)
    inputs.run(
        sequence=name, subject=capture.project.subject_of(name), names=capture.project.cameras_of(name),
        skeleton=steps.skeleton_of(capture, name), cameras=cameras, frames=capture.made("frames", name),
        clocks=[capture.made("clocks", name)], source="mocap" if indoor else "triangulated",
        out=capture.made("inputs", name), out_skeleton=capture.made("inputs", name, ".skeleton"),
    )  # fmt: skip
