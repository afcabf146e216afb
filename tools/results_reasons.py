"""The measurements behind the reasons in docs/RESULTS.md, section 7, as Markdown; a minute on one core.

.venv/bin/python tools/results_reasons.py order      which leg sticks first, by the body's angle at first contact
.venv/bin/python tools/results_reasons.py vehicle    one property of habas2021 at a time in crazyflie21
"""

import argparse
import sys
from itertools import pairwise

import numpy as np

from ivl import World, four_leg

ANGLES_DEG = (0, 90, 120, 150, 180, 190, 210, 240, 300)
APPROACHES = ((1.0, 45.0), (1.5, 60.0), (2.5, 60.0))
N_ROLLOUTS = 8
VARIANTS = (
    ("`habas2021`", "habas2021", {}),
    ("`crazyflie21`", "crazyflie21", {}),
    (
        "with sensing without latency and noise",
        "crazyflie21",
        dict.fromkeys(("sense.latency", "sense.position_noise", "sense.velocity_noise", "sense.gyro_noise"), 0.0),
    ),
    (
        "without drag and ceiling effect",
        "crazyflie21",
        dict.fromkeys(("aero.drag_xy", "aero.drag_z", "aero.ceiling_gain"), 0.0),
    ),
    ("with rotors that spin up in 10 ms", "crazyflie21", {"rotor.tau_up": 0.01}),
    ("with rotors that stop in 0.1 ms", "crazyflie21", {"rotor.tau_down": 0.0001, "rotor.drag_share": 0.0}),
    ("with a battery that never sags", "crazyflie21", {"battery.voltage": 0.0}),
    (
        "with the inertia of `habas2021`",
        "crazyflie21",
        {"body.inertia_xx": 4.935e-5, "body.inertia_yy": 4.935e-5, "body.inertia_zz": 2.926e-5},
    ),
    (
        "`habas2021` with rotors that slow as these",
        "habas2021",
        {"rotor.tau_down": 0.194, "rotor.drag_share": 0.9},
    ),
)


def main() -> int:
    """Command line."""
    parser = argparse.ArgumentParser(description="the measurements behind the reasons in docs/RESULTS.md")
    parser.add_argument("what", choices=("order", "vehicle"))
    print_order() if parser.parse_args().what == "order" else print_vehicles()
    return 0


def print_order() -> None:
    """Four-leg landings of Wide-Short from commanded flips: leg order and body contact by angle at first contact."""
    speed, angle = np.arange(1.5, 4.01, 0.5), np.array([30.0, 50.0, 70.0, 90.0])
    rrev, moment = np.linspace(4.0, 6.5, 40), np.linspace(5.0, 10.5, 12)
    v, phi, r, m = np.meshgrid(speed, angle, rrev, moment, indexing="ij")
    d_ceil_m = v * np.sin(np.deg2rad(phi)) / r
    out = World("habas2021", "wide_short", "table1").rollouts(v, phi, 0.0, m, d_ceil_m=d_ceil_m, start="at_trigger")
    landed = out[four_leg(out)]
    fore, body = np.isin(landed["leg_order"][..., 0], (1, 4)), landed["body_contact"] != 0
    print("| angle at first contact (deg) | four-leg landings | fore leg first | body contact |\n|---|---|---|---|")
    for low, high in pairwise(ANGLES_DEG):
        chosen = (landed["theta_impact_deg"] >= low) & (landed["theta_impact_deg"] < high)
        shares = " | ".join(f"{100 * x[chosen].mean():.0f} %" for x in (fore, body)) if chosen.any() else "- | -"
        print(f"| {low} to {high} | {chosen.sum()} | {shares} |")


def print_vehicles() -> None:
    """Best four-leg rate of each variant with Wide-Long, and body contact over all policies of the grid."""
    header = [f"{v:g} m/s, {phi:g} deg" for v, phi in APPROACHES]
    print(f"| vehicle | {' | '.join(header)} | body contact, {APPROACHES[0][0]:g} m/s |\n|---|---|---|---|---|")
    for label, vehicle, overrides in VARIANTS:
        world = World(vehicle, "wide_long", "table1", **overrides)
        found = [best_rate(world, *approach) for approach in APPROACHES]
        print(f"| {label} | {' | '.join(f'{rate:.2f}' for rate, _ in found)} | {100 * found[0][1]:.0f} % |")


def best_rate(world: World, speed_mps: float, angle_deg: float) -> tuple[float, float]:
    """Largest four-leg rate over a grid of policies, and the share of all its rollouts with body contact."""
    rrev, moment = np.linspace(3.0, 7.0, 41), np.linspace(3.0, 10.5, 11)
    stream = np.arange(41 * 11 * N_ROLLOUTS).reshape(41, 11, N_ROLLOUTS)
    out = world.rollouts(speed_mps, angle_deg, rrev[:, None, None], moment[:, None], seed=3, stream=stream)
    return float(four_leg(out).mean(axis=2).max()), float((out["body_contact"] != 0).mean())


if __name__ == "__main__":
    sys.exit(main())
