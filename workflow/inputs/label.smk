"""Input and parameter functions of the rules of reconstruct and label: clocks, cameras and who made the 3D. They only look things up in the project."""


def timeline_clocks(wildcards):
    return clocks_of(wildcards.sequence, close_names(wildcards))


def label_clocks(wildcards):
    return clocks_of(wildcards.sequence, [*makers(wildcards), wildcards.camera])


def label_clock_gains(wildcards):
    return clocks_of(wildcards.sequence, [*makers(wildcards), wildcards.camera], ".gains")


def same_cameras():
    """The sequences by the cameras that they have."""
    found = {}
    for sequence in SEQUENCES:
        found.setdefault(tuple(PROJECT.cameras_of(sequence)), []).append(sequence)
    return found


def all_clocks(wildcards):
    return clocks_of(wildcards.sequence, PROJECT.cameras_of(wildcards.sequence))


def all_clock_gains(wildcards):
    return clocks_of(wildcards.sequence, PROJECT.cameras_of(wildcards.sequence), ".gains")


def mocap_table(wildcards):
    return skeleton(wildcards) if PROJECT.indoor(wildcards.sequence) else []


def close_cameras(wildcards):
    session = session_of(wildcards)
    return cameras_of(session, PROJECT.close(session))


def camera_file(wildcards):
    return PROJECT.final_cameras(session_of(wildcards), wildcards.camera)


def sequence_seeds(wildcards):
    return PROJECT.seeds(wildcards.sequence)


def telling_walks(session):
    """The outdoor walks of a session that tell how tall their subjects are: those that placed its close cameras."""
    return list(PROJECT.window(session)) or [walk for walk in [telling_walk(session)] if walk]


def of_telling_walks(path):
    """Tables, below results/, of the walks that tell how tall their subjects are."""

    def files(wildcards):
        return [
            f"results/{path.format(sequence=walk)}" for walk in telling_walks(wildcards.session)
        ]

    return files


def close_of_session(wildcards):
    return cameras_of(wildcards.session, PROJECT.close(wildcards.session))


def session_close_names(wildcards):
    return PROJECT.close(wildcards.session)


def told_subjects(wildcards):
    return [f"{walk}={PROJECT.subject_of(walk)}" for walk in telling_walks(wildcards.session)]


def told_seeds(wildcards):
    return [path for walk in telling_walks(wildcards.session) for path in PROJECT.seeds(walk)]


def session_bodies(wildcards):
    """[table] that tells how tall the subject of a sequence is by another walk of theirs; else []."""
    own, session = wildcards.sequence, session_of(wildcards)
    others = [walk for walk in telling_walks(session) if walk != own]
    told = any(PROJECT.subject_of(walk) == PROJECT.subject_of(own) for walk in others)
    return [f"results/bodies/{session}.parquet"] if told else []


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


def sequence_camera_names(wildcards):
    return PROJECT.cameras_of(wildcards.sequence)


def sequence_cameras(wildcards):
    """The poses of all cameras of a sequence."""
    return cameras_of(session_of(wildcards), sequence_camera_names(wildcards))


def sequence_covariance(wildcards):
    """The covariances of the same cameras, of those whose step tells it."""
    session = session_of(wildcards)
    files = [covariance_of(session, camera) for camera in sequence_camera_names(wildcards)]
    return list(dict.fromkeys(path for path in files if path))


def people_of(sequence, kind=""):
    """[table] about everybody in a sequence, where all people are labelled; else []."""
    asked = CONFIG["people"] == "all" and not PROJECT.indoor(sequence)
    return [f"results/people/{sequence}{kind}.parquet"] if asked else []


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


def watched_cameras(wildcards):
    return cameras_of(wildcards.session, PROJECT.close(wildcards.session))


def label_source(wildcards):
    return "mocap" if PROJECT.indoor(wildcards.sequence) else "triangulated"


def walker_height(wildcards):
    return heights_of(subject(wildcards))


def labels(wildcards):
    return labels_of(wildcards.sequence)
