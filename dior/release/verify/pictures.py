"""Pictures must show the subject where the labels are.

INPUTS   a `Walk`, an `Evidence` (evidence.py): pictures, and the boxes around the labels. OUTPUTS: problems as (path,
         sentence)
What moves in a picture is what differs from the median of pictures of the same recording. A problem is told only where
another order explains the pictures, and this one does not: two pictures of each of which more moves where the labels
of the other are than where its own are; a picture that looks like another camera's; a recording whose pictures
show the subject of another one. So wind, people who pass by, a subject who stands still or light that changes raise no
alarm, and pictures that were exchanged for ones that look alike raise none either. Without `decode` some pictures of a
recording are looked at (sample.py).
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dior.arrays import Floats, Ints, Table
from dior.release.layout import IN_PICTURE
from dior.release.verify.evidence import Evidence, Walk
from dior.release.verify.folder_or_tarball import File
from dior.release.verify.walk_checks import Problem, pictures_in
from dior.tables import tables

# fewer pictures, or labels in fewer, tell no background from what stands before it
FEWEST = 8
# A picture is made smaller by 2, 4 or 8 while the subject stays this many px tall; chosen: a JPEG of 1/8 is decoded in
# half the time, and a body of a dozen pixels is still told from noise
TALL = 12
# the labels are joints; the body reaches further by this share of their box's height. Chosen.
AROUND = 0.15
# Of what moves in a picture the share that is in the box of its labels. Chosen: in sound recordings of one walker it is
# 0.85 to 1 (`real_outdoor` and the demo), in a busy street anything. So a low share raises no alarm, but one in the box
# of other labels that is so much MORE, both ways round; of recordings those are compared whose median is LOW.
LOW, MORE = 0.5, 0.3
# grey levels in sigma by the median, above which a pixel has changed, and the least of such sigmas
CHANGED, LEAST_SIGMA = 5.0, 1.0
# pictures that are tried as the other one of an exchange
TRIED = 24
# Correlation of small pictures: another camera's background must fit this well, and so much better than the own one, or
# lack so many times less of 1. Chosen: a body that fills a part of the picture leaves half of it, and no two pictures
# of one camera differ so much; cameras in one room look alike, but in sound recordings another's never lacks less
# (at most 0.87 times in simulated rooms, 0.23 in `real_outdoor`).
LIKE, BETTER, TIMES = 0.5, 0.3, 2.0
THUMB = (48, 27)
# of a normal distribution
SD_OF_MAD = 1.4826
# pictures that the median of a recording is taken of; chosen: more make it no better
MOST = 48


@dataclass(frozen=True, eq=False)
class Window:
    """How pictures are looked at: made smaller by `factor`, and then [top:bottom, left:right] of them."""

    factor: int
    left: int
    top: int
    right: int
    bottom: int


@dataclass(frozen=True, eq=False)
class View:
    """Some pictures of a recording.

    `path` in the release; `frames` (F,): the numbers of all its frames; `boxes` (F, 4) px: around the labels of each,
    NaN without; `rows` (K,): which of the frames were looked at; `parts` (K, h, w): what `window` shows of them;
    `median` (h, w): their background; `sigma`: grey levels; `thumbs` (K, n), `thumb` (n,): the pictures and their
    median, whole, very small and normalised.
    """

    path: str
    frames: Ints
    boxes: Floats
    window: Window
    rows: Ints
    parts: NDArray[np.uint8]
    median: Floats
    sigma: float
    thumbs: Floats
    thumb: Floats

    def shares(self, part: NDArray[np.uint8], boxes: Floats) -> Floats:
        """Of what has changed in a part (h, w) of a picture the share (B,) that is in each of `boxes` (B, 4) px; 0
        without a box, NaN where nothing has changed."""
        off = part - self.median
        changed = np.abs(off - np.median(off)) - CHANGED * self.sigma
        total = np.zeros((part.shape[0] + 1, part.shape[1] + 1))
        total[1:, 1:] = np.maximum(changed, 0.0).cumsum(axis=0).cumsum(axis=1)
        if total[-1, -1] <= 0:
            return np.full(len(boxes), np.nan)
        left, top, right, bottom = self._in_window(boxes)
        inside = total[bottom, right] - total[top, right] - total[bottom, left] + total[top, left]
        return inside / total[-1, -1]

    def _in_window(self, boxes: Floats) -> Ints:
        """First column and row and those after the last (4, B) of boxes (B, 4) px; empty ones without a box."""
        window = self.window
        low = np.floor((boxes[:, :2] + 0.5) / window.factor) - (window.left, window.top)
        high = np.ceil((boxes[:, 2:] + 0.5) / window.factor) - (window.left, window.top)
        size = self.median.shape[::-1]
        return np.nan_to_num(np.concatenate([low.clip(0, size), high.clip(0, size)], axis=1)).astype(int).T

    def all_shares(self) -> tuple[Floats, Floats]:
        """The shares (K, F) in the box of every frame, and those (K,) in the frame's own, NaN without labels there."""
        shares = np.stack([self.shares(part, self.boxes) for part in self.parts])
        own = shares[np.arange(len(self.rows)), self.rows]
        return shares, np.where(np.isfinite(self.boxes[self.rows, 0]), own, np.nan)


def check(walk: Walk) -> list[Problem]:
    """Find pictures of a walk that were exchanged with others of it.

    A recording whose pictures show nothing where its labels are is kept in `walk.suspects`, for `exchanged`, and where
    there is one, those of the other cameras are in `walk.beside`: its pictures may be theirs.
    """
    views: dict[str, View] = {}
    problems: list[Problem] = []
    for name, frames in sorted(walk.of("frames").items()):
        path, labels = walk.path("frames", name), walk.of("labels_2d").get(name)
        file = walk.files.get(path)
        kept = pictures_in(file) if walk.decode and file else walk.pictures.get(name, ())
        view = view_of(path, kept, frames, labels) if file and labels else None
        if file is None or view is None:
            continue
        views[name] = view
        shares, own = view.all_shares()
        known = own[np.isfinite(own)]
        if len(known) >= FEWEST and np.median(known) < LOW:
            walk.suspects[name] = view
        else:
            problems += [(path, text) for text in _within(view, shares, own, file)]
    if walk.suspects:
        walk.beside.update(views)
    return problems + _of_other_cameras(views)


def view_of(path: str, pictures: Iterable[tuple[int, bytes]], frames: Table, labels: Table) -> View | None:
    """The `View` of some `pictures`, (row, bytes), of a recording; None where they can tell nothing."""
    boxes = label_boxes(labels, frames["frame"])
    window = _window(boxes, frames)
    if window is None:
        return None
    rows, parts, thumbs = _decoded(pictures, window)
    if len(rows) < FEWEST:
        return None
    spread = np.linspace(0, len(rows) - 1, min(len(rows), MOST)).round().astype(int)
    median = np.median(parts[spread], axis=0)
    sigma = max(SD_OF_MAD * float(np.median(np.abs(parts[spread] - median))), LEAST_SIGMA)
    normal = _normalised(thumbs)
    thumb = _normalised(np.median(thumbs, axis=0)[None])[0]
    return View(path, frames["frame"], boxes, window, rows, parts, median, sigma, normal, thumb)


def label_boxes(labels: Table, frames: Ints) -> Floats:
    """Boxes (F, 4) px around the labels of each of `frames` in the picture, and AROUND more; NaN without two labels."""
    uv, _ = tables.grid(labels, "u", "v")
    inside = np.isin(labels["status"].reshape(uv.shape[:2]), IN_PICTURE)[..., None]
    low, high = (pick(np.where(inside, uv, worst), axis=1) for pick, worst in ((np.min, np.inf), (np.max, -np.inf)))
    more = AROUND * (high - low).max(axis=1, keepdims=True)
    found = np.where((inside.sum(axis=1) >= 2), np.concatenate([low - more, high + more], axis=1), np.nan)
    out = np.full((len(frames), 4), np.nan)
    _, here, there = np.intersect1d(frames, labels["frame"].reshape(uv.shape[:2])[:, 0], return_indices=True)
    out[here] = found[there]
    return out


def _window(boxes: Floats, frames: Table) -> Window | None:
    """Where the subject walks and half as much again on each side; None with too few boxes."""
    known = boxes[np.isfinite(boxes).all(axis=1)]
    if len(known) < FEWEST:
        return None
    height = float(np.median(known[:, 3] - known[:, 1]))
    factor = next((n for n in (8, 4, 2) if height / n >= TALL), 1)
    size = np.array([int(frames[key][0]) for key in ("width", "height")])
    low, high = known[:, :2].min(axis=0), known[:, 2:].max(axis=0)
    more = (high - low) / 2
    left, top = np.floor((low - more).clip(0, size) / factor).astype(int).tolist()
    right, bottom = np.ceil((high + more).clip(0, size) / factor).astype(int).tolist()
    return Window(factor, left, top, right, bottom) if right > left and bottom > top else None


def _decoded(
    pictures: Iterable[tuple[int, bytes]], window: Window
) -> tuple[Ints, NDArray[np.uint8], NDArray[np.uint8]]:
    """Of the pictures, (row, bytes), that can be decoded the rows (K,), what the window shows (K, h, w), and all of
    them very small (K, n)."""
    import cv2

    how = {1: cv2.IMREAD_GRAYSCALE, 2: cv2.IMREAD_REDUCED_GRAYSCALE_2, 4: cv2.IMREAD_REDUCED_GRAYSCALE_4}
    found, parts, thumbs = [], [], []
    for row, data in pictures:
        picture = cv2.imdecode(np.frombuffer(data, np.uint8), how.get(window.factor, cv2.IMREAD_REDUCED_GRAYSCALE_8))
        if picture is None:
            continue
        part = picture[window.top : window.bottom, window.left : window.right]
        if part.shape == (window.bottom - window.top, window.right - window.left):
            found.append(row)
            parts.append(part.copy())
            thumbs.append(cv2.resize(picture, THUMB, interpolation=cv2.INTER_AREA).ravel())
    return np.array(found, np.int64), np.array(parts, np.uint8), np.array(thumbs, np.uint8)


def _normalised(pictures: NDArray[Any]) -> Floats:
    """Pictures (K, n) with mean 0 and length 1, so that their product is a correlation."""
    off = pictures - pictures.mean(axis=1, keepdims=True, dtype=float)
    return off / np.maximum(np.linalg.norm(off, axis=1, keepdims=True), 1e-9)


def _within(view: View, shares: Floats, own: Floats, file: File) -> Iterator[str]:
    """Yield pairs of pictures of one recording that were exchanged; `shares` (K, F) and `own` (K,) as of the view."""
    told: set[int] = set()
    for row, every, mine in zip(view.rows.tolist(), shares, own, strict=True):
        likely = np.argsort(-every, kind="stable")[:TRIED]
        likely = likely[every[likely] >= mine + MORE]
        if row in told or not len(likely):
            continue
        tried = ((other, data) for other, data in pictures_in(file) if other in set(likely.tolist()))
        for other, part, _ in zip(*_decoded(tried, view.window), strict=True):
            there, here = view.shares(part, view.boxes[[other, row]])
            if here >= there + MORE:
                told |= {row, int(other)}
                first, second = sorted((int(view.frames[row]), int(view.frames[other])))
                yield (
                    f"the pictures of frames {first} and {second} are exchanged: what moves in each of them is where "
                    "the labels of the other are"
                )
                break


def _of_other_cameras(views: dict[str, View]) -> list[Problem]:
    """Single pictures that look like those of another camera of the walk."""
    problems = []
    for name, view in views.items():
        others = {camera: view.thumbs @ one.thumb for camera, one in views.items() if camera != name}
        if not others:
            continue
        camera = max(others, key=lambda one: float(others[one].max()))
        own, other = view.thumbs @ view.thumb, others[camera]
        wrong = (other >= LIKE) & ((other >= own + BETTER) | (TIMES * (1 - other) <= 1 - own))
        if wrong.any():
            frame = view.frames[view.rows[np.argmax(wrong)]]
            problems.append(
                (view.path, f"{int(wrong.sum())} pictures look like those of camera {camera}, first frame {frame}")
            )
    return problems


def exchanged(release: Evidence) -> list[Problem]:
    """Recordings whose pictures show the subject where the labels of another recording are, and not at their own."""
    suspects = [view for walk in release.walks for view in walk.suspects.values()]
    beside = [view for walk in release.walks for name, view in walk.beside.items() if name not in walk.suspects]
    problems = []
    for view in suspects:
        for other in [*suspects, *beside]:
            if other is not view and _fits(view, other):
                problems.append(
                    (
                        view.path,
                        f"its pictures are those of {other.path}: what moves in them is where the labels of that are",
                    )
                )
    return problems


def _fits(view: View, other: View) -> bool:
    """Whether what moves in the pictures of `view` is where the labels of `other` are, row by row."""
    both = view.rows[view.rows < len(other.boxes)]
    parts = view.parts[view.rows < len(other.boxes)]
    more = [
        np.subtract(*view.shares(part, np.stack([other.boxes[row], view.boxes[row]])))
        for row, part in zip(both.tolist(), parts, strict=True)
        if np.isfinite(other.boxes[row, 0])
    ]
    known = np.array(more)[np.isfinite(more)]
    return len(known) >= FEWEST and bool(np.median(known) >= MORE)
