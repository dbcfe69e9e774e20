"""How long Snakemake plans, what a fix costs, and the longest chain of jobs.

usage: python -m benchmarks.planning [WALKS ...]           (default: 28 56 112; every second one is outdoors)
       python -m benchmarks.planning fixes RAN [WALKS]     (default: 112)
       python -m benchmarks.planning chain RAN

The first form prints the CPU seconds of `snakemake -n`, with nothing made yet.

`fixes`: in a finished project of so many walks, eight in a session, one thing is mended: the jobs of the next run, the
CPU seconds that they take, and those in which Snakemake plans them. The project is of empty files, marked as made; what
a job takes is what jobs of its step, indoors or outdoors, took on average in RAN, a finished run of a simulated capture
with as many pictures a walk as yours. Jobs about all walks (metrics, statistics, report) count as in RAN:
`benchmarks.report` has the report of many. A release is not made again: `heads` and `pixels` are not counted.

`chain`: of RAN, for each walk, the jobs that wait for each other until its labels, and its page, are there, and their
CPU seconds: on no number of cores is it faster. The simulation counts nothing.
"""

import json
import os
import re
import resource
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from dior.evaluate.timing import NOT_COUNTED
from dior.project import project
from dior.simulate import config, settings

ROOT = Path(__file__).resolve().parents[1]
# shorter than a real walk: only files are named
WALK = {"sequences": 1, "duration_s": 2.0}
# chosen: four people, who walk twice
IN_A_SESSION = 8
DEAREST = 4
PAGE = "results/report/sequences/{}.html"


def snakemake(folder, *words, root=ROOT):
    """What Snakemake prints in a project folder, with the code of the checkout `root`, and its CPU seconds."""
    plain = ["--workflow-profile", "profiles/plain", "--cores", "2", "--directory", folder]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(
        [sys.executable, "-m", "snakemake", *words, *plain], cwd=root, check=True,
        env=os.environ | {"PYTHONPATH": str(root)}, capture_output=True, text=True,
    )  # fmt: skip
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return done.stdout + done.stderr, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def planned(walks):
    """(jobs, CPU seconds) of a dry run of everything."""
    with tempfile.TemporaryDirectory() as folder:
        config.write(settings.from_dict({"subjects": walks // 2, **WALK}), Path(folder) / "config")
        text, seconds = snakemake(folder, "-n", "all", "release")
    return int(re.findall(r"^total +(\d+)$", text, re.MULTILINE)[0]), seconds


@dataclass(frozen=True)
class Job:
    """A job of the workflow: its step, what it is about (`lab.cam02`, `indoor_01`), its files."""

    step: str
    unit: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]

    @property
    def kind(self):
        """The jobs of a kind take about the same: step, and `indoor`, `outdoor`, `lab`, `field`."""
        return self.step, re.match("[a-z]*", self.unit)[0]


def summary(folder):
    """(output, log, inputs) of each file that leads to the report; of what has not run yet the output alone is told."""
    lines = snakemake(folder, "--detailed-summary", "all")[0].splitlines()
    rows = [line.split("\t") for line in lines]
    return [(row[0], row[3], row[4]) for row in rows if len(row) == 8 and row[0] != "output_file"]


def jobs_of(folder):
    """All jobs of a finished project."""
    found = {}
    for output, log, inputs in summary(folder):
        if about := re.fullmatch(r"logs/(\w+)/(\S+)\.log", log):
            found.setdefault(about.groups(), (inputs.split(","), []))[1].append(output)
    return [Job(*about, tuple(inputs), tuple(outputs)) for about, (inputs, outputs) in found.items()]


def make_as_if_run(folder):
    """Make the empty results of a project, and have Snakemake note that they are up to date."""
    for output, _, _ in summary(folder):
        path = folder / output
        (path.parent if path.suffix else path).mkdir(parents=True, exist_ok=True)
        if path.suffix:
            path.touch()
    snakemake(folder, "--touch", "all")


def edit(path, old, new):
    """Replace the first place that a pattern fits; there has to be one."""
    text, count = re.subn(old, new, path.read_text(), count=1)
    assert count, f"{old!r} is not in {path}"
    path.write_text(text)


# what is mended -> how, in a project folder; the first walk and its person are those of the marks, which fix the poses
FIXES = {
    "a mark of an indoor camera": lambda at: edit(at / "config/sessions/lab/cam02.marks.csv", r"\n[^\n]+\n$", "\n"),
    "the tape of a long-range camera": lambda at: edit(
        at / "config/sessions/field/cam04.yaml", r"(sigma_m: \[?)[0-9.]+", r"\g<1>0.4"
    ),
    "the tape of a close camera": lambda at: edit(
        at / "config/sessions/field/cam01.yaml", r"(sigma_m: \[?)[0-9.]+", r"\g<1>0.07"
    ),
    "the clock of a camera in a walk": lambda at: write_offset(at / "config/offsets/indoor_02.yaml"),
    "triangulate.max_error_px": lambda at: edit(at / "config/config.yaml", r"(max_error_px: )[0-9.]+", r"\g<1>30.0"),
    "a person withdraws": lambda at: edit(at / "config/subjects.tsv", r"yes\tyes(?=\s*$)", "no\tno"),
}
CODE = "dior/label/uncertainty.py"


def write_offset(path):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("cam02: {offset_s: 0.45, sigma_s: 0.01}\n")


@contextmanager
def mended(folder, fix):
    """The project with something mended, and afterwards as before, with the times of its files."""
    aside = folder / "config.before"
    shutil.copytree(folder / "config", aside)
    fix(folder)
    yield
    shutil.rmtree(folder / "config")
    aside.rename(folder / "config")


def other_code():
    """A checkout in which the code of one module is another."""
    folder = Path(tempfile.mkdtemp(prefix="dior-code-"))
    for name in ("dior", "workflow", "profiles"):
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "Snakefile", folder)
    with open(folder / CODE, "a") as stream:
        stream.write("\n\nANOTHER = 1\n")
    return folder


def costs(ran):
    """CPU seconds of a finished run: by job (step, unit)."""
    found = {}
    for path in sorted((ran / "logs").glob("*/*.timing.json")):
        step, unit = path.parent.name, path.name.removesuffix(".timing.json")
        found[step, unit] = 0.0 if step in NOT_COUNTED else json.loads(path.read_text())["cpu_s"]
    return found


def means(ran):
    """CPU seconds that a job takes, by step and kind, and by step alone."""
    each = {}
    for (step, unit), seconds in costs(ran).items():
        for kind in (Job(step, unit, (), ()).kind, (step, "")):
            each.setdefault(kind, []).append(seconds)
    return {kind: sum(seconds) / len(seconds) for kind, seconds in each.items()}


def fixed(folder, taken, root=ROOT):
    """[jobs, their CPU seconds, CPU seconds until they are known, the dearest steps] of what a run would do now."""
    text, seconds = snakemake(folder, "-n", "all", root=root)
    steps = Counter()
    jobs = [Job(*about, (), ()) for about in re.findall(r"^ +log: logs/(\w+)/(\S+)\.log", text, re.MULTILINE)]
    for job in jobs:
        steps[job.step] += taken.get(job.kind, taken.get((job.step, ""), 0.0))
    counted = Counter(job.step for job in jobs)
    dearest = ", ".join(f"{step} {counted[step]} in {took:.0f}" for step, took in steps.most_common(DEAREST))
    return len(jobs), sum(steps.values()), seconds, dearest


def fixes(ran, walks):
    """Print what each fix costs."""
    taken, row = means(ran), "{:<36}{:>6}{:>8}{:>11}  {}"
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        days = max(walks // 2 // IN_A_SESSION, 1)
        made = settings.from_dict({"subjects": walks // 2, "sessions": days, **WALK})
        config.write(made, folder / "config")
        make_as_if_run(folder)
        print(f"{walks} walks in {2 * days} sessions, all made: {fixed(folder, taken)[0]} jobs left")
        print(row.format("what is mended", "jobs", "CPU s", "planned, s", "the dearest steps: jobs in CPU s"))
        for what, fix in FIXES.items():
            with mended(folder, fix):
                jobs, took, seconds, dearest = fixed(folder, taken)
            print(row.format(what, jobs, f"{took:.0f}", f"{seconds:.1f}", dearest), flush=True)
        code = other_code()
        jobs, took, seconds, dearest = fixed(folder, taken, code)
        print(row.format(CODE, jobs, f"{took:.0f}", f"{seconds:.1f}", dearest))
        shutil.rmtree(code)


def longest(jobs, taken, last):
    """The jobs that wait for each other until the file `last` is there, the longest such chain by CPU seconds."""
    maker = {path: job for job in jobs for path in job.outputs}
    known = {}

    def until(job):
        """(CPU seconds until it has ended, the chain)."""
        if job not in known:
            before = [until(maker[path]) for path in job.inputs if path in maker]
            seconds, chain = max(before, key=lambda one: one[0], default=(0.0, ()))
            known[job] = seconds + taken.get((job.step, job.unit), 0.0), (*chain, job)
        return known[job]

    return until(maker[last])[1]


def chain(ran):
    """Print the longest chain of each walk."""
    found, jobs, taken = project.load(ran), jobs_of(ran), costs(ran)
    for what, file in (("labels", found.label_tables), ("page", lambda walk: [PAGE.format(walk)])):
        print(f"{'walk':<12}{'CPU s':>7}  the longest chain until its {what}")
        for walk in found.sequences:
            own = longest(jobs, taken, file(walk)[-1])
            told = [(job.step, taken.get((job.step, job.unit), 0.0)) for job in own if job.step not in NOT_COUNTED]
            words = ", ".join(f"{step} {seconds:.1f}" for step, seconds in told)
            print(f"{walk:<12}{sum(seconds for _, seconds in told):>7.1f}  {words}")


def main():
    words = sys.argv[1:]
    if words[:1] == ["fixes"]:
        fixes(Path(words[1]), int(words[2]) if len(words) > 2 else 112)
        return
    if words[:1] == ["chain"]:
        chain(Path(words[1]))
        return
    print("walks  jobs  CPU s  ms per job")
    for walks in map(int, words or ("28", "56", "112")):
        jobs, seconds = planned(walks)
        print(f"{walks:5d}  {jobs:4d}  {seconds:5.1f}  {1000 * seconds / jobs:10.1f}", flush=True)


if __name__ == "__main__":
    main()
