"""What the flight core costs on the STM32F405: flash, memory, stack, instructions and cycles of a tick, in each phase.

Fails when a budget is exceeded or a rule is broken; with --diff also when a figure has grown beyond its margin over the
accepted one in tools/stm32/baseline.json.

usage: budget.py [--diff | --update] BUILD_FOLDER...       folders such as build/stm32-Os
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import cycles
import numpy as np
import objects
import recording
from replay import PHASES, RUN

BASELINE = Path(__file__).parent / "baseline.json"
CLOCK_HZ = 168e6
TICK_HZ = 500.0
VEHICLE_BUILD = "stm32-Os"
"""Compiled as the vehicle's firmware is: the budget of the flash is that of this build."""
LIMITS = {"flash_bytes": 18932, "ram_bytes": 2816, "stack_bytes": 512, "instructions_max": 3300, "cpu_percent": 2.0}
MARGINS = {"flash_bytes": 0.03, "ram_bytes": 0.0, "stack_bytes": 0.05, "instructions_max": 0.05, "bound_max": 0.05}
"""Growth over the baseline that is accepted without an update of it."""
_COUNTED_TICKS = 200_000
_WEIGHED_TICKS, _WEIGHED_PARTS, _WEIGHED_LEAST = 5_000, range(4, 20), 100
"""Ticks of a part, how many parts (more while a phase is rare), ticks of each phase that will do."""
_SEED = 20


def measure(build: Path, counted: recording.Recording, weighed: list[recording.Recording]) -> dict[str, Any]:
    """All figures of one build.

    Raises:
        RuntimeError: A rule of the core is broken, or figures contradict each other.
    """
    program, parts = build / "replay.elf", sorted((build / "firmware" / "core").glob("*.o"))
    if broken := objects.broken_rules(parts):
        raise RuntimeError(f"{build}: the flight core must not contain: {'; '.join(broken)}")
    stack = objects.worst_stack(program)
    chip = cycles.Chip(program)
    tallies = _weigh(chip, weighed, program)
    if chip.used_stack() > max(stack.values()):
        raise RuntimeError(f"{build}: {chip.used_stack()} bytes of stack were used where {stack} are the most")
    variables = objects.variable_bytes(parts)
    if variables:
        raise RuntimeError(f"{build}: the flight core has {variables} bytes of variables of its own")
    return {
        "flash_bytes": objects.flash_bytes(parts),
        "ram_bytes": variables + objects.instance_bytes(program),
        "stack_bytes": max(stack.values()),
        "stack_bytes_used": chip.used_stack(),
        "phases": _phases(_counts(program, counted), tallies),
    }


def _weigh(chip: cycles.Chip, parts: list[recording.Recording], program: Path) -> dict[int, cycles.Tally]:
    tallies = {phase: cycles.Tally() for phase in range(len(PHASES))}
    for n, part in enumerate(parts):
        if n >= _WEIGHED_PARTS.start and all(len(tally.n) >= _WEIGHED_LEAST for tally in tallies.values()):
            break
        found = chip.run(part, program)
        if n == 0:
            _compare_counts(_counts(program, part), found)
        for phase, tally in found.items():
            tallies[phase].add(tally)
    return tallies


def _compare_counts(counts: dict[str, list[int]], tallies: dict[int, cycles.Tally]) -> None:
    """Refuse figures of one recording on which the two ways to count instructions disagree."""
    for number, name in enumerate(PHASES):
        most, seen = counts[name][3], max(tallies[number].n, default=0)
        if not seen <= most <= seen + _CALL_INSTRUCTIONS:
            raise RuntimeError(f"phase {name}: the two ways to count instructions disagree: {seen} and {most}")


def _phases(counts: dict[str, list[int]], tallies: dict[int, cycles.Tally]) -> dict[str, dict[str, float]]:
    result = {}
    for number, name in enumerate(PHASES):
        n, _, total, most = counts[name]
        tally = tallies[number]
        if n < _WEIGHED_LEAST or len(tally.n) < _WEIGHED_LEAST:
            raise RuntimeError(f"phase {name} hardly occurs in the recording: {n} and {len(tally.n)} ticks")
        result[name] = {
            "instructions_mean": round(total / n, 1),
            "instructions_max": max(most, *tally.n),
            "expected_mean": round(float(np.mean(tally.expected)), 1),
            "expected_max": max(tally.expected),
            "worst_max": max(tally.worst),
            "bound_max": max(tally.bound),
        }
    return result


_CALL_INSTRUCTIONS = 8
"""QEMU's figure includes the call: fetching the arguments and the jump."""


def _counts(program: Path, recorded: recording.Recording) -> dict[str, list[int]]:
    """Phase -> ticks, fewest, sum and most instructions, counted by the emulated clock."""
    with recorded.requests.open("rb") as requests:
        run = subprocess.run(
            [RUN, program, "count"], stdin=requests, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
            check=False, env={**os.environ, "ICOUNT": "1"},
        )  # fmt: skip
    if run.returncode != 0:
        raise RuntimeError(f"{program}: exit code {run.returncode}: {run.stderr.strip()}")
    rows = (line.split(",") for line in run.stderr.splitlines() if line.count(",") == 4)
    return {PHASES[int(number)]: [int(count) for count in counts] for number, *counts in rows}


def worst(figures: dict[str, Any], name: str) -> float:
    """Largest figure of all phases."""
    return max(phase[name] for phase in figures["phases"].values())


def summary(figures: dict[str, Any]) -> dict[str, float]:
    """The figures that have budgets or margins."""
    flat = {name: figures[name] for name in ("flash_bytes", "ram_bytes", "stack_bytes")}
    flat |= {name: worst(figures, name) for name in ("instructions_max", "bound_max")}
    flat["cpu_percent"] = 100.0 * TICK_HZ * worst(figures, "expected_mean") / CLOCK_HZ
    return flat


def limits_of(name: str) -> dict[str, float]:
    """Budgets of a build."""
    return {key: limit for key, limit in LIMITS.items() if key != "flash_bytes" or name == VEHICLE_BUILD}


def exceeded(found: dict[str, float], name: str) -> list[str]:
    """Budgets that a build does not keep."""
    limits = limits_of(name)
    return [
        f"{name}: {key} is {found[key]:g}, the budget is {limit:g}"
        for key, limit in limits.items()
        if found[key] > limit
    ]


def grown(found: dict[str, float], accepted: dict[str, float], name: str) -> list[str]:
    """Figures that are larger than accepted, beyond the margin."""
    return [
        f"{name}: {key} is {found[key]:g}, it was {accepted[key]:g} (margin {100 * margin:g} %)"
        for key, margin in MARGINS.items()
        if found[key] > accepted[key] * (1.0 + margin)
    ]


def _print(name: str, figures: dict[str, Any], accepted: dict[str, float] | None) -> None:
    found = summary(figures)
    print(f"{name}: flight core")
    for key, value in found.items():
        limit = f"budget {limits_of(name)[key]:g}" if key in limits_of(name) else ""
        change = f"{value - accepted[key]:+g}" if accepted else ""
        print(f"  {key:20s} {value:10.6g}  {limit:14s} {change}")
    print(f"  {'stack used':20s} {figures['stack_bytes_used']:10d}  by the ticks that were weighed")
    print(f"  {'':10s}{'instructions':>16s}{'cycles expected':>20s}{'worst':>8s}{'bound':>8s}")
    print(f"  {'phase':10s}{'mean':>8s}{'max':>8s}{'mean':>12s}{'max':>8s}{'max':>8s}{'max':>8s}")
    for phase, row in figures["phases"].items():
        means = f"{row['instructions_mean']:8.0f}{row['instructions_max']:8d}{row['expected_mean']:12.0f}"
        print(f"  {phase:10s}{means}{row['expected_max']:8d}{row['worst_max']:8d}{row['bound_max']:8d}")
    most_us = worst(figures, "bound_max") / CLOCK_HZ * 1e6
    print(f"  at {CLOCK_HZ / 1e6:.0f} MHz the worst tick is bounded by {most_us:.1f} us of {1e6 / TICK_HZ:.0f} us")


def main() -> int:
    """Measure all builds; return 0 if all budgets and margins are kept."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--diff", action="store_true", help="compare with the accepted figures")
    parser.add_argument("--update", action="store_true", help="accept the present figures")
    parser.add_argument("builds", nargs="+", type=Path)
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        counted = recording.record(Path(folder), _COUNTED_TICKS, _SEED)
        weighed = [recording.record(Path(folder), _WEIGHED_TICKS, _SEED + 1 + i) for i in range(_WEIGHED_PARTS.stop)]
        measured = {build.name: measure(build, counted, weighed) for build in args.builds}
    baseline = json.loads(BASELINE.read_text(encoding="ascii")) if args.diff else {}
    problems = []
    for name, figures in measured.items():
        accepted = summary(baseline[name]) if args.diff else None
        _print(name, figures, accepted)
        problems += exceeded(summary(figures), name)
        problems += grown(summary(figures), accepted, name) if accepted else []
    if args.update and not problems:
        BASELINE.write_text(json.dumps(measured, indent=1) + "\n", encoding="ascii")
    for problem in problems:
        print(f"error: {problem}", file=sys.stderr)
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
