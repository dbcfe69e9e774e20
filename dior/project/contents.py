"""`Project`: what a project's files say, as the workflow, the report and the release ask it.

Paths are strings relative to `root`, Snakemake's working directory; only those of hand-made files that may be missing
are looked for. `dior.project.project.load` makes it. Loads no numerics.
"""

import os
from collections.abc import Collection, Iterable
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from dior.errors import DiorError, nearest
from dior.project import bumps
from dior.project.consent import consents
from dior.project.marks_file import MarkedLines, read_marks
from dior.project.schema_check import Row, Rows, read_yaml


@dataclass(frozen=True)
class Project:
    """What the workflow and the release know of a project. `rows` and `subjects`: sheet rows by name, as strings, of
    those who agreed to be processed; `withheld`: the rows of the other sequences, by which only names are checked;
    `gallery`: those of gallery.tsv by (subject, outfit, angle); `detectors`: those of detectors.tsv by (sequence,
    camera, tool, zoom). A subject is the pseudonym in all of them; `pseudonyms` tells by the name in the sheet, which
    nothing but the reading of config/ asks: what is made of a person is found, and forgotten, without the name.

    `session_files` and `camera_files`: contents of session.yaml by session and of the camera YAMLs by session and
    camera, defaults filled in. `marks`: by (session, camera), the sequences named in the marks, in order, each with
    the line of its first mark and that of its first mark without x, y, z (None if all have them). `left_out`: what the
    calibration does not use for want of consent, (scope, sentence) without a name of a person or sequence.
    """

    root: Path
    config: dict[str, Any]
    rows: Rows
    subjects: Rows
    session_files: dict[str, dict[str, Any]] = field(default_factory=dict)
    camera_files: dict[str, dict[str, dict[str, Any]]] = field(default_factory=dict)
    marks: dict[tuple[str, str], MarkedLines] = field(default_factory=dict)
    gallery: dict[tuple[str, ...], Row] = field(default_factory=dict)
    detectors: dict[tuple[str, ...], Row] = field(default_factory=dict)
    withheld: Rows = field(default_factory=dict)
    left_out: list[tuple[str, str]] = field(default_factory=list)
    pseudonyms: dict[str, str] = field(default_factory=dict, repr=False)

    @property
    def data_root(self) -> str:
        return self.config["data_root"]

    @cached_property
    def sequences(self) -> tuple[str, ...]:
        """Names of the processed sequences, by session, session_order and name."""
        kept = [row for row in self.rows.values() if not row["exclude_reason"]]
        kept.sort(key=lambda row: (row["session"], int(row["session_order"]), row["sequence"]))
        return tuple(row["sequence"] for row in kept)

    def named(self, sequences: Iterable[str] | None) -> list[str]:
        """The processed `sequences` that somebody names, each once; all where none is named. Raises DiorError for
        others."""
        for name in sequences or ():
            if name not in self.sequences:
                raise DiorError(f"{self.root}: no sequence '{name}'{nearest(name, self.sequences)} is processed")
        return list(dict.fromkeys(sequences or self.sequences))

    @cached_property
    def excluded(self) -> dict[str, str]:
        """Reasons by name of the sequences that are not processed."""
        return {name: row["exclude_reason"] for name, row in self.rows.items() if row["exclude_reason"]}

    @cached_property
    def sessions(self) -> tuple[str, ...]:
        """Sessions of the processed sequences, sorted."""
        return tuple(sorted({self.rows[name]["session"] for name in self.sequences}))

    @cached_property
    def processed_subjects(self) -> tuple[str, ...]:
        """Subjects of the processed sequences, sorted."""
        return tuple(sorted({self.rows[name]["subject"] for name in self.sequences}))

    @cached_property
    def released_subjects(self) -> tuple[str, ...]:
        """Subjects of the processed sequences who consent to the release, sorted."""
        return tuple(name for name in self.processed_subjects if self.consents(name, "release"))

    @cached_property
    def released_sequences(self) -> tuple[str, ...]:
        """The processed sequences of the released subjects."""
        return tuple(name for name in self.sequences if self.rows[name]["subject"] in self.released_subjects)

    @cached_property
    def unanswered(self) -> int:
        """The number of released subjects of whom the sheet does not say whether their pictures may be, too."""
        return sum(not self.subjects[name].get("consent_pictures") for name in self.released_subjects)

    def consents(self, subject: str, purpose: str) -> bool:
        """Whether a subject agreed to a purpose: processing, release or pictures (dior/project/consent.py)."""
        return subject in self.subjects and consents(self.subjects[subject], purpose)

    def pictures_released(self, sequence: str) -> bool:
        """Whether the pictures of a sequence may be published."""
        return self.consents(self.subject_of(sequence), "pictures")

    def shaping(self, session: str) -> list[str]:
        """Sequences of a session, in order, whose pictures and people may tell where its cameras are.

        The poses are published with the labels of those who consent to the release, so only these shape them. Where
        nobody of the session does, nothing is published, and everybody who is processed may.
        """
        here = self.sequences_of(session)
        return [name for name in here if name in self.released_sequences] or here

    def barred(self, session: str) -> set[str]:
        """Sequences of all parts of a session that must not shape the poses of this one."""
        folder = bumps.session_folder(session)
        published = set(self.sequences_of(session)) & set(self.released_sequences)
        return {
            name
            for name, row in {**self.rows, **self.withheld}.items()
            if bumps.session_folder(row["session"]) == folder
            and (name in self.withheld or published and not self.consents(row["subject"], "release"))
        }

    def sequence(self, name: str) -> Row:
        """The sheet's row of a sequence."""
        return self.rows[name]

    def subject_of(self, sequence: str) -> str:
        return self.rows[sequence]["subject"]

    def session_of(self, sequence: str) -> str:
        return self.rows[sequence]["session"]

    def indoor(self, sequence: str) -> bool:
        return self.rows[sequence]["environment"] == "indoor"

    def sequences_of(self, session: str) -> list[str]:
        """Processed sequences of a session, in the order of recording."""
        return [name for name in self.sequences if self.rows[name]["session"] == session]

    def first_sequence(self, session: str) -> str:
        return self.sequences_of(session)[0]

    def order(self, name: str) -> tuple[int, str]:
        """The place of a sequence in its session's order of recording."""
        return int({**self.rows, **self.withheld}[name]["session_order"]), name

    def sequences_of_subject(self, subject: str) -> list[str]:
        return [name for name in self.sequences if self.rows[name]["subject"] == subject]

    def cameras(self, session: str) -> dict[str, dict[str, Any]]:
        """Cameras of a session in the order of session.yaml: name -> content of the camera's YAML."""
        return self.camera_files[session]

    def cameras_of(self, sequence: str) -> list[str]:
        """Names of the cameras of a sequence's session."""
        return list(self.camera_files[self.session_of(sequence)])

    def close(self, session: str) -> list[str]:
        return [name for name, camera in self.camera_files[session].items() if camera["role"] == "close"]

    def followed(self, sequence: str) -> list[str]:
        """Cameras whose clock is found by the known walker: long-range ones, and those that are aligned to him."""
        return [
            name
            for name, camera in self.camera_files[self.session_of(sequence)].items()
            if camera["locate"] == "align" or camera["role"] == "long_range" and not self.indoor(sequence)
        ]

    def clocked(self, sequence: str) -> list[str]:
        """The other cameras."""
        return [name for name in self.cameras_of(sequence) if name not in self.followed(sequence)]

    def window(self, session: str) -> dict[str, dict[str, int]]:
        """Instants that the adjustment uses: sequence -> {first, count, step}; empty means no adjustment."""
        return self.session_files[session]["adjust"]

    def final_cameras(self, session: str, camera: str) -> str:
        """The table with the final pose of a camera."""
        how = self.cameras(session)[camera]["locate"]
        if how == "marks":
            return f"results/locate/{session}/{camera}.parquet"
        if how == "align":
            return f"results/align/{session}/{camera}.parquet"
        if self.window(session) and camera in self.close(session):
            return f"results/adjust/{session}.parquet"
        return self.first_cameras(session, camera)

    def first_cameras(self, session: str, camera: str) -> str:
        """The table with the pose of a camera before anything is adjusted."""
        if self.cameras(session)[camera]["locate"] == "reference":
            return f"results/reference/{session}.parquet"
        return f"results/place/{session}/{camera}.parquet"

    def skeleton_table(self, sequence: str) -> str:
        """The table with a sequence's 3D: mocap indoors, outdoors the triangulation, refined unless that is off."""
        outdoor = "triangulate" if self.config["refine"]["method"] == "none" else "refine"
        return f"results/{'mocap' if self.indoor(sequence) else outdoor}/{sequence}.parquet"

    def label_tables(self, sequence: str) -> list[str]:
        """The tables with the labels of a sequence, one a camera."""
        return [f"results/reproject/{sequence}.{camera}.parquet" for camera in self.cameras_of(sequence)]

    def clock_tables(self, sequence: str, cameras: Iterable[str], kind: str = "") -> list[str]:
        """The tables with the clocks of some cameras in a sequence; `kind`: another table of the same steps."""
        followed, indoor = self.followed(sequence), self.indoor(sequence)
        return list(
            dict.fromkeys(
                f"results/follow/{sequence}.{camera}{kind}.parquet"
                if camera in followed
                else f"results/clocks/{sequence}{f'.{camera}' if indoor else ''}{kind}.parquet"
                for camera in cameras
            )
        )

    def camera_tables(self, session: str, cameras: Iterable[str]) -> list[str]:
        """The tables with the final poses of some cameras of a session."""
        return list(dict.fromkeys(self.final_cameras(session, camera) for camera in cameras))

    def covariance_table(self, session: str, camera: str) -> str:
        """The table with the uncertainty of a camera's pose; "" where the step that gives the pose does not know it."""
        path = self.final_cameras(session, camera)
        known = ("results/locate/", "results/align/", "results/adjust/", "results/reference/")
        return path.replace(".parquet", ".covariance.parquet") if path.startswith(known) else ""

    def heads_checked(self, session: str) -> dict[str, str]:
        """Cameras whose pictures are released although dior does not say that the heads are covered: name -> reason."""
        return self.session_files[session].get("heads_checked", {})

    def privacy_masks(self, session: str) -> dict[str, list[list[float]]]:
        """Rectangles (u_min, v_min, u_max, v_max) px that are covered in all released pictures, by camera."""
        return self.session_files[session].get("privacy_masks", {})

    def labels_accepted(self, session: str) -> dict[str, str]:
        """Labels that are released although their light is red: "<sequence>" or "<sequence>/<camera>" -> reason.

        Of all parts of a session that a bump splits.
        """
        return self.session_files[session].get("labels_accepted", {})

    def detections_checked(self, session: str) -> dict[str, str]:
        """Cameras whose detections are used although dior says that they lie beside the pictures: name -> reason."""
        return self.session_files[session].get("detections_checked", {})

    def tag_sequence(self, session: str) -> str:
        """The sequence in whose pictures the AprilTag lies."""
        return self.session_files[session].get("tag", {}).get("sequence") or self.shaping(session)[0]

    def metric_facts(self, session: str) -> dict[str, Any]:
        """What is known in metres of a session that is adjusted, subjects replaced by their sequences of the window.

        `heights`: of the window's subjects, where subjects.tsv has them, to judge the adjusted people by; `stature`:
        those of them that the adjustment uses.
        """
        settings, window = self.session_files[session], self.window(session)

        def sequences(subject: str) -> list[str]:
            return [name for name in window if self.subject_of(name) == subject]

        known: dict[str, Any] = {key: settings[key] for key in ("distances", "scale_bar", "floor") if key in settings}
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
        known["stature"] = [fact for fact in known["heights"] if settings.get("stature") and fact["sigma_m"]]
        return known

    def marks_sequences(self, session: str, camera: str) -> list[str]:
        """Sequences named in the camera's marks, in order."""
        return list(self.marks.get((session, camera), {}))

    def clicked(self, session: str, camera: str) -> list[str]:
        """Sequences, in order, in whose pictures something is marked that may tell where the session's cameras are."""
        path, barred = self.marks_file(session, camera), self.barred(session)
        return [name for name in read_marks(self.root / path, path) if name not in barred]

    def marks_mocap(self, session: str, camera: str) -> list[str]:
        """Those of them whose motion capture the marks need: a mark without x, y, z is a marker of the C3D."""
        return [name for name, (_, without) in self.marks.get((session, camera), {}).items() if without]

    def in_data(self, path: str) -> str:
        """A path of the sheets or of a camera's YAML, as seen from the project's root."""
        return os.path.join(self.data_root, path)

    def bags(self, sequence: str) -> list[str]:
        return [self.in_data(bag) for bag in bags_of(self.rows[sequence])]

    def videos(self, sequence: str) -> dict[str, str]:
        """Videos or folders of pictures of the cameras that are in no bag: camera -> path."""
        return self._of_cameras(sequence, "videos")

    def sidecars(self, sequence: str) -> dict[str, str]:
        """CSV files with the stamps of their pictures: camera -> path."""
        return self._of_cameras(sequence, "stamps")

    def _of_cameras(self, sequence: str, column: str) -> dict[str, str]:
        row = self.rows[sequence]
        pattern = row[column] if row["videos"] else ""
        filmed = self.filmed(sequence) if pattern else []
        return {camera: self.in_data(pattern.format(camera=camera).rstrip("/")) for camera in filmed}

    def filmed(self, sequence: str) -> list[str]:
        """Cameras of a sequence that are in no bag: those without a topic, or all where it has no bags."""
        cameras = self.camera_files[self.session_of(sequence)]
        return [name for name, camera in cameras.items() if not camera["topic"] or not bags_of(self.rows[sequence])]

    def topics(self, sequence: str) -> dict[str, str]:
        """By camera the topic of its pictures, or the stream of its video (dior/ingest/videos.py)."""
        cameras, filmed = self.camera_files[self.session_of(sequence)], self.filmed(sequence)
        return {name: stream_of(camera) if name in filmed else camera["topic"] for name, camera in cameras.items()}

    def video_rates(self, sequence: str) -> dict[str, str]:
        """Pictures per second by camera, where they are given for its videos."""
        cameras = self.camera_files[self.session_of(sequence)]
        return {
            name: str(cameras[name]["video"]["fps"])
            for name in self.filmed(sequence)
            if "fps" in cameras[name]["video"]
        }

    def picture_files(self, sequence: str) -> list[str]:
        """What the pictures of a sequence, and their stamps, are read from."""
        of_cameras = [*self.videos(sequence).values(), *self.sidecars(sequence).values()]
        return list(dict.fromkeys([*self.bags(sequence), *of_cameras]))

    def mocap(self, sequence: str) -> list[str]:
        return self._optional(sequence, "mocap")

    def trigger_log(self, sequence: str) -> list[str]:
        path = self.rows[sequence]["trigger_log"].partition("#")[0].strip()
        return [self.in_data(path)] if path else []

    def capture(self, sequence: str) -> str:
        """What the capture is called in the trigger log, where the sheet says so: `trigger.jsonl#walk_03`."""
        return self.rows[sequence]["trigger_log"].partition("#")[2].strip()

    def mocap_settings(self, sequence: str) -> dict[str, str]:
        """How its C3D is read: `units` ("" to take the file's word), `up`, and the `prefix` of the subject's labels."""
        given = self.session_files[self.session_of(sequence)]["mocap"]
        names = {pseudonym: name for name, pseudonym in self.pseudonyms.items()}
        prefix = given["prefix"].get(names[self.subject_of(sequence)], "")
        return {"units": given.get("units", ""), "up": given.get("up", ""), "prefix": prefix}

    def truth(self, sequence: str) -> list[str]:
        return self._optional(sequence, "truth")

    def _optional(self, sequence: str, column: str) -> list[str]:
        path = self.rows[sequence][column]
        return [self.in_data(path)] if path else []

    def detected_here(self, sequence: str) -> bool:
        """Whether the sheet asks for the project's own detector."""
        return self.rows[sequence]["detections"] == "detect"

    def detections_pattern(self, sequence: str) -> str:
        """Path of the detections with {camera} in it, or "" where there are none."""
        pattern = self.rows[sequence]["detections"]
        if self.detected_here(sequence):
            return f"results/detect/{sequence}.{{camera}}.json"
        return self.in_data(pattern) if pattern else ""

    def recordings(self, sequence: str) -> dict[str, str]:
        """Paths of a sequence's recordings by what they are for: `bag_1`, `video.cam1`, `stamps.cam1`, `mocap`,
        `trigger_log`, `detections.cam1`."""
        found = {f"bag_{number}": path for number, path in enumerate(self.bags(sequence), start=1)}
        found |= {f"video.{camera}": path for camera, path in self.videos(sequence).items()}
        found |= {f"stamps.{camera}": path for camera, path in self.sidecars(sequence).items()}
        found.update(zip(("mocap",), self.mocap(sequence), strict=False))
        found.update(zip(("trigger_log",), self.trigger_log(sequence), strict=False))
        pattern = "" if self.detected_here(sequence) else self.detections_pattern(sequence)
        close = self.close(self.session_of(sequence)) if pattern else []
        return found | {f"detections.{camera}": pattern.format(camera=camera) for camera in close}

    def detectors_of(self, sequence: str) -> list[dict[str, str]]:
        """Outputs of other detectors: dicts camera, tool, zoom, path (as seen from the root) and, where it is given,
        first_frame, sorted."""
        mine = [row for _, row in sorted(self.detectors.items()) if row["sequence"] == sequence]
        return [
            {
                **{key: row[key] for key in ("camera", "tool", "zoom", "first_frame") if row[key]},
                "path": self.in_data(row["path"].rstrip("/")),
            }
            for row in mine
        ]

    def gallery_files(self) -> list[str]:
        """Folders and bags of the gallery's pictures."""
        return [self.in_data((row["path"] or row["bag"]).rstrip("/")) for row in self.gallery.values()]

    def whole_session(self, session: str) -> list[str]:
        """Processed sequences of a session with all its parts."""
        folder = bumps.session_folder(session)
        return [name for name in self.sequences if bumps.session_folder(self.session_of(name)) == folder]

    def session_file(self, session: str) -> str:
        return f"config/sessions/{bumps.session_folder(session)}/session.yaml"

    def camera_file(self, session: str, camera: str) -> str:
        return bumps.file_of(self.root, session, camera, ".yaml", {**self.rows, **self.withheld})

    def marks_file(self, session: str, camera: str) -> str:
        return bumps.file_of(self.root, session, camera, ".marks.csv", {**self.rows, **self.withheld})

    def offsets(self, sequence: str) -> list[str]:
        """[path] of the offsets given by hand, or []."""
        path = f"config/offsets/{sequence}.yaml"
        return [path] if self._exists(path) else []

    def clocked_by_hand(self, sequence: str) -> list[str]:
        """Cameras whose clock a person gave."""
        return sorted(camera for path in self.offsets(sequence) for camera in read_yaml(self.root / path, path))

    def clocks_by_hand(self, sequence: str, cameras: Collection[str]) -> list[tuple[str, str]]:
        """What a person wrote of the clocks of these cameras, by camera."""
        given = [read_yaml(self.root / path, path) for path in self.offsets(sequence)]
        return sorted((name, repr(said)) for one in given for name, said in one.items() if name in cameras)

    def seeds(self, sequence: str) -> list[str]:
        """[path] of the file in which a person pointed at the subject, or []."""
        path = f"config/people/{sequence}.yaml"
        return [path] if self._exists(path) else []

    def boxes(self, sequence: str) -> dict[str, str]:
        """Hand-drawn boxes: camera -> file, where there is one."""
        return self._per_camera("boxes", sequence)

    def checks(self, sequence: str) -> dict[str, str]:
        """Hand checks: camera -> file, where there is one."""
        return self._per_camera("checks", sequence)

    def earlier_heads(self, sequence: str, camera: str) -> list[str]:
        """[path] of the table that an earlier release covered the head by, or []."""
        path = f"config/heads/{sequence}.{camera}.parquet"
        return [path] if self._exists(path) else []

    def marker_names(self) -> list[str]:
        """The sheet of a lab's own names of markers, if there is one."""
        return ["config/markers.tsv"] if self._exists("config/markers.tsv") else []

    def effort(self) -> list[str]:
        """[path] of the sheet of manual work, or []."""
        return ["config/effort.tsv"] if self._exists("config/effort.tsv") else []

    def _per_camera(self, folder: str, sequence: str) -> dict[str, str]:
        paths = {camera: f"config/{folder}/{sequence}.{camera}.csv" for camera in self.cameras_of(sequence)}
        return {camera: path for camera, path in paths.items() if self._exists(path)}

    def _exists(self, path: str) -> bool:
        """Whether a file that need not be there is. Raises DiorError for one that is no file: it would be left out."""
        there = os.path.join(self.root, path)
        if os.path.lexists(there) and not os.path.isfile(there):
            what = "is a folder" if os.path.isdir(there) else "is a link to nothing, or no plain file"
            raise DiorError(f"{path}: {what}; put the file there, or remove it")
        return os.path.isfile(there)


def stream_of(camera: dict[str, Any]) -> str:
    """What the stream of a camera's video is called, from the content of its YAML."""
    video = camera["video"]
    return f"video{video['stream']}" + ("/stored" if video["frame"] == "stored" else "")


def bags_of(row: Row) -> list[str]:
    """Bag paths of a sheet row, relative to data_root; a ROS 2 bag is a folder, which may be written with a slash."""
    return [bag.strip().rstrip("/") for bag in row["bags"].split(";") if bag.strip()]
