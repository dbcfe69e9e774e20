"""A release that the workflow signs: what re-runs, what it tells, and that verify believes every kind of release."""

import shutil
import subprocess

import numpy as np
import pytest

from dior.cli import main
from dior.project.project import load
from dior.release import checksums
from dior.release.pixels import _writer
from dior.simulate import config as simulated
from dior.simulate import settings
from dior.tables import tables
from tests.end_to_end.workflow import edit, planned, snakemake
from tests.release import made_up

pytestmark = [pytest.mark.slow, pytest.mark.skipif(not shutil.which("ssh-keygen"), reason="OpenSSH is not there")]
TINY = {"subjects": 2, "sequences": 1, "duration_s": 3.0, "width": 640, "height": 360, "fx": 320.0}
TINY |= {"environments": ["indoor"]}
RELEASE = "results/release/dior-0.1.0"


@pytest.fixture(scope="module")
def key(tmp_path_factory):
    path = tmp_path_factory.mktemp("secret") / "lab"
    subprocess.run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", path], check=True)
    return path


@pytest.fixture(scope="module")
def project(tmp_path_factory, key):
    """A finished run with a signed release."""
    folder = tmp_path_factory.mktemp("tiny")
    simulated.write(settings.from_dict(TINY), folder / "config")
    edit(folder / "config/config.yaml", 'sign: ""', f"sign: {key}")
    snakemake(folder, "release")
    return folder


@pytest.fixture
def verified(capsys):
    def lines(*words):
        main.main(["verify", *map(str, words)])
        return capsys.readouterr().out.splitlines()

    return lines


def test_the_release_is_signed_and_nothing_tells_by_what(project, key, verified):
    (line,) = verified(project / RELEASE, "--key", f"{key}.pub")
    assert "; signed by SHA256:" in line
    (line,) = verified(f"{project / RELEASE}-metadata.tar", "--key", f"{key}.pub")
    assert "; signed by SHA256:" in line
    private = (str(key).encode(), str(key.parent).encode(), key.read_bytes().splitlines()[1])
    for path in [path for path in project.rglob("*") if path.is_file() and path.name != "config.yaml"]:
        content = path.read_bytes()
        assert not any(word in content for word in private), path
    assert planned(project, "release") == {}


def test_another_key_signs_anew_and_nothing_else(copy, tmp_path, verified):
    other = tmp_path / "other"
    subprocess.run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", other], check=True)
    text = (copy / "config/config.yaml").read_text().splitlines()
    sign = next(line for line in text if line.startswith("  sign:"))
    edit(copy / "config/config.yaml", sign, f"  sign: {other}")
    assert planned(copy, "release") == {"release": 1, "sign": 1, "tarballs": 1}
    before = checksums.digest(open(copy / RELEASE / "SHA256SUMS", "rb"))
    snakemake(copy, "release")
    (line,) = verified(copy / RELEASE, "--key", f"{other}.pub")
    assert "; signed by SHA256:" in line
    assert checksums.digest(open(copy / RELEASE / "SHA256SUMS", "rb")) == before
    (copy / RELEASE / "SHA256SUMS.sig").rename(tmp_path / "first.sig")
    snakemake(copy, "release")
    assert (copy / RELEASE / "SHA256SUMS.sig").read_bytes() == (tmp_path / "first.sig").read_bytes()


@pytest.mark.parametrize("kind", ["shifted", "without pictures", "shown", "one person"])
def test_verify_believes_every_kind_of_release(copy, kind, key, verified):
    subjects = copy / "config/subjects.tsv"
    if kind == "shifted":
        edit(copy / "config/config.yaml", "shift_stamps: false", "shift_stamps: true")
    elif kind == "shown":
        edit(copy / "config/config.yaml", "faces: blurred", "faces: shown")
    elif kind == "without pictures":
        subjects.write_text(subjects.read_text().replace("yes\tyes", "yes\tno"))
    else:
        # the second: the cameras were marked in the first one's walk
        first, _, second = subjects.read_text().rpartition("yes\tyes")
        subjects.write_text(f"{first}no\tno{second}")
    snakemake(copy, "release")
    for words in ((copy / RELEASE,), (copy / RELEASE, "--decode")):
        (line,) = verified(*words, "--key", f"{key}.pub")
        assert "checksums right" in line and load(copy).released_sequences
    if kind == "without pictures":
        assert ", 0 pictures" in line


def test_pictures_that_were_exchanged_are_found(copy, verified):
    """Two of one recording, one of another camera, and all of two cameras."""
    folder = copy / RELEASE
    path = sorted(folder.glob("frames/*/indoor_*.cam01.parquet"))[0]
    other = path.with_name(path.name.replace("cam01", "cam02"))
    whole = {one: tables.read(one, "released_frames") for one in (path, other)}
    last = len(whole[path]["frame"]) - 5

    def written(first, second=None):
        for one, image in ((path, first), (other, second)):
            image = whole[one]["image"] if image is None else image
            one.unlink()
            with _writer(one) as writer:
                writer.write_table(tables.to_arrow("released_frames", whole[one] | {"image": image}))
        (folder / checksums.SIGNATURE).unlink(missing_ok=True)
        made_up.remade(folder)
        return verified(folder, "--decode")

    first, second = (table["image"] for table in whole.values())
    swapped = first.copy()
    swapped[[4, last]] = swapped[[last, 4]]
    # pictures in the place of others are covered elsewhere
    bare, line = sorted(written(swapped), key=lambda line: "exchanged" in line)
    assert path.name in bare and "pictures that show more than a cover leaves" in bare
    assert f"{path.name}: the pictures of frames 4 and {last} are exchanged" in line
    swapped = first.copy()
    swapped[9] = second[9]
    line = next(line for line in written(swapped) if "a cover leaves" not in line)
    assert f"{path.name}: 1 pictures look like those of camera cam02, first frame 9" in line
    # the other camera's labels are where half of what moves in these is, too: that it has another's is not said of it
    lines = [line for line in written(second, first) if "its pictures are those of" in line]
    assert lines and f"{other.name}: its pictures are those of" in lines[-1] and path.name in lines[-1]
    assert len(written(first, second)) == 1 and np.array_equal(whole[path]["image"], first)
