"""A new project folder for recordings of one's own.

INPUTS: the templates of `dior/project/templates/` and the columns of the sheets' schemas. OUTPUTS: `<folder>/config/`
with config.yaml, the sheets with headers only, and one commented session with one commented camera.
"""

import os
import shlex
from pathlib import Path

from dior.errors import DiorError
from dior.project.schema_check import columns_of
from dior.tables.files import write_text

TEMPLATES = Path(__file__).parent / "templates"
SESSION, CAMERA = "session_01", "cam01"


def run(folder: Path) -> None:
    """Write the config of a new project into `folder` and print what to do next.

    `folder`: it may be there, its config not.
    Raises DiorError where there is a config already: what a person wrote is never overwritten.
    """
    if not folder.name and folder == Path():
        raise DiorError("name the folder of the new project, such as ../my_capture")
    check_folder(folder)
    if (folder / "config").exists():
        raise DiorError(f"{folder / 'config'} exists already; choose another folder or remove it first")
    for path, text in contents().items():
        write_text(folder / "config" / path, text)
    print(
        f"Wrote {folder / 'config'}. Fill in sequences.tsv, subjects.tsv and sessions/{SESSION} (a file per camera), "
        f"then type\n  dior run {shlex.quote(str(folder.resolve()))}"
    )


def check_folder(folder: Path) -> None:
    """Raise DiorError where a project's folder, or its config, cannot be made: a file is in its place."""
    for path in (folder, folder / "config"):
        found = next((one for one in (path, *path.parents) if os.path.lexists(one)), path)
        if os.path.lexists(found) and not os.path.isdir(found):
            what = "a link to nothing" if not os.path.exists(found) else "a file"
            raise DiorError(f"{found}: is {what}, and a project is a folder; choose another name, or move it away")


def contents() -> dict[str, str]:
    """Text by path below config/ of what a new project holds."""
    template = {path.name: path.read_text(encoding="utf-8") for path in sorted(TEMPLATES.glob("*.yaml"))}
    return {
        "config.yaml": template["config.yaml"],
        "sequences.tsv": header("sequences"),
        "subjects.tsv": header("subjects", "consent_pictures"),
        "gallery.tsv": header("gallery", "path"),
        "detectors.tsv": header("detectors"),
        f"sessions/{SESSION}/session.yaml": template["session.yaml"],
        f"sessions/{SESSION}/{CAMERA}.yaml": template["camera.yaml"],
    }


def header(kind: str, *more: str) -> str:
    """The first line of a sheet: the columns that every project needs, and `more`."""
    return "\t".join((*columns_of(kind), *more)) + "\n"
