"""The server itself: who may fly, time, faults of the link, abuse.  With plain sockets where cflib is not the point."""

import contextlib
import os
import random
import re
import signal
import struct
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from cflib.crazyflie.log import LogConfig

from ivl import silproc
from ivl.experiment import load
from ivl.silproc import SilProcess
from ivl.world import World

ROOT = Path(__file__).parents[2]


def files_and_memory_kB(pid: int) -> tuple[int, int]:
    """Open files and resident memory of a process."""
    status = Path(f"/proc/{pid}/status").read_text(encoding="ascii")
    memory = next(line for line in status.splitlines() if line.startswith("VmRSS"))
    return len(list(Path(f"/proc/{pid}/fd").iterdir())), int(memory.split()[1])


def run_to(raw, t_ms: int) -> list[bytes]:
    """Let a vehicle in lock-step run; the log packets that come before the answer."""
    raw.send(b"\x2f\x00sil\0run_to_ms\0\x0a" + struct.pack("<I", t_ms))
    packets = []
    while (packet := raw.receive())[0] & 0xF3 != 0x23:
        packets.append(packet)
    assert packet[-1] == 0
    return [p for p in packets if p[0] & 0xF3 == 0x52]


# ---- who may fly


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
            other.send(packet)
        wait_for("all to be seen", lambda: sil.get("sil.n_foreign") == 5)
        assert other.silent()
        assert client.ask("fc0011") == bytes.fromhex("fc0011")
        assert not int(sil.get("supervisor.info")) & 64
        # a request to connect is told who flies, and waits; nothing is answered as long as the client lives
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


def test_who_asked_is_next_when_the_client_has_been_silent(sil, Raw):
    with Raw(sil.uri) as client, Raw(sil.uri) as other:
        client.connect()
        assert other.ask("fd00")[1:9] == b"Bitcraze"
        client.send("fd00")
        while not client.receive().startswith(b"\x0cBusy"):
            pass


def test_log_blocks_go_with_a_silent_client(sil, Raw, wait_for):
    with Raw(sil.uri) as client:
        client.connect()
        client.ask("5d0601010000")
        client.ask("5d030101")
        wait_for("a data packet", lambda: client.receive()[0] & 0xF3 == 0x52)
        # the client does not speak for a second: the stream ends
        client.socket.settimeout(0.3)
        with contextlib.suppress(TimeoutError):
            while True:
                client.receive()
        client.socket.settimeout(5.0)
        assert client.ask("5d030101") == bytes.fromhex("5d030102")


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
            list(pool.map(lambda cf: cf.close_link(), flown))


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
    assert files_and_memory_kB(os.getpid())[0] == own[0]
    assert files_and_memory_kB(os.getpid())[1] - own[1] < 5000
    assert fast.get("sil.n_rx") >= 1050 * 13


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
        for end_ms in range(500, 5001, 500):
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
    assert sil.get("sil.n_slipped") >= 1
    # at most what has passed, and what may be caught up
    assert again_ms - t_ms <= 1000 * (time.monotonic() - before) + 260


# ---- faults


def test_freeze_is_survived_by_the_session(sil, connected, wait_for):
    with connected(sil.uri) as cf:
        sil.set("fault.freeze_ms", 1500)
        frozen_ms = sil.get("sil.time_ms")
        cf.param.set_value("fault.seed", 77)
        assert sil.get("sil.time_ms") == frozen_ms
        assert sil.get("fault.seed") == 0
        wait_for("the thaw", lambda: sil.get("fault.seed") == 77)
        config = LogConfig("z", 10)
        config.add_variable("stateEstimate.z")
        cf.log.add_config(config)
        rows: list[int] = []
        config.data_received_cb.add_callback(lambda t_ms, *_: rows.append(t_ms))
        config.start()
        wait_for("log data", lambda: rows)


def test_freeze_can_be_ended_over_the_control_channel(sil, Raw):
    with Raw(sil.uri) as client:
        client.connect()
        sil.set("fault.freeze_ms", 4_000_000)
        assert sil.get("fault.freeze_ms") == 4_000_000
        sil.set("fault.freeze_ms", 0)
        client.connect()


def test_cut_loses_everything_for_its_time(sil, Raw, wait_for):
    with Raw(sil.uri) as client:
        client.connect()
        sil.set("fault.cut_ms", 300)
        wait_for("the cut", lambda: (client.send("fc00"), sil.get("fault.n_lost"))[1] > 3)
        assert client.silent()
        wait_for("the end of the cut", lambda: (client.send("fc01"), not client.silent())[1])


def test_loss_is_as_asked_and_seeded(world, Raw, wait_for):
    def lost(seed: int) -> list[int]:
        with SilProcess(world, lockstep=True, faults={"loss": 0.2, "seed": seed}) as sil, Raw(sil.uri) as client:
            got: list[int] = []
            for n in range(400):
                client.send(b"\xfc" + struct.pack("<H", n))
                if n % 50 == 49:
                    # no more under way than fits into the client's buffer
                    wait_for("the packets", lambda n=n: sil.get("sil.n_rx") + sil.get("fault.n_lost") >= n + 1)
                    client.socket.settimeout(0.05)
                    with contextlib.suppress(TimeoutError):
                        while True:
                            got.append(struct.unpack("<H", client.receive()[1:])[0])
            assert sil.get("fault.n_lost") == 400 - len(got)
            return got

    first = lost(1)
    assert 210 <= len(first) <= 300  # both ways: 256 +- 4.8 sigma
    assert lost(1) == first
    assert lost(2) != first


# ---- abuse, under sanitizers where they are built


@pytest.fixture(params=["release", "san"])
def tough(request, world, monkeypatch):
    """The program as released, and with the sanitizers, which end it at the first error."""
    if request.param == "san":
        program = ROOT / "build" / "san" / "ivl_sil"
        assert program.is_file(), "run `make test-sil`, which builds it"
        monkeypatch.setenv(silproc.SERVER_ENV, str(program))
    with SilProcess(world, speed=None) as process:
        yield process


def test_datagrams_of_any_kind_change_nothing_for_a_client(tough, Raw):
    rng = random.Random(4)
    with Raw(tough.uri) as client:
        client.connect()
        for size in (0, 32, 33, 100, 1400, 60000):
            client.send(bytes(size))
        for i in range(3000):
            client.send(rng.randbytes(rng.choice((1, 2, 3, 5, 8, 15, 17, 30, 31, 32, 64))))
            if i % 40 == 0:
                client.ask("fc00")  # not faster than they are read
        tough.set("sil.lockstep", 0)
        for name in ("loss", "delay_ms", "jitter_ms", "reorder", "duplicate", "freeze_ms", "cut_ms"):
            tough.set(f"fault.{name}", 0)
        tough.set("sil.speed_factor", 0)
        client.connect()
        assert tough.get("sil.n_bad") > 500


def test_server_answers_on_after_every_length_of_every_packet(tough, Raw):
    with Raw(tough.uri) as client:
        client.connect()
        for port in range(16):
            for channel in range(4):
                for size in range(31):
                    client.send(bytes([port << 4 | channel]) + bytes([size % 14]) * size)
            # all that came of it is read before the next
            client.send(b"\xfcend" + bytes([port]))
            while client.receive() != b"\xfcend" + bytes([port]):
                pass
        client.connect()


def test_noise_on_the_control_channel_is_answered_with_an_error(tough):
    rng = random.Random(9)
    for _ in range(300):
        line = rng.randbytes(rng.randrange(1, 200)).decode("latin1")
        with pytest.raises((silproc.LinkError, UnicodeEncodeError)):
            tough.get(line)
    assert tough.get("sil.n_bad") == 0


def test_the_fuzzer_finds_nothing_in_a_few_seconds(tmp_path, world):
    program = ROOT / "build" / "fuzz" / "fuzz_crtp"
    assert program.is_file(), "run `make test-sil`, which builds it"
    (tmp_path / "model.txt").write_text(silproc.model_text(world), encoding="ascii")
    (tmp_path / "new").mkdir()
    corpus = ROOT / "tests" / "fuzz" / "corpus"
    assert len(list(corpus.iterdir())) > 50
    command = [str(program), "-runs=12000", "-max_len=400", "-seed=1", f"-artifact_prefix={tmp_path}/"]
    result = subprocess.run(
        [*command, str(tmp_path / "new"), str(corpus)],
        env={**os.environ, "IVL_FUZZ_MODEL": str(tmp_path / "model.txt")},
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 0, result.stderr[-3000:]
    assert "Done 12000 runs" in result.stderr


# ---- the program


def run(*arguments: str) -> subprocess.CompletedProcess[str]:
    """The program, which ends by itself."""
    return subprocess.run([silproc.server_path(), *arguments], capture_output=True, text=True, timeout=20, check=False)


def test_help_teaches():
    text = run("--help").stdout
    for word in ("--lockstep", "--fault", "--vehicles", "--control", "loss [1] 0 .. 1", "example"):
        assert word in text


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "--model FILE is missing"),
        (["--model", "/nonexistent"], "/nonexistent: No such file"),
        (["--port", "70000"], "--port: value '70000' is not allowed (a whole number from 0 to 65535)"),
        (["--speed", "-1"], "--speed: value '-1' is not allowed (a number from 0.01 to 1000, or max)"),
        (["--fault", "loss=2"], "--fault: value 'loss=2' is not allowed (loss from 0 to 1)"),
        (["--fault", "rain=1"], "(loss=.. delay_ms=.. jitter_ms=.. reorder=.. duplicate=.. seed=.. )"),
        (["--vehicles", "0"], "a whole number from 1 to 64"),
        (["--model", "x", "--port", "65535", "--vehicles", "2"], "the last port would be beyond 65535"),
        (["--model", "x", "extra"], "'extra' is not expected"),
        (["--bogus"], "unrecognized option"),
    ],
)
def test_wrong_usage_is_said_in_one_line(arguments, message):
    result = run(*arguments)
    assert result.returncode == 2
    assert message in result.stderr
    assert result.stderr.count("\n") == 1


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("vehicles", [1, 3])
def test_a_signal_ends_all_vehicles_cleanly(world, number, vehicles, wait_for):
    sil = SilProcess(world, vehicles=vehicles)
    sil.start()
    pid = sil.pid
    children = Path(f"/proc/{pid}/task/{pid}/children").read_text(encoding="ascii").split()
    assert len(children) == (0 if vehicles == 1 else vehicles)
    os.kill(pid, number)
    wait_for("the end", lambda: sil._process.poll() is not None)
    assert sil._process.returncode == 0
    sil.stop()
    assert not any(Path(f"/proc/{child}").exists() for child in children)


def test_a_vehicle_that_dies_takes_the_others_with_it(world, wait_for):
    sil = SilProcess(world, vehicles=3)
    sil.start()
    children = Path(f"/proc/{sil.pid}/task/{sil.pid}/children").read_text(encoding="ascii").split()
    os.kill(int(children[1]), signal.SIGKILL)
    wait_for("the end", lambda: sil._process.poll() is not None)
    with pytest.raises(silproc.LinkError, match="ended unexpectedly"):
        sil.stop()


def test_command_becomes_the_program(tmp_path):
    file = tmp_path / "vehicle.txt"
    ivl = [sys.executable, "-c", "from ivl.cli import main; main()", "sil"]
    world = World("crazyflie21", "wide_long", **{"sense.latency": 0.01})
    options = ["--vehicle", "crazyflie21", "--gear", "wide_long", "--set", "sense.latency=0.01"]
    subprocess.run([*ivl, *options, "--write-model", str(file)], check=True)
    assert file.read_text(encoding="ascii") == silproc.model_text(world)
    with subprocess.Popen(
        [*ivl, *options, "--port", "0"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as run:
        assert re.fullmatch(r"vehicle 0: udp://127\.0\.0\.1:\d+\n", run.stdout.readline())
        assert Path(f"/proc/{run.pid}/exe").resolve() == silproc.server_path()
        run.send_signal(signal.SIGINT)
        assert run.wait(20) == 0
        assert "crazyflie21 with gear wide_long of table1" in run.stderr.read()


def test_experiments_vehicle_is_flown(tmp_path):
    file = tmp_path / "vehicle.txt"
    ivl = [sys.executable, "-c", "from ivl.cli import main; main()", "sil"]
    subprocess.run([*ivl, "--experiment", "experiments/paper_vertical.yaml", "--write-model", str(file)], check=True)
    assert file.read_text(encoding="ascii") == silproc.model_text(load("experiments/paper_vertical.yaml").make_world())
