"""Calibrate: intrinsics and poses of every camera.

Required inputs: config/sessions/<session>/, the frames, indoors the mocap, outdoors the detections; for the long-range
camera the skeletons of the sequences that its file lists, and their boxes, marks or pictures.
Outputs: results/intrinsics, results/locate (indoors), results/place, results/adjust, results/align, results/follow.
"""


rule intrinsics:
    """Take a camera's intrinsics from the session's first recording, from a file or from pictures of a board."""
    input:
        frames=first_frames,
        file=there(intrinsics_file),
    output:
        camera="results/intrinsics/{session}/{camera}.parquet",
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
        model=setting("distortion_model"),
        sequence=first_sequence,
        data_root=DATA,
        code=code("calibrate.intrinsics"),
    shell:
        "dior intrinsics"
        " --session {wildcards.session}"
        " --camera {wildcards.camera}"
        " --role {params.role}"
        " --topic {params.topic:q}"
        " --source {params.source:q}"
        " --name {params.name:q}"
        " --board {params.board:q}"
        " --distortion-model {params.model:q}"
        " --frames {input.frames:q}"
        " --sequence {params.sequence}"
        " --data-root {params.data_root:q}"
        " --out {output.camera:q}"
        " --findings {output.findings:q}"
        " 2>&1 | tee {log:q}"


rule locate:
    """Locate an indoor camera from hand marks by PnP, together with its clock on the marked sequences."""
    input:
        camera=own_yaml,
        marks=own_marks,
        intrinsics="results/intrinsics/{session}/{camera}.parquet",
        mocap=marked_mocap,
        frames=marked_frames,
        offsets=marked_offsets,
    output:
        camera="results/locate/{session}/{camera}.parquet",
        covariance="results/locate/{session}/{camera}.covariance.parquet",
        clocks="results/locate/{session}/{camera}.clocks.parquet",
        clock_gains="results/locate/{session}/{camera}.clock_gains.parquet",
        clock_costs="results/locate/{session}/{camera}.clock_costs.parquet",
        marks="results/locate/{session}/{camera}.marks.parquet",
        findings="results/locate/{session}/{camera}.findings.parquet",
    log:
        "logs/locate/{session}.{camera}.log",
    benchmark:
        "logs/locate/{session}.{camera}.benchmark.tsv"
    params:
        sequences=marked_sequences,
        ransac_px=CONFIG["locate"]["ransac_px"],
        code=code("calibrate.locate"),
    shell:
        "dior locate"
        " --session {wildcards.session}"
        " --camera {wildcards.camera}"
        " --camera-file {input.camera:q}"
        " --marks {input.marks:q}"
        " --sequences {params.sequences}"
        " --intrinsics {input.intrinsics:q}"
        " --mocap {input.mocap:q}"
        " --frames {input.frames:q}"
        " --offsets {input.offsets:q}"
        " --ransac-px {params.ransac_px}"
        " --out {output.camera:q}"
        " --out-covariance {output.covariance:q}"
        " --out-clocks {output.clocks:q}"
        " --out-clock-gains {output.clock_gains:q}"
        " --out-clock-costs {output.clock_costs:q}"
        " --out-marks {output.marks:q}"
        " --findings {output.findings:q}"
        " 2>&1 | tee {log:q}"


rule place:
    """Place a camera from the tape, by an AprilTag, or where a reference says it is."""
    input:
        camera=own_yaml,
        intrinsics="results/intrinsics/{session}/{camera}.parquet",
        reference=there(reference_file),
        frames=tag_frames,
        bags=there(tag_bags),
    output:
        camera="results/place/{session}/{camera}.parquet",
        marks="results/place/{session}/{camera}.marks.parquet",
        findings="results/place/{session}/{camera}.findings.parquet",
    log:
        "logs/place/{session}.{camera}.log",
    benchmark:
        "logs/place/{session}.{camera}.benchmark.tsv"
    params:
        data_root=DATA,
        tag=tag,
        code=code("calibrate.place"),
    shell:
        "dior place"
        " --session {wildcards.session}"
        " --camera {wildcards.camera}"
        " --camera-file {input.camera:q}"
        " --tag {params.tag:q}"
        " --intrinsics {input.intrinsics:q}"
        " --frames {input.frames:q}"
        " --data-root {params.data_root:q}"
        " --out {output.camera:q}"
        " --out-marks {output.marks:q}"
        " --findings {output.findings:q}"
        " 2>&1 | tee {log:q}"


rule adjust:
    """Adjust the close cameras of a session together with the joints they see."""
    input:
        cameras=placed,
        camera_files=close_yamls,
        detections=adjusted("detections"),
        frames=adjusted("frames"),
        offsets=adjusted_offsets,
        marks=fact_marks,
        tags=tag_marks,
    output:
        cameras="results/adjust/{session}.parquet",
        covariance="results/adjust/{session}.covariance.parquet",
        metrics="results/adjust/{session}.metrics.parquet",
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
        marked=fact_sequences,
        intrinsics_sigma=CONFIG["adjust"]["intrinsics_sigma"],
        physics=as_json(CONFIG["physics"]),
        code=code("calibrate.adjust"),
    shell:
        "dior adjust"
        " --session {wildcards.session}"
        " --cameras {input.cameras:q}"
        " --camera-files {input.camera_files:q}"
        " --detections {input.detections:q}"
        " --frames {input.frames:q}"
        " --offsets {input.offsets:q}"
        " --window {params.window:q}"
        " --min-score {params.min_score}"
        " --min-views {params.min_views}"
        " --huber-px {params.huber_px}"
        " --max-mean-px {params.max_mean_px}"
        " --max-gap {params.max_gap}"
        " --known {params.known:q}"
        " --marks {input.marks:q}"
        " --marked {params.marked}"
        " --tags {input.tags:q}"
        " --intrinsics-sigma {params.intrinsics_sigma}"
        " --physics {params.physics:q}"
        " --out {output.cameras:q}"
        " --out-covariance {output.covariance:q}"
        " --out-metrics {output.metrics:q}"
        " --findings {output.findings:q}"
        " 2>&1 | tee {log:q}"


rule clocks:
    """Find a camera's clock against the motion capture, or those of the close cameras of a sequence with each other."""
    input:
        cameras=clocked_cameras,
        covariance=clocked_covariance,
        detections=clocked_detections,
        frames=clocked_frames,
        mocap=clocked_mocap,
        marked=marked_clocks,
        offsets=clocked_offsets,
        bags=there(clocked_bags),
    output:
        offsets="results/clocks/{recording}.parquet",
        gains="results/clocks/{recording}.gains.parquet",
        costs="results/clocks/{recording}.costs.parquet",
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
        data_root=DATA,
        code=code("calibrate.clocks"),
    shell:
        "dior clocks"
        " --sequence {params.sequence}"
        " --cameras {input.cameras:q}"
        " --names {params.names}"
        " --covariance {input.covariance:q}"
        " --detections {input.detections:q}"
        " --frames {input.frames:q}"
        " --mocap {input.mocap:q}"
        " --marked {input.marked:q}"
        " --offsets {input.offsets:q}"
        " --min-score {params.min_score}"
        " --max-gap {params.max_gap}"
        " --data-root {params.data_root:q}"
        " --out {output.offsets:q}"
        " --out-gains {output.gains:q}"
        " --out-costs {output.costs:q}"
        " --findings {output.findings:q}"
        " 2>&1 | tee {log:q}"


rule align:
    """Place the long-range camera by what is drawn or seen around the known walker, or as a person nudged it."""
    input:
        camera=own_yaml,
        intrinsics="results/intrinsics/{session}/{camera}.parquet",
        skeletons=aligned_skeletons,
        frames=aligned("frames/{sequence}.parquet"),
        offsets=aligned_offsets,
        boxes=aligned_boxes,
        marks=aligned_marks,
        bags=there(aligned_bags),
        close=aligned_close,
        covariance=aligned_covariance,
    output:
        camera="results/align/{session}/{camera}.parquet",
        covariance="results/align/{session}/{camera}.covariance.parquet",
        findings="results/align/{session}/{camera}.findings.parquet",
    log:
        "logs/align/{session}.{camera}.log",
    benchmark:
        "logs/align/{session}.{camera}.benchmark.tsv"
    params:
        data_root=DATA,
        code=code("calibrate.align"),
    shell:
        "dior align"
        " --session {wildcards.session}"
        " --camera {wildcards.camera}"
        " --camera-file {input.camera:q}"
        " --intrinsics {input.intrinsics:q}"
        " --skeletons {input.skeletons:q}"
        " --frames {input.frames:q}"
        " --offsets {input.offsets:q}"
        " --boxes {input.boxes:q}"
        " --marks {input.marks:q}"
        " --data-root {params.data_root:q}"
        " --close {input.close:q}"
        " --close-covariance {input.covariance:q}"
        " --out {output.camera:q}"
        " --out-covariance {output.covariance:q}"
        " --findings {output.findings:q}"
        " 2>&1 | tee {log:q}"


rule follow:
    """Find the clock of a long-range camera in one sequence by its boxes, or by the silhouettes in its pictures."""
    input:
        camera_file=followed_yaml,
        cameras=label_cameras,
        covariance=label_covariance,
        skeleton=skeleton,
        frames="results/frames/{sequence}.parquet",
        offsets=sequence_offsets,
        boxes=own_boxes,
        bags=there(followed_bags),
    output:
        offsets="results/follow/{sequence}.{camera}.parquet",
        gains="results/follow/{sequence}.{camera}.gains.parquet",
        costs="results/follow/{sequence}.{camera}.costs.parquet",
        findings="results/follow/{sequence}.{camera}.findings.parquet",
    log:
        "logs/follow/{sequence}.{camera}.log",
    benchmark:
        "logs/follow/{sequence}.{camera}.benchmark.tsv"
    params:
        makers=makers,
        data_root=DATA,
        code=code("calibrate.follow"),
    shell:
        "dior follow"
        " --sequence {wildcards.sequence}"
        " --camera {wildcards.camera}"
        " --camera-file {input.camera_file:q}"
        " --cameras {input.cameras:q}"
        " --makers {params.makers}"
        " --covariance {input.covariance:q}"
        " --skeleton {input.skeleton:q}"
        " --frames {input.frames:q}"
        " --offsets {input.offsets:q}"
        " --boxes {input.boxes:q}"
        " --data-root {params.data_root:q}"
        " --out {output.offsets:q}"
        " --out-gains {output.gains:q}"
        " --out-costs {output.costs:q}"
        " --findings {output.findings:q}"
        " 2>&1 | tee {log:q}"
