"""What the simulator in this process expects of a policy that is announced to an operator."""

import math
from dataclasses import dataclass

import numpy as np

from ivl.belief.recording import with_battery
from ivl.experiment import Experiment
from ivl.outcome import four_leg
from ivl.world import World

N = 64
_SEED = 2**63 - 1  # no trial has it: a forecast must not draw the numbers of the landing


@dataclass(frozen=True)
class Forecast:
    """What the simulator expects of a policy, from `n` landings with random numbers of its own."""

    n: int
    n_landed: int
    n_strikes: int

    def __str__(self) -> str:
        """In one line; a strike does not land, and its body or rotors touch the ceiling."""
        return (
            f"simulated: {self.n_landed} of {self.n} land; risk: {self.n_strikes} of {self.n} strike the ceiling "
            "with body or rotors"
        )


class Forecasts:
    """Forecasts of one experiment; the last one is kept, since a policy may be announced many times."""

    def __init__(self, world: World, experiment: Experiment) -> None:
        """Nothing is simulated yet."""
        self._world, self._experiment = world, experiment
        self._last: tuple[tuple[tuple[float, ...], float | None], Forecast] | None = None

    def of(self, theta: tuple[float, ...], rest_V: float = math.nan) -> Forecast:
        """Of a policy, in the units of the experiment's form, with a battery that has `rest_V` at rest; NaN: any."""
        told = math.isfinite(rest_V) and self._world.params.values["battery.voltage"] > 0.0
        battery_V = round(rest_V, 2) if told else None
        if self._last is None or self._last[0] != (theta, battery_V):
            self._last = (theta, battery_V), self._simulated(theta, battery_V)
        return self._last[1]

    def _simulated(self, theta: tuple[float, ...], battery_V: float | None) -> Forecast:
        experiment, world = self._experiment, self._world
        if battery_V is not None:
            world = with_battery(world, battery_V)
        out = world.rollouts(
            experiment.speed_mps, experiment.angle_deg, *theta, form=experiment.policy.form,
            seed=_SEED, stream=np.arange(N, dtype=np.uint64), start=experiment.start,
        )  # fmt: skip
        landed = four_leg(out)
        return Forecast(N, int(landed.sum()), int((~landed & (out["body_contact"] != 0)).sum()))
