"""The command `dior`: one subcommand per rule of the workflow, and the few that a person types. No logic here."""

import argparse
import json
import sys
import time
from importlib import import_module
from pathlib import Path

from dior import by_hand
from dior.errors import DiorError
from dior.evaluate import timing


def pairs(words):
    """`key=value` words as a dict."""
    return dict(word.split("=", 1) for word in words)


def path_pairs(words):
    return {key: Path(value) for key, value in pairs(words).items()}


def path_or_none(words):
    """Zero paths or one."""
    return Path(words[0]) if words else None


TEXT, PATH, NUMBER, INTEGER, JSON = {}, {"type": Path}, {"type": float}, {"type": int}, {"type": json.loads}
OPTIONAL = {"nargs": "?", "const": "", "default": ""}
PATHS = {"type": Path, "nargs": "*", "default": []}
WORDS = {"nargs": "*", "default": []}
# flags whose words become something else: flag kind -> conversion after parsing
PAIRS, PATH_PAIRS, MAYBE = {**WORDS, "dest": pairs}, {**WORDS, "dest": path_pairs}, {**WORDS, "dest": path_or_none}

STEPS = {
    "simulate": (
        "simulate.recording",
        "record one sequence of a simulated capture",
        {"settings": JSON, "sequence": TEXT, "out": PATH, "only": {"choices": ["recording", "mocap", "gallery"]}},
    ),
    "frames": (
        "ingest.frames",
        "index the pictures of a sequence",
        {"sequence": TEXT, "bags": PATHS, "data-root": PATH, "topics": PAIRS, "out": PATH},
    ),
    "audit": (
        "ingest.stamps",
        "audit the stamps and pictures of a sequence",
        {"sequence": TEXT, "frames": PATH, "data-root": PATH, "out": PATH, "out-dropped": PATH, "findings": PATH},
    ),
    "mocap": (
        "ingest.mocap",
        "read the markers of a C3D",
        {
            "sequence": TEXT,
            "subject": TEXT,
            "c3d": PATH,
            "frames": PATH,
            "trigger-log": MAYBE,
            "capture": OPTIONAL,
            "out": PATH,
        },
    ),
    "detect": (
        "ingest.detect",
        "run a pose network on the pictures of one camera",
        {
            "sequence": TEXT,
            "camera": TEXT,
            "frames": PATH,
            "data-root": PATH,
            "model": PATH,
            "crop": {"choices": ["whole", "person"]},
            "out": PATH,
        },
    ),
    "detections": (
        "ingest.detections",
        "read 2D detections and follow the subject",
        {
            "sequence": TEXT,
            "pattern": TEXT,
            "cameras": WORDS,
            "format": TEXT,
            "frames": PATH,
            "out": PATH,
            "findings": PATH,
        },
    ),
    "gallery": (
        "ingest.gallery",
        "index the pictures of the subjects from all around",
        {"rows": JSON, "data-root": PATH, "out": PATH, "findings": PATH},
    ),
    "intrinsics": (
        "calibrate.intrinsics",
        "intrinsics of one camera",
        {
            "session": TEXT,
            "camera": TEXT,
            "role": TEXT,
            "topic": TEXT,
            "source": TEXT,
            "name": OPTIONAL,
            "board": JSON,
            "distortion-model": OPTIONAL,
            "frames": PATH,
            "sequence": TEXT,
            "data-root": PATH,
            "out": PATH,
            "findings": PATH,
        },
    ),
    "locate": (
        "calibrate.locate",
        "pose of an indoor camera, and its clock in the marked sequences, from hand marks",
        {
            "session": TEXT,
            "camera": TEXT,
            "camera-file": PATH,
            "marks": PATH,
            "sequences": WORDS,
            "intrinsics": PATH,
            "mocap": PATHS,
            "frames": PATHS,
            "offsets": PATHS,
            "ransac-px": NUMBER,
            "out": PATH,
            "out-covariance": PATH,
            "out-clocks": PATH,
            "out-clock-gains": PATH,
            "out-clock-costs": PATH,
            "out-marks": PATH,
            "findings": PATH,
        },
    ),
    "place": (
        "calibrate.place",
        "pose of a camera from the tape, an AprilTag or a reference",
        {
            "session": TEXT,
            "camera": TEXT,
            "camera-file": PATH,
            "tag": JSON,
            "intrinsics": PATH,
            "frames": MAYBE,
            "data-root": PATH,
            "out": PATH,
            "out-marks": PATH,
            "findings": PATH,
        },
    ),
    "adjust": (
        "calibrate.adjust",
        "bundle adjustment of the close cameras of a session",
        {
            "session": TEXT,
            "cameras": PATHS,
            "camera-files": PATHS,
            "detections": PATHS,
            "frames": PATHS,
            "offsets": PATHS,
            "window": JSON,
            "min-score": NUMBER,
            "min-views": INTEGER,
            "huber-px": NUMBER,
            "max-mean-px": NUMBER,
            "max-gap": NUMBER,
            "known": JSON,
            "marks": PATHS,
            "marked": WORDS,
            "tags": PATHS,
            "intrinsics-sigma": NUMBER,
            "physics": JSON,
            "out": PATH,
            "out-covariance": PATH,
            "out-metrics": PATH,
            "findings": PATH,
        },
    ),
    "clocks": (
        "calibrate.clocks",
        "clocks of a sequence's cameras against the motion capture or each other",
        {
            "sequence": TEXT,
            "cameras": PATHS,
            "names": WORDS,
            "covariance": PATHS,
            "detections": MAYBE,
            "frames": PATH,
            "mocap": MAYBE,
            "marked": PATHS,
            "offsets": MAYBE,
            "min-score": NUMBER,
            "max-gap": NUMBER,
            "data-root": PATH,
            "out": PATH,
            "out-gains": PATH,
            "out-costs": PATH,
            "findings": PATH,
        },
    ),
    "align": (
        "calibrate.align",
        "pose of the long-range camera from boxes, silhouettes or clicked joints, or by nudges",
        {
            "session": TEXT,
            "camera": TEXT,
            "camera-file": PATH,
            "intrinsics": PATH,
            "skeletons": PATHS,
            "frames": PATHS,
            "offsets": PATHS,
            "boxes": PATHS,
            "marks": MAYBE,
            "data-root": PATH,
            "close": PATHS,
            "close-covariance": PATHS,
            "out": PATH,
            "out-covariance": PATH,
            "findings": PATH,
        },
    ),
    "follow": (
        "calibrate.follow",
        "clock of a camera without detections in one sequence, from boxes or silhouettes",
        {
            "sequence": TEXT,
            "camera": TEXT,
            "camera-file": PATH,
            "cameras": PATHS,
            "makers": WORDS,
            "covariance": PATHS,
            "skeleton": PATH,
            "frames": PATH,
            "offsets": MAYBE,
            "boxes": MAYBE,
            "data-root": PATH,
            "out": PATH,
            "out-gains": PATH,
            "out-costs": PATH,
            "findings": PATH,
        },
    ),
    "timeline": (
        "reconstruct.timeline",
        "the instants of a sequence",
        {
            "sequence": TEXT,
            "frames": PATH,
            "cameras": WORDS,
            "clocks": PATHS,
            "mocap": MAYBE,
            "max-gap": NUMBER,
            "out": PATH,
        },
    ),
    "triangulate": (
        "reconstruct.triangulate",
        "3D joints of an outdoor sequence",
        {
            "sequence": TEXT,
            "subject": TEXT,
            "cameras": PATHS,
            "names": WORDS,
            "detections": PATH,
            "timeline": PATH,
            "method": TEXT,
            "min-score": NUMBER,
            "max-error-px": NUMBER,
            "max-speed": NUMBER,
            "max-body-speed": NUMBER,
            "max-bone-change": NUMBER,
            "out": PATH,
            "out-swaps": PATH,
            "findings": PATH,
        },
    ),
    "refine": (
        "reconstruct.refine",
        "3D joints smoothed over a sequence",
        {"sequence": TEXT, "subject": TEXT, "skeleton": PATH, "max-gap-s": NUMBER, "out": PATH, "findings": PATH},
    ),
    "reproject": (
        "label.reproject",
        "2D labels of one camera of a sequence",
        {
            "sequence": TEXT,
            "subject": TEXT,
            "camera": TEXT,
            "cameras": PATHS,
            "makers": WORDS,
            "covariance": PATHS,
            "skeleton": PATH,
            "frames": PATH,
            "clocks": PATHS,
            "clock-gains": PATHS,
            "source": TEXT,
            "out": PATH,
        },
    ),
    "moved": (
        "evaluate.moved",
        "did a camera move in the course of a session",
        {
            "session": TEXT,
            "sequences": WORDS,
            "names": WORDS,
            "cameras": PATHS,
            "detections": PATHS,
            "timelines": PATHS,
            "swaps": PATHS,
            "min-score": NUMBER,
            "out": PATH,
            "findings": PATH,
        },
    ),
    "evaluate": (
        "evaluate.evaluate",
        "measure the labels of a sequence",
        {
            "sequence": TEXT,
            "subject": TEXT,
            "labels": PATHS,
            "skeleton": MAYBE,
            "roles": PAIRS,
            "detections": MAYBE,
            "min-score": NUMBER,
            "boxes": PATH_PAIRS,
            "marks": PATHS,
            "checks": PATH_PAIRS,
            "swaps": MAYBE,
            "truth": MAYBE,
            "out": PATH,
            "out-frames": PATH,
            "out-checks": PATH,
        },
    ),
    "detectors": (
        "evaluate.detectors",
        "measure what other detectors find",
        {
            "sequence": TEXT,
            "subject": TEXT,
            "rows": JSON,
            "roles": PAIRS,
            "frames": PATH,
            "labels": PATHS,
            "out": PATH,
            "out-frames": PATH,
            "findings": PATH,
        },
    ),
    "zoom": (
        "evaluate.zoom",
        "write the centre of a camera's pictures for a detector",
        {"sequence": TEXT, "camera": TEXT, "frames": PATH, "data-root": PATH, "out": PATH, "out-index": PATH},
    ),
    "to_mark": (
        "evaluate.to_mark",
        "draw what is to be marked by hand",
        {"indoor": PATHS, "long-range": PATHS, "out": PATH},
    ),
    "metrics": (
        "evaluate.metrics",
        "pool the figures of all sequences",
        {"inputs": PATHS, "checks": PATHS, "out": PATH},
    ),
    "statistics": (
        "evaluate.statistics",
        "count what is in the dataset and what is missing",
        {
            "root": PATH,
            "labels": PATHS,
            "skeletons": PATHS,
            "frames": PATHS,
            "dropped": PATHS,
            "gallery": MAYBE,
            "out": PATH,
        },
    ),
    "inputs": (
        "reid.inputs",
        "what re-identification is given: COCO-17 joints of a sequence in 3D and in every camera",
        {
            "sequence": TEXT,
            "subject": TEXT,
            "names": WORDS,
            "skeleton": PATH,
            "cameras": PATHS,
            "frames": PATH,
            "clocks": PATHS,
            "source": TEXT,
            "out": PATH,
            "out-skeleton": PATH,
        },
    ),
    "recognise": (
        "reid.recognise",
        "who is recognised by gait: every method with every camera as the probe",
        {
            "root": PATH,
            "labels": PATHS,
            "skeletons": PATHS,
            "frames": PATHS,
            "networks": JSON,
            "adaptations": WORDS,
            "length": INTEGER,
            "chunks": INTEGER,
            "out": PATH,
            "out-cmc": PATH,
            "out-left-out": PATH,
        },
    ),
    "reid": (
        "report.reid",
        "the page and the plots of re-identification",
        {"title": TEXT, "table": PATH, "cmc": PATH, "left-out": PATH, "out": PATH},
    ),
    "overlays": (
        "report.overlays",
        "draw labels on a few pictures",
        {
            "sequence": TEXT,
            "frames": PATH,
            "data-root": PATH,
            "labels": PATHS,
            "detections": MAYBE,
            "swaps": MAYBE,
            "min-score": NUMBER,
            "boxes": PATH_PAIRS,
            "roles": PAIRS,
            "count": INTEGER,
            "out": PATH,
        },
    ),
    "clip": (
        "report.clip",
        "film the labels of all cameras side by side",
        {
            "sequence": TEXT,
            "frames": PATH,
            "clocks": PATHS,
            "timeline": PATH,
            "data-root": PATH,
            "labels": PATHS,
            "roles": PAIRS,
            "seconds": NUMBER,
            "out": PATH,
            "poster": PATH,
        },
    ),
    "report": (
        "report.page",
        "write the report's page",
        {
            "root": PATH,
            "title": TEXT,
            "metrics": PATH,
            "frame-metrics": PATHS,
            "findings": PATHS,
            "cameras": PATHS,
            "covariances": PATHS,
            "turns": PATHS,
            "skeletons": PATHS,
            "audits": PATHS,
            "dropped": PATHS,
            "frames": PATHS,
            "clocks": PATHS,
            "clock-costs": PATHS,
            "overlays": PATHS,
            "clips": PATHS,
            "statistics": PATH,
            "effort": MAYBE,
            "recognition": PATHS,
            "out": PATH,
            "out-timing": PATH,
        },
    ),
    "provenance": (
        "release.provenance",
        "checksums of the recordings of one sequence",
        {"sequence": TEXT, "recordings": PATH_PAIRS, "out": PATH},
    ),
    "heads": (
        "release.heads",
        "find the subject's head in the pictures of one camera",
        {
            "sequence": TEXT,
            "camera": TEXT,
            "cameras": PATHS,
            "skeleton": PATH,
            "frames": PATH,
            "clocks": PATHS,
            "labels": PATH,
            "before": MAYBE,
            "out": PATH,
            "findings": PATH,
        },
    ),
    "pixels": (
        "release.pixels",
        "write the released pictures of one camera, the head covered",
        {
            "sequence": TEXT,
            "subject": TEXT,
            "camera": TEXT,
            "frames": PATH,
            "data-root": PATH,
            "heads": MAYBE,
            "faces": {"choices": ["blurred", "filled", "pixelated", "shown"]},
            "consent": {"choices": ["yes", "no"]},
            "shift": JSON,
            "out": PATH,
            "findings": PATH,
        },
    ),
    "package": (
        "release.package",
        "write the release folder",
        {
            "project": PATH,
            "config": JSON,
            "labels": PATHS,
            "pixels": PATHS,
            "skeletons": PATHS,
            "frames": PATHS,
            "detections": PATHS,
            "marks": PATHS,
            "cameras": PATHS,
            "covariances": PATHS,
            "clocks": PATHS,
            "metrics": PATHS,
            "gallery": MAYBE,
            "provenance": PATHS,
            "steps": PAIRS,
            "out": PATH,
        },
    ),
    "exports": (
        "release.exports",
        "write the release in other formats",
        {"release": PATH, "formats": WORDS, "out": PATH},
    ),
    "tarballs": (
        "release.tarballs",
        "pack one subject's part of the release, or its metadata",
        {"release": PATH, "subject": TEXT, "out": PATH},
    ),
}


def _parser():
    parser = argparse.ArgumentParser(prog="dior", description=__doc__.splitlines()[0])
    commands = parser.add_subparsers(dest="command", required=True, metavar="command")
    for name, (_, text, flags) in STEPS.items():
        command = commands.add_parser(name, help=text, description=text)
        for flag, how in flags.items():
            options = {key: value for key, value in how.items() if key != "dest"}
            command.add_argument(f"--{flag}", required="default" not in how, **options)
    by_hand.add_parsers(commands)
    return parser


def _config_parser():
    """`dior simulate --write-config FOLDER`: not a step, it makes the config that the steps run with."""
    parser = argparse.ArgumentParser(prog="dior simulate", description="write the config of a simulated capture")
    parser.add_argument("--write-config", type=Path, required=True, metavar="FOLDER")
    parser.add_argument("--settings", default={}, help="JSON of what differs from the demo", **JSON)
    return parser


def _arguments(args):
    values = vars(args)
    for flag, how in STEPS[args.command][2].items():
        key = flag.replace("-", "_")
        if "dest" in how:
            values[key] = how["dest"](values[key])
    return {key: value for key, value in values.items() if key != "command"}


def main(argv=None):
    """Run one subcommand; a DiorError is one line on standard error and exit code 1."""
    argv = sys.argv[1:] if argv is None else argv
    started = time.monotonic()
    try:
        if argv[:1] == ["simulate"] and "--write-config" in argv:
            import_module("dior.simulate.config").run(**vars(_config_parser().parse_args(argv[1:])))
            return 0
        args = _parser().parse_args(argv)
        if args.command in by_hand.COMMANDS:
            done = import_module(by_hand.COMMANDS[args.command]).run(
                **{k: v for k, v in vars(args).items() if k != "command"}
            )
            return done or 0
        step, arguments = args.command, _arguments(args)
        import_module(f"dior.{STEPS[step][0]}").run(**arguments)
        timing.write(step, arguments, started)
    except DiorError as error:
        print(f"dior {argv[0]}: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
