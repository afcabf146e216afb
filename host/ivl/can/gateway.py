"""The gateway: CRTP on UDP to CAN, and back.

At the host it is what a vehicle is to cflib, a server on a UDP port; at the vehicle it is the vehicle's client. One
event loop, no threads of its own; a gateway is one end of the link of one node.
"""

import asyncio
import contextlib
import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import can

from ivl.can import requests
from ivl.can.link import BusError, CanLink, State
from ivl.can.repeat import LogMemory, Repeater
from ivl.can.telemetry import Telemetry
from ivl.errors import IvlError

TICK_S = 0.01
AGAIN_S = 0.0005
"""A bus that is full is tried again after so long: a classic frame takes a fifth of that."""
TELEMETRY_S = 0.05
STOP_S = 10.0
"""A thread that reads a bus without a file ends within 0.1 s, on a busy machine later; it must not outlive the loop."""
PACKET_MAX = 31
CLIENT_S = 1.0
"""A client that is silent for so long has gone, as for the software vehicle; until then no other one is heard."""
_ID_MAX, _DATA_MAX = 2**29 - 1, 64
_SCAN = b"\xff"
"""A packet without a port that cflib sends to find vehicles; whoever sends it is no client yet."""
_REFUSED = bytes([0x91, 0x81, 0, 0])
"""Answer to a request to arm: not granted, not armed."""

Address = tuple[str, int]


@dataclass(frozen=True)
class Options:
    """What a gateway is told.

    Attributes:
        node: Number of the vehicle on the bus, 0 .. 15.
        listen: At the host: where UDP clients find the vehicle. None at the vehicle.
        to: At the vehicle: its UDP port. None at the host.
        fd: One CAN FD frame for a packet, instead of up to four classic frames.
        allow_arming: Let requests to arm the motors pass.
        networked: The bus is made of network packets, which anybody may have sent: an error frame says nothing then.
    """

    node: int
    listen: Address | None = None
    to: Address | None = None
    fd: bool = False
    allow_arming: bool = False
    networked: bool = False


class Gateway(ABC, asyncio.DatagramProtocol):
    """What both ends have in common: a bus, a socket, a clock."""

    at_host: bool

    def __init__(self, bus: can.BusABC, options: Options) -> None:
        """Run on an open bus, which stays the caller's."""
        self.options = options
        self.n_packets_in = self.n_packets_out = self.n_dropped = self.n_arming_refused = 0
        self._bus = bus
        self._link = CanLink(bus, options.node, self.at_host, options.fd, not options.networked)
        self._udp: asyncio.DatagramTransport | None = None
        self._failed: asyncio.Future[None] | None = None
        self._is_pumping = False

    async def run(self) -> None:
        """Run until the task is cancelled.

        Raises:
            BusError: The bus cannot be used any more.
            OSError: The UDP port cannot be had.
        """
        loop = asyncio.get_running_loop()
        self._failed = loop.create_future()
        tolerant: Any = _Tolerant(self._bus, self._link.count_bad)
        notifier = can.Notifier(tolerant, [_Frames(self)], timeout=0.1, loop=loop)
        loop.set_exception_handler(lambda _, context: self._fail(context.get("exception") or context["message"]))
        ticking = asyncio.ensure_future(self._tick_forever())
        try:
            done, _ = await asyncio.wait({ticking, self._failed}, return_when=asyncio.FIRST_COMPLETED)
            for ended in done:
                ended.result()
        finally:
            ticking.cancel()
            with contextlib.suppress(asyncio.CancelledError, BusError, OSError):
                await ticking
            notifier.stop(timeout=STOP_S)
            self._close()
            with contextlib.suppress(BusError):
                self._link.say(State.STOPPED, self.n_repeated, time.monotonic())
            await asyncio.sleep(0)  # the socket closes in the next turn of the loop

    @property
    def n_repeated(self) -> int:
        """Requests that this end has sent again."""
        return 0

    def report(self) -> dict[str, Any]:
        """State of the link and counts since the start."""
        now_s = time.monotonic()
        return {
            "up": self._link.is_up(now_s),
            "peer": self._link.peer_text(now_s),
            "n_packets_in": self.n_packets_in,
            "n_packets_out": self.n_packets_out,
            "n_dropped": self.n_dropped,
            "n_arming_refused": self.n_arming_refused,
            "n_repeated": self.n_repeated,
            **self._link.report(),
        }

    def on_frame(self, frame: can.Message) -> None:
        """A frame has come."""
        now_s = time.monotonic()
        packet = self._link.take(frame, now_s)
        if packet is not None:
            self.n_packets_in += 1
            self._from_bus(packet, now_s)

    @abstractmethod
    def _from_bus(self, packet: bytes, now_s: float) -> None: ...

    @abstractmethod
    async def _tick(self, now_s: float) -> None: ...

    async def _tick_forever(self) -> None:
        while True:
            await self._tick(time.monotonic())
            self._try_again_soon()
            await asyncio.sleep(TICK_S)

    def _to_bus(self, packets: list[bytes], now_s: float) -> None:
        for packet in packets:
            self.n_packets_out += 1
            self._link.send(packet, now_s)
        self._try_again_soon()

    def _try_again_soon(self) -> None:
        if self._link.is_waiting and not self._is_pumping:
            self._is_pumping = True
            asyncio.get_running_loop().call_later(AGAIN_S, self._pump)

    def _pump(self) -> None:
        self._is_pumping = False
        self._link.pump(time.monotonic())
        self._try_again_soon()

    def _own_state(self, now_s: float) -> State:
        return State.RUNNING if self._link.hears_peer(now_s) else State.PEER_LOST

    def _may_pass(self, packet: bytes) -> bool:
        refused = requests.is_arming(packet) and not self.options.allow_arming
        self.n_arming_refused += refused
        return not refused

    def _fail(self, error: Any) -> None:
        assert self._failed is not None
        if not self._failed.done():
            known = isinstance(error, (IvlError, OSError))
            self._failed.set_exception(error if known else BusError(f"gateway: {type(error).__name__}: {error}"))

    def _close(self) -> None:
        if self._udp is not None:
            self._udp.close()
            self._udp = None


class HostGateway(Gateway):
    """The host's end. Its UDP port is open while the link is up: a client sees at once that the vehicle is gone."""

    at_host = True

    def __init__(self, bus: can.BusABC, options: Options) -> None:
        """Serve UDP clients at `options.listen`."""
        super().__init__(bus, options)
        self._repeater = Repeater()
        self._client: Any = None
        self._t_client_s = float("-inf")
        self.n_foreign = 0

    @property
    def n_repeated(self) -> int:
        """Requests that this end has sent again."""
        return self._repeater.n_repeated

    def report(self) -> dict[str, Any]:
        """State of the link and counts since the start."""
        return {**super().report(), "n_given_up": self._repeater.n_given_up, "n_foreign": self.n_foreign}

    def datagram_received(self, data: bytes, address: Any) -> None:
        """A client has sent a packet; the first one keeps the vehicle until it is silent."""
        now_s = time.monotonic()
        if data == _SCAN:
            self._answer(_SCAN, address)
            return
        if not 1 <= len(data) <= PACKET_MAX:
            self.n_dropped += 1
            return
        if address != self._client:
            if self._client is not None and now_s - self._t_client_s <= CLIENT_S:
                self.n_foreign += 1
                return
            self._client = address
            self._repeater.clear()
        self._t_client_s = now_s
        if self._may_pass(data):
            self._to_bus(self._repeater.offer(data, now_s), now_s)
        else:
            self._answer(_REFUSED, address)

    def _from_bus(self, packet: bytes, now_s: float) -> None:
        self._to_bus(self._repeater.answered(packet, now_s), now_s)
        if self._client is None:
            self.n_dropped += 1
        else:
            self._answer(packet, self._client)

    def _answer(self, packet: bytes, address: Any) -> None:
        if self._udp is not None:
            self._udp.sendto(packet, address)

    async def _tick(self, now_s: float) -> None:
        self._link.beat(self._own_state(now_s), self.n_repeated, now_s)
        if not self._link.is_up(now_s):
            self._repeater.clear()
            self._client = None
            self._close()
        elif self._udp is None:
            loop = asyncio.get_running_loop()
            self._udp, _ = await loop.create_datagram_endpoint(lambda: self, local_addr=self.options.listen)
        self._to_bus(self._repeater.due(now_s), now_s)


class VehicleGateway(Gateway):
    """The vehicle's end: its client. It also shows state and policy in frames of ivl.dbc."""

    at_host = False

    def __init__(self, bus: can.BusABC, options: Options) -> None:
        """Be the client of the vehicle at `options.to`."""
        super().__init__(bus, options)
        self._memory, self._telemetry = LogMemory(), Telemetry(self._link.codec)
        self._has_vehicle = False
        self._t_told_s = float("-inf")

    def datagram_received(self, data: bytes, address: Any) -> None:  # noqa: ARG002 (the socket has one peer)
        """The vehicle has sent a packet."""
        now_s = time.monotonic()
        is_answer_to_scan = not self._has_vehicle
        self._has_vehicle = True
        if is_answer_to_scan or data == _SCAN:
            return
        if not 1 <= len(data) <= PACKET_MAX:
            self.n_dropped += 1
            return
        self._memory.answered(data)
        if self._telemetry.observer.from_vehicle(data, now_s):
            self._to_bus([data], now_s)

    def error_received(self, exc: Exception) -> None:  # noqa: ARG002 (refused is all that it can say)
        """Nobody listens at the vehicle's port."""
        self._has_vehicle = False

    def _from_bus(self, packet: bytes, now_s: float) -> None:
        if self._udp is None or not self._link.hears_peer(now_s):
            self.n_dropped += 1
            return
        if not self._may_pass(packet):
            self._to_bus([_REFUSED], now_s)
            return
        goes_on, answer = self._memory.forward(packet)
        if goes_on:
            self._udp.sendto(packet)
            for question in self._telemetry.observer.from_host(packet):
                self._udp.sendto(question)
        elif answer is not None:
            self._to_bus([answer], now_s)

    def _own_state(self, now_s: float) -> State:
        return super()._own_state(now_s) if self._has_vehicle else State.NO_VEHICLE

    async def _tick(self, now_s: float) -> None:
        if self._udp is None:
            loop = asyncio.get_running_loop()
            self._udp, _ = await loop.create_datagram_endpoint(lambda: self, remote_addr=self.options.to)
        self._link.beat(self._own_state(now_s), self.n_repeated, now_s)
        if now_s - self._t_told_s >= TELEMETRY_S:
            self._t_told_s = now_s
            if not self._has_vehicle:
                self._udp.sendto(_SCAN)
            for frame in self._telemetry.frames(now_s):
                self._link.show(frame, now_s)


class _Tolerant:
    """A bus on which what is no frame is counted, and not an error that ends the reader."""

    def __init__(self, bus: can.BusABC, on_bad: Callable[[], None]) -> None:
        self._bus, self._on_bad = bus, on_bad

    def __getattr__(self, name: str) -> Any:
        return getattr(self._bus, name)

    def recv(self, timeout: float | None = None) -> can.Message | None:
        """The next frame, if there is one.

        Raises:
            can.CanError: The bus failed.
        """
        try:
            frame = self._bus.recv(timeout)
        except can.CanError as error:
            if error.__cause__ is None or isinstance(error.__cause__, OSError):
                raise
            frame = None  # it could not be decoded
            self._on_bad()
        except (ValueError, TypeError, KeyError, AttributeError):
            frame = None
            self._on_bad()
        if frame is None or _is_frame(frame):
            return frame
        self._on_bad()
        return None


def _is_frame(frame: Any) -> bool:
    """Whether its parts are what they must be; an interface made of packets takes them as they were sent."""
    number, data = frame.arbitration_id, frame.data
    is_number = isinstance(number, int) and 0 <= number <= _ID_MAX
    return is_number and isinstance(data, (bytes, bytearray)) and len(data) <= _DATA_MAX


class _Frames(can.Listener):
    """Hands what the bus says to a gateway."""

    def __init__(self, gateway: Gateway) -> None:
        self._gateway = gateway

    def on_message_received(self, msg: can.Message) -> None:
        """A frame."""
        self._gateway.on_frame(msg)

    def on_error(self, exc: Exception) -> None:
        """The bus failed."""
        self._gateway._fail(BusError(f"CAN bus: {exc}"))


def make_gateway(bus: can.BusABC, options: Options) -> Gateway:
    """The end that the options ask for."""
    return HostGateway(bus, options) if options.to is None else VehicleGateway(bus, options)
