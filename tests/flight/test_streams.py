"""Log blocks at different rates, lost packets, several flights in a file, several files in a folder."""

from pathlib import Path

import numpy as np
import pytest
from logs import Truth, cfclient_text, usd_bytes
from test_formats import BLOCKS

from ivl.flight import importer
from ivl.flight.log import Given
from ivl.flight.schema import POSE
from ivl.flight.store import Flights


def read(*paths: Path, form: str = "cfclient") -> Flights:
    return importer.run(paths, form, Given())


def later(truth: Truth, shift_s: float) -> Truth:
    return Truth({**truth.columns, "t_s": truth["t_s"] + shift_s})


def write(path: Path, truth: Truth, names: list[str], every: int = 1, start_ms: int = 5000) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(cfclient_text(truth, names, every, start_ms))
    return path


def joined(*texts: str) -> str:
    """Logs one after the other under one header."""
    header, *_ = texts[0].splitlines()
    return "\n".join([header, *(line for text in texts for line in text.splitlines()[1:])]) + "\n"


def test_slower_blocks_are_interpolated_where_things_move_and_held_where_they_do_not(
    truth: Truth, tmp_path: Path
) -> None:
    write(tmp_path / "run" / "motion.csv", truth, BLOCKS["motion"])
    write(tmp_path / "run" / "attitude.csv", truth, BLOCKS["attitude"], every=2)
    write(tmp_path / "run" / "imu.csv", truth, BLOCKS["imu"], every=2)
    write(tmp_path / "run" / "app.csv", truth, BLOCKS["app"], every=5)
    (flight,) = read(tmp_path / "run")
    n = len(flight)
    assert flight["p_z_m"] == pytest.approx(truth["p_z_m"][:n])
    odd = slice(1, n - 1, 2)
    middle = (truth["w_y_radps"][0 : n - 2 : 2] + truth["w_y_radps"][2:n:2]) / 2
    assert flight["w_y_radps"][odd][: len(middle)] == pytest.approx(middle)
    q = flight.stack("q", "xyzw")
    assert np.linalg.norm(q, axis=1) == pytest.approx(1.0)
    assert flight["phase"].tolist() == truth["phase"][(np.arange(n) // 5) * 5].tolist()
    clock = read(tmp_path / "run").manifest.clock
    assert "imu every 20 ms" in clock
    assert "the rows are those of motion" in clock


def test_interpolated_attitude_crosses_a_change_of_sign(truth: Truth, tmp_path: Path) -> None:
    """The firmware may send q and then -q, which is the same attitude; the mean of both is none."""
    columns = dict(truth.columns)
    sign = np.where(np.arange(len(truth)) // 10 % 2, -1.0, 1.0)
    for axis in "xyzw":
        columns[f"q_{axis}"] = columns[f"q_{axis}"] * sign
    write(tmp_path / "run" / "motion.csv", truth, BLOCKS["motion"])
    write(tmp_path / "run" / "attitude.csv", Truth(columns), BLOCKS["attitude"], every=2)
    (flight,) = read(tmp_path / "run")
    n = len(flight)
    same = np.abs(sum(flight[f"q_{axis}"] * truth[f"q_{axis}"][:n] for axis in "xyzw"))
    assert same.min() > 0.99


def test_lost_packets_are_no_flight_of_their_own(truth: Truth, tmp_path: Path) -> None:
    path = write(tmp_path / "a.csv", truth, [*BLOCKS["motion"], *BLOCKS["attitude"]])
    lines = path.read_text().splitlines()
    del lines[40:60], lines[100]
    path.write_text("\n".join(lines) + "\n")
    (flight,) = read(path)
    assert len(flight) == len(truth) - 21


def test_block_that_falls_silent_ends_the_pose(truth: Truth, tmp_path: Path) -> None:
    write(tmp_path / "run" / "motion.csv", truth, BLOCKS["motion"])
    half = truth.part(slice(0, 100))
    write(tmp_path / "run" / "attitude.csv", half, BLOCKS["attitude"])
    (flight,) = read(tmp_path / "run")
    assert len(flight) == 100


def test_flights_are_cut_at_pauses_of_the_clock(truth: Truth, tmp_path: Path) -> None:
    names = BLOCKS["motion"]
    path = tmp_path / "a.csv"
    path.write_text(joined(*(cfclient_text(later(truth, s), names) for s in (0.0, 10.0, 20.0))))
    flights = read(path)
    assert [f.label for f in flights] == ["a#1", "a#2", "a#3"]
    for flight in flights:
        assert flight["p_z_m"] == pytest.approx(truth["p_z_m"])
        assert flight["t_s"] == pytest.approx(truth["t_s"])


def test_flights_are_cut_where_the_flight_core_is_ready_again(truth: Truth, tmp_path: Path) -> None:
    def with_hover(shift_s: float) -> Truth:
        columns = {name: np.concatenate([np.full(30, v[0]), v]) for name, v in truth.columns.items()}
        columns["t_s"] = np.arange(len(truth) + 30) * 0.01 + shift_s
        columns["phase"][:30] = 1
        return Truth(columns)

    names = [*BLOCKS["motion"], *BLOCKS["app"]]
    length_s = (len(truth) + 30) * 0.01
    path = tmp_path / "a.csv"
    path.write_text(joined(*(cfclient_text(with_hover(i * length_s), names) for i in range(3))))
    flights = read(path)
    assert len(flights) == 3
    for flight in flights:
        assert len(flight) == len(truth) + 30
        assert flight.info["t_trigger_s"] == pytest.approx(truth.t_trigger_s + 0.3)
        assert flight["phase"][0] == 1


def test_flights_are_cut_where_the_flight_core_is_back_before_a_flip(truth: Truth, tmp_path: Path) -> None:
    """A log too slow to see `ready` sees the approach after the end of the last flight."""
    names = [*BLOCKS["motion"], "ivl.phase"]
    path = tmp_path / "a.csv"
    path.write_text(joined(*(cfclient_text(later(truth, i * len(truth) * 0.01), names) for i in range(2))))
    flights = read(path)
    assert [len(flight) for flight in flights] == [len(truth)] * 2


def test_without_phases_a_new_policy_begins_a_flight(truth: Truth, tmp_path: Path) -> None:
    names = [*BLOCKS["motion"], "ivl.policy_seq", "ivl.n_trigger"]
    texts = []
    for i in range(2):
        text = cfclient_text(later(truth, i * len(truth) * 0.01), names)
        texts.append(text.replace(",7,", f",{7 + i},"))
    path = tmp_path / "a.csv"
    path.write_text(joined(*texts))
    flights = read(path)
    assert len(flights) == 2
    assert [f.info["t_trigger_s"] for f in flights] == pytest.approx([truth.t_trigger_s] * 2)
    assert flights[0]["triggered"].tolist() == truth["triggered"].tolist()


def test_clock_of_24_bits_starts_over(truth: Truth, tmp_path: Path) -> None:
    path = write(tmp_path / "a.csv", truth, BLOCKS["motion"], start_ms=2**24 - 500)
    assert "\n16777206," in path.read_text()
    assert "\n0," in path.read_text()
    (flight,) = read(path)
    assert flight["t_s"] == pytest.approx(truth["t_s"])


def test_files_of_one_folder_with_the_same_variables_at_the_same_time_are_flights_of_their_own(
    truth: Truth, tmp_path: Path
) -> None:
    for name, scale in (("first", 1.0), ("second", 2.0)):
        columns = {**truth.columns, "p_z_m": scale * truth["p_z_m"]}
        write(tmp_path / "run" / f"{name}-a.csv", Truth(columns), BLOCKS["motion"])
        write(tmp_path / "run" / f"{name}-b.csv", Truth(columns), BLOCKS["imu"])
    flights = read(tmp_path / "run")
    assert [f.label for f in flights] == ["first-a", "second-a"]
    for flight, scale in zip(flights, (1.0, 2.0), strict=True):
        assert flight["p_z_m"] == pytest.approx(scale * truth["p_z_m"])
        assert flight.has("w_x_radps", "f_x_mps2")


def test_variable_that_is_in_two_blocks_is_taken_from_the_faster(truth: Truth, tmp_path: Path) -> None:
    write(tmp_path / "run" / "motion.csv", truth, BLOCKS["motion"])
    write(tmp_path / "run" / "slow.csv", truth, ["stateEstimate.z", "pm.vbat"], every=10)
    (flight,) = read(tmp_path / "run")
    assert flight["p_z_m"] == pytest.approx(truth["p_z_m"])
    assert flight.has("battery_V")


def test_files_of_two_folders_are_two_recordings(truth: Truth, tmp_path: Path) -> None:
    paths = [write(tmp_path / name / "all.csv", truth, BLOCKS["motion"]) for name in ("one", "two")]
    flights = read(*paths)
    assert [f.label for f in flights] == ["all#1", "all#2"]


def test_part_of_a_vector_is_better_than_none(truth: Truth, tmp_path: Path) -> None:
    path = write(tmp_path / "a.csv", truth, ["stateEstimate.z", "stateEstimate.vz", "stateEstimate.qw", "acc.z"])
    (flight,) = read(path)
    assert {name for name in POSE if flight.has(name)} == {"p_z_m", "v_z_mps"}
    assert flight.has("f_z_mps2")


def test_events_with_the_pose_decide_the_rows(truth: Truth, tmp_path: Path) -> None:
    path = tmp_path / "log00"
    kinds = {"estPose": (BLOCKS["tracking"], 1), "fixedFrequency": ([*BLOCKS["motion"], *BLOCKS["imu"]], 2)}
    path.write_bytes(usd_bytes(truth, kinds))
    (flight,) = read(path, form="usd")
    assert len(flight) == (len(truth) + 1) // 2
    assert flight["v_z_mps"] == pytest.approx(truth["v_z_mps"][::2], abs=1e-5)
    assert flight["track_p_z_m"][1:-1] == pytest.approx(truth["track_p_z_m"][2:-1:2], abs=1e-3)


def test_what_the_app_has_not_is_nothing(truth: Truth, tmp_path: Path) -> None:
    columns = dict(truth.columns)
    for name in ("d_ceil_m", "rrev_per_s", "of_y_radps"):
        columns[name] = columns[name] * (np.arange(len(truth)) >= 20)
    path = write(tmp_path / "a.csv", Truth(columns), [*BLOCKS["motion"], *BLOCKS["app"]])
    (flight,) = read(path)
    for name in ("d_ceil_m", "rrev_per_s", "of_y_radps"):
        assert np.isnan(flight[name][:20]).all()
        assert np.isfinite(flight[name][20:]).all()


def test_check_of_signs_finds_a_wrong_one(truth: Truth, tmp_path: Path) -> None:
    path = write(
        tmp_path / "a.csv", truth, [*BLOCKS["motion"], "stabilizer.roll", "stabilizer.pitch", "stabilizer.yaw"]
    )
    imu = write(tmp_path / "b.csv", truth, BLOCKS["imu"])
    assert not any(note.startswith("WARNING") for note in read(path, imu).manifest.notes)
    lines = path.read_text().splitlines()
    at = lines[0].split(",").index("stabilizer.pitch")
    rows = [line.split(",") for line in lines]
    for row in rows[1:]:
        row[at] = str(-float(row[at]))
    path.write_text("\n".join(",".join(row) for row in rows) + "\n")
    warnings = [note for note in read(path, imu).manifest.notes if note.startswith("WARNING")]
    assert len(warnings) == 1
    assert "about y" in warnings[0]
