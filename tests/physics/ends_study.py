"""Whether every landing ends, whatever the vehicle: random valid vehicles fly random landings, whose ends are counted.

A vehicle is drawn around a shipped one with a shipped gear. Parameters with a `sigma` in their file are drawn over
three times that; the others, and in every second vehicle those as well, over the spreads below, which are wider than
what is known of a real vehicle. What the model or the flight core refuses is drawn again. A landing has a random start,
approach and policy.

A landing depends on the seed and its number alone, so a study can be cut into parts (--first) and flown anywhere; one
landing alone (--landings 1) is printed as the Python that flies it. Ctrl-C ends a study early; what it has found until
then is printed.

usage: ends_study.py [--landings N] [--first N] [--seed N] [--threads N]      prints a table in Markdown
"""

import argparse
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

from ivl import model, native
from ivl.errors import NativeError
from ivl.world import START_CODES

VEHICLES = ("habas2021", "crazyflie21")
GEAR_SETS = ("table1", "as_simulated")
LANDINGS_PER_VEHICLE = 512
ATTEMPTS_MAX = 100
PROGRESS_S = 10.0
DEFECTS_TOLD = 20
DEFECTS = ("not_finite", "step_limit")
"""Ends that say nothing about a policy: the first must never be, the second is of motion that cannot be resolved."""

FACTORS = {
    "body.mass": 1.2,
    "body.inertia_xx": 2.0,
    "body.inertia_yy": 2.0,
    "body.inertia_zz": 2.0,
    "rotor.x": 1.1,
    "rotor.y": 1.1,
    "rotor.thrust_max": 1.25,
    "rotor.thrust_constant": 1.25,
    "rotor.torque_constant": 1.25,
    "rotor.tau_up": 2.0,
    "rotor.tau_down": 2.0,
    "prop_plate.size_x": 1.2,
    "prop_plate.size_y": 1.2,
    "base_plate.size_x": 1.2,
    "base_plate.size_y": 1.2,
    "plate.stiffness": 2.0,
    "plate.damping": 2.0,
    "plate.friction": 2.0,
    "plate.slip_speed": 2.0,
    "leg.length": 1.2,
    "leg.mass": 1.5,
    "leg.stiffness": 2.0,
    "leg.damping": 3.0,
    "leg.hip_xy": 1.2,
    "leg.foot_radius": 1.5,
    "leg.foot_mass": 3.0,
    "sense.pose_rate": 3.0,
}
"""A value is multiplied by a number between 1/f and f, uniform in its logarithm."""

RANGES = {
    "world.ceiling_height": (1.5, 4.0),
    "world.sensed_gap_offset": (-0.05, 0.05),
    "aero.drag_xy": (0.0, 0.02),
    "aero.drag_z": (0.0, 0.02),
    "aero.yaw_torque": (0.0, 1.0),
    "aero.ceiling_gain": (0.0, 0.15),
    "leg.angle": (0.0, 75.0),
    "sense.latency": (0.0, 0.04),
}
"""Drawn in half of the vehicles, uniform between these."""

SOMETIMES = {
    "leg.adhesion": (0.05, 20.0),
    "leg.stick_delay": (1.0e-4, 0.02),
    "leg.foot_damping": (1.0e-5, 1.0e-3),
    "rotor.thrust_scatter": (1.0e-3, 0.05),
    "sense.position_noise": (1.0e-4, 0.02),
    "sense.velocity_noise": (1.0e-3, 0.1),
    "sense.attitude_noise": (1.0e-3, 0.03),
    "sense.gyro_noise": (1.0e-3, 0.1),
    "sense.accel_noise": (1.0e-2, 1.0),
    "sense.pose_drop": (1.0e-2, 0.3),
}
"""Drawn in a third of the vehicles, uniform in its logarithm; else as in the file."""

SPEED_MPS = (0.25, 4.0)
ANGLE_DEG = (20.0, 90.0)
RREV_C_PER_S = (0.0, 7.0)
D_CEIL_M = (0.05, 1.5)
MOMENT_Y_MAX_NMM = 20.0

Specs = npt.NDArray[np.void]
Outcomes = npt.NDArray[np.void]


@dataclass(frozen=True)
class Vehicle:
    """One random vehicle in the library, and how to name it."""

    number: int
    base: str
    gear_set: str
    gear: str
    sensing: str | None
    overrides: dict[str, float]
    native_model: native.NativeModel
    refused: tuple[str, ...]
    """Why the draws before this one were refused."""

    def call(self, spec: Any) -> str:
        """Python that flies a landing of this vehicle alone."""
        names = {code: name for name, code in START_CODES.items()}
        start = names[int(spec["start"])]
        distance = f", d_ceil_m={float(spec['d_ceil_m'])!r}" if start == "at_trigger" else ""
        numbers = ", ".join(
            repr(float(value))
            for value in (spec["speed_mps"], spec["angle_deg"], spec["theta"][0], 1e3 * spec["theta"][1])
        )
        return (
            f"ivl.World({self.base!r}, {self.gear!r}, {self.gear_set!r}, {self.sensing!r}, **{self.overrides!r})"
            f".rollouts({numbers}, seed={int(spec['seed'])}, stream={int(spec['stream'])}, start={start!r}{distance})"
        )


@dataclass
class Largest:
    """The largest of something, and the number of the landing that has it."""

    value: float = 0.0
    landing: int = -1

    def offer(self, value: float, landing: int) -> None:
        """Keep the larger one."""
        if value > self.value:
            self.value, self.landing = value, landing


@dataclass
class Tally:
    """What has been flown so far."""

    ends: Counter[tuple[str, str, str]] = field(default_factory=Counter)
    """Landings by vehicle, start and end."""
    steps: Counter[tuple[str, str]] = field(default_factory=Counter)
    most_steps: Counter[tuple[str, str]] = field(default_factory=Counter)
    refused: Counter[str] = field(default_factory=Counter)
    defects: list[tuple[str, int]] = field(default_factory=list)
    """End and number of each landing that came to an end of `DEFECTS`."""
    n_vehicles: int = 0
    longest: Largest = field(default_factory=Largest)
    """Integration steps of a landing."""
    slowest: Largest = field(default_factory=Largest)
    """Wall time of a vehicle's landings, on average, s."""
    wall_s: float = 0.0

    @property
    def n_landings(self) -> int:
        """Landings flown."""
        return self.ends.total()

    def count(self, end: str) -> int:
        """Landings that came to this end."""
        return sum(n for (_, _, name), n in self.ends.items() if name == end)

    def add(self, vehicle: Vehicle, specs: Specs, outcomes: Outcomes, wall_s: float) -> None:
        """Take in the landings of one vehicle, which took `wall_s`."""
        starts = {code: name for name, code in START_CODES.items()}
        reasons = np.array([_end_name(int(code)) for code in outcomes["end_reason"]])
        for code in np.unique(specs["start"]):
            rows, key = specs["start"] == code, (vehicle.base, starts[int(code)])
            for reason, n in zip(*np.unique(reasons[rows], return_counts=True), strict=True):
                self.ends[*key, str(reason)] += int(n)
            self.steps[key] += int(outcomes["n_steps"][rows].sum())
            self.most_steps[key] = max(self.most_steps[key], int(outcomes["n_steps"][rows].max()))
        numbers = specs["stream"]
        self.defects += [(str(reasons[i]), int(numbers[i])) for i in np.flatnonzero(np.isin(reasons, DEFECTS))]
        most = int(outcomes["n_steps"].argmax())
        self.longest.offer(float(outcomes["n_steps"][most]), int(numbers[most]))
        self.slowest.offer(wall_s / len(specs), int(numbers[most]))
        self.refused.update(vehicle.refused)
        self.n_vehicles += 1
        self.wall_s += wall_s


# ---- drawing


@cache
def _end_name(code: int) -> str:
    return native.library().end_reason(code)


@cache
def _gears(gear_set: str) -> tuple[str, ...]:
    return tuple(model.list_gears(gear_set))


@cache
def _sensor_sets() -> tuple[str, ...]:
    return tuple(model.list_sensor_sets())


@cache
def _parts(base: str, gear_set: str, gear: str, sensing: str | None) -> tuple[model.Part, ...]:
    """Files are read once."""
    airframe, legs = model.load_vehicle(base), model.load_gear(gear, gear_set)
    if sensing is None:
        return airframe, legs
    return model.without_sensors(airframe), legs, model.load_sensors(sensing)


def _log_uniform(rng: np.random.Generator, lo: float, hi: float) -> float:
    return float(np.exp(rng.uniform(np.log(lo), np.log(hi))))


def draw_overrides(parts: tuple[model.Part, ...], rng: np.random.Generator, far: bool) -> dict[str, float]:
    """Random values of the parameters of a vehicle, each within its allowed range."""
    values = model.assemble(parts).values
    sigmas = {name: q.sigma for part in parts for name, q in part.quantities.items() if q.sigma is not None}
    drawn: dict[str, float] = {}
    for name, (lo, hi) in SOMETIMES.items():
        if rng.random() < 1.0 / 3.0:
            drawn[name] = _log_uniform(rng, lo, hi)
    for name, (lo, hi) in RANGES.items():
        if rng.random() < 0.5:
            drawn[name] = float(rng.uniform(lo, hi))
    for name, factor in FACTORS.items():
        drawn[name] = values[name] * _log_uniform(rng, 1.0 / factor, factor)
    for name, sigma in sigmas.items():
        if not far or name not in drawn:
            drawn[name] = float(values[name] + rng.uniform(-3.0 * sigma, 3.0 * sigma))
    table = native.library().params
    return {name: float(np.clip(value, table[name].lo, table[name].hi)) for name, value in drawn.items()}


def draw_vehicle(seed: int, number: int) -> Vehicle:
    """Vehicle `number` of a seed.

    Raises:
        NativeError: Draw after draw was refused.
    """
    rng = np.random.default_rng([seed, number])
    refused: list[str] = []
    while len(refused) < ATTEMPTS_MAX:
        base, gear_set = str(rng.choice(VEHICLES)), str(rng.choice(GEAR_SETS))
        gear = str(rng.choice(_gears(gear_set)))
        sensing = str(rng.choice(_sensor_sets())) if rng.random() < 0.25 else None
        parts = _parts(base, gear_set, gear, sensing)
        overrides = draw_overrides(parts, rng, far=number % 2 == 1)
        try:
            made = native.library().create_model(model.assemble(parts, overrides).vector())
        except NativeError as error:
            refused.append(str(error).partition(":")[0])
            continue
        return Vehicle(number, base, gear_set, gear, sensing, overrides, made, tuple(refused))
    raise NativeError(f"vehicle {number} of seed {seed}: {ATTEMPTS_MAX} draws were refused: {Counter(refused)}")


def draw_specs(vehicle: Vehicle, seed: int) -> Specs:
    """The landings of a vehicle."""
    rng = np.random.default_rng([seed, vehicle.number, 1])
    n = LANDINGS_PER_VEHICLE
    moment_max = min(MOMENT_Y_MAX_NMM, float(vehicle.native_model.derived()["pitch_moment_max_Nmm"][0]))
    specs = native.library().default_specs(n)
    specs["speed_mps"] = rng.uniform(*SPEED_MPS, n)
    specs["angle_deg"] = rng.uniform(*ANGLE_DEG, n)
    specs["theta"][:, 0] = rng.uniform(*RREV_C_PER_S, n)
    specs["theta"][:, 1] = 1e-3 * rng.uniform(0.0, moment_max, n)
    specs["d_ceil_m"] = rng.uniform(*D_CEIL_M, n)
    specs["start"] = rng.choice(list(START_CODES.values()), n)
    _draw_states(vehicle, specs, rng)
    specs["seed"] = seed
    specs["stream"] = vehicle.number * n + np.arange(n)
    return specs


def _draw_states(vehicle: Vehicle, specs: Specs, rng: np.random.Generator) -> None:
    """States of free flight anywhere below the ceiling: tilted, turning, with rotors and batteries of any kind."""
    n = len(specs)
    ceiling_m = vehicle.overrides.get("world.ceiling_height", native.library().params["world.ceiling_height"].default)
    specs["p_start_W_m"][:, 2] = ceiling_m - rng.uniform(0.02, min(2.5, ceiling_m), n)
    specs["v_start_W_mps"] = rng.uniform(-4.0, 4.0, (n, 3))
    tilted = rng.normal(np.array([0.0, 0.0, 0.0, 1.0]), (0.3, 0.5, 0.3, 0.0), (n, 4))
    specs["q_start_WB"] = tilted / np.linalg.norm(tilted, axis=1, keepdims=True)
    specs["w_start_B_radps"] = rng.normal(0.0, 10.0, (n, 3))
    fastest = float(vehicle.native_model.derived()["rotor_speed_max_radps"][0])
    specs["rotor_start_radps"] = rng.uniform(-0.1, 1.0, (n, 4)).clip(-1.0 / fastest, 1.0) * fastest
    specs["battery_start_V"] = rng.choice([0.0, 3.0, 3.8, 4.2], n)


# ---- flying


def fly(first: int, landings: int, seed: int, threads: int, tally: Tally) -> Iterator[None]:
    """Fly landings `first` to `first + landings` of a seed into the tally, one vehicle after another."""
    for number in range(first // LANDINGS_PER_VEHICLE, -(-(first + landings) // LANDINGS_PER_VEHICLE)):
        vehicle = draw_vehicle(seed, number)
        begin = max(first - number * LANDINGS_PER_VEHICLE, 0)
        specs = draw_specs(vehicle, seed)[begin : first + landings - number * LANDINGS_PER_VEHICLE]
        started_s = time.perf_counter()
        outcomes = vehicle.native_model.rollouts(specs, threads)
        tally.add(vehicle, specs, outcomes, time.perf_counter() - started_s)
        yield


def study(landings: int, seed: int, first: int = 0, threads: int = 1) -> Tally:
    """Fly a study to its end, silently."""
    tally = Tally()
    for _ in fly(first, landings, seed, threads, tally):
        pass
    return tally


def _progress(landings: int, say: Callable[[str], None]) -> Callable[[Tally], None]:
    started_s = told_s = time.perf_counter()

    def tell(tally: Tally) -> None:
        nonlocal told_s
        now_s = time.perf_counter()
        if now_s - told_s >= PROGRESS_S:
            told_s = now_s
            rate = tally.n_landings / (now_s - started_s)
            left_min = (landings - tally.n_landings) / rate / 60.0
            defects = sum(tally.count(end) for end in DEFECTS)
            say(
                f"{tally.n_landings:,} of {landings:,} landings, {rate:,.0f} a second, {left_min:.0f} min to go; "
                f"{defects} with {' or '.join(DEFECTS)}"
            )

    return tell


# ---- telling


def markdown(tally: Tally) -> str:
    """The table: a row for each vehicle and start, and the total."""
    library = native.library()
    names = [library.end_reason(code) for code in range(int(library.outcome_fields["end_reason"].hi) + 1)]
    lines = [
        f"| vehicle / start | landings | {' | '.join(names)} | mean steps | most steps |",
        "|---" * (len(names) + 4) + "|",
    ]
    for key in sorted(tally.steps):
        counts = [tally.ends[*key, name] for name in names]
        lines.append(_row(" / ".join(key), counts, tally.steps[key], tally.most_steps[key]))
    counts = [tally.count(name) for name in names]
    lines.append(_row("all", counts, tally.steps.total(), max(tally.most_steps.values(), default=0)))
    return "\n".join(lines)


def _row(label: str, counts: list[int], steps: int, most_steps: int) -> str:
    n = sum(counts)
    return f"| {label} | {n} | {' | '.join(map(str, counts))} | {steps / max(n, 1):.0f} | {most_steps} |"


def _alone(landing: int, seed: int) -> tuple[Vehicle, Specs]:
    vehicle = draw_vehicle(seed, landing // LANDINGS_PER_VEHICLE)
    at = landing % LANDINGS_PER_VEHICLE
    return vehicle, draw_specs(vehicle, seed)[at : at + 1]


def _alone_ms(landing: int, seed: int) -> float:
    """Wall time of a landing that is flown alone."""
    vehicle, specs = _alone(landing, seed)
    started_s = time.perf_counter()
    vehicle.native_model.rollouts(specs, 1)
    return 1e3 * (time.perf_counter() - started_s)


def report(tally: Tally, seed: int) -> str:
    """Everything that was found."""
    refused = ", ".join(f"{why} {n}" for why, n in tally.refused.most_common(8))
    lines = [
        markdown(tally),
        "",
        f"{tally.n_vehicles} vehicles; {tally.refused.total()} draws refused and drawn again"
        f"{f' ({refused})' * bool(refused)}",
        f"{tally.wall_s:.0f} s of flying, {tally.n_landings / max(tally.wall_s, 1e-9):,.0f} landings a second",
    ]
    if tally.n_landings:
        longest, slowest = tally.longest, tally.slowest
        lines += [
            f"most steps: {longest.value:.0f}, landing {longest.landing}, "
            f"{_alone_ms(longest.landing, seed):.0f} ms alone",
            f"slowest vehicle: {1e3 * slowest.value:.2f} ms a landing; its longest is landing {slowest.landing}, "
            f"{_alone_ms(slowest.landing, seed):.0f} ms alone",
        ]
    lines += [f"{end}: landing {landing}" for end, landing in tally.defects[:DEFECTS_TOLD]]
    if len(tally.defects) > DEFECTS_TOLD:
        lines.append(f"and {len(tally.defects) - DEFECTS_TOLD} more of these")
    return "\n".join(lines)


def main() -> int:
    """Fly the study and print it; return 1 if a landing ended with a state that is not finite, 130 after Ctrl-C."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--landings", type=int, default=10_000_000)
    parser.add_argument("--first", type=int, default=0, help="number of the first landing")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--threads", type=int, default=1)
    args = parser.parse_args()
    tally, stopped = Tally(), False
    tell = _progress(args.landings, lambda line: print(line, file=sys.stderr, flush=True))
    try:
        for _ in fly(args.first, args.landings, args.seed, args.threads, tally):
            tell(tally)
    except KeyboardInterrupt:
        stopped = True
        print(f"stopped: what follows is of landings {args.first} to {args.first + tally.n_landings}", file=sys.stderr)
    print(report(tally, args.seed))
    if args.landings == 1:
        vehicle, specs = _alone(args.first, args.seed)
        print(f"\n{vehicle.call(specs[0])}")
    bad = tally.count("not_finite")
    print(f"\n{tally.n_landings} landings, of which {tally.count('step_limit')} ended by the bound on steps and "
          f"{bad} with a state that is not finite (must be none)")  # fmt: skip
    return 130 if stopped else int(bad > 0)


if __name__ == "__main__":
    sys.exit(main())
