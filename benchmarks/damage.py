"""One flipped bit in each kind of result of a finished project: is it noticed when a step reads the file?

    python -m benchmarks.damage ../my_capture
    python -m benchmarks.damage ../my_capture --flips 300 --seed 1 --every-bit-of clocks

Works on a copy of one file per kind. A flip is silent if the file is read without an error; beside it what a file
tells by itself, outside of a project, where nothing notes what its job wrote. `--every-bit-of` flips every bit of the
smallest table of a step, footer and page headers included.
"""

import argparse
import shutil
import tempfile
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from dior.errors import DiorError
from dior.evaluate import metrics, statistics
from dior.release import provenance
from dior.report import reid
from dior.tables import result_checksums, tables

# readers of the results that are no tables, by the end of their paths
OTHERS: dict[str, Callable[[Path], Any]] = {
    "evaluate/metrics.csv": metrics.read,
    "evaluate/statistics.csv": statistics.read,
    "reid/table.csv": lambda path: reid.read(path, path, path),
    "provenance/": provenance.read,
}


def reader_of(path: Path) -> Callable[[Path], Any] | None:
    """What reads a result; None for one that no step reads."""
    if path.suffix == ".parquet":
        name = tables.metadata(path)["dior_table"]
        return lambda path: tables.read(path, name)
    return next((read for end, read in OTHERS.items() if end in path.as_posix()), None)


def kinds(results: Path) -> dict[str, Path]:
    """One result of each kind: the step's folder, and the name of the table or of the file."""
    found: dict[str, Path] = {}
    for path in sorted(results.rglob("*")):
        if path.is_file() and (result := result_checksums.result_at(path)):
            what = tables.metadata(path)["dior_table"] if path.suffix == ".parquet" else path.name
            found.setdefault(f"{result.parts[0]}/{f'*{path.suffix}' if path.suffix == '.json' else what}", path)
    return found


def random_flips(size: int, count: int, seed: int) -> list[int]:
    """`count` different bits of a file of `size` bytes."""
    random = np.random.default_rng(seed)
    return random.choice(8 * size, min(count, 8 * size), replace=False).tolist()


def silent(path: Path, read: Callable[[Path], Any], bits: Iterable[int], errors: Any = DiorError) -> Iterator[int]:
    """Those of `bits` with which the file is read without one of `errors`. The file is afterwards as it was."""
    whole = path.read_bytes()
    try:
        for bit in bits:
            with open(path, "r+b") as stream:
                stream.seek(bit // 8)
                stream.write(bytes([whole[bit // 8] ^ 1 << bit % 8]))
            try:
                read(path)
                yield bit
            except errors:
                pass
            with open(path, "r+b") as stream:
                stream.seek(bit // 8)
                stream.write(whole[bit // 8 : bit // 8 + 1])
    finally:
        path.write_bytes(whole)


def main() -> None:
    """Print a row per kind."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("project", type=Path)
    parser.add_argument("--flips", type=int, default=300)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--every-bit-of", metavar="STEP")
    given = parser.parse_args()
    results = given.project / result_checksums.RESULTS
    print(f"{'result':44} {'bytes':>8} {'flips':>6} {'silent':>6} {'silent by itself':>16}")
    with tempfile.TemporaryDirectory() as folder:
        for kind, path in kinds(results).items():
            if read := reader_of(path):
                row(kind, path, read, random_flips(path.stat().st_size, given.flips, given.seed), Path(folder))
        if given.every_bit_of:
            path = min((results / given.every_bit_of).rglob("*.parquet"), key=lambda path: path.stat().st_size)
            every, read = range(8 * path.stat().st_size), reader_of(path)
            assert read
            row(f"every bit of {given.every_bit_of}/{path.name}", path, read, every, Path(folder))


def row(kind: str, path: Path, read: Callable[[Path], Any], bits: Iterable[int], folder: Path) -> None:
    """Flip bits of a copy in a project and of one outside, and print what is silent."""
    result = result_checksums.result_at(path)
    assert result
    inside = folder / "project" / result.name
    entry = folder / "project" / result_checksums.RESULTS / result.entry.relative_to(result.results)
    # the readers know some files by their place
    outside = folder / "elsewhere" / Path(*result.parts)
    for source, copy in ((path, inside), (result.entry, entry), (path, outside)):
        copy.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(source, copy)
    noticed = [sum(1 for _ in silent(one, read, bits, how)) for one, how in ((inside, DiorError), (outside, Exception))]
    print(f"{kind:44} {path.stat().st_size:8} {len(list(bits)):6} {noticed[0]:6} {noticed[1]:16}", flush=True)


if __name__ == "__main__":
    main()
