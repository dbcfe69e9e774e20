"""Pickles that OpenGait and FastPoseGait train and evaluate on as they are, by the names of SUSTech1K.

OUTPUTS  opengait/data/<subject>/<type>/<view>/03-<sequence>.<camera>.pkl: float32 (T, 17, 3) x, y, confidence;
         opengait/partition/{subject,everybody}.json with TRAIN_SET and TEST_SET; opengait/configs/;
         opengait/sequences.csv: what is what; opengait/README.md: what can be evaluated, and what cannot and why
Both toolkits (opengait/data/dataset.py, opengait/evaluation/evaluator.py and the same of fastposegait) take every file
of a view for another kind of data of the same frames; here there is one. Their evaluators know datasets by name only,
and look for words within a type: 00-nm is the gallery, 01-nm, bg and cl are probes, 01 to 04 anywhere is a probe of
all. They compare each view with each and take the five nearest, so that a view with fewer in the gallery stops them.
"""

import copyreg
import io
import pickle
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from dior.errors import many
from dior.release.exports import conditions, opengait_configs
from dior.release.exports.conditions import CONDITIONS, NORMAL
from dior.release.exports.poses import AddRecording, Pose
from dior.release.exports.recordings import Recording, Release, ReleasedWalk
from dior.release.exports.writing import write_csv, write_json
from dior.tables.files import write_text

ABOUT = """\
`opengait/data/<subject>/<type>/<view>/03-<sequence>.<camera>.pkl`: one float32 array (T, 17, 3) per recording: x and y
in pixels of the recorded picture ((0, 0) is the centre of the top-left pixel), joints in COCO's order, and a
confidence: 1 in the picture, 0 outside of it; a joint that is not known is 0, 0, 0. Pictures of which nothing is known
are left out. Names are SUSTech1K's, which OpenGait and FastPoseGait evaluate without a change: `type` is `00-nm` in the
gallery, `01-nm`, `01-bg` and `01-cl` of probes (the usual outfit, with a bag, in other clothes), `-1`, `-2`, ... after
it for further walks; `view` is <environment>-<camera>. `opengait/README.md` has the commands to train and evaluate,
what is compared, and what is left out because a view has fewer than five walks in its gallery;
`opengait/sequences.csv` says which recording is which.

`ln -s <this folder>/opengait datasets/dior` in a checkout of OpenGait or FastPoseGait
"""
COLUMNS = "subject type view sequence camera pictures kept left_out".split()
# the nearest that the evaluators look for in each view's gallery (Rank-5)
NEAREST = 5
GALLERY = "00-nm"
PROBES = {condition: f"01-{condition}" for condition in CONDITIONS}
# subject, type, view
Place: TypeAlias = tuple[str, str, str]


@dataclass(frozen=True)
class Plan:
    """`places`: of the recordings that are written, by name; `left_out`: why another is not; `partitions`: by name;
    `why`: sentences about what cannot be evaluated."""

    places: dict[str, Place]
    left_out: dict[str, str]
    partitions: dict[str, dict[str, list[str]]]
    why: list[str]


@contextmanager
def writer(folder: Path, release: Release) -> Iterator[AddRecording]:
    """Yield `add(recording, pose)`; files get their places, which depend on all, when the context ends."""
    data = folder / "data"
    data.mkdir(parents=True)
    found: list[tuple[Recording, int, int]] = []

    def add(recording: Recording, pose: Pose, pictures: dict[int, str]) -> None:
        array = of_pose(pose)
        found.append((recording, len(pose.frame), len(array)))
        if len(array):
            (data / f"{recording.name}.pkl").write_bytes(pickled(array))

    yield add
    plan = planned([recording for recording, _, kept in found if kept], conditions.of_walks(release.walks))
    rows: list[tuple[Any, ...]] = []
    for recording, pictures, kept in found:
        subject, kind, view = plan.places.get(recording.name, (recording.walk.subject, "", view_of(recording)))
        why = "" if kind else plan.left_out.get(recording.name, "no joint is known")
        rows.append((subject, kind, view, recording.walk.sequence, recording.camera.name, pictures, kept, why))
        path = data / f"{recording.name}.pkl"
        if kind:
            place = data / subject / kind / view / f"03-{recording.name}.pkl"
            place.parent.mkdir(parents=True, exist_ok=True)
            path.rename(place)
        else:
            path.unlink(missing_ok=True)
    write_csv(folder / "sequences.csv", COLUMNS, rows)
    for name, content in plan.partitions.items():
        write_json(folder / "partition" / f"{name}.json", content)
    if plan.partitions:
        # the first is the one to train by
        opengait_configs.write(folder / "configs", *next(iter(plan.partitions.items())))
    write_text(folder / "README.md", readme(release.folder.name, plan))


def view_of(recording: Recording) -> str:
    return f"{recording.walk.environment}-{recording.camera.name}"


def planned(recordings: Sequence[Recording], condition: Mapping[str, str]) -> Plan:
    """Where each recording goes. `condition`: nm, bg or cl by sequence.

    The people of the test part are compared, where the evaluators can: two of them at least, in two views whose
    galleries have five walks; else everybody, else nobody. The recordings of who is compared in other views are left
    out, since the evaluators stop at a view with fewer.
    """
    part = {r.walk.subject: r.part for r in recordings}
    tested = {who for who in part if part[who] == "test"}
    why = []
    for name, people in (("subject", tested), ("everybody", set(part))):
        types = types_of(recordings, condition, people)
        short, reason = _short_views(recordings, types, people)
        if reason:
            why.append(f"`partition/{name}.json` is not here: {reason}")
            continue
        left_out = {
            r.name: f"the gallery of view {view_of(r)} has {many(short[view_of(r)], 'walk')}, and the evaluators need "
            f"{NEAREST}"
            for r in recordings
            if r.walk.subject in people and view_of(r) in short
        }
        kept = [r for r in recordings if r.name not in left_out]
        partitions = {name: partition(part, people)}
        if name == "subject":
            if _short_views(kept, types, set(part))[0]:
                why.append("`partition/everybody.json` is not here: people of the training part walked in other views")
            else:
                partitions["everybody"] = partition(part, set(part))
        return Plan({r.name: _place(r, types) for r in kept}, left_out, partitions, why)
    return Plan({r.name: _place(r, types) for r in recordings}, {}, {}, why)


def _place(recording: Recording, types: Mapping[str, str]) -> Place:
    return recording.walk.subject, types[recording.walk.sequence], view_of(recording)


def _short_views(
    recordings: Iterable[Recording], types: Mapping[str, str], people: set[str]
) -> tuple[dict[str, int], str]:
    """Views whose gallery of `people` is too short, with how many walks are in it; why nothing can be compared, ""
    where something can."""
    rows = gallery_rows(recordings, types, people)
    short = {view: count for view, count in rows.items() if count < NEAREST}
    if len(people) < 2:
        return short, f"{len(people)} of the people to compare; of fewer than two every answer is right"
    if len(rows) - len(short) < 2:
        return short, (
            f"of {len(people)} people, {len(rows) - len(short)} of {many(len(rows), 'view')} with {NEAREST} walks in "
            "the gallery; the evaluators compare two views at least, and take the nearest five of each"
        )
    return short, ""


def gallery_rows(recordings: Iterable[Recording], types: Mapping[str, str], people: set[str]) -> dict[str, int]:
    """Walks of `people` in the gallery, by view."""
    rows: Counter[str] = Counter()
    for r in recordings:
        if r.walk.subject in people:
            rows[view_of(r)] += types[r.walk.sequence].startswith(GALLERY)
    return dict(sorted(rows.items()))


def types_of(recordings: Sequence[Recording], condition: Mapping[str, str], people: set[str]) -> dict[str, str]:
    """The type by sequence: each person's first walk in an environment is the gallery, with as many more as most views
    need to have five of `people` in theirs."""
    walks = {r.walk.sequence: r.walk for r in recordings}.values()
    most = -1
    chosen: dict[str, str] = {}
    for first in range(1, NEAREST + 1):
        types = _types(walks, condition, first)
        whole = sum(count >= NEAREST for count in gallery_rows(recordings, types, people).values())
        if whole > most:
            most, chosen = whole, types
    return chosen


def _types(walks: Iterable[ReleasedWalk], condition: Mapping[str, str], first: int) -> dict[str, str]:
    """The type by sequence, the `first` nm walks of each person in an environment in the gallery but for the last."""
    groups: dict[tuple[str, str, str], list[str]] = {}
    for walk in walks:
        groups.setdefault((walk.subject, walk.environment, condition[walk.sequence]), []).append(walk.sequence)
    types: dict[str, str] = {}
    for (_, _, kind), names in groups.items():
        shown = max(min(first, len(names) - 1), 1) if kind == NORMAL else 0
        types |= _numbered(GALLERY, names[:shown]) | _numbered(PROBES[kind], names[shown:])
    return types


def _numbered(kind: str, names: Sequence[str]) -> dict[str, str]:
    """`kind`, `kind`-1, ... by name. A gallery has five at most, so that no number has 01 to 04 in it, which would make
    it a probe."""
    return {name: f"{kind}-{i}" if i else kind for i, name in enumerate(names)}


def partition(part: Mapping[str, str], people: set[str]) -> dict[str, list[str]]:
    """Who is trained and tested on: TRAIN_SET are all of the train and val parts but the tested `people`."""
    trained = {who for who in part if part[who] in ("train", "val")} - people
    return {"TRAIN_SET": sorted(trained), "TEST_SET": sorted(people)}


def readme(name: str, plan: Plan) -> str:
    """What can be evaluated, by view, and how."""
    lines = [f"# {name} for OpenGait and FastPoseGait", ""]
    lines += [f"{sentence}." for sentence in plan.why]
    if plan.left_out:
        reasons = Counter(plan.left_out.values())
        lines += [f"Left out, {many(count, 'recording')}: {why}." for why, count in sorted(reasons.items())]
    if not plan.partitions:
        return "\n".join([*lines, "", "The poses are in `data/`, to be used as they are.", ""])
    for partition_name, content in plan.partitions.items():
        lines += ["", *_counted(partition_name, set(content["TEST_SET"]), list(plan.places.values()))]
    return "\n".join([*lines, "", opengait_configs.COMMANDS])


def _counted(name: str, people: set[str], places: Sequence[Place]) -> list[str]:
    """A table of the recordings of `people` by view and type."""
    kinds = (GALLERY, *PROBES.values())
    count = Counter((view, kind[: len(GALLERY)]) for who, kind, view in places if who in people)
    lines = [f"`partition/{name}.json`: {len(people)} people are tested, of", ""]
    lines += ["| view | " + " | ".join(kinds) + " |", "|---" * (len(kinds) + 1) + "|"]
    for view in sorted({view for view, _ in count}):
        lines.append(f"| {view} | " + " | ".join(str(count[view, kind]) for kind in kinds) + " |")
    return lines


def of_pose(pose: Pose) -> NDArray[np.float32]:
    """float32 (T, 17, 3): x, y px and confidence of the pictures of which a joint is known."""
    known = np.all(np.isfinite(pose.uv), axis=-1)
    array = np.concatenate([np.where(known[..., None], pose.uv, 0.0), pose.inside[..., None]], axis=-1)
    return array[known.any(axis=1)].astype(np.float32)


def pickled(array: NDArray[Any]) -> bytes:
    """The bytes of a pickle that numpy 1 and 2 both read: neither finds the other's private modules."""
    stream = io.BytesIO()
    pickler = pickle.Pickler(stream, protocol=4)
    pickler.dispatch_table = copyreg.dispatch_table | {np.ndarray: _plain}
    pickler.dump(array)
    return stream.getvalue()


def _plain(array: NDArray[Any]) -> tuple[type, tuple[Any, ...]]:
    # a bytearray, so that what is read can be written to
    return np.ndarray, (array.shape, array.dtype.str, bytearray(np.ascontiguousarray(array).tobytes()))
