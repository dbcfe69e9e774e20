"""What the index says of findings below the table of cameras: what that does not tell, the same of several walks once.

INPUTS   findings and the rows of the table of cameras. OUTPUT  `Group`s; nothing is drawn or written here
"""

from collections.abc import Collection, Iterable
from dataclasses import dataclass

from dior.errors import many
from dior.report.cards import SEVERITY_ORDER, level_of
from dior.report.lights import Finding
from dior.report.overview import CameraRow

# chosen: as many places as a line holds
NAMED = 3


@dataclass(frozen=True)
class Group:
    """Findings of one code: how bad (one of `lights.LEVELS`, and its word), where, and what the first of them says.

    `others`: (where, sentence) of those that say it with other words or numbers.
    """

    level: str
    word: str
    code: str
    where: str
    text: str
    others: tuple[tuple[str, str], ...]


def untold(findings: Iterable[Finding], table: Iterable[CameraRow], on_pages: Collection[Finding]) -> list[Finding]:
    """Those that no row of the table of cameras tells, as a cause or as what follows from one; of notes those that are
    not `on_pages` of sequences."""
    told: set[str] = set()
    for row in table:
        told |= {one.why for one in row.recordings}
        for trouble in row.troubles:
            told |= {trouble.text, *(text for _, text in (*trouble.alike, *trouble.follows))}
    return [
        finding for finding in findings if finding[3] not in told and (finding[1] != "info" or finding not in on_pages)
    ]


def grouped(findings: Iterable[Finding], walks: Collection[str]) -> list[Group]:
    """A `Group` for each code and severity, the worst first. `walks`: the names of all sequences."""
    by_code: dict[tuple[int, str], list[Finding]] = {}
    for finding in sorted(set(findings)):
        _, severity, code, _ = finding
        by_code.setdefault((SEVERITY_ORDER.index(severity), code), []).append(finding)
    return [_group(code, own, walks) for (_, code), own in sorted(by_code.items())]


def _group(code: str, own: list[Finding], walks: Collection[str]) -> Group:
    level, word = level_of(own[0][1])
    first = own[0][3]
    others = tuple((_place(scope), text) for scope, _, _, text in own if text != first)
    return Group(level, word, code, _places([scope for scope, *_ in own], walks), first, others)


def _place(scope: str) -> str:
    return scope.replace("/", " ") or "everywhere"


def _places(scopes: list[str], walks: Collection[str]) -> str:
    """ "in 4 walks: a, b, c, ...", "in 2 recordings: ...", or the one place."""
    scopes = list(dict.fromkeys(scopes))
    if len(scopes) == 1:
        return _place(scopes[0])
    names = ", ".join(map(_place, scopes[:NAMED])) + (", ..." if len(scopes) > NAMED else "")
    if set(scopes) <= set(walks):
        what = many(len(scopes), "walk")
    elif all(scope.split("/")[0] in walks for scope in scopes):
        what = many(len(scopes), "recording")
    else:
        what = many(len(scopes), "place")
    return f"in {what}: {names}"
