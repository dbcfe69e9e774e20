"""What the rules ask about the project: which files belong to a sequence, a session, a camera.

Required inputs: config/ of the working directory, read and checked once per parse. Nothing is globbed.
"""

import json
import os
import re
import sys
import time
from functools import cache
from hashlib import sha256

from snakemake.exceptions import WorkflowError

from dior.project import heights, project, secret
from dior.cli.flags import flags_of
from dior.errors import DiorError
from dior.project import running
from dior.project.steps import MODULES
from dior.project.replaced import state
from dior.tables.code_hash import code_hash as code
from dior.tables.code_hash import keep as keep_code
from dior.tables.result_checksums import file_sha256

# `dior` is found beside the Python that runs Snakemake, without activating the environment
os.environ.update(PATH=os.pathsep.join([os.path.dirname(sys.executable), os.getenv("PATH", "")]))
# each job leaves what it cost beside its log (dior/evaluate/timing.py); no rule knows of it
os.environ.update(DIOR_TIMINGS="logs")
# and says while it is at work that it is (dior/project/running.py)
os.environ.update({running.OF_A_JOB: running.JOBS})

# typed as `--config strict=true`: what is missing ends the run before it begins
STRICT = str(config.pop("strict", False)).lower() in ("true", "1", "yes")

try:
    PROJECT = project.load(os.getcwd(), config)
    KEY = secret.key_of(os.getcwd())
except DiorError as error:
    # on the screen only: it may name a person, and what Snakemake says is kept in its logs
    print(error, file=sys.stderr)
    sys.exit(1)

BEGUN = time.time()
CONFIG = PROJECT.config
DATA = str(PROJECT.data_root)
SEQUENCES = PROJECT.sequences
DETECTED = [sequence for sequence in SEQUENCES if PROJECT.detectors_of(sequence)]
ADJUSTED = [session for session in PROJECT.sessions if PROJECT.window(session)]
VERSION = CONFIG["release"]["version"]
RELEASE = f"results/release/dior-{VERSION}"
# where the tables of a sequence or a session are
skeleton_of, labels_of = PROJECT.skeleton_table, PROJECT.label_tables
clocks_of = PROJECT.clock_tables
cameras_of, covariance_of = PROJECT.camera_tables, PROJECT.covariance_table


wildcard_constraints:
    sequence=r"[A-Za-z0-9_-]+",
    session=r"[A-Za-z0-9_@-]+",
    camera=r"[A-Za-z0-9_-]+",
    recording=r"[A-Za-z0-9_-]+(\.(?!gains\.|costs\.|aside\.|findings\.)[A-Za-z0-9_-]+)?",
    subject=r"[A-Za-z0-9_-]+",


def numbered(step, number):
    """The name of a step's rule where it has several; the first is called after the step."""
    return step if number == 1 else f"{step}_{number}"


def step_of(name):
    """The step of a rule by its name."""
    step = re.sub(r"_\d+$", "", name)
    return step if step in MODULES else name


# step -> its shell line
LINES = {}


def dior(step):
    """The shell line of a step's rule. `fill_in_lines` makes it whole, when all names are known."""
    return LINES.get(step, f"dior {step}")


def fill_in_lines():
    """Make the shell line of each step: its flags, from what its rule calls by the flag's name.

    What is both a parameter and an input (files that may be missing are no input) is taken from the parameters, where
    it is whole.
    """
    for made in [one for one in workflow.rules if (one.shellcmd or "").startswith("dior ")]:
        step = made.shellcmd.split()[1]
        places = {name: "wildcards" for name in made.wildcard_names}
        for place in ("input", "output", "params"):
            places |= {name: place for name in getattr(made, place).keys()}
        words = [
            f"{flag.typed} {{{places[name]}.{name}:q}}"
            for name, flag in flags_of(step).items()
            if name in places
        ]
        LINES[step] = made.shellcmd = " ".join(["dior", step, *words, "2>&1 | tee {log:q}"])


def untracked(getter):
    """A parameter that a step is told and that does not run it again, as what it says of files is said by `contents_of`.

    Snakemake does not keep what is derived from the input; that the function takes it is what counts.
    """

    def value(wildcards, input):
        return getter(wildcards)

    return value


def data_root(wildcards, input):
    """Where the recordings are: moved elsewhere they are the same, so this runs nothing again."""
    return DATA


def contents_of(*getters, parts=()):
    """A parameter that tells what is in the files that these functions name, whatever their times.

    Of what people wrote all of it counts, of other files their name below data_root, their length and their ends.
    `parts`: functions that tell it of parts of files (`clocks_by_hand`).
    """

    def told(wildcards):
        found = [getter(wildcards) for getter in getters]
        paths = [path for one in found for path in several(one)]
        words = [content_of(path) for path in dict.fromkeys(paths)]
        return words + [word for part in parts for word in part(wildcards)]

    return told


def several(names):
    """Names of which there may be one alone."""
    return [names] if isinstance(names, str) else names


def offsets_of(sequences):
    """A function that gives the files with clocks by hand of the sequences that a function names."""

    def paths(wildcards):
        return [path for walk in several(sequences(wildcards)) for path in PROJECT.offsets(walk)]

    return paths


def clocks_by_hand(sequences, cameras):
    """What a person said of the clocks of these cameras, for `contents_of`: that another's changed runs nothing again.

    `sequences` and `cameras`: functions that give one or several names.
    """

    def told(wildcards):
        names = several(cameras(wildcards))
        return [
            f"{path} {sha256(repr(said).encode()).hexdigest()}"
            for walk in several(sequences(wildcards))
            for path in PROJECT.offsets(walk)
            if (said := PROJECT.clocks_by_hand(walk, names))
        ]

    return told


@cache
def content_of(path):
    """A file's or folder's name and what is in it."""
    if path.startswith("config/") and os.path.isfile(path):
        return f"{path} {file_sha256(path)}"
    below = path.startswith(os.path.join(DATA, ""))
    return f"{os.path.relpath(path, DATA) if below else path} {state(path)}"


def release_folder(wildcards):
    return RELEASE


def session_of(wildcards):
    return PROJECT.session_of(wildcards.sequence)


def subject(wildcards):
    return PROJECT.subject_of(wildcards.sequence)


def skeleton(wildcards):
    return skeleton_of(wildcards.sequence)


def as_json(value):
    """A function for params that gives a value as text; a plain string with braces would be taken for wildcards."""

    def text(wildcards):
        return json.dumps(value, sort_keys=True)

    return text


def fingerprint(value):
    """A function for params that must not tell what is in the sheets, but change with it."""

    def text(wildcards):
        return secret.digest(KEY, value)

    return text


def heights_of(name):
    """What changes with a subject's height, and does not tell it."""
    row = PROJECT.subjects.get(name, {})
    return secret.digest(KEY, [row.get("height_m", ""), row.get("height_sigma_m", "")])
