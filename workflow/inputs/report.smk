"""Input and parameter functions of the rules of report. They only look things up in the project."""


def own_label(wildcards):
    return f"results/reproject/{wildcards.sequence}.{wildcards.camera}.parquet"


def own_detections(wildcards):
    session = session_of(wildcards)
    drawn = not PROJECT.indoor(wildcards.sequence) and wildcards.camera in PROJECT.close(session)
    return f"results/triangulate/{wildcards.sequence}.detections.parquet" if drawn else []


def own_swaps(wildcards):
    drawn = own_detections(wildcards)
    return f"results/triangulate/{wildcards.sequence}.swaps.parquet" if drawn else []


def own_boxes(wildcards):
    path = PROJECT.boxes(wildcards.sequence).get(wildcards.camera)
    return [path] if path else []


def own_boxed_camera(wildcards):
    """The pose of the camera where boxes are drawn in its pictures."""
    return (
        [PROJECT.final_cameras(session_of(wildcards), wildcards.camera)]
        if own_boxes(wildcards)
        else []
    )


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
    gallery = ["results/gallery/gallery.findings.parquet"] if PROJECT.gallery else []
    return [*gallery, *findings_about(SEQUENCES, PROJECT.sessions)]


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


def all_clips():
    if not CONFIG["report"]["clip_seconds"]:
        return []
    return [f"results/report/assets/{sequence}/clip.webm" for sequence in SEQUENCES]


def all_scenes():
    return [f"results/report/assets/{sequence}/scene.js" for sequence in SEQUENCES]


def all_overlays():
    return [
        f"results/report/assets/{sequence}/{camera}.jpg"
        for sequence in SEQUENCES
        for camera in PROJECT.cameras_of(sequence)
    ]


def effort_files(wildcards):
    return PROJECT.effort()


def page_folder(wildcards, output):
    """Where the page is; its other files are beside it."""
    return os.path.dirname(output.page)
