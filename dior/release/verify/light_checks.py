"""What a red light says is wrong must have no place in a release, unless it says who accepted it.

INPUTS   a `Walk`, an `Evidence` (evidence.py). OUTPUTS: problems as (path, sentence)
`lights.parquet` has what was red when the release was made. Of these the labels are looked at again. The figures of
metrics.csv are judged anew, so that a row that was left out is found; a finding, such as a camera that does not belong
to the others, is not in a release but for its row.
"""

from collections.abc import Iterator

import numpy as np

from dior.release.suspect import NO_PLACE, STAYS, told
from dior.release.verify import figures, texts, walk_checks
from dior.release.verify.evidence import Evidence, Walk
from dior.release.verify.walk_checks import PARTS, Problem
from dior.report import red_labels

PATH = "lights.parquet"
KEY = {"labels_2d": "frame", "skeletons_3d": "instant"}


def check(walk: Walk) -> list[Problem]:
    """Labels and 3D that are there, although a red light says that they are wrong, and nobody accepts it."""
    places = [("labels_2d", name) for name in sorted(walk.of("labels_2d")) if walk.rig.suspect(walk.sequence, name)]
    places += [("skeletons_3d", "")] if walk.rig.suspect(walk.sequence) else []
    found = []
    for kind, name in places:
        path, where = walk.path(kind, name), (KEY[kind], "joint")
        numbers = [key for key in NO_PLACE[kind] if key != "source"]
        table, _ = walk_checks.read(walk.files[path], PARTS[kind], (*where, "status", *numbers))
        there = np.any([np.isfinite(table[key]) for key in numbers], axis=0) | ~np.isin(table["status"], STAYS[kind])
        what = f"rows have a place although {PATH} says that it is wrong, and that nobody accepts it"
        found += [(path, text) for text in walk_checks.first(there, what, table, where)]
    return found


def of_release(release: Evidence) -> list[Problem]:
    """Figures that are red of what `lights.parquet` does not tell, and what the card and provenance.json tell of it."""
    return [*_left_out(release), *_told(release)]


def _left_out(release: Evidence) -> Iterator[Problem]:
    try:
        rows = list(figures.read(release.files[figures.PATH].read()))
    except ValueError:
        # figures.check says so
        return
    named = {(light.sequence, light.camera) for light in release.rig.lights}
    table = {
        key: np.array([row[key] for row in rows], object)
        for key in ("sequence", "camera", "joint", "tool", "metric", "value")
    }
    measured = red_labels.by_camera(table)
    for walk in release.walks:
        session, outdoor = release.rig.session[walk.sequence], release.rig.environment[walk.sequence] != "indoor"
        own = {name: one for (of, name), one in release.rig.cameras.items() if of == session and one is not None}
        cameras = {
            name: red_labels.Judged(one.intrinsics.fx, measured.get((walk.sequence, name), {}))
            for name, one in own.items()
        }
        makers = [name for name, one in own.items() if outdoor and one.role == "close"]
        for red in red_labels.of_walk(walk.sequence, session, cameras, makers):
            if (walk.sequence, red.camera) not in named:
                where = f"camera {red.camera} of {walk.sequence}" if red.camera else f"all cameras of {walk.sequence}"
                yield PATH, f"does not tell of {where}, although the figures are red: {red.reason}"


def _told(release: Evidence) -> Iterator[Problem]:
    accepted = told(release.rig.lights)
    for name, about in sorted(release.provenance.get("sequences", {}).items()):
        if about.get("accepted", {}) != accepted.get(name, {}):
            yield "provenance.json", f"tells of another acceptance of {name} than {PATH}"
    card = texts.plain(release.files["README.md"].read().decode("utf-8", "replace"))
    # in the card it is one line, in which what Markdown would take for its own has a backslash
    for light in release.rig.lights:
        for words in filter(None, (light.reason, light.accepted)):
            if " ".join(words.split()).replace("\\", "") not in card:
                where = " ".join(filter(None, (light.sequence, light.camera)))
                yield "README.md", f"does not tell of {where} what {PATH} does: {words}"
