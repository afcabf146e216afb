"""Unmodified cflib at the software vehicle: every family of packets, end to end."""

import ast
import itertools
import os
import struct
import subprocess
import sys
import threading
import time
import zlib
from pathlib import Path
from typing import Any

import cflib.crtp
import pytest
from cflib.crazyflie.log import LogConfig

from ivl import forms, native, silproc
from ivl.errors import LinkError
from ivl.experiment import load
from ivl.silproc import SilProcess
from ivl.world import World


def log(cf, wait_for, names: list[str], period_ms: int = 10, n: int = 5) -> list[tuple[int, dict[str, Any]]]:
    """The first n packets of a log block; it is deleted afterwards."""
    config, rows = LogConfig("block", period_ms), []
    for name in names:
        config.add_variable(*name.split(":"))
    cf.log.add_config(config)
    config.data_received_cb.add_callback(lambda t_ms, data, _: rows.append((t_ms, data)))
    config.start()
    wait_for("log packets", lambda: len(rows) >= n)
    config.delete()
    return rows


def last(cf, wait_for, name: str) -> Any:
    return log(cf, wait_for, [name], n=1)[-1][1][name]


# ---- tables


# cflib does not close the sockets of refused probes
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning", "ignore::ResourceWarning")
def test_scan_finds_every_vehicle(world, monkeypatch, capsys):
    # an address of loopback that nobody else uses, since the ports of a scan are fixed
    host = f"127.77.{os.getpid() >> 8 & 255}.{os.getpid() & 255}"
    monkeypatch.setenv("SCAN_ADDRESS", host)
    with SilProcess(world, bind=host, port=19850, vehicles=2):
        found = [uri for uri, _ in cflib.crtp.scan_interfaces()]
    assert [uri for uri in found if uri.startswith("udp")] == [f"udp://{host}:19850", f"udp://{host}:19851"]
    capsys.readouterr()


def test_tables_and_values_are_those_of_the_vehicle(sil, connected):
    with connected(sil.uri) as cf:
        params = {f"{g}.{n}": e for g, group in cf.param.toc.toc.items() for n, e in group.items()}
        logs = {f"{g}.{n}" for g, group in cf.log.toc.toc.items() for n in group}
        assert {"ivl.commit", "sil.reset", "sil.run_to_ms", "fault.loss", "stabilizer.controller"} <= set(params)
        assert {"ivl.phase", "sil.ended", "sil.n_rx", "stateEstimate.z", "pm.vbat", "supervisor.info"} <= logs
        for name in params:
            assert float(cf.param.get_value(name)) == pytest.approx(sil.get(name), rel=1e-6, abs=1e-9), name
        assert cf.platform.get_protocol_version() == 12


# ---- parameters


def set_confirmed(cf: Any, name: str, value: float) -> None:
    """Set a parameter and wait for the vehicle's answer."""
    answered = threading.Event()

    def on_update(*_: Any) -> None:
        answered.set()

    group, _, last = name.partition(".")
    cf.param.add_update_callback(group, last, on_update)
    cf.param.set_value(name, value)
    assert answered.wait(60.0), f"{name} was never acknowledged"
    cf.param.remove_update_callback(group, last, on_update)


def test_parameter_is_set_and_confirmed(sil, connected, wait_for):
    with connected(sil.uri) as cf:
        confirmed = []
        cf.param.add_update_callback("fault", "delay_ms", lambda name, value: confirmed.append((name, value)))
        cf.param.set_value("fault.delay_ms", 0.25)
        wait_for("the acknowledgement", lambda: ("fault.delay_ms", "0.25") in confirmed)
        assert sil.get("fault.delay_ms") == 0.25


def test_defaults_and_persistent_values(sil, connected, wait_for):
    with connected(sil.uri) as cf:
        # not `supervisor.tmblChckEn`, which the app writes in every tick
        name = "pid_rate.rateFiltEn"
        assert cf.param.toc.get_element_by_complete_name(name).is_persistent()
        default = float(cf.param.get_value(name))
        answers: list[Any] = []

        def ask(function: Any) -> Any:
            answers.clear()
            function(name, lambda _, answer: answers.append(answer))
            wait_for("an answer", lambda: answers)
            return answers[0]

        assert ask(cf.param.persistent_get_state) == (False, default, None)
        # cflib sends a new value from a thread of its own, the request to store at once: wait for the value
        set_confirmed(cf, name, 0 if default else 1)
        assert ask(cf.param.persistent_store)
        state = ask(cf.param.persistent_get_state)
        assert state.is_stored
        assert state.default_value == default
        assert state.stored_value == (0 if default else 1)
        assert ask(cf.param.get_default_value) == default
        assert ask(cf.param.persistent_clear)
        assert not ask(cf.param.persistent_get_state).is_stored
        assert not ask(cf.param.persistent_clear)


def test_a_value_that_the_vehicle_changes_reaches_the_client(sil, connected, wait_for):
    with connected(sil.uri) as cf:
        values = []
        cf.param.add_update_callback("sil", "reset", lambda _, value: values.append(value))
        cf.param.set_value("sil.reset", 1)
        wait_for("0 again", lambda: values[-1:] == ["0"])


# ---- logs


def test_log_block_has_every_packet_of_its_period_in_vehicle_time(sil, connected, wait_for):
    with connected(sil.uri) as cf:
        rows = log(cf, wait_for, ["sil.time_ms", "stateEstimate.z", "supervisor.info"], n=100)
        t_ms = [t for t, _ in rows]
        assert [b - a for a, b in itertools.pairwise(t_ms)] == [10] * (len(t_ms) - 1)
        assert all(data["sil.time_ms"] & 0xFFFFFF == t for t, data in rows)


def test_log_in_milliseconds_and_half_precision(sil, connected, wait_for):
    with connected(sil.uri) as cf:
        rows = log(cf, wait_for, ["pm.vbat:FP16", "pm.vbat:float"])
        assert rows[0][1]["pm.vbat"] == pytest.approx(sil.get("pm.vbat"), abs=0.01)
        # from here on in lock-step: a packet each millisecond is more than fits into the buffer of a client that waits
        sil.set("sil.lockstep", 1)
        begin_ms = int(sil.get("sil.time_ms"))
        # the form in ms, which cflib has no call for
        ident = cf.log.toc.get_element_id("sil.time_ms")
        packets: list[bytes] = []
        cf.add_port_callback(5, lambda packet: packets.append((packet.channel, bytes(packet.data))))
        for payload in (b"\x06\xf0\x03" + struct.pack("<H", ident), b"\x08\xf0\x01\x00"):
            packet = cflib.crtp.crtpstack.CRTPPacket()
            packet.set_header(5, 1)
            packet.data = payload
            cf.send_packet(packet)
        wait_for("the start", lambda: (1, b"\x08\xf0\x00") in packets)
        cf.param.set_value("sil.run_to_ms", begin_ms + 60)

        def t_ms() -> list[int]:
            return [
                int.from_bytes(data[1:4], "little") for channel, data in packets if channel == 2 and data[0] == 0xF0
            ]

        wait_for("packets", lambda: len(t_ms()) >= 60)
        assert t_ms() == list(range(begin_ms + 1, begin_ms + 61))


# ---- what moves the vehicle


def test_arm_take_off_go_to_and_land(world, connected, wait_for):
    with SilProcess(world, speed=10.0) as sil, connected(sil.uri) as cf:
        assert not cf.supervisor.is_flying
        cf.supervisor.send_arming_request(True)
        wait_for("arming", lambda: sil.get("supervisor.info").__int__() & 2)
        cf.high_level_commander.takeoff(0.8, 2.0)
        wait_for("height", lambda: abs(last(cf, wait_for, "stateEstimate.z") - 0.8) < 0.05)
        cf.high_level_commander.go_to(0.3, -0.2, 1.0, 0.0, 2.0)
        wait_for(
            "the point", lambda: abs(sil.get("stateEstimate.x") - 0.3) + abs(sil.get("stateEstimate.y") + 0.2) < 0.1
        )
        cf.high_level_commander.land(0.0, 2.0)
        wait_for("the floor", lambda: sil.get("stateEstimate.z") < 0.1)
        cf.high_level_commander.stop()
        wait_for("motors off", lambda: not int(sil.get("supervisor.info")) & 16)


def test_setpoints_of_every_kind_are_followed(world, connected, wait_for):
    with SilProcess(world) as sil, connected(sil.uri) as cf:
        cf.param.set_value("sil.reset", 1)
        wait_for("flight", lambda: sil.get("stateEstimate.z") > 0.5)
        z = sil.get("stateEstimate.z")

        def streamed(send: Any, condition: Any) -> None:
            def step() -> bool:
                send()
                time.sleep(0.01)
                return condition()

            wait_for("the set-point to be followed", step)

        streamed(lambda: cf.commander.send_position_setpoint(0.3, 0, z, 0), lambda: sil.get("stateEstimate.x") > 0.2)
        streamed(
            lambda: cf.commander.send_velocity_world_setpoint(-0.5, 0, 0, 0), lambda: sil.get("stateEstimate.x") < 0
        )
        streamed(
            lambda: cf.commander.send_hover_setpoint(0, 0, 0, z - 0.3), lambda: sil.get("stateEstimate.z") < z - 0.2
        )
        streamed(lambda: cf.commander.send_zdistance_setpoint(0, 0, 0, z), lambda: sil.get("stateEstimate.z") > z - 0.1)
        streamed(
            lambda: cf.commander.send_full_state_setpoint([0.2, 0.2, z], [0, 0, 0], [0, 0, 0], [0, 0, 0, 1], 0, 0, 0),
            lambda: sil.get("stateEstimate.y") > 0.1,
        )
        n_bad = sil.get("sil.n_bad")
        cf.commander.send_setpoint(0, 0, 0, 0)
        cf.commander.send_setpoint_manual(0, 0, 0, 50, False)
        cf.commander.send_notify_setpoint_stop()
        assert sil.get("sil.n_bad") == n_bad
        cf.commander.send_stop_setpoint()
        wait_for("the fall", lambda: sil.get("stateEstimate.z") < 0.2)


def test_external_position_and_pose_arrive(sil, connected, wait_for):
    with connected(sil.uri) as cf:
        before = sil.get("sil.n_pose")
        cf.extpos.send_extpos(0.1, 0.2, 0.3)
        cf.extpos.send_extpose(0.1, 0.2, 0.3, 0.0, 0.0, 0.0, 1.0)
        wait_for("both", lambda: sil.get("sil.n_pose") == before + 2)
        assert sil.get("sil.n_bad") == 0


def test_emergency_stop_locks_the_vehicle(sil, connected, wait_for):
    with connected(sil.uri) as cf:
        cf.param.set_value("sil.reset", 1)
        wait_for("flight", lambda: int(sil.get("supervisor.info")) & 16)
        cf.supervisor.send_emergency_stop()
        wait_for("the lock", lambda: int(sil.get("supervisor.info")) & 64)
        wait_for("cflib to hear of it, which does not ask twice", lambda: cf.supervisor.is_locked)


# ---- memory, console, app channel


def test_memories_are_read(sil, connected, wait_for):
    with connected(sil.uri) as cf:
        types = {memory.type: memory for memory in cf.mem.mems}
        assert set(types) == {0x00, 0x01, 0x12, 0x15, 0x18, 0x19, 0x1E, 0x1F}
        done: list[bytes] = []
        cf.mem.mem_read_cb.add_callback(lambda _, __, data: done.append(bytes(data)))
        assert cf.mem.read(types[0x1E], 0, 64)
        wait_for("the memory", lambda: done)
        assert struct.unpack_from("<L", done[0])[0] == 0x4F4C5649
        assert len(done[0]) == 64
        values = World().params.values
        known = [value for name, value in values.items() if not name.startswith("firmware.")]
        assert cf.mem.read(types[0x1F], 0, 8 * len(known))
        wait_for("the world", lambda: len(done) > 1)
        assert list(struct.unpack(f"<{len(known)}d", done[1])) == known


def test_app_answers_on_its_channel(sil, connected, wait_for):
    with connected(sil.uri) as cf:
        answers: list[bytes] = []
        cf.appchannel.packet_received.add_callback(lambda data: answers.append(bytes(data)))
        theta = struct.pack("<ff", 4.8, 0.008)
        head = struct.pack("<BBLLBBB", 1, 2, 7, zlib.crc32(b"constant" + theta), 0, 2, 0)
        cf.appchannel.send_packet(head + theta + bytes(8))
        wait_for("the echo", lambda: answers)
        assert answers[0][:7] == struct.pack("<BBLb", 0x81, 2, 7, 0)
        cf.appchannel.send_packet(b"nonsense")
        wait_for("the count", lambda: sil.get("ivl.n_bad_packet") == 1)


def test_console_text_of_the_app_is_heard(sil, connected, wait_for):
    text: list[str] = []
    with connected(sil.uri) as cf:
        cf.console.receivedChar.add_callback(text.append)
        cf.param.set_value("ivl.tick_hz", 333.0)
        cf.param.set_value("ivl.commit", 6)
        wait_for("a line", lambda: "Configuration 6 refused (-1): tick_hz\n" in "".join(text))


# ---- reconnecting


def test_a_policy_stays_in_force_when_its_client_goes(sil, connected, wait_for):
    form = forms.by_name("polynomial2")
    values = [0.5 * (p.lo + p.hi) for p in form.params]
    theta, crc = form.to_si(values).astype("<f4"), form.crc(values)

    def part(seq: int, crc_sent: int, number: int) -> bytes:
        head = struct.pack("<BBLLBBB", 1, 2, seq, crc_sent, form.number, form.n, number)
        return head + theta[4 * number : 4 * number + 4].tobytes().ljust(16, b"\0")

    in_force = struct.pack("<LLB", 7, crc, form.number)
    for seq, crc_sent, status in ((7, crc, 0), (8, crc ^ 1, None)):  # the second one is spoiled
        with connected(sil.uri) as cf:
            answers: list[bytes] = []
            cf.appchannel.packet_received.add_callback(lambda data, heard=answers: heard.append(bytes(data)))
            for number in range(-(-form.n // 4)):
                cf.appchannel.send_packet(part(seq, crc_sent, number))
            wait_for(
                "the echo", lambda heard=answers, n=seq: any(a[:6] == struct.pack("<BBL", 0x81, 2, n) for a in heard)
            )
            wait_for("the answer", lambda heard=answers: heard[-1][9:18] == in_force)
            assert (answers[-1][6] == 0) == (status == 0)


def test_twenty_connections_in_a_row_leave_nothing_behind(fast, connected, wait_for):
    with connected(fast.uri, parameters=False):
        pass
    threads, (files, memory_kB) = threading.active_count(), _resources(fast.pid)
    own_files, _ = _resources(os.getpid())
    for _ in range(20):
        with connected(fast.uri, parameters=False):
            pass
    # some of cflib's threads end a little later than their link
    wait_for(
        "the end of threads and their sockets",
        lambda: threading.active_count() <= threads and _resources(os.getpid())[0] <= own_files,
    )
    assert _resources(fast.pid)[0] == files
    assert _resources(fast.pid)[1] - memory_kB < 200


def _resources(pid: int) -> tuple[int, int]:
    """Open files and resident memory (kB) of a process."""
    with open(f"/proc/{pid}/status", encoding="ascii") as file:  # noqa: PTH123
        status = dict(line.split(":", 1) for line in file)
    return len(os.listdir(f"/proc/{pid}/fd")), int(status["VmRSS"].split()[0])  # noqa: PTH208


# ---- the process


def test_a_port_that_is_taken_is_refused_in_words(sil, world):
    port = int(sil.uri.rsplit(":", 1)[1])
    with pytest.raises(LinkError, match=rf"127\.0\.0\.1:{port}: .*choose another port"):
        SilProcess(world, port=port).start()


def test_a_kill_and_a_start_keep_the_address(sil, connected):
    uri = sil.uri
    with connected(uri, parameters=False):
        sil.kill()
    sil.start()
    assert sil.uri == uri
    with connected(uri, parameters=False):
        pass


def test_a_damaged_model_is_refused_by_line(world, monkeypatch):
    text = silproc.model_text(world)
    for damage, message in (
        (text.replace("body.mass ", "body.mess "), r"standard input:\d+: expected parameter body.mass"),
        (text.replace("0x1.", "0x2.", 1), "CRC differ"),
        (text[: len(text) // 2], "ends too early|no end"),
        ("", "standard input:1: ends too early"),
    ):
        monkeypatch.setattr(silproc, "model_text", lambda _, damage=damage: damage)
        with pytest.raises(LinkError, match=message):
            SilProcess(world).start()


# ---- documentation


def first_flight(sil: SilProcess) -> subprocess.CompletedProcess[str]:
    """The script of the documentation."""
    script = Path(__file__).parents[2] / "docs" / "first_flight.py"
    sil.set("ivl.host_s_max", 10.0)  # on a busy machine the script may stand still for longer than a host may be silent
    environment = {**os.environ, "CFLIB_URI": sil.uri}
    return subprocess.run(
        [sys.executable, script], env=environment, capture_output=True, text=True, timeout=300, check=False
    )


def missed_its_host(sil: SilProcess) -> bool:
    """A machine that was busy for half a second: the vehicle aborted, as it has to."""
    return native.library().rule_name(int(sil.get("ivl.cause"))) == "host"


def test_first_flight_of_the_documentation_lands_twice_on_the_same_vehicle():
    flown_by_make_sil = load("experiments/paper_flight.yaml").make_world()
    for _ in range(5):
        with SilProcess(flown_by_make_sil) as sil:
            result = first_flight(sil)
            if result.returncode == 1 and missed_its_host(sil):
                continue
            assert result.returncode == 0, result.stderr
            parameters, logs, snapshot = result.stdout.splitlines()
            assert "commit" in parameters.split()
            assert "phase" in logs.split()
            values = ast.literal_eval(snapshot)
            assert values["ivl.phase"] in (5, 6)
            assert 3.9 <= values["ivl.trg_rrev"] < 4.2
            assert sil.get("simTruth.z") > 2.0
            again = first_flight(sil)
            if again.returncode == 1 and missed_its_host(sil):
                continue
            assert again.returncode == 0, again.stderr
            twice = ast.literal_eval(again.stdout.splitlines()[-1])
            assert twice["ivl.phase"] in (5, 6)
            assert twice["ivl.trg_seq"] > values["ivl.trg_seq"]
            return
    pytest.fail("the machine was too busy for real time, five times")


def test_what_the_vehicle_changes_by_itself_clients_are_told(sil, connected, wait_for):
    """A configuration that is refused, and a value that is brought into range."""
    with connected(sil.uri) as cf:
        wrong = {"tick_hz": 333.0, "h_ceil": 3.3, "attached_s": 7.5, "mass": 0.05, "fence_z_max": 9.0}
        before = {name: float(cf.param.get_value(f"ivl.{name}")) for name in wrong}
        for name, value in wrong.items():
            cf.param.set_value(f"ivl.{name}", value)
        cf.param.set_value("ivl.commit", 4711)
        wait_for("the refusal", lambda: sil.get("ivl.cfg_seq") == 4711)
        assert sil.get("ivl.cfg_status") != 0
        names = [f"ivl.{name}" for name in cf.param.toc.toc["ivl"]]
        assert len(names) > 50

        def agree() -> bool:
            return all(float(cf.param.get_value(name)) == pytest.approx(sil.get(name)) for name in names)

        wait_for("a client that knows what is in force", agree)
        assert {name: sil.get(f"ivl.{name}") for name in wrong} == pytest.approx(before)
        cf.param.set_value("hlCommander.vland", -3.0)
        wait_for("the clamp", lambda: float(cf.param.get_value("hlCommander.vland")) == 0.5)
