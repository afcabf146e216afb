"""Damage files and let the disk fail, and count what comes of it; writes the second table of docs/RELIABILITY.md.

Run by `make reliability`, which loads tools/faulty_io.c before libc. Each input is tried in a process of its own. It
must end in a good result or in one line with exit code 1 or 2; a number that is read must be the number that is
written there; after a failure of the disk `--resume` must give the same bits as a run without one. `--scale 0.1` tries
a tenth, and writes nothing.
"""

import argparse
import csv
import ctypes
import errno
import io
import json
import math
import os
import pickle
import random
import shutil
import sqlite3
import sys
import tempfile
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass, field
from decimal import Decimal, InvalidOperation
from pathlib import Path
from typing import Any

import marked
import numpy as np
import yaml

from ivl import cli, experiment, landing, model, native, tracefile, yamlfile
from ivl.errors import IvlError
from ivl.policy import file as policy_file
from ivl.store import RunStore
from ivl.sweep import config, plan, store, work
from ivl.sweep import folder as sweep_folder
from ivl.sweep.schema import TASKS

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "RELIABILITY.md"
BEGIN, END = "<!-- measured by tools/borders.py: begin -->", "<!-- measured by tools/borders.py: end -->"
TIME_S = 60.0
"""An input that takes longer counts as a traceback."""
SMALL = ["budget=16", "check.n_fresh=2", "check.effort=0.001"]


@dataclass
class Row:
    """One kind of input, and what came of it."""

    kind: str
    tried: int = 0
    refused: int = 0
    tracebacks: int = 0
    wrong: int = 0
    lost: int = 0
    told: list[str] = field(default_factory=list)

    def note(self, what: str) -> None:
        """Keep an example of a failure."""
        if len(self.told) < 5:
            self.told.append(what)


@dataclass(frozen=True)
class Ending:
    """How a trial ended: `code` as of the command line, -1 for a traceback or a crash; the last lines it said."""

    code: int
    said: str
    value: Any = None


def apart(action: Callable[[], Any], folder: Path) -> Ending:
    """Do something in a process of its own; its value must be picklable. IvlErrors count as on the command line."""
    answer = folder / "answer.pickle"
    answer.unlink(missing_ok=True)
    with (folder / "said.txt").open("w+b") as said:
        child = os.fork()
        if child == 0:
            os.dup2(said.fileno(), 2)
            os.dup2(said.fileno(), 1)
            code = -1
            try:
                value = action()
                code = value if isinstance(value, int) else 0
                answer.write_bytes(pickle.dumps(value))
            except IvlError as error:
                print(f"ivl: {error}", file=sys.stderr)
                code = 2
            except BaseException:  # noqa: BLE001 - whatever it is, it counts as a traceback
                traceback.print_exc()
                code = 99
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(code)
        status = wait(child)
        said.seek(0)
        text = said.read().decode(errors="replace")
    code = os.WEXITSTATUS(status) if os.WIFEXITED(status) else -os.WTERMSIG(status)
    value = pickle.loads(answer.read_bytes()) if answer.exists() else None
    return Ending(-1 if code == 99 or "Traceback" in text else code, text, value)


def wait(child: int) -> int:
    """Exit status of a child that is ended if it takes too long."""
    ends_s = time.monotonic() + TIME_S
    while True:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            return status
        if time.monotonic() > ends_s:
            os.kill(child, 9)
            return os.waitpid(child, 0)[1]
        time.sleep(0.002)


def judge(row: Row, ending: Ending, is_wrong: Callable[[Any], bool], what: str) -> None:
    """Count an ending; `is_wrong` looks at the value of a good one."""
    row.tried += 1
    complaints = [line for line in ending.said.splitlines() if line.startswith("ivl: ")]
    if ending.code == 0:
        if is_wrong(ending.value):
            row.wrong += 1
            row.note(f"{what}: another number")
    elif ending.code in (1, 2) and len(complaints) == 1:
        row.refused += 1
    else:
        row.tracebacks += 1
        row.note(f"{what}: code {ending.code}: {ending.said[-400:]}")


# ---- damage


def damage(data: bytes, rng: random.Random) -> bytes:
    """One of many kinds of damage to a file."""
    n = len(data)
    at = rng.randrange(n) if n else 0
    size = min(rng.choice((1, 4, 64, 512, 4096)), n)
    kind = rng.randrange(12)
    if kind == 0:
        return data[:at]
    if kind == 1:
        return b""
    if kind in (2, 3, 4):
        return data[:at] + bytes([data[at] ^ (1 << rng.randrange(8))]) + data[at + 1 :]
    if kind == 5:
        return data[:at] + bytes(size) + data[at + size :]
    if kind == 6:
        return data[:at] + rng.randbytes(size) + data[at + size :]
    if kind == 7:
        return data[:at] + data[at : at + size] * 2 + data[at + size :]
    if kind == 8:
        return data[:at] + data[at + size :]
    if kind == 9:
        return data + rng.randbytes(size)
    if kind == 10:
        return data[at:]
    return rng.randbytes(n)


def damage_text(text: str, rng: random.Random) -> bytes:
    """Damage that people and their programs do to text files, or any other one."""
    odd = [
        "nan",
        "",
        "inf",
        "-inf",
        "1e999",
        "1_000",
        "060",
        "0x1F",
        "1,5",
        "yes",
        "abc",
        "[" * 300,
        "9" * 6000,
        "\x00",
        "1e-6",
        "~",
    ]
    kind = rng.randrange(8)
    if kind == 0:
        return b"\xef\xbb\xbf" + text.encode()
    if kind == 1:
        return text.encode("utf-16")
    if kind == 2:
        return text.replace("\n", "\r\n").encode()
    if kind == 3:
        lines = text.splitlines(keepends=True)
        lines.insert(rng.randrange(len(lines)), rng.choice(lines))
        return "".join(lines).encode()
    if kind == 4:
        lines = text.splitlines(keepends=True)
        del lines[rng.randrange(len(lines))]
        return "".join(lines).encode()
    if kind in (5, 6):
        words = [(i, c) for i, c in enumerate(text) if c.isdigit()]
        start = rng.choice(words)[0]
        end = start
        while end < len(text) and text[end] in "0123456789.eE+-":
            end += 1
        return (text[:start] + rng.choice(odd) + text[end:]).encode()
    return damage(text.encode(), rng)


# ---- kinds


def yaml_is_wrong(text: str, value: Any) -> bool:
    """Whether a number that was read is not what its text says in decimal; text and nulls are not looked at."""
    numbers: list[tuple[str, Any]] = []
    walk(yaml.compose(text, Loader=yaml.BaseLoader), value, numbers, 0)
    return any(decimal(said) != read for said, read in numbers)


def walk(node: Any, value: Any, found: list[tuple[str, Any]], depth: int) -> None:
    """Pairs of text and number."""
    if isinstance(node, yaml.ScalarNode) and isinstance(value, (int, float)) and not isinstance(value, bool):
        found.append((node.value, value))
    elif isinstance(node, yaml.SequenceNode) and depth < 50:
        for child, part in zip(node.value, value, strict=True):
            walk(child, part, found, depth + 1)
    elif isinstance(node, yaml.MappingNode) and depth < 50:
        for key, child in node.value:
            if key.value in value:
                walk(child, value[key.value], found, depth + 1)


def decimal(text: str) -> float:
    """The number that a person reads."""
    try:
        return float(Decimal(text.replace(".inf", "inf").replace(".nan", "nan")))
    except InvalidOperation:
        return math.nan


def try_scalars(row: Row, n: int, folder: Path, rng: random.Random) -> None:
    """Random spellings of numbers, thousands in one process."""
    alphabet = "0123456789" * 3 + "+-.eE_:xob ,n"
    texts = ["".join(rng.choices(alphabet, k=rng.randrange(1, 9))) for _ in range(n)]

    def read() -> list[tuple[str, Any]]:
        result = []
        for text in texts:
            try:
                result.append((text, yamlfile.parse(f"x: {text}", "x").get("x")))
            except IvlError:
                result.append((text, "refused"))
        return result

    ending = apart(read, folder)
    row.tried += n
    if ending.value is None:
        row.tracebacks += 1
        row.note(ending.said[-300:])
        return
    for text, value in ending.value:
        row.refused += value == "refused"
        if isinstance(value, (int, float)) and not isinstance(value, bool) and decimal(text) != value:
            row.wrong += 1
            row.note(f"{text!r} read as {value!r}")


def try_yaml(row: Row, n: int, folder: Path, rng: random.Random) -> None:
    """Damaged experiments, vehicles, gears, policies."""
    base = Path(experiment.__file__).parent
    names = [base / "experiments/paper_vertical.yaml", base / "vehicles/crazyflie21.yaml", base / "gears/table1.yaml"]
    loads: list[Callable[[Path], Any]] = [
        lambda path: experiment.load(str(path)),
        lambda path: model.load_vehicle(str(path)),
        lambda path: model.load_gear("wide_short", str(path)),
    ]
    for i in range(n):
        k = i % len(names)
        path = folder / f"damaged {i}.yaml"
        path.write_bytes(damage_text(names[k].read_text(encoding="utf-8"), rng))

        def read(path: Path = path, load: Callable[[Path], Any] = loads[k]) -> Any:
            load(path)
            return yamlfile.read(path)

        ending = apart(read, folder)
        judge(row, ending, lambda value, path=path: yaml_is_wrong(path.read_text("utf-8-sig"), value), path.name)
        path.unlink()


def try_traces(row: Row, n: int, folder: Path, rng: random.Random, suffix: str) -> None:
    """Damaged traces, through `ivl export`."""
    spec = landing.LandingSpec(speed_mps=2.5, angle_deg=90.0, theta=[4.8, 8.0])
    _, trace = spec.fly(period_s=0.02)
    good = folder / f"good{suffix}"
    tracefile.write(good, trace.rows)
    for i in range(n):
        path = folder / f"a[b] ü {i}{suffix}"
        data = good.read_bytes()
        path.write_bytes(damage_text(data.decode(), rng) if suffix == ".csv" else damage(data, rng))

        def export(path: Path = path) -> int:
            return cli.run(["export", str(path), "--out", str(folder / "out.mcap")])

        ending = apart(export, folder)
        judge(row, ending, lambda _, path=path: trace_is_wrong(path), path.name)
        path.unlink()


def trace_is_wrong(path: Path) -> bool:
    """Whether numbers that were read are not those that another reader finds."""
    rows = tracefile.columns(tracefile.read(path))
    if path.suffix == ".npz":
        with np.load(path) as table:
            return any(not np.array_equal(table[name], rows[name], equal_nan=True) for name in rows)
    lines = list(csv.DictReader(io.StringIO(path.read_text("utf-8-sig"))))
    for name, column in rows.items():
        said = [decimal(line[name].strip() or "nan") for line in lines if any(line.values())]
        if not np.array_equal(np.array(said, dtype=column.dtype), column, equal_nan=column.dtype.kind == "f"):
            return True
    return False


def database_rows(folder: Path) -> list[list[Any]]:
    """All that a run has stored."""
    with sqlite3.connect(folder / "run.sqlite") as db:
        tables = ("rollout ORDER BY trial, episode, idx", "episode ORDER BY trial, episode", "learner ORDER BY trial")
        return [db.execute(f"SELECT * FROM {table}").fetchall() for table in tables]


def stored(folder: Path) -> Any:
    """What a reader of a run gets."""
    with RunStore.open_reading(folder, native.library().outcome_dtype) as run:
        return run.rollouts().outcomes.tobytes(), run.rollouts().theta.tolist(), run.episodes(), run.learner_states()


def try_run(row: Row, n: int, folder: Path, rng: random.Random, good: Path) -> None:
    """Damaged databases and descriptions of a run of `ivl learn`."""
    expected = stored(good)
    for i in range(n):
        copy = folder / "copy"
        shutil.copytree(good, copy)
        name = ("run.sqlite", "run.sqlite", "run.sqlite", "manifest.json", "config.yaml", "best.json")[i % 6]
        (copy / name).write_bytes(damage((copy / name).read_bytes(), rng))

        def read(copy: Path = copy) -> Any:
            code = cli.run(["export", str(copy), "--out", str(folder / "out.csv"), "--format", "csv"])
            return stored(copy) if code == 0 else code

        ending = apart(read, folder)
        judge(row, ending, lambda value: value != expected, f"{name} {i}")
        shutil.rmtree(copy)


def small_sweep(folder: Path) -> Path:
    """A finished sweep without a cluster."""
    settings = ["budget=16", "trials=2", "keep_rollouts=true"]
    grid = config.load_sweep("sweeps/smoke.yaml", settings, ["gear=wide_short", "speed_mps=2.5", "angle_deg=60.0,90.0"])
    run, worlds = folder / "sweep", grid.worlds()
    sweep_folder.open_run(run, grid, worlds, 2, resume=False).close()
    for task in plan.plan(grid, 2):
        done = work.run_task(grid, worlds[task.world], task)
        store.write_part(run, task.number, {**done.parts, TASKS: work.record(task, done)})
    return run


def try_sweep(row: Row, n: int, folder: Path, rng: random.Random, good: Path) -> None:
    """Damaged tables of a sweep."""
    kinds = ("trials", "episodes", "rollouts")
    expected = [store.read_frame(good, kind) for kind in kinds]
    parts = [*sorted(path.relative_to(good) for path in good.rglob("*.parquet")), Path("manifest.json")]
    for i in range(n):
        copy = folder / "copy"
        shutil.copytree(good, copy)
        path = copy / parts[i % len(parts)]
        path.write_bytes(damage(path.read_bytes(), rng))

        def read(copy: Path = copy) -> bool:
            found = [store.read_frame(copy, kind) for kind in kinds]  # frames are equal where both have NaN
            return all(one.equals(other) for one, other in zip(found, expected, strict=True))

        ending = apart(lambda: [read()], folder)
        judge(row, ending, lambda value: value != [True], str(parts[i % len(parts)]))
        shutil.rmtree(copy)


def try_policies(row: Row, n: int, folder: Path, rng: random.Random) -> None:
    """Damaged policies: what is read has the digest that was written."""
    form = experiment.load("experiments/paper_vertical.yaml").policy.shape
    task = {"vehicle": "habas2021", "gear": "wide_short"}
    made = policy_file.make(form, [4.8, 8.0], [policy_file.PolicyTask(**task)], None, None)
    good = folder / "good.yaml"
    policy_file.save(made, good)
    for i in range(n):
        path = folder / f"policy {i}.yaml"
        path.write_bytes(damage_text(good.read_text(), rng))
        ending = apart(lambda path=path: [policy_file.load(path).values], folder)
        same = [made.values]
        judge(
            row,
            ending,
            lambda value, path=path, same=same: (
                value != same and b"digest: null" not in path.read_bytes() and b"\ndigest: " in path.read_bytes()
            ),
            path.name,
        )
        path.unlink()


# ---- faults of the machine


def try_disk(rows: dict[str, Row], n: int, folder: Path, rng: random.Random, shim: Any) -> None:
    """Let each of many operations on a run folder fail, then continue."""
    file = folder / "small.yaml"
    file.write_text(experiment.load("experiments/paper_vertical.yaml", SMALL, learner="ephe").to_yaml())

    def learn(run: Path, *more: str, at: int = 1 << 60, error: int = 0) -> Ending:
        def action() -> int:
            shim.ivl_fault_arm(os.fsencode(run), at, error)
            code = cli.run(["learn", str(file), "--trials", "2", "--out", str(run), "--json", *more])
            print("operations", shim.ivl_fault_count())
            return code

        return apart(action, folder)

    reference = folder / "reference"
    began = learn(reference)
    if began.code:
        raise SystemExit(began.said)
    operations = int(began.said.rpartition("operations ")[2])
    expected = database_rows(reference), result_of(reference)
    errors = {"full disk": errno.ENOSPC, "EIO": errno.EIO, "EROFS": errno.EROFS, "SIGKILL": 0, "ENOLCK": errno.ENOLCK}
    for name, error in errors.items():
        row = rows[name]
        places = [0, 1] if error == errno.ENOLCK else sorted(rng.sample(range(operations), min(n, operations)))
        for at in places:
            run = folder / "run"
            shutil.rmtree(run, ignore_errors=True)
            ending = learn(run, at=at, error=error)
            row.tried += 1
            complaints = [line for line in ending.said.splitlines() if line.startswith("ivl: ")]
            if ending.code == 0:  # as for a folder that cannot be flushed, or a temporary file that is not removed
                pass
            elif (ending.code == -9 and error == 0) or (ending.code in (1, 2) and len(complaints) == 1):
                row.refused += 1
            else:
                row.tracebacks += 1
                row.note(f"{name} at {at}: code {ending.code}: {ending.said[-500:]}")
            again = learn(run, "--resume") if run.exists() else learn(run)
            if again.code or (database_rows(run), result_of(run)) != expected:
                row.lost += 1
                row.note(f"{name} at {at}: not continued: code {again.code}: {again.said[-300:]}")


def result_of(run: Path) -> Any:
    """The verdict of a run, without where it is."""
    return {k: v for k, v in json.loads((run / "result.json").read_text()).items() if k != "run_dir"}


# ---- the table


def table(rows: list[Row]) -> str:
    """The table of the page."""
    lines = [
        "| kind | inputs tried | refused in one line | tracebacks | wrong numbers | things lost |",
        "|---|---|---|---|---|---|",
    ]
    lines += [f"| {r.kind} | {r.tried} | {r.refused} | {r.tracebacks} | {r.wrong} | {r.lost} |" for r in rows]
    return "\n".join(lines) + "\n"


def main() -> None:
    """Try everything, print what failed, write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scale", type=float, default=1.0, help="share of the inputs to try")
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    shim = ctypes.CDLL(os.environ["IVL_FAULTY_IO"])
    shim.ivl_fault_arm.argtypes = [ctypes.c_char_p, ctypes.c_long, ctypes.c_int]
    shim.ivl_fault_count.restype = ctypes.c_long
    rng = random.Random(arguments.seed)

    def times(n: int) -> int:
        return max(round(arguments.scale * n), 3)

    rows = []
    with tempfile.TemporaryDirectory(prefix="ivl borders [x] ") as name:
        folder = Path(name)
        good = folder / "good run"
        code = apart(lambda: cli.run(["learn", "experiments/paper_vertical.yaml", "--learner", "ephe", "--trials", "2",
            "--out", str(good), *(word for s in SMALL for word in ("--set", s))]), folder)  # fmt: skip
        if code.code:
            raise SystemExit(code.said)
        kinds: list[tuple[str, int, Callable[[Row, int], None]]] = [
            ("spellings of a number in YAML", 20_000, lambda r, n: try_scalars(r, n, folder, rng)),
            ("damaged experiment, vehicle and gear files", 400, lambda r, n: try_yaml(r, n, folder, rng)),
            ("damaged traces, CSV", 250, lambda r, n: try_traces(r, n, folder, rng, ".csv")),
            ("damaged traces, npz", 150, lambda r, n: try_traces(r, n, folder, rng, ".npz")),
            ("damaged runs of `ivl learn` (SQLite, JSON, YAML)", 240, lambda r, n: try_run(r, n, folder, rng, good)),
            ("damaged sweeps (Parquet, JSON)", 200, lambda r, n: try_sweep(r, n, folder, rng, small_sweep(folder))),
            ("damaged policies", 150, lambda r, n: try_policies(r, n, folder, rng)),
        ]
        for kind, n, attempt in kinds:
            row = Row(kind)
            attempt(row, times(n))
            rows.append(row)
            print(f"{row.kind}: {row.tried} tried, {row.tracebacks} tracebacks, {row.wrong} wrong", flush=True)
        disk = {
            name: Row(f"a write to a run folder fails: {name}")
            for name in ("full disk", "EIO", "EROFS", "SIGKILL", "ENOLCK")
        }
        try_disk(disk, times(52), folder, rng, shim)
        rows += disk.values()
    for row in rows:
        for text in row.told:
            print(f"!! {row.kind}: {text}")
    print(table(rows))
    if arguments.scale == 1.0:
        marked.write(PAGE, table(rows), BEGIN, END)
    if any(row.tracebacks or row.wrong or row.lost for row in rows):
        raise SystemExit(1)


if __name__ == "__main__":
    main()
