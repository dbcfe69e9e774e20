"""Input and parameter functions of the rules of calibrate. They only look things up in the project."""


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


def intrinsics_sigma(wildcards):
    """As text, "" where the camera's YAML does not say it."""
    return str(PROJECT.cameras(wildcards.session)[wildcards.camera].get("intrinsics_sigma", ""))


def intrinsics_file(wildcards):
    source = setting("intrinsics")(wildcards)
    if not isinstance(source, dict):
        return []
    return [PROJECT.in_data(source.get("file") or next(iter(source.values()))["path"])]


def tag_sequence(wildcards):
    return PROJECT.tag_sequence(wildcards.session)


def tag_frames(wildcards):
    """The pictures with the AprilTag, where a camera is placed by it."""
    if setting("locate")(wildcards) != "apriltag":
        return []
    return [f"results/frames/{tag_sequence(wildcards)}.parquet"]


def tag_bags(wildcards):
    if setting("locate")(wildcards) != "apriltag":
        return []
    return PROJECT.picture_files(tag_sequence(wildcards))


def tag(wildcards):
    """The session's AprilTag as JSON, {} for a camera that is not placed by it."""
    wanted = setting("locate")(wildcards) == "apriltag"
    return json.dumps(PROJECT.session_files[wildcards.session]["tag"] if wanted else {})


def reference_file(wildcards):
    if setting("locate")(wildcards) != "reference":
        return []
    return [PROJECT.in_data(setting("reference")(wildcards)["file"])]


def marked_sequences(wildcards):
    """The sequences whose marks may be used, of those in the camera's file."""
    return PROJECT.marks_sequences(wildcards.session, wildcards.camera)


def marked_mocap(wildcards):
    names = PROJECT.marks_mocap(wildcards.session, wildcards.camera)
    return [f"results/mocap/{sequence}.parquet" for sequence in names]


def marked_frames(wildcards):
    names = PROJECT.marks_sequences(wildcards.session, wildcards.camera)
    return [f"results/frames/{sequence}.parquet" for sequence in names]


def adjusted(step, kind=""):
    """Tables of a step for the sequences whose instants adjust uses."""

    def files(wildcards):
        names = PROJECT.window(wildcards.session)
        return [f"results/{step}/{sequence}{kind}.parquet" for sequence in names]

    return files


def adjusted_sequences(wildcards):
    """The sequences whose instants adjust uses."""
    return sorted(PROJECT.window(wildcards.session))


def placed(wildcards):
    session = wildcards.session
    return list(
        dict.fromkeys(PROJECT.first_cameras(session, camera) for camera in PROJECT.close(session))
    )


def referenced(session):
    """The cameras of a session that somebody else's calibration places."""
    cameras = PROJECT.cameras(session)
    return [name for name, camera in cameras.items() if camera["locate"] == "reference"]


def referenced_cameras(wildcards):
    session = wildcards.session
    return [f"results/place/{session}/{camera}.parquet" for camera in referenced(session)]


def referenced_yamls(wildcards):
    session = wildcards.session
    return [PROJECT.camera_file(session, camera) for camera in referenced(session)]


def referenced_marks(wildcards):
    """The marks of a session's reference cameras, where marked points are its world."""
    session = wildcards.session
    cameras = [PROJECT.cameras(session)[name]["reference"] for name in referenced(session)]
    if all(camera["world"] != "from_marks" for camera in cameras):
        return []
    paths = [PROJECT.marks_file(session, name) for name in referenced(session)]
    return [path for path in paths if os.path.exists(path)]


def referenced_sequences(wildcards):
    """The sequences in whose pictures these points may be marked."""
    session, files = wildcards.session, cameras_of_files(referenced_marks(wildcards))
    names = [name for camera in files for name in PROJECT.clicked(session, camera)]
    return list(dict.fromkeys(names))


def telling_walk(session):
    """The first outdoor sequence by which a reference calibration is judged, "" where there is none."""
    outdoor = [name for name in PROJECT.shaping(session) if not PROJECT.indoor(name)]
    return outdoor[0] if outdoor else ""


def telling(path):
    """A table, below results/, of the walk by which a session's reference calibration is judged."""

    def files(wildcards):
        sequence = telling_walk(wildcards.session)
        return [f"results/{path.format(sequence=sequence)}"] if sequence else []

    return files


def telling_sequence(wildcards):
    return telling_walk(wildcards.session)


def telling_subject(wildcards):
    sequence = telling_walk(wildcards.session)
    return PROJECT.subject_of(sequence) if sequence else ""


def telling_offsets(wildcards):
    sequence = telling_walk(wildcards.session)
    return PROJECT.offsets(sequence) if sequence else []


def telling_height(wildcards):
    return heights_of(telling_subject(wildcards))


def tag_marks(wildcards):
    """Where the cameras that are placed by the AprilTag saw its corners."""
    session = wildcards.session
    return [
        f"results/place/{session}/{camera}.marks.parquet"
        for camera in PROJECT.close(session)
        if PROJECT.cameras(session)[camera]["locate"] == "apriltag"
    ]


def own_name(wildcards):
    return wildcards.camera


def own_sequence(wildcards):
    return wildcards.sequence


def adjusted_names(wildcards):
    """The close cameras of a session."""
    return PROJECT.close(wildcards.session)


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
    return [
        bag for sequence in aligned_sequences(wildcards) for bag in PROJECT.picture_files(sequence)
    ]


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
    """What session.yaml and subjects.tsv know in metres, as JSON; whose heights, but not these."""
    known = heights.without(PROJECT.metric_facts(wildcards.session))
    return json.dumps(known, sort_keys=True)


def people_measured(wildcards):
    """The sheet with the heights of the people that a session is adjusted with, where there are any."""
    known = PROJECT.metric_facts(wildcards.session)
    return ["config/subjects.tsv"] if known["heights"] else []


def heights_fingerprint(wildcards):
    return fingerprint(PROJECT.metric_facts(wildcards.session)["heights"])(wildcards)


def fact_marks(wildcards):
    """The close cameras' marks, where a scale bar or a distance needs its points marked."""
    known, close = PROJECT.metric_facts(wildcards.session), PROJECT.close(wildcards.session)
    points = [fact["between"][1] for fact in known.get("distances", [])]
    if not known.get("scale_bar") and all(name in close for name in points):
        return []
    paths = [PROJECT.marks_file(wildcards.session, camera) for camera in close]
    return [path for path in paths if os.path.exists(path)]


def fact_sequences(wildcards):
    """The sequences in whose pictures the points of the facts may be marked."""
    session, files = wildcards.session, cameras_of_files(fact_marks(wildcards))
    names = [name for camera in files for name in PROJECT.clicked(session, camera)]
    return list(dict.fromkeys(names))


def cameras_of_files(paths):
    """The cameras that files such as `<camera>@<part>.marks.csv` are of."""
    return [os.path.basename(path).split(".")[0].split("@")[0] for path in paths]


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


def clocked_detections(wildcards):
    sequence = clocked_sequence(wildcards)
    there_are = bool(PROJECT.detections_pattern(sequence))
    return f"results/detections/{sequence}.parquet" if there_are else []


def clocked_everybody(wildcards):
    """Whom the cameras of an outdoor sequence see."""
    sequence = clocked_sequence(wildcards)
    there_are = clocked_detections(wildcards) and not PROJECT.indoor(sequence)
    return f"results/detections/{sequence}.people.parquet" if there_are else []


def clocked_bags(wildcards):
    """The pictures of an indoor sequence, where nothing else tells the time."""
    sequence = clocked_sequence(wildcards)
    if clocked_detections(wildcards) or not PROJECT.indoor(sequence):
        return []
    return PROJECT.picture_files(sequence)


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


def followed_yaml(wildcards):
    """The file of a camera, as it is for the sequence."""
    return PROJECT.camera_file(session_of(wildcards), wildcards.camera)


def followed_bags(wildcards):
    """The pictures of a camera, where nobody drew boxes for it."""
    return [] if own_boxes(wildcards) else PROJECT.picture_files(wildcards.sequence)
