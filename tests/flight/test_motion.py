"""The flip of a recorded flight, and the same flip flown again."""

from dataclasses import replace

import numpy as np
import pytest
from recorded import QUIET, landing

from ivl import World
from ivl.errors import ConfigError
from ivl.flight import compare, motion
from ivl.flight.store import make_flight


@pytest.fixture(scope="module")
def world() -> World:
    return World("crazyflie21", "wide_short", "table1", None, **QUIET)


def test_recorded_flip_is_flown_again_when_the_vehicle_is_the_same(world: World) -> None:
    flip = motion.flip(landing(world, 3.85, 6.0))
    again = motion.fly(motion.quiet_world(compare.in_room(world, flip)), flip)
    used = flip.compared()
    assert used.sum() > 80
    assert np.abs(again.pitch_deg - flip.pitch_deg)[used].max() < 1.0
    assert np.abs(again.rate_radps - flip.rate_radps)[used].max() < 0.3
    new = used & flip.is_new_pose
    assert 0.15 * used.sum() < new.sum() < 0.25 * used.sum()  # 100 poses a second in 500 rows
    assert np.abs(again.height_m - flip.height_m)[new].max() < 0.006
    assert again.t_contact_s == pytest.approx(flip.t_contact_s, abs=0.005)


@pytest.mark.parametrize(("name", "value", "signal"), [
    ("rotor.tau_down", 0.25, "pitch_deg"), ("body.inertia_yy", 2.2e-5, "pitch_deg"),
    ("rotor.thrust_gain", 0.9, "pitch_deg"), ("rotor.drag_share", 0.0, "rate_radps"),
])  # fmt: skip
def test_another_vehicle_shows_in_the_motion(world: World, name: str, value: float, signal: str) -> None:
    flip = motion.flip(landing(world, 3.85, 6.0))
    errors = []
    for changes in ({}, {name: value}):
        again = motion.fly(motion.quiet_world(compare.in_room(world.changed(**changes), flip)), flip)
        errors.append(np.sqrt(np.mean((getattr(again, signal) - getattr(flip, signal))[flip.compared()] ** 2)))
    assert errors[1] > 2.0 * errors[0]


def test_a_vehicle_without_a_battery_gets_none_from_a_recording(world: World) -> None:
    flip = motion.flip(landing(world, 3.85, 6.0))
    assert flip.state.battery_V is not None
    assert motion.start_state(world, flip).battery_V == flip.state.battery_V
    assert motion.start_state(World("habas2021", "wide_short", "table1"), flip).battery_V is None


@pytest.mark.parametrize("back", [20, 0])
def test_a_sample_that_is_missing_does_not_spoil_the_others(world: World, back: int) -> None:
    flight = landing(world, 3.85, 6.0)
    at = int(np.argmax(flight["t_s"] >= flight.info["t_trigger_s"] - 1e-9)) - back
    columns = {name: values.copy() for name, values in flight.samples.items()}
    for name in ("q_w", "p_z_m"):
        columns[name][at] = np.nan
    broken = motion.flip(make_flight(flight.info, columns))
    assert np.isfinite(broken.pitch_deg).all()
    assert np.isfinite(np.asarray(broken.state.p_W_m)).all()


def test_pitch_is_unwrapped_and_nose_up_is_positive() -> None:
    angle = np.radians(np.linspace(0.0, 400.0, 41))
    yaw = 0.7
    nose_up = np.stack([np.zeros(41), -np.sin(angle / 2), np.zeros(41), np.cos(angle / 2)], axis=1)
    turned = np.empty_like(nose_up)  # the same flip of a vehicle that looks elsewhere
    c, s = np.cos(yaw / 2), np.sin(yaw / 2)
    x, y, z, w = nose_up.T
    turned[:] = np.stack([c * x - s * y, c * y + s * x, c * z + s * w, c * w - s * z], axis=1)
    assert motion.pitch_deg(nose_up) == pytest.approx(np.degrees(angle))
    assert motion.pitch_deg(turned) == pytest.approx(np.degrees(angle))


@pytest.mark.parametrize("period_s", [0.002, 0.01])
def test_contact_is_where_the_rate_falls(period_s: float) -> None:
    t = np.arange(0.0, 0.4, period_s)
    rate = np.where(t < 0.2, 100.0 * t, 20.0 - 400.0 * (t - 0.2))
    assert motion.contact_time(t, rate, 0.01) == pytest.approx(0.2, abs=period_s + 0.004)
    assert np.isnan(motion.contact_time(t, 80.0 * t, 0.01))
    # a gyro at its full scale hides what happens above it
    assert np.isnan(motion.contact_time(t, np.where(t < 0.2, 300.0 * t, 50.0), 0.01))


def test_hanging_height_is_that_of_a_vehicle_that_hangs(world: World) -> None:
    landed, missed = landing(world, 3.85, 6.0), landing(world, 2.5, 6.0)
    assert landed.info["n_legs"] == 4.0
    assert motion.flip(landed).hanging_m == pytest.approx(landed["p_z_m"][-1], abs=0.01)
    assert np.isnan(motion.flip(missed).hanging_m)


def test_voltage_without_load_is_read_after_the_motors_stop(world: World) -> None:
    flip = motion.flip(landing(world, 3.85, 6.0))
    assert flip.state.battery_V == pytest.approx(world.params.values["battery.voltage"], abs=0.05)


def test_repeated_rows_are_no_measurements(world: World) -> None:
    flight = landing(world, 3.85, 6.0, period_s=0.01)
    stale = {name: values.copy() for name, values in flight.samples.items()}
    at = int(np.argmax(flight["t_s"] >= flight.info["t_trigger_s"] + 0.1))
    for name in stale:
        if name != "t_s":
            stale[name][at] = stale[name][at - 1]
    told = motion.flip(make_flight(flight.info, stale))
    assert len(told.t_s) == len(motion.flip(flight).t_s) - 1
    assert not np.isclose(told.t_s, stale["t_s"][at] - flight.info["t_trigger_s"], atol=1e-4).any()


@pytest.mark.parametrize(("change", "words"), [
    ({"t_trigger_s": float("nan")}, "it did not trigger"),
    ({"moment_Nmm": float("nan")}, "moment_Nmm is not known"),
    ({"h_plane_m": float("nan")}, "h_plane_m is not known"),
])  # fmt: skip
def test_flights_that_cannot_be_compared_say_why(world: World, change: dict[str, float], words: str) -> None:
    flight = landing(world, 3.85, 6.0)
    with pytest.raises(ConfigError, match=words):
        motion.flip(replace(flight, info={**flight.info, **change}))


def test_a_log_without_attitude_is_refused_by_its_column(world: World) -> None:
    flight = landing(world, 3.85, 6.0)
    samples = {name: values for name, values in flight.samples.items() if name != "q_y"}
    with pytest.raises(ConfigError, match="q_y"):
        motion.flip(make_flight(flight.info, samples))


def test_surface_is_where_it_was_measured_else_below_the_plane(world: World) -> None:
    flip = motion.flip(landing(world, 3.85, 6.0))
    assert motion.site_overrides(flip, 0.03) == {
        "world.ceiling_height": pytest.approx(flip.h_plane_m - 0.03), "world.sensed_gap_offset": pytest.approx(0.03)
    }  # fmt: skip
    measured = replace(flip, h_surface_m=flip.h_plane_m - 0.01)
    assert motion.site_overrides(measured, 0.03)["world.sensed_gap_offset"] == pytest.approx(0.01)
