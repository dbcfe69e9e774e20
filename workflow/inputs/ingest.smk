"""Input and parameter functions of the rules of ingest, and what all stages share. They only look things up in the project."""


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


def mocap_units(wildcards):
    return PROJECT.mocap_settings(wildcards.sequence)["units"]


def mocap_up(wildcards):
    return PROJECT.mocap_settings(wildcards.sequence)["up"]


def mocap_prefix(wildcards):
    return PROJECT.mocap_settings(wildcards.sequence)["prefix"]


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
