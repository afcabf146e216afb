"""The program that writes the campaign's part of docs/RESULTS.md, and the part that is committed."""

import json
from collections.abc import Callable
from pathlib import Path

import marked
import numpy as np
import pandas as pd
import pytest
import results_sweep as tool

from ivl.analysis import campaign_text, compact, moment, separability
from ivl.layout import layout_of
from ivl.sweep import config, schema

LAYOUT = layout_of(config.load_sweep("sweeps/paper.yaml"))
Trials = Callable[..., pd.DataFrame]
Fly = Callable[[config.Sweep | config.PolicyMap, Path], Path]
ROOT = Path(__file__).parents[2]
GEARS = ("narrow_short", "wide_short", "wide_long")


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Few bootstraps and one classifier: what they give is tested elsewhere."""
    for module in (separability, moment):
        monkeypatch.setattr(module, "BOOTSTRAPS", 10)
    monkeypatch.setattr(campaign_text, "MODELS", {"svm": separability.MODELS["svm"]})


@pytest.fixture
def campaign(trials: Trials) -> pd.DataFrame:
    """Two vehicles, two learners; `ephe` gets stuck in one trial of five."""
    speeds, angles = (1.0, 2.0, 2.5, 4.0), (20.0, 60.0, 90.0)

    def rate(c: pd.DataFrame) -> np.ndarray:
        return np.where(c.v >= 2, 0.9, 0.1)

    def unlucky(c: pd.DataFrame) -> np.ndarray:
        return np.where((c.v >= 2) & (c.k > 0), 0.9, 0.1)

    parts = [trials(speeds, angles, rate=rate, gear=gear) for gear in GEARS]
    parts += [trials(speeds, angles, rate=unlucky, gear=gear, learner="ephe") for gear in GEARS]
    parts.append(trials(speeds, angles, rate=lambda c: rate(c) / 2, vehicle="crazyflie21"))
    return pd.concat(parts, ignore_index=True).assign(rollouts_to_rate=80.0)


@pytest.mark.usefixtures("quick")
def test_the_text_says_what_the_campaign_holds(campaign: pd.DataFrame) -> None:
    text = campaign_text.write(
        campaign, pd.DataFrame(), [{"git_commit": "0123456789abcdef", "library_sha256": "fe" * 32}]
    )
    assert "| habas2021 | table1, `bo` | 3 | 36 | 180 | 1 to 4 m/s, 20 to 90 deg |" in text
    assert "Commit 0123456789ab; simulator fefefefefefe." in text
    assert "| table1, `bo` | 180 | 0/135: 0.0 % (0.0 to 2.8) |" in text
    assert "| table1, `ephe` | 180 | 27/135: 20.0 % (14.1 to 27.5) |" in text
    assert "| all | 0.70 (0.70 to 0.70) | 0.35 (0.35 to 0.35) | -0.35 (-0.35 to -0.35) | 0.75 | 0.00 |" in text
    assert text.count("\n| 9 |") == 1
    assert text.count("(`ivl sweep sweeps/paper.yaml --set gear_set=table1 --learner ephe`)") == 9


def write_data(campaign: pd.DataFrame, path: Path) -> None:
    no_episodes = pd.DataFrame({f.name: [] for f in schema.schema(schema.EPISODES, LAYOUT)})
    path.mkdir()
    compact.write(compact.pack(campaign[campaign["vehicle"] == "habas2021"], no_episodes), path / "trials.parquet")


@pytest.mark.usefixtures("quick")
def test_check_finds_an_edited_number(
    campaign: pd.DataFrame, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_data(campaign, tmp_path / "data")
    results = tmp_path / "RESULTS.md"
    results.write_text(f"# Before\n\n{tool.BEGIN}\nold\n{tool.END}\n\n# After\n", encoding="utf-8")
    options = ["--data", str(tmp_path / "data"), "--results", str(results)]
    assert tool.main([*options, "check"]) == 1
    assert tool.main([*options, "write"]) == 0
    text = results.read_text(encoding="utf-8")
    assert text.startswith("# Before\n")
    assert text.endswith("# After\n")
    assert tool.main([*options, "check"]) == 0
    results.write_text(text.replace("27/135", "26/135"), encoding="utf-8")
    assert tool.main([*options, "check"]) == 1
    assert "26/135" in capsys.readouterr().out


@pytest.mark.parametrize("text", ["", "{begin}", "{end}{begin}", "{begin}{end}{begin}{end}"])
def test_a_file_without_its_marks_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="once each"):
        marked.replace(text.format(begin=tool.BEGIN, end=tool.END), "new", tool.BEGIN, tool.END)


def test_real_run_folders_are_collected(fly: Fly, tmp_path: Path) -> None:
    small = ["speeds_mps=[2.5, 4.0]", "angles_deg=[60.0, 90.0]", "gears=[wide_short]"]
    sweep = fly(config.load_sweep("sweeps/smoke.yaml", [*small, "budget=24"]), tmp_path / "sweep")
    axes = ["d_ceil_m=[0.3, 0.5, 0.8]", "moment_Nmm=[6.0, 8.0, 10.0]", "n_rollouts=2"]
    chart = fly(config.load_map("sweeps/map.yaml", [*small, *axes]), tmp_path / "map")
    assert tool.main(["--data", str(tmp_path / "data"), "collect", str(sweep), "--map", str(chart)]) == 0
    data = tool.read(tmp_path / "data")
    assert len(data.trials) == 8
    assert len(data.states) == 12
    assert data.trials["rollouts_to_rate"].notna().sum() <= 8
    assert [run["gear_set"] for run in data.runs] == ["as_simulated"] * 2
    assert json.loads((tmp_path / "data" / "runs.json").read_text(encoding="utf-8"))[0]["learner"] == "bo"
    assert "Policy maps" in tool.section(data)
    # another vehicle joins, the same one replaces itself, and nothing else goes
    other = fly(
        config.load_sweep("sweeps/smoke.yaml", [*small, "budget=24", "vehicle=crazyflie21"]), tmp_path / "other"
    )
    for _ in range(2):
        assert tool.main(["--data", str(tmp_path / "data"), "collect", str(other), "--keep"]) == 0
    both = tool.read(tmp_path / "data")
    assert both.trials.groupby("vehicle").size().to_dict() == {"habas2021": 8, "crazyflie21": 8}
    assert len(both.states) == 12
    assert sorted(run["vehicle"] for run in both.runs) == ["crazyflie21", "habas2021", "habas2021"]


def test_the_committed_results_are_those_of_the_committed_data(capsys: pytest.CaptureFixture[str]) -> None:
    assert tool.main(["check"]) == 0, capsys.readouterr().out


def test_the_committed_data_are_small() -> None:
    files = list((ROOT / "docs" / "data").glob("*"))
    assert sum(file.stat().st_size for file in files) < 500_000
