"""Free text of the config where others read it: nothing in it is a tag, a link, a formula or a command.

INPUT a text that a person wrote. OUTPUT the same text as it has to stand in Markdown, in BibTeX, in JSON inside a page.
(A cell of a sheet that a spreadsheet would run is refused when the sheet is read: dior/project/schemas/.)
"""

import re

_HTML = {"&": "&amp;", "<": "&lt;", ">": "&gt;"}
# what begins emphasis, code, a link, a picture, a table cell or a formula anywhere in a line (CommonMark 0.31, 2.4)
_MARKS = re.compile(r"([\\`*_\[\]|~$])")
_TEX = {"\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}"} | {
    c: f"\\{c}" for c in "&%$#_"
}
# what ends a <script> that JSON stands in, and the two line ends that JSON knows and JavaScript did not
_IN_SCRIPT = {character: f"\\u{ord(character):04x}" for character in "<>&\u2028\u2029"}


def markdown(text: str) -> str:
    r"""One line of Markdown that shows `text`.

    >>> markdown('<b>A</b> [link](http://x) 3_d')
    '&lt;b&gt;A&lt;/b&gt; \\[link\\](http://x) 3\\_d'
    """
    line = "".join(_HTML.get(character, character) for character in " ".join(text.split()))
    return _MARKS.sub(r"\\\1", line)


def bibtex(text: str) -> str:
    r"""The value of a BibTeX field: braces are left out, as one too many ends the field.

    >>> bibtex(r'R&D \input{x}')
    'R\\&D \\textbackslash{}inputx'
    """
    line = re.sub(r"[{}]", "", " ".join(text.split()))
    return "".join(_TEX.get(character, character) for character in line)


def json_in_page(text: str) -> str:
    """JSON text that stays JSON of the same content inside of a page's <script>, as search engines want Croissant."""
    return "".join(_IN_SCRIPT.get(character, character) for character in text)
