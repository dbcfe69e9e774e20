"""A project folder: its config, sheets, sessions and cameras, read and checked as a whole.

INPUTS: `<root>/config/`: config.yaml, sequences.tsv, subjects.tsv; gallery.tsv, detectors.tsv and effort.tsv, which may
be missing; sessions/<session>/{session.yaml, <camera>.yaml, <camera>.marks.csv}, offsets/, boxes/, checks/. OUTPUTS: a
`Project`, whose paths are strings relative to `root`, Snakemake's working directory. A session that a bump splits
counts as two (dior/bumps.py). Nothing else is globbed: the sheets and session.yaml say what exists. It is read each
time Snakemake parses the workflow, so this module loads no numerics, and YAML and the schemas' validator only when
asked.
"""

import csv
import os
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from dior import bumps, consistency, licenses
from dior.checked import check, read_sheet, read_yaml
from dior.consistency import consents
from dior.errors import DiorError, nearest

MARK_COLUMNS = ("sequence", "frame", "joint", "u", "v")


@dataclass(frozen=True)
class Project:
    """What the workflow and the release know of a project. `rows` and `subjects`: sheet rows by name, as strings;
    `gallery`: those of gallery.tsv by (subject, outfit, angle); `detectors`: those of detectors.tsv by (sequence,
    camera, tool, zoom).

    `session_files` and `camera_files`: contents of session.yaml by session and of the camera YAMLs by session and
    camera, defaults filled in. `marks`: by (session, camera), the sequences named in the marks, in order, each with
    the line of its first mark and that of its first mark without x, y, z (None if all have them).
    """

    root: Path
    config: dict
    rows: dict
    subjects: dict
    session_files: dict = field(default_factory=dict)
    camera_files: dict = field(default_factory=dict)
    marks: dict = field(default_factory=dict)
    gallery: dict = field(default_factory=dict)
    detectors: dict = field(default_factory=dict)

    @property
    def data_root(self):
        return self.config["data_root"]

    @cached_property
    def sequences(self):
        """Names of the processed sequences, by session, session_order and name."""
        kept = [row for row in self.rows.values() if not row["exclude_reason"]]
        kept.sort(key=lambda row: (row["session"], int(row["session_order"]), row["sequence"]))
        return tuple(row["sequence"] for row in kept)

    @cached_property
    def excluded(self):
        """Reasons by name of the sequences that are not processed."""
        return {name: row["exclude_reason"] for name, row in self.rows.items() if row["exclude_reason"]}

    @cached_property
    def sessions(self):
        """Sessions of the processed sequences, sorted."""
        return tuple(sorted({self.rows[name]["session"] for name in self.sequences}))

    @cached_property
    def processed_subjects(self):
        """Subjects of the processed sequences, sorted."""
        return tuple(sorted({self.rows[name]["subject"] for name in self.sequences}))

    @cached_property
    def released_subjects(self):
        """Subjects of the processed sequences who consent to the release, in the order of their pseudonyms."""
        agreed = [name for name in self.processed_subjects if consents(self.subjects[name])]
        return tuple(sorted(agreed, key=self.pseudonym))

    @cached_property
    def released_sequences(self):
        """The processed sequences of the released subjects."""
        return tuple(name for name in self.sequences if self.rows[name]["subject"] in self.released_subjects)

    def sequence(self, name):
        """The sheet's row of a sequence."""
        return self.rows[name]

    def subject_of(self, sequence):
        return self.rows[sequence]["subject"]

    def session_of(self, sequence):
        return self.rows[sequence]["session"]

    def indoor(self, sequence):
        return self.rows[sequence]["environment"] == "indoor"

    def pseudonym(self, subject):
        return self.subjects[subject]["pseudonym"]

    def sequences_of(self, session):
        """Processed sequences of a session, in the order of recording."""
        return [name for name in self.sequences if self.rows[name]["session"] == session]

    def first_sequence(self, session):
        return self.sequences_of(session)[0]

    def sequences_of_subject(self, subject):
        return [name for name in self.sequences if self.rows[name]["subject"] == subject]

    def cameras(self, session):
        """Cameras of a session in the order of session.yaml: name -> content of the camera's YAML."""
        return self.camera_files[session]

    def cameras_of(self, sequence):
        """Names of the cameras of a sequence's session."""
        return list(self.camera_files[self.session_of(sequence)])

    def close(self, session):
        return [name for name, camera in self.camera_files[session].items() if camera["role"] == "close"]

    def followed(self, sequence):
        """Cameras whose clock is found by the known walker: long-range ones, and those that are aligned to him."""
        return [
            name
            for name, camera in self.camera_files[self.session_of(sequence)].items()
            if camera["locate"] == "align" or camera["role"] == "long_range" and not self.indoor(sequence)
        ]

    def clocked(self, sequence):
        """The other cameras."""
        return [name for name in self.cameras_of(sequence) if name not in self.followed(sequence)]

    def window(self, session):
        """Instants that the adjustment uses: sequence -> {first, count, step}; empty means no adjustment."""
        return self.session_files[session]["adjust"]

    def metric_facts(self, session):
        """What is known in metres of a session that is adjusted, subjects replaced by their sequences of the window.

        `heights`: of the window's subjects, where subjects.tsv has them, to judge the adjusted people by.
        """
        settings, window = self.session_files[session], self.window(session)

        def sequences(subject):
            return [name for name in window if self.subject_of(name) == subject]

        known = {key: settings[key] for key in ("distances", "scale_bar", "floor") if key in settings}
        known["keypoint_distance"] = [
            {key: value for key, value in fact.items() if key != "subject"}
            | ({"sequences": sequences(fact["subject"])} if "subject" in fact else {})
            for fact in settings.get("keypoint_distance", [])
        ]
        known["heights"] = [
            {
                "subject": subject,
                "height_m": float(self.subjects[subject]["height_m"]),
                "sigma_m": float(self.subjects[subject]["height_sigma_m"] or 0),
                "sequences": sequences(subject),
            }
            for subject in sorted({self.subject_of(name) for name in window})
            if self.subjects[subject]["height_m"]
        ]
        told = [fact for fact in known["heights"] if settings.get("stature") and fact["sigma_m"]]
        known["stature"] = [{key: value for key, value in fact.items() if key != "subject"} for fact in told]
        return known

    def marks_sequences(self, session, camera):
        """Sequences named in the camera's marks, in order."""
        return list(self.marks.get((session, camera), {}))

    def marks_mocap(self, session, camera):
        """Those of them whose motion capture the marks need: a mark without x, y, z is a marker of the C3D."""
        return [name for name, (_, without) in self.marks.get((session, camera), {}).items() if without]

    def in_data(self, path):
        """A path of the sheets or of a camera's YAML, as seen from the project's root."""
        return os.path.join(self.data_root, path)

    def bags(self, sequence):
        return [self.in_data(bag) for bag in bags_of(self.rows[sequence])]

    def mocap(self, sequence):
        return self._optional(sequence, "mocap")

    def trigger_log(self, sequence):
        path = self.rows[sequence]["trigger_log"].partition("#")[0].strip()
        return [self.in_data(path)] if path else []

    def capture(self, sequence):
        """What the capture is called in the trigger log, where the sheet says so: `trigger.jsonl#walk_03`."""
        return self.rows[sequence]["trigger_log"].partition("#")[2].strip()

    def truth(self, sequence):
        return self._optional(sequence, "truth")

    def _optional(self, sequence, column):
        path = self.rows[sequence][column]
        return [self.in_data(path)] if path else []

    def detected_here(self, sequence):
        """Whether the sheet asks for the project's own detector."""
        return self.rows[sequence]["detections"] == "detect"

    def detections_pattern(self, sequence):
        """Path of the detections with {camera} in it, or "" where there are none."""
        pattern = self.rows[sequence]["detections"]
        if self.detected_here(sequence):
            return f"results/detect/{sequence}.{{camera}}.json"
        return self.in_data(pattern) if pattern else ""

    def detectors_of(self, sequence):
        """Outputs of other detectors: dicts camera, tool, zoom, path (as seen from the root), sorted."""
        mine = [row for _, row in sorted(self.detectors.items()) if row["sequence"] == sequence]
        return [
            {**{key: row[key] for key in ("camera", "tool", "zoom")}, "path": self.in_data(row["path"].rstrip("/"))}
            for row in mine
        ]

    def gallery_files(self):
        """Folders and bags of the gallery's pictures."""
        return [self.in_data((row["path"] or row["bag"]).rstrip("/")) for row in self.gallery.values()]

    def whole_session(self, session):
        """Processed sequences of a session with all its parts."""
        folder = bumps.session_folder(session)
        return [name for name in self.sequences if bumps.session_folder(self.session_of(name)) == folder]

    def session_file(self, session):
        return f"config/sessions/{bumps.session_folder(session)}/session.yaml"

    def camera_file(self, session, camera):
        return bumps.file_of(self.root, session, camera, ".yaml", self.rows)

    def marks_file(self, session, camera):
        return bumps.file_of(self.root, session, camera, ".marks.csv", self.rows)

    def offsets(self, sequence):
        """[path] of the offsets given by hand, or []."""
        path = f"config/offsets/{sequence}.yaml"
        return [path] if self._exists(path) else []

    def boxes(self, sequence):
        """Hand-drawn boxes: camera -> file, where there is one."""
        return self._per_camera("boxes", sequence)

    def checks(self, sequence):
        """Hand checks: camera -> file, where there is one."""
        return self._per_camera("checks", sequence)

    def effort(self):
        """[path] of the sheet of manual work, or []."""
        return ["config/effort.tsv"] if self._exists("config/effort.tsv") else []

    def _per_camera(self, folder, sequence):
        paths = {camera: f"config/{folder}/{sequence}.{camera}.csv" for camera in self.cameras_of(sequence)}
        return {camera: path for camera, path in paths.items() if self._exists(path)}

    def _exists(self, path):
        return os.path.exists(os.path.join(self.root, path))


def bags_of(row):
    """Bag paths of a sheet row, relative to data_root; a ROS 2 bag is a folder, which may be written with a slash."""
    return [bag.strip().rstrip("/") for bag in row["bags"].split(";") if bag.strip()]


def load(root, config=None):
    """Read and check the project in the folder `root`; DiorError names the first thing that is wrong.

    `config` is the content of config.yaml where the caller has read it already (Snakemake's `config`, which may hold
    changes made on its command line).
    """
    root = Path(root)
    config = _plain(config) if config is not None else read_yaml(root / "config/config.yaml", "config/config.yaml")
    check(config, "config", "config/config.yaml")
    licenses.check(config["release"], root)
    (rows, lines), (subjects, _) = sheets(root)
    if not rows:
        raise DiorError("config/sequences.tsv has no rows yet: enter one row per recorded walk")
    gallery, gallery_lines = _optional_sheet(root, "gallery", ("subject", "outfit", "angle"))
    detectors, detector_lines = _optional_sheet(root, "detectors", ("sequence", "camera", "tool", "zoom"))
    # only the report reads what is in it, hours later
    _optional_sheet(root, "effort", "what")
    rows = bumps.in_parts(root, rows)
    project = Project(root, config, rows, subjects, gallery=gallery, detectors=detectors)
    if not project.sequences:
        raise DiorError("config/sequences.tsv: every row has an exclude_reason, so there is nothing to process")
    consistency.check_sheets(project, lines)
    consistency.check_gallery(project, gallery_lines)
    for session in project.sessions:
        _read_session(project, session)
    consistency.check_sessions(project, lines)
    consistency.check_detectors(project, detector_lines)
    return project


def sheets(root):
    """Rows by name and their lines, of sequences.tsv and of subjects.tsv."""
    return tuple(
        read_sheet(Path(root) / f"config/{kind}.tsv", kind, key, f"config/{kind}.tsv")
        for kind, key in (("sequences", "sequence"), ("subjects", "subject"))
    )


def _optional_sheet(root, kind, key):
    """Rows of a sheet and their lines; none where there is no such sheet."""
    path = Path(root) / f"config/{kind}.tsv"
    return read_sheet(path, kind, key, f"config/{kind}.tsv") if path.is_file() else ({}, {})


def _plain(mapping):
    """A copy made of plain dicts, so that filling in defaults leaves the caller's config alone."""
    return {k: _plain(v) if isinstance(v, dict) else v for k, v in mapping.items()}


def _read_session(project, session):
    shown = project.session_file(session)
    content = check(read_yaml(project.root / shown, shown), "session", shown)
    repeated = [name for name in content["cameras"] if content["cameras"].count(name) > 1]
    if repeated:
        raise DiorError(f"{shown}: camera '{repeated[0]}' is listed twice")
    here, elsewhere = project.sequences_of(session), _elsewhere(project, session)
    content["adjust"] = {name: window for name, window in content["adjust"].items() if name not in elsewhere}
    if content.get("tag", {}).get("sequence") in elsewhere:
        content["tag"]["sequence"] = here[0]
    project.session_files[session] = content
    project.camera_files[session] = {name: _read_camera(project, session, name) for name in content["cameras"]}


def _elsewhere(project, session):
    """Sequences of the other parts of a session that a bump splits."""
    return set(project.whole_session(session)) - set(project.sequences_of(session))


def _read_camera(project, session, name):
    shown = project.camera_file(session, name)
    if not (project.root / shown).is_file():
        there = [file.removesuffix(".yaml") for file in sorted(os.listdir((project.root / shown).parent))]
        raise DiorError(
            f"{project.session_file(session)}: camera '{name}' has no file {shown}"
            f"{nearest(name, [n for n in there if n != 'session'])}"
        )
    camera = check(read_yaml(project.root / shown, shown), "camera", shown)
    consistency.check_camera(camera, shown)
    if "align" in camera:
        # the close cameras of each part have a world of their own
        elsewhere, listed = _elsewhere(project, session), camera["align"]["sequences"]
        camera["align"]["sequences"] = [sequence for sequence in listed if sequence not in elsewhere]
        if not camera["align"]["sequences"]:
            raise DiorError(
                f"{shown}: align.sequences has {', '.join(listed)}, none of session '{session}'; add a walk of that "
                "part of the session"
            )
    path = project.marks_file(session, name)
    if camera["locate"] == "marks":
        if not (project.root / path).is_file():
            raise DiorError(f"{shown}: 'locate: marks' needs the file {path}")
        project.marks[session, name] = _read_marks(project.root / path, path)
    return camera


def _read_marks(path, shown):
    """Sequences of a marks CSV, in order: name -> (its first line, the first line without x, y, z or None)."""
    with open(path, encoding="utf-8-sig", errors="replace", newline="") as stream:
        table = csv.DictReader(stream)
        for column in table.fieldnames or ():
            if column not in (*MARK_COLUMNS, *"xyz"):
                raise DiorError(f"{shown}: unknown column '{column}'{nearest(column, (*MARK_COLUMNS, *'xyz'))}")
        for column in MARK_COLUMNS:
            if column not in (table.fieldnames or ()):
                raise DiorError(f"{shown}: column '{column}' is missing; the file has {','.join(MARK_COLUMNS)}[,x,y,z]")
        lines = {}
        for mark in table:
            first, without = lines.get(mark["sequence"], (table.line_num, None))
            given = all(mark.get(axis) for axis in "xyz")
            lines[mark["sequence"]] = (first, without if given or without else table.line_num)
    return lines
