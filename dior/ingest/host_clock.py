"""How well this computer's clock is set: what its NTP service says, chrony, ntpd or timesyncd, whichever answers.

OUTPUTS  a `HostClock`; its source is `unknown` where none answers
"""

import re
import subprocess
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

# chosen: a service on this computer answers within milliseconds, and three may hang
ANSWER_S = 2.0
# systemd.time(7)
UNITS = {
    "us": 1e-6, "µs": 1e-6, "ms": 1e-3, "s": 1.0, "min": 60.0, "h": 3600.0, "d": 86400.0, "day": 86400.0,
    "w": 604800.0, "month": 2629800.0, "y": 31557600.0,
}  # fmt: skip


@dataclass(frozen=True)
class HostClock:
    """`offset_s`: NTP's time minus the host's. `error_s`: most that NTP's time is off, half of the delay to the
    reference and its dispersion. None is not known. `asked_ns`: host time of the answer."""

    source: str = "unknown"
    synchronised: bool | None = None
    offset_s: float | None = None
    error_s: float | None = None
    stratum: int | None = None
    asked_ns: int | None = None


def state() -> HostClock:
    """The `HostClock` now. Takes up to some seconds where a service hangs; raises nothing."""
    for command, read in SERVICES:
        text = _answer(command)
        try:
            found = read(text) if text else None
        except (ValueError, IndexError, KeyError):
            found = None
        if found:
            return replace(found, asked_ns=time.time_ns())
    return HostClock(asked_ns=time.time_ns())


def _answer(command: tuple[str, ...]) -> str:
    """What a command prints, "" where it is not there, fails or hangs."""
    try:
        done = subprocess.run(
            ["env", "LC_ALL=C", *command], capture_output=True, stdin=subprocess.DEVNULL, timeout=ANSWER_S
        )
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return "" if done.returncode else done.stdout.decode("utf-8", "replace")


def chrony(text: str) -> HostClock:
    """Of `chronyc -c tracking`: its csv has the fields of `chronyc tracking` in order; a positive offset is a slow
    host."""
    fields = text.strip().split(",")
    offset, delay, dispersion = (float(fields[i]) for i in (4, 10, 11))
    return HostClock("chrony", fields[13] != "Not synchronised", offset, delay / 2 + dispersion, int(fields[2]))


def ntpd(text: str) -> HostClock:
    """Of `ntpq -c rv`: key=value, ms."""
    fields = dict(re.findall(r"(\w+)=\"?([^\",\s]*)", text))
    stratum = int(fields["stratum"])
    error = (float(fields["rootdelay"]) / 2 + float(fields["rootdisp"])) / 1e3
    return HostClock("ntpd", stratum < 16 and fields.get("leap") != "11", float(fields["offset"]) / 1e3, error, stratum)


def timesyncd(text: str) -> HostClock | None:
    """Of `timedatectl timesync-status`. The root distance is the server's own, half of the way to it comes on top."""
    fields = dict(line.strip().split(": ", 1) for line in text.splitlines() if ": " in line)
    if "Offset" not in fields:
        return HostClock("timesyncd", False) if "Packet count" in fields else None
    error = seconds(fields["Root distance"].split("(")[0]) + seconds(fields["Delay"]) / 2
    return HostClock(
        "timesyncd", fields["Leap"] != "not synchronized", seconds(fields["Offset"]), error, int(fields["Stratum"])
    )


def seconds(text: str) -> float:
    """A time span as systemd writes it, such as `-1min 2.5s`, in seconds."""
    text = text.strip()
    parts = re.findall(r"([\d.]+)\s*([a-zµ]+)", text)
    if not parts and text.lstrip("+-") != "0":
        raise ValueError(text)
    total = sum(float(number) * UNITS[unit] for number, unit in parts)
    return -total if text.startswith("-") else total


SERVICES: tuple[tuple[tuple[str, ...], Callable[[str], HostClock | None]], ...] = (
    (("chronyc", "-c", "tracking"), chrony),
    (("ntpq", "-c", "rv"), ntpd),
    (("timedatectl", "timesync-status"), timesyncd),
)
