"""Mutants of the numeric core, to see what the tests would not notice.

    pip install cosmic-ray
    python -m benchmarks.mutants [COUNT] [SEED] [ROOM ...]

takes COUNT (300) of all that cosmic-ray can make of the rooms (geometry, clocks, reconstruct), by the SEED (1), and
runs the tests of these rooms against each, two at a time, those of the mutated module first. Prints every survivor with
its line, then the shares. A mutant that hangs is killed by the time limit.
"""

import ast
import os
import random
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from queue import SimpleQueue

ROOT = Path(__file__).resolve().parents[1]
ROOMS = ("geometry", "clocks", "reconstruct")
COPIED = ("dior", "tests", "benchmarks", "config", "workflow", "Snakefile", "pyproject.toml")
WORKERS = 2
LIMIT_S = 300.0


def main(count: int = 300, seed: int = 1, rooms: tuple[str, ...] = ROOMS) -> None:
    found = list(mutants(rooms))
    chosen = random.Random(seed).sample(found, min(count, len(found)))
    print(f"{len(chosen)} of {len(found)} mutants of {', '.join(rooms)}, seed {seed}", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        trees: SimpleQueue[Path] = SimpleQueue()
        for i in range(WORKERS):
            trees.put(copy_of(Path(folder) / str(i)))

        def one(mutant: tuple[Path, str, dict, int, int]) -> bool:
            tree = trees.get()
            try:
                return survives(tree, mutant, rooms)
            finally:
                trees.put(tree)

        if not passes(trees_first(trees), list(test_files(rooms))):
            sys.exit("the tests fail without any mutant, or take longer than LIMIT_S")
        with ThreadPoolExecutor(WORKERS) as pool:
            survived = list(pool.map(one, chosen))
    print(f"{len(chosen) - sum(survived)} of {len(chosen)} killed, {sum(survived)} survived")


def trees_first(trees: "SimpleQueue[Path]") -> Path:
    """One of the trees, left in the queue."""
    tree = trees.get()
    trees.put(tree)
    return tree


def copy_of(folder: Path) -> Path:
    """A copy of what the tests need, for a worker to mutate."""
    for name in COPIED:
        if (ROOT / name).is_dir():
            shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy2(ROOT / name, folder / name)
    shared, beside = ROOT.parent / "shared", folder.parent / "shared"
    if shared.is_dir() and not beside.exists():
        beside.symlink_to(shared)
    return folder


def mutants(rooms: tuple[str, ...]) -> Iterator[tuple[Path, str, dict, int, int]]:
    """(module, operator, its arguments, occurrence, line) of every mutant but those of annotations."""
    from cosmic_ray.commands.init import _all_work_items

    for room in rooms:
        for path in sorted((ROOT / "dior" / room).rglob("*.py")):
            spans = annotations(path)
            for item in _all_work_items([path], {}):
                one = item.mutations[0]
                if not any(start <= one.start_pos < end for start, end in spans):
                    yield path.relative_to(ROOT), one.operator_name, one.operator_args, one.occurrence, one.start_pos[0]


def annotations(path: Path) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """Where a module's annotations begin and end, as (line, column)."""
    found = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        for name in ("annotation", "returns"):
            one = getattr(node, name, None)
            if one is not None:
                found.append(((one.lineno, one.col_offset), (one.end_lineno, one.end_col_offset)))
    return found


def survives(tree: Path, mutant: tuple[Path, str, dict, int, int], rooms: tuple[str, ...]) -> bool:
    """Whether all tests pass with the mutant; a survivor is printed."""
    import cosmic_ray.plugins
    from cosmic_ray.mutating import mutate_code

    module, operator, arguments, occurrence, line = mutant
    path, source = tree / module, (ROOT / module).read_text(encoding="utf-8")
    mutated = mutate_code(source, cosmic_ray.plugins.get_operator(operator)(**arguments), occurrence)
    try:
        if mutated is None or ast.dump(ast.parse(mutated)) == ast.dump(ast.parse(source)):
            return False
    except SyntaxError:
        # a star between arguments was taken for a product
        return False
    path.write_text(mutated, encoding="utf-8")
    try:
        own = tree / "tests" / module.relative_to("dior").with_name(f"test_{module.name}")
        others = [name for name in test_files(rooms) if tree / name != own]
        first = [str(own.relative_to(tree))] if own.exists() else []
        if not all(passes(tree, files) for files in (first, others) if files):
            return False
    finally:
        path.write_text(source, encoding="utf-8")
    changed = [
        f"    - {old.strip()}\n    + {new.strip()}"
        for old, new in zip(source.splitlines(), mutated.splitlines(), strict=False)
        if old != new
    ]
    print(f"{module}:{line} {operator.removeprefix('core/')}\n" + "\n".join(changed[:2]), flush=True)
    return True


def test_files(rooms: tuple[str, ...]) -> list[str]:
    """The files of the tests of the rooms."""
    return [
        str(path.relative_to(ROOT)) for room in rooms for path in sorted((ROOT / "tests" / room).rglob("test_*.py"))
    ]


def passes(tree: Path, files: list[str]) -> bool:
    """Whether the tests in these files pass in a tree."""
    command = [sys.executable, "-m", "pytest", "-q", "-x", "-n", "0", "-p", "no:cacheprovider", *files]
    environment = os.environ | {"PYTHONPATH": str(tree), "PYTHONDONTWRITEBYTECODE": "1", "OMP_NUM_THREADS": "1"}
    try:
        done = subprocess.run(command, cwd=tree, env=environment, capture_output=True, timeout=LIMIT_S)
    except subprocess.TimeoutExpired:
        return False
    return done.returncode == 0


if __name__ == "__main__":
    main(*(int(word) for word in sys.argv[1:3]), **({"rooms": tuple(sys.argv[3:])} if sys.argv[3:] else {}))
