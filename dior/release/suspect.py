"""Labels that a red light says are wrong leave the house without a place: the rows stay, status `suspect`.

Of the gait of such a walk no event and no step leaves it, and its parameters have no values.

INPUTS   figures, findings and cameras of the released walks, what the lab accepts (`labels_accepted` of session.yaml);
         `labels_2d` and `skeletons_3d` of such a walk
OUTPUTS  columns of `released_lights`: what is red, and who accepts it; the tables without the places
What is made of a place goes with it: sigmas, correlations, depth, source. A joint that had no 3D before keeps its word
(`missing_3d`, `too_few_views`, `rejected`): that says more. `out_of_frame` and `behind_camera` do not stay: they are
said by the pose that is in doubt. `n_views` and `residual_px` stay, by which the doubt can be seen.
"""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import NamedTuple, TypeAlias

import numpy as np
import pyarrow as pa

from dior.arrays import Table
from dior.release.people_tables import Walks
from dior.report import red_labels
from dior.tables import buffers, tables

# what is null of a label and of a point without a place, and the statuses that stay as they are
NO_PLACE = {
    "labels_2d": ("u", "v", "sigma_u", "sigma_v", "rho_uv", "depth", "source"),
    "skeletons_3d": (
        *("x", "y", "z", "sigma_x", "sigma_y", "sigma_z", "rho_xy", "rho_xz", "rho_yz", "constant_share"),
    ),
}
STAYS = {"labels_2d": ("missing_3d", "suspect"), "skeletons_3d": ("too_few_views", "rejected", "suspect")}
# reasons by sequence, or by (sequence, camera) as "<sequence>/<camera>"
Accepted: TypeAlias = Mapping[str, str]


class RedLight(NamedTuple):
    """A row of `released_lights`: `camera` "" is the whole walk, `accepted` "" nobody's word."""

    subject: str
    sequence: str
    camera: str
    reason: str
    accepted: str


def red_lights(
    walks: Walks, rig: Table, metrics: Iterable[Path], findings: Iterable[Path], accepted: Accepted, robust: bool
) -> list[RedLight]:
    """What is red of the labels of the released walks, sorted.

    `rig`: columns of `released_cameras`; `metrics`, `findings`: tables of that kind; `robust`: of the triangulation.
    """
    figures: dict[tuple[str, str], dict[str, float]] = {}
    for path in metrics:
        figures |= red_labels.by_camera(tables.read(path, "metrics"))
    # the others say nothing of labels, and there are thousands of them
    found = [
        one for path in findings for one in tables.read_findings(path) if one[1] == "error" or one[2] == "mocap_agrees"
    ]
    keys = ("session", "camera", "fx", "role")
    rows = list(zip(*(rig[key].tolist() for key in keys), strict=True))
    lights = []
    for name, walk in walks.items():
        own = [row for row in rows if row[0] == walk["released_session"] and row[1] in walk["cameras"]]
        cameras = {camera: red_labels.Judged(fx, figures.get((name, camera), {})) for _, camera, fx, _ in own}
        makers = [camera for _, camera, _, role in own if role == "close" and walk["environment"] != "indoor"]
        reds = red_labels.of_walk(name, walk["session"], cameras, makers, found, robust)
        whole = accepted.get(name, "")
        # a camera's labels are drawn from the 3D: its word is none while that is in doubt
        of_camera = {} if not whole and any(not red.camera for red in reds) else accepted
        for red in reds:
            who = whole or of_camera.get(f"{name}/{red.camera}", "")
            lights.append(RedLight(walk["subject"], name, red.camera, red.reason, who))
    return sorted(lights)


def said(lights: Iterable[RedLight], accepted: Accepted, walks: Walks) -> list[str]:
    """Sentences for who makes the release: what has no place and why, and words that were given for nothing."""
    lights = list(lights)
    lines = [
        f"{' '.join(filter(None, (light.sequence, light.camera)))}: its labels are suspect and have no place: "
        f"{light.reason}; mend it, or say why they are good in `labels_accepted` of session.yaml"
        for light in lights
        if not light.accepted
    ]
    used = {word for light in lights if light.accepted for word in (light.sequence, f"{light.sequence}/{light.camera}")}
    unused = [key for key in accepted if key.partition("/")[0] in walks and key not in used]
    return lines + [f"labels_accepted of {key} is not used: nothing is red that it could accept" for key in unused]


def columns(lights: Iterable[RedLight]) -> dict[str, list[str]]:
    """Columns of `released_lights`."""
    rows = list(lights)
    return {key: [getattr(row, key) for row in rows] for key in RedLight._fields}


def told(lights: Iterable[RedLight]) -> dict[str, dict[str, str]]:
    """sequence -> camera, "" for the whole walk -> who accepts what is red."""
    found: dict[str, dict[str, str]] = {}
    for light in lights:
        if light.accepted:
            found.setdefault(light.sequence, {})[light.camera] = light.accepted
    return found


def without_place(lights: Iterable[RedLight], sequence: str) -> frozenset[str]:
    """The cameras of a walk whose labels are `suspect`; "" where the 3D is, and the labels of all cameras with it."""
    return frozenset(light.camera for light in lights if light.sequence == sequence and not light.accepted)


def without_gait(table: pa.Table) -> pa.Table:
    """A table of the gait of a walk whose 3D is suspect: of events and steps no row, of parameters no value."""
    kind = tables.kind_of(table)
    if kind != "gait_parameters":
        return table.slice(0, 0)
    names = ("subject", "sequence", "parameter", "side", "unit")
    kept = {name: buffers.to_numpy(table[name].combine_chunks()) for name in names}
    said = {"n": np.zeros(len(table), int), "reason": np.full(len(table), "suspect", object)}
    return tables.to_arrow(kind, kept | said)


def hidden(table: pa.Table) -> pa.Table:
    """`labels_2d` or `skeletons_3d` without a place."""
    kind = tables.kind_of(table)
    status = buffers.to_numpy(table["status"].combine_chunks())
    blank = tables.to_arrow(kind, {"status": np.where(np.isin(status, STAYS[kind]), status, "suspect")})
    for name in (*NO_PLACE[kind], "status"):
        at = table.schema.get_field_index(name)
        table = table.set_column(at, table.schema.field(at), blank[name])
    return table
