"""Reconstruct: the instants of every sequence, outdoors the 3D joints at them, as they are and smoothed, and whether
the 3D of a sequence is possible.

Required inputs: frames, cameras, detections, clocks.
Outputs: results/timeline, results/bodies, results/triangulate, results/refine, results/world.
"""


rule timeline:
    """Say which pictures of each camera surround every instant."""
    input:
        frames="results/frames/{sequence}.parquet",
        clocks=timeline_clocks,
        mocap=mocap_table,
    output:
        out="results/timeline/{sequence}.parquet",
    log:
        "logs/timeline/{sequence}.log",
    benchmark:
        "logs/timeline/{sequence}.benchmark.tsv"
    params:
        cameras=close_names,
        max_gap=CONFIG["time"]["max_gap"],
        code=code("reconstruct.timeline"),
    shell:
        dior("timeline")


rule bodies:
    """Say how tall the subjects of a session are by their joints, to tell them from others."""
    input:
        cameras=close_of_session,
        detections=of_telling_walks("detections/{sequence}.parquet"),
        everybody_seen=of_telling_walks("detections/{sequence}.people.parquet"),
        timelines=of_telling_walks("timeline/{sequence}.parquet"),
    output:
        out="results/bodies/{session}.parquet",
    log:
        "logs/bodies/{session}.log",
    benchmark:
        "logs/bodies/{session}.benchmark.tsv"
    params:
        names=session_close_names,
        subjects=told_subjects,
        seeds=untracked(told_seeds),
        contents=contents_of(told_seeds),
        min_score=CONFIG["detector"]["min_score"],
        code=code("reconstruct.bodies"),
    shell:
        dior("bodies")


rule triangulate:
    """Triangulate the joints of an outdoor sequence from its close cameras."""
    input:
        cameras=close_cameras,
        detections="results/detections/{sequence}.parquet",
        everybody_seen="results/detections/{sequence}.people.parquet",
        timeline="results/timeline/{sequence}.parquet",
        bodies=session_bodies,
    output:
        out="results/triangulate/{sequence}.parquet",
        out_swaps="results/triangulate/{sequence}.swaps.parquet",
        out_detections="results/triangulate/{sequence}.detections.parquet",
        findings="results/triangulate/{sequence}.findings.parquet",
    log:
        "logs/triangulate/{sequence}.log",
    benchmark:
        "logs/triangulate/{sequence}.benchmark.tsv"
    params:
        subject=subject,
        names=close_names,
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
        code=code("reconstruct.triangulate"),
    shell:
        dior("triangulate")


rule refine:
    """Smooth the joints of an outdoor sequence over time."""
    input:
        skeleton="results/triangulate/{sequence}.parquet",
    output:
        out="results/refine/{sequence}.parquet",
        findings="results/refine/{sequence}.findings.parquet",
    log:
        "logs/refine/{sequence}.log",
    benchmark:
        "logs/refine/{sequence}.benchmark.tsv"
    params:
        subject=subject,
        max_gap_s=CONFIG["refine"]["max_gap_s"],
        code=code("reconstruct.refine"),
    shell:
        dior("refine")


rule world:
    """Ask of the 3D of any sequence whether a person can walk in its world."""
    input:
        skeleton=skeleton,
    output:
        findings="results/world/{sequence}.findings.parquet",
    log:
        "logs/world/{sequence}.log",
    benchmark:
        "logs/world/{sequence}.benchmark.tsv"
    params:
        subject=subject,
        people=untracked(subjects_sheet),
        height=walker_height,
        physics=as_json(CONFIG["physics"]),
        source=label_source,
        code=code("reconstruct.world"),
    shell:
        dior("world")
