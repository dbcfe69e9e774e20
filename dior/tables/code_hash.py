"""What a result was made with: a hash of the code of its step.

Snakemake asks for the hashes of all steps each time it starts. What a module's text says is therefore kept, by the hash
of the text, in the user's folder for caches: 2 s of the 7 s that a start takes.
"""

import ast
import hashlib
import json
import os
import runpy
import sys
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

from dior.errors import DiorError
from dior.tables.files import write_text
from dior.tables.result_checksums import file_sha256

PACKAGE = Path(__file__).parents[1]
# what numbers are computed with; other packages read and write, and a new version of them re-runs nothing
NUMERIC = ("numpy", "opencv-python-headless", "gtsam", "scipy")
# packages that are not made for every kind of machine: without one the steps that have this file write something else
BESIDE = {"release/transform.py": "turbojpeg"}
NOT_CODE = {"cli"}
# the constant in which readers describe their formats (dior/formats.py): words for people
WORDS = "DESCRIPTIONS"
# modules that are kept at the most; chosen: those of some versions of dior
KEPT = 3000


@dataclass(frozen=True)
class _Module:
    """Of a module's syntax tree: a hash without docstrings and WORDS (comments are not in a tree), what it imports
    inside the package, without `dior.`, and the strings that it spells."""

    meaning: str
    imports: frozenset[str]
    strings: frozenset[str]


@cache
def code_hash(*modules: str) -> str:
    """A short hash of the code that steps run: `code_hash("calibrate.locate")`.

    It covers the modules; every dior module they import (inside functions, too); of each table whose name one of
    these spells the columns' names, types, units and words; the files that are no Python and that those name
    (templates; the JSON schemas, whose defaults are filled in); and the installed versions of the numeric packages
    and of those of BESIDE.
    Comments, docstrings and the descriptions of formats, columns and keys do not count, so that an edit of those
    re-runs nothing, except those of columns in the steps that show them: who imports `dior.tables.schemas`.
    """
    digest = hashlib.sha256()
    every = covered(*modules)
    for name, meaning in every:
        digest.update(f"{name}\0{meaning}\0".encode())
    digest.update(_versions().encode())
    for name, package in BESIDE.items():
        if name in dict(every):
            digest.update(f"\0{package}=={_version(package)}".encode())
    return digest.hexdigest()[:16]


def covered(*modules: str) -> list[tuple[str, str]]:
    """What the hash of some modules covers: files below the package and `table <name>`, each with a hash."""
    closure = sorted(_closure(modules))
    found = [(_name(path), _module(path).meaning) for path in closure]
    if _tables_room() / "tables.py" in closure:
        strings = frozenset().union(*(_module(path).strings for path in closure))
        found += [(f"table {name}", columns) for name, columns in _tables().items() if name in strings]
    data = sorted({file for path in closure for file in _data_files(path)})
    return found + [(_name(file), _content(file)) for file in data]


def _name(path: Path) -> str:
    return path.relative_to(PACKAGE).as_posix()


@cache
def _versions() -> str:
    return "\0".join(f"{package}=={metadata.version(package)}" for package in NUMERIC)


def _version(package: str) -> str:
    """Of a package, "" where it is not installed."""
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return ""


def _tables_room() -> Path:
    return PACKAGE / "tables"


@cache
def _tables() -> dict[str, str]:
    """Hash of the columns by table: names, types or words, units, and whether it is released."""
    stages = [runpy.run_path(str(path)) for path in _stages()]
    released = {name for stage in stages for name in stage.get("RELEASED", ())}
    columns = {name: [column[:3] for column in table] for stage in stages for name, table in stage["TABLES"].items()}
    return {name: _sha256(repr((columns[name], name in released))) for name in sorted(columns)}


def _stages() -> list[Path]:
    """The modules of `dior.tables.schemas` that say which columns a table has."""
    return [path for path in sorted((_tables_room() / "schemas").glob("*.py")) if path.name != "__init__.py"]


def _path_of(module: str) -> Path | None:
    """The file of a module named without `dior.`; None where there is none."""
    path = PACKAGE.joinpath(*module.split("."))
    if path.is_dir():
        return path / "__init__.py"
    return path.with_suffix(".py") if path.with_suffix(".py").is_file() else None


def _closure(modules: tuple[str, ...]) -> set[Path]:
    found: set[Path] = set()
    waiting = []
    for module in modules:
        path = _path_of(module)
        if path is None:
            raise ValueError(f"there is no module dior.{module}")
        waiting.append(path)
    while waiting:
        path = waiting.pop()
        if path not in found:
            found.add(path)
            waiting += _imports(path)
    return found


@cache
def _imports(path: Path) -> tuple[Path, ...]:
    """The files of what a module imports.

    `dior.tables.schemas` itself leads nowhere: `covered` has what counts of a table. A module that imports it from
    elsewhere than this room shows the descriptions, and so all of its text counts.
    """
    schemas = _tables_room() / "schemas" / "__init__.py"
    if path == schemas:
        return ()
    files = {file for name in _module(path).imports if (file := _path_of(name))}
    shown = path.parent != _tables_room() and any(file.parent == schemas.parent for file in files)
    return (*sorted(files), *(_stages() if shown else ()))


@cache
def _module(path: Path) -> _Module:
    return _parsed(path.read_text(encoding="utf-8"))


def _parsed(text: str) -> _Module:
    """What a module's text says."""
    # as this file and this Python understand it
    key = _sha256(f"{sys.version}\0{_own_text()}\0{text}")
    kept = _kept()
    if key not in kept:
        kept[key] = _read(text)
        _new().add(key)
    return kept[key]


@cache
def _own_text() -> str:
    return Path(__file__).read_text(encoding="utf-8")


def _cache_file() -> Path:
    return Path(os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")) / "dior" / "code.json"


@cache
def _kept() -> dict[str, _Module]:
    """What was kept, by key, and what was read since; damaged, it is as if there was nothing."""
    with suppress(OSError, ValueError):
        digest, _, content = _cache_file().read_text(encoding="utf-8").partition("\n")
        if digest == _sha256(content):
            return {k: _Module(m, frozenset(i), frozenset(s)) for k, (m, i, s) in json.loads(content).items()}
    return {}


@cache
def _new() -> set[str]:
    """Keys of what was read and is not kept yet."""
    return set()


def keep() -> None:
    """Keep what was read of modules for the next start; without a word where it cannot be."""
    if not (new := _new()):
        return
    kept = _kept()
    if len(kept) > KEPT:
        kept = {key: kept[key] for key in new}
    content = json.dumps({k: [m.meaning, sorted(m.imports), sorted(m.strings)] for k, m in sorted(kept.items())})
    with suppress(OSError, DiorError, UnicodeEncodeError):
        write_text(_cache_file(), f"{_sha256(content)}\n{content}")
    new.clear()


def _read(text: str) -> _Module:
    tree = ast.parse(text)
    tree.body = [node for node in tree.body if not _is_words(node)]
    imports, strings = set(), set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            imports |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            imports |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            strings.add(node.value)
        elif isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)):
            if ast.get_docstring(node, clean=False) is not None:
                node.body = node.body[1:]
    parts = (name.split(".") for name in imports)
    # `dior` itself holds the version and names for others (tests/test_api.py: nothing in here goes through those)
    inside = {".".join(part[1:]) for part in parts if part[0] == "dior" and part[1:] and part[1] not in NOT_CODE}
    return _Module(_sha256(ast.dump(tree)), frozenset(inside), frozenset(strings))


def _is_words(node: ast.stmt) -> bool:
    return isinstance(node, ast.Assign) and any(isinstance(to, ast.Name) and to.id == WORDS for to in node.targets)


def _sha256(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


@cache
def _data_files(path: Path) -> tuple[Path, ...]:
    """Files that a module reads: those below its folder whose name, or whose subfolder's name, it spells out."""
    if path.parent == PACKAGE:
        return ()
    strings = _module(path).strings
    return tuple(file for file in _not_code(path.parent) if strings & {file.name, *_folders(file, path.parent)})


@cache
def _not_code(folder: Path) -> tuple[Path, ...]:
    return tuple(file for file in folder.rglob("*") if file.is_file() and file.suffix not in (".py", ".pyc"))


def _folders(file: Path, above: Path) -> tuple[str, ...]:
    return file.relative_to(above).parts[:-1]


@cache
def _content(path: Path) -> str:
    """Hash of a file's bytes; of a JSON schema without its descriptions."""
    if not path.name.endswith(".schema.yaml"):
        return file_sha256(path)
    import yaml

    # PyYAML may have been built without the loader in C
    loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    return _sha256(repr(_undescribed(yaml.load(path.read_bytes(), loader))))


def _undescribed(schema: Any) -> Any:
    """A JSON schema without descriptions. A property may bear that name: then it holds no text but a schema."""
    if isinstance(schema, list):
        return [_undescribed(part) for part in schema]
    if not isinstance(schema, dict):
        return schema
    kept = {key: part for key, part in schema.items() if key != "description" or not isinstance(part, str)}
    return {key: _undescribed(part) for key, part in kept.items()}
