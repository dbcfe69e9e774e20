"""The gallery of a walk's subject in its outfit: pictures from all around, from two angles.

INPUTS   the `simulate:` section and the sequence's name
OUTPUTS  below `out` (data_root): gallery/<sequence>/<angle>/<degrees>.jpg: the person turns on the spot to the left, 0
         degrees is face to the camera; angle `frontal` is from the height of the hips, `down45` looks 45 degrees down
"""

from pathlib import Path
from typing import Any

import numpy as np

from dior.geometry.camera import Camera, Intrinsics, pose
from dior.geometry.multiview import look_at
from dior.simulate import backdrop, draw
from dior.simulate.body import body_of
from dior.simulate.bystander import standing
from dior.simulate.settings import Sequence, Settings, from_dict, sequence_named
from dior.tables.files import written_whole

# chosen: the whole body in the picture, from all around
ELEVATION_DEG = {"frontal": 0.0, "down45": 45.0}
STEP_DEG = 10
TARGET = np.array([0.0, 0.0, 0.9])
DISTANCE_M = 2.7


def run(*, settings: dict[str, Any], sequence: str, out: Path) -> None:
    """Write the gallery of one sequence's subject below `out`. `settings` is the section as a dict."""
    capture = from_dict(settings)
    walk = sequence_named(capture, sequence)
    write(capture, walk, Path(out) / "gallery" / walk.name)


def write(settings: Settings, sequence: Sequence, folder: Path) -> None:
    """Write the pictures of both angles below `folder`."""
    import cv2

    body = body_of(settings, sequence.subject)
    turns = np.arange(0, 360, STEP_DEG)
    landmarks = np.stack([standing(body, np.zeros(2), np.deg2rad(turn)) for turn in turns])
    figure = draw.figure(landmarks, body.height)
    for angle, camera in cameras(settings).items():
        empty = backdrop.background(settings, camera, "indoor")
        outlines = draw.outlines(camera, figure, body.height, sequence.outfit, sequence.subject, settings.figure)
        for i, turn in enumerate(turns.tolist()):
            picture = empty.copy()
            draw.paint(picture, outlines, i)
            jpeg = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, settings.jpeg_quality])[1]
            with written_whole(folder / angle / f"{turn:03d}.jpg") as part:
                part.write_bytes(jpeg.tobytes())


def cameras(settings: Settings) -> dict[str, Camera]:
    """The cameras of both angles by name."""
    lens = Intrinsics(
        settings.width, settings.height, settings.fx, settings.fx, (settings.width - 1) / 2, (settings.height - 1) / 2
    )
    found = {}
    for angle, elevation in ELEVATION_DEG.items():
        up = np.deg2rad(elevation)
        centre = TARGET + DISTANCE_M * np.array([np.cos(up), 0.0, np.sin(up)])
        found[angle] = Camera(angle, lens, pose(look_at(centre, TARGET), centre))
    return found


def rows(sequences: list[Sequence]) -> list[dict[str, str]]:
    """Rows of gallery.tsv: every subject and outfit once, from both angles, from the first walk that shows them."""
    first = {(walk.subject, walk.outfit): walk.name for walk in reversed(sequences)}
    return [
        {"subject": subject, "outfit": outfit, "angle": angle, "path": f"gallery/{name}/{angle}"}
        for (subject, outfit), name in sorted(first.items())
        for angle in ELEVATION_DEG
    ]
