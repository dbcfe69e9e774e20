"""Who agreed to what: the columns consent_<purpose> of config/subjects.tsv.

| purpose | a yes allows | an empty cell, or no such column, is |
|---|---|---|
| processing | to use the person's recordings at all | as release |
| release | to publish the labels and tables, and to use the person's walks for poses that are published | no |
| pictures | to publish the pictures | no |

Each needs the one before it. INPUTS: rows of the sheets. OUTPUTS: answers, and the rows without those of people who may
not be processed. Loads no numerics.
"""

from dior.errors import DiorError, nearest
from dior.project.schema_check import Name, Row, Rows

PURPOSES = ("processing", "release", "pictures")
YES = ("1", "true", "yes")


def consents(subject_row: Row, purpose: str = "release") -> bool:
    """Whether a subject (a row of subjects.tsv) agreed to a purpose. Only a plain yes counts.

    Raises DiorError for a purpose that there is not.
    """
    if purpose not in PURPOSES:
        raise DiorError(f"there is no consent to '{purpose}'{nearest(purpose, PURPOSES)}; it is one of {PURPOSES}")
    said = {name: subject_row.get(f"consent_{name}", "").lower() for name in PURPOSES}
    said["processing"] = said["processing"] or said["release"]
    return all(said[name] in YES for name in PURPOSES[: PURPOSES.index(purpose) + 1])


def processed(rows: dict[Name, Row], people: Rows, whose: str = "subject") -> tuple[dict[Name, Row], dict[Name, Row]]:
    """The rows of a sheet, by name, of those who may be processed, and the others.

    `people`: rows of subjects.tsv by name; `whose`: the column that names one of them. A row of somebody who is not
    among them is kept, so that the check complains about it.
    """
    withheld = {
        name: row
        for name, row in rows.items()
        if row[whose] in people and not consents(people[row[whose]], "processing")
    }
    return {name: row for name, row in rows.items() if name not in withheld}, withheld
