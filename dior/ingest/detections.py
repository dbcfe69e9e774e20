"""Detections of every tool in one table: the subject's joints on every frame of every camera.

INPUTS   one file or folder per camera (`pattern` with {camera}; the formats of `readers.READERS`) and the sequence's
         `frames` table; the bags, with whose pictures they are compared (`on_pictures`).
OUTPUTS  `detections` table, complete camera x frame x joint, recorded pixels, of the subject only: `person` is its
         index in the detector's output, null with u, v, score where the subject was not found or the detector not run.
         Who the subject is is a guess, made before it is known where the cameras are; `detected_people`: everybody in
         the cameras in which there may be others, for the choice that knows (dior/body/which_person.py).
         `findings`: pictures without output, without a person, with several people, and ambiguous choices; whether
         they lie on the pictures.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from dior.arrays import AnyPath, Ints, Table
from dior.errors import DiorError, nearest
from dior.ingest import on_pictures
from dior.ingest import people as subject
from dior.ingest.people import People, Subject
from dior.ingest.readers import READERS, Reader
from dior.ingest.readers.recognise import recognise, why_empty
from dior.ingest.stamps import header_ns
from dior.ingest.videos import is_stream
from dior.tables import result_checksums, tables

# chosen: above this share of frames something missing is a warning
FEW = 0.1
# a body is larger than this in pixels, and no larger in fractions of the picture
FRACTIONS_END = 3.0
SAY_SO = "say so in `detections_checked` of session.yaml"
SETTING = "`detector.first_frame` in config.yaml"
# columns of `frames`
NEEDED = ["camera", "frame", "stamp_ns", "restored_s", "topic", "width", "height"]


def run(
    *,
    sequence: str,
    pattern: str,
    cameras: list[str],
    format: str,
    frames: Path,
    looked_at: list[str],
    out: Path,
    findings: Path,
    first_frame: int = 0,
    out_people: Path | None = None,
    data_root: Path | None = None,
) -> None:
    """Write the subject's detections of `cameras`, those whose detections are used. See the module's docstring.

    `format` is auto or a key of READERS; `first_frame`: number that the files give the first picture; the bags of
    `frames` are below `data_root`, without which the detections are not compared with the pictures; `looked_at`:
    cameras of which somebody says that they lie on them, so that the comparison only warns. Raises DiorError for a
    missing file, a wrong format, frames or stamps of another recording, a camera in which nobody was ever found, and
    detections that do not lie on the pictures.
    """
    if not cameras:
        raise DiorError(f"{sequence}: no camera is given whose detections are to be read")
    if format != "auto" and format not in READERS:
        known = ("auto", *READERS)
        raise DiorError(f"detector.format '{format}' is not one of {', '.join(known)}{nearest(format, known)}")
    pictures = tables.read(frames, "frames", None if data_root else NEEDED)
    parts, everybody, seen = [], [], []
    in_one_file: dict[str, People] = {}
    for camera in sorted(cameras):
        where = f"{sequence}, {camera}"
        mine = tables.of_camera(pictures, camera)
        stamps_ns = mine["stamp_ns"]
        if not len(stamps_ns):
            raise DiorError(f"{where}: {frames} has no frame of this camera")
        path = Path(pattern.replace("{camera}", camera))
        reader = READERS[format_of(path, format, where)]
        check_pattern(sequence, pattern, cameras, reader)
        people = of_recording(path, reader, camera, mine, where, first_frame)
        _check_anybody(people, path, where)
        if "{camera}" not in pattern:
            _check_own_rows(in_one_file, people, camera, path, sequence)
            in_one_file[camera] = people
        track = subject.follow(people, stamps_ns)
        seen += [
            (f"{sequence}/{camera}", *finding) for finding in _findings(people, track, camera, reader, first_frame)
        ]
        parts.append(_columns(camera, stamps_ns, people, track))
        if out_people:
            everybody.append(_everybody(camera, people, subject.tracks(people, stamps_ns)))
        if data_root:
            uv, score = (parts[-1][key].reshape(len(stamps_ns), -1) for key in ("u", "score"))
            uv = np.stack([uv, parts[-1]["v"].reshape(uv.shape)], axis=-1)
            try:
                found = on_pictures.check(uv, score, people.joints, mine, data_root, path, where)
            except on_pictures.OffPictures as wrong:
                if camera not in looked_at:
                    raise DiorError(f"{wrong}. If you have looked and they are right, {SAY_SO}") from None
                found = [("warning", "detections_off_pictures", f"{wrong}. `detections_checked` lets them pass")]
            seen += [(f"{sequence}/{camera}", severity, code, f"{camera}: {text}") for severity, code, text in found]
    tables.write(out, "detections", _concatenated(parts))
    if out_people:
        tables.write(out_people, "detected_people", _concatenated(everybody))
    tables.write_findings(findings, seen)


def format_of(path: Path, wanted: str, where: str) -> str:
    """The tool that wrote `path`. Raises DiorError for a missing path, an unknown content and another tool's."""
    if not path.exists():
        raise DiorError(f"{where}: there are no detections at {path}; check `detections` in sequences.tsv")
    result = result_checksums.result_at(path)
    if result and result.parts[0] == "detect":
        result_checksums.check_file(path)
    if not (path.is_file() or path.is_dir()):
        raise DiorError(f"{where}: {path} is neither a file nor a folder; check `detections` in sequences.tsv")
    found = recognise(path)
    kind = "folder" if path.is_dir() else "file"
    if found == "empty":
        raise DiorError(f"{where}: the {kind} {path} {why_empty(path)}")
    if wanted != "auto" and found != wanted:
        what = f"{READERS[found].tool} output" if found else "something else"
        raise DiorError(f"{where}: the {kind} {path} is {what}, not {wanted}; correct detector.format or the path")
    if not found:
        known = ", ".join(reader.tool for reader in READERS.values())
        raise DiorError(f"{where}: {path} is output of none of {known}; docs/formats.md shows what they look like")
    if READERS[found].shape not in (kind, "either"):
        shape = "the folder of the files" if READERS[found].shape == "folder" else "the file itself"
        raise DiorError(f"{where}: {path} is {READERS[found].tool} output, but `detections` must name {shape}")
    return found


def check_pattern(sequence: str, pattern: str, cameras: Sequence[str], reader: Reader) -> None:
    """Refuse one file for several cameras, of a tool whose files hold one."""
    if "{camera}" not in pattern and len(cameras) > 1 and not reader.all_cameras:
        raise DiorError(f"{sequence}: `detections` in sequences.tsv is '{pattern}', which needs a {{camera}} in it")


def of_recording(
    path: AnyPath,
    reader: Reader,
    camera: str,
    pictures: Table,
    where: str,
    first_frame: int = 0,
    size: tuple[int, int] | None = None,
    setting: str = SETTING,
) -> People:
    """Everybody in the detections of a camera, in pixels, frames counted from 0.

    `pictures`: rows of the `frames` table of the camera; `first_frame`: number that the files give the first of them;
    `size` (width, height) of what the detector was run on, where it is not that of the pictures; `setting`: where
    `first_frame` is said. Raises DiorError for files that are not of that recording.
    """
    people = reader.read(path, camera)
    people = (
        _by_stamp(people, pictures, path, where) if people.by_stamp else _from_zero(people, first_frame, path, setting)
    )
    people = in_pixels(people, reader, size or (pictures["width"][0], pictures["height"][0]), path, where)
    check_recording(people, pictures, path, where, first_frame, setting)
    return people


def _from_zero(people: People, first_frame: int, path: AnyPath, setting: str) -> People:
    if not first_frame:
        return people
    if len(people.ran) and people.ran[0] < first_frame:
        raise DiorError(
            f"{path}: it begins with frame {people.ran[0]}, and {setting} says that the first is {first_frame}"
        )
    return replace(people, frame=people.frame - first_frame, ran=people.ran - first_frame)


def _by_stamp(people: People, pictures: Table, path: AnyPath, where: str) -> People:
    """`people` whose frames are places in `stamp_ns` on the frames that have these stamps.

    Raises DiorError for a stamp that no picture has, to half of the time between two, and for two of the same picture.
    """
    # a detector has the header's stamp, which may have been restored
    stamps = np.concatenate([header_ns(pictures), pictures["stamp_ns"]])
    order = np.argsort(stamps, kind="stable")
    right = np.clip(np.searchsorted(stamps[order], people.stamp_ns), 1, len(stamps) - 1)
    near = order[np.stack([right - 1, right])]
    apart = np.abs(stamps[near] - people.stamp_ns)
    frame = np.where(apart[0] <= apart[1], near[0], near[1]) % len(pictures["stamp_ns"])
    if (far := apart.min(axis=0) > _half_period_ns(pictures)).any():
        raise DiorError(
            f"{where}: {path} has the stamp {people.stamp_ns[int(far.argmax())]} ns, at which there is no picture of "
            "the recording; the detections belong to another one, or count from another moment"
        )
    if len(twice := np.flatnonzero(np.diff(np.sort(frame)) == 0)):
        raise DiorError(f"{where}: two stamps in {path} are those of frame {np.sort(frame)[twice[0]]}")
    of_people = frame[people.frame]
    rows, order = np.argsort(of_people, kind="stable"), np.argsort(frame, kind="stable")
    return replace(
        people,
        frame=of_people[rows],
        person=people.person[rows],
        uv=people.uv[rows],
        score=people.score[rows],
        ran=frame[order],
        stamp_ns=people.stamp_ns[order],
        by_stamp=False,
    )


def _half_period_ns(pictures: Table) -> float:
    """Half of the time between two pictures, ns."""
    stamps_ns = pictures["stamp_ns"]
    return float(np.median(np.diff(stamps_ns)) if len(stamps_ns) > 1 else 1e9) / 2


def in_pixels(people: People, reader: Reader, size: tuple[int, int], path: AnyPath, where: str) -> People:
    """`people` of pictures of `size` (width, height) in pixels, whether the reader gives fractions or pixels.

    Fractions count from the picture's edges and pixels from the centre of the first one, hence the half. Raises
    DiorError where the numbers are the other of the two.
    """
    if not len(people.frame):
        return people
    largest = np.nanmedian(np.nanmax(np.abs(people.uv), axis=(1, 2)))
    if (largest <= FRACTIONS_END) != reader.fractions:
        is_, should = ("pixels", "fractions of the picture") if reader.fractions else ("fractions", "pixels")
        raise DiorError(
            f"{where}: the coordinates in {path} go to {largest:.6g}, which is {is_}, but {reader.tool} output is read "
            f"as {should}; write it again in the tool's usual unit"
        )
    if not reader.fractions:
        return people
    if min(size) < 1:
        raise DiorError(f"{where}: the size of the pictures is not known, and {path} holds fractions of it")
    return replace(people, uv=people.uv * np.array(size, float) - 0.5)


def check_recording(
    people: People, pictures: Table, path: AnyPath, where: str, first_frame: int = 0, setting: str = SETTING
) -> None:
    """Refuse detections of another recording than that with the `pictures` (rows of the `frames` table).

    `people` counted from 0, and their files from `first_frame`, which `setting` says.
    """
    stamps_ns, as_recorded = pictures["stamp_ns"], header_ns(pictures)
    count = len(stamps_ns)
    beyond = people.ran[(people.ran < 0) | (people.ran >= count)]
    if len(beyond):
        from_one = f"; are they counted from 1? Then {setting} should be 1"
        raise DiorError(
            f"{where}: {path} has frame {beyond[-1] + first_frame} but the recording has frames {first_frame} to "
            f"{count - 1 + first_frame}; the detections belong to another recording"
            f"{from_one if people.ran[0] == 1 and beyond[-1] == count and not first_frame else ''}"
        )
    # a detector has the header's stamp, which may have been restored
    apart = [people.stamp_ns - each[people.ran] for each in (stamps_ns, as_recorded)]
    stamped = people.stamp_ns >= 0
    if stamped.any() and "topic" in pictures and is_stream(pictures["topic"][0]):
        # when a video began may not be known, or better known to the detector
        apart = [each - round(float(np.median(each[stamped]))) for each in apart]
    off = stamped & (np.minimum(*(np.abs(each) for each in apart)) > _half_period_ns(pictures))
    if off.any():
        i = int(np.argmax(off))
        raise DiorError(
            f"{where}: {path} gives frame {people.ran[i]} the stamp {people.stamp_ns[i]} where the bag has "
            f"{stamps_ns[people.ran[i]]}; the detections belong to another recording"
        )


def _check_anybody(people: People, path: AnyPath, where: str) -> None:
    if not len(people.frame):
        raise DiorError(
            f"{where}: no person found in any of {len(people.ran)} frames of {path}; "
            "is this the right camera and format? If the camera is long-range, say so in its YAML"
        )
    if not people.score.any():
        raise DiorError(
            f"{where}: no joint in {path} has a score above 0, and such joints count as not detected; write the tool's "
            "scores into it, or 1 where it has none"
        )


def _check_own_rows(others: dict[str, People], people: People, camera: str, path: AnyPath, sequence: str) -> None:
    """Refuse the rows of a file with all cameras that another camera has been given."""
    same = [name for name, other in others.items() if np.array_equal(other.uv, people.uv, equal_nan=True)]
    if same:
        raise DiorError(
            f"{sequence}: {same[0]} and {camera} have the same rows of {path}; it has those of one of them only, or "
            "the names of both end in the same number; give a file per camera, or rename one"
        )


def _columns(camera: str, stamps_ns: Ints, people: People, track: Subject) -> dict[str, Any]:
    """Columns of one camera; text stays as (word, index) until all cameras are put together."""
    frames, joints = len(stamps_ns), len(people.joints)
    # one row more than there are people, for nobody: index -1 finds it
    uv = np.concatenate([people.uv, np.full((1, joints, 2), np.nan)])[track.row]
    score = np.concatenate([np.where(np.isnan(people.uv[..., 0]), np.nan, people.score), np.full((1, joints), np.nan)])
    return {
        "camera": camera,
        "joints": people.joints,
        "frame": np.repeat(np.arange(frames), joints),
        "stamp_ns": np.repeat(stamps_ns, joints),
        "person": np.repeat(np.append(people.person, -1)[track.row], joints),
        "u": uv[..., 0].ravel(),
        "v": uv[..., 1].ravel(),
        "score": score[track.row].ravel(),
    }


def _everybody(camera: str, people: People, track: Ints) -> dict[str, Any]:
    """Columns of the people of one camera, none where one body is all that there is; text as in `_columns`."""
    rows = np.arange(len(track) if track.any() else 0)
    joints = len(people.joints)
    return {
        "camera": camera,
        "joints": people.joints,
        "frame": np.repeat(people.frame[rows], joints),
        "person": np.repeat(people.person[rows], joints),
        "track": np.repeat(track[rows], joints),
        "u": people.uv[rows, :, 0].ravel(),
        "v": people.uv[rows, :, 1].ravel(),
        "score": np.where(np.isnan(people.uv[rows, :, 0]), np.nan, people.score[rows]).ravel(),
    }


def _concatenated(parts: list[dict[str, Any]]) -> dict[str, Any]:
    words = list(dict.fromkeys(joint for part in parts for joint in part["joints"]))
    index = [np.array([words.index(joint) for joint in part["joints"]]) for part in parts]
    rows = [len(part["frame"]) for part in parts]
    tiled = [np.tile(one, count // len(one)) for one, count in zip(index, rows, strict=True)]
    columns: dict[str, Any] = {
        "camera": tables.Repeated([part["camera"] for part in parts], np.repeat(np.arange(len(parts)), rows)),
        "joint": tables.Repeated(words, np.concatenate(tiled)),
    }
    for key in parts[0].keys() - {"camera", "joints"}:
        columns[key] = np.concatenate([part[key] for part in parts])
    return columns


def _findings(
    people: People, track: Subject, camera: str, reader: Reader, first_frame: int
) -> list[tuple[str, str, str]]:
    """(severity, code, text) of one camera."""
    frames = len(track.row)
    count = np.bincount(people.frame, minlength=frames)
    nobody = int((count[people.ran] == 0).sum())
    not_run, several = frames - len(people.ran), int(track.several.sum())
    left_out, ambiguous = int(track.left_out.sum()), int(track.ambiguous.sum())
    found = []
    if not_run:
        text = f"{camera}: the detector was not run on {not_run} of {frames} frames"
        if reader.silent:
            text += f", or found nobody there: {reader.tool} output does not tell"
        found.append(("warning" if not_run > FEW * frames else "info", "detector_not_run", text))
    if len(people.ran) and people.ran[0] == 1 and not first_frame:
        text = (
            f"{camera}: the detections begin at frame 1; if the tool counts from 1, all of them are a frame late, and "
            f"{SETTING} should be 1"
        )
        found.append(("warning", "frames_from_one", text))
    if nobody:
        text = f"{camera}: the detector found nobody in {nobody} of {frames} frames"
        found.append(("warning" if nobody > FEW * frames else "info", "nobody_found", text))
    if several:
        text = (
            f"{camera}: more than one person in {several} of {frames} frames; "
            f"which of them is the subject was ambiguous in {ambiguous}"
        )
        # who is the subject is decided where all cameras are seen together, and what they leave open is said there
        found.append(("info", "several_people", text))
    if left_out:
        text = f"{camera}: in {left_out} of {frames} frames only somebody else was found; they are left empty"
        found.append(("warning" if left_out > FEW * frames else "info", "subject_left_out", text))
    return found
