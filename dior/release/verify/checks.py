"""What is recomputed of a release, in one list: a check is a module with a function that gives problems.

INPUTS   a `Walk` or an `Evidence` (evidence.py), in which no table is wrong by itself. OUTPUTS: problems as (path,
         sentence)
To add a check, add it to one of the tuples. A check of a walk runs beside those of another walk; one of the release
runs when nothing else was found, as what is wrong with a table is wrong in all that is made of it.
"""

from collections.abc import Callable
from typing import Any, TypeAlias

from dior.errors import DiorError
from dior.release.verify import (
    card_checks,
    cover_checks,
    evidence,
    figures,
    gait_checks,
    light_checks,
    pictures,
    projections,
    release_checks,
    texts,
)
from dior.release.verify.evidence import Evidence, Walk
from dior.release.verify.folder_or_tarball import File
from dior.release.verify.walk_checks import Problem, WalkFindings

OF_WALK: tuple[Callable[[Walk], list[Problem]], ...] = (
    light_checks.check,
    gait_checks.check,
    projections.check,
    pictures.check,
)
OF_RELEASE: tuple[Callable[[Evidence], list[Problem]], ...] = (
    release_checks.card,
    card_checks.check,
    texts.check,
    figures.check,
    light_checks.of_release,
    pictures.exchanged,
)
# what a table that nobody has foreseen may raise
UNFORESEEN = (DiorError, ArithmeticError, AttributeError, LookupError, TypeError, ValueError)
Check: TypeAlias = Callable[[Any], list[Problem]]


def of_walk(found: WalkFindings, files: dict[str, File], rig: evidence.Setup, decode: bool) -> None:
    """Add to what was `found` in a walk what its tables contradict, and the figures that they give."""
    walk = evidence.Walk(
        found.who, found.sequence, found.tables, files, rig, decode, found.pictures, found.suspects, found.beside
    )
    if not walk.of("labels_2d") or not walk.of("skeletons_3d"):
        return
    for check in OF_WALK:
        found.problems += _run(check, walk, f"labels_2d/{walk.who}/{walk.sequence}")
    found.bare += _run(cover_checks.check, walk, f"frames/{walk.who}/{walk.sequence}")
    if not found.problems:
        found.problems += _run(lambda one: found.figures.update(figures.of_walk(one)) or [], walk, figures.PATH)


def of_release(release: Evidence) -> list[Problem]:
    """Everything that a release as a whole contradicts."""
    return [problem for check in OF_RELEASE for problem in _run(check, release, "")]


def _run(check: Check, of: Walk | Evidence, path: str) -> list[Problem]:
    try:
        return check(of)
    except UNFORESEEN as error:
        return [(path, f"cannot be recomputed: {' '.join(str(error).split()) or type(error).__name__}")]
