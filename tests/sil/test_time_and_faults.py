"""Time of the vehicle (real, lock-step) and faults of the link.  With plain sockets where cflib is not the point."""

import os
import signal
import struct
import time

import pytest
from cflib.crazyflie.log import LogConfig

from ivl.silproc import SilProcess


def run_to(raw, t_ms: int) -> list[bytes]:
    """Let a vehicle in lock-step run; the log packets that come before the answer."""
    raw.send(b"\x2f\x00sil\0run_to_ms\0\x0a" + struct.pack("<I", t_ms))
    packets = []
    while (packet := raw.receive())[0] & 0xF3 != 0x23:
        packets.append(packet)
    assert packet[-1] == 0
    return [p for p in packets if p[0] & 0xF3 == 0x52]


# ---- time


def test_lockstep_stands_still_and_sends_the_span_before_its_answer(stepped, Raw):
    with Raw(stepped.uri) as client:
        client.connect()
        assert stepped.get("sil.time_ms") == 0
        client.ask("5d0601010000")
        client.ask("5d030101")
        assert client.silent()
        assert [p[2] for p in run_to(client, 100)] == list(range(10, 101, 10))
        assert stepped.get("sil.time_ms") == 100
        assert client.silent()
        # repeated, it does nothing more
        assert run_to(client, 100) == []
        assert stepped.get("sil.time_ms") == 100


def test_lockstep_of_a_long_span_loses_no_packet(stepped, Raw):
    with Raw(stepped.uri) as client:
        client.connect()
        client.ask("5d0601010000")
        client.ask("5d08010100")
        t_ms = []
        for end_ms in range(100, 5001, 100):  # as many packets as the buffer of a client that stands still holds
            t_ms += [int.from_bytes(p[2:5], "little") for p in run_to(client, end_ms)]
        assert t_ms == list(range(1, 5001))


def test_the_same_requests_in_lockstep_give_the_same_bytes(world, Raw):
    def flight() -> list[bytes]:
        with SilProcess(world, lockstep=True, seed=5) as sil, Raw(sil.uri) as client:
            client.connect()
            table = {}
            n = struct.unpack("<H", client.ask("5c03")[2:4])[0]
            for i in range(n):
                reply = client.ask(b"\x5c\x02" + struct.pack("<H", i))
                table[reply[5:-1].decode().replace("\0", ".")] = (reply[4], i)
            block = b"".join(struct.pack("<BH", *table[f"stateEstimate.{axis}"]) for axis in ("x", "z", "pitch", "vz"))
            client.ask(b"\x5d\x06\x01" + block)
            client.ask("5d030101")
            client.ask("9d0101")
            packets = []
            for t_ms in range(100, 3001, 100):
                if t_ms == 300:
                    client.ask(b"\x8c\x07\x00" + struct.pack("<ff?f", 1.0, 0.0, False, 1.5))
                packets += run_to(client, t_ms)
            return packets

    first = flight()
    assert len(first) == 300
    assert struct.unpack_from("<ff", first[-1], 5)[1] > 0.5
    assert flight() == first


def test_real_time_is_kept_and_not_caught_up_after_a_stop(sil, wait_for):
    wait_for("the start", lambda: sil.get("sil.time_ms") > 20)
    os.kill(sil.pid, signal.SIGSTOP)
    time.sleep(0.5)
    before = time.monotonic()
    os.kill(sil.pid, signal.SIGCONT)
    t_ms = sil.get("sil.time_ms")
    again_ms = sil.get("sil.time_ms")
    # at most what has passed, and what may be caught up
    assert again_ms - t_ms <= 1000 * (time.monotonic() - before) + 260
    wait_for("the count", lambda: sil.get("sil.n_slipped") >= 1)


# ---- faults


def test_freeze_is_survived_by_the_session(sil, connected, wait_for):
    with connected(sil.uri) as cf:
        sil.set("fault.freeze_ms", 4_000_000)
        frozen_ms = sil.get("sil.time_ms")
        cf.param.set_value("fault.seed", 77)
        assert sil.get("sil.time_ms") == frozen_ms
        assert sil.get("fault.seed") == 0
        sil.set("fault.freeze_ms", 0)
        wait_for("the thaw", lambda: sil.get("fault.seed") == 77)
        config = LogConfig("z", 10)
        config.add_variable("stateEstimate.z")
        cf.log.add_config(config)
        rows: list[int] = []
        config.data_received_cb.add_callback(lambda t_ms, *_: rows.append(t_ms))
        config.start()
        wait_for("log data", lambda: rows)


def test_a_freeze_ends_by_itself(sil, Raw, wait_for):
    with Raw(sil.uri) as client:
        client.connect()
        sil.set("fault.freeze_ms", 50)
        wait_for("the thaw", lambda: sil.get("fault.freeze_ms") == 0)
        client.connect()


def test_a_cut_loses_everything_until_it_is_ended(sil, Raw, wait_for):
    with Raw(sil.uri) as client:
        client.connect()
        sil.set("fault.cut_ms", 4_000_000)
        wait_for("the cut", lambda: (client.send("fc00"), sil.get("fault.n_lost"))[1] > 3)
        client.come()  # answers from before the cut came into force
        lost = sil.get("fault.n_lost")
        wait_for("more losses", lambda: (client.send("fc00"), sil.get("fault.n_lost"))[1] > lost + 3)
        assert client.silent()
        sil.set("fault.cut_ms", 0)
        wait_for("the end of the cut", lambda: (client.send("fc01"), not client.silent())[1])


def test_a_cut_ends_by_itself(sil, Raw, wait_for):
    with Raw(sil.uri) as client:
        client.connect()
        sil.set("fault.cut_ms", 50)
        wait_for("the end of the cut", lambda: sil.get("fault.cut_ms") == 0)
        client.connect()


@pytest.mark.parametrize(("name", "value"), [("loss", 1.0), ("duplicate", 0.75), ("jitter_ms", 3.0)])
def test_faults_of_a_client_end_with_it_and_those_of_the_operator_stay(sil, Raw, wait_for, name, value):
    """One packet must not lock out everybody who comes after it."""
    sil.set("fault.reorder", 0.25)
    with Raw(sil.uri) as client:
        client.connect()
        client.send(b"\x2f\x00fault\0" + name.encode() + b"\0\x06" + struct.pack("<f", value))
        wait_for("the fault", lambda: sil.get(f"fault.{name}") == value)
    wait_for("the client's end", lambda: sil.get(f"fault.{name}") == 0.0)
    assert sil.get("fault.reorder") == 0.25
    sil.set("fault.reorder", 0.0)
    with Raw(sil.uri) as client:
        client.connect()


@pytest.mark.parametrize("name", ["freeze_ms", "cut_ms"])
@pytest.mark.parametrize("value", [60001, 2**31, 2**32 - 1])
def test_a_vehicle_is_away_for_a_minute_at_most(sil, name, value):
    sil.set(f"fault.{name}", value)
    assert sil.get(f"fault.{name}") == 60000
    sil.set(f"fault.{name}", 0)


@pytest.mark.parametrize("value", [1e-42, 1e-20, 0.0009])
def test_a_pace_that_is_next_to_none_is_a_thousandth(sil, value):
    sil.set("sil.speed_factor", value)
    assert sil.get("sil.speed_factor") == pytest.approx(0.001)


def test_loss_is_as_asked_and_seeded(world, Raw, wait_for):
    def lost(seed: int) -> list[int]:
        with SilProcess(world, lockstep=True, faults={"loss": 0.2, "seed": seed}) as sil, Raw(sil.uri) as client:
            got: list[int] = []

            def is_all_known(n_sent: int) -> bool:
                """Each packet has come back, or has been lost on one of its ways."""
                got.extend(struct.unpack("<H", packet[1:])[0] for packet in client.come())
                return len(got) + sil.get("fault.n_lost") >= n_sent

            for n in range(400):
                client.send(b"\xfc" + struct.pack("<H", n))
                if n % 50 == 49:
                    # no more under way than fits into the client's buffer
                    wait_for("the packets", lambda n=n: is_all_known(n + 1))
            assert sil.get("fault.n_lost") == 400 - len(got)
            return got

    first = lost(1)
    assert 210 <= len(first) <= 300  # both ways: 256 +- 4.8 sigma
    assert lost(1) == first
    assert lost(2) != first
