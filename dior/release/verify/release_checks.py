"""What must hold in the files about the whole release: its tables, its splits, its card.

INPUTS   the `File`s at the top of a release (folder_or_tarball.py), the paths of all its files, and for the card what
         was found in its walks (walk_checks.py). OUTPUTS: problems as (path, sentence)
"""

import csv
import io
import json
import re
from collections import Counter
from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from dior.arrays import Table
from dior.errors import nearest
from dior.release import crate
from dior.release.verify import walk_checks
from dior.release.verify.folder_or_tarball import File
from dior.release.verify.walk_checks import PARTS, Broken, Problem, WalkFindings
from dior.tables import tables

if TYPE_CHECKING:
    from dior.release.verify.evidence import Evidence

LABELS = re.compile(r"labels_2d/([^/]+)/([^./]+)\.([^/]+)\.parquet")
# (subject, sequence, camera)
Recording: TypeAlias = tuple[str, str, str]
REQUIRED = (
    "CITATION.cff", "LICENSE", "README.md", "cameras.parquet", "clocks.parquet", "croissant.json", "metrics.csv",
    "provenance.json", "sequences.parquet", "splits.parquet", "subjects.parquet",
)  # fmt: skip
# what no row of a table may be there twice by
KEYS = {
    "cameras": ("session", "camera"),
    "camera_covariance": ("session", "camera", "other"),
    "clocks": ("sequence", "camera"),
    "lights": ("sequence", "camera"),
    "sequences": ("sequence",),
    "subjects": ("subject",),
    "splits": ("split", "subject", "sequence", "camera"),
}
# splits in which a person may be in one part only
OF_PEOPLE = ("subject",)
CARD_HEADER = "| environment | camera | role | sequences | frames | labels in the picture | share of all |"
COUNTED = ("camera_recordings", "frames", "keypoints_2d")


def about(
    files: dict[str, File], names: Collection[str], listed: dict[str, str]
) -> tuple[dict[str, Table], list[Problem]]:
    """(tables by name, problems) of the files at the top of a release.

    `files`: by path, those whose checksum is right; `names`: paths of all files that the release has; `listed`: their
    SHA-256.
    """
    problems = [(name, "is missing; a release has it") for name in REQUIRED if name not in names]
    found = {}
    for path, file in sorted(files.items()):
        if not path.endswith(".parquet"):
            continue
        name = path.removesuffix(".parquet")
        try:
            if name not in PARTS or PARTS[name].path != path:
                raise Broken(f"is a table that a release does not have{nearest(name, PARTS)}")
            found[name], words = walk_checks.read(file, PARTS[name])
            sentences = walk_checks.unknown_words(words, PARTS[name].table) + _twice(found[name], KEYS.get(name))
            problems += [(path, text) for text in sentences]
        except Broken as error:
            problems.append((path, str(error)))
    problems += _references(found, _recordings(names))
    problems += _covariances(found)
    if "cameras" in found:
        problems += [("cameras.parquet", text) for text in _poses(found["cameras"])]
    if "clocks" in found:
        problems += [("clocks.parquet", text) for text in _clocks(found["clocks"], _recordings(names))]
    if "lights" in found:
        problems += [("lights.parquet", text) for text in _lights(found["lights"], _recordings(names))]
    if "splits" in found:
        problems += [("splits.parquet", text) for text in _splits(found["splits"], _recordings(names))]
    if "metrics.csv" in files:
        problems += [("metrics.csv", text) for text in _metrics(files["metrics.csv"], found)]
    for path in ("croissant.json", "provenance.json", crate.FILE):
        if path in files:
            problems += [(path, text) for text in _json(files[path], listed)]
    return found, problems


def _recordings(names: Collection[str]) -> list[Recording]:
    """(subject, sequence, camera) of every labels file."""
    matches = (LABELS.fullmatch(name) for name in names)
    return sorted((match[1], match[2], match[3]) for match in matches if match)


def _twice(table: Table, keys: Sequence[str] | None) -> list[str]:
    if not keys:
        return []
    rows = Counter(zip(*(table[key].tolist() for key in keys), strict=True))
    return [f"{' '.join(key)} is there {n} times" for key, n in sorted(rows.items()) if n > 1]


def _references(found: dict[str, Table], recordings: list[Recording]) -> list[Problem]:
    """What a table names must be in the table of such things, and nothing may be there that nothing names."""
    problems: list[Problem] = []

    def compare(path: str, what: str, named: set[Any], known: set[Any], where: str) -> None:
        problems.extend((path, f"{what} '{_shown(one)}' is not in {where}") for one in sorted(named - known))

    people = set(found["subjects"]["subject"]) if "subjects" in found else None
    walks = found.get("sequences")
    recorded = {(who, sequence) for who, sequence, _ in recordings}
    if people is not None:
        compare("subjects.parquet", "subject", people, {who for who, _ in recorded}, "labels_2d/")
        compare("labels_2d/", "subject", {who for who, _ in recorded}, people, "subjects.parquet")
        for name in sorted({"sequences", "gallery"} & set(found)):
            compare(f"{name}.parquet", "subject", set(found[name]["subject"]), people, "subjects.parquet")
    if walks is None:
        return problems
    shown = set(zip(walks["subject"], walks["sequence"], strict=True))
    compare("sequences.parquet", "sequence", shown, recorded, "labels_2d/")
    compare("labels_2d/", "sequence", recorded, shown, "sequences.parquet")
    if "cameras" in found:
        session = dict(zip(walks["sequence"], walks["session"], strict=True))
        rig = set(zip(found["cameras"]["session"], found["cameras"]["camera"], strict=True))
        used = {(session[sequence], camera) for _, sequence, camera in recordings if sequence in session}
        compare("labels_2d/", "session and camera", used, rig, "cameras.parquet")
    return problems


def _shown(one: str | tuple[str, ...]) -> str:
    return one if isinstance(one, str) else " ".join(one)


def _covariances(found: dict[str, Table]) -> list[Problem]:
    """Pairs of cameras must be of cameras that there are."""
    if not {"cameras", "camera_covariance"} <= set(found):
        return []
    rig, pairs = found["cameras"], found["camera_covariance"]
    known = set(zip(rig["session"], rig["camera"], strict=True))
    named = {
        (session, camera)
        for column in ("camera", "other")
        for session, camera in zip(pairs["session"], pairs[column], strict=True)
    }
    return [
        ("camera_covariance.parquet", f"session and camera '{_shown(one)}' is not in cameras.parquet")
        for one in sorted(named - known)
    ]


def _clocks(table: Table, recordings: list[Recording]) -> list[str]:
    """Each recording has a clock, and nothing else has."""
    named = set(zip(*(table[key].tolist() for key in ("subject", "sequence", "camera")), strict=True))
    sentences = [f"recording '{_shown(one)}' is not in labels_2d/" for one in sorted(named - set(recordings))]
    return sentences + [f"recording '{_shown(one)}' has no clock" for one in sorted(set(recordings) - named)]


def _lights(table: Table, recordings: list[Recording]) -> list[str]:
    """Each is about a recording, or about a walk, and says why."""
    known = {*recordings, *((who, sequence, "") for who, sequence, _ in recordings)}
    rows = zip(*(table[key].tolist() for key in ("subject", "sequence", "camera", "reason")), strict=True)
    return [
        f"recording '{_shown(tuple(filter(None, row[:3])))}' is not in labels_2d/"
        for row in rows
        if row[:3] not in known
    ]


def _splits(table: Table, recordings: list[Recording]) -> list[str]:
    """Each recording is in the split by subject once, nothing else is in any, and no person is in two of its parts."""
    known = set(recordings)
    rows = list(zip(*(table[key].tolist() for key in ("split", "part", "subject", "sequence", "camera")), strict=True))
    sentences = [f"recording '{' '.join(row[2:])}' is not in labels_2d/" for row in rows if row[2:] not in known]
    for split in OF_PEOPLE:
        mine = [row for row in rows if row[0] == split]
        sentences += [
            f"recording '{' '.join(one)}' is in no part by {split}" for one in sorted(known - {r[2:] for r in mine})
        ]
        parts: dict[str, set[str]] = {}
        for _, part, who, *_ in mine:
            parts.setdefault(who, set()).add(part)
        sentences += [
            f"subject '{who}' is in {' and '.join(sorted(several))} by {split}"
            for who, several in sorted(parts.items())
            if len(several) > 1
        ]
    return sentences


def _metrics(file: File, found: dict[str, Table]) -> list[str]:
    """The figures' columns, and whom they are about."""
    rows = csv.DictReader(io.StringIO(file.read().decode("utf-8", "replace")))
    if list(rows.fieldnames or ()) != tables.columns_of("metrics"):
        return [f"has the columns {', '.join(rows.fieldnames or ())}, not {', '.join(tables.columns_of('metrics'))}"]
    known = {
        column: set(found[name][column]) | {""}
        for column, name in (("subject", "subjects"), ("sequence", "sequences"), ("camera", "cameras"))
        if name in found
    }
    unknown = sorted({(column, row[column]) for row in rows for column in known if row[column] not in known[column]})
    return [f"{column} '{word}' is not in {column}s.parquet" for column, word in unknown]


def _json(file: File, listed: dict[str, str]) -> list[str]:
    """Whether it is JSON at all, and whether the checksums in it are those of SHA256SUMS."""
    try:
        content = json.loads(file.read())
        described = (*content.get("distribution", ()), *content.get("@graph", ()))
        files = [(one.get("contentUrl") or one["@id"], one["sha256"]) for one in described if "sha256" in one]
        return [f"has another SHA-256 of {name} than SHA256SUMS" for name, sha in files if listed.get(name) != sha]
    except (ValueError, AttributeError, TypeError, KeyError) as error:
        return [f"is not the JSON that dior writes ({error})"]


def _poses(table: Table) -> list[str]:
    """Cameras whose pose is no rotation and translation."""
    wTc = table["wTc"].reshape(-1, 4, 4)
    known = np.all(np.isfinite(wTc), axis=(1, 2))
    R = np.where(known[:, None, None], wTc[:, :3, :3], np.eye(3))
    rotated = np.abs(R @ R.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2)) < 1e-6
    whole = (np.abs(wTc[:, 3] - [0, 0, 0, 1]) < 1e-9).all(axis=1) | ~known
    return [
        f"session and camera '{session} {camera}' has a pose that is no rotation and translation"
        for session, camera, good in zip(
            table["session"], table["camera"], rotated & (np.linalg.det(R) > 0) & whole, strict=True
        )
        if not good
    ]


def sizes(walks: Sequence[WalkFindings], found: dict[str, Table]) -> list[Problem]:
    """Pictures must have the size that their camera's intrinsics are for."""
    if not {"cameras", "sequences"} <= set(found):
        return []
    rig, sheet = found["cameras"], found["sequences"]
    session = dict(zip(sheet["sequence"], sheet["session"], strict=True))
    size = {
        (rig["session"][i], rig["camera"][i]): (int(rig["height"][i]), int(rig["width"][i]))
        for i in range(len(rig["camera"]))
    }
    problems = []
    for walk in walks:
        for camera, (path, there) in sorted(walk.sizes.items()):
            expected = size.get((session.get(walk.sequence), camera))
            if expected is None:
                continue
            for height, width in sorted(there - {expected}):
                problems.append((path, f"{width}x{height} px where cameras.parquet says {expected[1]}x{expected[0]}"))
    return problems


def card(release: "Evidence") -> list[Problem]:
    """The counts that the card states must be those of the tables."""
    text = release.files["README.md"].read().decode("utf-8", "replace")
    if CARD_HEADER not in text:
        return [("README.md", f"has no table '{CARD_HEADER}'")]
    lines = text.split(CARD_HEADER)[1].split("\n\n")[0].splitlines()[2:]
    stated = {tuple(cells[:3]): tuple(cells[3:6]) for cells in (_cells(line) for line in lines)}
    counted = {
        where: tuple(str(n[what]) for what in COUNTED) for where, n in _by_camera(release.walks, release.tables).items()
    }
    return [
        (
            "README.md",
            f"states {_counts(stated, where)} for {' '.join(where)}; the tables have {_counts(counted, where)}",
        )
        for where in sorted(stated.keys() | counted.keys())
        if stated.get(where) != counted.get(where)
    ]


def _cells(line: str) -> list[str]:
    return [cell.strip() for cell in line.strip("|").split("|")]


def _counts(table: dict[tuple[str, ...], tuple[str, ...]], where: tuple[str, ...]) -> str:
    if where not in table:
        return "nothing"
    return "{} recordings, {} frames and {} labels".format(*table[where])


def _by_camera(walks: Sequence[WalkFindings], found: dict[str, Table]) -> dict[tuple[str, ...], Counter[str]]:
    """Counts by (environment, camera, role), as the card words them."""
    sheet, rig = found["sequences"], found["cameras"]
    place = {name: (sheet["environment"][i], sheet["session"][i]) for i, name in enumerate(sheet["sequence"])}
    role = {(rig["session"][i], name): rig["role"][i].replace("_", "-") for i, name in enumerate(rig["camera"])}
    total: dict[tuple[str, ...], Counter[str]] = {}
    for walk in walks:
        environment, session = place.get(walk.sequence, ("", ""))
        for camera, counts in walk.counts.items():
            if camera:
                key = (environment, camera, role.get((session, camera), ""))
                total[key] = total.get(key, Counter()) + counts
    return total
