"""Start and stop the recording when Vicon Nexus starts and stops its capture, and note when that was.

INPUTS   the UDP packets that Nexus broadcasts (`trigger_packet`), shell commands that start and stop the recording
OUTPUTS  a log, one JSON object per line, only ever appended to (docs/formats.md); sequences.tsv names it in the column
         `trigger_log`, and `trigger_log` reads it
Times are ns since the Unix epoch by this computer's clock, at the arrival of the packet in its kernel. Nothing that
arrives, and nothing that a command does, ends the listener: SIGINT, SIGTERM and SIGHUP do.
"""

import json
import os
import select
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
from collections import deque
from dataclasses import asdict
from pathlib import Path
from typing import TypeAlias

from dior.errors import DiorError
from dior.ingest import host_clock
from dior.ingest.trigger_packet import MOST_BYTES, Packet, Refused, parse

# ip(7), ip_unprivileged_port_start
PRIVILEGED = 1024
# chosen: how long a PacketID stands for one packet; a Nexus that is started again may count anew
SAME_PACKET_S = 60.0
# chosen: NTP services ask their servers every minute or less often
CLOCK_EVERY_S = 30.0
# chosen: what a person reads of a flood; the rest is counted
REFUSED_IN_A_MINUTE = 20
# Linux; Python has no name for it
SO_TIMESTAMPNS = 35
TIMESPEC = struct.Struct("@ll")
# (start | stop, its process, monotonic s when it began, the thread that waits for it)
Child: TypeAlias = tuple[str, subprocess.Popen[bytes], float, threading.Thread]


def run(
    *,
    log: Path,
    bind: str = "0.0.0.0",
    port: int = 30,
    on_start: str = "",
    on_stop: str = "",
    patience: float = 10.0,
) -> None:
    """Listen until a signal ends it.

    `log`: file to append to, such as trigger.jsonl; `bind`: address to listen on, 0.0.0.0 for all of this computer's;
    `port`: UDP port, as set in Nexus; `on_start`: shell command that starts the recording; `on_stop`: shell command
    that stops it; `patience`: seconds after which a command that still runs is reported.
    Raises DiorError where the port or the log cannot be used.
    """
    listener = Listener(bound(bind, port), Log(log), on_start, on_stop, patience)
    for ending in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(ending, lambda *_: listener.stop())
    listener.serve()


def bound(address: str, port: int) -> socket.socket:
    """A UDP socket that hears what is sent to `address`:`port`. Raises DiorError with what to do."""
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        sock.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
    except OSError:
        pass  # the time is then taken when the packet is read
    try:
        sock.bind((address, port))
    except PermissionError:
        sock.close()
        raise DiorError(
            f"UDP port {port} is privileged, as all below {PRIVILEGED}: allow it until the next boot with `sudo sysctl "
            f"net.ipv4.ip_unprivileged_port_start={port}`, or set another port in Nexus and here, such as --port 3030"
        ) from None
    except (OSError, OverflowError) as error:
        sock.close()
        raise DiorError(
            f"{address}, UDP port {port}: {error}; is `dior trigger` running already, and is the address one of this "
            "computer's? --bind 0.0.0.0 hears all of them"
        ) from None
    return sock


def tell(text: str) -> None:
    """To the person at the terminal, who may have left."""
    try:
        print(f"dior trigger: {text}", file=sys.stderr, flush=True)
    except (OSError, ValueError):
        pass


class Log:
    """A file to which whole lines are appended; each is on the disk before `append` returns."""

    def __init__(self, path: str | os.PathLike[str]) -> None:
        """Raises DiorError where the file cannot be written."""
        path = Path(path)
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            file = os.open(path, os.O_RDWR | os.O_APPEND | os.O_CREAT, 0o644)
            # a line that a power cut has torn must not swallow the next
            self._torn = not _ends_with_newline(file)
            os.fsync(file)
        except OSError as error:
            raise DiorError(f"{path}: the log cannot be written ({error.strerror}); give --log another file") from None
        self._file: int | None = file
        self._lock = threading.Lock()

    def append(self, event: str, **values: object) -> None:
        """Write one event. A disk that is full is reported; the recording goes on."""
        line = (json.dumps({"event": event, **values}, ensure_ascii=False) + "\n").encode("utf-8", "backslashreplace")
        with self._lock:
            if self._file is None:
                return
            try:
                line = b"\n" * self._torn + line
                self._torn = os.write(self._file, line) < len(line)
                os.fsync(self._file)
            except OSError as error:
                tell(f"the log cannot be written ({error.strerror}): {line.decode().strip()}")

    def close(self) -> None:
        with self._lock:
            if self._file is not None:
                os.close(self._file)
            self._file = None


def _ends_with_newline(file: int) -> bool:
    size = os.fstat(file).st_size
    return size == 0 or os.pread(file, 1, size - 1) == b"\n"


class Listener:
    """Acts on the packets that `sock` receives. `port`: where it listens; `stop()` ends `serve()`."""

    def __init__(
        self, sock: socket.socket, log: Log, on_start: str = "", on_stop: str = "", patience: float = 10.0
    ) -> None:
        self.port: int = sock.getsockname()[1]
        self._sock, self._log, self._patience = sock, log, patience
        self._commands = {"start": on_start, "stop": on_stop}
        self._woken, self._wake = socket.socketpair()
        self._ending = threading.Event()
        # held while a packet is acted on, so that its line comes before those of its commands
        self._acting = threading.Lock()
        self._clock = host_clock.HostClock()
        self._running: Packet | None = None
        self._pid: int | str = ""
        self._replaced: deque[str] = deque(maxlen=64)
        self._seen: dict[tuple[str, str], float] = {}
        self._children: list[Child] = []
        self._refused: deque[float] = deque(maxlen=REFUSED_IN_A_MINUTE)
        self._unreported = 0

    def stop(self) -> None:
        """End `serve`; may be called in a signal handler and from another thread."""
        try:
            self._wake.send(b".")
        except OSError:
            pass  # it has ended

    def serve(self) -> None:
        """Receive until `stop`. Nothing is missed meanwhile: the socket keeps what comes while something is done."""
        self._clock = host_clock.state()
        self._log.append("listening", host_ns=time.time_ns(), port=self.port, ntp=asdict(self._clock))
        tell(f"listening on {self._sock.getsockname()[0]}, UDP port {self.port}; NTP: {self._clock.source}")
        threading.Thread(target=self._watch_clock, daemon=True).start()
        while True:
            ready, _, _ = select.select([self._sock, self._woken], [], [])
            if self._woken in ready:
                break
            try:
                with self._acting:
                    self._receive()
            except Exception as error:  # whatever it is, the next packet may start a recording
                self._log.append("error", host_ns=time.time_ns(), reason=repr(error))
                tell(f"a packet could not be handled: {error!r}")
        self._close()

    def _receive(self) -> None:
        data, ancillary, _, sender = self._sock.recvmsg(MOST_BYTES + 1, socket.CMSG_SPACE(TIMESPEC.size))
        host_ns = _arrival(ancillary)
        sender = f"{sender[0]}:{sender[1]}"
        try:
            packet = parse(data)
        except Refused as refused:
            self._refuse(str(refused), host_ns, sender, len(data))
            return
        if self._is_copy(packet):
            self._refuse(f"a copy of packet {packet.packet_id}", host_ns, sender, len(data))
            return
        happens = host_ns + round((packet.delay_ms or 0) * 1e6)
        (self._start if packet.kind == "start" else self._stop)(packet, host_ns, happens, sender)

    def _is_copy(self, packet: Packet) -> bool:
        """Whether the packet has been here, by its PacketID. A Nexus that is started again may count anew."""
        now = time.monotonic()
        self._seen = {key: at for key, at in self._seen.items() if now - at < SAME_PACKET_S}
        key = packet.kind, packet.packet_id
        known = bool(packet.packet_id) and key in self._seen
        self._seen.setdefault(key, now)
        return known

    def _refuse(self, reason: str, host_ns: int, sender: str, size: int) -> None:
        """Note what is not acted on, unless somebody floods the port."""
        if len(self._refused) == REFUSED_IN_A_MINUTE and time.monotonic() - self._refused[0] < 60:
            self._unreported += 1
            return
        self._refused.append(time.monotonic())
        self._log.append(
            "refused", host_ns=host_ns, sender=sender, bytes=size, reason=reason, unreported=self._unreported
        )
        self._unreported = 0

    def _start(self, packet: Packet, host_ns: int, start_ns: int, sender: str) -> None:
        if self._running:
            # its stop was lost on the way
            tell(f"{self._running.name!r} has had no CaptureStop; it is stopped now")
            self._replaced.append(self._running.name)
            self._run_stop(self._running, host_ns, host_ns, "LOST")
        self._let_stops_end()
        self._running = packet
        child = self._launch("start", packet, {"HOST_NS": host_ns, "START_NS": start_ns})
        self._pid = child.pid if child else ""
        self._note(packet, host_ns, sender, start_ns=start_ns)
        tell(f"start of {packet.name!r}" + (f" in {packet.delay_ms:g} ms" if packet.delay_ms else ""))

    def _stop(self, packet: Packet, host_ns: int, stop_ns: int, sender: str) -> None:
        """Also where nothing is known to run: somebody may have started it by hand, or this listener since."""
        late = self._running and packet.name != self._running.name and packet.name in self._replaced
        if not late:
            self._run_stop(packet, host_ns, stop_ns, packet.result)
            self._running = None
        self._note(packet, host_ns, sender, stop_ns=stop_ns, result=packet.result)
        tell(f"stop of {packet.name!r}: {packet.result or 'no RESULT'}" + (", which had been stopped" if late else ""))

    def _note(self, packet: Packet, host_ns: int, sender: str, **times: int | str) -> None:
        text = {key: getattr(packet, key) for key in ("notes", "description", "database_path", "packet_id")}
        self._log.append(
            packet.kind, name=packet.name, host_ns=host_ns, delay_ms=packet.delay_ms, **times, **text,
            sender=sender, ntp=asdict(self._clock),
        )  # fmt: skip

    def _run_stop(self, packet: Packet, host_ns: int, stop_ns: int, result: str) -> None:
        times: dict[str, int | str] = {"HOST_NS": host_ns, "STOP_NS": stop_ns, "RESULT": result, "START_PID": self._pid}
        self._launch("stop", packet, times)
        self._pid = ""

    def _launch(self, kind: str, packet: Packet, times: dict[str, int | str]) -> subprocess.Popen[bytes] | None:
        """Run a command in a process group of its own, so that Ctrl-C here does not reach the recorder."""
        command = self._commands[kind]
        if not command:
            return None
        variables = {
            "NAME": packet.name, "NOTES": packet.notes, "DESCRIPTION": packet.description,
            "DATABASE_PATH": packet.database_path, "PACKET_ID": packet.packet_id,
            "DELAY_MS": "" if packet.delay_ms is None else f"{packet.delay_ms:g}", **times,
        }  # fmt: skip
        encoded = {key.encode(): str(value).encode("utf-8", "backslashreplace") for key, value in variables.items()}
        try:
            child = subprocess.Popen(
                ["/bin/sh", "-c", command], env={**os.environb, **encoded}, stdin=subprocess.DEVNULL,
                start_new_session=True,
            )  # fmt: skip
        except (OSError, ValueError) as error:
            self._report(kind, packet, problem=f"could not be started: {error}")
            return None
        began = time.monotonic()
        watcher = threading.Thread(target=self._watch, args=(kind, packet, child, began), daemon=True)
        self._children = [known for known in self._children if known[3].is_alive()] + [(kind, child, began, watcher)]
        watcher.start()
        return child

    def _watch(self, kind: str, packet: Packet, child: subprocess.Popen[bytes], began: float) -> None:
        """Report how a command ends, and one that does not."""
        try:
            status = child.wait(self._patience)
        except subprocess.TimeoutExpired:
            with self._acting:
                self._report(kind, packet, problem=f"still runs after {self._patience:g} s and is left to")
            status = child.wait()
        problem = f"ended with status {status}" if status else ""
        with self._acting:
            self._report(kind, packet, status=status, seconds=round(time.monotonic() - began, 3), problem=problem)

    def _report(self, kind: str, packet: Packet, **how: int | float | str) -> None:
        self._log.append("command", command=f"on-{kind}", name=packet.name, host_ns=time.time_ns(), **how)
        if how["problem"]:
            tell(f"--on-{kind} of {packet.name!r} {how['problem']}")

    def _let_stops_end(self) -> None:
        """A recorder that is being stopped may be in the way of the next; one that hangs is not waited for."""
        for kind, child, began, _ in self._children:
            if kind == "stop":
                try:
                    child.wait(max(began + self._patience - time.monotonic(), 0))
                except subprocess.TimeoutExpired:
                    pass

    def _watch_clock(self) -> None:
        while not self._ending.wait(CLOCK_EVERY_S):
            self._clock = host_clock.state()

    def _close(self) -> None:
        """Stop what is being recorded: nobody else would."""
        self._ending.set()
        now = time.time_ns()
        if self._running:
            tell(f"{self._running.name!r} is stopped, since nobody listens any more")
            self._run_stop(self._running, now, now, "INTERRUPTED")
        self._let_stops_end()
        for _, child, _, watcher in self._children:
            if child.poll() is not None:
                watcher.join()
        left = [kind for kind, child, _, _ in self._children if child.poll() is None]
        for kind in left:
            tell(f"--on-{kind} still runs and is left to")
        interrupted = self._running.name if self._running else ""
        self._log.append("closed", host_ns=time.time_ns(), interrupted=interrupted, left_running=len(left))
        for sock in (self._sock, self._woken, self._wake):
            sock.close()
        self._log.close()


def _arrival(ancillary: list[tuple[int, int, bytes]]) -> int:
    """When the kernel received a packet; where it does not say, now."""
    for level, kind, data in ancillary:
        if (level, kind) == (socket.SOL_SOCKET, SO_TIMESTAMPNS) and len(data) == TIMESPEC.size:
            seconds, nanoseconds = TIMESPEC.unpack(data)
            return seconds * 1_000_000_000 + nanoseconds
    return time.time_ns()
