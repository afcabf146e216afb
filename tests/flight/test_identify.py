"""Identification: known numbers are found again, the prior counts as it says, and what is written is a vehicle."""

import json
from pathlib import Path

import pytest
from recorded import folder, landing

from ivl import World, cli, model
from ivl.errors import ConfigError
from ivl.flight import identify, store

TRUE = {"rotor.tau_down": 0.23, "sense.latency": 0.016, "world.sensed_gap_offset": 0.03}


@pytest.fixture(scope="module")
def flights() -> store.Flights:
    """Landings of a vehicle that differs from crazyflie21 in three numbers."""
    world = World("crazyflie21", "wide_short", "table1", None, **{**TRUE, "sense.phase_random": 0.0})
    policies = [(3.4, 6.0), (3.5, 5.6), (3.6, 6.4), (3.5, 7.0), (3.6, 6.0), (3.45, 6.2)]
    return folder(*(landing(world, rrev, moment, i) for i, (rrev, moment) in enumerate(policies)))


@pytest.fixture(scope="module")
def found(flights: store.Flights) -> identify.Identification:
    sigmas = {"rotor.tau_down": 0.05, "sense.latency": 0.01, "world.sensed_gap_offset": 0.02}
    return identify.identify(flights, World("crazyflie21", "wide_short", "table1"), list(TRUE), sigmas=sigmas)


def test_known_numbers_are_found(found: identify.Identification) -> None:
    """Poses come at the same instants in all these flights: that error neither averages out nor shows in intervals."""
    near = {"rotor.tau_down": 0.005, "sense.latency": 0.002, "world.sensed_gap_offset": 0.004}
    for estimate in found.estimates:
        assert estimate.value == pytest.approx(TRUE[estimate.name], abs=near[estimate.name])
        assert estimate.sigma < estimate.prior.sigma
    assert found.after["fitted"]["pitch_rms_deg"] < 0.6 * found.before["fitted"]["pitch_rms_deg"]


def test_intervals_are_centred_on_the_estimates(found: identify.Identification) -> None:
    for i, estimate in enumerate(found.estimates):
        assert found.draws[:, i].mean() == pytest.approx(estimate.value, abs=0.5 * estimate.sigma)
    assert abs(found.rotor_error) < 0.01


def test_what_the_flights_do_not_see_is_not_fitted(flights: store.Flights) -> None:
    few = folder(*flights.flights[:2])
    with pytest.raises(ConfigError, match=r"plate\.friction: the motion of these flights does not depend on it"):
        identify.identify(few, World("crazyflie21", "wide_short", "table1"), ["plate.friction"])


def test_one_flight_tells_no_less_than_the_vehicle_file_and_nothing_impossible(flights: store.Flights) -> None:
    names = ["rotor.tau_down", "sense.latency"]
    result = identify.identify(folder(flights[0]), World("crazyflie21", "wide_short", "table1"), names)
    for estimate in result.estimates:
        low, high = estimate.interval
        assert estimate.prior.lo <= low <= estimate.value <= high <= estimate.prior.hi
        assert high - low <= 4.0 * estimate.prior.sigma


def test_what_the_flights_measured_is_not_fitted(flights: store.Flights) -> None:
    measured = folder(
        *(store.Flight({**f.info, "h_surface_m": f.info["h_plane_m"] - 0.03}, f.samples) for f in flights)
    )
    with pytest.raises(ConfigError, match="these flights measured it"):
        identify.identify(measured, World("crazyflie21", "wide_short", "table1"), ["world.sensed_gap_offset"])


def test_what_was_held_is_in_the_vehicle_that_is_written(flights: store.Flights) -> None:
    few = folder(*flights.flights[:3])
    held = {"sense.latency": 0.02, "leg.stiffness": 0.1}
    home = World("crazyflie21", "wide_short", "table1", **held)
    result = identify.identify(few, home, ["rotor.tau_down"])
    content = identify.vehicle_file("crazyflie21", result, "test")
    assert content["sense"]["latency"]["value"] == 0.02
    assert "leg" not in content


def test_outcomes_are_not_looked_at(flights: store.Flights, found: identify.Identification) -> None:
    upside_down = folder(
        *(store.Flight({**f.info, "n_legs": 4.0 - f.info["n_legs"], "reward": 1e6}, f.samples) for f in flights)
    )
    sigmas = {e.name: e.prior.sigma for e in found.estimates}
    again = identify.identify(upside_down, World("crazyflie21", "wide_short", "table1"), list(TRUE), sigmas=sigmas)
    assert again.overrides() == found.overrides()


def test_a_sharp_prior_wins_over_flights(flights: store.Flights) -> None:
    sharp = identify.identify(
        flights, World("crazyflie21", "wide_short", "table1"), ["rotor.tau_down"], sigmas={"rotor.tau_down": 1e-5}
    )
    assert sharp.estimates[0].value == pytest.approx(sharp.estimates[0].prior.value, abs=2e-4)
    assert any("say little of rotor.tau_down" in word for word in sharp.words)


def test_what_the_flights_cannot_separate_is_said(flights: store.Flights) -> None:
    names = ["body.inertia_yy", "rotor.thrust_gain", "rotor.torque_constant"]
    few = folder(*flights.flights[:2])
    sigmas = {"body.inertia_yy": 5e-6, "rotor.thrust_gain": 0.3, "rotor.torque_constant": 1e-3}
    result = identify.identify(few, World("crazyflie21", "wide_short", "table1"), names, sigmas=sigmas)
    text = " ".join(result.words)
    assert "say little of rotor.torque_constant" in text
    assert "Few flights (2)" in text


def test_held_out_flights_are_judged_not_fitted(flights: store.Flights) -> None:
    result = identify.identify(
        flights, World("crazyflie21", "wide_short", "table1"), ["rotor.tau_down"], held_out=lambda i, _: i >= 4
    )
    assert result.held_out == ("made-4", "made-5")
    assert len(result.used) == 4
    assert result.after["held_out"]["pitch_rms_deg"] < result.before["held_out"]["pitch_rms_deg"]
    home = World("crazyflie21", "wide_short", "table1")
    with pytest.raises(ConfigError, match="every one is held out"):
        identify.identify(flights, home, ["rotor.tau_down"], held_out=lambda *_: True)


def test_command_writes_a_vehicle_that_flies(
    flights: store.Flights, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    store.write(tmp_path / "made", flights)
    out = tmp_path / "my.yaml"
    words = ["flight", "identify", str(tmp_path / "made"), "--fit", "rotor.tau_down,sense.latency", "--out", str(out)]
    assert cli.run([*words, "--hold-out", "3", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert len(told["held_out"]) == 2
    part, original = model.load_vehicle(str(out)), model.load_vehicle("crazyflie21")
    assert set(part.quantities) == set(original.quantities)
    for name, quantity in part.quantities.items():
        if name in told["parameters"]:
            assert quantity.value == told["parameters"][name]["value"]
            assert quantity.sigma == told["parameters"][name]["sigma"]
            assert "6 recorded" not in quantity.source
            assert "4 recorded flights (made.csv)" in quantity.source
        else:
            assert quantity == original.quantities[name]
    assert World(str(out), "wide_short").rollouts(2.5, 90.0, 3.8, 6.0, start="flown").end_reason >= 0
    assert cli.run(words) == 2  # the file exists by now
    assert "exists already" in capsys.readouterr().err


@pytest.mark.parametrize(("options", "words"), [
    (["--fit", "rotor.tau_dawn", "--out", "a.yaml"], "rotor.tau_dawn: unknown"),
    (["--fit", "leg.stiffness", "--out", "a.yaml"], "of the landing gear"),
    (["--fit", "", "--out", "a.yaml"], "names no parameter"),
    (["--fit", "rotor.tau_down,rotor.tau_down", "--out", "a.yaml"], "named twice"),
    (["--fit", "rotor.tau_down", "--out", "a.txt"], "ends in .yaml"),
    (["--fit", "rotor.tau_down", "--out", "a.yaml", "--set", "rotor.tau_down=0.2"], "also given by --set"),
    (["--fit", "rotor.tau_down", "--out", "a.yaml", "--set", "sensing=mocap"], "identified with its own sensing"),
    (["--fit", "rotor.tau_down", "--out", "a.yaml", "--sigma", "rotor.tau_down=-1"], "allowed: above 0"),
    (["--fit", "rotor.tau_down", "--out", "a.yaml", "--sigma", "rotor.tau_down=x"], "expected NAME=NUMBER"),
    (["--fit", "rotor.tau_down", "--out", "a.yaml", "--hold-out", "1"], "would hold out every flight"),
    (["--fit", "rotor.tau_down", "--out", "a.yaml", "--hold-out-moment", "6"], "expected LO:HI"),
    (["--fit", "rotor.tau_down", "--out", "a.yaml", "--hold-out-moment", "9:6"], "LO must not be above HI"),
    (["--fit", "rotor.tau_down", "--out", "a.yaml", "--sigma", "rotor.tau_dwn=0.1"], "rotor.tau_dwn: is not fitted"),
    (["--fit", "rotor.tau_down", "--out", "nowhere/a.yaml"], "the folder nowhere does not exist"),
    (["--fit", "world.ceiling_height", "--out", "a.yaml"], "the flights give it"),
])  # fmt: skip
def test_wrong_options_are_one_line(
    flights: store.Flights, tmp_path: Path, capsys: pytest.CaptureFixture[str], options: list[str], words: str
) -> None:
    store.write(tmp_path / "made", flights)
    options = [str(tmp_path / o) if o.startswith("a.") else o for o in options]
    assert cli.run(["flight", "identify", str(tmp_path / "made"), *options]) == 2
    text = capsys.readouterr().err
    assert words in text
    assert text.count("\n") == 1
