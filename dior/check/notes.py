"""What a check has found: faults, with which a run would fail, and warnings, with which it would not."""

from collections.abc import Iterator
from contextlib import contextmanager

from dior.errors import DiorError, DiorErrors
from dior.project.missing import Fault


class Notes:
    """`faults` and `warnings`, as they were found."""

    def __init__(self) -> None:
        self.faults: list[Fault] = []
        self.warnings: list[Fault] = []

    def fault(self, file: str, line: int | None, text: str, walk: str = "") -> None:
        self.faults.append(Fault(file, line, text, walk))

    def warn(self, file: str, line: int | None, text: str, walk: str = "") -> None:
        self.warnings.append(Fault(file, line, text, walk))

    @contextmanager
    def kept(self, file: str, line: int | None, walk: str = "") -> Iterator[None]:
        """Keep what is wrong with what is done within, to be mended in that file."""
        try:
            yield
        except DiorErrors as several:
            for error in several.found:
                self.fault(file, line, str(error), walk)
        except DiorError as error:
            self.fault(file, line, str(error), walk)
