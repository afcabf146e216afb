"""Recorded flights as a belief over vehicles would have learned from them, in the order in which they were flown."""

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ivl import World, experiment, family
from ivl.belief import recording
from ivl.belief.simulator import Simulator
from ivl.errors import ConfigError
from ivl.flight import identify, motion, store
from ivl.learners import make_learner
from ivl.learners.base import LANDED, RECORDING
from ivl.plots import style

EXPERIMENT = "experiments/transfer.yaml"
MOMENT_NMM, NEAR_NMM = 6.04, 0.3
THRESHOLDS_PER_S = np.arange(2.5, 6.01, 0.05)
GUARDS: dict[str, dict[str, float]] = {
    "all of them": {},
    "the motion of every flight counts in full": {"n_full": 1000.0},
    "no error of any model": {"discrepancy": 0.0},
    "every outcome is sure": {"lapse": 1e-6},
    "no local correction": {"local": 1e-3},
    "none of them": {"n_full": 1000.0, "discrepancy": 0.0, "lapse": 1e-6, "local": 1e-3},
}
"""Options of the learner that hold a belief when no member is the vehicle that flies, and what it is without them."""
LANDED_LEGS, HALF, HOVER_BEFORE_S = 3, 0.5, 1.0


@dataclass(frozen=True)
class Told:
    """One flight: policy (1/s, N mm), what it recorded, whether it landed."""

    label: str
    theta: tuple[float, float]
    features: np.ndarray
    landed: bool


def told(flights: store.Flights) -> list[Told]:
    """The flights that a learner can be told, in the order flown."""
    found = []
    for flight in flights.usable():
        policy = (float(flight.info["threshold_per_s"]), float(flight.info["moment_Nmm"]))
        legs = float(flight.info["n_legs"])
        if not np.isfinite([*policy, legs]).all():
            continue
        try:
            features = recording.of_flip(motion.flip(flight), _hover_V(flight), _overshoot(flight, policy[0]))
        except ConfigError:  # it did not trigger: only its outcome is known
            features = np.full(recording.N, np.nan)
        found.append(Told(flight.label, policy, features, legs >= LANDED_LEGS))
    return found


def _hover_V(flight: store.Flight) -> float:
    """Voltage before the approach; NaN if the log does not tell."""
    trigger = float(flight.info["t_trigger_s"])
    volts = flight["battery_V"][flight["t_s"] < trigger - HOVER_BEFORE_S]
    return float(np.nanmedian(volts)) if np.isfinite(volts).any() else float("nan")


def _overshoot(flight: store.Flight, threshold_per_s: float) -> float:
    """Share by which the logged RREV was above the threshold in the first sample after the trigger."""
    trigger = float(flight.info["t_trigger_s"])
    if not np.isfinite(trigger) or not flight.has("rrev_per_s"):
        return float("nan")
    return float(flight["rrev_per_s"][np.argmax(flight["t_s"] >= trigger - 1e-9)]) / threshold_per_s - 1.0


def simulator(vehicle: str, before: dict[str, float], sigmas: dict[str, float]) -> Simulator:
    """The family of the vehicle file as it was, with the spreads of the experiment where it says no others."""
    chosen = experiment.load(EXPERIMENT)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"{vehicle}.yaml"
        path.write_text(
            identify.vehicle_text(vehicle, {name: before[name] for name in sigmas}, sigmas), encoding="utf-8"
        )
        files = World(vehicle, chosen.gear, chosen.gear_set).params.values
        # what an override sets is not drawn
        known = {name: value for name, value in before.items() if name not in sigmas and value != files[name]}
        home = World(str(path), chosen.gear, chosen.gear_set, None, **known)
        spreads = {name: spread for name, spread in chosen.family.parameters.items() if name not in sigmas}
        kin = family.of(home, chosen.family.model_copy(update={"parameters": spreads}))
        return Simulator.of(kin, chosen.flight)


def learn(simulated: Simulator, flights: list[Told], seed: int = 0, **options: float) -> dict[str, Any]:
    """What `ephe_belief` believes after each flight; other options than the default ones are for comparison.

    Returns:
        `rates`: expected landing rate over THRESHOLDS_PER_S at MOMENT_NMM before any flight and after each, shape
        (n + 1, ...); `recommended`, `expected`, `surprise` after each; and the flights.
    """
    bounds = simulated.flight.bounds
    chosen = experiment.load(EXPERIMENT)
    start = [(p.mu0, p.sigma0) for p in chosen.policy.parameters]
    learner = make_learner(
        "ephe_belief", [mu for mu, _ in start], [sigma for _, sigma in start], bounds=bounds, n_rollouts=1, seed=seed,
        **options,
    )  # fmt: skip
    learner.begin(simulated)
    grid = np.stack([THRESHOLDS_PER_S, np.full(len(THRESHOLDS_PER_S), MOMENT_NMM)], axis=1)
    rates, rows = [learner.expected_rates(grid)], []
    for flight in flights:
        theta = np.array([flight.theta])
        expected = float(learner.expected_rates(theta)[0])
        meta = {LANDED: np.array([flight.landed]), RECORDING: flight.features[None]}
        learner.tell(theta, np.array([float(flight.landed)]), meta)
        rates.append(learner.expected_rates(grid))
        rows.append(
            {
                "label": flight.label,
                "threshold_per_s": flight.theta[0],
                "moment_Nmm": flight.theta[1],
                "landed": bool(flight.landed),
                "expected": expected,
                "recommended": np.asarray(learner.result.recommended).tolist(),
                "surprise": learner.surprise,
            }
        )
    return {"rates": np.round(rates, 3).tolist(), "flights": rows}


def summary(result: dict[str, Any]) -> dict[str, Any]:
    """After which flight the window that is believed in contains flown landings near its moment, and from when on.

    `first` and `stays` count flights; None: never. `missed`: flights from `first` on after which it does not.
    """
    near = [row for row in result["flights"] if row["landed"] and abs(row["moment_Nmm"] - MOMENT_NMM) <= NEAR_NMM]
    low, high = min(row["threshold_per_s"] for row in near), max(row["threshold_per_s"] for row in near)
    inside = (low - 1e-9 <= THRESHOLDS_PER_S) & (high + 1e-9 >= THRESHOLDS_PER_S)
    holds = [bool((np.array(rates)[inside] >= HALF).any()) for rates in result["rates"]]
    first = holds.index(True) if True in holds else None
    stays = (
        None
        if not holds[-1]
        else len(holds) - 1 - next((i for i, h in enumerate(holds[::-1]) if not h), len(holds)) + 1
    )
    window = THRESHOLDS_PER_S[np.array(result["rates"][-1]) >= HALF]
    return {
        "flown_per_s": [low, high],
        "first": first,
        "stays": stays,
        "missed": [] if first is None else [i for i in range(first, len(holds)) if not holds[i]],
        "window_per_s": [float(window.min()), float(window.max())] if len(window) else None,
        "best_per_s": float(THRESHOLDS_PER_S[int(np.argmax(result["rates"][-1]))]),
        "rate": float(np.max(result["rates"][-1])),
        "rate_in_flown": float(np.array(result["rates"][-1])[inside].mean()),
        "least_surprise": min(row["surprise"] for row in result["flights"]),
    }


@style.drawing
def draw(result: dict[str, Any], path: Path) -> None:
    """Expected landing rate over the threshold, before any flight and after each, with what was flown."""
    figure = style.new_figure(7.0, 3.6)
    axes = figure.add_subplot()
    rates = np.array(result["rates"])
    shown = axes.imshow(
        rates.T, origin="lower", aspect="auto", cmap="Blues", vmin=0.0, vmax=1.0, interpolation="nearest",
        extent=(-0.5, len(rates) - 0.5, THRESHOLDS_PER_S[0] - 0.025, THRESHOLDS_PER_S[-1] + 0.025),
    )  # fmt: skip
    for landed, marker, face, label in ((True, "o", style.GREEN, "landed"), (False, "x", style.VERMILION, "failed")):
        at = [
            (number, row["threshold_per_s"])
            for number, row in enumerate(result["flights"], start=1)
            if row["landed"] == landed and abs(row["moment_Nmm"] - MOMENT_NMM) <= NEAR_NMM
        ]
        axes.scatter(*np.array(at).T, marker=marker, s=22, color=face, label=f"real flight that {label}")
    axes.set_xlabel("real flights that the learner was told")
    axes.set_ylabel(f"RREV_c (1/s) at {MOMENT_NMM:g} N mm")
    axes.legend(loc="upper right", fontsize=style.SMALL)
    figure.colorbar(shown, ax=axes, label="expected landing rate")
    style.save(figure, [path])
