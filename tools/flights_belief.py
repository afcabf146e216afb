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

EXPERIMENT = "experiments/transfer.yaml"
MOMENT_NMM, NEAR_NMM = 6.04, 0.3
THRESHOLDS_PER_S = np.arange(2.5, 6.01, 0.05)
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
        path.write_text(identify.vehicle_text(vehicle, {name: before[name] for name in sigmas}, sigmas), encoding="utf-8")
        files = World(vehicle, chosen.gear, chosen.gear_set).params.values
        # what an override sets is not drawn
        known = {name: value for name, value in before.items() if name not in sigmas and value != files[name]}
        home = World(str(path), chosen.gear, chosen.gear_set, None, **known)
        spreads = {name: spread for name, spread in chosen.family.parameters.items() if name not in sigmas}
        kin = family.of(home, chosen.family.model_copy(update={"parameters": spreads}))
        return Simulator.of(kin, chosen.flight)


def learn(simulated: Simulator, flights: list[Told], seed: int = 0) -> dict[str, Any]:
    """What the default learner believes after each flight.

    Returns:
        `rates`: expected landing rate over THRESHOLDS_PER_S at MOMENT_NMM before any flight and after each, shape
        (n + 1, ...); `recommended`, `expected`, `surprise` after each; and the flights.
    """
    bounds = simulated.flight.bounds
    chosen = experiment.load(EXPERIMENT)
    start = [(p.mu0, p.sigma0) for p in chosen.policy.parameters]
    learner = make_learner(
        "ephe_belief", [mu for mu, _ in start], [sigma for _, sigma in start], bounds=bounds, n_rollouts=1, seed=seed
    )
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
