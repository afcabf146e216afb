"""Put small faults into the product, one at a time, and ask the quick tests of that place whether they notice.

Run by `make mutants`; writes its table of docs/RELIABILITY.md. `--scale 0.02` tries a fiftieth of them, and writes
nothing. Each fault is put into a copy of the tree and built by the commands of the project's own makefiles, so that
what is tested is what is built. The C tests link the product as libraries: a fault costs one compilation, one link and
the tests up to the first that fails, those first that found faults of that source before. A fault that does not
compile, or that gives the same program, is none. Those that were looked at and change nothing that anybody could see
stand in tools/mutants_equal.txt, each with its reason.

Verdicts are kept in build/mutants-kept.jsonl, or where `--kept` says, so that a run that was ended goes on where it
was. A kept verdict counts as long as neither the source nor the test that found the fault has changed; what was not
found is always tried again.
"""

import argparse
import functools
import hashlib
import json
import math
import os
import resource
import shlex
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import cmaes  # noqa: F401 - loaded once for all children
import hypothesis  # noqa: F401
import marked
import matplotlib.pyplot  # noqa: F401
import numpy as np  # noqa: F401
import pydantic  # noqa: F401
import pytest
import scipy.stats  # noqa: F401
import sklearn.svm  # noqa: F401
import yaml  # noqa: F401
from mutant_rules import Mutant, is_other_program, mutants

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "RELIABILITY.md"
EQUAL = ROOT / "tools" / "mutants_equal.txt"
BEGIN, END = "<!-- measured by tools/mutants.py: begin -->", "<!-- measured by tools/mutants.py: end -->"
TREE = ROOT / "build" / "mutants"
KEPT = ROOT / "build" / "mutants-kept.jsonl"
DIRTY = TREE / "dirty.txt"
"""Names the source that has a fault; what was made of it is made anew if a run was ended meanwhile."""
FLAVOUR = "shared"
LIBRARIES = [f"build/{FLAVOUR}/{name}.so" for name in ("libtested", "libtested_cf", "libtested_crtp")]
TIME_S = 1800.0
"""A test that takes longer has noticed: its program waits for what never comes.  The clock on the wall says little on a
busy machine: what works for too long is ended by its limit of processor time."""
PROCESSOR_S = 300
"""Of a test before it has been measured."""
FOUND, SURVIVED, EQUIVALENT, NONE = "found", "survived", "equivalent", "none"
QUIET = ["-W", "ignore::pytest.PytestAssertRewriteWarning"]
"""What is loaded before is not rewritten, and need not be."""
MAKE = ["make", "--no-print-directory"]
NATIVE = ["-f", "tools/native.mk", f"FLAVOUR={FLAVOUR}", "WARNINGS=-w", "CC=gcc"]
APP = ["-f", "tools/app.mk", "CC=gcc -w"]
APP_TESTS = {"test_app": ["build/app/test_app"], "sequences": ["build/app/sequences", "500"]}


@dataclass(frozen=True)
class Area:
    """A part of the product, how many faults it gets, and the tests that are asked.

    Attributes:
        name: For the table.
        sources: Patterns of paths, from the root.
        number: Faults of a full run.
        least: Share that must be found.
        tests: C test programs by pattern, or files of pytest.
        but: Sources that another area has.
    """

    name: str
    sources: tuple[str, ...]
    number: int
    least: float
    tests: tuple[str, ...]
    but: tuple[str, ...] = ()


LEARNER_TESTS = ("learners", "ephe", "ephe_memory", "cma_learner", "gp", "bo", "learners_bo_search", "belief")
AREAS = (
    Area("firmware core", ("firmware/core/ivl_*.c",), 130, 0.97, ("test_ivl_*",), ("ivl_guard.c", "ivl_wire.c")),
    Area("guard", ("firmware/core/ivl_guard.c",), 50, 0.97, ("test_ivl_*",)),
    Area(
        "app",
        ("firmware/app/app_*.c",),
        60,
        0.97,
        ("test_app", "sequences"),
        ("app_port.c",),
    ),
    Area(
        "wire",
        ("firmware/core/ivl_wire.c", "sim_sil/sil_wire.c"),
        30,
        0.97,
        ("test_ivl_wire", "test_ivl_parts", "test_sil_wire"),
    ),
    Area("crtp", ("sim_sil/crtp/crtp_*.c",), 60, 0.92, ("test_crtp_*",), ("crtp_main.c", "crtp_udp.c")),
    Area(
        "learners", ("host/ivl/learners/*.py",), 50, 0.92, tuple(f"tests/py/test_{name}.py" for name in LEARNER_TESTS)
    ),
    Area(
        "mocap",
        ("host/ivl/mocap/watch.py", "host/ivl/mocap/guard.py"),
        40,
        0.92,
        ("tests/wire/test_mocap_watch.py",),
    ),
    Area("store", ("host/ivl/store.py",), 30, 0.92, ("tests/py/test_store.py", "tests/py/test_borders.py")),
)


@dataclass(frozen=True)
class Verdict:
    """What became of a fault."""

    mutant: Mutant
    ending: str
    by: str = ""


# ---- what is tried


def sources(area: Area) -> list[str]:
    """The sources of an area, from the root, in order."""
    paths = sorted({p for pattern in area.sources for p in ROOT.glob(pattern)})
    return [str(p.relative_to(ROOT)) for p in paths if p.name not in area.but]


def candidates(area: Area, seed: int) -> list[Mutant]:
    """All faults of an area in an order that the seed decides; a change of one line moves no other line's faults."""
    found = [m for path in sources(area) for m in mutants(path, (ROOT / path).read_text(encoding="utf-8"))]
    return sorted(found, key=lambda m: digest(f"{seed} {m.path} {m.before} {m.after}"))


def digest(text: str) -> str:
    """Of a text, for names and orders."""
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def source_of(test: str) -> Path:
    """The file of a test, by its name in a verdict."""
    return next(path for path in ROOT.glob(f"tests/*/{test}.*") if path.suffix in (".c", ".py"))


def fingerprint(verdict: Verdict) -> str:
    """What a kept verdict rests on: the source with the fault, and the test that found it."""
    test = source_of(verdict.by).read_text(encoding="utf-8") if verdict.by else ""
    return digest(verdict.mutant.path + verdict.mutant.text + test)


def keep(verdict: Verdict, kept: Path) -> None:
    """Write down what became of a fault."""
    mutant = verdict.mutant
    names = {
        "fault": digest(mutant.path + mutant.text),
        "ending": verdict.ending,
        "by": verdict.by,
        "path": mutant.path,
    }
    with kept.open("a", encoding="utf-8") as file:
        file.write(json.dumps({**names, "fingerprint": fingerprint(verdict), "what": str(mutant)}) + "\n")


def read_kept(path: Path) -> dict[str, dict[str, str]]:
    """Verdicts of earlier runs by fault, the last of each."""
    if not path.exists():
        return {}
    return {kept["fault"]: kept for kept in map(json.loads, path.read_text(encoding="utf-8").splitlines())}


def recalled(mutant: Mutant, kept: dict[str, dict[str, str]]) -> Verdict | None:
    """The verdict of an earlier run, if it still counts."""
    earlier = kept.get(digest(mutant.path + mutant.text))
    if earlier is None or earlier["ending"] == SURVIVED:
        return None
    verdict = Verdict(mutant, earlier["ending"], earlier["by"])
    return verdict if fingerprint(verdict) == earlier["fingerprint"] else None


def read_equal() -> dict[tuple[str, str, str], str]:
    """Faults that change nothing, with their reasons; SystemExit for a line that fits no source any more."""
    known = {}
    for number, line in enumerate(EQUAL.read_text(encoding="utf-8").splitlines(), 1):
        if line and not line.startswith("#"):
            fields = line.split(" ~~ ")
            if len(fields) != 4:
                raise SystemExit(f"{EQUAL.name}:{number}: path ~~ line ~~ changed line ~~ reason")
            path, before, after, reason = fields
            if before not in [text.strip() for text in (ROOT / path).read_text(encoding="utf-8").splitlines()]:
                raise SystemExit(f"{EQUAL.name}:{number}: {path} has no such line")
            known[path, before, after] = reason
    return known


# ---- running


def run(command: list[str], processor_s: int = PROCESSOR_S) -> int:
    """Exit code of a command in the copy; -1 if it does not end, and then it and its children are ended."""
    with subprocess.Popen(
        ["prlimit", f"--cpu={processor_s}", *command],
        cwd=TREE,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    ) as process:
        try:
            return process.wait(TIME_S)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            return -1


def run_pytest(test: str, processor_s: int = PROCESSOR_S) -> int:
    """Exit code of pytest on a file of the copy, negative if it does not end.

    A child of this process has what takes long to load already, but nothing of the package that has the fault.
    """
    child = os.fork()
    if child == 0:
        code = 99
        try:
            os.setsid()
            resource.setrlimit(resource.RLIMIT_CPU, (processor_s, processor_s))
            quiet = os.open(os.devnull, os.O_RDWR)
            for fd in (0, 1, 2):
                os.dup2(quiet, fd)
            os.chdir(TREE)
            # a fault may have the size and the time of what it replaces: nothing compiled may be kept
            sys.dont_write_bytecode = True
            os.environ["PYTHONDONTWRITEBYTECODE"] = "1"
            os.environ["PYTHONPATH"] = str(TREE / "host")
            os.environ["HYPOTHESIS_STORAGE_DIRECTORY"] = str(TREE / "found")
            sys.path.insert(0, str(TREE / "host"))
            code = int(pytest.main(["-x", "-q", "-p", "no:cacheprovider", "--tb=no", *QUIET, test]))
        finally:
            os._exit(code)
    ends_s = time.monotonic() + TIME_S
    while time.monotonic() < ends_s:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            return os.waitstatus_to_exitcode(status)
        time.sleep(0.02)
    os.killpg(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return -1


def files_in(folder: Path) -> list[Path]:
    """All files below a folder, but for what Python has compiled, which comes and goes while other tests run."""
    return [Path(at, name) for at, _, names in os.walk(folder) for name in names if Path(at).name != "__pycache__"]


def copy_tree() -> None:
    """The tree as it is; what was compiled in the copy before is kept, and makefiles compile what has changed since."""
    if DIRTY.exists():
        (TREE / DIRTY.read_text(encoding="utf-8")).write_bytes(b"")
        DIRTY.unlink()
    for name in ("firmware", "sim_sil", "tests", "tools", "host", "build/unity"):
        wanted, there = ({p.relative_to(root) for p in files_in(root / name)} for root in (ROOT, TREE))
        for path in there - wanted:
            (TREE / path).unlink()
        for path in wanted:
            if path not in there or (TREE / path).read_bytes() != (ROOT / path).read_bytes():
                (TREE / path).parent.mkdir(parents=True, exist_ok=True)
                # as new, so that it is compiled
                shutil.copy(ROOT / path, TREE / path)
    for name in (FLAVOUR, "app"):
        if (ROOT / "build" / name).is_dir() and not (TREE / "build" / name).exists():
            shutil.copytree(ROOT / "build" / name, TREE / "build" / name, copy_function=shutil.copy)
    for name in ("pyproject.toml", "Makefile", "docs", "CHANGELOG.md", "README.md"):
        if not (TREE / name).is_symlink():
            (TREE / name).symlink_to(ROOT / name)


def programs(area: Area) -> list[str]:
    """C test programs of an area; the random ones last."""
    folders = ("tests/c", "tests/app", "tests/fuzz")
    found = {p.stem for pattern in area.tests for folder in folders for p in ROOT.glob(f"{folder}/{pattern}.c")}
    if not found:
        raise SystemExit(f"mutants: no test fits {area.tests}")
    return sorted(found, key=lambda name: (name.endswith("_fuzz"), name))


def in_order(tests: list[str], path: str, finders: Counter[tuple[str, str]]) -> list[str]:
    """The tests of a source: its own first, then those that have found most."""
    stem = Path(path).stem.split("_", 1)[-1]
    return sorted(tests, key=lambda test: (stem not in test, -finders[path, Path(test).stem]))


def program(test: str) -> list[str]:
    """The command that runs a C test in the copy."""
    return APP_TESTS.get(test, [f"build/{FLAVOUR}/{test}"])


def build(test: str) -> int:
    """Build a C test by its makefile."""
    return run([*MAKE, *(APP if test in APP_TESTS else NATIVE), program(test)[0]])


@functools.lru_cache(maxsize=1000)
def recipe(makefile: tuple[str, ...], path: str, targets: tuple[str, ...]) -> tuple[list[str], list[Path]]:
    """What make would do after a change of one source: its commands that compile and link, and what they make."""
    # what FORCE checks at each call, flags and lists of sources, has not changed
    command = [*MAKE, *makefile, "--dry-run", "-o", "FORCE", "-W", path, *targets]
    done = subprocess.run(command, cwd=TREE, capture_output=True, text=True, check=True)
    commands = [line for line in done.stdout.splitlines() if line.startswith("gcc ")]
    words = [shlex.split(command) for command in commands]
    return commands, [TREE / line[line.index("-o") + 1] for line in words]


@functools.cache
def build_libraries() -> None:
    """Build all libraries of the copy without a fault: what a change of a source means is told of what is there."""
    if run([*MAKE, *NATIVE, *LIBRARIES]) != 0:
        raise SystemExit(f"mutants: {', '.join(LIBRARIES)}: cannot be built")


def recipes(area: Area, path: str) -> dict[str, tuple[list[str], list[Path]]]:
    """How a source is built again: into the libraries, if a test links them, and into each test of the app."""
    found = {}
    if any(test not in APP_TESTS for test in programs(area)):
        build_libraries()
        found["libraries"] = recipe(tuple(NATIVE), path, tuple(LIBRARIES))
    for test in APP_TESTS:
        if test in area.tests:
            found[test] = recipe(tuple(APP), path, (program(test)[0],))
    return found


def follow(commands: list[str]) -> bool:
    """Whether the commands of a recipe succeed."""
    return run(["sh", "-e", "-c", "\n".join(commands)]) == 0


@contextmanager
def with_fault(mutant: Mutant, made: list[Path]) -> Iterator[None]:
    """Put a fault into the copy, and put back its source and what was made of it."""
    path, before = TREE / mutant.path, [(file, file.read_bytes()) for file in made]
    DIRTY.write_text(mutant.path, encoding="utf-8")
    path.write_text(mutant.text, encoding="utf-8")
    try:
        yield
    finally:
        shutil.copy(ROOT / mutant.path, path)
        for file, data in before:
            file.write_bytes(data)  # newer than the source
        DIRTY.unlink()


def try_c(area: Area, mutant: Mutant, limits: dict[str, int], finders: Counter[tuple[str, str]]) -> Verdict:
    """Compile a fault, and run tests until one fails."""
    how = recipes(area, mutant.path)
    with with_fault(mutant, [file for _, made in how.values() for file in made]):
        if "libraries" in how and not follow(how["libraries"][0]):
            return Verdict(mutant, NONE)
        for test in in_order(programs(area), mutant.path, finders):
            if test in how and not follow(how[test][0]):
                return Verdict(mutant, NONE)
            if run(program(test), limits[test]) != 0:
                return Verdict(mutant, FOUND, test)
        return Verdict(mutant, SURVIVED if is_other_code(mutant) else NONE)


def is_other_code(mutant: Mutant) -> bool:
    """Whether the compiler makes something else of a fault."""
    return assembly(TREE / mutant.path, mutant.path) != assembly(ROOT / mutant.path, mutant.path)


def assembly(path: Path, place: str) -> bytes | None:
    """Optimised code of a source in the copy of the tree; None if it does not compile."""
    folders = (
        "firmware/core",
        "firmware/app",
        "sim_sil",
        "sim_sil/physics",
        "sim_sil/world",
        "sim_sil/cf",
        "sim_sil/crtp",
    )
    sdk = "sim_sil/cf/sdk" if place.startswith("firmware/app") and not place.endswith("app_cpx.c") else "firmware/sdk"
    command = [
        "gcc",
        "-w",
        "-std=gnu11",
        "-O2",
        "-ffp-contract=off",
        "-DSDK_ON_HOST",
        "-isystem",
        sdk,
        "-isystem",
        "firmware/sdk",
    ]
    command += [part for folder in folders for part in ("-I", folder)] + ["-S", "-x", "c", "-o", "-", "-"]
    source = path.read_bytes()
    done = subprocess.run(command, input=source, cwd=TREE, capture_output=True, check=False)
    return done.stdout if done.returncode == 0 else None


def try_python(area: Area, mutant: Mutant, limits: dict[str, int], finders: Counter[tuple[str, str]]) -> Verdict:
    """Run tests on a fault until one fails."""
    if not is_other_program((ROOT / mutant.path).read_text(encoding="utf-8"), mutant.text):
        return Verdict(mutant, NONE)
    with with_fault(mutant, []):
        for test in in_order(list(area.tests), mutant.path, finders):
            if run_pytest(test, limits[test]) != 0:
                return Verdict(mutant, FOUND, Path(test).stem)
    return Verdict(mutant, SURVIVED)


def try_area(
    area: Area, number: int, seed: int, equal: dict[tuple[str, str, str], str], kept_path: Path
) -> list[Verdict]:
    """Verdicts of so many faults that are some."""
    verdicts: list[Verdict] = []
    kept = read_kept(kept_path)
    finders = Counter((earlier["path"], earlier["by"]) for earlier in kept.values() if earlier["by"])
    limits: dict[str, int] = {}
    for mutant in candidates(area, seed):
        if len(verdicts) >= number:
            break
        began_s = time.monotonic()
        verdict = recalled(mutant, kept)
        if verdict is None:
            limits = limits or check_untouched(area)
            attempt = try_c if mutant.path.endswith(".c") else try_python
            verdict = attempt(area, mutant, limits, finders)
            keep(verdict, kept_path)
            finders[mutant.path, verdict.by] += 1
        if verdict.ending == SURVIVED and (mutant.path, mutant.before, mutant.after) in equal:
            verdict = Verdict(mutant, EQUIVALENT)
        if verdict.ending != NONE:
            verdicts.append(verdict)
            took_s = time.monotonic() - began_s
            ended = f"{verdict.ending} {verdict.by}".strip()
            print(f"{area.name} {len(verdicts)}/{number} {ended}, {took_s:.0f} s: {mutant}", flush=True)
    return verdicts


def check_untouched(area: Area) -> dict[str, int]:
    """Refuse tests that fail without a fault, and measure the others: how many seconds of processor each may take."""
    limits, bad = {}, []
    is_c = sources(area)[0].endswith(".c")
    for test in programs(area) if is_c else area.tests:
        is_built = not is_c or build(test) == 0
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        if not is_built or (run(program(test)) if is_c else run_pytest(test)) != 0:
            bad.append(test)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        took_s = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        limits[test] = 2 + math.ceil(4.0 * took_s)
    if bad:
        raise SystemExit(f"mutants: without a fault these fail already: {', '.join(bad)}")
    return limits


# ---- telling


def share(verdicts: list[Verdict]) -> float:
    """How many of the faults that change something were found."""
    counts = Counter(v.ending for v in verdicts)
    return counts[FOUND] / max(counts[FOUND] + counts[SURVIVED], 1)


def table(results: dict[str, list[Verdict]], seed: int) -> str:
    """The results for the page."""
    lines = [
        f"`make mutants`, seed {seed}; {time.strftime('%Y-%m-%d')}.",
        "",
        "| where | faults | found | change nothing | not found | found, of those that change something |",
        "|---|---|---|---|---|---|",
    ]
    for name, verdicts in results.items():
        n = Counter(v.ending for v in verdicts)
        counts = f"{len(verdicts)} | {n[FOUND]} | {n[EQUIVALENT]} | {n[SURVIVED]}"
        lines.append(f"| {name} | {counts} | {100 * share(verdicts):.1f} % |")
    return "\n".join(lines) + "\n"


def main() -> int:
    """Try the faults; exit code 1 if too many were not found."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--scale", type=float, default=1.0, help="share of the faults")
    parser.add_argument("--only", action="append", choices=[area.name for area in AREAS], help="this area alone")
    parser.add_argument("--kept", type=Path, default=KEPT, help="file of verdicts, which a later run goes on from")
    arguments = parser.parse_args()
    areas = [area for area in AREAS if not arguments.only or area.name in arguments.only]
    equal = read_equal()
    copy_tree()
    results = {}
    for area in areas:
        number = max(round(area.number * arguments.scale), 1)
        results[area.name] = try_area(area, number, arguments.seed, equal, arguments.kept)
    text = table(results, arguments.seed)
    print(text)
    for verdict in (v for verdicts in results.values() for v in verdicts if v.ending == SURVIVED):
        print(f"not found: {verdict.mutant}")
    if arguments.scale == 1.0 and arguments.only is None:
        marked.write(PAGE, text, BEGIN, END)
    # a sample has too few faults for a share of them: there each must be found
    is_sample = arguments.scale < 1.0
    return 0 if all(share(results[area.name]) >= (1.0 if is_sample else area.least) for area in areas) else 1


if __name__ == "__main__":
    raise SystemExit(main())
