"""The steps of the workflow by their stage: a rule, a subcommand, a log folder and a module of the stage bear a step's
name.

A step's results lie in the folder of its name, unless `PLACES` says otherwise.
"""

STAGES = {
    "simulate": ("simulate", "simulate_mocap", "simulate_gallery"),
    "ingest": ("frames", "audit", "mocap", "detect", "detections", "gallery"),
    "calibrate": ("intrinsics", "locate", "place", "reference", "adjust", "clocks", "align", "follow"),
    "reconstruct": ("timeline", "bodies", "triangulate", "refine", "world"),
    "gait": ("gait",),
    "label": ("reproject", "people"),
    "evaluate": ("moved", "evaluate", "detectors", "zoom", "to_mark", "metrics", "statistics"),
    "reid": ("inputs", "recognise"),
    "report": ("reid", "overlays", "clip", "viewer", "page", "report"),
    "release": ("provenance", "heads", "pixels", "package", "sign", "exports", "tarballs"),
}
# step -> the module of the package that runs it, without `dior.`
MODULES = {step: f"{stage}.{step}" for stage, steps in STAGES.items() for step in steps}
# where results lie that are no folder of the step's name below results/: what a person opens, copies or reads together
PLACES = {
    "simulate": "<data_root>",
    "simulate_mocap": "<data_root>",
    "simulate_gallery": "<data_root>",
    "to_mark": "results/evaluate",
    "metrics": "results/evaluate",
    "statistics": "results/evaluate",
    "inputs": "results/reid",
    "recognise": "results/reid",
    "overlays": "results/report",
    "clip": "results/report",
    "viewer": "results/report",
    "page": "results/report",
    "package": "results/release",
    "sign": "results/release",
    "exports": "results/release",
    "tarballs": "results/release",
}


def place_of(step: str) -> str:
    """The folder of a step's results, relative to the project."""
    return PLACES.get(step, f"results/{step}")
