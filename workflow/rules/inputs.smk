"""Input and parameter functions of the rules, in the order of the stages. They only look things up in the project."""


def there(files):
    """A function for the files that exist, or will, of those that `files` names.

    Snakemake stops everything where an input is missing. So a missing recording is no input: the step that reads it
    says what is wrong, in its own words, and the other sequences go on.
    """

    def existing(wildcards):
        made = "simulate" in CONFIG
        return [path for path in files(wildcards) if made or os.path.exists(path)]

    return existing


def bags(wildcards):
    return PROJECT.bags(wildcards.sequence)


def gallery_files(wildcards):
    return PROJECT.gallery_files()


def topics(wildcards):
    cameras = PROJECT.cameras(session_of(wildcards))
    return [f"{name}={camera['topic']}" for name, camera in cameras.items()]


def mocap_file(wildcards):
    return PROJECT.mocap(wildcards.sequence)


def trigger_log(wildcards):
    return PROJECT.trigger_log(wildcards.sequence)


def capture(wildcards):
    return PROJECT.capture(wildcards.sequence)


def close_names(wildcards):
    return PROJECT.close(session_of(wildcards))


def detection_pattern(wildcards):
    return PROJECT.detections_pattern(wildcards.sequence)


def detection_files(wildcards):
    """The detections of the close cameras: as the sheet has them, where they exist, or those of rule detect."""
    if PROJECT.detected_here(wildcards.sequence):
        return recorded_detections(wildcards)
    return there(recorded_detections)(wildcards)


def detection_format(wildcards):
    """What rule detect writes is known."""
    here = PROJECT.detected_here(wildcards.sequence)
    return "coco" if here else CONFIG["detector"]["format"]


def detector_model(wildcards):
    return [CONFIG["detector"]["model"]]


def recorded_detections(wildcards):
    pattern = PROJECT.detections_pattern(wildcards.sequence)
    return [pattern.format(camera=camera) for camera in close_names(wildcards)]


def detection_folders(wildcards):
    """What is in the detections that are folders: a file written again in one does not change the folder's time."""
    return [folder_state(path) for path in detection_files(wildcards)]


def motion(wildcards):
    """The C3D whose walk the simulation uses, if any."""
    path = CONFIG["simulate"]["motion"]
    return [path] if path else []


def first_sequence(wildcards):
    return PROJECT.first_sequence(wildcards.session)


def first_frames(wildcards):
    return f"results/frames/{PROJECT.first_sequence(wildcards.session)}.parquet"


def setting(key):
    """A function that gives a setting of the camera's YAML, for a rule's params."""

    def value(wildcards):
        return PROJECT.cameras(wildcards.session)[wildcards.camera].get(key) or ""

    return value


def intrinsics_source(wildcards):
    """The file of a camera's intrinsics below data_root, `camera_info` for the bag's own, or `board`."""
    source = setting("intrinsics")(wildcards)
    return source.get("file", "board") if isinstance(source, dict) else source


def intrinsics_name(wildcards):
    source = setting("intrinsics")(wildcards)
    return source.get("name", "") if isinstance(source, dict) else ""


def intrinsics_board(wildcards):
    """The board that a camera's intrinsics are found with, by its kind, as JSON; {} where there is none."""
    source = setting("intrinsics")(wildcards)
    return json.dumps({} if not isinstance(source, dict) or "file" in source else source)


def intrinsics_file(wildcards):
    source = setting("intrinsics")(wildcards)
    if not isinstance(source, dict):
        return []
    return [PROJECT.in_data(source.get("file") or next(iter(source.values()))["path"])]


def tag_sequence(wildcards):
    tag = PROJECT.session_files[wildcards.session].get("tag", {})
    return tag.get("sequence") or PROJECT.first_sequence(wildcards.session)


def tag_frames(wildcards):
    """The pictures with the AprilTag, where a camera is placed by it."""
    if setting("locate")(wildcards) != "apriltag":
        return []
    return [f"results/frames/{tag_sequence(wildcards)}.parquet"]


def tag_bags(wildcards):
    if setting("locate")(wildcards) != "apriltag":
        return []
    return PROJECT.bags(tag_sequence(wildcards))


def tag(wildcards):
    """The session's AprilTag as JSON, {} for a camera that is not placed by it."""
    wanted = setting("locate")(wildcards) == "apriltag"
    return json.dumps(PROJECT.session_files[wildcards.session]["tag"] if wanted else {})


def reference_file(wildcards):
    if setting("locate")(wildcards) != "reference":
        return []
    return [PROJECT.in_data(setting("reference")(wildcards)["file"])]


def marked_mocap(wildcards):
    names = PROJECT.marks_mocap(wildcards.session, wildcards.camera)
    return [f"results/mocap/{sequence}.parquet" for sequence in names]


def marked_frames(wildcards):
    names = PROJECT.marks_sequences(wildcards.session, wildcards.camera)
    return [f"results/frames/{sequence}.parquet" for sequence in names]


def marked_offsets(wildcards):
    names = PROJECT.marks_sequences(wildcards.session, wildcards.camera)
    return [path for sequence in names for path in PROJECT.offsets(sequence)]


def adjusted(step):
    """Tables of a step for the sequences whose instants adjust uses."""

    def files(wildcards):
        names = PROJECT.window(wildcards.session)
        return [f"results/{step}/{sequence}.parquet" for sequence in names]

    return files


def adjusted_offsets(wildcards):
    names = PROJECT.window(wildcards.session)
    return [path for sequence in names for path in PROJECT.offsets(sequence)]


def placed(wildcards):
    return [
        f"results/place/{wildcards.session}/{camera}.parquet"
        for camera in PROJECT.close(wildcards.session)
    ]


def tag_marks(wildcards):
    """Where the cameras that are placed by the AprilTag saw its corners."""
    session = wildcards.session
    return [
        f"results/place/{session}/{camera}.marks.parquet"
        for camera in PROJECT.close(session)
        if PROJECT.cameras(session)[camera]["locate"] == "apriltag"
    ]


def own_yaml(wildcards):
    """The file of a camera, after a bump the one from then on."""
    return PROJECT.camera_file(wildcards.session, wildcards.camera)


def own_marks(wildcards):
    return PROJECT.marks_file(wildcards.session, wildcards.camera)


def close_yamls(wildcards):
    return [
        PROJECT.camera_file(wildcards.session, camera)
        for camera in PROJECT.close(wildcards.session)
    ]


def windows(wildcards):
    return json.dumps(PROJECT.window(wildcards.session))


def aligned_sequences(wildcards):
    """The sequences that a long-range camera is aligned to: those its file lists, none where it is nudged by eye."""
    return (setting("align")(wildcards) or {}).get("sequences", [])


def aligned(path):
    """Tables, below results/, of the sequences that a long-range camera is aligned to."""

    def files(wildcards):
        return [f"results/{path.format(sequence=s)}" for s in aligned_sequences(wildcards)]

    return files


def aligned_skeletons(wildcards):
    return [skeleton_of(sequence) for sequence in aligned_sequences(wildcards)]


def aligned_offsets(wildcards):
    """The clocks given by hand of the sequences that a long-range camera is aligned to."""
    return [path for s in aligned_sequences(wildcards) for path in PROJECT.offsets(s)]


def aligned_from(wildcards, source):
    return (setting("align")(wildcards) or {}).get("from") == source


def aligned_boxes(wildcards):
    if not aligned_from(wildcards, "boxes"):
        return []
    return [PROJECT.boxes(sequence)[wildcards.camera] for sequence in aligned_sequences(wildcards)]


def aligned_marks(wildcards):
    if not aligned_from(wildcards, "marks"):
        return []
    return [PROJECT.marks_file(wildcards.session, wildcards.camera)]


def aligned_bags(wildcards):
    if not aligned_from(wildcards, "silhouettes"):
        return []
    return [bag for sequence in aligned_sequences(wildcards) for bag in PROJECT.bags(sequence)]


def aligned_close(wildcards):
    """The close cameras that made the 3D of outdoor sequences."""
    outdoor = [s for s in aligned_sequences(wildcards) if not PROJECT.indoor(s)]
    if not outdoor:
        return []
    return cameras_of(wildcards.session, PROJECT.close(wildcards.session))


def aligned_covariance(wildcards):
    """The covariance of the close cameras, where it is known."""
    session = wildcards.session
    if not aligned_close(wildcards):
        return []
    files = [covariance_of(session, camera) for camera in PROJECT.close(session)]
    return list(dict.fromkeys(path for path in files if path))


def metric_facts(wildcards):
    """What session.yaml and subjects.tsv know in metres, as JSON."""
    return json.dumps(PROJECT.metric_facts(wildcards.session), sort_keys=True)


def fact_marks(wildcards):
    """The close cameras' marks, where a scale bar or a distance needs its points marked."""
    known, close = PROJECT.metric_facts(wildcards.session), PROJECT.close(wildcards.session)
    points = [fact["between"][1] for fact in known.get("distances", [])]
    if not known.get("scale_bar") and all(name in close for name in points):
        return []
    paths = [PROJECT.marks_file(wildcards.session, camera) for camera in close]
    return [path for path in paths if os.path.exists(path)]


def sequence_offsets(wildcards):
    return PROJECT.offsets(wildcards.sequence)


def clocked_sequence(wildcards):
    """The sequence of a recording: indoors `<sequence>.<camera>`, outdoors the sequence."""
    return wildcards.recording.partition(".")[0]


def clocked_names(wildcards):
    """The cameras whose clocks are found together: indoors each alone, so that one that is fixed leaves the others."""
    camera = wildcards.recording.partition(".")[2]
    return [camera] if camera else PROJECT.clocked(wildcards.recording)


def clocked_session(wildcards):
    return PROJECT.session_of(clocked_sequence(wildcards))


def clocked_cameras(wildcards):
    return cameras_of(clocked_session(wildcards), clocked_names(wildcards))


def clocked_covariance(wildcards):
    files = [
        covariance_of(clocked_session(wildcards), camera) for camera in clocked_names(wildcards)
    ]
    return list(dict.fromkeys(path for path in files if path))


def clocked_frames(wildcards):
    return f"results/frames/{clocked_sequence(wildcards)}.parquet"


def clocked_mocap(wildcards):
    sequence = clocked_sequence(wildcards)
    return f"results/mocap/{sequence}.parquet" if PROJECT.indoor(sequence) else []


def clocked_offsets(wildcards):
    return PROJECT.offsets(clocked_sequence(wildcards))


def clocked_detections(wildcards):
    sequence = clocked_sequence(wildcards)
    there_are = bool(PROJECT.detections_pattern(sequence))
    return f"results/detections/{sequence}.parquet" if there_are else []


def clocked_bags(wildcards):
    """The pictures of an indoor sequence, where nothing else tells the time."""
    sequence = clocked_sequence(wildcards)
    if clocked_detections(wildcards) or not PROJECT.indoor(sequence):
        return []
    return PROJECT.bags(sequence)


def marked_clocks(wildcards):
    """What locate found about the clocks of a sequence that has marks."""
    session, sequence = clocked_session(wildcards), clocked_sequence(wildcards)
    return [
        f"results/locate/{session}/{camera}.{kind}.parquet"
        for camera in clocked_names(wildcards)
        if sequence in PROJECT.marks_sequences(session, camera)
        and PROJECT.cameras(session)[camera]["locate"] == "marks"
        for kind in ("clocks", "clock_gains")
    ]


def clocks_of(sequence, cameras, kind=""):
    """The tables with the clocks of some cameras in a sequence."""
    followed, indoor = PROJECT.followed(sequence), PROJECT.indoor(sequence)
    return list(
        dict.fromkeys(
            (
                f"results/follow/{sequence}.{camera}{kind}.parquet"
                if camera in followed
                else f"results/clocks/{sequence}{f'.{camera}' if indoor else ''}{kind}.parquet"
            )
            for camera in cameras
        )
    )


def timeline_clocks(wildcards):
    return clocks_of(wildcards.sequence, close_names(wildcards))


def label_clocks(wildcards):
    return clocks_of(wildcards.sequence, [*makers(wildcards), wildcards.camera])


def label_clock_gains(wildcards):
    return clocks_of(wildcards.sequence, [*makers(wildcards), wildcards.camera], ".gains")


def all_clocks(wildcards):
    return clocks_of(wildcards.sequence, PROJECT.cameras_of(wildcards.sequence))


def mocap_table(wildcards):
    return skeleton(wildcards) if PROJECT.indoor(wildcards.sequence) else []


def close_cameras(wildcards):
    session = session_of(wildcards)
    return cameras_of(session, PROJECT.close(session))


def camera_file(wildcards):
    return camera_of(session_of(wildcards), wildcards.camera)


def makers(wildcards):
    """The cameras that the sequence's 3D was triangulated from; none indoors."""
    return [] if PROJECT.indoor(wildcards.sequence) else close_names(wildcards)


def label_cameras(wildcards):
    """The poses of the label's camera and of those that made the 3D."""
    names = [*makers(wildcards), wildcards.camera]
    return cameras_of(session_of(wildcards), names)


def label_covariance(wildcards):
    """The covariances of the same cameras, of those whose step tells it."""
    session = session_of(wildcards)
    files = [covariance_of(session, camera) for camera in [*makers(wildcards), wildcards.camera]]
    return list(dict.fromkeys(path for path in files if path))


def outdoor_walks(session):
    return [name for name in PROJECT.sequences_of(session) if not PROJECT.indoor(name)]


def watched_sessions():
    """Sessions in which a camera that moves shows: three views of several walks."""
    return [
        session
        for session in PROJECT.sessions
        if len(outdoor_walks(session)) > 1 and len(PROJECT.close(session)) > 2
    ]


def watched(path):
    """Names of, or tables below results/ of, a session's outdoor sequences in order of recording."""
    root = "" if path == "{sequence}" else "results/"

    def files(wildcards):
        return [root + path.format(sequence=name) for name in outdoor_walks(wildcards.session)]

    return files


def watched_names(wildcards):
    return PROJECT.close(wildcards.session)


def watched_cameras(wildcards):
    return cameras_of(wildcards.session, PROJECT.close(wildcards.session))


def label_source(wildcards):
    return "mocap" if PROJECT.indoor(wildcards.sequence) else "triangulated"


def labels(wildcards):
    return labels_of(wildcards.sequence)


def outdoor_only(path):
    """A table of the sequence that only outdoor ones have."""

    def file(wildcards):
        indoor = PROJECT.indoor(wildcards.sequence)
        return [] if indoor else path.format(sequence=wildcards.sequence)

    return file


def hand_boxes(wildcards):
    return list(PROJECT.boxes(wildcards.sequence).values())


def hand_checks(wildcards):
    return list(PROJECT.checks(wildcards.sequence).values())


def named(getter):
    """Files by camera as `camera=file` words."""

    def words(wildcards):
        return [f"{camera}={path}" for camera, path in getter(wildcards.sequence).items()]

    return words


def marks_tables(wildcards):
    session = session_of(wildcards)
    return [
        f"results/locate/{session}/{camera}.marks.parquet"
        for camera, setting in PROJECT.cameras(session).items()
        if wildcards.sequence in PROJECT.marks_sequences(session, camera)
        and setting["locate"] == "marks"
    ]


def truth_tables(wildcards):
    folders = PROJECT.truth(wildcards.sequence)
    return expand("{folder}/{table}.parquet", folder=folders, table=["labels_2d", "skeletons_3d"])


def truth_folder(wildcards):
    return PROJECT.truth(wildcards.sequence)


def roles(wildcards):
    cameras = PROJECT.cameras(session_of(wildcards))
    return [f"{name}={camera['role']}" for name, camera in cameras.items()]


def detector_files(wildcards):
    return [row["path"] for row in PROJECT.detectors_of(wildcards.sequence)]


def detector_rows(wildcards):
    return json.dumps(PROJECT.detectors_of(wildcards.sequence))


def detector_states(wildcards):
    """What is in the outputs that are folders, as for the detections."""
    return [folder_state(path) for path in detector_files(wildcards)]


def detector_labels(wildcards):
    cameras = {row["camera"] for row in PROJECT.detectors_of(wildcards.sequence)}
    return [
        f"results/reproject/{wildcards.sequence}.{camera}.parquet" for camera in sorted(cameras)
    ]


def indoor_labels(wildcards):
    indoor = [sequence for sequence in SEQUENCES if PROJECT.indoor(sequence)]
    return [path for sequence in indoor for path in labels_of(sequence)]


def long_range_recordings():
    """(sequence, camera) of every long-range camera."""
    return [
        (sequence, camera)
        for sequence in SEQUENCES
        for camera, setting in PROJECT.cameras(PROJECT.session_of(sequence)).items()
        if setting["role"] == "long_range"
    ]


def long_range_labels(wildcards):
    pairs = long_range_recordings()
    return [f"results/reproject/{sequence}.{camera}.parquet" for sequence, camera in pairs]


def own_label(wildcards):
    return f"results/reproject/{wildcards.sequence}.{wildcards.camera}.parquet"


def own_detections(wildcards):
    session = session_of(wildcards)
    drawn = not PROJECT.indoor(wildcards.sequence) and wildcards.camera in PROJECT.close(session)
    return f"results/detections/{wildcards.sequence}.parquet" if drawn else []


def own_swaps(wildcards):
    drawn = own_detections(wildcards)
    return f"results/triangulate/{wildcards.sequence}.swaps.parquet" if drawn else []


def own_boxes(wildcards):
    path = PROJECT.boxes(wildcards.sequence).get(wildcards.camera)
    return [path] if path else []


def followed_yaml(wildcards):
    """The file of a camera, as it is for the sequence."""
    return PROJECT.camera_file(session_of(wildcards), wildcards.camera)


def followed_bags(wildcards):
    """The pictures of a camera, where nobody drew boxes for it."""
    return [] if own_boxes(wildcards) else PROJECT.bags(wildcards.sequence)


def own_boxes_words(wildcards):
    return [f"{wildcards.camera}={path}" for path in own_boxes(wildcards)]


def own_role(wildcards):
    camera = PROJECT.cameras(session_of(wildcards))[wildcards.camera]
    return f"{wildcards.camera}={camera['role']}"


def report_clocks(kind=""):
    """The clocks of all cameras in all sequences."""
    return [path for name in SEQUENCES for path in clocks_of(name, PROJECT.cameras_of(name), kind)]


def report_clock_costs():
    """How well each lag fits: of the clocks, then of those that marks told."""
    located = [
        f"results/locate/{session}/{camera}.clock_costs.parquet"
        for session in PROJECT.sessions
        for camera, setting in PROJECT.cameras(session).items()
        if setting["locate"] == "marks"
    ]
    return report_clocks(".costs") + located


def all_findings():
    """The findings of every step and every unit of it."""
    outdoor = [sequence for sequence in SEQUENCES if not PROJECT.indoor(sequence)]
    refines = CONFIG["refine"]["method"] != "none"
    located = [
        (session, camera)
        for session in PROJECT.sessions
        for camera, setting in PROJECT.cameras(session).items()
        if setting["locate"] == "marks"
    ]
    return [
        *[f"results/audit/{sequence}.findings.parquet" for sequence in SEQUENCES],
        *(["results/gallery/gallery.findings.parquet"] if PROJECT.gallery else []),
        *[
            f"results/detections/{sequence}.findings.parquet"
            for sequence in SEQUENCES
            if PROJECT.detections_pattern(sequence)
        ],
        *[
            path
            for sequence in SEQUENCES
            for path in clocks_of(sequence, PROJECT.cameras_of(sequence), ".findings")
        ],
        *[f"results/triangulate/{sequence}.findings.parquet" for sequence in outdoor],
        *[f"results/refine/{sequence}.findings.parquet" for sequence in outdoor if refines],
        *[f"results/detectors/{sequence}.findings.parquet" for sequence in DETECTED],
        *[
            f"results/intrinsics/{session}/{camera}.findings.parquet"
            for session in PROJECT.sessions
            for camera in PROJECT.cameras(session)
        ],
        *[
            f"results/place/{session}/{camera}.findings.parquet"
            for session in PROJECT.sessions
            for camera, setting in PROJECT.cameras(session).items()
            if setting["locate"] in ("tape", "apriltag", "reference")
        ],
        *[f"results/adjust/{session}.findings.parquet" for session in ADJUSTED],
        *[f"results/moved/{session}.findings.parquet" for session in watched_sessions()],
        *[f"results/locate/{session}/{camera}.findings.parquet" for session, camera in located],
        *[
            f"results/align/{session}/{camera}.findings.parquet"
            for session in PROJECT.sessions
            for camera, setting in PROJECT.cameras(session).items()
            if setting["locate"] == "align"
        ],
        *[
            f"results/follow/{sequence}.{camera}.findings.parquet"
            for sequence, camera in long_range_recordings()
        ],
    ]


def all_cameras():
    """The final poses of every camera."""
    return [
        path
        for session in PROJECT.sessions
        for path in cameras_of(session, PROJECT.cameras(session))
    ]


def all_covariances():
    """The uncertainties of every camera, where they are known."""
    files = [
        covariance_of(session, camera)
        for session in PROJECT.sessions
        for camera in PROJECT.cameras(session)
    ]
    return list(dict.fromkeys(path for path in files if path))


def all_clips():
    if not CONFIG["report"]["clip_seconds"]:
        return []
    return [f"results/report/assets/{sequence}/clip.webm" for sequence in SEQUENCES]


def all_overlays():
    return [
        f"results/report/assets/{sequence}/{camera}.jpg"
        for sequence in SEQUENCES
        for camera in PROJECT.cameras_of(sequence)
    ]


def released(path):
    """A file of every released sequence."""
    return expand(path, sequence=PROJECT.released_sequences)


def released_sessions():
    return [
        session
        for session in PROJECT.sessions
        if set(PROJECT.sequences_of(session)) & set(PROJECT.released_sequences)
    ]


def released_files():
    """Every table of the release, so that a lost one is noticed."""
    people = {
        sequence: PROJECT.pseudonym(PROJECT.subject_of(sequence))
        for sequence in PROJECT.released_sequences
    }
    return [
        *[
            f"{RELEASE}/labels_2d/{who}/{sequence}.{camera}.parquet"
            for sequence, who in people.items()
            for camera in PROJECT.cameras_of(sequence)
        ],
        *[
            f"{RELEASE}/{table}/{who}/{sequence}.parquet"
            for table in ("skeletons_3d", "frames")
            for sequence, who in people.items()
        ],
        *[f"{RELEASE}/{table}.parquet" for table in ("cameras", "sequences", "subjects")],
        *([f"{RELEASE}/gallery.parquet"] if PROJECT.gallery else []),
        *[f"{RELEASE}/{file}" for file in ("metrics.csv", "README.md", "SHA256SUMS")],
    ]


def tarballs_of(subjects):
    return [f"{RELEASE}-{PROJECT.pseudonym(name)}.tar" for name in subjects]
