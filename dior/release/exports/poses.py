"""COCO-17 in the pictures of a recording: the labels of that name, or joint centres derived from labels of markers.

INPUTS   labels of a recording and its camera
OUTPUTS  `Pose`: pixel, sigma and status of 17 joints per picture, and which were derived by what rule
A derived joint is made in 3D at the picture's own stamp: a label says how far its marker is from the camera, so that
the markers of a picture are in the world again, with the clock that the labels were made with, which is not in the
release. The joint centres (dior/body/coco17.py) are projected like every label.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from dior.arrays import Bools, Floats, Ints, Texts
from dior.body.coco17 import coco17
from dior.body.joint_centres import CENTRES
from dior.body.names import COCO_17
from dior.geometry import camera as cam
from dior.geometry.camera import Camera
from dior.label.reproject import labels as projected
from dior.release.exports.recordings import Labels, Recording
from dior.tables.words import LABEL_STATUS

OK, OCCLUDED, MISSING = (LABEL_STATUS.index(word) for word in ("ok", "occluded", "missing_3d"))


@dataclass(frozen=True, eq=False)
class Pose:
    """F pictures: `frame`, `stamp_ns` (F,); `uv`, `sigma` (F, 17, 2) px, NaN where not known; `status` (F, 17): indices
    into `LABEL_STATUS`; `derived` (17,) bool and `rules` (17 words); `box` (F, 4): the smallest and largest u and v of
    all joints in the picture, derived or not, NaN where there is none."""

    frame: Ints
    stamp_ns: Ints
    uv: Floats
    sigma: Floats
    status: NDArray[np.int8]
    derived: Bools
    rules: tuple[str, ...]
    box: Floats

    @property
    def inside(self) -> Bools:
        """Joints (F, 17) that lie in the picture, seen or hidden by the body."""
        return (self.status == OK) | (self.status == OCCLUDED)


# what a format about recordings does with each recording, its pose and why pictures lack, by frame
AddRecording: TypeAlias = Callable[[Recording, Pose, dict[int, str]], None]


def of(labels: Labels, camera: Camera) -> Pose:
    """The `Pose` of labels (recordings.Labels) in pictures of `camera`."""
    frames = len(labels.frame)
    uv, sigma = np.full((frames, 17, 2), np.nan), np.full((frames, 17, 2), np.nan)
    status = np.full((frames, 17), MISSING, np.int8)
    named = np.array([joint in labels.joints for joint in COCO_17])
    index = [labels.joints.index(joint) for joint in COCO_17 if joint in labels.joints]
    uv[:, named], sigma[:, named] = labels.uv[:, index], labels.sigma[:, index]
    status[:, named] = labels.status[:, index]
    derived = np.zeros(17, bool)
    rules: tuple[str, ...] = ("named",) * 17
    if not named.all():
        world = cam.unproject(camera, labels.uv, labels.depth)
        points, derived, rules = coco17(world, labels.joints)
        found, _, words = projected(camera, points, COCO_17)
        uv[:, derived] = found[:, derived]
        status[:, derived] = _codes(words[:, derived])
        sigma[:, derived] = _markers_sigma(labels, derived)
    uv[status == MISSING] = np.nan
    sigma[~np.isfinite(uv).all(axis=-1)] = np.nan
    box = _box(np.concatenate([labels.uv, uv], axis=1), np.concatenate([labels.status, status], axis=1))
    return Pose(labels.frame, labels.stamp_ns, uv, sigma, status, derived, rules, box)


def _codes(words: Texts) -> NDArray[np.int8]:
    out = np.full(words.shape, MISSING, np.int8)
    for code, word in enumerate(LABEL_STATUS):
        out[words == word] = code
    return out


def _markers_sigma(labels: Labels, derived: Bools) -> Floats:
    """Sigma (F, D, 2) px of derived joints: the mean of that of their nearest markers, which the errors of the camera
    and of its clock move together with them. Null where one of those is; the rule's own error is not counted."""
    out = np.full((len(labels.frame), int(derived.sum()), 2), np.nan)
    for i, joint in enumerate(np.array(COCO_17)[derived]):
        near = [labels.joints.index(marker) for marker in CENTRES[joint][0] if marker in labels.joints]
        if near:
            out[:, i] = labels.sigma[:, near].mean(axis=1)
    return out


def _box(uv: Floats, status: NDArray[np.int8]) -> Floats:
    inside = ((status == OK) | (status == OCCLUDED))[..., None]
    low, high = np.where(inside, uv, np.inf).min(axis=1), np.where(inside, uv, -np.inf).max(axis=1)
    box = np.concatenate([low, high], axis=1)
    return np.where(np.isfinite(box), box, np.nan)
