"""`dior publish --zenodo` against a server that does what developers.zenodo.org says."""

import hashlib
import io
import json
import shutil

import pytest

from dior.cli import main
from dior.release import checksums
from dior.release.publish import to_zenodo
from tests.release.publish.conftest import served

DRAFTS = to_zenodo.DRAFTS


class Zenodo:
    """Depositions in memory. `fails`: method and end of a path -> what is answered instead, once."""

    def __init__(self):
        self.drafts, self.put, self.asked, self.fails = {}, [], [], {}
        self.address = ""

    def shown(self, number):
        draft = self.drafts[number]
        files = [
            {"filename": name, "checksum": hashlib.md5(content).hexdigest(), "filesize": len(content)}
            for name, content in draft["files"].items()
        ]
        links = {"bucket": f"{self.address}/api/files/b{number}", "html": f"{self.address}/deposit/{number}"}
        meta = draft["metadata"] | {"prereserve_doi": {"doi": f"10.5281/zenodo.{number}"}}
        return {"id": number, "submitted": False, "metadata": meta, "files": files, "links": links}

    def __call__(self, method, path, body, headers):
        self.asked.append((method, path))
        for (verb, end), given in list(self.fails.items()):
            if verb == method and path.endswith(end):
                del self.fails[verb, end]
                return given
        if headers["Authorization"] != "Bearer secret":
            return 401, {}, b'{"message": "no"}'
        found = self._answer(method, path, body)
        return (200, {}, json.dumps(found).encode()) if found is not None else (404, {}, b"{}")

    def _answer(self, method, path, body):
        if method == "GET" and path.startswith(f"{DRAFTS}?"):
            return [self.shown(number) for number in self.drafts]
        if method == "POST" and path == DRAFTS:
            self.drafts[len(self.drafts) + 1] = {"metadata": json.loads(body)["metadata"], "files": {}}
            return self.shown(len(self.drafts))
        if path.startswith(f"{DRAFTS}/"):
            number = int(path.split("/")[-1])
            if method == "PUT":
                self.drafts[number]["metadata"] = json.loads(body)["metadata"]
            return self.shown(number)
        if method == "PUT" and path.startswith("/api/files/b"):
            number, name = path.removeprefix("/api/files/b").split("/")
            self.drafts[int(number)]["files"][name] = body
            self.put.append(name)
            return {"key": name, "checksum": f"md5:{hashlib.md5(body).hexdigest()}", "size": len(body)}
        return None


@pytest.fixture
def zenodo(monkeypatch):
    site = Zenodo()
    with served(site) as address:
        site.address = address
        monkeypatch.setenv("ZENODO_URL", address)
        monkeypatch.setenv("ZENODO_TOKEN", "secret")
        yield site


def publish(release, *words):
    return main.main(["publish", str(release), "--zenodo", *words])


def tarballs(release):
    return {path.name: path.read_bytes() for path in release.parent.glob(f"{release.name}-*.tar")}


def test_a_draft_gets_the_tarballs_title_and_licence_and_nothing_else(release, zenodo, capsys):
    assert publish(release, "--yes") == 0
    said = capsys.readouterr().out
    ((number, draft),) = zenodo.drafts.items()
    assert draft["files"] == tarballs(release) and len(draft["files"]) == 3
    about = draft["metadata"]
    assert (about["title"], about["version"], about["license"]) == ("made up", "0.1.0", "cc0-1.0")
    assert about["upload_type"] == "dataset" and "labels" in about["description"] and about["prereserve_doi"] is True
    assert said.splitlines()[0].startswith("dior-0.1.0: 55 files"), "it was verified"
    assert f"3 tarballs in the draft {zenodo.address}/deposit/{number}" in said and "10.5281/zenodo.1" in said
    assert not any(path.endswith("actions/publish") for _, path in zenodo.asked)


@pytest.mark.parametrize("answer", ["", "n\n", "\n", "what?\n"])
def test_nothing_is_sent_without_a_yes(release, zenodo, monkeypatch, capsys, answer):
    monkeypatch.setattr("sys.stdin", io.StringIO(answer))
    assert publish(release) == (0 if answer else 1)
    said = capsys.readouterr()
    assert {method for method, _ in zenodo.asked} == {"GET"} and not zenodo.drafts
    assert "Send 3 tarballs (" in said.err and f"to a new draft on {zenodo.address}? [y/N]" in said.err
    assert "nothing was sent" in said.out + said.err


def test_a_yes_is_enough(release, zenodo, monkeypatch):
    monkeypatch.setattr("sys.stdin", io.StringIO("Yes\n"))
    assert publish(release) == 0 and len(zenodo.put) == 3


def test_what_broke_off_goes_on_and_nothing_is_sent_twice(release, zenodo, capsys):
    second = sorted(tarballs(release))[1]
    zenodo.fails["PUT", second] = (0, {}, b"")
    assert publish(release, "--yes") == 1
    said = capsys.readouterr().err
    assert "1 of 3 tarballs are there, and the same line goes on with " + second in said
    assert zenodo.put == sorted(tarballs(release))[:1]
    assert publish(release, "--yes") == 0
    assert zenodo.put == sorted(tarballs(release)) and len(zenodo.drafts) == 1
    assert publish(release, "--yes") == 0
    assert len(zenodo.put) == 3


def test_a_tarball_that_differs_is_sent_again_and_foreign_files_are_named(release, zenodo, capsys):
    assert publish(release, "--yes") == 0
    name = min(tarballs(release))
    zenodo.drafts[1]["files"][name] = b"of an earlier build"
    assert publish(release, "--yes") == 0 and zenodo.put[3:] == [name]
    zenodo.drafts[1]["files"]["dior-0.1.0-who-withdrew.tar"] = b"x"
    assert publish(release, "--yes") == 1
    assert "has 1 file that the release has not, first 'dior-0.1.0-who-withdrew.tar'" in capsys.readouterr().err
    assert len(zenodo.put) == 4


def test_what_arrives_changed_is_told(release, zenodo, capsys):
    zenodo.fails["PUT", min(tarballs(release))] = (200, {}, b'{"checksum": "md5:0"}')
    assert publish(release, "--yes") == 1
    assert "arrived changed, its MD5 is 0" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("status", "expected"),
    [
        (401, "the token is not taken; make one with the scope deposit:write"),
        (413, "the file is too large for Zenodo; 0 of 3 tarballs are there"),
        (400, "answers 400: no; metadata.title: missing"),
        (502, "answers 502: Bad Gateway"),
    ],
)
def test_a_refusal_is_a_sentence(release, zenodo, capsys, status, expected):
    content = b'{"message": "no", "errors": [{"field": "metadata.title", "message": "missing"}]}'
    zenodo.fails["PUT", min(tarballs(release))] = (status, {}, content if status == 400 else b"<html>")
    assert publish(release, "--yes") == 1
    said = capsys.readouterr().err
    assert expected in said and "Traceback" not in said


def test_what_is_wrong_before_anything_is_asked(release, monkeypatch, capsys, tmp_path):
    monkeypatch.delenv("ZENODO_TOKEN", raising=False)
    assert publish(release, "--yes") == 1
    assert "no token of Zenodo" in capsys.readouterr().err
    monkeypatch.setenv("ZENODO_TOKEN", "secret")
    monkeypatch.setenv("ZENODO_URL", "http://127.0.0.1:9")
    assert publish(release, "--yes") == 1
    assert "http://127.0.0.1:9 cannot be reached, or broke off" in capsys.readouterr().err
    monkeypatch.setenv("ZENODO_URL", "zenodo.org")
    assert publish(release, "--yes") == 1
    assert "ZENODO_URL is 'zenodo.org', which is no address" in capsys.readouterr().err
    for words in ([], ["--zenodo", "--hub", "lab/walks"]):
        assert main.main(["publish", str(release), *words]) == 1
        assert "say where to: --hub and a dataset repository such as lab/walks, or --zenodo" in capsys.readouterr().err
    assert publish(tmp_path, "--yes") == 1
    assert "no whole release" in capsys.readouterr().err
    (tmp_path / "README.md").write_text("exports, say")
    checksums.write(tmp_path)
    assert publish(tmp_path, "--yes") == 1
    assert "is no release, which has a sequences.parquet" in capsys.readouterr().err


def test_a_damaged_release_and_tarballs_of_another_build_are_not_sent(release, zenodo, tmp_path, capsys):
    shutil.copytree(release.parent, tmp_path / "r")
    copy = tmp_path / "r" / release.name
    with open(copy / "README.md", "a") as stream:
        stream.write("more\n")
    assert publish(copy, "--yes") == 1
    assert "README.md: its SHA-256 is not the listed one" in capsys.readouterr().out
    shutil.copyfile(release / "README.md", copy / "README.md")
    tarball = copy.with_name(f"{copy.name}-metadata.tar")
    whole = bytearray(tarball.read_bytes())
    whole[len(whole) // 2] ^= 1
    tarball.write_bytes(whole)
    assert publish(copy, "--yes") == 1
    whole[600] ^= 1
    tarball.write_bytes(whole)
    assert publish(copy, "--yes") == 1
    assert "is not of this build of dior-0.1.0" in capsys.readouterr().err
    tarball.unlink()
    assert publish(copy, "--yes") == 1
    assert "there is no such tarball; `dior run release` packs them" in capsys.readouterr().err
    assert not zenodo.drafts and not zenodo.put


def test_more_than_zenodo_takes_is_told_first(release, zenodo, monkeypatch, capsys):
    monkeypatch.setattr(to_zenodo, "MOST_FILES", 2)
    assert publish(release, "--yes") == 1
    assert "3 tarballs, and Zenodo takes 2 files of a record" in capsys.readouterr().err
    monkeypatch.setattr(to_zenodo, "MOST_FILES", 3)
    monkeypatch.setattr(to_zenodo, "MOST_BYTES", 1000)
    assert publish(release, "--yes") == 1
    assert "`dior publish --hub` takes them" in capsys.readouterr().err
    assert not zenodo.asked


def test_the_token_goes_to_no_other_computer(release, zenodo, capsys):
    shown = Zenodo.shown
    zenodo.shown = lambda number: shown(zenodo, number) | {"links": {"bucket": "http://elsewhere.invalid/b"}}
    assert publish(release, "--yes") == 1
    assert "http://elsewhere.invalid/b for the files, which is another computer" in capsys.readouterr().err
