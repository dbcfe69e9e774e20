"""Protobuf text format, as far as landmark files need it: nested messages and plain values."""

import re
from typing import Any

from dior.arrays import AnyPath
from dior.errors import DiorError
from dior.ingest.readers.common import INTERRUPTED

_TOKEN = re.compile(
    r"""\s+ | \#[^\n]* | [,;]
    | (?P<open>[A-Za-z_]\w*) \s* :? \s* \{
    | (?P<name>[A-Za-z_]\w*) \s* : \s* (?P<value>"[^"\n]*" | '[^'\n]*' | [-+.\w]+)
    | (?P<close>\})""",
    re.VERBOSE,
)


def parse(text: str, where: AnyPath) -> list[tuple[str, Any]]:
    """A message as a list of (name, value): a value is a list for a message, text for anything else.

    Raises DiorError, with the line, where `text` is no such message or ends within one.
    """
    message: list[tuple[str, Any]] = []
    outer: list[list[tuple[str, Any]]] = []
    at = 0
    while at < len(text):
        token = _TOKEN.match(text, at)
        if not token or (token["close"] and not outer):
            line = text.count("\n", 0, at) + 1
            raise DiorError(f"{where}: line {line} is no protobuf text ({text[at : at + 20]!r}); {INTERRUPTED}")
        at = token.end()
        if token["open"]:
            inner: list[tuple[str, Any]] = []
            message.append((token["open"], inner))
            outer.append(message)
            message = inner
        elif token["close"]:
            message = outer.pop()
        elif token["name"]:
            message.append((token["name"], token["value"]))
    if outer:
        raise DiorError(f"{where}: the protobuf text ends within {len(outer)} open messages; {INTERRUPTED}")
    return message
