"""Running the real Snakemake on a project folder, and reading what it says."""

import os
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
# the checkout goes before a package that is installed
ENVIRONMENT = os.environ | {"PYTHONPATH": os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])}


def command(project, words, root):
    """Arguments of `subprocess` for Snakemake with the code of the checkout `root`."""
    base = [sys.executable, "-m", "snakemake", "-j2", "--snakefile", root / "Snakefile", "--directory", project]
    base += ["--workflow-profile", ROOT / "profiles/plain"]
    return {
        "args": [str(word) for word in (*base, *words)],
        "env": os.environ | {"PYTHONPATH": str(root)},
        "cwd": root,
        "text": True,
    }


def start(project, *words, root=ROOT):
    """Start the workflow as a process group of its own."""
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    return subprocess.Popen(**command(project, words, root), **quiet, start_new_session=True)


def snakemake(project, *words, root=ROOT, check=True):
    """Run the workflow of the checkout `root` in a project folder; returns its exit code and what it printed."""
    done = subprocess.run(**command(project, words, root), capture_output=True)
    text = done.stdout + done.stderr
    if check and done.returncode:
        raise AssertionError(f"snakemake {' '.join(map(str, words))} ended with {done.returncode}:\n{text[-6000:]}")
    return done.returncode, text


def planned(project, *words, root=ROOT):
    """Jobs by rule that a run would do now, from a dry run."""
    _, text = snakemake(project, "-n", *words, root=root)
    stats = text.split("Job stats:")[1].split("total")[0] if "Job stats:" in text else ""
    jobs = {rule: int(count) for rule, count in re.findall(r"^(\w+) +(\d+)$", stats, re.MULTILINE)}
    return {rule: count for rule, count in jobs.items() if rule != "all"}


def edit(path, old, new):
    """Replace the first `old` in a file; it must be there."""
    text = path.read_text()
    assert old in text, f"{old!r} is not in {path}"
    path.write_text(text.replace(old, new, 1))


def nudge(path, key, by=0.05):
    """Add to the number after `key:` in a YAML file."""
    text = path.read_text()
    changed = re.sub(rf"(?<={key}: )-?[0-9.]+", lambda found: f"{float(found[0]) + by:.3f}", text, count=1)
    assert changed != text, f"{key} is not in {path}"
    path.write_text(changed)
