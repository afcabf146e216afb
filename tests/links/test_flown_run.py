"""What a vehicle has flown comes first: in report, export, pictures and figures; corrections keep what was there."""

import base64
import gzip
import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rehearsed import BUDGET, Days

from ivl import cli, flown, native, report, run
from ivl.belief import recording
from ivl.errors import ConfigError
from ivl.export.source import Choice, resolve
from ivl.flight import table
from ivl.learning.amend import Change, amend, listed
from ivl.learning.earlier import meta_of
from ivl.learning.recorder import DISCARDED, SCORED
from ivl.outcome import four_leg
from ivl.seeds import Purpose, derive
from ivl.site import file as site_file
from ivl.store import RunStore

COLUMNS = {
    "p_WB_m_1": "p_x_W_m", "p_WB_m_3": "p_z_W_m", "v_WB_mps_3": "v_z_W_mps", "q_WB_2": "q_WB_y",
    "w_B_radps_2": "w_y_B_radps", "f_B_mps2_3": "f_z_B_mps2", "thrust_cmd_N_4": "thrust4_N", "phase": "phase",
}  # fmt: skip


def triggered(days: Days) -> int:
    """The last rollout with a flip."""
    return int(np.flatnonzero(days.rollouts().outcomes["triggered"])[-1])


def test_recordings_are_named_by_their_rollouts(days: Days) -> None:
    names = sorted(path.name for path in (days.folder / "recordings").iterdir())
    seed = derive(days.chosen.seed, Purpose.WORLD)
    assert names == [f"rollout-{n:03d}-{seed:016x}.csv" for n in range(1, BUDGET + 1)]


def test_an_export_has_the_recorded_rows_bit_for_bit(days: Days) -> None:
    row = triggered(days)
    flight = resolve(days.folder, Choice(rollout=row))
    _, path = flown.counterpart(days.folder, days.chosen, days.rollouts(), row)
    recorded = table.read_csv(path)
    assert len(flight) == len(path.read_text().splitlines()) - 1
    for exported, column in COLUMNS.items():
        assert flight.columns[exported].tobytes() == recorded.numbers(column, needed=True).tobytes(), exported
    assert "as recorded" in flight.title
    assert flight.facts["judged_by"] == "operator"
    assert flight.facts["outcome.n_legs"] == str(days.truths[row]["n_legs"])
    assert flight.feet_W_m is None, "nobody has recorded feet"
    simulated = resolve(days.folder, Choice(rollout=row, simulated=True))
    assert "SIMULATED counterpart" in simulated.title
    assert len(simulated) != len(flight)


def test_the_report_carries_the_recordings_byte_for_byte_and_calls_the_rest_simulated(
    days: Days, tmp_path: Path
) -> None:
    made = report.write(days.folder, tmp_path / "page.html")
    page = made.path.read_text()
    data = json.loads(gzip.decompress(base64.b64decode(page.split('id="data">')[1].split("<")[0])))
    files = {path.name: path.read_text() for path in (days.folder / "recordings").iterdir()}
    assert data["learn"]["flown"]["recordings"] == files
    rows, rollouts = data["learn"]["flown"]["rows"], days.rollouts()
    assert [row["cells"][0] for row in rows] == [str(n) for n in range(1, BUDGET + 1)]
    for i, row in enumerate(rows):
        assert ("RECORDED" in data["landings"][row["recorded"]]["label"]) or not rollouts.outcomes["triggered"][i]
        assert "SIMULATED counterpart" in data["landings"][row["simulated"]]["label"]
    assert made.n_different == 0
    landed = int(four_leg(rollouts.outcomes).sum())
    facts = dict(data["facts"])
    assert facts["Flown: landed on three or four legs"].startswith(f"{landed} of {BUDGET} (")
    assert any(name.endswith("by the simulator") for name in facts)


def test_the_summary_has_the_flown_rate_with_its_interval(days: Days) -> None:
    assert days.result is not None
    told, rollouts = days.result.summary["flown"], days.rollouts()
    assert (told["landings"], told["recorded"]) == (BUDGET, BUDGET)
    assert told["landed"] == int(four_leg(rollouts.outcomes).sum())
    assert told["rate_lo"] < told["rate"] < told["rate_hi"]
    assert 0.0 < told["pitch_rms_deg_median"] < 30.0, "the simulator flew both, with other noise and battery"


def test_counterparts_and_judge_have_the_batteries_that_were_on_board(days: Days) -> None:
    assert days.result is not None
    world, rollouts = days.chosen.make_world(), days.rollouts()
    assert rollouts.recordings is not None
    flew_V = np.array([flown.rest_V(world, days.chosen, rollouts, row) for row in range(len(rollouts))])
    assert days.chosen.site is not None
    battery = site_file.load(days.chosen.site).battery
    assert np.nanmax(flew_V) < battery.full_V + 0.03
    assert np.nanmin(flew_V) > battery.rest_V_min - 0.1, "a flight takes some of it"
    told = np.full((len(rollouts), recording.N), np.nan)
    unknown = replace(rollouts, recordings=told.copy())
    assert flown.with_last_battery(world, days.chosen, unknown) is world
    rest_V = np.where(np.arange(len(rollouts)) % 2 == 0, 3.7, 4.1)
    in_hover_V = [recording.hover_V(world, days.chosen.flight, volts) for volts in rest_V]
    told[:, recording.CONDITIONS[0]] = in_hover_V
    known = replace(rollouts, recordings=told)
    assert [flown.rest_V(world, days.chosen, known, row) for row in range(len(known))] == pytest.approx(rest_V.tolist())
    row = triggered(days)
    spec, _ = flown.counterpart(days.folder, days.chosen, known, row)
    assert spec.overrides["battery.voltage"].value == pytest.approx(rest_V[row])
    found = flown.landings(days.folder, days.chosen, world, known)
    (own,) = (each for each in found if each.row == row)
    assert np.array_equal(own.simulated.rows["p_WB_m"], spec.fly()[1].rows["p_WB_m"]), "the page and a replay agree"
    last_V = rest_V[rollouts.status == SCORED][-1]
    judging = flown.with_last_battery(world, days.chosen, known).params.values
    assert judging["battery.voltage"] == pytest.approx(last_V)
    assert judging["battery.voltage_scatter"] == 0.0
    assert days.result.summary["flown"]["judged_battery_V"] == pytest.approx(flew_V[np.isfinite(flew_V)][-1])


@pytest.fixture
def copied(days: Days, tmp_path: Path) -> Path:
    """A run folder that may be changed."""
    return Path(shutil.copytree(days.folder, tmp_path / "run"))


def test_an_amended_outcome_keeps_who_when_and_what_was_there(
    days: Days, copied: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    legs = int(days.truths[0]["n_legs"])
    other = 4 if legs != 4 else 1
    words = ["run", "amend", str(copied), "1", "--legs", str(other), "--touched", "--why", "video", "--who", "anna"]
    assert cli.run([*words, "--json"]) == 0
    (made,) = json.loads(capsys.readouterr().out)["amendments"]
    assert (made["rollout"], made["who"], made["why"]) == (1, "anna", "video")
    assert made["before"]["n_legs"] == legs
    assert made["after"] == {"n_legs": other, "body_contact": True, "counts": True}
    assert made["utc"].startswith("20")
    assert not (copied / "result.json").exists(), "its verdict was that of the other outcome"
    with RunStore.open_reading(copied, native.library().outcome_dtype) as store:
        rows, last = store.rollouts(), store.episodes()[-1]
    assert (rows.outcomes["n_legs"][0], rows.outcomes["body_contact"][0]) == (other, 1)
    assert rows.reward[0] == days.chosen.reward.score(rows.outcomes[:1])["total"][0]
    learner = days.chosen.make_learner(derive(days.chosen.seed, Purpose.LEARNER))
    for episode in range(days.chosen.n_episodes):
        own = rows.of_rows(rows.episode == episode)
        learner.ask()
        learner.tell(own.theta, own.reward, meta_of(own.outcomes, None))
    assert (tuple(learner.result.mu), tuple(learner.result.sigma)) == (last.mu, last.sigma)


def test_a_landing_can_be_taken_out_and_back_and_the_run_is_as_it_was(copied: Path) -> None:
    def stored() -> tuple[object, ...]:
        with RunStore.open_reading(copied, native.library().outcome_dtype) as store:
            return [row.mu for row in store.episodes()], store.rollouts().status[7], store.learner_states()[0]

    before = stored()
    amend(copied, 8, Change(counts=False), "anna", "the net had touched it")
    assert stored()[1] == DISCARDED
    assert stored()[0] != before[0]
    amend(copied, 8, Change(counts=True), "anna", "it had not")
    assert stored() == before
    assert stored()[1] == SCORED
    assert [made["who"] for made in listed(copied)] == ["anna", "anna"]


@pytest.mark.parametrize(
    ("number", "change", "why", "told"),
    [
        (0, Change(n_legs=1), "x", "no rollout 0"),
        (BUDGET + 1, Change(n_legs=1), "x", f"allowed 1 .. {BUDGET}"),
        (1, Change(n_legs=5), "x", "--legs 5: value is out of range"),
        (1, Change(n_legs=-1), "x", "--legs -1: value is out of range"),
        (1, Change(n_legs=4), " ", "a name and a reason"),
        (1, Change(), "x", "says so already"),
    ],
)
def test_what_amends_nothing_is_refused(days: Days, number: int, change: Change, why: str, told: str) -> None:
    with pytest.raises(ConfigError, match=told):
        amend(days.folder, number, change, "anna", why)
    assert listed(days.folder) == []


def test_a_simulated_run_is_not_amended(tmp_path: Path, days: Days) -> None:
    settings = {"budget": 10, "site": None}
    run.run(days.chosen.model_copy(update=settings), tmp_path / "run")
    with pytest.raises(ConfigError, match="the simulator has judged"):
        amend(tmp_path / "run", 1, Change(n_legs=2), "anna", "x")
