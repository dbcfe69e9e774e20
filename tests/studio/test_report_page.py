"""The report as the studio shows it: whole, and unable to reach the studio, whatever is written in it."""

import base64
import hashlib

import pytest
from starlette.testclient import TestClient

from dior.studio import app, report_page
from dior.studio.workspace import Workspace
from tests.studio import browser
from tests.studio.conftest import HOST, TOKEN

BASE = f"/report/{report_page.key_of(TOKEN)}/"
SCRIPT = "document.title = 'run'"


@pytest.fixture
def report(project):
    folder = project / report_page.FOLDER
    (folder / "assets").mkdir(parents=True)
    (folder / "index.html").write_text(f"<title>report</title><script>{SCRIPT}</script><script src='a.js'></script>")
    (folder / "assets/one.svg").write_text("<svg xmlns='http://www.w3.org/2000/svg'><script>0</script></svg>")
    (folder / "assets/away").symlink_to(project / "config/config.yaml")
    return folder


@pytest.fixture
def stranger(project):
    """Who has no cookie, as the report's own pages in their sandbox."""
    with Workspace() as workspace:
        yield TestClient(app.made(workspace, TOKEN), base_url=HOST, follow_redirects=False)


def policy_of(answer):
    parts = [one.strip().partition(" ") for one in answer.headers["content-security-policy"].split(";")]
    return {name: words.split() for name, _, words in parts}


def test_the_first_page_links_to_the_report_where_there_is_one(client, project):
    assert "/report/" not in client.get("/").text
    (project / report_page.FOLDER).mkdir(parents=True)
    (project / report_page.FOLDER / "index.html").write_text("")
    assert f'href="{BASE}index.html"' in client.get("/").text
    assert TOKEN not in BASE


def test_a_page_of_the_report_runs_its_own_scripts_in_a_sandbox(stranger, report):
    answer = stranger.get(BASE + "index.html")
    policy = policy_of(answer)
    own = base64.b64encode(hashlib.sha256(SCRIPT.encode()).digest()).decode()
    assert answer.status_code == 200 and policy["script-src"] == [HOST + BASE, f"'sha256-{own}'"]
    assert policy["sandbox"] == ["allow-scripts"] and policy["default-src"] == ["'none'"]
    assert "connect-src" not in policy and policy["form-action"] == policy["base-uri"] == ["'none'"]
    assert all("'self'" not in words and "'unsafe-eval'" not in words for words in policy.values())
    assert answer.headers["x-content-type-options"] == "nosniff"
    # a picture that is opened alone is a document, too
    drawn = policy_of(stranger.get(BASE + "assets/one.svg"))
    assert drawn["sandbox"] == ["allow-scripts"] and drawn["script-src"] == [HOST + BASE]


@pytest.mark.parametrize(
    ("method", "path", "headers", "status"),
    [
        ("GET", "/report/", {}, 403),
        ("GET", f"/report/{TOKEN}/index.html", {}, 403),
        ("GET", f"/report/{'0' * 64}/index.html", {}, 403),
        ("GET", "/report/\xe4/index.html", {}, 403),
        ("GET", f"/x{BASE}index.html", {}, 403),
        ("GET", f"{BASE}../../api/walks", {}, 403),
        ("GET", BASE + "index.html", {"host": "evil.example"}, 400),
        ("GET", BASE + "index.html", {"origin": "http://evil.example"}, 403),
        ("GET", BASE + "index.html", {"origin": "null"}, 403),
        ("POST", BASE + "index.html", {"origin": HOST}, 403),
        ("GET", BASE, {}, 404),
        ("GET", BASE + "assets", {}, 404),
        ("GET", BASE + "nothing.html", {}, 404),
        ("GET", BASE + "assets/away", {}, 404),
        ("GET", BASE + "%2e%2e/evaluate/metrics.csv", {}, 404),
        ("GET", BASE + "..%2f..%2fconfig/config.yaml", {}, 404),
        ("GET", BASE + "/etc/passwd", {}, 404),
        ("GET", BASE + "a%00b", {}, 404),
        ("GET", BASE + "a" * 5000, {}, 404),
    ],
)
def test_the_key_opens_files_of_the_report_and_nothing_else(stranger, report, method, path, headers, status):
    assert stranger.request(method, path, headers=headers).status_code == status


def test_the_key_is_no_cookie(stranger, report):
    key = report_page.key_of(TOKEN)
    assert stranger.get("/", params={"token": key}).status_code == 403
    assert stranger.get("/", headers={"cookie": f"dior_studio_8125={key}"}).status_code == 403
    assert "set-cookie" not in stranger.get(BASE + "index.html").headers


HOSTILE = """<!doctype html><title>report</title><img id="picture" src="/picture?walk=indoor_01&camera=cam01&frame=0">
<script>
(async () => {
  const told = {origin: self.origin, opener: String(window.opener)};
  try { told.cookie = document.cookie; } catch (error) { told.cookie = error.name; }
  const asked = [["get", "/api/walks"], ["post", "/api/run", {method: "POST", body: '{"do": "dry"}'}],
                 ["own", "index.html"], ["blind", "/api/walks", {mode: "no-cors", credentials: "include"}]];
  for (const [name, path, options] of asked) {
    try { await fetch(path, options); told[name] = "answered"; } catch (error) { told[name] = "refused"; }
  }
  told.beacon = navigator.sendBeacon("/api/run", "{}");
  try { Function("1")(); told.eval = "run"; } catch (error) { told.eval = "refused"; }
  const added = document.createElement("script");
  added.textContent = "document.title = 'added'";
  document.head.append(added);
  await new Promise((done) => setTimeout(done, 300));
  told.title = document.title;
  told.picture = document.querySelector("#picture").naturalWidth;
  document.body.dataset.told = JSON.stringify(told);
})();
</script>"""


@pytest.mark.slow
def test_in_a_browser_the_report_is_whole_and_a_hostile_one_reaches_nothing(ran, chromium):
    import json

    browser.run(ran)
    with browser.served(ran) as address, browser.page(chromium, address) as one:
        with one.context.expect_page() as opened:
            one.get_by_role("link", name="Open the report").click()
        report = opened.value
        said = []
        report.on("console", lambda message: said.append(message.text) if message.type == "error" else None)
        report.on("pageerror", lambda error: said.append(str(error)))
        report.wait_for_load_state("load")
        report.reload()
        report.wait_for_load_state("load")
        base = report.url.rpartition("/")[0]
        for path in ("sequences/indoor_01.html", "sequences/indoor_01.3d.html"):
            report.goto(f"{base}/{path}")
            report.wait_for_load_state("load")
        report.wait_for_selector("canvas")
        assert not said, said
        index = ran / report_page.FOLDER / "index.html"
        index.write_text(HOSTILE)
        report.goto(f"{base}/index.html")
        report.wait_for_selector("body[data-told]", timeout=60_000)
        told = json.loads(report.get_attribute("body", "data-told"))
        assert told["origin"] == "null" and told["opener"] == "null" and told["cookie"] == "SecurityError"
        assert {told[name] for name in ("get", "post", "own", "blind", "eval")} == {"refused"}
        assert told["title"] == "report" and told["picture"] == 0
        assert one.request.get(address.partition("/?")[0] + "/api/run").json()["state"] == "none"
