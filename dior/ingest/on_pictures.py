"""Whether the detections lie on the pictures: what moves in some of them has to lie under the detected body.

INPUTS   the subject's detections in one camera, the rows of its pictures in the table `frames`, the bags
OUTPUTS  findings; a DiorError where the detections fit the pictures better turned, mirrored, rescaled or shifted by
         frames, or not at all

Nothing else compares the two: what is turned by 180 degrees looks like a camera that hangs upside down, what is late
like another clock. In some twenty pictures what stands out of the still scene (`moving`) is compared with the body
drawn around the detected joints, by the share of both that they have in common (intersection over union). An
alternative counts in those pictures only in which it would move the body by a quarter of its width or as much: who
walks along the camera's axis tells nothing of a mirror, and who stands still nothing of anything. The scene is taken
from where the body is not, as far as the detections are right; where it always is, nothing is compared. Recorded
pixels; pixel (0, 0) is the centre of the top-left pixel.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

import numpy as np

from dior.arrays import AnyPath, Bools, Floats, Ints, Table
from dior.body.names import bones_of
from dior.errors import DiorError, many
from dior.ingest import bags, moving
from dior.ingest.containers import BROKEN
from dior.ingest.moving import Mask, Picture
from dior.tables import tables

# chosen: a body is some 30 px tall or more in a picture that is made smaller to this width or a little more
WIDE_PX = 240
# chosen: a detection with so many joints is a body, and a joint with a lower score is a guess
FEWEST_JOINTS, LEAST_SCORE = 6, 0.3
# of the longer side of the body: how thick a limb is drawn, twice what flesh and clothes lie outside of a joint
# (dior/calibrate/outline/silhouettes.py has 3 to 6 % of the stature), and the radius of a head
LIMB, HEAD = 0.10, 0.06
# An alternative tells in pictures in which it has no more of the body in common than one that is moved by a quarter of
# its width: (1 - 1/4) / (1 + 1/4). Chosen; and in how many pictures at least
ALIKE, FEWEST = 0.6, 6
# chosen: so much of the body's length around it the scene is taken from other pictures, and from so many at least
AROUND, LEAST_LEFT = 0.08, 3
# chosen: t of the paired differences; a culprit has to be ahead by so much of the intersection over union as well
SURE, GAIN = 4.0, 0.05
# chosen: a body has so little in common with what moves if it is anywhere else (drawn ones have 0.5 to 0.8)
NOWHERE = 0.15
# chosen: a cause under which they have less in common may be chance, of detections that belong to another recording
WELL = 0.4
# chosen: what moves is at least this share of the body, else nothing does
LEAST_MOVES = 0.25
# chosen: pictures by which a numbering may be off; a few in a row tell as much as all of them
SLIPS = (*range(1, 9), 10, 12, 15)
SCALES = (2.0, 0.5, 1.5, 2 / 3)

# pixels (..., 2) of the picture and its size (width, height) to pixels (..., 2)
Change: TypeAlias = Callable[[Floats, tuple[int, int]], Floats]


@dataclass(frozen=True)
class Alternative:
    """Another way in which the detections may lie on the pictures: in words, what to do if they do; by how much it
    makes a body larger, and by how many frames the detection of a picture is found later in the file."""

    words: str
    remedy: str
    change: Change
    larger: float = 1.0
    frames: int = 0


class OffPictures(DiorError):
    """The detections clearly do not lie on the pictures."""


def _scaled(by: float) -> Change:
    return lambda uv, size: (uv + 0.5) * by - 0.5


def _unchanged(uv: Floats, size: tuple[int, int]) -> Floats:
    return uv


_ELSEWHERE = "are they of another camera or recording?"
_OR_OTHERS = f"; or, as that is little for detections that fit: {_ELSEWHERE}"
_AS_RECORDED = "run the detector on the pictures as they were recorded"
TURNS = (
    Alternative("turned by 180 degrees", _AS_RECORDED, lambda uv, size: np.array(size) - 1 - uv),
    Alternative("mirrored left to right", _AS_RECORDED, lambda uv, size: np.array([size[0] - 1, 0]) + uv * (-1, 1)),
    Alternative("mirrored top to bottom", _AS_RECORDED, lambda uv, size: np.array([0, size[1] - 1]) + uv * (1, -1)),
)
ELSEWHEN = Alternative("of another moment", "", _unchanged)


def alternatives() -> list[Alternative]:
    """All of them."""
    sizes = [
        Alternative(
            f"multiplied by {by:.3g}",
            f"they were made on pictures of {1 / by:.3g} times the size: multiply them, or run the detector on the "
            "pictures as they were recorded",
            _scaled(by),
            by,
        )
        for by in SCALES
    ]
    slips = [
        Alternative(
            f"taken {many(abs(k), 'frame')} {'earlier' if k > 0 else 'later'}",
            f"they are about so many frames {'late' if k > 0 else 'early'}: number them by the pictures in the bag, "
            "the first of which is 0",
            _unchanged,
            frames=k,
        )
        for k in (*(-k for k in reversed(SLIPS)), *SLIPS)
    ]
    return [*TURNS, *sizes, *slips]


def drawn(uv: Floats, bones: Ints, head: Bools, shape: tuple[int, int], around: float = 0.0) -> Mask:
    """1 where a body with the joints uv (J, 2) px is in a picture of `shape` (height, width), and so much of its length
    around it."""
    import cv2

    out = np.zeros(shape, np.uint8)
    known: Bools = np.asarray(np.isfinite(uv).all(axis=1))
    tall = float(np.ptp(uv[known], axis=0).max())
    thick = max(int(round((LIMB + 2 * around) * tall)), 1)
    whole = np.clip(np.round(np.nan_to_num(uv)), -30000, 30000).astype(int)
    for a, b in bones[np.asarray(known[bones].all(axis=1))].tolist():
        cv2.line(out, whole[a].tolist(), whole[b].tolist(), 1, thick)
    face = known & head
    if face.any():
        middle = np.clip(np.round(uv[face].mean(axis=0)), -30000, 30000).astype(int)
        cv2.circle(out, middle.tolist(), max(int(round((HEAD + around) * tall)), 1), 1, -1)
    return out


@dataclass(frozen=True, eq=False)
class Judged:
    """How well each of the alternatives fits: `gain` (A,) of the intersection over union against the detections as they
    are, `t` (A,) of it, `count` (A,) of pictures that tell, NaN and 0 where none does; `score` and `other` (A,): the
    means in these pictures as they are and with the alternative; `moves`: what moves, of the body's size; `elsewhen`:
    gain, t, count, score and other of the bodies of other moments."""

    gain: Floats
    t: Floats
    count: Ints
    score: Floats
    other: Floats
    moves: float
    elsewhen: tuple[float, float, int, float, float]


def judge(
    uv: Floats, joints: Sequence[str], size: tuple[int, int], shown: Ints, pictures: Sequence[Picture], factor: int,
    others: Sequence[Alternative],
) -> Judged:  # fmt: skip
    """`Judged` of detections uv (F, J, 2) px, NaN where none, by the `pictures` (P, height, width, 3) of the frames
    `shown`.

    They are `factor` times smaller than the pictures of `size` (width, height).
    """
    bones = bones_of(joints)
    head = np.array([name == "nose" or name.endswith(("_ear", "_eye")) for name in joints])
    shape = pictures[0].shape[0], pictures[0].shape[1]
    there = np.isfinite(uv).all(axis=-1).sum(axis=1) >= FEWEST_JOINTS

    def small(at: Floats) -> Floats:
        return (at + 0.5) / factor - 0.5

    now = [small(uv[f]) for f in shown]
    around = [drawn(at, bones, head, shape, AROUND) for at in now]
    seen = np.asarray((np.stack(around) == 0).sum(axis=0) >= LEAST_LEFT, np.uint8)
    scene = moving.scene_of(pictures, around)
    masks = [moving.standing_out(picture, scene) & seen for picture in pictures]
    bodies = [drawn(at, bones, head, shape) & seen for at in now]
    area = np.array([body.sum() for body in bodies], float)
    loose = np.array([mask.sum() for mask in masks], float)
    plain = np.array([_overlap(*pair) for pair in zip(masks, bodies, loose, area, strict=True)])
    at_all = np.flatnonzero(there)

    def paired(other: Alternative, frames: Ints) -> tuple[float, float, int, float, float]:
        """`_paired` of the pictures with the detections of `frames` (P,) changed."""
        scores = []
        for p, f in enumerate(frames.tolist()):
            if not 0 <= f < len(uv) or not there[f]:
                continue
            body = drawn(small(other.change(uv[f], size)), bones, head, shape) & seen
            there_now = max(float(body.sum()), area[p] * other.larger**2)
            if _overlap(bodies[p], body, area[p], there_now) > ALIKE:
                continue
            score = _overlap(masks[p], body, loose[p], there_now)
            scores.append((plain[p], score))
        return _paired(np.array(scores).reshape(-1, 2))

    rows = [paired(other, shown + other.frames) for other in others]
    gain, t, count, score, found = (np.array(column) for column in zip(*rows, strict=True))
    elsewhen = paired(ELSEWHEN, at_all[(np.searchsorted(at_all, shown) + len(at_all) // 3) % len(at_all)])
    moves = float(np.median(loose) / max(np.median(area), 1.0))
    return Judged(gain, t, count.astype(int), score, found, moves, elsewhen)


def _overlap(mask: Mask, body: Mask, of_mask: float, of_body: float) -> float:
    """Intersection over union; the body may be larger than what is left of it in the picture."""
    import cv2

    both = float(cv2.countNonZero(cv2.bitwise_and(mask, body)))
    return both / max(of_mask + of_body - both, 1.0)


def _paired(scores: Floats) -> tuple[float, float, int, float, float]:
    """Gain, t, number, and both means of scores (N, 2) before and after; NaN and 0 where they are too few."""
    if len(scores) < FEWEST:
        return np.nan, np.nan, 0, np.nan, np.nan
    gain = scores[:, 1] - scores[:, 0]
    error = max(float(gain.std(ddof=1)) / np.sqrt(len(gain)), 1e-3)
    return float(gain.mean()), float(gain.mean()) / error, len(gain), *scores.mean(axis=0).tolist()


def chosen(uv: Floats, there: Ints, frames: int) -> Ints:
    """Which pictures are looked at: of equal parts of those with a body (`there`, ascending), the ones in which it
    moves most within so many `frames`.
    """
    middle = np.full((len(uv), 2), np.nan)
    middle[there] = np.nanmean(uv[there], axis=1)
    later, before = (middle[np.clip(there + k, 0, len(uv) - 1)] for k in (frames, -frames))
    speed = np.nan_to_num(np.linalg.norm(later - before, axis=1), nan=-1.0)
    parts = np.array_split(np.arange(len(there)), min(moving.SAMPLES, len(there)))
    return there[[int(part[speed[part].argmax()]) for part in parts]]


def check(
    uv: Floats, score: Floats, joints: Sequence[str], rows: Table, data_root: AnyPath, path: AnyPath, where: str
) -> list[tuple[str, str, str]]:
    """Findings (severity, code, text) on whether the subject's detections uv (F, J, 2) px lie on the pictures `rows`.

    `score` (F, J); `path` of the detections. Raises DiorError (beginning with `where`) where they clearly do not.
    """
    with np.errstate(invalid="ignore"):
        uv = np.where((score < LEAST_SCORE)[..., None], np.nan, uv)
    there = np.flatnonzero(np.isfinite(uv).all(axis=-1).sum(axis=1) >= FEWEST_JOINTS)
    if len(there) < FEWEST:
        return [_cannot_tell(f"the subject is found in {len(there)} pictures")]
    shown = chosen(uv, there, SLIPS[-1] // 2)
    size = int(rows["width"][0]), int(rows["height"][0])
    factor = next((f for f in (8, 4, 2) if size[0] >= f * WIDE_PX), 1)
    pictures = _read(rows, shown, Path(data_root), factor)
    shown = np.array(sorted(pictures), int)
    if len(shown) < FEWEST:
        return [_cannot_tell(f"{len(shown)} of its pictures can be read")]
    few = [pictures[f] for f in shown.tolist()]
    return verdict(uv, joints, size, shown, few, factor, f"{where}: {path}")


def _read(rows: Table, shown: Ints, data_root: Path, factor: int) -> dict[int, Picture]:
    """The pictures `shown` by their frame, `factor` times smaller; those that cannot be read are left out."""
    found, mine = {}, tables.rows(rows, shown)
    for row, message, _ in bags.read_messages(mine, data_root):
        try:
            size = int(mine["height"][row]), int(mine["width"][row])
            found[int(shown[row])] = moving.smaller(message, size, factor)
        except BROKEN:
            continue
    return found


def verdict(
    uv: Floats, joints: Sequence[str], size: tuple[int, int], shown: Ints, pictures: Sequence[Picture], factor: int,
    where: str,
) -> list[tuple[str, str, str]]:  # fmt: skip
    """The findings of `check`, from the `pictures` of the frames `shown`, `factor` times smaller than they are."""
    others = alternatives()
    found = judge(uv, joints, size, shown, pictures, factor, others)
    if found.moves < LEAST_MOVES:
        return [_cannot_tell("next to nothing moves in its pictures")]
    known = found.count > 0
    better = known & (found.t > SURE) & (found.gain > GAIN)
    if better.any():
        # a slip of a few frames more or less moves the body in fewer or more of the pictures
        best = int(np.argmax(np.where(better, found.gain * found.count, -np.inf)))
        little = found.other[best] < WELL
        raise OffPictures(
            f"{where}: the detections fit the pictures when {others[best].words}: what moves and the body then have "
            f"{found.other[best]:.0%} in common, as they are {found.score[best]:.0%} ({found.count[best]} pictures); "
            f"{others[best].remedy}{_OR_OTHERS if little else ''}"
        )
    _, t, count, score, _ = found.elsewhen
    if count and t > -SURE and score < NOWHERE:
        raise OffPictures(
            f"{where}: the detections lie nowhere near what moves in the pictures ({score:.0%} in common in {count} "
            "pictures, no more than those of another moment), nor do they turned, mirrored, rescaled or shifted by up "
            f"to {SLIPS[-1]} frames; {_ELSEWHERE}"
        )
    worse = known & (found.t < -SURE)
    if not known.any():
        return [_cannot_tell("the subject hardly moves in its pictures")]
    unsure = [other.words for other, clear in zip(others, worse, strict=True) if not clear and not other.frames]
    likely = [abs(other.frames) for other, clear in zip(others, worse, strict=True) if other.frames and not clear]
    slips = [frames for frames in SLIPS if frames > max(likely, default=0)]
    told = f", and not {slips[0]} frames or more off" if slips else ""
    text = f"what moves in {len(shown)} pictures lies under the detected body, {np.nanmean(found.score):.0%} in common"
    if unsure or not slips:
        late = [] if slips else ["taken some frames earlier or later"]
        return [("info", "detections_unsure", f"{text}{told}; it cannot be told from: {', '.join([*unsure, *late])}")]
    return [("info", "detections_on_pictures", f"{text}{told}")]


def _cannot_tell(why: str) -> tuple[str, str, str]:
    return ("info", "detections_unsure", f"it cannot be told whether the detections lie on the pictures: {why}")
