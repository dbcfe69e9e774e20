"""Label: the 2D keypoints of every frame of every camera.

Required inputs: skeletons, cameras, frames, clocks; of all people also the detections.
Outputs: results/reproject; results/people where config.yaml asks for all people.
"""

# what a job writes has to be said with its rule: one for all sequences that have the same cameras
for number, (cameras, walks) in enumerate(same_cameras().items(), start=1):

    rule:
        """Project the skeleton into every picture of the cameras of a sequence."""
        name:
            numbered("reproject", number)
        input:
            cameras=sequence_cameras,
            covariance=sequence_covariance,
            skeleton=skeleton,
            frames="results/frames/{sequence}.parquet",
            clocks=all_clocks,
            clock_gains=all_clock_gains,
        output:
            out=[f"results/reproject/{{sequence}}.{camera}.parquet" for camera in cameras],
        log:
            "logs/reproject/{sequence}.log",
        benchmark:
            "logs/reproject/{sequence}.benchmark.tsv"
        wildcard_constraints:
            sequence="|".join(walks),
        params:
            subject=subject,
            source=label_source,
            labelled=sequence_camera_names,
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
