"""One connection to one vehicle: how it is made, questions with deadlines, and how good the link is.

Every call either returns what it promises or raises LinkError within a stated time. Requests are idempotent, and are
repeated until they are answered. What is asked is in `ivl.links.tables`.
"""

import contextlib
import io
import os
import queue
import struct
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from ivl.errors import ConfigError, LinkError
from ivl.links.deadlines import DEADLINES, Deadlines
from ivl.links.steady import SteadyCrazyflie, init_drivers

SCHEMES = ("udp", "radio", "usb", "tcp", "serial")
PROTOCOL_MIN = 12
"""Version of the protocol from which on the supervisor has a port of its own."""
PORT_CONSOLE, PORT_LINK = 0, 15
PING_S = 0.1
_PINGS_KEPT = 50
_RETRY_ROUND_TRIPS = 4.0
_RTT_GAIN = 0.125
_WHO_IS_ASKED = {
    "udp": "is the software vehicle started, with `ivl sil`, and on this port?",
    "radio": "is the vehicle switched on, and set to this channel, data rate and address?",
    "usb": "is the vehicle switched on?",
    "tcp": "is the bridge to the vehicle started, and on this port?",
    "serial": "is the vehicle switched on, and wired to this port?",
}
_BUSY = "Busy: "  # a software vehicle says on the console who has it


@dataclass(frozen=True)
class LinkQuality:
    """What the pings of the last seconds say; a ping is sent ten times a second.

    Attributes:
        sent: Pings that are old enough to be judged.
        lost: Those without an answer.
        p95_s: Round trip that 95 % stay below, NaN without answers.
    """

    sent: int
    lost: int
    p95_s: float


class Connection:
    """An open connection; use as a context manager. All methods are for one thread, the one that opened it."""

    def __init__(self, uri: str, deadlines: Deadlines = DEADLINES) -> None:
        """Connect and learn the vehicle's tables.

        Raises:
            ConfigError: The URI names no kind of link.
            LinkError: No such radio, nobody answers, or the vehicle's firmware is too old.
        """
        check_uri(uri)
        self.uri, self.deadlines = uri, deadlines
        self._waiting: dict[tuple[int, int], list[Waiter]] = {}
        self._listeners: list[tuple[int, int, Callable[[bytes], None]]] = []
        self._lock = threading.Lock()
        self._heard_s = time.monotonic()
        self._rtt_s = deadlines.retry_s / _RETRY_ROUND_TRIPS
        self._pings: deque[list[float]] = deque(maxlen=_PINGS_KEPT)
        self._next_ping_s = 0.0
        self.ping_s = PING_S
        """Time between two pings."""
        self.console: deque[str] = deque(maxlen=200)
        init_drivers()
        self.cf = SteadyCrazyflie(_cache_folder())
        try:
            self._connect()
        except BaseException:
            self.close()
            raise

    def _connect(self) -> None:
        began_s = time.monotonic()
        self.cf.packet_received.add_callback(self._on_packet)
        with contextlib.redirect_stdout(io.StringIO()):  # cflib prints on some kinds of link
            self.cf.open(self.uri)
        next_ask_s = began_s + self.deadlines.retry_s
        while not self.cf.tables_known.wait(0.02):
            now_s = time.monotonic()
            if self.cf.lost:
                raise LinkError(f"{self.uri}: {_explain(self.uri, self.cf.lost)}")
            if now_s - began_s > self.deadlines.connect_s:
                raise LinkError(f"{self.uri}: no connection within {self.deadlines.connect_s:g} s: {self._missing()}")
            if now_s >= next_ask_s:
                self.cf.ask_source()
                next_ask_s = now_s + self.deadlines.retry_s
        version = self.cf.platform.get_protocol_version()
        if version < PROTOCOL_MIN:
            raise LinkError(
                f"{self.uri}: its firmware speaks protocol version {version} (needed: {PROTOCOL_MIN} or later)"
            )
        self.cf.each_tick = self._ping

    def _missing(self) -> str:
        if self.cf.platform.get_protocol_version() < 0:
            holder = next((line.strip() for line in reversed(list(self.console)) if line.startswith(_BUSY)), "")
            if holder:
                return f"another client flies it ({holder}): stop that one first"
            return f"nobody answers ({_WHO_IS_ASKED[self.uri.partition('://')[0]]})"
        return "the tables of parameters and log variables did not arrive (bad link)"

    def close(self) -> None:
        """Close the connection within three seconds, whatever state it is in; again does nothing."""
        closer = threading.Thread(target=self.cf.shut, name="ivl-close", daemon=True)
        if not self.cf.closing:
            self.cf.closing = True
            closer.start()
            closer.join(timeout=self.deadlines.close_s)

    def __enter__(self) -> Self:
        """The session itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close."""
        self.close()

    # ---- questions and answers

    def check(self) -> None:
        """Raise LinkError if the link is known to be gone."""
        if self.cf.lost:
            raise LinkError(f"{self.uri}: link lost: {_explain(self.uri, self.cf.lost)}")

    @property
    def silence_s(self) -> float:
        """Time since anything was heard."""
        return time.monotonic() - self._heard_s

    def send(self, port: int, channel: int, data: bytes) -> None:
        """Send once, without an answer."""
        self.check()
        self.cf.send(port, channel, data)

    def ask(
        self, port: int, channel: int, data: bytes, answer: bytes, what: str, deadline_s: float | None = None
    ) -> bytes:
        """Send until an answer comes that begins with `answer`, and return it whole.

        Raises:
            LinkError: None came within the deadline, or the link is gone.
        """
        return self.ask_many(port, channel, [(data, answer)], what, deadline_s)[0]

    def ask_many(
        self,
        port: int,
        channel: int,
        questions: Sequence[tuple[bytes, bytes]],
        what: str,
        deadline_s: float | None = None,
    ) -> list[bytes]:
        """Ask several questions, a few of them under way at any time; the deadline is from each answer to the next."""
        limit_s = self.deadlines.answer_s if deadline_s is None else deadline_s
        waiter = Waiter({answer: i for i, (_, answer) in enumerate(questions)})
        waiting, answers = deque(range(len(questions))), [b""] * len(questions)
        asked: dict[int, _Asked] = {}
        with self.heard_by(port, channel, waiter):
            last_s = time.monotonic()
            while waiting or asked:
                while waiting and len(asked) < self.deadlines.window:
                    asked[waiting.popleft()] = _Asked()
                for i, state in asked.items():
                    if state.is_due(self._retry_s):
                        self.send(port, channel, questions[i][0])
                i, answer = waiter.take(self._retry_s / 2)
                if i in asked:
                    self._note_round_trip(asked.pop(i))
                    answers[i], last_s = answer, time.monotonic()
                elif time.monotonic() - last_s > limit_s:
                    raise LinkError(f"{self.uri}: no answer within {limit_s:g} s: {what}")
        return answers

    @property
    def _retry_s(self) -> float:
        """A question is repeated after a few round trips, as they have been of late."""
        return min(max(_RETRY_ROUND_TRIPS * self._rtt_s, self.deadlines.retry_s_min), self.deadlines.retry_s)

    def _note_round_trip(self, asked: "_Asked") -> None:
        if asked.n_sent == 1:  # else nobody knows which of them was answered
            self._rtt_s += _RTT_GAIN * (time.monotonic() - asked.sent_s - self._rtt_s)
        else:
            self._rtt_s *= 1.0 + _RTT_GAIN

    def listen(self, port: int, channel: int, listener: Callable[[bytes], None]) -> None:
        """Call `listener` with the data of each packet, in a thread of the link; it must return at once."""
        self._listeners.append((port, channel, listener))

    @contextlib.contextmanager
    def heard_by(self, port: int, channel: int, waiter: "Waiter") -> Iterator[None]:
        """Let a waiter see the packets of a channel."""
        with self._lock:
            self._waiting.setdefault((port, channel), []).append(waiter)
        try:
            yield
        finally:
            with self._lock:
                self._waiting[port, channel].remove(waiter)

    def _on_packet(self, packet: Any) -> None:
        """In cflib's thread, which dies of an exception: nothing here may raise."""
        self._heard_s = time.monotonic()
        port, channel, data = packet.port, packet.channel, bytes(packet.data)
        with self._lock:
            waiting = tuple(self._waiting.get((port, channel), ()))
        for waiter in waiting:
            waiter.offer(data)
        if (port, channel) == (PORT_LINK, 0) and len(data) == 9:
            self._on_pong(data)
        elif (port, channel) == (PORT_CONSOLE, 0):
            self.console.append(data.rstrip(b"\x00").decode("ascii", "replace"))
        for wanted_port, wanted_channel, listener in self._listeners:
            if (wanted_port, wanted_channel) == (port, channel):
                listener(data)

    # ---- link quality

    def _ping(self) -> None:
        now_s = time.monotonic()
        if now_s >= self._next_ping_s and not self.cf.lost:
            self._next_ping_s = now_s + self.ping_s
            self._pings.append([now_s, float("nan")])
            self.cf.send(PORT_LINK, 0, b"\x00" + struct.pack("<d", now_s))

    def _on_pong(self, data: bytes) -> None:
        (sent_s,) = struct.unpack("<d", data[1:])
        for ping in list(self._pings):
            if ping[0] == sent_s:
                ping[1] = self._heard_s - sent_s

    def forget_pings(self) -> None:
        """Let `quality` begin anew."""
        self._pings.clear()

    def quality(self, patience_s: float) -> LinkQuality:
        """How the last fifty pings went; one without an answer counts once it is older than `patience_s`."""
        now_s = time.monotonic()
        judged = [ping for ping in list(self._pings) if ping[1] == ping[1] or now_s - ping[0] > patience_s]
        times = sorted(ping[1] for ping in judged if ping[1] == ping[1])
        p95_s = times[int(0.95 * (len(times) - 1))] if times else float("nan")
        return LinkQuality(len(judged), len(judged) - len(times), p95_s)


@dataclass
class _Asked:
    """A question that is under way."""

    sent_s: float = float("-inf")
    n_sent: int = 0

    def is_due(self, retry_s: float) -> bool:
        """Whether it must be sent now; then it counts as sent."""
        now_s = time.monotonic()
        if now_s - self.sent_s < retry_s:
            return False
        self.sent_s, self.n_sent = now_s, self.n_sent + 1
        return True


class Waiter:
    """Answers that somebody waits for; `offer` is called by the link's thread."""

    def __init__(self, index_of: Mapping[bytes, int]) -> None:
        """Tell how the answers begin, and the number of the question that each belongs to."""
        self._index_of = index_of
        self._sizes = sorted({len(answer) for answer in index_of}, reverse=True)
        self._found: queue.SimpleQueue[tuple[int, bytes]] = queue.SimpleQueue()

    def offer(self, data: bytes) -> None:
        """Take a packet if it is an answer."""
        for size in self._sizes:
            index = self._index_of.get(data[:size])
            if index is not None:
                self._found.put((index, data))
                return

    def take(self, timeout_s: float) -> tuple[int, bytes]:
        """The next answer and the number of its question; -1 if there is none in time."""
        try:
            return self._found.get(timeout=timeout_s)
        except queue.Empty:
            return -1, b""


def check_uri(uri: str) -> None:
    """Raise ConfigError unless the URI is of a kind of link that cflib has."""
    scheme, separator, rest = uri.partition("://")
    if not separator or scheme not in SCHEMES or not rest:
        examples = "udp://127.0.0.1:19850, radio://0/80/2M/E7E7E7E7E7, usb://0, tcp://host:5000, serial://name"
        raise ConfigError(f"uri: value {uri!r} names no link (allowed such as {examples})")
    host, _, port = rest.rpartition(":")
    if scheme in ("udp", "tcp") and not (host and port.isdigit() and 0 < int(port) < 65536):
        raise ConfigError(f"uri: value {uri!r} is not {scheme}://HOST:PORT with a port 1 .. 65535")


def _explain(uri: str, text: str) -> str:
    """What cflib says, in words that tell what to do."""
    if "Cannot find a Crazyradio" in text:
        return "no Crazyradio is plugged in"
    if uri.startswith("usb://") and text.startswith("Could not open"):
        return "no Crazyflie is plugged in"
    if "Connection refused" in text:
        return f"nobody listens there ({_WHO_IS_ASKED[uri.partition('://')[0]]})"
    if "Could not identify device" in text:
        return "there is no such serial port"
    if text.startswith("No driver found"):
        return "the URI is malformed"
    return text


def _cache_folder() -> str | None:
    """Folder for tables of contents, named by their checksums; None if it cannot be made."""
    base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    folder = base / "ivl" / "toc"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return None
    return str(folder) if os.access(folder, os.W_OK) else None
