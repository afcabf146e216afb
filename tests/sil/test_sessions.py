"""Who may fly: probes, a second client, silent clients, many vehicles, many connections.  With plain sockets."""

import contextlib
import os
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from cflib.crazyflie.log import LogConfig

from ivl.silproc import SilProcess


def files_and_memory_kB(pid: int) -> tuple[int, int]:
    """Open files and resident memory of a process."""
    status = Path(f"/proc/{pid}/status").read_text(encoding="ascii")
    memory = next(line for line in status.splitlines() if line.startswith("VmRSS"))
    return len(list(Path(f"/proc/{pid}/fd").iterdir())), int(memory.split()[1])


def test_a_probe_is_answered_and_does_not_take_the_vehicle(sil, Raw):
    with Raw(sil.uri) as client, Raw(sil.uri) as scanner:
        scanner.send("ff")
        assert scanner.receive(null=True) == b"\xff"
        client.connect()
        scanner.send("ff")
        assert scanner.receive(null=True) == b"\xff"
        assert client.ask("fc0011") == bytes.fromhex("fc0011")
        assert sil.get("sil.n_foreign") == 0


def test_a_second_client_cannot_take_a_vehicle_that_is_flown(sil, Raw, wait_for):
    with Raw(sil.uri) as client, Raw(sil.uri) as other:
        client.connect()
        host, port = client.socket.getsockname()
        for packet in ("9d03", "8c0300", "5d05", "2e0000ff", "3c" + "00" * 14):
            client.ask("fc00")  # who is silent for a second is no client any more
            other.send(packet)
        wait_for("all to be seen", lambda: sil.get("sil.n_foreign") == 5)
        assert other.silent()
        assert client.ask("fc0011") == bytes.fromhex("fc0011")
        assert not int(sil.get("supervisor.info")) & 64
        # a request to connect is told who flies, and waits; nothing is answered as long as the client lives
        client.ask("fc00")
        other.send("fd00")
        assert other.receive() == f"\x0cBusy: {host}:{port}\n".encode()
        for _ in range(20):
            client.ask("fc00")
        assert other.silent()


def test_who_asked_is_next_as_soon_as_the_client_has_closed_his_socket(sil, Raw):
    client = Raw(sil.uri)
    client.connect()
    with Raw(sil.uri) as other:
        client.__exit__()
        # the server learns of it when it sends to the client, and does so when somebody else asks
        assert other.ask("fd00")[1:9] == b"Bitcraze"
        other.connect()


def test_who_asked_is_next_when_the_client_has_been_silent(sil, Raw, wait_for):
    with Raw(sil.uri) as client, Raw(sil.uri) as other:
        client.connect()
        assert other.ask("fd00")[1:9] == b"Bitcraze"

        def is_told() -> bool:
            other.send("fc00")  # still there
            client.send("fd00")
            return client.receive().startswith(b"\x0cBusy")

        wait_for("the answer to one who comes too late", is_told)


def test_log_blocks_go_with_a_silent_client(sil, Raw, wait_for):
    with Raw(sil.uri) as client, Raw(sil.uri) as other:
        client.connect()
        client.ask("5d0601010000")
        client.ask("5d030101")
        wait_for("a data packet", lambda: client.receive()[0] & 0xF3 == 0x52)
        # the client does not speak for a second: then the vehicle is another's, and there is no such block
        assert other.ask("fd00")[1:9] == b"Bitcraze"
        assert other.ask("5d030101") == bytes.fromhex("5d030102")


def test_one_who_only_listens_keeps_his_log_blocks(sil, Raw, wait_for):
    """As by radio, where the dongle asks on when the program says nothing."""
    with Raw(sil.uri) as client:
        client.connect()
        client.ask("5d0601010000")
        client.ask("5d030101")  # every 10 ms
        seen = 0
        began = time.monotonic()
        while time.monotonic() < began + 2.5:
            seen += client.receive()[0] & 0xF3 == 0x52
        assert seen > 150  # 250, if this machine has nothing else to do
        assert sil.get("radio.isConnected") == 1
    wait_for("a closed socket to be noticed", lambda: sil.get("radio.isConnected") == 0)


def test_silence_over_a_bad_link_is_a_lost_link(sil, Raw, wait_for):
    with Raw(sil.uri) as client:
        client.connect()
        assert sil.get("radio.isConnected") == 1
        sil.set("fault.delay_ms", 1.0)
        wait_for("the end of the link", lambda: sil.get("radio.isConnected") == 0)


def test_only_the_client_switches_the_power_and_anybody_if_there_is_none(sil, Raw, wait_for):
    with Raw(sil.uri) as client, Raw(sil.uri) as other:
        client.connect()
        for packet in ("fffe02", "f3fe01", "fffef001", "fffeff"):
            client.ask("fc00")
            other.send(packet)
        wait_for("all to be seen", lambda: sil.get("sil.n_foreign") == 4)
        assert other.silent()
        assert client.ask("fc0011") == bytes.fromhex("fc0011")
        client.send("fffe02")
        wait_for("the vehicle to be off", lambda: sil.get("radio.isConnected") == 0)
        client.send("fffe03")
        client.connect()
    # as cflib's PowerSwitch does it: a socket of its own, at once after the client's was closed
    with Raw(sil.uri) as other:
        other.send("fffeff")
        assert other.receive(null=True)[:3] == bytes.fromhex("fffeff")


def test_eight_vehicles_at_once(world, connected):
    with SilProcess(world, vehicles=8, seed=3) as sil:
        assert len(set(sil.uris)) == 8
        with contextlib.ExitStack() as stack, ThreadPoolExecutor(8) as pool:
            flown = list(pool.map(lambda uri: stack.enter_context(connected(uri, parameters=False)), sil.uris))
            for n, cf in enumerate(flown):
                config = LogConfig("z", 10)
                config.add_variable("stateEstimate.z")
                cf.log.add_config(config)
                config.start()
                cf.loc.send_extpos([0.0, 0.0, float(n)])
            assert [cf.state for cf in flown] == [2] * 8
            assert {sil.get("sil.n_bad", n) for n in range(8)} == {0}


def test_a_thousand_connections_leave_nothing_behind(fast, Raw):
    def cycle(n: int) -> None:
        for _ in range(n):
            with Raw(fast.uri) as client:
                client.connect()
                client.ask("5d0601010000")
                client.ask("5d08010100")
                assert client.ask("5d0401") == bytes.fromhex("5d040100")

    cycle(50)
    own, server = files_and_memory_kB(os.getpid()), files_and_memory_kB(fast.pid)
    cycle(1000)
    assert files_and_memory_kB(fast.pid)[0] == server[0]
    assert files_and_memory_kB(fast.pid)[1] - server[1] < 200
    assert files_and_memory_kB(os.getpid())[0] <= own[0]  # what earlier tests left may be closed by now
    assert files_and_memory_kB(os.getpid())[1] - own[1] < 5000
    assert fast.get("sil.n_rx") >= 1050 * 13
