"""The table of every stage: what a step wants a person to see."""

from dior.tables.words import SEVERITY

TABLES = {
    "findings": (("scope", "text"), ("severity", SEVERITY), ("code", "text"), ("text", "string")),
}
