"""The packets that Vicon Nexus broadcasts when a capture starts and stops.

INPUTS   the bytes of a UDP packet: XML in UTF-8, null-terminated, `CaptureStart` or `CaptureStop` whose children hold
         their text in the attribute VALUE (Vicon's help, "UDP capture broadcast/trigger")
OUTPUTS  a `Packet`, or `Refused` with the reason
Whoever is on the network can send such bytes: no document type, so no entities, nothing large, and a name that would
be no file's.
"""

import math
from dataclasses import dataclass
from xml.parsers import expat

# chosen: room for notes of some pages
MOST_BYTES = 16384
KINDS = {"CaptureStart": "start", "CaptureStop": "stop"}
# chosen: file systems end names at 255 bytes, suffix included; a delay of more than an hour is a mistake
LONGEST_NAME = 200
LONGEST_DELAY_MS = 3_600_000


class Refused(Exception):
    """The bytes are no packet of Nexus; the text says why."""


@dataclass(frozen=True)
class Packet:
    """`kind`: start | stop. `delay_ms`: from the packet until it happens, None where it does not say.

    `packet_id`: the same in every copy of a packet, "" where it has none. `result` of a stop: SUCCESS | FAIL | CANCEL
    or what else is there.
    """

    kind: str
    name: str
    delay_ms: float | None = None
    packet_id: str = ""
    result: str = ""
    notes: str = ""
    description: str = ""
    database_path: str = ""


def parse(data: bytes) -> Packet:
    """The `Packet` in `data` (bytes). Raises Refused."""
    if len(data) > MOST_BYTES:
        raise Refused(f"larger than {MOST_BYTES} bytes")
    root, attributes, values = _elements(data.split(b"\0", 1)[0].strip())
    if root not in KINDS:
        raise Refused(f"its element is {root[:40]!r}, not CaptureStart or CaptureStop")
    name = values.get("Name", "")
    if not _is_file_name(name):
        raise Refused(f"its Name {name[:40]!r} cannot be that of a trial")
    return Packet(
        KINDS[root],
        name,
        _milliseconds(values.get("Delay", "")),
        values.get("PacketID", "").strip(),
        attributes.get("RESULT", ""),
        values.get("Notes", ""),
        values.get("Description", ""),
        values.get("DatabasePath", ""),
    )


def _elements(data: bytes) -> tuple[str, dict[str, str], dict[str, str]]:
    """Name and attributes of the root, and the VALUE of each of its children by name, the first where it is twice."""
    path: list[str] = []
    root: list[tuple[str, dict[str, str]]] = []
    values: dict[str, str] = {}

    def started(name: str, attributes: dict[str, str]) -> None:
        path.append(name)
        if len(path) == 1:
            root.append((name, attributes))
        if len(path) == 2 and "VALUE" in attributes:
            values.setdefault(name, attributes["VALUE"])

    def no_document_type(*_: object) -> None:
        raise Refused("it has a document type; entities are not read")

    # told that it is UTF-8, expat looks up no codec that the packet names
    parser = expat.ParserCreate("utf-8")
    parser.StartElementHandler, parser.EndElementHandler = started, lambda name: path.pop()
    parser.StartDoctypeDeclHandler = no_document_type
    try:
        parser.Parse(data, True)
    except (expat.ExpatError, ValueError) as error:
        raise Refused(f"not XML ({error})") from None
    return *root[0], values


def _is_file_name(name: str) -> bool:
    """Nexus names the trial's files by it; a command may do so as well."""
    plain = name.isprintable() and not set(name) & set("/\\")
    return bool(name.strip()) and plain and name not in (".", "..") and len(name) <= LONGEST_NAME


def _milliseconds(text: str) -> float | None:
    """Delay in ms; None where there is none or it cannot be meant."""
    try:
        delay = float(text)
    except ValueError:
        return None
    return delay if math.isfinite(delay) and 0 <= delay <= LONGEST_DELAY_MS else None
