"""What a vehicle, a link or a policy can do wrong so that a flight must not be scored."""

from typing import Any

import numpy as np
import pytest

from ivl import experiment
from ivl.errors import RolloutError
from ivl.experiment import Experiment
from ivl.links import recovery
from ivl.links import vehicle as vehicles
from ivl.links.crazyflie import CrazyflieSource
from ivl.links.options import Options
from ivl.links.packets import Packet, PacketType
from ivl.links.tables import Session
from ivl.silproc import SilProcess
from ivl.source import Plan, WorldSource


def first(plan: Plan, n: int) -> Plan:
    return Plan(plan.theta[:n], plan.seed[:n], plan.stream[:n])


@pytest.mark.parametrize("member", ["seq_in_force", "crc_in_force", "form_in_force"])
def test_policy_is_not_flown_when_the_vehicle_echoes_another(
    server: SilProcess, vertical: Experiment, plan: Plan, monkeypatch: pytest.MonkeyPatch, member: str
) -> None:
    decode = vehicles.decode

    def other(data: bytes) -> Packet | None:
        packet = decode(data)
        if packet is not None and packet.type == PacketType.POLICY_ECHO:
            return Packet(packet.type, {**packet.values, member: packet[member] + 1})
        return packet

    monkeypatch.setattr(recovery, "ATTEMPTS_MAX", 2)
    said: list[str] = []
    with CrazyflieSource(server.uri, vertical, Options(say=said.append)) as source:
        monkeypatch.setattr(vehicles, "decode", other)
        with pytest.raises(RolloutError, match="discarded 2 times in a row"):
            next(source.fly(first(plan, 1)))
        assert source.n_discarded == 2
        assert server.get("sil.episode") == 1, "no landing was begun after the one that compares worlds"
    assert any("not in force" in line for line in said)
    assert server.get("sil.lockstep") == 0, "time must pass for whoever comes next"


def test_policy_out_of_range_is_discarded_and_not_flown(server: SilProcess, vertical: Experiment) -> None:
    theta = np.array([[25.0, 8.0], [4.8, 8.0]])
    plan = Plan(theta, np.zeros(2, dtype=np.uint64), np.arange(2, dtype=np.uint64))
    with CrazyflieSource(server.uri, vertical) as source:
        refused, flown = source.fly(plan)
    assert refused.discarded.startswith("vehicle: policy: form constant: rrev_c_per_s: value 25.0 is out of range")
    assert np.isnan(refused.outcomes["t_impact_s"][0])
    assert flown.discarded == ""
    assert flown.outcomes["triggered"][0] == 1


def test_outcome_of_another_policy_is_not_scored(
    server: SilProcess, vertical: Experiment, plan: Plan, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recovery, "ATTEMPTS_MAX", 1)
    with CrazyflieSource(server.uri, vertical) as source:
        confirm = vehicles.Vehicle.confirm_policy
        monkeypatch.setattr(vehicles.Vehicle, "confirm_policy", lambda self: confirm(self) + 1)
        with pytest.raises(RolloutError, match="discarded 1 times"):
            next(source.fly(first(plan, 1)))


@pytest.mark.parametrize("damage", ["another seed", "a byte of another outcome"])
def test_outcome_that_does_not_belong_to_what_was_asked_is_not_scored(
    server: SilProcess, vertical: Experiment, plan: Plan, monkeypatch: pytest.MonkeyPatch, damage: str
) -> None:
    monkeypatch.setattr(recovery, "ATTEMPTS_MAX", 1)
    said: list[str] = []
    with CrazyflieSource(server.uri, vertical, Options(say=said.append)) as source:
        read = Session.read_memory

        def garbled(*arguments: Any) -> bytes:
            data = bytearray(read(*arguments))
            data[100] ^= 1
            return bytes(data)

        if damage == "another seed":
            # as an older write would do that arrives late
            monkeypatch.setattr(source._site, "before_approach", lambda _: server.set("sil.seed_lo", 99))
        else:
            monkeypatch.setattr(Session, "read_memory", garbled)
        with pytest.raises(RolloutError, match="discarded 1 times"):
            next(source.fly(first(plan, 1)))
    assert "its check sum is that of other random numbers, or bytes" in said[0]


def test_vehicle_does_not_miss_its_host_when_commands_are_lost_one_after_the_other(
    server: SilProcess, vertical: Experiment, plan: Plan, monkeypatch: pytest.MonkeyPatch
) -> None:
    send, n_commands = Session.send, 0

    def lossy(session: Session, port: int, channel: int, data: bytes) -> None:
        nonlocal n_commands
        is_command = (port, channel, data[0]) == (13, 2, PacketType.COMMAND)
        n_commands += is_command
        if not is_command or n_commands % 8 == 0:
            send(session, port, channel, data)

    with CrazyflieSource(server.uri, vertical) as source:
        monkeypatch.setattr(Session, "send", lossy)
        flown = list(source.fly(first(plan, 2)))
        assert source.n_discarded == 0
    (wanted,) = WorldSource(vertical.make_world(), vertical).fly(first(plan, 2))
    assert b"".join(part.outcomes.tobytes() for part in flown) == wanted.outcomes.tobytes()


def test_bounds_beyond_the_vehicle_are_refused_before_the_first_flight(server: SilProcess) -> None:
    chosen = experiment.load("experiments/paper_vertical.yaml", ["firmware.flip_moment_max=0.005"])
    with pytest.raises(RolloutError, match=r"policy bounds: rrev_c_per_s 0 \.\. 7, moment_y_Nmm 0 \.\. 10.65"):
        CrazyflieSource(server.uri, chosen)
    assert server.get("sil.lockstep") == 0, "time must pass for whoever comes next"
