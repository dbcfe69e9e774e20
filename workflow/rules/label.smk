"""Label: the 2D keypoints of every frame of every camera.

Required inputs: skeletons, cameras, frames, clocks.
Outputs: results/reproject.
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
