"""What a change of each file re-runs: the files and tables that the steps' hashes cover (dior/tables/code_hash.py).

usage: python -m benchmarks.reruns [--write]      (--write: the table goes into docs/architecture.md)

A row holds the files that the same steps depend on; a folder stands for all files below it, `__init__.py` without
content are left out.
"""

import sys
from collections import defaultdict

from dior.project.steps import MODULES
from dior.tables.code_hash import PACKAGE, covered
from dior.tables.files import write_text

DOCS = PACKAGE.parent / "docs" / "architecture.md"
BEGIN, END = "<!-- python -m benchmarks.reruns --write -->\n", "<!-- end -->\n"


def steps_by_name():
    """Steps, in the workflow's order, by the file or `table <name>` that their hashes cover."""
    found = defaultdict(list)
    for step, module in MODULES.items():
        for name, _ in covered(module):
            if not (name.endswith("__init__.py") and (PACKAGE / name).stat().st_size == 0):
                found[name].append(step)
    return {name: tuple(steps) for name, steps in found.items()}


def table(found):
    """The rows of the table in Markdown, the files that most steps depend on first."""
    rows = defaultdict(list)
    for name, steps in found.items():
        rows[steps].append(name)
    lines = ["| a change of | re-runs | which |", "|---|---|---|"]
    for steps, names in sorted(rows.items(), key=lambda row: (-len(row[0]), row[1])):
        if len(steps) > 1:
            lines.append(f"| {', '.join(shortened(names, found))} | {len(steps)} | {_which(steps)} |")
    return "\n".join([*lines, "| any other file | 1 | the one step that it belongs to |"]) + "\n"


def shortened(names, found):
    """Names, in order; a folder of which all are there stands for two or more of them. Tables in italics."""
    whole = {}
    for name in found:
        folder = name.rpartition("/")[0]
        whole.setdefault(folder, []).append(name)
    words = []
    for name in sorted(names):
        folder = name.rpartition("/")[0]
        if folder and len(whole[folder]) > 1 and set(whole[folder]) <= set(names):
            words.append(f"`{folder}/`")
        else:
            words.append(f"*{name}*" if name.startswith("table ") else f"`{name}`")
    return list(dict.fromkeys(words))


def _which(steps):
    others = [step for step in MODULES if step not in steps]
    if not others:
        return "all"
    return ", ".join(steps) if len(steps) <= len(others) else f"all but {', '.join(others)}"


def main():
    text = table(steps_by_name())
    if "--write" not in sys.argv[1:]:
        print(text, end="")
        return
    before, _, rest = DOCS.read_text(encoding="utf-8").partition(BEGIN)
    write_text(DOCS, before + BEGIN + text + END + rest.partition(END)[2])


if __name__ == "__main__":
    main()
