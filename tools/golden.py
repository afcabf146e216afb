"""Compare the bits of reference landings across compilers, optimisation levels and thread counts.

Each program given prints one line, a hash over everything that its rollouts computed; its only argument is the number
of threads.  All lines must be equal, and equal to the reference in tests/c/golden.txt, which changes with the physics.

usage: golden.py [--update] PROGRAM...
"""

import argparse
import subprocess
import sys
from pathlib import Path

THREADS = (1, 2, 5)
REFERENCE = Path(__file__).parent.parent / "tests" / "c" / "golden.txt"


def hash_line(program: Path, threads: int) -> str:
    """Return the one line that the program prints; raise if it fails or prints something else."""
    run = subprocess.run([program.resolve(), str(threads)], capture_output=True, text=True, check=False)
    lines = run.stdout.split("\n")
    if run.returncode != 0 or len(lines) != 2 or not lines[0] or lines[1]:
        found = f"exit code {run.returncode}, output {run.stdout!r}, errors {run.stderr!r}"
        raise RuntimeError(f"{program} {threads}: expected one line and exit code 0, found {found}")
    return lines[0]


def main() -> int:
    """Run all programs; return 0 if every hash is the reference."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--update", action="store_true", help="write the reference instead of comparing with it")
    parser.add_argument("programs", nargs="+", type=Path)
    args = parser.parse_args()

    hashes = {(program, n): hash_line(program, n) for program in args.programs for n in THREADS}
    for (program, n), found in hashes.items():
        print(f"  {found}  {program.parent.name:9} {n} threads")
    distinct = set(hashes.values())
    if len(distinct) != 1:
        print(f"error: {len(distinct)} different hashes where there must be one", file=sys.stderr)
        return 1

    (found,) = distinct
    if args.update:
        REFERENCE.write_text(found + "\n", encoding="ascii")
        return 0
    if not REFERENCE.exists():
        print(f"error: {REFERENCE} does not exist; make golden-update writes it", file=sys.stderr)
        return 1
    expected = REFERENCE.read_text(encoding="ascii").strip()
    if found != expected:
        print(f"error: the landings changed from {expected}; if that is meant: make golden-update", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
