"""Rollouts over a link against rollouts in this process: the same bits, whatever happens to the link."""

import signal
import sqlite3
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ivl import experiment, run
from ivl.errors import ConfigError, LinkError, RolloutError
from ivl.experiment import Experiment
from ivl.links import open_source
from ivl.links.crazyflie import CrazyflieSource
from ivl.links.deadlines import Deadlines
from ivl.links.landing_flight import Rollout
from ivl.links.options import Options
from ivl.links.packets import Phase
from ivl.links.sites.simulator import OtherWorld, Simulator
from ivl.silproc import SilProcess
from ivl.source import Plan, WorldSource


def fly_both(server: SilProcess, chosen: Experiment, plan: Plan, options: Options | None = None) -> CrazyflieSource:
    """Fly a plan over the link and in this process, and compare every outcome bit for bit."""
    with CrazyflieSource(server.uri, chosen, options) as source:
        flown = list(source.fly(plan))
    (wanted,) = WorldSource(chosen.make_world(), chosen).fly(plan)
    assert [int(part.index[0]) for part in flown] == list(range(len(plan.theta)))
    assert all(part.discarded == "" for part in flown)
    assert b"".join(part.outcomes.tobytes() for part in flown) == wanted.outcomes.tobytes()
    return source


def first(plan: Plan, n: int) -> Plan:
    return Plan(plan.theta[:n], plan.seed[:n], plan.stream[:n])


def rows_of(folder: Path) -> list[list[tuple[object, ...]]]:
    """Everything that a run has stored about rollouts, episodes and learners."""
    with sqlite3.connect(folder / "run.sqlite") as db:
        tables = ("rollout ORDER BY trial, episode, idx", "episode", "learner")
        return [db.execute(f"SELECT * FROM {table}").fetchall() for table in tables]


# ---- the same bits


def test_outcomes_have_the_same_bits_as_in_process(server: SilProcess, vertical: Experiment, plan: Plan) -> None:
    assert fly_both(server, vertical, plan).n_discarded == 0


@pytest.mark.parametrize(
    "settings",
    [
        ["speed_mps=2.2", "angle_deg=60.3", "start=flown"],
        ["gear=narrow_long", "speed_mps=3.3", "sense.latency=0.02", "sense.position_noise=0.003"],
        ["sensing=camera50_delay20_unknown", "approach=constant_rrev", "estimator=kalman", "start=flown"],
    ],
)
def test_outcomes_have_the_same_bits_when_numbers_are_not_of_single_precision(
    plan: Plan, vertical: Experiment, settings: list[str], tmp_path: Path
) -> None:
    path = tmp_path / "other.yaml"
    path.write_text(vertical.to_yaml())
    chosen = experiment.load(str(path), settings)
    with SilProcess(chosen.make_world()) as server:
        fly_both(server, chosen, first(plan, 4))


def test_learning_stores_the_same_bits_as_in_process(server: SilProcess, vertical: Experiment, tmp_path: Path) -> None:
    run.run(vertical, tmp_path / "link", uri=server.uri)
    run.run(vertical, tmp_path / "here")
    assert rows_of(tmp_path / "link") == rows_of(tmp_path / "here")
    journal = (tmp_path / "link" / "flights.jsonl").read_text().splitlines()
    assert len(journal) == vertical.budget


@pytest.mark.parametrize("theta", [(4.8, 8.0), (2.0, 5.0), (20.0, 8.0)], ids=["lands", "falls", "late"])
def test_recorder_is_read_whatever_the_landing_comes_to(
    server: SilProcess, vertical: Experiment, theta: tuple[float, float]
) -> None:
    with CrazyflieSource(server.uri, vertical, Options(keep_recordings=True)) as source:
        landing = source.fly_one(Rollout(theta, seed=5, stream=6))
    rows = vertical.make_world().trace(2.5, 90.0, *theta, seed=5, stream=6, period_s=0.002).rows
    recording = landing.recording
    assert recording is not None
    assert recording.trigger_row is not None
    # row by row against the simulator's own time series, from the trigger on
    first_flip = int(np.argmax(rows.phase == Phase.FLIP))
    n = min(100, len(recording.rows) - recording.trigger_row, len(rows) - first_flip)
    mine, known = recording.rows[recording.trigger_row :][:n], rows[first_flip:][:n]
    assert n > 20
    assert mine["phase"].tolist()[:20] == known.phase.tolist()[:20]
    assert mine["thrust_N"][:20] == pytest.approx(known.thrust_cmd_N[:20], abs=0.2 / 255)
    # what a tick senses is how the tick before it left the vehicle
    assert mine["w_B_radps"][1:20] == pytest.approx(known.w_B_radps[:19], abs=1 / 32)
    assert mine["p_W_m"][:20, 2] == pytest.approx(known.p_WB_m[:20, 2], abs=0.03)


def test_another_world_at_the_other_end_is_refused_and_named(vertical: Experiment) -> None:
    other = vertical.model_copy(update={"gear_set": "table1"})
    with SilProcess(other.make_world()) as server:
        with pytest.raises(OtherWorld) as refused:
            CrazyflieSource(server.uri, vertical, Options(start_hint="ivl sil --experiment mine.yaml"))
        assert server.get("sil.lockstep") == 0, "time must pass for whoever comes next"
        with CrazyflieSource(server.uri, other) as source:
            assert source.warnings == []
    text = str(refused.value)
    assert text.startswith(f"{server.uri} simulates another world than paper_vertical: leg.angle 60 (here 50) deg")
    assert text.endswith("start the right one with: ivl sil --experiment mine.yaml")


def test_another_world_is_flown_when_that_is_wanted(vertical: Experiment, plan: Plan) -> None:
    other = vertical.model_copy(update={"gear_set": "table1"})
    said: list[str] = []
    with SilProcess(other.make_world()) as server:
        options = Options(say=said.append, other_world=True)
        with CrazyflieSource(server.uri, vertical, options) as source:
            next(source.fly(first(plan, 1)))
        assert len(source.warnings) == 1
        assert source.warnings == [line for line in said if "simulates another world than paper_vertical" in line]


def test_run_stops_when_the_vehicle_comes_back_in_another_world(
    server: SilProcess, vertical: Experiment, plan: Plan
) -> None:
    other = vertical.model_copy(update={"gear_set": "table1"})
    with CrazyflieSource(server.uri, vertical) as source:
        flight = source.fly(first(plan, 2))
        next(flight)
        port = int(server.uri.rpartition(":")[2])
        server.kill()
        with SilProcess(other.make_world(), port=port), pytest.raises(OtherWorld):
            next(flight)


def test_software_vehicle_gets_its_time_back(server: SilProcess, vertical: Experiment, plan: Plan) -> None:
    server.set("sil.lockstep", 1)  # as a host that died would leave it
    fly_both(server, vertical, first(plan, 1))
    assert server.get("sil.lockstep") == 0
    assert server.get("sil.start") == 255
    began_ms, end_s = server.get("sil.time_ms"), time.monotonic() + 30.0
    while server.get("sil.time_ms") <= began_ms:
        assert time.monotonic() < end_s


# ---- faults: nothing scored wrongly, nothing lost


@pytest.mark.parametrize(
    ("faults", "n"),
    [
        ({"loss": 0.05}, 6),
        ({"loss": 0.2}, 3),
        ({"jitter_ms": 50}, 1),
        ({"duplicate": 0.3, "reorder": 0.3}, 4),
    ],
    ids=lambda value: "+".join(value) if isinstance(value, dict) else "",
)
def test_outcomes_are_right_on_a_bad_link(
    server: SilProcess, vertical: Experiment, plan: Plan, faults: dict[str, float], n: int
) -> None:
    with CrazyflieSource(server.uri, vertical) as source:
        for name, value in faults.items():
            server.set(f"fault.{name}", value)
        flown = list(source.fly(first(plan, n)))
        for name in faults:
            server.set(f"fault.{name}", 0)
    (wanted,) = WorldSource(vertical.make_world(), vertical).fly(first(plan, n))
    assert b"".join(part.outcomes.tobytes() for part in flown) == wanted.outcomes.tobytes()
    assert server.get("fault.n_lost") + server.get("fault.n_duplicated") > 0 or "jitter_ms" in faults


def freeze(server: SilProcess, struck: threading.Event) -> None:
    server.set("fault.freeze_ms", 3000)
    struck.set()


def cut(server: SilProcess, struck: threading.Event) -> None:
    server.set("fault.cut_ms", 2500)
    struck.set()


def restart(server: SilProcess, struck: threading.Event) -> None:
    server.kill()
    struck.set()
    time.sleep(0.4)
    server.start()


def restart_at_once(server: SilProcess, struck: threading.Event) -> None:
    server.kill()
    struck.set()
    server.start()


@pytest.mark.parametrize("fault", [freeze, cut, restart, restart_at_once], ids=lambda fault: fault.__name__)
def test_flight_is_discarded_and_flown_again_when_the_vehicle_goes_away_in_it(
    server: SilProcess,
    vertical: Experiment,
    plan: Plan,
    fault: Callable[[SilProcess, threading.Event], None],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    said: list[str] = []
    failed: list[LinkError] = []

    def strike() -> None:
        try:
            fault(server, struck)
        except LinkError as error:
            failed.append(error)

    striker, struck = threading.Thread(target=strike), threading.Event()
    flown = []
    with CrazyflieSource(server.uri, vertical, Options(say=said.append)) as source:
        strike_in_flight(monkeypatch, striker, struck)
        for part in source.fly(first(plan, 4)):
            flown.append(part)
        striker.join()
        flown += list(source.fly(first(plan, 1)))
    (wanted,) = WorldSource(vertical.make_world(), vertical).fly(first(plan, 4))
    got = b"".join(part.outcomes.tobytes() for part in flown)
    assert not failed
    assert got == wanted.outcomes.tobytes() + wanted.outcomes[:1].tobytes()
    assert source.n_discarded >= 1, said
    assert any(line.startswith("flight discarded, flown again") for line in said)
    assert any(line.startswith("connected again") for line in said)


def strike_in_flight(patch: pytest.MonkeyPatch, striker: threading.Thread, struck: threading.Event) -> None:
    """Let the fault strike in the second landing, after its approach has begun."""
    original, n_calls = Simulator.outcome, 0

    def outcome(site: Simulator, policy_seq: int) -> object:
        nonlocal n_calls
        n_calls += 1
        if n_calls == 2:
            striker.start()
            struck.wait(30.0)
        return original(site, policy_seq)

    patch.setattr(Simulator, "outcome", outcome)


def test_landing_that_compares_worlds_may_be_discarded_before_there_is_a_run_folder(
    server: SilProcess, vertical: Experiment, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    original, n_calls = Simulator.outcome, 0

    def fail_first(site: Simulator, policy_seq: int) -> object:
        nonlocal n_calls
        n_calls += 1
        if n_calls == 1:
            raise LinkError("lost")
        return original(site, policy_seq)

    monkeypatch.setattr(Simulator, "outcome", fail_first)
    run.run(vertical, tmp_path / "link", uri=server.uri)
    assert n_calls == 2 + vertical.budget
    assert len((tmp_path / "link" / "flights.jsonl").read_text().splitlines()) == vertical.budget


def test_run_ends_and_can_be_resumed_when_the_vehicle_stays_away(
    server: SilProcess, vertical: Experiment, plan: Plan
) -> None:
    options = Options(deadlines=replace(Deadlines(), return_s=0.5))
    with CrazyflieSource(server.uri, vertical, options) as source:
        flight = source.fly(first(plan, 2))
        next(flight)
        server.kill()
        with pytest.raises(RolloutError, match=r"the vehicle stayed away for 0\.5 s: .* nobody listens there"):
            next(flight)


# ---- the run around it


def test_ctrl_c_stops_cleanly_and_the_resumed_run_has_the_same_bits(
    server: SilProcess, vertical: Experiment, tmp_path: Path
) -> None:
    longer = vertical.model_copy(update={"budget": 40})
    path = tmp_path / "vertical.yaml"
    path.write_text(longer.to_yaml())
    command = [sys.executable, "-m", "ivl", "learn", str(path), "--uri", server.uri, "--out", str(tmp_path / "link")]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        lines = [process.stderr.readline() for _ in range(2)]
        process.send_signal(signal.SIGINT)
        lines += process.stderr.read().splitlines(keepends=True)
        assert process.wait(30) == 130, lines
    assert any("--resume" in line for line in lines)
    assert "Traceback" not in "".join(lines)
    assert server.get("sil.lockstep") == 0
    assert server.get("ivl.phase") == 0
    n_flown = len((tmp_path / "link" / "flights.jsonl").read_text().splitlines())
    assert 4 <= n_flown < longer.budget
    run.run(longer, tmp_path / "link", resume=True, uri=server.uri)
    run.run(longer, tmp_path / "here")
    assert rows_of(tmp_path / "link") == rows_of(tmp_path / "here")


def test_nothing_is_created_when_the_vehicle_cannot_be_reached(in_room: Experiment, tmp_path: Path) -> None:
    with pytest.raises(LinkError, match="no Crazyradio is plugged in"):
        run.run(in_room, tmp_path / "run", uri="radio://0/80/2M/E7E7E7E7E7")
    assert not (tmp_path / "run").exists()


def test_unknown_scheme_is_refused(vertical: Experiment) -> None:
    with pytest.raises(ConfigError, match=r"allowed pil://, udp://, radio://"):
        open_source("ftp://x", vertical)
