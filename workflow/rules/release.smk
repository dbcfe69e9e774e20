"""Release: the dataset as others get it.

Required inputs: labels, skeletons, frames, cameras and metrics of the subjects who agreed.
Outputs: results/release/dior-<version>/ and a tarball per subject beside it.
"""


rule package:
    """Write the release folder: tables, card and checksums."""
    input:
        labels=[path for sequence in PROJECT.released_sequences for path in labels_of(sequence)],
        skeletons=[skeleton_of(sequence) for sequence in PROJECT.released_sequences],
        frames=released("results/frames/{sequence}.parquet"),
        cameras=[
            path
            for session in released_sessions()
            for path in cameras_of(session, PROJECT.cameras(session))
        ],
        metrics=[
            *released("results/evaluate/{sequence}.parquet"),
            *[
                f"results/adjust/{session}.metrics.parquet"
                for session in ADJUSTED
                if session in released_sessions()
            ],
            *[
                f"results/detectors/{sequence}.parquet"
                for sequence in PROJECT.released_sequences
                if sequence in DETECTED
            ],
        ],
        gallery=["results/gallery/gallery.parquet"] if PROJECT.gallery else [],
    output:
        released_files(),
    log:
        "logs/package/package.log",
    benchmark:
        "logs/package/package.benchmark.tsv"
    params:
        version=VERSION,
        title=CONFIG["release"]["title"],
        license=CONFIG["release"]["license"],
        authors=CONFIG["release"]["authors"],
        out=release_folder,
        sheets=as_json([PROJECT.rows, PROJECT.subjects]),
        code=code("release.package"),
    shell:
        "dior package"
        " --project ."
        " --version {params.version:q}"
        " --title {params.title:q}"
        " --license {params.license:q}"
        " --authors {params.authors:q}"
        " --labels {input.labels:q}"
        " --skeletons {input.skeletons:q}"
        " --frames {input.frames:q}"
        " --cameras {input.cameras:q}"
        " --metrics {input.metrics:q}"
        " --gallery {input.gallery:q}"
        " --out {params.out:q}"
        " 2>&1 | tee {log:q}"


rule tarballs:
    """Pack one subject's part of the release."""
    input:
        released_files(),
    output:
        f"{RELEASE}-{{pseudonym}}.tar",
    log:
        "logs/tarballs/{pseudonym}.log",
    benchmark:
        "logs/tarballs/{pseudonym}.benchmark.tsv"
    params:
        release=release_folder,
        code=code("release.tarballs"),
    shell:
        "dior tarballs"
        " --release {params.release:q}"
        " --subject {wildcards.pseudonym}"
        " --out {output:q}"
        " 2>&1 | tee {log:q}"


rule heads:
    """Find the subject's head in the pictures of one camera."""
    input:
        cameras=camera_file,
        skeleton=skeleton,
        frames="results/frames/{sequence}.parquet",
        clocks=own_clock,
        labels="results/reproject/{sequence}.{camera}.parquet",
        before=earlier_heads,
    output:
        heads="results/heads/{sequence}.{camera}.parquet",
        findings="results/heads/{sequence}.{camera}.findings.parquet",
    log:
        "logs/heads/{sequence}.{camera}.log",
    benchmark:
        "logs/heads/{sequence}.{camera}.benchmark.tsv"
    params:
        code=code("release.heads"),
    shell:
        "dior heads"
        " --sequence {wildcards.sequence}"
        " --camera {wildcards.camera}"
        " --cameras {input.cameras:q}"
        " --skeleton {input.skeleton:q}"
        " --frames {input.frames:q}"
        " --clocks {input.clocks:q}"
        " --labels {input.labels:q}"
        " --before {input.before:q}"
        " --out {output.heads:q}"
        " --findings {output.findings:q}"
        " 2>&1 | tee {log:q}"


rule pixels:
    """Write the released pictures of one camera, the subject's head covered."""
    input:
        bags=there(released_bags),
        frames="results/frames/{sequence}.parquet",
        heads=covered_heads,
        shift=stamps_from,
    output:
        pixels="results/pixels/{sequence}.{camera}.parquet",
        findings="results/pixels/{sequence}.{camera}.findings.parquet",
    log:
        "logs/pixels/{sequence}.{camera}.log",
    benchmark:
        "logs/pixels/{sequence}.{camera}.benchmark.tsv"
    params:
        subject=pseudonym,
        data_root=DATA,
        faces=CONFIG["release"]["faces"],
        consent=pictures_consent,
        shift=stamps_shift,
        code=code("release.pixels"),
    shell:
        "dior pixels"
        " --sequence {wildcards.sequence}"
        " --subject {params.subject}"
        " --camera {wildcards.camera}"
        " --frames {input.frames:q}"
        " --data-root {params.data_root:q}"
        " --heads {input.heads:q}"
        " --faces {params.faces}"
        " --consent {params.consent}"
        " --shift {params.shift:q}"
        " --out {output.pixels:q}"
        " --findings {output.findings:q}"
        " 2>&1 | tee {log:q}"
