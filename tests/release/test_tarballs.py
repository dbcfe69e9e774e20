"""A tarball holds one part of the release, is the same bytes each time, and goes on where it was killed."""

import hashlib
import os
import signal
import subprocess
import sys
import tarfile

import numpy as np
import pytest

from dior.errors import DiorError
from dior.release import checksums, tarballs

WHO = ("apple-0002", "zebra-0001")
PARTS = (*WHO, checksums.METADATA)


def release(folder, who=WHO, size=50_000):
    """A release of files of random bytes, several to a part."""
    rng = np.random.default_rng(0)
    for one in sorted(WHO):
        for table, files in (("labels_2d", 3), ("frames", 3), ("skeletons_3d", 1)):
            for i in range(files):
                content = rng.bytes(int(rng.integers(0, size)))
                if one in who:
                    path = folder / table / one / f"walk_{one[0]}.cam0{i}.parquet"
                    path.parent.mkdir(parents=True, exist_ok=True)
                    path.write_bytes(content)
    for name in ("README.md", "LICENSE", "subjects.parquet"):
        (folder / name).write_text(f"{name} of {' '.join(who)}\n")
    checksums.write(folder)
    return folder


@pytest.fixture
def made(tmp_path):
    return release(tmp_path / "dior-0.1.0")


def pack(folder, part, out=None):
    out = out or folder.with_name(f"{folder.name}-{part}.tar")
    tarballs.run(release=folder, subject=part, out=out)
    return out


def files(folder):
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_the_tarballs_together_are_the_release(made, tmp_path):
    for part in PARTS:
        with tarfile.open(pack(made, part)) as tar:
            entries = tar.getmembers()
            names = [entry.name for entry in entries]
            assert names[0] == f"dior-0.1.0/{checksums.list_of(part)}" and names[1:] == sorted(names[1:])
            assert {(m.mtime, m.uid, m.gid, m.uname, m.gname, m.mode) for m in entries} == {(0, 0, 0, "", "", 0o644)}
            tar.extractall(tmp_path / "unpacked", filter="data")
    assert files(tmp_path / "unpacked/dior-0.1.0") == files(made)


def test_sums_and_tar_of_the_system_agree(made, tmp_path):
    """GNU tar unpacks a subject's tarball, and sha256sum finds every file of it in its own list and right."""
    out = pack(made, WHO[0])
    alone = tmp_path / "alone"
    alone.mkdir()
    subprocess.run(["tar", "xf", out, "-C", alone], check=True)
    own = f"checksums/{WHO[0]}/SHA256SUMS"
    checked = subprocess.run(["sha256sum", "-c", own], cwd=alone / "dior-0.1.0", capture_output=True, text=True)
    assert checked.returncode == 0 and len(checked.stdout.splitlines()) == 7
    assert {line.split(": ")[0] for line in checked.stdout.splitlines()} == set(files(alone / "dior-0.1.0")) - {own}
    whole = subprocess.run(["sha256sum", "-c", "--quiet", "SHA256SUMS"], cwd=made)
    assert whole.returncode == 0


def test_a_subjects_tarball_names_nobody_else_and_outlives_a_withdrawal(made, tmp_path):
    before = pack(made, WHO[1]).read_bytes()
    assert WHO[0].encode() not in before
    fewer = release(tmp_path / "later/dior-0.1.0", who=WHO[1:])
    assert pack(fewer, WHO[1]).read_bytes() == before
    assert WHO[0].encode() not in pack(fewer, checksums.METADATA).read_bytes()


def test_a_tarball_is_the_same_bytes_whenever_it_is_made(made):
    found = []
    for stamp in (0, 10**9):
        for path in made.rglob("*"):
            os.utime(path, (stamp, stamp))
            path.chmod(0o755 if path.is_dir() or stamp else 0o600)
        found.append(hashlib.sha256(pack(made, WHO[0]).read_bytes()).hexdigest())
    assert found[0] == found[1]


def test_bytes_are_those_that_tarfile_writes(made, tmp_path):
    with tarfile.open(tmp_path / "other.tar", "w", format=tarfile.PAX_FORMAT) as tar:
        for name in tarballs.members(made, WHO[0]):
            entry = tarfile.TarInfo(f"dior-0.1.0/{name}")
            entry.size, entry.mode = (made / name).stat().st_size, 0o644
            with open(made / name, "rb") as stream:
                tar.addfile(entry, stream)
    assert pack(made, WHO[0]).read_bytes() == (tmp_path / "other.tar").read_bytes()


def test_what_no_tarball_can_be_made_of(made, tmp_path):
    out = tmp_path / "x.tar"
    with pytest.raises(DiorError, match=r"'zebra-001' is not in the release \(did you mean 'zebra-0001'"):
        pack(made, "zebra-001", out)
    path = made / "frames/zebra-0001/walk_z.cam01.parquet"
    path.rename(tmp_path / "kept")
    with pytest.raises(DiorError, match="walk_z.cam01.parquet: listed in SHA256SUMS but gone"):
        pack(made, "zebra-0001", out)
    (made / "SHA256SUMS").write_text("rubbish\n")
    with pytest.raises(DiorError, match="SHA256SUMS: line 1 is not '<SHA-256>  <path>'"):
        pack(made, "zebra-0001", out)
    (made / "SHA256SUMS").unlink()
    with pytest.raises(DiorError, match="so this is no whole release"):
        pack(made, "zebra-0001", out)
    assert not out.exists()


@pytest.mark.parametrize("change", [lambda b: b[:-1] + bytes([b[-1] ^ 1]), lambda b: b + b"x", lambda b: b[:-1]])
def test_a_file_changed_by_hand_is_refused_and_named(made, change):
    """The tarball of before stays, and once the file is as it was the tarball is the same."""
    before = pack(made, WHO[0])
    content = before.read_bytes()
    path = made / f"labels_2d/{WHO[0]}/walk_a.cam01.parquet"
    was = path.read_bytes()
    path.write_bytes(change(was))
    with pytest.raises(DiorError, match="walk_a.cam01.parquet: its SHA-256 is not the one that SHA256SUMS has"):
        pack(made, WHO[0])
    assert before.read_bytes() == content
    path.write_bytes(was)
    assert pack(made, WHO[0]).read_bytes() == content
    assert not list(made.parent.glob(".*")), "nothing is left beside it"


PACK = """
import sys
from pathlib import Path
from dior.errors import DiorError
from dior.release import tarballs
tarballs.CHECKPOINT = 1 << 20
if sys.argv[4:]:
    import resource
    resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[4]), resource.RLIM_INFINITY))
try:
    tarballs.run(release=Path(sys.argv[1]), subject=sys.argv[2], out=Path(sys.argv[3]))
except DiorError as error:
    sys.exit(str(error))
"""


# at the sixth file, in the middle of it
KILL = """
import os, signal, sys, time
from pathlib import Path
from dior.release import tarballs
opened, write = [], tarballs._write
def killed(tar, content):
    write(tar, content)
    opened.append(len(content) == 512)
    if sum(opened) == 6 and len(content) == tarballs.BLOCK:
        while not tarballs.leftovers(Path(sys.argv[3]))[1].exists():
            time.sleep(0.01)
        os.kill(os.getpid(), signal.SIGKILL)
tarballs._write = killed
"""


def read_again(monkeypatch, folder, part, out):
    """Files that a run which goes on has read."""
    opened, original = [], tarballs._opened
    monkeypatch.setattr(tarballs, "_opened", lambda member: opened.append(member.path.name) or original(member))
    pack(folder, part, out)
    return opened


def test_a_killed_run_goes_on_and_the_bytes_are_the_same(tmp_path, monkeypatch):
    folder = release(tmp_path / "dior-0.1.0", size=4 << 20)
    whole = pack(folder, WHO[0]).read_bytes()
    out = tmp_path / "killed.tar"
    part, state = tarballs.leftovers(out)
    done = subprocess.run([sys.executable, "-c", KILL + PACK, folder, WHO[0], out])
    assert done.returncode == -signal.SIGKILL
    assert not out.exists() and 0 < part.stat().st_size < len(whole)
    opened = read_again(monkeypatch, folder, WHO[0], out)
    assert 0 < len(opened) < 7, "what was packed is not read again"
    assert out.read_bytes() == whole and not part.exists() and not state.exists()


def test_a_full_disk_is_told_and_what_was_packed_is_kept(tmp_path, monkeypatch):
    folder = release(tmp_path / "dior-0.1.0", size=3 << 20)
    whole = pack(folder, WHO[0]).read_bytes()
    out = tmp_path / "full.tar"
    command = [sys.executable, "-c", PACK, folder, WHO[0], out]
    done = subprocess.run([*command, str(len(whole) // 2)], capture_output=True, text=True)
    assert done.returncode == 1 and not out.exists()
    assert done.stderr.startswith(f"{out}: cannot be written: files may not become so large: ")
    assert f"of about {len(whole) / 1e6:.1f} MB were written" in done.stderr
    assert done.stderr.endswith("run again; what is packed so far is kept\n")
    opened = read_again(monkeypatch, folder, WHO[0], out)
    assert 0 < len(opened) < 7 and out.read_bytes() == whole


def test_two_runs_do_not_pack_into_one_file(tmp_path):
    """The second says so, and once the first has ended, alive or killed, it goes on."""
    folder = release(tmp_path / "dior-0.1.0")
    out = tmp_path / "x.tar"
    part, _ = tarballs.leftovers(out)
    with tarballs._alone(part) as first:
        first.write(b"half")
        done = subprocess.run([sys.executable, "-c", PACK, folder, WHO[0], out], capture_output=True, text=True)
        assert done.returncode == 1 and "another run is packing this tarball" in done.stderr
        assert part.read_bytes() == b"half" and not out.exists()
    assert pack(folder, WHO[0], out).read_bytes() == pack(folder, WHO[0]).read_bytes()


def test_a_file_that_got_its_final_name_meanwhile_is_not_written_into(tmp_path, monkeypatch):
    """The other run ended between the opening and the locking."""
    part, out = tmp_path / ".x.part.tar", tmp_path / "x.tar"
    part.write_bytes(b"whole")
    lock = tarballs.fcntl.flock

    def late(file, how):
        if part.exists() and not out.exists():
            part.rename(out)
        lock(file, how)

    monkeypatch.setattr(tarballs.fcntl, "flock", late)
    with tarballs._alone(part) as tar:
        tar.truncate(0)
    assert out.read_bytes() == b"whole" and part.read_bytes() == b""


def test_another_release_is_packed_from_the_start(tmp_path):
    old = release(tmp_path / "old/dior-0.1.0", size=3 << 20)
    new = release(tmp_path / "new/dior-0.1.0", size=3 << 20)
    path = new / f"skeletons_3d/{WHO[0]}/walk_a.cam00.parquet"
    path.write_bytes(path.read_bytes()[::-1])
    checksums.write(new)
    out = tmp_path / "x.tar"
    subprocess.run([sys.executable, "-c", PACK, old, WHO[0], out, "4000000"], capture_output=True)
    assert tarballs.leftovers(out)[1].exists()
    assert pack(new, WHO[0], out).read_bytes() == pack(new, WHO[0]).read_bytes()


@pytest.mark.slow
def test_memory_is_bounded(tmp_path):
    """Packing 50 MB takes no more memory than packing 1 MB, but for a few blocks."""
    used = []
    for i, size in enumerate((1 << 18, 16 << 20)):
        folder = release(tmp_path / f"{i}/dior-0.1.0", size=size)
        code = PACK + "\nprint(Path('/proc/self/status').read_text().split('VmHWM:')[1].split()[0])"
        command = [sys.executable, "-c", code, folder, WHO[0], tmp_path / f"{i}.tar"]
        used.append(int(subprocess.run(command, capture_output=True, text=True, check=True).stdout))
    assert used[1] - used[0] < 8_000, "kB"


def test_half_made_files_are_found_by_name(tmp_path):
    assert [path.name for path in tarballs.leftovers(tmp_path / "dior-0.1.0-zebra-0001.tar")] == [
        ".dior-0.1.0-zebra-0001.part.tar",
        ".dior-0.1.0-zebra-0001.part.json",
    ]
