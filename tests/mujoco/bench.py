"""How many landings a second MuJoCo makes on one core, stepped from C, and how accurate they are.

    rollouts_per_s_per_core()   the rate at an accuracy like that of the project's simulator
    survey()                    rate and error of every setting in SETTINGS

The landings are those of the paper's vertical experiment around its best policy, from the start to one second after
touch-down. MuJoCo gets the motor commands ready-made: neither flight core nor sensors run in the time that is measured,
which is processor time of one thread, so that a busy machine does not make MuJoCo slow.
"""

import time
from collections.abc import Sequence
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
    """MuJoCo as usual: one step throughout, feet stick at the end of a step, the constraint makes the impulse."""
    return Steps(integrator, step_s, step_s, step_s, 0.0, locate=False, burst=False)


def _graded(flight_s: float, touch_s: float, swing_s: float) -> Steps:
    """Runge-Kutta with short steps after each touch."""
    return Steps("RK4", flight_s, touch_s, swing_s, touch_time_s=0.01)


GRADED = {
    "RK4 2 / 0.5 / 2 ms": _graded(2.0e-3, 5.0e-4, 2.0e-3),
    "RK4 2 / 0.5 / 1 ms": _graded(2.0e-3, 5.0e-4, 1.0e-3),
    "RK4 2 / 2 / 2 ms": _graded(2.0e-3, 2.0e-3, 2.0e-3),
    "RK4 1 / 0.25 / 1 ms": _graded(1.0e-3, 2.5e-4, 1.0e-3),
    "RK4 1 / 0.25 / 0.5 ms": _graded(1.0e-3, 2.5e-4, 5.0e-4),
    "RK4 0.5 / 0.1 / 0.25 ms": _graded(5.0e-4, 1.0e-4, 2.5e-4),
}
FIXED = {
    f"{integrator} {1e3 * step_s:g} ms": _fixed(integrator, step_s)
    for integrator in ("Euler", "implicitfast", "discrete", "RK4")
    for step_s in (2.0e-3, 1.0e-3, 5.0e-4, 2.0e-4, 1.0e-4)
}
LOCATED = {
    f"{integrator} {1e3 * step_s:g} ms, located": Steps(integrator, step_s, step_s, step_s, 0.0)
    for integrator in ("Euler", "discrete")
    for step_s in (2.0e-3, 1.0e-3, 2.0e-4)
}
SETTINGS = GRADED | LOCATED | FIXED
# The cheapest settings with an error no larger than that of the project's simulator: located touches need Runge-Kutta.
COMPARABLE = "RK4 2 / 0.5 / 2 ms"
# The fastest with almost every outcome right (63 of 64), though its motion is off by millimetres.
COARSE = "Euler 2 ms, located"


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


def survey(n: int = 16, names: Sequence[str] = tuple(SETTINGS)) -> list[Row]:
    """Speed and error of every setting, and the error of the project's simulator; reference: MuJoCo in small steps."""
    world, traces = _landings(n)
    engine = Engine(world)
    reference = [engine.fly(t, REFERENCE) for t in traces]
    own = [_as_flight(t) for t in traces]
    rows = [_row("ivl", np.nan, own, reference)]
    fast = _fast_engine(world)
    for name in names:
        steps = SETTINGS[name]
        flights = [fast.fly(t, steps) for t in traces]
        rows.append(_row(name, _rate(fast, traces[::4], steps), flights, reference))
    return rows


def _as_flight(trace: Trace) -> Flight:
    out, rows = trace.outcome, trace.rows
    return Flight(
        n_legs=int(out.n_legs),
        leg_order=tuple(out.leg_order),
        body_contact=bool(out.body_contact),
        base_contact=bool(out.base_contact),
        t_impact_s=out.t_impact_s,
        theta_impact_deg=out.theta_impact_deg,
        t_plate_s=np.nan,
        n_steps=int(out.n_steps),
        t_s=rows.t_s,
        p_m=rows.p_WB_m,
        q_xyzw=rows.q_WB,
        v_mps=rows.v_WB_mps,
        w_radps=rows.w_B_radps,
        feet_m=rows.foot_W_m.reshape(-1, 4, 3),
    )


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
            began = time.thread_time()
            run(engine, given, result, None)
            spent_s += time.thread_time() - began
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
    print(
        f"{'setting':24s} {'1/s':>7s} {'steps':>7s} {'right':>6s} {'dp median':>10s} {'dp max':>10s} {'da median':>10s}"
    )
    for r in survey():
        errors = f"{r.dp_median_m:8.1e} m {r.dp_max_m:8.1e} m {r.da_median_deg:6.3f} deg"
        print(f"{r.name:24s} {r.rollouts_per_s:7.1f} {r.steps:7.0f} {r.right:6.2f} {errors}")
