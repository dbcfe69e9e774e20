"""What the networks are given: the COCO-17 joints of a walk as every camera shows them, cut to whole sequences.

INPUTS   the 3D of a sequence (`skeletons_3d`: a detector's joints or Plug-in-Gait markers), its cameras, their clocks
OUTPUTS  `labels_2d` of the COCO-17 joints in every camera, px in the recorded picture; `skeletons_3d` of the same
         joints, m. In memory: `CameraWalk`s, cut and adapted
The joints are made in 3D (dior/body/coco17.py) and then projected, since a joint centre is no marker. As the labels,
they come from the 3D in every camera, the long-range one included. What lies outside the picture or is behind the
camera is missing; a joint that the body hides is kept.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dior.arrays import AnyPath, Bools, Floats, Ints, Table, Texts, runs_of
from dior.body.coco17 import coco17
from dior.body.names import COCO_17
from dior.clocks import clock as on_axis
from dior.clocks.axis import moving, nominal_fps
from dior.errors import DiorError, nearest
from dior.geometry import camera_tables
from dior.label.reproject import labels
from dior.tables import tables

LENGTH = 300  # frames of a sequence (paper, section 5)
LEAST = 61  # what the authors' evaluations ask for
GAP_S = 0.4  # the longest gap of a joint that is bridged: less than half a stride
# a picture of CASIA-B, which the networks were trained on, and where and how large a person is in it
WIDTH, MIDDLE, BODY_PX = 320, (165.0, 101.0), 106.0
NOSE, ANKLES = 0, (15, 16)
ADAPTATIONS = {
    "as_is": "pixels as recorded (the paper)",
    "scaled": "pixels of a picture that is 320 wide, as in CASIA-B",
    "canonical": "every sequence moved and scaled to where and how large people are in CASIA-B",
}


@dataclass(frozen=True, eq=False)
class CameraWalk:
    """One walk as one camera shows it: uv (F, 17, 2) px at regular times, NaN where a joint is missing."""

    uv: Floats
    fps: float
    width: int


def run(
    *,
    sequence: str,
    subject: str,
    names: list[str],
    skeleton: Path,
    cameras: list[Path],
    frames: Path,
    clocks: list[Path],
    source: str,
    out: Path,
    out_skeleton: Path,
) -> None:
    """Write the COCO-17 joints of one sequence, in 3D and in the cameras called `names`.

    `cameras`: `cameras` tables that hold them; `clocks`: their `offsets` tables. Raises DiorError for a camera without
    a pose, a clock or pictures, and for a skeleton that none of COCO's joints can be made of.
    """
    rig = dict(zip(names, camera_tables.read_placed(cameras, names, sequence), strict=True))
    known, pictures = on_axis.read(clocks), tables.read(frames, "frames")
    body = tables.read(skeleton, "skeletons_3d")
    walker, parts = moving(body), []
    joints = walker.joints
    for name in names:
        rows = tables.of_camera(pictures, name)
        if name not in known or not len(rows["frame"]):
            lacks = "clock" if name not in known else "picture"
            raise DiorError(f"{sequence}, camera {name}: there is no {lacks} of it; run the steps before")
        points, *_ = walker.at_pictures(rows["stamp_ns"], known[name].offset_s, known[name].drift_ppm)
        uv, depth, status = labels(rig[name], coco17(points, joints)[0], list(COCO_17))
        parts.append(_label_rows(subject, sequence, name, rows, uv, depth, status, source))
    if all((part["status"] == "missing_3d").all() for part in parts):
        raise DiorError(f"{sequence}: no joint of COCO-17 can be made of {skeleton} ({', '.join(joints[:4])}, ...)")
    tables.write(out, "labels_2d", {key: np.concatenate([part[key] for part in parts]) for key in parts[0]})
    tables.write(out_skeleton, "skeletons_3d", _skeleton(body, joints, subject, sequence))


def _label_rows(
    subject: str, sequence: str, camera: str, rows: Table, uv: Floats, depth: Floats, status: Texts, source: str
) -> Table:
    count, each = status.shape
    words = {"subject": subject, "sequence": sequence, "camera": camera}
    return {
        **{key: np.full(count * each, word, object) for key, word in words.items()},
        "joint": np.tile(np.array(COCO_17, object), count),
        "frame": np.repeat(rows["frame"], each),
        "stamp_ns": np.repeat(rows["stamp_ns"], each),
        "u": uv[..., 0].ravel(),
        "v": uv[..., 1].ravel(),
        "depth": depth.ravel(),
        "status": status.ravel(),
        "source": np.where(status == "missing_3d", "", source).ravel().astype(object),
    }


def _skeleton(body: Table, joints: list[str], subject: str, sequence: str) -> Table:
    """`skeletons_3d` of the COCO-17 joints; a joint that is derived has no sigma."""
    points, _ = tables.grid(body, "x", "y", "z")
    made, _, rules = coco17(points, joints)
    count, each = made.shape[:2]
    here = [joints.index(name) if rule == "named" else -1 for name, rule in zip(COCO_17, rules, strict=True)]

    def own(column: str, nothing: Any) -> NDArray[Any]:
        values = body[column].reshape(count, -1)
        return np.where(np.array(here) >= 0, values[:, here], nothing).ravel()

    known = np.isfinite(made).all(axis=-1)
    status = np.where(known, "ok", "too_few_views").ravel().astype(object)
    status[own("status", "") == "gap_filled"] = "gap_filled"
    spread = [c for c in tables.columns_of("skeletons_3d") if c.startswith(("sigma_", "rho_"))]
    return {
        "subject": np.full(count * each, subject, object),
        "sequence": np.full(count * each, sequence, object),
        "joint": np.tile(np.array(COCO_17, object), count),
        "instant": np.repeat(np.arange(count), each),
        "stamp_ns": np.repeat(body["stamp_ns"].reshape(count, -1)[:, 0], each),
        **{axis: made[..., i].ravel() for i, axis in enumerate("xyz")},
        **{column: own(column, np.nan) for column in spread},
        "n_views": own("n_views", -1),
        "status": status,
    }


def camera_walks(path: AnyPath, widths: Mapping[str, int]) -> dict[str, CameraWalk]:
    """`CameraWalk` of every camera by name of a table that `run` wrote; `widths`: of the cameras' pictures, px."""
    table = tables.read(path, "labels_2d", ["camera", "joint", "stamp_ns", "u", "v", "status"])
    found: dict[str, CameraWalk] = {}
    for name in tables.ordered_unique(table["camera"]):
        rows = tables.of_camera(table, name)
        uv, joints = tables.grid(rows, "u", "v")
        if tuple(joints) != COCO_17:
            raise DiorError(f"{path}: the joints are not COCO-17; delete it and run again")
        seen = np.isin(rows["status"].astype(str), ("ok", "occluded")).reshape(uv.shape[:2])
        stamps = rows["stamp_ns"].reshape(uv.shape[:2])[:, 0]
        found[name] = CameraWalk(*regular(stamps, np.where(seen[..., None], uv, np.nan)), widths[name])
    return found


def regular(stamps_ns: Ints, values: Floats) -> tuple[Floats, float]:
    """Values (F, ...) recorded at stamps (F,) ns on a regular grid, NaN where a picture lacks, and its rate (Hz).

    Of pictures with one place the first counts.
    """
    if len(stamps_ns) < 2:
        return np.asarray(values, float), np.nan
    fps = nominal_fps(stamps_ns)
    place = np.rint((stamps_ns - stamps_ns.min()) / 1e9 * fps).astype(int)
    first = np.unique(place, return_index=True)[1]
    out = np.full((place.max() + 1, *values.shape[1:]), np.nan)
    out[place[first]] = values[first]
    return out, fps


def filled(values: Floats, most: int) -> Floats:
    """Values (F, J, 2 or 3) with gaps of at most `most` frames between known ones bridged by a cubic spline."""
    from scipy.interpolate import CubicSpline

    out = np.array(values, float)
    for joint in range(out.shape[1]):
        known = np.flatnonzero(np.isfinite(out[:, joint]).all(axis=-1))
        before, after = known[:-1], known[1:]
        short = (after - before > 1) & (after - before <= most + 1)
        if short.any():
            gaps = np.concatenate([np.arange(a + 1, b) for a, b in zip(before[short], after[short], strict=True)])
            out[gaps, joint] = CubicSpline(known, out[known, joint])(gaps)
    return out


def cut(track: CameraWalk, length: int = LENGTH, chunks: int = 1, gap_s: float = GAP_S) -> tuple[list[Floats], str]:
    """Sequences of `track` without a gap: a list of (frames, 17, 2), and why there are fewer than `chunks`, or "".

    Each is the one of `length` frames nearest to the middle of its part of the recording; where no such is whole, the
    longest whole one of that part, of LEAST frames at least.
    """
    uv = filled(track.uv, int(gap_s * track.fps)) if len(track.uv) > 1 else track.uv
    whole = np.all(np.isfinite(uv), axis=(1, 2))
    edges = np.rint(np.linspace(0, len(uv), chunks + 1)).astype(int)
    found, longest = [], 0
    for start, stop in zip(edges[:-1], edges[1:], strict=True):
        first, count = _whole(whole[start:stop], length)
        longest = max(longest, count)
        if count >= LEAST:
            found.append(uv[start + first : start + first + count])
    if len(found) == chunks:
        return found, ""
    lacks = (
        f"{len(uv)} pictures"
        if len(uv) < LEAST
        else f"at most {longest} pictures in a row with all joints, gaps up to {gap_s:g} s bridged"
    )
    return found, f"{lacks}; {LEAST} are needed"


def _whole(whole: Bools, length: int) -> tuple[int, int]:
    """First frame and number of frames of the run of `whole` (F,) that `cut` takes."""
    ends = runs_of(whole)
    if not len(ends):
        return 0, 0
    counts = ends[:, 1] - ends[:, 0]
    if counts.max() < length:
        best = counts.argmax()
        return int(ends[best, 0]), int(counts[best])
    wanted = (len(whole) - length) // 2
    starts = [int(np.clip(wanted, a, b - length)) for a, b in ends[counts >= length]]
    return min(starts, key=lambda start: (abs(start - wanted), start)), length


def adapted(uv: Floats, width: int, adaptation: str) -> Floats:
    """uv (F, 17, 2) px of a picture `width` wide as a network is given it; ADAPTATIONS says how."""
    if adaptation not in ADAPTATIONS:
        raise DiorError(f"there is no adaptation '{adaptation}'{nearest(adaptation, ADAPTATIONS)}")
    if adaptation == "as_is":
        return uv
    if adaptation == "scaled":
        return uv * (WIDTH / width)
    tall = height_px(uv)
    if not tall > 0:
        raise DiorError("a sequence shows a person whose nose is not above the ankles; is the picture upside down?")
    return (uv - uv.mean(axis=(0, 1))) * (BODY_PX / tall) + MIDDLE


def height_px(uv: Floats) -> float:
    """How far the ankles are below the nose in a sequence (F, 17, 2) px, the median."""
    return float(np.median(uv[:, ANKLES, 1].mean(axis=1) - uv[:, NOSE, 1]))
