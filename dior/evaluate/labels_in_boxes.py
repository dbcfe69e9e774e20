"""Share of the labels inside hand-drawn boxes, the paper's measure of the long-range labels; how the box around the
labels lies in the hand-drawn one, and what perfect labels would score in such boxes.

INPUTS   `LabelGrid` of a long-range camera, hand boxes (F, 4) px in the order u_min, v_min, u_max, v_max, NaN without.
OUTPUTS  per frame intersection over union, signed centre and size offset px; per label the probability that a perfect
         one would lie in a box drawn like these. All (F, 1) or (F, J), NaN where there is nothing to judge.

The share of labels in hand boxes rewards large boxes: of a person 20 px tall and edges with an sd of 2 px, perfect
labels score 55-63 % in unbiased boxes and 95-97 % in boxes drawn 3 px large (simulated). So the share is only as good
as it is near to `in_box_expected`. And boxes that a camera was placed by, or its clock found, hold its labels better
than others: `held_back_*` are of those alone that no step has fitted to, `left_out_*` of all, each with the labels that
a fit without it would give. Both share the drawer's habit; `other_drawer_*` are of boxes of somebody else.

Where something hides a part of the body in all pictures (`cameras.occluded`), the edge of a box towards it is not the
body's: joints beyond it are not judged, the edge itself agrees with whatever the labels say, and along its axis nothing
is said of offsets, sizes and the drawer.
"""

from dataclasses import replace

import numpy as np

from dior.arrays import Bools, Floats, Ints
from dior.evaluate.grids import LabelGrid
from dior.project.boxes import at_line, kept_back, line_of

WILD = 4.0  # chosen: of boxes drawn with care one in 16 000 is left out
SD_OF_MAD = 1.4826  # of a normal distribution


def of_frames(grid: LabelGrid, box_frames: Ints, boxes: Floats) -> Floats:
    """Edges (F, 4) px of the box of every frame of the labels, NaN where there is none."""
    edges = np.full((len(grid.frames), 4), np.nan)
    _, row, box = np.intersect1d(grid.frames, box_frames, return_indices=True)
    edges[row] = boxes[box]
    return edges


def within(grid: LabelGrid, hand: Floats) -> Floats:
    """1 or 0 (F, J) whether an in-frame label lies in its frame's box `hand` (F, 4) px, NaN where there is nothing to
    judge.
    """
    u, v = grid.uv[..., 0], grid.uv[..., 1]
    u_min, v_min, u_max, v_max = hand.T[:, :, None]
    with np.errstate(invalid="ignore"):
        hit = (u >= u_min) & (u <= u_max) & (v >= v_min) & (v <= v_max)
    judged = np.isfinite(u_min) & grid.in_frame
    return np.where(judged, hit.astype(float), np.nan)


def figures(grid: LabelGrid, hand: Floats, occluded_edge: int | None = None) -> list[tuple[str, str, Floats]]:
    """(metric, unit, values) of everything this module measures; `occluded_edge` as of `dior.geometry.camera`."""
    whole, (grid, cut) = grid, unhidden(grid, hand, occluded_edge)
    label = np.where(cut, hand, label_boxes(grid))
    offset, size = _centre(label) - _centre(hand), _size(label) - _size(hand)
    untold = cut[:, :2] | cut[:, 2:]
    offset[untold], size[untold] = np.nan, np.nan
    return [
        ("in_box_share", "share", within(grid, hand)),
        ("in_box_expected", "share", expected(grid, hand, cut)),
        *judged("held_back", whole, hand, held_back(grid, hand), occluded_edge),
        ("box_iou", "share", iou(label, hand)[:, None]),
        ("box_offset_u", "px", offset[:, :1]),
        ("box_offset_v", "px", offset[:, 1:]),
        ("box_width_difference", "px", size[:, :1]),
        ("box_height_difference", "px", size[:, 1:]),
    ]


def judged(
    name: str, grid: LabelGrid, hand: Floats, judges: Bools, occluded_edge: int | None = None
) -> list[tuple[str, str, Floats]]:
    """(metric, unit, values) of those frames whose box `judges` (F,): the share of labels in them, that of perfect
    labels in such boxes, and how far labels lie beside their middle, as a share of the label box's height.

    That height does not depend on how large the boxes are drawn. The drawer's margin and spread are those of all boxes.
    """
    grid, cut = unhidden(grid, hand, occluded_edge)
    label = np.where(cut, hand, label_boxes(grid))
    offset = np.where(cut[:, :2] | cut[:, 2:], np.nan, _centre(label) - _centre(hand))
    height = np.where(_size(label)[:, 1:] > 0, _size(label)[:, 1:], np.nan)
    found = [("share", within(grid, hand)), ("expected", expected(grid, hand, cut))]
    found += [(f"offset_{axis}", offset[:, [i]] / height) for i, axis in enumerate("uv")]
    return [(f"{name}_{what}", "share", np.where(judges[:, None], values, np.nan)) for what, values in found]


def left_out(
    grid: LabelGrid, hand: Floats, frames: Ints, shift: Floats, occluded_edge: int | None = None
) -> list[tuple[str, str, Floats]]:
    """`judged` with the labels that a fit without the box would give: those of `frames` (B,) moved by `shift` (B, 2)
    px, and those of the boxes that are kept back as they are. Nothing where no frame is.
    """
    if not len(frames):
        return []
    moves = np.full((len(grid.frames), 2), np.nan)
    moves[held_back(grid, hand)] = 0.0
    _, row, at = np.intersect1d(grid.frames, frames, return_indices=True)
    moves[row] = shift[at]
    moved = replace(grid, uv=grid.uv + np.nan_to_num(moves)[:, None])
    return judged("left_out", moved, hand, np.isfinite(moves).all(axis=1), occluded_edge)


def held_back(grid: LabelGrid, hand: Floats) -> Bools:
    """Frames (F,) whose box is kept back from every fit."""
    drawn = np.flatnonzero(np.isfinite(hand).all(axis=1))
    out = np.zeros(len(hand), bool)
    out[drawn] = kept_back(grid.frames[drawn])
    return out


def share(grid: LabelGrid, hand: Floats, occluded_edge: int | None) -> Floats:
    """1 or 0 (F, J) whether a label lies in the hand box, NaN where there is nothing to judge."""
    return within(unhidden(grid, hand, occluded_edge)[0], hand)


def unhidden(grid: LabelGrid, hand: Floats, occluded_edge: int | None) -> tuple[LabelGrid, Bools]:
    """The labels that nothing hides, and which edges (F, 4) of the boxes are those of what hides the others."""
    cut = np.zeros(hand.shape, bool)
    if occluded_edge is None:
        return grid, cut
    edge = hand[:, occluded_edge]
    cut[:, occluded_edge] = at_line(edge, line_of(edge))
    axis, outwards = occluded_edge % 2, 1 if occluded_edge > 1 else -1
    with np.errstate(invalid="ignore"):
        beyond = (outwards * (grid.uv[..., axis] - edge[:, None]) > 0) & cut[:, [occluded_edge]]
    uv = np.where(beyond[..., None], np.nan, grid.uv)
    return replace(grid, uv=uv, in_frame=grid.in_frame & ~beyond), cut


def label_boxes(grid: LabelGrid) -> Floats:
    """Tight boxes (F, 4) px of the in-frame labels, NaN where there are none."""
    uv = np.where(grid.in_frame[..., None], grid.uv, np.nan)
    low = np.where(np.isnan(uv), np.inf, uv).min(axis=1, initial=np.inf)
    high = np.where(np.isnan(uv), -np.inf, uv).max(axis=1, initial=-np.inf)
    return np.where(np.isfinite(low).all(axis=1)[:, None], np.concatenate([low, high], axis=1), np.nan)


def iou(a: Floats, b: Floats) -> Floats:
    """Area of the intersection of boxes `a` and `b`, (F, 4) px, over that of their union: (F,), NaN without area."""
    sides = np.minimum(a[:, 2:], b[:, 2:]) - np.maximum(a[:, :2], b[:, :2])
    common = np.clip(sides, 0, None).prod(axis=1)
    union = _size(a).prod(axis=1) + _size(b).prod(axis=1) - common
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(union > 0, common / union, np.nan)


def drawing(label: Floats, hand: Floats) -> tuple[Floats, Floats]:
    """How a person draws: margin (2,) px by which the edges lie outside and their sd (2,) px, along u and v.

    From half the difference of the sizes, h = (right + left) / 2 of what the edges are outside of `label` boxes: its
    mean is the margin and its variance half that of an edge, edges being drawn independently. Labels that are all off
    by the same, in a frame or in all of them, move the centre and leave h alone. Values further than WILD from the
    median, in sd by the MAD, are left out: a frame with one wild label would make the boxes look carelessly drawn. An
    axis of which fewer than two boxes tell is drawn as the other one; NaN where neither is told.
    """
    found = np.full((2, 2), np.nan)
    for axis, half in enumerate(((_size(hand) - _size(label)) / 2).T):
        half = half[np.isfinite(half)]
        if len(half) < 2:
            continue
        off = np.abs(half - np.median(half))
        usual = half[off <= WILD * SD_OF_MAD * np.median(off)]
        found[:, axis] = usual.mean(), np.sqrt(2 * usual.var())
    margin, sd = np.where(np.isnan(found), found[:, ::-1], found)
    return margin, sd


def expected(grid: LabelGrid, hand: Floats, cut: Bools) -> Floats:
    """Probability (F, J) that a perfect label would lie in a box drawn like `hand` (F, 4), of frames with a box.

    `cut` (F, 4): edges that are not the body's, which hold every label.

    A label that lies `a` px inside the left edge of its own tight box is inside a hand box, whose left edge is the
    margin m further out with a spread s, with probability Phi((a + m) / s); the four edges are independent. The shape
    of the labels and the size of the boxes are used, their place is not: so this is the share of labels moved to where
    they have no offset.
    """
    label = label_boxes(grid)
    untold = np.tile(cut[:, :2] | cut[:, 2:], 2)
    margin, sd = drawing(np.where(untold, np.nan, label), hand)
    inside = np.concatenate([grid.uv - label[:, None, :2], label[:, None, 2:] - grid.uv], axis=-1)
    each = _normal(inside + np.tile(margin, 2), np.tile(sd, 2))
    probability = np.where(cut[:, None], 1.0, each).prod(axis=-1)
    return np.where(np.all(np.isfinite(hand), axis=1)[:, None] & grid.in_frame, probability, np.nan)


def _normal(distance: Floats, sd: Floats) -> Floats:
    """Probability that a normal deviation of `sd` is at most `distance`; a step where sd is 0."""
    from scipy.special import ndtr

    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(sd > 0, ndtr(distance / sd), np.where(np.isnan(sd + distance), np.nan, distance >= 0))


def _centre(box: Floats) -> Floats:
    return (box[:, :2] + box[:, 2:]) / 2


def _size(box: Floats) -> Floats:
    return box[:, 2:] - box[:, :2]
