"""Pages of the documentation site out of the docstrings, one per module; run by mkdocs (plugin gen-files)."""

from pathlib import Path

import mkdocs_gen_files

nav = mkdocs_gen_files.Nav()
for path in sorted(Path("dior").rglob("*.py")):
    parts = path.with_suffix("").parts
    if parts[-1] in ("__init__", "__main__"):
        continue
    page = Path(*parts[1:]).with_suffix(".md")
    nav[parts[1:]] = page.as_posix()
    with mkdocs_gen_files.open(Path("reference", page), "w") as stream:
        stream.write(f"::: {'.'.join(parts)}\n")
with mkdocs_gen_files.open("reference/SUMMARY.md", "w") as stream:
    stream.writelines(nav.build_literate_nav())
