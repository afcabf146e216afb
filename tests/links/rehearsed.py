"""A rehearsed day and the day after it, for the tests that look at what they have left.

Independent of what is tested: after each landing the simulator's own outcome is read, and the recorder's checksum of
the policy that flew.
"""

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from ivl import experiment, files, native, run
from ivl.experiment import Experiment
from ivl.learning.recorder import RolloutRows
from ivl.links import preflight, sil
from ivl.links.operators import OperatorStopped
from ivl.links.options import Options
from ivl.links.sites.rehearsal import Rehearsal
from ivl.rehearsal import script as scripts
from ivl.rehearsal.script import Script
from ivl.site import file as site_file
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


def fly_both(folder: Path) -> Days:
    """Forty flights, then the operator goes home; twenty more with a library that was rebuilt over night."""
    files.write_new(folder / "lab.yaml", site_file.TEMPLATE.read_bytes())
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
