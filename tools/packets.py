"""Random packets and random sequences of events, and their table in the documents.

Packets go to the software vehicle; sequences to the app, to the software vehicle through its server's loop, to the CAN
gateways, and to watch and guard of motion capture. Run by `make reliability`, which builds the C programs with
sanitizers before. `--scale 0.01` tries a hundredth, and writes nothing; `--packets 1000000` and its like say how many
there are of a kind, and the table says so. All run in parts, each with a seed of its own, so that the figures of an
interrupted run are known.
"""

import argparse
import os
import re
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import marked

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "RELIABILITY.md"
BEGIN, END = "<!-- measured by tools/packets.py: begin -->", "<!-- measured by tools/packets.py: end -->"
INPUTS_A_PART = 200_000
_PACKETS = re.compile(r"fuzz_crtp: (\d+) inputs, (\d+) datagrams, (\d+) ms of the vehicle")


@dataclass
class Total:
    """What was tried, and how often something broke."""

    tried: int = 0
    vehicle_ms: int = 0
    flips: int = 0
    broken: int = 0


@dataclass(frozen=True)
class Kind:
    """A kind of sequences.

    Attributes:
        name: Option that says how many.
        text: For the table.
        number: Sequences of a full run.
        a_part: Sequences of one call of the program.
        command: The program; `{number}` and `{seed}` are put in.
        says: What it prints when nothing broke: sequences, and perhaps milliseconds of the vehicle and flips.
        is_python: It takes number and seed from the environment, as tests do.
    """

    name: str
    text: str
    number: int
    a_part: int
    command: tuple[str, ...]
    says: re.Pattern[str]
    is_python: bool = False


def _program(path: str, says: str) -> tuple[tuple[str, ...], re.Pattern[str]]:
    return (path, "{number}", "{seed}"), re.compile(says + r": (\d+), (\d+) ms, (\d+) flips, nothing broken")


def _test(path: str, says: str) -> tuple[tuple[str, ...], re.Pattern[str]]:
    command = (sys.executable, "-m", "pytest", "-q", "-s", "-p", "no:cacheprovider", "-k", "no_sequence", path)
    return (*command, "--hypothesis-seed={seed}"), re.compile(says + r" sequences: sequences=(\d+)")


KINDS = (
    Kind(
        "sequences", "host, link and vehicle, to the app", 100_000, 5_000, *_program("build/app/sequences", "sequences")
    ),
    Kind(
        "loop",
        "clients, operator and a bad link, to the software vehicle through its server's loop",
        20_000,
        1_000,
        *_program("build/san/loop_sequences", "loop_sequences"),
    ),
    Kind(
        "gateways",
        "clients, vehicle and a bad bus, to the CAN gateways",
        2_000,
        200,
        *_test("tests/wire/test_can_sequences.py", "can"),
        True,
    ),
    Kind(
        "tracking",
        "cameras, a strange body and vehicle, to watch and guard of motion capture",
        5_000,
        1_000,
        *_test("tests/wire/test_mocap_sequences.py", "mocap"),
        True,
    ),
)
N_PACKETS = 20_000_000


def sequences(kind: Kind, number: int) -> Total:
    """So many sequences; what breaks is printed with its shortest sequence."""
    total, seed = Total(), 0
    while total.tried < number:
        seed += 1
        part = min(kind.a_part, number - total.tried)
        command = [word.format(number=part, seed=seed) for word in kind.command]
        environment = {**os.environ, "IVL_SEQUENCES": str(part)} if kind.is_python else None
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False, env=environment)
        found = kind.says.search(done.stdout)
        if done.returncode != 0 or found is None:
            total.tried += part
            total.broken += 1
            print(done.stdout + done.stderr, flush=True)
            continue
        total.tried += int(found[1])
        if not kind.is_python:
            total.vehicle_ms += int(found[2])
            total.flips += int(found[3])
    print(f"{kind.name}: {total}", flush=True)
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


def row(text: str, total: Total) -> str:
    """One kind, for the table."""
    flown = f"{total.vehicle_ms / 3.6e6:.1f} h" if total.vehicle_ms else "-"
    flown += f", {total.flips:,} flips" if total.flips else ""
    return f"| {text} | {total.tried:,} | {flown} | {total.broken} |\n"


def table(hostile: Total, played: dict[str, Total]) -> str:
    """The results for the page."""
    head = (
        f"`make reliability`, {time.strftime('%Y-%m-%d')}; what is C under AddressSanitizer and "
        "UndefinedBehaviorSanitizer.\n\n| what | tried | of the vehicle | broken |\n|---|---|---|---|\n"
    )
    rows = [row(f"sequences of {kind.text}", played[kind.name]) for kind in KINDS]
    first = (
        row("packets, guided by coverage, to the software vehicle", hostile) if hostile.tried or hostile.broken else ""
    )
    return head + first + "".join(rows)


def main() -> int:
    """Try all of them; exit code 1 if something broke."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scale", type=float, default=1.0, help="share of the packets and sequences")
    parser.add_argument("--packets", type=int, default=N_PACKETS, help="datagrams to the software vehicle")
    for kind in KINDS:
        parser.add_argument(f"--{kind.name}", type=int, default=kind.number, help=f"sequences of {kind.text}")
    arguments = parser.parse_args()
    played = {}
    for kind in KINDS:
        number = round(getattr(arguments, kind.name) * arguments.scale)
        played[kind.name] = sequences(kind, number)
    hostile = packets(round(arguments.packets * arguments.scale))
    text = table(hostile, played)
    print(text)
    if arguments.scale == 1.0:
        marked.write(PAGE, text, BEGIN, END)
    return 1 if hostile.broken or any(total.broken for total in played.values()) else 0


if __name__ == "__main__":
    raise SystemExit(main())
