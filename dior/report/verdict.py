"""What came out of a run, in a sentence or two for the terminal: how many recordings are good, and what to mend first.

INPUTS   the cards of the report (`dior.report.cards`)
OUTPUT   a line of text: results/report/verdict.txt
"""

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from dior.errors import one_line
from dior.report import lights

# chosen: the sentence that says why, with its fix, on some lines of a terminal; the report has all of it
MOST_LETTERS = 500


def sentence(cards: Iterable[Mapping[str, Any]], file_of: Callable[[str, str], str]) -> str:
    """How many of the recordings are good, and of the worst of the others where it is, why, and what to edit.

    `file_of`: the YAML file of a camera of a sequence.
    """
    cards = list(cards)
    levels = [cell["light"].level for card in cards for cell in card["cells"]]
    good, there = levels.count("good"), len(levels) - levels.count("none")
    problems = [problem for card in cards for problem in _problems(card, file_of)]
    text = f"{good} of {there} recordings are good."
    if problems:
        level, about, why = max(problems, key=lambda problem: lights.LEVELS.index(problem[0]))
        more = len({about for _, about, _ in problems}) - 1
        others = f" {more} more {'is' if more == 1 else 'are'} in the report." if more else ""
        text += f" {lights.WORDS[level].capitalize()}: {about}: {why}.{others}"
    return text


def _problems(card: Mapping[str, Any], file_of: Callable[[str, str], str]) -> Iterable[tuple[str, str, str]]:
    """(level, which recording or sequence, why) of what is amber or red on a card."""
    sequence, cells = card["sequence"], card["cells"]
    for cell in cells:
        light = cell["light"]
        if light.level in ("look", "bad"):
            why, file = _told(light.reasons), file_of(sequence, cell["camera"])
            edit = "" if ".yaml" in why else f"; its file is {file}"
            yield light.level, f"{sequence} {cell['camera']}", why + edit
    if card["level"] not in {cell["light"].level for cell in cells} and card["level"] in ("look", "bad"):
        yield card["level"], sequence, _told(card["notes"])


def _told(reasons: Iterable[str]) -> str:
    text = one_line(next(iter(reasons), "see the report")).rstrip(".")
    return text if len(text) <= MOST_LETTERS else f"{text[:MOST_LETTERS]} [...]"
