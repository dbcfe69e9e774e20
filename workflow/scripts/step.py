"""Run the step that the rule is named after: the rule's wildcards, files and params with the names of flags are these.

For the rules over all sequences, or all of a session: their lists of files outgrow a command line (128 KB on Linux) at
about 120 sequences.
"""

import os
import subprocess
import sys
import traceback

from dior.cli import main
from dior.cli.flags import flags_of


def words(job):
    """The command line of `dior` for a job of Snakemake's, as a list."""
    found = [job.rule]
    for key, value in (pair for part in (job.wildcards, job.input, job.output, job.params) for pair in part.items()):
        if flag := flags_of(job.rule).get(key):
            found += [flag.typed, *map(str, value if isinstance(value, list) else [value])]
    return found


def run(job):
    """Exit code; what is printed goes to the screen and to the log, as with `2>&1 | tee`."""
    screen = [os.dup(stream) for stream in (1, 2)]
    with subprocess.Popen(["tee", job.log[0]], stdin=subprocess.PIPE) as tee:
        for stream in (1, 2):
            os.dup2(tee.stdin.fileno(), stream)
        try:
            return main.main(words(job))
        except Exception:
            # a fault of dior's own: printed here, its trace is in the log, too
            traceback.print_exc()
            return 1
        finally:
            # tee ends when nothing can write to it any more
            sys.stdout.flush()
            for stream, own in zip((1, 2), screen, strict=True):
                os.dup2(own, stream)


main.end(run(snakemake))  # noqa: F821 (Snakemake puts it there)
