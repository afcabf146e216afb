"""How much the outcome of a landing depends on the integration step.

Random landings of all gears are flown with the steps as they are, with half of them and with a tenth. A landing whose
number of stuck feet changes with the step must lie at the edge of the success region: among its neighbours, up to 2 %
away in speed, angle, RREV_c and M_yd, the finest steps themselves must give different numbers.

usage: step_study.py [--landings N] [--seed N] [--vehicle NAME]      prints a table in Markdown
"""

import argparse
import sys
from dataclasses import dataclass
from typing import Any

import numpy as np

import ivl
from ivl import native

GEAR_SETS = ("table1", "as_simulated")
GEARS = (
    "extra_narrow_short",
    "narrow_short",
    "wide_short",
    "extra_narrow_long",
    "narrow_long",
    "wide_long",
)
SCALES = (1.0, 0.5, 0.1)
N_NEIGHBOURS = 128
NEIGHBOURHOOD = 0.02
ANGLE_MAX_DEG = 90.0


@dataclass(frozen=True)
class Row:
    """Shares of one gear's landings, and how many of those that changed lie far from the edge."""

    gear: str
    landings: int
    four_leg: float
    half: float
    tenth: float
    four_leg_tenth: float
    body_tenth: float
    theta_deg: float
    n_far: int
    steps: float

    def markdown(self) -> str:
        """One line of the table."""
        return (
            f"| {self.gear} | {self.landings} | {100 * self.four_leg:.1f} | {100 * self.half:.2f} "
            f"| {100 * self.tenth:.2f} | {100 * self.four_leg_tenth:.2f} | {100 * self.body_tenth:.2f} "
            f"| {self.theta_deg:.3f} | {self.n_far} | {self.steps:.0f} |"
        )


HEADER = (
    "| gear | landings | four-leg % | legs changed, step / 2 % | legs changed, step / 10 % "
    "| four-leg changed, step / 10 % | body contact changed, step / 10 % "
    "| median change of theta_impact, deg | far from the edge | steps |\n"
    "|---|---|---|---|---|---|---|---|---|---|"
)


def world(vehicle: str, gear_set: str, gear: str, scale: float) -> ivl.World:
    """The world with all steps multiplied by `scale`; their growth is per time, not per step."""
    growth = native.library().params["step.growth"].default
    assert growth is not None
    return ivl.World(vehicle, gear, gear_set, **{"step.scale": scale, "step.growth": growth**scale})


def draw(n: int, rng: np.random.Generator) -> dict[str, Any]:
    """Arguments of n random landings."""
    return {
        "speed_mps": rng.uniform(0.5, 4.0, n),
        "angle_deg": rng.uniform(20.0, 90.0, n),
        "rrev_c_per_s": rng.uniform(2.0, 7.0, n),
        "moment_y_Nmm": rng.uniform(3.0, 11.0, n),
    }


def far_from_edge(reference: ivl.World, landing: dict[str, float], stream: int, seed: int) -> bool:
    """True if all neighbours of a landing end with the same number of stuck feet under the finest steps."""
    rng = np.random.default_rng(stream)
    near = {
        name: value * rng.uniform(1.0 - NEIGHBOURHOOD, 1.0 + NEIGHBOURHOOD, N_NEIGHBOURS)
        for name, value in landing.items()
    }
    near["angle_deg"] = np.minimum(near["angle_deg"], ANGLE_MAX_DEG)
    out = reference.rollouts(**near, seed=seed, stream=np.uint64(stream))
    return bool((out.n_legs == out.n_legs[0]).all())


def study_gear(vehicle: str, gear_set: str, gear: str, n: int, seed: int, rng: np.random.Generator) -> Row:
    """Fly n landings of one gear with all steps."""
    landings = draw(n, rng)
    worlds = [world(vehicle, gear_set, gear, scale) for scale in SCALES]
    full, half, tenth = (w.rollouts(**landings, seed=seed) for w in worlds)
    changed = np.flatnonzero((full.n_legs != tenth.n_legs) | (full.n_legs != half.n_legs))
    far = sum(
        far_from_edge(worlds[-1], {name: float(values[i]) for name, values in landings.items()}, int(i), seed)
        for i in changed
    )
    both = np.isfinite(full.theta_impact_deg) & np.isfinite(tenth.theta_impact_deg)
    return Row(
        gear=f"{gear_set} / {gear}",
        landings=n,
        four_leg=float((full.n_legs >= 3).mean()),
        half=float((full.n_legs != half.n_legs).mean()),
        tenth=float((full.n_legs != tenth.n_legs).mean()),
        four_leg_tenth=float(((full.n_legs >= 3) != (tenth.n_legs >= 3)).mean()),
        body_tenth=float((full.body_contact != tenth.body_contact).mean()),
        theta_deg=float(np.median(np.abs(full.theta_impact_deg - tenth.theta_impact_deg)[both])),
        n_far=far,
        steps=float(full.n_steps.mean()),
    )


def total(rows: list[Row]) -> Row:
    """All gears together."""
    weights = np.array([row.landings for row in rows], dtype=float)

    def mean(name: str) -> float:
        return float(np.average([getattr(row, name) for row in rows], weights=weights))

    shares = {
        name: mean(name) for name in ("four_leg", "half", "tenth", "four_leg_tenth", "body_tenth", "theta_deg", "steps")
    }
    return Row(gear="all", landings=int(weights.sum()), n_far=sum(row.n_far for row in rows), **shares)


def study(landings: int, seed: int, vehicle: str) -> list[Row]:
    """One row for each gear, and the total last."""
    rng = np.random.default_rng(seed)
    each = -(-landings // (len(GEAR_SETS) * len(GEARS)))
    rows = [study_gear(vehicle, gear_set, gear, each, seed, rng) for gear_set in GEAR_SETS for gear in GEARS]
    return [*rows, total(rows)]


def main() -> int:
    """Print the table; return 1 if the claim does not hold."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--landings", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--vehicle", default="habas2021")
    args = parser.parse_args()
    rows = study(args.landings, args.seed, args.vehicle)
    print(HEADER)
    for row in rows:
        print(row.markdown())
    good = rows[-1].half < 0.01 and rows[-1].n_far == 0
    print(f"\nhalf the step changes {100 * rows[-1].half:.2f} % (must stay below 1 %), "
          f"{rows[-1].n_far} far from the edge (must be none)")  # fmt: skip
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
