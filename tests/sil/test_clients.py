"""What programs of the Crazyflie world do with a vehicle, through unmodified cflib: each kind once, by true motion."""

import json
import math
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cfclient
import pytest
from cflib.crazyflie.log import LogConfig
from cflib.crazyflie.mem import CompressedSegment, CompressedStart, MemoryElement, Poly4D
from cflib.crazyflie.syncCrazyflie import SyncCrazyflie
from cflib.crazyflie.syncLogger import SyncLogger
from cflib.positioning.motion_commander import MotionCommander
from cflib.utils.multiranger import Multiranger
from cflib.utils.power_switch import PowerSwitch
from cflib.utils.reset_estimator import reset_estimator

from ivl.silproc import SilProcess
from ivl.world import World

VEHICLE = "crazyflie21"  # what `ivl sil` starts
CAN_FLY, FLYING, LOCKED, FINISHED = 1 << 3, 1 << 4, 1 << 6, 1 << 9


@pytest.fixture
def crazyflie() -> Iterator[SilProcess]:
    """A Crazyflie five times as fast as a real one."""
    with SilProcess(World(VEHICLE), speed=5.0) as process:
        yield process


def info(sil: SilProcess) -> int:
    return int(sil.get("supervisor.info"))


def at(sil: SilProcess) -> tuple[float, float, float]:
    return sil.get("simTruth.x"), sil.get("simTruth.y"), sil.get("simTruth.z")


def near(sil: SilProcess, place: tuple[float, float, float], within: float = 0.06) -> bool:
    return math.dist(at(sil), place) < within


def past(sil: SilProcess, wait_for: Any, span_ms: int) -> None:
    """Some time of the vehicle."""
    until_ms = sil.get("sil.time_ms") + span_ms
    wait_for(f"{span_ms} ms of the vehicle", lambda: sil.get("sil.time_ms") > until_ms)


# ---- one flight after another


def test_a_second_connection_flies_after_one_that_only_looked(crazyflie, connected, wait_for):
    for _ in range(2):
        with connected(crazyflie.uri):
            pass
    with connected(crazyflie.uri) as cf:
        cf.high_level_commander.takeoff(0.6, 1.0)
        wait_for("the height", lambda: near(crazyflie, (0.0, 0.0, 0.6)))


def test_a_program_that_streams_flies_twice_on_the_same_vehicle(crazyflie, connected, wait_for):
    for _ in range(2):
        crazyflie.set("sil.speed_factor", 1.0)  # a set-point holds for half a second; a busy client may come late
        with connected(crazyflie.uri) as cf:
            wait_for("motors that may run", lambda: info(crazyflie) & CAN_FLY)
            for height in (0.5, 0.0):

                def step(cf: Any = cf, height: float = height) -> bool:
                    cf.commander.send_position_setpoint(0, 0, height, 0)
                    return near(crazyflie, (0.0, 0.0, height))

                wait_for(f"{height} m", step)
            cf.commander.send_stop_setpoint()
            cf.commander.send_notify_setpoint_stop()
        crazyflie.set("sil.speed_factor", 5.0)
        past(crazyflie, wait_for, 8000)  # far more than the age that locks
        assert not info(crazyflie) & LOCKED


def test_a_vehicle_that_flies_by_itself_stays_where_it_is_when_its_client_closes(crazyflie, connected, wait_for):
    with connected(crazyflie.uri) as cf:
        cf.high_level_commander.takeoff(0.8, 1.0)
        wait_for("the height", lambda: near(crazyflie, (0.0, 0.0, 0.8)))
    past(crazyflie, wait_for, 10000)
    assert near(crazyflie, (0.0, 0.0, 0.8))
    with connected(crazyflie.uri) as cf:
        # a client that stays means it
        cf.commander.send_setpoint(0, 0, 0, 0)
        wait_for("the fall", lambda: at(crazyflie)[2] < 0.05)


# ---- power


def test_a_reboot_by_power_packets_unlocks_and_keeps_what_was_stored(crazyflie, connected, wait_for):
    stored = threading.Event()
    with connected(crazyflie.uri) as cf:
        cf.param.set_value("sound.effect", 11)
        cf.param.set_value("ring.solidRed", 99)
        wait_for("the values", lambda: (crazyflie.get("sound.effect"), crazyflie.get("ring.solidRed")) == (11.0, 99.0))
        cf.param.persistent_store("sound.effect", lambda _, good: good and stored.set())
        wait_for("the answer", stored.is_set)
        cf.high_level_commander.takeoff(0.5, 1.0)
        wait_for("flight", lambda: info(crazyflie) & FLYING)
        cf.supervisor.send_emergency_stop()
        wait_for("the lock", lambda: info(crazyflie) & LOCKED)
    switch = PowerSwitch(crazyflie.uri)
    switch.stm_power_cycle()
    switch.close()
    wait_for("motors that may run", lambda: info(crazyflie) & CAN_FLY)
    with connected(crazyflie.uri) as cf:
        assert int(cf.param.get_value("sound.effect")) == 11
        assert int(cf.param.get_value("ring.solidRed")) == 20
        cf.high_level_commander.takeoff(0.5, 1.0)
        wait_for("the height", lambda: abs(at(crazyflie)[2] - 0.5) < 0.05)


# ---- flights


def test_motion_commander_turns_and_flies_where_the_nose_points(crazyflie, wait_for):
    with SyncCrazyflie(crazyflie.uri) as scf:
        wait_for("motors that may run", lambda: info(crazyflie) & CAN_FLY)
        with MotionCommander(scf, default_height=0.6) as motion:
            # cflib waits in the time of this machine: the vehicle's is set to the same
            crazyflie.set("sil.speed_factor", 1.0)
            motion.turn_left(90)
            motion.forward(0.4)
            crazyflie.set("sil.speed_factor", 5.0)
            wait_for("the place to the left", lambda: math.dist(at(crazyflie)[:2], (0.0, 0.4)) < 0.15)
            assert abs(crazyflie.get("stateEstimate.yaw") - 90.0) < 15.0
    wait_for("the floor", lambda: crazyflie.get("sil.grounded") == 1.0)


def plain_circle() -> list[Poly4D]:
    """Forward by a metre within two seconds, and back."""
    zero = Poly4D.Poly()
    there = [0.0, 0.0, 0.0, 0.0, 35 / 16, -84 / 32, 70 / 64, -20 / 128]
    return [
        Poly4D(2.0, Poly4D.Poly(there), zero, zero, zero),
        Poly4D(2.0, Poly4D.Poly([1.0, *(-c for c in there[1:])]), zero, zero, zero),
    ]


def compressed_way() -> list[Any]:
    """To the left by 0.6 m within two seconds, with a quarter turn."""
    return [CompressedStart(0.0, 0.0, 0.0, 0.0), CompressedSegment(2.0, [], [0.0, 0.6, 0.6], [], [math.pi / 2])]


def upload(cf: Any, number: int, pieces: list[Any], kind: int, offset: int) -> None:
    memory = cf.mem.get_mems(MemoryElement.TYPE_TRAJ)[0]
    memory.trajectory = pieces
    assert memory.write_data_sync(start_addr=offset)
    cf.high_level_commander.define_trajectory(number, offset, len(pieces), kind)


def test_uploaded_trajectories_of_both_kinds_are_flown(crazyflie, connected, wait_for):
    with connected(crazyflie.uri) as cf:
        commander = cf.high_level_commander
        upload(cf, 1, plain_circle(), commander.TRAJECTORY_TYPE_POLY4D, 0)
        upload(cf, 2, compressed_way(), commander.TRAJECTORY_TYPE_POLY4D_COMPRESSED, 512)
        commander.takeoff(0.6, 1.0)
        wait_for("the height", lambda: near(crazyflie, (0.0, 0.0, 0.6)))
        commander.start_trajectory(1, 1.0, relative_position=True)
        wait_for("the far end", lambda: abs(at(crazyflie)[0] - 1.0) < 0.15)
        wait_for("the end of the way", lambda: info(crazyflie) & FINISHED)
        wait_for("the return", lambda: near(crazyflie, (0.0, 0.0, 0.6)))
        commander.start_trajectory(2, 1.0, relative_position=True)
        wait_for("the place to the left", lambda: near(crazyflie, (0.0, 0.6, 0.6)))
        wait_for("the quarter turn", lambda: abs(crazyflie.get("stateEstimate.yaw") - 90.0) < 5.0)
        commander.land(0.0, 1.0)
        wait_for("the floor", lambda: crazyflie.get("sil.grounded") == 1.0)


def test_a_refused_command_is_said_on_the_console(crazyflie, connected, wait_for):
    text: list[str] = []
    with connected(crazyflie.uri) as cf:
        cf.console.receivedChar.add_callback(text.append)
        wait_for("motors that may run", lambda: info(crazyflie) & CAN_FLY)
        cf.high_level_commander.start_trajectory(30, 1.0)
        wait_for("a line", lambda: "HLCMD: trajectory refused: no such trajectory" in "".join(text))


def test_a_vehicle_that_cannot_turn_says_so(Raw):
    with SilProcess(World("habas2021")) as sil, Raw(sil.uri) as raw:
        raw.send("fc01")
        text = b""
        while b"change nothing" not in text:
            packet = raw.receive()
            text += packet[1:] if packet[0] & 0xF3 == 0 else b""
        assert b"cannot turn (aero.yaw_torque is 0)" in text


# ---- decks, memories, names


def test_a_multiranger_sees_the_walls(wait_for):
    with SilProcess(World(VEHICLE), speed=5.0, decks=["bcMultiranger", "bcFlow2"]) as sil:
        sil.set("sil.wall_x", 1.5)
        sil.set("sil.reset", 1)
        with SyncCrazyflie(sil.uri) as scf:
            decks = scf.cf.mem.get_mems(MemoryElement.TYPE_1W)
            names: list[str] = []
            for n, deck in enumerate(decks):
                deck.update(lambda memory: names.append(memory.elements["Board name"]))
                wait_for("the deck's name", lambda n=n: len(names) > n)
            assert sorted(names) == ["bcFlow2", "bcMultiranger"]
            with Multiranger(scf) as ranger:
                wait_for("a distance", lambda: ranger.front is not None and abs(ranger.front - 1.5) < 0.1)
                assert ranger.left is None


def test_without_decks_there_are_none(connected):
    with SilProcess(World(VEHICLE), decks=["none"]) as sil, connected(sil.uri) as cf:
        assert not cf.mem.get_mems(MemoryElement.TYPE_1W)
        assert {name: value for name, value in cf.param.values["deck"].items() if int(value)} == {}


def test_eeprom_and_tester_are_those_of_a_crazyflie(crazyflie, connected, wait_for):
    with connected(crazyflie.uri) as cf:
        eeprom = cf.mem.get_mems(MemoryElement.TYPE_I2C)[0]
        seen: list[Any] = []
        eeprom.update(seen.append)
        wait_for("the settings", lambda: seen)
        assert eeprom.valid
        assert eeprom.elements["radio_address"] == 0xE7E7E7E7E7
        tester = cf.mem.get_mems(MemoryElement.TYPE_MEMORY_TESTER)[0]
        tester.read_data(5, 1000, seen.append)
        wait_for("a thousand bytes", lambda: len(seen) == 2)
        assert tester.readValidationSuccess
        tester.write_data(5, 1000, lambda *_: seen.append(None))
        wait_for("a thousand bytes", lambda: len(seen) == 3)
        assert crazyflie.get("memTst.errCntW") == 0.0


def test_values_live_at_rest_and_the_estimator_settles(crazyflie):
    with SyncCrazyflie(crazyflie.uri) as scf:
        reset_estimator(scf)
        block = LogConfig("rest", 10)
        block.add_variable("stabilizer.roll", "float")
        block.add_variable("kalman.stateZ", "float")
        block.add_variable("gyro.xVariance", "float")
        with SyncLogger(scf, block) as log:
            _, values, _ = next(log)
        assert abs(values["stabilizer.roll"]) > 0.01
        assert values["gyro.xVariance"] > 0.0


def cfclient_variables() -> set[str]:
    """Those of all log configurations that Bitcraze's client brings."""
    folder = Path(cfclient.__file__).parent / "configs" / "log"
    found = set()
    for path in folder.rglob("*.json"):
        block = json.loads(path.read_text(encoding="utf-8"))["logconfig"]["logblock"]
        found |= {variable["name"] for variable in block["variables"]}
    return found


def test_every_log_configuration_of_cfclient_finds_its_variables(crazyflie, connected):
    with connected(crazyflie.uri) as cf:
        served = {f"{group}.{name}" for group, names in cf.log.toc.toc.items() for name in names}
        assert len(cfclient_variables()) > 20
        assert cfclient_variables() <= served


def test_each_controller_of_the_firmware_flies_and_says_what_it_is(crazyflie, connected, wait_for):
    text: list[str] = []
    with connected(crazyflie.uri) as cf:
        cf.console.receivedChar.add_callback(text.append)
        cf.param.set_value("stabilizer.controller", 2)
        wait_for("a line", lambda: "CONTROLLER: 2 flies the simulated stock law" in "".join(text))
        cf.high_level_commander.takeoff(0.5, 1.0)
        wait_for("the height", lambda: near(crazyflie, (0.0, 0.0, 0.5)))
        cf.param.set_value("stabilizer.controller", 0)
        wait_for("the app", lambda: cf.param.get_value("stabilizer.controller") == "6")


# ---- the page of names


def test_the_page_of_parameters_and_logs_is_what_the_vehicle_serves():
    command = [sys.executable, Path(__file__).parents[2] / "tools" / "sil_tables.py", "--check"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr


def acknowledged(raw: Any, packet: str) -> None:
    """Send a packet whose answer is an empty one; what the vehicle says of itself may come first."""
    raw.send(packet)
    while raw.receive(null=True) != b"\xff":
        pass


def test_a_probe_is_answered_without_power_and_a_request_is_not(crazyflie, Raw):
    with Raw(crazyflie.uri) as raw:
        assert raw.ask("fc0102") == bytes.fromhex("fc0102")
        acknowledged(raw, "fffe02")
        raw.come()
        raw.send("fc0102")
        raw.send("ff")
        assert raw.receive(null=True) == b"\xff"
        acknowledged(raw, "fffe03")
        assert raw.ask("fc0102") == bytes.fromhex("fc0102")
