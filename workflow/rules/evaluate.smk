"""Evaluate: how good the labels are, by every yardstick that a sequence offers.

Required inputs: labels and skeletons; detections, boxes, marks, checks and truth where there are any.
Outputs: results/evaluate/<sequence>.parquet, results/evaluate/metrics.csv, results/evaluate/statistics.csv.
"""


rule evaluate:
    """Measure the labels of one sequence."""
    input:
        labels=labels,
        skeleton=skeleton,
        detections=outdoor_only("results/detections/{sequence}.parquet"),
        swaps=outdoor_only("results/triangulate/{sequence}.swaps.parquet"),
        boxes=hand_boxes,
        checks=hand_checks,
        marks=marks_tables,
        truth=truth_tables,
    output:
        metrics="results/evaluate/{sequence}.parquet",
        frames="results/evaluate/{sequence}.frames.parquet",
    log:
        "logs/evaluate/{sequence}.log",
    benchmark:
        "logs/evaluate/{sequence}.benchmark.tsv"
    params:
        subject=subject,
        roles=roles,
        boxes=named(PROJECT.boxes),
        checks=named(PROJECT.checks),
        truth=truth_folder,
        min_score=CONFIG["detector"]["min_score"],
        code=code("evaluate.evaluate"),
    shell:
        "dior evaluate"
        " --sequence {wildcards.sequence}"
        " --subject {params.subject}"
        " --labels {input.labels:q}"
        " --skeleton {input.skeleton:q}"
        " --roles {params.roles}"
        " --detections {input.detections:q}"
        " --min-score {params.min_score}"
        " --boxes {params.boxes:q}"
        " --marks {input.marks:q}"
        " --checks {params.checks:q}"
        " --swaps {input.swaps:q}"
        " --truth {params.truth:q}"
        " --out {output.metrics:q}"
        " --out-frames {output.frames:q}"
        " 2>&1 | tee {log:q}"


rule metrics:
    """Pool the figures over sequences, subjects and cameras."""
    input:
        sequences=expand("results/evaluate/{sequence}.parquet", sequence=SEQUENCES),
        adjust=expand("results/adjust/{session}.metrics.parquet", session=ADJUSTED),
    output:
        report("results/evaluate/metrics.csv", category="Tables"),
    log:
        "logs/metrics/metrics.log",
    benchmark:
        "logs/metrics/metrics.benchmark.tsv"
    params:
        code=code("evaluate.metrics"),
    shell:
        "dior metrics" " --inputs {input:q}" " --out {output:q}" " 2>&1 | tee {log:q}"


rule statistics:
    """Count what is in the dataset, what is missing and why."""
    input:
        labels=[path for sequence in SEQUENCES for path in labels_of(sequence)],
        skeletons=[skeleton_of(sequence) for sequence in SEQUENCES],
        frames=expand("results/frames/{sequence}.parquet", sequence=SEQUENCES),
        dropped=expand("results/audit/{sequence}.dropped.parquet", sequence=SEQUENCES),
        gallery=["results/gallery/gallery.parquet"] if PROJECT.gallery else [],
    output:
        report("results/evaluate/statistics.csv", category="Tables"),
    log:
        "logs/statistics/statistics.log",
    benchmark:
        "logs/statistics/statistics.benchmark.tsv"
    params:
        sheet=as_json(PROJECT.rows),
        code=code("evaluate.statistics"),
    shell:
        "dior statistics"
        " --root ."
        " --labels {input.labels:q}"
        " --skeletons {input.skeletons:q}"
        " --frames {input.frames:q}"
        " --dropped {input.dropped:q}"
        " --gallery {input.gallery:q}"
        " --out {output:q}"
        " 2>&1 | tee {log:q}"
