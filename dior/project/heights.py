"""People's heights stay in config/subjects.tsv: a step that needs them is told whose, and reads them there.

What a rule passes to a step is kept in Snakemake's records and printed in its logs. INPUTS: metric facts of a session
(`Project.metric_facts`), subjects.tsv. OUTPUTS: the same facts without, and with, the numbers. Loads no numerics.
"""

from pathlib import Path
from typing import Any

from dior.errors import DiorError
from dior.project.schema_check import read_sheet

# keys of the facts that are lists of people with their heights
OF_PEOPLE = ("heights", "stature")
NUMBERS = ("height_m", "sigma_m")


def without(known: dict[str, Any]) -> dict[str, Any]:
    """The facts without the numbers of people's heights."""

    def bare(facts: list[dict[str, Any]]) -> list[dict[str, Any]]:
        return [{key: value for key, value in fact.items() if key not in NUMBERS} for fact in facts]

    return known | {key: bare(known[key]) for key in OF_PEOPLE if key in known}


def filled(known: dict[str, Any], people: Path | None) -> dict[str, Any]:
    """The facts with the heights (m) of `people`, a subjects.tsv, by the pseudonym.

    Raises DiorError where one is not there any more.
    """
    if people is None or not any(known.get(key) for key in OF_PEOPLE):
        return known
    rows = {row["pseudonym"]: row for row in read_sheet(people, "subjects", "subject")[0].values()}

    def whole(fact: dict[str, Any]) -> dict[str, Any]:
        row = rows.get(fact["subject"], {})
        if not row.get("height_m"):
            raise DiorError(f"{people}: '{fact['subject']}' has no height_m any more; run the workflow again")
        return fact | {"height_m": float(row["height_m"]), "sigma_m": float(row["height_sigma_m"] or 0)}

    return known | {key: [whole(fact) for fact in known[key]] for key in OF_PEOPLE if key in known}


def of(subject: str, people: Path | None) -> tuple[float, float] | None:
    """Height and its standard error (m, 0 where not said) of a subject, by the pseudonym, in `people`, a subjects.tsv.

    None where there is no sheet, no such subject or no height.
    """
    if people is None:
        return None
    rows = read_sheet(people, "subjects", "subject")[0].values()
    height = [(row["height_m"], row["height_sigma_m"]) for row in rows if row["pseudonym"] == subject]
    return (float(height[0][0]), float(height[0][1] or 0)) if height and height[0][0] else None
