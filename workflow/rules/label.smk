"""Label: the 2D keypoints of every frame of every camera.

Required inputs: skeletons, cameras, frames, clocks; of all people also the detections.
Outputs: results/reproject; results/people where config.yaml asks for all people.
"""


rule reproject:
    """Project the skeleton into every picture of one camera."""
    input:
        cameras=label_cameras,
        covariance=label_covariance,
        skeleton=skeleton,
        frames="results/frames/{sequence}.parquet",
        clocks=label_clocks,
        clock_gains=label_clock_gains,
    output:
        out="results/reproject/{sequence}.{camera}.parquet",
    log:
        "logs/reproject/{sequence}.{camera}.log",
    benchmark:
        "logs/reproject/{sequence}.{camera}.benchmark.tsv"
    params:
        subject=subject,
        source=label_source,
        makers=makers,
        code=code("label.reproject"),
    shell:
        dior("reproject")


rule people:
    """Label everybody who is tracked through the close cameras of an outdoor sequence."""
    input:
        cameras=sequence_cameras,
        covariance=sequence_covariance,
        detections="results/detections/{sequence}.parquet",
        everybody_seen="results/detections/{sequence}.people.parquet",
        timeline="results/timeline/{sequence}.parquet",
        bodies=session_bodies,
        skeleton=skeleton,
        frames="results/frames/{sequence}.parquet",
        clocks=all_clocks,
        clock_gains=all_clock_gains,
    output:
        out="results/people/{sequence}.parquet",
        out_labels="results/people/{sequence}.labels.parquet",
        findings="results/people/{sequence}.findings.parquet",
    log:
        "logs/people/{sequence}.log",
    benchmark:
        "logs/people/{sequence}.benchmark.tsv"
    params:
        subject=subject,
        labelled=sequence_camera_names,
        makers=close_names,
        people=untracked(subjects_sheet),
        height=walker_height,
        seeds=untracked(sequence_seeds),
        contents=contents_of(sequence_seeds),
        method=CONFIG["triangulate"]["method"],
        max_error_px=CONFIG["triangulate"]["max_error_px"],
        max_speed=CONFIG["triangulate"]["max_speed_m_s"],
        max_body_speed=CONFIG["triangulate"]["max_body_speed_m_s"],
        max_bone_change=CONFIG["triangulate"]["max_bone_change"],
        min_score=CONFIG["detector"]["min_score"],
        smoothing=CONFIG["refine"]["method"],
        max_gap_s=CONFIG["refine"]["max_gap_s"],
        code=code("label.people"),
    shell:
        dior("people")
