"""Whether each camera's intrinsics can be had and are those of its pictures, and whether its reference is in its file.

INPUTS   a `Project` (paths as seen from the working directory); what was recorded (`recordings.Recorded`)
OUTPUTS  faults in `Notes`
The intrinsics of a session are those of its first walk; of a bag's CameraInfo the first message is read.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from dior.calibrate import intrinsics
from dior.calibrate.readers import files
from dior.check.notes import Notes
from dior.check.recordings import Recorded
from dior.errors import DiorError
from dior.geometry.camera import Intrinsics
from dior.ingest import bags, messages
from dior.ingest.containers import BROKEN
from dior.ingest.glance import first_message
from dior.project.contents import Project
from dior.project.missing import can_be_read, line_of


def of_session(project: Project, session: str, recorded: Mapping[str, Mapping[str, Recorded]], notes: Notes) -> None:
    """Look at the cameras of a session. `recorded`: by walk and camera."""
    for name, settings in project.cameras(session).items():
        shown = project.camera_file(session, name)
        if settings["locate"] == "reference":
            reference = settings["reference"]
            path = Path(project.in_data(reference["file"]))
            with notes.kept(shown, line_of(project.root, shown, "reference")):
                if can_be_read(".", str(path)):
                    files.camera(path, reference["name"])
        first = recorded.get(project.first_sequence(session), {}).get(name)
        lens = None
        with notes.kept(shown, line_of(project.root, shown, "intrinsics")):
            lens = _lens(project, session, name, settings, first)
        for walk in project.sequences_of(session):
            if lens is not None and (one := recorded.get(walk, {}).get(name)) and one.width:
                with notes.kept(shown, line_of(project.root, shown, "intrinsics"), walk):
                    _check_size(project, walk, name, lens, one, shown)


def _lens(
    project: Project, session: str, name: str, settings: dict[str, Any], first: Recorded | None
) -> Intrinsics | None:
    """The intrinsics of a camera; None where they are found with a board or cannot be looked for. Raises DiorError."""
    source, model = settings["intrinsics"], settings.get("distortion_model", "")
    if isinstance(source, dict):
        path = Path(project.in_data(source["file"])) if "file" in source else None
        return intrinsics.from_file(path, source["name"], model) if path and can_be_read(".", str(path)) else None
    if first is None or not first.width:
        return None
    info = _camera_info(first, settings)
    shown = project.camera_file(session, name).removeprefix("config/")
    return intrinsics.from_camera_info(info, settings["topic"], model, shown, (first.width, first.height))


def _camera_info(recorded: Recorded, settings: dict[str, Any]) -> bags.CameraInfo:
    """The first CameraInfo of a camera. Raises DiorError where there is none."""
    topic = settings.get("camera_info") or bags.camera_info_topic(settings["topic"])
    for path in recorded.paths:
        message = first_message(path, bags.full_name(topic))
        if message is None:
            continue
        where = f"{path}: the first message of {topic}"
        if message.kind != messages.CAMERA_INFO:
            raise DiorError(f"{where} is a {message.kind}, not {messages.CAMERA_INFO}")
        try:
            return bags.CameraInfo(where=where, **messages.camera_info(message.raw, message.wire))
        except BROKEN as error:
            raise DiorError(f"{where} is no readable CameraInfo ({error})") from None
    raise DiorError(
        f"the bags with its pictures have no message of {topic}; name its topic (`camera_info:`), or give intrinsics "
        "from a file or a board"
    )


def _check_size(project: Project, walk: str, name: str, lens: Intrinsics, one: Recorded, shown: str) -> None:
    of_one = {"width": one.width, "height": one.height, "bag": one.paths[0], "topic": project.topics(walk)[name]}
    pictures = {key: np.array([value]) for key, value in of_one.items()}
    intrinsics.check_size(lens, pictures, name, shown.removeprefix("config/"))
