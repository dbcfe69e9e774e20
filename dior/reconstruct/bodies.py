"""How tall the subjects of a session are by their joints, in walks in which nobody else can be meant.

INPUTS   placed close cameras; of the walks by which they were placed the detections, everybody in the pictures
         (`detected_people`), the timeline and the seeds
OUTPUTS  `bodies`: the stature of each of these walks' subjects, null where somebody else may be he
By it the subject is told from others in his further walks: the same cameras and the same detector err alike, so that it
tells more than a tape does.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dior.arrays import AnyPath
from dior.body import which_person
from dior.body.people_followed import LONGER_SHARE, UNKNOWN, Size, mean_size
from dior.errors import DiorError
from dior.geometry import camera_tables
from dior.reconstruct import everybody
from dior.reconstruct.timeline import nearest_frames, rate, stamps_of
from dior.tables import tables

# chosen: how far one body's statures by joints are apart from walk to walk beside their scatter, m: a detector errs
# otherwise from another side, as level `real` does (`python -m benchmarks.which_person sizes`)
ACROSS_M = 0.012


@dataclass(frozen=True)
class Walks:
    """What the cameras recorded of the walks, in files named by their sequence.

    `detections`: tables `detections`; `everybody_seen`: tables `detected_people`; `timelines`: tables `timeline`;
    `seeds`: YAML files in which somebody pointed at the subject.
    """

    detections: list[Path]
    everybody_seen: list[Path]
    timelines: list[Path]
    seeds: list[Path]


def run(
    *,
    session: str,
    cameras: list[Path],
    names: list[str],
    subjects: dict[str, str],
    walks: Walks,
    min_score: float,
    out: Path,
) -> None:
    """Write the table `bodies` of a session.

    `names`: the close cameras, whose poses are in the `cameras` tables; `subjects`: the walks, with whose each is.
    """
    rig = camera_tables.read_placed(cameras, names, f"session {session}")
    detected, everybody_seen, timelines, seeds = (
        {path.name.partition(".")[0]: path for path in paths}
        for paths in (walks.detections, walks.everybody_seen, walks.timelines, walks.seeds)
    )
    found = []
    for sequence in subjects:
        line = tables.read(timelines[sequence], "timeline")
        fps = rate(stamps_of(line))
        seen = everybody.at_instants(
            tables.read(detected[sequence], "detections"),
            tables.read(everybody_seen[sequence], "detected_people"),
            line,
            names,
            min_score,
            fps,
        )
        try:
            pointed = everybody.seeds_of(seeds.get(sequence), seen, names, nearest_frames(line, names))
        except DiorError:
            # the walk's own step says what is wrong with its seeds; the others go on
            found.append(UNKNOWN)
        else:
            found.append(which_person.size_of_subject(rig, seen, pointed))
    write(out, subjects, found)


def write(path: AnyPath, subjects: Mapping[str, str], found: Sequence[Size]) -> None:
    """Write `bodies` of walks, each with its subject and the size that was `found`."""
    known = [np.isfinite(one.sigma_m) for one in found]
    tables.write(
        path,
        "bodies",
        {
            "subject": np.array(list(subjects.values()), object),
            "sequence": np.array(list(subjects), object),
            "stature_m": np.where(known, [one.stature_m for one in found], np.nan),
            "sigma_m": np.where(known, [one.sigma_m for one in found], np.nan),
            "longer_m": np.where(known, [one.longer_m for one in found], np.nan),
        },
    )


def of_other_walks(path: AnyPath | None, subject: str, sequence: str) -> Size:
    """The `Size` of a subject as it should be in one walk, by the mean of their others; unknown without any.

    What errors make longer is known by itself in each walk.
    """
    if path is None:
        return UNKNOWN
    table = tables.read(path, "bodies")
    mine = (table["subject"] == subject) & (table["sequence"] != sequence) & np.isfinite(table["sigma_m"])
    rows = zip(*(table[key][mine].tolist() for key in ("stature_m", "sigma_m", "longer_m")), strict=True)
    mean = mean_size([Size(*row) for row in rows])
    sigma = np.sqrt(mean.sigma_m**2 + ACROSS_M**2 + (LONGER_SHARE * mean.longer_m) ** 2)
    return Size(mean.stature_m, float(sigma))
