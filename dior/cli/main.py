"""The command `dior`: one subcommand per step of the workflow, and the few that a person types. No logic here.

A step's flags are read from its source and only its own module is imported, so that a job starts fast; what a person
types goes through cyclopts (`dior.cli.commands`). Exit codes: 0 all is well; 1 something is wrong with what was given,
said in one sentence, or `dior diff` found differences; 2 the command line is wrong (or what `dior diff` was given).
"""

import os
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from operator import attrgetter
from pathlib import Path
from typing import Any

from dior.cli import flags
from dior.errors import DiorError
from dior.project import running
from dior.project.steps import MODULES

NEXT = """dior turns raw recordings of a gait capture into a labelled dataset. What to type:
  dior init my_capture --from recordings
                                   writes a project folder; fill in what is TODO in its config/
  dior check my_capture            says all that is wrong with it, or what a run will do and take
  dior run my_capture              labels it, and again after each change what depends on that; look at the report
  dior run my_capture release      makes the dataset as others get it
`dior --help` lists all commands."""
# `dior simulate` without it is what a person types
OF_A_JOB = "--sequence"


def main(argv: list[str] | None = None) -> int:
    """Run one subcommand; what is wrong is one line on standard error. Returns the exit code."""
    words = sys.argv[1:] if argv is None else argv
    if not words:
        print(NEXT)
        return 0
    step = words[0].replace("-", "_")
    try:
        if step in MODULES and not (step == "simulate" and OF_A_JOB not in words):
            return _run_step(step, words[1:])
        from dior.cli import commands

        return commands.run(words)
    except flags.UsageError as error:
        print(f"dior {words[0]}: {error}", file=sys.stderr)
        return 2
    except DiorError as error:
        print(f"dior {words[0]}: {error}", file=sys.stderr)
        return 1
    except Exception as error:
        from dior.shortage import sentence

        said = sentence(error)
        if not said and isinstance(error, OSError) and error.filename is not None:
            said = f"{error.filename}: {error.strerror}"
        if not said:
            raise
        print(f"dior {words[0]}: {said}", file=sys.stderr)
        return 1


def _run_step(step: str, words: list[str]) -> int:
    if "--help" in words or "-h" in words:
        print(flags.help_of(step))
        return 0
    started = time.monotonic()
    given = flags.parsed(step, words)
    module = import_module(f"dior.{MODULES[step]}")
    from dior.evaluate import timing

    with running.job():
        values = [one for value in given.values() for one in (value if isinstance(value, list) else [value])]
        with _all_or_nothing([value for value in values if isinstance(value, Path)]):
            module.run(**_grouped(module, step, given))
        timing.write(step, given, started)
    return 0


@contextmanager
def _all_or_nothing(paths: list[Path]) -> Iterator[None]:
    """Take away the files among `paths` that a step wrote before it failed, as Snakemake does with its outputs."""
    before = {path: _state(path) for path in paths}
    try:
        yield
    except BaseException:
        for path in paths:
            if path.is_file() and _state(path) != before[path]:
                path.unlink()
        raise


def _state(path: Path) -> tuple[int, ...]:
    try:
        found = path.stat()
    except OSError:
        return ()
    return found.st_ino, found.st_mtime_ns, found.st_size


def _grouped(module: Any, step: str, given: dict[str, Any]) -> dict[str, Any]:
    """The arguments of `run`: values that are fields of a dataclass are put into one."""
    arguments: dict[str, Any] = {}
    parts: dict[tuple[str, str], dict[str, Any]] = {}
    for name, value in given.items():
        within = flags.flags_of(step)[name].within
        (parts.setdefault(within, {}) if within else arguments)[name] = value
    return arguments | {name: attrgetter(of)(module)(**values) for (name, of), values in parts.items()}


def command() -> None:
    """The process of the command line: `main`, and its end."""
    try:
        end(main())
    except BrokenPipeError:
        # whoever reads, such as `head`, has enough; the code is what a shell says of one that SIGPIPE ended
        os._exit(141)


def end(code: int) -> None:
    """End the process at once.

    Its files are written and closed. What the libraries in C++ do at an ordinary exit takes as long as some steps, and
    on a busy machine now and then aborts it ("terminate called without an active exception"), for which a whole job
    would be lost, or a release that is right called damaged.
    """
    # what Python would do at an exit
    if containers := sys.modules.get("dior.ingest.containers"):
        containers.remove_unpacked()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)


if __name__ == "__main__":
    command()
