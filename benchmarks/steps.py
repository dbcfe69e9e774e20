"""A simulated capture taken through the steps in one process, without a picture being drawn: what benchmarks of many
captures share.

The config is the one that `dior simulate --write-config` writes; recordings are the tables that ingest would make of
the bags, the detections and the C3D go through their own steps.
"""

import json
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from dior.calibrate import adjust, align, clocks, follow, locate, place
from dior.clocks.clock import ClockFiles
from dior.geometry import camera_tables
from dior.ingest import detections, mocap, video_starts
from dior.label import reproject
from dior.project import project as projects
from dior.reconstruct import bodies, refine, timeline, triangulate
from dior.simulate import config, scene, simulate, simulate_mocap
from dior.simulate import settings as levels
from dior.simulate.motion import motion_of
from dior.tables import tables


@dataclass(frozen=True)
class Capture:
    """A simulated capture in `folder`, labelled; `views`: sequence -> camera -> its `simulate.truth.View`."""

    folder: Path
    settings: object
    project: object
    views: dict = field(default_factory=dict)

    def made(self, step, unit, kind=""):
        """Path of a step's table."""
        return self.folder / f"results/{step}/{unit}{kind}.parquet"


def recorded(folder, true_clocks=False, start_sigma_s=0.0, offsets_s=None, **settings):
    """`Capture` with the tables of its recordings in `folder`; arguments as of `labelled`."""
    made = levels.from_dict(settings)
    config.write(made, Path(folder) / "config")
    if true_clocks:
        config.write_offsets(made, Path(folder) / "config")
    capture = Capture(Path(folder), made, projects.load(folder))
    for walk in levels.sequences(made):
        _record(capture, walk, start_sigma_s, offsets_s)
    return capture


def labelled(folder, true_clocks=False, start_sigma_s=0.0, offsets_s=None, **settings):
    """`Capture` with every label of it made in `folder`; `settings` of the `simulate:` section.

    `true_clocks`: config/offsets has the clocks, which are estimated otherwise; `start_sigma_s`: how well is known
    when the cameras began, as of videos; `offsets_s`: the same pictures by clocks that are off by this, camera by
    camera, and by nothing where they are not named.
    """
    capture = recorded(folder, true_clocks, start_sigma_s, offsets_s, **settings)
    for session in capture.project.sessions:
        (_indoors if levels.place_of(session) == "lab" else _outdoors)(capture, session)
    for name in capture.project.sequences:
        _reproject(capture, name, capture.project.cameras_of(name))
    return capture


def _record(capture, walk, start_sigma_s=0.0, offsets_s=None):
    """What ingest makes of a recorded walk."""
    motion = motion_of(capture.settings, walk)
    views, others = simulate.observe(capture.settings, walk, motion)
    capture.views[walk.name] = views
    if offsets_s is not None:
        views = {name: _with_offset(seen, offsets_s.get(name, 0.0)) for name, seen in views.items()}
    data, frames = capture.folder / "data", capture.made("frames", walk.name)
    simulate.write_detections(capture.settings, walk, motion.height, views, others, data)
    starts = {"source": "created", "start_sigma_s": start_sigma_s, "apart_sigma_s": start_sigma_s}
    metadata = {video_starts.METADATA: json.dumps(dict.fromkeys(views, starts))} if start_sigma_s else {}
    tables.write(frames, "frames", _frames(views), metadata)
    for name, seen in views.items():
        lens = replace(
            seen.camera, intrinsics=scene.reported(capture.settings, walk.session, seen.camera), wTc=None, locate=""
        )
        camera_tables.write_cameras(capture.made("intrinsics", f"{walk.session}/{name}"), [lens], walk.session)
    if walk.environment == "indoor":
        simulate_mocap.write_c3d(data / f"{walk.name}/mocap.c3d", capture.settings, walk, motion)
        mocap.run(
            sequence=walk.name, subject=walk.subject, c3d=data / f"{walk.name}/mocap.c3d", frames=frames,
            trigger_log=None, out=capture.made("mocap", walk.name),
        )  # fmt: skip
    detections.run(
        looked_at=[], sequence=walk.name, pattern=str(data / f"{walk.name}/mlkit/{{camera}}.jsonl"),
        cameras=capture.project.close(walk.session), format="mlkit", frames=frames,
        out=capture.made("detections", walk.name), findings=capture.made("detections", walk.name, ".findings"),
        out_people=capture.made("detections", walk.name, ".people"),
    )  # fmt: skip


def _with_offset(seen, offset_s):
    """A view of the same pictures whose stamps are off by another offset."""
    clock = seen.clock
    moved = clock.stamp_ns + round(1e9 * (clock.offset_s - offset_s))
    return replace(seen, clock=replace(clock, stamp_ns=moved, offset_s=offset_s))


def _frames(views):
    """The `frames` table of the recorded messages of every camera."""
    parts = []
    for name, seen in views.items():
        shown, lens = seen.clock.messages, seen.camera.intrinsics
        count = len(shown)
        parts.append(
            {
                "camera": np.full(count, name, object),
                "frame": np.arange(count),
                "stamp_ns": seen.clock.stamp_ns[shown],
                "receive_ns": seen.clock.receive_ns[shown],
                "height": np.full(count, lens.height),
                "width": np.full(count, lens.width),
            }
        )
    return {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}


def _config(capture, session, camera, kind="yaml"):
    return capture.folder / f"config/sessions/{session}/{camera}.{kind}"


def _offsets(capture, name):
    return capture.folder / f"config/offsets/{name}.yaml"


def _clock_files(capture, step, unit):
    return ClockFiles(*(capture.made(step, unit, kind) for kind in ("", ".gains", ".costs", ".findings")))


def _clocks(capture, name, cameras, covariance, marked=()):
    """The clocks of a sequence, and its timeline."""
    indoor, project = capture.project.indoor(name), capture.project
    mocap = capture.made("mocap", name) if indoor else None
    clocks.run(
        sequence=name, placed=clocks.Placed(cameras, project.clocked(name), covariance),
        detected=clocks.Detected(
            capture.made("detections", name), min_score=project.config["detector"]["min_score"],
            max_gap=project.config["time"]["max_gap"],
            everybody_seen=None if indoor else capture.made("detections", name, ".people"),
        ),
        frames=capture.made("frames", name), indoors=clocks.Indoors(mocap, marked),
        offsets=_offsets(capture, name), data_root=capture.folder / "data",
        written=_clock_files(capture, "clocks", name), out_aside=capture.made("clocks", name, ".aside"),
    )  # fmt: skip
    timeline.run(
        sequence=name, frames=capture.made("frames", name), cameras=project.close(project.session_of(name)),
        clocks=[capture.made("clocks", name)], mocap=mocap, max_gap=project.config["time"]["max_gap"],
        out=capture.made("timeline", name),
    )  # fmt: skip


def _indoors(capture, session):
    for camera in capture.project.cameras(session):
        unit, marked = f"{session}/{camera}", capture.project.marks_sequences(session, camera)
        locate.run(
            session=session, camera=camera, camera_file=_config(capture, session, camera),
            intrinsics=capture.made("intrinsics", unit),
            given=locate.ByHand(
                marks=_config(capture, session, camera, "marks.csv"), sequences=marked,
                offsets=[_offsets(capture, name) for name in marked],
            ),
            recorded=locate.Recorded(
                mocap=[capture.made("mocap", name) for name in marked],
                frames=[capture.made("frames", name) for name in marked],
            ),
            ransac_px=capture.project.config["locate"]["ransac_px"],
            written=locate.Written(
                out=capture.made("locate", unit),
                out_covariance=capture.made("locate", unit, ".covariance"),
                out_clocks=capture.made("locate", unit, ".clocks"),
                out_clock_gains=capture.made("locate", unit, ".clock_gains"),
                out_clock_costs=capture.made("locate", unit, ".clock_costs"),
                out_marks=capture.made("locate", unit, ".marks"),
                findings=capture.made("locate", unit, ".findings"),
            ),
        )  # fmt: skip
    units = [f"{session}/{camera}" for camera in capture.project.cameras(session)]
    for name in capture.project.sequences_of(session):
        marked = [
            capture.made("locate", unit, kind)
            for unit in units
            if name in capture.project.marks_sequences(*unit.split("/"))
            for kind in (".clocks", ".clock_gains")
        ]
        cameras, spread = ([capture.made("locate", unit, kind) for unit in units] for kind in ("", ".covariance"))
        _clocks(capture, name, cameras, spread, marked)


def adjusted(capture, session):
    """The close cameras of an outdoor session placed and adjusted."""
    project, close = capture.project, capture.project.close(session)
    for camera in close:
        unit = f"{session}/{camera}"
        place.run(
            session=session, camera=camera, camera_file=_config(capture, session, camera), tag={},
            intrinsics=capture.made("intrinsics", unit), frames=None, data_root=capture.folder / "data",
            out=capture.made("place", unit), out_marks=capture.made("place", unit, ".marks"),
            findings=capture.made("place", unit, ".findings"),
        )  # fmt: skip
    window, choices = project.window(session), project.config["adjust"]
    adjust.run(
        session=session, cameras=[capture.made("place", f"{session}/{camera}") for camera in close],
        camera_files=[_config(capture, session, camera) for camera in close],
        walks=adjust.Walks(
            detections=[capture.made("detections", name) for name in window],
            frames=[capture.made("frames", name) for name in window],
            offsets=[_offsets(capture, name) for name in window], window=window,
            everybody_seen=[capture.made("detections", name, ".people") for name in window],
        ),
        choices=adjust.Choices(**choices, max_gap=project.config["time"]["max_gap"]),
        measured=adjust.Measured(project.metric_facts(session), marks=[], marked=[], tags=[]),
        physics=project.config["physics"],
        written=adjust.Written(
            *(capture.made("adjust", session, kind) for kind in ("", ".covariance", ".metrics", ".findings"))
        ),
    )  # fmt: skip


def reconstructed(capture, session):
    """The 3D of an outdoor session: its close cameras adjusted, clocks, triangulated and refined."""
    adjusted(capture, session)
    rig, spread = [capture.made("adjust", session)], [capture.made("adjust", session, ".covariance")]
    names, close = capture.project.sequences_of(session), capture.project.close(session)
    for name in names:
        _clocks(capture, name, rig, spread)
    _bodies(capture, session, close)
    for name in names:
        skeleton(capture, session, name, close)


def _bodies(capture, session, close):
    walks = list(capture.project.window(session))
    bodies.run(
        session=session, cameras=[capture.made("adjust", session)], names=close,
        subjects={name: capture.project.subject_of(name) for name in walks},
        walks=bodies.Walks(
            detections=[capture.made("detections", name) for name in walks],
            everybody_seen=[capture.made("detections", name, ".people") for name in walks],
            timelines=[capture.made("timeline", name) for name in walks], seeds=[],
        ),
        min_score=capture.project.config["detector"]["min_score"], out=capture.made("bodies", session),
    )  # fmt: skip


def _outdoors(capture, session):
    project, close = capture.project, capture.project.close(session)
    reconstructed(capture, session)
    for camera in (name for name in project.cameras(session) if name not in close):
        _align(capture, session, camera)
        for name in project.sequences_of(session):
            _follow(capture, session, name, camera)


def skeleton(capture, session, name, close):
    """The 3D of an outdoor sequence, triangulated and refined."""
    choices, told_by = capture.project.config["triangulate"], capture.made("bodies", session)
    triangulate.run(
        sequence=name, subject=capture.project.subject_of(name), cameras=[capture.made("adjust", session)],
        names=close, detections=capture.made("detections", name), timeline=capture.made("timeline", name),
        method=choices["method"],
        limits=triangulate.Limits(
            min_score=capture.project.config["detector"]["min_score"], max_error_px=choices["max_error_px"],
            max_speed=choices["max_speed_m_s"], max_body_speed=choices["max_body_speed_m_s"],
            max_bone_change=choices["max_bone_change"],
        ),
        out=capture.made("triangulate", name), out_swaps=capture.made("triangulate", name, ".swaps"),
        findings=capture.made("triangulate", name, ".findings"),
        told=triangulate.Told(
            capture.made("detections", name, ".people"), capture.folder / "config/subjects.tsv",
            told_by if told_by.exists() else None,
        ),
        out_detections=capture.made("triangulate", name, ".detections"),
    )  # fmt: skip
    refine.run(
        sequence=name, subject=capture.project.subject_of(name), skeleton=capture.made("triangulate", name),
        max_gap_s=capture.project.config["refine"]["max_gap_s"], out=capture.made("refine", name),
        findings=capture.made("refine", name, ".findings"),
    )  # fmt: skip


def _align(capture, session, camera):
    unit, drawn = f"{session}/{camera}", capture.project.cameras(session)[camera]["align"]["sequences"]
    align.run(
        session=session, camera=camera, camera_file=_config(capture, session, camera),
        intrinsics=capture.made("intrinsics", unit),
        filmed=align.Walks(
            skeletons=[skeleton_of(capture, name) for name in drawn],
            frames=[capture.made("frames", name) for name in drawn],
        ),
        given=align.ByHand(
            offsets=[_offsets(capture, name) for name in drawn],
            boxes=[capture.folder / f"config/boxes/{name}.{camera}.csv" for name in drawn], marks=None,
        ),
        data_root=capture.folder / "data",
        triangulated_by=align.CloseCameras(
            [capture.made("adjust", session)], [capture.made("adjust", session, ".covariance")]
        ),
        out=capture.made("align", unit),
        out_covariance=capture.made("align", unit, ".covariance"),
        out_without=capture.made("align", unit, ".left_out"), findings=capture.made("align", unit, ".findings"),
    )  # fmt: skip


def _follow(capture, session, name, camera):
    unit, close = f"{name}.{camera}", capture.project.close(session)
    boxes = capture.folder / f"config/boxes/{name}.{camera}.csv"
    steps = [("adjust", session), ("align", f"{session}/{camera}")]
    follow.run(
        sequence=name, camera=camera, camera_file=_config(capture, session, camera),
        placed=follow.Placed(
            cameras=[capture.made(*step) for step in steps], makers=close,
            covariance=[capture.made(*step, ".covariance") for step in steps],
        ),
        skeleton=skeleton_of(capture, name), frames=capture.made("frames", name),
        given=follow.ByHand(_offsets(capture, name), boxes), data_root=capture.folder / "data",
        written=_clock_files(capture, "follow", unit),
    )  # fmt: skip


def skeleton_of(capture, name):
    """The 3D that the labels of a sequence come from."""
    return capture.made("mocap" if capture.project.indoor(name) else "refine", name)


def labels_of(capture, name, camera):
    """The labels of a camera of a sequence."""
    return capture.made("reproject", f"{name}.{camera}")


def _reproject(capture, name, every):
    session, indoor = capture.project.session_of(name), capture.project.indoor(name)
    close = capture.project.close(session)
    own = {one: "locate" if indoor else "adjust" if one in close else "align" for one in every}
    steps = dict.fromkeys((step, session if step == "adjust" else f"{session}/{one}") for one, step in own.items())
    kinds = {kind: [clock_tables(capture, name, one, kind) for one in every] for kind in ("", ".gains")}
    clocks, gains = (list(dict.fromkeys(path for paths in each for path in paths)) for each in kinds.values())
    reproject.run(
        sequence=name, subject=capture.project.subject_of(name), labelled=every,
        cameras=[capture.made(*step) for step in steps], makers=[] if indoor else close,
        covariance=[capture.made(*step, ".covariance") for step in steps],
        skeleton=skeleton_of(capture, name),
        frames=capture.made("frames", name), clocks=clocks, clock_gains=gains,
        source="mocap" if indoor else "triangulated", out=[labels_of(capture, name, one) for one in every],
    )  # fmt: skip


def clock_tables(capture, name, camera, kind):
    """Tables with the clocks of a camera and of those that made the 3D."""
    if camera not in capture.project.followed(name):
        return [capture.made("clocks", name, kind)]
    return [capture.made("clocks", name, kind), capture.made("follow", f"{name}.{camera}", kind)]
