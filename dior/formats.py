"""What a reader says, for people, of the files that it reads.

The constant DESCRIPTIONS of a reader's module holds one of these for each kind of file. `dior formats` prints them, and
the tables of the docs are made of them (docs/format_tables.py); no step reads them, so that an edit re-runs nothing
(`dior.tables.code_hash`). A field is a column of the table, called as it is; `key` is the name in the registry.
"""

from dataclasses import dataclass
from typing import TypeAlias


@dataclass(frozen=True)
class Sample:
    """What a reader was tried on: `variant` of the format, what was `read` of it, and where the `sample` came from."""

    variant: str
    read: str
    sample: str


@dataclass(frozen=True)
class BagFormat:
    """`storage`: how the messages lie in the file."""

    key: str
    format: str
    storage: str
    compression: str
    note: str


@dataclass(frozen=True)
class MessageFormat:
    """A type of message in bags; `key`: its name; `what`: what it is."""

    key: str
    what: str
    read: str
    refused: str


@dataclass(frozen=True)
class VideoFormat:
    """Recordings that are no bags; `tried`: what of it tests write and read."""

    key: str
    format: str
    read: str
    tried: str


@dataclass(frozen=True)
class DetectionFormat:
    """`key`: `detector.format` of config.yaml; `file`: what `detections` in the sheet names; `frame`: where the number
    of the picture is; `score`: where the joints' is; `nobody`: how a picture without a person looks."""

    key: str
    tool: str
    file: str
    joints: str
    frame: str
    score: str
    nobody: str
    refused: str
    samples: tuple[Sample, ...]


@dataclass(frozen=True)
class CalibrationFormat:
    """`name`: what `name` in a camera's YAML may be; `convention`, `unit`, `world`: of the pose; `lens`: its models."""

    key: str
    file: str
    name: str
    convention: str
    unit: str
    world: str
    lens: str
    checked: str
    sample: str


@dataclass(frozen=True)
class MocapFormat:
    """`key`: `format` in config/markers.tsv; `first_frame`: where the number of the first frame stored is; `up`: the
    vertical axis."""

    key: str
    tool: str
    first_frame: str
    unit: str
    up: str
    checked: str
    sample: str


Format: TypeAlias = BagFormat | MessageFormat | VideoFormat | DetectionFormat | CalibrationFormat | MocapFormat
