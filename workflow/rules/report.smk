"""Report: one page that shows what came out and what needs a look.

Required inputs: metrics, findings, labels, cameras, skeletons, and pictures of the bags.
Outputs: results/report/index.html with its assets beside it; it opens from disk.
"""


rule overlays:
    """Draw the labels of each camera of a sequence on a few of its pictures."""
    input:
        bags=simulated(picture_files),
        frames="results/frames/{sequence}.parquet",
        labels=labels,
        detections=outdoor_only("results/triangulate/{sequence}.detections.parquet"),
        swaps=outdoor_only("results/triangulate/{sequence}.swaps.parquet"),
        boxes=hand_boxes,
        cameras=sequence_cameras,
    output:
        out=directory("results/report/assets/{sequence}/sheets"),
    log:
        "logs/overlays/{sequence}.log",
    benchmark:
        "logs/overlays/{sequence}.benchmark.tsv"
    params:
        data_root=data_root,
        boxes=named(PROJECT.boxes),
        roles=roles,
        per_camera=CONFIG["report"]["overlay_frames"],
        min_score=CONFIG["detector"]["min_score"],
        contents=contents_of(hand_boxes, recorded(picture_files)),
        code=code("report.overlays"),
    shell:
        dior("overlays")


rule clip:
    """Film the labels of all cameras of a sequence side by side."""
    input:
        bags=simulated(picture_files),
        frames="results/frames/{sequence}.parquet",
        clocks=all_clocks,
        timeline="results/timeline/{sequence}.parquet",
        labels=labels,
        frame_metrics="results/evaluate/{sequence}.frames.parquet",
    output:
        out="results/report/assets/{sequence}/clip.webm",
        poster="results/report/assets/{sequence}/clip.poster.jpg",
    log:
        "logs/clip/{sequence}.log",
    benchmark:
        "logs/clip/{sequence}.benchmark.tsv"
    params:
        data_root=data_root,
        seconds=CONFIG["report"]["clip_seconds"],
        contents=contents_of(recorded(picture_files)),
        code=code("report.clip"),
    shell:
        dior("clip")


rule viewer:
    """Gather the 3D, the cameras and a picture of each every second for the page that shows them over time."""
    input:
        bags=simulated(picture_files),
        frames="results/frames/{sequence}.parquet",
        clocks=all_clocks,
        timeline="results/timeline/{sequence}.parquet",
        skeleton=skeleton,
        cameras=sequence_cameras,
        covariance=sequence_covariance,
        labels=labels,
        detections=outdoor_only("results/triangulate/{sequence}.detections.parquet"),
        frame_metrics="results/evaluate/{sequence}.frames.parquet",
    output:
        out="results/report/assets/{sequence}/scene.js",
        out_pictures=directory("results/report/assets/{sequence}/pictures"),
    log:
        "logs/viewer/{sequence}.log",
    benchmark:
        "logs/viewer/{sequence}.benchmark.tsv"
    params:
        data_root=data_root,
        min_score=CONFIG["detector"]["min_score"],
        contents=contents_of(recorded(picture_files)),
        code=code("report.viewer"),
    shell:
        dior("viewer")


rule page:
    """Write the pages of one sequence, and leave for the first page what that needs of it."""
    input:
        metrics="results/evaluate/{sequence}.parquet",
        frame_metrics="results/evaluate/{sequence}.frames.parquet",
        skeleton=skeleton,
        gait="results/gait/{sequence}.parquet",
        gait_events="results/gait/{sequence}.events.parquet",
        findings=own_findings,
        cameras=sequence_cameras,
        audit="results/audit/{sequence}.parquet",
        dropped="results/audit/{sequence}.dropped.parquet",
        frames="results/frames/{sequence}.parquet",
        clocks=all_clocks,
        clock_costs=clock_costs,
        overlays="results/report/assets/{sequence}/sheets",
        clip=own_clip,
        scene="results/report/assets/{sequence}/scene.js",
    output:
        out="results/report/sequences/{sequence}.html",
        out_3d="results/report/sequences/{sequence}.3d.html",
        out_facts="results/report/assets/{sequence}/facts.json",
        out_plots=report(
            directory("results/report/assets/{sequence}/plots"),
            patterns=["{name}.svg"],
            category="Figures",
            subcategory="{sequence}",
        ),
    log:
        "logs/page/{sequence}.log",
    benchmark:
        "logs/page/{sequence}.benchmark.tsv"
    params:
        within=within,
        about=about,
        roles=roles,
        title=CONFIG["release"]["title"],
        before=before,
        after=after,
        code=code("report.page"),
    shell:
        dior("page")


rule report:
    """Write the first page, of all sequences."""
    input:
        # not read, but linked to: they are made again where they are gone
        expand(
            [
                "results/report/sequences/{sequence}.html",
                "results/report/sequences/{sequence}.3d.html",
                "results/report/assets/{sequence}/plots",
            ],
            sequence=SEQUENCES,
        ),
        metrics="results/evaluate/metrics.csv",
        quantiles=expand("results/evaluate/{sequence}.quantiles.parquet", sequence=SEQUENCES),
        told=expand("results/report/assets/{sequence}/facts.json", sequence=SEQUENCES),
        findings=common_findings(),
        cameras=all_cameras(),
        covariances=all_covariances(),
        turns=expand("results/moved/{session}.parquet", session=watched_sessions()),
        statistics="results/evaluate/statistics.csv",
        effort=PROJECT.effort(),
        recognition=existing_recognition(),
    output:
        page="results/report/index.html",
        compared="results/report/compared.js",
        viewer=directory("results/report/viewer"),
        cost="results/report/cost.html",
        verdict="results/report/verdict.txt",
        out_timing="results/timing.csv",
        plots=report(
            directory("results/report/assets/plots"), patterns=["{name}.svg"], category="Figures"
        ),
    log:
        "logs/report/report.log",
    benchmark:
        "logs/report/report.benchmark.tsv"
    params:
        root=".",
        out=page_folder,
        title=CONFIG["release"]["title"],
        sheet=fingerprint(PROJECT.rows),
        consents=as_json([PROJECT.left_out, PROJECT.unanswered]),
        contents=contents_of(effort_files),
        code=code("report.report"),
    script:
        "../scripts/step.py"
