"""Release: the dataset as others get it.

Required inputs: labels, pictures, skeletons, frames, detections, cameras and figures of the subjects who agreed, and
their recordings, for the checksums.
Outputs: results/provenance/<sequence>.json, results/release/dior-<version>/, signed or not; beside it a tarball per
subject and one of metadata, and the exports to other formats.
"""


rule provenance:
    """Take the checksums of the recordings of one sequence."""
    input:
        simulated(recording_files),
    output:
        out="results/provenance/{sequence}.json",
    log:
        "logs/provenance/{sequence}.log",
    benchmark:
        "logs/provenance/{sequence}.benchmark.tsv"
    threads: 2
    params:
        recordings=untracked(recordings),
        contents=contents_of(recorded(recording_files)),
        code=code("release.provenance"),
    shell:
        dior("provenance")


rule heads:
    """Find the heads in the pictures of one camera, and whether they are surely covered there."""
    input:
        cameras=label_cameras,
        skeleton=skeleton,
        frames="results/frames/{sequence}.parquet",
        clocks=own_clock,
        # written with those of the other cameras: what counts is whether something that this camera's are made of changed
        labels=ancient("results/reproject/{sequence}.{camera}.parquet"),
        covariance=label_covariance,
        label_clocks=label_clocks,
        label_clock_gains=label_clock_gains,
        before=earlier_heads,
        bags=simulated(released_bags),
        detections=everybody_made,
        boxes=own_boxes,
        people=everybody_labelled,
        people_labels=everybodys_labels,
        metrics=evaluated,
        noticed=noticed_errors,
    output:
        out="results/heads/{sequence}.{camera}.parquet",
        out_covers="results/heads/{sequence}.{camera}.covers.parquet",
        findings="results/heads/{sequence}.{camera}.findings.parquet",
    log:
        "logs/heads/{sequence}.{camera}.log",
    benchmark:
        "logs/heads/{sequence}.{camera}.benchmark.tsv"
    params:
        data_root=data_root,
        detections=untracked(everybody_detected),
        format=detection_format,
        first_frame=detection_first_frame,
        min_score=CONFIG["detector"]["min_score"],
        role=camera_role,
        makers=makers,
        method=CONFIG["triangulate"]["method"],
        session_name=session_of,
        checked=heads_checked,
        label_code=code("label.reproject"),
        contents=contents_of(
            earlier_heads, own_boxes, own_checks, everybody_brought, recorded(released_bags)
        ),
        code=code("release.heads"),
    shell:
        dior("heads")


rule pixels:
    """Write the released pictures of one camera, the heads covered."""
    input:
        bags=simulated(released_bags),
        frames="results/frames/{sequence}.parquet",
        heads=covered_heads,
        covers=other_covers,
        shift=stamps_from,
    output:
        out="results/pixels/{sequence}.{camera}.parquet",
        out_covers="results/pixels/{sequence}.{camera}.covers.parquet",
        findings="results/pixels/{sequence}.{camera}.findings.parquet",
    log:
        "logs/pixels/{sequence}.{camera}.log",
    benchmark:
        "logs/pixels/{sequence}.{camera}.benchmark.tsv"
    params:
        subject=subject,
        data_root=data_root,
        faces=CONFIG["release"]["faces"],
        consent=pictures_consent,
        masks=privacy_masks,
        shift=stamps_shift,
        contents=contents_of(recorded(released_bags)),
        code=code("release.pixels"),
    shell:
        dior("pixels")


rule package:
    """Write the release folder: tables, pictures, card and checksums."""
    input:
        labels=[path for sequence in PROJECT.released_sequences for path in labels_of(sequence)],
        pixels=[
            f"results/pixels/{sequence}.{camera}.parquet"
            for sequence in PROJECT.released_sequences
            for camera in PROJECT.cameras_of(sequence)
        ],
        covers=[
            f"results/pixels/{sequence}.{camera}.covers.parquet"
            for sequence in PROJECT.released_sequences
            for camera in PROJECT.cameras_of(sequence)
        ],
        skeletons=[skeleton_of(sequence) for sequence in PROJECT.released_sequences],
        gait=[
            f"results/gait/{sequence}{part}.parquet"
            for sequence in PROJECT.released_sequences
            for part in ("", ".events", ".steps")
        ],
        frames=released("results/frames/{sequence}.parquet"),
        detections=released_detections(),
        marks=released_marks(),
        cameras=[
            path
            for session in released_sessions()
            for path in cameras_of(session, PROJECT.cameras(session))
        ],
        covariances=released_covariances(),
        clocks=released_clocks(),
        quantiles=released("results/evaluate/{sequence}.quantiles.parquet"),
        metrics=released_metrics(),
        findings=released_findings(),
        gallery=released_gallery(),
        provenance=released("results/provenance/{sequence}.json"),
        by_hand=released_by_hand(),
        license=license_file(),
    output:
        released_files(),
    log:
        "logs/package/package.log",
    benchmark:
        "logs/package/package.benchmark.tsv"
    threads: 2
    params:
        project=".",
        config=untracked(release_config),
        settings=release_settings,
        out=release_folder,
        sheets=fingerprint(released_rows()),
        steps=released_code(),
        contents=contents_of(hand_made_of_release),
        code=code("release.package"),
    script:
        "../scripts/step.py"


rule sign:
    """Sign the checksums of the release with a key of the lab's."""
    input:
        f"{RELEASE}/SHA256SUMS",
    output:
        out=f"{RELEASE}/SHA256SUMS.sig",
    log:
        "logs/sign/sign.log",
    benchmark:
        "logs/sign/sign.benchmark.tsv"
    params:
        project=".",
        release=release_folder,
        signer=signer,
        code=code("release.sign"),
    shell:
        dior("sign")


rule tarballs:
    """Pack one subject's part of the release, or what is about all (`metadata`)."""
    input:
        packed,
    output:
        out=f"{RELEASE}-{{subject}}.tar",
    log:
        "logs/tarballs/{subject}.log",
    benchmark:
        "logs/tarballs/{subject}.benchmark.tsv"
    params:
        release=release_folder,
        code=code("release.tarballs"),
    shell:
        dior("tarballs")


rule exports:
    """Write the release in the formats of other tools."""
    input:
        f"{RELEASE}/SHA256SUMS",
    output:
        exported_files(),
    log:
        "logs/exports/exports.log",
    benchmark:
        "logs/exports/exports.benchmark.tsv"
    params:
        release=release_folder,
        formats=CONFIG["release"]["exports"],
        out=exports_folder,
        code=code("release.exports"),
    shell:
        dior("exports")
