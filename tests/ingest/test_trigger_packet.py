"""Packets as Vicon's help prints them, and what else may arrive at a port."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dior.ingest.trigger_packet import MOST_BYTES, Packet, Refused, parse

HEAD = '<?xml version="1.0" encoding="UTF-8" standalone="no"?>'


def packet(kind="CaptureStart", attributes="", head=HEAD, **values):
    """The bytes of a packet whose children are `values`, None being left out."""
    values = {"Name": "walk_03", "Delay": "33", "PacketID": "33360"} | values
    children = "".join(f'<{key} VALUE="{value}"/>' for key, value in values.items() if value is not None)
    return f"{head}<{kind}{attributes}>{children}</{kind}>".encode() + b"\0"


def test_a_start():
    got = parse(packet(Notes="a &amp; b", Description="groß", DatabasePath="D:/Jeremy/Captures"))
    assert got == Packet("start", "walk_03", 33, "33360", "", "a & b", "groß", "D:/Jeremy/Captures")


@pytest.mark.parametrize("result", ["SUCCESS", "FAIL", "CANCEL", "MAYBE"])
def test_a_stop_whatever_its_result(result):
    got = parse(packet("CaptureStop", f' RESULT="{result}"'))
    assert (got.kind, got.name, got.result) == ("stop", "walk_03", result)


def test_a_stop_without_result():
    assert parse(packet("CaptureStop")).result == ""


@pytest.mark.parametrize("end", [b"", b"\n\0", b"\0\0\0", b"\0rubbish <"])
def test_what_is_around_the_xml(end):
    assert parse(b"\r\n" + packet().rstrip(b"\0") + end).name == "walk_03"
    assert parse(packet(head="")).name == "walk_03"


@pytest.mark.parametrize(
    "delay, expected",
    [("0", 0), (" 250 ", 250), ("16.5", 16.5), (None, None), ("", None), ("Reserved", None), ("-5", None)]
    + [("nan", None), ("inf", None), ("1e300", None)],
)
def test_a_delay_is_a_number_or_none(delay, expected):
    assert parse(packet(Delay=delay)).delay_ms == expected


LAUGHS = (
    '<!DOCTYPE lolz [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;"><!ENTITY c "&b;&b;&b;&b;&b;&b;&b;&b;">'
    '<!ENTITY d "&c;&c;&c;&c;&c;&c;&c;&c;&c;&c;">]>'
)
REFUSED = {
    "billion laughs": (packet(head=HEAD + LAUGHS, Name="&d;"), "document type"),
    "a file": (packet(head=HEAD + '<!DOCTYPE x [<!ENTITY f SYSTEM "file:///etc/passwd">]>', Name="&f;"), "document"),
    "a document type alone": (packet(head=HEAD + '<!DOCTYPE x SYSTEM "http://127.0.0.1/x.dtd">'), "document type"),
    "an entity of nobody": (packet(Name="&lol;"), "undefined entity"),
    "64 kB": (packet(Description="x" * 65000), f"larger than {MOST_BYTES}"),
    "another root": (packet("CaptureComplete"), "its element is 'CaptureComplete'"),
    "cut off": (packet()[:60], "not XML"),
    "nothing": (b"", "not XML"),
    "a null": (b"\0", "not XML"),
    "no text": (bytes(range(256)), "not XML"),
    "not UTF-8": (packet(Name="Gr\xf6\xdfe").decode().encode("latin-1"), "not XML"),
    "two roots": (packet()[:-1] + b"<a/>", "not XML"),
    "no name": (packet(Name=None), "cannot be that of a trial"),
    "a blank name": (packet(Name="  "), "cannot be"),
    "a path": (packet(Name="../../etc/cron.d/x"), "cannot be"),
    "a Windows path": (packet(Name="..\\x"), "cannot be"),
    "the folder above": (packet(Name=".."), "cannot be"),
    "a line": (packet(Name="a&#10;b"), "cannot be"),
    "an escape": (packet(Name="a&#155;31mb"), "cannot be"),
    "a long name": (packet(Name="x" * 5000), "cannot be"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refused_with_a_reason(case):
    data, reason = REFUSED[case]
    with pytest.raises(Refused, match=reason):
        parse(data)


def test_the_encoding_that_is_declared_is_not_looked_up():
    head = '<?xml version="1.0" encoding="{}"?>'
    assert {parse(packet(head=head.format(name))).name for name in ("utf-16", "rot13", "nobody-8")} == {"walk_03"}


def test_a_name_in_a_deeper_element_is_nobodys():
    with pytest.raises(Refused, match="Name ''"):
        parse(b'<CaptureStart><x><Name VALUE="walk"/></x></CaptureStart>')


@settings(max_examples=400, deadline=None, derandomize=True)
@given(data=st.data())
def test_damage_is_read_or_refused(data):
    damaged = bytearray(packet("CaptureStop", ' RESULT="SUCCESS"', Notes="n"))
    for _ in range(data.draw(st.integers(1, 4))):
        damaged[data.draw(st.integers(0, len(damaged) - 1))] = data.draw(st.integers(0, 255))
    try:
        got = parse(bytes(damaged))
    except Refused:
        return
    assert got.name and got.kind in ("start", "stop")
