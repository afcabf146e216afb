"""Random packets and random sequences of events, and their table in the documents.

Packets go to the software vehicle; sequences to the app, to the software vehicle through its server's loop, to the CAN
gateways, and to watch and guard of motion capture. Run by `make reliability`, which builds the C programs with
sanitizers before. `--scale 0.01` tries a hundredth, and writes nothing; `--packets 1000000` and its like say how many
there are of a kind, and the table says so. All run in parts, each with a seed of its own; how far it is and how long
the rest will take is printed after each. What is done is kept in build/kept: Ctrl-C ends it with the table so far, and
the same command goes on.
"""

import argparse
import functools
import os
import re
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

import marked
from kept import Kept, package

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "RELIABILITY.md"
FUZZER = ROOT / "build" / "fuzz" / "fuzz_crtp"
BEGIN, END = "<!-- measured by tools/packets.py: begin -->", "<!-- measured by tools/packets.py: end -->"
DATAGRAMS_A_PART = 400_000
DATAGRAMS_AN_INPUT = 4
"""At least, as it has been so far."""
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


def sequences(kind: Kind, seed: int, part: int) -> Total:
    """So many sequences; what breaks is printed with its shortest sequence."""
    command = [word.format(number=part, seed=seed) for word in kind.command]
    environment = {**os.environ, "IVL_SEQUENCES": str(part)} if kind.is_python else None
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False, env=environment)
    found = kind.says.search(done.stdout)
    if done.returncode != 0 or found is None:
        print(done.stdout + done.stderr, flush=True)
        return Total(part, broken=1)
    if kind.is_python:
        return Total(int(found[1]))
    return Total(int(found[1]), int(found[2]), int(found[3]))


def packets(seed: int, part: int) -> Total:
    """A call of libFuzzer for about so many datagrams, which writes what breaks the vehicle into a file and says which.

    Raises:
        SystemExit: It said nothing: it is not there, or could not begin.
    """
    command = ["tools/fuzz.sh", str(FUZZER), str(max(part // DATAGRAMS_AN_INPUT, 1000)), f"-seed={seed}"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    found = _PACKETS.search(done.stderr)
    if done.returncode != 0 or found is None:
        print(done.stdout + done.stderr[-4000:], flush=True)
    if found is None:
        raise SystemExit("packets: the fuzzer did not say what it had tried")
    return Total(int(found[2]), int(found[3]), broken=int(done.returncode != 0))


def in_parts(name: str, total: Total, number: int, a_part: int, kept: Kept, play: Callable[[int, int], Total]) -> None:
    """Play parts until there are so many; those that an earlier call has played count, if nothing was broken."""
    seed, n_new, began_s = 0, 0, time.monotonic()
    while total.tried < number:
        seed += 1
        part = min(a_part, number - total.tried)
        key = f"{part} of seed {seed}"
        known = kept.get(key)
        played = play(seed, part) if known is None else Total(**known)
        if known is None and not played.broken:
            kept.put(key, asdict(played))
        n_new += played.tried if known is None else 0
        for field, value in asdict(played).items():
            setattr(total, field, getattr(total, field) + value)
        left_s = (time.monotonic() - began_s) * (number - total.tried) / n_new if n_new else 0.0
        left = f", {left_s / 60:.0f} min left" if n_new and total.tried < number else ""
        print(f"{name}: {total.tried:,} of {number:,}, {total.broken} broken{left}", flush=True)


def row(text: str, total: Total) -> str:
    """One kind, for the table."""
    flown = f"{total.vehicle_ms / 3.6e6:.1f} h" if total.vehicle_ms else "-"
    flown += f", {total.flips:,} flips" if total.flips else ""
    return f"| {text} | {total.tried:,} | {flown} | {total.broken} |\n"


def table(hostile: Total, played: dict[str, Total], note: str = "") -> str:
    """The results for the page."""
    head = (
        f"`make reliability`, {time.strftime('%Y-%m-%d')}{note}; what is C under AddressSanitizer and "
        "UndefinedBehaviorSanitizer.\n\n| what | tried | of the vehicle | broken |\n|---|---|---|---|\n"
    )
    rows = [row(f"sequences of {kind.text}", played[kind.name]) for kind in KINDS]
    first = (
        row("packets, guided by coverage, to the software vehicle", hostile) if hostile.tried or hostile.broken else ""
    )
    return head + first + "".join(rows)


def rests_on(kind: Kind) -> list[Path]:
    """What the result of a sequence depends on: the program, or the test and the package."""
    return [ROOT / kind.command[-2], *package()] if kind.is_python else [ROOT / kind.command[0]]


def main() -> int:
    """Try all of them; exit code 1 if something broke, 130 if somebody ended it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scale", type=float, default=1.0, help="share of the packets and sequences")
    parser.add_argument("--packets", type=int, default=N_PACKETS, help="datagrams to the software vehicle")
    for kind in KINDS:
        parser.add_argument(f"--{kind.name}", type=int, default=kind.number, help=f"sequences of {kind.text}")
    arguments = parser.parse_args()
    hostile, played = Total(), {kind.name: Total() for kind in KINDS}
    try:
        for kind in KINDS:
            number = round(getattr(arguments, kind.name) * arguments.scale)
            kept = Kept(kind.name, rests_on(kind))
            in_parts(kind.name, played[kind.name], number, kind.a_part, kept, functools.partial(sequences, kind))
        number = round(arguments.packets * arguments.scale)
        in_parts("packets", hostile, number, DATAGRAMS_A_PART, Kept("packets", [FUZZER]), packets)
    except KeyboardInterrupt:
        print(table(hostile, played, ", ended before it was done"))
        print("packets: ended; the same command goes on from here")
        return 130
    text = table(hostile, played)
    print(text)
    if arguments.scale == 1.0:
        marked.write(PAGE, text, BEGIN, END)
    return 1 if hostile.broken or any(total.broken for total in played.values()) else 0


if __name__ == "__main__":
    raise SystemExit(main())
