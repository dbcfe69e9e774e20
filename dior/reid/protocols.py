"""Who is recognised: every sequence of a probe camera looks for its subject in the sequences of other cameras.

INPUTS   distances (N, N) between sequences, and what each of them shows (`Item`)
OUTPUTS  `Trials`: a row per probe and gallery, with the galleries' sequences from the nearest on

| protocol | gallery | |
|---|---|---|
| per_camera | one other camera after the other | the paper's, as far as its numbers tell |
| pooled | all other cameras at once | |
| other_recording | as per_camera, without the recording of the probe | a walk is not found by its own pictures |
| other_place | as per_camera, only cameras of the other environment | indoors in outdoors and the reverse |

A camera is one of an environment: cam01 indoors and cam01 outdoors are two. Equal distances are taken in the order of
the sequences (as numpy's argmin).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from dior.arrays import Bools, Floats, Ints
from dior.errors import DiorError, nearest

# environment, camera
ProbeView: TypeAlias = tuple[str, str]
PROTOCOLS = ("per_camera", "pooled", "other_recording", "other_place")


@dataclass(frozen=True)
class Item:
    """One sequence of one camera. `recording`: of which walk it is; cameras show one walk at the same time."""

    subject: str
    recording: str
    session: str
    environment: str
    camera: str

    @property
    def view(self) -> ProbeView:
        return self.environment, self.camera


@dataclass(frozen=True, eq=False)
class Trials:
    """R trials: the probe's item (R,), the gallery's items from the nearest on (R, G), -1 where it has no more, how far
    they are (R, G), NaN there, and the view of the probe (R,) as an index into `views`."""

    probe: Ints
    ranked: Ints
    far: Floats
    view: Ints
    views: tuple[ProbeView, ...]

    def of(self, view: ProbeView) -> "Trials":
        """The trials of one probe camera."""
        keep = self.view == self.views.index(view)
        return Trials(self.probe[keep], self.ranked[keep], self.far[keep], self.view[keep], self.views)


def trials(distances: ArrayLike, items: Sequence[Item], protocol: str, held_out: Bools | None = None) -> Trials:
    """`Trials` of a protocol. A probe whose subject is not in a gallery has no trial there.

    `held_out` (N,) bool: only these are probes, and only the others are in galleries.
    """
    if protocol not in PROTOCOLS:
        raise DiorError(f"there is no protocol '{protocol}'{nearest(protocol, PROTOCOLS)}")
    distances = np.asarray(distances, float)
    if distances.shape != (len(items), len(items)) or not np.isfinite(distances).all():
        raise DiorError(f"distances {distances.shape} of {len(items)} sequences must be a square of finite numbers")
    views = tuple(sorted({item.view for item in items}))
    view = np.array([views.index(item.view) for item in items], int)
    subject = numbered([item.subject for item in items])
    recording = numbered([item.recording for item in items])
    asks, answers = (True, True) if held_out is None else (held_out, ~held_out)
    probes, ranked = [], []
    for p in range(len(views)):
        for gallery in _galleries(views, p, protocol):
            inside = np.flatnonzero(np.isin(view, gallery) & answers)
            for nth in np.flatnonzero((view == p) & asks).tolist():
                own = inside if protocol != "other_recording" else inside[recording[inside] != recording[nth]]
                if (subject[own] == subject[nth]).any():
                    probes.append(nth)
                    ranked.append(own[np.argsort(distances[nth, own], kind="stable")])
    most = max((len(row) for row in ranked), default=0)
    filled = np.full((len(ranked), most), -1)
    for row, order in zip(filled, ranked, strict=True):
        row[: len(order)] = order
    probe = np.array(probes, int)
    far = np.where(filled >= 0, distances[probe[:, None], filled], np.nan)
    return Trials(probe, filled, far, view[probe], views)


def _galleries(views: Sequence[ProbeView], p: int, protocol: str) -> list[list[int]]:
    """Lists of views (indices) that the probes of view `p` look into."""
    others = [g for g in range(len(views)) if g != p]
    if protocol == "pooled":
        return [others] if others else []
    if protocol == "other_place":
        others = [g for g in others if views[g][0] != views[p][0]]
    return [[g] for g in others]


def numbered(words: ArrayLike) -> Ints:
    """Words (N,) as numbers, equal where the words are."""
    return np.unique(np.asarray(words, dtype=object).astype(str), return_inverse=True)[1].ravel()


def matches(found: Trials, items: Sequence[Item]) -> Bools:
    """Whether each of the ranked sequences shows the probe's subject, (R, G) bool."""
    subject = numbered([item.subject for item in items])
    return (subject[found.ranked] == subject[found.probe][:, None]) & (found.ranked >= 0)


def hits(match: Bools, most: int) -> Bools:
    """Whether the subject is among the nearest 1, 2, ..., `most` sequences, (R, most) bool: the CMC of each trial."""
    first = match[:, :most]
    first = np.pad(first, ((0, 0), (0, most - first.shape[1])))
    return np.logical_or.accumulate(first, axis=1)


def average_precision(match: Bools) -> Floats:
    """Average precision (R,): the mean, over the subject's sequences, of the share of right ones up to each."""
    right = match.cumsum(axis=1)
    place = np.arange(1, match.shape[1] + 1)
    return np.where(match, right / place, 0.0).sum(axis=1) / match.sum(axis=1)


def inverse_precision(match: Bools) -> Floats:
    """Inverse negative penalty (R,) (Ye et al., TPAMI 2021): the subject's sequences over the place of the last one."""
    last = match.shape[1] - match[:, ::-1].argmax(axis=1)
    return match.sum(axis=1) / last


def accepted(found: Trials, match: Bools, share: float) -> Bools:
    """Pairs (R, G) of a probe and its own subject that are nearer than all but a `share` of the pairs of two people.

    One threshold for all trials; where it would be an extrapolation, with fewer pairs of two people than 1 / `share`,
    raises ValueError.
    """
    others = np.sort(found.far[~match & (found.ranked >= 0)])
    if len(others) * share < 1:
        raise ValueError(f"{len(others)} pairs of two people say nothing of a share of {share:g}")
    return match & (found.far < others[int(len(others) * share)])
