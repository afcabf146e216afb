"""Replay of flights whose answers are known: the simulator's own, and such with something wrong."""

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import replay_fixture as fixture
from hypothesis import given
from hypothesis import strategies as st
from replay_fixture import COAST, as_log, changed, simulated

from ivl.cli import run as cli
from ivl.errors import ConfigError
from ivl.flight import inputs, phases, replay, schema, store
from ivl.flight.store import Flight, Flights, Manifest, make_flight
from ivl.world import World


@pytest.fixture(scope="module")
def world() -> World:
    return fixture.world()


@pytest.fixture(scope="module")
def flight(world: World) -> Flight:
    return simulated(world)


@pytest.fixture(scope="module")
def log(flight: Flight) -> Flight:
    return as_log(flight)


def manifest() -> Manifest:
    return Manifest("test", [], "MIT", "as in the schema", "simulated")


def folder(path: Path, *flights: Flight) -> str:
    numbered = tuple(Flight({**f.info, "flight": i}, f.samples) for i, f in enumerate(flights))
    store.write(path, Flights(manifest(), numbered))
    return str(path)


def trigger_of(result: replay.Result) -> dict:
    return result.summary["flights"][0]["trigger"]


# ---- the same bits


@pytest.mark.parametrize("start", ["imparted", "flown"])
@pytest.mark.parametrize(("speed", "angle"), [(2.5, 90.0), (3.0, 60.0), (1.5, 35.0)])
def test_replay_of_a_simulated_flight_gives_its_own_answers_bit_for_bit(
    world: World, start: str, speed: float, angle: float
) -> None:
    flight = simulated(world, speed, angle, 4.0, start)
    result = replay.replay([flight], world)
    rows = result.flights[0].rows
    # the world does not ask a core whose motors are latched off
    stepped = int(np.argmax(flight["phase"] == COAST)) + 1 if (flight["phase"] == COAST).any() else len(flight)
    assert stepped > 200
    assert len(rows) == len(flight)
    for name, column in (("rrev_per_s",) * 2, ("of_y_radps",) * 2, ("d_ceil_m",) * 2, ("phase",) * 2):
        assert (rows[name][:stepped] == flight[column][:stepped]).all(), name
    for i in range(1, 5):
        # motors are given a share of the largest thrust, which costs a bit
        np.testing.assert_allclose(rows[f"thrust{i}_N"][:stepped], flight[f"thrust_{i}_N"][:stepped], rtol=2.4e-7)
    trigger = trigger_of(result)
    assert trigger["logged_s"] is not None
    assert trigger["offset_samples"] == 0
    assert result.summary["rrev"]["max_error_per_s"] == 0.0
    assert result.summary["rrev"]["within_0_003"] == 1.0
    assert result.summary["flights"][0]["cut"]["offset_samples"] == 0


def test_phases_are_compared_where_the_log_has_them(world: World, flight: Flight) -> None:
    phase = replay.replay([flight], world).summary["phase"]
    assert phase["n_samples"] == len(flight)
    wrong = changed(flight)
    wrong.samples["phase"][100:120] = phases.ABORTED
    more = replay.replay([wrong], world).summary["phase"]
    assert more["n_different"] == phase["n_different"] + 20
    assert more["n_ticks"] == phase["n_ticks"] + 20


def test_log_of_100_hz_triggers_at_the_same_tick(world: World) -> None:
    held = fixture.world(**{"sense.pose_rate": 100.0})
    for speed in (1.5, 2.0, 2.5, 3.0):
        result = replay.replay([as_log(simulated(held, speed))], world)
        assert trigger_of(result)["offset_s"] == 0.0
        assert result.summary["rrev"]["max_error_per_s"] == 0.0


def test_repeated_replay_has_the_same_bits_and_another_flight_has_not(world: World, log: Flight) -> None:
    bits = replay.replay([log], world).summary["bits"]
    assert replay.replay([log], fixture.world()).summary["bits"] == bits
    other = changed(log)
    other.samples["v_z_mps"][10] += 1e-6
    assert replay.replay([other], world).summary["bits"] != bits


def test_log_that_is_faster_than_the_core_is_compared_where_the_core_was_fed(flight: Flight) -> None:
    slow = fixture.world(**{"firmware.tick_hz": 125.0})
    result = replay.replay([changed(flight, drop=("phase",))], slow)
    assert result.summary["n_samples"] <= result.summary["n_ticks"] < len(flight) / 3
    assert result.summary["rrev"]["max_error_per_s"] == 0.0


# ---- what the core is told


def test_samples_are_held_and_their_age_is_told(world: World, log: Flight) -> None:
    ticks = inputs.make(log, world)
    assert (np.diff(ticks.inputs["t_us"].astype(np.int64)) == 2000).all()
    assert (ticks.seen == 5 * np.arange(len(log))).all()
    age_us = (ticks.inputs["t_us"] - ticks.inputs["t_pose_us"]).astype(int)
    assert (age_us[:10] == [0, 2000, 4000, 6000, 8000] * 2).all()
    assert (ticks.inputs["p_WB_m"][:5] == ticks.inputs["p_WB_m"][0]).all()


def test_sample_between_two_ticks_is_seen_by_the_later_one(world: World, log: Flight) -> None:
    late = make_flight(log.info, {**log.samples, "t_s": log["t_s"] + np.where(log["t_s"] > 0.1, 0.0013, 0.0)})
    ticks = inputs.make(late, world)
    assert ticks.seen[11] == 56
    age_us = (ticks.inputs["t_us"] - ticks.inputs["t_pose_us"]).astype(int)
    assert age_us[56] == 700
    assert (age_us >= 0).all()


def test_each_sensor_is_held_by_itself(world: World, log: Flight) -> None:
    sparse = changed(log)
    sparse.samples["q_x"][20:23] = np.nan
    sparse.samples["v_z_mps"][30:32] = np.nan
    ticks = inputs.make(sparse, world)
    assert (ticks.inputs["q_WB"][110] == ticks.inputs["q_WB"][95]).all()
    assert ticks.inputs["p_WB_m"][105, 2] != ticks.inputs["p_WB_m"][95, 2]
    assert (ticks.inputs["v_WB_mps"][155] == ticks.inputs["v_WB_mps"][145]).all()
    assert ticks.inputs["t_us"][155] - ticks.inputs["t_pose_us"][155] == 20000


def test_approach_begins_where_the_log_says(world: World) -> None:
    flight = simulated(world, start="flown")
    still = np.full(100, 0.0)
    moving = np.concatenate([still, np.linspace(0.02, 2.5, len(flight) - 100)])
    with_set_point = make_flight(flight.info, {**flight.samples, "set_v_z_mps": moving, "set_v_x_mps": 0 * moving, "set_v_y_mps": 0 * moving})  # fmt: skip  # noqa: E501
    assert inputs.find_approach(with_set_point) == (0, "phase")
    assert inputs.find_approach(changed(with_set_point, drop=("phase",))) == (100, "set-point")
    begins, told_by = inputs.find_approach(changed(flight, drop=("phase",)))
    assert told_by == "closing speed"
    assert (flight["v_z_mps"][begins:inputs.trigger_sample(flight)] > 0.0).all()  # fmt: skip


def test_approach_is_the_last_rise_before_the_trigger(log: Flight) -> None:
    twice = changed(log)
    twice.samples["v_z_mps"][20] = -0.1
    assert inputs.find_approach(twice) == (21, "closing speed")


def test_flight_that_never_rises_has_no_approach(world: World, log: Flight) -> None:
    hover = changed(log, slice(0, 30), drop=("phase", "triggered"))
    hover.samples["v_z_mps"][:] = -0.01
    result = replay.replay([hover], world)
    assert result.summary["n_samples"] == 0
    assert result.summary["flights"][0]["approach_told_by"] == "nothing"
    assert result.summary["flights"][0]["last_phase"] == "ready"
    assert result.verdict()[0] == "The log has no RREV to compare with."


def test_hover_is_asked_for_shortly_before_the_approach(world: World, log: Flight) -> None:
    early = np.arange(-300, 0) * 0.01
    waiting = {name: np.concatenate([np.full(300, values[0]), values]) for name, values in log.samples.items()}
    waiting["t_s"] = np.concatenate([early, log["t_s"]]) + 3.0
    waiting["v_z_mps"][:300] = 0.0
    ticks = inputs.make(make_flight(log.info, waiting), world)
    requests = ticks.inputs["request"]
    assert (requests[: 2 * 500 - 5] == inputs.ASK_IDLE).all()
    assert (requests[2 * 500 + 5 : 1500] == inputs.ASK_HOVER).all()
    assert (requests[1500:] == inputs.ASK_APPROACH).all()
    assert trigger_of(replay.replay([make_flight(log.info, waiting)], world))["offset_samples"] == 0


def test_approach_s_arguments_come_from_the_motion_where_nobody_says_them(world: World, log: Flight) -> None:
    unasked = changed(log, speed_mps=float("nan"))
    told = inputs.make(unasked, world).inputs
    assert told["speed_mps"][0] == pytest.approx(2.5, abs=0.1)
    assert told["angle_rad"][0] == pytest.approx(np.pi / 2, abs=0.01)


def test_accelerometer_of_the_log_is_fed_and_feels_the_contact(log: Flight) -> None:
    touching = fixture.world(**{"firmware.cut_on_contact": 1.0})
    felt = changed(log)
    trigger = inputs.trigger_sample(log)
    assert trigger is not None
    for name, value in (("f_x_mps2", 0.0), ("f_y_mps2", 0.0), ("f_z_mps2", 9.81)):
        felt.samples[name][:] = value
    felt.samples["f_x_mps2"][trigger + 3] = 60.0
    result = replay.replay([felt], touching)
    assert result.summary["flights"][0]["notes"] == []
    assert result.flights[0].at_samples("phase")[trigger + 3] == phases.ATTACHED
    assert "no accelerometer" in replay.replay([log], touching).summary["flights"][0]["notes"][0]


# ---- what is wrong is noticed


@pytest.mark.parametrize("shift_m", [-0.03, 0.03])
def test_shifted_plane_is_noticed(world: World, log: Flight, shift_m: float) -> None:
    result = replay.replay([changed(log, h_plane_m=log.info["h_plane_m"] + shift_m)], world)
    assert result.summary["rrev"]["within_0_003"] < 0.3
    assert result.summary["d_ceil"]["median_error_m"] == pytest.approx(0.03, abs=1e-6)
    assert trigger_of(result)["offset_samples"] * shift_m > 0
    assert "does not see" in result.verdict()[0]


def test_cues_of_the_tick_before_are_noticed(world: World, log: Flight) -> None:
    late = changed(log)
    late.samples["rrev_per_s"][1:] = log["rrev_per_s"][:-1]
    assert replay.replay([late], world).summary["rrev"]["median_error_per_s"] > 0.005


def test_few_lost_samples_delay_the_trigger_by_as_many(world: World, log: Flight) -> None:
    trigger = inputs.trigger_sample(log)
    assert trigger is not None
    kept = [i for i in range(len(log)) if not trigger - 2 <= i < trigger + 3]
    result = replay.replay([changed(log, kept)], world)
    assert trigger_of(result)["offset_samples"] == 0
    assert trigger_of(result)["offset_s"] == 0.0
    assert result.summary["rrev"]["max_error_per_s"] < 1e-3


def test_long_gap_makes_the_core_abort_and_is_named(world: World, log: Flight) -> None:
    kept = [i for i in range(len(log)) if not 20 <= i < 35]
    result = replay.replay([changed(log, kept)], world)
    assert result.summary["flights"][0]["ended_early_by"] == "state"
    assert result.summary["flights"][0]["n_bad_pose"] > 0
    assert trigger_of(result)["replayed_s"] is None
    assert result.summary["trigger"] | {"offsets_s": []} == {
        "n": 1, "within_one_sample": 0.0, "within_one_new_sample": 0.0, "offsets_samples": [], "offsets_s": [],
        "n_logged_only": 1, "n_replayed_only": 0, "n_neither": 0,
    }  # fmt: skip
    assert "Rules of the core ended approaches before the trigger: state (1)." in result.verdict()


def test_samples_that_repeat_the_one_before_are_told_apart(world: World, log: Flight) -> None:
    trigger = inputs.trigger_sample(log)
    assert trigger is not None
    repeated = changed(log)
    for values in repeated.samples.values():
        values[trigger - 1] = values[trigger - 2] if values is not repeated.samples["t_s"] else values[trigger - 1]
    repeated.samples["triggered"][trigger : trigger + 1] = 0.0
    late = changed(repeated, threshold_per_s=float(repeated["rrev_per_s"][trigger - 2]) - 1e-4)
    result = replay.replay([late], world)
    assert trigger_of(result)["offset_samples"] == -3
    assert trigger_of(result)["offset_new_samples"] == -2


def test_flight_that_never_triggers_agrees_when_neither_does(world: World) -> None:
    never = as_log(simulated(world, rrev_c=20.0))
    never = changed(never, never["t_s"] < 0.85)
    result = replay.replay([never], world)
    assert result.summary["trigger"]["n_neither"] == 1
    assert result.summary["trigger"]["within_one_sample"] == 1.0
    assert result.summary["flights"][0]["ended_early_by"] == ""
    eager = replay.replay([changed(never, threshold_per_s=2.0)], world)
    assert eager.summary["trigger"]["n_replayed_only"] == 1
    assert "0 flights triggered in the log alone, 1 in the replay alone." in eager.verdict()


def test_trigger_is_not_judged_without_policy_or_without_a_log_of_it(world: World, log: Flight) -> None:
    no_policy = replay.replay([changed(log, threshold_per_s=float("nan"))], world)
    assert no_policy.summary["trigger"]["n"] == 0
    assert no_policy.summary["rrev"]["within_0_003"] == 1.0
    assert "no policy in the log: the trigger is not compared" in no_policy.summary["flights"][0]["notes"]
    silent = replay.replay([changed(log, drop=("triggered",))], world)
    assert trigger_of(silent) is None
    assert "The log tells too little to compare the trigger." in silent.verdict()


def test_trigger_may_be_told_by_a_time_alone(world: World, log: Flight) -> None:
    trigger = inputs.trigger_sample(log)
    timed = changed(log, drop=("triggered",), t_trigger_s=float(log["t_s"][trigger]))
    assert trigger_of(replay.replay([timed], world))["offset_samples"] == 0


def test_log_of_three_digits_is_explained_by_its_step(world: World, log: Flight) -> None:
    cut = {name: np.floor(values * 1000) / 1000 if name not in ("t_s", "moment_cmd_y_Nm") else values for name, values in log.samples.items()}  # fmt: skip  # noqa: E501
    rough = make_flight({**log.info, "h_plane_m": round(log.info["h_plane_m"], 3)}, cut)
    rrev = replay.replay([rough], world, step=1e-3).summary["rrev"]
    assert rrev["explained_by_step"] == 1.0
    assert 0.0 < rrev["max_error_per_s"] < 0.03
    assert replay.replay([rough], world, step=1e-6).summary["rrev"]["explained_by_step"] < 0.2


def test_rule_about_the_battery_applies_when_it_is_told(world: World, log: Flight) -> None:
    low = changed(log)
    low.samples["battery_V"][:] = np.where(log["t_s"] > 0.3, 2.6, 3.3)
    assert replay.replay([low], world).summary["flights"][0]["ended_early_by"] == ""
    assert replay.replay([low], world, battery=True).summary["flights"][0]["ended_early_by"] == "battery"
    unknown = replay.replay([log], world, battery=True)
    assert unknown.summary["flights"][0]["ended_early_by"] == "battery"
    lenient = fixture.world(**{"firmware.vbat_min": 2.5})
    assert trigger_of(replay.replay([low], lenient, battery=True))["offset_samples"] == 0


def test_core_that_may_not_begin_names_its_rule(log: Flight) -> None:
    fenced = fixture.world(**{"firmware.fence_z_max": 0.1})
    assert replay.replay([log], fenced).summary["flights"][0]["ended_early_by"] == "fence"


# ---- refusals


def test_policy_out_of_range_is_one_line(world: World, log: Flight) -> None:
    wanted = (
        r"^flight 2\.5 m/s: policy: form constant: rrev_c_per_s: value 25\.0 is out of range "
        r"\(allowed 0 \.\. 20 1/s\)$"
    )
    with pytest.raises(ConfigError, match=wanted):
        replay.replay([changed(log, threshold_per_s=25.0)], world)
    with pytest.raises(ConfigError, match="policy: form constant: moment_y_Nmm: value"):
        replay.replay([changed(log, moment_Nmm=float("inf"))], world)


def test_plane_out_of_range_is_one_line(world: World, log: Flight) -> None:
    with pytest.raises(ConfigError, match=r"h_plane_m: value 210 is out of range \(allowed -100 \.\. 100 m\)"):
        replay.replay([changed(log, h_plane_m=210.0)], world)


def test_source_of_the_distance_that_no_log_can_feed_is_refused(log: Flight) -> None:
    with pytest.raises(ConfigError, match=r"firmware\.d_source: value 2: .* \(allowed 0, the known height\)"):
        replay.replay([log], fixture.world(**{"firmware.d_source": 2.0}))


def test_flights_that_cannot_be_replayed_are_left_out_with_a_reason(world: World, log: Flight) -> None:
    blind = changed(log, drop=("q_",), label="blind")
    broken = changed(log, label="broken", usable=False, note="tracking lost")
    endless = make_flight({**log.info, "label": "endless"}, {**log.samples, "t_s": log["t_s"] * 1e4})
    result = replay.replay([blind, log, broken, endless], world)
    assert result.summary["n_flights"] == 1
    reasons = {entry["label"]: entry["reason"] for entry in result.summary["left_out"]}
    assert reasons["blind"].startswith("the log has no q:")
    assert reasons["broken"] == "not usable: tracking lost"
    assert "(allowed 0 .. 3600 s)" in reasons["endless"]
    with pytest.raises(ConfigError, match=r"no flight can be replayed: flight broken: not usable: tracking lost"):
        replay.replay([broken], world)
    with pytest.raises(ConfigError, match=r"no flight can be replayed$"):
        replay.replay([], world)


ODD = st.sampled_from([np.nan, np.inf, -np.inf, 0.0, -0.0, 1e-320, 1e300, -1e300, 1.0, -2.5, 199.0])
COLUMNS = [name for name in schema.SAMPLES if name not in ("flight", "t_s")]


@cache
def known() -> tuple[World, Flight]:
    """Not a fixture: what is told when an example fails would be a hundred pages long."""
    return fixture.world(), as_log(simulated(fixture.world()))


@given(
    spoiled=st.lists(st.tuples(st.sampled_from(COLUMNS), st.integers(0, 99), st.integers(1, 60), ODD), max_size=12),
    steps=st.lists(st.sampled_from([1e-4, 0.003, 0.01, 0.02, 0.3]), min_size=99, max_size=99),
)
def test_any_numbers_in_a_log_give_an_answer_and_a_summary_of_numbers(
    spoiled: list[tuple[str, int, int, float]], steps: list[float]
) -> None:
    world, log = known()
    odd = make_flight(log.info, {n: v[:100].copy() for n, v in log.samples.items()} | {"t_s": np.cumsum([0.0, *steps])})
    for name, first, n, value in spoiled:
        odd.samples[name][first : first + n] = value
    if inputs.why_not(odd):
        return
    result = replay.replay([odd], world, battery=True, step=0.001)
    json.dumps(result.summary, allow_nan=False)
    assert result.verdict()


# ---- the command


def test_command_prints_one_object_or_a_table(
    tmp_path: Path, log: Flight, world: World, capsys: pytest.CaptureFixture[str]
) -> None:
    flights = folder(tmp_path / "flights", log, changed(log, usable=False, note="by hand"))
    settings = [text for name, value in fixture.IDEAL.items() for text in ("--set", f"{name}={value}")]
    words = ["flight", "replay", flights, "--vehicle", "habas2021", "--gear-set", "as_simulated", *settings]
    assert cli([*words, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["bits"] == replay.replay([log], world).summary["bits"]
    assert found["where"] == "in process"
    assert found["trigger"]["within_one_sample"] == 1.0
    assert cli([*words, "--plot", str(tmp_path / "a.png"), "--step", "0.001"]) == 0
    text = capsys.readouterr().out
    assert "Left out: 2.5 m/s: not usable: by hand" in text
    assert "The core sees the logged RREV: 100.0 %" in text
    assert (tmp_path / "a.png").stat().st_size > 1000


def test_command_refuses_in_one_line(tmp_path: Path, log: Flight, capsys: pytest.CaptureFixture[str]) -> None:
    flights = folder(tmp_path / "flights", changed(log, threshold_per_s=25.0))
    for words, message in (
        ([flights], "policy: form constant: rrev_c_per_s: value 25.0 is out of range"),
        ([flights, "--uri", "radio://0"], "allowed pil://"),
        ([flights, "--plot", "a.gif"], "unknown kind of file (allowed .png, .svg, .pdf)"),
        ([str(tmp_path / "none")], "this is no folder of flights"),
        ([flights, "--set", "firmware.tick=1"], "firmware.tick"),
    ):
        assert cli(["flight", "replay", *words]) == 2
        error = capsys.readouterr().err
        assert message in error
        assert error.count("\n") == 1


def test_plot_shows_the_flights_that_differ_most(world: World, log: Flight) -> None:
    from ivl.plots import replay as figure

    shifted = changed(log, h_plane_m=log.info["h_plane_m"] + 0.1, label="shifted")
    result = replay.replay([log] * 8 + [shifted] + [log] * 3, world)
    chosen = figure.choose(result.flights)
    assert len(chosen) == figure.N_FLIGHTS
    assert "shifted" in [r.flight.label for r in chosen]
    assert len(figure.choose(result.flights[:1])) == 1
