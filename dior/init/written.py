"""The sheets and YAML files of a capture, as text, with the reason of each guess as a comment.

INPUTS   `capture.Capture`
OUTPUTS  texts by path below config/; rows for sheets that are there already
"""

import json
import re
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import PurePosixPath
from typing import Any

from dior.errors import DiorError
from dior.geometry.camera import MODELS
from dior.ingest.bags import camera_info_topic
from dior.init.cameras import Filmed
from dior.init.capture import Capture
from dior.init.sessions import Lensed, Session, Taken
from dior.project.init import TEMPLATES
from dior.project.schema_check import columns_of, describe
from dior.project.todos import WORD

WALKS = (*columns_of("sequences"), "videos", "stamps")
PEOPLE = (*columns_of("subjects"), "consent_pictures")
# chosen, as the demo has it: instants that place the cameras, of so many walks, and walks that a far one is aligned to
INSTANTS, ADJUSTED, ALIGNED = 400, 4, 2
# chosen: of a tape, from near by and over 60 m; hip height, at which a person in the middle of the walkway is looked at
SIGMA_M, FAR_SIGMA_M, TARGET_M = 0.05, 0.3, [0.0, 0.0, 1.0]
WIDTH = 118
# what a person does besides filling in, by `locate`
BY_HAND = {
    "marks": "click markers on 3-10 pictures of each, into sessions/<session>/<camera>.marks.csv",
    "align": "draw boxes around the person on 20-30 pictures of each, into boxes/<sequence>.<camera>.csv",
}


def config_yaml(data_root: str, capture: Capture) -> str:
    """config.yaml: the template with what the recordings tell."""
    text = (TEMPLATES / "config.yaml").read_text(encoding="utf-8")
    text = _replaced(text, "data_root: data", f"data_root: {value(data_root)}")
    devices = sorted({one.device for session in capture.sessions for one in session.lenses.values() if one.device})
    if devices:
        asked = ", ".join(f"{device}: {WORD}" for device in devices)
        why = _comment(
            f"Which lens model have these cameras, of {', '.join(MODELS)}? `rs-enumerate-devices -c` shows it; the "
            "names tell the size of the pictures and the focal length, px."
        )
        text = _replaced(text, "lenses: {}", f"{why}lenses: {{{asked}}}")
    if capture.first_frame.text:
        line = f"  first_frame: {capture.first_frame.text}"
        text = _replaced(text, "  first_frame: 0", f"{_comment(capture.first_frame.reason, '  ')}{line}")
    two = [
        session.name for session in capture.sessions if sum(how == "tape" for how in _located(session).values()) == 2
    ]
    if two:
        why = _comment(f"two in {', '.join(two)}, where no more are to be adjusted", "  ")
        text = _replaced(text, "  min_views: 3", f"{why}  min_views: 2")
    return text


def _replaced(text: str, line: str, new: str) -> str:
    assert f"\n{line}\n" in text, line
    return text.replace(f"\n{line}\n", f"\n{new}\n", 1)


def value(of: Any) -> str:
    """A value as YAML has it on one line."""
    if isinstance(of, str):
        # as it is where YAML takes it for nothing but a text
        plain = re.fullmatch(r"[A-Za-z/_.][\w/.@+-]*( [\w/.@+-]+)*", of, re.ASCII)
        word = of.lower() in ("true", "false", "yes", "no", "on", "off", "null", "y", "n", "nan", "inf")
        return of if plain and not word and not re.match(r"\.[0-9]|\.(inf|nan)", of.lower()) else json.dumps(
            of, ensure_ascii=False
        )  # fmt: skip
    if isinstance(of, Mapping):
        return "{" + ", ".join(f"{key}: {value(each)}" for key, each in of.items()) + "}"
    if isinstance(of, (list, tuple)):
        return "[" + ", ".join(value(each) for each in of) + "]"
    return str(of)


def _comment(text: str, indent: str = "") -> str:
    lines = textwrap.wrap(text, WIDTH - len(indent), break_long_words=False, break_on_hyphens=False)
    return "".join(f"{indent}# {line}\n" for line in lines)


def header(kind: str, columns: Sequence[str]) -> str:
    """The lines of a sheet before its rows: what its columns mean, and their names."""
    about = "".join(f"# {column}: {describe(kind, column)}\n" for column in columns)
    return f"{about}\n" + "\t".join(columns) + "\n"


def walk_rows(sessions: Iterable[Session], columns: Sequence[str], order: Mapping[str, int]) -> str:
    """Rows of sequences.tsv, each below its reasons. `order`: the session_order of each walk."""
    text = ""
    for session in sessions:
        for one in session.taken:
            cells = walk_cells(session, one, order[one.name])
            text += f"\n{reasons(session, one)}" + "\t".join(cells.get(column, "") for column in columns) + "\n"
    return text


def walk_cells(session: Session, one: Taken, order: int) -> dict[str, str]:
    """The cells of a walk's row by column."""
    return {
        "sequence": one.name,
        "session_order": str(order),
        "subject": one.subject.text,
        "session": session.name,
        "environment": "indoor" if one.indoor else "outdoor",
        "bags": one.bags,
        "mocap": one.owned.mocap.text,
        "detections": one.owned.detections.text,
        "trigger_log": one.owned.trigger.text,
        "videos": one.videos,
        "stamps": one.owned.stamps.text,
    }


def reasons(session: Session, one: Taken) -> str:
    """Comment lines that say why a row is as it is."""
    said = [
        f"{one.name}: {when(one)}",
        *one.walk.reasons,
        *one.doubts,
        one.subject.reason and f"subject: {one.subject.reason}",
    ]
    said.append(
        f"indoor, as it has motion capture: {one.owned.mocap.reason}" if one.indoor
        else "outdoor, as no motion capture belongs to it"
    )  # fmt: skip
    said += [f"{name}: {cell.reason}" for name, cell in (
        ("trigger_log", one.owned.trigger), ("detections", one.owned.detections), ("stamps", one.owned.stamps),
    ) if cell.reason]  # fmt: skip
    said.append(f"session {session.name}: {session.reason}")
    return _comment(". ".join(filter(None, said)) + ".").replace("\t", " ")


def when(one: Taken) -> str:
    """How long and when a walk was recorded, in words."""
    first, last = one.walk.first_ns, one.walk.last_ns
    if first is None or last is None:
        return f"{one.pictures} pictures, at an unknown time"
    return f"{(last - first) / 1e9:.1f} s from {datetime.fromtimestamp(first // 10**9, UTC):%Y-%m-%d %H:%M:%S} UTC on"


def people_rows(people: Iterable[str], columns: Sequence[str]) -> str:
    """Rows of subjects.tsv of people of whom only the name may be known."""
    asked = ("height_m", "height_sigma_m", "consent_release", "consent_pictures")
    return "".join(
        "\t".join({"subject": name, **dict.fromkeys(asked, WORD)}.get(column, "") for column in columns) + "\n"
        for name in people
    )


def session_files(session: Session, lenses_there: Mapping[str, str] | None) -> dict[str, str]:
    """Text by path below config/ of a session's YAML files. `lenses_there`: `lenses` of a config.yaml that is there
    already, None for one that is written now. Raises DiorError where two of them would be one file."""
    folder = f"sessions/{session.name}"
    files = {f"{folder}/session.yaml": _session_yaml(session)}
    for camera in session.cameras:
        path = f"{folder}/{camera.name}.yaml"
        if path.casefold() in {one.casefold() for one in files}:
            raise DiorError(
                f"config/{path} would be written twice: the camera in {', '.join(camera.paths)} is called as another "
                "one, or as session.yaml; rename its file, or put it elsewhere"
            )
        files[path] = _camera_yaml(session, camera, lenses_there)
    return files


def _session_yaml(session: Session) -> str:
    text = _comment(
        f"{session.name}: {session.reason}. What else may be said here: dior/project/templates/session.yaml."
    )
    text += f"cameras: {value([camera.name for camera in session.cameras])}\n"
    taped = [name for name, how in _located(session).items() if how == "tape"]
    if taped:
        walks = spread([one for one in session.taken if not one.owned.detections.asked] or session.taken, ADJUSTED)
        count = INSTANTS // len(walks)
        text += _comment(
            f"{', '.join(taped)} are placed by tape and adjusted by these walks, which should cover the whole walkway; "
            "the list is fixed, so that new walks move no old labels. Whose walk it is has to agree to the release."
        )
        text += "adjust:\n" + "".join(
            f"  {value(one.name)}: {{first: 0, count: {max(min(count, one.pictures - 1), 1)}, step: 1}}\n"
            for one in walks
        )
    return text


def spread(items: Sequence[Taken], most: int) -> list[Taken]:
    """At most so many of a list, evenly spread."""
    count = min(len(items), most)
    return [items[i * len(items) // count] for i in range(count)]


def _located(session: Session) -> dict[str, str]:
    """`locate` of each camera."""
    return {camera.name: _locate(session, camera)[0] for camera in session.cameras}


def located(capture: Capture, how: str) -> list[str]:
    """The cameras, as <session>/<camera>, that are located by `how`."""
    return [
        f"{session.name}/{name}" for session in capture.sessions for name, by in _located(session).items() if by == how
    ]


def _locate(session: Session, camera: Filmed) -> tuple[str, str]:
    lensed, role = session.lenses[camera.name], session.roles[camera.name].role
    if lensed.pose_files:
        return "reference", "a calibration file has its pose"
    if role == "long_range":
        return "align", "it is far away: by tape, and by boxes that are drawn around the person"
    if session.indoor:
        return "marks", f"indoors: markers of the motion capture are clicked on some pictures ({camera.name}.marks.csv)"
    if role == WORD:
        return "tape", "a close camera; align for a long-range one, with `align: {from: boxes, sequences: [...]}`"
    return "tape", "outdoors, and no calibration file has its pose"


def _camera_yaml(session: Session, camera: Filmed, lenses_there: Mapping[str, str] | None) -> str:
    stream, lensed, role = camera.stream, session.lenses[camera.name], session.roles[camera.name]
    size = f"{stream.width}x{stream.height} px" if stream.width else "pictures of unknown size"
    rate = f", {stream.fps:.1f} pictures per second" if stream.fps else ""
    text = _comment(
        f"{camera.name} of {session.name}: {size}{rate}, in {session.taken[0].name}. What else may be said here: "
        "dior/project/templates/camera.yaml."
    )
    text += _comment(role.reason) + f"role: {role.role}\n"
    text += _recorded(camera, session.taken[0])
    text += _intrinsics(camera, lensed, lenses_there)
    how, why = _locate(session, camera)
    text += _comment(why) + f"locate: {how}\n"
    if how == "reference":
        text += _reference(lensed)
    elif how in ("tape", "align"):
        sigma = FAR_SIGMA_M if how == "align" else SIGMA_M
        text += "tape:\n" + _comment(
            "where the lens is: x, y, z in metres from the origin on the floor, Z up, such as [4.0, 0.0, 1.5]", "  "
        )
        text += f"  position_m: {WORD}\n" + _comment("how far off that may be, 1 sigma", "  ") + f"  sigma_m: {sigma}\n"
        text += _comment("what is in the middle of the picture; it need not be known well", "  ")
        text += f"  target_m: {value(TARGET_M)}\n"
    if how == "align":
        walks = [one.name for one in session.taken[:ALIGNED]]
        text += _comment(
            f"20-30 boxes around the person, spread over these walks: config/boxes/<sequence>.{camera.name}.csv"
        )
        text += f"align: {{from: boxes, sequences: {value(walks)}, fit: range}}\n"
    return text


def _recorded(camera: Filmed, first: Taken) -> str:
    """Where its pictures are."""
    if camera.kind == "bag":
        text = _comment(". ".join(camera.reasons)) + f"topic: {value(camera.topic)}\n"
        if camera.bag == WORD:
            text += _comment(
                "other cameras have this topic in their bags: what do the names of its bags hold, and others not? "
                "Rename them where it is nothing"
            )
        elif camera.bag:
            text += _comment("other cameras have this topic in their bags; the names of its own hold this")
        return text + (f"bag: {value(camera.bag)}\n" if camera.bag else "")
    text = _comment(f"no topic: it is in {'videos' if camera.kind == 'video' else 'folders of pictures'}, such as "
                    f"{camera.paths[0]}")  # fmt: skip
    if camera.kind == "pictures" and not first.owned.stamps.text:
        text += _comment("pictures per second: neither the pictures nor a file beside them tell")
        text += f"video: {{fps: {WORD}}}\n"
    return text


def _intrinsics(camera: Filmed, lensed: Lensed, lenses_there: Mapping[str, str] | None) -> str:
    files = [{"file": path, "name": name} for path, name in lensed.lens_files]
    if camera.info:
        beside = f"; {', '.join(one['file'] for one in files)} has a lens of its own" if files else ""
        text = _comment(f"its bags say {lensed.info or 'something that cannot be read'} ({camera.info}){beside}")
        text += "intrinsics: camera_info\n"
        # what lies beside the pictures' topic is found without a word
        if camera.info != camera_info_topic(camera.topic):
            text += f"camera_info: {value(camera.info)}\n"
        return text + _lens(lensed, lenses_there)
    nothing = "its bags have no CameraInfo" if camera.kind == "bag" else "videos say nothing of a lens"
    if len(files) == 1:
        return _comment(f"{nothing}; it is in this file") + f"intrinsics: {value(files[0])}\n"
    options = " or ".join(value(one) for one in files) or "{file, name}, or {chessboard} or {charuco}"
    return _comment(f"{nothing}: {options}; docs/calibrations.md") + f"intrinsics: {WORD}\n"


def _lens(lensed: Lensed, lenses_there: Mapping[str, str] | None) -> str:
    if not lensed.device:
        return ""
    if lenses_there is None or lensed.device in lenses_there:
        return _comment("realsense-ros writes plumb_bob whatever the lens is: config.yaml says which it is") + (
            f"lens: {lensed.device}\n"
        )
    why = f"realsense-ros writes plumb_bob whatever the lens is; it is one of {', '.join(MODELS)}"
    return _comment(why) + f"distortion_model: {WORD}\n"


def _reference(lensed: Lensed) -> str:
    text, pose = "", lensed.pose
    options = [{"file": path, "name": name} for path, name in lensed.pose_files]
    if len(options) > 1:
        text += _comment(f"which of {' or '.join(value(one) for one in options)}?")
        text += f"reference:\n  file: {WORD}\n  name: {value(options[0]['name'])}\n"
    else:
        text += f"reference:\n  file: {value(options[0]['file'])}\n  name: {value(options[0]['name'])}\n"
    if pose is None:
        return text
    for key, said, words in (("convention", pose.convention, "cTw or wTc"), ("units", pose.units, "m, cm or mm")):
        if not said:
            text += _comment(f"the file does not say: {words}", "  ") + f"  {key}: {WORD}\n"
    if pose.origin:
        text += _comment(f"{pose.origin}: floor and vertical are those of the first outdoor walk", "  ")
        text += "  world: from_walk\n"
    return text


def table(capture: Capture, new: Sequence[str]) -> str:
    """What was found and guessed, for the terminal. `new`: the walks that are not in the sheet yet."""
    rows: list[Sequence[str]] = [
        ("walk", "who", "session", "where", "when", "cameras", "recorded in", "motion capture", "detections", "")
    ]
    for session in capture.sessions:
        for one in session.taken:
            recorded = one.videos or ", ".join(PurePosixPath(path).name for path in one.paths)
            rows.append((
                one.name, one.subject.text, session.name, "indoor" if one.indoor else "outdoor", when(one),
                str(len(one.cameras)), recorded, one.owned.mocap.text or "-", one.owned.detections.text or "-",
                "new" if one.name in new else "",
            ))  # fmt: skip
    text = _table(rows)
    of_cameras: list[Sequence[str]] = [("camera", "role", "pictures", "rate", "topic", "lens", "pose")]
    for session in capture.sessions:
        for camera in session.cameras:
            stream, lensed = camera.stream, session.lenses[camera.name]
            lens = "camera_info" if camera.info else lensed.lens_files[0][0] if len(lensed.lens_files) == 1 else WORD
            rate = f"{stream.fps:.1f} Hz" if stream.fps else "-"
            of_cameras.append((
                f"{session.name}/{camera.name}", session.roles[camera.name].role, f"{stream.width}x{stream.height}",
                rate, camera.topic or camera.kind, lens, _locate(session, camera)[0],
            ))  # fmt: skip
    return f"{text}\n{_table(of_cameras)}"


def _table(rows: Sequence[Sequence[str]]) -> str:
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    return "".join("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() + "\n"
                   for row in rows)  # fmt: skip
