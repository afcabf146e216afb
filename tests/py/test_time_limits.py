"""Whatever does not end is ended: each program of `make test` has a limit of time."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
TEST_TARGETS = re.compile(r"^(golden|san|pil|sizes-diff|test(-\w+)?):")


def script(folder: Path, text: str) -> Path:
    path = folder / "program"
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(0o755)
    return path


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("while :; do sleep 0.05; done", "did not end within 1 s"),
        ("trap '' TERM; while :; do sleep 0.05; done", "did not end within 1 s"),
        ("echo '3 Tests 0 Failures 0 Ignored'; sleep 60", "did not end within 1 s"),
        ("echo '3 Tests 1 Failures 0 Ignored'; exit 1", "exit code 1"),
        ("echo '0 Tests 0 Failures 0 Ignored'", "failed"),
    ],
)
def test_a_c_program_that_does_not_end_or_fails_is_an_error(tmp_path: Path, text: str, said: str) -> None:
    options = {**os.environ, "TIMEOUT_S": "1", "KILL_S": "0.2"}
    command = [str(ROOT / "tools/run_unity.sh"), str(script(tmp_path, text))]
    done = subprocess.run(command, env=options, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 1
    assert said in done.stderr


def test_a_c_program_that_passes_is_one_line(tmp_path: Path) -> None:
    command = [str(ROOT / "tools/run_unity.sh"), str(script(tmp_path, "echo '3 Tests 0 Failures 0 Ignored'"))]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0
    assert done.stdout.count("\n") == 1


def test_a_test_that_does_not_end_is_ended_and_shown(tmp_path: Path) -> None:
    (tmp_path / "test_endless.py").write_text("import time\n\n\ndef test_endless():\n    time.sleep(600)\n")
    command = [sys.executable, "-m", "pytest", "-c", str(ROOT / "pyproject.toml"), "-o", "faulthandler_timeout=1"]
    command += ["-p", "no:cacheprovider", "--rootdir", str(tmp_path), str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 1
    assert "in test_endless" in done.stderr


def test_pytest_has_a_limit(pytestconfig: pytest.Config) -> None:
    assert 0.0 < float(pytestconfig.getini("faulthandler_timeout")) <= 600.0
    assert pytestconfig.getini("faulthandler_exit_on_timeout") is True


def test_each_program_of_make_test_runs_under_a_limit() -> None:
    target, unlimited = "", []
    for line in (ROOT / "Makefile").read_text().splitlines():
        if line and not line.startswith(("\t", "#")):
            target = line
        if TEST_TARGETS.match(target) and "$(BIN)/python tools/" in line and "$(within)" not in line:
            unlimited.append(line)
    assert unlimited == []
    programs = re.findall(r"^\t@?(.*\$<.*)$", (ROOT / "tools/app.mk").read_text(), re.MULTILINE)
    running = [line for line in programs if "-c -o" not in line]
    assert len(running) == 3
    assert all("run_unity.sh" in line or "timeout" in line for line in running)
