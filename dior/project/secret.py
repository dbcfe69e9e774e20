"""A key of the project, and digests that nobody can guess from without it.

INPUTS   <project>/.dior_key, 32 random bytes as hexadecimal digits, which the first run writes
OUTPUTS  digests of what is in the sheets, for the parameters of rules that have to run again when it changes

Snakemake keeps parameters in its records and prints them in its logs. Heights and rows of sheets can be guessed, so a
plain hash of them tells what they are. The key lies neither beside the digests (.snakemake/) nor in what people
version and publish (config/). Without it every rule with such a parameter runs once more, nothing else.
"""

import hashlib
import hmac
import json
import os
import re
import secrets
from pathlib import Path
from typing import Any

from dior.errors import DiorError
from dior.paths import AnyPath

FILE = ".dior_key"
BYTES = 32


def key_of(root: AnyPath) -> str:
    """The key of the project in `root`, a new one where it has none. Raises DiorError for a file that holds no key."""
    path = Path(root) / FILE
    if not path.exists():
        return secrets.token_hex(BYTES)
    key = path.read_text(encoding="ascii", errors="replace").strip()
    if not re.fullmatch(rf"[0-9a-f]{{{2 * BYTES}}}", key):
        raise DiorError(f"{path}: this is no key of {2 * BYTES} hexadecimal digits; delete the file, a new one is made")
    return key


def keep(root: AnyPath, key: str) -> None:
    """Write the key of the project in `root` where it has none: to be read by its owner only."""
    try:
        file = os.open(Path(root) / FILE, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    except FileExistsError:
        return
    with os.fdopen(file, "w", encoding="ascii") as stream:
        stream.write(key + "\n")


def digest(key: str, value: Any) -> str:
    """What a value, of what JSON knows, is with this key: 32 hexadecimal digits."""
    text = json.dumps(value, sort_keys=True)
    return hmac.new(bytes.fromhex(key), text.encode(), hashlib.sha256).hexdigest()[:32]
