"""What the page of an `ivl sweep` run shows: landing rates of all cells, trials and their search, best landings."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd  # type: ignore[import-untyped]

from ivl import forms
from ivl.analysis.claims import evaluate
from ivl.analysis.rates import CLEAN_RATE, RATE, cell_rates, rollouts_to_rate
from ivl.errors import StoreError
from ivl.landing import LandingSpec
from ivl.outcome import SOLVED_SHARE, solved
from ivl.report import replay
from ivl.report.landings import Album, thinned
from ivl.report.page import axis_from_zero, encode, fine_unit, flatten, learner_words, parameter_names, reward_names
from ivl.rewards import TOTAL
from ivl.sweep import store
from ivl.sweep.config import Sweep, load_sweep
from ivl.sweep.schema import cell_columns, varied_columns
from ivl.sweep.vary import AXES, text_of

CAMPAIGN_GEARS, CAMPAIGN_APPROACHES = 6, 100
"""A run with fewer gears or approaches says nothing about the paper's claims (which rest on 6 and 240)."""
_PLACES = {"group": "gear", "speed_mps": "speed", "angle_deg": "angle"}


def collect(folder: Path, n_landings_max: int, on_landing: Callable[[int, int], None]) -> tuple[dict[str, Any], Album]:
    """Data of the page, and its landings (arguments as `learn_page.collect`).

    Raises:
        StoreError: The folder holds no sweep, or none of its trials is finished.
    """
    manifest, sweep = store.read_manifest(folder), load_sweep(str(folder / "sweep.yaml"))
    trials, cells = _tables(folder, sweep)
    album = Album(sweep.reward)
    trials["landing"] = _fly(sweep, trials, album, n_landings_max, on_landing)
    data = {
        "title": f"Inverted landing: {sweep.name}",
        "subtitle": sweep.doc,
        "facts": [*_facts(sweep, trials, cells), album.fact()],
        "manifest": flatten(manifest),
        "claims": _claims(folder, trials, cells) if sweep.policy.form == forms.PAPER else None,
        "scale": replay.SCALE,
        "geometry": album.geometry,
        "landings": album.landings,
        "terms": reward_names(sweep.reward),
        "parameters": parameter_names(sweep.policy.shape),
        "sweep": _encode(sweep, trials, cells, _places(cells), _episodes(folder, sweep, trials)),
    }
    return data, album


def _tables(folder: Path, sweep: Sweep) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Trials (with the number of their cell) and cells, both in the order of their names."""
    trials = store.read_trials(folder)
    if trials.empty:
        raise StoreError(f"{folder}: none of its trials is finished, there is nothing to report")
    keys = cell_columns(trials)
    names = {name: object for name in keys if isinstance(trials[name].dtype, pd.CategoricalDtype)}
    trials = trials.astype(names)
    cells = cell_rates(trials).sort_values(keys, kind="stable").reset_index(drop=True)
    cells["group"] = [_group(sweep, cell) for _, cell in cells.iterrows()]
    trials = trials.merge(cells[keys].assign(cell=np.arange(len(cells))), on=keys, how="inner")
    return trials.sort_values([*keys, "trial"], kind="stable").reset_index(drop=True), cells


def _group(sweep: Sweep, row: pd.Series) -> str:
    """What the page shows side by side: a landing gear, with the value of each varied path if there are some."""
    return ", ".join([row["gear"], *_varied_words(sweep, row)])


def _varied_words(sweep: Sweep, row: pd.Series) -> list[str]:
    """Path and value of whatever the sweep varies but gear, speed and angle."""
    return [f"{path} {text_of(value)}" for path, value in sweep.variant_of(row)]


def _fly(
    sweep: Sweep, trials: pd.DataFrame, album: Album, n_max: int, on_landing: Callable[[int, int], None]
) -> pd.Series:
    """Number of each trial's best landing on the page, -1 without: first one a cell, others as far as there is room."""
    order = trials.sort_values(["cell", "best_reward", RATE], ascending=[True, False, False], kind="stable")
    flown = order[order["best_stream"] >= 0]
    firsts, others = flown.groupby("cell").head(1), flown[flown["cell"].duplicated()]
    chosen = thinned(firsts.index, n_max)
    chosen |= thinned(others.index, n_max - len(chosen))
    numbers = pd.Series(-1, index=trials.index)
    for done, row in enumerate(sorted(chosen), 1):
        trial = trials.loc[row]
        numbers[row] = album.add(best_landing(sweep, trial), label(trial, sweep), _is_recorded(sweep, trial))
        on_landing(done, len(chosen))
    return numbers


def label(trial: pd.Series, sweep: Sweep) -> str:
    """What people call a trial."""
    group = ", ".join([trial["gear"].replace("_", " "), *_varied_words(sweep, trial)])
    return f"{group}, {trial['speed_mps']:g} m/s at {trial['angle_deg']:g}°, trial {trial['trial']}"


def best_landing(sweep: Sweep, trial: pd.Series) -> LandingSpec:
    """The rollout of a trial with the largest return."""
    return LandingSpec(
        **sweep.at(sweep.variant_of(trial)).setup(),
        gear=trial["gear"],
        speed_mps=float(trial["speed_mps"]),
        angle_deg=float(trial["angle_deg"]),
        form=sweep.policy.form,
        theta=[float(trial[f"best_{name}"]) for name in sweep.policy.shape.names],
        seed=int(trial["seed"]),
        stream=int(trial["best_stream"]),
    )


def _is_recorded(sweep: Sweep, trial: pd.Series) -> Callable[[Any], bool]:
    """Whether an outcome has the return, feet and body contact that the table of trials tells, exactly."""
    scored = sweep.at(sweep.variant_of(trial)).reward

    def same(record: Any) -> bool:
        terms = scored.score(np.array([record], dtype=record.dtype))
        found = (float(terms[TOTAL][0]), int(record["n_legs"]), int(record["body_contact"]))
        return found == (trial["best_reward"], trial["best_n_legs"], trial["best_body_contact"])

    return same


def _facts(sweep: Sweep, trials: pd.DataFrame, cells: pd.DataFrame) -> list[list[str]]:
    n_solved = int(solved(cells["rate_best_norm"]).sum())
    varied = [f"{path}: {', '.join(map(text_of, given))}" for path, given in sweep.vary.items() if path not in AXES]
    return [
        ["Vehicle and gears", f"{sweep.vehicle}, {sweep.gear_set}"],
        *([["Varied", "; ".join(varied)]] if varied else []),
        ["Learner", ", ".join(learner_words(name) for name in sweep.learner_names())],
        ["Cells and trials", f"{len(cells)} cells, {_finished(sweep, trials)} trials"],
        ["Rollouts", f"{int(trials['n_rollouts'].sum()):,}"],
        ["Mean landing rate", f"{100 * cells['rate_mean_norm'].mean():.1f} %"],
        [f"Cells with a trial of {100 * SOLVED_SHARE:.0f} % or more", f"{n_solved} of {len(cells)}"],
        ["Seed", str(sweep.seed)],
    ]


def _claims(folder: Path, trials: pd.DataFrame, cells: pd.DataFrame) -> dict[str, Any] | None:
    """The paper's claims tried on this run; None for a run that is not nearly the paper's campaign, or several."""
    approaches = cells.groupby("gear", observed=True).size()
    several = varied_columns(cells) or any(cells[name].nunique() > 1 for name in ("vehicle", "gear_set", "learner"))
    if several or len(approaches) < CAMPAIGN_GEARS or approaches.min() < CAMPAIGN_APPROACHES:
        return None
    keys = cell_columns(trials)
    needed = rollouts_to_rate(store.read_episodes(folder)).astype({name: trials[name].dtype for name in keys})
    found = evaluate(trials.merge(needed, on=[*keys, "trial"], how="left"))
    head = ["", "claim of the paper", "verdict", "what was found"]
    return {"head": head, "rows": [[str(c.number), c.text, c.verdict, c.finding] for c in found]}


def _finished(sweep: Sweep, trials: pd.DataFrame) -> str:
    """Number of trials, and of how many if some are missing."""
    n_planned = len(sweep.approaches()) * sweep.n_gears() * sweep.trials
    return str(len(trials)) if len(trials) == n_planned else f"{len(trials)} of {n_planned}"


def _places(cells: pd.DataFrame) -> dict[str, list[Any]]:
    """Values of gear (with what else is varied), speed and angle that occur; gears by their legs' length and width."""
    return {name: sorted(cells[name].unique().tolist(), key=_gear_order) for name in _PLACES}


def _gear_order(value: Any) -> tuple[Any, ...]:
    """Short gears before long ones, narrow before wide; numbers by value."""
    if not isinstance(value, str):
        return (value,)
    width = 0 if "extra_narrow" in value else 1 if "narrow" in value else 2
    return ("long" in value, width, value)


def _episodes(folder: Path, sweep: Sweep, trials: pd.DataFrame) -> dict[str, Any]:
    """The search of every trial, one after the other, each beginning with its start; adds to `trials` where it is."""
    keys = [*cell_columns(trials), "trial"]
    episodes = store.read_episodes(folder).astype({name: trials[name].dtype for name in keys})
    grids = {varied: sweep.at(varied) for varied in sweep.variants()}
    own = [grids[sweep.variant_of(trial)] for _, trial in trials.iterrows()]
    start = trials[keys].assign(episode=-1, rate=np.nan, reward=np.nan)
    names = sweep.policy.shape.names
    for i, name in enumerate(names):
        start[f"mu_{name}"] = trials[f"mu0_{name}"]
        start[f"sigma_{name}"] = [grid.policy.parameters[i].sigma0 for grid in own]
    episodes = episodes.rename(columns={RATE: "rate", "reward_mean": "reward"})
    both = pd.concat([start, episodes[start.columns]]).sort_values([*keys, "episode"], kind="stable")
    both = both.merge(trials[keys].assign(n_rollouts=[grid.n_rollouts for grid in own]), on=keys, how="left")
    trials["n_episodes_shown"] = 1 + trials["n_episodes"]
    trials["first_episode"] = trials["n_episodes_shown"].cumsum() - trials["n_episodes_shown"]
    return {
        "at": encode((both["episode"] + 1) * both["n_rollouts"], 1.0),
        "mu": [encode(both[f"mu_{name}"], 1e-2) for name in names],
        "sigma": [encode(both[f"sigma_{name}"], 1e-2) for name in names],
        "rate": encode(both["rate"], 1e-2),
        "reward": encode(both["reward"], fine_unit(both["reward"], 3)),
    }


def _encode(
    sweep: Sweep, trials: pd.DataFrame, cells: pd.DataFrame, places: dict[str, list[Any]], episodes: dict[str, Any]
) -> dict[str, Any]:
    best = trials[trials["landing"] >= 0].groupby("cell")["best_reward"].idxmax()
    landing = trials.loc[best].set_index("cell")["landing"].reindex(cells.index, fill_value=-1)
    return {
        **{f"{short}s": places[name] for name, short in _PLACES.items()},
        "cells": {
            **{short: [places[name].index(v) for v in cells[name]] for name, short in _PLACES.items()},
            "rate": encode(cells["rate_mean_norm"], 1e-3),
            "lo": encode(cells["rate_low_norm"], 1e-3),
            "hi": encode(cells["rate_high_norm"], 1e-3),
            "best": encode(cells["rate_best_norm"], 1e-3),
            "landing": landing.tolist(),
        },
        "trials": _encode_trials(trials, sweep.policy.shape.names),
        "episodes": episodes,
        "limits": [
            *(_limits(sweep, trials, i) for i in range(sweep.policy.shape.n)),
            [-0.03, 1.05],
            axis_from_zero(trials["best_reward"]),
        ],
    }


def _encode_trials(trials: pd.DataFrame, names: Sequence[str]) -> dict[str, Any]:
    plain = {"cell": "cell", "trial": "trial", "landing": "landing"}
    plain |= {"first_episode": "first_episode", "n_episodes": "n_episodes_shown"}
    scaled = {"rate": (RATE, 1e-3), "clean": (CLEAN_RATE, 1e-3)}
    for i, name in enumerate(names):
        scaled |= {f"mu_{i}": (f"mu_{name}", 1e-2), f"sigma_{i}": (f"sigma_{name}", 1e-2)}
    scaled |= {"rrev": ("trigger_rrev_per_s", 1e-3), "of_y": ("trigger_of_y_radps", 1e-3)}
    scaled |= {"d": ("trigger_d_ceil_m", 1e-4)}
    return {short: trials[name].astype(int).tolist() for short, name in plain.items()} | {
        short: encode(trials[name], unit) for short, (name, unit) in scaled.items()
    }


def _limits(sweep: Sweep, trials: pd.DataFrame, i: int) -> list[float]:
    """Range of a parameter's axis: bounds, and wherever a search ended."""
    bounds, name = [sweep.at(varied).policy.bounds[i] for varied in sweep.variants()], sweep.policy.shape.names[i]
    lo, hi = trials[f"mu_{name}"].min(), trials[f"mu_{name}"].max()
    lo, hi = min([lo, *(each[0] for each in bounds)]), max([hi, *(each[1] for each in bounds)])
    return [float(lo - 0.03 * (hi - lo)), float(hi + 0.03 * (hi - lo))]
