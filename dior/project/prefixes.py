"""What a person's labels begin with in a C3D is often the name: it stays in config/, and a step reads it there.

INPUTS   a pseudonym, subjects.tsv and the session's session.yaml. OUTPUTS: the name in the sheet, and the prefix.
What a rule passes to a step is kept in Snakemake's records and printed in its logs. Loads no numerics.
"""

from pathlib import Path

from dior.project import schema_check


def name_and_prefix(pseudonym: str, people: Path, session_file: Path) -> tuple[str, str]:
    """The person's name, and what `mocap.prefix` of the session says of it, "" where it says nothing.

    Raises DiorError for files that cannot be read.
    """
    rows, _ = schema_check.read_sheet(people, "subjects", "subject")
    name = next((name for name, row in rows.items() if row["pseudonym"] == pseudonym), "")
    settings = schema_check.check(schema_check.read_yaml(session_file), "session", session_file)
    return name, settings["mocap"]["prefix"].get(name, "")
