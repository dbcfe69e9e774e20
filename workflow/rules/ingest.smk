"""Ingest: what was recorded, as tables.

Required inputs: the bags or videos, C3D files and detections named in config/sequences.tsv.
Outputs: results/frames, results/audit, results/mocap, results/detect (where the sheet asks for it),
results/detections, results/gallery (where there is a gallery.tsv).
"""


rule frames:
    """Index the pictures of a sequence by stamp; the pixels stay in the bags."""
    input:
        bags=simulated(picture_files),
    output:
        out="results/frames/{sequence}.parquet",
    log:
        "logs/frames/{sequence}.log",
    benchmark:
        "logs/frames/{sequence}.benchmark.tsv"
    params:
        bags=untracked(bags),
        topics=topics,
        in_bags=in_bags,
        by_hand=untracked(clocked_by_hand),
        videos=untracked(videos),
        sidecars=untracked(sidecars),
        rates=video_rates,
        data_root=data_root,
        contents=contents_of(recorded(picture_files)),
        code=code("ingest.frames"),
    shell:
        dior("frames")


rule audit:
    """Audit the stamps of a sequence: what is late, lost, repeated, black or out of order."""
    input:
        bags=simulated(picture_files),
        frames="results/frames/{sequence}.parquet",
    output:
        out="results/audit/{sequence}.parquet",
        out_dropped="results/audit/{sequence}.dropped.parquet",
        findings="results/audit/{sequence}.findings.parquet",
    log:
        "logs/audit/{sequence}.log",
    benchmark:
        "logs/audit/{sequence}.benchmark.tsv"
    params:
        data_root=data_root,
        contents=contents_of(recorded(picture_files)),
        code=code("ingest.audit"),
    shell:
        dior("audit")


rule mocap:
    """Read the markers of an indoor sequence, by name and in metres."""
    input:
        c3d=simulated(mocap_file),
        frames="results/frames/{sequence}.parquet",
    output:
        out="results/mocap/{sequence}.parquet",
        findings="results/mocap/{sequence}.findings.parquet",
    log:
        "logs/mocap/{sequence}.log",
    benchmark:
        "logs/mocap/{sequence}.benchmark.tsv"
    params:
        c3d=untracked(mocap_file),
        trigger_log=untracked(trigger_log),
        capture=capture,
        subject=subject,
        units=mocap_units,
        up=mocap_up,
        people=untracked(subjects_sheet),
        session_file=untracked(sequence_session_file),
        prefix=prefix_fingerprint,
        names=untracked(marker_names),
        contents=contents_of(recorded(mocap_file), trigger_log, marker_names),
        code=code("ingest.mocap"),
    shell:
        dior("mocap")


rule detect:
    """Run the project's pose network on the pictures of a close camera."""
    input:
        model=detector_model,
        bags=simulated(picture_files),
        frames="results/frames/{sequence}.parquet",
    output:
        out="results/detect/{sequence}.{camera}.json",
    log:
        "logs/detect/{sequence}.{camera}.log",
    benchmark:
        "logs/detect/{sequence}.{camera}.benchmark.tsv"
    params:
        crop=CONFIG["detector"]["crop"],
        data_root=data_root,
        contents=contents_of(detector_model, recorded(picture_files)),
        code=code("ingest.detect"),
    shell:
        dior("detect")


rule detections:
    """Read the 2D detections of a sequence, follow the subject in them and compare them with the pictures."""
    input:
        files=detection_files,
        bags=simulated(picture_files),
        frames="results/frames/{sequence}.parquet",
    output:
        out="results/detections/{sequence}.parquet",
        out_people="results/detections/{sequence}.people.parquet",
        findings="results/detections/{sequence}.findings.parquet",
    log:
        "logs/detections/{sequence}.log",
    benchmark:
        "logs/detections/{sequence}.benchmark.tsv"
    params:
        pattern=untracked(detection_pattern),
        cameras=close_names,
        format=detection_format,
        first_frame=detection_first_frame,
        data_root=data_root,
        looked_at=detections_checked,
        contents=contents_of(brought_detections, recorded(picture_files)),
        code=code("ingest.detections"),
    shell:
        dior("detections")


rule gallery:
    """Index the pictures of the subjects from all around."""
    input:
        recordings=simulated(gallery_files),
    output:
        out="results/gallery/gallery.parquet",
        findings="results/gallery/gallery.findings.parquet",
    log:
        "logs/gallery/gallery.log",
    benchmark:
        "logs/gallery/gallery.benchmark.tsv"
    params:
        rows=as_json(list(PROJECT.gallery.values())),
        data_root=data_root,
        contents=contents_of(recorded(gallery_files)),
        code=code("ingest.gallery"),
    shell:
        dior("gallery")
