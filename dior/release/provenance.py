"""What a walk was recorded as: the checksums of its recordings, so that a release can say what it was made from.

INPUTS   the recordings of a sequence: bags, videos, C3D, trigger log, detections; files, or folders of files
OUTPUT   results/provenance/<sequence>.json: SHA-256 and size by what each is for (`bag_1`, `video.cam01`, `mocap`,
         `detections.cam01`)

A file's name may tell a machine, a person or a date, so none is kept. The recordings are read once, when a sequence is
released for the first time, and not again because another is added.
"""

import hashlib
import json
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from dior.arrays import AnyPath
from dior.errors import DiorError
from dior.progress import reporting
from dior.release import checksums
from dior.tables import result_checksums
from dior.tables.files import write_text
from dior.tables.result_checksums import file_sha256


def run(*, sequence: str, recordings: dict[str, Path], out: Path) -> None:
    """Write the checksums of one sequence. `recordings`: paths by what they are for."""
    with ThreadPoolExecutor(checksums.THREADS) as pool:
        every = pool.map(lambda what: checksum_of(recordings[what], f"{sequence}, {what}"), recordings)
        found = dict(zip(recordings, reporting(every, len(recordings), "recordings hashed", sequence), strict=True))
    write_text(out, json.dumps(found, indent=1, sort_keys=True) + "\n")


def checksum_of(path: AnyPath, where: str) -> dict[str, str | int]:
    """`sha256` and `bytes` of a file; of a folder, of the list of its files' checksums, and all their bytes."""
    path = Path(path)
    if path.is_file():
        return {"sha256": file_sha256(path), "bytes": path.stat().st_size}
    if not path.is_dir():
        raise DiorError(f"{where}: {path} does not exist; correct config/sequences.tsv or bring it back")
    files = sorted(file for file in path.rglob("*") if file.is_file())
    lines = [f"{file_sha256(file)}  {file.relative_to(path).as_posix()}\n" for file in files]
    size = sum(file.stat().st_size for file in files)
    return {"sha256": hashlib.sha256("".join(lines).encode()).hexdigest(), "bytes": size}


def read(path: AnyPath) -> Any:
    """What `run` wrote."""
    try:
        return json.loads(result_checksums.read_text(path))
    except (OSError, ValueError) as error:
        raise DiorError(f"{path}: not readable ({error}); delete it and run again") from None
