"""One tarball per subject, so that a person's data can be given out, or taken back, on its own.

INPUTS   a release folder (see package.py) and a pseudonym
OUTPUT   results/release/dior-<version>-<pseudonym>.tar: the subject's labels, skeletons and frames and the files about
         the whole release (card, cameras, sheets, figures, checksums), below dior-<version>/. Unpacked over each
         other the tarballs of all subjects are the release. Plain tar: Parquet is compressed already.
"""

import tarfile
from pathlib import Path

from dior.errors import DiorError, nearest
from dior.files import written_whole
from dior.release.package import SUMS


def run(*, release, subject, out):
    """Pack what belongs to `subject` (a pseudonym) of the folder `release`. Same release, same bytes.

    Raises DiorError for a subject that is not in the release and for a file of SHA256SUMS that is gone.
    """
    release = Path(release)
    names = members(release, subject)
    with written_whole(out) as part, tarfile.open(part, "w", format=tarfile.PAX_FORMAT) as tar:
        for name in names:
            _add(tar, release / name, f"{release.name}/{name}")


def members(release, subject):
    """Paths in the release, sorted, that the tarball of `subject` holds."""
    sums = Path(release) / SUMS
    if not sums.is_file():
        raise DiorError(f"{sums}: there is no such file; build the release first")
    listed = [line.split("  ", 1)[1] for line in sums.read_text(encoding="utf-8").splitlines()]
    subjects = sorted({name.split("/")[1] for name in listed if "/" in name})
    if subject not in subjects:
        raise DiorError(f"{release}: subject '{subject}' is not in the release{nearest(subject, subjects)}")
    return sorted([SUMS, *(name for name in listed if "/" not in name or name.split("/")[1] == subject)])


def _add(tar, path, name):
    """Append a file with nothing of its owner, time or rights."""
    if not path.is_file():
        raise DiorError(f"{path}: listed in {SUMS} but gone; build the release again")
    entry = tarfile.TarInfo(name)
    entry.size, entry.mode = path.stat().st_size, 0o644
    with open(path, "rb") as stream:
        tar.addfile(entry, stream)
