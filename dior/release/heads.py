"""Where the subject's head is in every picture of a camera, what else moves there, and whether that is sure enough.

INPUTS   the skeleton, the camera's pose and clock, its `labels_2d`, the sequence's figures, the pictures; a detector's
         output and the `heads` of an earlier release, if there are any
OUTPUTS  `heads` table: a row per picture with a box of whole pixels that holds the head, and whether the picture may be
         released; `other_covers`: boxes of whatever else is to be covered; findings
The box is that of an ellipsoid as large as a head (`head_model`), projected and enlarged by SIGMAS of the labels'
uncertainty. It works where no face detector does: from behind, and at a distance where a head has three pixels. Its
edges are rounded outwards on a grid, so that a camera that is moved by a tenth of a pixel leaves most pictures of the
release as they are, byte by byte. All of them stay where the boxes of an earlier release are given: a box is kept as
long as it holds the head.

A picture is not released where the labels' uncertainty is not known or more than half a head, where the camera's light
is red or another one says that its labels are wrong (`report.red_labels`), and where the picture itself does not show
the head under its cover (`head_evidence`). A person who has looked at the pictures can say so: `heads_checked` of
session.yaml lifts all three, and the release tells of it.
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dior.arrays import Bools, Floats, Ints, Table, Texts
from dior.calibrate.outline import tracks
from dior.clocks import clock as on_axis
from dior.clocks.axis import seconds
from dior.errors import DiorError
from dior.geometry import camera as cam
from dior.geometry import camera_tables
from dior.geometry.camera import Camera
from dior.geometry.camera_tables import read_cameras
from dior.project import boxes as hand_boxes
from dior.release import faces, head_model, look
from dior.report import lights, red_labels
from dior.tables import tables

# Of the labels' uncertainty. The ellipsoid is a head with its hair and somewhat more, so that 1.5 leave less than 0.1 %
# of a head outside (benchmarks/blur.py); 3 would cover five times its area at 60 m.
SIGMAS = 1.5
# An earlier box is kept while it holds the ellipsoid with this many, and is at most this many times as large as a new
# one. Chosen: smaller keeps fewer pictures as they were, larger covers less surely or more than the head.
KEPT_SIGMAS, KEPT_AREA = 0.5, 2.0
# where the labels have no known uncertainty, 1 sigma as a share of the head's half width and height; chosen, and said
# in a finding
UNKNOWN_SIGMA = 1 / 6
# The grid, px: the coarsest of which a box is at least this many wide and high. A head of 3 px in a box of 8 would be
# covered ten times over. Chosen: a coarser grid leaves more pictures as they are and covers more beside the head.
GRIDS, PER_BOX = (8, 4, 2, 1), 4
# m from the lens; chosen: twice what a head's ellipsoid reaches, nearer than that its outline is not the one projected
NEAR_M = 0.3
# of a single pixel, this much of its width or height may be left outside; chosen: without it a box that
# reaches a hair into the next pixel becomes a pixel larger
SLIVER = 0.15


EDGES = ("u_min", "v_min", "u_max", "v_max")
NO_BOX = np.zeros((0, 4), int)


@dataclass(frozen=True)
class Filmed:
    """The pictures and who was found in them.

    `data_root`: folder that the bags lie in; `detections`: the detector's own output of the camera, everybody in it,
    or None; `format`: tool that it is of, or auto; `min_score`: score from which a joint counts; `boxes`: boxes drawn
    by hand around the subject, CSV, or None; `people`, `people_labels`: tables `people_3d` and `people_2d` where all
    people are labelled, or None; `first_frame`: number that the detections give the first picture.
    """

    data_root: Path
    detections: Path | None
    format: str
    min_score: float
    boxes: Path | None
    people: Path | None = None
    people_labels: Path | None = None
    first_frame: int = 0


@dataclass(frozen=True)
class Judged:
    """What says whether the labels of the camera can be relied on.

    `role`: close or long_range; `makers`: cameras that the 3D is drawn from, none indoors; `method`: robust, or rays
    for all views as they are; `metrics`: table `metrics` of the sequence; `noticed`: tables `findings` with what is
    wrong with the session or the recording; `session_name`: of the sequence; `checked`: who has looked at the pictures
    and released them all the same, or nothing.
    """

    role: str
    makers: list[str]
    method: str
    session_name: str
    metrics: Path
    noticed: list[Path]
    checked: str = ""


@dataclass(frozen=True, eq=False)
class Known:
    """What is known of the head in the pictures of a camera, a row each.

    `rows` of its `frames`; `times` (F,) s; `middle` between the ears (F, 3) m with its own error `own` (F,) m; `sigma`
    (F, 2) px of the labels; `points` (F, J, 3) m of the `joints`, NaN where missing.
    """

    rows: Table
    camera: Camera
    times: Floats
    middle: Floats
    own: Floats
    sigma: Floats
    points: Floats
    joints: list[str]

    def walker(self, edges: Floats, drawn: Floats) -> look.Walker:
        """The same as pictures are looked at with covers `edges` (F, 4) px and boxes `drawn` (F, 4) px by hand."""
        return look.Walker(self.camera, self.times, self.middle, self.points, self.joints, edges, drawn)

    def boxes(self, sigmas: float | None = None) -> tuple[Floats, Texts]:
        """As `boxes`."""
        return boxes(self.camera, self.middle, self.own, self.sigma, SIGMAS if sigmas is None else sigmas)


def run(
    *,
    sequence: str,
    camera: str,
    cameras: list[Path],
    skeleton: Path,
    frames: Path,
    clocks: list[Path],
    labels: Path,
    before: Path | None,
    filmed: Filmed,
    judged: Judged,
    out: Path,
    out_covers: Path,
    findings: Path,
) -> None:
    """Write the head's box in every picture of one camera of one sequence, and what else is to be covered there.

    `cameras`, `clocks`: tables that hold the poses of the camera and of the makers, and the camera's clock. Raises
    DiorError where they do not, and where the labels are of other pictures. `before`: the table that an earlier release
    was made with, or None; `out_covers`: table `other_covers` to write.
    """
    where = f"{sequence}, camera {camera}"
    subject = known(sequence, camera, cameras, skeleton, frames, clocks, labels)
    box, status = subject.boxes()
    box = np.where((status == "ok")[:, None], on_grid(box), np.nan)
    if before:
        box = kept(_earlier(before, subject.rows, where), box, subject.boxes(KEPT_SIGMAS)[0])
    red = red_by(sequence, camera, judged, {name: one.intrinsics.fx for name, one in read_cameras(cameras).items()})
    others = known_others(filmed.people, filmed.people_labels, subject, where)
    if not judged.checked:
        unsure = np.any([doubtful(subject), *(doubtful(one) & in_picture(one) for one in others)], axis=0)
        status = np.where(unsure & (status != "unknown"), "uncertain", status).astype(object)
        if red:
            status = np.full(len(status), "red", object)
    moving_boxes: list[Ints] = [NO_BOX] * len(status)
    always = np.zeros(len(status), bool)
    if np.isin(status, ("ok", "out_of_frame")).any():
        found = faces.read(filmed.detections, filmed.format, filmed.min_score, subject.rows, where, filmed.first_frame)
        walker = subject.walker(box, drawn_boxes(filmed.boxes, subject.rows))
        seen = look.looked(walker, judged.role, found, look.reader(subject.rows, filmed.data_root))
        always = seen.always
        moving_boxes = [
            np.concatenate([*each]) for each in zip(seen.others, *(heads_of(one) for one in others), strict=True)
        ]
        if not judged.checked:
            wrong = np.isin(status, ("ok", "out_of_frame")) & (seen.sure != "ok")
            status = np.where(wrong, seen.sure, status).astype(object)
    box = np.where((status == "out_of_frame")[:, None], np.nan, box)
    tables.write(
        out, "heads", {"frame": subject.rows["frame"], "status": status, **dict(zip(EDGES, box.T, strict=True))}
    )
    tables.write(out_covers, "other_covers", _covers(subject.rows["frame"], moving_boxes))
    said = _findings(f"{sequence}/{camera}", status, always, red, judged.checked)
    for _, severity, _, text in said:
        print(f"{sequence}, {camera}: {severity}: {text}", file=sys.stderr)
    tables.write_findings(findings, said)


def known_others(people: Path | None, people_labels: Path | None, subject: Known, where: str) -> list[Known]:
    """What is known of the heads of everybody else who was labelled, in the pictures of the `subject`; nobody without
    the tables.

    Raises DiorError where the labels are of other joints or pictures.
    """
    if people is None or people_labels is None:
        return []
    everybody = tables.read(people, "people_3d")
    everybody = tables.rows(everybody, everybody["is_subject"] != "yes")
    labels = tables.of_camera(
        tables.read(people_labels, "people_2d", [*LABELLED, "person", "camera"]), subject.camera.name
    )
    found = []
    for name in tables.ordered_unique(everybody["person"]):
        body, mine = (tables.rows(table, table["person"] == name) for table in (everybody, labels))
        one = of_body(subject.rows, subject.camera, subject.times, body, mine)
        if one is None:
            raise DiorError(f"{where}: {people_labels} has labels of other joints or pictures; run people again")
        found.append(one)
    return found


def heads_of(other: Known) -> list[Ints]:
    """By picture the box (1, 4) of whole pixels that holds somebody's head, or none (0, 4)."""
    box, status = other.boxes()
    there = (status == "ok") & in_picture(other)
    return [edges[None].astype(int) if ok else NO_BOX for edges, ok in zip(on_grid(box), there, strict=True)]


def drawn_boxes(path: Path | None, rows: Table) -> Floats:
    """Edges (F, 4) px of the boxes drawn by hand, NaN where there is none."""
    edges = np.full((len(rows["frame"]), 4), np.nan)
    if path:
        frames, boxes = hand_boxes.read(path, rows["frame"])
        edges[np.searchsorted(rows["frame"], frames)] = boxes
    return edges


def _covers(frames: Ints, boxes: Sequence[Ints]) -> Table:
    """Columns of `other_covers`: a row per box of each of the pictures `frames` (F,)."""
    count = [len(each) for each in boxes]
    edges = np.concatenate([np.zeros((0, 4)), *boxes])
    return {"frame": np.repeat(frames, count), **dict(zip(EDGES, edges.T, strict=True))}


def red_by(sequence: str, camera: str, judged: Judged, fx: dict[str, float]) -> str:
    """Why the report's light of the camera is red, or which one says that its labels are wrong, in words, or "".

    `fx`: px by camera. Lost pictures do not count: they say nothing of the others.
    """
    figures = red_labels.by_camera(tables.read(judged.metrics, "metrics"))
    found = [row for path in judged.noticed for row in tables.read_findings(path)]
    own = dict.fromkeys(
        finding for name in (camera, "") for finding in lights.findings_of(found, sequence, [judged.session_name], name)
    )
    why = reasons(figures.get((sequence, camera), {}), fx[camera], list(own), judged.role)
    rig = {name: red_labels.Judged(fx[name], figures.get((sequence, name), {})) for name in (*judged.makers, camera)}
    wrong = red_labels.of_walk(sequence, judged.session_name, rig, judged.makers, found, judged.method == "robust")
    return why or "; ".join(red.reason for red in wrong if red.camera in ("", camera))


def reasons(figures: dict[str, float], fx: float, found: list[lights.Told], role: str) -> str:
    """What makes a camera's light red, in words; "" where it is not."""
    light = lights.judge(figures, fx, found, role)
    return "; ".join(light.reasons) if light.level == "bad" else ""


def doubtful(subject: Known) -> Bools:
    """Pictures (F,) in which the labels' uncertainty is not known, or larger than half a head."""
    _, status = subject.boxes()
    with np.errstate(invalid="ignore"):
        small = subject.sigma.max(axis=1) <= half_a_head(subject)
    # of who is not in the picture, the sigma need not be small
    return ~np.isfinite(subject.sigma).all(axis=1) | (status == "ok") & ~small


def half_a_head(of: Known) -> Floats:
    """Half a head's width (F,) px at its distance."""
    distance = np.linalg.norm(of.middle - of.camera.centre, axis=1)
    return np.asarray(head_model.RADII_M[0] * of.camera.intrinsics.fx / distance)


def in_picture(other: Known) -> Bools:
    """Whether (F,) the head is in the picture, were it half a head off at the most.

    Of who stands beside a camera pixels are of no use, where a sigma is larger than the picture and a head's outline
    has no end: that they are beside it tells the angle from its axis.
    """
    camera, lens = other.camera, other.camera.intrinsics
    sigma = np.fmin(other.sigma, half_a_head(other)[:, None])
    _, status = boxes(camera, other.middle, other.own, sigma)
    corners = cam.rays(camera, np.array([(u, v) for u in (0.0, lens.width - 1) for v in (0.0, lens.height - 1)]))
    sight = other.middle - camera.centre
    distance = np.linalg.norm(sight, axis=1)
    axis = camera.wRc[:, 2]
    widest = np.arccos(corners @ axis).max()
    with np.errstate(invalid="ignore"):
        aside = np.arccos(np.clip(sight @ axis / distance, -1.0, 1.0))
        head = np.arcsin(np.minimum(2 * head_model.RADII_M[1] / distance, 1.0))
        return np.asarray((status == "ok") & (aside - head <= widest))


def known(
    sequence: str, camera: str, cameras: list[Path], skeleton: Path, frames: Path, clocks: list[Path], labels: Path
) -> Known:
    """What is known of the head in one camera's pictures; arguments as of `run`."""
    (placed,) = camera_tables.read_placed(cameras, [camera], sequence)
    where = f"{sequence}, camera {camera}"
    if camera not in (own_clocks := on_axis.read(clocks)):
        raise DiorError(f"{where}: {', '.join(map(str, clocks))} has no clock of it")
    rows = tables.of_camera(tables.read(frames, "frames"), camera)
    body, clock = tables.read(skeleton, "skeletons_3d"), own_clocks[camera]
    table = tables.read(labels, "labels_2d", list(LABELLED))
    found = of_tables(rows, placed, body, table, clock.offset_s, clock.drift_ppm)
    if found is None:
        raise DiorError(f"{where}: {labels} has labels of other joints or pictures; run reproject again")
    return found


# what is read of the labels
LABELLED = ("frame", "joint", "sigma_u", "sigma_v")


def of_tables(
    rows: Table, placed: Camera, body: Table, labels: Table, offset_s: float, drift_ppm: float
) -> Known | None:
    """The same from tables: `rows` of the camera's pictures, `body` (`skeletons_3d`) and the camera's `labels_2d`.

    None where the labels are of other joints or pictures.
    """
    return of_body(rows, placed, seconds(rows["stamp_ns"], body["stamp_ns"][0], offset_s, drift_ppm), body, labels)


def of_body(rows: Table, placed: Camera, times: Floats, body: Table, labels: Table) -> Known | None:
    """The same at `times` (F,) s, of a body that may be anybody's."""
    track, _, joints = tracks.read(body)
    sigma = _sigma(labels, joints, rows)
    if sigma is None:
        return None
    return Known(
        rows, placed, times, *_heads(body, times), _everywhere(times, sigma), bridged(track.at(times), times), joints
    )


def _heads(body: Table, times: Floats) -> tuple[Floats, Floats]:
    """The middle between the ears (F, 3) m at `times` (F,) s, and its own error (F,) m, of a `skeletons_3d` table."""
    points, joints = tables.grid(body, "x", "y", "z")
    instants = seconds(body["stamp_ns"].reshape(points.shape[:2])[:, 0], body["stamp_ns"][0])
    middle, own = head_model.centres(points, joints)
    filled = (body["status"] == "gap_filled").reshape(points.shape[:2])[:, head_model.used(joints)].any(axis=1)
    return head_model.at_times(times, instants, head_model.steady(instants, middle, filled), own)


def _sigma(labels: Table, joints: list[str], rows: Table) -> Floats | None:
    """Uncertainty (F, 2) px of the labels of the head, the mean over its joints; NaN where none is known.

    None where the labels are of other joints or pictures.
    """
    values, named = tables.grid(labels, "frame", "sigma_u", "sigma_v")
    if named != joints or not np.array_equal(values[:, 0, 0], rows["frame"]):
        return None
    mine = values[:, head_model.used(joints), 1:]
    known = np.all(np.isfinite(mine), axis=-1)
    count = known.sum(axis=1)[:, None]
    return np.where(count > 0, np.where(known[..., None], mine, 0.0).sum(axis=1) / np.maximum(count, 1), np.nan)


def bridged(points: Floats, times: Floats) -> Floats:
    """Points (F, J, 3) m at ascending `times` (F,) s, on a straight line over gaps as long as those of the head."""
    out = points.copy()
    for j in range(points.shape[1]):
        known = np.isfinite(points[:, j]).all(axis=1)
        if known.sum() < 2 or known.all():
            continue
        after = np.searchsorted(times[known], times)
        inside = (after > 0) & (after < known.sum()) & ~known
        gap = times[known][after.clip(1, known.sum() - 1)] - times[known][after.clip(1, known.sum() - 1) - 1]
        mine = inside & (gap <= head_model.MAX_GAP_S)
        for axis in range(3):
            out[mine, j, axis] = np.interp(times[mine], times[known], points[known, j, axis])
    return out


def _everywhere(times: Floats, sigma: Floats) -> Floats:
    """Sigma (F, 2) px with those of the nearest pictures where there is none; NaN where there is none at all."""
    known = np.isfinite(sigma).all(axis=1)
    if not known.any():
        return sigma
    return np.stack([np.interp(times, times[known], sigma[known, i]) for i in range(2)], axis=1)


def boxes(camera: Camera, middle: Floats, own: Floats, sigma: Floats, sigmas: float = SIGMAS) -> tuple[Floats, Texts]:
    """Box (F, 4) px (u_min, v_min, u_max, v_max) of the head in every picture, and its status (F,).

    `middle` (F, 3) m between the ears with its own error `own` (F,) m, `sigma` (F, 2) px of the labels, NaN unknown;
    the box is larger than the ellipsoid by `sigmas` of all that.
    """
    centre = middle + (0.0, 0.0, head_model.RAISED_M)
    uv, depth = cam.project(camera, _outline(camera, centre))
    low, high = (_extreme(uv, pick) for pick in (np.fmin, np.fmax))
    half = (high - low) / 2
    with np.errstate(invalid="ignore"):
        error = np.hypot(np.where(np.isfinite(sigma), sigma, UNKNOWN_SIGMA * half), own[:, None] * _scale(half))
        box = np.concatenate([low - sigmas * error, high + sigmas * error], axis=1)
        lens = camera.intrinsics
        outside = (box[:, 0] >= lens.width - 0.5) | (box[:, 1] >= lens.height - 0.5) | (box[:, 2:] < -0.5).any(axis=1)
        # a head at the lens: no box is sure to hold it
        unknown = ~(np.linalg.norm(centre - camera.centre, axis=1) >= NEAR_M)
    behind = (depth <= 0).all(axis=1)
    unknown |= (depth <= 0).any(axis=1) & ~behind
    nowhere = behind | ~np.isfinite(box).all(axis=1) | outside
    return box, np.where(unknown, "unknown", np.where(nowhere, "out_of_frame", "ok")).astype(object)


def _extreme(uv: Floats, pick: np.ufunc) -> Floats:
    return pick.reduce(uv, axis=1)


def _scale(half: Floats) -> Floats:
    """Pixels per metre (F, 2) at the head, from its half width and height px."""
    return half / np.array(head_model.RADII_M)


def _outline(camera: Camera, centre: Floats) -> Floats:
    """Points (F, 4, 3) m of the ellipsoid that a camera sees furthest right, left, down and up."""
    sight = centre - camera.centre
    sight = sight / np.linalg.norm(sight, axis=1, keepdims=True)
    horizontal, vertical = head_model.RADII_M
    radii = np.array([horizontal, horizontal, vertical])
    points = []
    for axis in camera.wRc.T[:2]:
        across = axis - (sight @ axis)[:, None] * sight
        # where the ellipsoid's surface is furthest along `across`
        reach = radii**2 * across
        reach = reach / np.linalg.norm(radii * across, axis=1, keepdims=True)
        points += [centre + reach, centre - reach]
    return np.stack(points, axis=1)


def on_grid(box: Floats) -> Floats:
    """Edges (F, 4) of whole pixels around boxes (F, 4) px: first column and row, and those after the last.

    Rounded outwards to a grid of 8 px, of 4, 2 or 1 px where the box is less than four of these wide or high.
    """
    edges = box + 0.5
    with np.errstate(invalid="ignore"):
        small = np.minimum(edges[:, 2] - edges[:, 0], edges[:, 3] - edges[:, 1])
        grid = np.select([small >= PER_BOX * g for g in GRIDS[:-1]], GRIDS[:-1], GRIDS[-1])[:, None]
        spared = np.where(grid == 1, SLIVER, 0.0)
    low, high = np.floor(edges[:, :2] / grid + spared), np.ceil(edges[:, 2:] / grid - spared)
    return np.concatenate([low, high], axis=1) * grid


def _earlier(path: Path, rows: Table, where: str) -> Floats:
    """Edges (F, 4) of an earlier `heads` table. Raises DiorError where it is of other pictures."""
    table = tables.read(path, "heads")
    if not np.array_equal(table["frame"], rows["frame"]):
        raise DiorError(f"{where}: {path} is of other pictures; the recording has changed, so delete it")
    return np.stack([table[key] for key in EDGES], axis=1)


def hold(edges: Floats, least: Floats) -> Bools:
    """Whether (F,) the edges (F, 4) of whole pixels hold the boxes `least` (F, 4) px."""
    with np.errstate(invalid="ignore"):
        inside = (edges[:, :2] <= least[:, :2] + 0.5 + SLIVER) & (edges[:, 2:] >= least[:, 2:] + 0.5 - SLIVER)
    return np.asarray(inside.all(axis=1))


def kept(before: Floats, edges: Floats, least: Floats) -> Floats:
    """Edges (F, 4) on the grid, those of `before` where they still hold the boxes `least` (F, 4) px and little more."""

    def area(box: Floats) -> Floats:
        return (box[:, 2] - box[:, 0]) * (box[:, 3] - box[:, 1])

    with np.errstate(invalid="ignore"):
        same = hold(before, least) & np.isfinite(edges).all(axis=1) & (area(before) <= KEPT_AREA * area(edges))
    return np.where(same[:, None], before, edges)


def _findings(scope: str, status: Texts, always: Bools, red: str, checked: str) -> list[tuple[str, str, str, str]]:
    """What a person should see: how many pictures are not released, and why; `always` (F,) as of `look.Looked`."""
    found = []
    unseen = status == "unseen"
    why = WHY | ({"unseen": NO_SCENE} if (always & unseen).sum() > unseen.sum() / 2 else {})
    for word, text in why.items():
        lost = int((status == word).sum())
        if lost:
            text = f"{lost} of {len(status)} pictures are not released: {text.format(red=red)}"
            found.append((scope, "warning", f"head_{word}", text))
    if checked:
        text = f"its pictures are released although dior did not judge whether the heads are covered: {checked}"
        found.append((scope, "warning", "heads_checked", text + (f" (the light is red: {red})" if red else "")))
    return found


LOOK = "look at the pictures yourself and say so in `heads_checked` of session.yaml"
ADVICE = f"; correct the camera's pose or clock, or {LOOK}"
WHY = {
    "unknown": "where the head is in them is not known",
    "uncertain": f"how far the labels are off is not known, or may be more than half a head{ADVICE}",
    "red": f"{{red}}{ADVICE}",
    "unseen": f"nothing that moves is seen where the 3D has the head{ADVICE}",
    "beside": f"what moves there is beside the cover{ADVICE}",
}
NO_SCENE = (
    "the subject is in the same part of the pictures in nearly all of the recording, so that none shows the scene "
    "without them, and nothing tells whether the cover is on the head; draw boxes in 8 of its pictures (config/boxes/) "
    f"if it is a long-range camera, or {LOOK}"
)
