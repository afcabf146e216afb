"""docs/FLIGHTS.md from recorded flights: measure them, keep the figures, write the page.

    .venv/bin/python tools/flights.py measure --logs learning_trial_00.csv calibration.csv --spin-down decay_*.csv
    .venv/bin/python tools/flights.py believe --logs learning_trial_00.csv calibration.csv
    .venv/bin/python tools/flights.py page [--check]

The logs are those of the paper's authors (public repository bhabas/sar_simulation, MIT licence) and stay where they
are; `measure` writes what follows from them into docs/data/flights.json and the picture, `page` writes docs/FLIGHTS.md
from that. A test compares page and figures, so that neither is edited by hand.
"""

import argparse
import json
import sys
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import flights_belief
import numpy as np
from scipy.optimize import least_squares

from ivl import World
from ivl.flight import compare, identify, importer, motion, replay, store
from ivl.flight.log import Given

ROOT = Path(__file__).parents[1]
DATA, PAGE = ROOT / "docs/data/flights.json", ROOT / "docs/FLIGHTS.md"
PICTURE = ROOT / "docs/figures/flights.png"
BELIEF_PICTURE = ROOT / "docs/figures/flights_belief.png"
VEHICLE, GEAR, GEAR_SET = "crazyflie21", "wide_short", "table1"
POLICIES = ((3.72, 6.04), (3.95, 6.0), (4.0, 8.12))
FITTED = ("rotor.tau_down", "sense.latency", "world.sensed_gap_offset")
BEFORE = {
    "rotor.tau_down": 0.15, "rotor.drag_share": 0.0, "rotor.inflow_loss": 0.0, "rotor.thrust_gain": 1.0,
    "battery.voltage": 0.0, "battery.voltage_scatter": 0.0, "sense.latency": 0.01, "world.sensed_gap_offset": 0.0,
}  # fmt: skip
"""crazyflie21 as it was before these flights were known; its tracking law is the present one."""
PRIOR_SIGMAS = {"rotor.tau_down": 0.05, "sense.latency": 0.005, "world.sensed_gap_offset": 0.02}
"""Of the fit that starts from there: what was known without the flights, generously."""
MOMENT_NMM = (5.7, 6.3)
"""The fit of section 4 sees flights with a moment in this range; the others are left out and judged."""
_TRIED_FEET = (
    {"leg.foot_damping": 2e-4}, {"leg.foot_damping": 8e-4}, {"leg.stiffness": 0.05}, {"leg.stiffness": 0.14},
    {"leg.adhesion": 5.0}, {"leg.adhesion": 2.0}, {"leg.adhesion": 1.0},
)  # fmt: skip
N_ROLLOUTS, N_GOOD_FITS = 128, 24


def spin_down(paths: list[Path]) -> dict[str, Any]:
    """Fit the decay law (MODEL eq. 2.9) to spin-down logs, and a pure exponential beside it."""
    full = World(VEHICLE, GEAR, GEAR_SET).derived()["rotor_speed_max_radps"]
    logs = []
    for path in paths:
        t_s, speed = np.genfromtxt(path, delimiter=",", skip_header=1).T
        top = float(np.median(speed[speed > 0.9 * speed.max()]))
        cut = int(np.flatnonzero(speed > 0.95 * top)[-1])
        later = float(np.median(speed[(t_s > t_s[cut] + 0.9) & (t_s < t_s[cut] + 1.3)]))
        used = (t_s > t_s[cut] - 0.11) & (t_s < t_s[cut] + 1.3)
        logs.append((t_s[used] - t_s[cut], speed[used], top, later if later > 0.3 * top else 0.0))

    def residuals(x: np.ndarray, share_fitted: bool) -> np.ndarray:
        tau_s, share = x[0], x[1] if share_fitted else 0.0
        parts = []
        for (t_s, speed, top, rest), shift_s in zip(logs, x[2:], strict=True):
            alpha, beta = (1 - share + 2 * share * rest / full) / tau_s, share / (tau_s * full)
            left = np.exp(-alpha * np.maximum(t_s - shift_s, 0.0))
            excess = (top - rest) * left / (1 + beta / alpha * (top - rest) * (1 - left))
            parts.append(rest + excess - speed)
        return np.concatenate(parts)

    result: dict[str, Any] = {"n_logs": len(logs)}
    for name, fitted in (("law", True), ("exponential", False)):
        shifts = [0.0] * len(logs)
        fit = least_squares(
            residuals, [0.25, 0.5, *shifts], args=(fitted,),
            bounds=([0.02, 0.0, *(-0.12 for _ in logs)], [2.0, 0.95, *(0.12 for _ in logs)]),
        )  # fmt: skip
        rms = float(np.sqrt(np.mean(fit.fun**2)))
        result[name] = {"tau_down_s": float(fit.x[0]), "rms_radps": rms}
        if fitted:
            result[name]["drag_share"] = float(fit.x[1])
    return result


def climb(flights: store.Flights, world: World) -> list[dict[str, float]]:
    """Acceleration of saturated climbs over speed, recorded and simulated."""
    rows = []
    for flight in flights:
        t_s = flight["t_s"] - flight.info["t_trigger_s"]
        for begin in np.arange(-0.6, -0.05, 0.1):
            part = (t_s >= begin) & (t_s < begin + 0.1)
            if part.sum() >= 8 and np.nanmin(flight["thrust_cmd_N"][part]) > 0.99 * np.nanmax(flight["thrust_cmd_N"]):
                slope = float(np.polyfit(t_s[part], flight["v_z_mps"][part], 1)[0])
                rows.append((float(np.mean(flight["v_z_mps"][part])), slope))
    recorded = np.array(rows)
    trace = world.changed(**dict.fromkeys(motion.SCATTER, 0.0)).trace(
        2.5, 90.0, 3.85, 6.0, start="flown", period_s=0.01
    )
    rising = trace.rows[trace.rows.phase == 2]
    speed, slope = rising.v_WB_mps[:, 2], np.gradient(rising.v_WB_mps[:, 2], 0.01)
    result = []
    for low in np.arange(0.4, 2.8, 0.4):
        inside = (recorded[:, 0] >= low) & (recorded[:, 0] < low + 0.4)
        if inside.sum() >= 5:
            middle = float(np.mean(recorded[inside, 0]))
            row = {"speed_mps": middle, "n": int(inside.sum()), "recorded_mps2": float(recorded[inside, 1].mean())}
            result.append({**row, "simulated_mps2": float(np.interp(middle, speed, slope))})
    return result


def battery(flights: store.Flights) -> dict[str, float]:
    """Voltage without load, with all rotors at full duty, and with the front pair alone; medians over flights."""
    rows = []
    for flight in flights:
        t_s, volts = flight["t_s"] - flight.info["t_trigger_s"], flight["battery_V"]
        spans = ((0.5, 0.9), (-0.3, -0.1), (0.06, 0.18))
        rows.append([float(np.nanmedian(volts[(t_s > lo) & (t_s < hi)])) for lo, hi in spans])
    values = np.array(rows)[np.array(rows)[:, 0] > 3.4]
    rest, full, pair = np.median(values, axis=0)
    return {
        "rest_V": float(rest),
        "rest_spread_V": float(values[:, 0].std()),
        "full_V": float(full),
        "pair_V": float(pair),
    }


def good_fits(flights: store.Flights, result: identify.Identification) -> dict[str, Any]:
    """What equally good fits predict: range over resampled fits, 5th to 95th percentile."""
    rng = np.random.default_rng(1)
    figures = []
    for number, row in enumerate(rng.choice(len(result.draws), N_GOOD_FITS, replace=False)):
        values = dict(zip((e.name for e in result.estimates), map(float, result.draws[row]), strict=True))
        one = compare.compare(flights, World(VEHICLE, GEAR, GEAR_SET, None, **values), 32, number, POLICIES).summary()
        figures.append([one["landed_auc"], one["landed_brier"], one["two_leg_share"]["simulated"], one["pitch_rms_deg"],
                        *(p["rate"] for p in one["policies"])])  # fmt: skip
        print(f"equally good fits: {number + 1} of {N_GOOD_FITS}", file=sys.stderr, flush=True)
    names = ("landed_auc", "landed_brier", "two_leg_share", "pitch_rms_deg", *(f"{r:g}, {m:g}" for r, m in POLICIES))
    low, high = np.percentile(figures, (5, 95), axis=0)
    return {name: [float(lo), float(hi)] for name, lo, hi in zip(names, low, high, strict=True)}


def feet(flights: store.Flights) -> list[dict[str, Any]]:
    """What the motion after the contact says of the feet: difference of pitch from 200 to 420 ms, by parameter.

    The trigger's jitter (4 ms) and the height (8 mm) are fitted for each flight, so that only what follows counts.
    """
    found, _ = compare.flips(flights)
    chosen = [f for f in found if MOMENT_NMM[0] <= f.moment_Nmm <= MOMENT_NMM[1] and f.n_legs >= 1]
    home = World(VEHICLE, GEAR, GEAR_SET).changed(**dict.fromkeys(motion.SCATTER, 0.0))
    tried = [{}, *_TRIED_FEET]
    rows = []
    for changes in tried:
        best = []
        for flip in chosen:
            world = compare.in_room(home.changed(**changes), flip)
            start = motion.start_state(world, flip)
            part = (flip.t_s > 0.2) & (flip.t_s < 0.42)
            errors = []
            for height_m in (-0.008, 0.0, 0.008):
                lifted = replace(start, p_W_m=np.add(start.p_W_m, (0.0, 0.0, height_m)))
                pitch = motion.fly(world, flip, lifted).pitch_deg
                errors += [np.interp(flip.t_s[part] + late, flip.t_s, pitch) - flip.pitch_deg[part]
                           for late in (-0.004, 0.0, 0.004)]  # fmt: skip
            best.append(min(float(np.mean(np.minimum(np.abs(e), 60.0) ** 2)) for e in errors))
        label = ", ".join(f"{name} = {value:g}" for name, value in changes.items()) or "as in the files"
        rows.append({"gear": label, "median_rms_deg": float(np.sqrt(np.median(best))), "n": len(chosen)})
    return rows


def measure(logs: list[Path], spin_downs: list[Path]) -> dict[str, Any]:
    """Every figure of the page."""
    flights = importer.run(logs, "habas2021", Given(licence="MIT"))
    usable = flights.usable()
    world = World(VEHICLE, GEAR, GEAR_SET)
    compared: dict[str, Any] = {}
    for label, vehicle, changes in (("now", VEHICLE, {}), ("before", VEHICLE, BEFORE), ("habas2021", "habas2021", {})):
        result = compare.compare(usable, World(vehicle, GEAR, GEAR_SET, None, **changes), N_ROLLOUTS, 0, POLICIES)
        compared[label] = result.summary()
        if label == "now":
            draw(result)
    low, high = MOMENT_NMM
    before = {name: value for name, value in BEFORE.items() if name in FITTED}
    fit = identify_from(usable, before, lambda _, flip: not low <= flip.moment_Nmm <= high)
    return {
        "sources": list(flights.manifest.source),
        "n_flights": len(flights),
        "n_usable": len(usable),
        "endings": {str(c): sum(compare.class_of(f.info["n_legs"]) == c for f in usable) for c in compare.CLASSES},
        "replay": replay_figures(usable, world),
        "spin_down": spin_down(spin_downs),
        "climb": climb(usable, world),
        "battery": battery(usable),
        "compared": compared,
        "fit": fit.summary(),
        "good_fits": good_fits(usable, fit),
        "feet": feet(usable),
    }


def identify_from(flights: store.Flights, wrong: dict[str, float], held_out: Any) -> identify.Identification:
    """The fit from the vehicle as it was: three parameters are off, with wide priors."""
    with tempfile.TemporaryDirectory() as text:
        path = Path(text) / "before.yaml"
        path.write_text(identify.vehicle_text(VEHICLE, wrong, PRIOR_SIGMAS), encoding="utf-8")
        return identify.identify(flights, World(str(path), GEAR, GEAR_SET), list(FITTED), held_out=held_out,
                                 progress=lambda line: print(line, file=sys.stderr, flush=True))  # fmt: skip


def replay_figures(flights: store.Flights, world: World) -> dict[str, Any]:
    """Agreement of the flight core with what was logged."""
    told = replay.replay(flights, world).summary
    keys = ("n_flights", "n_samples", "n_ticks", "rrev", "of_y", "trigger")
    return {key: told[key] for key in keys}


def draw(result: compare.Comparison) -> None:
    """The picture of the page."""
    from ivl.plots import flights as picture

    home = World(VEHICLE, GEAR, GEAR_SET)
    worlds = [compare.in_room(home, row.flip) for row in result.rows]
    picture.draw(result, worlds, [PICTURE], f"{VEHICLE}, {GEAR_SET}/{GEAR}")


def believe(logs: list[Path]) -> dict[str, Any]:
    """What the default learner would have believed after each flight, from the vehicle file as it was."""
    told = flights_belief.told(importer.run(logs, "habas2021", Given(licence="MIT")))
    simulated = flights_belief.simulator(VEHICLE, BEFORE, PRIOR_SIGMAS)
    results = {}
    for name, options in flights_belief.GUARDS.items():
        print(f"guards: {name}", file=sys.stderr, flush=True)
        results[name] = flights_belief.learn(simulated, told, **options)
    whole, *_ = results.values()
    flights_belief.draw(whole, BELIEF_PICTURE)
    guards = {name: flights_belief.summary(result) for name, result in results.items()}
    return {**flights_belief.summary(whole), "n_flights": len(told), "guards": guards}


def main() -> int:
    """Measure, or write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    commands = parser.add_subparsers(dest="command", required=True)
    first = commands.add_parser("measure", help="recompute docs/data/flights.json and the picture")
    first.add_argument("--logs", nargs="+", type=Path, required=True)
    first.add_argument("--spin-down", nargs="+", type=Path, required=True)
    third = commands.add_parser("believe", help="recompute what a belief learns from the flights (minutes)")
    third.add_argument("--logs", nargs="+", type=Path, required=True)
    second = commands.add_parser("page", help="write docs/FLIGHTS.md from docs/data/flights.json")
    second.add_argument("--check", action="store_true", help="only say whether it is up to date")
    args = parser.parse_args()
    if args.command == "measure":
        _keep(measure(args.logs, args.spin_down) | {"belief": _kept()["belief"]})
        print(f"{DATA.relative_to(ROOT)} and {PICTURE.relative_to(ROOT)} are written")
    if args.command == "believe":
        _keep(_kept() | {"belief": believe(args.logs)})
    from flights_page import page

    text = page(json.loads(DATA.read_text(encoding="utf-8")))
    if args.command == "page" and args.check:
        return 0 if PAGE.read_text(encoding="utf-8") == text else 1
    PAGE.write_text(text, encoding="utf-8")
    return 0


def _kept() -> dict[str, Any]:
    data: dict[str, Any] = json.loads(DATA.read_text(encoding="utf-8"))
    return data


def _keep(data: dict[str, Any]) -> None:
    DATA.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
