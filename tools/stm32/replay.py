"""Replay recorded landings on the emulated STM32F405 and compare every bit of every answer with this computer's.

The whole state of the core and its output are compared after each tick; only padding between members is left out.

usage: replay.py [--ticks N] [--seed S] REPLAY.elf...
"""

import argparse
import os
import subprocess
import sys
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

import layout
import numpy as np
import numpy.typing as npt
import recording
from recording import Recording

ROOT = Path(__file__).parents[2]
RUN = ROOT / "tools" / "run_stm32.sh"
PART_TICKS = 100_000  # recorded, replayed and thrown away together
_CHUNK = 8192  # records
_INIT, _COMMIT, _STEP = 1, 2, 3  # ivl_port_operation_t
_TIMEOUT_S = 1200
PHASES = ("idle", "ready", "approach", "flip", "coast", "attached", "done", "aborted", "level_out")


@dataclass
class Verdict:
    """What a replay showed.

    Attributes:
        n_ticks: Ticks compared.
        n_bits: Bits that differ.
        first: Where the first of them is; empty if there is none.
        counts: Name -> how often; shows that the recording visits what it should.
    """

    n_ticks: int = 0
    n_bits: int = 0
    first: str = ""
    counts: dict[str, int] = field(default_factory=dict)

    def add(self, other: "Verdict") -> None:
        """Sum up the parts of a long replay."""
        self.n_ticks += other.n_ticks
        self.n_bits += other.n_bits
        self.first = self.first or other.first
        for name, n in other.counts.items():
            self.counts[name] = self.counts.get(name, 0) + n


def replay(program: Path, recorded: Recording) -> Verdict:
    """Run `program` on the emulated chip and compare.

    Raises:
        RuntimeError: The program failed, or did not answer every request.
    """
    problem = None
    with tempfile.TemporaryFile() as errors:
        with (
            recorded.requests.open("rb") as requests,
            recorded.replies.open("rb") as expected,
            recorded.requests.open("rb") as asked,
            subprocess.Popen(
                [RUN, program], stdin=requests, stdout=subprocess.PIPE, stderr=errors, env=_environment()
            ) as run,
        ):
            assert run.stdout is not None
            try:
                verdict = _compare(program, run.stdout, expected, asked)
            except RuntimeError as error:
                problem = error  # its cause, if the program failed, is the exit code
        errors.seek(0)
        message = errors.read().decode(errors="replace").strip()
    if run.returncode != 0:
        raise RuntimeError(f"{program}: exit code {run.returncode}: {message}") from problem
    if problem:
        raise problem
    return verdict


def _environment() -> dict[str, str]:
    return {**os.environ, "TIMEOUT_S": str(_TIMEOUT_S)}


def _compare(program: Path, answers, expected, asked) -> Verdict:
    _, hello_size = layout.struct(program, "ivl_port_hello_t")
    if answers.read(hello_size) != expected.read(hello_size):
        raise RuntimeError(f"{program}: sizes of structs differ from those on this computer, or no greeting came")
    reply, request = layout.dtype(program, "ivl_port_reply_t"), layout.dtype(program, "ivl_port_request_t")
    keep = layout.mask(program, "ivl_port_reply_t")
    verdict = Verdict()
    while want := expected.read(_CHUNK * reply.itemsize):
        got = answers.read(len(want))
        if len(got) != len(want):
            raise RuntimeError(f"{program}: {len(got)} bytes of answers where {len(want)} were expected")
        a = np.frombuffer(want, np.uint8).reshape(-1, reply.itemsize)
        b = np.frombuffer(got, np.uint8).reshape(-1, reply.itemsize)
        questions = np.frombuffer(asked.read(len(a) * request.itemsize), request)
        part = Verdict(int((questions["operation"] == _STEP).sum()), counts=_count(questions, a.view(reply)[:, 0]))
        difference = (a ^ b) & keep
        part.n_bits = int(np.unpackbits(difference[difference != 0]).sum())
        if part.n_bits:
            part.first = _describe(program, difference, a, b)
        verdict.add(part)
    if answers.read(1):
        raise RuntimeError(f"{program}: more answers than requests")
    return verdict


def _describe(program: Path, difference: npt.NDArray, a: npt.NDArray, b: npt.NDArray) -> str:
    row, byte = (int(i) for i in np.argwhere(difference)[0])
    leaves, _ = layout.struct(program, "ivl_port_reply_t")
    name = next(leaf.name for leaf in leaves if leaf.offset <= byte < leaf.offset + leaf.size)
    dtype = layout.dtype(program, "ivl_port_reply_t")
    here, there = a[row].view(dtype)[name][0], b[row].view(dtype)[name][0]
    return f"record {row} of its chunk: {name} is {here!r} on this computer and {there!r} on the chip"


def _count(asked: npt.NDArray[np.void], answered: npt.NDArray[np.void]) -> dict[str, int]:
    """How often what happened."""
    step = asked["operation"] == _STEP
    steps, replies = asked[step], answered[step]
    counts = {f"phase {name}": int((replies["out.phase"] == i).sum()) for i, name in enumerate(PHASES)}
    names = asked.dtype.names or ()
    numbers = [n for n in names if n.startswith("with.in.") and asked.dtype[n].kind == "f" and ".vitals." not in n]
    values = np.stack([steps[n] for n in numbers], axis=1)
    size = np.abs(values)
    counts["inputs not finite"] = int((~np.isfinite(values)).any(axis=1).sum())
    counts["inputs denormal"] = int(((size > 0) & (size < np.finfo(np.float32).tiny)).any(axis=1).sum())
    counts["inputs beyond 1e8"] = int((np.isfinite(size) & (size > 1e8)).any(axis=1).sum())
    age_us = (steps["with.in.t_us"] - steps["with.in.t_pose_us"]).astype(np.int64)
    counts["poses older than 40 ms"] = int((age_us > 40_000).sum())
    counts["poses from the future"] = int((age_us < 0).sum())
    counts["poses refused"] = int((replies["state.sense.pose_fresh"] == 0).sum())
    counts["commands refused"] = int((replies["state.sense.cmd_fresh"] == 0).sum())
    counts["battery, radio and autopilot known"] = int((steps["with.in.vitals.given"] != 0).sum())
    counts["policies refused"] = int(((asked["operation"] == _COMMIT) & (answered["status"] != 0)).sum())
    thrusts = np.stack([replies[f"out.thrust_N[{i}]"] for i in range(4)], axis=1)
    motors_on = replies["out.motors_on"] != 0
    limits = asked["with.cfg.motor_thrust_N_max"][asked["operation"] == _INIT]
    counts["a motor at its limit"] = int(np.isin(thrusts, limits).any(axis=1).sum())
    counts["a motor at rest while others run"] = int(((thrusts == 0).any(axis=1) & motors_on).sum())
    counts["motors run"] = int(motors_on.sum())
    return counts


def main() -> int:
    """Replay on every program given; return 0 if no bit differs."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--ticks", type=int, default=1_000_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("programs", nargs="+", type=Path)
    args = parser.parse_args()
    verdicts = {program: Verdict() for program in args.programs}
    flown, seed = 0, args.seed
    while flown < args.ticks:
        with tempfile.TemporaryDirectory() as folder:
            recorded = recording.record(Path(folder), min(PART_TICKS, args.ticks - flown), seed)
            for program, verdict in verdicts.items():
                verdict.add(replay(program, recorded))
        flown, seed = next(iter(verdicts.values())).n_ticks, seed + 1
    for program, verdict in verdicts.items():
        print(f"  {program.parent.name:12s} {verdict.n_ticks} ticks, {verdict.n_bits} differing bits {verdict.first}")
    for name, n in next(iter(verdicts.values())).counts.items():
        print(f"    {name:34s} {n}")
    return 1 if any(verdict.n_bits for verdict in verdicts.values()) else 0


if __name__ == "__main__":
    sys.exit(main())
