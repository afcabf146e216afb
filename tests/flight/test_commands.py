"""`ivl flight import` and `ivl flight show` as they are called."""

import json
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from logs import Truth, cfclient_text, habas_rows, habas_text, recording_text
from test_formats import BLOCKS

from ivl import cli, experiment, recordings, run, store
from ivl.flight import store as flights
from ivl.seeds import Purpose, derive

Refused = Callable[..., str]


@pytest.fixture
def july(truth: Truth, tmp_path: Path) -> Path:
    """A log of the study with three rollouts, one of them failed."""
    rows = habas_rows(truth, (0, 0)) + habas_rows(truth, (0, 1), reward=35.4, start_s=20.0)
    rows += habas_rows(truth, (0, 2), reward=0.9, z_max_m=0.19, error="Failed Rollout", start_s=40.0)
    path = tmp_path / "july.csv"
    path.write_bytes(habas_text(rows).encode())
    return path


def imported(*words: str | Path, form: str, out: Path) -> None:
    assert cli.run(["flight", "import", *map(str, words), "--format", form, "--out", str(out)]) == 0


def test_import_tells_what_it_made(july: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "a[b]" / "flights"
    imported(july, form="habas2021", out=out)
    captured = capsys.readouterr()
    assert captured.out == f"{out}: 3 flights, 2 usable, 609 samples\n"
    assert captured.err == ""
    imported(july, "--json", form="habas2021", out=tmp_path / "again")
    data = json.loads(capsys.readouterr().out)
    assert {k: data[k] for k in ("flights", "usable", "samples")} == {"flights": 3, "usable": 2, "samples": 609}


def test_show(july: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    imported(july, "--licence", "MIT", form="habas2021", out=tmp_path / "out")
    capsys.readouterr()
    assert cli.run(["flight", "show", str(tmp_path / "out")]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= 80
    assert lines[0].split() == ["flight", "RREV_c", "M_yd", "m/s", "deg", "samples", "s", "legs", "judged", "by"]
    assert lines[1].split() == ["ep0-run0", "4.80", "8.00", "2.5", "60", "203", "2.0", "4", "reward", "100"]
    assert [line.split()[7] for line in lines[1:4]] == ["4", "2", "0"]
    assert "ep0-run2: NOT USABLE: the log says: Failed Rollout" in lines
    assert "flights: 3, 2 usable; feet at the end of the usable ones: 1 on 4, 1 on 2" in lines
    assert "licence: MIT" in lines
    assert any(line.startswith("note:    Checked: the rates fit") for line in lines)


def test_show_keeps_its_telling_columns_at_80_columns(
    truth: Truth, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    path = tmp_path / "stateEstimate-and-everything-else-20260801T10-11-00.csv"
    path.write_text(cfclient_text(truth, BLOCKS["motion"]))
    options = ("--rrev", "4.81", "--moment", "8.02", "--speed", "2.5", "--angle", "60")
    imported(
        path, *options, "--outcome", "3", "--judged-by", "two people with a camera", form="cfclient", out=tmp_path / "o"
    )
    capsys.readouterr()
    assert cli.run(["flight", "show", str(tmp_path / "o")]) == 0
    text = capsys.readouterr().out
    assert max(map(len, text.splitlines())) <= 80
    row = text.splitlines()[1]
    assert [word for word in row.split() if word[0].isdigit()][:7] == ["4.81", "8.02", "2.5", "60", "203", "2.0", "3"]


def test_show_as_json(july: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    imported(july, form="habas2021", out=tmp_path / "out")
    capsys.readouterr()
    assert cli.run(["flight", "show", str(tmp_path / "out"), "--json"]) == 0
    data = json.loads(capsys.readouterr().out)
    assert data["format"] == "habas2021"
    assert data["licence"] == "not stated"
    assert set(data) == {"folder", "format", "source", "licence", "frames", "clock", "absent", "notes", "flights"}
    first = data["flights"][0]
    assert (first["label"], first["n_legs"], first["usable"], first["n_samples"]) == ("ep0-run0", 4.0, True, 203)
    assert first["h_surface_m"] is None
    assert first["duration_s"] == pytest.approx(2.02)


def test_what_the_log_does_not_say_can_be_given(truth: Truth, tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text(cfclient_text(truth, [*BLOCKS["motion"], *BLOCKS["attitude"]]))
    options = [
        "--rrev",
        "4.8",
        "--moment",
        "8",
        "--speed",
        "2.5",
        "--angle",
        "60",
        "--h-plane",
        "3",
        "--h-surface",
        "3.03",
    ]
    imported(path, *options, "--outcome", "2", form="cfclient", out=tmp_path / "out")
    info = flights.read(tmp_path / "out")[0].info
    names = ("threshold_per_s", "moment_Nmm", "speed_mps", "angle_deg", "h_plane_m", "h_surface_m", "n_legs")
    assert [info[name] for name in names] == [4.8, 8.0, 2.5, 60.0, 3.0, 3.03, 2.0]
    assert info["judged_by"] == "operator"


def test_what_the_log_says_cannot_be_changed(refused: Refused, july: Path, tmp_path: Path) -> None:
    text = refused(july, form="habas2021", options=("--rrev", "4"))
    assert text == "flight ep0-run0: threshold_per_s: 4 was given, but the log says 4.8"
    assert refused(july, form="habas2021", options=("--h-plane", "2.1")).endswith("2.1 was given, but the log says 3")
    imported(july, "--rrev", "4.8", "--h-plane", "3.0", form="habas2021", out=tmp_path / "fine")


def test_outcomes_replace_those_of_the_log(july: Path, tmp_path: Path) -> None:
    imported(july, "--outcome", "-,4,-", "--judged-by", "video", form="habas2021", out=tmp_path / "out")
    found = [(f.info["n_legs"], f.info["judged_by"]) for f in flights.read(tmp_path / "out")]
    assert found == [(4.0, "reward 100"), (4.0, "video"), (0.0, "reward 0")]


@pytest.mark.parametrize(
    ("options", "text"),
    [
        (("--outcome", "4,2"), "--outcome: 2 outcomes for 3 flights"),
        (("--outcome", "4,2,7"), "--outcome: value 7: feet that hold (allowed 0 .. 4, or - for unknown)"),
        (("--outcome", "4,x,2"), "--outcome 4,x,2: value 'x' is neither a number of feet nor -"),
        (("--outcome", "4,-1,2"), "--outcome 4,-1,2: value '-1' is neither a number of feet nor -"),
        (("--attempts", "first"), "--attempts first: unknown (allowed last, all)"),
        (("--map", "p_z_m"), "--map p_z_m: expected COLUMN=VARIABLE or COLUMN=VARIABLE*FACTOR"),
        (("--map", "p_z_m="), "--map p_z_m=: expected COLUMN=VARIABLE or COLUMN=VARIABLE*FACTOR"),
        (("--map", "p_z_m=z*big"), "--map p_z_m=z*big: expected COLUMN=VARIABLE or COLUMN=VARIABLE*FACTOR"),
        (("--map", "height=z"), "--map height=z: height: no such column in the schema of flights"),
        (("--map", "t_s=z"), "--map t_s=z: t_s: no such column in the schema of flights"),
        (("--map", "p_z_m=zz"), "column zz is missing for --map; there are k_ep"),
        (("--rrev", "nan"), "--rrev: value nan: must be finite"),
        (("--speed", "inf"), "--speed: value inf: must be finite"),
    ],
)
def test_wrong_options(refused: Refused, july: Path, options: tuple[str, str], text: str) -> None:
    assert text in refused(july, form="habas2021", options=options)


def test_folder_that_is_there_is_refused_before_anything_is_read(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "mine.txt").write_text("x")
    words = ["flight", "import", str(tmp_path / "nothing"), "--format", "ivl", "--out", str(tmp_path / "out")]
    assert cli.run(words) == 2
    assert capsys.readouterr().err == f"ivl: {tmp_path}/out: is there already: name a new folder\n"
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["mine.txt"]


def test_warning_of_a_wrong_sign_is_seen(truth: Truth, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    columns = {**truth.columns, "w_y_radps": -truth["w_y_radps"]}
    path = tmp_path / "a.csv"
    path.write_text(recording_text(Truth(columns)))
    imported(path, form="ivl", out=tmp_path / "out")
    assert capsys.readouterr().err.startswith("WARNING: the rates do not fit the turning of the attitude (slope -1.0")


def test_missing_package_is_told(
    july: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    import sys

    for name in [name for name in sys.modules if name.startswith("ivl.flight")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    words = ["flight", "import", str(july), "--format", "habas2021", "--out", str(tmp_path / "out")]
    assert cli.run(words) == 1
    assert capsys.readouterr().err == "ivl: pyarrow is not installed: pip install 'ivl[flight]'\n"


@pytest.mark.parametrize("words", [["import"], ["show"]])
def test_help_teaches_with_examples(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.run(["flight", *words, "--help"]) == 0
    assert f"ivl flight {words[0]}" in capsys.readouterr().out.partition("Examples:")[2]


# ---- run folders


@pytest.fixture
def run_folder(truth: Truth, tmp_path: Path) -> Path:
    """A run of two episodes whose recordings were kept."""
    settings = ["learner.name=ephe_robust", "n_rollouts=4", "budget=8", "check.n_fresh=10", "check.effort=0.01"]
    settings += [
        "check.grid.rrev_c_per_s={lo: 4.5, hi: 5.0, step: 0.1}",
        "check.grid.moment_y_Nmm={lo: 7.0, hi: 9.0, step: 1.0}",
    ]
    chosen = experiment.load("experiments/paper_vertical.yaml", settings)
    folder = tmp_path / "run"
    run.run(chosen, folder)
    (folder / "recordings").mkdir()
    seed = derive(chosen.seed, Purpose.WORLD)
    for stream in (5, 2, 0):
        recordings.path_of(folder, seed, stream).write_text(recording_text(truth))
    entry = {"seed": seed, "stream": 2, "what": "flown", "battery_V": 3.91, "n_legs": 4}
    other = {"seed": seed, "stream": 5, "what": "discarded: x"}
    (folder / "flights.jsonl").write_text(json.dumps(other) + "\n" + json.dumps(entry) + "\n")
    return folder


def rows_of(folder: Path) -> store.RolloutRows:
    from ivl import native

    with store.RunStore.open_existing(folder, native.library().outcome_dtype) as run:
        return run.rollouts()


def test_run_folder(run_folder: Path, tmp_path: Path) -> None:
    imported(run_folder, form="ivl", out=tmp_path / "out")
    found = flights.read(tmp_path / "out")
    rows = rows_of(run_folder)
    assert [f.label for f in found] == ["ep0-run0", "ep0-run2", "ep1-run1"]
    for flight, stream in zip(found, (0, 2, 5), strict=True):
        i = int(np.flatnonzero(rows.stream == stream)[0])
        info = flight.info
        assert (info["threshold_per_s"], info["moment_Nmm"]) == tuple(rows.theta[i])
        assert (info["n_legs"], info["reward"]) == (rows.outcomes.n_legs[i], rows.reward[i])
        assert (info["speed_mps"], info["angle_deg"], info["judged_by"]) == (2.5, 90.0, "simulator")
        assert info["usable"]
        assert math.isfinite(info["h_plane_m"])
    assert [f.info["note"] for f in found] == ["", "battery 3.91 V before take-off", ""]
    names = [source["file"] for source in found.manifest.source]
    assert names[0] == "run/run.sqlite"
    assert all(name.startswith("run/recordings/") for name in names[1:])


def test_run_folder_with_names_of_earlier(run_folder: Path, tmp_path: Path) -> None:
    imported(run_folder, form="ivl", out=tmp_path / "now")
    seed = derive(run.read_config(run_folder)[0].seed, Purpose.WORLD)
    for stream in (0, 5):
        recordings.path_of(run_folder, seed, stream).rename(run_folder / "recordings" / f"{seed:016x}-{stream}.csv")
        assert recordings.path_of(run_folder, seed, stream).is_file()
    imported(run_folder, form="ivl", out=tmp_path / "then")
    now, then = (flights.read(tmp_path / name) for name in ("now", "then"))
    assert [f.label for f in then] == ["ep0-run0", "ep0-run2", "ep1-run1"]
    for a, b in zip(now, then, strict=True):
        assert str({**a.info, "source": ""}) == str({**b.info, "source": ""})
    assert not any("no rollout belongs" in note for note in then.manifest.notes)


@pytest.mark.parametrize("seed", [0, 0x00F3A5C2B1D4E698, 2**64 - 1])
@pytest.mark.parametrize("stream", [0, 8, 998, 999, 2**40])
def test_names_of_recordings_tell_their_rollout(seed: int, stream: int, tmp_path: Path) -> None:
    path = recordings.path_of(tmp_path, seed, stream)
    assert recordings.rollout_of(path) == (seed, stream)
    earlier = path.with_name(f"{seed:016x}-{stream}.csv")
    assert recordings.rollout_of(earlier) == (seed, stream)
    for stray in ("stray", path.stem + "x", path.stem.replace("rollout", "trial"), earlier.stem[1:]):
        assert recordings.rollout_of(path.with_stem(stray)) is None


def test_recording_without_a_rollout_is_kept_and_told(run_folder: Path, truth: Truth, tmp_path: Path) -> None:
    (run_folder / "recordings" / "stray.csv").write_text(recording_text(truth))
    imported(run_folder, form="ivl", out=tmp_path / "out")
    found = flights.read(tmp_path / "out")
    assert found[-1].label == "stray"
    assert math.isnan(found[-1].info["n_legs"])
    assert any("no rollout belongs to recording stray" in note for note in found.manifest.notes)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("run.sqlite", b"no database"),
        ("manifest.json", b"{"),
        ("config.yaml", b"name: [1"),
        ("flights.jsonl", b"no journal\n"),
        ("flights.jsonl", b"[1]\n"),
    ],
)
def test_damaged_run_folder(refused: Refused, run_folder: Path, name: str, content: bytes) -> None:
    (run_folder / name).write_bytes(content)
    for left in run_folder.glob("run.sqlite-*"):
        left.unlink()
    assert str(run_folder) in refused(run_folder, form="ivl")


def test_damaged_recording_of_a_run_is_named(refused: Refused, run_folder: Path) -> None:
    path = sorted((run_folder / "recordings").iterdir())[1]
    path.write_text(path.read_text().replace("\n0.5,", "\nhalf,"))
    assert refused(run_folder, form="ivl").startswith(f"{path}: line 52: t_s: value 'half' is no number")
