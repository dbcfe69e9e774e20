"""Run the workflow on a project, from any folder, on all processors.

INPUTS   a project folder and the workflow, which is in the clone of dior and not in its package
OUTPUTS  what Snakemake makes of them; this process becomes Snakemake, so signals and the exit code are its own

Nothing is done here that `snakemake --snakefile <clone>/Snakefile --directory <project> --cores all` does not do.
"""

import os
import re
import sys
from collections.abc import Sequence
from pathlib import Path

from dior.errors import DiorError, nearest

# beside the package, where it is installed from the clone (`pip install -e .`, as requirements.txt does)
CLONE = Path(__file__).resolve().parents[2]
CONFIG = "config/config.yaml"
# Snakemake's flags, with which a person decides what else would be filled in; a profile of one's own may, too
GIVEN = {
    "--snakefile": r"-s|--snakefile",
    "--workflow-profile": r"--workflow-profile",
    "--cores": r"-[jc]\d*|--cores|--jobs|-e|--executor|--profile",
}


def run(*words: str) -> None:
    """Run the workflow on a project; does not return.

    `words`: the project's folder, where it is not the one that you are in, and any targets and flags of Snakemake, such
    as `release`, `-n` (what would run) or `--keep-going`.
    Raises DiorError where there is no project, or where the workflow is not found.
    """
    project, rest = of_project(words)
    flags = [*filled_in(rest), "--directory", str(project.resolve())]
    # -P: what lies in the folder that one is in is no module of Snakemake's
    command = [sys.executable, "-P", "-m", "snakemake", *flags, *rest]
    sys.stdout.flush()
    os.execv(sys.executable, command)


def of_project(words: Sequence[str]) -> tuple[Path, list[str]]:
    """The project's folder, and the words that are Snakemake's.

    The first word is the folder if a config lies in it, and else, in a project's folder, a target, also where a folder
    of its name is there, as release/ is.
    """
    first = next(iter(words), "")
    if first and (Path(first) / CONFIG).is_file():
        return Path(first), list(words[1:])
    here = Path(CONFIG).is_file()
    is_flag = first.startswith("-")
    if first and not is_flag and not (here and not first.startswith((".", "/", "~"))):
        around = next((path for path in Path(first).absolute().parents if (path / CONFIG).is_file()), None)
        if around is not None and Path(first).exists():
            raise DiorError(f"{first}: lies in the project {around}; name that (`dior run {around} ...`)")
        beside = [path.parents[1] for path in Path(first).absolute().parent.glob(f"*/{CONFIG}")]
        meant = nearest(Path(first).name.lower(), [path.name for path in beside])
        raise DiorError(
            f"{first}: there is no {CONFIG} in it, and the project's folder is the first word"
            f"{meant or '; `dior init <folder>` makes a project'}"
        )
    if not here:
        later = next((word for word in words[1:] if (Path(word) / CONFIG).is_file()), None)
        if later is not None:
            rest = " ".join(word for word in words if word != later)
            raise DiorError(f"{later}: the project's folder is the first word (`dior run {later} {rest}`)")
        raise DiorError(
            f"there is no {CONFIG} here; name the project's folder (`dior run ../my_capture`), or make one with "
            "`dior init <folder>`"
        )
    return Path(), list(words)


def filled_in(words: Sequence[str]) -> list[str]:
    """The flags that Snakemake needs and that `words` do not have. Raises DiorError where the workflow is not found."""
    given = {flag for flag, typed in GIVEN.items() if any(re.fullmatch(f"(?:{typed})(?:=.*)?", word) for word in words)}
    if "--snakefile" not in given and not (CLONE / "Snakefile").is_file():
        raise DiorError(
            f"the workflow is not beside this installation of dior ({CLONE}): it is in the clone; install dior from "
            "there (`pip install -e <clone>`), or name it with `--snakefile <clone>/Snakefile`"
        )
    wanted = {
        "--snakefile": str(CLONE / "Snakefile"),
        "--workflow-profile": str(CLONE / "profiles/default"),
        "--cores": str(cores()),
    }
    if "--snakefile" in given:
        # the profile is found beside it
        given.add("--workflow-profile")
    return [word for flag, value in wanted.items() if flag not in given for word in (flag, value)]


def cores() -> int:
    """How many processors this process may use."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:
        # not everywhere
        return os.cpu_count() or 1
