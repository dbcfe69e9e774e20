"""One reader per kind of file with motion capture, which its first bytes tell; each gives a `Capture`."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from dior.arrays import AnyPath
from dior.errors import DiorError
from dior.formats import MocapFormat
from dior.ingest.mocap_files import c3d, motive, qtm, trc
from dior.ingest.mocap_files.capture import Capture
from dior.project.plain_text import unmarked


@dataclass(frozen=True)
class Reader:
    """`read(path)` gives a `Capture` and raises ValueError or DiorError; `tool` is its name in messages; `begins`: the
    first bytes of its files, in any case; `rate` and `units`: what a file calls these; `described`: for people."""

    tool: str
    read: Callable[[AnyPath], Capture]
    begins: tuple[bytes, ...]
    rate: str
    units: str
    described: tuple[MocapFormat, ...]


# what is none of the others is said to be no C3D
C3D = "c3d"
READERS = {
    "qtm": Reader(
        "TSV of Qualisys Track Manager",
        qtm.read,
        (b"NO_OF_FRAMES", b"FILE_VERSION"),
        "FREQUENCY",
        "its unit",
        qtm.DESCRIPTIONS,
    ),
    "motive": Reader(
        "CSV of OptiTrack Motive",
        motive.read,
        (b"Format Version",),
        "its frame rate",
        "Length Units",
        motive.DESCRIPTIONS,
    ),
    "trc": Reader("TRC", trc.read, (b"PathFileType",), "DataRate", "Units", trc.DESCRIPTIONS),
    C3D: Reader("C3D", c3d.read, (), "POINT:RATE", "POINT:UNITS", c3d.DESCRIPTIONS),
}


def recognise(path: AnyPath) -> str:
    """The key in READERS of a file, by its first bytes. Raises DiorError for UTF-16."""
    with open(path, "rb") as stream:
        head = unmarked(stream.read(64), path).upper()
    return next(
        (key for key, reader in READERS.items() if head.startswith(tuple(word.upper() for word in reader.begins))), C3D
    )


def read(path: AnyPath) -> tuple[str, Capture]:
    """(key in READERS, what the file holds). Raises DiorError for a missing or broken file."""
    if not Path(path).is_file():
        raise DiorError(f"{path}: there is no such C3D; check `mocap` in sequences.tsv and `data_root`")
    try:
        kind = recognise(path)
        return kind, READERS[kind].read(path)
    except (OSError, ValueError) as error:
        raise DiorError(f"{path}: not a readable {READERS[kind].tool} ({error})") from None
