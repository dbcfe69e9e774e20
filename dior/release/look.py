"""All pictures of a camera looked at: is the subject's head under its cover, and what else is to be covered.

INPUTS   the pictures of a recording, in whatever order its bags give them; what the 3D knows of the subject
OUTPUTS  by picture what is to be thought of the cover, and boxes of whole pixels around everything else
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path

import numpy as np

from dior.arrays import Bools, Floats, Ints, Table, Texts
from dior.calibrate.outline import silhouettes
from dior.geometry import camera as cam
from dior.geometry.camera import Camera
from dior.ingest import bags, moving
from dior.ingest.containers import BROKEN
from dior.ingest.moving import Picture
from dior.project.boxes import at_line, line_of
from dior.release import faces, head_blur, head_evidence, other_people
from dior.release.faces import Faces

# chosen: pictures are looked at smaller than they are while a head is so many pixels wide
HEAD_PX, FACTORS = 16, (4, 2)
# chosen: from so many boxes drawn by hand on, their median is good to half a pixel
LEAST_BOXES = 8
# s; chosen: the error of a detector at one joint changes over this time
STEADY_S = 0.5
# (row, picture) of the rows asked for that can be read, `factor` times smaller
Read = Callable[[Ints, int], Iterable[tuple[int, Picture]]]


@dataclass(frozen=True, eq=False)
class Walker:
    """The subject in a camera's pictures, a row each: `times` (F,) s, `middle` between the ears (F, 3) m, `points`
    (F, J, 3) m of the `joints`, `edges` (F, 4) px of the cover, `drawn` (F, 4) px of boxes drawn around the body by
    hand, NaN none."""

    camera: Camera
    times: Floats
    middle: Floats
    points: Floats
    joints: list[str]
    edges: Floats
    drawn: Floats


@dataclass(frozen=True, eq=False)
class Looked:
    """By picture what is to be thought of the cover, as of `head_evidence.sure`, and `others`: boxes (N, 4) of whole
    pixels around what else is to be covered. `always` (F,): where the cover is, the subject is in nearly all of the
    recording, so that the scene is not known there and nothing can stand out of it."""

    sure: Texts
    others: list[Ints]
    always: Bools


def reader(rows: Table, data_root: Path) -> Read:
    """What reads the pictures of `frames` rows; those that cannot be read are left out."""

    def read(wanted: Ints, factor: int) -> Iterator[tuple[int, Picture]]:
        mine = {key: values[wanted] for key, values in rows.items()}
        for row, message, _ in bags.read_messages(mine, data_root):
            try:
                size = int(mine["height"][row]), int(mine["width"][row])
                yield int(wanted[row]), moving.smaller(message, size, factor)
            except BROKEN:
                continue

    return read


def factor_of(edges: Floats) -> int:
    """How many times smaller the pictures with covers `edges` (F, 4) px are looked at."""
    wide = edges[:, 2] - edges[:, 0]
    wide = wide[np.isfinite(wide)]
    if not len(wide):
        return FACTORS[-1]
    return next((factor for factor in FACTORS if np.median(wide) >= HEAD_PX * factor), 1)


def looked(walker: Walker, role: str, found: Faces, read: Read) -> Looked:
    """`Looked` at all pictures that `read` gives. `role` of the camera: in a close one something is covered where it
    may be a head, in a long-range one anywhere. `found`: what a detector found."""
    factor = factor_of(walker.edges)
    few = {row: picture for row, picture in read(moving.samples(len(walker.times)), factor)}
    if not few:
        nowhere = np.full(len(walker.times), "unseen", object)
        return Looked(nowhere, [np.zeros((0, 4), int)] * len(walker.times), np.zeros(len(walker.times), bool))
    subject = head_evidence.subject_of(walker.camera, walker.edges, walker.middle, walker.points, walker.joints, factor)
    bodies = [head_evidence.whole_body(few[row].shape[:2], subject, row) for row in sorted(few)]
    scene = moving.scene_of([few[row] for row in sorted(few)], bodies)
    others = read(np.setdiff1d(np.arange(len(walker.times)), list(few)), factor)
    every = chain(few.items(), others)
    found_out = judged(walker, role, found, ((row, moving.standing_out(one, scene)) for row, one in every), factor)
    return replace(found_out, always=_always(subject.edges, bodies))


def _always(edges: Floats, bodies: Sequence[moving.Mask]) -> Bools:
    """Pictures (F,) with covers `edges` (F, 4) px for most of which the samples, with the subject in `bodies`, do not
    tell the scene."""
    unknown = sum((body == 0).astype(int) for body in bodies) < moving.LEAST_LEFT
    out = np.zeros(len(edges), bool)
    for i in np.flatnonzero(np.isfinite(edges).all(axis=1)):
        part = unknown[head_blur.inside(edges[i], *unknown.shape)]
        out[i] = part.size > 0 and part.mean() > 0.5
    return out


def judged(walker: Walker, role: str, found: Faces, masks: Iterable[tuple[int, moving.Mask]], factor: int) -> Looked:
    """The same from the masks of what stands out, by row; these do not tell `always`."""
    count = len(walker.times)
    subject = head_evidence.subject_of(walker.camera, walker.edges, walker.middle, walker.points, walker.joints, factor)
    says, off_m = np.full(count, "outside", object), np.full((count, 2), np.nan)
    others: list[Ints] = [np.zeros((0, 4), int)] * count
    quarters, lens = head_evidence.quarter_turns(walker.camera), walker.camera.intrinsics
    shape = (lens.height // factor, lens.width // factor)
    # everything is judged in upright pictures
    upright, zone, often = head_evidence.turned(subject, quarters, shape), None, None
    for row, mask in masks:
        if often is None:
            shape = (mask.shape[0], mask.shape[1])
            upright = head_evidence.turned(subject, quarters, shape)
            often = np.zeros(np.rot90(mask, quarters).shape, np.int32)
            if role == "close":
                zone = np.ascontiguousarray(np.rot90(other_people.head_zone(walker.camera, shape, factor), quarters))
        one, rest = head_evidence.look(np.ascontiguousarray(np.rot90(mask, quarters)), upright, row, zone)
        says[row], off_m[row], others[row] = one.says, one.off_m, one.others
        often += rest
    cover_m = head_evidence.covers_m(upright)
    px = subject.scale * factor
    told, there = zip(
        *(
            head_evidence.told_where(upright, cover_m, head_evidence.turned_points(off_m, quarters, (1, 1)))
            for off_m in (by_hand_m(walker, px), _detected_m(walker, found, px))
        ),
        strict=True,
    )
    sure = head_evidence.sure(says, off_m, cover_m, subject.scale, walker.times, np.any(told, axis=0))
    scale = float(np.nanmedian(subject.scale)) if np.isfinite(subject.scale).any() else 0.0
    always = np.zeros((0, 4), int)
    if often is not None and count > 1:
        always = other_people.stays(often, count, other_people.JOIN_M * scale)
    strange = faces.strangers(found, walker.edges, walker.times, quarters % 2 == 1)
    back = np.rot90(np.empty(shape[:2], np.uint8), quarters).shape
    others = other_people.followed(others, walker.times, scale) if scale else others
    others = other_people.held(others, walker.times, (back[0], back[1]))
    return Looked(
        sure,
        [
            np.concatenate(
                [
                    _whole(head_evidence.turned_boxes(np.concatenate([*each, always]), -quarters, back), factor),
                    heads,
                ]
            )
            for *each, heads in zip(others, *there, strange, strict=True)
        ],
        np.zeros(count, bool),
    )


def _whole(boxes: Ints, factor: int) -> Ints:
    """Boxes (N, 4) of small pixels in those of the picture, with one small pixel around them."""
    return np.concatenate([(boxes[:, :2] - 1) * factor, (boxes[:, 2:] + 1) * factor], axis=1)


def _detected_m(walker: Walker, found: Faces, scale: Floats) -> Floats:
    """How far (F, 2) m a detector finds the head to the right of and below the 3D, in the median over some pictures."""
    uv = cam.project(walker.camera, walker.points)[0]
    return head_evidence.steady(faces.off(found, uv, walker.joints), walker.times, STEADY_S) / scale[:, None]


def by_hand_m(walker: Walker, scale: Floats) -> Floats:
    """The same (F, 2) m by the boxes that a person drew, in the median over all of them; NaN where there are too few.

    A person draws boxes larger than the body by some margin, the same on opposite sides: their middle tells. A box that
    ends at something that hides the rest of the body tells nothing: where its middle should be nobody knows.
    """
    drawn = np.asarray(np.isfinite(walker.drawn).all(axis=1))
    side = cam.occluded_edge(walker.camera)
    if side is not None and drawn.any():
        drawn[drawn] = ~at_line(walker.drawn[drawn, side], line_of(walker.drawn[drawn, side]))
    if drawn.sum() < LEAST_BOXES:
        return np.full((len(scale), 2), np.nan)
    points, flesh_m = silhouettes.outline(walker.points[drawn], walker.joints)
    uv, flesh = cam.project(walker.camera, points)[0], (flesh_m * scale[drawn][:, None])[..., None]
    whole = np.isfinite(uv).all(axis=(1, 2))
    if whole.sum() < LEAST_BOXES:
        return np.full((len(scale), 2), np.nan)
    low, high = ((uv - flesh).min(axis=1)[whole], (uv + flesh).max(axis=1)[whole])
    boxes, px = walker.drawn[drawn][whole], scale[drawn][whole]
    off = (boxes[:, :2] + boxes[:, 2:]) / 2 - (low + high) / 2
    return np.tile(np.median(off / px[:, None], axis=0), (len(scale), 1))
