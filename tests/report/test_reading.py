"""How the pages are read: what is folded, what a dark page, a phone and paper show, and what is told once."""

import re
from html.parser import HTMLParser

import pytest

from dior.report import colours, findings, lights, pages
from dior.report.overview import CameraRow
from dior.report.troubles import Trouble
from tests.report.test_report import made  # noqa: F401

STYLE = (pages.TEMPLATES / "style.css").read_text()


class Seen(HTMLParser):
    """`headings`: (level, within a details); `scrolls`: attributes of the scroll areas; `ids`."""

    def __init__(self, text):
        super().__init__()
        self.headings, self.scrolls, self.ids, self.folded = [], [], [], 0
        self.empty_heads, self.head = 0, None
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        attrs = dict(attrs)
        self.folded += tag == "details"
        if re.fullmatch(r"h[1-6]", tag):
            self.headings.append((int(tag[1]), self.folded))
        if attrs.get("class") == "scroll":
            self.scrolls.append(attrs)
        if "id" in attrs:
            self.ids.append(attrs["id"])
        self.head = "" if tag == "th" else self.head

    def handle_data(self, data):
        self.head = self.head + data if self.head is not None else None

    def handle_endtag(self, tag):
        self.folded -= tag == "details"
        if tag == "th":
            self.empty_heads += not self.head.strip()
            self.head = None


def all_pages(out):
    return {path.relative_to(out).as_posix(): Seen(path.read_text()) for path in sorted(out.rglob("*.html"))}


def test_headings_go_down_one_level_at_a_time_and_no_id_is_there_twice(made):  # noqa: F811
    for name, seen in all_pages(made[0]).items():
        levels = [level for level, _ in seen.headings]
        assert levels[0] == 1 and levels.count(1) == 1, name
        assert all(b <= a + 1 for a, b in zip(levels, levels[1:], strict=False)), name
        assert len(set(seen.ids)) == len(seen.ids), name
        assert not seen.empty_heads, name


def test_tables_that_scroll_can_be_reached_by_keys_and_have_names(made):  # noqa: F811
    for name, seen in all_pages(made[0]).items():
        for attrs in seen.scrolls:
            assert attrs.get("tabindex") == "0" and attrs.get("aria-label") and attrs.get("role"), name


def test_all_below_the_table_of_cameras_is_folded_and_in_the_navigation(made):  # noqa: F811
    out, text = made
    parts = re.findall(r'<details class="part" id="([\w-]+)">', text)
    assert {"dataset", "figures", "section-1", "scenes", "recognised", "limits"} <= set(parts)
    nav = re.search(r"<nav.*?</nav>", text, re.S)[0]
    assert set(re.findall(r'href="#([\w-]+)"', nav)) == {"headline", "summary", *parts}
    assert text.index("</header>") < text.index("<nav") < text.index("<main>")
    after = text[text.index('<section id="summary">') :]
    assert "<section" not in after[1:] and after.count('<details class="part"') == len(parts)


def test_there_are_colours_for_a_dark_page_and_rules_for_paper_and_phones():
    light, dark = (re.findall(r":root \{(.*?)\}", STYLE, re.S))[:2]
    names = set(re.findall(r"--(\w+):", light.split("--good")[0]))
    assert names == {"ink", "soft", "line", "paper", "card", "link"} <= set(re.findall(r"--(\w+):", dark))
    assert f"--card: {colours.AT_NIGHT[colours.WHITE]}" in dark and f"--ink: {colours.AT_NIGHT[colours.DARK]}" in dark
    # nothing outside the variables is white, but what is written on a coloured light
    assert not re.search(r"background: #fff\b", STYLE)
    assert "position: sticky" in STYLE and "@media (prefers-color-scheme: dark)" in STYLE
    paper = STYLE[STYLE.index("@media print") :]
    assert "nav, .tools, .more, video { display: none; }" in paper and "details::details-content" in paper
    assert "display: table-row" in paper


@pytest.mark.parametrize("name", ["--ink", "--soft", "--link", "--look", "--bad"])
def test_words_can_be_read_on_light_and_dark_paper(name):
    from tests.report.test_plots import contrast, luminance

    for block in re.findall(r":root \{(.*?)\}", STYLE, re.S)[:2]:
        values = dict(re.findall(r"(--\w+): (#\w+)", block))
        ink, *papers = ((v if len(v) == 7 else "#" + "".join(2 * c for c in v[1:])) for v in
                        (values[name], values["--paper"], values["--card"]))  # fmt: skip
        for paper in papers:
            assert contrast(luminance(ink), luminance(paper)) >= 4.5


def test_a_phone_shows_the_interval_and_n_of_every_key_figure(made):  # noqa: F811
    _, text = made
    table = text[text.index('aria-label="Table of the key figures"') :].split("</table>")[0]
    assert '<table class="cards">' in table
    rows = table.split("<tr>")[2:]
    assert rows and all('data-label="n"' in row for row in rows)
    assert all('data-label="95 %"' in row for row in rows if " to " in row)
    phone = STYLE[STYLE.index("@media (max-width: 40rem)") : STYLE.index("@media print")]
    assert "content: attr(data-label)" in phone and "display: none" in phone
    assert [line for line in phone.splitlines() if "display: none" in line] == [
        "  .cards thead { display: none; }",
        "  .cards th[scope=row], .cards .why { display: block; min-width: 0; } .cards .why:empty { display: none; }",
    ]


def row(*troubles):
    return CameraRow("lab", "cam01", "close", "look", lights.WORDS["look"], (), troubles, ())


def test_the_index_tells_no_finding_that_the_table_of_cameras_tells():
    told = Trouble("bad", "clock_off", "the clock is off", ("walk_1",), None, (("walk_1", "labels are off"),))
    found = [
        ("walk_1/cam01", "error", "clock_off", "the clock is off"),
        ("walk_1", "warning", "high_error", "labels are off"),
        ("walk_1", "info", "adjusted", "all is well"),
        ("release", "warning", "pictures_unanswered", "of 2 people nothing is known"),
    ]
    assert findings.untold(found, [row(told)], {found[2]}) == [found[-1]]
    assert findings.untold(found, [row()], {found[2]}) == [found[0], found[1], found[-1]]


def test_findings_that_say_the_same_are_one_with_their_walks():
    walks = [f"walk_{i}" for i in range(5)]
    found = [(walk, "warning", "gap", "no detections for 2 s") for walk in walks[:4]]
    found += [("walk_4", "warning", "gap", "no detections for 3 s")]
    found += [("walk_1/cam01", "error", "broken", "it is broken"), ("walk_1/cam02", "error", "broken", "it is broken")]
    found += [("lab", "warning", "alone", "only this")]
    broken, alone, gap = findings.grouped(found * 2, walks)
    assert (broken.level, broken.where, broken.others) == ("bad", "in 2 recordings: walk_1 cam01, walk_1 cam02", ())
    assert (alone.where, alone.text) == ("lab", "only this")
    assert gap.where == "in 5 walks: walk_0, walk_1, walk_2, ..." and gap.text == "no detections for 2 s"
    assert gap.others == (("walk_4", "no detections for 3 s"),)
