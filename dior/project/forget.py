"""What is left of sequences and people that the project no longer has: named, and deleted when a person says so.

INPUTS   a project's sheets, results/, logs/ and .snakemake/
OUTPUTS  lines on standard output; with `yes` the files are gone
A run of the workflow makes nothing of them any more and leaves them out of the report and of the release, but what was
made of each sequence is kept where it is until then, and so are releases of other versions and their tarballs, and what
Snakemake noted. Of what is about all it is told by the record that it was made of somebody who is gone; a run makes it
anew, unless nothing asks for it any more.
What people wrote (config/) and the recordings are only named: they are nobody's output.
"""

import binascii
import os
import re
import shutil
from base64 import b64decode
from collections.abc import Iterable, Iterator
from pathlib import Path

from dior.errors import DiorError
from dior.paths import AnyPath
from dior.project import bumps, running
from dior.project.consent import consents, processed
from dior.project.contents import bags_of
from dior.project.project import sheets
from dior.project.steps import MODULES
from dior.tables import result_checksums

# folders of a step whose entries are named by sequence, as those of the step itself
INSIDE = {
    "simulate": ("truth", "gallery"),
    "evaluate": ("to_mark", "checks", "boxes"),
    "report": ("assets", "sequences"),
}
# what is made of all sequences together, by its name without a suffix; besides that of the step
OF_ALL = {
    "evaluate": ("metrics", "statistics", "to_mark"),
    "reid": ("index", "plots", "table", "cmc", "left_out"),
    "report": ("index", "cost", "verdict", "history", "compared", "plots", "viewer"),
    "tarballs": ("metadata",),
}
SUMS, RELEASES = "SHA256SUMS", Path("results/release")
RECORDS = (".snakemake/metadata", ".snakemake/incomplete")
# what Snakemake writes besides: of whole runs, and of jobs that were killed
NOTES = ("logs", ".snakemake/log", ".snakemake/scripts", ".snakemake/auxiliary", ".snakemake/iocache")
# paths of outputs and logs in a text
PATHS = re.compile(r"(?:results|logs)/[A-Za-z0-9_@./-]+")
# a pattern that finds nothing
NOWHERE = r"(?!)"
GALLERY = "config/gallery.tsv"
# a person may have begun to fill it in: only what it has of those who are gone is deleted
BY_HAND = Path("results/evaluate/to_mark")


class Known:
    """The names that a project has: `units` (sequences and sessions) and of the released ones `walks`, (pseudonym,
    sequence) pairs; `pseudonyms`: of these; `withheld`: rows of the sequences of people who may not be processed;
    `left_out`: the names of these people in the sheet; `gone`: those, but for numbers and single letters, and their
    pseudonyms.
    """

    def __init__(self, root: Path) -> None:
        (rows, _), (people, _) = sheets(root)
        rows, self.withheld = processed(bumps.in_parts(root, rows), people)
        self.units = {*rows, *(row["session"] for row in rows.values())}
        left_out = [row for row in people.values() if not consents(row, "processing")]
        self.left_out = {row["subject"] for row in left_out}
        words = {row[key] for row in left_out for key in ("subject", "pseudonym")}
        self.gone = {word for word in words if _is_name(word)}
        agreed = {name: row["pseudonym"] for name, row in people.items() if consents(row)}
        self.walks = {
            (agreed[row["subject"]], name)
            for name, row in rows.items()
            if row["subject"] in agreed and not row["exclude_reason"]
        }
        self.pseudonyms = {who for who, _ in self.walks}


def _is_name(word: str) -> bool:
    """Whether a word can be looked for in a text: a number or a letter is anywhere."""
    return len(word) > 1 and not word.isdigit()


def run(*, project: Path = Path("."), yes: bool = False) -> None:
    """List, and with `yes` delete, what is left in the project's folder of what it no longer has.

    `project`: folder that holds config/; `yes`: delete what is listed.
    """
    root = project
    if not (root / "config").is_dir():
        raise DiorError(f"{root}: is no project (there is no config/ in it); give --project the folder that holds it")
    known = Known(root)
    tells = _Telling(known)
    found = [*left(root, known), *_made_of(root, tells), *_notes(root, tells)]
    found = sorted(dict.fromkeys(found))
    for path in found:
        print(path)
    if not found:
        print("Nothing is left in results/ and logs/ of sequences or people that the project does not have.")
    elif yes:
        if who := running.at_work(root):
            raise DiorError(f"{who}; what it is making now would be deleted, so forget when it has ended")
        for path in found:
            _delete(root / path)
        print(f"Deleted {len(found)} files and folders.")
    else:
        print(
            f"{len(found)} files and folders, of sequences or people that the project does not have. Nothing was "
            "deleted: --yes does it. Run the workflow first, so that the report and the release hold them no longer."
        )
    by_hand = _by_people(root, known)
    if by_hand:
        print("Recordings and hand-made files about people who may not be processed; dior deletes none of these:")
        print(*(f"  {path}" for path in by_hand), sep="\n")


def left(root: AnyPath, known: "Known | None" = None) -> list[Path]:
    """Files and folders below results/ and logs/, relative to `root`, of what the project does not have."""
    root = Path(root)
    known = known or Known(root)
    found: list[Path] = []
    for step in MODULES:
        for folder in (Path("results", step), Path("logs", step), Path("results", result_checksums.FOLDER, step)):
            found += _strays(root, folder, known)
    return [*found, *_releases(root, known)]


def _strays(root: Path, folder: Path, known: Known) -> list[Path]:
    found = []
    for entry in sorted(os.listdir(root / folder)) if (root / folder).is_dir() else ():
        path = folder / entry
        if _is_stray(path.parts, known):
            found.append(path)
        elif entry in INSIDE.get(_noted(path.parts)[1], ()) and (root / path).is_dir():
            found += _strays(root, path, known)
    return found


def _is_stray(parts: tuple[str, ...], known: Known) -> bool:
    unit = _unit(parts)
    return unit is not None and unit not in known.units and unit not in known.pseudonyms


def _noted(parts: tuple[str, ...]) -> tuple[str, ...]:
    """The path of the result that a path in the list of checksums tells of; any other path as it is."""
    return parts[:1] + parts[2:] if parts[1:2] == (result_checksums.FOLDER,) else parts


def _unit(parts: tuple[str, ...]) -> str | None:
    """The sequence, session or person that an output or a log is about; None where it is about all."""
    parts = _noted(parts)
    if len(parts) < 3 or parts[0] not in ("results", "logs") or parts[1] not in MODULES:
        return None
    step, rest = parts[1], [part for part in parts[2:] if part != ".snakemake_timestamp"]
    while rest and rest[0] in INSIDE.get(step, ()):
        rest = rest[1:]
    # what a killed job was writing begins with a dot
    unit = rest[0].lstrip(".").split(".")[0] if rest else ""
    return None if unit in ("", step, *OF_ALL.get(step, ())) else unit


def _releases(root: Path, known: Known) -> list[Path]:
    """Releases, with what was made of them, that hold somebody who is not released now, and tarballs of such people."""
    if not (root / RELEASES).is_dir():
        return []
    entries = sorted(os.listdir(root / RELEASES))
    folders = [name for name in entries if (root / RELEASES / name / SUMS).is_file() and not name.startswith(".")]
    versions = [name for name in folders if not name.endswith("-exports")]
    stale = {name for name in versions if not _walks(root / RELEASES / name) <= known.walks}
    found = []
    for name in entries:
        # what is half made begins with a dot
        plain = name.lstrip(".")
        version = max((v for v in versions if plain == v or plain.startswith(f"{v}-")), key=len, default=None)
        whose = {*known.pseudonyms, "metadata"} if plain == name else known.pseudonyms
        rest = plain.removeprefix(f"{version}-").rpartition(".")[0].removesuffix(".part")
        kept = version and version not in stale and (name in folders or rest in whose)
        if not kept:
            found.append(RELEASES / name)
    return found


def _walks(release: Path) -> set[tuple[str, str]]:
    """(pseudonym, sequence) of the labels of a release."""
    listed = (line.split("  ", 1)[1] for line in (release / SUMS).read_text(encoding="utf-8").splitlines())
    parts = [name.split("/") for name in listed if name.startswith("labels_2d/")]
    return {(who, file.split(".")[0]) for _, who, file in parts}


class _Telling:
    """Whether a text tells of somebody who is gone: by a name that the sheets still have, or by the path of an output
    that the project does not have any more.
    """

    def __init__(self, known: Known) -> None:
        self.known = known
        self.words = _naming({*known.gone, *filter(_is_name, known.withheld)})
        # a record has names in quotes, and after a flag; anywhere else a name may be a word of dior's own
        self.quoted = _naming(known.gone, r"""(?<=["'])""", r"""(?=[\\"'])""")
        self.typed = _naming(known.gone, r"--[\w-]+ ", r"""(?=[\s"'])""")

    def text(self, text: str) -> bool:
        return bool(self.words.search(text)) or self._paths(text)

    def record(self, text: str) -> bool:
        return bool(self.quoted.search(text) or self.typed.search(text)) or self._paths(text)

    def _paths(self, text: str) -> bool:
        return any(self.path(path) for path in set(PATHS.findall(text)))

    def path(self, path: str) -> bool:
        """Whether an output or a log is about what the project does not have; in a release a person's folder tells."""
        parts = Path(path).parts
        if parts[:2] != RELEASES.parts:
            return _is_stray(parts, self.known)
        # results/release/<version>/<table>/<pseudonym>/<sequence>[.<camera>].parquet
        of_walk = len(parts) == 6 and parts[5].endswith(".parquet")
        return of_walk and (parts[4], parts[5].split(".")[0]) not in self.known.walks


def _made_of(root: Path, tells: _Telling) -> list[Path]:
    """Snakemake's records of outputs that are not there or were made of somebody who is gone; and these outputs."""
    records = list(_records(root))
    lost = {path for path, output in records if tells.path(output) or not os.path.lexists(root / output)}
    kept = {output: path for path, output in records if path not in lost and path.parts[1] == "metadata"}
    stale: set[str] = set()
    more = {output for output, path in kept.items() if tells.record(_text(root / path))}
    while more:
        stale |= more
        # what was made of a stale output is stale, too: what is up to date has other inputs
        quoted = re.compile("|".join(f'"{re.escape(output)}"' for output in more))
        more = {output for output in kept.keys() - stale if quoted.search(_text(root / kept[output]))}
    return [*lost, *(kept[output] for output in stale), *(Path(output) for output in stale if _is_made(output))]


def _is_made(output: str) -> bool:
    """Whether an output may be deleted as a whole. The release's own files are judged by `_releases`."""
    path = Path(output)
    return path.parts[0] == "results" and path.parts[1:2] != RELEASES.parts[1:] and path != BY_HAND


def _records(root: Path) -> Iterator[tuple[Path, str]]:
    """Snakemake's records, relative to `root`, with the output that each is about."""
    for folder in filter(lambda folder: (root / folder).is_dir(), map(Path, RECORDS)):
        for path in sorted(path for path in (root / folder).rglob("*") if path.is_file()):
            coded = "".join(part.removeprefix("@") for part in path.relative_to(root / folder).parts)
            yield path.relative_to(root), _decoded(coded)


def _decoded(name: str) -> str:
    try:
        return b64decode(name, altchars=b"-_", validate=False).decode()
    except (binascii.Error, UnicodeDecodeError):
        return ""


def _notes(root: Path, tells: _Telling) -> list[Path]:
    """Logs of steps and of whole runs, and what killed jobs left, that tell of somebody who is gone."""
    folders = [root / folder for folder in NOTES]
    files = sorted(path for folder in folders if folder.is_dir() for path in folder.rglob("*") if path.is_file())
    return [path.relative_to(root) for path in files if tells.text(_text(path))]


def _text(path: Path) -> str:
    return path.read_text(encoding="utf-8", errors="replace")


def _naming(names: Iterable[str], before: str = r"(?<![\w-])", after: str = r"(?![\w-])") -> re.Pattern[str]:
    """What finds one of some names in a text, as a word of its own or between what `before` and `after` say."""
    words = "|".join(map(re.escape, sorted(names)))
    return re.compile(f"{before}(?:{words}){after}" if words else NOWHERE)


def _by_people(root: Path, known: Known) -> list[str]:
    """Recordings of the withheld sequences, and files in config/ that name one of these, as far as they are there."""
    from dior.project.schema_check import read_sheet, read_yaml

    data = Path(read_yaml(root / "config/config.yaml").get("data_root", "data"))
    recordings = set()
    for row in known.withheld.values():
        patterns = (row[column].partition("{")[0] for column in ("detections", "videos", "stamps"))
        files = [*bags_of(row), row["mocap"], *patterns, row["trigger_log"].partition("#")[0]]
        recordings |= {str(data / path) for path in files if path and path != "detect"}
    if (root / GALLERY).is_file():
        rows, _ = read_sheet(root / GALLERY, "gallery", ("subject", "outfit", "angle"), GALLERY)
        recordings |= {str(data / row["path"]) for row in rows.values() if row["subject"] in known.left_out}
    there = [path for path in sorted(recordings) if (root / path).exists() and not path.startswith("results/")]
    named = _naming({*known.withheld, *known.gone})
    for path in sorted((root / "config").rglob("*")):
        if not path.is_file() or path.name in ("sequences.tsv", "subjects.tsv"):
            continue
        if named.search(path.name) or named.search(_text(path)):
            there.append(str(path.relative_to(root)))
    return there


def _delete(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)
