"""Simulate: a capture with known truth, where config.yaml asks for one.

Required inputs: the `simulate:` section of config.yaml and the sheet.
Outputs: below data_root, the recordings of each sequence as a lab would bring them, and the truth apart.
"""


rule simulate:
    """Render the bags of one sequence and detect the person in them."""
    input:
        motion=motion,
    output:
        bags=expand("{data}/{{sequence}}/{pc}.bag", data=DATA, pc=["pc1", "pc2"]),
        detections=simulated_detections(),
        truth=expand("{data}/truth/{{sequence}}/{table}.parquet", data=DATA, table=true_tables()),
    log:
        "logs/simulate/{sequence}.log",
    benchmark:
        "logs/simulate/{sequence}.benchmark.tsv"
    params:
        settings=as_json(CONFIG["simulate"]),
        out=data_root,
        contents=contents_of(motion),
        code=code("simulate.simulate"),
    shell:
        dior("simulate")


rule simulate_mocap:
    """Write the C3D of one indoor sequence."""
    input:
        motion=motion,
    output:
        out=f"{DATA}/{{sequence}}/mocap.c3d",
    log:
        "logs/simulate_mocap/{sequence}.log",
    benchmark:
        "logs/simulate_mocap/{sequence}.benchmark.tsv"
    params:
        settings=as_json(CONFIG["simulate"]),
        out=data_root,
        contents=contents_of(motion),
        code=code("simulate.simulate_mocap"),
    shell:
        dior("simulate_mocap")


rule simulate_gallery:
    """Render the subject of one sequence from all around, as gallery.tsv asks for it."""
    output:
        frontal=directory(f"{DATA}/gallery/{{sequence}}/frontal"),
        down=directory(f"{DATA}/gallery/{{sequence}}/down45"),
    log:
        "logs/simulate_gallery/{sequence}.log",
    benchmark:
        "logs/simulate_gallery/{sequence}.benchmark.tsv"
    params:
        settings=as_json(CONFIG["simulate"]),
        out=data_root,
        code=code("simulate.simulate_gallery"),
    shell:
        dior("simulate_gallery")
