"""How many landings a second MuJoCo makes on one core, stepped from C, and how accurate they are.

    rollouts_per_s_per_core()   the rate at an accuracy like that of the project's simulator
    survey()                    rate and error of every setting in SETTINGS

The landings are those of the paper's vertical experiment around its best policy, from the start to one second after touch-down. MuJoCo gets
the motor commands ready-made: neither flight core nor sensors run in the time that is measured.
"""

import time
from dataclasses import dataclass

import numpy as np
from agreement import rotation_deg
from engine import Array, Engine, Flight, Output, Steps, run

import ivl
from ivl.world import Trace

REFERENCE = Steps(flight_s=2.0e-4, touch_s=2.5e-5, swing_s=1.0e-4)
AFTER_S = 0.05  # instant after touch-down at which the error is measured
_REPEATS = 3


def _fixed(integrator: str, step_s: float) -> Steps:
    """One step throughout; feet stick at the end of a step, the constraint makes the impulse: the usual way to run MuJoCo."""
    return Steps(integrator, step_s, step_s, step_s, 0.0, locate=False, burst=False)


def _graded(flight_s: float, touch_s: float, swing_s: float) -> Steps:
    """Runge-Kutta with short steps after each touch."""
    return Steps("RK4", flight_s, touch_s, swing_s, touch_time_s=0.01)


GRADED = {
    "RK4 2 / 0.5 / 2 ms": _graded(2.0e-3, 5.0e-4, 2.0e-3),
    "RK4 2 / 0.5 / 1 ms": _graded(2.0e-3, 5.0e-4, 1.0e-3),
    "RK4 1 / 0.25 / 1 ms": _graded(1.0e-3, 2.5e-4, 1.0e-3),
    "RK4 1 / 0.25 / 0.5 ms": _graded(1.0e-3, 2.5e-4, 5.0e-4),
    "RK4 0.5 / 0.1 / 0.25 ms": _graded(5.0e-4, 1.0e-4, 2.5e-4),
}
FIXED = {
    f"{integrator} {1e3 * step_s:g} ms": _fixed(integrator, step_s)
    for integrator in ("Euler", "implicitfast", "RK4")
    for step_s in (2.0e-3, 1.0e-3, 5.0e-4, 2.0e-4, 1.0e-4)
}
SETTINGS = GRADED | FIXED
# The cheapest setting whose error is like that of the project's simulator: `survey()` shows it.
COMPARABLE = "RK4 2 / 0.5 / 2 ms"
# The cheapest setting that gets every outcome right.
LARGEST = "Euler 2 ms"


@dataclass(frozen=True)
class Row:
    """One setting's speed and error.

    Attributes:
        name: Key in SETTINGS, or "ivl" for the project's simulator.
        rollouts_per_s: On one core; NaN for "ivl", which `ivl bench` measures.
        steps: Mean number of integration steps a landing.
        right: Share of landings with the reference's number of stuck feet.
        dp_median_m: Median distance of the body origin from the reference, 50 ms after touch-down.
        dp_max_m: Largest such distance.
        da_median_deg: Median angle between the attitudes then.
    """

    name: str
    rollouts_per_s: float
    steps: float
    right: float
    dp_median_m: float
    dp_max_m: float
    da_median_deg: float


def rollouts_per_s_per_core(setting: str = COMPARABLE, n: int = 24) -> float:
    """Landings a second of MuJoCo on one core, best of three passes over `n` landings.

    Args:
        setting: A key of SETTINGS.
        n: Landings.
    """
    world, traces = _landings(n)
    return _rate(_fast_engine(world), traces, SETTINGS[setting])


def survey(n: int = 16) -> list[Row]:
    """Speed and error of every setting, and the error of the project's simulator; MuJoCo in small steps is the reference."""
    world, traces = _landings(n)
    engine = Engine(world)
    reference = [engine.fly(t, REFERENCE) for t in traces]
    own = [Flight(
        int(t.outcome.n_legs), tuple(t.outcome.leg_order), False, False, t.outcome.t_impact_s, t.outcome.theta_impact_deg, np.nan,
        int(t.outcome.n_steps), t.rows.t_s, t.rows.p_WB_m, t.rows.q_WB, t.rows.v_WB_mps, t.rows.w_B_radps, np.empty(0),
    ) for t in traces]  # fmt: skip
    rows = [_row("ivl", np.nan, own, reference)]
    fast = _fast_engine(world)
    for name, steps in SETTINGS.items():
        flights = [fast.fly(t, steps) for t in traces]
        rows.append(_row(name, _rate(fast, traces[::4], steps), flights, reference))
    return rows


def _landings(n: int) -> tuple[ivl.World, list[Trace]]:
    """Landings around the best policy of the paper's vertical experiment, recorded at each tick."""
    world = ivl.World("habas2021", "wide_short", "as_simulated")
    rng = np.random.default_rng(0)
    rrev_c_per_s, moment_y_Nmm = rng.uniform(4.5, 5.1, n), rng.uniform(7.0, 9.0, n)
    return world, [world.trace(2.5, 90.0, rrev_c_per_s[i], moment_y_Nmm[i], stream=i) for i in range(n)]


def _fast_engine(world: ivl.World) -> Engine:
    """Solver tolerance as MuJoCo ships it."""
    engine = Engine(world)
    engine.model.opt.tolerance = 1.0e-8
    return engine


def _rate(engine: Engine, traces: list[Trace], steps: Steps) -> float:
    best_s = np.inf
    for _ in range(_REPEATS):
        spent_s = 0.0
        for trace in traces:
            given, commands = engine.prepare(trace, steps)
            assert commands.size
            result = Output()
            engine.reset(trace)
            began = time.perf_counter()
            run(engine, given, result, None)
            spent_s += time.perf_counter() - began
        best_s = min(best_s, spent_s)
    return len(traces) / best_s


def _row(name: str, rate: float, flights: list[Flight], reference: list[Flight]) -> Row:
    pairs = list(zip(flights, reference, strict=True))
    errors = np.array([_error(f, r) for f, r in pairs])
    return Row(
        name=name,
        rollouts_per_s=rate,
        steps=float(np.mean([f.n_steps for f in flights])),
        right=float(np.mean([f.n_legs == r.n_legs for f, r in pairs])),
        dp_median_m=float(np.median(errors[:, 0])),
        dp_max_m=float(errors[:, 0].max()),
        da_median_deg=float(np.median(errors[:, 1])),
    )


def _error(flight: Flight, reference: Flight) -> tuple[float, float]:
    """Distance and angle from the reference at the first row AFTER_S after its touch-down."""
    row = int(np.searchsorted(reference.t_s, reference.t_impact_s + AFTER_S))
    at: Array = flight.p_m[row] - reference.p_m[row]
    return float(np.linalg.norm(at)), float(rotation_deg(flight.q_xyzw[row], reference.q_xyzw[row]))


if __name__ == "__main__":
    print(f"{'setting':26s} {'1/s':>7s} {'steps':>7s} {'right':>6s} {'dp median m':>12s} {'dp max m':>10s} {'da median deg':>14s}")
    for r in survey():
        print(
            f"{r.name:26s} {r.rollouts_per_s:7.1f} {r.steps:7.0f} {r.right:6.2f} {r.dp_median_m:12.2e} {r.dp_max_m:10.2e} {r.da_median_deg:14.4f}"
        )
