"""Input and parameter functions of the rules of ingest, and what all stages share. They only look things up in the project."""


def simulated(files):
    """A function for the files that `files` names where the simulation makes them.

    Recordings are no inputs of the rules: their times would count, Snakemake would stop everything where one is
    missing, and it would run everything again where they were moved. The step that reads one says what is wrong with
    it, in its own words, while the others go on; `contents_of(recorded(files))` tells when one was replaced.
    """

    def made(wildcards):
        return files(wildcards) if "simulate" in CONFIG else []

    return made


def recorded(files):
    """A function for the same files where they were recorded."""

    def found(wildcards):
        return [] if "simulate" in CONFIG else files(wildcards)

    return found


def bags(wildcards):
    return PROJECT.bags(wildcards.sequence)


def picture_files(wildcards):
    """The bags and videos of a sequence, and the stamps of these."""
    return PROJECT.picture_files(wildcards.sequence)


def videos(wildcards):
    return as_words(PROJECT.videos(wildcards.sequence))


def sidecars(wildcards):
    return as_words(PROJECT.sidecars(wildcards.sequence))


def video_rates(wildcards):
    return as_words(PROJECT.video_rates(wildcards.sequence))


def as_words(found):
    """A dict as a flag takes it."""
    return [f"{key}={value}" for key, value in found.items()]


def gallery_files(wildcards):
    return PROJECT.gallery_files()


def topics(wildcards):
    return as_words(PROJECT.topics(wildcards.sequence))


def in_bags(wildcards):
    """By camera what the names of its bags hold, where its YAML says it."""
    cameras = PROJECT.cameras(session_of(wildcards))
    return [f"{name}={camera['bag']}" for name, camera in cameras.items() if "bag" in camera]


def clocked_by_hand(wildcards):
    return PROJECT.clocked_by_hand(wildcards.sequence)


def mocap_file(wildcards):
    return PROJECT.mocap(wildcards.sequence)


def trigger_log(wildcards):
    return PROJECT.trigger_log(wildcards.sequence)


def capture(wildcards):
    return PROJECT.capture(wildcards.sequence)


def mocap_units(wildcards):
    return PROJECT.mocap_settings(wildcards.sequence)["units"]


def mocap_up(wildcards):
    return PROJECT.mocap_settings(wildcards.sequence)["up"]


def marker_names(wildcards):
    """The sheet of a lab's own names of markers, if there is one."""
    return PROJECT.marker_names()


def prefix_fingerprint(wildcards):
    prefix = PROJECT.mocap_settings(wildcards.sequence)["prefix"]
    # without one there is nothing to hide, and a key that is lost runs nothing again
    return fingerprint(prefix)(wildcards) if prefix else ""


def detections_checked(wildcards):
    """Cameras of whose detections somebody says that they lie on the pictures."""
    return sorted(PROJECT.detections_checked(session_of(wildcards)))


def subjects_sheet(wildcards):
    return "config/subjects.tsv"


def sequence_session_file(wildcards):
    """The session.yaml of a sequence; a parameter that runs nothing again."""
    return PROJECT.session_file(session_of(wildcards))


def close_names(wildcards):
    return PROJECT.close(session_of(wildcards))


def detection_pattern(wildcards):
    return PROJECT.detections_pattern(wildcards.sequence)


def detection_files(wildcards):
    """The detections of the close cameras, where detect or the simulation makes them."""
    if PROJECT.detected_here(wildcards.sequence):
        return recorded_detections(wildcards)
    return simulated(recorded_detections)(wildcards)


def brought_detections(wildcards):
    """The other detections, which were brought."""
    here = PROJECT.detected_here(wildcards.sequence)
    return [] if here else recorded(recorded_detections)(wildcards)


def detection_format(wildcards):
    """What rule detect writes is known."""
    here = PROJECT.detected_here(wildcards.sequence)
    return "coco" if here else CONFIG["detector"]["format"]


def detection_first_frame(wildcards):
    """Rule detect counts from 0."""
    here = PROJECT.detected_here(wildcards.sequence)
    return 0 if here or "simulate" in CONFIG else CONFIG["detector"]["first_frame"]


def detector_model(wildcards):
    return [ancient(CONFIG["detector"]["model"])]


def recorded_detections(wildcards):
    pattern = PROJECT.detections_pattern(wildcards.sequence)
    return [pattern.format(camera=camera) for camera in close_names(wildcards)]


def motion(wildcards):
    """The C3D whose walk the simulation uses, if any."""
    path = CONFIG["simulate"]["motion"]
    return [ancient(path)] if path else []


def simulated_detections():
    """Where the simulation writes the detections of a sequence: of everybody, or of one person at most."""
    tool = "mediapipe" if CONFIG["simulate"]["detector"]["everybody"] else "mlkit"
    cameras = ["cam01", "cam02", "cam03", "cam04"]
    return expand("{data}/{{sequence}}/{tool}/{camera}.jsonl", data=DATA, tool=tool, camera=cameras)


def true_tables():
    """The tables of the truth of a sequence."""
    second = CONFIG["simulate"]["detector"]["everybody"] and CONFIG["simulate"].get("bystander")
    of_second = ["second_labels_2d", "second_skeletons_3d"] if second else []
    return ["labels_2d", "skeletons_3d", "cameras", "detections", "contacts", "angles", *of_second]
