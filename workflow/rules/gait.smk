"""Gait: when feet strike the floor and leave it, and the parameters of gait of every walk.

Required inputs: skeletons.
Outputs: results/gait/<sequence>.parquet (the walk), .events.parquet, .steps.parquet.
"""


rule gait:
    """Find the gait events of a sequence, and measure its steps and strides."""
    input:
        skeleton=skeleton,
    output:
        out="results/gait/{sequence}.parquet",
        out_events="results/gait/{sequence}.events.parquet",
        out_steps="results/gait/{sequence}.steps.parquet",
        findings="results/gait/{sequence}.findings.parquet",
    log:
        "logs/gait/{sequence}.log",
    benchmark:
        "logs/gait/{sequence}.benchmark.tsv"
    params:
        subject=subject,
        code=code("gait.gait"),
    shell:
        dior("gait")
