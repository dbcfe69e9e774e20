"""Release: the dataset as others get it.

Required inputs: labels, skeletons, frames, cameras and metrics of the subjects who agreed.
Outputs: results/release/dior-<version>/; beside it a tarball per subject, and the exports to other formats.
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


rule exports:
    """Write the release in the formats of other tools."""
    input:
        f"{RELEASE}/SHA256SUMS",
    output:
        exported_files(),
    log:
        "logs/exports/exports.log",
    benchmark:
        "logs/exports/exports.benchmark.tsv"
    params:
        release=release_folder,
        formats=CONFIG["release"]["exports"],
        out=exports_folder,
        code=code("release.exports"),
    shell:
        "dior exports"
        " --release {params.release:q}"
        " --formats {params.formats:q}"
        " --out {params.out:q}"
        " 2>&1 | tee {log:q}"
