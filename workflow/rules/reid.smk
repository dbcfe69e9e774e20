"""Re-identification: who is recognised by gait. Only when asked for, by the target `reid`.

Required inputs: skeletons, cameras, clocks and frames of all sequences; weights of the networks in config.yaml, outputs
of detectors at long range where there are any.
Outputs: results/reid/<sequence>.parquet (COCO-17 labels of all cameras) and .skeleton.parquet; table.csv, cmc.csv and
left_out.csv of all sequences, and a page with plots.
"""


rule inputs:
    """Make the COCO-17 joints of one sequence, in 3D and in every camera."""
    input:
        skeleton=skeleton,
        cameras=session_cameras,
        frames="results/frames/{sequence}.parquet",
        clocks=all_clocks,
    output:
        out="results/reid/{sequence}.parquet",
        out_skeleton="results/reid/{sequence}.skeleton.parquet",
    log:
        "logs/inputs/{sequence}.log",
    benchmark:
        "logs/inputs/{sequence}.benchmark.tsv"
    params:
        subject=subject,
        names=session_names,
        source=label_source,
        code=code("reid.inputs"),
    shell:
        dior("inputs")


rule recognise:
    """Compare all sequences by the baseline and the networks."""
    input:
        weights=compared_weights,
        labels=expand("results/reid/{sequence}.parquet", sequence=SEQUENCES),
        skeletons=expand("results/reid/{sequence}.skeleton.parquet", sequence=SEQUENCES),
        frames=expand("results/frames/{sequence}.parquet", sequence=SEQUENCES),
    output:
        out=report("results/reid/table.csv", category="Re-identification"),
        out_cmc="results/reid/cmc.csv",
        out_left_out="results/reid/left_out.csv",
    log:
        "logs/recognise/recognise.log",
    benchmark:
        "logs/recognise/recognise.benchmark.tsv"
    threads: 2
    params:
        root=".",
        networks=as_json(CONFIG["reid"]["networks"]),
        adaptations=CONFIG["reid"]["adaptations"],
        length=CONFIG["reid"]["length"],
        chunks=CONFIG["reid"]["chunks"],
        sheet=fingerprint(PROJECT.rows),
        detectors=untracked(as_json(long_range_rows())),
        tools=long_range_tools,
        contents=contents_of(compared_weights, long_range_detectors),
        code=code("reid.recognise"),
    script:
        "../scripts/step.py"


rule reid:
    """Write the table's page and plots: the target."""
    input:
        table="results/reid/table.csv",
        cmc="results/reid/cmc.csv",
        left_out="results/reid/left_out.csv",
    output:
        page="results/reid/index.html",
        plots=report(
            directory("results/reid/plots"),
            patterns=["{name}.svg"],
            category="Re-identification",
        ),
    log:
        "logs/reid/reid.log",
    benchmark:
        "logs/reid/reid.benchmark.tsv"
    params:
        title=CONFIG["release"]["title"],
        out=page_folder,
        code=code("report.reid"),
    shell:
        dior("reid")
