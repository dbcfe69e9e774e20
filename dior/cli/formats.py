"""`dior formats`: the files of other tools that dior reads.

OUTPUTS  standard output; what is said of a format stands in the module of its reader (`dior.formats`)
"""

import json
import shutil
import textwrap
from dataclasses import asdict, fields
from typing import Literal

from dior.calibrate.readers import files
from dior.formats import Format
from dior.ingest import containers, messages, mocap_files, picture_folders, readers, videos

# by the column of sequences.tsv or the section of a camera's YAML that names such files; pictures are messages of bags
KINDS: dict[str, tuple[Format, ...]] = {
    "bags": containers.DESCRIPTIONS,
    "messages": messages.DESCRIPTIONS,
    "videos": (*videos.DESCRIPTIONS, *picture_folders.DESCRIPTIONS),
    "calibrations": tuple(one for reader in files.READERS.values() for one in reader.described),
    "detections": tuple(one for reader in readers.READERS.values() for one in reader.described),
    "mocap": tuple(one for reader in mocap_files.READERS.values() for one in reader.described),
}
TITLES = {
    "bags": "Bags (`bags` in sequences.tsv)",
    "messages": "Messages in bags",
    "videos": "Videos and folders of pictures (`videos` in sequences.tsv)",
    "calibrations": "Calibrations (`intrinsics` and `reference` in a camera's YAML)",
    "detections": "Detections (`detections` in sequences.tsv)",
    "mocap": "Motion capture (`mocap` in sequences.tsv)",
}
# chosen: the width of a line where no terminal says it, and the most that reads well
WIDTH, WIDEST = 100, 120


def run(
    kind: Literal["bags", "messages", "videos", "calibrations", "detections", "mocap"] | None = None,
    *,
    as_json: bool = False,
) -> None:
    """Print the formats that are read: a line each, or all that is known of those of one kind.

    `kind`: bags, messages, videos, calibrations, detections or mocap, all that is known of it; `as_json`: print all
    that is known as JSON instead of text.
    """
    chosen = {name: found for name, found in KINDS.items() if kind in (None, name)}
    if as_json:
        found = {name: [asdict(one) for one in formats] for name, formats in chosen.items()}
        print(json.dumps(found, indent=1, ensure_ascii=False))
        return
    width = min(shutil.get_terminal_size((WIDTH, 0)).columns, WIDEST)
    print("\n\n".join((_listed if kind is None else _whole)(name, width) for name in chosen))
    if kind is None:
        print(f"\nAll that is known of a kind: dior formats {'|'.join(KINDS)}")


def _listed(kind: str, width: int) -> str:
    """A line for each format: its key and what it is."""
    rows = [[getattr(one, field.name) for field in fields(one)[:2]] for one in KINDS[kind]]
    left = max(len(key) for key, _ in rows) + 4
    return "\n".join([TITLES[kind], *(_filled(f"  {key}".ljust(left), about, width) for key, about in rows)])


def _whole(kind: str, width: int) -> str:
    """Every format with all that is known of it."""
    return "\n\n".join([TITLES[kind], *(_each(one, width) for one in KINDS[kind])])


def _each(one: Format, width: int) -> str:
    said = {name.replace("_", " "): value for name, value in asdict(one).items() if name != "key" and value}
    samples = said.pop("samples", ())
    said |= {"tried" if at == 0 else " " * at: "; ".join(dict.values(sample)) for at, sample in enumerate(samples)}
    left = 2 + max(map(len, said)) + 2
    return "\n".join([one.key, *(_filled(f"  {name}".ljust(left), value, width) for name, value in said.items())])


def _filled(before: str, text: str, width: int) -> str:
    return textwrap.fill(
        text,
        width,
        initial_indent=before,
        subsequent_indent=" " * len(before),
        break_long_words=False,
        break_on_hyphens=False,
    )
