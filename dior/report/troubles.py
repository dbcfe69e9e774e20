"""What is wrong with a camera of a session, cause by cause, and what to type in which file.

INPUTS   the lights of its recordings (codes and sentences), what its YAML says, how far labels lie beside hand boxes
OUTPUT   `Trouble`s: one for each cause, with the faults that follow from it below it, and a `Fix`

One cause makes many faults: a camera that is turned moves labels out of boxes, which takes its clock away; a camera
that does not belong to the others draws the 3D of all of them aside. EXPLAINS says what follows from what.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from dior.errors import many
from dior.geometry import culprit
from dior.geometry.camera import Camera
from dior.project import bumps
from dior.report import beside_boxes, lights

# what is seen where labels are drawn aside, whatever did it
ASIDE = frozenset({
    "reprojection_error", "check_error", "error_to_truth_2d", "in_box_lacking", "in_box_share", "beside_boxes",
    "high_error", "swapped_share", "in_picture_share", "clock_unknown", "clock_off", "align_disagrees",
    lights.BESIDE_CULPRIT,
})  # fmt: skip
WORLD = frozenset({
    "world_scale", "world_bones", "world_left_handed", "world_axes", "world_floor", "world_vertical", "world_speed",
})  # fmt: skip
EVERYTHING = frozenset({"*"})
# of a whole walk -> what its cameras lack by it
OF_WALK: Mapping[str, frozenset[str]] = dict.fromkeys(
    ("who_is_subject", "somebody_else"), frozenset({"coverage", "missing_3d", "clock_unknown"})
)
# cause -> what follows from it, the first causes first; of two that are there the first is the cause
EXPLAINS: Mapping[str, frozenset[str]] = {
    "sequence_failed": EVERYTHING,
    "camera_missing": EVERYTHING,
    **OF_WALK,
    **dict.fromkeys(
        culprit.CODES,
        ASIDE | WORLD | {"clock_contradicts", "camera_bumped", "camera_turned", "mark_error", "coverage", "missing_3d"},
    ),
    "clock_jump": ASIDE | {"clock_contradicts", "camera_bumped"},
    # in a walk of the adjustment it turns all cameras, in another it turns its own: either way walk differs from walk
    "clock_contradicts": ASIDE | {"camera_bumped"},
    "camera_bumped": ASIDE | WORLD,
    lights.BESIDE_CULPRIT: ASIDE | WORLD | {"coverage"},
    "camera_rolled": ASIDE,
    "frame_suspect": ASIDE | {"mark_error", "mark_rejected", "pose_uncertain", "camera_turned"},
    "mark_error": ASIDE | {"mark_rejected", "mark_suspect", "pose_uncertain", "camera_turned"},
    # marks of other frames turn the camera that they place
    "marks_clock": ASIDE | {"camera_turned", "mark_rejected", "mark_suspect", "pose_uncertain"},
    "camera_turned": ASIDE | {"mark_rejected", "mark_suspect"},
    "in_picture_share": ASIDE,
    "beside_boxes": ASIDE,
    "in_box_lacking": ASIDE,
    "in_box_share": ASIDE,
    # the recorder's own finding, and the share that the light is by
    "pictures_lost": frozenset({"lost_pictures"}),
    "high_error": frozenset({"reprojection_error"}),
    "reprojection_error": frozenset({"error_to_truth_2d", "high_error"}),
    "check_error": frozenset({"error_to_truth_2d"}),
}
# what is wrong with one camera and draws what is made of all of them
DRAWS_ALL = frozenset({*culprit.CODES, *OF_WALK, "clock_contradicts", "clock_jump", "camera_bumped"})
# of these, what follows from another camera's: elsewhere two of them are two causes
DRAWN = {"clock_contradicts": "camera_bumped", "clock_jump": "camera_bumped"}
# what `calibrate.clocks` asks of marks a picture before the detections
FROM_ONE = "marks.csv count from 1"
# what no file of the project mends, or one that the sentence names: how it was recorded, and what says that, not why
WITHOUT_FILE = frozenset({
    "pictures_lost", "lost_pictures", "same_stamp", "same_picture", "subject_left_out", "error_to_truth_2d",
    "clock_unknown",
})  # fmt: skip
# the other camera that may have been bumped as well (`dior.evaluate.moved`)
OR_ANOTHER = re.compile(r"\(or (\S+): that explains")
# a file of the project in a sentence
FILE = re.compile(r"config/[\w./@<>{}-]*\.\w+")
# what to type in it, as a sentence gives it
SUCH_AS = re.compile(rf"(?:, or)? in ({FILE.pattern}), such as `([^`]+)`")
MANY_BOXES = 20  # chosen: that the light is sure of labels which are 2 px off (docs/figures.md)


@dataclass(frozen=True)
class Fix:
    """What to type: `file` of the project, "" where it is a command, where `at` in it, `what` to write there, "" where
    the sentence says it, and what it brings; `literal`: `what` is typed as it stands, else it says what to do."""

    file: str
    what: str = ""
    gain: str = ""
    at: str = ""
    literal: bool = False


@dataclass(frozen=True)
class Trouble:
    """A cause: how bad (one of `lights.LEVELS`), its code, what is wrong in a sentence, in which sequences, what to
    type, and the other faults that follow from it, (where, sentence); `also`: what else is to be typed; `alike`: the
    same in other sequences, where it says other figures, and `of` then the sequence of the sentence."""

    level: str
    code: str
    text: str
    sequences: tuple[str, ...]
    fix: Fix | None = None
    follows: tuple[tuple[str, str], ...] = ()
    also: tuple[Fix, ...] = ()
    alike: tuple[tuple[str, str], ...] = ()
    of: str = ""


@dataclass(frozen=True)
class Recording:
    """A camera of a sequence, as far as its troubles go; `camera` is "" for what is about the whole walk."""

    sequence: str
    camera: str
    faults: tuple[tuple[str, str, str], ...]
    offset: beside_boxes.Offset | None = None


@dataclass(frozen=True)
class Setting:
    """Of a camera: its file, what it says, and where it stands, if that is known; `aligned`: the walks that cameras of
    the session are aligned to, where they list them, by file."""

    file: str
    says: Mapping[str, Any] = field(default_factory=dict)
    camera: Camera | None = None
    aligned: Mapping[str, Sequence[str]] = field(default_factory=dict)


def of_camera(recordings: Sequence[Recording], setting: Setting) -> list[Trouble]:
    """The `Trouble`s of a camera of a session, the worst first, from those of its recordings that have faults."""
    heads: dict[str, list[tuple[Recording, str, str, list[tuple[str, str]]]]] = {}
    for recording in recordings:
        for level, code, text, follows in causes(recording):
            heads.setdefault(code, []).append((recording, level, text, follows))
    found = []
    for code, each in heads.items():
        names = tuple(dict.fromkeys(recording.sequence for recording, *_ in each))
        level = lights.worst(level for _, level, _, _ in each)
        of, text = next((one.sequence, text) for one, own, text, _ in each if own == level)
        below = tuple(dict.fromkeys((one.sequence, text) for one, _, _, own in each for _, text in own))
        others = [(one.sequence, other) for one, _, other, _ in each if other != text]
        alike = tuple(one for one in others if one[0] != of)
        below = (*(one for one in others if one[0] == of), *below)
        told = Trouble(level, code, text, names, follows=below, alike=alike, of=of if alike else "")
        found.append(_with_fix(told, recordings, setting))
    return sorted(found, key=lambda one: -lights.LEVELS.index(one.level))


def causes(recording: Recording) -> list[tuple[str, str, str, list[tuple[str, str]]]]:
    """(level, code, sentence, [(code, sentence) of what follows]) of each cause among the faults of a recording."""
    rank = {code: i for i, code in enumerate(EXPLAINS)}
    ordered = sorted(dict.fromkeys(recording.faults), key=lambda fault: rank.get(fault[1], len(rank)))
    found: list[tuple[str, str, str, list[tuple[str, str]]]] = []
    for level, code, text in ordered:
        at = next((i for i, one in enumerate(found) if explains(one[1], code)), None)
        if at is None:
            found.append((level, code, text, []))
        else:
            # a cause is as bad as what follows from it
            worse, cause, why, follows = found[at]
            found[at] = lights.worst((worse, level)), cause, why, [*follows, (code, text)]
    return found


def across(by_camera: Mapping[str, Sequence[Trouble]], adjusted: Iterable[str]) -> dict[str, tuple[Trouble, ...]]:
    """The `Trouble`s of the cameras of a session, "" for whole walks, those of one that follow from another's below it.

    A camera with a wrong clock or place in a walk that the session is `adjusted` with draws the poses of all of them
    aside; one that does not belong to the others draws the 3D of its walk aside.
    """
    window = set(adjusted)
    found = {camera: list(own) for camera, own in by_camera.items()}
    causes_of_all = [(camera, one) for camera, own in by_camera.items() for one in own if one.code in DRAWS_ALL]
    for camera, cause in sorted(causes_of_all, key=lambda each: list(EXPLAINS).index(each[1].code)):
        if cause not in found[camera]:
            continue  # it follows from another one
        poses = cause.code not in OF_WALK and window & set(cause.sequences)
        reach = None if poses else set(cause.sequences)
        own = [one for one in found[camera] if one.code == DRAWN.get(cause.code)]
        found[camera] = [one for one in found[camera] if one not in own]
        follows = [(", ".join(one.sequences), one.text) for one in own]
        level = lights.worst((cause.level, *(one.level for one in own)))
        for other, theirs in found.items():
            if other == camera:
                continue
            for i, one in enumerate(theirs):
                # a turn is told by comparing all walks of the session
                drawn = DRAWN.get(cause.code) == one.code
                within = drawn or reach is None or set(one.sequences) <= reach
                if (one.code in DRAWS_ALL and not drawn) or not within or not explains(cause.code, one.code):
                    continue
                level = lights.worst((level, one.level))
                if one.code != lights.BESIDE_CULPRIT:
                    for place, why in ((", ".join(one.sequences), one.text), *one.alike, *one.follows):
                        # what followed from that camera's own has another's name already
                        named = bool(found.keys() & set(place.split()))
                        follows.append((place if named else f"{place} {other}".strip(), why))
                text = f"this follows from {camera or 'the whole walk'}, which is to be mended first"
                theirs[i] = Trouble(one.level, lights.BESIDE_CULPRIT, text, one.sequences)
        at = found[camera].index(cause)
        found[camera][at] = replace(cause, level=level, follows=tuple(dict.fromkeys((*cause.follows, *follows))))
    return {camera: _once(own) for camera, own in found.items()}


def _once(own: Iterable[Trouble]) -> tuple[Trouble, ...]:
    """Those that follow from another camera as one for each sentence."""
    found: dict[tuple[str, str], Trouble] = {}
    for one in own:
        key = one.code, one.text
        there = found.get(key)
        names = tuple(dict.fromkeys((*(there.sequences if there else ()), *one.sequences)))
        level = lights.worst((one.level, there.level)) if there else one.level
        found[key] = replace(one, sequences=names, level=level)
    return tuple(found.values())


def explains(cause: str, code: str) -> bool:
    """Whether a fault follows from a cause."""
    of_cause = EXPLAINS.get(cause, frozenset())
    return cause != code and (code in of_cause or "*" in of_cause)


def _with_fix(trouble: Trouble, recordings: Sequence[Recording], setting: Setting) -> Trouble:
    """The trouble with what to type: for labels beside the boxes what is measured of all recordings."""
    own = [one for one in recordings if one.sequence in trouble.sequences]
    offsets = [one.offset for one in own if one.offset is not None and any(one.offset.told)]
    if trouble.code in ("beside_boxes", "in_box_lacking", "in_box_share") and offsets:
        offset = beside_boxes.together(offsets)
        if offset and any(offset.told) and (len(offsets) == 1 or beside_boxes.alike(offsets)):
            each = ((trouble.of or own[0].sequence, trouble.text), *trouble.alike)
            follows = (*each, *trouble.follows)
            side = beside_boxes.words(offset)
            of = "" if side.endswith(("above", "below")) else " of"
            text = f"the labels lie {side}{of} the hand boxes"
            trouble = replace(trouble, text=text, follows=follows, alike=(), of="")
            return replace(trouble, fix=_nudged(offset, setting, f"{own[0].sequence}.{own[0].camera}"))
    if trouble.code == lights.UNCHECKED:
        [first, *_] = trouble.sequences
        what = (
            f"{MANY_BOXES} boxes or more; `dior run <this project> to_mark` chooses pictures and writes rows to fill in"
        )
        return replace(trouble, fix=Fix(f"config/boxes/{first}.{own[0].camera}.csv", what, "tells how good they are"))
    if trouble.code == lights.BESIDE_CULPRIT or trouble.code in WITHOUT_FILE:
        return trouble
    if trouble.code == "clock_contradicts":
        fixes = [
            Fix(f"config/offsets/{one.sequence}.yaml", f"remove the line of {one.camera}", "the recording tells it")
            for one in own
        ]
        return replace(trouble, fix=fixes[0], also=tuple(fixes[1:]))
    if trouble.code == "camera_turned":
        return _turned(trouble, recordings, setting)
    if trouble.code == "marks_clock" and FROM_ONE in trouble.text:
        return replace(
            trouble, fix=Fix(_marks(setting), "subtract 1 from every frame", "the pose and the clock by them")
        )
    if given := SUCH_AS.search(trouble.text):
        text = trouble.text[: given.start()]
        return replace(
            trouble, text=text, fix=Fix(given[1], given[2], trouble.text[given.end() :].strip(), literal=True)
        )
    named = FILE.search(trouble.text)
    file = named[0] if named else setting.file
    if trouble.code == "camera_bumped" and bumps.MARK in file:
        return _bumped(trouble, setting, file.removesuffix(".yaml").partition(bumps.MARK)[2])
    return replace(trouble, fix=Fix(file)) if file else trouble


def _turned(trouble: Trouble, recordings: Sequence[Recording], setting: Setting) -> Trouble:
    """The trouble with what to type where a camera's pose is off in all of its walks, or from one of them on."""
    names = [one.sequence for one in recordings]
    first = len(names) - len(trouble.sequences)
    if first > 0 and tuple(names[first:]) == trouble.sequences:
        return _bumped(trouble, setting, names[first])
    if setting.says.get("locate") != "marks":
        return replace(trouble, fix=Fix(setting.file))
    what = "mark the frames again, each picture at its full size"
    why = "that marks fit each other is no proof: marks that are off alike give a pose that is off"
    return replace(trouble, fix=Fix(_marks(setting), what, why))


def _marks(setting: Setting) -> str:
    """The file of a camera's marks, beside its own."""
    return setting.file.removesuffix(".yaml") + ".marks.csv"


def _bumped(trouble: Trouble, setting: Setting, first: str) -> Trouble:
    """The trouble with what to type where a camera stands elsewhere from the sequence `first` on."""
    stem = setting.file.removesuffix(".yaml").partition(bumps.MARK)[0]
    folder = stem.rpartition("/")[0]
    own = f"{stem}{bumps.MARK}{first}"
    gain = f"from {first} on the camera has a pose of its own"
    if other := OR_ANOTHER.search(trouble.text):
        gain += f"; if that does not mend it, take these lines back and do the same for {other[1]}"
    copied = Fix("", f"cp {stem}.yaml {own}.yaml", gain, literal=True)
    if setting.says.get("locate") == "marks":
        return replace(
            trouble, fix=copied, also=(Fix(f"{own}.marks.csv", f"10-20 markers on each of 3 pictures of {first}"),)
        )
    gain = "the cameras are adjusted anew with this walk"
    window = Fix(f"{folder}/session.yaml", f"  {first}: {{}}", gain, "in a line more below adjust:", literal=True)
    lacking = [file for file, listed in setting.aligned.items() if first not in listed]
    lacking = [f"{own}.yaml" if file == f"{stem}.yaml" else file for file in lacking]
    gain = "it is aligned to the 3D, which the pose of the other changes"
    aligned = [Fix(file, first, gain, "as one more of the sequences of align:", literal=True) for file in lacking]
    return replace(trouble, fix=copied, also=(window, *aligned))


def _nudged(offset: beside_boxes.Offset, setting: Setting, recording: str) -> Fix:
    """What puts labels right that lie beside the boxes in all recordings alike, such as "walk_1.cam04"."""
    says = setting.says
    if says.get("locate") == "align" and not says.get("align") and setting.camera is not None:
        new = beside_boxes.nudge(offset, setting.camera, says.get("nudge") or {})
        what = f"nudge: {{{', '.join(f'{key}: {value:g}' for key, value in new.items())}}}"
        left = max(sigma for sigma, told in zip(offset.sigma, offset.told, strict=True) if told)
        instead = "instead of the nudge that is there, " if says.get("nudge") else ""
        gain = f"{instead}moves the labels onto the boxes, to ± {1.96 * left:.1f} px"
        return Fix(setting.file, what, gain, literal=True)
    if says.get("locate") == "align":
        what = "are all of them drawn around the subject, and at the right frames? And is the camera's tape right"
        return Fix(f"config/boxes/{recording}.csv", f"{what} ({setting.file})?")
    return Fix(setting.file)


def where(trouble: Trouble, recorded: Iterable[str]) -> str:
    """In which recordings: "in all 4 recordings", "in walk_1 and walk_3", "in 5 of 12 recordings: walk_1, ...", "in
    walk_1; the same in 4 of 12". `recorded`: of the trouble's camera; none where it is of whole walks."""
    names, whole = trouble.sequences, list(recorded)
    if not whole:
        return f"in {', '.join(names[:3])}{', ...' if len(names) > 3 else ''}"
    if trouble.of:
        return f"in {trouble.of}; the same in {len(names)} of {len(whole)} recordings"
    if len(names) == len(whole):
        return "" if len(whole) == 1 else f"in all {many(len(whole), 'recording')}"
    if len(names) <= 2:
        return f"in {' and '.join(names)}"
    return f"in {len(names)} of {len(whole)} recordings: {', '.join(names[:3])}{', ...' if len(names) > 3 else ''}"
