"""`python -m dior` is the command `dior`."""

from dior.cli.main import command

command()
