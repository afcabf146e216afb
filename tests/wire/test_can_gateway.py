"""Unmodified cflib through two gateways and a bus: `virtual` in one process, `udp_multicast` across three."""

import asyncio
import errno
import functools
import json
import random
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import can
import cflib.crtp
import pytest
from can.interfaces.virtual import VirtualBus
from cflib.crazyflie import Crazyflie
from cflib.crazyflie.log import LogConfig
from crtp_double import VALUES, Vehicle, value_of

from ivl.can import gateway, link, outbox
from ivl.can.dbc import Codec
from ivl.can.gateway import Options, make_gateway
from ivl.can.link import BusError
from ivl.can.repeat import Repeater

# cflib's threads read the link that is being closed: their errors say nothing about ours
pytestmark = [
    pytest.mark.filterwarnings("ignore:Exception in thread ping_thread"),
    pytest.mark.filterwarnings("ignore:Exception in thread IncomingPacketHandlerThread"),
]
DEADLINE_S = 60.0
TIMEOUT_S, GIVEN_UP_S = 3.0, 60.0
"""On a busy machine a thread may stand still for longer than a heartbeat may be late, and an answer for long."""
PROGRAM = [
    sys.executable,
    "-c",
    f"from ivl.can import link; link.TIMEOUT_S = {TIMEOUT_S}\nfrom ivl.cli import main; main()",
    "can-gateway",
]


def wait_for(condition: Callable[[], Any], what: str) -> None:
    ends_s = time.monotonic() + DEADLINE_S
    while not condition():
        assert time.monotonic() < ends_s, f"never: {what}"
        time.sleep(0.005)


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@pytest.fixture(autouse=True)
def _patient(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(link, "TIMEOUT_S", TIMEOUT_S)
    monkeypatch.setattr(gateway, "Repeater", functools.partial(Repeater, limit_s=GIVEN_UP_S))


class LossyBus(VirtualBus):
    """Loses a share of the frames that carry packets, as a seeded generator says, and no heartbeats."""

    def __init__(self, channel: str, loss: float = 0.0, seed: int = 1) -> None:
        super().__init__(channel)
        self.loss, self.rng, self.n_lost = loss, random.Random(seed), 0
        self.is_full, self.n_tried = False, 0
        self.is_in = can.BusState.ACTIVE

    @property
    def state(self) -> can.BusState:
        return self.is_in

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        self.n_tried += 1
        if self.is_full and self.n_tried % 3:  # as a queue of a few frames that drains: what is refused goes later
            raise can.CanOperationError("Failed to transmit: No buffer space available", errno.ENOBUFS)
        if msg.is_extended_id and self.rng.random() < self.loss:
            self.n_lost += 1
        else:
            super().send(msg, timeout)


class End(threading.Thread):
    """A gateway with an event loop of its own."""

    def __init__(self, bus: LossyBus, options: Options) -> None:
        super().__init__(daemon=True)
        self.bus, self.gateway = bus, make_gateway(bus, options)
        self.error: Exception | None = None
        self._loop = asyncio.new_event_loop()
        self._task: asyncio.Task[None] | None = None
        self.start()

    def run(self) -> None:
        self._task = self._loop.create_task(self.gateway.run())
        try:
            self._loop.run_until_complete(self._task)
        except asyncio.CancelledError:
            pass
        except (BusError, OSError) as error:
            self.error = error
        finally:
            self._loop.close()

    def stop(self) -> None:
        if self.is_alive() and self._task is not None:
            self._loop.call_soon_threadsafe(self._task.cancel)
        self.join(timeout=DEADLINE_S)


class Pair:
    """Both ends on one virtual bus, in front of a vehicle."""

    def __init__(self, vehicle: Vehicle, loss: float = 0.0, **options: Any) -> None:
        self.channel, self.vehicle, self.options = f"bench-{id(self)}", vehicle, options
        self.port = free_port()
        self.uri = f"udp://127.0.0.1:{self.port}"
        self.host = End(LossyBus(self.channel, loss, 1), Options(2, listen=("127.0.0.1", self.port), **options))
        self.far = self.start_far(loss)

    def start_far(self, loss: float = 0.0) -> End:
        return End(LossyBus(self.channel, loss, 2), Options(2, to=("127.0.0.1", self.vehicle.port), **self.options))

    def up(self) -> "Pair":
        wait_for(lambda: self.host.gateway.report()["up"] and self.host.gateway._udp is not None, "link up")
        return self

    def stop(self) -> None:
        for end in (self.host, self.far):
            end.stop()
            end.bus.shutdown()


@pytest.fixture
def pair(vehicle: Vehicle) -> Iterator[Callable[..., Pair]]:
    pairs: list[Pair] = []

    def make(**options: Any) -> Pair:
        pairs.append(Pair(vehicle, **options))
        return pairs[-1].up()

    yield make
    for each in pairs:
        each.stop()


class Client:
    """cflib as it comes, with deadlines."""

    def __init__(self, uri: str) -> None:
        cflib.crtp.init_drivers()
        self.cf = Crazyflie()
        self.fully, self.lost = threading.Event(), threading.Event()
        self.cf.fully_connected.add_callback(lambda _: self.fully.set())
        self.cf.connection_lost.add_callback(lambda *_: self.lost.set())
        self.cf.open_link(uri)
        assert self.fully.wait(DEADLINE_S), "never fully connected"

    def close(self) -> None:
        """Close; its threads look once a second whether they are to end, and are helped to see it now."""
        link = self.cf.link
        if link is not None:
            link.socket.settimeout(0.05)
            self.cf.incoming.stop()
            link.in_queue.put(None)
            self.cf.incoming.join(DEADLINE_S)
        self.cf.link_statistics.stop()
        self.cf.close_link()

    def set(self, name: str, value: float) -> None:
        done = threading.Event()
        group, _, last = name.partition(".")
        self.cf.param.add_update_callback(group, last, lambda *_: done.set())
        self.cf.param.set_value(name, value)
        assert done.wait(DEADLINE_S), f"{name} never acknowledged"
        self.cf.param.remove_update_callback(group, last)

    def log(self, names: list[str], types: str) -> dict[str, float]:
        """The first row of a new block of these variables."""
        rows: list[dict[str, float]] = []
        block = LogConfig("test", period_in_ms=10)
        for name, kind in zip(names, types, strict=True):
            block.add_variable(name, {"f": "float", "u": "uint8_t"}[kind])
        block.data_received_cb.add_callback(lambda _, row, __: rows.append(row))
        self.cf.log.add_config(block)
        block.start()
        wait_for(lambda: rows, f"data of {names}")
        return rows[0]


@pytest.fixture
def connect() -> Iterator[Callable[[str], Client]]:
    clients: list[Client] = []

    def make(uri: str) -> Client:
        clients.append(Client(uri))
        return clients[-1]

    yield make
    for client in clients:
        client.close()


@pytest.mark.parametrize("fd", [False, True])
def test_cflib_connects_reads_writes_and_logs(pair: Any, connect: Any, vehicle: Vehicle, fd: bool) -> None:
    both = pair(fd=fd)
    client = connect(both.uri)
    assert len(client.cf.param.toc.toc["bench"]) == 21
    assert len(client.cf.log.toc.toc["bench"]) == 26
    client.set("bench.p07", 2.5)
    assert vehicle.values[7] == 2.5
    names = ["stateEstimate.z", "ivl.phase", "pm.vbat"]
    assert client.log(names, "fuf") == {n: pytest.approx(VALUES[n.partition(".")[2]]) for n in names}
    for end in (both.host, both.far):
        report = end.gateway.report()
        assert (report["n_bad"], report["n_missing"], report["n_unsent"]) == (0, 0, 0)


def test_bus_that_is_full_now_and_then_loses_nothing(
    pair: Any, connect: Any, vehicle: Vehicle, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(outbox, "SEND_S", DEADLINE_S)  # a busy machine tries again late
    both = pair()
    client = connect(both.uri)
    both.host.bus.is_full = both.far.bus.is_full = True
    for n in range(5):
        client.set("bench.p07", float(n))
        assert vehicle.values[7] == n
    names = [f"bench.u{i:02d}" for i in range(26)]
    assert client.log(names, "u" * 26) == {name: value_of(name.partition(".")[2]) for name in names}
    both.host.bus.is_full = both.far.bus.is_full = False
    for end in (both.host, both.far):
        report = end.gateway.report()
        assert (report["n_bad"], report["n_missing"], report["n_unsent"]) == (0, 0, 0)


def test_what_is_logged_shows_in_frames_for_people(pair: Any, connect: Any) -> None:
    both = pair()
    client = connect(both.uri)
    watcher = VirtualBus(both.channel)
    client.log(["stateEstimate.z", "ivl.phase"], "fu")
    seen: dict[str, Any] = {}

    def watch() -> bool:
        frame = watcher.recv(0.1)
        decoded = None if frame is None else Codec(2).decode(frame)
        seen.update([decoded] if decoded else [])
        is_complete = seen.keys() >= {"STATE_A", "HEARTBEAT_HOST", "HEARTBEAT_VEHICLE"}
        return is_complete and seen["STATE_A"]["phase"] == "approach" and set(states()) == {"running"}

    def states() -> list[str]:
        return [seen[name]["state"] for name in ("HEARTBEAT_HOST", "HEARTBEAT_VEHICLE")]

    wait_for(watch, "state on the bus")
    watcher.shutdown()
    assert seen["STATE_A"]["z"] == 1.25
    assert seen["STATE_A"]["vbat"] is None


def test_lost_frames_cost_time_and_nothing_else(pair: Any, connect: Any, vehicle: Vehicle) -> None:
    both = pair(loss=0.1)
    client = connect(both.uri)
    for i in range(20):
        client.set(f"bench.p{i:02d}", float(i))
    assert vehicle.values[:20] == [float(i) for i in range(20)]
    # a block of three packets: were one lost and repeated out of order, its values would be others
    names = [f"bench.u{i:02d}" for i in range(26)]
    assert client.log(names, "u" * 26) == {name: value_of(name[6:]) for name in names}
    for i in range(200):
        client.cf.commander.send_setpoint(0.0, 0.0, float(i + 1), 1000)
    # a ping behind them: what is still to come has come
    wait_for(lambda: both.far.gateway.report()["n_packets_in"] > 200, "set-points")
    time.sleep(0.1)
    received = [p for p in vehicle.of(3, 0) if p[12:] == (1000).to_bytes(2, "little")]
    assert 0 < len(received) < 200
    assert len(set(received)) == len(received)
    report = both.host.gateway.report()
    assert report["n_repeated"] > 0
    assert report["n_given_up"] == 0
    assert both.host.bus.n_lost > 0
    assert both.far.gateway.report()["n_bad"] + both.far.gateway.report()["n_missing"] > 0


def test_scan_finds_the_vehicle_without_taking_the_link(pair: Any, connect: Any) -> None:
    both = pair()
    client = connect(both.uri)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.settimeout(DEADLINE_S)
        other.sendto(b"\xff", ("127.0.0.1", both.port))
        assert other.recv(64) == b"\xff"
        client.set("bench.p01", 1.0)
        other.sendto(bytes(32), ("127.0.0.1", both.port))
        other.sendto(b"", ("127.0.0.1", both.port))
        client.set("bench.p01", 2.0)


def test_client_sees_that_an_end_is_gone_and_can_come_back(pair: Any, connect: Any, vehicle: Vehicle) -> None:
    both = pair()
    client = connect(both.uri)
    both.far.stop()
    assert client.lost.wait(DEADLINE_S)
    assert not both.host.gateway.report()["up"]
    both.far.bus.shutdown()
    both.far = both.start_far()
    both.up()
    connect(both.uri).set("bench.p02", 5.0)
    assert vehicle.values[2] == 5.0


def test_client_sees_that_the_vehicle_is_gone(pair: Any, connect: Any, vehicle: Vehicle) -> None:
    both = pair()
    client = connect(both.uri)
    vehicle.stop()
    assert client.lost.wait(DEADLINE_S)
    assert both.host.gateway.report()["peer"] == "no_vehicle"


@pytest.mark.parametrize("allow", [False, True])
def test_arming_needs_a_flag(pair: Any, connect: Any, vehicle: Vehicle, allow: bool) -> None:
    both = pair(allow_arming=allow)
    client = connect(both.uri)
    answers: list[bytes] = []
    client.cf.add_port_callback(9, lambda packet: answers.append(bytes(packet.data)))
    client.cf.supervisor.send_arming_request(True)
    wait_for(lambda: [a for a in answers if a[0] == 0x81], "an answer")
    assert vehicle.armed == allow
    assert [a for a in answers if a[0] == 0x81] == [bytes([0x81, allow, allow])]
    assert both.host.gateway.report()["n_arming_refused"] == (not allow)
    client.cf.supervisor.send_arming_request(False)
    wait_for(lambda: b"\x01\x00" in vehicle.of(9, 1), "disarmed")
    assert not vehicle.armed


def test_dead_bus_stops_the_gateway_until_it_is_started_again(pair: Any, connect: Any) -> None:
    both = pair()
    client = connect(both.uri)
    both.host.bus.is_in = can.BusState.ERROR
    both.host.join(DEADLINE_S)
    assert isinstance(both.host.error, BusError)
    assert "bus-off" in str(both.host.error)
    assert client.lost.wait(DEADLINE_S)


def test_port_that_is_taken_is_told(vehicle: Vehicle) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))
        far = End(LossyBus("taken"), Options(2, to=("127.0.0.1", vehicle.port)))
        host = End(LossyBus("taken"), Options(2, listen=other.getsockname()))
        host.join(DEADLINE_S)
        far.stop()
    for end in (host, far):
        end.bus.shutdown()
    assert isinstance(host.error, OSError)
    assert host.error.errno == errno.EADDRINUSE


def test_error_frame_stops_the_gateway(pair: Any) -> None:
    both = pair()
    both.far.bus.send(can.Message(arbitration_id=0x40, is_error_frame=True, dlc=8, data=bytes(8)))
    both.host.join(DEADLINE_S)
    assert "bus-off" in str(both.host.error)


def test_a_third_on_the_bus_does_no_harm(pair: Any, connect: Any, vehicle: Vehicle) -> None:
    both = pair()
    client = connect(both.uri)
    other, rng = VirtualBus(both.channel), random.Random(3)
    for _ in range(2000):
        other.send(can.Message(arbitration_id=rng.getrandbits(29), data=rng.randbytes(rng.randrange(9))))
    client.set("bench.p03", 3.0)
    other.shutdown()
    assert vehicle.values[3] == 3.0


def test_the_programs_over_multicast(connect: Any, vehicle: Vehicle) -> None:
    port, bus_port = free_port(), free_port()
    bus = ["--interface", "udp_multicast", "--channel", "239.74.163.77", "--bus-option", f"port={bus_port}"]
    bus += ["--bus-option", "hop_limit=0", "--node", "15", "--fd", "--json"]
    ends = [
        subprocess.Popen([*PROGRAM, *bus, *end], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        for end in (["--listen", f"127.0.0.1:{port}"], ["--to", f"udp://127.0.0.1:{vehicle.port}"])
    ]
    try:
        assert ends[0].stderr is not None
        for line in ends[0].stderr:
            if line == "node 15: link up\n":
                break
        client = connect(f"udp://127.0.0.1:{port}")
        client.set("bench.p09", 9.0)
        assert vehicle.values[9] == 9.0
        client.close()
    finally:
        for end in ends:
            end.send_signal(signal.SIGINT)
        outputs = [end.communicate(timeout=DEADLINE_S) for end in ends]
    assert [end.returncode for end in ends] == [0, 0], outputs
    reports = [json.loads(output) for output, _ in outputs]
    assert all(report["n_packets_in"] > 80 for report in reports)
    assert reports[0]["n_given_up"] == 0


class StrangeBus(VirtualBus):
    """What a bus made of network packets may bring: nothing that can be decoded, or a message with odd parts."""

    def __init__(self, channel: str) -> None:
        super().__init__(channel)
        self.strange: list[Any] = []

    def recv(self, timeout: float | None = None) -> can.Message | None:
        if self.strange:
            odd = self.strange.pop()
            if isinstance(odd, Exception):
                raise can.CanOperationError("could not unpack received message") from odd
            return can.Message(check=False, **odd)
        return super().recv(timeout)


def test_what_is_no_frame_is_counted_and_ends_nothing(vehicle: Vehicle) -> None:
    channel = f"strange-{id(vehicle)}"
    bus, other = StrangeBus(channel), LossyBus(channel)
    host = End(bus, Options(2, listen=("127.0.0.1", free_port()), networked=True))
    far = End(other, Options(2, to=("127.0.0.1", vehicle.port)))
    try:
        wait_for(lambda: host.gateway.report()["up"], "link up")
        bus.strange = [
            ValueError("a 1-byte datagram"),
            {"arbitration_id": -5},
            {"arbitration_id": "x"},
            {"is_error_frame": True, "arbitration_id": 0x40},
        ]
        wait_for(lambda: not bus.strange and host.gateway.report()["n_bad"] >= 3, "bad frames are counted")
        assert host.gateway.report()["n_error_frames"] == 1
        assert host.gateway.report()["up"]
        assert host.is_alive()
    finally:
        for end in (host, far):
            end.stop()
            end.bus.shutdown()


def test_the_first_client_keeps_the_vehicle(monkeypatch: pytest.MonkeyPatch) -> None:
    bus = VirtualBus("first-client")
    try:
        end: Any = make_gateway(bus, Options(2, listen=("127.0.0.1", 0)))
        monkeypatch.setattr(gateway, "CLIENT_S", 1e9)
        end.datagram_received(b"\xf3", ("127.0.0.1", 1))
        end.datagram_received(b"\x3c\x00", ("127.0.0.1", 2))
        assert end._client == ("127.0.0.1", 1)
        assert end.report()["n_foreign"] == 1
        monkeypatch.setattr(gateway, "CLIENT_S", -1.0)
        end.datagram_received(b"\xf3", ("127.0.0.1", 2))
        assert end._client == ("127.0.0.1", 2)
        assert end.report()["n_foreign"] == 1
    finally:
        bus.shutdown()
