"""Regenerate the campaign's part of docs/RESULTS.md from data that are kept beside it.

    .venv/bin/python tools/results_sweep.py collect RUN... [--map RUN...]   run folders -> docs/data
    .venv/bin/python tools/results_sweep.py collect RUN... --keep           the same; runs of other kinds stay
    .venv/bin/python tools/results_sweep.py write                           docs/data -> docs/RESULTS.md
    .venv/bin/python tools/results_sweep.py check                           is docs/RESULTS.md what `write` would write?

A RUN is a folder of `ivl sweep`, a map's one of `ivl map`. docs/data/trials.parquet holds a row of whole numbers per
trial (`ivl.analysis.compact`), states.parquet one per state of the policy maps, runs.json what was run. The text
between the two marks in RESULTS.md belongs to this program; everything else in the file is written by hand.
"""

import argparse
import json
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import marked
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

import ivl  # noqa: F401  (sets the number of BLAS threads, before numpy is used)
from ivl.analysis import campaign_text, compact, region
from ivl.sweep import store

ROOT = Path(__file__).parent.parent
DATA, RESULTS = ROOT / "docs" / "data", ROOT / "docs" / "RESULTS.md"
BEGIN, END = "<!-- campaign: begin -->", "<!-- campaign: end -->"
_KIND = ("vehicle", "gear_set", "learner")
_OF_A_RUN = ("name", "vehicle", "gear_set", "learner", "seed", "git_commit", "model_sha256", "library_sha256")


@dataclass(frozen=True)
class Data:
    """What docs/data holds; tables without rows where a file is missing."""

    trials: pd.DataFrame
    states: pd.DataFrame
    runs: list[dict[str, Any]]


def main(arguments: list[str] | None = None) -> int:
    """Command line; exit code 1 if `check` finds a difference."""
    parser = argparse.ArgumentParser(description="regenerate the campaign's part of docs/RESULTS.md")
    parser.add_argument("--data", type=Path, default=DATA, help="folder with the data; default: docs/data")
    parser.add_argument(
        "--results", type=Path, default=RESULTS, help="file to write or check; default: docs/RESULTS.md"
    )
    commands = parser.add_subparsers(dest="command", required=True)
    collecting = commands.add_parser("collect", help="run folders -> data")
    collecting.add_argument("runs", nargs="+", type=Path, metavar="RUN")
    collecting.add_argument("--map", nargs="*", type=Path, default=[], dest="maps", metavar="RUN")
    collecting.add_argument("--keep", action="store_true", help="keep the data of other vehicles, gears and learners")
    commands.add_parser("write", help="data -> RESULTS.md")
    commands.add_parser("check", help="compare RESULTS.md with the data")
    args = parser.parse_args(arguments)
    if args.command == "collect":
        collect(args.runs, args.maps, args.data, args.keep)
        return 0
    new = section(read(args.data))
    if args.command == "write":
        return marked.write(args.results, new, BEGIN, END)
    return marked.check(args.results, new, BEGIN, END, args.data)


def collect(runs: list[Path], maps: list[Path], folder: Path, keep: bool = False) -> None:
    """Pack run folders into the data folder, replacing what is there; with `keep` only what is of the same kinds."""
    folder.mkdir(parents=True, exist_ok=True)
    packed = [compact.pack(store.read_trials(run), store.read_episodes(run)) for run in runs]
    kept: list[dict[str, Any]] = []
    if keep:
        fresh = {_kind(row) for table in packed for row in table.select(list(_KIND)).to_pylist()}
        before = pq.read_table(folder / "trials.parquet")
        stays = [_kind(row) not in fresh for row in before.select(list(_KIND)).to_pylist()]
        packed = [before.filter(pa.array(stays)), *packed]
        kept = [run for run in read(folder).runs if _kind(run) not in fresh]
    _write(pa.concat_tables(packed).unify_dictionaries(), folder / "trials.parquet")
    states = [compact.pack_states(region.map_states(store.read_map(run))) for run in maps]
    if states:
        _write(pa.concat_tables(states).unify_dictionaries(), folder / "states.parquet")
    about = [*kept, *(_describe(run) for run in (*runs, *maps))]
    (folder / "runs.json").write_text(json.dumps(about, indent=1, sort_keys=True) + "\n", encoding="utf-8")


def _kind(row: dict[str, Any]) -> tuple[Any, ...]:
    return tuple(row.get(name) for name in _KIND)


def read(folder: Path) -> Data:
    """The data folder; a file that is missing gives a table without rows."""
    trials = folder / "trials.parquet"
    states, runs = folder / "states.parquet", folder / "runs.json"
    return Data(
        compact.unpack(pq.read_table(trials)) if trials.exists() else pd.DataFrame(),
        compact.unpack_states(pq.read_table(states)) if states.exists() else pd.DataFrame(),
        json.loads(runs.read_text(encoding="utf-8")) if runs.exists() else [],
    )


def section(data: Data) -> str:
    """The text between the marks."""
    if data.trials.empty:
        return "No campaign has been collected into docs/data.\n"
    return campaign_text.write(data.trials, data.states, data.runs)


def _describe(run: Path) -> dict[str, Any]:
    """What identifies a run, from its manifest."""
    manifest = store.read_manifest(run)
    return {name: manifest[name] for name in _OF_A_RUN if name in manifest}


def _write(table: pa.Table, path: Path) -> None:
    compact.write(table, path)
    print(f"{path}: {table.num_rows} rows, {path.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    sys.exit(main())
