"""Evaluate: how good the labels are, by every yardstick that a sequence offers.

Required inputs: labels and skeletons; detections, boxes, marks, checks and truth where there are any; outputs of other
detectors where there is a detectors.tsv.
Outputs: results/moved/<session>.parquet, results/evaluate/<sequence>.parquet, results/detectors/<sequence>.parquet, results/evaluate/metrics.csv and
statistics.csv; when asked for, results/evaluate/to_mark (what to mark by hand) and results/zoom (pictures for a detector).
"""


rule moved:
    """Look for a camera that moved in the course of a session."""
    input:
        cameras=watched_cameras,
        detections=watched("triangulate/{sequence}.detections.parquet"),
        timelines=watched("timeline/{sequence}.parquet"),
        swaps=watched("triangulate/{sequence}.swaps.parquet"),
    output:
        out="results/moved/{session}.parquet",
        findings="results/moved/{session}.findings.parquet",
    log:
        "logs/moved/{session}.log",
    benchmark:
        "logs/moved/{session}.benchmark.tsv"
    params:
        sequences=watched("{sequence}"),
        names=adjusted_names,
        min_score=CONFIG["detector"]["min_score"],
        adjusted=adjusted_sequences,
        code=code("evaluate.moved"),
    script:
        "../scripts/step.py"


rule evaluate:
    """Measure the labels of one sequence."""
    input:
        labels=labels,
        skeleton=skeleton,
        cameras=sequence_cameras,
        detections=outdoor_only("results/triangulate/{sequence}.detections.parquet"),
        swaps=outdoor_only("results/triangulate/{sequence}.swaps.parquet"),
        aside=detection_offsets,
        boxes=hand_boxes,
        left_out=left_out_boxes,
        checks=hand_checks,
        marks=marks_tables,
        truth=simulated(truth_tables),
    output:
        out="results/evaluate/{sequence}.parquet",
        out_frames="results/evaluate/{sequence}.frames.parquet",
        out_checks="results/evaluate/{sequence}.checks.parquet",
        out_quantiles="results/evaluate/{sequence}.quantiles.parquet",
        findings="results/evaluate/{sequence}.findings.parquet",
    log:
        "logs/evaluate/{sequence}.log",
    benchmark:
        "logs/evaluate/{sequence}.benchmark.tsv"
    params:
        subject=subject,
        roles=roles,
        boxes=named(PROJECT.boxes),
        checks=named(PROJECT.checks),
        truth=untracked(truth_folder),
        min_score=CONFIG["detector"]["min_score"],
        contents=contents_of(hand_boxes, hand_checks, recorded(truth_tables)),
        code=code("evaluate.evaluate"),
    shell:
        dior("evaluate")


rule detectors:
    """Measure what other detectors find in the pictures of one sequence."""
    input:
        frames="results/frames/{sequence}.parquet",
        labels=detector_labels,
    output:
        out="results/detectors/{sequence}.parquet",
        out_frames="results/detectors/{sequence}.frames.parquet",
        findings="results/detectors/{sequence}.findings.parquet",
    log:
        "logs/detectors/{sequence}.log",
    benchmark:
        "logs/detectors/{sequence}.benchmark.tsv"
    params:
        subject=subject,
        rows=untracked(detector_rows),
        tools=detector_tools,
        roles=roles,
        contents=contents_of(detector_files),
        code=code("evaluate.detectors"),
    shell:
        dior("detectors")


rule zoom:
    """Write the centre of a camera's pictures for a detector (only when asked for)."""
    input:
        bags=simulated(picture_files),
        frames="results/frames/{sequence}.parquet",
    output:
        out=directory("results/zoom/{sequence}.{camera}"),
        out_index="results/zoom/{sequence}.{camera}.csv",
    log:
        "logs/zoom/{sequence}.{camera}.log",
    benchmark:
        "logs/zoom/{sequence}.{camera}.benchmark.tsv"
    params:
        data_root=data_root,
        contents=contents_of(recorded(picture_files)),
        code=code("evaluate.zoom"),
    shell:
        dior("zoom")


rule to_mark:
    """Draw what a person is to mark by hand (only when asked for)."""
    input:
        indoor=indoor_labels,
        long_range=long_range_labels,
    output:
        out=directory("results/evaluate/to_mark"),
    log:
        "logs/to_mark/to_mark.log",
    benchmark:
        "logs/to_mark/to_mark.benchmark.tsv"
    params:
        code=code("evaluate.to_mark"),
    shell:
        dior("to_mark")


rule metrics:
    """Pool the figures over sequences, subjects and cameras."""
    input:
        inputs=expand("results/evaluate/{sequence}.parquet", sequence=SEQUENCES)
        + expand("results/adjust/{session}.metrics.parquet", session=ADJUSTED)
        + expand("results/detectors/{sequence}.parquet", sequence=DETECTED),
        checks=expand("results/evaluate/{sequence}.checks.parquet", sequence=SEQUENCES),
    output:
        out=report("results/evaluate/metrics.csv", category="Tables"),
    log:
        "logs/metrics/metrics.log",
    benchmark:
        "logs/metrics/metrics.benchmark.tsv"
    params:
        code=code("evaluate.metrics"),
    script:
        "../scripts/step.py"


rule statistics:
    """Count what is in the dataset, what is missing and why."""
    input:
        labels=[path for sequence in SEQUENCES for path in labels_of(sequence)],
        skeletons=[skeleton_of(sequence) for sequence in SEQUENCES],
        frames=expand("results/frames/{sequence}.parquet", sequence=SEQUENCES),
        dropped=expand("results/audit/{sequence}.dropped.parquet", sequence=SEQUENCES),
        gallery=["results/gallery/gallery.parquet"] if PROJECT.gallery else [],
    output:
        out=report("results/evaluate/statistics.csv", category="Tables"),
    log:
        "logs/statistics/statistics.log",
    benchmark:
        "logs/statistics/statistics.benchmark.tsv"
    params:
        root=".",
        sheet=fingerprint(PROJECT.rows),
        code=code("evaluate.statistics"),
    script:
        "../scripts/step.py"
