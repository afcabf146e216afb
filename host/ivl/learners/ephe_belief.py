"""EPHE on a belief over simulated vehicles: the learner for a vehicle that was never simulated exactly.

Before the first flight the belief is the family of the task. Each flight tells what it recorded of its flip and whether
it landed; the belief follows (`ivl.belief.posterior`). mu and sigma follow by EPHE over rollouts imagined on the belief
(`ivl.belief.decide`). Flown first, and recommended, is the policy of the largest margin rate; further flights of an
episode are drawn from N(mu, diag sigma^2).

A simulated family may be wrong. What no member explains is learned from outcomes by a local correction of the expected
landing rate (`ivl.belief.correction`). The learner watches whether flights land as often as was expected of them,

    surprise = sum(landed_i - p_i) / sqrt(sum p_i (1 - p_i)),    p_i what was expected before flight i,

and while the surprise is below `alarm` it says that no member fits and trusts outcomes more: the correction may be
`wide` times as large. Without a simulator it is EPHE with a memory (`ivl.learners.ephe_memory`).
"""

import copy
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from pydantic import Field

from ivl.belief import correction, decide, emulator, recording
from ivl.belief.posterior import Belief, Evidence, Trust
from ivl.belief.simulator import Simulator
from ivl.errors import LearnerError
from ivl.learners.base import LANDED, RECORDING, FloatArray, Meta, draw_truncated
from ivl.learners.bo import BOOptions
from ivl.learners.ephe import imagine
from ivl.learners.ephe_memory import EpheMemory, EpheMemoryOptions

_P_MIN = 0.02
LEVELS = (0.05, 0.25, 0.5, 0.75, 0.95)
"""Levels of the quantiles in `EpheBelief.insight`."""


class EpheBeliefOptions(EpheMemoryOptions):
    """Options of EPHE on a belief, beside those of EPHE with a memory."""

    n_particles: int = Field(default=256, ge=16, le=1000, description="particles of the belief")
    lapse: float = Field(default=0.05, gt=0, lt=1, description="probability that an outcome says nothing")
    alarm: float = Field(default=-2.2, lt=0, description="surprise below which no member is said to fit")
    floor: float = Field(default=0.03, gt=0, le=1, description="smallest sigma, in units of sigma0")
    local: float = Field(default=1.0, gt=0, le=10, description="size of the local correction, in logits")
    wide: float = Field(default=3.0, ge=1, le=10, description="factor on that size while the alarm is on")
    local_length: float = Field(default=0.2, gt=0, le=10, description="its lengths, in units of sigma0")
    discrepancy: float = Field(default=1.0, ge=0, le=10, description="factor on the errors allowed to any model")
    n_full: float = Field(default=3.0, ge=1, le=10_000, description="flights whose motion counts in full, all told")


class EpheBelief(EpheMemory):
    """EPHE over rollouts imagined on a belief over vehicles; without a simulator EPHE with a memory."""

    Options: ClassVar[type[BOOptions]] = EpheBeliefOptions
    uses_simulator: ClassVar[bool] = True
    options: EpheBeliefOptions

    def _setup(self) -> None:
        super()._setup()
        self._bounds = np.stack([self.lo, self.hi], axis=1)
        self._belief: Belief | None = None
        self._theta, self._features = np.empty((0, self.dim)), np.empty((0, len(emulator.USED)))
        self._told, self._conditions, self._foreseen = np.empty(0, dtype=bool), np.empty((0, 2)), np.empty(0)

    def begin(self, simulator: Simulator) -> None:
        """Start from simulated vehicles; before the first `ask` or `load_state_dict`."""
        given = self.options
        trust = Trust(lapse=given.lapse, discrepancy=given.discrepancy, n_full=given.n_full)
        self._belief = simulator.belief(self._rng, self.options.n_particles, trust)
        self._simulator = simulator
        self._at_first = self._quantiles()
        self._predicted: dict[str, Any] | None = None
        self._normal = (self.mu0, self.sigma0)
        self._decide()

    @property
    def model_fits(self) -> bool | None:
        """Whether flights land as often as the belief expects; None without a belief."""
        return None if self._belief is None else not self.surprise < self.options.alarm

    @property
    def insight(self) -> dict[str, Any] | None:
        """See `Learner`; also `surprise`, and what a picture of the belief needs.

        `belief`: `names` and `units` of the family's parameters, their `quantiles` now and in the family (`prior`),
        shape (n_dimensions, 5) each at `LEVELS`. `predicted`: what was expected of the recording of the flight told
        last that came first in its episode: `names`, `mean` and `sd` of each feature; None before any flight.
        """
        if self._belief is None:
            return None
        kin = self._simulator.kin
        return {
            "expected_rate": float(self.expected_rates(self._choice[None])[0]),
            "margin_rate": self._margin_rate,
            "model_fits": bool(self.model_fits),
            "surprise": self.surprise,
            "belief": {
                "names": list(kin.names),
                "units": [d.unit for d in kin.dimensions],
                "prior": self._at_first,
                "quantiles": self._quantiles(),
            },
            "predicted": self._predicted,
        }

    @property
    def particles(self) -> FloatArray:
        """Vehicles that are believed in, shape (n_particles, n_dimensions), see `ivl.family`; only with a belief."""
        assert self._belief is not None
        return self._belief.z

    def expected_rates(self, theta: FloatArray) -> FloatArray:
        """Landing rates that are expected now of policies, shape (n, dim): shape (n,); only with a belief."""
        assert self._belief is not None
        return decide.rate(self._belief, self._corrected, theta)

    def _quantiles(self) -> list[list[float]]:
        """Quantiles of each parameter of the family over the particles."""
        assert self._belief is not None
        found = np.quantile(self._simulator.kin.values(self._belief.z), LEVELS, axis=0)
        return [[float(value) for value in row] for row in found.T]

    def _predict(self, theta: FloatArray, conditions: FloatArray) -> dict[str, Any]:
        """What a flight of a policy, shape (dim,), is expected to record; its scatter is in the standard deviation."""
        assert self._belief is not None
        emulated, n = self._simulator.recordings, len(self._belief.z)
        expected = emulated.mean(self._belief.z, np.tile(theta, (n, 1)), np.tile(conditions, (n, 1)))
        sd = np.sqrt(expected.var(axis=0) + np.diag(emulated.within))
        return {"names": list(emulator.USED), "mean": expected.mean(axis=0).tolist(), "sd": sd.tolist()}

    @property
    def surprise(self) -> float:
        """See the module's text; 0 before the first flight."""
        p = np.clip(self._foreseen, _P_MIN, 1.0 - _P_MIN)
        return float((self._told - p).sum() / np.sqrt((p * (1.0 - p)).sum())) if len(p) else 0.0

    def _ask(self, n: int) -> FloatArray:
        if self._belief is None:
            return super()._ask(n)
        drawn = draw_truncated(self._rng, *self._normal, self.lo, self.hi, n - 1)
        return np.vstack([self._choice, drawn])

    def _update(self, theta: FloatArray, rewards: FloatArray, meta: Meta, /) -> None:
        if self._belief is None:
            super()._update(theta, rewards, meta)
            return
        self._remember(theta, rewards, meta)
        self._belief.update(self._evidence())
        self._decide()

    def _decide(self) -> None:
        """The correction, the policy of the largest margin rate, and (mu, sigma)."""
        assert self._belief is not None
        options = self.options
        size = options.local * (1.0 if self.model_fits else options.wide)
        self._belief.battery_V = self._battery_V()
        expected = self._rates_flown(self._theta, self._conditions) if len(self._theta) else np.empty(0)
        self._corrected = correction.fit(self._theta, self._told, expected, options.local_length * self.sigma0, size)
        self._choice, self._margin_rate = decide.safest(self._belief, self._corrected, self._bounds, self._rng)
        self._normal = self._imagine_on_belief(*self._normal)

    def _battery_V(self) -> float:
        """Voltage of the last flight that told one, if the next has the same battery; else NaN."""
        told = self._conditions[np.isfinite(self._conditions[:, 0]), 0]
        return float(told[-1]) if self._simulator.flight.battery_lasts and len(told) else np.nan

    def take_battery(self, battery_V: float) -> None:
        """Decide again for the battery of the next flight, if it is none that flights have told of.

        The random numbers are a copy, so later ones are as without it.

        Args:
            battery_V: Voltage that is expected in the hover; NaN is unknown.
        """
        if self._belief is None or not self._simulator.flight.battery_lasts or not np.isfinite(battery_V):
            return
        if abs(battery_V - self._belief.battery_V) <= emulator.BATTERY_CHANGES_V:
            return
        self._belief.battery_V = battery_V
        rng = copy.deepcopy(self._rng)
        self._choice, self._margin_rate = decide.safest(self._belief, self._corrected, self._bounds, rng)

    def rechosen(self, theta: FloatArray, battery_V: float) -> FloatArray:
        """The choice for another battery in place of that which was asked for, shape (dim,); other policies stay."""
        is_choice = self._belief is not None and np.array_equal(theta, self._choice)
        self.take_battery(battery_V)
        return self._choice if is_choice else theta

    def _rates_flown(self, theta: FloatArray, conditions: FloatArray) -> FloatArray:
        """Landing rates that the belief, uncorrected, expects of flights; if a battery lasts, each with its own."""
        assert self._belief is not None
        if self._simulator.flight.battery_lasts:
            return self._belief.rates_under(theta, conditions)
        return np.asarray(self._belief.rates(theta).mean(axis=0))

    def _remember(self, theta: FloatArray, rewards: FloatArray, meta: Meta) -> None:
        """Add flights to the evidence, with what was expected of them."""
        assert self._belief is not None
        features = np.asarray(meta.get(RECORDING, np.full((len(rewards), recording.N), np.nan)), dtype=np.float64)
        if LANDED not in meta:
            raise LearnerError(f"tell: meta[{LANDED!r}] is missing: a belief must be told which rollouts landed")
        landed = meta[LANDED].astype(bool)
        self._predicted = self._predict(theta[0], features[0, recording.CONDITIONS])
        conditions = features[:, recording.CONDITIONS]
        foreseen = self._corrected(theta, self._rates_flown(theta, conditions))
        self._foreseen = np.append(self._foreseen, foreseen)
        self._theta = np.vstack([self._theta, theta])
        self._features = np.vstack([self._features, emulator.used(features)])
        self._conditions = np.vstack([self._conditions, features[:, recording.CONDITIONS]])
        self._told = np.append(self._told, landed)

    def _evidence(self) -> Evidence:
        return Evidence(self._theta, self._features, self._told, self._conditions)

    def _imagine_on_belief(self, mu: FloatArray, sigma: FloatArray) -> tuple[FloatArray, FloatArray]:
        """EPHE from where it stands; from the belief's best policy where that is expected to land more often."""
        assert self._belief is not None
        options, floor = self.options, self.options.floor * self.sigma0
        starts = [(mu, np.maximum(sigma, 0.5 * self.sigma0)), (self._choice, 0.5 * self.sigma0)]
        reward = decide.imagined(self._belief, self._corrected, self._bounds, self._rng)
        n, updates, shrink = options.n_imagined, options.iterations, options.shrink_min
        found = [imagine(reward, *start, self._bounds, self._rng, n, updates, shrink, floor) for start in starts]
        rates = decide.margin_rate(self._belief, self._corrected, np.array([mu for mu, _ in found]), self._bounds)
        return found[int(rates.argmax())]

    def _distribution(self) -> tuple[FloatArray, FloatArray]:
        return self._normal if self._belief is not None else super()._distribution()

    def _recommended(self) -> FloatArray:
        return self._choice if self._belief is not None else super()._recommended()

    def _state(self) -> dict[str, Any]:
        state = super()._state()
        if self._belief is None:
            return state
        return {
            **state,
            "belief": self._belief.state(),
            "emulators": self._belief.digest(),
            "theta": self._theta.tolist(),
            "features": _plain(self._features),
            "conditions": _plain(self._conditions),
            "told": [int(value) for value in self._told],
            "foreseen": self._foreseen.tolist(),
            "choice": self._choice.tolist(),
            "margin_rate": self._margin_rate,
            "imagined": [part.tolist() for part in self._normal],
        }

    def _load(self, state: Mapping[str, Any]) -> None:
        belief = self._belief
        super()._load(state)
        if "belief" not in state:
            return
        if belief is None:
            raise ValueError("it began with a simulator, and none is given")
        self._belief = belief
        if state["emulators"] != belief.digest():
            raise ValueError("the simulated vehicles are not those it began with: another version of what fits them")
        self._theta = np.array(state["theta"], dtype=np.float64).reshape(-1, self.dim)
        self._features = np.array(state["features"], dtype=np.float64).reshape(-1, len(emulator.USED))
        self._conditions = np.array(state["conditions"], dtype=np.float64).reshape(-1, 2)
        self._told = np.array(state["told"], dtype=bool)
        self._foreseen = np.array(state["foreseen"], dtype=np.float64)
        self._choice = np.array(state["choice"], dtype=np.float64)
        self._margin_rate = float(state["margin_rate"])
        mu, sigma = (np.array(part, dtype=np.float64) for part in state["imagined"])
        self._normal = (mu, sigma)
        self._belief.load(state["belief"], self._evidence() if len(self._theta) else None)
        size = self.options.local * (1.0 if self.model_fits else self.options.wide)
        self._belief.battery_V = self._battery_V()
        expected = self._rates_flown(self._theta, self._conditions) if len(self._theta) else np.empty(0)
        self._corrected = correction.fit(
            self._theta, self._told, expected, self.options.local_length * self.sigma0, size
        )


def _plain(values: FloatArray) -> list[Any]:
    """Plain data for JSON, None for NaN."""
    plain = values.astype(object)
    plain[~np.isfinite(values)] = None
    return list(plain.tolist())
