"""The signature of a release: SHA256SUMS signed with a key of the lab's, by OpenSSH's `ssh-keygen -Y` (8.3 or later).

INPUTS   bytes of SHA256SUMS, a private key or one that an agent holds; to check it an allowed-signers file or public
         keys. OUTPUTS: the armoured signature; who made one
A signature is for NAMESPACE, so that one made for anything else is none.
Source: OpenSSH, PROTOCOL.sshsig and ssh-keygen(1)
"""

import os
import re
import shutil
import subprocess
import tempfile
from pathlib import Path

from dior.errors import DiorError

NAMESPACE = "dior-release"
# Types of keys whose signature of the same bytes is always the same: Ed25519 (RFC 8032), RSA (PKCS #1 v1.5, as
# PROTOCOL.sshsig wants it). ECDSA draws a random number, a security key counts.
DETERMINISTIC = ("ssh-ed25519", "ssh-rsa")
TYPES = re.compile(r"(sk-)?(ssh|ecdsa)-[a-z0-9@.-]+")
ANYBODY = "anybody"


def public_key(key: Path) -> str:
    """Type and base64 text of the public half of `key`: of the file beside it that ends in .pub, or of it itself.

    Raises DiorError where there is none, and for a type of key that signs differently each time.
    """
    path = key if key.suffix == ".pub" else Path(f"{key}.pub")
    try:
        words = path.read_text(encoding="utf-8").split()
    except (OSError, UnicodeDecodeError):
        words = []
    if len(words) < 2 or not TYPES.fullmatch(words[0]):
        raise DiorError(
            "config/config.yaml: beside the key that 'release.sign' names there is no public key that ends in .pub; "
            "correct the path, or write it with `ssh-keygen -y -f <key> > <key>.pub`"
        )
    if words[0] not in DETERMINISTIC:
        raise DiorError(
            f"config/config.yaml: the key that 'release.sign' names is of type {words[0]}, which signs the same "
            "release differently each time; take one of `ssh-keygen -t ed25519`, or sign by hand (docs/verifying.md)"
        )
    return " ".join(words[:2])


def signed(content: bytes, key: Path) -> bytes:
    """The armoured signature of `content`. Raises DiorError where the key cannot be used without asking somebody."""
    done = _ssh_keygen("sign", "-f", str(key), content=content)
    if done.returncode == 0 and done.stdout.startswith(b"-----BEGIN SSH SIGNATURE-----"):
        return done.stdout
    said = done.stderr.decode("utf-8", "replace")
    what = "config/config.yaml: the key that 'release.sign' names"
    if "passphrase" in said:
        raise DiorError(f"{what} has a passphrase, which no job can ask for; `ssh-add <key>` first, in the same shell")
    if "permissions" in said.lower():
        raise DiorError(f"{what} can be read by others, so that ssh-keygen does not take it; `chmod 600 <key>`")
    last = (said.strip().splitlines() or ["it said nothing"])[-1].replace(str(key), "<key>")
    raise DiorError(f"{what} is no private key, and no agent holds it (`ssh-add -l` lists them): {last}")


def signer(content: bytes, signature: bytes) -> str:
    """Fingerprint of the key that made a signature of `content`, whoever that is. Raises DiorError for no such one."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "sig"
        path.write_bytes(signature)
        done = _ssh_keygen("check-novalidate", "-s", str(path), content=content)
    found = re.search(r" key (\S+)", done.stdout.decode("utf-8", "replace"))
    if done.returncode == 0 and found:
        return found[1]
    said = done.stderr.decode("utf-8", "replace")
    if "incorrect signature" in said:
        raise DiorError("is not of this SHA256SUMS: one of them was changed after it was signed")
    if "namespace" in said:
        raise DiorError(f"was made for something else than a release (its namespace is not {NAMESPACE})")
    if "Couldn't parse signature" in said or "armor" in said:
        raise DiorError("is no signature of ssh-keygen; get it again")
    last = (said.strip().splitlines() or ["it said nothing"])[-1]
    raise DiorError(f"cannot be checked: ssh-keygen says: {last.replace(str(path), 'SHA256SUMS.sig')}")


def checked(content: bytes, signature: bytes, known: Path) -> str:
    """Who of `known` (an allowed-signers file, or public keys) signed `content`: "<name> (<fingerprint>)".

    Raises DiorError where it was none of them, and for a file that names none.
    """
    made_by = signer(content, signature)
    with tempfile.TemporaryDirectory() as folder:
        path, allowed = Path(folder) / "sig", Path(folder) / "allowed"
        path.write_bytes(signature)
        allowed.write_text("".join(f"{line}\n" for line in allowed_signers(known)), encoding="utf-8")
        named = _ssh_keygen("find-principals", "-f", str(allowed), "-s", str(path), content=b"", namespace=False)
        names = named.stdout.decode("utf-8", "replace").splitlines()
        if named.returncode or not names:
            said = named.stderr.decode("utf-8", "replace")
            why = "whose time there is over" if "expired" in said else "which is not in it"
            raise DiorError(f"is not by a key of {known}: it was made with {made_by}, {why}")
        done = _ssh_keygen("verify", "-f", str(allowed), "-I", names[0], "-s", str(path), content=content)
    if done.returncode:
        raise DiorError(f"is not by a key of {known} that may sign releases: it was made with {made_by}")
    return made_by if names[0] == ANYBODY else f"{names[0]} ({made_by})"


def allowed_signers(known: Path) -> list[str]:
    """The lines of an allowed-signers file, or lines of one that allows the public keys in a file.

    Raises DiorError for a file of something else.
    """
    try:
        lines = [line.strip() for line in known.read_text(encoding="utf-8").splitlines()]
    except OSError as error:
        raise DiorError(f"{known}: cannot be read ({error.strerror})") from None
    except UnicodeDecodeError:
        lines = ["no text"]
    lines = [line for line in lines if line and not line.startswith("#")]
    if any("PRIVATE KEY" in line for line in lines):
        raise DiorError(f"{known}: is a private key, which nobody else should have; give the public one, {known}.pub")
    keys = [line for line in lines if any(map(TYPES.fullmatch, line.split()[:-1]))]
    if not keys or len(keys) < len(lines):
        raise DiorError(
            f"{known}: is neither an allowed-signers file (`<name> ssh-ed25519 AAAA...`) nor a public key "
            "(`ssh-ed25519 AAAA...`)"
        )
    return [f"{ANYBODY} {' '.join(line.split()[:2])}" if TYPES.fullmatch(line.split()[0]) else line for line in keys]


def can_check() -> bool:
    """Whether this machine has ssh-keygen."""
    return shutil.which("ssh-keygen") is not None


def _ssh_keygen(what: str, *words: str, content: bytes, namespace: bool = True) -> "subprocess.CompletedProcess[bytes]":
    """Run `ssh-keygen -Y <what>` on `content`, without a terminal, so that it asks nobody for anything."""
    environment = {key: value for key, value in os.environ.items() if key not in ("DISPLAY", "SSH_ASKPASS")}
    command = ["ssh-keygen", "-Y", what, *(("-n", NAMESPACE) if namespace else ()), *words]
    try:
        done = subprocess.run(
            command,
            input=content,
            capture_output=True,
            check=False,
            start_new_session=True,
            env=environment | {"SSH_ASKPASS_REQUIRE": "never", "LC_ALL": "C"},
        )
    except FileNotFoundError:
        raise DiorError("ssh-keygen is not there; install OpenSSH (Debian: openssh-client) where this runs") from None
    if b"illegal option" in done.stderr or b"unknown option" in done.stderr:
        raise DiorError("ssh-keygen is older than 8.3 and knows no signatures of files; install a newer OpenSSH")
    return done
