"""Regenerate the part of docs/RESULTS.md that tells of policies for every approach, from data kept beside it.

    .venv/bin/python tools/policy_results.py measure [PART...]   fly a part (all of them), write it into docs/data
    .venv/bin/python tools/policy_results.py write               docs/data -> docs/RESULTS.md
    .venv/bin/python tools/policy_results.py check               is docs/RESULTS.md what `write` would write?

docs/data/policies.json holds each part with the commit and the simulator that it was measured with, and every policy's
numbers. Learned policies are kept in a folder (`--kept`), so that a part that is measured again does not learn again;
name another folder after a change of the simulator. The text between the two marks in RESULTS.md belongs to this
program; everything else in the file is written by hand.
"""

import argparse
import json
import sys
from pathlib import Path
from typing import Any

import marked
import policy_text
from policy_measure import PARTS, Bench

import ivl  # noqa: F401  (sets the number of BLAS threads, before numpy is used)
from ivl import native
from ivl.run import git_commit

ROOT = Path(__file__).parent.parent
DATA, RESULTS = ROOT / "docs" / "data" / "policies.json", ROOT / "docs" / "RESULTS.md"
KEPT = ROOT / "build" / "policies"
BEGIN, END = "<!-- policies: begin -->", "<!-- policies: end -->"
_DIGITS = 4


def main(arguments: list[str] | None = None) -> int:
    """Command line; exit code 1 if `check` finds a difference."""
    parser = argparse.ArgumentParser(description="regenerate the part of docs/RESULTS.md on policies")
    parser.add_argument("--data", type=Path, default=DATA, help="data; default: docs/data/policies.json")
    parser.add_argument("--results", type=Path, default=RESULTS, help="page; default: docs/RESULTS.md")
    commands = parser.add_subparsers(dest="command", required=True)
    measuring = commands.add_parser("measure", help="fly, and write the data")
    measuring.add_argument("parts", nargs="*", metavar="PART", help=f"of {', '.join(PARTS)}; default: all")
    measuring.add_argument("--kept", type=Path, default=KEPT, help="learned policies; default: build/policies")
    measuring.add_argument("--threads", type=int, help="worker threads; default: all processors")
    commands.add_parser("write", help="data -> RESULTS.md")
    commands.add_parser("check", help="compare RESULTS.md with the data")
    args = parser.parse_args(arguments)
    if args.command == "measure":
        unknown = [part for part in args.parts if part not in PARTS]
        if unknown:
            parser.error(f"no part {unknown[0]!r} (allowed {', '.join(PARTS)})")
        measure(args.parts or list(PARTS), args.data, args.kept, args.threads)
        return 0
    new = policy_text.section(read(args.data))
    if args.command == "write":
        return marked.write(args.results, new, BEGIN, END)
    return marked.check(args.results, new, BEGIN, END, args.data)


def read(path: Path) -> dict[str, Any]:
    """The data by part."""
    data: dict[str, Any] = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    return data


def measure(parts: list[str], path: Path, kept: Path, threads: int | None) -> None:
    """Fly parts, and write each into the data as soon as it is there."""
    kept.mkdir(parents=True, exist_ok=True)
    bench = Bench(kept, lambda text: print(text, file=sys.stderr, flush=True), threads)
    for part in parts:
        found = PARTS[part](bench)
        made = {"git_commit": git_commit(), "library_sha256": native.library().digest()}
        data = {**read(path), part: {"made": made, "found": found}}
        path.write_text(json.dumps(_short(data), indent=1, sort_keys=True) + "\n", encoding="utf-8")
        print(f"{path}: {part}", file=sys.stderr, flush=True)


def _short(data: Any, name: str = "") -> Any:
    """Numbers with the digits that mean something; those of a policy stay whole."""
    if isinstance(data, dict):
        return {key: _short(value, key) for key, value in data.items()}
    if isinstance(data, list) and name != "theta":
        return [_short(value) for value in data]
    return round(data, _DIGITS) if isinstance(data, float) else data


if __name__ == "__main__":
    sys.exit(main())
