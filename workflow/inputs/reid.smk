"""Input and parameter functions of the rules of reid. They only look things up in the project."""

from importlib.util import find_spec

from dior.reid.networks import INSTALL, no_file

# what the report shows of it
RECOGNITION = expand("results/reid/{table}.csv", table=["table", "cmc", "left_out"])


def session_cameras(wildcards):
    session = session_of(wildcards)
    return cameras_of(session, PROJECT.cameras(session))


def session_names(wildcards):
    return PROJECT.cameras_of(wildcards.sequence)


def network_weights():
    return [path for files in CONFIG["reid"]["networks"].values() for path in files]


def lacks_torch():
    """Whether networks are asked for that cannot run here. PyTorch is not imported: that takes seconds."""
    return bool(network_weights()) and find_spec("torch") is None


def compared_weights(wildcards):
    """The weights of the networks; what lacks is said before the first job, not after the last."""
    for path in network_weights():
        if not os.path.isfile(path):
            raise WorkflowError(no_file("reid.networks", path))
    if lacks_torch():
        raise WorkflowError(
            "config/config.yaml: 'reid.networks' names weights, but PyTorch, which networks need, is not installed: "
            f"{INSTALL} (or leave the lists empty: the baseline needs no network)"
        )
    return [ancient(path) for path in network_weights()]


def long_range_rows():
    """The rows of detectors.tsv of long-range cameras."""
    recorded = set(long_range_recordings())
    return [
        {"sequence": sequence, **row}
        for sequence in SEQUENCES
        for row in PROJECT.detectors_of(sequence)
        if (sequence, row["camera"]) in recorded
    ]


def long_range_detectors(wildcards):
    return [row["path"] for row in long_range_rows()]


def long_range_tools(wildcards):
    """Whose outputs they are, in the order of `contents_of(long_range_detectors)`."""
    return as_told(long_range_rows())


def existing_recognition():
    """The tables, where there are some already that can be kept up: nobody who withdrew stays in them.

    Their page tells, too: a step that fails loses its tables, and is to fail again until it is mended.
    """
    lacking = lacks_torch() or not all(map(os.path.isfile, network_weights()))
    possible = len(PROJECT.processed_subjects) > 1 and not lacking
    there = any(map(os.path.exists, [RECOGNITION[0], "results/reid/index.html"]))
    return RECOGNITION if possible and there else []


def existing_reid():
    """Their page, too."""
    return ["results/reid/index.html"] if existing_recognition() else []
