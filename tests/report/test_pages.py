"""What people wrote is text in every page."""

from dior.report import pages

HOSTILE = "<script>alert(1)</script>\"'><img src=x onerror=f()> [click](javascript:f)"


def test_every_template_escapes_what_it_shows():
    shown = pages.environment().from_string('<a title="{{ title }}">{{ title }}</a>').render(title=HOSTILE)
    assert shown.count("<") == 2 and shown.count('"') == 2
    for path in sorted(pages.TEMPLATES.glob("*.j2")):
        text = path.read_text()
        assert "safe" not in text.replace("unsafe", "") and "autoescape" not in text, path.name
        # what a person wrote is never an address
        assert "{{ title" not in "".join(part.split('"')[0] for part in text.split('href="')[1:]), path.name
