"""docs/FLIGHTS.md is what its figures say, and the shipped vehicle still has them."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

from ivl import World, experiment

ROOT = Path(__file__).parents[2]
DATA = json.loads((ROOT / "docs/data/flights.json").read_text(encoding="utf-8"))
PAGE = (ROOT / "docs/FLIGHTS.md").read_text(encoding="utf-8")


def test_page_is_written_from_its_figures() -> None:
    run = subprocess.run(
        [sys.executable, ROOT / "tools/flights.py", "page", "--check"], cwd=ROOT, capture_output=True, check=False
    )
    assert run.returncode == 0, "write it anew: .venv/bin/python tools/flights.py page"


def test_no_recorded_row_is_kept() -> None:
    text = json.dumps(DATA)
    assert len(text) < 40_000
    assert set(DATA["sources"][0]) == {"file", "sha256"}
    assert "/" not in DATA["sources"][0]["file"]


def test_shipped_vehicle_has_what_was_identified() -> None:
    values = World("crazyflie21", "wide_short", "table1").params.values
    for name, found in DATA["fit"]["parameters"].items():
        low, high = found["interval_95"]
        assert low <= values[name] <= high, name
    assert values["rotor.drag_share"] == pytest.approx(DATA["spin_down"]["law"]["drag_share"], abs=0.05)
    assert values["battery.voltage"] == pytest.approx(DATA["battery"]["rest_V"], abs=0.03)


def test_the_experiment_draws_where_the_flights_landed() -> None:
    marks = experiment.load("experiments/paper_flight.yaml").flown
    landed = DATA["compared"]["now"]["windows"][0]["landed_threshold_per_s"]
    assert marks[0].rrev_c_per_s == pytest.approx(landed)
    assert (marks[1].rrev_c_per_s[0], marks[1].moment_y_Nmm[0]) == (4.0, 8.12)


def test_readme_quotes_the_page() -> None:
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    now, before = DATA["compared"]["now"], DATA["compared"]["before"]
    assert f"| {now['pitch_rms_deg']:.1f} deg; {before['pitch_rms_deg']:.0f} deg |" in readme
    assert f"| {now['landed_auc']:.2f}; {now['landed_brier']:.3f} |" in readme
    assert f"within {now['pitch_rms_deg']:.1f} degrees rms" in re.sub(r"\s+", " ", readme)
