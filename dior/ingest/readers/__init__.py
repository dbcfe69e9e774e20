"""One reader per detection tool; each returns `dior.ingest.people.People`."""
