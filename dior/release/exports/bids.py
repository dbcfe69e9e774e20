"""BIDS motion: the motion capture of the walks, as the Brain Imaging Data Structure wants it.

OUTPUTS  bids/dataset_description.json, README, participants.tsv and .json, and for each subject
         sub-<subject>/sub-<subject>_scans.tsv and .json, and below sub-<subject>/motion/ for each walk *_motion.tsv (m,
         no header), *_motion.json, *_channels.tsv and *_channels.json, and *_events.tsv and .json with its gait events
Specification: bids-specification.readthedocs.io, motion. Labels may hold letters and digits only. Only the walks
with motion capture are in it; a release without any has no such folder.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from dior import __version__
from dior.arrays import Floats, Table
from dior.body.names import PLUG_IN_GAIT_39
from dior.errors import DiorError
from dior.release.exports.fixed_rate import AddWalk, regular
from dior.release.exports.recordings import Body, Release, ReleasedWalk, settings_of
from dior.release.exports.writing import plain, write_json
from dior.tables import tables
from dior.tables.files import write_text
from dior.tables.words import FOOT, GAIT_EVENT

ABOUT = """\
`bids/`: the walks with motion capture as a BIDS dataset (motion), metres in the world of the release (Z up), `n/a`
where a marker is missing. The task is the walk pattern, `acq` the outfit; `sub-<subject>_scans.tsv` says which file is
which sequence. `*_events.tsv` has the heel strikes and toe offs, seconds after the first sample of the motion.
`bids-validator-deno bids` (of PyPI) checks it.

`pandas.read_csv("bids/sub-.../motion/sub-..._motion.tsv", sep="\\t", header=None, na_values="n/a")`
"""
# of the specification
VERSION = "1.10.0"
SYSTEM = "omc"  # optical motion capture
AXES = "Right-handed, origin and x and y as calibrated by the motion capture, z up"
README = """\
Motion capture of the walks of {name}, made from that release alone: its card, README.md, says how the walks were
recorded, how good the labels are, who may use them and what to cite.

Points are markers in metres. {axes}. sub-<subject>_scans.tsv says which file is which walk of the release.
"""

# the columns of events.tsv but for those that the specification demands
EVENTS = {
    "trial_type": {
        "Description": "Gait event",
        "Levels": {
            f"{event}_{foot}": f"{words} of the {foot} foot"
            for event, words in zip(GAIT_EVENT, ("Heel strike", "Toe off"), strict=True)
            for foot in FOOT
        },
    },
    "sample": {"Description": "The sample of the motion that is nearest to the onset, from 0"},
    "sigma": {"Description": "Standard error of the onset", "Units": "s"},
    "low": {"Description": "95 % interval of the onset: its lower end", "Units": "s"},
    "high": {"Description": "95 % interval of the onset: its upper end", "Units": "s"},
    "left_out": {"Description": "Why no parameter of gait is made of it: turn, standing, or end of what is known"},
}


@contextmanager
def writer(folder: Path, release: Release) -> Iterator[AddWalk]:
    """Yield `add(walk, body)`; what is about all walks is written when the context ends."""
    scans: dict[str, list[str]] = {}
    used: set[str] = set()
    people: dict[str, str] = {}

    def add(walk: ReleasedWalk, body: Body) -> None:
        if not set(body.joints) & set(PLUG_IN_GAIT_39):
            return
        other = people.setdefault(plain(walk.subject), walk.subject)
        if other != walk.subject:
            raise DiorError(
                f"bids: the pseudonyms {other} and {walk.subject} differ in no letter or digit, and a BIDS label has "
                "only those; change one in config/subjects.tsv or leave bids out of release.exports"
            )
        stem, place = _name(walk, used), folder / f"sub-{plain(walk.subject)}" / "motion"
        place.mkdir(parents=True, exist_ok=True)
        rate, points = regular(body, walk.skeleton)
        write_text(place / f"{stem}_motion.tsv", motion(points))
        write_json(place / f"{stem}_motion.json", sidecar(walk, rate, points))
        write_text(place / f"{stem}_channels.tsv", channels(body.joints))
        write_json(place / f"{stem}_channels.json", {"reference_frame": {"Levels": {"world": {"Description": AXES}}}})
        gait = release.folder / "gait_events" / walk.subject / f"{walk.sequence}.parquet"
        if gait.is_file():
            write_text(place / f"{stem}_events.tsv", events(tables.read(gait, "gait_events"), rate))
            write_json(place / f"{stem}_events.json", EVENTS)
        row = (f"motion/{stem}_motion.tsv", walk.sequence, walk.session, walk.outfit or "n/a")
        scans.setdefault(walk.subject, []).append("\t".join(row))

    yield add
    if scans:
        _about_all(folder, release, scans)


def _name(walk: ReleasedWalk, used: set[str]) -> str:
    """sub-<>_task-<>_tracksys-<>[_acq-<>]_run-<> of a walk; the run is the first that is not in `used`."""
    acquired = f"_acq-{plain(walk.outfit)}" if plain(walk.outfit) else ""
    stem = f"sub-{plain(walk.subject)}_task-{plain(walk.walk) or 'walk'}_tracksys-{SYSTEM}{acquired}"
    run = next(run for run in range(1, len(used) + 2) if f"{stem}_run-{run:02d}" not in used)
    used.add(f"{stem}_run-{run:02d}")
    return f"{stem}_run-{run:02d}"


def motion(points: Floats) -> str:
    """Rows of tab-separated metres of points (N, J, 3), `n/a` where one is missing."""
    missing = np.isnan(points).any(axis=-1)
    cells = np.repeat(missing, 3, axis=1)
    whole = "\t".join(["%.6f"] * cells.shape[1])
    lines = []
    for row, lacks in zip(points.reshape(len(points), -1).tolist(), cells, strict=True):
        if lacks.any():
            lines.append("\t".join("n/a" if no else f"{x:.6f}" for x, no in zip(row, lacks, strict=True)))
        else:
            lines.append(whole % tuple(row))
    return "\n".join(lines) + "\n"


def events(gait: Table, rate: float) -> str:
    """The table of events of a walk's `gait_events`; `rate` (Hz) of its motion."""
    rows = ["onset\tduration\ttrial_type\tsample\tsigma\tlow\thigh\tleft_out"]
    keys = ("time_s", "event", "foot", "sigma_s", "low_s", "high_s", "reason")
    for at, event, foot, *spread, reason in zip(*(gait[key].tolist() for key in keys), strict=True):
        seconds = (f"{value:.4f}" for value in spread)
        rows.append("\t".join((f"{at:.4f}", "0", f"{event}_{foot}", str(round(at * rate)), *seconds, reason or "n/a")))
    return "\n".join(rows) + "\n"


def channels(joints: Sequence[str]) -> str:
    """The table of channels: three per marker, in the order of the columns of the motion."""
    rows = ["name\tcomponent\ttype\ttracked_point\tunits\treference_frame"]
    rows += [f"{joint}_{axis}\t{axis}\tPOS\t{joint}\tm\tworld" for joint in joints for axis in "xyz"]
    return "\n".join(rows) + "\n"


def sidecar(walk: ReleasedWalk, rate: float, points: Floats) -> dict[str, Any]:
    count = points.shape[1]
    return {
        "TaskName": walk.walk or "walk",
        "TaskDescription": "Walking" + (f", by the pattern that the lab calls '{walk.walk}'" if walk.walk else ""),
        "SamplingFrequency": rate,
        "SamplingFrequencyEffective": rate,
        "TrackingSystemName": SYSTEM,
        "RecordingDuration": round(len(points) / rate, 6),
        "MotionChannelCount": 3 * count,
        "POSChannelCount": 3 * count,
        "TrackedPointsCount": count,
        "MissingValues": "n/a",
    }


def described(release: Release) -> dict[str, Any]:
    """dataset_description.json: what is known of title, authors, licence and DOI is from the release's settings."""
    about = settings_of(release.folder)
    known = {
        "License": about.get("license"),
        "Authors": about.get("authors"),
        "DatasetDOI": f"doi:{about['doi']}" if about.get("doi") else "",
    }
    source = {"DOI": known["DatasetDOI"], "Version": about.get("version")}
    return {
        "Name": about.get("title") or release.folder.name,
        "BIDSVersion": VERSION,
        "DatasetType": "raw",
        **{key: value for key, value in known.items() if value},
        "GeneratedBy": [
            {
                "Name": "dior",
                "Version": __version__,
                "Description": f"Exported from the release {release.folder.name}",
            }
        ],
        **({"SourceDatasets": [{key: value for key, value in source.items() if value}]} if about else {}),
    }


def _about_all(folder: Path, release: Release, scans: dict[str, list[str]]) -> None:
    write_json(folder / "dataset_description.json", described(release))
    write_text(folder / "README", README.format(name=release.folder.name, axes=AXES))
    people = tables.read(release.folder / "subjects.parquet", "subjects")
    heights = dict(zip(people["subject"], people["height_m"], strict=True))
    rows = ["participant_id\theight"]
    for who in sorted(scans):
        height = heights.get(who, np.nan)
        rows.append(f"sub-{plain(who)}\t" + ("n/a" if np.isnan(height) else f"{height:g}"))
    write_text(folder / "participants.tsv", "\n".join(rows) + "\n")
    write_json(folder / "participants.json", {"height": {"Description": "Body height", "Units": "m"}})
    meaning = {
        "sequence": {"Description": "The walk in the release"},
        "session": {"Description": "Recording session in the release"},
        "outfit": {"Description": "What the subject wore"},
    }
    for who, lines in scans.items():
        place = folder / f"sub-{plain(who)}"
        write_text(
            place / f"sub-{plain(who)}_scans.tsv", "\n".join(["filename\tsequence\tsession\toutfit", *lines]) + "\n"
        )
        write_json(place / f"sub-{plain(who)}_scans.json", meaning)
