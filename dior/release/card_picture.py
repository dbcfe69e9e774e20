"""The picture on the card of a release: one person's labels over released pictures, a camera of each kind side by side.

INPUTS   tables of a release: `sequences`, `released_cameras`, and of some recordings `released_covers`,
         `released_frames` and `labels_2d`
OUTPUT   card.jpg, or none: only released pictures are shown, thus of somebody who agreed to that, in which dior has
         covered the whole head, and of no camera of which a person and not dior says that heads are covered
The same release gives the same picture: the first person by pseudonym with the most kinds of cameras, of each kind the
first recording by name, of that the picture with the most labels that no other cover lies on, and of those the one in
which the body is tallest.
"""

from collections.abc import Callable, Collection
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dior.arrays import Bools, Floats, Ints, Table
from dior.errors import DiorError
from dior.release import jpeg
from dior.release.exports.recordings import AT_A_TIME
from dior.release.heads import EDGES
from dior.release.layout import IN_PICTURE, PARTS
from dior.report import overlays
from dior.tables import tables

FILE = "card.jpg"
# px; chosen: a standing person fills it, and three beside each other are as wide as a page
TILE = (360, 480)
# chosen: a picture with fewer of its labels shows half a person
LEAST_SHARE = 0.5
SCHEMA = {part.name: part.table for part in PARTS}
ROLES = {"close": "close camera", "long_range": "long range"}


@dataclass(frozen=True)
class Source:
    """Where the tables of a release are read. `names`: the paths of its files; `table`: the columns of the table at a
    path, of a part of layout.py; `picture`: the JPEG file in a row of a frames table."""

    names: Collection[str]
    table: Callable[[str, str, list[str]], Table]
    picture: Callable[[str, int], bytes]


@dataclass(frozen=True, eq=False)
class Panel:
    """A picture and its labels: `recording`, its file's name below a part's folder; `row` in its frames table; `uv`
    (J, 2) px of `joints`, NaN where none is in the picture; `metres` to the person."""

    recording: str
    environment: str
    role: str
    row: int
    frame: int
    uv: Floats
    joints: list[str]
    metres: float

    @property
    def words(self) -> str:
        far = f", {self.metres:.0f} m" if self.role == "long_range" and np.isfinite(self.metres) else ""
        return f"{self.environment}, {ROLES[self.role]}{far}"


def of_folder(folder: Path) -> Source:
    """The `Source` of a release's folder."""

    def table(path: str, part: str, columns: list[str]) -> Table:
        return tables.read(folder / path, SCHEMA[part], columns)

    def picture(path: str, row: int) -> bytes:
        at = 0
        for t in tables.read_in_parts(folder / path, SCHEMA["frames"], ["image"], AT_A_TIME):
            if row < at + len(t["image"]):
                return bytes(t["image"][row - at])
            at += len(t["image"])
        raise IndexError(row)

    names = {path.relative_to(folder).as_posix() for path in folder.rglob("*.parquet")}
    return Source(names, table, picture)


def panels(source: Source, sequences: Table, cameras: Table) -> list[Panel]:
    """What the picture shows; [] where there is nothing that may be shown. `sequences`, `cameras`: those tables."""
    walks = {
        (who, name): (session, environment)
        for who, name, session, environment in zip(
            *(sequences[key] for key in ("subject", "sequence", "session", "environment")), strict=True
        )
    }
    roles = {
        (session, name): role
        for session, name, role, checked in zip(
            *(cameras[key] for key in ("session", "camera", "role", "heads_checked")), strict=True
        )
        if not checked
    }
    people: dict[str, dict[tuple[str, str], list[str]]] = {}
    for path in sorted(name for name in source.names if name.startswith("covers/")):
        recording = path.removeprefix("covers/")
        who, _, file = recording.partition("/")
        sequence, camera, _ = file.split(".")
        session, environment = walks[who, sequence]
        if (session, camera) in roles:
            kind = environment, roles[session, camera]
            people.setdefault(who, {}).setdefault(kind, []).append(recording)
    kinds = {kind for own in people.values() for kind in own}
    best: list[Panel] = []
    for _, own in sorted(people.items()):
        tried = ((_panel(source, one, *kind) for one in names) for kind, names in sorted(own.items()))
        found = [panel for panel in (next(filter(None, one), None) for one in tried) if panel]
        best = found if len(found) > len(best) else best
        if len(best) == len(kinds):
            break
    return best


def _panel(source: Source, recording: str, environment: str, role: str) -> Panel | None:
    """The picture of a recording that shows its labels best, None where there is none that may be shown."""
    frames = source.table(f"frames/{recording}", "frames", ["frame", "height", "width", "no_image"])
    covers = source.table(f"covers/{recording}", "covers", ["frame", "what", *EDGES])
    low, high = (np.stack([covers[key] for key in keys], axis=1) for keys in (EDGES[:2], EDGES[2:]))
    row = np.searchsorted(frames["frame"], covers["frame"])
    size = np.stack([frames["width"][row], frames["height"][row]], axis=1)
    whole = (covers["what"] == "head") & (low >= 0).all(axis=1) & (high <= size).all(axis=1)
    covered = np.unique(row[whole & (frames["no_image"][row] == "")])
    if not len(covered):
        return None
    labels = source.table(f"labels_2d/{recording}", "labels_2d", ["frame", "joint", "u", "v", "depth", "status"])
    uv, joints = tables.grid(labels, "u", "v")
    inside = np.isin(labels["status"].reshape(uv.shape[:2]), IN_PICTURE) & np.isfinite(uv).all(axis=-1)
    numbers = labels["frame"].reshape(inside.shape)[:, 0]
    bare = inside & ~_under(covers, low, high, numbers, uv)
    there = np.searchsorted(numbers, frames["frame"][covered])
    count = bare[there].sum(axis=1)
    if count.max() < LEAST_SHARE * len(joints):
        return None
    v = np.where(inside[there], uv[there, :, 1], np.nan)
    most = np.flatnonzero(count == count.max())
    at = most[np.argmax(np.nanmax(v[most], axis=1) - np.nanmin(v[most], axis=1))]
    seen = inside[there[at]]
    depth = labels["depth"].reshape(inside.shape)[there[at]][seen]
    row_of_frame = int(covered[at])
    return Panel(
        recording,
        environment,
        role,
        row_of_frame,
        int(frames["frame"][row_of_frame]),
        np.where(seen[:, None], uv[there[at]].astype(float), np.nan),
        joints,
        float(np.median(depth)),
    )


def _under(covers: Table, low: Floats, high: Floats, numbers: Ints, uv: Floats) -> Bools:
    """Which labels uv (F, J, 2) px of the frames `numbers` (F,) lie in the covers of what else moves, whose edges are
    `low` and `high` (C, 2) px."""
    found, other = np.zeros(uv.shape[:2], bool), covers["what"] == "other"
    at = np.searchsorted(numbers, covers["frame"][other])
    low, high = (edges[other][:, None] - 0.5 for edges in (low, high))
    # a frame may have several
    np.logical_or.at(found, at, ((uv[at] >= low) & (uv[at] <= high)).all(axis=-1))
    return found


def drawn(source: Source, chosen: list[Panel]) -> overlays.Picture:
    """BGR picture (height, width, 3) of the panels, with what each is below it."""
    import cv2

    tiles = []
    for panel in chosen:
        data = source.picture(f"frames/{panel.recording}", panel.row)
        picture = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION)
        if picture is None:
            raise DiorError(f"frames/{panel.recording}: the picture of frame {panel.frame} cannot be decoded")
        high, wide = picture.shape[:2]
        view = overlays.view_of(wide, high, TILE, min(TILE[0] / wide, TILE[1] / high), panel.uv, True)
        tile = overlays.shown_in(view, picture)
        overlays.draw_skeleton(tile, view.of(panel.uv), panel.joints, np.zeros(len(panel.joints), bool))
        enlarged = f", {view.scale:.0f}x" if view.scale >= 1.5 else ""
        tiles.append(overlays.captioned(tile, f"{panel.words}{enlarged}"))
    return overlays.side_by_side(tiles)


def write(folder: Path, sequences: Table, cameras: Table) -> str:
    """Write the picture into the folder of a release; returns what it shows, "" where nothing may be shown."""
    source = of_folder(folder)
    chosen = panels(source, sequences, cameras)
    if not chosen:
        return ""
    (folder / FILE).write_bytes(jpeg.encoded(drawn(source, chosen), overlays.JPEG_QUALITY))
    return "; ".join(panel.words for panel in chosen)
