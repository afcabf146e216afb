"""Shared by the tests of the software vehicle: unmodified cflib, and a client of plain sockets."""

import contextlib
import socket
import struct
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import cflib.crtp
import pytest
from cflib.crazyflie import Crazyflie

from ivl.silproc import SilProcess
from ivl.world import World

DEADLINE_S = 60.0  # for a machine that is busy; nothing is judged by it


def wait_for(what: str, condition: Callable[[], Any]) -> Any:
    """The first true value of a condition."""
    end = time.monotonic() + DEADLINE_S
    while not (value := condition()):
        if time.monotonic() > end:
            raise TimeoutError(f"waited {DEADLINE_S} s for: {what}")
        time.sleep(0.002)
    return value


@contextlib.contextmanager
def connected(uri: str, parameters: bool = True) -> Iterator[Crazyflie]:
    """Unmodified cflib, connected."""
    cf = Crazyflie()
    done, failed = threading.Event(), []
    (cf.fully_connected if parameters else cf.connected).add_callback(lambda _: done.set())
    cf.connection_failed.add_callback(lambda _, message: failed.append(message))
    cf.open_link(uri)
    try:
        wait_for(f"a connection to {uri}", lambda: done.is_set() or failed)
        assert not failed
        yield cf
    finally:
        close(cf)


def close(cf: Crazyflie) -> None:
    """Close; its threads look once a second whether they are to end, and are helped to see it now.

    They end before the link is taken from under them, or one of them would trip over it now and then.
    """
    link = cf.link
    if link is not None:
        link.socket.settimeout(0.05)
        cf.incoming.stop()
        link.in_queue.put(None)
        cf.incoming.join(DEADLINE_S)
    cf.link_statistics.stop()
    cf.close_link()


class Raw:
    """A CRTP client of plain sockets, which sends what it is told, and only that."""

    def __init__(self, uri: str) -> None:
        host, port = uri.removeprefix("udp://").split(":")
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.settimeout(DEADLINE_S)
        self.socket.connect((host, int(port)))

    def __enter__(self) -> "Raw":
        return self

    def __exit__(self, *_: object) -> None:
        self.socket.close()

    def send(self, data: str | bytes) -> None:
        self.socket.send(bytes.fromhex(data) if isinstance(data, str) else data)

    def receive(self, null: bool = False) -> bytes:
        """The next packet that says something, or that says nothing."""
        while (packet := self.socket.recv(100)) == b"\xff" and not null:
            pass
        return packet

    def ask(self, data: str | bytes) -> bytes:
        """Send, and the next packet on the same port and channel."""
        request = bytes.fromhex(data) if isinstance(data, str) else data
        self.send(request)
        while True:
            reply = self.receive()
            if reply[0] & 0xF3 == request[0] & 0xF3:
                return reply

    def come(self) -> list[bytes]:
        """What has come by now and was not read yet."""
        packets = []
        self.socket.setblocking(False)
        with contextlib.suppress(BlockingIOError):
            while True:
                packets.append(self.socket.recv(100))
        self.socket.settimeout(DEADLINE_S)
        return packets

    def silent(self) -> bool:
        """Nothing has come."""
        return not self.come()

    def connect(self) -> None:
        """The packets with which cflib begins, tables left out."""
        assert self.ask("fd00")[1:19] == b"Bitcraze Crazyflie"
        assert self.ask("dd00") == bytes.fromhex("dd000c000000")
        assert self.ask("5d05") == bytes.fromhex("5d050000")
        n_logs, *_ = struct.unpack("<HIBB", self.ask("5c03")[2:])
        assert len(self.ask(b"\x5c\x02" + struct.pack("<H", n_logs - 1))) > 6
        assert self.ask("4c01")[2] >= 7
        assert len(self.ask("4c0201")) == 16
        n_params, _ = struct.unpack("<HI", self.ask("2c03")[2:])
        assert len(self.ask(b"\x2c\x02" + struct.pack("<H", n_params - 1))) > 6
        assert self.ask(b"\x2d" + struct.pack("<H", n_params - 1))[3] == 0


@pytest.fixture(scope="session", autouse=True)
def _drivers() -> None:
    cflib.crtp.init_drivers()


@pytest.fixture(scope="session")
def world() -> World:
    return World()


@pytest.fixture
def sil(world: World) -> Iterator[SilProcess]:
    """A vehicle in real time."""
    with SilProcess(world) as process:
        yield process


@pytest.fixture
def fast(world: World) -> Iterator[SilProcess]:
    """A vehicle as fast as possible."""
    with SilProcess(world, speed=None) as process:
        yield process


@pytest.fixture
def stepped(world: World) -> Iterator[SilProcess]:
    """A vehicle in lock-step."""
    with SilProcess(world, lockstep=True) as process:
        yield process


@pytest.fixture(name="connected")
def _connected() -> Callable[..., contextlib.AbstractContextManager[Crazyflie]]:
    return connected


@pytest.fixture(name="Raw")
def _raw() -> type[Raw]:
    return Raw


@pytest.fixture(name="wait_for")
def _wait_for() -> Callable[[str, Callable[[], Any]], Any]:
    return wait_for
