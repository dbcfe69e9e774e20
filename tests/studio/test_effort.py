"""Minutes at the pages are noted in the sheet that people fill in, beside what they wrote."""

import re
import signal
import subprocess
import sys
from urllib.request import HTTPCookieProcessor, Request, build_opener

import pytest

from dior.studio.effort import Effort

SHEET = "# noted by Ann\nwhat\tminutes\tcount\ndriving\t40\t\nmarks\t2.5\t48\n"


@pytest.fixture
def sheet(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "config").mkdir()
    path = tmp_path / "config/effort.tsv"
    path.write_text(SHEET)
    return path


def test_minutes_are_added_to_what_is_there(sheet):
    effort = Effort()
    for _ in range(3):
        effort.add("marks", 30)
    effort.add("boxes", 14)
    assert sheet.read_text() == SHEET.replace("marks\t2.5", "marks\t3.5")
    effort.note()
    assert sheet.read_text() == SHEET.replace("marks\t2.5", "marks\t4.0") + "boxes\t0.2\t\n"
    effort.note()
    effort.add("boxes", 52)
    effort.note()
    assert "boxes\t1.1\t" in sheet.read_text()


def test_a_sheet_is_begun_where_there_is_none(sheet):
    sheet.unlink()
    Effort().add("clocks", 60)
    assert sheet.read_text() == "what\tminutes\nclocks\t1.0\n"


def test_what_a_page_tells_is_checked(client, project):
    for told in ({"page": "/", "seconds": 3}, {"page": "/marks"}, {"page": "/marks", "seconds": 61},
                 {"page": "/marks", "seconds": -1}, {"page": "/marks", "seconds": True}):  # fmt: skip
        assert client.post("/api/effort", json=told).status_code == 422
    assert client.post("/api/effort", content=b'{"page": "/marks", "seconds": NaN}').status_code == 422
    assert client.post("/api/effort", json={"page": "/marks", "seconds": 60}).status_code == 200
    assert "marks\t" in (project / "config/effort.tsv").read_text()


@pytest.mark.parametrize("before", ["", "trap '' INT; "], ids=["", "begun in the background"])
def test_what_is_not_noted_yet_is_noted_at_the_end(project, before):
    command = ["sh", "-c", before + 'exec "$@"', "sh", sys.executable, "-m", "dior", "studio", "."]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as studio:
        address = re.search(r"http\S+", studio.stdout.readline())[0]
        origin = address.partition("/?")[0]
        asking = build_opener(HTTPCookieProcessor())
        asking.open(address).read()
        told = b'{"page": "/marks", "seconds": 30}'
        asking.open(Request(f"{origin}/api/effort", told, {"Origin": origin})).read()
        studio.send_signal(signal.SIGINT)
        try:
            assert studio.wait(60) == 128 + signal.SIGINT
        finally:
            studio.kill()
    assert "marks\t0.5" in (project / "config/effort.tsv").read_text()
