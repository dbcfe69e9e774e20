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


def own_clock(wildcards):
    """The table with the clock of one camera."""
    return clocks_of(wildcards.sequence, [wildcards.camera])


def pseudonym(wildcards):
    return PROJECT.pseudonym(subject(wildcards))


def pictures_consent(wildcards):
    return "yes" if PROJECT.pictures_released(wildcards.sequence) else "no"


def released_bags(wildcards):
    """The recordings of a sequence whose pictures are released."""
    return bags(wildcards) if PROJECT.pictures_released(wildcards.sequence) else []


def earlier_heads(wildcards):
    """Where an earlier release has covered the head."""
    return PROJECT.earlier_heads(wildcards.sequence, wildcards.camera)


def covered_heads(wildcards):
    """Where the head is, if it is to be covered."""
    shown = CONFIG["release"]["faces"] == "shown"
    if shown or not PROJECT.pictures_released(wildcards.sequence):
        return []
    return [f"results/heads/{wildcards.sequence}.{wildcards.camera}.parquet"]


def stamps_from(wildcards):
    """The tables with all pictures of a sequence's subject, if stamps count from the first of them."""
    if not CONFIG["release"]["shift_stamps"]:
        return []
    walks = PROJECT.sequences_of_subject(subject(wildcards))
    gallery = ["results/gallery/gallery.parquet"] if PROJECT.gallery else []
    return [*[f"results/frames/{sequence}.parquet" for sequence in walks], *gallery]


def stamps_shift(wildcards):
    """What `dior.release.stamps.taken_off` wants to know, as JSON; {} to leave stamps as they are."""
    files = stamps_from(wildcards)
    if not files:
        return json.dumps({})
    gallery = files.pop() if PROJECT.gallery else None
    return json.dumps({"frames": files, "gallery": gallery, "subject": subject(wildcards)})
