"""SQLite files as ROS 2 writes them (.db3), every schema version.

INPUTS   a .db3 file, `opened`.
OUTPUTS  topics and `Message`s in the order in which they were written; only the bytes that are fetched are read.
Plain SQL instead of rosbags' reader, which gives whole messages in the order of their stamps only.
ValueError or sqlite3.Error mean damage.
"""

import sqlite3
from contextlib import closing, contextmanager
from functools import partial
from pathlib import Path

from dior.ingest.containers.source import Message, first, full_kind, full_name, plain

MAGIC = b"SQLite format 3\0"
HINT = "`ros2 bag reindex`, or `sqlite3 <file> .recover`"


@contextmanager
def opened(path):
    """The database of a .db3 file, for `topics` and `messages`."""
    journal = Path(f"{path}-wal")
    if journal.is_file() and journal.stat().st_size:
        raise ValueError(f"its last messages are still in {journal.name}")
    with open(path, "rb") as stream:
        page = int.from_bytes(stream.read(18)[16:], "big")
    # SQLite takes a last page that is cut off for one that ends in zeros; a page size of 1 means 65536
    if not page or Path(path).stat().st_size % (65536 if page == 1 else page):
        raise ValueError("its last page is cut off")
    # immutable: no lock and no file is written beside a bag that may lie on a read-only disk
    base = sqlite3.connect(f"{Path(path).absolute().as_uri()}?mode=ro&immutable=1", uri=True)
    with closing(base):
        yield base


def topics(base):
    """Topics: list of (topic, message type, number of messages)."""
    declared = _declared(base)
    counts = dict(base.execute("SELECT topic_id, count(*) FROM messages GROUP BY topic_id"))
    return [(topic, kind, counts.get(i, 0)) for i, (topic, kind, _) in declared.items()]


def messages(base, wanted, received=None):
    """Yield the `Message`s of the topics `wanted` (full names), only of the receive stamps `received` if given."""
    declared = {i: what for i, what in _declared(base).items() if what[0] in wanted}
    for row, topic, receive_ns in base.execute("SELECT rowid, topic_id, timestamp FROM messages ORDER BY rowid"):
        if not isinstance(receive_ns, int):
            raise ValueError(f"message {row} has no receive stamp")
        if topic in declared and (received is None or receive_ns in received):
            yield Message(*declared[topic], receive_ns, partial(plain, partial(_first, base, row)))


def _first(base, row, count):
    with base.blobopen("messages", "data", row, readonly=True) as blob:
        return first(lambda at, size: blob.read(size), 0, len(blob), count)


def _declared(base):
    """Topics by number: (topic, message type, wire)."""
    rows = base.execute("SELECT id, name, type, serialization_format FROM topics ORDER BY id").fetchall()
    for row in rows:
        if not all(isinstance(word, str) for word in row[1:]):
            raise ValueError(f"topic {row[0]} is damaged")
    return {i: (full_name(topic), full_kind(kind), wire) for i, topic, kind, wire in rows}
