"""What a calibration file of any tool says of a camera, and what a reader needs to say it.

OUTPUTS  `GivenCamera`: lens and pose as the file has them, with what it says of their convention, unit and world
A part that is not there, or cannot be right, is the sentence that refuses it: it is raised where that part is asked
for, so that a file may give the lens of one camera and the pose of another.
"""

import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from dior.arrays import AnyPath, Floats
from dior.errors import DiorError
from dior.geometry.camera import MODELS, Intrinsics, in_frame, inverse_pose, pose
from dior.geometry.rotation import from_rotvec, nearest_rotation

# of a translation, by `reference.units`
METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001}
CONVENTIONS = ("cTw", "wTc")
# chosen: no focal length in px, no distortion and no place in mm is larger
LARGEST = 1e7
# chosen: rounding to four digits; what is further off is no rotation
ORTHONORMAL = 1e-3
# chosen: px; a picture of 100 px would show 150 degrees, beyond any lens that is read
LEAST_FOCAL = 10.0
# chosen: of a picture's sides; principal points of whole pictures are this near to the middle
NEAR_CENTRE = 0.2
Part = TypeVar("Part")


@dataclass(frozen=True, eq=False)
class Lens:
    """A pinhole `K` (3, 3) px and its `distortion` for pictures of `width` x `height` px.

    `model` is one of `geometry.camera.MODELS`, or the file's own word for a lens that dior has not. Where the file does
    not say it (`said`), it is the usual one, and the camera's YAML may name another.
    """

    width: int
    height: int
    K: Floats
    model: str
    distortion: tuple[float, ...]
    said: bool = True


@dataclass(frozen=True, eq=False)
class Pose:
    """`T` (4, 4), its translation in `units`: world to camera (`convention` cTw) or camera to world (wTc).

    "" is what the file does not say, and a person has to. `assumed`: convention and units are the format's usual ones,
    and a person may say others. `origin`: what the world stands on where that is no floor with Z up, "" where the file
    does not tell.
    """

    T: Floats
    convention: str = ""
    units: str = ""
    assumed: bool = False
    origin: str = ""


@dataclass(frozen=True, eq=False)
class GivenCamera:
    """A camera by the `name` it has in the file, or one of the names `also`; a part that is refused is the error."""

    name: str
    lens: Lens | DiorError
    pose: Pose | DiorError
    also: tuple[str, ...] = ()


def part(make: Callable[[], Part]) -> Part | DiorError:
    """What `make` gives, or the error by which it refuses."""
    try:
        return make()
    except DiorError as error:
        return error


def numbers(section: Mapping[str, Any], key: str, shapes: Collection[tuple[int, ...]], where: str) -> Floats:
    """The numbers of `key`, of one of some shapes. Raises DiorError for anything else, `where` it stands first."""
    if key not in section:
        raise DiorError(f"{where}: `{key}` is missing")
    wanted = " or ".join(" x ".join(map(str, shape)) for shape in shapes)
    wanted = f"{wanted} numbers" if wanted else "one number"
    try:
        values = np.array(section[key], float)
    except (ValueError, TypeError, OverflowError):
        words = section[key] if isinstance(section[key], list) else [section[key]]
        comma = next((word for word in words if isinstance(word, str) and re.fullmatch(r"\s*[+-]?\d+,\d+.*", word)), "")
        fix = f", and '{comma:.40}' has a decimal comma; write a point" if comma else ""
        raise DiorError(f"{where}: `{key}` must be {wanted}{fix}") from None
    if values.shape not in shapes:
        given = " x ".join(map(str, values.shape)) or "one"
        raise DiorError(f"{where}: `{key}` must be {wanted}, and there is {given}")
    if not (np.abs(values) <= LARGEST).all():
        raise DiorError(f"{where}: `{key}` has a value that is not finite or above {LARGEST:.0e}")
    return values


def matrix(content: Mapping[str, Any], key: str, where: str) -> Floats:
    """A matrix written as `rows`, `cols` and `data`, as ROS and OpenCV do, or as a list of its rows, as Python's json
    does. Raises DiorError for anything else."""
    node = content.get(key)
    if isinstance(node, list):
        listed = node if node and isinstance(node[0], list) else [node]
        return numbers({key: listed}, key, [(len(listed), len(listed[0]))], where)
    if not isinstance(node, Mapping):
        raise DiorError(f"{where}: `{key}` is missing, or no matrix with rows, cols and data")
    if "sizes" in node and "rows" not in node:
        # how OpenCV 5 writes a vector
        node = {**node, "rows": numbers(node, "sizes", [(1,)], f"{where}: {key}")[0], "cols": 1}
    rows, columns = (int(numbers(node, side, [()], f"{where}: {key}")) for side in ("rows", "cols"))
    data = node.get("data")
    count = len(data) if isinstance(data, list) else 0
    if min(rows, columns) < 0 or count != rows * columns:
        raise DiorError(f"{where}: `{key}` is {rows} x {columns}, and has {count} numbers")
    return numbers(node, "data", [(count,)], f"{where}: {key}").reshape(rows, columns)


def size(values: Sequence[float] | Floats, where: str) -> tuple[int, int]:
    """Width and height (px) of pictures, whole and positive."""
    width, height = (round(float(value)) for value in values)
    if width < 1 or height < 1 or max(abs(width - values[0]), abs(height - values[1])) > 1e-6:
        raise DiorError(f"{where}: pictures of {values[0]:g} x {values[1]:g} px cannot be")
    return width, height


def rotation(values: Floats, where: str) -> Floats:
    """Rotation (3, 3) from a Rodrigues vector (3,) in rad or a matrix (3, 3). Raises DiorError for what is none."""
    if values.shape == (3,):
        if (turn := float(np.linalg.norm(values))) > 2 * np.pi * 1.01:
            raise DiorError(
                f"{where}: rotation is a Rodrigues vector of {turn:.0f} rad, more than a whole turn; if it is in "
                "degrees, multiply it by pi / 180"
            )
        return from_rotvec(values)
    if np.abs(values @ values.T - np.eye(3)).max() > ORTHONORMAL:
        raise DiorError(f"{where}: rotation is no rotation matrix (its rows must be orthonormal and right-handed)")
    if np.linalg.det(values) < 0:
        raise DiorError(
            f"{where}: rotation is no rotation matrix but mirrors, so the calibration is left-handed; export it with a "
            "right-handed world and OpenCV's axes (x right, y down, z forward)"
        )
    return nearest_rotation(values)


def intrinsics(camera: GivenCamera, distortion_model: str, where: str) -> Intrinsics:
    """The lens of a camera; `distortion_model` is what the camera's YAML says of it, "" for nothing.

    Raises DiorError for a lens that dior has not, by its name, and for a word of the YAML against the file's own.
    """
    if isinstance(camera.lens, DiorError):
        raise camera.lens
    lens = camera.lens
    model = lens.model if lens.said else distortion_model or lens.model
    if model not in MODELS:
        raise DiorError(
            f"{where}: a lens of the model {model} is not understood; the models are {', '.join(MODELS)}. Rectify its "
            "pictures before they are recorded, and give the K of these without distortion"
        )
    if lens.said and distortion_model and distortion_model != lens.model:
        raise DiorError(
            f"{where}: the file says that the lens is {lens.model}, and `distortion_model` in the camera's YAML says "
            f"{distortion_model}; delete the key there"
        )
    found = checked(lens.width, lens.height, lens.K, model, lens.distortion, where)
    _check_pixels(found, where)
    return found


def _check_pixels(lens: Intrinsics, where: str) -> None:
    """Raise DiorError where K is no pixels, or the principal point lies outside the picture, with what that looks like.

    Only of files: a bag says of which part of the sensor its pictures are, and there it may lie outside.
    """
    focal, centre, sides = np.array([[lens.fx, lens.fy], [lens.cx, lens.cy], [lens.width, lens.height]])
    if focal.max() < LEAST_FOCAL:
        raise DiorError(
            f"{where}: the focal lengths {lens.fx:g} and {lens.fy:g} are no pixels; if K is in fractions of the "
            f"picture, multiply its first row by {lens.width} and its second by {lens.height}"
        )
    if in_frame(lens, centre):
        return
    if np.abs(focal / sides - 0.5).max() < NEAR_CENTRE:
        fix = "it looks as if focal lengths and principal point were exchanged"
    elif (centre > 0).all():
        fix = (
            f"K looks like one of pictures of about {2 * lens.cx:.0f} x {2 * lens.cy:.0f} px; give K and size of the "
            "pictures that were recorded"
        )
    else:
        fix = "give the K of the whole pictures that were recorded"
    raise DiorError(
        f"{where}: the principal point {lens.cx:g}, {lens.cy:g} lies outside the pictures of {lens.width} x "
        f"{lens.height} px; {fix}"
    )


def checked(width: int, height: int, K: Floats, model: str, coefficients: Sequence[float], where: str) -> Intrinsics:
    """`Intrinsics` of a `K` (3, 3) px; refuses what no lens can have."""
    (fx, skew, cx), (below, fy, cy), last = K.tolist()
    if below or last != [0, 0, 1]:
        looks = "; it looks transposed: write it by rows" if any(last[:2]) and not (cx or cy) else ""
        raise DiorError(f"{where}: K must have 0 below its diagonal and the last row 0, 0, 1, and has {last}{looks}")
    if not (fx > 0 and fy > 0) or skew:
        raise DiorError(f"{where}: the focal lengths {fx} and {fy} must be positive and the skew {skew} zero")
    if model != "rational_polynomial" and any(coefficients[5:]):
        raise DiorError(f"{where}: k4, k5 and k6 are given, but {model} has none of them; it is rational_polynomial")
    return Intrinsics(width, height, fx, fy, cx, cy, model, tuple(coefficients))


def placed(camera: GivenCamera, path: AnyPath, convention: str, units: str, world: str) -> Floats:
    """wTc (4, 4) m of a camera of the file `path`; the others are what the camera's YAML says, "" for nothing.

    Raises DiorError where neither says the convention or the unit, where they contradict each other, and where the
    file's world is none with Z up and `world` takes it as given.
    """
    if isinstance(camera.pose, DiorError):
        raise camera.pose
    given, where = camera.pose, f"{path} [{camera.name}]"
    convention = _settled("convention", given.convention, given.assumed, convention, CONVENTIONS, where)
    units = _settled("units", given.units, given.assumed, units, METRES, where)
    if given.origin and world == "as_given":
        raise DiorError(
            f"{where}: {given.origin}, so that its Z is no vertical and its Z = 0 no floor; set `reference.world: "
            "from_walk` in the YAML of every camera of it, which takes both from the session's first outdoor walk, or "
            "`from_marks`, by three measured points"
        )
    T = pose(given.T[:3, :3], METRES[units] * given.T[:3, 3])
    return inverse_pose(T) if convention == "cTw" else T


def _settled(key: str, said: str, assumed: bool, asked: str, known: Collection[str], where: str) -> str:
    """The `convention` or `units` by the file or by the camera's YAML."""
    what = key.removesuffix("s")
    if asked and asked not in known:
        raise DiorError(f"{where}: {what} '{asked}' is not one of {', '.join(known)}")
    if said and not assumed and asked not in ("", said):
        raise DiorError(
            f"{where}: its {what} is {said} by its format, and `reference.{key}` in the camera's YAML says {asked}; "
            "delete the key there"
        )
    if not said and not asked:
        raise DiorError(
            f"{where}: the file does not say its {what}; add `reference.{key}` ({', '.join(known)}) to the YAML of the "
            "camera"
        )
    return asked or said
