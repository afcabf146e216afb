"""The project's simulator against MuJoCo: first where the answer must be the same, then over random landings.

Both engines converge to one solution. What is left at the simulator's normal steps is its own step error, second order,
so that the tight tests run it with steps ten times finer (`step.scale`), and the random landings run it as it is used.
docs/VALIDATION.md has the figures.
"""

from functools import cache
from typing import Any

import agreement
import mjcf
import numpy as np
import pytest
from engine import Engine, Flight, Steps

import ivl
from ivl.world import Trace

FINE = {"step.scale": 0.1}
N_TOUCHING, N_MISSES, N_FINE, N_NATIVE, N_TILTED = 300, 36, 64, 64, 24


def _fly(world: ivl.World, **arguments: Any) -> tuple[Trace, Flight]:
    trace = world.trace(**arguments)
    return trace, Engine(world, "same_law").fly(trace, Steps().scaled(0.5))


def _feet(trace: Trace) -> np.ndarray[Any, Any]:
    return trace.rows.foot_W_m.reshape(-1, 4, 3)


def _distance(a: np.ndarray[Any, Any], b: np.ndarray[Any, Any]) -> float:
    return float(np.linalg.norm(a - b, axis=-1).max())


# ---- one case at a time


def test_mass_and_inertia_agree_when_built_twice() -> None:
    world = ivl.World("habas2021", "wide_long", "table1")
    engine = Engine(world)
    assert engine.model.body_subtreemass[1] == pytest.approx(world.derived()["mass_total_kg"], rel=1e-12)
    p = world.params.values
    rod, foot, length = p["leg.mass"], p["leg.foot_mass"], p["leg.length"]
    leg = engine.model.body("leg1")
    com = float(np.linalg.norm(leg.ipos))
    about_hip = leg.inertia[0] + leg.mass[0] * com**2
    assert about_hip == pytest.approx((rod / 3 + foot) * length**2, rel=1e-9)


def test_flight_agrees_when_body_tumbles_and_legs_ring() -> None:
    # uneven thrusts and reaction torque make the flip a tumble about three axes, soft hips let the legs swing
    overrides = {"rotor.thrust_scatter": 0.4, "aero.yaw_torque": 1.0, "leg.stiffness": 0.01}
    world = ivl.World("habas2021", "wide_long", "table1", **overrides, **FINE)
    trace, flight = _fly(
        world,
        speed_mps=4.0,
        angle_deg=90.0,
        rrev_c_per_s=0.0,
        moment_y_Nmm=8.0,
        start="at_trigger",
        d_ceil_m=1.2,
        seed=7,
    )
    flown = slice(0, 151)  # 0.3 s
    assert not trace.outcome.t_impact_s < 0.3
    assert np.abs(trace.rows.w_B_radps[flown]).max(axis=0).min() > 1.0, "the case must turn about all axes"
    assert _leg_swing_deg(world, trace, 151) > 3.0, "the case must ring"
    assert _distance(flight.p_m[flown], trace.rows.p_WB_m[flown]) < 1e-6
    assert _distance(flight.feet_m[flown], _feet(trace)[flown]) < 1e-5
    assert agreement.rotation_deg(flight.q_xyzw[flown], trace.rows.q_WB[flown]).max() < 2e-3


def _leg_swing_deg(world: ivl.World, trace: Trace, n_rows: int) -> float:
    """Largest angle between a leg and its rest direction."""
    p = world.params.values
    x, y, z, w = trace.rows.q_WB[:n_rows].T
    up = np.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], axis=-1)
    worst = 0.0
    for leg in range(4):
        sx, sy, _ = mjcf.SIGNS[leg]
        hip = np.array([sx * p["leg.hip_xy"], sy * p["leg.hip_xy"], p["leg.hip_z"]])
        height = trace.rows.p_WB_m[:n_rows, 2] + up @ (hip + p["leg.length"] * mjcf.rest_direction(p, leg))
        worst = max(worst, float(np.abs(_feet(trace)[:n_rows, leg, 2] - height).max()) / p["leg.length"])
    return float(np.degrees(worst))


@cache
def _two_feet() -> tuple[Trace, Flight]:
    """Two feet stick in the same instant, the body swings on them for three seconds and touches nothing else."""
    world = ivl.World("habas2021", "wide_long", "table1", **{"end.contact_time": 3.0}, **FINE)
    return _fly(world, speed_mps=3.0, angle_deg=60.0, rrev_c_per_s=4.2, moment_y_Nmm=8.0)


def test_touch_down_agrees_when_two_feet_stick_together() -> None:
    trace, flight = _two_feet()
    row = int(trace.outcome.t_impact_s / 0.002) + 1  # within 2 ms of the impulse
    assert tuple(trace.outcome.leg_order) == flight.leg_order == (2, 3, 0, 0)
    assert flight.t_impact_s == pytest.approx(trace.outcome.t_impact_s, abs=1e-6)
    assert flight.theta_impact_deg == pytest.approx(trace.outcome.theta_impact_deg, abs=2e-3)
    assert np.abs(trace.rows.v_WB_mps[row] - trace.rows.v_WB_mps[row - 2]).max() > 0.1, "the impulse must be felt"
    assert _distance(flight.v_mps[row], trace.rows.v_WB_mps[row]) < 1e-4
    assert _distance(flight.w_radps[row], trace.rows.w_B_radps[row]) < 1e-3


def test_pendulum_agrees_when_hanging_from_two_feet() -> None:
    trace, flight = _two_feet()
    hanging = trace.rows.t_s > trace.outcome.t_impact_s
    swing_m = float(np.ptp(trace.rows.p_WB_m[hanging], axis=0).max())
    assert trace.outcome.n_legs == flight.n_legs == 2
    assert not trace.outcome.body_contact
    assert not trace.outcome.base_contact
    assert swing_m > 0.1
    assert _distance(flight.p_m[hanging], trace.rows.p_WB_m[hanging]) < 5e-6
    assert _distance(flight.feet_m[hanging], _feet(trace)[hanging]) < 2e-5


def test_steps_of_mujoco_are_fine_enough_when_halved() -> None:
    world = ivl.World("habas2021", "wide_short", "as_simulated")
    trace = world.trace(2.5, 90.0, 4.8, 8.0)
    engine = Engine(world)
    flights = [engine.fly(trace, Steps().scaled(f)) for f in (1.0, 0.5, 0.25)]
    coarse, fine = (_distance(f.p_m, flights[2].p_m) for f in flights[:2])
    assert flights[0].n_legs == flights[2].n_legs == 4
    assert coarse < 2e-6
    assert fine < coarse


def test_model_is_refused_when_mujoco_lacks_a_parameter() -> None:
    world = ivl.World("habas2021", "wide_short", **{"leg.stick_delay": 0.01})
    with pytest.raises(ValueError, match=r"leg\.stick_delay"):
        Engine(world)


# ---- random landings


@cache
def _landings() -> tuple[list[agreement.Landing], list[agreement.Landing]]:
    touching, misses = agreement.split(agreement.draw(720, seed=20))
    assert len(touching) >= N_TOUCHING
    assert len(misses) >= N_MISSES
    return touching[:N_TOUCHING], misses[:N_MISSES]


@cache
def _as_used() -> np.recarray[Any, Any]:
    return agreement.compare(_landings()[0], "same_law")


def test_random_landings_stick_as_many_feet_when_outcome_is_decided() -> None:
    touching = _landings()[0]
    r = _as_used()
    differ = np.flatnonzero(r.n_legs != r.n_legs_mj)
    assert len(set(r.n_legs)) >= 3, "the sample must hold landings, failures and partial ones"
    assert len(differ) <= 0.01 * len(r)
    for i in differ:
        # an outcome may differ only where the simulator itself changes its mind under changes of 0.1 %
        assert agreement.undecided(touching[i]) > 0.0, touching[i]


def test_random_landings_touch_at_same_time_and_angle() -> None:
    r = _as_used()
    assert r.hit_mj.all()
    assert np.abs(r.dt_impact_s).max() < 1e-4
    assert np.abs(r.dtheta_impact_deg).max() < 0.2
    assert np.median(np.abs(r.dt_impact_s)) < 5e-6
    assert (r.plate == r.plate_mj).mean() >= 0.99


def test_random_landings_move_alike_after_impact() -> None:
    r = _as_used()
    free = ~r.plate & ~r.plate_mj
    assert free.sum() >= 30
    assert r.dp_m[free].max() < 1.5e-3
    assert r.da_deg[free].max() < 0.6
    assert np.median(r.dp_m[free]) < 1e-4
    # where plates strike, the step of 0.5 ms in their contact shows
    assert (np.median(r.dp_m[~free], axis=0) < [6e-4, 1.2e-3, 2e-3]).all()
    assert (np.percentile(r.dp_m[~free], 98, axis=0) < [2e-3, 5e-3, 1.2e-2]).all()


def test_random_landings_agree_closely_when_steps_are_fine() -> None:
    touching = _landings()[0][:N_FINE]
    r = agreement.compare(touching, "same_law", **FINE)
    differ = np.flatnonzero(r.n_legs != r.n_legs_mj)
    assert all(agreement.undecided(touching[i]) > 0.0 for i in differ)
    assert len(differ) <= 1
    assert np.abs(r.dt_impact_s).max() < 5e-6
    assert np.abs(r.dtheta_impact_deg).max() < 3e-3
    assert (np.percentile(r.dp_m, 97, axis=0) < [2e-5, 4e-5, 1e-4]).all()
    assert (np.percentile(r.da_deg, 97, axis=0) < [0.01, 0.04, 0.1]).all()


def test_random_landings_agree_with_contact_of_mujoco_itself() -> None:
    """Box on plane, linear damper: another law, with the same motion up to the first strike of a plate."""
    r = agreement.compare(_landings()[0][:N_NATIVE], "native")
    assert ((r.n_legs >= 3) == (r.n_legs_mj >= 3))[~r.plate].all()
    assert (r.n_legs != r.n_legs_mj).mean() < 0.05
    assert r.dp_m[r.clean].max() < 1.5e-3
    assert np.median(r.dp_m[:, 0]) < 3e-3


@pytest.mark.parametrize("angle_deg", [135.0, 90.0, 45.0])
def test_random_landings_on_surfaces_of_other_angles_agree(angle_deg: float) -> None:
    """An overhang, a wall and a slope; MuJoCo has its own gravity and axes for each."""
    surface = {"surface.angle": angle_deg}
    drawn = agreement.draw(3 * N_TILTED, int(angle_deg), (1.5, 3.5), (30.0, 150.0), (0.5, 8.0))
    touching = agreement.split(drawn, **surface)[0][:N_TILTED]
    assert len(touching) == N_TILTED
    r = agreement.compare(touching, "same_law", **surface)
    differ = np.flatnonzero(r.n_legs != r.n_legs_mj)
    assert (r.n_legs >= 3).sum() >= N_TILTED // 10
    assert all(agreement.undecided(touching[i], **surface) > 0.0 for i in differ)
    assert len(differ) <= 0.05 * N_TILTED
    assert r.hit_mj.all()
    assert np.abs(r.dt_impact_s).max() < 1e-4
    assert np.abs(r.dtheta_impact_deg).max() < 0.2
    assert np.median(np.abs(r.dt_impact_s)) < 2e-5  # rotors that are told to push feel the steps of MuJoCo for longer
    assert (r.plate == r.plate_mj).mean() >= 0.95
    assert (np.median(r.dp_m, axis=0) < [6e-4, 1.2e-3, 2e-3]).all()


def test_misses_are_misses_in_both() -> None:
    r = agreement.compare(_landings()[1], "same_law")
    assert not r.hit.any()
    assert not r.hit_mj.any()
