"""Two gateways on a bus between clients and a vehicle, in one thread, with a clock that a test turns."""

import errno
import functools
import heapq
import itertools
from collections import deque
from collections.abc import Callable
from typing import Any

import can

from ivl.can.gateway import HostGateway, Options, VehicleGateway

TICK_S = 0.01
STEP_S = 0.001


class Clock:
    """Time, and what is to be done at a time."""

    def __init__(self) -> None:
        self.now_s = 100.0
        self._number = itertools.count()
        self._due: list[tuple[float, int, Callable[[], None]]] = []

    def monotonic(self) -> float:
        return self.now_s

    def call_later(self, delay_s: float, action: Callable[[], None]) -> None:
        heapq.heappush(self._due, (self.now_s + delay_s, next(self._number), action))

    def advance(self, step_s: float) -> None:
        ends_s = self.now_s + step_s
        while self._due and self._due[0][0] <= ends_s:
            self.now_s, _, action = heapq.heappop(self._due)
            action()
        self.now_s = ends_s


class Transport:
    """A socket's end: what is sent goes to a function."""

    def __init__(self, take: Callable[[bytes, Any], None]) -> None:
        self._take, self.is_closed = take, False

    def sendto(self, packet: bytes, address: Any = None) -> None:
        self._take(packet, address)

    def close(self) -> None:
        self.is_closed = True


class Loop:
    """As much of an event loop as a gateway asks for."""

    def __init__(self, clock: Clock, transport: Transport) -> None:
        self._transport = transport
        self.call_later = clock.call_later

    async def create_datagram_endpoint(self, factory: Callable[[], Any], **_: Any) -> tuple[Transport, Any]:
        self._transport.is_closed = False
        return self._transport, factory()


class Bus:
    """One end's side of the bus: it may lose, be full, and carry what another node says."""

    def __init__(self) -> None:
        self.other: Bus | None = None
        self.arriving: deque[can.Message] = deque()
        self.loses = self.is_full = False

    @property
    def state(self) -> can.BusState:
        raise NotImplementedError

    def send(self, frame: can.Message, timeout: float | None = None) -> None:  # noqa: ARG002 (python-can's signature)
        if self.is_full:
            raise can.CanOperationError("Failed to transmit: No buffer space available", errno.ENOBUFS)
        if not self.loses and self.other is not None:
            self.other.arriving.append(frame)


class Gateways:
    """Both ends; `at_vehicle` and `at_client` are told what arrives there."""

    def __init__(
        self, at_vehicle: Callable[[bytes], None], at_client: Callable[[bytes, Any], None], allow_arming: bool
    ) -> None:
        self.clock = Clock()
        self.buses = (Bus(), Bus())
        self.buses[0].other, self.buses[1].other = self.buses[1], self.buses[0]
        to_client, to_vehicle = Transport(at_client), Transport(lambda packet, _: at_vehicle(packet))
        self.loops = (Loop(self.clock, to_client), Loop(self.clock, to_vehicle))
        bus_host: Any = self.buses[0]
        bus_vehicle: Any = self.buses[1]
        self.host = HostGateway(
            bus_host, Options(2, listen=("127.0.0.1", 1), allow_arming=allow_arming, networked=True)
        )
        self.far = VehicleGateway(
            bus_vehicle, Options(2, to=("127.0.0.1", 2), allow_arming=allow_arming, networked=True)
        )
        self._next_tick_s = self.clock.now_s
        self.running: Any = self.loops[0]

    def inside(self, end: int, action: Callable[[], Any]) -> Any:
        """Do something in the loop of an end."""
        before, self.running = self.running, self.loops[end]
        try:
            return action()
        finally:
            self.running = before

    def advance(self, span_s: float) -> None:
        """Let time pass: frames arrive, timers run, both ends have their ticks."""
        ends_s = self.clock.now_s + span_s
        while self.clock.now_s < ends_s:
            for end, gateway in enumerate((self.host, self.far)):
                arriving = self.buses[end].arriving
                for _ in range(len(arriving)):
                    self.inside(end, functools.partial(gateway.on_frame, arriving.popleft()))
            if self.clock.now_s >= self._next_tick_s:
                self._next_tick_s += TICK_S
                for end, gateway in enumerate((self.host, self.far)):
                    self.inside(end, functools.partial(self._tick, gateway))
            self.clock.advance(STEP_S)

    def _tick(self, gateway: Any) -> None:
        ticking = gateway._tick(self.clock.now_s)
        try:
            ticking.send(None)
        except StopIteration:
            gateway._try_again_soon()
            return
        raise AssertionError("a tick waits for something")
