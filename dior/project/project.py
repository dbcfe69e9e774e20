"""A project folder: its config, sheets, sessions and cameras, read and checked as a whole.

INPUTS: `<root>/config/`: config.yaml, sequences.tsv, subjects.tsv; gallery.tsv, detectors.tsv and effort.tsv, which may
be missing; sessions/<session>/{session.yaml, <camera>.yaml, <camera>.marks.csv}, offsets/, boxes/, checks/. OUTPUTS: a
`Project`, whose paths are strings relative to `root`, Snakemake's working directory. A session that a bump splits
counts as two (dior/project/bumps.py). Nothing else is globbed: the sheets and session.yaml say what exists. It is read
each time Snakemake parses the workflow, so this module loads no numerics, and YAML and the schemas' validator only when
asked.

Who did not agree to be processed (dior/project/consent.py) is not there: the rows are dropped as soon as the sheets are
read, and what else names one of these sequences is left alone or, where nothing is left without it, complained about.
"""

import os
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from dior.errors import DiorError
from dior.project import bumps, licenses, sessions
from dior.project import check as consistency
from dior.project.consent import consents, processed
from dior.project.read import check, read_sheet, read_yaml


@dataclass(frozen=True)
class Project:
    """What the workflow and the release know of a project. `rows` and `subjects`: sheet rows by name, as strings, of
    those who agreed to be processed; `withheld`: the rows of the other sequences, by which only names are checked;
    `gallery`: those of gallery.tsv by (subject, outfit, angle); `detectors`: those of detectors.tsv by (sequence,
    camera, tool, zoom).

    `session_files` and `camera_files`: contents of session.yaml by session and of the camera YAMLs by session and
    camera, defaults filled in. `marks`: by (session, camera), the sequences named in the marks, in order, each with
    the line of its first mark and that of its first mark without x, y, z (None if all have them). `left_out`: what the
    calibration does not use for want of consent, (scope, sentence) without a name of a person or sequence.
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
    withheld: dict = field(default_factory=dict)
    left_out: list = field(default_factory=list)

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
        agreed = [name for name in self.processed_subjects if self.consents(name, "release")]
        return tuple(sorted(agreed, key=self.pseudonym))

    @cached_property
    def released_sequences(self):
        """The processed sequences of the released subjects."""
        return tuple(name for name in self.sequences if self.rows[name]["subject"] in self.released_subjects)

    @cached_property
    def unanswered(self):
        """The number of released subjects of whom the sheet does not say whether their pictures may be, too."""
        return sum(not self.subjects[name].get("consent_pictures") for name in self.released_subjects)

    def consents(self, subject, purpose):
        """Whether a subject agreed to a purpose: processing, release or pictures (dior/project/consent.py)."""
        return subject in self.subjects and consents(self.subjects[subject], purpose)

    def pictures_released(self, sequence):
        """Whether the pictures of a sequence may be published."""
        return self.consents(self.subject_of(sequence), "pictures")

    def shaping(self, session):
        """Sequences of a session, in order, whose pictures and people may tell where its cameras are.

        The poses are published with the labels of those who consent to the release, so only these shape them. Where
        nobody of the session does, nothing is published, and everybody who is processed may.
        """
        here = self.sequences_of(session)
        return [name for name in here if name in self.released_sequences] or here

    def barred(self, session):
        """Sequences of all parts of a session that must not shape the poses of this one."""
        folder = bumps.session_folder(session)
        published = set(self.sequences_of(session)) & set(self.released_sequences)
        return {
            name
            for name, row in {**self.rows, **self.withheld}.items()
            if bumps.session_folder(row["session"]) == folder
            and (name in self.withheld or published and not self.consents(row["subject"], "release"))
        }

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

    def order(self, name):
        """The place of a sequence in its session's order of recording."""
        return int({**self.rows, **self.withheld}[name]["session_order"]), name

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

    def tag_sequence(self, session):
        """The sequence in whose pictures the AprilTag lies."""
        return self.session_files[session].get("tag", {}).get("sequence") or self.shaping(session)[0]

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

    def clicked(self, session, camera):
        """Sequences, in order, in whose pictures something is marked that may tell where the session's cameras are."""
        path, barred = self.marks_file(session, camera), self.barred(session)
        return [name for name in sessions.read_marks(self.root / path, path) if name not in barred]

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
        return bumps.file_of(self.root, session, camera, ".yaml", {**self.rows, **self.withheld})

    def marks_file(self, session, camera):
        return bumps.file_of(self.root, session, camera, ".marks.csv", {**self.rows, **self.withheld})

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

    def earlier_heads(self, sequence, camera):
        """[path] of the table that an earlier release covered the head by, or []."""
        path = f"config/heads/{sequence}.{camera}.parquet"
        return [path] if self._exists(path) else []

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
    (rows, lines), (people, _) = sheets(root)
    if not rows:
        raise DiorError("config/sequences.tsv has no rows yet: enter one row per recorded walk")
    gallery, gallery_lines = _optional_sheet(root, "gallery", ("subject", "outfit", "angle"))
    detectors, detector_lines = _optional_sheet(root, "detectors", ("sequence", "camera", "tool", "zoom"))
    # only the report reads what is in it, hours later
    _optional_sheet(root, "effort", "what")
    rows, withheld = processed(bumps.in_parts(root, rows), people)
    project = Project(
        root, config, rows, {name: row for name, row in people.items() if consents(row, "processing")},
        gallery=processed(gallery, people)[0], withheld=withheld,
        detectors={name: row for name, row in detectors.items() if row["sequence"] not in withheld},
    )  # fmt: skip
    if not rows:
        raise DiorError(
            "config/subjects.tsv: nobody agreed to be processed, so there is nothing to do; consent_processing is yes "
            "for those who did, or, where it is left out, consent_release. `dior forget` lists what is left of others"
        )
    if not project.sequences:
        raise DiorError("config/sequences.tsv: every row has an exclude_reason, so there is nothing to process")
    consistency.check_sheets(project, people, lines)
    consistency.check_gallery(project, people, gallery_lines)
    for session in project.sessions:
        sessions.read(project, session)
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
