"""The release signed: a signature of its list of checksums by a key of the lab's (`release.sign` in config.yaml).

INPUTS   SHA256SUMS of the release folder; config.yaml, which is read here, so that the place of the private key is in
         no parameter, log or output
OUTPUT   SHA256SUMS.sig beside it, as `ssh-keygen -Y sign` writes it (signature.py). Same release and key, same bytes.
"""

from pathlib import Path
from typing import Any

from dior.errors import DiorError
from dior.project.schema_check import check, read_yaml
from dior.release import checksums, signature
from dior.tables.files import written_whole


def run(*, release: Path, project: Path, signer: str, out: Path) -> None:
    """Sign the list of checksums of the folder `release`.

    `project`: the folder that holds config/; `signer`: the public key, "" to take whichever the config names. Raises
    DiorError where the config names no key or another one, or one that cannot sign.
    """
    config = read_yaml(project / "config/config.yaml", "config/config.yaml")
    key = key_of(project, check(config, "config", "config/config.yaml"))
    if key is None:
        raise DiorError("config/config.yaml: 'release.sign' names no key; it is read from the file, nowhere else")
    public = signature.public_key(key)
    if signer not in ("", public):
        raise DiorError("config/config.yaml: 'release.sign' names another key than when this run began; run again")
    sums = release / checksums.SUMS
    if not sums.is_file():
        raise DiorError(f"{sums}: there is no such file; build the release first")
    with written_whole(out) as part:
        part.write_bytes(signature.signed(sums.read_bytes(), key))


def key_of(project: Path, config: dict[str, Any]) -> Path | None:
    """The key that a config names, relative to the folder that holds config/ or below the home folder (~); None."""
    named = config["release"]["sign"]
    return project / Path(named).expanduser() if named else None
