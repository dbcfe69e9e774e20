"""Ingest: what was recorded, as tables.

Required inputs: the bags, C3D files and detections named in config/sequences.tsv.
Outputs: results/frames, results/audit, results/mocap, results/detect (where the sheet asks for it),
results/detections, results/gallery (where there is a gallery.tsv).
"""


rule frames:
    """Index the pictures of a sequence by stamp; the pixels stay in the bags."""
    input:
        bags=there(bags),
    output:
        "results/frames/{sequence}.parquet",
    log:
        "logs/frames/{sequence}.log",
    benchmark:
        "logs/frames/{sequence}.benchmark.tsv"
    params:
        bags=bags,
        topics=topics,
        data_root=DATA,
        code=code("ingest.frames"),
    shell:
        "dior frames"
        " --sequence {wildcards.sequence}"
        " --bags {params.bags:q}"
        " --data-root {params.data_root:q}"
        " --topics {params.topics:q}"
        " --out {output:q}"
        " 2>&1 | tee {log:q}"


rule audit:
    """Audit the stamps of a sequence: what is late, lost, repeated, black or out of order."""
    input:
        bags=there(bags),
        frames="results/frames/{sequence}.parquet",
    output:
        table="results/audit/{sequence}.parquet",
        dropped="results/audit/{sequence}.dropped.parquet",
        findings="results/audit/{sequence}.findings.parquet",
    log:
        "logs/audit/{sequence}.log",
    benchmark:
        "logs/audit/{sequence}.benchmark.tsv"
    params:
        data_root=DATA,
        code=code("ingest.audit"),
    shell:
        "dior audit"
        " --sequence {wildcards.sequence}"
        " --frames {input.frames:q}"
        " --data-root {params.data_root:q}"
        " --out {output.table:q}"
        " --out-dropped {output.dropped:q}"
        " --findings {output.findings:q}"
        " 2>&1 | tee {log:q}"


rule mocap:
    """Read the markers of an indoor sequence, by name and in metres."""
    input:
        c3d=there(mocap_file),
        trigger_log=there(trigger_log),
        frames="results/frames/{sequence}.parquet",
    output:
        "results/mocap/{sequence}.parquet",
    log:
        "logs/mocap/{sequence}.log",
    benchmark:
        "logs/mocap/{sequence}.benchmark.tsv"
    params:
        c3d=mocap_file,
        trigger_log=trigger_log,
        capture=capture,
        subject=subject,
        code=code("ingest.mocap"),
    shell:
        "dior mocap"
        " --sequence {wildcards.sequence}"
        " --subject {params.subject}"
        " --c3d {params.c3d:q}"
        " --frames {input.frames:q}"
        " --trigger-log {params.trigger_log:q}"
        " --capture {params.capture:q}"
        " --out {output:q}"
        " 2>&1 | tee {log:q}"


rule detect:
    """Run the project's pose network on the pictures of a close camera."""
    input:
        model=detector_model,
        bags=there(bags),
        frames="results/frames/{sequence}.parquet",
    output:
        "results/detect/{sequence}.{camera}.json",
    log:
        "logs/detect/{sequence}.{camera}.log",
    benchmark:
        "logs/detect/{sequence}.{camera}.benchmark.tsv"
    params:
        crop=CONFIG["detector"]["crop"],
        data_root=DATA,
        code=code("ingest.detect"),
    shell:
        "dior detect"
        " --sequence {wildcards.sequence}"
        " --camera {wildcards.camera}"
        " --frames {input.frames:q}"
        " --data-root {params.data_root:q}"
        " --model {input.model:q}"
        " --crop {params.crop}"
        " --out {output:q}"
        " 2>&1 | tee {log:q}"


rule detections:
    """Read the 2D detections of a sequence and follow the subject in them."""
    input:
        files=detection_files,
        frames="results/frames/{sequence}.parquet",
    output:
        table="results/detections/{sequence}.parquet",
        findings="results/detections/{sequence}.findings.parquet",
    log:
        "logs/detections/{sequence}.log",
    benchmark:
        "logs/detections/{sequence}.benchmark.tsv"
    params:
        pattern=detection_pattern,
        cameras=close_names,
        folders=detection_folders,
        format=detection_format,
        code=code("ingest.detections"),
    shell:
        "dior detections"
        " --sequence {wildcards.sequence}"
        " --pattern {params.pattern:q}"
        " --cameras {params.cameras}"
        " --format {params.format}"
        " --frames {input.frames:q}"
        " --out {output.table:q}"
        " --findings {output.findings:q}"
        " 2>&1 | tee {log:q}"


rule gallery:
    """Index the pictures of the subjects from all around."""
    input:
        recordings=there(gallery_files),
    output:
        table="results/gallery/gallery.parquet",
        findings="results/gallery/gallery.findings.parquet",
    log:
        "logs/gallery/gallery.log",
    benchmark:
        "logs/gallery/gallery.benchmark.tsv"
    params:
        rows=as_json(list(PROJECT.gallery.values())),
        data_root=DATA,
        code=code("ingest.gallery"),
    shell:
        "dior gallery"
        " --rows {params.rows:q}"
        " --data-root {params.data_root:q}"
        " --out {output.table:q}"
        " --findings {output.findings:q}"
        " 2>&1 | tee {log:q}"
