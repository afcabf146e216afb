"""What the study's logs of 2021 have beside samples: attempts, notes, failures, broken telemetry, a standing clock."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from logs import Truth, habas_rows, habas_text

from ivl.flight import importer
from ivl.flight.log import ALL, Given
from ivl.flight.store import Flights


def read(path: Path, rows: list[dict[str, Any]], attempts: str = "last", **text: Any) -> Flights:
    path.write_bytes(habas_text(rows, **text).encode())
    return importer.run([path], "habas2021", Given(attempts=attempts))


def test_last_attempt_counts_and_all_can_be_had(truth: Truth, tmp_path: Path) -> None:
    rows = habas_rows(truth.part(slice(0, 1)), (1, 2), reward=0.9, z_max_m=0.19, error="Failed Rollout")
    rows += habas_rows(truth, (1, 2), reward=15.75, z_max_m=0.19, error="Failed Rollout", start_s=30.0)
    rows += habas_rows(truth, (1, 2), reward=35.12, z_max_m=2.12, start_s=90.0)
    rows += habas_rows(truth, (1, 3), reward=9.05, z_max_m=1.9, start_s=140.0)
    path = tmp_path / "trial.csv"
    last = read(path, rows)
    assert [f.label for f in last] == ["ep1-run2", "ep1-run3"]
    assert [f.info["n_legs"] for f in last] == [2, 0]
    assert [f.info["usable"] for f in last] == [True, True]
    every = read(path, rows, ALL)
    assert [f.label for f in every] == ["ep1-run2-try1", "ep1-run2-try2", "ep1-run2-try3", "ep1-run3"]
    assert [f.info["usable"] for f in every] == [False, False, True, True]
    assert every[0].info["note"] == "the log says: Failed Rollout; no more than 1 sample"
    assert all(f["t_s"][0] == 0.0 for f in every)


def test_jump_of_the_clock_alone_starts_another_attempt(truth: Truth, tmp_path: Path) -> None:
    rows = habas_rows(truth, summary=False, start_s=3.0)[:-1] + habas_rows(truth, start_s=50.0)
    every = read(tmp_path / "a.csv", rows, ALL)
    assert [(f.label, f.info["n_legs"]) for f in every][1] == ("ep0-run0-try2", 4)
    assert math.isnan(every[0].info["n_legs"])
    assert every[0].info["note"] == "no summary row: outcome not known"


@pytest.mark.parametrize(
    ("reward", "z_max_m", "n_legs"),
    [
        (110.19, 2.14, 4),
        (160, 2.1, 4),
        (35.42, 2.19, 2),
        (60, 2.1, 2),
        (20.6, 2.23, 1),
        (10.23, 2.15, 0),
        (11.3, 2.06, 0),
    ],
)
def test_feet_from_the_return(truth: Truth, tmp_path: Path, reward: float, z_max_m: float, n_legs: int) -> None:
    (flight,) = read(tmp_path / "a.csv", habas_rows(truth, reward=reward, z_max_m=z_max_m))
    assert flight.info["n_legs"] == n_legs
    assert flight.info["judged_by"].startswith("reward ")


def test_telemetry_that_stops_while_the_vehicle_moves_makes_a_flight_unusable(truth: Truth, tmp_path: Path) -> None:
    rows = habas_rows(truth)
    at = int(np.argmax(truth["triggered"])) + 1
    state = ["x", "y", "z", "qw", "qx", "qy", "qz", "vx", "vy", "vz", "wx", "wy", "wz"]
    for row in rows[at : len(truth)]:
        row |= {name: rows[at - 1][name] for name in state}
    (flight,) = read(tmp_path / "a.csv", rows)
    assert not flight.info["usable"]
    stop_s = truth["t_s"][at - 1]
    assert flight.info["note"] == (
        f"the vehicle's state stands still from {stop_s:.2f} s on, while the tracking sees it move"
    )


def test_vehicle_that_hangs_still_is_no_broken_telemetry(truth: Truth, tmp_path: Path) -> None:
    columns = {name: np.concatenate([v, np.full(50, v[-1])]) for name, v in truth.columns.items()}
    columns["t_s"] = np.arange(len(truth) + 50) * 0.01
    (flight,) = read(tmp_path / "a.csv", habas_rows(Truth(columns)))
    assert flight.info["usable"]


def test_tracked_poses_that_repeat_are_no_measurements(truth: Truth, tmp_path: Path) -> None:
    rows = habas_rows(truth)
    tracked = [name for name in rows[0] if name.endswith("_Raw")]
    for row in rows[60:75]:
        row |= {name: rows[59][name] for name in tracked}
    (flight,) = read(tmp_path / "a.csv", rows)
    assert np.isnan(flight["track_p_z_m"][60:75]).all()
    assert np.isnan(flight["track_q_w"][60:75]).all()
    assert np.isfinite(flight["track_p_z_m"][[59, 75]]).all()
    assert np.isfinite(flight["p_z_m"]).all()


def test_hover_flip_without_clock_flag_and_summary(truth: Truth, tmp_path: Path) -> None:
    """The commands tell when it flipped and how hard: twice the policy's moment, and no thrust."""
    rows = habas_rows(truth, summary=False)[:-1]
    at = 80
    unit = 4 * 0.04 * math.sqrt(0.5) * 9.81
    for i, row in enumerate(rows):
        row |= {"t": 0.0, "flip_flag": "False", "v_d.x": 0.0, "v_d.y": 0.0, "v_d.z": 0.0}
        row |= {"F_thrust": 9.4 if i < at else 0.0, "My": 0.4 if i < at else -12.0 / unit}
    empty = dict.fromkeys(("x", "y", "z", "qx", "qy", "qz", "vx", "vy", "vz", "wx", "wy", "wz"), 0)
    rows.insert(0, {**rows[0], **empty, "qw": 1, "Volts": 0})
    flights = read(tmp_path / "hover.csv", rows, note="", end="\n")
    (flight,) = flights
    assert len(flight) == len(truth), "the row before the first packet is no sample"
    assert flight["t_s"] == pytest.approx(truth["t_s"])
    assert flight.info["t_trigger_s"] == pytest.approx(0.01 * at)
    assert flight.info["moment_Nmm"] == pytest.approx(6.0)
    assert math.isnan(flight.info["threshold_per_s"])
    assert flight.info["speed_mps"] == 0.0
    assert math.isnan(flight.info["angle_deg"])
    assert math.isnan(flight.info["n_legs"])
    assert "trigger and moment read from the commands" in flight.info["note"]
    assert any("clock of the log stands still" in note for note in flights.manifest.notes)


def test_calibration_with_a_marker_row_that_is_one_field_short(truth: Truth, tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    text = habas_text(habas_rows(truth))
    assert ",,Impact Data" in text
    path.write_bytes(text.replace(",,Impact Data", ",Impact Data").encode())
    assert len(importer.run([path], "habas2021", Given())) == 1


def test_several_files_tell_their_flights_apart(truth: Truth, tmp_path: Path) -> None:
    paths = [tmp_path / "a.csv", tmp_path / "b.csv"]
    for path in paths:
        path.write_bytes(habas_text(habas_rows(truth) + habas_rows(truth, (0, 1), start_s=50.0)[:-1]).encode())
    flights = importer.run(paths, "habas2021", Given())
    assert [f.label for f in flights] == ["ep0-run0#1", "ep0-run1#1", "ep0-run0#2", "ep0-run1#2"]
    assert [f.info["source"] for f in flights] == ["a.csv", "a.csv", "b.csv", "b.csv"]


def test_manifest_says_what_the_log_says_against_itself(truth: Truth, tmp_path: Path) -> None:
    good = read(tmp_path / "a.csv", habas_rows(truth)).manifest.notes
    assert sum(note.startswith("Checked: ") for note in good) == 3
    assert not any(note.startswith("WARNING") for note in good)
    rows = habas_rows(truth)
    for row in rows[: len(truth)]:
        row["wy"] = -row["wy"]
        row["vz"] = 100 * row["vz"]
    bad = [note for note in read(tmp_path / "a.csv", rows).manifest.notes if note.startswith("WARNING")]
    assert len(bad) == 2
    assert "the rates do not fit the turning of the attitude (slope -1.0" in bad[0]
    assert " about y" in bad[0]
    assert "the velocities do not fit the motion of the position (slope 0.01 along z)" in bad[1]
