"""Whole landings through the flight core: starts, cues, cuts, contact, energy."""

from typing import Any

import numpy as np
import pytest

import ivl

GEARS = [
    (gear_set, gear)
    for gear_set in ("table1", "as_simulated")
    for gear in (
        "extra_narrow_short",
        "narrow_short",
        "wide_short",
        "extra_narrow_long",
        "narrow_long",
        "wide_long",
    )
]
TICK_S = 0.002


@pytest.fixture(scope="module")
def world() -> ivl.World:
    return ivl.World("habas2021", "wide_short", "as_simulated")


def plane_height_m(world: ivl.World) -> float:
    """Height of the plane that the cues refer to."""
    params = world._library.params
    height = params["world.ceiling_height"].default
    assert height is not None
    return height + 0.045  # habas2021


# ---- cues ------------------------------------------------------------------------------------------------------------


def test_rate_of_rrev_follows_its_identity_along_a_flown_trajectory(world):
    # RREV' = z'' / d + RREV^2, from the trajectory alone: the speed of RREV against acceleration and distance
    rows = world.trace(2.5, 70.0, 15.0, 8.0, start="flown", period_s=TICK_S).rows
    flight = rows[(rows.phase == rows.phase[1]) & (rows.d_ceil_m > 0.25)]
    t, d = flight.t_s, plane_height_m(world) - flight.p_WB_m[:, 2]
    rrev = flight.v_WB_mps[:, 2] / d
    rrev_rate = np.gradient(rrev, t, edge_order=2)
    z_accel = np.gradient(flight.v_WB_mps[:, 2], t, edge_order=2)
    identity = z_accel / d + rrev**2
    assert len(flight) > 200
    assert np.abs(identity).max() > 5.0
    # central differences err by h^2/6 of the third derivative; thrust steps at each tick bound what is smooth
    np.testing.assert_allclose(rrev_rate[2:-2], identity[2:-2], atol=5e-3 * np.abs(identity).max())


def test_sensed_cues_are_those_of_the_last_sample():
    # 500 Hz without offset: a sample at every tick
    exact = ivl.World(
        "habas2021", "wide_short", "as_simulated", **{"sense.pose_rate": 500.0, "sense.phase_random": 0.0}
    )
    rows = exact.trace(2.5, 60.0, 12.0, 8.0, start="imparted", period_s=TICK_S).rows
    approach = rows[1:][rows[1:].phase == rows.phase[1]]
    before = rows[: len(approach)]  # a row shows what the core saw at the tick before it
    d = plane_height_m(exact) - before.p_WB_m[:, 2]
    np.testing.assert_allclose(approach.d_sensed_m, d, rtol=2e-6)
    np.testing.assert_allclose(approach.rrev_per_s, before.v_WB_mps[:, 2] / d, rtol=1e-5)
    np.testing.assert_allclose(approach.of_y_radps, -before.v_WB_mps[:, 0] / d, rtol=1e-5)


@pytest.mark.parametrize("rrev_c", [2.0, 3.5, 5.0, 8.0])
def test_trigger_comes_when_rrev_passes_its_threshold_within_one_sample(world, rrev_c):
    out = world.rollouts(2.5, 80.0, np.full(40, rrev_c), 8.0)
    assert (out.rrev_trigger >= rrev_c * (1.0 - 1e-6)).all()
    # RREV grows by RREV^2 * 10 ms between two samples
    assert (out.rrev_trigger < rrev_c * (1.0 + 1.3 * 0.01 * rrev_c)).all()
    np.testing.assert_allclose(out.d_trigger_m * out.rrev_trigger, 2.5 * np.sin(np.radians(80.0)), rtol=0.05)


# ---- starts ----------------------------------------------------------------------------------------------------------


def test_imparted_start_moves_at_the_approach_velocity_with_rrev_one(world):
    rows = world.trace(3.0, 40.0, 6.0, 8.0, start="imparted").rows
    np.testing.assert_allclose(
        rows.v_WB_mps[0], [3.0 * np.cos(np.radians(40)), 0.0, 3.0 * np.sin(np.radians(40))], atol=1e-9
    )
    assert rows.v_WB_mps[0, 2] / (plane_height_m(world) - rows.p_WB_m[0, 2]) == pytest.approx(1.0)


@pytest.mark.parametrize(("speed", "angle"), [(1.0, 90.0), (2.5, 90.0), (2.5, 60.0), (3.5, 30.0), (2.0, 20.0)])
def test_flown_start_reaches_the_approach_velocity(world, speed, angle):
    rows = world.trace(speed, angle, 6.0, 8.0, start="flown").rows
    assert np.abs(rows.v_WB_mps[0]).max() == 0.0
    out = world.trace(speed, angle, 4.0, 8.0, start="flown").outcome
    vx, vz = speed * np.cos(np.radians(angle)), speed * np.sin(np.radians(angle))
    assert np.hypot(out.vx_trigger_mps - vx, out.vz_trigger_mps - vz) < 0.12 * speed


@pytest.mark.parametrize("d_ceil_m", [0.2, 0.5, 1.2])
def test_at_trigger_start_flips_at_once(world, d_ceil_m):
    out = world.rollouts(2.5, 60.0, 4.0, np.linspace(4, 10, 7), start="at_trigger", d_ceil_m=d_ceil_m)
    assert (out.triggered == 1).all()
    assert (out.t_trigger_s == 0.0).all()
    np.testing.assert_allclose(out.vz_trigger_mps, 2.5 * np.sin(np.radians(60.0)))
    # the first sample is up to one period old
    assert ((out.d_trigger_m >= d_ceil_m - 1e-6) & (out.d_trigger_m <= d_ceil_m + 0.01 * 2.5)).all()


# ---- cuts ------------------------------------------------------------------------------------------------------------


def flip_of(trace: Any) -> Any:
    """Rows after the trigger."""
    return trace.rows[trace.rows.t_s > trace.outcome.t_trigger_s + 1e-9]


def test_motors_stop_when_the_body_passes_the_vertical_only_if_told_to():
    results = {}
    for cut in (0.0, 1.0):
        world = ivl.World("habas2021", "wide_short", "as_simulated", **{"firmware.cut_at_inverted": cut})
        rows = flip_of(world.trace(2.5, 90.0, 4.8, 8.0))
        beyond = rows[rows.pitch_deg > 92.0]
        assert len(beyond) > 5
        results[cut] = beyond.thrust_cmd_N.max(axis=1)
    assert (results[1.0] == 0.0).all()
    assert results[0.0][0] > 0.1


def test_motors_stop_on_contact_only_if_told_to():
    after = {}
    for cut in (0.0, 1.0):
        overrides = {"firmware.cut_at_inverted": 0.0, "firmware.cut_on_contact": cut}
        world = ivl.World("habas2021", "wide_short", "as_simulated", **overrides)
        trace = world.trace(2.5, 90.0, 5.2, 6.0)
        assert np.isfinite(trace.outcome.t_impact_s)
        rows = trace.rows[trace.rows.t_s > trace.outcome.t_impact_s + 2.5 * TICK_S]
        after[cut] = rows.thrust_cmd_N.max(axis=1)[:10]
    assert (after[1.0] == 0.0).all()
    assert (after[0.0] > 0.05).all()


# ---- contact ---------------------------------------------------------------------------------------------------------


def random_policies(n: int, seed: int) -> tuple[np.ndarray, ...]:
    rng = np.random.default_rng(seed)
    return rng.uniform(1.5, 4.0, n), rng.uniform(40.0, 90.0, n), rng.uniform(3.5, 6.0, n), rng.uniform(5.0, 10.0, n)


@pytest.mark.parametrize(("gear_set", "gear"), GEARS)
def test_stuck_feet_stay_and_energy_never_grows_once_the_rotors_stand(gear_set, gear):
    world = ivl.World("habas2021", gear, gear_set)
    contacts = 0
    for V, phi, rrev_c, moment in zip(*random_policies(12, seed=len(gear)), strict=True):
        trace = world.trace(V, phi, rrev_c, moment)
        rows = trace.rows
        stuck = rows.foot_state == 2
        feet = rows.foot_W_m.reshape(-1, 4, 3)
        for leg in range(4):
            held = feet[stuck[:, leg], leg]
            assert (held == held[:1]).all()
        still = rows[
            (rows.thrust_N.max(axis=1) < 1e-12) & (rows.t_s > np.nan_to_num(trace.outcome.t_trigger_s, nan=9.0))
        ]
        if len(still) > 2 and np.isfinite(trace.outcome.t_impact_s):
            contacts += 1
            lowest = np.minimum.accumulate(still.energy_J)
            # the oscillation of a second-order step, of some 0.2 J; a contact that pumps is far above it
            assert (still.energy_J[1:] - lowest[:-1]).max() < 0.01
    assert contacts >= 3


def test_a_landing_in_the_plane_of_symmetry_stays_in_it(world):
    rows = world.trace(2.5, 70.0, 4.8, 8.0).rows
    before = rows[: np.flatnonzero((rows.foot_state == 2).any(axis=1))[0] + 20]
    feet = before.foot_W_m.reshape(-1, 4, 3)
    assert np.abs(before.p_WB_m[:, 1]).max() < 1e-9
    np.testing.assert_allclose(feet[:, 0, 2], feet[:, 3, 2], atol=1e-9)
    np.testing.assert_allclose(feet[:, 1, 1], -feet[:, 2, 1], atol=1e-9)


def test_pads_that_hold_less_hold_fewer_feet():
    kwargs: dict[str, Any] = {"speed_mps": 2.5, "angle_deg": 80.0, "moment_y_Nmm": 8.0}
    counts = []
    for adhesion in (0.02, 0.5, float("inf")):
        world = ivl.World("habas2021", "wide_long", "table1", **{"leg.adhesion": adhesion})
        counts.append(int(world.rollouts(rrev_c_per_s=np.linspace(3.5, 6.0, 60), **kwargs).n_legs.sum()))
    assert counts[0] == 0
    assert counts[0] < counts[2]
    assert counts[1] <= counts[2]
