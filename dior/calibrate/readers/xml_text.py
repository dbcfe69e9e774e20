"""XML that other programs write, parsed so that nothing in it can hang or surprise.

INPUTS   the text of a file
OUTPUTS  its root element
Entities are refused: no calibration has any, and they are how a small file becomes a large one. So is what is nested
beyond all reason, before a tree is made of it.
"""

import re
from typing import TYPE_CHECKING, Any

import numpy as np

from dior.arrays import AnyPath, Floats
from dior.calibrate.readers.given import numbers
from dior.errors import DiorError

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

# chosen: calibrations have 5 levels
MOST_DEPTH = 40
# chosen, characters: what is parsed before the depth is looked at
AT_ONCE = 1 << 16


def root_of(text: str, path: AnyPath) -> "Element":
    """The root of an XML text. Raises DiorError where it is not well-formed, with the line."""
    from xml.etree import ElementTree

    if re.search(r"<!(DOCTYPE|ENTITY)", text):
        raise DiorError(f"{path}: declares a document type, as no calibration does; is it another file?")
    # the declared encoding is that of the file, which has been decoded
    text = re.sub(r"^\s*<\?xml[^>]*\?>", "", text)
    parser: Any = ElementTree.XMLPullParser(("start", "end"))
    depth = 0
    root: Element | None = None
    try:
        for start in range(0, len(text), AT_ONCE):
            parser.feed(text[start : start + AT_ONCE])
            for event, element in parser.read_events():
                root = element if root is None else root
                depth += 1 if event == "start" else -1
                if depth > MOST_DEPTH:
                    raise DiorError(f"{path}: nested {MOST_DEPTH} times; is a tag left open?")
        parser.close()
    except ElementTree.ParseError as error:
        raise DiorError(f"{path} line {error.position[0]}: not valid XML ({error}); copy the file again") from None
    if root is None:
        raise DiorError(f"{path}: not valid XML (there is nothing in it)")
    return root


def attributes(element: "Element | None", names: list[str], where: str) -> Floats:
    """Numbers (N,) in the attributes of an element. Raises DiorError for one that is missing or is none."""
    found = {} if element is None else dict(element.attrib)
    return np.array([float(numbers(found, name, [()], where)) for name in names])


def listed(element: "Element", name: str, count: int, where: str) -> Floats:
    """Numbers (count,) in one attribute, with blanks between them."""
    words = {name: element.attrib[name].split()} if name in element.attrib else {}
    return numbers(words, name, [(count,)], where)
