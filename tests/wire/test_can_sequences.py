"""Random sequences of clients, a vehicle and a bad bus over both gateways; what breaks a rule is shown at its shortest.

Rules, for whatever order things come in:

- nothing reaches the vehicle but what the client who had it has sent, and answers go to nobody else;
- a request to stop is there within 30 ms if the bus takes frames, whatever else is under way;
- what must not be sent again is never there twice, nor late, nor after a request to stop that was sent behind it;
- arming passes with its flag alone; no input ends a gateway.
"""

import os
import struct
import time
from collections.abc import Iterator
from typing import Any

import can
import pytest
from gateways import Gateways
from hypothesis import Phase, settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    invariant,
    precondition,
    rule,
    run_state_machine_as_test,
)

from ivl.can import gateway
from ivl.can.link import BusError
from ivl.can.outbox import SEND_S

N_SEQUENCES = int(os.environ.get("IVL_SEQUENCES", "25"))
COMMAND, POLICY, SETPOINT, READ, PARAM = 0xD2, 0xD2, 0x30, 0x41, 0x22
STOPS = (0, 3)
STOP_S, LATE_S = 0.03, SEND_S + 0.02
CLIENT_S = gateway.CLIENT_S
ARMING = bytes([0x91, 0x01, 0x01])
running: list[Gateways] = []
played = {"sequences": 0, "packets": 0, "strangers": 0, "stops": 0}


class Machine(RuleBasedStateMachine):
    """Three clients, of whom the first to speak has the vehicle until he is silent."""

    @initialize(allow_arming=st.booleans())
    def begin(self, allow_arming: bool) -> None:
        played["sequences"] += 1
        self.allow_arming = allow_arming
        self.holder: int | None = None
        self.t_heard_s = 0.0
        self.n_sent = 0
        self.sent: dict[bytes, tuple[float, bool]] = {}
        self.seen: dict[bytes, int] = {}
        self.numbered: set[bytes] = set()  # what is sent once, and is no noise
        self.stop: tuple[bytes, float] | None = None
        self.last_stop = -1
        self.broken = ""
        self.gateways = Gateways(self.at_vehicle, self.at_client, allow_arming)
        running.append(self.gateways)
        self.wait(40)

    # ---- what arrives

    def at_vehicle(self, packet: bytes) -> None:
        if packet == b"\xff":
            self.gateways.inside(1, lambda: self.gateways.far.datagram_received(b"\xff", None))
            return
        now_s = self.gateways.clock.now_s
        played["packets"] += 1
        if packet == ARMING:
            self.fail_if(not self.allow_arming, "arming passes without its flag")
        elif packet in self.sent:
            t_sent_s, is_clients = self.sent[packet]
            self.fail_if(not is_clients, "a packet of a stranger reaches the vehicle")
            self.seen[packet] = self.seen.get(packet, 0) + 1
            if packet in self.numbered and packet[0] in (COMMAND, SETPOINT):
                self.fail_if(self.seen[packet] > 1, "a command is there twice")
                self.fail_if(now_s - t_sent_s > LATE_S, "a command is late")
            if packet in self.numbered and packet[0] == COMMAND:
                number = struct.unpack("<I", packet[4:8])[0]
                stops = packet[3] in STOPS
                self.fail_if(
                    not stops and number < self.last_stop, "a command is there after a stop that was sent later"
                )
                self.last_stop = max(self.last_stop, number) if stops else self.last_stop
        elif packet[0] & 0xF0 != 0x50:  # the gateway itself asks for names of logs
            self.fail_if(True, "nobody has sent what reaches the vehicle")
        if packet[0] in (READ, PARAM):
            answer = packet[:6]
            self.gateways.inside(1, lambda: self.gateways.far.datagram_received(answer, None))

    def at_client(self, packet: bytes, address: Any) -> None:
        is_answer = packet != b"\xff" and packet[0] != 0x91
        if is_answer and self.holder is not None and self.gateways.clock.now_s - self.t_heard_s < CLIENT_S - 0.1:
            self.fail_if(address != self.holder, "an answer goes to a stranger")

    def fail_if(self, is_broken: bool, what: str) -> None:
        if is_broken and not self.broken:
            self.broken = what

    # ---- what happens

    def send(self, client: int, packet: bytes) -> bool:
        """Whether it is of the client who has the vehicle; None who it is cannot be said of nobody."""
        now_s = self.gateways.clock.now_s
        is_free = self.holder is None or now_s - self.t_heard_s > CLIENT_S
        is_clients = is_free or client == self.holder
        if self.gateways.host._udp is None:  # the link is down: the port is closed
            return False
        if is_clients:
            self.holder, self.t_heard_s = client, now_s
        played["strangers"] += not is_clients
        self.sent[packet] = (now_s, is_clients or self.sent.get(packet, (0.0, False))[1])
        self.gateways.inside(0, lambda: self.gateways.host.datagram_received(packet, client))
        self.wait(1)
        return is_clients

    @rule(client=st.integers(0, 2), request=st.integers(0, 4))
    def command(self, client: int, request: int) -> None:
        self.n_sent += 1
        packet = bytes([COMMAND, 2, 2, request]) + struct.pack("<I", self.n_sent) + bytes(16)
        self.numbered.add(packet)
        is_clients = self.send(client, packet)
        takes = not any(bus.is_full or bus.loses for bus in self.gateways.buses)
        if is_clients and request in STOPS and takes and self.is_up():
            self.stop = (packet, self.gateways.clock.now_s)

    @rule(client=st.integers(0, 2), n=st.integers(1, 60), port=st.sampled_from([READ, PARAM, SETPOINT]))
    def burst(self, client: int, n: int, port: int) -> None:
        for _ in range(n):
            self.n_sent += 1
            packet = bytes([port]) + struct.pack("<I", self.n_sent) + bytes(22)
            self.numbered.add(packet)
            self.send(client, packet)

    @rule(client=st.integers(0, 2))
    def arm(self, client: int) -> None:
        self.send(client, ARMING)
        self.sent.pop(ARMING, None)

    @rule(client=st.integers(0, 2), data=st.binary(max_size=40))
    def noise(self, client: int, data: bytes) -> None:
        if data[:1] not in (b"\x91", b"\xd0", b"\x90", b"\xff"):
            self.send(client, data)

    @rule(end=st.integers(0, 1), number=st.integers(0, 2**29 - 1), data=st.binary(max_size=8), is_error=st.booleans())
    def foreign_frame(self, end: int, number: int, data: bytes, is_error: bool) -> None:
        # of another node, since a frame of our own number is one that the other end could have sent
        number = number & ~(0xF << 17) | (5 << 17)
        frame = can.Message(arbitration_id=number, data=data, is_extended_id=True, is_error_frame=is_error)
        self.gateways.buses[end].arriving.append(frame)
        self.wait(1)

    @rule(end=st.integers(0, 1), loses=st.booleans())
    def bus_loses(self, end: int, loses: bool) -> None:
        self.gateways.buses[end].loses = loses
        self.stop = None

    @rule(ms=st.integers(1, 200))
    def bus_is_full(self, ms: int) -> None:
        """For less time than the bus may refuse all; then the gateway would end, as it must."""
        for bus in self.gateways.buses:
            bus.is_full = True
        self.stop = None
        self.wait(ms)
        for bus in self.gateways.buses:
            bus.is_full = False
        self.wait(120)  # a heartbeat leaves; a gateway that sees no frame go in between takes two such times for one

    @rule(ms=st.integers(1, 400))
    def wait(self, ms: int) -> None:
        self.gateways.advance(1e-3 * ms)

    @rule()
    def silence(self) -> None:
        self.gateways.advance(CLIENT_S + 0.2)

    @precondition(lambda self: not any(bus.loses for bus in self.gateways.buses))
    @rule()
    def vehicle_says_nothing(self) -> None:
        self.gateways.inside(1, lambda: self.gateways.far.error_received(ConnectionRefusedError()))

    def is_up(self) -> bool:
        now_s = self.gateways.clock.now_s
        return bool(self.gateways.host._link.is_up(now_s) and self.gateways.far._link.hears_peer(now_s))

    @invariant()
    def holds(self) -> None:
        if not hasattr(self, "gateways"):
            return
        if self.stop is not None:
            packet, t_sent_s = self.stop
            if packet in self.seen:
                self.stop = None
                played["stops"] += 1
            elif self.gateways.clock.now_s - t_sent_s > STOP_S:
                self.fail_if(True, "a request to stop is not there in time")
        if self.gateways.host._client is None:
            self.holder = None  # the link was down
        assert not self.broken, self.broken

    def teardown(self) -> None:
        running.clear()


@pytest.fixture(autouse=True)
def _clock(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    true_s = time.monotonic
    monkeypatch.setattr(gateway.time, "monotonic", lambda: running[-1].clock.now_s if running else true_s())
    monkeypatch.setattr(gateway.asyncio, "get_running_loop", lambda: running[-1].running)
    yield
    monkeypatch.undo()


FEW = settings(
    max_examples=N_SEQUENCES, stateful_step_count=30, deadline=None, derandomize="IVL_SEQUENCES" not in os.environ
)


def test_no_sequence_over_the_gateways_breaks_a_rule() -> None:
    run_state_machine_as_test(Machine, settings=FEW)
    print("can sequences:", " ".join(f"{name}={n}" for name, n in played.items()))


def test_a_gateway_that_heeds_strangers_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gateway, "CLIENT_S", -1.0)
    with pytest.raises(AssertionError, match="a stranger"):
        run_state_machine_as_test(Machine, settings=settings(FEW, max_examples=300, phases=[Phase.generate]))


def test_a_bus_that_refuses_for_long_ends_the_gateway_and_nothing_else() -> None:
    machine = Machine()
    machine.begin(allow_arming=False)
    for bus in machine.gateways.buses:
        bus.is_full = True
    with pytest.raises(BusError, match="nothing could be sent"):
        machine.wait(2000)
    machine.teardown()
