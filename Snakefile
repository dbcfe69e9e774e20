import sys

from snakemake.utils import min_version

from dior.errors import DiorError
from dior.project.project import read_config

min_version("9.0")

try:
    # Snakemake's own reader, below, ends in a traceback where the file is no YAML, and takes none without a key
    has_keys = bool(read_config("."))
except DiorError as error:
    # Snakemake would print where this was raised after the sentence
    print(error, file=sys.stderr)
    sys.exit(1)


if has_keys:

    configfile: "config/config.yaml"


include: "workflow/rules/common.smk"
include: "workflow/rules/terminal.smk"
include: "workflow/rules/runs.smk"
include: "workflow/inputs/ingest.smk"
include: "workflow/inputs/calibrate.smk"
include: "workflow/inputs/label.smk"
include: "workflow/inputs/evaluate.smk"
include: "workflow/inputs/reid.smk"
include: "workflow/inputs/report.smk"
include: "workflow/inputs/release.smk"


if "simulate" in config:

    include: "workflow/rules/simulate.smk"


include: "workflow/rules/ingest.smk"
include: "workflow/rules/calibrate.smk"
include: "workflow/rules/reconstruct.smk"
include: "workflow/rules/gait.smk"
include: "workflow/rules/label.smk"
include: "workflow/rules/evaluate.smk"
include: "workflow/rules/reid.smk"
include: "workflow/rules/report.smk"
include: "workflow/rules/release.smk"


fill_in_lines()
keep_code()


onstart:
    secret.keep(os.getcwd(), KEY)
    show_bars()


onsuccess:
    say_what_to_open()


onerror:
    say_what_failed()


rule all:
    """The report, and a release and a re-identification that there are already (the default)."""
    default_target: True
    input:
        rules.report.output.page,
        existing_reid(),
        existing_release(),


rule release:
    """The release folder, its tarballs and its exports."""
    input:
        release_outputs(),


rule zoomed:
    """The centre of every long-range picture, for a detector."""
    input:
        [f"results/zoom/{sequence}.{camera}" for sequence, camera in long_range_recordings()],


for name in PROJECT.processed_subjects:

    rule:
        name:
            f"subject_{name}"
        input:
            [labels_of(sequence) for sequence in PROJECT.sequences_of_subject(name)],
            [
                f"results/evaluate/{sequence}.parquet"
                for sequence in PROJECT.sequences_of_subject(name)
            ],
            [
                f"results/report/assets/{sequence}/sheets"
                for sequence in PROJECT.sequences_of_subject(name)
            ],
