"""Every fault of the processor ends a program with an exit code of its own, so that none can pass for a result."""

import os
import subprocess
from pathlib import Path

import pytest

FAULTS = {
    "none": 0,
    "nmi": 110,
    "escalated": 111,
    "not_code": 112,
    "no_memory": 113,
    "runaway_stack": 113,
    "no_fpu": 114,
    "undefined_instruction": 114,
    "unaligned_float": 114,
    "interrupt": 115,
    "hang": 124,
}


@pytest.mark.parametrize("fault", FAULTS)
def test_fault_ends_the_program_with_its_code(build: Path, run_script: Path, fault: str) -> None:
    limit_s = "1" if fault == "hang" else "30"
    run = subprocess.run(
        [run_script, build / "faults.elf", fault], stdin=subprocess.DEVNULL, capture_output=True, text=True,
        check=False, env={**os.environ, "TIMEOUT_S": limit_s},
    )  # fmt: skip
    assert run.returncode == FAULTS[fault], run.stderr
    assert run.stdout == ""
    assert ("exception" in run.stderr) == (110 <= run.returncode <= 115)


def test_report_says_where_the_fault_was(build: Path, run_script: Path) -> None:
    run = subprocess.run(
        [run_script, build / "faults.elf", "no_memory"], stdin=subprocess.DEVNULL, capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    assert "BFAR 60000000" in run.stderr
    symbols = subprocess.run(
        ["arm-none-eabi-nm", "--format=posix", "--print-size", build / "faults.elf"], capture_output=True, text=True,
        check=True,
    ).stdout  # fmt: skip
    (row,) = [line.split() for line in symbols.splitlines() if line.startswith("no_memory ")]
    begin, size = int(row[2], 16), int(row[3], 16)
    where = int(run.stderr.split("PC ")[1][:8], 16)
    assert begin <= where < begin + size
