"""A release is signed by a key of the lab's, and whoever has the public one can tell."""

import os
import shutil
import subprocess

import pytest
import yaml

from dior.cli import main
from dior.errors import DiorError
from dior.project import project as projects
from dior.release import checksums, provenance_json, sign, signature, tarballs
from tests.release import made as project
from tests.release import made_up

pytestmark = pytest.mark.skipif(not shutil.which("ssh-keygen"), reason="OpenSSH is not there")
OURS = "config/config.yaml: the key that 'release.sign' names"


def key(folder, name="lab", kind="ed25519", passphrase=""):
    path = folder / name
    made = ["ssh-keygen", "-q", "-t", kind, "-N", passphrase, "-C", "lab@example.org", "-f", path]
    subprocess.run(made + (["-b", "2048"] if kind == "rsa" else []), check=True)
    return path


@pytest.fixture(scope="module")
def keys(tmp_path_factory):
    folder = tmp_path_factory.mktemp("keys")
    names = {"lab": "ed25519", "rsa": "rsa", "ecdsa": "ecdsa", "other": "ed25519"}
    return {name: key(folder, name, kind) for name, kind in names.items()} | {
        "locked": key(folder, "locked", passphrase="secret")
    }


@pytest.fixture(scope="module")
def whole(tmp_path_factory, keys):
    folder = made_up.release(tmp_path_factory.mktemp("whole") / "dior-0.1.0")
    signed_by(folder, keys["lab"])
    return folder


@pytest.fixture
def made(whole, tmp_path):
    shutil.copytree(whole, tmp_path / whole.name)
    return tmp_path / whole.name


@pytest.fixture(autouse=True)
def no_agent(monkeypatch):
    monkeypatch.delenv("SSH_AUTH_SOCK", raising=False)


def signed_by(folder, path):
    """Sign a release as the step does, with a config that names the key."""
    project.write_config(folder.parent, {"sign": str(path)})
    sign.run(release=folder, project=folder.parent, signer="", out=folder / checksums.SIGNATURE)
    return (folder / checksums.SIGNATURE).read_bytes()


@pytest.fixture
def verified(capsys):
    def said(*words):
        code = main.main(["verify", *map(str, words)])
        found = capsys.readouterr()
        return code, found.out.splitlines() or found.err.splitlines()

    return said


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["lab", "rsa"])
def test_the_same_release_and_key_give_the_same_bytes(made, keys, kind):
    first = signed_by(made, keys[kind])
    (made / checksums.SIGNATURE).unlink()
    assert signed_by(made, keys[kind]) == first != signed_by(made, keys["other"])


def test_a_key_that_signs_differently_each_time_is_refused(made, keys):
    with pytest.raises(DiorError, match=f"^{OURS} is of type ecdsa-sha2-nistp256, which signs the same release diff"):
        signed_by(made, keys["ecdsa"])


def test_who_signed_is_told(made, keys, verified):
    code, (line,) = verified(made, "--key", f"{keys['lab']}.pub")
    assert code == 0 and "; signed by SHA256:" in line
    allowed = made.parent / "allowed_signers"
    public = keys["lab"].with_suffix(".pub").read_text().split()
    allowed.write_text(f'# of the lab\nlab@example.org namespaces="dior-release" {public[0]} {public[1]}\n')
    code, (line,) = verified(made, "--key", allowed)
    assert code == 0 and "; signed by lab@example.org (SHA256:" in line
    code, (line,) = verified(made)
    assert code == 0 and "; signed with SHA256:" in line and line.endswith("--key <the lab's public key> checks whose")


@pytest.mark.parametrize(
    ("options", "problem"),
    [
        ('namespaces="git" ', "that may sign releases: it was made with SHA256:"),
        ('valid-before="20200101" ', "whose time there is over"),
    ],
)
def test_a_key_that_may_not_sign_releases(made, keys, verified, options, problem):
    allowed = made.parent / "allowed_signers"
    allowed.write_text(f"lab@example.org {options}{keys['lab'].with_suffix('.pub').read_text()}")
    code, (line,) = verified(made, "--key", allowed)
    assert code == 1 and line.startswith(f"dior-0.1.0/SHA256SUMS.sig: is not by a key of {allowed}") and problem in line


def test_a_signature_by_another_key(made, keys, verified):
    code, (line,) = verified(made, "--key", f"{keys['other']}.pub")
    assert code == 1
    assert line.startswith(
        f"dior-0.1.0/SHA256SUMS.sig: is not by a key of {keys['other']}.pub: it was made with SHA256:"
    )
    assert line.endswith(", which is not in it")


def test_a_release_that_was_changed_after_it_was_signed(made, keys, verified):
    """Everything moved alike, with the figures and the checksums made anew: only a signature shows that."""
    edges = {name: [value[0] + 1.0] for name, value in made_up.boxes("walk_1", "cam01").items() if name[:2] in "u_v_"}
    made_up.write(made, "boxes/zebra-0001/walk_1.cam01.parquet", "released_boxes",
                  made_up.boxes("walk_1", "cam01", **edges))  # fmt: skip
    signature_of = made / checksums.SIGNATURE
    listed = checksums.read(made)
    (made / checksums.SUMS).write_text(checksums.text({n: d for n, d in listed.items() if n != signature_of.name}))
    problem = "is not of this SHA256SUMS: one of them was changed after it was signed"
    for words in ((made,), (made, "--key", f"{keys['lab']}.pub")):
        assert verified(*words) == (1, [f"dior-0.1.0/SHA256SUMS.sig: {problem}"])
    signature_of.unlink()
    code, (line,) = verified(made)
    assert code == 0 and line.endswith("; not signed, so that what was changed consistently is not found")


@pytest.mark.parametrize("content", [b"", b"junk", b"-----BEGIN SSH SIGNATURE-----\nAAAA\n"])
def test_a_signature_that_is_none(made, keys, verified, content):
    (made / checksums.SIGNATURE).write_bytes(content)
    assert verified(made, "--key", f"{keys['lab']}.pub") == (
        1, ["dior-0.1.0/SHA256SUMS.sig: is no signature of ssh-keygen; get it again"],
    )  # fmt: skip


def test_a_signature_for_something_else(made, keys, verified):
    sums = (made / checksums.SUMS).read_bytes()
    made_it = subprocess.run(
        ["ssh-keygen", "-Y", "sign", "-n", "file", "-f", keys["lab"]], input=sums, capture_output=True, check=True
    )
    (made / checksums.SIGNATURE).write_bytes(made_it.stdout)
    code, (line,) = verified(made, "--key", f"{keys['lab']}.pub")
    assert code == 1 and line.endswith("was made for something else than a release (its namespace is not dior-release)")


def test_a_release_without_a_signature(made, keys, verified):
    (made / checksums.SIGNATURE).unlink()
    why = "its lab has not signed it, or the signature was lost; ask them for it"
    problem = f"dior-0.1.0/SHA256SUMS.sig: is missing: {why}"
    assert verified(made, "--key", f"{keys['lab']}.pub") == (1, [problem])


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        (None, "cannot be read (No such file or directory)"),
        ("-----BEGIN OPENSSH PRIVATE KEY-----\nAAAA\n", "is a private key, which nobody else should have; give the"),
        ("", "is neither an allowed-signers file"),
        ("Creative Commons Zero\nNo key\n", "is neither an allowed-signers file"),
    ],
)
def test_a_list_of_keys_that_is_none(made, verified, tmp_path, content, problem):
    path = tmp_path / "keys"
    if content is not None:
        path.write_text(content)
    code, (line,) = verified(made, "--key", path)
    assert code == 1 and line.startswith(f"dior verify: {path}: {problem}")


def test_a_machine_without_ssh_keygen(made, keys, verified, monkeypatch, tmp_path):
    """Checking a signature needs it, checking a release does not."""
    monkeypatch.setenv("PATH", str(tmp_path))
    problem = "ssh-keygen is not there; install OpenSSH (Debian: openssh-client) where this runs"
    assert verified(made, "--key", f"{keys['lab']}.pub") == (1, [f"dior-0.1.0/SHA256SUMS.sig: {problem}"])
    code, (line,) = verified(made)
    assert code == 0 and line.endswith("; signed, which nobody can check without ssh-keygen")
    with pytest.raises(DiorError, match="^ssh-keygen is not there"):
        signed_by(made, keys["lab"])


def test_an_ssh_keygen_that_is_too_old(made, keys, verified, monkeypatch, tmp_path):
    (tmp_path / "ssh-keygen").write_text("#!/bin/sh\necho 'unknown option -- Y' >&2\nexit 1\n")
    (tmp_path / "ssh-keygen").chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}{os.pathsep}{os.environ['PATH']}")
    code, (line,) = verified(made, "--key", f"{keys['lab']}.pub")
    assert code == 1 and "older than 8.3" in line


def test_a_key_with_a_passphrase_needs_an_agent(made, keys, monkeypatch):
    with pytest.raises(DiorError, match=f"^{OURS} has a passphrase, which no job can ask for; `ssh-add <key>` first"):
        signed_by(made, keys["locked"])
    started = subprocess.run(["ssh-agent", "-s"], capture_output=True, text=True, check=True).stdout
    found = dict(word.split("=", 1) for word in started.replace("\n", ";").split(";") if word.startswith("SSH_"))
    for name, value in found.items():
        monkeypatch.setenv(name, value)
    try:
        ask = made.parent / "ask"
        ask.write_text("#!/bin/sh\necho secret\n")
        ask.chmod(0o700)
        subprocess.run(
            ["ssh-add", "-q", keys["locked"]], check=True, stdin=subprocess.DEVNULL, start_new_session=True,
            env=os.environ | {"SSH_ASKPASS": str(ask), "SSH_ASKPASS_REQUIRE": "force", "DISPLAY": ":0"},
        )  # fmt: skip
        first = signed_by(made, keys["locked"])
        assert signed_by(made, f"{keys['locked']}.pub") == first, "the public half is enough where an agent has the key"
    finally:
        subprocess.run(["ssh-agent", "-k"], check=True, capture_output=True)


def test_a_key_that_is_not_there(made, keys, tmp_path):
    with pytest.raises(DiorError, match="there is no public key that ends in .pub; correct the path"):
        signed_by(made, tmp_path / "nothing")
    shutil.copy(f"{keys['lab']}.pub", tmp_path / "alone.pub")
    for name in ("alone", "alone.pub"):
        with pytest.raises(DiorError, match=f"^{OURS} is no private key, and no agent holds it") as error:
            signed_by(made, tmp_path / name)
        assert str(tmp_path) not in str(error.value), "the log need not say where keys are"
    with pytest.raises(DiorError, match="'release.sign' names no key"):
        signed_by(made, "")
    assert not (made / f".{checksums.SUMS}.part.sig").exists()


def test_a_key_that_others_can_read(made, keys, tmp_path):
    for suffix in ("", ".pub"):
        shutil.copy(f"{keys['lab']}{suffix}", tmp_path / f"open{suffix}")
    (tmp_path / "open").chmod(0o644)
    with pytest.raises(DiorError, match=f"^{OURS} can be read by others"):
        signed_by(made, tmp_path / "open")


def test_another_key_than_the_run_began_with(made, keys):
    project.write_config(made.parent, {"sign": str(keys["lab"])})
    with pytest.raises(DiorError, match="names another key than when this run began"):
        sign.run(
            release=made, project=made.parent, signer=signature.public_key(keys["other"]), out=made / "SHA256SUMS.sig"
        )


def test_the_signature_is_in_the_tarball_of_metadata(made, keys, verified):
    packed = {}
    for part in ("zebra-0001", checksums.METADATA):
        packed[part] = made.with_name(f"{part}.tar")
        tarballs.run(release=made, subject=part, out=packed[part])
    code, (line,) = verified(packed[checksums.METADATA], "--key", f"{keys['lab']}.pub")
    assert code == 0 and "; signed by SHA256:" in line and "not all of the release was given" in line
    code, (line,) = verified(packed["zebra-0001"], "--key", f"{keys['lab']}.pub")
    assert code == 1 and line.endswith("is missing: is in the tarball of metadata; give that, too")
    assert verified(*packed.values(), "--key", f"{keys['lab']}.pub")[0] == 0
    (made / checksums.SIGNATURE).unlink()
    tarballs.run(release=made, subject=checksums.METADATA, out=packed[checksums.METADATA])
    assert verified(packed[checksums.METADATA])[0] == 0


def test_exports_are_not_signed(keys, verified, tmp_path):
    (tmp_path / "coco").mkdir()
    (tmp_path / "coco/labels.json").write_text("{}")
    (tmp_path / checksums.SUMS).write_text(checksums.text(checksums.of_folder(tmp_path)))
    code, (line,) = verified(tmp_path, "--key", f"{keys['lab']}.pub")
    assert code == 1 and line.endswith("exports are not signed; verify the release that they were made of")


def test_nothing_tells_where_the_key_is(tmp_path, keys):
    """Neither provenance.json nor anything else that a release is made of."""
    arguments = project.project(tmp_path)
    arguments["config"]["release"]["sign"] = str(keys["lab"])
    (tmp_path / "config/config.yaml").write_text(yaml.safe_dump(arguments["config"]))
    out = project.build(arguments)
    told = provenance_json.config_of(projects.load(tmp_path, arguments["config"]))
    assert "release.version" in told and not any("sign" in name for name in told)
    assert all(str(keys["lab"].parent).encode() not in content for content in project.files(out).values())
