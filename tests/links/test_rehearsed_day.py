"""A day of 60 flights and the day after it, rehearsed: every kind of fault, and what must follow from each."""

import json
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from rehearsed import BUDGET, FIRST_DAY, Days

from ivl import files
from ivl.errors import ConfigError
from ivl.experiment import Experiment
from ivl.learning.earlier import meta_of
from ivl.learning.recorder import SCORED
from ivl.rehearsal import script as scripts
from ivl.rehearsal.script import FAULTS, Fault, Kind
from ivl.seeds import Purpose, derive
from ivl.source import Plan, WorldSource


def test_nothing_is_lost_and_nothing_is_scored_wrongly(days: Days) -> None:
    rows = days.rollouts()
    assert (rows.status == SCORED).all()
    assert rows.stream.tolist() == list(range(BUDGET))
    for row in range(BUDGET):
        stored, truth = rows.outcomes[row], days.truths[row]
        told = [(stored[name], truth[name]) for name in ("n_legs", "body_contact", "triggered")]
        assert all(a == b for a, b in told), f"rollout {row + 1}: {told}"
        for name in ("d_trigger_m", "rrev_trigger"):
            assert np.array_equal(stored[name], truth[name], equal_nan=True), f"rollout {row + 1}: {name}"
        if stored["triggered"]:
            assert days.policy_crc[row] == days.chosen.policy.shape.crc(rows.theta[row]), f"rollout {row + 1}"
    assert days.result is not None
    assert (days.result.summary["rollouts"], days.result.summary["discarded"]) == (BUDGET, 0)


def test_each_kind_of_fault_has_struck_once_and_has_its_outcome(days: Days) -> None:
    plan = scripts.load("default").plan(BUDGET)
    struck = [line for line in days.said if line.startswith("rehearsal: ")]
    happened = {row.happens: row for row in FAULTS}
    assert Counter(line.partition(": ")[2].partition(": ")[2] for line in struck) == Counter(happened.keys())
    assert sorted(kind for kinds in plan.values() for kind in kinds) == sorted(Kind)
    for line in struck:
        number, text = line.removeprefix("rehearsal: rollout ").split(": ", 1)
        row, lines = happened[text], days.journal(int(number))
        assert plan[int(number)] == [row.kind]
        assert lines.count("flown") == 1, f"{row.kind}: {lines}"
        assert lines[-1] == "flown"
        if row.cause is None:
            assert lines == ["flown"], f"{row.kind}: {lines}"
        else:
            wanted = [f"{how}: {row.cause}" for how in ("discarded", "not begun")]
            assert any(line.startswith(tuple(wanted)) for line in lines), f"{row.kind}: {lines}"
            assert any(line.startswith("discarded") for line in lines) == row.in_flight, f"{row.kind}: {lines}"
    assert any(line.startswith("away: nobody answered") for line in days.said)


def test_rollouts_without_a_fault_fly_at_once_but_for_empty_batteries(days: Days) -> None:
    quiet = set(range(1, BUDGET + 1)) - set(scripts.load("default").plan(BUDGET)) - {FIRST_DAY + 1}
    for number in quiet:
        lines = days.journal(number)
        assert lines[-1] == "flown"
        assert all("battery" in line or "link" in line for line in lines[:-1]), f"rollout {number}: {lines}"


def test_the_second_day_says_what_is_another_one_and_goes_on(days: Days) -> None:
    assert any("the native library is another one: it was rebuilt" in note for note in days.notes)
    manifest = json.loads((days.folder / "manifest.json").read_text())
    assert [session["library_sha256"] == "rebuilt" for session in manifest["sessions"]] == [False, True]


def test_faults_leave_no_trace_in_what_is_learned(days: Days) -> None:
    """A learner that is told the sixty landings alone stands where the run does, bit for bit."""
    rows, chosen = days.rollouts(), days.chosen
    learner = chosen.make_learner(derive(chosen.seed, Purpose.LEARNER))
    for episode in range(chosen.n_episodes):
        own = rows.episode == episode
        assert np.array_equal(learner.ask(), rows.theta[own])
        learner.tell(rows.theta[own], rows.reward[own], meta_of(rows.outcomes[own], None))
    assert days.result is not None
    last = days.result.history[-1]
    assert (tuple(learner.result.mu), tuple(learner.result.sigma)) == (last.mu, last.sigma)


def test_the_learned_policy_is_that_of_days_without_faults(days: Days) -> None:
    """Noise alone moves what is learned, so the day lies among days without faults, or near them.

    Eight days tell their spread roughly, and a day differs from run to run by its timing: four spreads are allowed.
    """
    assert days.result is not None
    last = days.result.history[-1]
    calm = np.array([learned_without_faults(days.chosen, seed) for seed in range(8)])
    away = np.abs(np.array(last.mu) - calm.mean(axis=0))
    assert (away <= np.hypot(np.array(last.sigma), 4.0 * calm.std(axis=0))).all(), (last.mu, last.sigma, calm)


def learned_without_faults(chosen: Experiment, seed: int) -> np.ndarray:
    """Where the same learner ends in the simulator of this process, with other random numbers of the landings."""
    world = chosen.make_world()
    learner = chosen.make_learner(derive(chosen.seed, Purpose.LEARNER))
    for episode in range(chosen.n_episodes):
        theta, n = learner.ask(), chosen.n_rollouts
        stream = np.arange(episode * n, (episode + 1) * n, dtype=np.uint64)
        plan = Plan(theta, np.full(n, 10_000 + seed, dtype=np.uint64), stream)
        (flown, *_) = WorldSource(world, chosen).fly(plan)
        learner.tell(theta, chosen.reward.score(flown.outcomes)["total"], meta_of(flown.outcomes, None))
    return learner.result.mu


def test_a_script_says_what_happens_and_when() -> None:
    default = scripts.load("default")
    assert [fault.what for fault in default.faults] == list(Kind)
    assert default.plan(60) == default.plan(60)
    assert default.plan(60) != default.model_copy(update={"seed": 2}).plan(60)
    for n_rollouts in (1, 4, 13, 200):
        plan = default.plan(n_rollouts)
        assert sorted(kind for kinds in plan.values() for kind in kinds) == sorted(Kind)
        assert set(plan) <= set(range(1, n_rollouts + 1))
        assert max(map(len, plan.values())) == -(-len(Kind) // n_rollouts)
    placed = default.model_copy(update={"faults": [Fault(what=Kind.LOCKS, rollout=7), Fault(what=Kind.RESTARTS)]})
    assert placed.plan(8)[7] == [Kind.LOCKS]
    with pytest.raises(ConfigError, match=r"locks: rollout 7 \(allowed 1 \.\. 6"):
        placed.plan(6)


def test_a_script_that_is_none_is_refused_in_a_line(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    files.write_new(path, scripts.TEMPLATE.read_bytes())
    assert scripts.load(str(path)) == scripts.load("default")
    with pytest.raises(ConfigError, match="is there already"):
        files.write_new(path, scripts.TEMPLATE.read_bytes())
    path.write_text(path.read_text().replace("what: locks", "what: lock"))
    with pytest.raises(ConfigError, match=r"'lock' is unknown.*locks"):
        scripts.load(str(path))
    with pytest.raises(ConfigError, match=r"no such script \(shipped: calm, default\)"):
        scripts.load("nowhere")
