"""What no page sends, sent to every address: one sentence, nothing is written, and the studio goes on."""

import json

import pytest

from tests.studio.test_guard import files

INDOORS, FAR = {"walk": "in_1", "camera": "cam01"}, {"walk": "out_1", "camera": "cam03"}
MARK = {"key": ["in_1", 3, "LASI"], "before": [10, 20], "after": [11, 21]}
NUDGE = {"key": "nudge", "before": {"azimuth_deg": 0.2}, "after": {"azimuth_deg": 0.3}}
SENT = {
    "/api/marks/change": INDOORS | {"changes": [MARK]},
    "/api/boxes": FAR | {"frame": 0, "drawer": "A", "before": None, "after": [1, 2, 3, 4]},
    "/api/checks/change": INDOORS | {"frame": 0, "joint": "left_hip", "before": None, "after": [1, 2]},
    "/api/long-range/fit": {"session": "field", "camera": "cam03", "azimuth_deg": 0},
    "/api/long-range/save": {"session": "field", "camera": "cam03", "changes": [NUDGE]},
    "/api/time/save": INDOORS | {"before": None, "after": {"offset_s": 0.1}},
    "/api/who": {"walk": "out_1", "before": None, "after": [{"camera": "cam01", "frame": 0, "u": 1, "v": 1}]},
    "/api/fill": {"path": "config/config.yaml", "line": 1, "key": "data_root", "value": "x"},
    "/api/run": {"do": "nothing"},
    "/api/effort": {"page": "/marks", "seconds": 1},
}
WORDS = {
    "no number": "NaN",
    "without end": "-Infinity",
    "too large": "1e999",
    "too long": "1" + "0" * 400,
    "half a letter": '"\\ud800"',
    "deep": "[" * 300 + "]" * 300,
    "deeper": '{"a": ' * 900 + "1" + "}" * 900,
}


def places(content, at=()):
    """The ways to all that is in lists and objects."""
    inside = content.items() if isinstance(content, dict) else enumerate(content) if isinstance(content, list) else ()
    for key, one in inside:
        yield (*at, key)
        yield from places(one, (*at, key))


def with_word(content, at, word):
    """JSON of the content with another word at one of its places."""
    content = json.loads(json.dumps(content))
    there = content
    for key in at[:-1]:
        there = there[key]
    there[at[-1]] = "the word"
    return json.dumps(content).replace('"the word"', word)


@pytest.mark.parametrize("path", SENT)
def test_what_cannot_be_is_refused_and_nothing_is_written(client, project, path):
    before = files(project / "config")
    *_, last = places(SENT[path])
    for at in (next(places(SENT[path])), last):
        for what, word in WORDS.items():
            answer = client.post(path, content=with_word(SENT[path], at, word))
            assert answer.status_code == 422, (at, what, answer.text)
            assert 0 < len(answer.json()["error"]) < 500, (at, what)
    assert files(project / "config") == before


def test_a_click_nowhere_is_refused_or_found_nothing(client):
    for u in ("nan", "inf", "-inf", "1e400", ""):
        assert client.get("/api/marks/snap", params=INDOORS | {"frame": 3, "u": u, "v": 5}).status_code == 422, u
    for u in ("1e300", "-1e300"):
        assert not client.get("/api/marks/snap", params=INDOORS | {"frame": 3, "u": u, "v": 5}).json()["found"]
