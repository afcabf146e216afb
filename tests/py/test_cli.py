import json
import os
import random
import resource
import signal
import sqlite3
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import ivl
from ivl import cli, experiment
from ivl.cli import bench
from ivl.experiment import Experiment

LANDING = ["rollout", "--speed", "2.5", "--angle", "90", "--rrev", "4.8", "--moment", "8", "--gear-set", "as_simulated"]
PROGRAM = [sys.executable, "-c", "from ivl.cli import main; main()"]

Capture = pytest.CaptureFixture[str]


def ok(arguments: list[str], capsys: Capture) -> str:
    """Run a command that must succeed; its stdout."""
    assert cli.run(arguments) == 0, capsys.readouterr().err
    return capsys.readouterr().out


def json_of(arguments: list[str], capsys: Capture) -> dict[str, Any]:
    """Run with --json; stdout must be exactly one object."""
    data = json.loads(ok([*arguments, "--json"], capsys))
    assert isinstance(data, dict)
    return data


def refused(arguments: list[str], capsys: Capture, code: int = 2) -> str:
    """Run a command that must fail with one line on stderr and nothing on stdout."""
    assert cli.run(arguments) == code
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.count("\n") == 1
    return printed.err


@pytest.fixture(autouse=True)
def _elsewhere(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Every command must work in any directory, and its runs must not litter the source tree."""
    monkeypatch.chdir(tmp_path)


# rollout


def test_the_version_is_told(capsys: Capture) -> None:
    assert ok(["--version"], capsys) == f"ivl {ivl.__version__}\n"


def test_rollout_prints_the_outcome_by_name(capsys: Capture) -> None:
    data = json_of(LANDING, capsys)
    assert data["n_legs"] == 4
    assert data["four_leg"] is True
    assert data["end_reason"] == "contact_time"
    assert {"leg_order", "body_contact", "t_trigger_s", "t_impact_s", "theta_impact_deg", "d_min_m"} <= set(data)
    assert "n_legs" in ok(LANDING, capsys)


def test_rollout_is_what_the_library_call_gives(capsys: Capture, world: ivl.World) -> None:
    data = json_of([*LANDING, "--seed", "3", "--stream", "5"], capsys)
    out = world.rollouts(2.5, 90.0, 4.8, 8.0, seed=3, stream=5)
    assert data["t_impact_s"] == float(out.t_impact_s)
    assert data["d_min_m"] == float(out.d_min_m)


def test_rollout_writes_trace_and_picture(capsys: Capture, tmp_path: Path) -> None:
    json_of([*LANDING, "--trace", "landing.csv", "--plot", "landing.png"], capsys)
    assert (tmp_path / "landing.csv").read_text().startswith("t_s,")
    assert (tmp_path / "landing.png").read_bytes().startswith(b"\x89PNG")


def test_rollout_from_hover_and_at_the_trigger(capsys: Capture) -> None:
    assert json_of([*LANDING, "--start", "flown"], capsys)["triggered"] == 1
    assert json_of([*LANDING, "--start", "at_trigger", "--distance", "0.5"], capsys)["triggered"] == 1


@pytest.mark.parametrize(
    ("extra", "message"),
    [
        (["--speed", "-1"], "speed_mps: value -1.0 is out of range (allowed"),
        (["--speed", "fast"], "Invalid value for '--speed'"),
        (["--gear", "wide_shrt"], "did you mean 'wide_short'"),
        (["--gear-set", "table2"], "no gear set 'table2', did you mean 'table1'"),
        (["--vehicle", "none"], "no vehicle 'none'"),
        (["--set", "sense.latency='1e-3'"], "write the number without them"),
        (["--set", "sense.latncy=0.001"], "did you mean 'sense.latency'"),
        (["--set", "sense.latency"], "expected name=value"),
        (["--trace", "x.txt"], "unknown kind of file (allowed .csv, .npz)"),
        (["--plot", "x.bmp"], "unknown kind of file (allowed .png, .svg, .pdf)"),
        (["--start", "thrown"], "thrown"),
        (["--start", "at_trigger"], "d_ceil_m"),
        (["--colour", "red"], "--colour"),
    ],
)
def test_rollout_refuses_wrong_arguments_in_one_line(capsys: Capture, extra: list[str], message: str) -> None:
    assert message in refused([*LANDING, *extra], capsys)


# list


def test_list_names_everything(capsys: Capture) -> None:
    data = json_of(["list"], capsys)
    assert set(data) == {
        "vehicles", "gears", "sensors", "experiments", "tasks", "sweeps", "approaches", "estimators", "params",
        "learners", "rewards", "forms",
    }  # fmt: skip
    assert {"ideal", "mocap", "camera50", "ranger10"} <= {entry["name"] for entry in data["sensors"]}
    assert {entry["name"] for entry in data["vehicles"]} == {"habas2021", "crazyflie21", "crazyflie21_brushless"}
    assert len(data["gears"]) == 12
    assert "experiments/paper_vertical.yaml" in {entry["name"] for entry in data["experiments"]}
    assert {"ephe", "ephe_robust", "ephe_memory", "cmaes", "bo"} <= {entry["name"] for entry in data["learners"]}
    assert {entry["name"] for entry in data["rewards"]} == {"paper", "authors_code"}
    forms = {entry["name"]: entry["parameters"] for entry in data["forms"]}
    assert set(forms) == {"constant", "polynomial2", "polynomial3", "bilinear"}
    assert forms["constant"]["moment_y_Nmm"]["unit"] == "N mm"
    assert forms["bilinear"]["r_45_per_s"]["unit"] == "1/s"
    assert all(entry["doc"] for entries in data.values() for entry in entries)


def test_list_of_one_kind(capsys: Capture) -> None:
    assert set(json_of(["list", "gears"], capsys)) == {"gears"}
    assert "as_simulated/wide_long" in ok(["list", "gears"], capsys)


def test_list_shows_the_options_of_each_learner_as_this_entry_has_them(capsys: Capture) -> None:
    options = {entry["name"]: entry["options"] for entry in json_of(["list", "learners"], capsys)["learners"]}
    assert options["ephe"]["sigma_ref"] == "old"
    assert options["ephe_new"]["sigma_ref"] == "new"
    assert options["ephe_robust"]["shrink_min"] == 0.85


# learn


def test_learn_prints_one_object_and_leaves_a_run_folder_with_pictures(capsys: Capture, small_file: Path) -> None:
    data = json_of(["learn", str(small_file)], capsys)
    assert list(data)[:7] == [
        "solved", "rollouts_to_convergence", "mu", "sigma",
        "landing_rate_four_leg", "landing_rate_clean", "failed_landings",
    ]  # fmt: skip
    folder = Path(data["run_dir"])
    names = {"config.yaml", "manifest.json", "run.sqlite", "result.json", "convergence.png", "last_landing.png"}
    assert names <= {path.name for path in folder.iterdir()}


def test_learn_shows_progress_on_stderr_and_figures_on_stdout(capsys: Capture, small_file: Path) -> None:
    assert cli.run(["learn", str(small_file)]) == 0
    printed = capsys.readouterr()
    assert printed.err.count("episode ") == 4
    assert "rollouts/s" in printed.err
    assert "landing rate" in printed.err
    assert "± " in printed.err
    assert "solved" in printed.out


def test_learn_over_trials_prints_their_summary(capsys: Capture, small_file: Path) -> None:
    data = json_of(["learn", str(small_file), "--trials", "3"], capsys)
    assert data["trials"] == 3
    assert set(data["rollouts_to_convergence"]) == {"median", "p90"}
    assert "median" in data["failed_landings"]
    assert 0 <= data["stuck"] <= 1
    assert 0 <= data["solved"] <= 3
    assert "solved" in ok(["learn", str(small_file), "--trials", "3", "--out", "again"], capsys)


def test_learn_takes_learner_seed_and_settings(capsys: Capture, small_file: Path, tmp_path: Path) -> None:
    arguments = ["--learner", "cmaes", "--seed", "4", "--set", "budget=8", "--set", "sense.latency=0.01", "--out", "r"]
    json_of(["learn", str(small_file), *arguments], capsys)
    chosen = experiment.load(str(tmp_path / "r" / "config.yaml"))
    assert (chosen.learner.name, chosen.seed, chosen.budget) == ("cmaes", 4, 8)
    assert chosen.overrides["sense.latency"].value == 0.01


def test_equal_commands_give_equal_results(capsys: Capture, small_file: Path) -> None:
    first, second = (json_of(["learn", str(small_file)], capsys) for _ in range(2))
    assert first.pop("run_dir") != second.pop("run_dir")
    assert first == second


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["none.yaml"], "none.yaml: no such file"),
        ([], "EXPERIMENT is missing"),
        (["SMALL", "--learner", "sgd"], "no learner 'sgd'"),
        (["SMALL", "--set", "speed_mps=-1"], "small.yaml: speed_mps: value -1"),
        (["SMALL", "--set", "colour=red"], "small.yaml: colour: unknown key"),
        (["SMALL", "--set", "leg.stiffnes=3"], "leg.stiffnes: unknown parameter, did you mean 'leg.stiffness'?"),
        (["SMALL", "--trials", "0"], "--trials"),
        (["--resume", "--out", "x", "--seed", "1"], "--resume without EXPERIMENT takes all from the run folder"),
    ],
)
def test_learn_refuses_wrong_arguments_in_one_line(
    capsys: Capture, small_file: Path, arguments: list[str], message: str
) -> None:
    given = [str(small_file) if argument == "SMALL" else argument for argument in arguments]
    assert message in refused(["learn", *given], capsys)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["SMALL", "--resume"], "there is no run to resume"),
        (["SMALL", "--resume", "--out", "none"], "none: there is no run to resume"),
        (["--resume", "--out", "none"], "none: holds no run"),
    ],
)
def test_learn_cannot_resume_what_is_not_there(
    capsys: Capture, small_file: Path, arguments: list[str], message: str
) -> None:
    given = [str(small_file) if argument == "SMALL" else argument for argument in arguments]
    assert message in refused(["learn", *given], capsys, code=1)


def test_learn_does_not_overwrite_a_run(capsys: Capture, small_file: Path, finished: Path) -> None:
    assert "holds a run already" in refused(["learn", str(small_file), "--out", str(finished)], capsys, code=1)


def test_ctrl_c_says_how_to_resume_and_the_resumed_run_is_the_same(
    capsys: Capture, small_file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = json_of(["learn", str(small_file), "--out", "whole"], capsys)

    def interrupt(_: object, **__: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr("ivl.cli.console.print_episode", interrupt)
        assert cli.run(["learn", str(small_file), "--out", "cut"]) == 130
    assert "continue with: ivl learn --resume --out cut" in capsys.readouterr().err
    resumed = json_of(["learn", "--resume", "--out", "cut"], capsys)
    assert {**resumed, "run_dir": ""} == {**whole, "run_dir": ""}


def rows_of(folder: Path) -> list[Any]:
    with sqlite3.connect(folder / "run.sqlite") as database:
        tables = ("rollout", "episode", "learner")
        return [database.execute(f"SELECT * FROM {table} ORDER BY 1, 2, 3").fetchall() for table in tables[:2]] + [
            database.execute("SELECT * FROM learner ORDER BY trial").fetchall()
        ]


def test_kill_9_at_random_moments_and_resume_end_in_the_uninterrupted_result(
    capsys: Capture, small_file: Path, tmp_path: Path
) -> None:
    settings = ["--trials", "40", "--set", "budget=80"]
    whole = json_of(["learn", str(small_file), *settings, "--out", "whole"], capsys)
    command = [*PROGRAM, "learn", str(small_file), *settings, "--out", "killed", "--json"]
    rng, kills, done = random.Random(1), 0, None
    while done is None:
        resume = ["--resume"] if (tmp_path / "killed").exists() else []
        process = subprocess.Popen([*command, *resume], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        watch = tmp_path / "killed" / "run.sqlite"
        deadline = time.monotonic() + 60
        while kills < 3 and not watch.exists() and process.poll() is None and time.monotonic() < deadline:
            time.sleep(0.01)
        if kills < 3:
            time.sleep(rng.uniform(0.0, 0.6))
            process.send_signal(signal.SIGKILL)
            kills += process.wait() == -signal.SIGKILL
            process.communicate()
        else:
            output, errors = process.communicate(timeout=300)
            assert process.returncode == 0, errors
            done = json.loads(output)
    assert kills == 3
    assert {**done, "run_dir": ""} == {**whole, "run_dir": ""}
    assert rows_of(tmp_path / "killed") == rows_of(tmp_path / "whole")


# bench


def test_bench_without_mujoco_measures_this_simulator(capsys: Capture) -> None:
    data = json_of(["bench", "--no-mujoco", "--rollouts", "100"], capsys)
    sets = ["friendly", "cell", "slowest_cell", "learner"]
    assert list(data)[:2] == ["rollouts_per_s_per_core", "steps_per_s_per_core"]
    assert all(data[f"rollouts_per_s_{name}"] > 0 and 0.3 < data[f"occupancy_{name}"] <= 1 for name in sets)
    assert data[f"rollouts_per_s_in_{data['register_bits']:.0f}_bits"] > 0
    assert data["machine"]
    assert data["rollouts_per_s_per_core"] > 100
    assert data["steps_per_s_per_core"] > 100 * data["rollouts_per_s_per_core"]
    assert data["ratio_to_mujoco"] is None


def test_bench_divides_by_the_rate_of_the_other_engine(
    capsys: Capture, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "other.py").write_text("def rollouts_per_s_per_core():\n    return 50.0\n")
    monkeypatch.setattr(bench, "_MUJOCO_BENCH", tmp_path / "other.py")
    monkeypatch.setattr("importlib.util.find_spec", lambda _: True)
    data = json_of(["bench", "--rollouts", "100"], capsys)
    assert data["ratio_to_mujoco"] == pytest.approx(data["rollouts_per_s_per_core"] / 50)


def test_bench_says_what_to_do_when_mujoco_is_missing(capsys: Capture, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda _: None)
    assert "mujoco is not installed: run `make setup-dev`" in refused(["bench"], capsys, code=1)
    monkeypatch.setattr(bench, "_MUJOCO_BENCH", Path("none.py"))
    assert "leave it out with --no-mujoco" in refused(["bench"], capsys, code=1)


# the program


@pytest.mark.parametrize("command", ["learn", "rollout", "list", "bench"])
def test_help_teaches_with_examples(capsys: Capture, command: str) -> None:
    text = ok([command, "--help"], capsys)
    assert "Examples:" in text
    assert f"ivl {command}" in text
    assert "--json" in text


def test_help_lists_the_commands(capsys: Capture) -> None:
    text = ok(["--help"], capsys)
    assert all(command in text for command in ("learn", "rollout", "list", "bench"))
    assert "..." not in text.split("Commands:")[1]  # every line says what it has to say


def test_without_a_command_the_help_is_shown_and_nothing_succeeds(capsys: Capture) -> None:
    assert cli.run([]) == 2
    assert "learn" in capsys.readouterr().out


def test_an_unknown_command_is_refused(capsys: Capture) -> None:
    assert "flie" in refused(["flie"], capsys)


def test_wrong_usage_points_to_the_help_of_its_command(capsys: Capture) -> None:
    assert refused(["list", "wheels"], capsys).startswith("ivl: Invalid value for 'kind': 'wheels' is not one of")
    assert "(try `ivl list --help`)" in refused(["list", "wheels"], capsys)


def test_the_program_exits_with_the_code_of_its_command() -> None:
    environment = {**os.environ, "COLUMNS": "80"}
    good = subprocess.run([*PROGRAM, *LANDING, "--json"], capture_output=True, text=True, env=environment, check=False)
    assert good.returncode == 0
    assert json.loads(good.stdout)["n_legs"] == 4
    bad = subprocess.run([*PROGRAM, "learn", "none.yaml"], capture_output=True, text=True, env=environment, check=False)
    assert bad.returncode == 2
    assert bad.stderr.count("\n") == 1


def test_json_of_numbers_that_are_missing_is_null(capsys: Capture, small: Experiment, tmp_path: Path) -> None:
    policy = {"mu0": 0.2, "sigma0": 0.01, "bounds": [0.1, 0.3]}
    data = small.model_dump(mode="json")
    data["policy"] = {"rrev_c_per_s": policy, "moment_y_Nmm": policy}
    (tmp_path / "hopeless.yaml").write_text(json.dumps(data))
    found = json_of(["learn", "hopeless.yaml"], capsys)
    assert found["solved"] is False
    assert found["rollouts_to_convergence"] is None
    assert found["failed_landings"] == 16
    assert np.isfinite(found["landing_rate_four_leg"])


@pytest.mark.parametrize(
    ("limit", "how"), [(resource.RLIMIT_AS, "ulimit -v"), (resource.RLIMIT_DATA, "ulimit -d")], ids=["space", "data"]
)
@pytest.mark.parametrize("megabytes", [60, 150, 349])
def test_too_little_memory_to_be_loaded_is_one_line(limit: int, how: str, megabytes: int) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "ivl", "list"],
        preexec_fn=lambda: resource.setrlimit(limit, (megabytes * 1_000_000, megabytes * 1_000_000)),
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert done.stderr.startswith(f"ivl: this process may have {megabytes} MB of ")
    assert f"`{how} unlimited`" in done.stderr
    assert done.stderr.count("\n") == 1


def test_what_finds_no_room_later_is_one_line_where_there_is_a_limit(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail(*_: object, **__: object) -> None:
        raise ImportError("libarrow.so: failed to map segment from shared object")

    monkeypatch.setattr(cli, "app", fail)
    monkeypatch.setattr("ivl.memory.resource.getrlimit", lambda _: (500_000_000, 500_000_000))
    assert cli.run(["list"]) == 1
    said = capsys.readouterr().err
    assert "libarrow.so" in said
    assert "500 MB of address space, and 2000 MB are needed" in said
    assert said.count("\n") == 1
    monkeypatch.setattr("ivl.memory.resource.getrlimit", lambda _: (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
    with pytest.raises(ImportError, match="failed to map"):
        cli.run(["list"])
