"""When a release was published: the day or the year that `release:` of the config gives. Loads no numerics."""

from datetime import date
from typing import Any

from dior.errors import DiorError


def check(release: dict[str, Any]) -> None:
    """Raise DiorError where the day of publication is none, or lies in another year than the one that is given."""
    day, year = release["date"], release["year"]
    if not day:
        return
    try:
        date.fromisoformat(day)
    except ValueError:
        raise DiorError(
            f"config/config.yaml: 'release.date' is '{day}', which is no day; write it as 2026-11-30"
        ) from None
    if year and year != year_of(release):
        raise DiorError(f"config/config.yaml: 'release.date' is {day} and 'release.year' {year}; leave the year at 0")


def year_of(release: dict[str, Any]) -> int:
    """The year of publication, 0 while there is none."""
    return int(release["date"][:4]) if release["date"] else int(release["year"])


def published(release: dict[str, Any]) -> str:
    """The day of publication, or its year where no day is given, "" while there is none."""
    return release["date"] or (str(release["year"]) if release["year"] else "")
