"""What training with a gallery of its own is worth: held-out walks or sessions before and after, and the baseline's.

usage: python -m benchmarks.reid_train FOLDER [NETWORK] [STEPS] [SESSION ...]

FOLDER: of benchmarks.reid, whose gallery of different people is taken or made. NETWORK: gaitmixer (default) or
another, from the released weights where they are there, else from random ones. SESSION ...: sessions to test with
(such as field field_2 field_3); without, the last walk of every subject in each session.
"""

import sys
import time
from pathlib import Path

import numpy as np

from benchmarks import reid, walkers
from dior.reid import baseline, protocols, split, statistics, train


def main():
    folder, name = Path(sys.argv[1]), (sys.argv[2:3] or ["gaitmixer"])[0]
    steps = int((sys.argv[3:4] or [train.STEPS])[0])
    capture = walkers.made(folder / "different", people="different")
    sheet, shown, walks, _ = reid.shown_of(capture)
    parts = split.of({walk: sheet[walk] for walk in capture.project.sequences}, sys.argv[4:])
    compare(name, steps, sheet, shown, walks, parts, folder / f"{name}.{len(sys.argv[4:])}.{steps}.pt")


def compare(name, steps, sheet, shown, walks, parts, out):
    for row in of_baseline(sheet, shown, walks, parts):
        told("baseline", *row)
    weights = reid.WEIGHTS / reid.FILES.get(name, f"{name}.pt")
    began = time.monotonic()
    found = train.train_and_test(name, shown, parts, out, weights if weights.is_file() else None, steps)
    seconds = time.monotonic() - began
    for row in found["test"]:
        told(row["weights"], row["protocol"], row["rank1"], row["low"], row["high"], row["p"])
    print(
        f"{name}: {found['steps']} steps of {found['sequences']} sequences trained and tested in {seconds:.0f} s; loss "
        f"{found['loss_first']:.4f} to {found['loss_last']:.4f}"
    )


def of_baseline(sheet, shown, walks, parts):
    """(protocol, rank-1, low, high, p) of the held-out walks looked for among those that a network would train with."""
    names = sorted(walks)
    subjects, sessions = ([sheet[walk][key] for walk in names] for key in ("subject", "session"))
    far, _ = baseline.distances([walks[walk] for walk in names], subjects, sessions)
    items = [item for item in shown.items if item.recording in walks]
    at = [names.index(item.recording) for item in items]
    held = np.array([item.recording in parts.test for item in items])
    for protocol in train.PROTOCOLS:
        score = statistics.score(protocols.trials(far[np.ix_(at, at)], items, protocol, held), items)
        yield protocol, score.rank1, score.low, score.high, score.p


def told(what, protocol, rank1, low, high, p):
    print(f"{what:<24}{protocol:<16} rank-1 {rank1:6.1%} ({low:.1%} to {high:.1%}), p {p:.3f}", flush=True)


if __name__ == "__main__":
    main()
