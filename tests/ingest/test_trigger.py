"""The listener with real packets on the loopback."""

import json
import os
import signal
import socket
import subprocess
import sys
import threading
import time

import pytest

from dior.errors import DiorError
from dior.ingest import host_clock, trigger, trigger_log
from tests.cases import some
from tests.ingest.test_trigger_packet import LAUGHS, packet

LONG_S = 20


@pytest.fixture
def nexus(tmp_path, monkeypatch):
    """A function that starts a listener and gives what one does to it."""
    # what the computer of the tests runs must not matter
    monkeypatch.setattr(host_clock, "SERVICES", ())
    running = []

    def listen(on_start="", on_stop="", patience=10.0):
        log = tmp_path / "logs/trigger.jsonl"
        listener = trigger.Listener(trigger.bound("127.0.0.1", 0), trigger.Log(log), on_start, on_stop, patience)
        thread = threading.Thread(target=listener.serve)
        thread.start()
        running.append(Nexus(listener, thread, log))
        return running[-1]

    yield listen
    for one in running:
        one.end()


class Nexus:
    def __init__(self, listener, thread, log):
        self.listener, self.thread, self.log = listener, thread, log
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)

    def send(self, *packets):
        for data in packets:
            self.socket.sendto(data, ("127.0.0.1", self.listener.port))

    def events(self, *kinds):
        lines = [json.loads(line) for line in self.log.read_text().splitlines() if line.strip()]
        return [line for line in lines if not kinds or line["event"] in kinds]

    def wait_for(self, kind, count=1):
        """The events of a kind as soon as there are `count`."""
        return waited(lambda: len(self.events(kind)) >= count and self.events(kind), f"{count} {kind}")

    def end(self):
        self.listener.stop()
        self.thread.join(LONG_S)
        assert not self.thread.is_alive()
        self.socket.close()
        return self.events()


def waited(found, what):
    until = time.monotonic() + LONG_S
    while time.monotonic() < until:
        if got := found():
            return got
        time.sleep(0.005)
    raise AssertionError(f"no {what}")


def start(name="walk_01", number=1, **values):
    return packet(Name=name, PacketID=str(number), **values)


def stop(name="walk_01", number=2, result="SUCCESS", **values):
    return packet("CaptureStop", f' RESULT="{result}"', Name=name, PacketID=str(number), **values)


def test_a_capture_starts_and_stops_the_recording_and_is_noted(nexus, tmp_path):
    said = tmp_path / "said"
    names = "$NAME|$DELAY_MS|$PACKET_ID|$DATABASE_PATH|$NOTES|$RESULT"
    listening = nexus(
        f'echo "start|{names}|$START_NS|$HOST_NS" >> {said}', f'echo "stop|{names}|$STOP_NS|$HOST_NS" >> {said}'
    )
    before = time.time_ns()
    listening.send(start("walk 'x' $(id)", Delay="250", Notes="a &quot;b&quot;", DatabasePath="D:/x"))
    noted = listening.wait_for("start")[0]
    waited(lambda: said.is_file() and said.read_text().count("\n") == 1, "command")
    listening.send(stop("walk 'x' $(id)", 2, "FAIL"))
    ended = listening.wait_for("stop")[0]
    listening.wait_for("command", 2)
    assert before < noted["host_ns"] < time.time_ns()
    assert noted["start_ns"] == noted["host_ns"] + 250_000_000 and noted["delay_ms"] == 250
    assert (noted["name"], noted["packet_id"], noted["database_path"]) == ("walk 'x' $(id)", "1", "D:/x")
    assert noted["notes"] == 'a "b"' and noted["ntp"]["source"] == "unknown"
    assert (ended["result"], ended["stop_ns"] - ended["host_ns"]) == ("FAIL", 33_000_000)
    first, second = said.read_text().splitlines()
    assert first == f"start|walk 'x' $(id)|250|1|D:/x|a \"b\"||{noted['start_ns']}|{noted['host_ns']}"
    assert second == f"stop|walk 'x' $(id)|33|2|||FAIL|{ended['stop_ns']}|{ended['host_ns']}"
    assert {(e["command"], e["status"]) for e in listening.events("command")} == {("on-start", 0), ("on-stop", 0)}
    assert trigger_log.read(listening.log) == [
        trigger_log.Capture("walk 'x' $(id)", noted["start_ns"], ended["stop_ns"])
    ]


def test_a_broadcast_is_heard(tmp_path, monkeypatch):
    monkeypatch.setattr(host_clock, "SERVICES", ())
    listener = trigger.Listener(trigger.bound("0.0.0.0", 0), trigger.Log(tmp_path / "a.jsonl"))
    thread = threading.Thread(target=listener.serve)
    thread.start()
    try:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            sender.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
            sender.sendto(start(), ("127.255.255.255", listener.port))
        waited(lambda: '"start"' in (tmp_path / "a.jsonl").read_text(), "start")
    finally:
        listener.stop()
        thread.join(LONG_S)


def test_copies_are_dropped_by_their_number(nexus):
    listening = nexus()
    listening.send(start(), start(), start(Notes="by another way"), stop(), stop())
    # the stop of a sender that counts nothing is none of the start
    listening.send(start("walk_02", 7), stop("walk_02", 7))
    listening.wait_for("stop", 2)
    listening.wait_for("refused", 3)
    assert [(e["event"], e["name"]) for e in listening.events("start", "stop")] == [
        ("start", "walk_01"), ("stop", "walk_01"), ("start", "walk_02"), ("stop", "walk_02"),
    ]  # fmt: skip
    assert [e["reason"] for e in listening.events("refused")] == [
        "a copy of packet 1", "a copy of packet 1", "a copy of packet 2",
    ]  # fmt: skip


def test_nothing_that_arrives_ends_it(nexus):
    listening = nexus()
    bad = [b"", b"\0", b"\xff" * 900, b"hello", packet()[:50], packet("CaptureComplete")]
    bad += [packet(head=LAUGHS, Name="&d;"), packet(Description="x" * 64000), packet(Name="../x"), os.urandom(3000)]
    for garbage in bad:
        listening.send(garbage)
    listening.send(start(Delay="soon"))
    noted = listening.wait_for("start")[0]
    assert noted["delay_ms"] is None and noted["start_ns"] == noted["host_ns"], "what cannot be read is not invented"
    refused = listening.events("refused")
    assert len(refused) == len(bad) and all(e["reason"] and e["sender"].startswith("127.0.0.1:") for e in refused)
    assert "document type" in refused[6]["reason"] and "larger than" in refused[7]["reason"]


def test_a_flood_does_not_fill_the_disk(nexus):
    listening = nexus()
    for i in range(200):
        listening.send(b"garbage %d" % i)
        time.sleep(0.0005)
    listening.send(start(), stop())
    listening.wait_for("stop")
    assert len(listening.events("refused")) == trigger.REFUSED_IN_A_MINUTE and len(listening.events("start")) == 1


@pytest.mark.parametrize("result", ["CANCEL", "FAIL", "MAYBE"])
def test_every_result_stops_the_recording(nexus, tmp_path, result):
    listening = nexus("", f'echo "$RESULT" > {tmp_path}/stopped')
    listening.send(start(), stop(result=result))
    listening.wait_for("command")
    assert (tmp_path / "stopped").read_text().strip() == result == listening.events("stop")[0]["result"]


def test_a_stop_without_a_start_stops_too(nexus, tmp_path):
    """The listener may have been started again in between."""
    listening = nexus("", f"echo $NAME >> {tmp_path}/stopped")
    listening.send(stop("walk_09", 5))
    listening.wait_for("command")
    assert (tmp_path / "stopped").read_text() == "walk_09\n"


def test_a_lost_stop_is_made_up_for_and_a_late_one_does_no_harm(nexus, tmp_path):
    said = tmp_path / "said"
    listening = nexus(f'echo "start $NAME" >> {said}', f'sleep 0.2; echo "stop $NAME $RESULT" >> {said}')
    listening.send(start("walk_01", 1))
    waited(said.is_file, "start")
    listening.send(start("walk_02", 3))
    listening.wait_for("start", 2)
    waited(lambda: said.read_text().count("\n") == 3, "second start")
    listening.send(stop("walk_01", 2), stop("walk_02", 4))
    listening.wait_for("stop", 2)
    waited(lambda: said.read_text().count("\n") == 4, "second stop")
    assert said.read_text().splitlines() == [
        "start walk_01", "stop walk_01 LOST", "start walk_02", "stop walk_02 SUCCESS",
    ]  # fmt: skip


def test_a_command_that_fails_is_reported(nexus, capfd):
    listening = nexus("exit 3", "no_such_program_here")
    listening.send(start(), stop())
    listening.wait_for("command", 2)
    assert {(e["command"], e["status"]) for e in listening.events("command")} == {("on-start", 3), ("on-stop", 127)}
    listening.send(start("walk_02", 3))
    listening.wait_for("start", 2)
    assert "--on-start of 'walk_01' ended with status 3" in capfd.readouterr().err


def test_a_command_that_hangs_is_reported_and_left(nexus, tmp_path):
    hang = f"echo $$ >> {tmp_path}/pids; exec sleep 600"
    listening = nexus(hang, hang, patience=0.1)
    try:
        listening.send(start(), stop())
        assert "still runs after 0.1 s" in listening.wait_for("command", 2)[0]["problem"]
        listening.send(start("walk_02", 3), stop("walk_02", 4))
        listening.wait_for("command", 4)
        ended = listening.end()
        assert ended[-1]["event"] == "closed" and ended[-1]["left_running"] == 4
    finally:
        for pid in (tmp_path / "pids").read_text().split():
            os.kill(int(pid), signal.SIGKILL)


@pytest.fixture
def interruptible():
    """As `dior trigger` is, also where the tests run in the background of a script, which ignores SIGINT."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def test_a_recorder_in_the_foreground_is_ended_by_its_number(interruptible, nexus, tmp_path):
    listening = nexus(
        f"trap 'echo saved > {tmp_path}/bag; exit 0' INT; touch {tmp_path}/ready; while :; do sleep 0.05; done",
        "kill -INT $START_PID",
    )
    listening.send(start())
    waited((tmp_path / "ready").exists, "recorder")
    listening.send(stop())
    listening.wait_for("command", 2)
    # the command ends when it has sent the signal, the recorder a little later
    waited(lambda: (tmp_path / "bag").exists() and (tmp_path / "bag").read_text() == "saved\n", "bag")
    assert {e["status"] for e in listening.events("command")} == {0}


def test_the_end_stops_what_is_recorded(nexus, tmp_path):
    listening = nexus("", f'echo "$NAME $RESULT" > {tmp_path}/stopped')
    listening.send(start())
    listening.wait_for("start")
    events = listening.end()
    assert (tmp_path / "stopped").read_text() == "walk_01 INTERRUPTED\n"
    assert events[-1]["interrupted"] == "walk_01"
    assert trigger_log.read(listening.log)[0].stop_ns is None


def test_a_packet_is_timed_when_it_arrives(nexus):
    """Not when the listener has time for it: here it waits for a command that stops the recorder."""
    listening = nexus("", "sleep 0.5", patience=5.0)
    listening.send(start("walk_01", 1))
    listening.wait_for("start")
    before = time.time_ns()
    # the second capture waits for the recorder of the first
    listening.send(start("walk_02", 3), start("walk_03", 5))
    sent = time.time_ns()
    noted = listening.wait_for("start", 3)
    assert before <= noted[1]["host_ns"] <= noted[2]["host_ns"] <= sent + 50_000_000
    written = listening.wait_for("command", 2)[1]["host_ns"]
    assert written - noted[2]["host_ns"] > 500_000_000


def test_a_log_is_appended_to_also_behind_a_torn_line(tmp_path):
    path = tmp_path / "trigger.jsonl"
    first = trigger.Log(path)
    first.append("start", name="größe", start_ns=5)
    first.close()
    with open(path, "ab") as stream:
        stream.write(b'{"event": "stop", "na')
    second = trigger.Log(path)
    second.append("start", name="b", start_ns=9)
    second.close()
    second.append("start", name="nobody reads this", start_ns=9)
    assert trigger_log.read(path) == [trigger_log.Capture("größe", 5), trigger_log.Capture("b", 9)]


def test_a_port_or_a_log_that_cannot_be_used(tmp_path):
    with trigger.bound("127.0.0.1", 0) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(DiorError, match=f"UDP port {port}: .*running already"):
            trigger.bound("127.0.0.1", port)
    with pytest.raises(DiorError, match="203.0.113.9, UDP port 3030: .*--bind 0.0.0.0"):
        trigger.bound("203.0.113.9", 3030)
    with pytest.raises(DiorError, match="UDP port 99999"):
        trigger.bound("127.0.0.1", 99999)
    with pytest.raises(DiorError, match="the log cannot be written"):
        trigger.Log(tmp_path)


def test_a_privileged_port_says_what_to_do(monkeypatch):
    def forbidden(*_):
        raise PermissionError(13, "Permission denied")

    class Socket(socket.socket):
        bind = forbidden

    monkeypatch.setattr(socket, "socket", Socket)
    with pytest.raises(DiorError, match=r"port 30 is privileged.*ip_unprivileged_port_start=30.*--port 3030"):
        trigger.bound("0.0.0.0", 30)


@pytest.mark.parametrize("ending", some([signal.SIGINT, signal.SIGTERM, signal.SIGHUP], signal.SIGTERM))
def test_the_command_ends_cleanly_by_a_signal(tmp_path, ending):
    log, said = tmp_path / "trigger.jsonl", tmp_path / "said"
    with trigger.bound("127.0.0.1", 0) as free:
        port = free.getsockname()[1]
    program = [sys.executable, "-m", "dior.cli.main", "trigger", "--log", str(log), "--bind", "127.0.0.1"]
    program += ["--port", str(port), "--on-start", f"echo start >> {said}", "--on-stop", f"echo stop >> {said}"]
    with subprocess.Popen(program, stderr=subprocess.PIPE, text=True) as running:
        assert f"listening on 127.0.0.1, UDP port {port}" in running.stderr.readline()
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            sender.sendto(start(), ("127.0.0.1", port))
        waited(said.is_file, "start of the recording")
        running.send_signal(ending)
        assert running.wait(LONG_S) == 0
    assert said.read_text() == "start\nstop\n"
    events = [json.loads(line)["event"] for line in log.read_text().splitlines()]
    assert events[:2] == ["listening", "start"] and events[-1] == "closed"
