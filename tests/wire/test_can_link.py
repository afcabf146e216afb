"""What a bus tells: frames for people, what passes by, heartbeats, and a bus that is dead."""

import errno
import math
import struct
from collections import deque
from collections.abc import Iterator

import can
import cantools
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ivl import forms
from ivl.can.dbc import FILE, Codec, RangeError
from ivl.can.fragments import Joiner
from ivl.can.link import BusError, CanLink, State
from ivl.can.telemetry import Observer, Telemetry
from ivl.errors import ConfigError
from ivl.links import packets

PING = b"\xfc\x00"


# ---- frames of ivl.dbc


def test_state_frame_bytes_by_hand() -> None:
    frame = Codec(0).encode("STATE_A", {"phase": 3, "count": 200, "z": 2.1, "vz": -0.5, "vbat": 3.7})
    assert frame.arbitration_id == 0x100
    assert not frame.is_extended_id
    assert bytes(frame.data) == struct.pack("<BBhhH", 3, 200, 2100, -500, 3700)


def test_policy_frame_holds_the_vehicles_own_float() -> None:
    frame = Codec(5).encode("POLICY_PARAM", {"form": 1, "number": 2, "value": 4.8})
    assert (frame.arbitration_id, bytes(frame.data)) == (0x135, struct.pack("<BBxxf", 1, 2, 4.8))


def test_cantools_alone_reads_the_frames() -> None:
    frame = Codec(0).encode("STATE_B", {"rule": 2, "cause": 0, "count": 1, "rrev": None, "d_ceil": 0.012})
    read = cantools.database.load_file(FILE).decode_message(frame.arbitration_id, frame.data)
    assert {k: str(v) for k, v in read.items()} == {
        "rule": "2", "cause": "0", "count": "1", "rrev": "unknown", "d_ceil": "0.012"
    }  # fmt: skip


@pytest.mark.parametrize(("signal", "value"), [("value", math.nan), ("value", math.inf), ("number", 64), ("form", -1)])
def test_value_out_of_range_is_refused_with_its_name(signal: str, value: float) -> None:
    with pytest.raises(RangeError, match=rf"POLICY_PARAM\.{signal}: value .*allowed "):
        Codec(0).encode("POLICY_PARAM", {"form": 0, "number": 1, "value": 4.8, signal: value})


def test_value_that_is_needed_cannot_be_unknown() -> None:
    with pytest.raises(RangeError, match=r"POLICY_PARAM\.value: a value is needed"):
        Codec(0).encode("POLICY_PARAM", {"form": 0, "number": 1, "value": None})


@given(z=st.floats(-32.767, 32.767), vz=st.floats(-32.767, 32.767), vbat=st.floats(0, 65.534), phase=st.integers(0, 7))
def test_every_value_in_range_comes_back_within_half_a_step(z: float, vz: float, vbat: float, phase: int) -> None:
    codec = Codec(7)
    decoded = codec.decode(codec.encode("STATE_A", {"phase": phase, "count": 0, "z": z, "vz": vz, "vbat": vbat}))
    assert decoded is not None
    name, values = decoded
    assert (name, values["phase"]) == ("STATE_A", packets.Phase(phase).name.lower())
    assert [values["z"], values["vz"], values["vbat"]] == pytest.approx([z, vz, vbat], abs=0.000501)


def test_identifiers_of_all_nodes_differ() -> None:
    ids = [message.frame_id for node in range(16) for message in Codec(node).database.messages]
    assert len(ids) == len(set(ids)) == 16 * 6
    assert max(ids) < 0x800
    with pytest.raises(ConfigError, match=r"node: value 16 .*0 \.\. 15"):
        Codec(16)


# ---- what passes by


def observed(*, ask: bool = False) -> Observer:
    observer = Observer()
    names = {0: b"\x07stateEstimate\0z\0", 1: b"\x01ivl\0phase\0", 2: b"\x07pm\0vbat\0"}
    items = [struct.pack("<BBH", 0x50, 2, number) + row for number, row in names.items()]
    if not ask:
        assert all(observer.from_vehicle(item, 0.0) for item in items)
    questions = observer.from_host(b"\x5d\x06\x04\x07\x00\x00\x01\x01\x00") + observer.from_host(
        b"\x5d\x07\x04\x07\x02\x00"
    )
    assert questions == ([item[:4] for item in items] if ask else [])
    if ask:
        assert not any(observer.from_vehicle(item, 0.0) for item in items)
        assert all(observer.from_vehicle(item, 0.0) for item in items)
    return observer


@pytest.mark.parametrize("ask", [False, True])
def test_log_data_become_values(ask: bool) -> None:
    observer = observed(ask=ask)
    assert observer.from_vehicle(b"\x52\x04\x00\x00\x00" + struct.pack("<fBf", 1.5, 2, 3.9), 7.0)
    assert observer.values == {"stateEstimate.z": 1.5, "ivl.phase": 2, "pm.vbat": pytest.approx(3.9)}
    telemetry = Telemetry(Codec(0))
    telemetry.observer = observer
    assert telemetry.frames(9.0) == []
    state_a, state_b = telemetry.frames(7.5)
    assert Codec(0).decode(state_a)[1] == {"phase": "approach", "count": 1, "z": 1.5, "vz": None, "vbat": 3.9}
    assert Codec(0).decode(state_b)[1]["rrev"] is None


def test_value_that_does_not_fit_is_not_sent() -> None:
    telemetry = Telemetry(Codec(0))
    telemetry.observer = observed()
    telemetry.observer.from_vehicle(b"\x52\x04\x00\x00\x00" + struct.pack("<fBf", math.nan, 2, 3.9), 7.0)
    assert [frame.arbitration_id for frame in telemetry.frames(7.0)] == [0x110]
    assert telemetry.n_refused == 1


def test_blocks_end_with_reset_and_delete() -> None:
    data = b"\x52\x04\x00\x00\x00" + struct.pack("<fBf", 1.5, 2, 3.9)
    for ending in (b"\x5d\x05", b"\x5d\x02\x04"):
        observer = observed()
        observer.from_host(ending)
        observer.from_vehicle(data, 7.0)
        assert observer.values == {}


def test_policy_of_an_echo_is_told_once() -> None:
    telemetry, form = Telemetry(Codec(0)), forms.by_name("constant")
    crc = form.crc([4.5, 7.8125])
    for part in packets.encode_policy(9, form, [4.5, 7.8125]):
        assert telemetry.observer.from_host(b"\xd2" + part) == []
    echo = packets.encode(
        packets.PacketType.POLICY_ECHO, seq=9, status=0, missing=0, seq_in_force=9, crc_in_force=crc, form_in_force=0
    )
    assert telemetry.observer.from_vehicle(b"\xd2" + echo, 0.0)
    told = [Codec(0).decode(frame) for frame in telemetry.frames(0.0)]
    assert told == [
        ("POLICY", {"seq": 9, "crc": crc}),
        ("POLICY_PARAM", {"form": 0, "number": 0, "value": 4.5}),
        ("POLICY_PARAM", {"form": 0, "number": 1, "value": 0.0078125}),
    ]
    assert telemetry.frames(0.0) == []


def test_policy_whose_parameters_nobody_heard_is_told_by_its_number() -> None:
    telemetry = Telemetry(Codec(0))
    echo = packets.encode(
        packets.PacketType.POLICY_ECHO, seq=9, status=0, missing=0, seq_in_force=8, crc_in_force=77, form_in_force=0
    )
    assert telemetry.observer.from_vehicle(b"\xd2" + echo, 0.0)
    assert [Codec(0).decode(frame) for frame in telemetry.frames(0.0)] == [("POLICY", {"seq": 8, "crc": 77})]


@settings(max_examples=100)
@given(
    st.lists(
        st.tuples(st.booleans(), st.sampled_from([0x50, 0x51, 0x52, 0xD2, 0x5D]), st.binary(max_size=30)), max_size=20
    )
)
def test_observer_survives_any_packets(passing: list[tuple[bool, int, bytes]]) -> None:
    telemetry = Telemetry(Codec(0))
    for from_host, header, payload in passing:
        packet = bytes([header]) + payload
        if from_host:
            telemetry.observer.from_host(packet)
        else:
            telemetry.observer.from_vehicle(packet, 0.0)
        telemetry.frames(0.0)


# ---- the bus itself


class _Bus(can.BusABC):
    """A bus that takes frames, or does not, and says what state it is in."""

    def __init__(self) -> None:
        super().__init__("none")
        self.sent: list[can.Message] = []
        self.refuses, self.is_in = False, can.BusState.ACTIVE

    @property
    def state(self) -> can.BusState:
        return self.is_in

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        assert timeout is not None
        if self.refuses:
            raise can.CanOperationError("no buffer space")
        self.sent.append(msg)

    def _recv_internal(self, timeout: float | None) -> tuple[None, bool]:  # noqa: ARG002 (the base class names it)
        return None, False


@pytest.fixture
def bus() -> Iterator[_Bus]:
    bus = _Bus()
    yield bus
    bus.shutdown()


def test_heartbeats_bring_the_link_up_and_their_end_takes_it_down(bus: _Bus) -> None:
    host, vehicle = CanLink(bus, 2, at_host=True), CanLink(bus, 2, at_host=False)

    def exchange(t_s: float) -> None:
        bus.sent.clear()
        for end in (host, vehicle):
            end.beat(State.RUNNING if end.hears_peer(t_s) else State.PEER_LOST, 0, t_s)
        for frame in list(bus.sent):
            (vehicle if frame.arbitration_id == 0x702 else host).take(frame, t_s)

    exchange(0.0)
    assert [host.is_up(0.0), vehicle.is_up(0.0)] == [False, False]
    exchange(0.05)
    assert bus.sent == []
    exchange(0.125)
    assert host.is_up(0.125)
    assert vehicle.is_up(0.42)
    assert not host.is_up(0.43)
    assert host.peer_text(1.125) == "silent for 1.0 s"


@pytest.mark.parametrize(
    ("identifier", "data", "text"),
    [
        (0x40, bytes(8), "bus-off"),
        (0x04, b"\0\x10" + bytes(6), "error-passive"),
        (0x04, b"\0\x20" + bytes(6), "error-passive"),
    ],
)
def test_error_frame_of_a_dead_bus_stops(bus: _Bus, identifier: int, data: bytes, text: str) -> None:
    link = CanLink(bus, 0, at_host=True)
    frame = can.Message(arbitration_id=identifier, is_error_frame=True, data=data)
    with pytest.raises(BusError, match=rf"{text}.*start the gateway again"):
        link.take(frame, 0.0)


def test_error_frame_of_a_passing_fault_is_counted(bus: _Bus) -> None:
    link = CanLink(bus, 0, at_host=True)
    assert link.take(can.Message(arbitration_id=0x08, is_error_frame=True, data=bytes(8)), 0.0) is None
    assert link.report()["n_error_frames"] == 1


@pytest.mark.parametrize(("state", "text"), [(can.BusState.PASSIVE, "error-passive"), (can.BusState.ERROR, "bus-off")])
def test_state_of_a_dead_bus_stops(bus: _Bus, state: can.BusState, text: str) -> None:
    link = CanLink(bus, 0, at_host=True)
    link.beat(State.RUNNING, 0, 0.0)
    bus.is_in = state
    with pytest.raises(BusError, match=text):
        link.beat(State.RUNNING, 0, 0.2)


def test_bus_that_takes_nothing_stops(bus: _Bus) -> None:
    link = CanLink(bus, 0, at_host=True)
    bus.refuses = True
    link.send(PING, 0.0)
    bus.refuses = False
    link.send(PING, 1.0)
    bus.refuses = True
    link.send(PING, 1.1)
    with pytest.raises(BusError, match=r"nothing could be sent for 0\.3 s: no buffer space"):
        link.send(PING, 1.5)
    assert link.report()["n_unsent"] == 3


# ---- a bus that is full


class _ShortQueue(_Bus):
    """Holds a few frames, as SocketCAN does, each for as long as it takes on the wire; its clock is the test's."""

    def __init__(self, n_max: int = 10, frame_s: float = 150e-6) -> None:
        super().__init__()
        self.n_max, self.frame_s, self.t_s = n_max, frame_s, 0.0
        self._leaves_s: deque[float] = deque()

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        while self._leaves_s and self._leaves_s[0] <= self.t_s:
            self._leaves_s.popleft()
        if len(self._leaves_s) >= self.n_max:
            raise can.CanOperationError("Failed to transmit: No buffer space available", errno.ENOBUFS)
        super().send(msg, timeout)
        self._leaves_s.append(max(self.t_s, self._leaves_s[-1] if self._leaves_s else 0.0) + self.frame_s)


def _run(bus: _ShortQueue, link: CanLink, seconds: float, burst: list[bytes]) -> list[bytes]:
    """A burst each 10 ms; the packets that come out at the other end."""
    joiner = Joiner(0, to_vehicle=False)
    for step in range(round(seconds * 2000)):
        bus.t_s = step * 0.0005
        for packet in burst if step % 20 == 0 else []:
            link.send(packet, bus.t_s)
        link.pump(bus.t_s)
    return [packet for frame in bus.sent if (packet := joiner.join(frame)) is not None]


@pytest.mark.parametrize("n_packets", [1, 4, 10, 15])
@pytest.mark.parametrize("n_max", [1, 3, 10])
def test_bus_with_a_short_queue_loses_nothing_that_it_has_time_for(n_max: int, n_packets: int) -> None:
    if n_max == 1:
        n_packets = min(n_packets, 4)  # one frame each half millisecond
    bus = _ShortQueue(n_max)
    link = CanLink(bus, 0, at_host=False)
    burst = [bytes([0x52]) + bytes([n]) * 28 for n in range(n_packets)]
    assert _run(bus, link, 1.0, burst) == burst * 100
    assert (link.report()["n_unsent"], link.is_waiting) == (0, False)
    bus.shutdown()


def test_bus_without_time_gets_whole_packets_and_safety_first() -> None:
    bus = _ShortQueue(frame_s=0.002)
    link = CanLink(bus, 0, at_host=False)
    stream = [bytes([0x52]) + bytes([n]) * 28 for n in range(4)]
    arrived = _run(bus, link, 2.0, [*stream, b"\x9d\x81\x00\x00"])
    assert arrived.count(b"\x9d\x81\x00\x00") == 200
    assert 150 < len(arrived) - 200 < 400
    report = link.report()
    # parts of packets are few: a packet is dropped whole, unless its time ends while it is sent
    n_sent_for_nothing = report["n_frames_out"] - 200 - 4 * (len(arrived) - 200)
    assert n_sent_for_nothing < 0.1 * report["n_frames_out"]
    assert report["n_unsent"] > 500
    bus.shutdown()


def test_packet_that_lost_a_frame_is_dropped_with_the_rest_of_it(bus: _Bus) -> None:
    link = CanLink(bus, 0, at_host=True)
    room = [2]

    def send(frame: can.Message, timeout: float | None = None) -> None:
        del timeout
        if not room[0]:
            raise OSError(errno.ENOBUFS, "No buffer space available")
        room[0] -= 1
        bus.sent.append(frame)

    bus.send = send  # type: ignore[method-assign]
    link.send(bytes([0x50]) + bytes(30), 0.0)
    link.send(PING, 0.001)
    assert (len(bus.sent), link.is_waiting) == (2, True)
    room[0] = 99
    assert not link.pump(0.0505)  # the first is too old by now
    assert link.report()["n_unsent"] == 2
    assert [frame.arbitration_id & 0xFF for frame in bus.sent] == [0x50, 0x50, 0xFC]
