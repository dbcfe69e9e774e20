"""Input and parameter functions of the rules of evaluate. They only look things up in the project."""


def outdoor_only(path):
    """A table of the sequence that only outdoor ones have."""

    def file(wildcards):
        indoor = PROJECT.indoor(wildcards.sequence)
        return [] if indoor else path.format(sequence=wildcards.sequence)

    return file


def detection_offsets(wildcards):
    """Where the detections of each camera lie beside the motion capture."""
    sequence = wildcards.sequence
    if not PROJECT.indoor(sequence):
        return []
    return clocks_of(sequence, PROJECT.clocked(sequence), ".aside")


def hand_boxes(wildcards):
    return list(PROJECT.boxes(wildcards.sequence).values())


def left_out_boxes(wildcards):
    """What the labels would be without each box, of the cameras that boxes of the sequence place."""
    session = session_of(wildcards)
    return [
        f"results/align/{session}/{camera}.left_out.parquet"
        for camera, setting in PROJECT.cameras(session).items()
        if camera in PROJECT.boxes(wildcards.sequence)
        and setting["locate"] == "align"
        and setting["role"] == "long_range"
        and wildcards.sequence in (setting.get("align") or {}).get("sequences", [])
    ]


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


def detector_tools(wildcards):
    """Whose outputs they are, in the order of `contents_of(detector_files)`."""
    return as_told(PROJECT.detectors_of(wildcards.sequence))


def as_told(rows):
    """Rows of detectors.tsv as text, without the paths, which tell where data_root is."""
    return json.dumps([{key: row[key] for key in row if key != "path"} for row in rows])


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
