"""Who is recognised in a simulated gallery: the pretrained networks and the baseline, and what must not be recognised.

usage: OMP_NUM_THREADS=2 python -m benchmarks.reid [FOLDER] [SEED] [PEOPLE]

FOLDER for the galleries and tables: a new temporary one, removed after; in one that is there, what is done already is
not done again. PEOPLE: `different` or `same` alone.

14 subjects in three sessions per environment, 8 cameras, 2 outfits, 2 walks, detector level `real`: 56 sequences per
camera, as in the paper. `different`: with different bodies and gaits; `same`: one body and one gait for all, in which
whatever is recognised is a session, a camera or a recording. Released weights are taken from ../shared/reid/weights;
without them the networks are left out.
"""

import json
import shutil
import sys
import tempfile
import time
from functools import partial
from pathlib import Path

from benchmarks import walkers
from dior.reid import checkpoint, inputs, recognise, statistics
from dior.tables.files import write_text

WEIGHTS = Path(__file__).resolve().parents[2] / "shared/reid/weights"
FILES = {"gaitgraph": "gaitgraph.pth", "gaitmixer": "gaitmixer.pt", "gaitformer": "gaitformer.pt"}


def shown_of(capture):
    """The sheet, the `recognise.Gallery` and the `Gait`s of a gallery."""
    project = capture.project
    paths = {name: capture.made("inputs", name) for name in project.sequences}
    widths = {name: dict.fromkeys(project.cameras_of(name), capture.settings.width) for name in paths}
    walks, left_out = recognise.gaits({name: capture.made("inputs", name, ".skeleton") for name in paths})
    return project.rows, recognise.gallery(project.rows, paths, widths), walks, left_out


def told(rows, cameras=False):
    for row in rows:
        if row["camera"] and not cameras:
            continue
        print(
            f"{row['method']:<11}{row['adaptation']:<10}{row['protocol']:<16}{row['environment']:<8}{row['camera']:<6}"
            f"{row['rank1']:>7.1%}{row['low']:>7.1%}{row['high']:>7.1%}{row['hits']:>6} of {row['n']:<6}"
            f"{row['chance']:>7.1%}{row['null95']:>7.1%}{row['p']:>7.3f}{row['rank5']:>7.1%}{row['mean_ap']:>6.2f} "
            f"{row['verdict']}",
            flush=True,
        )


def kept(path, made):
    """Rows of a table from a file of an earlier run, or made now and written there; and the seconds that took."""
    if not path.is_file():
        began = time.monotonic()
        rows = made()
        write_text(path, json.dumps([rows, time.monotonic() - began]))
    return json.loads(path.read_text())


def main():
    given = Path(sys.argv[1]) if len(sys.argv) > 1 else None
    seed = int(sys.argv[2]) if len(sys.argv) > 2 else 1
    folder = given or Path(tempfile.mkdtemp(prefix="dior-reid-"))
    for people in sys.argv[3:] or ("different", "same"):
        began = time.monotonic()
        capture = walkers.made(folder / people, people=people, seed=seed)
        print(f"people: {people}, seed {seed}: the gallery is there after {time.monotonic() - began:.0f} s", flush=True)
        compare(capture, folder / people / "tables", cameras=people == "different")
    if given is None:
        shutil.rmtree(folder)


def compare(capture, tables, cameras):
    """Print the rows of the baseline and of every network and adaptation; they are kept in the folder `tables`."""
    sheet, shown, walks, left_out = shown_of(capture)
    print(f"{len(shown.items)} sequences of {len(walks)} walks, {len(shown.left_out)} and {len(left_out)} left out")
    print(
        f"{'method':<11}{'input':<10}{'protocol':<16}{'probe':<14}{'rank-1':>7}{'low':>7}{'high':>7}{'hits':>6}"
        f"{'':<10}{'chance':>7}{'null95':>7}{'p':>7}{'rank-5':>7}{'mAP':>6}"
    )
    rows, seconds = kept(tables / "baseline.json", lambda: recognise.of_baseline(sheet, walks, shown)[0])
    told(rows, cameras)
    print(f"baseline: {seconds:.1f} s")
    exchanges = statistics.exchanged(shown.items)
    for name, file in FILES.items():
        if not (WEIGHTS / file).is_file():
            print(f"{name}: no weights at {WEIGHTS / file}")
            continue
        network = checkpoint.load(name, WEIGHTS / file)
        for adaptation in inputs.ADAPTATIONS:
            rows, seconds = kept(
                tables / f"{name}.{adaptation}.json",
                partial(recognise.of_network, name, network, shown, adaptation, exchanges=exchanges),
            )
            told(rows, cameras)
            print(f"{name} {adaptation}: {seconds:.1f} s for {len(shown.items)} sequences")


if __name__ == "__main__":
    main()
