"""Input and parameter functions of the rules of report. They only look things up in the project."""


def own_boxes(wildcards):
    path = PROJECT.boxes(wildcards.sequence).get(wildcards.camera)
    return [path] if path else []


def clock_costs(wildcards):
    """How well each lag fits: of the clocks, then of those that marks told."""
    sequence, session = wildcards.sequence, session_of(wildcards)
    located = [
        f"results/locate/{session}/{camera}.clock_costs.parquet"
        for camera, setting in PROJECT.cameras(session).items()
        if setting["locate"] == "marks"
    ]
    return clocks_of(sequence, PROJECT.cameras_of(sequence), ".costs") + located


def own_findings(wildcards):
    """The findings about a sequence and its session that no other sequence of the session changes."""
    found = findings_about([wildcards.sequence], [session_of(wildcards)])
    return [path for path in found if path not in common_findings()]


def common_findings():
    """The findings that a comparison of sequences tells, and those about people."""
    gallery = ["results/gallery/gallery.findings.parquet"] if PROJECT.gallery else []
    return gallery + expand("results/moved/{session}.findings.parquet", session=watched_sessions())


def findings_about(sequences, sessions):
    """The findings of every step about some sequences and their sessions."""
    outdoor = [sequence for sequence in sequences if not PROJECT.indoor(sequence)]
    refines = CONFIG["refine"]["method"] != "none"
    located = [
        (session, camera)
        for session in sessions
        for camera, setting in PROJECT.cameras(session).items()
        if setting["locate"] == "marks"
    ]
    return [
        *[f"results/audit/{sequence}.findings.parquet" for sequence in sequences],
        *[
            f"results/mocap/{sequence}.findings.parquet"
            for sequence in sequences
            if PROJECT.indoor(sequence)
        ],
        *[
            f"results/detections/{sequence}.findings.parquet"
            for sequence in sequences
            if PROJECT.detections_pattern(sequence)
        ],
        *[
            path
            for sequence in sequences
            for path in clocks_of(sequence, PROJECT.cameras_of(sequence), ".findings")
        ],
        *[f"results/triangulate/{sequence}.findings.parquet" for sequence in outdoor],
        *[f"results/refine/{sequence}.findings.parquet" for sequence in outdoor if refines],
        *[path for sequence in sequences for path in people_of(sequence, ".findings")],
        *[
            f"results/detectors/{sequence}.findings.parquet"
            for sequence in DETECTED
            if sequence in sequences
        ],
        *[
            f"results/intrinsics/{session}/{camera}.findings.parquet"
            for session in sessions
            for camera in PROJECT.cameras(session)
        ],
        *[
            f"results/place/{session}/{camera}.findings.parquet"
            for session in sessions
            for camera, setting in PROJECT.cameras(session).items()
            if setting["locate"] in ("tape", "apriltag", "reference")
        ],
        *[
            f"results/reference/{session}.findings.parquet"
            for session in sessions
            if referenced(session)
        ],
        *[f"results/world/{sequence}.findings.parquet" for sequence in sequences],
        *[f"results/gait/{sequence}.findings.parquet" for sequence in sequences],
        *[f"results/evaluate/{sequence}.findings.parquet" for sequence in sequences],
        *[
            f"results/adjust/{session}.findings.parquet"
            for session in ADJUSTED
            if session in sessions
        ],
        *[
            f"results/moved/{session}.findings.parquet"
            for session in watched_sessions()
            if session in sessions
        ],
        *[f"results/locate/{session}/{camera}.findings.parquet" for session, camera in located],
        *[
            f"results/align/{session}/{camera}.findings.parquet"
            for session in sessions
            for camera, setting in PROJECT.cameras(session).items()
            if setting["locate"] == "align"
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


def own_clip(wildcards):
    wanted = CONFIG["report"]["clip_seconds"]
    return [f"results/report/assets/{wildcards.sequence}/clip.webm"] if wanted else []


def within(wildcards):
    """What a sequence is a part of."""
    return [session_of(wildcards), subject(wildcards)]


def about(wildcards):
    """What the page of a sequence says of it."""
    row = PROJECT.sequence(wildcards.sequence)
    words = (row[key] for key in ("subject", "environment", "session", "outfit", "walk"))
    return ", ".join(filter(None, words))


def before(wildcards):
    return beside(wildcards.sequence, -1)


def after(wildcards):
    return beside(wildcards.sequence, 1)


def beside(sequence, step):
    """[sequence] that is next to one in the sheet; [] beyond its ends."""
    at = SEQUENCES.index(sequence) + step
    return list(SEQUENCES[at : at + 1]) if at >= 0 else []


def effort_files(wildcards):
    return PROJECT.effort()


def page_folder(wildcards, output):
    """Where the page is; its other files are beside it."""
    return os.path.dirname(output.page)
