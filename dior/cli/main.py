"""The command `dior`: one subcommand per rule of the workflow, and the few that a person types. No logic here."""

import argparse
import sys
import time
from importlib import import_module
from pathlib import Path

from dior.cli import by_hand
from dior.cli.steps import JSON, STEPS
from dior.errors import DiorError
from dior.evaluate import timing


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
