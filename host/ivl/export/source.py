"""Where a landing to export comes from: a run folder, a specification, a trace file, a flight recorder's table."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ivl import flown, landing, native, run
from ivl.errors import ConfigError, StoreError
from ivl.experiment import Experiment
from ivl.export.flight import Flight, of_file, of_spec
from ivl.landing import LandingSpec
from ivl.learning.recorder import SCORED, RolloutRows
from ivl.outcome import as_dict
from ivl.rewards import RewardChoice
from ivl.store import RunStore, read_manifest
from ivl.world import World


@dataclass(frozen=True)
class Choice:
    """Which landing of a run, and whose shapes a file is drawn with; None where nothing was said.

    Attributes:
        trial: Trial of a run.
        rollout: Rollout of a trial of `ivl learn`, counted from 0; None: that with the largest return.
        gear: Landing gear: of a sweep's cell, or of the vehicle that a file is about.
        gear_set: Set of landing gears of the vehicle that a file is about.
        vehicle: Vehicle that a file is about.
        speed_mps: Approach speed of a sweep's cell.
        angle_deg: Approach angle of a sweep's cell.
        simulated: Of a flown rollout its simulated counterpart, and not its recording.
    """

    trial: int | None = None
    rollout: int | None = None
    gear: str | None = None
    gear_set: str | None = None
    vehicle: str | None = None
    speed_mps: float | None = None
    angle_deg: float | None = None
    simulated: bool | None = None

    def given(self) -> list[str]:
        """Names of what was said."""
        return [name for name, value in vars(self).items() if value is not None]


def resolve(source: Path, choice: Choice) -> Flight:
    """The landing that `source` and `choice` name, flown again if it comes from a run or a specification.

    Raises:
        ConfigError: There is no such landing, or the choice does not fit the source.
        StoreError: A run folder cannot be read.
    """
    if source.is_dir():
        if "sweep" in read_manifest(source):
            return of_spec(*_of_sweep(source, choice))
        return _of_learn(source, choice)
    if not source.is_file():
        raise ConfigError(f"{source}: no such file or run folder")
    if source.suffix in (".yaml", ".yml"):
        _allow(choice, (), f"{source.name} is a specification")
        return of_spec(landing.load(source), source.name)
    if source.suffix not in (".csv", ".npz"):
        raise ConfigError(f"{source}: unknown kind of file (allowed a run folder, .yaml, .csv, .npz)")
    _allow(choice, ("vehicle", "gear", "gear_set"), f"{source.name} is a recorded landing")
    shapes = {name: value for name in ("vehicle", "gear", "gear_set") if (value := getattr(choice, name)) is not None}
    return of_file(source, World(**shapes))


def _of_learn(folder: Path, choice: Choice) -> Flight:
    """A rollout of a run of `ivl learn`: the one that was asked for, or that with the largest return.

    What a vehicle has flown is its recording; what the simulator has flown is flown again.
    """
    is_flown = bool(read_manifest(folder).get("flown"))
    allowed = ("trial", "rollout", *(["simulated"] if is_flown else []))
    _allow(choice, allowed, f"{folder} is a run of `ivl learn`")
    experiment, n_trials = run.read_config(folder)
    trial = choice.trial or 0
    if trial >= (n_trials or 1):
        raise ConfigError(f"--trial {trial}: {folder} has trials 0 .. {(n_trials or 1) - 1}")
    with RunStore.open_reading(folder, native.library().outcome_dtype) as store:
        rollouts = store.rollouts(trial=trial)
    scored = np.flatnonzero(rollouts.status == SCORED)
    if not scored.size:
        raise StoreError(f"{folder}: trial {trial} has no finished rollout")
    row = int(scored[np.argmax(rollouts.reward[scored])]) if choice.rollout is None else choice.rollout
    if row >= len(rollouts):
        raise ConfigError(f"--rollout {row}: trial {trial} of {folder} has rollouts 0 .. {len(rollouts) - 1}")
    title = f"{experiment.name}, trial {trial}, rollout {row}"
    if not is_flown:
        spec = landing.of_rollout(experiment, trial, rollouts.theta[row].tolist(), int(rollouts.stream[row]))
        return of_spec(spec, title, experiment.reward)
    spec, path = flown.counterpart(folder, experiment, rollouts, row)
    if choice.simulated:
        return of_spec(spec, f"{title}, SIMULATED counterpart of a flown landing", experiment.reward)
    if not path.is_file():
        raise ConfigError(f"{folder}: rollout {row} has no recording ({path.name}); --simulated has its counterpart")
    return _of_recording(path, experiment, rollouts, row, f"{title}, as recorded")


def _of_recording(path: Path, experiment: Experiment, rollouts: RolloutRows, row: int, title: str) -> Flight:
    """The recording of a flown rollout, with what the run knows of it."""
    world = experiment.make_world()
    flight = of_file(path, world)
    record = rollouts.outcomes[row]
    facts = {f"outcome.{k}": str(v) for k, v in as_dict(record, world.end_reason(int(record["end_reason"]))).items()}
    facts |= {
        f"spec.{p.name}": str(v) for p, v in zip(experiment.policy.shape.params, rollouts.theta[row], strict=True)
    }
    said = {"source": "flight recorder of the vehicle", "judged_by": "operator", "file": path.name}
    return replace(flight, title=title, facts={**facts, **said})


def _of_sweep(folder: Path, choice: Choice) -> tuple[LandingSpec, str, RewardChoice]:
    """The best landing of a trial of a sweep; of the trials that fit what was said, that with the largest return."""
    from ivl.report.sweep_page import best_landing, label  # pandas takes a second to load
    from ivl.sweep import store
    from ivl.sweep.config import load_sweep

    _allow(choice, ("trial", "gear", "speed_mps", "angle_deg"), f"{folder} is a sweep, which keeps the best landings")
    trials = store.read_trials(folder)
    for name in choice.given():
        value, column = getattr(choice, name), trials[name]
        fits = np.isclose(column, value) if isinstance(value, float) else column == value
        if not fits.any():
            known = ", ".join(f"{v:g}" if isinstance(v, float) else str(v) for v in sorted(column.unique()))
            raise ConfigError(f"{folder}: no trial has {name} {value!r} (allowed {known or 'none'})")
        trials = trials[fits]
    flown = trials[trials["best_stream"] >= 0]
    if flown.empty:
        raise StoreError(f"{folder}: no trial of this choice has a landing")
    trial = flown.loc[flown["best_reward"].idxmax()]
    sweep = load_sweep(str(folder / "sweep.yaml"))
    return best_landing(sweep, trial), label(trial, sweep), sweep.at(sweep.variant_of(trial)).reward


def _allow(choice: Choice, names: tuple[str, ...], why: str) -> None:
    """Refuse options that this kind of source has no use for."""
    for name in choice.given():
        if name not in names:
            option = "--" + {"speed_mps": "speed", "angle_deg": "angle"}.get(name, name.replace("_", "-"))
            raise ConfigError(f"{option}: {why}, it takes no such option")
