"""Who may ask the studio: the table of what was tried, and that nothing is written where it is refused."""

import pytest
from starlette.testclient import TestClient
from starlette.websockets import WebSocketDisconnect

from dior.studio import app, guard
from dior.studio.workspace import Workspace
from tests.studio.conftest import HOST, TOKEN


@pytest.fixture
def stranger(project):
    """A browser that was not given the address."""
    with Workspace() as workspace:
        yield TestClient(app.made(workspace, TOKEN), base_url=HOST, follow_redirects=False)


def files(root):
    return {path: path.read_bytes() for path in sorted(root.rglob("*")) if path.is_file()}


def test_the_printed_address_becomes_a_cookie_and_leaves_the_address_bar(stranger):
    answer = stranger.get("/frames", params={"token": TOKEN, "walk": "in_1"})
    assert (answer.status_code, answer.headers["location"]) == (303, "/frames?walk=in_1")
    cookie = answer.headers["set-cookie"]
    assert "HttpOnly" in cookie and "SameSite=strict" in cookie and TOKEN in cookie
    assert stranger.get("/frames").status_code == 200


@pytest.mark.parametrize(
    ("path", "location"),
    [
        ("//evil.example/", "/evil.example/"),
        ("/%5Cevil.example/", "/%5Cevil.example/"),
        ("/%09/evil.example/", "/%09/evil.example/"),
        ("/%2F/evil.example/", "/evil.example/"),
        ("/http://evil.example/", "/http://evil.example/"),
    ],
)
def test_a_redirect_leads_to_no_other_computer(stranger, path, location):
    assert stranger.get(f"{HOST}{path}", params={"token": TOKEN}).headers["location"] == location


@pytest.mark.parametrize(
    ("method", "path", "headers", "status"),
    [
        ("GET", "/", {"host": "evil.example"}, 400),
        ("GET", "/", {"host": "127.0.0.1.evil.example"}, 400),
        ("GET", "/", {"origin": "http://evil.example"}, 403),
        ("GET", "/", {"origin": "null"}, 403),
        ("GET", "/", {"origin": "http://127.0.0.1:9999"}, 403),
        ("GET", "/", {"origin": "http://localhost:8125"}, 403),
        ("POST", "/api/walks", {"origin": ""}, 403),
        ("DELETE", "/", {"origin": "http://evil.example"}, 403),
        ("GET", "/picture?walk=../../etc&camera=cam01&frame=0", {}, 422),
        ("GET", "/picture?walk=in_1&camera=../cam01&frame=0", {}, 422),
        ("GET", "/picture?walk=in_1&camera=cam01&frame=-1", {}, 422),
        ("GET", "/picture?walk=in_1&camera=cam01&frame=1e3", {}, 422),
        ("GET", "/picture?walk=in_1&camera=cam01&frame=99999999999999", {}, 422),
        ("GET", "/picture?walk=in_1&camera=cam01&frame=%EF%BC%91", {}, 422),
        ("GET", "/picture", {}, 422),
        ("GET", "/static/../studio.py", {}, 404),
        ("GET", "/static/%2e%2e/studio.py", {}, 404),
        ("GET", "/static/..%2f..%2f..%2fpyproject.toml", {}, 404),
        ("GET", "/config/config.yaml", {}, 404),
        ("PUT", "/", {}, 405),
    ],
)
def test_what_is_foreign_or_malformed_is_refused_and_writes_nothing(client, project, method, path, headers, status):
    before = files(project / "config")
    sent = {key: value for key, value in headers.items() if value}
    if headers.get("origin") == "":
        del client.headers["origin"]
    answer = client.request(method, path, headers=sent)
    assert answer.status_code == status
    assert files(project / "config") == before


@pytest.mark.parametrize("path", ["/", "/frames", "/api/walks", "/picture?walk=in_1&camera=cam01&frame=0", "/static/a"])
@pytest.mark.parametrize("cookie", ["", "wrong", "a-token-and-more", "A-TOKEN", "\xe4"])
def test_without_the_token_nothing_is_shown(stranger, path, cookie):
    headers = {"cookie": f"dior_studio_8125={cookie}".encode("latin-1")} if cookie else {}
    assert stranger.get(path, headers=headers).status_code == 403
    assert stranger.get(path, params={"token": cookie}).status_code == 403


def test_too_much_is_refused_before_it_is_read(client):
    assert client.post("/api/walks", content=b"x" * (guard.MOST_BYTES + 1)).status_code == 413


def test_there_is_no_websocket(client):
    with pytest.raises(WebSocketDisconnect), client.websocket_connect("/"):
        pass


def test_pages_forbid_inline_script_and_eval(client):
    for path in ("/", "/frames", "/nothing", "/static/studio.js"):
        answer = client.get(path, headers={"accept": "text/html"})
        policy = dict(one.strip().split(" ", 1) for one in answer.headers["content-security-policy"].split(";"))
        assert policy["script-src"] == "'self'" and policy["default-src"] == "'none'"
        assert policy["frame-ancestors"] == "'none'"
        assert answer.headers["x-content-type-options"] == "nosniff"
    assert "<script>" not in client.get("/frames").text and "onclick=" not in client.get("/frames").text
