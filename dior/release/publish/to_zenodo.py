"""A release as a draft on Zenodo, by its REST API: the tarballs beside the folder, title, authors and licence.

INPUTS   a release folder with its tarballs; ZENODO_TOKEN, and ZENODO_URL where it is not zenodo.org (the sandbox)
OUTPUTS  a draft, which nobody sees until you publish it there
A draft of yours that has the same title and version is taken again: what is in it already, by MD5, is not sent, what
differs is replaced. The API is that of developers.zenodo.org: depositions, and a bucket that files are PUT into.
"""

import hashlib
import html
import http.client
import json
import os
import tarfile
import urllib.error
import urllib.request
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, BinaryIO
from urllib.parse import quote, urlsplit

from dior.errors import DiorError, many
from dior.progress import reporting
from dior.project import licenses
from dior.release import checksums
from dior.release.publish.delivery import Delivery, settings, told
from dior.shortage import size

SERVER = "https://zenodo.org"
DRAFTS = "/api/deposit/depositions"
# what Zenodo takes of one record
MOST_FILES, MOST_BYTES = 100, 50 * 10**9
# seconds without a byte; chosen: a server that hashes a large file answers late
PATIENCE_S = 300.0
REFUSED = {
    401: "the token is not taken; make one with the scope deposit:write and set ZENODO_TOKEN",
    403: "the token may not do that; it has to have the scope deposit:write",
    413: "the file is too large for Zenodo",
    429: "too much was asked of Zenodo in a short time; wait for a minute and type the same line again",
}


def delivery(release: Path, listed: Mapping[str, str]) -> Delivery:
    """What would be sent. Raises DiorError without a token, tarballs or Zenodo, and for what it would not take."""
    token, server = os.environ.get("ZENODO_TOKEN", ""), os.environ.get("ZENODO_URL", SERVER).rstrip("/")
    if not token:
        raise DiorError("no token of Zenodo: make one with the scope deposit:write there and set ZENODO_TOKEN")
    tarballs = tarballs_of(release, listed)
    about = metadata(release)
    draft = _draft(server, token, about)
    names = {path.name for path in tarballs}
    if draft and (others := sorted(set(_md5s(draft)) - names)):
        raise DiorError(
            f"{server}: your draft {draft['id']} of this title and version has {many(len(others), 'file')} that the "
            f"release has not, first '{others[0]}'; delete what has no place in it, or the draft"
        )
    where = f"your draft {draft['id']}" if draft else "a new draft"
    question = f"Send {told(release, tarballs, 'tarball')} to {where} on {server}?"
    return Delivery(([release], tarballs), question, lambda: _sent(server, token, tarballs, about, draft))


def tarballs_of(release: Path, listed: Mapping[str, str]) -> list[Path]:
    """The tarballs that are the release. Raises DiorError where one is missing, of another build, or too much."""
    parts = sorted(set(map(checksums.of_whom, listed)))
    folder = release.resolve()
    found = [folder.with_name(f"{folder.name}-{part}.tar") for part in parts]
    for part, path in zip(parts, found, strict=True):
        if not path.is_file():
            raise DiorError(f"{path}: there is no such tarball; `dior run release` packs them beside the folder")
        if _first_of(path) != (release / checksums.list_of(part)).read_bytes():
            raise DiorError(f"{path}: is not of this build of {folder.name}; `dior run release` packs it again")
    if len(found) > MOST_FILES:
        raise DiorError(f"{release}: {len(found)} tarballs, and Zenodo takes {MOST_FILES} files of a record")
    total = sum(path.stat().st_size for path in found)
    if total > MOST_BYTES:
        raise DiorError(
            f"{release}: tarballs of {size(total)}, and Zenodo takes {size(MOST_BYTES)} of a record unless you ask it "
            "for more; `dior publish --hub` takes them"
        )
    return found


def _first_of(tarball: Path) -> bytes:
    """What the first file of a tarball holds, which is the list of what follows."""
    try:
        with tarfile.open(tarball) as tar:
            first = tar.next()
            stream = tar.extractfile(first) if first else None
            return stream.read() if stream else b""
    except (tarfile.TarError, OSError):
        return b""


def metadata(release: Path) -> dict[str, Any]:
    """What Zenodo shows: of the release's own settings and texts only."""
    about = settings(release)
    described = json.loads((release / "croissant.json").read_text(encoding="utf-8")).get("description", "")
    found = {
        "upload_type": "dataset",
        "title": about["title"] or release.resolve().name,
        "version": about["version"],
        "description": html.escape(described),
        "creators": [{"name": name} for name in about["authors"]],
        "license": about["license"].lower() if about["license"] in licenses.KNOWN else "",
        "publication_date": about["date"],
        "keywords": ["gait", "human pose estimation", "gait recognition"],
    }
    return {key: value for key, value in found.items() if value} | {"prereserve_doi": True}


def _draft(server: str, token: str, about: Mapping[str, Any]) -> dict[str, Any] | None:
    """The draft of that title and version, None where there is none."""
    for one in _asked(server, token, "GET", f"{DRAFTS}?status=draft&size=100"):
        known = one.get("metadata", {})
        if not one.get("submitted") and all(known.get(key) == about.get(key) for key in ("title", "version")):
            return dict(_asked(server, token, "GET", f"{DRAFTS}/{one['id']}"))
    return None


def _md5s(draft: Mapping[str, Any]) -> dict[str, str]:
    """MD5 by name of the files of a draft."""
    return {one["filename"]: str(one.get("checksum", "")).removeprefix("md5:") for one in draft.get("files", ())}


def _sent(
    server: str, token: str, tarballs: Sequence[Path], about: dict[str, Any], draft: dict[str, Any] | None
) -> str:
    if draft is None:
        draft = dict(_asked(server, token, "POST", DRAFTS, {"metadata": about}))
    else:
        draft |= dict(_asked(server, token, "PUT", f"{DRAFTS}/{draft['id']}", {"metadata": about}))
    bucket, there = str(draft["links"]["bucket"]), _md5s(draft)
    if urlsplit(bucket).netloc != urlsplit(server).netloc:
        raise DiorError(f"{server}: names {bucket} for the files, which is another computer; nothing was sent there")
    for done, path in enumerate(reporting(tarballs, len(tarballs), "tarballs", "publish")):
        with open(path, "rb") as stream:
            digest = hashlib.file_digest(stream, lambda: hashlib.md5(usedforsecurity=False)).hexdigest()
        if there.get(path.name) != digest:
            _put(server, token, f"{bucket}/{quote(path.name)}", path, digest, f"{done} of {len(tarballs)}")
    doi = draft.get("metadata", {}).get("prereserve_doi", {}).get("doi", "")
    kept = (
        f"; it keeps the DOI {doi} for you, which `release.doi` takes before you build again and send again"
        if doi
        else ""
    )
    page = draft.get("links", {}).get("html", server)
    return f"{many(len(tarballs), 'tarball')} in the draft {page}, which nobody sees until you publish it there{kept}"


def _put(server: str, token: str, url: str, path: Path, digest: str, done: str) -> None:
    """Send a file, and compare the MD5 that comes back."""
    then = f"; {done} tarballs are there, and the same line goes on with {path.name}"
    with open(path, "rb") as stream:
        answer = _asked(server, token, "PUT", url, stream, path.stat().st_size, then)
    told = str(answer.get("checksum", "")).removeprefix("md5:")
    if told != digest:
        raise DiorError(f"{server}: {path.name} arrived changed, its MD5 is {told or 'not told'}{then}")


def _asked(
    server: str,
    token: str,
    method: str,
    place: str,
    content: dict[str, Any] | BinaryIO | None = None,
    length: int = 0,
    then: str = "",
) -> Any:
    """The answer of the API, from JSON. `place`: below the server, or a URL; `then`: what to do after a failure."""
    headers = {"Authorization": f"Bearer {token}", "Accept": "application/json"}
    data: bytes | BinaryIO | None
    if isinstance(content, dict):
        data = json.dumps(content).encode()
        headers["Content-Type"] = "application/json"
    else:
        data = content
        if content is not None:
            headers |= {"Content-Type": "application/octet-stream", "Content-Length": str(length)}
    url = place if place.startswith("http") else server + place
    if urlsplit(url).scheme not in ("http", "https"):
        raise DiorError(f"ZENODO_URL is '{server}', which is no address such as {SERVER}")
    request = urllib.request.Request(url, data=data, headers=headers, method=method)
    try:
        with urllib.request.urlopen(request, timeout=PATIENCE_S) as answer:
            return json.loads(answer.read() or b"{}")
    except urllib.error.HTTPError as error:
        why = REFUSED.get(error.code) or f"answers {error.code}: {_message(error)}"
        raise DiorError(f"{server}: {why}{then}") from None
    except (OSError, http.client.HTTPException, ValueError) as error:
        why = getattr(error, "reason", None) or str(error) or type(error).__name__
        raise DiorError(f"{server} cannot be reached, or broke off ({why}){then}") from None


def _message(error: urllib.error.HTTPError) -> str:
    """What the API says is wrong, with what it says of single fields."""
    try:
        content = json.loads(error.read())
        fields = [f"{one.get('field')}: {one.get('message')}" for one in content.get("errors", ())]
        return "; ".join([str(content.get("message", "")), *fields])
    except (OSError, ValueError, AttributeError):
        return str(error.reason)
