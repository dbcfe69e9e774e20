"""What people write, YAML files and tab-separated sheets, checked against the JSON schemas.

INPUTS: files of a project's config/ and `dior/project/schemas/<kind>.schema.yaml`. OUTPUTS: plain dicts with the
schemas' defaults filled in. Every complaint is one DiorError that names the file, the key or line, and the nearest
valid name, and those of one file come together.
"""

import math
import re
from collections import defaultdict
from collections.abc import Callable
from copy import deepcopy
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar, overload

from dior.errors import MOST_FAULTS, DiorError, Faults, nearest
from dior.paths import AnyPath
from dior.project.plain_text import rows_of
from dior.project.yaml_file import read_yaml as read_yaml

if TYPE_CHECKING:
    import fastjsonschema

SCHEMAS = Path(__file__).with_name("schemas")
# a row of a sheet by column, as text; rows by name, which is one cell or several
Row: TypeAlias = dict[str, str]
Rows: TypeAlias = dict[str, Row]
Name = TypeVar("Name", str, tuple[str, ...])
_KINDS = {
    "number": "a number",
    "integer": "a whole number",
    "string": "text",
    "object": "keys with values",
    "array": "a list",
    "boolean": "true or false",
}
# above it not every whole number is a float
LARGEST = 2**53
_LIMITS = {
    "minimum": "at least",
    "exclusiveMinimum": "above",
    "maximum": "at most",
    "exclusiveMaximum": "below",
}


def columns_of(kind: str) -> list[str]:
    """Columns that a sheet must have, in order."""
    return list(_schema(kind)["required"])


def describe(kind: str, *keys: str) -> str:
    """The description of a key (a path of keys) in a schema."""
    schema = _schema(kind)
    for key in keys:
        schema = schema["properties"][key]
    return " ".join(schema["description"].split())


def largest(kind: str, key: str) -> float:
    """The largest value of a key of the entries that a schema has under any name, such as a camera's."""
    [entry] = _schema(kind)["patternProperties"].values()
    return float(entry["properties"][key]["maximum"])


@overload
def read_sheet(path: AnyPath, kind: str, key: str, shown: str | None = None) -> tuple[Rows, dict[str, int]]: ...


@overload
def read_sheet(
    path: AnyPath, kind: str, key: tuple[str, ...], shown: str | None = None
) -> tuple[dict[tuple[str, ...], Row], dict[tuple[str, ...], int]]: ...


def read_sheet(
    path: AnyPath, kind: str, key: str | tuple[str, ...], shown: str | None = None
) -> tuple[dict[Any, Row], dict[Any, int]]:
    """Rows of a tab-separated sheet by the value of column `key`, in order, as dicts of strings; and their lines.

    `key` may be several columns: then a row's name is the tuple of their values.
    A row does not know its line: it goes into Snakemake's params, and a row added above must not re-run it. Raises
    DiorError for a missing file, unknown or missing columns, cells that the schema refuses and a key that is there
    twice.
    """
    shown = shown or str(path)
    lines = rows_of(path, shown, "\t")
    if not lines:
        raise DiorError(f"{shown}: the file is empty; its first line must name the columns")
    (_, header), *body = lines
    schema, known = _schema(kind), list(_schema(kind)["properties"])
    if "" in header:
        raise DiorError(f"{shown}: column {header.index('') + 1} has no name; delete it, or name it in the first line")
    repeated = next((column for i, column in enumerate(header) if column in header[:i]), None)
    if repeated is not None:
        raise DiorError(f"{shown}: column '{repeated}' is there twice")
    patterns = schema.get("patternProperties", {})
    unknown = [
        column
        for column in header
        if column not in known and not any(re.search(pattern, column) for pattern in patterns)
    ]
    # a column with a slip in its name is also a missing one, and the slip is what helps
    missing = [column for column in schema["required"] if column not in header and not unknown]
    sentences = [f"{shown}: unknown column '{column}'{nearest(column, known)}" for column in unknown]
    sentences += [f"{shown}: column '{one}' is missing; it holds {_first_sentence(schema, one)}" for one in missing]
    Faults(map(DiorError, sentences)).tell()
    rows: dict[Any, Row] = {}
    line_of: dict[Any, int] = {}
    faults = Faults()
    for line, cells in body:
        with faults.kept():
            if len(cells) > len(header):
                raise DiorError(f"{shown} line {line}: {len(cells)} cells but the sheet has {len(header)} columns")
            row = dict(zip(header, [*cells, *[""] * (len(header) - len(cells))], strict=True))
            check(row, kind, f"{shown} line {line}")
            row = {**dict.fromkeys(known, ""), **row}
            name = row[key] if isinstance(key, str) else tuple(row[column] for column in key)
            if name in rows:
                what = f"{key} '{name}'" if isinstance(key, str) else f"{', '.join(key)} '{', '.join(name)}'"
                raise DiorError(f"{shown}: {what} is there twice, on lines {line_of[name]} and {line}")
            rows[name] = row
            line_of[name] = line
    if isinstance(key, str):
        with faults.kept():
            _check_case(shown, key, line_of)
    faults.tell()
    return rows, line_of


def as_written(path: AnyPath, shown: AnyPath) -> list[tuple[int, Row]]:
    """Line and cells by column of each row of a sheet, whatever is in them. Raises DiorError where it is no sheet."""
    (_, header), *rows = rows_of(path, shown, "\t") or [(1, [""])]
    return [(line, defaultdict(str, zip(header, cells, strict=False))) for line, cells in rows]


def _check_case(shown: str, key: str, line_of: dict[str, int]) -> None:
    """Names become those of files, and a release goes where capitals do not tell files apart."""
    first: dict[str, str] = {}
    for name, line in line_of.items():
        other = first.setdefault(name.casefold(), name)
        if other != name:
            raise DiorError(
                f"{shown}: {key} '{other}' and '{name}' on lines {line_of[other]} and {line} differ by capitals alone: "
                "on Windows and macOS their files would be one; rename one of them"
            )


def check(content: Any, kind: str, shown: AnyPath) -> Any:
    """`content` checked against a schema, filled with its defaults in place, and returned.

    Raises DiorError with the dotted path of each key that is wrong. Unknown keys come first, and none is said to be
    missing where there is one: a key with a slip in its name is also a missing one, and the slip is what helps.
    """
    import fastjsonschema

    found: list[str] = []
    _fill(_schema(kind), content, "", found)
    _check_finite(content, "", found)
    _make_whole(_schema(kind), content)
    for _ in range(MOST_FAULTS):
        try:
            _validator(kind, strict=not found)(content)
            break
        except fastjsonschema.JsonSchemaValueException as error:
            found += _sentences(error)
            if not _without(content, error.path[1:]) and error.rule != "required":
                break
    Faults(DiorError(f"{shown}: {sentence}") for sentence in dict.fromkeys(found)).tell()
    return content


def _without(content: Any, path: list[Any]) -> bool:
    """Take the value at `path`, or the list that it is in, out of `content`, so that the others can be looked at;
    False where there is none."""
    holder, key = None, None
    for part in path:
        if not isinstance(content, dict) or part not in content:
            break
        holder, key, content = content, part, content[part]
    if holder is None:
        return False
    del holder[key]
    return True


def _check_finite(content: Any, inside: str, found: list[str]) -> None:
    """YAML's .nan and .inf are numbers to a schema, but never what a person measured; nor is what fits no float."""
    if isinstance(content, float) and not math.isfinite(content):
        found.append(f"'{inside}' is {content} but should be a finite number")
    if isinstance(content, int) and abs(content) > LARGEST:
        found.append(f"'{inside}' is {content}, which is more than any number here can be")
    keys = content.items() if isinstance(content, dict) else enumerate(content) if isinstance(content, list) else ()
    for key, value in keys:
        _check_finite(value, f"{inside}.{key}" if inside else str(key), found)


def _fill(schema: dict[str, Any], content: Any, inside: str, found: list[str]) -> None:
    """Fill in the defaults; keys that nobody knows are taken out and told in `found`."""
    if not isinstance(content, dict):
        return
    known = schema.get("properties", {})
    patterns = schema.get("patternProperties", {})
    for key in list(content):
        if not isinstance(key, str):
            found.append(f"key '{inside}{key}' is read as a {type(key).__name__}, not as text; put it in quotes")
        elif key in known or any(re.search(pattern, key) for pattern in patterns):
            continue
        elif schema.get("additionalProperties", True) is not False:
            continue
        elif known:
            found.append(f"unknown key '{inside}{key}'{nearest(key, known)}")
        else:
            found.append(f"'{inside}{key}' is not a name of letters, digits, _ and - (not first; at most 100)")
        del content[key]
    for key, value in known.items():
        if key not in content and "default" in value:
            content[key] = deepcopy(value["default"])
    for key, value in content.items():
        below: dict[str, Any] = known.get(key) or next((s for p, s in patterns.items() if re.search(p, key)), {})
        _fill(below, value, f"{inside}{key}.", found)


def _make_whole(schema: dict[str, Any], content: Any) -> None:
    """Turn 1.0 where an integer belongs, which a schema takes for one, into 1, which flags of the steps need."""
    places: list[tuple[Any, dict[str, Any]]] = []
    if isinstance(content, dict):
        known = schema.get("properties", {})
        patterns = schema.get("patternProperties", {})
        places = [
            (key, known.get(key) or next((below for pattern, below in patterns.items() if re.search(pattern, key)), {}))
            for key in content
        ]
    elif isinstance(content, list):
        places = [(at, schema.get("items", {})) for at in range(len(content))]
    for key, below in places:
        value = content[key]
        if below.get("type") == "integer" and isinstance(value, float) and value.is_integer():
            content[key] = int(value)
        _make_whole(below, value)


@cache
def _schema(kind: str) -> dict[str, Any]:
    return read_yaml(SCHEMAS / f"{kind}.schema.yaml")


@cache
def _validator(kind: str, strict: bool) -> Callable[[Any], Any]:
    """What raises for content that a schema refuses; not `strict`: keys may be missing."""
    import fastjsonschema

    schema = _schema(kind)
    return fastjsonschema.compile(schema if strict else _with_gaps(schema), use_default=False)


def _with_gaps(schema: Any) -> Any:
    """A schema without its lists of keys that must be there."""
    if isinstance(schema, list):
        return [_with_gaps(one) for one in schema]
    if not isinstance(schema, dict):
        return schema
    # where `required` is a key of the content, it is a schema and no list
    kept = {key: value for key, value in schema.items() if not (key == "required" and isinstance(value, list))}
    return {key: _with_gaps(value) for key, value in kept.items()}


def _first_sentence(schema: dict[str, Any], key: str) -> str:
    text = schema.get("properties", {}).get(key, {}).get("description", "")
    return text.split(". ")[0].rstrip(".")


def _sentences(error: "fastjsonschema.JsonSchemaValueException") -> list[str]:
    if error.rule != "required":
        return [_sentence(error)]
    inside, schema = "".join(f"{part}." for part in error.path[1:]), error.definition
    missing = [key for key in schema["required"] if key not in error.value]
    return [f"key '{inside}{key}' is missing; it holds: {_first_sentence(schema, key)}" for key in missing]


def _sentence(error: "fastjsonschema.JsonSchemaValueException") -> str:
    path, schema = ".".join(str(part) for part in error.path[1:]), error.definition
    if error.rule == "minLength" and error.value:
        return f"'{path}' is {error.value!r}, which is too short; it holds: {_decapitalised(schema['description'])}"
    value = "nothing" if error.value in (None, "") else repr(error.value)
    guess = nearest(error.value, schema["enum"]) if error.rule == "enum" else _as_number(error.value, schema)
    subject = f"'{path}'" if path else "the file"
    return f"{subject} is {value} but should be {_expected(schema)}{guess}"


def _as_number(value: Any, schema: dict[str, Any]) -> str:
    """How to write a number that YAML takes for a word: 1e9 is one without a point and a sign."""
    if schema.get("type") not in ("number", "integer") or not isinstance(value, str):
        return ""
    try:
        number = float(value)
    except ValueError:
        return ""
    return f"; YAML takes that for a word, write {number:.15g}" if math.isfinite(number) else ""


def _expected(schema: dict[str, Any]) -> str:
    """What a schema asks for, in words."""
    if "enum" in schema:
        return "one of " + ", ".join(str(word) for word in schema["enum"])
    if "pattern" in schema:
        return _decapitalised(schema["description"].split(". ")[0].rstrip("."))
    kind = schema.get("type")
    text = _KINDS.get(str(kind), "something else")
    if kind == "array":
        items = {"number": "numbers", "string": "words"}.get(schema["items"].get("type"), "values")
        exact = schema.get("minItems") if schema.get("minItems") == schema.get("maxItems") else None
        at_least = f"{schema['minItems']} or more " if schema.get("minItems") and not exact else ""
        return f"a list of {exact or at_least}{' ' if exact else ''}{items}"
    limited = " and ".join(f"{word} {schema[key]}" for key, word in _LIMITS.items() if key in schema)
    quoted = ", in quotes if it looks like a number" if kind == "string" else ""
    return f"{text}{' ' if limited else ''}{limited}{quoted}"


def _decapitalised(text: str) -> str:
    return text[:1].lower() + text[1:]
