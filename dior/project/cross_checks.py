"""What one file of a project says about another, checked when the project is read.

INPUTS: a `dior.project.project.Project` whose files have the right keys. OUTPUTS: a DiorError for the contradictions:
sentences that name the file, line or key and the likely fix.
"""

import difflib
import os
import re
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

from dior.errors import DiorError, Faults, nearest
from dior.paths import AnyPath
from dior.project.bumps import session_folder
from dior.project.contents import Project
from dior.project.schema_check import Row, Rows, check, read_yaml

# Snakemake takes braces for wildcards; what is not printed cannot be retyped from a sentence
NO_PART_OF_A_PATH = re.compile(r"[{}\x00-\x1f\x7f]")
FOLDERS = ("boxes", "checks", "heads", "offsets", "people", "sessions")
# chosen: a letter or two too few or too many in a name; a lab's own `boxes_old` or `notes` is less alike
A_SLIP = 0.8
# columns in which {camera} stands for the camera's name
PATTERNS = ("videos", "stamps", "detections")
TABLES_AND_YAML = (".csv", ".tsv", ".yaml", ".yml")
# chosen: what a tape measure resolves; two cameras are farther apart
SAME_PLACE_M = 0.01
# chosen: of somebody farther from a close camera no detector finds joints; a long-range camera sees nobody at two km
FARTHEST_M = {"close": 100.0, "long_range": 2000.0}


class NotMarked(DiorError):
    """The marks or boxes that a camera is placed by are still to be made."""


def check_config(config: dict[str, Any]) -> None:
    """Paths in config.yaml must be such as a command line and Snakemake take as they are."""
    paths = {"data_root": [config["data_root"]], "detector.model": [config["detector"]["model"]]}
    paths |= {f"reid.networks.{name}": files for name, files in config["reid"]["networks"].items()}
    for key, files in paths.items():
        for path in files:
            _check_path(path, f"config/config.yaml: '{key}'")
            _check_begin(path, f"config/config.yaml: '{key}'", "./")


def check_sheets(project: Project, people: Rows, lines: dict[str, int]) -> None:
    """Subjects and sessions that the sheets name must exist, pseudonyms must hide who it is.

    `people`: all rows of subjects.tsv, of those who may not be processed, too; `lines` of the rows of sequences.tsv.
    """
    faults = Faults()
    with faults.kept():
        _check_pseudonyms(people)
    for name in project.sequences:
        where = f"config/sequences.tsv line {lines[name]}"
        for check_row in (_check_subject, _check_session, _check_detector, _check_paths, _check_name):
            with faults.kept():
                check_row(project, project.rows[name], people, where)
    faults.tell()


def check_gallery(project: Project, people: Rows, lines: dict[tuple[str, ...], int]) -> None:
    """Rows of the gallery name a subject and one place of their pictures. `people`, `lines`: as of `check_sheets`."""
    for name, row in project.gallery.items():
        where = f"config/gallery.tsv line {lines[name]}"
        if row["subject"] not in people:
            raise DiorError(
                f"{where}: subject '{row['subject']}' is not in config/subjects.tsv{nearest(row['subject'], people)}"
            )
        if bool(row["path"]) == bool(row["bag"]):
            raise DiorError(f"{where}: give either path (a folder of pictures) or bag (with its topic)")
        if bool(row["bag"]) != bool(row["topic"]):
            raise DiorError(f"{where}: {'bag needs its topic' if row['bag'] else 'topic is of no bag'}")
        _check_path(row["path"] or row["bag"], where)
        if os.path.isabs(row["path"] or row["bag"]):
            raise DiorError(f"{where}: '{row['path'] or row['bag']}' must be relative to data_root")
        _check_words(row, ("outfit", "angle"), people, where)


def check_detectors(project: Project, lines: dict[tuple[str, ...], int]) -> None:
    """Rows of detectors.tsv name a sequence and one of its cameras; those of excluded ones wait. `lines` of them."""
    for name, row in project.detectors.items():
        where = f"config/detectors.tsv line {lines[name]}"
        if row["sequence"] not in project.rows:
            raise DiorError(
                f"{where}: '{row['sequence']}' is not in config/sequences.tsv{nearest(row['sequence'], project.rows)}"
            )
        _check_path(row["path"], where)
        if os.path.isabs(row["path"]):
            raise DiorError(f"{where}: path '{row['path']}' must be relative to data_root")
        if row["sequence"] not in project.sequences:
            continue
        cameras = project.cameras_of(row["sequence"])
        if row["camera"] not in cameras:
            raise DiorError(
                f"{where}: '{row['camera']}' is no camera of session '{project.session_of(row['sequence'])}'"
                f"{nearest(row['camera'], cameras)}"
            )


def check_sessions(project: Project, lines: dict[str, int]) -> None:
    """Sequences, sessions, cameras and the files beside them must fit together. `lines` of the sheet's rows."""
    faults = Faults()
    for session in project.sessions:
        with faults.kept():
            _check_distinct(project, session)
            for name in project.sequences_of(session):
                _check_sequence(project, project.rows[name], f"config/sequences.tsv line {lines[name]}")
    # what follows counts on that
    faults.tell()
    for session in project.sessions:
        with faults.kept():
            # each counts on those before it
            _check_window(project, session)
            _check_tag(project, session)
            _check_facts(project, session)
            _check_mocap(project, session)
            _check_looked_at(project, session)
            _check_masks(project, session)
            _check_accepted(project, session)
        for camera in project.cameras(session):
            with faults.kept():
                _check_marks(project, session, camera)
                _check_align(project, session, camera)
    for check_all in (_check_people, _check_folders):
        with faults.kept():
            check_all(project)
    for folder in ("offsets", "people", "boxes", "checks"):
        with faults.kept():
            _check_names(project, folder)
    for name in project.sequences:
        for check_given in (_check_offsets, _check_seeds):
            with faults.kept():
                check_given(project, name)
    faults.tell()


def _check_people(project: Project) -> None:
    """Where all people are to be labelled, close cameras must be able to see them."""
    several = [name for name in project.sequences if len(project.close(project.session_of(name))) > 1]
    if project.config["people"] == "all" and all(project.indoor(name) for name in several):
        raise DiorError(
            "config/config.yaml: 'people' is all, but no sequence is outdoors in a session with two close cameras, "
            "which others could be seen by; write subject"
        )


def check_camera(camera: dict[str, Any], shown: str) -> None:
    """A camera must have what its `locate` needs. Raises DiorError for all that it has not."""
    faults = Faults()
    with faults.kept():
        _check_intrinsics(camera, shown)
    for key in ("topic", "camera_info"):
        with faults.kept():
            _check_begin(camera.get(key, ""), f"{shown}: '{key}'", "/")
    if "reference" in camera:
        with faults.kept():
            _check_path(camera["reference"]["file"], f"{shown}: 'reference.file'")
    faults.found += [DiorError(f"{shown}: {text}") for text in _contradictions(camera)]
    faults.tell()


def _contradictions(camera: dict[str, Any]) -> Iterator[str]:
    """What a camera's keys say that does not go together."""
    tape = camera.get("tape")
    if {"lens", "distortion_model"} <= camera.keys():
        yield "'lens' and 'distortion_model' say the same thing; delete one of them"
    if not camera["topic"] and camera["intrinsics"] == "camera_info":
        yield (
            "'intrinsics' is camera_info, which bags have and videos have not; give a file or a board, or, for a "
            "camera that is in bags, its 'topic'"
        )
    yield from _of_locate(camera)
    off = _distance(tape["position_m"], tape["target_m"]) if tape else 1.0
    if off < SAME_PLACE_M:
        yield "'tape.target_m' is the camera's own position, so it looks nowhere"
    if off > FARTHEST_M[camera["role"]]:
        yield (
            f"'tape.position_m' is {off:.0f} m from 'tape.target_m'; both are metres from the origin on the floor, not "
            "centimetres or degrees of latitude"
        )


def _of_locate(camera: dict[str, Any]) -> Iterator[str]:
    """What does not go together with `locate`: its role, or, where that does, the sections for it."""
    locate = camera["locate"]
    if locate == "align" and camera["role"] != "long_range":
        yield "'locate: align' is for long_range cameras; a close one has marks, tape or reference"
        return
    if locate in ("tape", "apriltag") and camera["role"] != "close":
        yield f"a long_range camera is not adjusted after 'locate: {locate}'; use 'locate: align'"
        return
    if locate in ("tape", "align") and "tape" not in camera:
        yield f"'locate: {locate}' needs the key 'tape' with the measured position_m"
    if locate == "reference" and "reference" not in camera:
        yield "'locate: reference' needs the key 'reference' with file and name"
    if locate != "align" and any(camera["nudge"].values()):
        yield f"'nudge' has no effect with 'locate: {locate}'; only align uses it"
    if "align" in camera and locate != "align":
        yield f"the section 'align' has no effect with 'locate: {locate}'"


def lens_model(name: str, lenses: dict[str, str], shown: str) -> str:
    """The lens model of a device. Raises DiorError where config.yaml has none of that name."""
    if name not in lenses:
        raise DiorError(f"{shown}: lens '{name}' is not in `lenses` of config/config.yaml{nearest(name, lenses)}")
    return lenses[name]


def _check_intrinsics(camera: dict[str, Any], shown: str) -> None:
    """Intrinsics come from one place, and a board gives the whole lens model."""
    source = camera["intrinsics"]
    if not isinstance(source, dict):
        return
    if "camera_info" in camera:
        raise DiorError(f"{shown}: 'camera_info' has no effect, as 'intrinsics' does not come from the bag; delete one")
    ways = [key for key in ("file", "chessboard", "charuco") if key in source]
    for key, other in (("file", "name"), ("name", "file")):
        if key in source and other not in source:
            raise DiorError(f"{shown}: key 'intrinsics.{other}' is missing; intrinsics from a file need file and name")
    if len(ways) != 1:
        given = " and ".join(ways) or "nothing"
        raise DiorError(f"{shown}: 'intrinsics' names {given}; give one of file (with name), chessboard and charuco")
    board = source[ways[0]]
    _check_path(board if isinstance(board, str) else board["path"], f"{shown}: 'intrinsics.{ways[0]}'")
    _check_begin(source.get("name", ""), f"{shown}: 'intrinsics.name'", "")
    model = camera.get("distortion_model", "plumb_bob")
    if ways[0] != "file" and model != "plumb_bob":
        raise DiorError(f"{shown}: 'distortion_model: {model}' does not fit: a {ways[0]} gives a plumb_bob lens")


def _check_align(project: Project, session: str, camera: str) -> None:
    """A camera is aligned to sequences of its session that are processed and have what it is aligned to."""
    how = project.cameras(session)[camera].get("align")
    if not how:
        return
    shown = project.camera_file(session, camera)
    here = project.sequences_of(session)
    for name in how["sequences"]:
        if name in project.excluded:
            raise DiorError(f"{shown}: align.sequences names '{name}', which has an exclude_reason")
        if name not in here:
            raise DiorError(f"{shown}: align.sequences: '{name}' is no sequence of {session}{nearest(name, here)}")
        if how["from"] == "boxes" and camera not in project.boxes(name):
            raise NotMarked(f"{shown}: 'align.from: boxes' needs the file config/boxes/{name}.{camera}.csv")
    path = project.marks_file(session, camera)
    if how["from"] == "marks" and not (project.root / path).is_file():
        raise NotMarked(f"{shown}: 'align.from: marks' needs the file {path}")


def _check_pseudonyms(subjects: Rows) -> None:
    owner: dict[str, str] = {}
    for name, row in subjects.items():
        word = row["pseudonym"].lower()
        if word == "metadata":
            raise DiorError(
                f"config/subjects.tsv: '{name}' has the pseudonym '{word}', as a tarball is called; make one up"
            )
        if word in owner:
            raise DiorError(
                f"config/subjects.tsv: subjects '{owner[word]}' and '{name}' share the pseudonym '{row['pseudonym']}'"
            )
        owner[word] = name
    for word, name in owner.items():
        for other in subjects:
            if _holds(word, other):
                raise DiorError(
                    f"config/subjects.tsv: the pseudonym of '{name}' holds the name of subject '{other}'; make one up"
                )


def _check_subject(project: Project, row: Row, people: Rows, where: str) -> None:
    if row["subject"] not in people:
        raise DiorError(
            f"{where}: sequence '{row['sequence']}' is of subject '{row['subject']}', who is not in config/subjects.tsv"
            f"{nearest(row['subject'], people)}"
        )


def _check_session(project: Project, row: Row, people: Rows, where: str) -> None:
    if told := no_session(project.root, row):
        raise DiorError(f"{where}: {told}")


def no_session(root: AnyPath, row: Row) -> str:
    """What to say of a row of sequences.tsv whose session has no files, "" where it has."""
    folder, name = Path(root, "config/sessions"), session_folder(row["session"])
    if (folder / name / "session.yaml").is_file():
        return ""
    there = sorted(os.listdir(folder)) if folder.is_dir() else []
    fix = nearest(row["session"], [one for one in there if one != name])
    if not fix:
        other = "copy the folder of another session" if there else "`dior init <new folder>` makes one to copy"
        fix = f"; {other}" if name not in there else "; it lists the session's cameras"
    return f"session '{row['session']}' of sequence '{row['sequence']}' has no config/sessions/{name}/session.yaml{fix}"


def _check_paths(project: Project, row: Row, people: Rows, where: str) -> None:
    for column in ("bags", "videos", "stamps", "mocap", "detections", "trigger_log", "truth"):
        for path in row[column].split(";"):
            _check_path(path.replace("{camera}", "") if column in PATTERNS else path, f"{where}: {column}")
            if os.path.isabs(path.strip()):
                raise DiorError(f"{where}: {column} '{path.strip()}' must be relative to data_root")
    _check_begin(project.capture(row["sequence"]), f"{where}: the capture behind # in trigger_log", "")


def _check_path(path: str, what: str) -> None:
    """Raise DiorError for a path that the workflow would take for something else."""
    if found := NO_PART_OF_A_PATH.search(path):
        why = "which the workflow takes for a wildcard" if found[0] in "{}" else "which cannot be typed"
        raise DiorError(f"{what} is '{path}' with {found[0]!r}, {why}; rename the file or folder")


def _check_begin(word: str, what: str, before: str) -> None:
    """Raise DiorError for a word that a command would take for an option; `before`: what may stand before it."""
    if word.startswith("-"):
        fix = f"write '{before}{word}'" if before else "rename it"
        raise DiorError(f"{what} is '{word}', which begins with - as the options of a command do; {fix}")


def _check_detector(project: Project, row: Row, people: Rows, where: str) -> None:
    if not project.detected_here(row["sequence"]):
        return
    asking = f"{where}: sequence '{row['sequence']}' has 'detections: detect'"
    model = project.config["detector"]["model"]
    if not model:
        raise DiorError(f"{asking}, which needs the pose network `detector.model` in config/config.yaml")
    if not os.path.isfile(os.path.join(project.root, model)):
        raise DiorError(
            f"{asking}, but `detector.model` in config/config.yaml is '{model}', where there is no file; it is "
            "relative to the folder that holds config/"
        )


def _distance(a: Sequence[float], b: Sequence[float]) -> float:
    return sum((x - y) ** 2 for x, y in zip(a, b, strict=True)) ** 0.5


def _check_name(project: Project, row: Row, people: Rows, where: str) -> None:
    """The names of sequences and sessions go into the release, so they must not hold the name of a subject."""
    for column in ("sequence", "session"):
        for subject in people:
            if _holds(row[column], subject):
                raise DiorError(
                    f"{where}: the name of {column} '{row[column]}' holds that of subject '{subject}', which the "
                    f"release must not tell; rename the {column}"
                )
    _check_words(row, ("outfit", "walk"), people, where)


def _check_looked_at(project: Project, session: str) -> None:
    """Cameras that there are, and reasons that tell nobody's name: a release shows them."""
    shown, cameras = project.session_file(session), project.cameras(session)
    reasons = {"heads_checked": project.heads_checked(session)}
    reasons["detections_checked"] = project.detections_checked(session)
    for key, of_cameras in reasons.items():
        for camera, reason in of_cameras.items():
            if camera not in cameras:
                raise DiorError(f"{shown}: {key} names '{camera}', no camera of it{nearest(camera, cameras)}")
            _check_words({f"{key} {camera}": reason}, (f"{key} {camera}",), project.pseudonyms, shown)


def _check_masks(project: Project, session: str) -> None:
    """Privacy masks are rectangles of cameras that there are."""
    shown, cameras = project.session_file(session), project.cameras(session)
    for camera, masks in project.privacy_masks(session).items():
        if camera not in cameras:
            raise DiorError(f"{shown}: privacy_masks names '{camera}', no camera of it{nearest(camera, cameras)}")
        for u_min, v_min, u_max, v_max in masks:
            if not (u_min < u_max and v_min < v_max):
                raise DiorError(
                    f"{shown}: privacy_masks of {camera}: [{u_min:g}, {v_min:g}, {u_max:g}, {v_max:g}] holds no pixel; "
                    "the order is u_min, v_min, u_max, v_max"
                )


def _check_accepted(project: Project, session: str) -> None:
    """Red lights are accepted of walks and cameras that there are, for reasons that tell nobody's name."""
    shown, cameras = project.session_file(session), project.cameras(session)
    rows = {**project.rows, **project.withheld}
    here = [name for name, row in rows.items() if session_folder(row["session"]) == session_folder(session)]
    for key, reason in project.labels_accepted(session).items():
        sequence, _, camera = key.partition("/")
        if sequence not in here:
            raise DiorError(
                f"{shown}: labels_accepted names '{sequence}', no sequence of this session"
                f"{nearest(sequence, project.rows.keys() & set(here))}"
            )
        if camera and camera not in cameras:
            raise DiorError(f"{shown}: labels_accepted names '{key}', no camera of it{nearest(camera, cameras)}")
        _check_words({"labels_accepted": reason}, ("labels_accepted",), project.pseudonyms, shown)


def _check_words(row: Row, columns: Iterable[str], people: Iterable[str], where: str) -> None:
    """Nor must other words that go there. A number is a size or an angle, and a letter a kind; no person's name."""
    for column in columns:
        for subject in people:
            name = rf"(?<![A-Za-z0-9]){re.escape(subject)}(?![A-Za-z0-9])"
            if not subject.isdigit() and len(subject) > 1 and re.search(name, row[column], re.IGNORECASE):
                raise DiorError(
                    f"{where}: {column} '{row[column]}' must not hold the name of subject '{subject}', which the "
                    "release must not tell"
                )


def _holds(text: str, subject: str) -> bool:
    """Whether a name is there as a word. One or two digits are a number of something, not a person's name."""
    if subject.isdigit() and len(subject) < 3:
        return False
    return bool(re.search(rf"(^|[_-]){re.escape(subject)}([_-]|$)", text, re.IGNORECASE))


def _check_distinct(project: Project, session: str) -> None:
    """No two cameras of a session record the same topic, stand in one place or take one pose."""
    names = list(project.cameras(session))
    for i, first in enumerate(names):
        for second in names[i + 1 :]:
            a, b = project.cameras(session)[first], project.cameras(session)[second]
            where = f"config/sessions/{session}: cameras '{first}' and '{second}'"
            measured = [camera["tape"]["position_m"] for camera in (a, b) if "tape" in camera]
            if (
                a["topic"]
                and a["topic"] == b["topic"]
                and not ({"bag"} <= a.keys() & b.keys() and a["bag"] != b["bag"])
            ):
                raise DiorError(
                    f"{where} have the same topic '{a['topic']}'; where they have it in different bags, give `bag` of "
                    "each, what the names of its bags hold"
                )
            if len(measured) == 2 and _distance(*measured) < SAME_PLACE_M:
                raise DiorError(
                    f"{where} are at the same place {measured[0]} (tape.position_m of {first}.yaml and {second}.yaml); "
                    "correct one of them, or delete `tape:` where nothing was measured"
                )
            if a["locate"] == b["locate"] == "reference" and all(
                a["reference"].get(key) == b["reference"].get(key) for key in ("file", "name", "convention")
            ):
                raise DiorError(f"{where} take the same pose '{a['reference']['name']}' (reference.name)")


def _check_videos(project: Project, row: Row, where: str) -> None:
    """Every camera is in a bag or has a video of its own."""
    name, session = row["sequence"], row["session"]
    if not project.bags(name) and not row["videos"]:
        raise DiorError(f"{where}: sequence '{name}' has no bags and no videos; name what its cameras recorded")
    filmed = project.filmed(name)
    if filmed and not row["videos"]:
        shown = project.camera_file(session, filmed[0])
        raise DiorError(
            f"{where}: sequence '{name}' has no videos, and {shown} has no topic of its bags; give `videos` here, or "
            "`topic` there"
        )
    if row["videos"] and not filmed:
        raise DiorError(
            f"{where}: sequence '{name}' has bags and videos, and every camera of session '{session}' has a topic, by "
            f"which it is in the bags; delete the topic of those in videos ({project.camera_file(session, '<camera>')})"
        )
    if row["stamps"] and not row["videos"]:
        raise DiorError(f"{where}: sequence '{name}' has stamps of videos, but no videos; bags have stamps themselves")
    owner: dict[tuple[str, str], str] = {}
    topics = project.topics(name)
    for camera, path in project.videos(name).items():
        stream = path, topics[camera].partition("/")[0]
        if stream in owner:
            raise DiorError(
                f"{where}: cameras '{owner[stream]}' and '{camera}' of sequence '{name}' are the same {stream[1]} of "
                f"{path}; write {{camera}} into `videos`, or give their `video: {{stream: ...}}`"
            )
        owner[stream] = camera


def _check_sequence(project: Project, row: Row, where: str) -> None:
    name, session = row["sequence"], row["session"]
    _check_videos(project, row, where)
    if row["environment"] == "indoor" and not row["mocap"]:
        raise DiorError(f"{where}: sequence '{name}' is indoor but has no mocap (the C3D file)")
    if row["environment"] == "indoor":
        return
    if row["trigger_log"]:
        raise DiorError(
            f"{where}: sequence '{name}' is outdoor, where the first close camera gives the time; its trigger_log has "
            "no motion capture to start, so leave it empty"
        )
    if not row["detections"]:
        raise DiorError(f"{where}: sequence '{name}' is outdoor but has no detections")
    if len(project.close(session)) < 2:
        raise DiorError(
            f"{where}: sequence '{name}' is outdoor, so session '{session}' needs at least 2 close cameras, "
            f"but {project.session_file(session)} has {len(project.close(session))}"
        )


def _check_window(project: Project, session: str) -> None:
    shown, processed = project.session_file(session), project.sequences_of(session)
    close = {name: project.cameras(session)[name]["locate"] for name in project.close(session)}
    taped = [name for name, how in close.items() if how == "tape"]
    if taped and not project.window(session):
        raise DiorError(
            f"{shown}: {', '.join(taped)} are placed by tape, which is some degrees off until they are adjusted; name "
            f"walks of session '{session}' to adjust with, such as "
            f"'adjust: {{{processed[0]}: {{first: 0, count: 400, step: 1}}}}'"
        )
    marked = [name for name, how in close.items() if how == "marks"]
    if marked and project.window(session):
        raise DiorError(
            f"{shown}: 'adjust' is for close cameras placed by tape or reference, but {marked[0]} has 'locate: marks'"
        )
    for name in project.window(session):
        if name in project.excluded:
            raise DiorError(f"{shown}: 'adjust.{name}' is an excluded sequence; use one that is processed")
        if name not in processed:
            raise DiorError(f"{shown}: 'adjust.{name}' is no sequence of session '{session}'{nearest(name, processed)}")
        if not project.rows[name]["detections"]:
            raise DiorError(f"{shown}: 'adjust.{name}' has no detections in config/sequences.tsv to adjust with")


def _check_tag(project: Project, session: str) -> None:
    shown, tag = project.session_file(session), project.session_files[session].get("tag")
    asking = [name for name, camera in project.cameras(session).items() if camera["locate"] == "apriltag"]
    if asking and not tag:
        raise DiorError(f"{shown}: camera '{asking[0]}' has 'locate: apriltag', which needs the key 'tag' here")
    processed = project.sequences_of(session)
    if tag and tag.get("sequence", processed[0]) not in processed:
        raise DiorError(
            f"{shown}: 'tag.sequence' is '{tag['sequence']}', no processed sequence of session '{session}'"
            f"{nearest(tag['sequence'], processed)}"
        )


def _check_facts(project: Project, session: str) -> None:
    """The metric facts are about cameras of the session and people of the walks that it is adjusted with."""
    shown, settings, window = project.session_file(session), project.session_files[session], project.window(session)
    close, people = project.close(session), sorted({project.subject_of(name) for name in window})
    named = {pseudonym: name for name, pseudonym in project.pseudonyms.items()}
    for i, fact in enumerate(settings.get("distances", [])):
        first, second = fact["between"]
        if first not in close:
            raise DiorError(
                f"{shown}: 'distances.{i}.between' begins with '{first}', which is no close "
                f"camera{nearest(first, close)}; it is a camera and another one or a marked point"
            )
        if first == second:
            raise DiorError(f"{shown}: 'distances.{i}.between' names '{first}' twice")
    if not window:
        return
    for i, fact in enumerate(settings.get("keypoint_distance", [])):
        name = fact.get("subject", people[0])
        # after a bump the walks of a subject may all be in the other part of the session
        if name not in {project.subject_of(walk) for walk in project.whole_session(session)}:
            raise DiorError(
                f"{shown}: 'keypoint_distance.{i}.subject' is '{named.get(name, name)}', who walks in no sequence of "
                f"session '{session}'{nearest(name, [named[who] for who in people])}"
            )
    measured = [name for name in people if project.subjects[name]["height_m"]]
    if settings.get("stature") and not any(project.subjects[name]["height_sigma_m"] for name in measured):
        raise DiorError(
            f"{shown}: 'stature' needs height_m and height_sigma_m in config/subjects.tsv of one of the people in "
            f"'adjust': {', '.join(named[who] for who in people)}"
        )


def _check_mocap(project: Project, session: str) -> None:
    """`mocap.prefix` is of people who walk in the session, also of those who may not be processed."""
    folder = session_folder(session)
    named = {pseudonym: name for name, pseudonym in project.pseudonyms.items()}
    people = {
        named[row["subject"]]
        for row in (*project.rows.values(), *project.withheld.values())
        if session_folder(row["session"]) == folder and row["subject"] in named
    }
    for name in project.session_files[session]["mocap"]["prefix"]:
        if name not in people:
            raise DiorError(
                f"config/sessions/{folder}/session.yaml: 'mocap.prefix.{name}': '{name}' walks in no sequence of "
                f"session '{folder}'{nearest(name, people)}"
            )


def _check_marks(project: Project, session: str, camera: str) -> None:
    # a camera that stands still may be marked in any part of its session
    shown, processed = project.marks_file(session, camera), project.whole_session(session)
    for name, (first, without_3d) in project.marks.get((session, camera), {}).items():
        if name not in processed:
            raise DiorError(
                f"{shown} line {first}: '{name}' is no processed sequence of session '{session}'"
                f"{nearest(name, processed)}"
            )
        if without_3d and not project.rows[name]["mocap"]:
            raise DiorError(
                f"{shown} line {without_3d}: the mark has no x, y, z and sequence '{name}' has no mocap to take its "
                "3D point from"
            )


def _check_folders(project: Project) -> None:
    """A folder of config/ whose name is nearly that of one that is read would be left out in silence."""
    for name in sorted(os.listdir(project.root / "config")):
        meant = difflib.get_close_matches(name, FOLDERS, n=1, cutoff=A_SLIP)
        if meant and name not in FOLDERS and (project.root / "config" / name).is_dir():
            raise DiorError(f"config/{name}: no such folder is read (did you mean '{meant[0]}'?); rename it")


def _check_names(project: Project, folder: str) -> None:
    """A file whose name no sequence or camera has would be left out in silence."""
    path = project.root / "config" / folder
    whole = folder in ("offsets", "people")
    suffix = ".yaml" if whole else ".csv"
    for file in sorted(os.listdir(path)) if path.is_dir() else ():
        if file.startswith(".") or not file.endswith(suffix):
            named = file.partition(".")[0] in project.rows
            if named and file.lower().endswith(TABLES_AND_YAML):
                raise DiorError(f"config/{folder}/{file}: is not read, as its name must end in {suffix}; rename it")
            continue
        sequence, _, camera = file.removesuffix(suffix).partition(".")
        if sequence in project.withheld:
            continue
        if sequence not in project.rows:
            raise DiorError(
                f"config/{folder}/{file}: '{sequence}' is not in config/sequences.tsv{nearest(sequence, project.rows)}"
                "; remove the file if its row was taken out"
            )
        if whole or sequence in project.excluded:
            continue
        if camera not in project.cameras_of(sequence):
            raise DiorError(
                f"config/{folder}/{file}: '{camera}' is no camera of session '{project.session_of(sequence)}'"
                f"{nearest(camera, project.cameras_of(sequence))}; the name is <sequence>.<camera>.csv"
            )


def _check_offsets(project: Project, sequence: str) -> None:
    for shown in project.offsets(sequence):
        cameras = project.cameras_of(sequence)
        for camera in check(read_yaml(project.root / shown, shown), "offsets", shown):
            if camera not in cameras:
                raise DiorError(f"{shown}: '{camera}' is no camera of this sequence{nearest(camera, cameras)}")


def _check_seeds(project: Project, sequence: str) -> None:
    """Somebody who points at the subject does so in a close camera of a walk that is triangulated."""
    for shown in project.seeds(sequence):
        if project.indoor(sequence):
            raise DiorError(f"{shown}: '{sequence}' is indoor, where the motion capture says where the subject is")
        close = project.close(project.session_of(sequence))
        for number, seed in enumerate(check(read_yaml(project.root / shown, shown), "people", shown)["seeds"], 1):
            if seed["camera"] not in close:
                raise DiorError(
                    f"{shown}: seed {number}: '{seed['camera']}' is no close camera of this sequence"
                    f"{nearest(seed['camera'], close)}"
                )
