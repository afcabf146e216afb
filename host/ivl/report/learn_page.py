"""What the page of an `ivl learn` run shows: convergence, and every rollout of the first trial to replay."""

import base64
import json
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from ivl import landing, margin, native, run
from ivl.assess import Best
from ivl.errors import StoreError
from ivl.experiment import Experiment
from ivl.learning.recorder import SCORED, EpisodeRow, RolloutRows
from ivl.outcome import four_leg
from ivl.plots.convergence import outcome_classes
from ivl.report import replay
from ivl.report.flown_part import FlownPart
from ivl.report.landings import Album, thinned
from ivl.report.page import axis_from_zero, encode, fine_unit, flatten, learner_words, parameter_names, reward_names
from ivl.store import RunStore, read_manifest


def collect(folder: Path, n_landings_max: int, on_landing: Callable[[int, int], None]) -> tuple[dict[str, Any], Album]:
    """Data of the page, and its landings.

    Args:
        folder: Run folder.
        n_landings_max: Most landings that the page carries.
        on_landing: Called with (done, all) after each landing that was flown again.

    Raises:
        StoreError: The folder holds no run, nothing is finished, or another process is working on it.
    """
    experiment, n_trials = run.read_config(folder)
    with RunStore.open_reading(folder, native.library().outcome_dtype) as store:
        history, rollouts = store.episodes(), store.rollouts(trial=0)
        corrections = store.amendments()
    album, numbers = Album(experiment.reward), np.full(len(rollouts), -1)
    scored = np.flatnonzero(rollouts.status == SCORED)
    if not scored.size:
        raise StoreError(f"{folder}: no rollout is finished, there is nothing to report")
    notable, flown = _notable(rollouts, scored), None
    if read_manifest(folder).get("flown"):
        flown = FlownPart.of(folder, experiment, rollouts, album, on_landing)
        numbers = flown.numbers
        notable = [(what, row) for what, row in notable if numbers[row] >= 0]
    else:
        chosen = thinned(scored.tolist(), n_landings_max) | {row for _, row in notable}
        for done, row in enumerate(sorted(chosen), 1):
            numbers[row] = album.add(_spec(experiment, rollouts, row), f"rollout {row}", _is_recorded(rollouts, row))
            on_landing(done, len(chosen))
    data = {
        "title": f"Inverted landing: {experiment.name}",
        "subtitle": experiment.doc,
        "facts": [
            *_facts(experiment, n_trials or 1, folder, flown is not None),
            *([album.fact()] if flown is None else flown.facts),
        ],
        "manifest": flatten(read_manifest(folder)),
        "claims": None,
        "scale": replay.SCALE,
        "geometry": album.geometry,
        "landings": album.landings,
        "terms": reward_names(experiment.reward),
        "parameters": parameter_names(experiment.policy.shape),
        "learn": {
            "episodes": [_episodes(experiment, history, trial) for trial in range(n_trials or 1)],
            "rollouts": _rollouts(rollouts, numbers),
            "limits": _limits(experiment, rollouts),
            "notable": [{"what": what, "landing": int(numbers[row])} for what, row in notable],
            "first_shown": [0, max(0, len(notable) - 2)],
            "pictures": _pictures(experiment, [row for row in history if row.trial == 0], rollouts),
            "flown": None if flown is None else flown.data(corrections),
        },
    }
    return data, album


def _spec(experiment: Experiment, rollouts: RolloutRows, row: int) -> landing.LandingSpec:
    theta = rollouts.theta[row].tolist()
    return landing.of_rollout(experiment, int(rollouts.trial[row]), theta, int(rollouts.stream[row]))


def _is_recorded(rollouts: RolloutRows, row: int) -> Callable[[Any], bool]:
    """Whether an outcome is the stored one, number for number (the store does not keep the sign of a zero)."""
    stored = rollouts.outcomes[row]
    names = stored.dtype.names

    def same(record: Any) -> bool:
        return all(np.array_equal(record[n], stored[n], equal_nan=stored.dtype[n].base.kind == "f") for n in names)

    return same


def _notable(rollouts: RolloutRows, scored: Any) -> list[tuple[str, int]]:
    """Rollouts worth a look, best first."""
    reward, landed = rollouts.reward[scored], four_leg(rollouts.outcomes[scored])
    touched = np.isfinite(rollouts.outcomes["t_impact_s"][scored])
    found = [("best return", int(scored[np.argmax(reward)]))]
    if landed.any():
        found += [
            ("first on three or four legs", int(scored[landed][0])),
            ("last on three or four legs", int(scored[landed][-1])),
        ]
    found.append(("last rollout", int(scored[-1])))
    if touched.any():
        found.append(("worst that touched the ceiling", int(scored[touched][np.argmin(reward[touched])])))
    return [*found, ("worst return", int(scored[np.argmin(reward)]))]


def _facts(experiment: Experiment, n_trials: int, folder: Path, is_flown: bool) -> list[list[str]]:
    facts = [
        ["Vehicle and gear", f"{experiment.vehicle}, {experiment.gear_set}/{experiment.gear}"],
        ["Approach", f"{experiment.speed_mps:g} m/s at {experiment.angle_deg:g}°"],
        ["Learner", learner_words(experiment.learner.name)],
        ["Rollouts", f"{experiment.budget} in episodes of {experiment.n_rollouts}"],
        ["Seed", str(experiment.seed) if n_trials == 1 else f"{experiment.seed} and on, {n_trials} trials"],
    ]
    judged = _verdict(folder / "result.json", n_trials, experiment)
    return facts + [[f"{name}, by the simulator", text] if is_flown else [name, text] for name, text in judged]


def _verdict(path: Path, n_trials: int, experiment: Experiment) -> list[list[str]]:
    """Whether the trial was solved, and what room its policy has; nothing if the run has not been judged yet."""
    if not path.is_file():
        return [["Verdict", "not judged: the run was cut off"]]
    result = json.loads(path.read_text(encoding="utf-8"))
    verdicts = result["verdicts"]
    solved = [verdict["rollouts_to_convergence"] for verdict in verdicts if verdict["solved"]]
    if n_trials > 1:
        return [["Solved", f"{len(solved)} of {n_trials} trials"]]
    facts = [["Solved", f"after {solved[0]} rollouts" if solved else "no"]]
    if result.get("margin") is not None:
        told = margin.lines(result["margin"], Best.of_dict(result["best"]), experiment)
        facts += [[name.capitalize(), text] for name, text in told]
    if result.get("model_fits") is not None:
        facts.append(
            ["Model", "fits" if result["model_fits"] else "no model fits: flights land less often than expected"]
        )
    return facts


def _pictures(experiment: Experiment, history: list[EpisodeRow], rollouts: RolloutRows) -> list[dict[str, str]]:
    """The picture of the belief as text that a browser shows without asking anybody, if the learner has a belief."""
    from ivl.plots import belief  # matplotlib takes a second to load

    if not belief.has_picture(history):
        return []
    with tempfile.TemporaryDirectory() as folder:
        (path,) = belief.draw(experiment, history, rollouts, [Path(folder) / "belief.png"])
        text = base64.b64encode(path.read_bytes()).decode()
    return [{"name": "belief", "title": belief.TITLE, "source": f"data:image/png;base64,{text}"}]


def _episodes(experiment: Experiment, history: list[EpisodeRow], trial: int) -> dict[str, Any]:
    """The search of one trial, from its start on; rate and return begin with the first episode."""
    own = [row for row in history if row.trial == trial]
    returns = [np.nan, *(row.reward_mean for row in own)]
    start = experiment.policy.parameters
    return {
        "at": [experiment.n_rollouts * k for k in range(len(own) + 1)],
        "mu": [encode([p.mu0, *(row.mu[i] for row in own)], 1e-3) for i, p in enumerate(start)],
        "sigma": [encode([p.sigma0, *(row.sigma[i] for row in own)], 1e-3) for i, p in enumerate(start)],
        "rate": encode([np.nan, *(row.rate_four_leg for row in own)], 1e-3),
        "reward": encode(returns, fine_unit(returns, 5)),
    }


def _rollouts(rollouts: RolloutRows, numbers: Any) -> dict[str, Any]:
    """Every rollout of the first trial; kind is the place in the list of outcomes, -1 if it was not scored."""
    kind = np.full(len(rollouts), -1)
    for number, mask in enumerate(outcome_classes(rollouts)):
        kind[mask] = number
    return {
        "at": list(range(1, len(rollouts) + 1)),
        "kind": kind.tolist(),
        "theta": [encode(column, 1e-3) for column in rollouts.theta.T],
        "reward": encode(rollouts.reward, fine_unit(rollouts.reward, 5)),
        "landing": numbers.tolist(),
    }


def _limits(experiment: Experiment, rollouts: RolloutRows) -> list[list[float]]:
    """Ranges of the axes: parameters (bounds and what was flown), rate, return."""
    limits = []
    for bounds, flown in zip(experiment.policy.bounds, rollouts.theta.T, strict=True):
        lo, hi = min(bounds[0], flown.min()), max(bounds[1], flown.max())
        limits.append([float(lo - 0.03 * (hi - lo)), float(hi + 0.03 * (hi - lo))])
    return [*limits, [-0.03, 1.05], axis_from_zero(rollouts.reward)]
