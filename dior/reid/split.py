"""What a network is tested with: walks or sessions of a gallery that its training does not see.

INPUTS   the sheet's rows by name (subject, session, session_order). OUTPUTS  `Split`
Every camera's sequence of a walk is on the same side, since cameras show one walk at the same time; so are all walks of
a session that is held out, whose errors they share.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

from dior.errors import DiorError, nearest

# rows of config/sequences.tsv by walk
Sheet: TypeAlias = Mapping[str, Mapping[str, str]]
# below, there is nobody to tell apart
LEAST_SUBJECTS = 2


@dataclass(frozen=True)
class Split:
    """Names of the walks that are trained with and tested with; `unused`: names that are neither."""

    train: tuple[str, ...]
    test: tuple[str, ...]
    unused: tuple[str, ...] = ()


def of(sheet: Sheet, test_sessions: Sequence[str] = ()) -> Split:
    """`Split` of the walks in `sheet`: those of `test_sessions` are held out; where there are none given, the last walk
    of every subject in every session in which it has at least two.

    Raises DiorError where that leaves nothing to train or to test with, and for an unknown session.
    """
    return by_session(sheet, test_sessions) if test_sessions else by_walk(sheet)


def by_walk(sheet: Sheet) -> Split:
    last: dict[tuple[str, str], list[str]] = {}
    for name in sorted(sheet, key=lambda name: (int(sheet[name].get("session_order") or 0), name)):
        last.setdefault((sheet[name]["subject"], sheet[name]["session"]), []).append(name)
    test = {names[-1] for names in last.values() if len(names) > 1}
    if not test:
        raise DiorError(
            "no subject has two walks in one session, so that no walk can be held out; name sessions to test with "
            "(--test-sessions), or record more walks"
        )
    return _checked(sheet, test)


def by_session(sheet: Sheet, test_sessions: Sequence[str]) -> Split:
    known = sorted({row["session"] for row in sheet.values()})
    for session in test_sessions:
        if session not in known:
            raise DiorError(f"there is no session '{session}' to test with{nearest(session, known)}")
    return _checked(sheet, {name for name, row in sheet.items() if row["session"] in test_sessions})


def _checked(sheet: Sheet, held: set[str]) -> Split:
    train = tuple(name for name in sheet if name not in held)
    trained = {sheet[name]["subject"] for name in train}
    if len(trained) < LEAST_SUBJECTS:
        one = "1 subject" if len(trained) == 1 else f"{len(trained)} subjects"
        raise DiorError(
            f"{one} would be left to train with, and a network needs at least {LEAST_SUBJECTS} to tell apart; hold out "
            "less, or record more people"
        )
    test = tuple(name for name in sheet if name in held and sheet[name]["subject"] in trained)
    if not test:
        raise DiorError(
            "no subject is both in the sessions to train with and in those to test with, so that nobody could be "
            "recognised; hold out sessions of people who come to others, too"
        )
    return Split(train, test, tuple(name for name in sheet if name in held and name not in test))
