"""Random packets for the software vehicle, random sequences of events for the app, and their table in the documents.

Run by `make reliability`, which builds both programs with sanitizers before. `--scale 0.01` tries a hundredth, and
writes nothing. Both run in parts, each with a seed of its own, so that the figures of an interrupted run are known.
"""

import argparse
import re
import subprocess
import time
from dataclasses import dataclass
from pathlib import Path

import marked

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "RELIABILITY.md"
BEGIN, END = "<!-- measured by tools/packets.py: begin -->", "<!-- measured by tools/packets.py: end -->"
N_SEQUENCES, N_PACKETS = 100_000, 20_000_000
SEQUENCES_A_PART, INPUTS_A_PART = 5_000, 200_000
_SEQUENCES = re.compile(r"sequences: (\d+), (\d+) ms, (\d+) flips, nothing broken")
_PACKETS = re.compile(r"fuzz_crtp: (\d+) inputs, (\d+) datagrams, (\d+) ms of the vehicle")


@dataclass
class Total:
    """What was tried, and how often something broke."""

    tried: int = 0
    vehicle_ms: int = 0
    flips: int = 0
    broken: int = 0


def sequences(number: int) -> Total:
    """So many sequences; what breaks is printed with its shortest sequence."""
    total = Total()
    while total.tried < number:
        part = min(SEQUENCES_A_PART, number - total.tried)
        seed = 1 + total.tried // SEQUENCES_A_PART
        done = subprocess.run(
            ["build/app/sequences", str(part), str(seed)], cwd=ROOT, capture_output=True, text=True, check=False
        )
        found = _SEQUENCES.search(done.stdout)
        total.tried += part
        if done.returncode != 0 or found is None:
            total.broken += 1
            print(done.stdout + done.stderr, flush=True)
            continue
        total.vehicle_ms += int(found[2])
        total.flips += int(found[3])
    return total


def packets(number: int) -> Total:
    """At least so many datagrams; libFuzzer writes what breaks the vehicle into a file and says which."""
    total, seed = Total(), 0
    while total.tried < number:
        seed += 1
        command = ["tools/fuzz.sh", "build/fuzz/fuzz_crtp", str(INPUTS_A_PART), f"-seed={seed}"]
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
        found = _PACKETS.search(done.stderr)
        if done.returncode != 0 or found is None:
            total.broken += 1
            print(done.stdout + done.stderr[-4000:], flush=True)
            if found is None:
                break
        total.tried += int(found[2])
        total.vehicle_ms += int(found[3])
    return total


def table(hostile: Total, sequence: Total) -> str:
    """The results for the page."""
    flips = f"{sequence.flips:,} flips"
    return (
        f"`make reliability`, {time.strftime('%Y-%m-%d')}; under AddressSanitizer and UndefinedBehaviorSanitizer.\n\n"
        "| what | tried | of the vehicle | broken |\n|---|---|---|---|\n"
        f"| packets, guided by coverage, to the software vehicle | {hostile.tried:,} | "
        f"{hostile.vehicle_ms / 3.6e6:.1f} h | {hostile.broken} |\n"
        f"| sequences of host, link and vehicle, to the app | {sequence.tried:,} | "
        f"{sequence.vehicle_ms / 3.6e6:.1f} h, {flips} | {sequence.broken} |\n"
    )


def main() -> int:
    """Try both; exit code 1 if something broke."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scale", type=float, default=1.0, help="share of the packets and sequences")
    arguments = parser.parse_args()
    sequence = sequences(max(round(N_SEQUENCES * arguments.scale), 1000))
    hostile = packets(round(N_PACKETS * arguments.scale))
    text = table(hostile, sequence)
    print(text)
    if arguments.scale == 1.0:
        marked.write(PAGE, text, BEGIN, END)
    return 1 if sequence.broken or hostile.broken else 0


if __name__ == "__main__":
    raise SystemExit(main())
