"""Numbers as the report shows them to people."""

import numpy as np


def show(value: float, unit: str) -> str:
    """A figure for people: shares in percent, metres in millimetres, three significant digits."""
    if not np.isfinite(value):
        return "unknown"
    value, unit = (100 * value, "%") if unit == "share" else (1000 * value, "mm") if unit == "m" else (value, unit)
    digits = 1 if abs(value) >= 9.95 or unit == "%" else 2
    return f"{value:.{digits}f} {unit}"


def count(number: float) -> str:
    """A whole number with thin spaces between thousands."""
    return f"{int(number):,}".replace(",", "\u202f")
