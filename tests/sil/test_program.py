"""The program `ivl_sil`: its options, how it ends, and the command that starts it."""

import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from ivl import bootloader, silproc
from ivl.experiment import load
from ivl.silproc import SilProcess
from ivl.world import World


def run(*arguments: str) -> subprocess.CompletedProcess[str]:
    """The program, which ends by itself."""
    return subprocess.run([silproc.server_path(), *arguments], capture_output=True, text=True, timeout=60, check=False)


def test_help_teaches():
    text = run("--help").stdout
    for word in ("--lockstep", "--fault", "--vehicles", "--control", "loss [1] 0 .. 1", "example"):
        assert word in text


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "--model FILE is missing"),
        (["--model", "/nonexistent"], "/nonexistent: No such file"),
        (["--port", "70000"], "--port: value '70000' is not allowed (a whole number from 0 to 65535)"),
        (["--speed", "-1"], "--speed: value '-1' is not allowed (a number from 0.01 to 1000, or max)"),
        (["--fault", "loss=2"], "--fault: value 'loss=2' is not allowed (loss from 0 to 1)"),
        (["--fault", "rain=1"], "(loss=.. delay_ms=.. jitter_ms=.. reorder=.. duplicate=.. seed=.. )"),
        (["--vehicles", "0"], "a whole number from 1 to 64"),
        (["--model", "x", "--port", "65535", "--vehicles", "2"], "the last port would be beyond 65535"),
        (["--model", "x", "extra"], "'extra' is not expected"),
        (["--bogus"], "unrecognized option"),
    ],
)
def test_wrong_usage_is_said_in_one_line(arguments, message):
    result = run(*arguments)
    assert result.returncode == 2
    assert message in result.stderr
    assert result.stderr.count("\n") == 1


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("vehicles", [1, 3])
def test_a_signal_ends_all_vehicles_cleanly(world, number, vehicles, wait_for):
    sil = SilProcess(world, vehicles=vehicles)
    sil.start()
    pid = sil.pid
    children = Path(f"/proc/{pid}/task/{pid}/children").read_text(encoding="ascii").split()
    assert len(children) == (0 if vehicles == 1 else vehicles)
    os.kill(pid, number)
    wait_for("the end", lambda: sil._process.poll() is not None)
    assert sil._process.returncode == 0
    sil.stop()
    assert not any(Path(f"/proc/{child}").exists() for child in children)


def test_a_vehicle_that_dies_takes_the_others_with_it(world, wait_for):
    sil = SilProcess(world, vehicles=3)
    sil.start()
    children = Path(f"/proc/{sil.pid}/task/{sil.pid}/children").read_text(encoding="ascii").split()
    os.kill(int(children[1]), signal.SIGKILL)
    wait_for("the end", lambda: sil._process.poll() is not None)
    with pytest.raises(silproc.LinkError, match="ended unexpectedly"):
        sil.stop()


def test_command_becomes_the_program(tmp_path):
    file = tmp_path / "vehicle.txt"
    ivl = [sys.executable, "-c", "from ivl.cli import main; main()", "sil"]
    world = World("crazyflie21", "wide_long", **{"sense.latency": 0.01})
    options = ["--vehicle", "crazyflie21", "--gear", "wide_long", "--set", "sense.latency=0.01"]
    subprocess.run([*ivl, *options, "--write-model", str(file)], check=True)
    assert file.read_text(encoding="ascii") == silproc.model_text(world)
    with subprocess.Popen(
        [*ivl, *options, "--port", "0"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as run:
        assert re.fullmatch(r"vehicle 0: udp://127\.0\.0\.1:\d+\n", run.stdout.readline())
        assert Path(f"/proc/{run.pid}/exe").resolve() == silproc.server_path()
        run.send_signal(signal.SIGINT)
        assert run.wait(60) == 0
        assert "crazyflie21 with gear wide_long of table1" in run.stderr.read()


def test_experiments_vehicle_is_flown(tmp_path):
    file = tmp_path / "vehicle.txt"
    ivl = [sys.executable, "-c", "from ivl.cli import main; main()", "sil"]
    subprocess.run([*ivl, "--experiment", "experiments/paper_vertical.yaml", "--write-model", str(file)], check=True)
    assert file.read_text(encoding="ascii") == silproc.model_text(load("experiments/paper_vertical.yaml").make_world())


def test_a_vehicle_says_what_it_is_and_which_build_it_runs(sil):
    now = bootloader.running(sil.uri)
    assert now == bootloader.Running(bootloader.device_name(sil.uri), 0), "no image, so no number"
    assert now.device.startswith("Crazyflie")
