"""Each form of log, written from a landing with known truth, comes back as that truth: every column, unit and sign."""

import datetime
import math
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
import pytest
from logs import (
    Truth,
    cfclient_text,
    habas_rows,
    habas_text,
    recording_text,
    states_npz,
    states_text,
    topic_text,
    usd_bytes,
    variables,
)

import ivl
from ivl import tracefile
from ivl.flight import importer, store
from ivl.flight.formats import FORMATS
from ivl.flight.log import Given, parse_rule
from ivl.flight.schema import POSE, SAMPLES
from ivl.flight.store import Flight, Flights


def read(form: str, *paths: Path, **given: object) -> Flights:
    """Import, write and read again."""
    flights = importer.run(paths, form, Given(**given))  # type: ignore[arg-type]
    store.write(paths[0].parent / "flights", flights)
    return store.read(paths[0].parent / "flights")


def agree(flight: Flight, truth: Truth, names: Iterable[str], tolerance: float = 1e-9) -> None:
    """Every one of these columns is the truth, sample by sample; a quaternion may have the other sign."""
    assert flight["t_s"] == pytest.approx(truth["t_s"][: len(flight)] - truth["t_s"][0], abs=1e-6)
    assert len(flight) >= len(truth) - 1
    for name in names:
        mine, known = flight[name], truth[name][: len(flight)]
        if name.startswith(("q_", "track_q_")):
            stem = name[:-1]
            other = sum(flight[f"{stem}{axis}"] * truth[f"{stem}{axis}"][: len(flight)] for axis in "xyzw")
            mine = mine * np.sign(other)
        assert np.abs(known).max() > 1e-3, f"{name} must be something"
        assert mine == pytest.approx(known, abs=tolerance, rel=1e-9), name


def only(flight: Flight, names: Sequence[str]) -> None:
    """No other column has a number."""
    assert {name for name in SAMPLES if name not in ("flight", "t_s") and flight.has(name)} == set(names)


TRACK = [name for name in SAMPLES if name.startswith("track_")]
SET = [name for name in SAMPLES if name.startswith("set_")]
FORCE = ["f_x_mps2", "f_y_mps2", "f_z_mps2"]
THRUST = [f"thrust_{i}_N" for i in range(1, 5)]


def test_truth_has_no_component_that_is_zero_or_equal_to_another(truth: Truth) -> None:
    for name, values in truth.columns.items():
        assert np.abs(values).max() > 1e-3, name
    for first in truth.columns:
        same = [other for other in truth.columns if other > first and np.allclose(truth[first], truth[other])]
        assert same == []


def test_habas2021(truth: Truth, tmp_path: Path) -> None:
    path = tmp_path / "july.csv"
    path.write_bytes(habas_text(habas_rows(truth)).encode())
    (flight,) = read("habas2021", path)
    known = [*POSE, *TRACK, *SET, "rrev_per_s", "of_x_radps", "of_y_radps", "triggered", "battery_V", "thrust_cmd_N"]
    known += ["moment_cmd_x_Nm", "moment_cmd_y_Nm"]
    agree(flight, truth, known)
    only(flight, known)
    info = flight.info
    assert (info["label"], info["source"], info["usable"], info["note"]) == ("ep0-run0", "july.csv", True, "")
    assert (info["threshold_per_s"], info["moment_Nmm"], info["n_legs"]) == (4.8, 8.0, 4)
    assert info["speed_mps"] == pytest.approx(2.5)
    assert info["angle_deg"] == pytest.approx(60.0)
    assert info["t_trigger_s"] == pytest.approx(truth.t_trigger_s)
    assert info["trigger_age_s"] == pytest.approx(0.005 + 0.005), "a row tells what came within the 10 ms before it"
    assert info["h_plane_m"] == truth.h_plane_m
    assert (info["reward"], info["judged_by"]) == (110.0, "reward 100")


def test_recording(truth: Truth, tmp_path: Path) -> None:
    path = tmp_path / "landing.csv"
    path.write_text(recording_text(truth))
    (flight,) = read("ivl", path, threshold_per_s=4.8, moment_Nmm=8.0, speed_mps=2.5, outcomes=(3,), judged_by="me")
    known = [*POSE, *FORCE, *THRUST, "d_ceil_m", "phase", "triggered"]
    agree(flight, truth, known, 1e-6)
    only(flight, known)
    info = flight.info
    assert (info["threshold_per_s"], info["moment_Nmm"], info["speed_mps"]) == (4.8, 8.0, 2.5)
    assert (info["n_legs"], info["judged_by"], info["h_plane_m"]) == (3, "me", truth.h_plane_m)
    assert info["t_trigger_s"] == pytest.approx(truth.t_trigger_s)


@pytest.mark.parametrize("suffix", [".csv", ".npz"])
def test_trace(suffix: str, tmp_path: Path) -> None:
    world = ivl.World("habas2021", "wide_short", "as_simulated")
    trace = world.trace(2.5, 60.0, 4.8, 8.0)
    rows, path = trace.rows, tmp_path / f"landing{suffix}"
    tracefile.write(path, rows)
    (flight,) = read("trace", path)
    for i, axis in enumerate("xyz"):
        for name in (f"p_{axis}_m", f"track_p_{axis}_m"):
            assert flight[name].tolist() == rows.p_WB_m[:, i].tolist()
        assert flight[f"v_{axis}_mps"].tolist() == rows.v_WB_mps[:, i].tolist()
        assert flight[f"w_{axis}_radps"].tolist() == rows.w_B_radps[:, i].tolist()
    for i in range(4):
        assert flight[f"q_{'xyzw'[i]}"] == pytest.approx(rows.q_WB[:, i], abs=1e-12)
        assert flight[f"thrust_{i + 1}_N"].tolist() == rows.thrust_cmd_N[:, i].tolist()
    seen = rows.d_sensed_m > 0
    assert flight["d_ceil_m"][seen].tolist() == rows.d_sensed_m[seen].tolist()
    assert np.isnan(flight["d_ceil_m"][~seen]).all()
    info = flight.info
    assert (info["n_legs"], info["judged_by"]) == (int(trace.outcome.n_legs), "simulator")
    assert info["body_contact"] == trace.outcome.body_contact
    assert info["t_trigger_s"] == pytest.approx(float(trace.outcome.t_trigger_s), abs=0.003)
    assert info["h_surface_m"] == world.params.values["world.ceiling_height"]


BLOCKS = {
    "motion": [f"stateEstimate.{name}" for name in ("x", "y", "z", "vx", "vy", "vz")],
    "attitude": [f"stateEstimate.q{axis}" for axis in "xyzw"],
    "imu": [f"{group}.{axis}" for group in ("gyro", "acc") for axis in "xyz"],
    "tracking": [*(f"locSrv.{axis}" for axis in "xyz"), *(f"locSrv.q{axis}" for axis in "xyzw")],
    "setpoint": [*(f"ctrltarget.{axis}" for axis in "xyz"), *(f"ctrltarget.v{axis}" for axis in "xyz")],
    "motors": [f"motor.m{i}{end}" for end in ("", "_rpm") for i in range(1, 5)],
    "app": ["ivl.phase", "ivl.d_ceil", "ivl.rrev", "ivl.of_y", "ivl.theta0", "ivl.theta1", "ivl.policy_seq"],
    "thrusts": [*(f"ivl.thrust{i}" for i in range(1, 5)), "ivl.thrust_total", "ivl.pitch_moment", "pm.vbat"],
}
"""Log blocks; the radio carries 26 bytes in each."""
FIRMWARE = [
    *(name for name in SAMPLES if name not in ("flight", "t_s", "of_x_radps", "moment_cmd_x_Nm", "moment_cmd_z_Nm"))
]


@pytest.mark.parametrize("named", ["folder", "files"])
def test_cfclient_with_every_block_in_a_file_of_its_own(truth: Truth, tmp_path: Path, named: str) -> None:
    folder = tmp_path / "20260801T10-10-10"
    folder.mkdir()
    for block, names in BLOCKS.items():
        (folder / f"{block}-20260801T10-11-00.csv").write_text(cfclient_text(truth, names))
    (flight,) = read("cfclient", *([folder] if named == "folder" else sorted(folder.iterdir())))
    agree(flight, truth, FIRMWARE)
    only(flight, FIRMWARE)
    info = flight.info
    assert (info["threshold_per_s"], info["moment_Nmm"]) == (4.8, pytest.approx(8.0))
    assert info["h_plane_m"] == truth.h_plane_m
    assert info["t_trigger_s"] == pytest.approx(truth.t_trigger_s)
    assert math.isnan(info["n_legs"])


def test_file_that_the_client_itself_writes(truth: Truth, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import cfclient
    from cfclient.utils.logdatawriter import LogWriter
    from cflib.crazyflie.log import LogConfig

    monkeypatch.setattr(cfclient, "config_path", str(tmp_path))
    block = LogConfig("my/block", 10)
    for name in BLOCKS["motion"]:
        block.add_variable(name, "float")
    writer = LogWriter(block, datetime.datetime(2026, 8, 1))
    writer.start()
    values = variables(truth)
    for i, t_s in enumerate(truth["t_s"]):
        row = {name: float(values[name][i]) for name in BLOCKS["motion"]}
        block.data_received_cb.call(round(1000 * t_s), row, block)
    writer.stop()
    (flight,) = read("cfclient", tmp_path / "logdata" / "20260801T00-00-00")
    assert flight.label.startswith("my-block-")
    agree(flight, truth, POSE[:6])


def test_usd_with_several_events(truth: Truth, tmp_path: Path) -> None:
    path = tmp_path / "log07"
    path.write_bytes(usd_bytes(truth, {block: (names, 1) for block, names in BLOCKS.items()}))
    (flight,) = read("usd", path)
    # events of one sample come 10 us apart
    assert flight.label == "log07"
    for name in (*POSE, *TRACK, *FORCE):
        sign = -1.0 if "q_" in name and flight[name][0] * truth[name][1] < 0 else 1.0
        assert flight[name] == pytest.approx(sign * truth[name][1 : 1 + len(flight)], abs=0.05), name
    path.write_bytes(usd_bytes(truth, {"fixedFrequency": ([name for b in BLOCKS.values() for name in b], 1)}))
    (flight,) = importer.run([path], "usd", Given()).flights
    agree(flight, truth, FIRMWARE, 2e-6 * 100)
    only(flight, FIRMWARE)


def test_usd_of_version_1_counts_milliseconds(truth: Truth, tmp_path: Path) -> None:
    path = tmp_path / "log00"
    path.write_bytes(usd_bytes(truth, {"fixedFrequency": (BLOCKS["motion"], 1)}, version=1))
    (flight,) = read("usd", path)
    agree(flight, truth, POSE[:6], 1e-5)


def test_firmware_angles_become_the_attitude(truth: Truth, tmp_path: Path) -> None:
    path = tmp_path / "stabilizer.csv"
    path.write_text(cfclient_text(truth, [*BLOCKS["motion"], "stabilizer.roll", "stabilizer.pitch", "stabilizer.yaw"]))
    (flight,) = read("cfclient", path)
    agree(flight, truth, [f"q_{axis}" for axis in "xyzw"], 1e-6)


def test_pitch_of_the_firmware_is_positive_nose_up(truth: Truth) -> None:
    """Of the writer: before the trigger the vehicle leans back, and body x points above the horizon."""
    x, y, z, w = (truth[f"q_{axis}"] for axis in "xyzw")
    nose_up = 2 * (x * z - w * y)
    pitch = variables(truth)["stabilizer.pitch"]
    assert (np.sign(pitch[np.abs(pitch) > 0.1]) == np.sign(nose_up[np.abs(pitch) > 0.1])).all()


def test_compressed_state(truth: Truth, tmp_path: Path) -> None:
    names = [name for name in variables(truth) if name.startswith("stateEstimateZ")]
    path = tmp_path / "z.csv"
    path.write_text(cfclient_text(truth, names))
    (flight,) = read("cfclient", path)
    agree(flight, truth, [*POSE[:6], *POSE[10:]], 0.0011)
    agree(flight, truth, POSE[6:10], 0.003)


@pytest.mark.parametrize(
    ("names", "columns", "tolerance"),
    [
        ([f"kalman.state{axis}" for axis in "XYZ"], POSE[:3], 1e-9),
        ([f"kalman.q{i}" for i in range(4)], POSE[6:10], 1e-9),
        ([f"lighthouse.{axis}" for axis in "xyz"], TRACK[:3], 1e-9),
        ([f"ext_pos.{axis}" for axis in "XYZ"], TRACK[:3], 1e-9),
        ([f"ctrltargetZ.{axis}" for axis in ("x", "y", "z", "vx", "vy", "vz")], SET, 0.0011),
        ([f"rpm.m{i}" for i in range(1, 5)], [f"rotor_{i}_radps" for i in range(1, 5)], 1e-9),
        ([f"ivl.pwm{i}" for i in range(1, 5)], [f"pwm_{i}_norm" for i in range(1, 5)], 1e-9),
        (["pm.vbatMV"], ["battery_V"], 0.00051),
        (["ivl.n_trigger"], ["triggered"], 1e-9),
    ],
)
def test_what_the_firmware_logs_by_another_name(
    truth: Truth, tmp_path: Path, names: list[str], columns: list[str], tolerance: float
) -> None:
    path = tmp_path / "a.csv"
    path.write_text(cfclient_text(truth, names))
    (flight,) = read("cfclient", path)
    agree(flight, truth, columns, tolerance)
    only(flight, columns)


def test_first_of_two_names_is_taken(truth: Truth, tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text(
        cfclient_text(truth, [*BLOCKS["motion"], "stateEstimateZ.x", "kalman.stateX", "pm.vbatMV", "pm.vbat"])
    )
    (flight,) = read("cfclient", path)
    agree(flight, truth, [*POSE[:6], "battery_V"])


@pytest.mark.parametrize("form", ["csv", "npz"])
def test_states_that_crazyswarm2_records(truth: Truth, tmp_path: Path, form: str) -> None:
    path = tmp_path / f"cf231.{form}"
    if form == "csv":
        path.write_text(states_text(truth))
    else:
        states_npz(truth, path)
    (flight,) = read("crazyswarm", path)
    known = [*POSE[:3], *POSE[6:10]]
    agree(flight, truth, known)
    only(flight, known)


def test_topics_of_crazyswarm(truth: Truth, tmp_path: Path) -> None:
    folder = tmp_path / "bag"
    folder.mkdir()
    pose = {f"field.pose.position.{axis}": f"p_{axis}_m" for axis in "xyz"}
    pose |= {f"field.pose.orientation.{axis}": f"q_{axis}" for axis in "xyzw"}
    tf = {f"field.transforms0.transform.translation.{axis}": f"track_p_{axis}_m" for axis in "xyz"}
    tf |= {f"field.transforms0.transform.rotation.{axis}": f"track_q_{axis}" for axis in "xyzw"}
    rates = {f"field.values{i}": f"w_{axis}_radps" for i, axis in enumerate("xyz")}
    speeds = {f"field.values{i}": f"v_{axis}_mps" for i, axis in enumerate("xyz")}
    for name, columns in (("pose", pose), ("tf", tf), ("log1", rates), ("log2", speeds)):
        (folder / f"{name}.csv").write_text(topic_text(truth, columns))
    maps = [f"w_{axis}_radps=log1:field.values{i}" for i, axis in enumerate("xyz")]
    maps += [f"v_{axis}_mps=log2:field.values{i}" for i, axis in enumerate("xyz")]
    (flight,) = read("crazyswarm", folder, rules=[parse_rule(text) for text in maps])
    known = [*POSE, *TRACK]
    agree(flight, truth, known, 1e-6)
    only(flight, known)


def test_tracked_positions_of_the_system_tests(truth: Truth, tmp_path: Path) -> None:
    rows = [f"{t},{x},{y},{z}" for t, x, y, z in zip(*(truth[n] for n in ("t_s", *TRACK[:3])), strict=True)]
    path = tmp_path / "tf.csv"
    path.write_text("# t, x, y, z\n" + "\n".join(rows) + "\n")
    (flight,) = read("crazyswarm", path)
    agree(flight, truth, TRACK[:3])
    only(flight, TRACK[:3])


def test_other_names_and_units_are_mapped(truth: Truth, tmp_path: Path) -> None:
    text = cfclient_text(truth, [*BLOCKS["motion"], *BLOCKS["attitude"]])
    text = text.replace("stateEstimate.z", "my.height").replace("stateEstimate.vz", "my.climb")
    path = tmp_path / "mine.csv"
    path.write_text(text)
    rules = [parse_rule("p_z_m=my.height*0.001"), parse_rule("v_z_mps=my.climb*-1")]
    (flight,) = read("cfclient", path, rules=rules)
    assert flight["p_z_m"] == pytest.approx(truth["p_z_m"] / 1000)
    assert flight["v_z_mps"] == pytest.approx(-truth["v_z_mps"])
    agree(flight, truth, [*POSE[:2], *POSE[3:5], *POSE[6:10]])


def test_every_format_has_a_name_and_a_line() -> None:
    assert list(FORMATS) == ["habas2021", "ivl", "trace", "cfclient", "crazyswarm", "usd"]
    assert all(form.doc and "\n" not in form.doc for form in FORMATS.values())
