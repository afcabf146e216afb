"""This project's recordings: the flight recorder's table, and run folders of `ivl learn` that keep them.

A run folder knows policy, approach, outcome and return of each recording from its database, by its name.
"""

import json
import sqlite3
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ivl import forms, native, recordings, run
from ivl.errors import ConfigError, IvlError
from ivl.flight import table as border
from ivl.flight.log import Format, Given, Log, with_rules
from ivl.flight.phases import plane, trigger
from ivl.flight.store import Flight, make_flight
from ivl.flight.table import Rule
from ivl.learning.recorder import SCORED, RolloutRows
from ivl.seeds import Purpose, derive
from ivl.store import RunStore


def _vector(stem: str, axes: str, suffix: str, pattern: str) -> list[Rule]:
    return [Rule(r.target, r.variable, needed=True) for r in border.rules(stem, axes, suffix, pattern)]


_RULES = (
    *_vector("p", "xyz", "m", "p_{}_W_m"),
    *_vector("v", "xyz", "mps", "v_{}_W_mps"),
    *_vector("q", "xyzw", "", "q_WB_{}"),
    *_vector("w", "xyz", "radps", "w_{}_B_radps"),
    *_vector("f", "xyz", "mps2", "f_{}_B_mps2"),
    *_vector("thrust", "1234", "N", "thrust{}_N"),
    Rule("d_ceil_m", "d_ceil_m", nothing=0.0),
    Rule("phase", "phase", needed=True),
)
_Rollout = tuple[int, int]
"""Seed and stream; None is a recording whose name tells no rollout, of which nothing is known."""
_NEEDED = ["t_s", *(rule.variable for rule in _RULES)]
_FRAMES = "Those of the flight core, which are those of the schema."
_CLOCK = "Time of the flight core, from the recorder's first row on."


def load(paths: Sequence[Path], given: Given) -> Log:
    """Read recordings and run folders."""
    flights: list[Flight] = []
    files: list[Path] = []
    notes: list[str] = []
    for path in paths:
        if border.is_folder(path):
            found = _recordings(path)
            flights += _run(path, found, given, notes)
            files += [path / "run.sqlite", *found]
        else:
            flights.append(_flight(path, {"label": path.stem}, given))
            files.append(path)
    return Log(flights, files, _FRAMES, _CLOCK, {"rrev_per_s": "not recorded; v_z_mps / d_ceil_m"}, notes)


FORMAT = Format("ivl", "this project's flight recorder (`ivl fly --csv`), or a run folder with recordings", load)


def _flight(path: Path, known: dict[str, Any], given: Given) -> Flight:
    table = border.read_csv(path)
    table.need(_NEEDED, "format ivl")
    t_s = border.clock(table, "t_s", 1.0)
    columns = border.samples(table, with_rules(_RULES, given, table))
    first, columns["triggered"] = trigger(columns["phase"])
    info = {"h_plane_m": plane(columns["p_z_m"] + columns["d_ceil_m"]), "source": path.name, **known}
    if first is not None:
        info |= {"t_trigger_s": t_s[first] - t_s[0], "trigger_age_s": 0.0}
    return make_flight(info, {"t_s": t_s - t_s[0], **columns})


def _recordings(folder: Path) -> list[Path]:
    files = sorted((folder / recordings.FOLDER).glob("*.csv"))
    if not files:
        raise ConfigError(f"{folder}: no {recordings.FOLDER}/*.csv: neither a run folder of a vehicle nor a file")
    return files


def _run(folder: Path, files: list[Path], given: Given, notes: list[str]) -> list[Flight]:
    known = _database(folder)
    battery_V = _journal(folder / recordings.JOURNAL)
    for rollout, info in known.items():
        if rollout in battery_V:
            info["note"] = f"battery {battery_V[rollout]:.2f} V before take-off"
    of = {file: recordings.rollout_of(file) for file in files}
    strange = [file.stem for file, rollout in of.items() if rollout not in known]
    if strange:
        notes.append(f"{folder}: no rollout belongs to recording {', '.join(strange)}: policy and outcome not known.")
    order = {rollout: i for i, rollout in enumerate(known)}
    files = sorted(files, key=lambda file: (order.get(of[file], len(order)), file.stem))
    return [_flight(file, known.get(of[file], {"label": file.stem}), given) for file in files]


def _database(folder: Path) -> dict[_Rollout | None, dict[str, Any]]:
    """What was flown and what came of it, by rollout, in the order flown."""
    result: dict[_Rollout | None, dict[str, Any]] = {}
    try:
        experiment, n_trials = run.read_config(folder)
        with RunStore.open_reading(folder, native.library().outcome_dtype) as store:
            rollouts = [store.rollouts(trial=trial) for trial in range(n_trials or 1)]
        record, _ = experiment.make_world().native_model.config()
    except (IvlError, sqlite3.Error) as error:
        raise ConfigError(f"{folder}: {error}") from error
    site = {"speed_mps": experiment.speed_mps, "angle_deg": experiment.angle_deg}
    site["h_plane_m"] = round(float(record["ivl.h_ceil"][0]), 6)
    for trial, rows in enumerate(rollouts):
        seed = derive(experiment.seed + trial, Purpose.WORLD)
        for i in range(len(rows)):
            label = f"ep{rows.episode[i]}-run{rows.idx[i]}"
            label = f"trial{trial}-{label}" if n_trials else label
            told = _rollout(experiment.policy.shape, rows, i)
            result[seed, int(rows.stream[i])] = {"label": label, **site, **told}
    return result


def _rollout(form: forms.Form, rows: RolloutRows, i: int) -> dict[str, Any]:
    theta = rows.theta[i].tolist()
    info: dict[str, Any] = {"form": form.name, "theta": " ".join(repr(value) for value in theta)}
    if form.name == forms.PAPER:
        info |= dict(zip(("threshold_per_s", "moment_Nmm"), theta, strict=True))
    if rows.status[i] != SCORED:
        return {**info, "usable": False, "note": f"the run says: {rows.status[i]}"}
    outcome = rows.outcomes[i]
    # a room knows no steps of an integrator
    judge = "simulator" if outcome["n_steps"] else "operator"
    info |= {"n_legs": int(outcome["n_legs"]), "body_contact": float(outcome["body_contact"] != 0)}
    return {**info, "reward": float(rows.reward[i]), "judged_by": judge}


def _journal(path: Path) -> dict[_Rollout | None, float]:
    """Battery voltage before each take-off, by rollout; what the journal lacks is not known."""
    result: dict[_Rollout | None, float] = {}
    if not path.is_file():
        return result
    for number, line in enumerate(border.read_text(path).splitlines(), 1):
        try:
            entry = json.loads(line)
            if entry["what"] == "flown" and entry["battery_V"] is not None:
                result[int(entry["seed"]), int(entry["stream"])] = float(entry["battery_V"])
        except (ValueError, TypeError, KeyError, OverflowError, RecursionError) as error:
            raise ConfigError(f"{path}: line {number}: is no entry of a journal") from error
    return result
