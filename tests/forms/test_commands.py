"""What people do with a form of their own by the command line: list, fly, learn, sweep, report, export."""

import base64
import gzip
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from form_six import POLICY_SIX, SIX
from small_sweep import fly, make

from ivl import landing
from ivl import run as ivl_run
from ivl.analysis.policy import recommended
from ivl.cli import run
from ivl.experiment import Experiment
from ivl.export.source import Choice, resolve
from ivl.silproc import SilProcess
from ivl.sweep import store, summary

Capture = pytest.CaptureFixture[str]
NAMES = [name for name in POLICY_SIX if name != "form"]
THETA = "4.8,0,0,8,0,9"


def printed(capsys: Capture, *arguments: str) -> dict[str, Any]:
    assert run([*arguments, "--json"]) == 0
    return dict(json.loads(capsys.readouterr().out))


def refused(capsys: Capture, *arguments: str) -> str:
    assert run(list(arguments)) == 2
    return " ".join(capsys.readouterr().err.split())


def packed(page: Path) -> dict[str, Any]:
    """The data that a page carries."""
    found = re.search(r'<script[^>]*id="data"[^>]*>([^<]+)</script>', page.read_text(encoding="utf-8"))
    assert found is not None
    return dict(json.loads(gzip.decompress(base64.b64decode(found[1]))))


# ---- list


def test_forms_are_listed_with_name_unit_range_and_meaning(capsys: Capture) -> None:
    listed = {entry["name"]: entry for entry in printed(capsys, "list", "forms")["forms"]}
    assert list(listed) == ["constant", "polynomial2", "polynomial3", "bilinear", "six", "most"]
    assert list(listed["six"]["parameters"]) == NAMES
    assert listed["six"]["parameters"]["flip_vz_mNs"] == {
        "unit": "mN s", "lo": -5.0, "hi": 5.0, "doc": "its change with the closing speed",
    }  # fmt: skip
    assert len(listed["most"]["parameters"]) == 64
    assert run(["list", "forms"]) == 0
    text = capsys.readouterr().out
    assert re.search(r"flip_vz_mNs\s+-5 \.\. 5 mN s\s+its change with the closing speed", text)


# ---- fly


def test_rollout_of_the_form_is_that_of_the_world(capsys: Capture, six: Experiment) -> None:
    task = ["--vehicle", "habas2021", "--gear-set", "as_simulated", "--speed", "2.5", "--angle", "90"]
    told = printed(capsys, "rollout", *task, "--form", "six", "--theta", THETA)
    wanted = six.make_world().rollouts(2.5, 90.0, 4.8, 0, 0, 8, 0, 9, form="six", stream=0)
    assert told["n_legs"] == wanted.n_legs == 4
    assert told["t_impact_s"] == wanted.t_impact_s
    # with no change by velocity it is the paper's policy
    paper = printed(capsys, "rollout", *task, "--rrev", "4.8", "--moment", "8")
    assert paper == told


@pytest.mark.parametrize(
    ("theta", "message"),
    [
        ("4.8,8", "policy of the form six has 6 parameters (threshold_per_s, threshold_vz_per_m"),
        ("4.8,0,0,30,0,9", "form six: flip_Nmm: value 30.0 is out of range (allowed 0 .. 20 N mm)"),
        ("4.8,0,0,x,0,9", "--theta 4.8,0,0,x,0,9: numbers with commas between them are needed"),
    ],
)
def test_a_wrong_theta_is_refused_by_form_and_parameter(capsys: Capture, theta: str, message: str) -> None:
    assert message in refused(capsys, "rollout", "--speed", "2", "--angle", "90", "--form", "six", "--theta", theta)


def test_a_landing_is_flown_over_a_link(capsys: Capture, six: Experiment, six_file: Path) -> None:
    with SilProcess(six.make_world()) as server:
        told = printed(capsys, "fly", str(six_file), "--uri", server.uri, "--theta", THETA, "--seed", "3")
        text = refused(capsys, "fly", str(six_file), "--uri", server.uri, "--rrev", "4.8", "--moment", "8")
    wanted = six.make_world().rollouts(2.5, 90.0, 4.8, 0, 0, 8, 0, 9, form="six", seed=3, stream=0)
    assert told["snapshot"]["triggered"]
    assert told["outcome"]["t_impact_s"] == wanted.t_impact_s
    assert "--theta is missing: the form six has 6 parameters" in text


# ---- learn


def test_a_run_is_learned_reported_and_exported(capsys: Capture, six_file: Path, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    told = printed(capsys, "learn", str(six_file), "--out", str(folder))
    assert len(told["mu"]) == len(told["best"]["theta"]) == 6
    assert "searches of" in told["best"]["search"]
    assert (folder / "convergence.png").stat().st_size > 0
    page = printed(capsys, "report", str(folder))
    assert page["landings"] > 0
    assert page["landings_that_differ"] == 0
    data = packed(folder / "report.html")
    assert [row[:2] for row in data["parameters"]][3] == ["M_0", "N mm"]
    assert len(data["learn"]["limits"]) >= 6
    for kind in ("mcap", "csv"):
        exported = printed(capsys, "export", str(folder), "--format", kind)
        assert exported["rows"] > 0
        assert Path(exported["files"][0]).stat().st_size > 0
    facts = resolve(folder, Choice(rollout=3)).facts
    assert facts["spec.form"] == "six"
    assert [f"spec.{name}" in facts for name in NAMES] == [True] * 6


def test_people_read_symbols_and_units_of_the_form(capsys: Capture, six_file: Path, tmp_path: Path) -> None:
    assert run(["learn", str(six_file), "--out", str(tmp_path / "run")]) == 0
    out, err = capsys.readouterr()
    assert re.search(r"M_z\s+-?\d+\.\d\d ± \d+\.\d\d mN s", out)
    assert re.search(r"best possible policy\s+\d+\.\d % at R_0 .* 1/s, R_z", out)
    assert "(and 2 more)" in err


def test_a_rollout_of_a_run_is_a_landing_by_its_specification(six: Experiment, tmp_path: Path) -> None:
    result = ivl_run.run(six, tmp_path / "run")
    spec = landing.of_rollout(six, 0, result.rollouts.theta[5].tolist(), int(result.rollouts.stream[5]))
    _, trace = spec.fly()
    assert trace.outcome.t_end_s == result.rollouts.outcomes["t_end_s"][5]


# ---- sweep


@pytest.fixture(scope="module")
def swept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two cells of two trials."""
    folder = tmp_path_factory.mktemp("sweep")
    start = {name: [POLICY_SIX[name]["mu0"] - 0.1, POLICY_SIX[name]["mu0"] + 0.1] for name in NAMES}
    sweep = make(
        folder, gears=["wide_short"], speeds_mps=[2.5], angles_deg=[60.0, 90.0], trials=2, policy=POLICY_SIX,
        mu0_range=start,
    )  # fmt: skip
    return fly(sweep, folder / "run", size=2)


def test_tables_of_a_sweep_have_the_names_of_the_form(swept: Path) -> None:
    trials, episodes, rollouts = (store.read_frame(swept, kind) for kind in ("trials", "episodes", "rollouts"))
    assert len(trials) == 4
    for what in ("mu0", "mu", "sigma", "recommended", "best"):
        assert [f"{what}_{name}" in trials for name in NAMES] == [True] * 6
    assert {f"recommended_{name}" for name in NAMES} <= set(episodes.columns)
    assert set(NAMES) <= set(rollouts.columns)
    assert recommended(0) not in trials
    assert (trials[[f"mu0_{name}" for name in NAMES]].nunique() > 1).all()


def test_a_trial_of_a_sweep_is_a_run_of_learn(swept: Path, tmp_path: Path) -> None:
    sweep = make(tmp_path, **{**store.read_manifest(swept)["sweep"], "vary": {}})
    trials = store.read_frame(swept, "trials")
    row = trials.iloc[3]
    chosen = sweep.experiment(str(row["gear"]), float(row["speed_mps"]), float(row["angle_deg"]), int(row["trial"]))
    check = chosen.check.model_copy(update={"effort": 0.01, "n_fresh": 5})
    result = ivl_run.run(chosen.model_copy(update={"check": check}), tmp_path / "run")
    assert result.summary["mu"] == [row[f"mu_{name}"] for name in NAMES]


def test_a_sweep_is_summarised_reported_and_exported(capsys: Capture, swept: Path, tmp_path: Path) -> None:
    assert summary._learned(store.read_trials(swept))["cells"] == 2
    page = printed(capsys, "report", str(swept), "--out", str(tmp_path / "page.html"))
    assert page["landings"] > 0
    assert page["landings_that_differ"] == 0
    data = packed(tmp_path / "page.html")
    assert data["claims"] is None
    assert len(data["parameters"]) == 6
    exported = printed(capsys, "export", str(swept), "--angle", "60", "--out", str(tmp_path / "best.mcap"))
    assert Path(exported["files"][0]).stat().st_size > 0


def test_figures_of_the_paper_are_those_of_its_form(capsys: Capture, swept: Path) -> None:
    text = refused(capsys, "figs", str(swept))
    assert "has policies of the form six; figures are those of constant (`ivl report` shows any)" in text


def test_a_sweep_by_the_command_line(capsys: Capture, tmp_path: Path) -> None:
    """From the YAML file to the tables, with workers of its own."""
    sweep = {**SIX, "gears": ["wide_short"], "speeds_mps": [2.5], "angles_deg": [60.0, 90.0], "trials": 2}
    for name in ("gear", "speed_mps", "angle_deg", "check"):
        del sweep[name]
    path = tmp_path / "sweep.yaml"
    path.write_text(json.dumps(sweep))
    told = printed(capsys, "sweep", str(path), "--out", str(tmp_path / "run"))
    assert (told["trials"], told["failed"], told["cells"]) == (4, 0, 2)
    best = store.read_frame(tmp_path / "run", "trials")[[f"best_{name}" for name in NAMES]].to_numpy()
    assert np.isfinite(best).all()
