"""The one-class SVM with a network of the authors' later paper, beside a form of the flight core, judged alike.

The SVM knows where landings lie in (RREV, OF_y, d) and flips when an approach enters; the network says the moment. It
is no form of the flight core, so both are judged on recorded approaches: a policy's first tick that says flip is looked
up in the recorded cues, and the flip is flown by the core from the recorded state of that tick. What the core itself
does with the form on the same approaches tells how good this way of judging is.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from sklearn.neural_network import MLPRegressor
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.svm import OneClassSVM

from ivl import native
from ivl.outcome import clean, four_leg
from ivl.policy.flying import Place, fly
from ivl.policy.flying import score as score_of
from ivl.policy.region import BOX, Approaches, Series
from ivl.policy.shape import General
from ivl.policy.start import moment_most_Nmm
from ivl.seeds import Purpose
from ivl.world import State

FloatArray = npt.NDArray[np.float64]
Decide = Callable[[FloatArray], tuple[npt.NDArray[np.bool_], FloatArray]]
"""Of cues (n, 3), RREV, OF_y and d: whether to flip, and the moment in N mm."""

N_TRAINED, N_TUNED = 125, 150
_NEVER_PER_S = 20.0
_OUTLIERS, _GAMMAS = (0.02, 0.1, 0.3, 0.5), (0.3, 1.0, 3.0, 10.0)


@dataclass(frozen=True)
class Recorded:
    """Approaches that nothing ends before the ceiling, tick by tick.

    Attributes:
        approaches: What was flown.
        rows: Rows of the trace in which the approach was flown and the ceiling came closer, one after the other.
        flight: Index of the approach of each row.
        cues: RREV (1/s), OF_y (rad/s) and d (m) of each row, as the core sensed them.
    """

    approaches: Approaches
    rows: npt.NDArray[np.void]
    flight: npt.NDArray[np.intp]
    cues: FloatArray


def record(place: Place, approaches: Approaches) -> Recorded:
    """Fly approaches with a threshold that is hardly ever reached."""
    names = [place.world.phase_name(i) for i in range(9)]
    parts = []
    for i in range(len(approaches)):
        trace = place.world.trace(
            float(approaches.speed_mps[i]), float(approaches.angle_deg[i]), _NEVER_PER_S, 5.0,
            start=place.task.start, seed=approaches.seed, stream=int(approaches.stream[i]), period_s=0.002,
        )  # fmt: skip
        flown = (trace.rows["phase"] == names.index("approach")) & (trace.rows["rrev_per_s"] > 0)
        parts.append(np.asarray(trace.rows)[flown])
    rows = np.concatenate(parts)
    flight = np.repeat(np.arange(len(parts)), [len(part) for part in parts])
    cues = np.stack([rows[name] for name in ("rrev_per_s", "of_y_radps", "d_sensed_m")], axis=-1).astype(np.float64)
    return Recorded(approaches, rows, flight, cues)


def judge(place: Place, recorded: Recorded, decide: Decide) -> dict[str, float]:
    """Landed, clean, and the share of approaches that never trigger, over all approaches."""
    n = len(recorded.approaches)
    flips, moment_Nmm = decide(recorded.cues)
    flight, first = np.unique(recorded.flight[flips], return_index=True)
    at = np.flatnonzero(flips)[first]
    if not at.size:
        return {"landed": 0.0, "clean": 0.0, "score": 0.0, "silent": 1.0}
    rows = recorded.rows[at]
    per_thrust = place.world.params.values["rotor.thrust_constant"]
    state = State(
        rows["p_WB_m"], rows["v_WB_mps"], rows["q_WB"] / np.linalg.norm(rows["q_WB"], axis=-1, keepdims=True),
        rows["w_B_radps"], np.sqrt(np.maximum(rows["thrust_N"], 0.0) / per_thrust),
    )  # fmt: skip
    speed, angle = (np.asarray(of)[flight] for of in (recorded.approaches.speed_mps, recorded.approaches.angle_deg))
    flown = place.world.rollouts(
        speed, angle, 0.0, moment_Nmm[at], start="state", state=state, seed=recorded.approaches.seed,
        stream=recorded.approaches.stream[flight],
    )  # fmt: skip
    return {
        "landed": float(four_leg(flown).sum() / n),
        "clean": float(clean(flown).sum() / n),
        "score": float(score_of(flown).sum() / n),
        "silent": 1.0 - flight.size / n,
    }


def by_form(name: str, theta: FloatArray) -> Decide:
    """What the flight core's form decides."""
    general = General(name)
    numbers = general.form.to_si(general.always_go(theta))

    def decide(cues: FloatArray) -> tuple[npt.NDArray[np.bool_], FloatArray]:
        seen = np.ascontiguousarray(cues[:, [2, 0, 1]])
        actions = native.library().decide(general.form.number, numbers, seen)
        return actions[:, 0] > 0.5, 1e3 * actions[:, 2]

    return decide


def compare(place: Place, name: str, theta: FloatArray, seed: int, n_judged: int) -> dict[str, Any]:
    """The SVM and a form over fresh approaches of the box.

    Args:
        place: Where.
        name: The form.
        theta: Its numbers.
        seed: Of the judgement; training has the seed 0.
        n_judged: Approaches.
    """
    cues, moments, n_flights = _landings(place)
    network = make_pipeline(
        StandardScaler(),
        MLPRegressor(hidden_layer_sizes=(16, 16), solver="lbfgs", alpha=1e-3, max_iter=2000, random_state=0),
    )
    network.fit(cues, moments)
    tuned_on = record(place, Series([BOX], 0, Purpose.SELECT).next(N_TUNED))
    found = []
    for outliers in _OUTLIERS:
        for gamma in _GAMMAS:
            inside = make_pipeline(StandardScaler(), OneClassSVM(nu=outliers, gamma=gamma)).fit(cues)
            found.append((judge(place, tuned_on, _by_svm(inside, network))["score"], outliers, gamma, inside))
    _, outliers, gamma, best = max(found, key=lambda one: one[0])
    approaches = Series([BOX], seed, Purpose.ASSESS).next(n_judged)
    recorded = record(place, approaches)
    (core,) = fly([place], name, General(name).always_go(theta), approaches)
    return {
        "svm": judge(place, recorded, _by_svm(best, network)),
        "form": judge(place, recorded, by_form(name, theta)),
        "core": {"landed": float(four_leg(core).mean()), "clean": float(clean(core).mean())},
        "name": name,
        "flights": n_flights + len(found) * N_TUNED,
        "landings": len(cues),
        "outliers": outliers,
        "gamma": gamma,
        "judged_on": n_judged,
    }


def _landings(place: Place) -> tuple[FloatArray, FloatArray, int]:
    """Cues at the trigger and moment of the clean landings of a map."""
    approaches = Series([BOX], 0, Purpose.SEARCH).next(N_TRAINED)
    moments = moment_most_Nmm([place]) * np.array([0.7, 0.8, 0.9, 1.0])
    grid = np.stack(np.broadcast_arrays(1.0 / np.linspace(0.12, 0.4, 20), moments[:, None]), axis=-1)
    (flown,) = fly([place], "constant", grid, approaches)
    good = clean(flown) & (flown["triggered"] == 1)
    cues = np.stack([flown[name][good] for name in ("rrev_trigger", "of_y_trigger", "d_trigger_m")], axis=-1)
    used = np.broadcast_to(grid[..., None, 1], flown.shape)[good]
    return cues.astype(np.float64), used.astype(np.float64), int(flown.size)


def _by_svm(inside: Any, network: Any) -> Decide:
    def decide(cues: FloatArray) -> tuple[npt.NDArray[np.bool_], FloatArray]:
        return inside.decision_function(cues) > 0, np.clip(network.predict(cues), 0.0, 20.0)

    return decide
