"""provenance.json: what a release was made of and with, so that a later one can say why it differs.

INPUTS   the project's config and the checksums of each walk's recordings (provenance.py)
OUTPUT   a dict for JSON:
         config       every setting by its dotted key, and `config_sha256` over all of them
         sessions     SHA-256 of the files of each session, by name: session.yaml, cameras, marks
         sequences    of each walk: recordings (SHA-256 and size) and the hand-made files about it; `accepted`: who
                      accepts labels whose light is red, by camera, "" for the whole walk; left out where nobody does
         code         a hash of each step's code (dior.tables.code_hash), `packages` versions

No path of a machine, nobody's name: a setting that is a path is replaced by its file's checksum. Sheets are not hashed,
as a hash of so little can be turned back into names; what the release has of them is in its tables.
"""

import hashlib
import json
import platform
import re
from collections.abc import Iterator
from contextlib import suppress
from importlib import metadata
from pathlib import Path
from typing import Any

from dior.project.project import Project
from dior.release import provenance
from dior.release.people_tables import Walks
from dior.tables.result_checksums import file_sha256

# of the layout of provenance.json; raised where a reader of the one before could not read it
VERSION = 1
# settings that say where files are: their content counts
PATHS = ("detector.model", "simulate.motion", "release.license_file")
# what has no effect on a release
LEFT_OUT = ("data_root", "report", "reid")
# where the lab's private key is, is nobody's business
SECRET = ("release.sign",)


def of(
    project: Project,
    walks: Walks,
    recordings: dict[str, Path],
    code: dict[str, str],
    accepted: dict[str, dict[str, str]],
) -> dict[str, Any]:
    """The content of provenance.json. `recordings`: by sequence, the file that provenance.py wrote; `code`: hash by
    step of the code that made what is in the release; `accepted`: by sequence, as above.
    """
    settings = config_of(project)
    return {
        "provenance_version": VERSION,
        "release": project.config["release"]["version"],
        "config": settings,
        "config_sha256": hashlib.sha256(json.dumps(settings, sort_keys=True).encode()).hexdigest(),
        "sessions": {
            shown: _session_files(project, session)
            for session, shown in sorted({(walk["session"], walk["released_session"]) for walk in walks.values()})
        },
        "sequences": {
            name: {
                "recordings": provenance.read(recordings[name]),
                "by_hand": _hand_made(project, name),
                **({"accepted": accepted[name]} if name in accepted else {}),
            }
            for name in sorted(walks)
        },
        "code": dict(sorted(code.items())),
        "packages": versions(),
    }


def config_of(project: Project) -> dict[str, Any]:
    """Every setting by its dotted key, sorted; those of PATHS as the checksum of the file, "" where there is none."""
    settings = _flat({key: value for key, value in project.config.items() if key not in LEFT_OUT})
    found = {key: value for key, value in sorted(settings) if key not in SECRET}
    for key in PATHS:
        if found.get(key):
            path = Path(project.root) / found[key]
            found[key] = f"sha256:{file_sha256(path)}" if path.is_file() else ""
    return found


def _flat(settings: dict[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in settings.items():
        if isinstance(value, dict):
            yield from _flat(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


def _session_files(project: Project, session: str) -> dict[str, str]:
    """SHA-256 of the files in config/sessions/ that hold for a session or a part of one.

    After a bump a camera's file is called after a walk, which may be nobody's business: here it is the camera's name.
    """
    paths = {"session.yaml": project.session_file(session)}
    for camera in project.cameras(session):
        paths[f"{camera}.yaml"] = project.camera_file(session, camera)
        paths[f"{camera}.marks.csv"] = project.marks_file(session, camera)
    return _digests(project, paths)


def _hand_made(project: Project, sequence: str) -> dict[str, str]:
    """SHA-256 by path of what a person made for one walk: offsets, seeds, boxes, checks."""
    paths = [*project.offsets(sequence), *project.seeds(sequence)]
    paths += [*project.boxes(sequence).values(), *project.checks(sequence).values()]
    return _digests(project, {path: path for path in paths})


def _digests(project: Project, paths: dict[str, str]) -> dict[str, str]:
    """SHA-256 by name of the files that there are."""
    there = {name: Path(project.root) / path for name, path in sorted(paths.items())}
    return {name: file_sha256(path) for name, path in there.items() if path.is_file()}


def versions() -> dict[str, str]:
    """Versions of Python and of what dior depends on, by name: what is there of it, as some is not made for every kind
    of machine."""
    needed = [line for line in metadata.requires("dior") or () if "extra ==" not in line]
    # a requirement may go on with the versions that it takes
    names = {re.split(r"[^\w.-]", line)[0] for line in needed}
    found = {"python": platform.python_version()}
    for name in sorted(names):
        with suppress(metadata.PackageNotFoundError):
            found[name] = metadata.version(name)
    return found
