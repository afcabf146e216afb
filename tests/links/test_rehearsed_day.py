"""A day of 60 flights and the day after it, rehearsed: every kind of fault, and what must follow from each.

Independent of what is tested: after each landing the simulator's own outcome is read, and the recorder's checksum of
the policy that flew. What the run has stored of that rollout must be this landing, and nothing else.
"""

import json
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ivl import experiment, native, run
from ivl.errors import ConfigError
from ivl.experiment import Experiment
from ivl.learning.earlier import meta_of
from ivl.learning.recorder import SCORED, RolloutRows
from ivl.links import preflight, sil
from ivl.links.operators import OperatorStopped
from ivl.links.options import Options
from ivl.links.sites.rehearsal import Rehearsal
from ivl.rehearsal import script as scripts
from ivl.rehearsal.script import FAULTS, Fault, Kind, Script
from ivl.seeds import Purpose, derive
from ivl.site import file as site_file
from ivl.source import Plan, WorldSource
from ivl.store import RunStore

BUDGET, FIRST_DAY = 60, 40
SETTINGS = [
    "learner.name=ephe_robust", "n_rollouts=10", f"budget={BUDGET}", "check.n_fresh=5", "check.effort=0.02",
    "check.grid.rrev_c_per_s={lo: 4.0, hi: 5.0, step: 0.5}", "check.grid.moment_y_Nmm={lo: 6.0, hi: 9.0, step: 1.0}",
]  # fmt: skip


@dataclass
class Days:
    """What was seen of both days, beside what the run stored."""

    chosen: Experiment
    folder: Path
    said: list[str] = field(default_factory=list)
    truths: dict[int, Any] = field(default_factory=dict)
    policy_crc: dict[int, int] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    result: run.RunResult | None = None

    def rollouts(self) -> RolloutRows:
        with RunStore.open_reading(self.folder, native.library().outcome_dtype) as store:
            return store.rollouts()

    def journal(self, rollout: int) -> list[str]:
        """What became of the attempts of a rollout."""
        lines = [json.loads(line) for line in (self.folder / "flights.jsonl").read_text().splitlines()]
        return [line["what"] for line in lines if line["stream"] == rollout - 1]


@pytest.fixture(scope="module")
def days(tmp_path_factory: pytest.TempPathFactory) -> Days:
    """Forty flights, then the operator goes home; twenty more with a library that was rebuilt over night."""
    folder = tmp_path_factory.mktemp("cage")
    site_file.write_new(folder / "lab.yaml")
    chosen = experiment.load("experiments/paper_flight.yaml", SETTINGS, site=str(folder / "lab.yaml"))
    seen = Days(chosen, folder / "run")
    bad_day = scripts.load("default")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(preflight, "P95_S_MAX", 10.0)  # a busy machine answers pings late; that is no fault of the room
        look_at_truth(patch, seen)
        first = bad_day.model_copy(update={"ends_before": FIRST_DAY + 1})
        with pytest.raises(OperatorStopped, match="the script's operator ends the day"):
            fly(seen, first, resume=False)
        patch.setattr(type(native.library()), "digest", lambda _: "rebuilt")
        seen.result = fly(seen, bad_day, resume=True)
    return seen


def fly(seen: Days, script: Script, resume: bool) -> run.RunResult:
    options = Options(rehearse=True, script=script, answered_by_script=True, say=seen.said.append)
    hooks = run.Hooks(on_note=seen.notes.append)
    return run.run(seen.chosen, seen.folder, resume=resume, hooks=hooks, uri="rehearsal://", flight=options)


def look_at_truth(patch: pytest.MonkeyPatch, seen: Days) -> None:
    """Keep the simulator's outcome of the landing that each rollout was scored for: that of its last attempt."""
    outcome, place = Rehearsal.outcome, Rehearsal._place
    now: list[int] = []

    def note(site: Rehearsal, rollout: Any) -> None:
        now[:] = [rollout.stream]
        place(site, rollout)

    def look(site: Rehearsal, policy_seq: int) -> Any:
        found, recording = outcome(site, policy_seq)
        seen.truths[now[0]] = sil.last_outcome(site._vehicle.session, policy_seq)[0]
        seen.policy_crc[now[0]] = recording.policy_crc if recording is not None else 0
        return found, recording

    patch.setattr(Rehearsal, "_place", note)
    patch.setattr(Rehearsal, "outcome", look)


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
    """Noise alone moves what is learned: the day lies among days without faults, within their spread and its sigma."""
    assert days.result is not None
    last = days.result.history[-1]
    calm = np.array([learned_without_faults(days.chosen, seed) for seed in range(8)])
    away = np.abs(np.array(last.mu) - calm.mean(axis=0))
    assert (away <= np.hypot(np.array(last.sigma), 2.0 * calm.std(axis=0))).all(), (last.mu, last.sigma, calm)


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
    scripts.write_new(path)
    assert scripts.load(str(path)) == scripts.load("default")
    with pytest.raises(ConfigError, match="is there already"):
        scripts.write_new(path)
    path.write_text(path.read_text().replace("what: locks", "what: lock"))
    with pytest.raises(ConfigError, match=r"'lock' is unknown.*locks"):
        scripts.load(str(path))
    with pytest.raises(ConfigError, match=r"no such script \(shipped: calm, default\)"):
        scripts.load("nowhere")
