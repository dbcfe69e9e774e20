"""A calibration file as a reader is given it: its bytes, and what is in them as text, XML or YAML.

INPUTS   a path
OUTPUTS  `Source`; each way to read it is tried when a reader first asks, and gives nothing of a file of another kind
"""

import re
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dior.arrays import AnyPath
from dior.calibrate.readers import xml_text
from dior.project.plain_text import bytes_of, text_of
from dior.project.yaml_file import yaml_of

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

# chosen: a camera has some hundred bytes; Vicon's, which have their thresholds besides, some ten thousand
MOST_BYTES, MOST_BYTES_XML = 1 << 20, 1 << 22


@dataclass(frozen=True)
class Source:
    """The file `path`. Raises DiorError, when it is asked for its content, for a file that cannot be read so."""

    path: AnyPath

    @property
    def stem(self) -> str:
        """The file's name without its ending."""
        return Path(self.path).stem

    @cached_property
    def content(self) -> bytes:
        return bytes_of(self.path, self.path, MOST_BYTES_XML)

    @cached_property
    def is_xml(self) -> bool:
        return self.content.removeprefix(b"\xef\xbb\xbf").lstrip().startswith(b"<")

    @cached_property
    def text(self) -> str:
        return text_of(self.path, self.path, MOST_BYTES_XML if self.is_xml else MOST_BYTES)

    @cached_property
    def first_line(self) -> str:
        """The first line that is neither empty nor a comment, from its first letter."""
        found = re.search(r"^[ \t]*([^\s#].*)$", self.text, re.MULTILINE)
        return found[1] if found else ""

    @cached_property
    def xml(self) -> "Element | None":
        """The root of an XML file, None of any other."""
        return xml_text.root_of(self.text, self.path) if self.is_xml else None

    def elements(self, root: str, place: str) -> "list[Element]":
        """The elements at a `place` of an XML file whose root is called `root`, none of any other file."""
        return self.xml.findall(place) if self.xml is not None and self.xml.tag == root else []

    @cached_property
    def has_opencv_matrix(self) -> bool:
        """Whether a matrix is marked as OpenCV's, by a tag or in JSON by its kind."""
        return "opencv-matrix" in self.text

    @cached_property
    def mapping(self) -> dict[Any, Any]:
        """The keys of a YAML or JSON file, none of any other; without OpenCV's directive and the tags of its matrices,
        which no reader but its own understands."""
        if self.is_xml:
            return {}
        plain = re.sub(r"!!opencv-(nd-)?matrix", "", re.sub(r"^%YAML:1\.0", "# ", self.text))
        content = yaml_of(plain, self.path)
        return content if isinstance(content, dict) else {}
