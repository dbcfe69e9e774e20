"""Why a step runs again, in words: the key of config.yaml, the file, or the code that has changed.

INPUTS   the parameters that its job is given now, what of them is new, and what was noted of them when it ran before
OUTPUT   sentences such as `triangulate.max_error_px 45.0 -> 30.0` and `config/sessions/field/cam04.yaml`
What is noted are the values' `repr` without the names of the parameters. Values are told only where they are of
config.yaml: others may be about people, and who is gone is not named.
"""

import ast
import json
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from dior.errors import many

# chosen: of more changes than these nobody reads the rest; a key that many steps are given counts once
MOST = 6
CODE = "the code of "
# parameters that are the code of a step, "" for the job's own
CODES = {"code": "", "label_code": "reproject"}
AFTER = "after "
# a word of `contents_of` (workflow/rules/common.smk): a file's name and what is in it
CONTENT = re.compile(r"(.*) (?:[0-9a-f]{64}|\d+ [0-9a-f]{16}|missing|unreadable)", re.DOTALL)
# what a digest of the sheets (dior/project/secret.py) and what comes from them is about, by the parameter's name
SHEETS = {
    "consents": "a consent in config/subjects.tsv",
    "consent": "a consent in config/subjects.tsv",
    "heights": "a height in config/subjects.tsv",
    "height": "a height in config/subjects.tsv",
    "prefix": "mocap.prefix of a session.yaml",
    "sheet": "config/sequences.tsv or config/subjects.tsv",
    "sheets": "config/sequences.tsv or config/subjects.tsv",
    "subject": "config/subjects.tsv",
    "subjects": "config/subjects.tsv",
    "rows": "config/gallery.tsv",
    **dict.fromkeys(("about", "within"), "config/sequences.tsv or config/subjects.tsv"),
    **dict.fromkeys(("before", "after"), "config/sequences.tsv"),
}
# whose values come from YAML files, which are told where they are inputs or `contents`
YAML = {
    **dict.fromkeys(("known", "window", "marked", "tag", "units", "up"), "session.yaml"),
    **dict.fromkeys(("masks", "checked", "looked_at"), "session.yaml"),
    **dict.fromkeys(("role", "topic", "source", "board", "sigma", "distortion_model", "name"), "a camera's file"),
}


def words(
    step: str, params: Mapping[str, Any], before: Iterable[str], now: Iterable[str], config: Mapping[str, Any]
) -> list[str]:
    """What has changed of the parameters of a job of `step`, each once.

    `params`: its parameters by name; `before`, `now`: the `repr` of those that were and are not the same; `config`: the
    content of config.yaml.
    """
    fresh, old = set(now), [_value(text) for text in before]
    changed = {name: value for name, value in params.items() if repr(value) in fresh}
    found = list(_files([changed.pop("contents", [])], [value for value in old if _is_contents(value)]))
    old = [value for value in old if not _is_contents(value)]
    for name, value in changed.items():
        if name in CODES:
            found.append(f"{CODE}{CODES[name] or step}")
        elif name in SHEETS:
            found.append(SHEETS[name])
        else:
            alone = [_kind(other) for other in changed.values()].count(_kind(value)) == 1
            found += _of_config(step, name, value, old, alone, config)
    return list(dict.fromkeys(found)) or [f"what {step} is given"]


def together(counted: Counter[str]) -> str:
    """What has changed of all jobs, that which most of them are given first, code last; `counted`: jobs by `words`.

    >>> together(Counter({"the code of refine": 9, "a.yaml": 1, "b.yaml": 2}))
    'b.yaml; a.yaml; the code of refine'
    """
    told = [text for text, _ in counted.most_common() if not text.startswith(CODE)]
    code = [text for text in counted if text.startswith(CODE)]
    return "; ".join(_first(told) + (code if len(code) <= 2 else [f"{CODE}{len(code)} steps"]))


def plan(jobs: Mapping[str, list[list[str]]]) -> list[str]:
    """What a run would do: a line for each step with its number of jobs and why, and one for all.

    `jobs`: by step, in the order of the lines, for each of its jobs why it would run, `after <step>` being one of that.

    >>> plan({"refine": [["a.yaml", "after clocks"]] * 2, "report": [["not made yet"]]})
    ['refine   2  a.yaml; after clocks', 'report   1  not made yet', '3 jobs of 2 steps would run. Nothing was run.']
    """
    if not jobs:
        return ["Nothing to do: all that was asked for is there and up to date."]
    width, place = max(map(len, jobs)), {step: at for at, step in enumerate(jobs)}
    lines = []
    for step, each in jobs.items():
        counted = Counter(text for why in each for text in why)
        # what most jobs have first
        own = _first(sorted((text for text in counted if not text.startswith(AFTER)), key=lambda t: (-counted[t], t)))
        steps = {text.removeprefix(AFTER) for text in counted if text.startswith(AFTER)}
        after = ", ".join(_first(sorted(steps, key=lambda step: (place.get(step, len(place)), step))))
        lines.append(f"{step:{width}} {len(each):3}  {'; '.join([*own, *([AFTER + after] if after else [])])}")
    total = sum(map(len, jobs.values()))
    return [*lines, f"{many(total, 'job')} of {many(len(jobs), 'step')} would run. Nothing was run."]


def _first(told: list[str]) -> list[str]:
    """The first MOST, and how many more there are."""
    return [*told[:MOST], *([f"and {len(told) - MOST} more"] if len(told) > MOST else [])]


def _value(text: str) -> Any:
    try:
        return ast.literal_eval(text)
    except (ValueError, SyntaxError):
        return text


def _is_contents(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and all(CONTENT.fullmatch(str(word)) for word in value)


def _files(now: list[list[str]], before: list[list[str]]) -> Iterator[str]:
    """The files that changed or are new; of those that are gone only that some are."""
    fresh, old = ({word for one in words for word in one} for words in (now, before))
    named = {match[1] for match in map(CONTENT.fullmatch, fresh - old) if match}
    yield from sorted(named)
    gone = {match[1] for match in map(CONTENT.fullmatch, old - fresh) if match} - named
    if gone:
        yield "files that are not used any more"


def _of_config(
    step: str, name: str, value: Any, old: list[Any], alone: bool, config: Mapping[str, Any]
) -> Iterator[str]:
    """The key of config.yaml that a parameter comes from, with its values, or else what it may come from.

    `alone`: no other one of its kind has changed, so that the old value of this kind is its own.
    """
    told = _json(value)
    former = [one for one in map(_json, old) if isinstance(one, dict)]
    where = _section(told, config) if isinstance(told, dict) and len(former) == 1 else None
    if where is not None:
        yield from _leaves(former[0], told, where)
        return
    if key := _key(step, name, value, config):
        same = [one for one in old if _kind(one) == _kind(value)]
        sure = alone and len(same) == 1
        yield f"{key} {_short(same[0])} -> {_short(value)}" if sure else f"{key} (now {_short(value)})"
    elif name in YAML:
        yield f"{name} in {YAML[name]}"
    else:
        yield f"{name} of {step}"


def _section(told: dict[str, Any], config: Mapping[str, Any]) -> str | None:
    """The section of config.yaml whose content this is, "" for several of them, None for none."""
    if told and set(told) <= set(config):
        return ""
    return next((name for name, section in config.items() if section == told), None)


def _key(step: str, name: str, value: Any, config: Mapping[str, Any]) -> str:
    """The key whose value this is: of the step's own section or of any, called like the parameter or alone with it."""
    keys = [
        (section, key)
        for section, part in config.items()
        if isinstance(part, dict)
        for key, own in part.items()
        if own == value and type(own) is type(value)
    ]
    alike = [(section, key) for section, key in keys if name in key]
    for candidates in ([pair for pair in alike if pair[0] == step], alike, keys):
        if len(candidates) == 1:
            return ".".join(candidates[0])
    return ""


def _leaves(before: Any, now: Any, where: str) -> Iterator[str]:
    """`key old -> new` of each value that differs."""
    if isinstance(before, dict) and isinstance(now, dict):
        for key in sorted({*before, *now}):
            if before.get(key) != now.get(key):
                yield from _leaves(before.get(key), now.get(key), f"{where}.{key}" if where else key)
    else:
        yield f"{where} {_short(before)} -> {_short(now)}"


def _json(value: Any) -> Any:
    try:
        return json.loads(value) if isinstance(value, str) and value.startswith("{") else None
    except ValueError:
        return None


def _kind(value: Any) -> str:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    return "number" if number else type(value).__name__


def _short(value: Any) -> str:
    """A value on less than half a line."""
    text = "nothing" if value is None or value == "" else str(value)
    return text if len(text) <= 40 else f"{text[:37]}..."
