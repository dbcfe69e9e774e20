"""What came out of a run, in a sentence or two for the terminal: how many recordings are good, and what to mend first.

INPUTS   the rows of the report's table (`dior.report.overview`)
OUTPUT   a line of text: results/report/verdict.txt
"""

from collections.abc import Iterable

from dior.errors import many, one_line
from dior.report import lights, troubles
from dior.report.overview import CameraRow
from dior.report.troubles import Trouble

# chosen: the sentence that says why, with its fix, on some lines of a terminal; the report has all of it
MOST_LETTERS = 500


def sentence(rows: Iterable[CameraRow]) -> str:
    """How many of the recordings are good, and the worst cause of what is wrong: where, why, and what to type."""
    rows = list(rows)
    levels = [one.level for row in rows for one in row.recordings]
    good, there = levels.count("good"), len(levels) - levels.count("none")
    problems = [(row, one) for row in rows for one in row.troubles if one.code != lights.BESIDE_CULPRIT]
    text = f"{good} of {there} recordings are good."
    if problems:
        row, first = max(problems, key=lambda problem: lights.LEVELS.index(problem[1].level))
        more = len(problems) - 1
        others = f" {more} more {'is' if more == 1 else 'are'} in the report." if more else ""
        told = _told(row, first)
        text += f" {lights.WORDS[first.level].capitalize()}: {told}{'' if told.endswith(('.', '?')) else '.'}{others}"
    return text


def _told(row: CameraRow, trouble: Trouble) -> str:
    where = troubles.where(trouble, [one.sequence for one in row.recordings])
    about = " ".join(word for word in (row.session, row.camera) if word)
    why = one_line(trouble.text).rstrip(".")
    why = why if len(why) <= MOST_LETTERS else f"{why[:MOST_LETTERS]} [...]"
    text = f"{about}: {why}{f' ({where})' if where else ''}"
    fix = trouble.fix
    if fix is None or (not fix.what and fix.file in why):
        return text
    if not fix.what:
        return f"{text}; its file is {fix.file}"
    more = f" ({many(len(trouble.also), 'other thing')} to type in the report)" if trouble.also else ""
    return f"{text}; {f'in {fix.file}' if fix.file else 'type'}: {fix.what}{more}"
