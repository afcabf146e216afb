"""The program that writes what docs/RESULTS.md says of policies for every approach, and what is committed of it."""

import copy
import json
from pathlib import Path
from typing import Any

import numpy as np
import policies
import policy_measure
import policy_results as tool
import policy_text
import pytest
from policy_measure import Bench

from ivl import forms, native
from ivl.policy import general
from ivl.policy.cells import Effort

ROOT = Path(__file__).parents[2]
Capture = pytest.CaptureFixture[str]


@pytest.fixture
def committed() -> dict[str, Any]:
    data: dict[str, Any] = copy.deepcopy(tool.read(tool.DATA))
    return data


def test_the_committed_page_is_that_of_the_committed_data(capsys: Capture) -> None:
    assert tool.main(["check"]) == 0, capsys.readouterr().out


def test_an_edited_number_is_found(tmp_path: Path, capsys: Capture) -> None:
    page = tmp_path / "RESULTS.md"
    page.write_text(f"# Before\n\n{tool.BEGIN}\nold\n{tool.END}\n\n# After\n", encoding="utf-8")
    assert tool.main(["--results", str(page), "check"]) == 1
    assert tool.main(["--results", str(page), "write"]) == 0
    assert tool.main(["--results", str(page), "check"]) == 0
    text = page.read_text(encoding="utf-8")
    assert text.startswith("# Before\n")
    assert text.endswith("# After\n")
    changed = text.replace("| .", "| .0", 1)
    assert changed != text
    page.write_text(changed, encoding="utf-8")
    assert tool.main(["--results", str(page), "check"]) == 1
    assert "from the data" in capsys.readouterr().out


def test_a_worse_number_changes_its_verdict(committed: dict[str, Any]) -> None:
    ideal = committed["sensors"]["found"]["ideal"]["box"]
    for landed, interval, wanted in (
        (0.961, [0.95, 0.97], "| yes |"),
        (0.940, [0.92, 0.952], "| no, by 0.010 (within the interval) / yes |"),
        (0.930, [0.92, 0.941], "| no, by 0.020 / yes |"),
    ):
        ideal |= {"landed": landed, "landed_interval": interval, "clean": 0.935, "clean_interval": [0.92, 0.94]}
        (row,) = (
            line for line in policy_text.section(committed).splitlines() if line.startswith("| box, ideal sensing")
        )
        assert wanted in row


def test_a_part_that_is_missing_is_said(committed: dict[str, Any]) -> None:
    del committed["gears"]
    text = policy_text.section(committed)
    assert "*Part gears: not measured.*" in text
    assert "What the paper expects" not in text


@pytest.mark.parametrize(
    ("value", "low", "high", "least", "wanted"),
    [
        (0.95, 0.9, 1.0, True, "yes"),
        (0.94, 0.9, 0.96, True, "no, by 0.010 (within the interval)"),
        (0.94, 0.9, 0.949, True, "no, by 0.010"),
        (0.95, 0.9, 1.0, False, "yes"),
        (0.96, 0.94, 0.97, False, "no, by 0.010 (within the interval)"),
        (0.97, 0.96, 0.98, False, "no, by 0.020"),
    ],
)
def test_a_verdict_follows_its_rule(value: float, low: float, high: float, least: bool, wanted: str) -> None:
    assert policy_text.verdict(value, 0.95, low, high, least) == wanted


def test_every_policy_of_the_data_is_one_that_a_vehicle_accepts(committed: dict[str, Any]) -> None:
    found = [row for part in committed.values() for row in part["found"].values()]
    rows = [row for row in found if "theta" in row]
    rows += [row[which] for row in found for which in ("nominal", "family") if which in row]
    assert len(rows) > 5
    for row in rows:
        form = forms.by_name(row["form"])
        form.to_si(row["theta"])
        assert f"{form.crc(row['theta']):08x}" == row["crc"]


def test_a_policy_beside_the_best_of_each_cell_is_on_the_same_flights(tmp_path: Path, monkeypatch: Any) -> None:
    monkeypatch.setattr(policy_measure, "N_APPROACHES", 150)
    monkeypatch.setattr(
        policy_measure, "CELLS", general.MapSettings(n_speeds=2, n_angles=2, n_thresholds=12, moments_norm=[0.9])
    )
    found = policy_measure.beside_cells(Bench(tmp_path, lambda _: None), policies.by_hand(), Effort(n_choose=8))
    assert found["box"]["flights"] == found["best"]["flights"] == 150
    assert found["box"]["landed"] > 0.9
    assert 0.1 < found["best"]["clean"] <= found["best"]["landed"] < found["box"]["landed"]  # cells far too large
    ratio = found["ratio"]["landed"]
    assert ratio["value"] == pytest.approx(found["box"]["landed"] / found["best"]["landed"])
    assert ratio["interval"][0] <= ratio["value"] <= ratio["interval"][1]


def test_the_interval_of_a_ratio_knows_that_the_flights_are_the_same() -> None:
    rng = np.random.default_rng(3)
    true, covered, widths = 0.8 / 0.9, 0, []
    for _ in range(400):
        best = rng.random(300) < 0.9
        own = best & (rng.random(300) < 0.8 / 0.9)
        found = policy_measure.ratio(own, best)
        covered += found["interval"][0] <= true <= found["interval"][1]
        widths.append(found["interval"][1] - found["interval"][0])
    assert 0.92 < covered / 400 < 0.98
    apart = policy_measure.ratio(own, rng.permutation(best))
    assert apart["interval"][1] - apart["interval"][0] > np.mean(widths)


def test_a_policy_is_learned_once_for_equal_settings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    said: list[str] = []
    bench = Bench(tmp_path, said.append)
    small = (
        "form=polynomial2", "map.n_speeds=2", "map.n_angles=2", "map.n_thresholds=20", "map.moments_norm=[0.9]",
        "search.n_candidates=2", "search.n_approaches=2", "search.n_iterations=1", "search.n_select=5",
        "go.n_approaches=100", "go.n_held_out=100", "regions=[box]",
    )  # fmt: skip
    first, again, other = bench.learned(*small), bench.learned(*small), bench.learned(*small, "seed=1")
    assert first == again != other
    assert [text.startswith("learning: form=polynomial2") for text in said] == [True, True]
    # what another simulator has learned is not taken for it
    monkeypatch.setattr(type(native.library()), "digest", lambda _: "0" * 64)
    bench.learned(*small)
    assert len(said) == 3
    assert np.isfinite(first.values).all()


def test_measured_parts_join_those_that_are_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(policy_measure.PARTS, "forms", lambda _: {"x": {"theta": [1.23456789], "landed": 1.23456789}})
    path = tmp_path / "data.json"
    path.write_text(json.dumps({"gears": {"made": {}, "found": {}}}))
    assert tool.main(["--data", str(path), "measure", "forms", "--kept", str(tmp_path / "kept")]) == 0
    data = json.loads(path.read_text())
    assert set(data) == {"gears", "forms"}
    assert data["forms"]["found"] == {"x": {"theta": [1.23456789], "landed": 1.2346}}
    assert len(data["forms"]["made"]["library_sha256"]) == 64
    with pytest.raises(SystemExit) as error:
        tool.main(["measure", "froms"])
    assert error.value.code == 2
