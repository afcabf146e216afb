"""Compare the bits of reference landings across compilers, optimisation levels, register widths and thread counts.

Each library given is loaded in processes of their own and flies the same landings, in registers of every width that
this machine has. What they computed must be equal, and
equal to the reference in tests/golden/landings.txt, which changes with the physics: in its own commit, with the reason.

usage: golden.py [--update] LIBRARY...
"""

import argparse
import difflib
import hashlib
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

RUNS = {0: (1, 2, 5), 256: (2,), 128: (1,)}
"""Bits of the registers, 0: the widest; numbers of threads."""
STREAMS = 9  # one more than the library flies side by side
REFERENCE = Path(__file__).parent.parent / "tests" / "golden" / "landings.txt"

NOISE = {
    "sense.position_noise": 0.01,
    "sense.velocity_noise": 0.05,
    "sense.latency": 0.01,
    "sense.attitude_noise": 0.01,
    "sense.gyro_noise": 0.02,
    "sense.accel_noise": 0.1,
    "rotor.thrust_scatter": 0.02,
}
ONBOARD = {
    "firmware.d_source": 2.0,
    "firmware.rrev_delay": 0.02,
    "firmware.accel_delay": 0.0075,
    "sense.inertial": 1.0,
    "sense.attitude_integrated": 1.0,
    "sense.start_position_error": 0.3,
    "sense.accel_noise": 0.5,
    "sense.accel_bias": 0.15,
    "sense.accel_cutoff": 30.0,
    "sense.gyro_max": 34.9,
    "rrev.rate": 50.0,
    "rrev.delay": 0.02,
    "rrev.noise_rel": 0.05,
    "range.rate": 10.0,
    "range.noise": 0.01,
}
HOOK_AND_LOOP = {"leg.adhesion": 1.0, "leg.stick_delay": 0.004, "leg.foot_damping": 5e-4}

# name: vehicle, gear set, gear, overrides, speed, angle, RREV_c, M_yd, start, distance
CASES: dict[str, tuple[str, str, str, dict[str, float], float, float, float, float, str, float | None]] = {
    "paper": ("habas2021", "as_simulated", "wide_short", {}, 2.5, 90.0, 4.8, 8.0, "imparted", None),
    "paper_noise": ("habas2021", "as_simulated", "wide_short", NOISE, 2.5, 90.0, 4.8, 8.0, "imparted", None),
    "oblique": ("habas2021", "table1", "wide_long", {}, 3.0, 45.0, 4.8, 6.5, "imparted", None),
    "shallow": ("habas2021", "as_simulated", "narrow_long", NOISE, 3.5, 25.0, 4.7, 8.0, "imparted", None),
    "flown": ("habas2021", "table1", "narrow_short", {}, 2.0, 70.0, 4.8, 8.0, "flown", None),
    "flown_noise": ("crazyflie21", "table1", "wide_short", NOISE, 2.5, 80.0, 4.6, 7.0, "flown", None),
    "at_trigger": ("crazyflie21", "as_simulated", "narrow_long", {}, 2.5, 60.0, 4.0, 5.0, "at_trigger", 0.45),
    "straight_legs": ("habas2021", "table1", "extra_narrow_long", {}, 3.0, 90.0, 5.0, 9.0, "imparted", None),
    "plate_first": ("habas2021", "table1", "extra_narrow_short", {}, 3.5, 90.0, 6.5, 4.0, "imparted", None),
    "hook_and_loop": ("habas2021", "table1", "wide_long", HOOK_AND_LOOP, 2.5, 75.0, 4.5, 7.0, "imparted", None),
    "onboard": ("habas2021", "as_simulated", "wide_short", ONBOARD, 2.5, 80.0, 5.0, 10.0, "flown", None),
    "missed": ("habas2021", "table1", "wide_short", {}, 0.8, 60.0, 2.0, 9.0, "imparted", None),
}


def digest(records: Any) -> str:
    """Hash of every field of a record array; a number that does not exist counts as such, whatever its bits."""
    import numpy as np

    total = hashlib.sha256()
    for name in records.dtype.names:
        values = np.ascontiguousarray(records[name])
        if values.dtype.kind == "f":
            values = np.where(np.isnan(values), np.nan, values)
        total.update(name.encode() + values.astype(values.dtype.newbyteorder("<")).tobytes())
    return total.hexdigest()[:16]


def fly(name: str, threads: int) -> str:
    """Fly a case; return its line: hashes of outcomes and of a time series, then the outcome of the first landing."""
    import numpy as np

    import ivl

    vehicle, gear_set, gear, overrides, speed, angle, rrev_c, moment, start, d_ceil = CASES[name]
    world = ivl.World(vehicle, gear, gear_set, **overrides)
    policies = rrev_c + 0.05 * np.arange(STREAMS)
    out = world.rollouts(speed, angle, policies, moment, seed=42, start=start, d_ceil_m=d_ceil, threads=threads)
    trace = world.trace(speed, angle, rrev_c, moment, seed=42, start=start, d_ceil_m=d_ceil)
    first = out[0]
    if digest(trace.outcome.reshape(1)) != digest(out[:1]):
        raise RuntimeError(f"{name}: the traced landing has another outcome than the one in the batch")
    legs = "".join(str(leg) for leg in first.leg_order)
    return (
        f"{name:14} {digest(out)} {digest(trace.rows)}  legs {first.n_legs} order {legs} body {first.body_contact} "
        f"end {world.end_reason(first.end_reason)} trigger {first.t_trigger_s:.3f} s "
        f"theta {first.theta_impact_deg:.6f} deg d_min {first.d_min_m:.9f} m"
    )


def report(threads: int) -> str:
    """The lines of all cases."""
    return "".join(fly(name, threads) + "\n" for name in CASES)


def widest() -> int:
    """Bits of this machine's widest registers."""
    from ivl import native

    return native.library().use_registers()


def reports_of(library: Path, bits: int) -> dict[tuple[Path, int, int], str]:
    """The lines of all cases by library, bits and threads, all threads from one process; raise if it fails."""
    environment = dict(os.environ, IVL_NATIVE_LIBRARY=str(library.resolve()), IVL_REGISTER_BITS=str(bits))
    command = [sys.executable, str(Path(__file__).resolve()), "--fly", *map(str, RUNS[bits])]
    run = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    lines, n = run.stdout.splitlines(keepends=True), len(CASES)
    if run.returncode != 0 or len(lines) != n * len(RUNS[bits]):
        raise RuntimeError(f"{library}, {bits} bits: exit code {run.returncode}, {len(lines)} lines\n{run.stderr}")
    return {(library, bits, threads): "".join(lines[i * n : (i + 1) * n]) for i, threads in enumerate(RUNS[bits])}


def differences(expected: str, found: str, label: str) -> int:
    """Print how two reports differ; return 1 if they do."""
    if expected == found:
        print(f"  same bits   {label}")
        return 0
    print(f"  DIFFERENT   {label}")
    lines = difflib.unified_diff(expected.splitlines(), found.splitlines(), "expected", label, lineterm="", n=0)
    print("\n".join(lines), file=sys.stderr)
    return 1


def main() -> int:
    """Compare all libraries with the reference; return 0 if every bit is equal."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--update", action="store_true", help="write the reference, if all libraries agree on it")
    parser.add_argument(
        "--fly", type=int, nargs="+", metavar="THREADS", help="print the lines of the loaded library, then end"
    )
    parser.add_argument("libraries", nargs="*", type=Path)
    args = parser.parse_args()
    if args.fly is not None:
        print("".join(map(report, args.fly)), end="")
        return 0
    if not args.libraries:
        parser.error("no library given")
    runs = [(path, bits) for path in args.libraries for bits in RUNS if bits <= widest()]
    reports = {key: lines for run in runs for key, lines in reports_of(*run).items()}
    first = next(iter(reports.values()))
    if not args.update and not REFERENCE.exists():
        print(f"error: {REFERENCE} does not exist; make golden-update writes it", file=sys.stderr)
        return 1
    expected = first if args.update else REFERENCE.read_text(encoding="ascii")
    bad = sum(
        differences(expected, found, f"{path.parent.name}, {f'{bits} bits' if bits else 'widest'}, {threads} threads")
        for (path, bits, threads), found in reports.items()
    )
    if bad:
        print("error: the landings changed; if that is meant: make golden-update, and commit it alone", file=sys.stderr)
        return 1
    if args.update:
        REFERENCE.write_text(first, encoding="ascii")
        print(f"wrote {REFERENCE}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
