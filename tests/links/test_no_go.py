"""An approach that the policy calls off, flown over a link: scored, never discarded, and the vehicle comes home."""

import json
import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import cast

import numpy as np
import policies
import pytest

from ivl import cli, experiment
from ivl.experiment import Experiment
from ivl.links.crazyflie import CrazyflieSource
from ivl.links.landing_flight import Rollout, end_level_out, make_safe
from ivl.links.operators import Seen, Upcoming
from ivl.links.options import Options
from ivl.links.packets import Phase, Request
from ivl.links.trouble import Cause
from ivl.links.truth import Resting
from ivl.links.vehicle import Command, Vehicle
from ivl.policy import file, use
from ivl.policy.file import PolicyFile
from ivl.policy.shape import General
from ivl.silproc import SilProcess
from ivl.source import Plan
from ivl.surface import Surface

Furnish = Callable[[Experiment], Experiment]
SLOW, FAST = (0.6, 60.0), (2.5, 60.0)
"""Approaches that the policy refuses and flies."""


class Script:
    """An operator who confirms what is suggested."""

    def __init__(self) -> None:
        self.asked: list[str] = []

    def place(self, upcoming: Upcoming) -> None:
        assert upcoming.start_W_m[2] > 0.3
        self.asked.append("place")

    def change_battery(self, battery_V: float, needed_V: float) -> None:
        raise AssertionError(f"battery {battery_V}, needed {needed_V}")

    def help(self, cause: Cause) -> None:
        raise AssertionError(cause)

    def confirm(self, suggested: Seen, resting: Resting, note: str) -> Seen:
        assert resting.p_W_m[2] < 0.2, "it stands on the floor"
        self.asked.append(f"confirm {suggested.n_legs} {note}".strip())
        return suggested


@pytest.fixture(scope="module")
def policy() -> PolicyFile:
    """It lands in the box, and refuses slow approaches."""
    return policies.by_hand()


def flies(policy: PolicyFile, approach: tuple[float, float], *settings: str) -> Experiment:
    """An experiment that flies the policy at this approach."""
    change = use.on_its_task(policy)
    speed_mps, angle_deg = approach
    path = "experiments/paper_vertical.yaml"
    return experiment.load(path, settings, change, speed_mps=speed_mps, angle_deg=angle_deg)


@pytest.fixture
def server(policy: PolicyFile) -> Iterator[SilProcess]:
    with SilProcess(flies(policy, SLOW).make_world()) as process:
        yield process


def here(chosen: Experiment, seed: int, stream: int) -> np.ndarray:
    """The same landing in this process, shape (1,)."""
    outcome = chosen.make_world().rollouts(
        chosen.speed_mps, chosen.angle_deg, *chosen.policy.mu0, form=chosen.policy.form,
        seed=[seed], stream=[stream], start=chosen.start,
    )  # fmt: skip
    return np.asarray(outcome)


def vehicle_of(source: CrazyflieSource) -> Vehicle:
    assert source._vehicle is not None
    return source._vehicle


def plan_of(chosen: Experiment, n: int) -> Plan:
    return Plan(np.tile(chosen.policy.mu0, (n, 1)), np.zeros(n, dtype=np.uint64), np.arange(n, dtype=np.uint64))


def test_a_no_go_over_a_link_is_bit_for_bit_that_of_this_process(policy: PolicyFile, server: SilProcess) -> None:
    chosen = flies(policy, SLOW)
    with CrazyflieSource(server.uri, chosen) as source:  # which proves one landing by itself
        (flown,) = source.fly(plan_of(chosen, 1))
        assert vehicle_of(source).phase == Phase.READY, "it was asked to hover again"
        assert vehicle_of(source).aborted_by == ""
        assert source.n_discarded == 0
        assert flown.discarded == ""
        assert source.warnings == []
    outcome = flown.outcomes
    assert outcome.tobytes() == here(chosen, 0, 0).tobytes()
    assert (outcome["no_go"][0], outcome["n_legs"][0], outcome["triggered"][0]) == (1, 0, 0)
    assert np.isnan(outcome["t_impact_s"][0])


def test_landings_and_no_goes_take_turns_on_one_connection(policy: PolicyFile, server: SilProcess) -> None:
    """The policy goes with each flight, so that the one of the flight before does not stay in force."""
    chosen = flies(policy, SLOW)
    free = General("polynomial2").always_go(policy.values)
    with CrazyflieSource(server.uri, chosen) as source:
        outcomes = [source.fly_one(Rollout(tuple(theta), 0, 7)).outcome for theta in (free, policy.values, free)]
        no_go = [int(outcome["no_go"][0]) for outcome in outcomes]
    assert no_go == [0, 1, 0]
    assert outcomes[0].tobytes() == outcomes[2].tobytes()


def test_a_vehicle_that_comes_back_gets_the_policy_again(
    policy: PolicyFile, server: SilProcess, tmp_path: Path
) -> None:
    chosen = flies(policy, FAST)
    with CrazyflieSource(server.uri, chosen, Options(tmp_path)) as source:
        (first,) = source.fly(plan_of(chosen, 1))
        server.kill()
        server.start()
        (second,) = source.fly(plan_of(chosen, 1))
    assert first.outcomes.tobytes() == second.outcomes.tobytes() == here(chosen, 0, 0).tobytes()
    assert second.outcomes["n_legs"][0] == 4
    lines = [json.loads(line) for line in (tmp_path / "flights.jsonl").read_text().splitlines()]
    flown = [line for line in lines if line["what"] == "flown"]
    assert len(flown) == 2
    assert [[line[name] for name in policy.shape.names] for line in flown] == [policy.values] * 2


def test_a_rehearsal_ends_a_no_go_on_the_floor_with_the_outcome_of_the_simulator(
    policy: PolicyFile, server: SilProcess, tmp_path: Path, furnish: Furnish
) -> None:
    chosen, script = furnish(flies(policy, SLOW)), Script()
    with CrazyflieSource(server.uri, chosen, Options(tmp_path, script, rehearse=True)) as source:
        flown = list(source.fly(plan_of(chosen, 2)))
        assert source.n_discarded == 0
    assert script.asked == ["place", "confirm 0 called off by the policy"] * 2
    for stream, portion in enumerate(flown):
        outcome, known = portion.outcomes, here(chosen, 0, stream)
        assert portion.discarded == ""
        for name in ("no_go", "end_reason", "n_legs", "triggered", "body_contact"):
            assert outcome[name][0] == known[name][0], name
        # flown from the floor, so the approach begins a few millimetres elsewhere
        assert outcome["p_land"][0] == pytest.approx(known["p_land"][0], abs=0.02)
        assert outcome["d_decided_m"][0] == pytest.approx(known["d_decided_m"][0], abs=0.01)
        assert outcome["d_min_m"][0] == pytest.approx(known["d_min_m"][0], abs=0.03)
        assert np.isnan(outcome["t_impact_s"][0])


@pytest.mark.parametrize("level_out_s_max", [0.1, 0.3])  # long before it could hover
def test_a_level_out_that_ends_in_a_scored_abort_is_still_a_no_go(
    policy: PolicyFile, tmp_path: Path, level_out_s_max: float, furnish: Furnish
) -> None:
    chosen, script = furnish(flies(policy, SLOW, f"firmware.level_out_s_max={level_out_s_max}")), Script()
    said: list[str] = []
    options = Options(tmp_path, script, rehearse=True, say=said.append)
    with SilProcess(chosen.make_world()) as process, CrazyflieSource(process.uri, chosen, options) as source:
        (flown,) = source.fly(plan_of(chosen, 1))
        end_reason = source.world.end_reason(int(flown.outcomes["end_reason"][0]))
        assert source.n_discarded == 0
    assert script.asked == ["place", "confirm 0 called off by the policy, aborted: level_out_time"]
    outcome, known = flown.outcomes, here(flies(policy, SLOW), 0, 0)
    assert [outcome[name][0] for name in ("no_go", "decided", "n_legs", "triggered")] == [1, 1, 0, 0]
    assert outcome["p_land"][0] == pytest.approx(known["p_land"][0], abs=0.02)
    assert end_reason == "missed", "it did not come to rest"
    (told,) = (line for line in said if line.startswith("flown: "))
    assert told.startswith("flown: no_go at P ")


@pytest.mark.parametrize("phase", [Phase.LEVEL_OUT, Phase.ABORTED])
def test_the_distance_of_a_level_out_is_that_from_the_surface_however_it_is_tilted(phase: Phase) -> None:
    half = math.sqrt(0.5)
    wall = Surface((2.0, 0.0, 3.0), (half, 0.0, half), (0.0, 0.0, 0.0))
    way = [(0.0, 0.0, 1.0), (1.0, 0.0, 2.0), (0.5, 0.0, 1.5), (0.5, 0.0, 1.5), (0.5, 0.0, 1.5)]

    class Flier:
        """Follows its way, and is in a phase at the end of it."""

        aborted_by, n, asked = "", 0, 0
        position_W_m = way[0]
        phase = Phase.LEVEL_OUT

        def wait(self, condition: Callable[[], bool], *_: object) -> None:
            while not condition():
                self.n += 1
                self.position_W_m = way[self.n]
                self.phase = phase if self.n >= 2 else Phase.LEVEL_OUT

        def decision(self) -> tuple[float, float]:
            return (0.25, 0.8) if not self.asked else (math.nan, math.nan)

        def ask_for(self, *_: object) -> None:
            self.asked += 1

        def come_down(self) -> None:
            assert self.asked == 1

    flier = Flier()
    told = end_level_out(cast("Vehicle", flier), wall)
    assert told.nearest_m == pytest.approx(2.0 * half)
    assert told.decision == (0.25, 0.8)
    assert flier.asked == (phase == Phase.LEVEL_OUT)


def test_a_rehearsed_landing_tells_its_decision_too(policy: PolicyFile, server: SilProcess, furnish: Furnish) -> None:
    chosen = furnish(flies(policy, FAST))
    with CrazyflieSource(server.uri, chosen, Options(operator=Script(), rehearse=True)) as source:
        vehicle_of(source)  # the operator's script checks that a vehicle lies on the floor; one that hangs does not
        source._site._operator.confirm = lambda suggested, *_: suggested  # type: ignore[union-attr]
        outcome = source.fly_one(Rollout(tuple(policy.values))).outcome
    known = here(chosen, 0, 0)
    assert (outcome["no_go"][0], outcome["n_legs"][0]) == (0, 4)
    assert outcome["p_land"][0] == pytest.approx(known["p_land"][0], abs=0.01)
    assert outcome["d_decided_m"][0] == pytest.approx(known["d_decided_m"][0], abs=0.03)


def test_a_vehicle_that_levels_out_is_brought_down_safely(
    policy: PolicyFile, server: SilProcess, furnish: Furnish
) -> None:
    chosen = furnish(flies(policy, SLOW))
    with CrazyflieSource(server.uri, chosen, Options(operator=Script(), rehearse=True)) as source:
        vehicle, site = vehicle_of(source), source._site
        assert site is not None
        start = site.to_start(Rollout(tuple(policy.values)))
        vehicle.put_policy(policy.shape, policy.values)
        vehicle.ask_for(Command(Request.HOVER, start), (Phase.READY,), 5.0)
        approach = Command(Request.APPROACH, start, SLOW[0], np.radians(SLOW[1]))
        vehicle.ask_for(approach, (Phase.LEVEL_OUT,), 5.0)
        assert make_safe(vehicle) == "landed, disarmed"
        assert vehicle.phase == Phase.IDLE


def test_the_command_flies_a_policy_file(
    policy: PolicyFile, server: SilProcess, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "g.yaml"
    file.save(policy, path)
    for (speed, angle), legs in ((SLOW, 0), (FAST, 4)):
        words = ["--policy", str(path), "--speed", str(speed), "--angle", str(angle), "--json"]
        assert cli.run(["fly", "--uri", server.uri, *words]) == 0
        told = json.loads(capsys.readouterr().out)
        assert cli.run(["rollout", *words]) == 0
        in_process = json.loads(capsys.readouterr().out)
        assert told["outcome"] == in_process
        assert in_process["verdict"].startswith("no_go" if legs == 0 else "4 feet stuck")
        assert told["warnings"] == []
        assert told["outcome"]["n_legs"] == legs
