"""The subcommands of `dior` that are no steps of the workflow: a person types them."""

from pathlib import Path

from dior.reid.networks import NAMES

# module whose `run` does it
COMMANDS = {
    "init": "dior.project.init",
    "trigger": "dior.ingest.trigger",
    "verify": "dior.release.verify.verify",
    "diff": "dior.release.diff.diff",
    "forget": "dior.project.forget",
    "train-reid": "dior.reid.train",
}
PROJECT = {"type": Path, "default": Path("."), "help": "folder that holds config/ (default: this one)"}


def add_parsers(commands):
    """Add a parser of each command to argparse's subparsers."""
    init = commands.add_parser("init", help="start a project folder for your own recordings")
    init.add_argument("folder", type=Path)
    _trigger(commands)
    text = "list, or delete, what is left of sequences and people that the project no longer has"
    forget = commands.add_parser("forget", help=text, description=text)
    forget.add_argument("--project", **PROJECT)
    forget.add_argument("--yes", action="store_true", help="delete what is listed")
    text = "is a release, its exports or a tarball whole, unchanged and consistent"
    verify = commands.add_parser("verify", help=text, description=text)
    verify.add_argument("paths", type=Path, nargs="+", help="release folder, exports folder, tarballs")
    verify.add_argument("--decode", action="store_true", help="decode every picture, not only read its header")
    text = "which sequences and cameras differ between two releases, by how much and why; exit code 1 where any does"
    diff = commands.add_parser("diff", help=text, description=text)
    diff.add_argument("first", type=Path, help="release folder")
    diff.add_argument("second", type=Path, help="release folder")
    diff.add_argument("--json", dest="as_json", action="store_true", help="print JSON instead of text")
    _train_reid(commands)


def _trigger(commands):
    text = "start and stop the recording with Vicon Nexus, and note when that was"
    trigger = commands.add_parser("trigger", help=text, description=text)
    trigger.add_argument("--log", type=Path, required=True, help="file to append to, such as trigger.jsonl")
    trigger.add_argument("--bind", default="0.0.0.0", help="address to listen on (default: all of this computer's)")
    trigger.add_argument("--port", type=int, default=30, help="UDP port, as set in Nexus (default: 30)")
    trigger.add_argument("--on-start", default="", help="shell command that starts the recording")
    trigger.add_argument("--on-stop", default="", help="shell command that stops it")
    trigger.add_argument(
        "--patience", type=float, default=10.0, help="seconds after which a command that still runs is reported"
    )


def _train_reid(commands):
    text = "train a re-identification network with the project's own walks, and test it with walks it has not seen"
    train = commands.add_parser("train-reid", help=text, description=text)
    train.add_argument("--project", **PROJECT)
    train.add_argument("--labels", type=Path, required=True, help="folder of COCO-17 labels: results/reid")
    train.add_argument("--network", required=True, choices=NAMES)
    train.add_argument("--out", type=Path, required=True, help="file of the weights to write, such as lab.pt")
    train.add_argument("--weights", type=Path, help="weights to begin with (default: random ones)")
    train.add_argument(
        "--test-sessions",
        nargs="+",
        default=(),
        metavar="SESSION",
        help="sessions to test with (default: the last walk of every subject in each session)",
    )
    train.add_argument("--steps", type=int, default=200, help="batches to train with (default: 200)")
    train.add_argument("--seed", type=int, default=1, help="of all that is random (default: 1)")
