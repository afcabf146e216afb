"""Comparison of recorded flights with the simulation: figures with known answers, and the command."""

import importlib
import json
from pathlib import Path

import numpy as np
import pytest
from recorded import folder, landing

from ivl import World, cli
from ivl.errors import ConfigError
from ivl.experiment import load
from ivl.flight import compare, store
from ivl.sensing import ESTIMATORS


@pytest.fixture(scope="module")
def flights() -> store.Flights:
    world = World("crazyflie21", "wide_short", "table1", None, **{"sense.phase_random": 0.0})
    policies = [(3.6, 6.0), (3.75, 6.0), (3.8, 6.05), (3.85, 6.0), (3.9, 6.05), (4.2, 6.0), (3.0, 6.0), (3.85, 6.1)]
    return folder(*(landing(world, rrev, moment, i) for i, (rrev, moment) in enumerate(policies)))


@pytest.fixture(scope="module")
def made(flights: store.Flights, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("flights") / "made"
    store.write(path, flights)
    return path


def test_the_vehicle_that_flew_explains_its_flights(flights: store.Flights) -> None:
    figures = compare.compare(flights, World("crazyflie21", "wide_short", "table1"), n=48).summary()
    assert figures["n_flights"] == len(flights)
    assert figures["pitch_rms_deg"] < 3.0
    assert figures["height_rms_m"] < 0.015
    assert figures["landed_brier"] < 0.2
    assert sum(figures["legs_confusion"]["4"].values()) == pytest.approx(
        sum(flight.info["n_legs"] >= 3 for flight in flights)
    )


def test_another_vehicle_does_not(flights: store.Flights) -> None:
    figures = compare.compare(flights, World("habas2021", "wide_short", "table1"), n=16).summary()
    assert figures["pitch_rms_deg"] > 8.0


def test_windows_span_where_half_of_the_landings_succeed(flights: store.Flights) -> None:
    result = compare.compare(flights, World("crazyflie21", "wide_short", "table1"), n=4, policies=[(3.85, 6.0)])
    (window,) = result.windows
    assert len(window.flown) == len(flights)
    low, high = window.span() or (np.nan, np.nan)
    inside = (window.threshold_per_s >= low) & (window.threshold_per_s <= high)
    assert window.rate[inside].min() >= 0.3
    assert window.rate[np.argmin(np.abs(window.threshold_per_s - 3.0))] == 0.0
    assert result.at_policies[0][2] > 0.5


def test_auc_and_brier_have_known_answers() -> None:
    score, landed = np.array([0.9, 0.8, 0.2, 0.2]), np.array([True, True, False, False])
    assert compare.auc(score, landed) == 1.0
    assert compare.auc(1.0 - score, landed) == 0.0
    assert compare.auc(np.full(4, 0.5), landed) == 0.5
    assert np.isnan(compare.auc(score, np.ones(4, dtype=bool)))
    assert compare.brier(np.array([1.0, 0.0]), np.array([True, True])) == 0.5


def test_interval_of_a_mean_is_that_of_the_normal_distribution() -> None:
    values = np.random.default_rng(3).normal(2.0, 1.0, 400)
    low, high = compare.interval(lambda i: float(values[i].mean()), len(values))
    assert high - low == pytest.approx(2 * 1.96 / 20, rel=0.15)
    assert low < values.mean() < high


@pytest.mark.parametrize(("legs", "expected"), [(4.0, 4), (3.0, 4), (2.0, 2), (1.0, 2), (0.0, 0), (float("nan"), None)])
def test_classes_of_endings(legs: float, expected: int | None) -> None:
    assert compare.class_of(legs) == expected


def test_flights_that_cannot_be_compared_are_named(flights: store.Flights) -> None:
    world = World("crazyflie21", "wide_short", "table1", None, **{"sense.phase_random": 0.0})
    broken = landing(world, 3.85, 6.0, 99, usable=False, note="it hit the net")
    result = compare.compare(folder(flights[3], broken), World("crazyflie21", "wide_short", "table1"), n=2)
    assert result.left_out == ("flight made-99: not usable: it hit the net",)
    with pytest.raises(ConfigError, match="it hit the net"):
        compare.compare(folder(broken), World("crazyflie21", "wide_short", "table1"), n=2)


@pytest.mark.parametrize("change", [{"h_plane_m": 1.0}, {"moment_Nmm": 1e3}])
def test_a_flight_that_cannot_be_flown_is_left_out_and_named(flights: store.Flights, change: dict[str, float]) -> None:
    wrong = store.Flight({**flights[0].info, **change, "label": "wrong"}, flights[0].samples)
    result = compare.compare(folder(flights[3], wrong), World("crazyflie21", "wide_short", "table1"), n=2)
    assert len(result.rows) == 1
    assert "flight wrong: " in result.left_out[0]


def test_ranking_is_unknown_where_all_flights_ended_alike(
    flights: store.Flights, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    store.write(tmp_path / "one", folder(flights[3]))
    assert cli.run(["flight", "compare", str(tmp_path / "one"), "--n", "4", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["landed_auc"] is None
    nobody = store.Flight({**flights[3].info, "n_legs": float("nan")}, flights[3].samples)
    store.write(tmp_path / "nobody", folder(nobody))
    picture = tmp_path / "one.png"
    assert cli.run(["flight", "compare", str(tmp_path / "nobody"), "--n", "4", "--plot", str(picture)]) == 0
    assert picture.is_file()


def test_windows_are_flown_under_the_ceiling_of_the_flights(flights: store.Flights) -> None:
    few = flights.flights[:4]
    spans = []
    for gap_m in (0.0, 0.06):
        room = folder(*(store.Flight({**f.info, "h_surface_m": f.info["h_plane_m"] - gap_m}, f.samples) for f in few))
        spans.append(compare.compare(room, World("crazyflie21", "wide_short", "table1"), n=2).windows[0].rate)
    assert np.abs(spans[0] - spans[1]).max() > 0.3


@pytest.mark.parametrize("command", ["compare", "identify", "replay"])
def test_flights_are_held_against_the_world_that_the_common_options_say(
    command: str, made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[World] = []

    def stop(_flights: object, home: World, *_: object, **__: object) -> None:
        seen.append(home)
        raise ConfigError("enough")

    monkeypatch.setattr(importlib.import_module(f"ivl.flight.{command}"), command, stop)
    own = ["--fit", "rotor.tau_down", "--out", str(tmp_path / "a.yaml")] if command == "identify" else []
    words = ["flight", command, str(made), *own]
    experiment = "experiments/paper_vertical.yaml"
    for options in (
        [], ["--gear", "wide_long", "--set", "sense.latency=0.02"],
        ["--set", "estimator=kalman", "--set", "gear=wide_long"],
        ["--experiment", experiment], ["--experiment", experiment, "--vehicle", "crazyflie21"],
    ):  # fmt: skip
        assert cli.run([*words, *options]) == 2
    plain, changed, by_set, learned, other = seen
    assert repr(plain) == repr(World("crazyflie21", "wide_short", "table1"))
    assert repr(changed) == repr(World("crazyflie21", "wide_long", "table1", **{"sense.latency": 0.02}))
    assert (by_set.gear, by_set.overrides) == ("wide_long", dict(ESTIMATORS["kalman"]))
    assert repr(learned) == repr(load(experiment).make_world())
    assert (other.vehicle, other.gear_set) == ("crazyflie21", learned.gear_set)


def test_equal_seeds_give_equal_figures(flights: store.Flights) -> None:
    first, second = (
        compare.compare(
            folder(*flights.flights[:3]), World("crazyflie21", "wide_short", "table1"), n=8, seed=5
        ).summary()
        for _ in range(2)
    )
    assert json.dumps(first) == json.dumps(second)


def test_command_prints_figures_and_draws(made: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    picture = tmp_path / "flights.png"
    words = ["flight", "compare", str(made), "--policy", "3.85,6", "--n", "4", "--plot", str(picture)]
    assert cli.run([*words, "--json"]) == 0
    figures = json.loads(capsys.readouterr().out)
    assert {
        "pitch_rms_deg",
        "height_rms_m",
        "rate_rms_radps",
        "t_contact_error_s",
        "landed_auc",
        "landed_brier",
    } <= set(figures)
    assert set(figures["rate_by_flown_legs"]) == {"4", "2", "0"}
    assert picture.stat().st_size > 20_000
    assert cli.run(words) == 0
    assert "pitch, rms to 200 ms" in capsys.readouterr().out


@pytest.mark.parametrize(("options", "words"), [
    (["--policy", "3.85"], "expected RREV_C,M_YD"), (["--plot", "a.gif"], "unknown kind of file"),
    (["--vehicle", "crazyfly"], "did you mean 'crazyflie21'"), (["--set", "sense.latency=9"], "out of range"),
    (["--set", "sense.latenzy=0.01"], "did you mean 'sense.latency'"),
    (["--plot", "nowhere/a.png"], "the folder nowhere does not exist"),
])  # fmt: skip
def test_wrong_options_are_one_line(
    made: Path, capsys: pytest.CaptureFixture[str], options: list[str], words: str
) -> None:
    assert cli.run(["flight", "compare", str(made), *options]) == 2
    text = capsys.readouterr().err.strip()
    assert words in text
    assert "\n" not in text
