"""Pictures of a simulated walk in which people wear caps and buns, and where their heads are in them: the truth that
covers are measured against. It is another head than the one that the release's covers are made for."""

from dataclasses import dataclass

import cv2
import numpy as np

from dior.body.names import MLKIT_33
from dior.simulate import backdrop, draw
from dior.simulate.motion import motion_of
from dior.simulate.settings import sequence_named

SUBSAMPLES, SHIFT = 8, 4
HEAD = [i for i, limb in enumerate(draw._LIMBS) if limb[0] in ("skull", "face")]
# Beside skull and face: a cap that reaches 18 cm above the ears, with a peak, or a bun behind the head. In the head's
# axes (forward, left, up) m from the middle between the ears, two ends and a radius.
WEAR = {
    "cap": (((0.0, 0.0, 0.08), (0.0, 0.0, 0.09), 0.09), ((0.08, 0.0, 0.07), (0.16, 0.0, 0.06), 0.02)),
    "bun": (((-0.12, 0.0, 0.03), (-0.14, 0.0, 0.04), 0.045),),
}
COLOUR = (60, 40, 150)


@dataclass(frozen=True)
class Person:
    """Somebody in the pictures of a camera: the drawn body, the polygons of the head (P, 2, N) px, what is worn on it,
    in how many pictures they are there, and how far from the camera."""

    drawing: draw.Drawing
    heads: np.ndarray
    worn: np.ndarray
    present: np.ndarray
    far: np.ndarray


@dataclass(frozen=True)
class Scene:
    """The pictures of a camera of a walk: the empty one, who is in it (the subject first), what hides them."""

    empty: np.ndarray
    people: list
    wall: np.ndarray | None
    quality: int

    def picture(self, i):
        """(height, width, 3) uint8, as it comes out of its JPEG."""
        shown = self.empty.copy()
        there = sorted((p for p in self.people if p.present[i]), key=lambda p: -p.far[i])
        for person in there:
            draw.paint(shown, person.drawing, i)
            _paint(shown, person.worn[i])
        if self.wall is not None:
            shown = np.where(self.wall, self.empty, shown)
        return cv2.imencode(".jpg", shown, [cv2.IMWRITE_JPEG_QUALITY, self.quality])[1]

    def head(self, i, person):
        """Which pixels (height, width) are at least half the head of a person, and hidden by nobody."""
        who, shape = self.people[person], self.empty.shape[:2]
        if not who.present[i]:
            return np.zeros(shape, bool)
        own = share([*who.heads[i], *who.worn[i]], shape) >= 0.5
        for other in self.people:
            if other is not who and other.present[i] and other.far[i] < who.far[i]:
                limbs, trunk = other.drawing.limbs[i, :, 0], other.drawing.trunk[i, 0]
                own &= share([*limbs, cv2.convexHull(trunk.astype(np.float32))[:, 0], *other.worn[i]], shape) < 0.5
        return own if self.wall is None else own & ~self.wall[..., 0]


def scene_of(made, name, seen, other):
    """`Scene` of the camera of a `truth.View` of a walk of a `steps.Capture`, with the second person that it sees."""
    walk = sequence_named(made.settings, name)
    motion, camera = motion_of(made.settings, walk), seen.camera
    wear = ("cap", "bun")[walk.outfit == "shirt"]
    people = [_person(camera, seen.landmarks, motion.height, walk.outfit, walk.subject, wear, True)]
    if other.present.any():
        people.append(_person(camera, other.landmarks, other.height, "shirt", "S00", "cap", other.present))
    empty = backdrop.background(made.settings, camera, walk.environment)
    wall = backdrop.in_front(made.settings, camera, walk.environment)
    return Scene(empty, people, wall, made.settings.jpeg_quality)


def _person(camera, landmarks, height, outfit, subject, wear, present):
    figure = draw.figure(landmarks, height)
    drawing = draw.outlines(camera, figure, height, outfit, subject)
    at = {name: landmarks[:, MLKIT_33.index(name)] for name in ("nose", "left_ear", "right_ear")}
    ears = (at["left_ear"] + at["right_ear"]) / 2
    ahead, left = draw._unit(at["nose"] - ears), draw._unit(at["left_ear"] - at["right_ear"])
    axes = np.stack([ahead, left, draw._unit(np.cross(ahead, left))], axis=1)
    worn = []
    for a, b, radius in WEAR[wear]:
        ends = [draw.project(camera, ears + np.einsum("j,tjk->tk", end, axes)) for end in (a, b)]
        sizes = [(camera.intrinsics.fx * radius / depth)[:, None] for _, depth in ends]
        worn.append(draw._shaded(*(uv[:, None] for uv, _ in ends), *sizes)[:, 0, 0])
    there = np.broadcast_to(np.asarray(present), len(landmarks))
    far = np.linalg.norm(ears - camera.centre, axis=1)
    return Person(drawing, drawing.limbs[:, HEAD, 0], np.stack(worn, axis=1), there, far)


def _paint(picture, polygons):
    """Draw polygons (P, N, 2) px over a picture, border pixels by their share."""
    found = share(polygons, picture.shape[:2], window=True)
    if found is None:
        return
    part, (rows, columns) = found
    below = picture[rows, columns].astype(float)
    picture[rows, columns] = np.rint(below + part[..., None] * (np.array(COLOUR) - below))


def share(polygons, shape, window=False):
    """How much (height, width) of each pixel of a picture is in polygons of (N, 2) px; with `window` only the part of
    the picture with something in it, and its (rows, columns) as slices, None for nothing."""
    points = np.concatenate(polygons)
    whole = np.zeros(shape)
    if not np.isfinite(points).all() or (np.abs(points) > 20 * max(shape)).any():
        return None if window else whole
    low = np.clip(np.floor(points.min(axis=0)).astype(int) - 1, 0, shape[::-1])
    high = np.clip(np.ceil(points.max(axis=0)).astype(int) + 2, 0, shape[::-1])
    if (high <= low).any():
        return None if window else whole
    wide, tall = high - low
    canvas = np.zeros((tall * SUBSAMPLES, wide * SUBSAMPLES), np.uint8)
    for polygon in polygons:
        at = ((polygon - low + 0.5) * SUBSAMPLES - 0.5) * (1 << SHIFT)
        cv2.fillConvexPoly(canvas, np.round(at).astype(np.int32), 1, cv2.LINE_8, SHIFT)
    part = canvas.reshape(tall, SUBSAMPLES, wide, SUBSAMPLES).mean(axis=(1, 3))
    rows, columns = slice(low[1], high[1]), slice(low[0], high[0])
    if window:
        return part, (rows, columns)
    whole[rows, columns] = part
    return whole
