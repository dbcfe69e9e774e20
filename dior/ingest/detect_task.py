"""Detections made here by MediaPipe: a pose landmarker's task file, run on the pictures of one camera.

INPUTS   a `.task` file (detector and landmark network in one) and BGR pictures.
OUTPUTS  per picture the people found: points (33, 3) u, v, score in recorded pixels, joints MLKIT_33; the score is
         MediaPipe's `visibility`. Landmarks outside the picture are guesses and stay.

The package `mediapipe` asks for an OpenCV build that takes the place of the pinned one in the same folder, which is why
it is no extra of this project: it is installed without what it asks for, and uses the OpenCV that is there.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from dior.arrays import AnyPath, Floats
from dior.body.names import MLKIT_33
from dior.errors import DiorError

# BGR (height, width, 3)
Picture: TypeAlias = NDArray[np.uint8]
# from (row, picture) pairs to (row, points (K, 3) of each person found)
Finder: TypeAlias = Callable[[Iterable[tuple[int, Picture]]], Iterator[tuple[int, list[Floats]]]]

SUFFIX = ".task"
INSTALL = "pip install --no-deps mediapipe absl-py flatbuffers"
# chosen: who of them is the subject is decided over the whole recording
MOST_PEOPLE = 3


def finder(model: AnyPath) -> Finder:
    """A function from (row, picture) pairs to (row, people) pairs. Raises DiorError as `load` does."""
    landmarker, image_of = load(model)

    def people(pictures: Iterable[tuple[int, Picture]]) -> Iterator[tuple[int, list[Floats]]]:
        with landmarker:
            for row, picture in pictures:
                found = landmarker.detect(image_of(picture)).pose_landmarks
                yield row, [points(one, picture.shape, model) for one in found]

    return people


def load(model: AnyPath) -> tuple[Any, Callable[[Picture], Any]]:
    """The landmarker of a task file and a function from a BGR picture to MediaPipe's image.

    Each picture is looked at alone (running mode IMAGE): in video mode landmarks follow the picture before, smoothed
    and late, and depend on where the recording begins. Raises DiorError where MediaPipe is missing or refuses the file.
    """
    try:
        import mediapipe
        from mediapipe.tasks.python import BaseOptions, vision
    except ImportError as error:
        raise DiorError(
            f"detector.model {model}: a {SUFFIX} file needs MediaPipe ({error}); install it beside the OpenCV that is "
            f"there: {INSTALL}"
        ) from None
    try:
        options = vision.PoseLandmarkerOptions(
            base_options=BaseOptions(model_asset_path=str(model)),
            running_mode=vision.RunningMode.IMAGE,
            num_poses=MOST_PEOPLE,
        )
        landmarker = vision.PoseLandmarker.create_from_options(options)
    # its exceptions have no base of their own, and a library that the machine lacks is an OSError
    except Exception as error:
        reason = next(iter(str(error).splitlines()), type(error).__name__)
        raise DiorError(
            f"detector.model {model}: no pose landmarker that MediaPipe opens ({reason:.200}); copy the file again"
        ) from None
    srgb = mediapipe.ImageFormat.SRGB
    return landmarker, lambda bgr: mediapipe.Image(image_format=srgb, data=np.ascontiguousarray(bgr[..., ::-1]))


def points(landmarks: Sequence[Any], shape: tuple[int, ...], model: AnyPath) -> Floats:
    """Points (33, 3) px of one person's landmarks, fractions from the edges of a picture of `shape` (height, width)."""
    if len(landmarks) != len(MLKIT_33):
        raise DiorError(
            f"detector.model {model}: gives {len(landmarks)} landmarks where a pose has {len(MLKIT_33)}; is it the "
            "task file of another solution?"
        )
    height, width = shape[:2]
    return np.array([(one.x * width - 0.5, one.y * height - 0.5, one.visibility or 0.0) for one in landmarks])
