"""What a result was made with: content hashes of files and of the code of a step."""

import ast
import hashlib
import os
from functools import cache
from importlib import metadata
from pathlib import Path

PACKAGE = Path(__file__).parents[1]
NUMERIC = ("numpy", "opencv-python-headless", "gtsam", "scipy")
NOT_CODE = {"cli"}


def file_sha256(path):
    """Hex SHA-256 of a file's bytes."""
    with open(path, "rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


@cache
def code_hash(*modules):
    """A short hash of the code that steps run: `code_hash("calibrate.locate")`.

    It covers the modules, every dior module they import (inside functions, too), the files that are no Python and
    that those name (templates; the JSON schemas, whose defaults are filled in) and the installed versions
    of the numeric packages. Comments and docstrings do not count, so an edit of those re-runs nothing.
    """
    digest = hashlib.sha256()
    closure = sorted(_closure(modules))
    for path in closure:
        digest.update(f"{path.relative_to(PACKAGE)}\0{_meaning(path)}\0".encode())
    for path in sorted({data for module in closure for data in _data_files(module)}):
        digest.update(f"{path.relative_to(PACKAGE)}\0{file_sha256(path)}\0".encode())
    digest.update(_versions().encode())
    return digest.hexdigest()[:16]


@cache
def _versions():
    return "\0".join(f"{package}=={metadata.version(package)}" for package in NUMERIC)


@cache
def _path_of(module):
    path = PACKAGE.joinpath(*module.split("."))
    if path.is_dir():
        return path / "__init__.py"
    if path.with_suffix(".py").is_file():
        return path.with_suffix(".py")
    raise ValueError(f"there is no module dior.{module}")


def _closure(modules):
    found, waiting = set(), [_path_of(module) for module in modules]
    while waiting:
        path = waiting.pop()
        if path not in found:
            found.add(path)
            waiting += _imports(path)
    return found


@cache
def _imports(path):
    wanted = set()
    for node in ast.walk(ast.parse(path.read_text(), str(path))):
        if isinstance(node, ast.Import):
            wanted |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            wanted.add(node.module)
            wanted |= {f"{node.module}.{alias.name}" for alias in node.names}
    paths = []
    for name in sorted(wanted):
        parts = name.split(".")
        if parts[0] != "dior" or (len(parts) > 1 and parts[1] in NOT_CODE):
            continue
        try:
            paths.append(_path_of(".".join(parts[1:])) if len(parts) > 1 else PACKAGE / "__init__.py")
        except ValueError:
            continue
    return tuple(paths)


@cache
def _meaning(path):
    """Hash of a module's syntax tree without docstrings; comments are not in a tree."""
    tree = ast.parse(path.read_text())
    for node in ast.walk(tree):
        documented = isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef))
        if documented and ast.get_docstring(node, clean=False) is not None:
            node.body = node.body[1:]
    return hashlib.sha256(ast.dump(tree).encode()).hexdigest()


@cache
def _data_files(path):
    """Files that a module reads: those below its folder whose name, or whose subfolder's name, it spells out."""
    if path.parent == PACKAGE:
        return ()
    nodes = ast.walk(ast.parse(path.read_text()))
    spelled = {node.value for node in nodes if isinstance(node, ast.Constant) and isinstance(node.value, str)}
    return tuple(
        file
        for file in path.parent.rglob("*")
        if file.is_file()
        and file.suffix not in (".py", ".pyc")
        and spelled & {file.name, *file.relative_to(path.parent).parts[:-1]}
    )


def folder_state(path):
    """A short hash of the names, sizes and times of the files in a folder; "" for what is no folder.

    Snakemake looks at a folder's own time, which does not change when a file in it is written again.
    """
    if not os.path.isdir(path):
        return ""
    files = sorted((e.name, e.stat().st_size, e.stat().st_mtime_ns) for e in os.scandir(path) if e.is_file())
    return hashlib.sha256(repr(files).encode()).hexdigest()[:16]
