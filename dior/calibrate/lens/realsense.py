"""What a bag cannot tell of a RealSense colour camera: whether its lens is plumb_bob or inverse_brown_conrady.

realsense-ros writes plumb_bob in either case, which is 3 px off at a normalised radius of 0.4 and 12 px at 0.8. So a
person names the model in the camera's YAML, and the residuals are reported under both.
realsense-viewer writes librealsense's own words, which are to be believed (`said_by_librealsense`).
"""

from collections.abc import Sequence
from dataclasses import replace

from dior.arrays import AnyPath
from dior.geometry.camera import Camera, Intrinsics

MODELS = ("plumb_bob", "inverse_brown_conrady")
CLEARLY_BETTER = 0.8  # chosen: the share of the error that the other model has to reach before a person is asked


# rs2_distortion_to_string (librealsense, src/to-string.cpp and include/librealsense2/h/rs_types.h): the same
# coefficients k1 k2 p1 p2 k3 as here, by rs2_project_point_to_pixel and rs2_deproject_pixel_to_point (rsutil.h)
LIBREALSENSE = {
    "None": "plumb_bob",
    "Brown Conrady": "plumb_bob",
    "Inverse Brown Conrady": "inverse_brown_conrady",
    "Modified Brown Conrady": "plumb_bob",
}
FISHEYES = ("Ftheta", "Kannala Brandt4")


def said_by_librealsense(model: str, D: Sequence[float]) -> tuple[str, str]:
    """(the lens model that a word of librealsense and coefficients `D` mean, "" for another's word; why it is refused,
    "" where it is not)."""
    word = model.strip().replace("_", " ").title()
    if word in FISHEYES:
        return "", f"'{model}' is librealsense's word for a fisheye lens, which is not understood"
    if word == "Modified Brown Conrady" and any(D[2:4]):
        return "", (
            f"'{model}' bends by p1 and p2 what is bent by k1 to k3 already, which is not understood unless p1 and p2 "
            "are 0"
        )
    if word == "None" and any(D):
        return "", f"'{model}' is librealsense's word for a lens without distortion, and D is not zero"
    return LIBREALSENSE.get(word, ""), ""


def is_colour(topic: str) -> bool:
    """Whether a topic is named as realsense-ros names its colour pictures; a leading slash may be missing."""
    return "/color/image_raw" in f"/{topic}"


def is_ambiguous(topic: str, lens: Intrinsics) -> bool:
    """Whether `Intrinsics` of a topic's pictures may be of either model; they are the same without distortion."""
    return is_colour(topic) and lens.model in MODELS and any(lens.distortion)


def as_other(camera: Camera) -> Camera:
    """The `Camera` with its lens of the other model."""
    (other,) = set(MODELS) - {camera.intrinsics.model}
    return replace(camera, intrinsics=replace(camera.intrinsics, model=other))


def finding(
    scope: str, what: str, named: str, named_px: float, other_px: float, path: AnyPath
) -> tuple[str, str, str, str]:
    """Finding on how `what` fits the lens `named` in the file `path` and the other model, mean px."""
    (other,) = set(MODELS) - {named}
    text = f"{what} are {named_px:.2f} px off with the lens as {named}, {other_px:.2f} px as {other}"
    if other_px < CLEARLY_BETTER * named_px:
        return scope, "warning", "lens_model_doubtful", f"{text}; check `distortion_model` in {path}"
    return scope, "info", "lens_models", text
