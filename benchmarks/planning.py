"""How long Snakemake plans: CPU seconds of `snakemake -n` for projects of more and more walks, with nothing made yet.

usage: python -m benchmarks.planning [WALKS ...]      (default: 28 56 112; every second one is outdoors)
"""

import os
import re
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

from dior.simulate import config, settings

ROOT = Path(__file__).resolve().parents[1]
# shorter than a real walk: only files are named
WALK = {"sequences": 1, "duration_s": 2.0}


def planned(walks):
    """(jobs, CPU seconds) of a dry run of everything."""
    with tempfile.TemporaryDirectory() as folder:
        config.write(settings.from_dict({"subjects": walks // 2, **WALK}), Path(folder) / "config")
        plain = ["--workflow-profile", "profiles/plain", "--directory", folder]
        command = [sys.executable, "-m", "snakemake", "-n", "all", "release", *plain]
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        done = subprocess.run(
            command, cwd=ROOT, check=True, env=os.environ | {"PYTHONPATH": str(ROOT)}, capture_output=True, text=True
        )
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
    jobs = int(re.findall(r"^total +(\d+)$", done.stdout + done.stderr, re.MULTILINE)[0])
    return jobs, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main():
    print("walks  jobs  CPU s  ms per job")
    for walks in map(int, sys.argv[1:] or ("28", "56", "112")):
        jobs, seconds = planned(walks)
        print(f"{walks:5d}  {jobs:4d}  {seconds:5.1f}  {1000 * seconds / jobs:10.1f}", flush=True)


if __name__ == "__main__":
    main()
