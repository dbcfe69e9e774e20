"""Detections of every tool in one table: the subject's joints on every frame of every camera.

INPUTS   one file or folder per camera (`pattern` with {camera}; ML Kit JSON lines or an OpenPose folder) and the
         sequence's `frames` table.
OUTPUTS  `detections` table, complete camera x frame x joint, recorded pixels, of the subject only: `person` is its
         index in the detector's output, null with u, v, score where the subject was not found or the detector not run.
         `findings`: pictures without output, without a person, with several people, and ambiguous choices.
"""

import json
from pathlib import Path

import numpy as np

from dior import tables
from dior.errors import DiorError, nearest
from dior.ingest import people as subject
from dior.ingest.readers import mlkit, openpose

READERS = {"mlkit": mlkit.read, "openpose": openpose.read}
TOOLS = {"mlkit": "ML Kit", "openpose": "OpenPose"}
FEW = 0.1


def run(*, sequence, pattern, cameras, format, frames, out, findings):
    """Write the subject's detections of `cameras`, those whose detections are used. See the module's docstring.

    `format` is auto, mlkit or openpose. Raises DiorError for a missing file, a wrong format, frames or stamps of
    another recording, and a camera in which nobody was ever found.
    """
    if format != "auto" and format not in READERS:
        known = ("auto", *READERS)
        raise DiorError(f"detector.format '{format}' is not one of {', '.join(known)}{nearest(format, known)}")
    if "{camera}" not in pattern and len(cameras) > 1:
        raise DiorError(f"{sequence}: `detections` in sequences.tsv is '{pattern}', which needs a {{camera}} in it")
    pictures = tables.read(frames, "frames", ["camera", "frame", "stamp_ns"])
    parts, seen = [], []
    for camera in sorted(cameras):
        where = f"{sequence}, {camera}"
        stamps_ns = tables.of_camera(pictures, camera)["stamp_ns"]
        if not len(stamps_ns):
            raise DiorError(f"{where}: {frames} has no frame of this camera")
        path = Path(pattern.replace("{camera}", camera))
        people = READERS[_format(path, format, where)](path)
        _check(people, stamps_ns, path, where)
        track = subject.follow(people, stamps_ns)
        seen += [(f"{sequence}/{camera}", *finding) for finding in _findings(people, track, camera)]
        parts.append(_columns(camera, stamps_ns, people, track))
    tables.write(out, "detections", _concatenated(parts))
    tables.write_findings(findings, seen)


def _format(path, wanted, where):
    """The tool that wrote `path`. Raises DiorError for a missing path, an unknown content and another tool's."""
    if not path.exists():
        raise DiorError(f"{where}: there are no detections at {path}; check `detections` in sequences.tsv")
    found = recognise(path)
    kind = "folder" if path.is_dir() else "file"
    if found == "empty":
        raise DiorError(f"{where}: the {kind} {path} is empty; run the detector")
    if wanted != "auto" and found != wanted:
        what = f"{TOOLS[found]} output" if found else "something else"
        raise DiorError(f"{where}: the {kind} {path} is {what}, not {wanted}; correct detector.format or the path")
    if not found:
        raise DiorError(f"{where}: {path} is neither ML Kit JSON lines nor a folder of OpenPose JSON files")
    if found == "openpose" and not path.is_dir() or found == "mlkit" and path.is_dir():
        shape = "the folder of the files" if found == "openpose" else "the .jsonl file itself"
        raise DiorError(f"{where}: {path} is {TOOLS[found]} output, but `detections` must name {shape}")
    return found


def recognise(path):
    """Which tool wrote a file or folder, by its content: "mlkit", "openpose", "empty" or None (none of them)."""
    if path.is_dir():
        names = sorted(one for one in path.iterdir() if one.suffix in (".json", ".jsonl"))
        return recognise(names[0]) if names else "empty"
    with open(path, "rb") as stream:
        line = next((line for line in stream if line.strip()), b"")
    if not line:
        return "empty"
    try:
        content = json.loads(line)
    except ValueError:
        content = _whole(path)
    if not isinstance(content, dict):
        return None
    return "mlkit" if "landmarks" in content else "openpose" if "people" in content else None


def _whole(path):
    """The JSON of a file that spreads over several lines, or None."""
    try:
        return json.loads(path.read_bytes())
    except ValueError:
        return None


def _check(people, stamps_ns, path, where):
    """Refuse detections of another recording, and those in which nobody was found."""
    count = len(stamps_ns)
    beyond = people.ran[(people.ran < 0) | (people.ran >= count)]
    if len(beyond):
        raise DiorError(
            f"{where}: {path} has frame {beyond[-1]} but the recording has frames 0 to {count - 1}; "
            "the detections belong to another recording"
        )
    period_ns = np.median(np.diff(stamps_ns)) if count > 1 else 1e9
    off = (people.stamp_ns >= 0) & (np.abs(people.stamp_ns - stamps_ns[people.ran]) > period_ns / 2)
    if off.any():
        i = int(np.argmax(off))
        raise DiorError(
            f"{where}: {path} gives frame {people.ran[i]} the stamp {people.stamp_ns[i]} where the bag has "
            f"{stamps_ns[people.ran[i]]}; the detections belong to another recording"
        )
    if not len(people.frame):
        raise DiorError(
            f"{where}: no person found in any of {len(people.ran)} frames of {path}; "
            "is this the right camera and format? If the camera is long-range, say so in its YAML"
        )


def _columns(camera, stamps_ns, people, track):
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


def _concatenated(parts):
    words = list(dict.fromkeys(joint for part in parts for joint in part["joints"]))
    index = [np.array([words.index(joint) for joint in part["joints"]]) for part in parts]
    rows = [len(part["frame"]) for part in parts]
    tiled = [np.tile(one, count // len(one)) for one, count in zip(index, rows, strict=True)]
    columns = {
        "camera": tables.Repeated([part["camera"] for part in parts], np.repeat(np.arange(len(parts)), rows)),
        "joint": tables.Repeated(words, np.concatenate(tiled)),
    }
    for key in ("frame", "stamp_ns", "person", "u", "v", "score"):
        columns[key] = np.concatenate([part[key] for part in parts])
    return columns


def _findings(people, track, camera):
    """(severity, code, text) of one camera."""
    frames = len(track.row)
    count = np.bincount(people.frame, minlength=frames)
    nobody = int((count[people.ran] == 0).sum())
    not_run, several = frames - len(people.ran), int(track.several.sum())
    left_out, ambiguous = int(track.left_out.sum()), int(track.ambiguous.sum())
    found = []
    if not_run:
        text = f"{camera}: the detector was not run on {not_run} of {frames} frames"
        found.append(("warning" if not_run > FEW * frames else "info", "detector_not_run", text))
    if nobody:
        text = f"{camera}: the detector found nobody in {nobody} of {frames} frames"
        found.append(("warning" if nobody > FEW * frames else "info", "nobody_found", text))
    if several:
        text = (
            f"{camera}: more than one person in {several} of {frames} frames; "
            f"which of them is the subject was ambiguous in {ambiguous}"
        )
        found.append(("warning" if ambiguous else "info", "several_people", text))
    if left_out:
        text = f"{camera}: in {left_out} of {frames} frames only somebody else was found; they are left empty"
        found.append(("warning" if left_out > FEW * frames else "info", "subject_left_out", text))
    return found
