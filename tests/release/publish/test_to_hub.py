"""`dior publish --hub` against a server that answers the Hub's own library: it is sent what the release holds."""

import base64
import hashlib
import importlib
import io
import json
import re
import shutil
import sys

import pytest

from dior.cli import main
from dior.release import checksums
from tests.release.publish.conftest import served

hub = pytest.importorskip("huggingface_hub", reason="not installed: pip install -e '.[hub]'")
constants = importlib.import_module("huggingface_hub.constants")
REPO = "lab/walks"
NOT_THERE = (404, {"X-Error-Code": "RepoNotFound"}, b'{"error": "Repository not found"}')


class Hub:
    """One dataset repository in memory. `fails`: method and a part of a path -> what is answered instead, once."""

    def __init__(self):
        self.files, self.private, self.blobs, self.uploaded, self.commits = None, None, {}, [], 0
        self.asked, self.fails, self.address = [], {}, ""

    def __call__(self, method, path, body, headers):
        path = path.split("?")[0]
        self.asked.append((method, path))
        for (verb, part), given in list(self.fails.items()):
            if verb == method and part in path:
                del self.fails[verb, part]
                return given
        if not path.startswith("/blobs/") and headers["Authorization"] != "Bearer hf_secret":
            return 401, {}, b'{"error": "Invalid username or password."}'
        found = self._answer(method, path, body)
        return found if isinstance(found, tuple) else (200, {}, json.dumps(found).encode())

    def _answer(self, method, path, body):
        if path.startswith("/blobs/"):
            assert hashlib.sha256(body).hexdigest() == path.removeprefix("/blobs/")
            self.blobs[path.removeprefix("/blobs/")] = body
            self.uploaded.append(path)
            return {}
        if path == "/api/whoami-v2":
            return {"name": "lab", "type": "user"}
        if path == "/api/validate-yaml":
            return {"errors": [], "warnings": []}
        if path == "/api/repos/create":
            asked = json.loads(body)
            # versions of the library say it in one way or the other
            self.files, self.private = {".gitattributes": b""}, asked.get("visibility", asked.get("private"))
            return {"url": f"{self.address}/datasets/{REPO}", "id": REPO}
        if self.files is None:
            return NOT_THERE
        if method == "GET" and path == f"/api/datasets/{REPO}":
            return {"id": REPO, "private": self.private, "sha": "0" * 40}
        if path.startswith(f"/api/datasets/{REPO}/tree/main"):
            return [{"type": "file", "path": name, "size": 1, "oid": "0"} for name in self.files]
        if path == f"/api/datasets/{REPO}/preupload/main":
            wanted = json.loads(body)["files"]
            modes = [("lfs" if one["path"].endswith(".parquet") else "regular") for one in wanted]
            return {
                "files": [
                    {"path": one["path"], "uploadMode": mode, "shouldIgnore": False, "oid": None}
                    for one, mode in zip(wanted, modes, strict=True)
                ]
            }
        if path == f"/datasets/{REPO}.git/info/lfs/objects/batch":
            asked = json.loads(body)["objects"]
            return {"transfer": "basic", "objects": [self._batch(one) for one in asked]}
        if path == f"/api/datasets/{REPO}/commit/main":
            self._commit([json.loads(line) for line in body.splitlines()])
            url = f"{self.address}/datasets/{REPO}/commit/{'1' * 40}"
            return {"commitUrl": url, "commitOid": "1" * 40, "success": True}
        raise AssertionError((method, path))

    def _batch(self, one):
        actions = {} if one["oid"] in self.blobs else {"upload": {"href": f"{self.address}/blobs/{one['oid']}"}}
        return {"oid": one["oid"], "size": one["size"], **({"actions": actions} if actions else {})}

    def _commit(self, lines):
        self.commits += 1
        for line in lines:
            value = line["value"]
            if line["key"] == "file":
                self.files[value["path"]] = base64.b64decode(value["content"])
            if line["key"] == "lfsFile":
                self.files[value["path"]] = self.blobs[value["oid"]]
            if line["key"] == "deletedFile":
                del self.files[value["path"]]


@pytest.fixture
def site(monkeypatch):
    found = Hub()
    with served(found) as address:
        found.address = address
        monkeypatch.setenv("HF_TOKEN", "hf_secret")
        monkeypatch.setenv("HF_ENDPOINT", address)
        monkeypatch.setattr(constants, "HF_HUB_OFFLINE", False)
        # the storage that replaces LFS asks servers of its own, which no stub stands for
        monkeypatch.setattr(constants, "HF_HUB_DISABLE_XET", True)
        yield found


def publish(release, *words):
    return main.main(["publish", str(release), "--hub", REPO, *words])


def files(release):
    return {path.relative_to(release).as_posix(): path.read_bytes() for path in release.rglob("*") if path.is_file()}


def test_a_new_repository_is_private_and_holds_the_release_and_nothing_else(release, site, capsys):
    assert publish(release, "--yes") == 0
    said = capsys.readouterr().out
    assert site.private in ("private", True) and site.commits == 1
    assert {name: content for name, content in site.files.items() if name != ".gitattributes"} == files(release)
    assert said.splitlines()[0].startswith("dior-0.1.0: 55 files"), "it was verified"
    assert f"{len(files(release))} files at {site.address}/datasets/{REPO}; it is private" in said


@pytest.mark.parametrize("answer", ["", "no\n", "\n"])
def test_nothing_is_sent_without_a_yes(release, site, monkeypatch, capsys, answer):
    monkeypatch.setattr("sys.stdin", io.StringIO(answer))
    assert publish(release) == (0 if answer else 1)
    said = capsys.readouterr()
    assert {method for method, _ in site.asked} == {"GET"} and site.files is None
    assert re.search(
        rf"Send \d+ files \(.*B\) of dior-0.1.0, licence CC0-1.0, to the new private dataset {REPO}", said.err
    )


def test_who_withdrew_is_deleted_and_the_question_says_so_and_who_can_see_it(release, site, monkeypatch, capsys):
    site.files = {".gitattributes": b"", "labels_2d/gone-0001/walk_9.cam01.parquet": b"x", "README.md": b"old"}
    site.private = False
    monkeypatch.setattr("sys.stdin", io.StringIO("y\n"))
    assert publish(release) == 0
    assert f"to the PUBLIC dataset {REPO}" in (said := capsys.readouterr().err)
    assert "and delete 1 file there that the release does not have? [y/N]" in said
    assert set(site.files) == {*files(release), ".gitattributes"}
    assert site.files["README.md"] == files(release)["README.md"]


def test_what_broke_off_shows_nothing_and_goes_on_without_sending_twice(release, site, capsys):
    site.fails["POST", "/commit/main"] = (500, {}, b'{"error": "down"}')
    assert publish(release, "--yes") == 1
    said = capsys.readouterr().err
    assert "nothing of this release shows there yet, and the same line goes on where it was" in said
    assert set(site.files) == {".gitattributes"} and site.uploaded
    before = list(site.uploaded)
    assert publish(release, "--yes") == 0
    assert site.uploaded == before and set(site.files) == {*files(release), ".gitattributes"}


@pytest.mark.parametrize(
    ("where", "status", "expected"),
    [
        (("POST", "/api/repos/create"), 403, "the token may not write there"),
        (("POST", "/commit/main"), 413, "a file, or all of them together, is too large for the Hub"),
    ],
)
def test_a_refusal_is_a_sentence(release, site, capsys, where, status, expected):
    site.fails[where] = (status, {}, b'{"error": "no"}')
    assert publish(release, "--yes") == 1
    assert capsys.readouterr().err == f"dior publish: {REPO}: {expected}" + (
        "; it has to be one that may write, of a member of the organisation\n" if status == 403 else "\n"
    )


def test_a_repository_that_leaves_files_out_is_named(release, site, capsys):
    answer = site._answer

    def ignoring(method, path, body):
        found = answer(method, path, body)
        if path.endswith("/preupload/main"):
            for one in found["files"]:
                one["shouldIgnore"] = one["path"] == "metrics.csv"
        return found

    site._answer = ignoring
    assert publish(release, "--yes") == 1
    assert (
        "1 file there that the release has not, or the other way round, first 'metrics.csv'" in capsys.readouterr().err
    )


def test_what_is_wrong_before_anything_is_sent(release, site, monkeypatch, capsys, tmp_path):
    monkeypatch.setenv("HF_TOKEN", "hf_other")
    assert publish(release, "--yes") == 1
    assert f"{REPO}: the token is not taken" in capsys.readouterr().err
    monkeypatch.setenv("HF_TOKEN", "hf_secret")
    assert main.main(["publish", str(release), "--hub", "a/b/c", "--yes"]) == 1
    assert "is no name of a repository, such as lab/walks" in capsys.readouterr().err
    copy = shutil.copytree(release, tmp_path / release.name)
    (copy / "notes about Ann.txt").write_text("not of the release")
    assert publish(copy, "--yes") == 1
    assert "notes about Ann.txt" in capsys.readouterr().out, "dior verify finds it"
    monkeypatch.setenv("HF_ENDPOINT", "http://127.0.0.1:9")
    assert publish(release, "--yes") == 1
    assert "http://127.0.0.1:9 cannot be reached" in capsys.readouterr().err
    monkeypatch.delenv("HF_TOKEN")
    monkeypatch.setattr(hub, "get_token", lambda: None)
    assert publish(release, "--yes") == 1
    assert "no token of the Hugging Face Hub: set HF_TOKEN" in capsys.readouterr().err
    monkeypatch.setitem(sys.modules, "huggingface_hub", None)
    assert publish(release, "--yes") == 1
    assert capsys.readouterr().err.endswith("needs huggingface_hub; install it: pip install -e '.[hub]'\n")
    assert site.files is None
    assert checksums.SUMS in files(release)
