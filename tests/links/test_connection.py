"""The connection on a vehicle that loses, repeats, garbles or stops: it works, or it says so in time."""

import struct
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from fake_vehicle import FakeVehicle, Reply

from ivl.errors import ConfigError, LinkError
from ivl.links.connection import _explain, check_uri
from ivl.links.deadlines import Deadlines
from ivl.links.tables import LogBlock, Session
from ivl.silproc import SilProcess

SHORT = Deadlines(connect_s=10.0, answer_s=3.0, retry_s=0.05)
PARAMS = {"ivl.mass": ("<f", 0.03), "ivl.cut": ("<B", 1), "sil.seed": ("<L", 5), "sil.speed": ("<d", 2.2)}


def wait_for(condition: Callable[[], bool]) -> None:
    """Until a condition holds, however busy the machine is."""
    end_s = time.monotonic() + 30.0
    while not condition():
        assert time.monotonic() < end_s
        time.sleep(0.01)


@pytest.fixture
def vehicle() -> Iterator[FakeVehicle]:
    with FakeVehicle(PARAMS, {"ivl.phase": "<B", "pm.vbat": "<f"}) as fake:
        yield fake


def test_parameters_are_read_and_written_exactly(vehicle: FakeVehicle) -> None:
    with Session(vehicle.uri, SHORT) as session:
        got = session.read(PARAMS)
        session.write({"sil.speed": 0.1 + 0.2, "ivl.cut": 0, "sil.seed": 2**32 - 1})
    assert got["sil.speed"] == 2.2
    assert got["ivl.mass"] == struct.unpack("<f", struct.pack("<f", 0.03))[0]
    assert (vehicle.params["sil.speed"][1], vehicle.params["ivl.cut"][1]) == (0.1 + 0.2, 0)
    assert vehicle.params["sil.seed"][1] == 2**32 - 1


def test_value_that_the_vehicle_does_not_take_is_named(server: SilProcess) -> None:
    with Session(server.uri, replace(SHORT, answer_s=0.5)) as session:
        session.write({"fault.seed": 3})
        with pytest.raises(LinkError, match=r"parameter fault\.loss: value nan is not .* it answers 0 \("):
            session.write({"fault.seed": 4, "fault.loss": float("nan"), "fault.delay_ms": 0.0})
        with pytest.raises(LinkError, match=r"parameter sil\.speed_factor: value 5000 is not .* it answers 1000 \("):
            session.write({"sil.speed_factor": 5000})


def test_late_answer_to_an_older_write_is_not_taken_for_a_refusal(vehicle: FakeVehicle) -> None:
    def echo_the_last_one_first(reply: Reply) -> list[Reply]:
        if reply[:2] != (2, 2):
            return [reply]
        seen.append(reply)
        return seen[-2:]

    seen: list[Reply] = []
    vehicle.change = echo_the_last_one_first
    with Session(vehicle.uri, SHORT) as session:
        for value in range(5):
            session.write({"sil.seed": value})
    assert vehicle.params["sil.seed"][1] == 4


def test_memory_is_read_whole_when_it_takes_many_packets(vehicle: FakeVehicle) -> None:
    content = bytes(i * 7 % 251 for i in range(1000))
    vehicle.memories = {0x18: content}
    with Session(vehicle.uri, SHORT) as session:
        number = session.memory(0x18)
        assert number is not None
        assert session.memory(0x19) is None
        assert session.read_memory(number, 0, 1000, "memory") == content
        assert session.read_memory(number, 17, 5, "memory") == content[17:22]


@pytest.mark.parametrize("loss", [0.05, 0.2])
def test_connect_and_requests_survive_when_packets_are_lost_in_both_directions(
    vehicle: FakeVehicle, loss: float
) -> None:
    vehicle.memories = {0x18: bytes(range(240))}
    vehicle.loss = loss
    deadlines = Deadlines(connect_s=30.0, answer_s=5.0, retry_s=0.05)
    with Session(vehicle.uri, deadlines) as session:
        for i in range(20):
            session.write({"sil.seed": i})
        assert session.read(["sil.seed"]) == {"sil.seed": 19}
        assert session.read_memory(0, 0, 240, "memory") == bytes(range(240))


def test_connect_works_when_every_answer_comes_twice(vehicle: FakeVehicle) -> None:
    vehicle.memories = {0x18: b"abc"}
    vehicle.duplicate = True
    with Session(vehicle.uri, SHORT) as session:
        assert set(session.read(PARAMS)) == set(PARAMS)
        assert session.read_memory(0, 0, 3, "memory") == b"abc"


def test_connect_uses_the_cached_tables_when_they_are_the_same(
    vehicle: FakeVehicle, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    for _ in range(2):
        with Session(vehicle.uri, SHORT) as session:
            assert session.has_param("ivl.mass")
    assert vehicle.n_received[2, 0] == 1 + len(PARAMS) + 1, "the second connect asks for the checksum alone"


def test_error_is_raised_in_time_when_nobody_answers(vehicle: FakeVehicle) -> None:
    vehicle.muted = True
    with pytest.raises(LinkError, match=r"no connection within 0\.4 s: nobody answers"):
        Session(vehicle.uri, Deadlines(connect_s=0.4, retry_s=0.05))


def test_second_client_is_told_who_flies_the_vehicle(server: SilProcess) -> None:
    with Session(server.uri, SHORT) as first:
        with pytest.raises(LinkError, match=r"another client flies it \(Busy: 127\.0\.0\.1:\d+\)"):
            Session(server.uri, Deadlines(connect_s=0.6, retry_s=0.05))
        assert first.has_param("ivl.mass")
        first.ask(15, 0, b"still there", b"still there", "echo")


def test_error_is_raised_when_nobody_listens() -> None:
    with pytest.raises(LinkError, match="nobody listens there"):
        Session("udp://127.0.0.1:9", SHORT)


def test_error_is_raised_in_time_when_the_vehicle_falls_silent(vehicle: FakeVehicle) -> None:
    with Session(vehicle.uri, Deadlines(connect_s=10.0, answer_s=0.3, retry_s=0.05)) as session:
        vehicle.muted = True
        with pytest.raises(LinkError, match=r"no answer within 0\.3 s: writing sil.seed"):
            session.write({"sil.seed": 1})
        vehicle.muted = False
        session.write({"sil.seed": 2}, deadline_s=3.0)
    assert vehicle.params["sil.seed"][1] == 2


def test_error_names_the_version_when_the_firmware_is_old(vehicle: FakeVehicle) -> None:
    vehicle.version = 10
    with pytest.raises(LinkError, match="protocol version 10"):
        Session(vehicle.uri, SHORT)


def test_answers_of_the_wrong_length_are_refused_and_nothing_stalls(vehicle: FakeVehicle) -> None:
    with Session(vehicle.uri, SHORT) as session:
        vehicle.change = lambda reply: [(reply[0], reply[1], reply[2][:-1])] if reply[:2] == (2, 1) else [reply]
        with pytest.raises(LinkError, match=r"ivl\.mass: its value came with 3 bytes"):
            session.read(["ivl.mass"])
        vehicle.change = lambda reply: [reply]
        assert session.read(["ivl.cut"]) == {"ivl.cut": 1}


def test_garbage_on_every_channel_does_no_harm(vehicle: FakeVehicle) -> None:
    with Session(vehicle.uri, SHORT) as session:
        block = LogBlock(("ivl.phase", "pm.vbat"), 20)
        session.start_log(block)
        for port in range(16):
            for channel in range(4):
                for data in (b"", b"\x01", b"\xff" * 30, b"\x80" * 9):
                    vehicle.tell(port, channel, data)
            session.read(["ivl.cut"])  # no more under way than the socket's buffer holds
        vehicle.tell(5, 2, b"\x01\0\0\0" + struct.pack("<Bf", 3, 3.9))
        assert set(session.read(PARAMS)) == set(PARAMS)
        assert block.values == {"ivl.phase": 3, "pm.vbat": pytest.approx(3.9)}


def test_log_block_is_refused_when_a_variable_is_missing_or_it_is_too_large(vehicle: FakeVehicle) -> None:
    with Session(vehicle.uri, SHORT) as session:
        with pytest.raises(LinkError, match=r"no log variable ivl\.rule"):
            session.start_log(LogBlock(("ivl.phase", "ivl.rule"), 20))
        with pytest.raises(ValueError, match="28 bytes"):
            session.start_log(LogBlock(("pm.vbat",) * 7, 20))


def test_link_quality_counts_what_was_lost(vehicle: FakeVehicle) -> None:
    with Session(vehicle.uri, Deadlines(connect_s=5.0, answer_s=0.1, retry_s=0.05)) as session:
        wait_for(lambda: session.quality(60.0).sent >= 3)
        assert session.quality(60.0).lost == 0
        vehicle.muted = True
        wait_for(lambda: session.quality(0.1).lost >= 2)
        quality = session.quality(0.1)
    assert quality.sent >= quality.lost + 3
    assert quality.p95_s > 0


def test_no_thread_is_left_after_closing(vehicle: FakeVehicle) -> None:
    before = set(threading.enumerate())
    for _ in range(3):
        session = Session(vehicle.uri, SHORT)
        vehicle.loss = 1.0
        session.cf.send_packet(_packet(), expected_reply=(7,))
        session.close()
        session.close()
        vehicle.loss = 0.0
    wait_for(lambda: set(threading.enumerate()) <= before)


@pytest.mark.parametrize(
    ("uri", "why"),
    [
        ("foo://x", "names no link"),
        ("udp://", "names no link"),
        ("radio", "names no link"),
        ("udp://:19850", "is not udp://HOST:PORT"),
        ("udp://127.0.0.1", "is not (udp|tcp)://HOST:PORT"),
        ("udp://127.0.0.1:0", "is not (udp|tcp)://HOST:PORT"),
        ("tcp://host:99999", "is not (udp|tcp)://HOST:PORT"),
    ],
)
def test_uri_is_refused(uri: str, why: str) -> None:
    with pytest.raises(ConfigError, match=why):
        check_uri(uri)


@pytest.mark.parametrize(
    ("uri", "hint"),
    [("udp://host:1", "with `ivl sil`, and on this port"), ("tcp://host:1", "is the bridge to the vehicle started")],
)
def test_refused_connection_tells_what_may_be_missing(uri: str, hint: str) -> None:
    assert hint in _explain(uri, "[Errno 111] Connection refused")


def test_radio_error_is_one_clear_line_when_none_is_plugged_in() -> None:
    with pytest.raises(LinkError) as error:
        Session("radio://0/80/2M/E7E7E7E7E7", SHORT)
    assert str(error.value) == "radio://0/80/2M/E7E7E7E7E7: no Crazyradio is plugged in"


def _packet() -> object:
    from cflib.crtp.crtpstack import CRTPPacket

    packet = CRTPPacket()
    packet.set_header(2, 0)
    packet.data = b"\x03"
    return packet
