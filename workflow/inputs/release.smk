"""Input and parameter functions of the rules of release. They only look things up in the project."""

from glob import escape, glob
from pathlib import Path

from dior.release.sign import key_of
from dior.release.signature import public_key

# the steps whose output is in a release or shapes it
RELEASED_STEPS = [
    "ingest.frames",
    "ingest.mocap",
    "ingest.detect",
    "ingest.detections",
    "ingest.gallery",
    "calibrate.intrinsics",
    "calibrate.locate",
    "calibrate.place",
    "calibrate.adjust",
    "calibrate.align",
    "calibrate.clocks",
    "calibrate.follow",
    "reconstruct.timeline",
    "reconstruct.triangulate",
    "reconstruct.refine",
    "gait.gait",
    "label.reproject",
    "evaluate.evaluate",
    "release.heads",
    "release.pixels",
    "release.package",
]


def released_code():
    """The hash of each of these steps' code, as `step=hash` words."""
    others = ["label.people"] if CONFIG["people"] == "all" else []
    return [f"{step}={code(step)}" for step in [*RELEASED_STEPS, *others]]


def released(path):
    """A file of every released sequence."""
    return expand(path, sequence=PROJECT.released_sequences)


def released_rows():
    """The sheets' rows of the released sequences and subjects, whose heads somebody has looked at, and which red lights
    somebody accepts."""
    return [
        {name: PROJECT.rows[name] for name in PROJECT.released_sequences},
        {name: PROJECT.subjects[name] for name in PROJECT.released_subjects},
        {session: PROJECT.heads_checked(session) for session in released_sessions()},
        {session: PROJECT.labels_accepted(session) for session in released_sessions()},
    ]


def released_sessions():
    return [
        session
        for session in PROJECT.sessions
        if set(PROJECT.sequences_of(session)) & set(PROJECT.released_sequences)
    ]


def released_covariances():
    """The uncertainty of the released cameras, of those whose step tells it."""
    files = [
        covariance_of(session, camera)
        for session in released_sessions()
        for camera in PROJECT.cameras(session)
    ]
    return list(dict.fromkeys(path for path in files if path))


def released_clocks():
    """The clocks of all cameras in the released sequences."""
    return [
        path
        for sequence in PROJECT.released_sequences
        for path in clocks_of(sequence, PROJECT.cameras_of(sequence))
    ]


def released_marks():
    """The marks that located cameras on pictures of released sequences."""
    return [
        f"results/locate/{session}/{camera}.marks.parquet"
        for session in released_sessions()
        for camera, setting in PROJECT.cameras(session).items()
        if setting["locate"] == "marks"
        and set(PROJECT.marks_sequences(session, camera)) & set(PROJECT.released_sequences)
    ]


def released_detections():
    """Of the subject: outdoors as it was chosen."""
    return [
        (
            f"results/detections/{sequence}.parquet"
            if PROJECT.indoor(sequence)
            else f"results/triangulate/{sequence}.detections.parquet"
        )
        for sequence in PROJECT.released_sequences
        if PROJECT.detections_pattern(sequence)
    ]


def released_metrics():
    """Figures of the released sequences, of the sessions' adjustment and of other detectors."""
    adjusted = [session for session in ADJUSTED if session in released_sessions()]
    detected = [sequence for sequence in PROJECT.released_sequences if sequence in DETECTED]
    return [
        *released("results/evaluate/{sequence}.parquet"),
        *expand("results/adjust/{session}.metrics.parquet", session=adjusted),
        *expand("results/detectors/{sequence}.parquet", sequence=detected),
    ]


def released_findings():
    """The findings of all steps about the released sequences and their sessions."""
    return findings_about(PROJECT.released_sequences, released_sessions())


def released_by_hand():
    """What a person wrote that a release tells of: boxes and checks are in it, of the rest the checksums."""
    files = [
        path
        for sequence in PROJECT.released_sequences
        for path in [
            *PROJECT.offsets(sequence),
            *PROJECT.seeds(sequence),
            *PROJECT.boxes(sequence).values(),
            *PROJECT.checks(sequence).values(),
        ]
    ]
    for session in released_sessions():
        files.append(PROJECT.session_file(session))
        for camera in PROJECT.cameras(session):
            files.append(PROJECT.camera_file(session, camera))
            files.append(PROJECT.marks_file(session, camera))
    return [path for path in dict.fromkeys(files) if os.path.exists(path)]


def hand_made_of_release(wildcards):
    return [*released_by_hand(), *license_file()]


def release_config(wildcards):
    """The settings that a release is made with or tells of, as text."""
    told = {key: CONFIG[key] for key in CONFIG if key not in ("report", "reid")}
    told["release"] = {key: value for key, value in told["release"].items() if key != "sign"}
    return json.dumps(told, sort_keys=True)


def release_settings(wildcards):
    """The same but for where the recordings are, which a release does not tell."""
    told = json.loads(release_config(wildcards))
    return json.dumps({key: told[key] for key in told if key != "data_root"}, sort_keys=True)


def license_file():
    path = CONFIG["release"]["license_file"]
    return [ancient(path)] if path else []


def recordings(wildcards):
    """The recordings of a sequence by what they are for, as `what=path` words; a close camera may have no detections."""
    return [
        f"{what}={path}"
        for what, path in PROJECT.recordings(wildcards.sequence).items()
        if "simulate" in CONFIG or not what.startswith("detections.") or os.path.exists(path)
    ]


def recording_files(wildcards):
    return [word.split("=", 1)[1] for word in recordings(wildcards)]


def released_files():
    """Every table of the release that there surely is, so that a lost one is noticed.

    Not the pictures: they are hard links to results/pixels/, and Snakemake sets the time of what a job made, so that
    these inputs would be newer than the release.
    """
    people = {sequence: PROJECT.subject_of(sequence) for sequence in PROJECT.released_sequences}
    tables = ["cameras", "clocks", "sequences", "subjects", "splits"]
    tables += ["camera_covariance"] if released_covariances() else []
    tables += ["gallery"] if released_gallery() else []
    about = ["README.md", "LICENSE", "CITATION.cff", "croissant.json", "provenance.json"]
    return [
        *[
            f"{RELEASE}/labels_2d/{who}/{sequence}.{camera}.parquet"
            for sequence, who in people.items()
            for camera in PROJECT.cameras_of(sequence)
        ],
        *[
            f"{RELEASE}/{part}/{who}/{sequence}.parquet"
            for part in ("skeletons_3d", "gait", "gait_events", "gait_steps")
            for sequence, who in people.items()
        ],
        *[f"{RELEASE}/{table}.parquet" for table in tables],
        *[f"{RELEASE}/{file}" for file in [*about, "metrics.csv", "SHA256SUMS"]],
    ]


def released_gallery():
    """The gallery, where somebody who is released is in it."""
    people = {row["subject"] for row in PROJECT.gallery.values()}
    there = people & set(PROJECT.released_subjects)
    return ["results/gallery/gallery.parquet"] if there else []


def release_outputs():
    """All that is made of a release."""
    return [
        *released_files(),
        *signature_file(),
        *tarballs_of(PROJECT.released_subjects),
        *exports(),
    ]


def signature_file():
    return [f"{RELEASE}/SHA256SUMS.sig"] if CONFIG["release"]["sign"] else []


def signer(wildcards):
    """The public key that signs, so that another one signs anew; where the private one is stays in the config."""
    try:
        return public_key(key_of(Path("."), CONFIG) or Path())
    except DiorError:
        # the step says what is wrong, when its time comes
        return ""


def packed(wildcards):
    """What a tarball waits for: that of metadata holds the signature."""
    return [
        f"{RELEASE}/SHA256SUMS",
        *(signature_file() if wildcards.subject == "metadata" else []),
    ]


def existing_release():
    """The same, where there is a release already, or what is left of one: nobody who withdrew stays in it.

    It is there where anything about a person is: an empty folder is no release. SHA256SUMS does not tell. Snakemake
    deletes it before `package` starts, so that a build which was cut short leaves people's pictures without it.
    """
    about_people = glob(f"{escape(RELEASE)}/*/*/*")
    return release_outputs() if about_people else []


def tarballs_of(subjects):
    """A tarball for each subject and one for what is about all of them."""
    return [f"{RELEASE}-{part}.tar" for part in (*subjects, "metadata") if subjects]


def own_clock(wildcards):
    """The table with the clock of one camera."""
    return clocks_of(wildcards.sequence, [wildcards.camera])


def pictures_consent(wildcards):
    return "yes" if PROJECT.pictures_released(wildcards.sequence) else "no"


def released_bags(wildcards):
    """The recordings of a sequence whose pictures are released."""
    return picture_files(wildcards) if PROJECT.pictures_released(wildcards.sequence) else []


def earlier_heads(wildcards):
    """Where an earlier release has covered the head."""
    return PROJECT.earlier_heads(wildcards.sequence, wildcards.camera)


def covered_heads(wildcards):
    """Where the head is, if it is to be covered."""
    shown = CONFIG["release"]["faces"] == "shown"
    if shown or not PROJECT.pictures_released(wildcards.sequence):
        return []
    return [f"results/heads/{wildcards.sequence}.{wildcards.camera}.parquet"]


def other_covers(wildcards):
    """What else is to be covered, if anything is."""
    return [path.replace(".parquet", ".covers.parquet") for path in covered_heads(wildcards)]


def everybody_detected(wildcards):
    """The detector's own output of a close camera, which holds everybody and not the subject alone."""
    pattern = PROJECT.detections_pattern(wildcards.sequence)
    detected = pattern and wildcards.camera in close_names(wildcards)
    paths = [pattern.format(camera=wildcards.camera)] if detected else []
    return [path for path in paths if detections_are_made(wildcards) or os.path.exists(path)]


def everybody_labelled(wildcards):
    """[table] with the 3D of everybody in a sequence, where all people are labelled."""
    return people_of(wildcards.sequence)


def everybodys_labels(wildcards):
    """The same with their labels."""
    return people_of(wildcards.sequence, ".labels")


def detections_are_made(wildcards):
    """Whether detect or the simulation makes them, and nobody brought them."""
    return "simulate" in CONFIG or PROJECT.detected_here(wildcards.sequence)


def everybody_made(wildcards):
    return everybody_detected(wildcards) if detections_are_made(wildcards) else []


def everybody_brought(wildcards):
    return [] if detections_are_made(wildcards) else everybody_detected(wildcards)


def evaluated(wildcards):
    """The figures of all cameras of a sequence; that they were written again does not count."""
    return [ancient(f"results/evaluate/{wildcards.sequence}.parquet")]


def own_checks(wildcards):
    """[path] of the hand checks of a camera, or []."""
    made = PROJECT.checks(wildcards.sequence)
    return [made[wildcards.camera]] if wildcards.camera in made else []


def noticed_errors(wildcards):
    """The findings that make a camera's light red: of the recording, of cameras that moved, of those that do not belong
    to the others, and of a world in which nobody can walk."""
    session, cameras = session_of(wildcards), PROJECT.cameras_of(wildcards.sequence)
    own = clocks_of(wildcards.sequence, [wildcards.camera], ".findings")
    # that those of another camera were written again does not count
    others = [
        ancient(path)
        for path in clocks_of(wildcards.sequence, cameras, ".findings")
        if path not in own
    ]
    moved = [session] if session in watched_sessions() else []
    return [
        f"results/audit/{wildcards.sequence}.findings.parquet",
        *[f"results/moved/{name}.findings.parquet" for name in moved],
        *(
            [*own, *others]
            if PROJECT.indoor(wildcards.sequence)
            else [f"results/triangulate/{wildcards.sequence}.findings.parquet"]
        ),
        f"results/world/{wildcards.sequence}.findings.parquet",
    ]


def camera_role(wildcards):
    return PROJECT.cameras(session_of(wildcards))[wildcards.camera]["role"]


def heads_checked(wildcards):
    """Who has looked whether the heads in a camera's pictures are covered, and released them all the same."""
    return PROJECT.heads_checked(session_of(wildcards)).get(wildcards.camera, "")


def privacy_masks(wildcards):
    """Rectangles of a camera's pictures that are covered in all of them, as JSON."""
    return json.dumps(PROJECT.privacy_masks(session_of(wildcards)).get(wildcards.camera, []))


def stamps_from(wildcards):
    """The tables with all pictures of a sequence's subject, if stamps count from the first of them."""
    if not CONFIG["release"]["shift_stamps"]:
        return []
    walks = PROJECT.sequences_of_subject(subject(wildcards))
    return [f"results/frames/{sequence}.parquet" for sequence in walks]


def stamps_shift(wildcards):
    """What `dior.release.shift_stamps.shift_ns` wants to know, as JSON; {} to leave stamps as they are."""
    files = stamps_from(wildcards)
    return json.dumps({"frames": files} if files else {})


def exports_folder(wildcards):
    return f"{RELEASE}-exports"


def exported_files():
    """Two files that every export folder has; the checksums are written last."""
    return [f"{RELEASE}-exports/README.md", f"{RELEASE}-exports/SHA256SUMS"]


def exports():
    """The same, where the config wants any format."""
    return exported_files() if CONFIG["release"]["exports"] else []
