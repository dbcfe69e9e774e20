"""A project folder: its config, sheets, sessions and cameras, read and checked as a whole.

INPUTS: `<root>/config/`: config.yaml, sequences.tsv, subjects.tsv; gallery.tsv, detectors.tsv, effort.tsv and
markers.tsv, which may be missing; sessions/<session>/{session.yaml, <camera>.yaml, <camera>.marks.csv}, offsets/,
people/, boxes/, checks/.
OUTPUTS: a `Project`, whose paths are strings relative to `root`, Snakemake's working directory. A session that a bump
splits counts as two (dior/project/bumps.py). Nothing else is globbed: the sheets and session.yaml say what exists. It
is read each time Snakemake parses the workflow, so this module loads no numerics, and YAML and the schemas' validator
only when asked.

People are called by their pseudonyms as soon as the sheets are checked, so that no step, parameter, log or table has a
name. Who did not agree to be processed (dior/project/consent.py) is not there: the rows are dropped as soon as the
sheets are read, and what else names one of these sequences is left alone or, where nothing is left without it,
complained about.
"""

import os
from collections.abc import Iterable, Mapping
from dataclasses import replace
from datetime import date
from pathlib import Path
from typing import Any

from dior.errors import DiorError, Faults
from dior.paths import AnyPath
from dior.project import bumps, cross_checks, licenses, publication, sessions, todos
from dior.project.consent import consents, processed
from dior.project.contents import Project
from dior.project.schema_check import Row, Rows, check, columns_of, read_sheet, read_yaml
from dior.project.todos import Todo


def load(root: AnyPath, config: dict[str, Any] | None = None) -> Project:
    """Read and check the project in the folder `root`; DiorError names what is wrong, a line for each mistake.

    What one file says of another is looked at when each is right in itself. Where something is still TODO, that is all
    that is told.

    `config` is the content of config.yaml where the caller has read it already (Snakemake's `config`, which may hold
    changes made on its command line).
    """
    todos.check(root)
    faults = Faults()
    project = as_far_as_it_goes(root, faults, config)
    faults.tell()
    assert project is not None
    return project


def as_far_as_it_goes(
    root: AnyPath, faults: Faults, config: dict[str, Any] | None = None, unfinished: Iterable[Todo] = ()
) -> Project | None:
    """The same, what is wrong being kept in `faults`: without the sessions whose files are wrong, or `unfinished`,
    their walks excluded; None where nothing is left, or where the config or a sheet is wrong or unfinished. Cameras
    that are only not marked yet are there.

    What is kept may be of the `unfinished` values, too: the word is in such a sentence."""
    root = Path(root)
    # by the folders of their files
    to_do = {os.path.dirname(todo.path) for todo in unfinished}
    with faults.kept():
        config = _plain(config) if config is not None else read_config(root)
        check(config, "config", "config/config.yaml")
        cross_checks.check_config(config)
        licenses.check(config["release"], root)
        publication.check(config["release"])
    with faults.kept():
        (rows, lines), (people, _) = sheets(root)
    with faults.kept():
        gallery, gallery_lines = _optional_sheet(root, "gallery", ("subject", "outfit", "angle"))
    with faults.kept():
        detectors, detector_lines = _optional_sheet(root, "detectors", ("sequence", "camera", "tool", "zoom"))
    with faults.kept():
        # only the report and the step mocap read what is in them, the former hours later
        _optional_sheet(root, "effort", ("what",))
    with faults.kept():
        _optional_sheet(root, "markers", ("name", "format"))
    if faults.found or config is None:
        sessions.check_alone(root, faults)
        return None
    with faults.kept():
        _check_anything(rows, people, root)
    if faults.found:
        return None
    rows, withheld = processed(bumps.in_parts(root, rows), people)
    project = Project(
        root, config, rows, {name: row for name, row in people.items() if consents(row, "processing")},
        gallery=processed(gallery, people)[0], withheld=withheld,
        detectors={name: row for name, row in detectors.items() if row["sequence"] not in withheld},
    )  # fmt: skip
    with faults.kept():
        cross_checks.check_sheets(project, people, lines)
    with faults.kept():
        cross_checks.check_gallery(project, people, gallery_lines)
    if faults.found or "config" in to_do:
        sessions.check_alone(root, faults)
        return None
    project = _by_pseudonym(project, people)
    broken = set()
    for session in project.sessions:
        before = len(faults.found)
        with faults.kept():
            sessions.read(project, session)
        if session not in project.session_files:
            sessions.check_cameras_alone(root, bumps.session_folder(session), faults)
        wrong = [fault for fault in faults.found[before:] if not isinstance(fault, cross_checks.NotMarked)]
        if wrong or os.path.dirname(project.session_file(session)) in to_do:
            broken.add(session)
    left = _without(project, broken) if broken else project
    if left is not None:
        with faults.kept():
            cross_checks.check_sessions(left, lines)
        with faults.kept():
            cross_checks.check_detectors(left, detector_lines)
    return left


def _check_anything(rows: Rows, people: Rows, root: Path) -> None:
    """Raise DiorError where there is no walk that may be processed."""
    if not rows:
        raise DiorError("config/sequences.tsv has no rows yet: enter one row per recorded walk")
    used, _ = processed(bumps.in_parts(root, rows), people)
    if not used:
        raise DiorError(
            "config/subjects.tsv: nobody agreed to be processed, so there is nothing to do; consent_processing is yes "
            "for those who did, or, where it is left out, consent_release. `dior forget` lists what is left of others"
        )
    if all(row["exclude_reason"] for row in used.values()):
        raise DiorError("config/sequences.tsv: every row has an exclude_reason, so there is nothing to process")


def _without(project: Project, broken: set[str]) -> Project | None:
    """The project, the walks of the sessions `broken` excluded; None where these are all."""
    reason = "its session's files are wrong"
    rows = {
        name: row | ({"exclude_reason": reason} if row["session"] in broken and not row["exclude_reason"] else {})
        for name, row in project.rows.items()
    }
    left = replace(project, rows=rows)
    return left if left.sequences else None


def read_config(root: AnyPath) -> dict[str, Any]:
    """The content of config.yaml, not checked yet. Raises DiorError where it is not there or no YAML with keys."""
    shown = "config/config.yaml"
    path = Path(root) / shown
    if not path.exists():
        raise DiorError(
            f"{shown}: there is no such file; name the folder that holds config/ (`dior check <folder>`, `dior run "
            "<folder>`), or make one with `dior init <folder>`"
        )
    content = read_yaml(path, shown)
    if not isinstance(content, dict):
        raise DiorError(f"{shown}: is a {type(content).__name__}, not keys with values such as `data_root: data`")
    return content


def _by_pseudonym(project: Project, people: Rows) -> Project:
    """The project with every subject called by the pseudonym. `people`: all rows of subjects.tsv."""
    pseudonyms = {name: row["pseudonym"] for name, row in people.items()}

    def hidden(row: Row) -> Row:
        # an excluded row may be of somebody who is in no sheet
        return {**row, "subject": pseudonyms.get(row["subject"], "")}

    return replace(
        project,
        rows={name: hidden(row) for name, row in project.rows.items()},
        withheld={name: hidden(row) for name, row in project.withheld.items()},
        gallery={(pseudonyms[name[0]], *name[1:]): hidden(row) for name, row in project.gallery.items()},
        subjects={row["pseudonym"]: hidden(row) for row in project.subjects.values()},
        pseudonyms=pseudonyms,
    )


def sheets(root: AnyPath) -> tuple[tuple[Rows, dict[str, int]], tuple[Rows, dict[str, int]]]:
    """Rows by name and their lines, of sequences.tsv and of subjects.tsv. Raises DiorError for both together."""
    sequences, subjects = "config/sequences.tsv", "config/subjects.tsv"
    faults = Faults()
    with faults.kept():
        walks = _needed_sheet(root, sequences, "sequence")
    with faults.kept():
        people = _needed_sheet(root, subjects, "subject")
    faults.tell()
    return walks, people


def _needed_sheet(root: AnyPath, shown: str, key: str) -> tuple[Rows, dict[str, int]]:
    kind = f"{key}s"
    if not os.path.lexists(Path(root, shown)):
        raise DiorError(
            f"{shown}: there is no such file; write one with a row for each {key} and the columns "
            f"{', '.join(columns_of(kind))}, separated by tabs (`dior init <new folder>` makes one to copy)"
        )
    return read_sheet(Path(root, shown), kind, key, shown)


def _optional_sheet(
    root: AnyPath, kind: str, key: tuple[str, ...]
) -> tuple[dict[tuple[str, ...], Row], dict[tuple[str, ...], int]]:
    """Rows of a sheet and their lines; none where there is no such sheet."""
    path = Path(root) / f"config/{kind}.tsv"
    return read_sheet(path, kind, key, f"config/{kind}.tsv") if os.path.lexists(path) else ({}, {})


def _plain(mapping: Mapping[str, Any]) -> dict[str, Any]:
    """A copy made of plain dicts, so that filling in defaults leaves the caller's config alone.

    Snakemake makes a day of what looks like one, and the schema knows text.
    """
    return {
        k: _plain(v) if isinstance(v, dict) else v.isoformat() if isinstance(v, date) else v for k, v in mapping.items()
    }
