"""The flags of a step: the parameters of its `run`, read from the source of its module.

The module is not imported for that: not to show the flags, and not by the workflow, whose rules make their shell lines
of them (workflow/rules/common.smk). A parameter becomes a flag by its annotation (`KINDS`; what holds `Any` is JSON);
one that is a frozen dataclass, of the same module or imported from dior, becomes a flag for each of its fields. A
parameter with a default may be left out, and so may what can be empty.
The text of a flag is what the docstring of `run`, or of the dataclass, says after its name: "`name`: text" up to the
next semicolon, full stop or name; or else that of `dior.cli.words`.
"""

import ast
import json
import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from dior.cli.words import TEXTS
from dior.errors import nearest
from dior.project.steps import MODULES


class UsageError(Exception):
    """A command line that is wrong; the text says what, in one sentence."""


@dataclass(frozen=True)
class Kind:
    """How the words after a flag become a value: how many there may be (`most` None: any number), what to call them."""

    least: int
    most: int | None
    value: Callable[[list[str]], Any]
    shown: str


def _one(convert: Callable[[str], Any]) -> Callable[[list[str]], Any]:
    return lambda words: convert(words[0])


def _pairs(convert: Callable[[str], Any]) -> Callable[[list[str]], Any]:
    def value(words: list[str]) -> dict[str, Any]:
        pairs = [word.partition("=") for word in words]
        if not all(equals for _, equals, _ in pairs):
            raise ValueError
        return {key: convert(rest) for key, _, rest in pairs}

    return value


def _json(least: type) -> Callable[[str], Any]:
    def value(word: str) -> Any:
        try:
            content = json.loads(word)
        except RecursionError:
            raise ValueError from None
        if not isinstance(content, least):
            raise ValueError
        return content

    return value


def _path(word: str) -> Path:
    """A path; an empty word would be the folder that one is in."""
    if not word:
        raise ValueError
    return Path(word)


# by what the annotation begins with
JSON = {
    "dict": Kind(1, 1, _one(_json(dict)), "JSON {...}"),
    "list": Kind(1, 1, _one(_json(list)), "JSON [...]"),
    "": Kind(1, 1, _one(_json(object)), "JSON"),
}
KINDS = {
    "str": Kind(1, 1, _one(str), "TEXT"),
    "int": Kind(1, 1, _one(int), "INTEGER"),
    "float": Kind(1, 1, _one(float), "NUMBER"),
    "Path": Kind(1, 1, _one(_path), "PATH"),
    "Path | None": Kind(0, 1, lambda words: _path(words[0]) if words else None, "[PATH]"),
    "list[str]": Kind(0, None, list, "[TEXT ...]"),
    "list[Path]": Kind(0, None, lambda words: [_path(word) for word in words], "[PATH ...]"),
    "dict[str, str]": Kind(0, None, _pairs(str), "[KEY=TEXT ...]"),
    "dict[str, Path]": Kind(0, None, _pairs(_path), "[KEY=PATH ...]"),
}
# a text that may be empty: Snakemake's shell lines hold no word for it
EMPTY = Kind(0, 1, lambda words: words[0] if words else "", "[TEXT]")


@dataclass(frozen=True)
class Flag:
    """A parameter of a step.

    `name`: as in Python; `default`: there is one; `text`: its help; `within`: the parameter of `run` whose field it is,
    and that parameter's class as the module calls it, or None.
    """

    name: str
    kind: Kind
    default: bool
    text: str
    within: tuple[str, str] | None = None

    @property
    def typed(self) -> str:
        """As a person types it."""
        return f"--{self.name.replace('_', '-')}"

    @property
    def needed(self) -> bool:
        return not self.default and self.kind.least > 0


@cache
def flags_of(step: str) -> dict[str, Flag]:
    """The flags of a step by name, in the order of its parameters."""
    return flags_in(f"dior.{MODULES[step]}")


def flags_in(module: str) -> dict[str, Flag]:
    """The same of a module's `run`."""
    tree = _tree(module)
    run = next(node for node in tree.body if isinstance(node, ast.FunctionDef) and node.name == "run")
    positional = [*run.args.posonlyargs, *run.args.args]
    defaults: list[ast.expr | None] = [None] * (len(positional) - len(run.args.defaults))
    parameters = [*positional, *run.args.kwonlyargs]
    flags = {}
    for parameter, default in zip(parameters, [*defaults, *run.args.defaults, *run.args.kw_defaults], strict=True):
        if parameter.annotation is None:
            raise TypeError(f"{module}.run: {parameter.arg} has no annotation")
        known = _dataclass(module, tree, parameter.annotation)
        within = (parameter.arg, ast.unparse(parameter.annotation)) if known else None
        docstring = ast.get_docstring(known or run) or ""
        fields = _fields(known) if known else [(parameter.arg, parameter.annotation, default)]
        for name, annotation, given in fields:
            kind = _kind(annotation, given, f"{module}.run: {name}")
            flags[name] = Flag(name, kind, given is not None, text_of(name, docstring), within)
    return flags


def _fields(known: ast.ClassDef) -> list[tuple[str, ast.expr, ast.expr | None]]:
    """Name, annotation and default of the fields of a dataclass."""
    nodes = [node for node in known.body if isinstance(node, ast.AnnAssign)]
    return [(node.target.id, node.annotation, node.value) for node in nodes if isinstance(node.target, ast.Name)]


@cache
def _tree(module: str) -> ast.Module:
    """The syntax tree of a module up to the end of `run`: what follows tells nothing of it and takes time."""
    spec = find_spec(module)
    if spec is None or spec.origin is None:
        raise ModuleNotFoundError(f"there is no module {module}")
    before, run, after = Path(spec.origin).read_text(encoding="utf-8").partition("\ndef run(")
    return ast.parse(before + run + (after.partition("\n\n\n")[0] if run else ""), spec.origin)


def _dataclass(module: str, tree: ast.Module, annotation: ast.expr) -> ast.ClassDef | None:
    """The class that an annotation names, if it is a dataclass of this module or of another one of dior."""
    name = ast.unparse(annotation)
    if name in KINDS:
        return None
    holder, _, name = name.rpartition(".")
    for node in tree.body:
        if isinstance(node, ast.ClassDef) and node.name == name and not holder:
            return node if any("dataclass" in ast.unparse(one) for one in node.decorator_list) else None
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("dior"):
            for alias in node.names:
                if (alias.asname or alias.name) == (holder or name):
                    inside = f"{node.module}.{alias.name}" if holder else str(node.module)
                    return _dataclass(inside, _tree(inside), ast.Name(name if holder else alias.name))
    return None


def _kind(annotation: ast.expr, default: ast.expr | None, where: str) -> Kind:
    text = ast.unparse(annotation)
    if isinstance(default, ast.Constant) and default.value == "" and text == "str":
        return EMPTY
    if text in KINDS:
        return KINDS[text]
    if re.search(r"\bAny\b", text):
        return next(kind for begin, kind in JSON.items() if text.startswith(begin))
    if text.startswith("Literal["):
        choices = ast.literal_eval(text.removeprefix("Literal"))
        return Kind(1, 1, _one(lambda word: choices[choices.index(word)]), "|".join(choices))
    raise TypeError(f"{where}: no flag can be made of {text}")


def text_of(name: str, docstring: str) -> str:
    """The help of a flag.

    From the docstring: what is after its name in backticks and a colon, or after several with commas or `and` between.
    """
    end = r";|\.(?:\s|$)|,? (?:and )?`\w+`: |$"
    found = re.search(rf"`{name}`(?:(?:, | and )`\w+`)*: (.*?)(?={end})", " ".join(docstring.split()))
    return found[1] if found else TEXTS.get(name, "")


def parsed(step: str, words: list[str]) -> dict[str, Any]:
    """The arguments of a step by flag. Raises UsageError for a flag that is unknown, missing or has a wrong value."""
    flags = flags_of(step)
    given = _grouped(flags, words)
    missing = [flag.typed for name, flag in flags.items() if flag.needed and name not in given]
    if missing:
        raise UsageError(f"{' and '.join(missing)} must be given; `dior {step} --help` says what each is")
    empty: dict[str, list[str]] = {name: [] for name, flag in flags.items() if not flag.default}
    return {name: _value(flags[name], words) for name, words in (empty | given).items()}


def _grouped(flags: dict[str, Flag], words: list[str]) -> dict[str, list[str]]:
    """The words after each flag; `--flag=word` counts as two."""
    given: dict[str, list[str]] = {}
    name = ""
    for word in words:
        if not word.startswith("--"):
            if not name:
                raise UsageError(f"'{word}' belongs to no flag")
            given[name].append(word)
            continue
        typed, equals, value = word.partition("=")
        name = typed.removeprefix("--").replace("-", "_")
        if name not in flags:
            raise UsageError(f"there is no flag {typed}{nearest(typed, [flag.typed for flag in flags.values()])}")
        if name in given:
            raise UsageError(f"{typed} is given twice")
        given[name] = [value] if equals else []
    return given


def _value(flag: Flag, words: list[str]) -> Any:
    kind = flag.kind
    try:
        if len(words) < kind.least or (kind.most is not None and len(words) > kind.most):
            raise ValueError
        return kind.value(words)
    except ValueError:
        given = " ".join(map(repr, words)) or "nothing"
        raise UsageError(f"{flag.typed} takes {kind.shown}, not {given}") from None


def help_of(step: str) -> str:
    """What `dior <step> --help` prints."""
    documented = ast.get_docstring(_tree(f"dior.{MODULES[step]}")) or ""
    lines = [f"usage: dior {step} --FLAG VALUE ...", "", documented, ""]
    for flag in flags_of(step).values():
        optional = "" if flag.needed else " (may be left out)"
        lines += [f"  {flag.typed} {flag.kind.shown}", f"        {flag.text}{optional}"]
    return "\n".join(lines)
