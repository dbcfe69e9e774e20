"""What NTP services print, by their own programs where these are played by scripts."""

import os

import pytest

from dior.ingest import host_clock
from dior.ingest.host_clock import HostClock, chrony, ntpd, seconds, timesyncd

CHRONY = "A9FEA97B,169.254.169.123,4,1700000000.123,-0.000012,0.000003,0.000010,-12.5,0.001,0.02,0.0004,0.0001,16.1,{}"
NTPQ = """associd=0 status=0615 leap_none, sync_ntp, 1 event, clock_sync,
version="ntpd 4.2.8p15@1.3728-o", processor="x86_64", leap={}, stratum={}, precision=-24,
rootdelay=12.500, rootdisp=3.250, refid=192.168.1.1, offset=-0.750000, sys_jitter=0.2
"""
TIMESYNC = """       Server: 185.125.190.58 (ntp.ubuntu.com)
Poll interval: 34min 8s (min: 32s; max 34min 8s)
         Leap: {}
      Version: 4
      Stratum: 2
    Reference: C342502B
    Precision: 1us (-24)
Root distance: 20.371ms (max: 5s)
       Offset: {}
        Delay: 12.184ms
       Jitter: 1.2ms
 Packet count: 17
    Frequency: -0.870ppm
"""


def test_chrony():
    assert chrony(CHRONY.format("Normal") + "\n") == HostClock("chrony", True, -0.000012, pytest.approx(0.0003), 4)
    assert chrony(CHRONY.format("Not synchronised")).synchronised is False


def test_ntpd():
    assert ntpd(NTPQ.format("00", 3)) == HostClock("ntpd", True, -0.00075, pytest.approx(0.0095), 3)
    assert ntpd(NTPQ.format("11", 16)).synchronised is False and ntpd(NTPQ.format("11", 3)).synchronised is False


def test_timesyncd():
    found = timesyncd(TIMESYNC.format("normal", "-1.243ms"))
    assert found == HostClock("timesyncd", True, pytest.approx(-0.001243), pytest.approx(0.026463), 2)
    assert timesyncd(TIMESYNC.format("not synchronized", "+7.493693s")).synchronised is False
    assert timesyncd("       Server: 10.0.0.1\n Packet count: 0\n") == HostClock("timesyncd", False)
    assert timesyncd("something else\n") is None


@pytest.mark.parametrize(
    "text, expected",
    [("+2.345ms", 0.002345), ("-517us", -0.000517), ("1min 2.5s", 62.5), ("0", 0), ("-0", 0), ("34µs", 34e-6)]
    + [("10month 2w 1d 13h 28min 23.169258s", 26298000 + 1209600 + 86400 + 46800 + 1680 + 23.169258)],
)
def test_spans(text, expected):
    assert seconds(text) == pytest.approx(expected)


def test_a_span_that_is_none():
    with pytest.raises(ValueError, match="soon"):
        seconds("soon")


@pytest.fixture
def programs(tmp_path, monkeypatch):
    """A function that puts scripts where the programs of the services would be, and no others."""
    monkeypatch.setenv("PATH", f"{tmp_path}:/usr/bin:/bin")
    monkeypatch.setattr(host_clock, "ANSWER_S", 0.5)
    for name in ("chronyc", "ntpq", "timedatectl"):
        _script(tmp_path / name, "exit 1")
    return lambda name, script: _script(tmp_path / name, script)


def _script(path, text):
    path.write_text(f"#!/bin/sh\n{text}\n")
    os.chmod(path, 0o755)


def printing(text):
    return f"cat <<'END'\n{text}\nEND"


def test_whichever_answers(programs):
    assert (host_clock.state().source, host_clock.state().offset_s) == ("unknown", None)
    programs(
        "timedatectl", f'[ "$1 $LC_ALL" = "timesync-status C" ] || exit 1\n{printing(TIMESYNC.format("normal", 0))}'
    )
    assert (host_clock.state().source, host_clock.state().offset_s) == ("timesyncd", 0.0)
    programs("ntpq", f'[ "$*" = "-c rv" ] || exit 1\n{printing(NTPQ.format("00", 3))}')
    assert host_clock.state().source == "ntpd"
    programs("chronyc", f'[ "$*" = "-c tracking" ] || exit 1\n{printing(CHRONY.format("Normal"))}')
    found = host_clock.state()
    assert (found.source, found.stratum) == ("chrony", 4) and found.asked_ns > 1_700_000_000_000_000_000


@pytest.mark.parametrize(
    "script",
    ["exec sleep 60", "exit 3", printing("506 Cannot talk to daemon"), printing("a,b,c,d,e,f,g,h,i,j,k,l,m,n"), ""],
)
def test_a_service_that_hangs_fails_or_talks_nonsense_is_passed_over(programs, script):
    programs("chronyc", script)
    programs("ntpq", printing("ntpq: read: Connection refused"))
    assert host_clock.state().source == "unknown"
    programs("timedatectl", printing(TIMESYNC.format("normal", "+1ms")))
    assert host_clock.state().source == "timesyncd"
