"""cflib's Crazyflie, made safe against lost datagrams, silent links and its own locks.

What is replaced, and why (cflib 0.1.34; `tests/links/test_steady.py` fails if a replaced method disappears):

send_packet: The original starts a timer thread for each request, which is no daemon, and only for drivers that ask for
    it (UDP does not: one lost datagram stops a connect for ever); an error while it sends leaves its lock taken. Here
    what expects an answer is noted, and one thread sends it again until it comes.
_platform_info_fetched: The first two questions of a connect are never repeated by the original. `ask_source` does, and
    their answer, which may then come twice, counts once.
_param_toc_updated_cb: The original reads every parameter, one round trip each (seconds over radio); `Session` reads
    those that it needs. Its ping thread is no daemon either, and is not started.
_link_error_cb: The original tears the link down inside whichever thread noticed, under the lock that others wait for.
"""

import logging
import socket
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import cflib.crtp  # type: ignore[import-untyped]
from cflib.crazyflie import Crazyflie  # type: ignore[import-untyped]
from cflib.crtp.crtpstack import CRTPPacket, CRTPPort  # type: ignore[import-untyped]

RESEND_S = 0.1
"""An unanswered question of cflib's is asked again after this."""
_TICK_S = 0.02
_RECEIVE_S = 0.05
_SOURCE_CHANNEL = 1


@cache
def init_drivers() -> None:
    """Make every kind of link known to cflib, once in a process, and silence its log of each packet that is ours."""
    logging.getLogger("cflib").setLevel(logging.CRITICAL + 1)
    cflib.crtp.init_drivers(enable_serial_driver=True)


@dataclass
class _Question:
    """A packet that expects an answer."""

    packet: Any
    due_s: float

    def cancel(self) -> None:
        """Called by cflib when the answer has come; it forgets the question itself."""


class SteadyCrazyflie(Crazyflie):  # type: ignore[misc]
    """A Crazyflie whose connect ends, whose sends never block for good, and whose close leaves no thread behind."""

    def __init__(self, toc_cache: str | None) -> None:
        """Nothing is opened yet; `toc_cache` is a folder for tables of contents."""
        super().__init__(rw_cache=toc_cache)
        self.tables_known = threading.Event()
        self.lost = ""
        """Why the link is gone; empty while it is not."""
        self.closing = False
        self._version_known = False
        self._stop = threading.Event()
        self._resender = threading.Thread(target=self._resend, name="ivl-resend", daemon=True)
        self.each_tick: Callable[[], None] = lambda: None
        """Called fifty times a second from a thread of this object, while it is open."""

    def open(self, uri: str) -> None:
        """Begin to connect; `tables_known` is set when it has worked, `lost` when it has not."""
        self.connection_failed.add_callback(lambda _, text: self._link_error_cb(text))
        self._resender.start()
        self.open_link(uri)

    def ask_source(self) -> None:
        """Repeat the first question of a connect, from whose answer the second follows."""
        if not self._version_known:
            _quicken(self.link)
            self.send(CRTPPort.LINKCTRL, _SOURCE_CHANNEL, b"\x00")

    def send(self, port: int, channel: int, data: bytes) -> None:
        """Send one packet, once."""
        packet = CRTPPacket()
        packet.set_header(port, channel)
        packet.data = data
        self.send_packet(packet)

    def send_packet(self, pk: Any, expected_reply: Any = (), resend: bool = False, timeout: float = RESEND_S) -> None:
        """Send, and if an answer is expected, again until it comes or the link is closed."""
        del resend
        link = self.link
        if link is None or self.lost:
            return
        with self._send_lock:
            if expected_reply:
                due_s = time.monotonic() + min(timeout, RESEND_S)
                self._answer_patterns[(pk.header, *expected_reply)] = _Question(pk, due_s)
            link.send_packet(pk)
        self.packet_sent.call(pk)

    def shut(self) -> None:
        """Close everything; takes a fraction of a second, whatever state the link is in."""
        self._stop.set()
        if self._resender.ident is not None:
            self._resender.join(timeout=1.0)
        link = self.link
        self.incoming.stop()
        _wake(link)
        self.close_link()

    def _resend(self) -> None:
        while not self._stop.wait(_TICK_S):
            now_s = time.monotonic()
            for question in list(self._answer_patterns.values()):
                if question.due_s <= now_s and self.link is not None:
                    question.due_s = now_s + RESEND_S
                    with self._send_lock:
                        self.link.send_packet(question.packet)
            self.each_tick()

    def _platform_info_fetched(self) -> None:
        if not self._version_known:  # an answer that comes twice must not start a second download
            self._version_known = True
            _quicken(self.link)
            super()._platform_info_fetched()

    def _param_toc_updated_cb(self) -> None:
        self.tables_known.set()

    def _link_error_cb(self, errmsg: str) -> None:
        self.lost = self.lost or _first_line(errmsg)


def _first_line(text: str) -> str:
    """What went wrong, without cflib's traceback behind it."""
    lines = [line.strip() for line in text.splitlines() if line.strip()] or ["no reason given"]
    first = lines[0].removeprefix("Couldn't load link driver:").strip()
    vague = not first or first.startswith("Error communicating") or "Could not send" in first
    return lines[-1] if vague else first


def _quicken(link: Any) -> None:
    """Let cflib's thread that waits at a socket see within a moment that it is to end; it looks once a second."""
    receiver = getattr(link, "socket", None)
    if isinstance(receiver, socket.socket):
        receiver.settimeout(_RECEIVE_S)


def _wake(link: Any) -> None:
    """Wake the thread that waits for packets of a link; else it takes a second to see that it is to end."""
    queue = getattr(link, "in_queue", None)
    if queue is not None:
        queue.put(None)
