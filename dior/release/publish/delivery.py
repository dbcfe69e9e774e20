"""What would be sent where: the question, the files that have to be whole for it, and how it is sent."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dior.errors import many
from dior.release.exports.recordings import settings_of
from dior.shortage import size


@dataclass(frozen=True)
class Delivery:
    """`sources`: what `dior verify` takes, each a release; `question`: for a yes or no; `send`: sends, and says where
    it is."""

    sources: tuple[list[Path], ...]
    question: str
    send: Callable[[], str]


def told(release: Path, files: Iterable[Path], what: str) -> str:
    """What would be sent, for the question: how many files, how much, under which licence."""
    sizes = [path.stat().st_size for path in files]
    licence = settings_of(release).get("license")
    return f"{many(len(sizes), what)} ({size(sum(sizes))}) of {release.resolve().name}" + (
        f", licence {licence}," if licence else ""
    )


def settings(release: Path) -> dict[str, Any]:
    """Title, version and the like of a release, "" where its provenance.json does not say."""
    keys = ("title", "version", "license", "doi", "date")
    return {"authors": [], "year": 0} | dict.fromkeys(keys, "") | settings_of(release)
