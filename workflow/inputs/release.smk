"""Input and parameter functions of the rules of release. They only look things up in the project."""


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


def exports_folder(wildcards):
    return f"{RELEASE}-exports"


def exported_files():
    """Two files that every export folder has; the checksums are written last."""
    return [f"{RELEASE}-exports/README.md", f"{RELEASE}-exports/SHA256SUMS"]


def exports():
    """The same, where the config wants any format."""
    return exported_files() if CONFIG["release"]["exports"] else []
