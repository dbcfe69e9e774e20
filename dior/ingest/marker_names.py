"""Which points of a file with motion capture are which Plug-in-Gait markers.

INPUTS   the labels of the points; the subject's name or prefix; a lab's own names (config/markers.tsv)
OUTPUTS  the place of each marker, and what a person should know of how it was found
A marker of the lab's own that the sheet gives a `joint` is found by that name beside those of Plug-in-Gait.

A marker is, in this order: what the sheet says; a label that is spelled right; one in small letters, as a name of the
sheet may be, too, or with other signs around it; one behind a word and an underscore, as Motive writes the subject
where it is not told to write a colon (docs.optitrack.com, Data Export: C3D, Colon Name Separation); a guess: one label
alone that spells side and marker otherwise, such as L_ASI or Asi-Left.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from dior.arrays import AnyPath
from dior.body.names import HALPE_136, PLUG_IN_GAIT_39, WHOLEBODY_133
from dior.body.spellings import joint_of, words_of
from dior.errors import DiorError
from dior.project import schema_check

SHEET = "config/markers.tsv"
# chosen: a file with fewer labels of the 39 is of another marker set, or of none
FEWEST = 4
# chosen: how many labels a sentence lists
LISTED = 20
# how a marker was found
BY_SHEET, EXACT, ALIKE, BEHIND, GUESSED = range(5)
_SIDES = {"left": "L", "right": "R"}
NOTHING: Mapping[str, str] = {}


@dataclass(frozen=True)
class Found:
    """`place`: index among the labels by marker; `said`: (severity, code, text) about them."""

    place: dict[str, int]
    said: list[tuple[str, str, str]]


def sheet(path: Path, kind: str) -> dict[str, str]:
    """Plug-in-Gait marker, or joint of its own, by a lab's name for it, in files of a `kind` (key in `READERS`).

    Raises DiorError as `read_sheet`, for a row that is neither or both, and for a joint whose name means another place.
    """
    rows, lines = schema_check.read_sheet(path, "markers", ("name", "format"), SHEET)
    for key, row in rows.items():
        _check_row(row, f"{SHEET} line {lines[key]}")
    named: dict[str, str] = {}
    # what is for the format goes before what is for any
    for wanted in ("", kind):
        named |= {name: row["marker"] or row["joint"] for (name, format), row in rows.items() if format == wanted}
    return named


def _check_row(row: Mapping[str, str], where: str) -> None:
    name, joint = row["name"], row["joint"]
    if bool(row["marker"]) == bool(joint):
        raise DiorError(
            f"{where}: '{name}' needs either `marker`, what it is of Plug-in-Gait's, or `joint`, a name of its own"
        )
    side, *rest = words_of(joint) or [""]
    # l5 is a vertebra
    if side in _SIDES and joint.split("_")[0] not in _SIDES and not any(word.isdigit() for word in rest):
        mend = "_".join([side, *rest])
        raise DiorError(f"{where}: the side of the joint '{joint}' of '{name}' comes first, as a word: write {mend}")
    if ":" in name:
        raise DiorError(f"{where}: the name '{name}' is found in no file; leave out what stands up to its colon")
    if joint and (joint_of(joint) or joint in (*HALPE_136, *WHOLEBODY_133) or joint.upper() in PLUG_IN_GAIT_39):
        raise DiorError(
            f"{where}: the joint '{joint}' of '{name}' is one of a detector's, or a marker of Plug-in-Gait, so another "
            "place of the body; give it a name such as left_epicondyle"
        )


def find(
    labels: Sequence[str], path: AnyPath, subject: str = "", prefix: str = "", named: Mapping[str, str] = NOTHING
) -> Found:
    """The markers among the labels. `named`: as of `sheet`.

    A prefix up to a colon is the subject's name. Raises DiorError for a marker given twice, for several subjects of
    whom nobody says which it is, and for too few markers.
    """
    parts = [_parts(label, prefix) for label in labels]
    ranked: dict[str, dict[int, list[int]]] = {}
    for i, (_, word) in enumerate(parts):
        found = _read(word, named)
        if not found and not prefix and (split := _behind(word, named)):
            parts[i], found = split, (named.get(split[1], split[1]), BEHIND)
        if found:
            marker, rank = found
            ranked.setdefault(marker, {}).setdefault(rank, []).append(i)
    best = {marker: min(ranks) for marker, ranks in ranked.items()}
    places = {marker: ranks[best[marker]] for marker, ranks in ranked.items()}
    sure = {marker: there for marker, there in places.items() if best[marker] != GUESSED}
    if any(len({parts[i][0] for i in there}) > 1 for there in (sure or places).values()):
        chosen = _chosen({parts[i][0] for there in places.values() for i in there}, path, subject)
        places = {marker: [i for i in there if parts[i][0] == chosen] for marker, there in places.items()}
    place = {}
    for marker, there in places.items():
        if len(there) > 1 and best[marker] != GUESSED:
            points = " and ".join(f"{i + 1} ('{parts[i][1]}')" for i in there)
            raise DiorError(
                f"{path}: the points {points} are all the marker {marker}; name or delete them so that one is left, "
                "and export it again"
            )
        if len(there) == 1:
            place[marker] = there[0]
    known = sum(marker in PLUG_IN_GAIT_39 for marker in place)
    if known < FEWEST:
        more = f" and {len(labels) - LISTED} more" if len(labels) > LISTED else ""
        behind = " behind the prefix that `mocap.prefix` in session.yaml gives" if prefix else ""
        words = [label.rpartition(":")[2].strip() for label in labels]
        raise DiorError(
            f"{path}: {known} of the {len(PLUG_IN_GAIT_39)} Plug-in-Gait markers are there{behind}, and fewer "
            f"than {FEWEST} are no such marker set; its labels are {', '.join(words[:LISTED]) or 'none'}{more}. "
            f"Were they labelled before the export? If they have names of your lab's, list them in {SHEET}"
        )
    return Found(place, _said(place, {marker: parts[i][1] for marker, i in place.items()}, best, named))


def _said(
    place: dict[str, int], words: dict[str, str], best: dict[str, int], named: Mapping[str, str]
) -> list[tuple[str, str, str]]:
    said = []
    by_sheet = [marker for marker in place if best[marker] == BY_SHEET or marker not in PLUG_IN_GAIT_39]
    if named:
        text = f"{len(by_sheet)} of {len(place)} markers have the names that {SHEET} gives them"
        if own := [marker for marker in by_sheet if marker not in PLUG_IN_GAIT_39]:
            text += f", of which Plug-in-Gait does not have {', '.join(own)}"
        if gone := sorted({*named.values()} - {*PLUG_IN_GAIT_39, *place}):
            text += f"; {', '.join(gone)} of that sheet it has not"
        said.append(("info", "markers_by_sheet", text))
    if guessed := [f"{words[marker]} for {marker}" for marker in place if best[marker] == GUESSED]:
        text = f"by their spelling alone are taken {', '.join(guessed)}; look, and list them in {SHEET}"
        said.append(("warning", "markers_guessed", text))
    return said


def _read(word: str, named: Mapping[str, str]) -> tuple[str, int] | None:
    """The marker that a word may be, and how well it says so."""
    if word in named:
        return named[word], BY_SHEET
    marker = word.strip(" .*_-'\"\0").upper()
    if marker in PLUG_IN_GAIT_39:
        return marker, EXACT if marker == word else ALIKE
    alike = [name for name in named if name.lower() == word.lower()]
    if len(alike) == 1:
        return named[alike[0]], ALIKE
    words = words_of(word)
    spelled = (_SIDES.get(words[0], words[0]) + "".join(words[1:])).upper() if words else ""
    return (spelled, GUESSED) if spelled in PLUG_IN_GAIT_39 else None


def _behind(word: str, named: Mapping[str, str]) -> tuple[str, str] | None:
    """A word split at one of its underscores, if what follows that is a marker's name."""
    pieces = word.split("_")
    splits = (("_".join(pieces[:at]), "_".join(pieces[at:])) for at in range(1, len(pieces)))
    return next(
        ((before, name) for before, name in splits if before and (name in named or name in PLUG_IN_GAIT_39)), None
    )


def _parts(label: str, prefix: str) -> tuple[str, str]:
    """The prefix of a label and what follows; nothing follows where `prefix` is given and the label has another."""
    if not prefix:
        before, _, word = label.rpartition(":")
        return before.strip(), word.strip()
    return (prefix, label[len(prefix) :].lstrip(":_ ").strip()) if label.startswith(prefix) else ("", "")


def _chosen(given: set[str], path: AnyPath, subject: str) -> str:
    """The prefix that is the subject's name, where several have the same markers."""
    same = [prefix for prefix in given if prefix.lower() == subject.lower()]
    if subject and len(same) == 1:
        return same[0]
    # a prefix is often a name, which no log may keep
    raise DiorError(
        f"{path}: its labels are of {len(given)} subjects, with as many prefixes; set "
        "`mocap: {prefix: {<subject>: <prefix>}}` in session.yaml, with what stands before the colon of the labels"
    )
