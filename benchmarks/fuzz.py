"""Damaged files for every reader of foreign and hand-made files: each is read, or refused in one sentence, and soon.

usage: python -m benchmarks.fuzz [READER[,READER ...]|all] [COUNT] [SEED] [--keep FOLDER]

makes COUNT (5000) files of the SEED (17) for each reader (all; `benchmarks/fuzz_readers.py` lists them) and reads them
in a process of its own. A fault is a traceback, a refusal that is no single line or does not name the file, more than
5 s of processor time, more than 1 GB, or a crash. Prints per reader how many files were read and refused, the slowest
file and the most memory, and each kind of fault once, with the number of its first file: the same seed and number make
the same file, and --keep writes it into FOLDER. Exits with 1 where there is a fault.
"""

import argparse
import multiprocessing
import os
import random
import re
import resource
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path

from benchmarks.fuzz_readers import READERS, prepared
from dior.errors import DiorError, DiorErrors

LIMIT_S = 5.0
LIMIT_MB = 1000
# chosen: other programs want the processor, too
PATIENCE_S = 60.0
# the process ends before the machine does
MOST_MB = 6000
# chosen: a file is damaged once or some times
MOST_DAMAGES = 4

# what is put into a file: what breaks parsers, and what people type
WORDS = [
    b'"', b"'", b'""', b"\0", b"\xe9", b"\xff\xfe", b"\xef\xbb\xbf", b"\r", b"\n", b"\r\n", b"\t", b",", b";", b":",
    b"#", b"{", b"}", b"[", b"]", b"{wild}", b"{camera}", b"%", b"$HOME", b"`id`", b"../..", b"/", b"-S01", b"--help",
    b"-h", b"=HYPERLINK(1)", b"\x1b[2J", b"\xe2\x80\xa8", b"\xd9\xa3", b"nan", b"inf", b"-inf", b".nan", b".inf",
    b"1e999", b"1e308", b"-1", b"0", b"1_0", b"0x10", b"1.5", b"9" * 19, b"9" * 40, b"9" * 5000, b"0x" + b"f" * 5000,
    b"null", b"~", b"true", b"None", b"2023-02-30", b"2024-02-29", b"12:59:61", b"99999-01-01T00:00:00Z", b"!!int x",
    b"!!timestamp x", b"!!binary x", b"!!set {a}", b"!!python/object:os.system x", b"!x", b"&a [*a]", b"*a", b"&a",
    b"<<: *a", b"? ", b"- ", b"|\n", b">\n", b"---\n", b"...\n", b"a: b\n", b"[" * 2000, b"[" * 50_000,
    b'{"a":' * 2000, b"- " * 2000, b"? " * 2000, b"a.b." * 2000, b"[a" + b".a" * 2000 + b"]", b"x" * 5000,
    b"x" * 140_000, b"landmarks {" * 2000, b"<a>" * 2000, b"<!DOCTYPE a>", b"&lt;", b"\x00\x00\x00\x00",
    b"\xff\xff\xff\xff", b"\x7f\xff\xff\xff",
    b"&a [x,x,x,x,x,x,x,x,x]\n" + b"".join(
        b"b%d: &b%d [%s]\n" % (i, i, b",".join([b"*b%d" % (i - 1) if i else b"x"] * 9)) for i in range(9)
    ),
]  # fmt: skip
NUMBER = re.compile(rb"-?\d+(?:\.\d+)?")
Damage = Callable[[random.Random, bytes, list[bytes]], bytes]


def _place(chance: random.Random, content: bytes) -> tuple[int, int]:
    """Begin and end of a part, mostly a short one."""
    begin = chance.randrange(len(content) + 1)
    return begin, min(len(content), begin + int(2 ** chance.uniform(0, 10)))


def cut(chance: random.Random, content: bytes, others: list[bytes]) -> bytes:
    return content[: _place(chance, content)[0]]


def flipped(chance: random.Random, content: bytes, others: list[bytes]) -> bytes:
    damaged = bytearray(content)
    for _ in range(chance.randint(1, 8)):
        if damaged:
            damaged[chance.randrange(len(damaged))] ^= 1 << chance.randrange(8)
    return bytes(damaged)


def noise(chance: random.Random, content: bytes, others: list[bytes]) -> bytes:
    begin, end = _place(chance, content)
    return content[:begin] + chance.randbytes(end - begin) + content[end:]


def zeros(chance: random.Random, content: bytes, others: list[bytes]) -> bytes:
    begin, end = _place(chance, content)
    return content[:begin] + bytes(end - begin) + content[end:]


def left_out(chance: random.Random, content: bytes, others: list[bytes]) -> bytes:
    begin, end = _place(chance, content)
    return content[:begin] + content[end:]


def repeated(chance: random.Random, content: bytes, others: list[bytes]) -> bytes:
    begin, end = _place(chance, content)
    times = int(2 ** chance.uniform(1, 12))
    return content[:end] + content[begin:end] * min(times, 300_000 // max(end - begin, 1)) + content[end:]


def word(chance: random.Random, content: bytes, others: list[bytes]) -> bytes:
    at = chance.randrange(len(content) + 1)
    return content[:at] + chance.choice(WORDS) + content[at:]


def other_word(chance: random.Random, content: bytes, others: list[bytes]) -> bytes:
    """One of the words of a text becomes another."""
    found = list(re.finditer(rb"[^\s,;:{}\[\]\"]+", content[:100_000]))
    if not found:
        return word(chance, content, others)
    begin, end = chance.choice(found).span()
    return content[:begin] + chance.choice(WORDS) + content[end:]


def number(chance: random.Random, content: bytes, others: list[bytes]) -> bytes:
    found = list(NUMBER.finditer(content[:100_000]))
    if not found:
        return flipped(chance, content, others)
    begin, end = chance.choice(found).span()
    new = chance.choice(
        [b"-1", b"0", b"1e999", b"nan", b"9" * 18, b"9" * 19, b"9" * 400, b"9" * 5000, b"1e300", b"0.5"]
    )
    return content[:begin] + new + content[end:]


def lines_moved(chance: random.Random, content: bytes, others: list[bytes]) -> bytes:
    lines = content.split(b"\n")
    i, j = chance.randrange(len(lines)), chance.randrange(len(lines))
    if chance.random() < 0.5:
        lines[i], lines[j] = lines[j], lines[i]
    else:
        lines.insert(i, lines[j])
    return b"\n".join(lines)


def spliced(chance: random.Random, content: bytes, others: list[bytes]) -> bytes:
    """The beginning of one file with the end of another."""
    other = chance.choice(others)
    return content[: chance.randrange(len(content) + 1)] + other[chance.randrange(len(other) + 1) :]


def encoded(chance: random.Random, content: bytes, others: list[bytes]) -> bytes:
    """As another program or system writes a text."""
    text = content.decode("utf-8", "replace")
    ways: list[Callable[[], bytes]] = [
        lambda: text.encode("utf-16"),
        lambda: text.encode("utf-16-be"),
        lambda: text.replace("a", "é", 3).encode("latin-1", "replace"),
        lambda: b"\xef\xbb\xbf" + content,
        lambda: content.replace(b"\n", b"\r"),
        lambda: content.replace(b"\n", b"\r\n"),
        lambda: content.replace(b",", b";").replace(b".", b","),
        lambda: content.replace(b"\t", b"    "),
        lambda: content + b"\x1a",
    ]
    return chance.choice(ways)()


DAMAGES: list[Damage] = [
    cut, flipped, noise, zeros, left_out, repeated, word, word, other_word, other_word, number, number, lines_moved,
    spliced, encoded,
]  # fmt: skip


def damaged(reader: str, seed: int, i: int) -> tuple[str, bytes]:
    """The name and content of file number `i`; the same at every call."""
    samples = READERS[reader].samples()
    chance = random.Random(f"{reader} {seed} {i}")
    name = chance.choice(sorted(samples))
    content, others = samples[name], list(samples.values())
    if chance.random() < 0.02:
        return name, chance.choice([b"", *WORDS])
    for _ in range(min(MOST_DAMAGES, int(chance.expovariate(1)) + 1)):
        content = chance.choice(DAMAGES)(chance, content, others)
    return name, content


@dataclass
class Outcome:
    """What became of the files of one reader: how many were read and refused, by kind of fault its files and the
    text of the first."""

    read: int = 0
    refused: int = 0
    seconds: float = 0.0
    megabytes: float = 0.0
    faults: dict[str, list[int]] = field(default_factory=dict)
    examples: dict[str, str] = field(default_factory=dict)

    def add(self, i: int, verdict: str) -> None:
        kind, _, example = verdict.partition(": ")
        self.faults.setdefault(kind, []).append(i)
        self.examples.setdefault(kind, example)


def tried(reader: str, folder: Path, seed: int, i: int) -> str:
    """`read`, `refused`, or what is wrong with how the file was taken."""
    name, content = damaged(reader, seed, i)
    path = prepared(READERS[reader], folder / "files", name, content)
    try:
        READERS[reader].read(path, folder / "files")
    except DiorError as error:
        # of several faults each is a sentence that names the file
        texts = [str(one) for one in (error.found if isinstance(error, DiorErrors) else [error])]
        names = (path.name, path.parent.name, "/".join(path.parts[-2:]))
        if broken := [text for text in texts if not text.isprintable()]:
            return f"a refusal of several lines: {broken[0]!r:.200}"
        unnamed = [text for text in texts if not any(name in text for name in names)]
        return f"a refusal that does not name the file: {unnamed[0]:.200}" if unnamed else "refused"
    except MemoryError:
        return "memory"
    except BaseException as error:
        last = traceback.extract_tb(error.__traceback__)
        own = [one for one in last if "/dior/" in one.filename] or last
        return f"{type(error).__name__} at {Path(own[-1].filename).name} line {own[-1].lineno}: {str(error)!r:.120}"
    return "read"


def _worker(pipe: Connection, reader: str, folder: Path, seed: int, begin: int, count: int) -> None:
    """Send (verdict, seconds, MB more than at the beginning) of each file."""
    limit = _megabytes() + MOST_MB
    resource.setrlimit(resource.RLIMIT_AS, (int(limit) << 20, int(limit) << 20))
    # what libraries in C print
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
    warnings.simplefilter("ignore")
    before = _megabytes()
    for i in range(begin, count):
        started = time.process_time()
        verdict = tried(reader, folder, seed, i)
        pipe.send((verdict, time.process_time() - started, max(0.0, _megabytes() - before)))


def _megabytes() -> float:
    """The most memory that this process has had."""
    text = Path("/proc/self/status").read_text(encoding="ascii")
    found = re.search(r"VmHWM:\s+(\d+)", text)
    return int(found[1]) / 1024 if found else 0.0


def _verdicts(reader: str, folder: Path, seed: int, count: int) -> Iterator[tuple[int, str, float, float]]:
    """(number, verdict, s, MB) of each file; a process that hangs, dies or has grown is replaced."""
    context = multiprocessing.get_context("fork")
    done = 0
    while done < count:
        ours, theirs = context.Pipe(duplex=False)
        process = context.Process(target=_worker, args=(theirs, reader, folder, seed, done, count))
        process.start()
        theirs.close()
        while done < count:
            if not ours.poll(PATIENCE_S):
                yield done, "slow", PATIENCE_S, 0.0
                done += 1
                break
            try:
                verdict, seconds, megabytes = ours.recv()
            except EOFError:
                process.join()
                yield done, f"a crash (exit code {process.exitcode})", 0.0, 0.0
                done += 1
                break
            yield done, verdict, seconds, megabytes
            done += 1
            if megabytes > LIMIT_MB / 2:
                break
        process.kill()
        process.join()


def fuzzed(reader: str, count: int, seed: int) -> Outcome:
    """The `Outcome` of `count` files."""
    outcome = Outcome()
    READERS[reader].samples()
    with tempfile.TemporaryDirectory(prefix="fuzz_") as folder:
        for i, verdict, seconds, megabytes in _verdicts(reader, Path(folder), seed, count):
            outcome.seconds = max(outcome.seconds, seconds)
            outcome.megabytes = max(outcome.megabytes, megabytes)
            if verdict == "read":
                outcome.read += 1
            elif verdict == "refused":
                outcome.refused += 1
            else:
                outcome.add(i, verdict)
            if seconds > LIMIT_S and verdict != "slow":
                outcome.add(i, f"slow: {seconds:.1f} s")
            if megabytes > LIMIT_MB:
                outcome.add(i, f"memory: {megabytes:.0f} MB")
    return outcome


def _keep(folder: Path, reader: str, seed: int, i: int) -> Path:
    name, content = damaged(reader, seed, i)
    kept = folder / f"{reader}.{seed}.{i}.{Path(name).name}"
    kept.parent.mkdir(parents=True, exist_ok=True)
    kept.write_bytes(content)
    return kept


def main() -> int:
    parser = argparse.ArgumentParser(usage=__doc__)
    parser.add_argument("readers", nargs="?", default="all")
    parser.add_argument("count", nargs="?", type=int, default=5000)
    parser.add_argument("seed", nargs="?", type=int, default=17)
    parser.add_argument("--keep", type=Path)
    given = parser.parse_args()
    names = list(READERS) if given.readers == "all" else given.readers.split(",")
    if unknown := [name for name in names if name not in READERS]:
        parser.error(f"there is no reader {unknown[0]}; there are {', '.join(READERS)}")
    found: Counter[str] = Counter()
    print(f"{'reader':16}{'read':>7}{'refused':>9}{'faults':>8}{'slowest s':>11}{'most MB':>9}", flush=True)
    for name in names:
        outcome = fuzzed(name, given.count, given.seed)
        faults = sum(map(len, outcome.faults.values()))
        found["files"] += given.count
        found["faults"] += faults
        print(
            f"{name:16}{outcome.read:7}{outcome.refused:9}{faults:8}{outcome.seconds:11.2f}{outcome.megabytes:9.0f}",
            flush=True,
        )
        for kind, numbers in outcome.faults.items():
            kept = f" ({_keep(given.keep, name, given.seed, numbers[0])})" if given.keep else ""
            print(f"  {len(numbers)} x {kind}, first file {numbers[0]}{kept}: {outcome.examples[kind]}", flush=True)
    print(f"{found['files']} files, {found['faults']} faults")
    return int(found["faults"] > 0)


if __name__ == "__main__":
    sys.exit(main())
