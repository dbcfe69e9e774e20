"""The `config/` of a simulated capture: what a person would have measured, clicked and drawn.

INPUTS   settings (the `simulate:` section)
OUTPUTS  config.yaml, sequences.tsv, subjects.tsv, sessions/, boxes/ in a folder, gallery.tsv if asked for; with
         `--practice` the recordings, too, and what is done by hand in the pictures is left undone
The committed demo config is what `dior simulate --write-config config` writes. Values are rounded as a person would
note them (0.01 px, 1 mm, 0.1 ms), and no picture is rendered for them: boxes are drawn around the outlines.
"""

import shlex
from copy import deepcopy
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import numpy as np

from dior.arrays import Floats, Ints
from dior.errors import DiorError
from dior.project.init import TEMPLATES
from dior.project.schema_check import check, describe, read_yaml
from dior.simulate import backdrop, draw, scene, simulate_gallery, truth
from dior.simulate.body import body_of
from dior.simulate.clocks import clocks_of
from dior.simulate.motion import motion_of
from dior.simulate.settings import (
    CAMERAS,
    SECTIONS,
    SESSIONS,
    Sequence,
    Settings,
    detections_path,
    from_dict,
    generator,
    place_of,
    sequences,
)
from dior.tables.files import write_text

# chosen, as somebody would who does not want to click for long: marked pictures of a camera, walks that the long-range
# camera is aligned to, marks in a picture, every how many pictures a box is drawn, instants of the adjustment
MARKED_FRAMES = 3
ALIGNED = 2
MOST_MARKS = 16
BOX_EVERY = 10
ADJUST_INSTANTS = 400
ALWAYS_SHOWN = ("seed", "subjects", "sequences", "duration_s", "long_range_m", "detector")
DETECTOR_SHOWN = {"ideal": ("level", "noise_px"), "real": ("level",)}
# what is recorded to practise on, and the folders beside its config
ONE_OF_EACH = {"subjects": 1, "sequences": 1, "markers": True}
RECORDINGS, SOLUTION, NOTEBOOK = "recordings", "solution", "notebook.txt"
# chosen: how well a height is measured against a wall
HEIGHT_SIGMA_M = 0.01


def run(
    *, write_config: Path | None = None, practice: Path | None = None, settings: dict[str, Any] | None = None
) -> None:
    """Write the config of a simulated capture, or a project to practise on.

    `write_config`: folder to write the config to; `practice`: folder of a new project, with its recordings, in which
    the marks, the boxes and the long-range camera are left to do; `settings`: what differs from the demo, as JSON, such
    as '{"subjects": 1, "sequences": 1, "duration_s": 4}' (all keys: `simulate:` in a project's config.yaml).
    Raises DiorError where there is a config already: what a person wrote is never overwritten.
    """
    folder = write_config if practice is None else practice / "config"
    if folder is None or (write_config and practice):
        raise DiorError("give either --write-config with a folder for the config, or --practice with one for a project")
    if (folder / "config.yaml").exists():
        raise DiorError(f"{folder / 'config.yaml'} exists already; choose another folder or remove it first")
    given = ({} if practice is None else ONE_OF_EACH) | (settings or {})
    whole = read_yaml(TEMPLATES / "config.yaml") | {"simulate": deepcopy(given)}
    check(whole, "config", "--settings")
    if practice is None:
        write(from_dict(given), folder)
    else:
        write_practice(from_dict(given), practice)


def write_practice(settings: Settings, folder: Path) -> None:
    """Write a project that lacks what is done by hand in the pictures, beside it the config of who has done it, and
    what somebody noted on the day, for who makes a project of the recordings alone.

    The config comes last, when all is recorded.
    """
    from dior.simulate import simulate, simulate_gallery, simulate_mocap

    recordings = folder / RECORDINGS
    for walk in sequences(settings):
        simulate.record(settings, walk, recordings)
        if walk.environment == "indoor":
            simulate_mocap.record(settings, walk, recordings)
        if settings.gallery:
            simulate_gallery.write(settings, walk, recordings / "gallery" / walk.name)
    write_text(folder / NOTEBOOK, _notebook(settings))
    write(settings, folder / SOLUTION, RECORDINGS)
    write(settings, folder / "config", RECORDINGS, undone=True)
    print(
        f"Wrote {folder}, a project in which the marks of the lab's cameras, the boxes and the place of the field's "
        f"long-range camera are left to do; in {SOLUTION}/ they are done. Type\n"
        f"  dior run {shlex.quote(str(folder.resolve()))}\nto hear what is missing"
    )


def write(settings: Settings, folder: Path, recordings: str | None = None, undone: bool = False) -> None:
    """Write every file of the config below `folder`.

    `recordings`: the folder that they are in already; `undone`: without marks, boxes and what the long-range camera is
    fitted to.
    """
    walks = sequences(settings)
    write_text(folder / "config.yaml", config_yaml(settings, recordings))
    write_text(folder / "sequences.tsv", _sheet([_sequence_row(settings, walk) for walk in walks]))
    write_text(folder / "subjects.tsv", _sheet([_subject_row(settings, s) for s in _subjects(walks)]))
    if settings.gallery:
        write_text(folder / "gallery.tsv", _sheet(simulate_gallery.rows(walks)))
    for session in dict.fromkeys(walk.session for walk in walks):
        own = [walk for walk in walks if walk.session == session]
        _write_session(settings, folder / "sessions" / session, session, own, undone)
    for walk in walks:
        if walk.environment == "outdoor" and not undone:
            path = folder / "boxes" / f"{walk.name}.{scene.LONG_RANGE}.csv"
            write_text(path, _boxes(settings, walk))


def config_yaml(settings: Settings, recordings: str | None = None) -> str:
    """config.yaml: the template of `dior init`, with the data below results/ and the `simulate:` section; or, where
    there are `recordings`, with their folder alone."""
    template = (TEMPLATES / "config.yaml").read_text(encoding="utf-8")
    assert "\ndata_root: data\n" in template
    if recordings is not None:
        return template.replace("\ndata_root: data\n", f"\ndata_root: {recordings}\n")
    text = template.replace("\ndata_root: data\n", "\ndata_root: results/simulate\n")
    keys = "dior/project/schemas/config.schema.yaml"
    text += f"\n# The capture is simulated. All keys and their defaults: {keys}.\nsimulate:\n"
    default, given = asdict(from_dict({"preset": settings.preset})), asdict(settings)
    default["preset"] = Settings.preset
    for key in (field.name for field in fields(Settings)):
        if key not in ALWAYS_SHOWN and given[key] == default[key]:
            continue
        value = given[key]
        if key in SECTIONS:
            shown = DETECTOR_SHOWN[value["level"]] if key == "detector" else ()
            value = {name: entry for name, entry in value.items() if name in shown or entry != default[key][name]}
        text += f"  # {describe('config', 'simulate', key)}\n  {key}: {_yaml(value)}\n"
    return text


def _yaml(value: Any) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key}: {_yaml(entry)}" for key, entry in value.items()) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_yaml(entry) for entry in value) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    return str(value)


def _sheet(rows: list[dict[str, Any]]) -> str:
    lines = [list(rows[0]), *(row.values() for row in rows)]
    return "".join("\t".join(map(str, line)) + "\n" for line in lines)


def _subjects(walks: list[Sequence]) -> list[str]:
    return list(dict.fromkeys(walk.subject for walk in walks))


def _sequence_row(settings: Settings, walk: Sequence) -> dict[str, Any]:
    indoor = walk.environment == "indoor"
    return {
        "sequence": walk.name,
        "session_order": int(walk.name.rsplit("_", 1)[1]),
        "subject": walk.subject,
        "session": walk.session,
        "environment": walk.environment,
        "outfit": walk.outfit,
        "walk": walk.walk,
        "bags": f"{walk.name}/pc1.bag;{walk.name}/pc2.bag",
        "mocap": f"{walk.name}/mocap.c3d" if indoor else "",
        "detections": detections_path(settings, walk.name),
        "trigger_log": "",
        "exclude_reason": "",
        "truth": f"truth/{walk.name}",
    }


def _subject_row(settings: Settings, subject: str) -> dict[str, str]:
    random = generator(settings, "person", subject)
    height = body_of(settings, subject).height + HEIGHT_SIGMA_M * random.standard_normal()
    return {
        "subject": subject,
        "pseudonym": f"p{random.integers(16**9, 16**10):010x}",
        "height_m": f"{height:.2f}",
        "height_sigma_m": f"{HEIGHT_SIGMA_M:g}",
        "consent_release": "yes",
        "consent_pictures": "yes",
    }


def _notebook(settings: Settings) -> str:
    """What nothing in the recordings tells."""
    walks = sequences(settings)
    lines = ["All colour cameras have the lens model plumb_bob.", ""]
    for row in (_subject_row(settings, subject) for subject in _subjects(walks)):
        own = ", ".join(walk.name for walk in walks if walk.subject == row["subject"])
        lines += [
            f"{row['subject']}, who walks in {own}: {row['height_m']} m tall, measured to {row['height_sigma_m']} m. "
            "Agreed to the release of labels and of pictures.",
        ]
    for session in dict.fromkeys(walk.session for walk in walks if walk.environment == "outdoor"):
        lines += ["", f"{session}: where the lenses are by tape, x, y, z in m from the middle of the walkway, z up"]
        lines += [
            f"{name}  {', '.join(f'{x:.3f}' for x in placed.tape)}  (to {placed.sigma:g} m)"
            for name, placed in scene.cameras_of(settings, session).items()
        ]
    return "\n".join(lines) + "\n"


def _write_session(settings: Settings, folder: Path, session: str, walks: list[Sequence], undone: bool) -> None:
    outdoor = place_of(session) == SESSIONS["outdoor"]
    text = f"cameras: [{', '.join(CAMERAS)}]\n"
    if outdoor:
        first = {walk.subject: walk.name for walk in reversed(walks)}
        count = min(ADJUST_INSTANTS // len(first), int(settings.duration_s * settings.fps) - 1)
        text += "# a walk of every person, which together cover the walkway\nadjust:\n"
        text += "".join(f"  {name}: {{first: 0, count: {count}, step: 1}}\n" for name in sorted(first.values()))
    write_text(folder / "session.yaml", text)
    boxed = [] if undone else sorted(walk.name for walk in walks)[:ALIGNED]
    for name, placed in scene.cameras_of(settings, session).items():
        write_text(folder / f"{name}.yaml", _camera_yaml(settings, name, placed, outdoor, boxed))
        if not (outdoor or undone):
            seen = truth.view(settings, walks[0], motion_of(settings, walks[0]), name)
            write_text(folder / f"{name}.marks.csv", marks(settings, walks[0], seen))


def _camera_yaml(settings: Settings, name: str, placed: scene.Placed, outdoor: bool, boxed: list[str]) -> str:
    long_range = placed.camera.role == "long_range"
    lines = [
        f"role: {placed.camera.role}",
        f"topic: /{name}/color/image_raw/compressed",
        "intrinsics: camera_info",
        f"intrinsics_sigma: {settings.intrinsics_error:g}",
        "# the simulator's lens is what the bag says; a real RealSense may not be",
        "distortion_model: plumb_bob",
        f"locate: {'align' if long_range else 'tape' if outdoor else 'marks'}",
    ]
    if outdoor:
        numbers = [f"[{', '.join(f'{x:.3f}' for x in point)}]" for point in (placed.tape, placed.target)]
        lines.append(f"tape: {{position_m: {numbers[0]}, sigma_m: {placed.sigma:g}, target_m: {numbers[1]}}}")
    if long_range and boxed:
        lines.append(
            "# the boxes of two walks place it; the list is fixed, so that a new walk does not move old labels"
        )
        lines.append(f"align: {{from: boxes, sequences: [{', '.join(boxed)}], fit: range}}")
    return "\n".join(lines) + "\n"


def marks(
    settings: Settings, walk: Sequence, seen: truth.View, frames: int = MARKED_FRAMES, worth: Floats | None = None
) -> str:
    """Clicked markers (CSV): on a few frames of a walk, those that show best in a camera's `truth.View`.

    `worth` (P,) of a visible marker in each picture; 1 without it.
    """
    motion, camera = motion_of(settings, walk), seen.camera.name
    markers = [i for i, name in enumerate(seen.joints) if name in motion.names]
    visible = seen.status[:, markers] == "ok"
    shows = visible.sum(axis=1) * (1.0 if worth is None else worth)
    random, lens = generator(settings, "marks", walk.session, camera), seen.camera.intrinsics
    numbers = seen.clock.frame_numbers
    lines = ["sequence,frame,joint,u,v"]
    for part in np.array_split(np.arange(len(visible)), frames):
        frame = int(part[shows[part].argmax()])
        shown = np.flatnonzero(visible[frame])
        for i in sorted(random.permutation(shown)[:MOST_MARKS].tolist()):
            clicked = seen.uv[frame, markers[i]] + settings.mark_noise_px * random.standard_normal(2)
            # nobody clicks beside the picture
            u, v = np.clip(clicked, -0.5, np.array([lens.width, lens.height]) - 0.51)
            lines.append(f"{walk.name},{numbers[frame]},{seen.joints[markers[i]]},{u:.2f},{v:.2f}")
    return "\n".join(lines) + "\n"


def _boxes(settings: Settings, walk: Sequence) -> str:
    """Boxes drawn around the person in the long-range picture; an edge is `box_margin_px` too far out, give or take.

    One person draws them all, who has the same habits (`box_habit_px`) in every box.
    """
    motion = motion_of(settings, walk)
    seen = truth.view(settings, walk, motion, scene.LONG_RANGE)
    frames = np.arange(0, len(seen.seconds), BOX_EVERY)
    tight = tight_boxes(settings, walk, motion.height, seen, frames)
    habit = settings.box_habit_px * generator(settings, "drawer").standard_normal(4)
    random = generator(settings, "boxes", walk.name)
    numbers = seen.clock.frame_numbers
    lines = ["frame,u_min,v_min,u_max,v_max"]
    for frame, box in zip(frames.tolist(), tight, strict=True):
        outwards = settings.box_margin_px + habit + settings.box_sd_px * random.standard_normal(4)
        if np.isfinite(box).all():
            edges = box + outwards * (-1, -1, 1, 1)
            lines.append(f"{numbers[frame]},{','.join(f'{edge:.2f}' for edge in edges)}")
    return "\n".join(lines) + "\n"


def tight_boxes(settings: Settings, walk: Sequence, height: float, seen: truth.View, frames: Ints) -> Floats:
    """Boxes (F, 4) px without any error in the pictures `frames` (F,) of a camera's `truth.View`, NaN without anybody.

    Around what is seen of the body as it is drawn; or around its joints, also those that something hides.
    """
    if settings.box_around == "joints":
        uv, status = seen.landmark(seen.uv)[frames], seen.landmark(seen.status)[frames]
        known = ((status == "ok") | (status == "occluded"))[..., None]
        low, high = np.where(known, uv, np.inf).min(axis=1), np.where(known, uv, -np.inf).max(axis=1)
        box = np.concatenate([low, high], axis=1)
        return np.where(np.isfinite(box), box, np.nan)
    points = draw.figure(seen.landmarks[frames], height)
    drawing = draw.outlines(seen.camera, points, height, walk.outfit, walk.subject, settings.figure)
    wall = backdrop.in_front(settings, seen.camera, walk.environment)
    return draw.seen_boxes(drawing, (settings.width, settings.height), wall)


def write_offsets(settings: Settings, folder: Path) -> None:
    """Write the true clocks of every walk below `folder`, as a person would give them."""
    for walk in sequences(settings):
        write_text(folder / "offsets" / f"{walk.name}.yaml", _offsets(settings, walk))


def _offsets(settings: Settings, walk: Sequence) -> str:
    clocks, _ = clocks_of(settings, walk)
    lines = [
        f"{name}: {{offset_s: {clock.offset_s:.4f}, drift_ppm: {clock.drift_ppm:g}}}" for name, clock in clocks.items()
    ]
    return "\n".join(lines) + "\n"
