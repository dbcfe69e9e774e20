"""Calibrate: intrinsics and poses of every camera.

Required inputs: config/sessions/<session>/, the frames, indoors the mocap, outdoors the detections; for the long-range
camera the skeletons of the sequences that its file lists, and their boxes, marks or pictures.
Outputs: results/intrinsics, results/locate (indoors), results/place, results/reference, results/adjust, results/align, results/follow.
"""


rule intrinsics:
    """Take a camera's intrinsics from the session's first recording, from a file or from pictures of a board."""
    input:
        frames=first_frames,
    output:
        out="results/intrinsics/{session}/{camera}.parquet",
        findings="results/intrinsics/{session}/{camera}.findings.parquet",
    log:
        "logs/intrinsics/{session}.{camera}.log",
    benchmark:
        "logs/intrinsics/{session}.{camera}.benchmark.tsv"
    params:
        role=setting("role"),
        topic=setting("topic"),
        source=intrinsics_source,
        name=intrinsics_name,
        board=intrinsics_board,
        distortion_model=setting("distortion_model"),
        info_topic=setting("camera_info"),
        sigma=intrinsics_sigma,
        sequence=first_sequence,
        data_root=data_root,
        contents=contents_of(intrinsics_file),
        code=code("calibrate.intrinsics"),
    shell:
        dior("intrinsics")


rule locate:
    """Locate an indoor camera from hand marks by PnP, together with its clock on the marked sequences."""
    input:
        camera_file=own_yaml,
        marks=own_marks,
        intrinsics="results/intrinsics/{session}/{camera}.parquet",
        mocap=marked_mocap,
        frames=marked_frames,
    output:
        out="results/locate/{session}/{camera}.parquet",
        out_covariance="results/locate/{session}/{camera}.covariance.parquet",
        out_clocks="results/locate/{session}/{camera}.clocks.parquet",
        out_clock_gains="results/locate/{session}/{camera}.clock_gains.parquet",
        out_clock_costs="results/locate/{session}/{camera}.clock_costs.parquet",
        out_marks="results/locate/{session}/{camera}.marks.parquet",
        findings="results/locate/{session}/{camera}.findings.parquet",
    log:
        "logs/locate/{session}.{camera}.log",
    benchmark:
        "logs/locate/{session}.{camera}.benchmark.tsv"
    params:
        sequences=marked_sequences,
        ransac_px=CONFIG["locate"]["ransac_px"],
        offsets=untracked(offsets_of(marked_sequences)),
        contents=contents_of(
            own_yaml, own_marks, parts=[clocks_by_hand(marked_sequences, own_name)]
        ),
        code=code("calibrate.locate"),
    shell:
        dior("locate")


rule place:
    """Place a camera from the tape, by an AprilTag, or where a reference says it is."""
    input:
        camera_file=own_yaml,
        intrinsics="results/intrinsics/{session}/{camera}.parquet",
        frames=tag_frames,
        bags=simulated(tag_bags),
    output:
        out="results/place/{session}/{camera}.parquet",
        out_marks="results/place/{session}/{camera}.marks.parquet",
        findings="results/place/{session}/{camera}.findings.parquet",
    log:
        "logs/place/{session}.{camera}.log",
    benchmark:
        "logs/place/{session}.{camera}.benchmark.tsv"
    params:
        data_root=data_root,
        tag=tag,
        contents=contents_of(own_yaml, reference_file, recorded(tag_bags)),
        code=code("calibrate.place"),
    shell:
        dior("place")


rule reference:
    """Judge somebody else's calibration by a walk: is its world one, and how well is it known?"""
    input:
        cameras=referenced_cameras,
        camera_files=referenced_yamls,
        marks=referenced_marks,
        detections=telling("detections/{sequence}.parquet"),
        frames=telling("frames/{sequence}.parquet"),
        offsets=telling_offsets,
    output:
        out="results/reference/{session}.parquet",
        out_covariance="results/reference/{session}.covariance.parquet",
        findings="results/reference/{session}.findings.parquet",
    log:
        "logs/reference/{session}.log",
    benchmark:
        "logs/reference/{session}.benchmark.tsv"
    params:
        sequence=telling_sequence,
        subject=telling_subject,
        people=untracked(subjects_sheet),
        height=telling_height,
        min_score=CONFIG["adjust"]["min_score"],
        huber_px=CONFIG["adjust"]["huber_px"],
        max_gap=CONFIG["time"]["max_gap"],
        marked=referenced_sequences,
        contents=contents_of(referenced_yamls, telling_offsets, referenced_marks),
        code=code("calibrate.reference"),
    shell:
        dior("reference")


rule adjust:
    """Adjust the close cameras of a session together with the joints they see."""
    input:
        cameras=placed,
        camera_files=close_yamls,
        detections=adjusted("detections"),
        everybody_seen=adjusted("detections", ".people"),
        frames=adjusted("frames"),
        marks=fact_marks,
        tags=tag_marks,
    output:
        out="results/adjust/{session}.parquet",
        out_covariance="results/adjust/{session}.covariance.parquet",
        out_metrics="results/adjust/{session}.metrics.parquet",
        findings="results/adjust/{session}.findings.parquet",
    log:
        "logs/adjust/{session}.log",
    benchmark:
        "logs/adjust/{session}.benchmark.tsv"
    params:
        window=windows,
        min_score=CONFIG["adjust"]["min_score"],
        min_views=CONFIG["adjust"]["min_views"],
        huber_px=CONFIG["adjust"]["huber_px"],
        max_mean_px=CONFIG["adjust"]["max_mean_px"],
        max_gap=CONFIG["time"]["max_gap"],
        known=metric_facts,
        people=people_measured,
        heights=heights_fingerprint,
        marked=fact_sequences,
        physics=as_json(CONFIG["physics"]),
        offsets=untracked(offsets_of(adjusted_sequences)),
        contents=contents_of(
            close_yamls, fact_marks, parts=[clocks_by_hand(adjusted_sequences, adjusted_names)]
        ),
        code=code("calibrate.adjust"),
    shell:
        dior("adjust")


rule clocks:
    """Find a camera's clock against the motion capture, or those of the close cameras of a sequence with each other."""
    input:
        cameras=clocked_cameras,
        covariance=clocked_covariance,
        detections=clocked_detections,
        everybody_seen=clocked_everybody,
        frames=clocked_frames,
        mocap=clocked_mocap,
        marked=marked_clocks,
        bags=simulated(clocked_bags),
    output:
        out="results/clocks/{recording}.parquet",
        out_gains="results/clocks/{recording}.gains.parquet",
        out_costs="results/clocks/{recording}.costs.parquet",
        out_aside="results/clocks/{recording}.aside.parquet",
        findings="results/clocks/{recording}.findings.parquet",
    log:
        "logs/clocks/{recording}.log",
    benchmark:
        "logs/clocks/{recording}.benchmark.tsv"
    params:
        sequence=clocked_sequence,
        names=clocked_names,
        min_score=CONFIG["detector"]["min_score"],
        max_gap=CONFIG["time"]["max_gap"],
        data_root=data_root,
        offsets=untracked(offsets_of(clocked_sequence)),
        contents=contents_of(
            recorded(clocked_bags), parts=[clocks_by_hand(clocked_sequence, clocked_names)]
        ),
        code=code("calibrate.clocks"),
    shell:
        dior("clocks")


rule align:
    """Place the long-range camera by boxes drawn or outlines seen around the known walker, or as a person nudged it."""
    input:
        camera_file=own_yaml,
        intrinsics="results/intrinsics/{session}/{camera}.parquet",
        skeletons=aligned_skeletons,
        frames=aligned("frames/{sequence}.parquet"),
        boxes=aligned_boxes,
        marks=aligned_marks,
        bags=simulated(aligned_bags),
        close=aligned_close,
        close_covariance=aligned_covariance,
    output:
        out="results/align/{session}/{camera}.parquet",
        out_covariance="results/align/{session}/{camera}.covariance.parquet",
        out_without="results/align/{session}/{camera}.left_out.parquet",
        findings="results/align/{session}/{camera}.findings.parquet",
    log:
        "logs/align/{session}.{camera}.log",
    benchmark:
        "logs/align/{session}.{camera}.benchmark.tsv"
    params:
        data_root=data_root,
        offsets=untracked(offsets_of(aligned_sequences)),
        contents=contents_of(
            own_yaml,
            aligned_boxes,
            aligned_marks,
            recorded(aligned_bags),
            parts=[clocks_by_hand(aligned_sequences, own_name)],
        ),
        code=code("calibrate.align"),
    shell:
        dior("align")


rule follow:
    """Find the clock of a long-range camera in one sequence by its boxes, or by the silhouettes in its pictures."""
    input:
        camera_file=followed_yaml,
        cameras=label_cameras,
        covariance=label_covariance,
        skeleton=skeleton,
        frames="results/frames/{sequence}.parquet",
        boxes=own_boxes,
        bags=simulated(followed_bags),
    output:
        out="results/follow/{sequence}.{camera}.parquet",
        out_gains="results/follow/{sequence}.{camera}.gains.parquet",
        out_costs="results/follow/{sequence}.{camera}.costs.parquet",
        findings="results/follow/{sequence}.{camera}.findings.parquet",
    log:
        "logs/follow/{sequence}.{camera}.log",
    benchmark:
        "logs/follow/{sequence}.{camera}.benchmark.tsv"
    params:
        makers=makers,
        data_root=data_root,
        offsets=untracked(offsets_of(own_sequence)),
        contents=contents_of(
            followed_yaml,
            own_boxes,
            recorded(followed_bags),
            parts=[clocks_by_hand(own_sequence, own_name)],
        ),
        code=code("calibrate.follow"),
    shell:
        dior("follow")
