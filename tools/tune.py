"""Tune the tracking law of a vehicle in simulation, and judge its gains; repeatable to the bit.

    python tools/tune.py --vehicle crazyflie21             search, then the table before and after (7 min on one core)
    python tools/tune.py --vehicle crazyflie21 --judge     the table of the gains as they are (5 s)
    python tools/tune.py --vehicle crazyflie21 --json FILE    gains and criteria as JSON as well

What is flown, in each world, with the vehicle's own noise:

- *hover and steps*: a hover, then 0.3 m forward, to the left, up and down;
- *turn*: an error of 20 degrees in yaw is let go;
- *approaches*: from a hover to 1 .. 4 m/s at 20 .. 90 degrees, up to the trigger at RREV 4 1/s, or 0.2 m below the
  plane of the cues where that comes first;
- *the paper's approach*: vertical, 2.5 m/s from 1.7 m below the plane, trigger at RREV 3.8 1/s.

`CRITERIA` says what is measured there, and the limits: one for the vehicle as it is, with its battery at its mean
voltage, one for each member of a family. A member has every value with a sigma in the vehicle file drawn from a normal
distribution cut at two sigma, and an open-circuit voltage drawn uniformly from 3.4 to 4.1 V. Besides, the gyro stands
behind a low-pass of 40 Hz (5.6 ms: the drone's two filters and a millisecond of computing), and the motors' thrusts
differ by 1 % (one sigma), which the files leave out.

Objective, to be made small. Let r be a value as a share of its limit, R the largest r of the vehicle as it is, of two
corners and of four members of a family: R + 0.1 (mean of all r). A corner has what makes its loops strong (thrust,
voltage, little inertia) or weak at one sigma, and late motors and sensors in both. Below one every criterion is met,
and the smaller it is, the larger the margin.

Differential evolution over the logarithms of the gains, within a factor of six of those in the file, polished by the
method of Nelder and Mead, once for each seed, each time from the best so far; that is rounded to three digits in the
end. The two gains of yaw are sought last and alone, since nothing else depends on them. The family that the table shows
is another one, of 64.
"""

import argparse
import json
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import differential_evolution, minimize

from ivl import model
from ivl.world import State, World

YAW_GAINS = ("kp_att_z", "kd_rate_z")
OTHER_GAINS = ("kp_pos_xy", "kd_vel_xy", "kp_pos_z", "kd_vel_z", "kp_att_xy", "kd_rate_xy")
GAINS = (*OTHER_GAINS, *YAW_GAINS)
REACH = 6.0  # the search stays within this factor of the start

STEP_M = 0.3
STEPS_M = ((STEP_M, 0.0, 0.0), (0.0, STEP_M, 0.0), (0.0, 0.0, STEP_M), (0.0, 0.0, -STEP_M))
BAND_M = 0.1 * STEP_M  # settled: stays within this of where it ends
ROW_S, SETTLE_S, HOVER_S, FLIGHT_S = 0.02, 1.0, 2.0, 6.5
END_ROWS = 25
START_M = (0.0, 0.0, 1.5)
TURN_DEG, TURN_BAND_DEG, TURN_S = 20.0, 2.0, 4.0
SPEEDS_MPS, ANGLES_DEG = (1.0, 1.75, 2.5, 3.25, 4.0), (20.0, 35.0, 50.0, 65.0, 90.0)
RREV_C_PER_S, NEAREST_M = 4.0, 0.2
PAPER_MPS, PAPER_RREV_PER_S = 2.5, 3.8
MOMENT_NMM = 6.0
NEVER = 1e3  # stands for a value that is none: an abort, a crash, no trigger

VOLTAGE_V = (3.4, 4.1)
CORNER_V = {1.0: 3.95, -1.0: 3.55}
STRONG = {
    "rotor.thrust_gain": 1,
    "battery.sag": -1,
    "battery.rated_voltage": -1,
    "body.inertia_xx": -1,
    "body.inertia_yy": -1,
}
LATE = ("rotor.tau_up", "rotor.tau_down", "sense.latency")
IMPERFECT = {"sense.gyro_cutoff": 40.0, "rotor.thrust_scatter": 0.01}
SEARCHED, SHOWN = 1, 2  # seeds of the families


@dataclass(frozen=True)
class Criterion:
    """One number that is measured, and what it may be at most.

    Attributes:
        unit: Unit of value and limits.
        limit: For the vehicle as it is.
        family: For each member of a family; None: not judged there.
        doc: What it is.
    """

    unit: str
    limit: float
    family: float | None
    doc: str


CRITERIA = {
    "settle_xy": Criterion("s", 2.25, 2.5, "step of 0.3 m forward or left: until it stays within 30 mm of its end"),
    "settle_z": Criterion("s", 1.25, 1.5, "the same, up or down"),
    "overshoot_xy": Criterion("%", 10.0, 20.0, "the step's overshoot"),
    "overshoot_z": Criterion("%", 10.0, 20.0, "the same, up or down"),
    "tilt_max": Criterion("deg", 10.0, 30.0, "largest tilt during the steps"),
    "hover_mm": Criterion("mm", 5.0, 15.0, "hover: standard deviation of the position, all axes together"),
    "hover_tilt": Criterion("deg", 0.4, 0.8, "hover: rms of the tilt"),
    "hover_rate": Criterion("rad/s", 0.1, 0.2, "hover: rms of the rate, each of roll and pitch"),
    "height_mm": Criterion("mm", 5.0, 140.0, "hover: error of the mean height; there is no integral term"),
    "side_mm": Criterion("mm", 20.0, 150.0, "hover: largest horizontal error at the end of a step"),
    "aborted": Criterion("%", 1.0, 1.0, "share of the time in which the core did not hover: an abort"),
    "approach_speed": Criterion("%", 16.0, 35.0, "approaches: rms error of the velocity at the trigger, of the speed"),
    "approach_rate": Criterion("rad/s", 1.2, 2.2, "approaches: rms of the pitch rate at the trigger"),
    "paper_speed": Criterion("%", 8.0, None, "the paper's approach: error of the speed at the trigger"),
    "settle_yaw": Criterion("s", 1.5, 2.0, "20 degrees of yaw: time until it stays within 2 degrees"),
    "overshoot_yaw": Criterion("%", 20.0, 30.0, "its overshoot"),
}  # fmt: skip

Values = dict[str, float]


def step_flights(n_each: int) -> np.ndarray:
    """Set-points of the hover and steps: n_each flights in each direction, shape (4, n_each, 2, 4)."""
    points = np.zeros((len(STEPS_M), n_each, 2, 4))
    points[..., 1:] = START_M
    points[..., 1, 0] = HOVER_S
    points[..., 1, 1:] += np.array(STEPS_M)[:, None]
    return points


def settle_s(error: np.ndarray, band: float) -> float:
    """Time after which a series stays within a band about zero, s."""
    outside = np.flatnonzero(~(np.abs(error) < band))
    return float(outside[-1] + 1) * ROW_S if outside.size else 0.0


def measure_steps(world: World, n_each: int) -> Values:
    """Hover and steps; steps are judged by the mean over the flights in one direction."""
    points = step_flights(n_each)
    rows = world.hover(points, FLIGHT_S, period_s=ROW_S)
    at, calm = round(HOVER_S / ROW_S), round(SETTLE_S / ROW_S)
    p = rows.p_WB_m
    settle, overshoot = [], []
    for k, step in enumerate(STEPS_M):
        way = (p[k, :, at:] - p[k, :, at - END_ROWS : at].mean(axis=1, keepdims=True)).mean(axis=0) @ np.sign(step)
        settle.append(settle_s(way - way[-END_ROWS:].mean(), BAND_M))
        overshoot.append(100.0 * max(0.0, float(way.max() / way[-END_ROWS:].mean()) - 1.0))
    tilt_deg = np.degrees(2.0 * np.arcsin(np.clip(np.hypot(rows.q_WB[..., 0], rows.q_WB[..., 1]), 0.0, 1.0)))
    still = np.s_[..., calm:at]
    late_m = p[..., -END_ROWS:, :].mean(axis=2) - points[..., 1, 1:]
    return {
        "settle_xy": max(settle[:2]),
        "settle_z": max(settle[2:]),
        "overshoot_xy": max(overshoot[:2]),
        "overshoot_z": max(overshoot[2:]),
        "tilt_max": float(tilt_deg[..., at:].max()),
        "hover_mm": 1e3 * float(np.sqrt(p[:, :, calm:at].var(axis=2).sum(axis=-1).mean())),
        "hover_tilt": float(np.sqrt((tilt_deg[still] ** 2).mean())),
        "hover_rate": float(np.sqrt((rows.w_B_radps[:, :, calm:at, :2] ** 2).mean())),
        "height_mm": 1e3 * float(np.abs(late_m[..., 2].mean())),
        "side_mm": 1e3 * float(np.hypot(late_m[..., 0], late_m[..., 1]).max()),
        "aborted": 100.0 * float((rows.phase[..., 1:] != rows.phase[0, 0, 1]).mean()),
    }


def measure_turn(world: World) -> Values:
    """An error in yaw that is let go; nothing for a vehicle whose rotors make no moment about z."""
    if world.params.values["aero.yaw_torque"] == 0.0:
        return {}
    half = np.radians(TURN_DEG) / 2.0
    state = State((0.0, 0.0, 0.0), q_WB=(0.0, 0.0, np.sin(half), np.cos(half)))
    rows = world.trace(0.1, 90.0, 20.0, MOMENT_NMM, start="state", state=state, period_s=ROW_S).rows
    x, y, z, w = rows.q_WB[: round(TURN_S / ROW_S)].T
    yaw_deg = np.degrees(np.arctan2(2.0 * (x * y + w * z), 1.0 - 2.0 * (y * y + z * z)))
    return {
        "settle_yaw": settle_s(yaw_deg, TURN_BAND_DEG),
        "overshoot_yaw": 100.0 * max(0.0, -float(yaw_deg.min()) / TURN_DEG),
    }


def measure_approaches(world: World) -> Values:
    """Approaches that are flown from a hover, at their triggers."""
    speed, angle = (grid.ravel() for grid in np.meshgrid(SPEEDS_MPS, ANGLES_DEG, indexing="ij"))
    vx, vz = speed * np.cos(np.radians(angle)), speed * np.sin(np.radians(angle))
    rrev_c = np.minimum(RREV_C_PER_S, vz / NEAREST_M)
    out = world.rollouts(speed, angle, rrev_c, MOMENT_NMM, start="flown", threads=1)
    error = np.hypot(out.vx_trigger_mps - vx, out.vz_trigger_mps - vz) / speed
    paper = world.rollouts(PAPER_MPS, 90.0, np.full(4, PAPER_RREV_PER_S), MOMENT_NMM, start="flown", threads=1)
    return {
        "approach_speed": 100.0 * float(np.sqrt((error**2).mean())),
        "approach_rate": float(np.sqrt((out.rate_trigger_radps**2).mean())),
        "paper_speed": 100.0 * abs(float(paper.vz_trigger_mps.mean()) / PAPER_MPS - 1.0),
    }


def measure_flights(world: World, n_each: int) -> Values:
    """Everything but the turn."""
    return measure_steps(world, n_each) | measure_approaches(world)


def shares(values: Values, in_family: bool) -> dict[str, float]:
    """Each value as a share of its limit; what is no number counts as NEVER."""
    result = {}
    for name, value in values.items():
        limit = CRITERIA[name].family if in_family else CRITERIA[name].limit
        if limit is not None:
            result[name] = value / limit if np.isfinite(value) else NEVER
    return result


def different(world: World, quantities: Mapping[str, model.Quantity], sigmas: Values, voltage_V: float) -> World:
    """The world with some values that many sigma away from those of the file, and with what the file leaves out."""
    drawn = dict(IMPERFECT)
    for name, sigma in sigmas.items():
        field = world._library.params[name]
        drawn[name] = min(max(quantities[name].value + sigma * (quantities[name].sigma or 0.0), field.lo), field.hi)
    if world.params.values["battery.voltage"] > 0.0:
        drawn |= {"battery.voltage": voltage_V, "battery.voltage_scatter": 0.0}
    return world.changed(**drawn)


def family(vehicle: str, world: World, n: int, seed: int) -> list[World]:
    """Members that differ from the vehicle as the file says it may."""
    rng = np.random.default_rng(seed)
    uncertain = {name: q for name, q in sorted(model.load_vehicle(vehicle).quantities.items()) if q.sigma}
    members = []
    for _ in range(n):
        sigmas = dict(zip(uncertain, np.clip(rng.standard_normal(len(uncertain)), -2.0, 2.0).tolist(), strict=True))
        members.append(different(world, uncertain, sigmas, float(rng.uniform(*VOLTAGE_V))))
    return members


def corners(vehicle: str, world: World, sigma: float) -> list[World]:
    """The vehicle with strong loops and with weak ones, late motors and sensors in both."""
    uncertain = {name: q for name, q in model.load_vehicle(vehicle).quantities.items() if q.sigma}
    members = []
    for sign, voltage_V in CORNER_V.items():
        sigmas = {name: sign * sigma * way for name, way in STRONG.items()} | dict.fromkeys(LATE, sigma)
        members.append(different(world, uncertain, {n: s for n, s in sigmas.items() if n in uncertain}, voltage_V))
    return members


def as_it_is(vehicle: str) -> World:
    """The vehicle of the file, its battery at its mean voltage."""
    return World(vehicle).changed(**{"battery.voltage_scatter": 0.0})


def with_gains(world: World, gains: Values) -> World:
    """The world with other gains."""
    return world.changed(**{f"firmware.{name}": value for name, value in gains.items()})


def objective(worlds: Sequence[World], gains: Values, measure: Callable[[World, bool], Values], enough: float) -> float:
    """The objective; `worlds` begins with the vehicle as it is. A value beyond `enough` is a lower bound."""
    all_shares: list[float] = []
    for k, world in enumerate(worlds):
        all_shares += shares(measure(with_gains(world, gains), k > 0), k > 0).values()
        if max(all_shares) > enough:
            break
    return max(all_shares) + 0.1 * float(np.mean(all_shares))


def search(
    worlds: Sequence[World],
    start: Values,
    names: Sequence[str],
    measure: Callable[[World, bool], Values],
    seeds: Sequence[int],
    generations: int,
) -> Values:
    """Best gains of `names`; the others stay as in `start`."""
    origin = np.log([start[name] for name in names])
    lowest, highest = origin - np.log(REACH), origin + np.log(REACH)
    best = (np.inf, origin)

    def cost(x: np.ndarray) -> float:
        return objective(worlds, start | dict(zip(names, np.exp(x), strict=True)), measure, enough=30.0)

    for seed in seeds:
        found = differential_evolution(
            cost, list(zip(lowest, highest, strict=True)), x0=np.clip(best[1], lowest, highest), rng=seed, popsize=5,
            maxiter=generations, tol=0.0, polish=False,
        )  # fmt: skip
        simplex = np.vstack([found.x, found.x + 0.1 * np.eye(len(names))])
        fine = minimize(
            cost, found.x, method="Nelder-Mead", options={"initial_simplex": simplex, "maxfev": 12 * len(names)}
        )
        best = min(best, (float(fine.fun), fine.x), key=lambda b: b[0])
        print(f"# seed {seed}: objective {fine.fun:.3f}", file=sys.stderr, flush=True)
    return start | {name: float(f"{value:.3g}") for name, value in zip(names, np.exp(best[1]), strict=True)}


def tune(vehicle: str, seeds: Sequence[int], generations: int, corner_sigma: float = 1.0) -> Values:
    """Search all gains of a vehicle, starting from those of its file."""
    world = as_it_is(vehicle)
    start = {name: world.params.values[f"firmware.{name}"] for name in GAINS}
    worlds = [world, *corners(vehicle, world, corner_sigma), *family(vehicle, world, 4, SEARCHED)]

    def flights(w: World, member: bool) -> Values:
        return measure_flights(w, 2 if member else 4)

    gains = search(worlds, start, OTHER_GAINS, flights, seeds, generations)
    if measure_turn(world):
        gains = search(worlds, gains, YAW_GAINS, lambda w, _: measure_turn(w), seeds, generations)
    return gains


def judge(vehicle: str, gains: Values | None = None, n_family: int = 64) -> dict[str, dict[str, float]]:
    """What `gains`, or those of the file, are worth.

    Returns:
        For each criterion the value of the vehicle as it is, the 95th percentile and the worst of a family, and the
        share of its members that meet the criterion, %.
    """
    world = with_gains(as_it_is(vehicle), gains or {})
    own = measure_flights(world, 8) | measure_turn(world)
    members = [measure_flights(w, 2) | measure_turn(w) for w in family(vehicle, world, n_family, SHOWN)]
    table = {}
    for name in own:
        criterion = CRITERIA[name]
        values = np.nan_to_num([m[name] for m in members], nan=NEVER)
        row = {"value": own[name], "limit": criterion.limit}
        if criterion.family is not None and n_family:
            row |= {
                "family_95": float(np.percentile(values, 95.0)),
                "family_worst": float(values.max()),
                "family_limit": criterion.family,
                "family_met": 100.0 * float((values <= criterion.family).mean()),
            }
        table[name] = row
    return table


def markdown(tables: dict[str, dict[str, dict[str, float]]]) -> str:
    """Criteria and what each set of gains makes of them."""
    names = list(tables)
    lines = [
        "| criterion | unit | limit | " + " | ".join(names) + " | family | "
        + " | ".join(f"{name}: 95 % / worst / met" for name in names) + " |",
        "|---" * (4 + 2 * len(names)) + "|",
    ]  # fmt: skip
    for criterion in tables[names[0]]:
        about = CRITERIA[criterion]
        rows = [tables[name][criterion] for name in names]
        own = " | ".join(f"{row['value']:.3g}" for row in rows)
        members = " | ".join(
            f"{row['family_95']:.3g} / {row['family_worst']:.3g} / {row['family_met']:.0f} %"
            if "family_95" in row
            else "-"
            for row in rows
        )
        most = "-" if about.family is None else f"{about.family:g}"
        lines.append(f"| {criterion} | {about.unit} | {about.limit:g} | {own} | {most} | {members} |")
    return "\n".join(lines)


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; 1 if the vehicle as it is misses a criterion with its new gains."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--vehicle", default="crazyflie21", help="shipped vehicle, or a path that ends in .yaml")
    parser.add_argument("--judge", action="store_true", help="no search: the gains of the file")
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2], help="one start of the search for each")
    parser.add_argument("--generations", type=int, default=20, help="of each start")
    parser.add_argument(
        "--corner", type=float, default=1.0, help="sigma of the corners; more for a vehicle known less well"
    )
    parser.add_argument("--family", type=int, default=64, help="members that the table judges")
    parser.add_argument("--json", type=Path, help="write gains and criteria there as well")
    args = parser.parse_args(arguments)
    began = time.monotonic()
    world = World(args.vehicle)
    gains = {"before": {name: world.params.values[f"firmware.{name}"] for name in GAINS}}
    if not args.judge:
        gains["after"] = tune(args.vehicle, args.seeds, args.generations, args.corner)
    tables = {when: judge(args.vehicle, values, args.family) for when, values in gains.items()}
    for when, values in gains.items():
        print(f"{when}: " + ", ".join(f"{name} {value:g}" for name, value in values.items()))
    print("\n" + markdown(tables))
    print(f"# {time.monotonic() - began:.0f} s", file=sys.stderr)
    if args.json:
        report: dict[str, Any] = {"vehicle": args.vehicle, "seeds": args.seeds, "gains": gains, "criteria": tables}
        args.json.write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    last = tables["before" if args.judge else "after"]
    return 1 if any(not row["value"] <= row["limit"] for row in last.values()) else 0


if __name__ == "__main__":
    sys.exit(main())
