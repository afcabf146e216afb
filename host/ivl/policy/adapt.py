"""A policy for every approach that learns which vehicle flies: EPHE on a belief over vehicles.

    adaptation = Adaptation(place, policy, region, seed=0)
    theta = adaptation.theta                          # fly it at any approach of the region
    adaptation.tell(speed_mps, angle_deg, features, landed)

The belief starts from the family of the policy's task. Each flight tells what it recorded and whether it landed
(`ivl.belief`), whatever its approach was. Then EPHE goes on from where it stands, over flights imagined on the belief
at approaches of the region (`ivl.belief.every`); of its mean, of the policy so far and of the one that it began with,
the one with the largest margin rate is flown next. Threshold and moment change; go / no-go stays as it is.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ivl import family, forms
from ivl.belief import emulator, every, recording
from ivl.belief.bank import Progress
from ivl.belief.posterior import Evidence, Trust
from ivl.belief.recording import Flight
from ivl.belief.simulator import Simulator
from ivl.learners.ephe import imagine
from ivl.outcome import Outcomes, four_leg
from ivl.policy.file import PolicyFile
from ivl.policy.flying import Place
from ivl.policy.region import Region
from ivl.policy.shape import THRESHOLD_PER_S_MAX, THRESHOLD_PER_S_MIN, General
from ivl.policy.start import design, moment_most_Nmm
from ivl.world import World

FloatArray = npt.NDArray[np.float64]

MEMBERS = 4800
"""Vehicles of the bank: twice as many as for one approach."""
_PARTICLES = 256
_ABOUT_PER_S, _ABOUT_NMM, _STEP_NMM = 4.0, 5.0, 0.5
_WIDER, _LEAST_MOMENT = 1.4, 0.4
"""Flights of the bank: thresholds so far beyond those of the policy, and moments from this part of the largest on."""
_SPREAD_PER_S, _SPREAD_NMM, _REACH = 0.15, 0.2, 6.0
"""Spread of the first imagined thresholds and moments, and how far from the policy they may go, in spreads."""
_AGAIN, _FLOOR, _SHRINK = 0.3, 0.05, 0.85
"""After each flight sigma is at least, and may at last become, these shares of the first one."""
_POLICIES, _UPDATES = 300, 20


def linear(general: General, approaches: FloatArray) -> every.Linear:
    """How the searched numbers of a form change threshold and moment at approaches, shape (n, 2)."""
    speed_mps, angle_rad = approaches[:, 0], np.deg2rad(approaches[:, 1])
    vx, vz = speed_mps * np.cos(angle_rad), speed_mps * np.sin(angle_rad)
    level = np.asarray(general.level(_ABOUT_PER_S, _ABOUT_NMM))
    threshold = design(general, vx, vz, _ABOUT_PER_S)
    base = general.thresholds(level, vx, vz) - threshold @ level[general.threshold]
    moments = []
    for i in range(general.moment.start, general.moment.stop):
        moved = level.copy()
        moved[i] += _STEP_NMM
        moments.append((general.moments(moved, vx, vz) - general.moments(level, vx, vz)) / _STEP_NMM)
    moment = np.stack(moments, axis=-1)
    return every.Linear(
        approaches,
        base,
        np.concatenate([threshold, np.zeros_like(moment)], axis=1),
        np.concatenate([np.zeros_like(threshold), moment], axis=1),
        (THRESHOLD_PER_S_MIN, THRESHOLD_PER_S_MAX),
    )


def flight_of(place: Place, policy: PolicyFile, region: Region) -> Flight:
    """What the bank of an adaptation flies: flips of the paper's form around those of the policy."""
    approaches = np.array([region.speeds_mps, region.angles_deg])
    general = General(policy.form)
    most = moment_most_Nmm([place])
    flown = linear(general, every.spread(approaches)).flights(np.array([policy.values])[:, general.searched], most)
    lo, hi = float(flown[..., 0].min()) / _WIDER, float(flown[..., 0].max()) * _WIDER
    bounds = np.array([[lo, min(hi, THRESHOLD_PER_S_MAX)], [_LEAST_MOMENT * most, most]])
    return Flight(float("nan"), float("nan"), forms.PAPER, place.task.start, bounds, approaches)


@dataclass
class _Flown:
    """Flights so far."""

    theta: FloatArray
    features: FloatArray
    landed: npt.NDArray[np.bool_]
    conditions: FloatArray


class Adaptation:
    """See the module's text."""

    def __init__(
        self,
        place: Place,
        policy: PolicyFile,
        region: Region,
        seed: int = 0,
        threads: int | None = None,
        progress: Progress | None = None,
        n_members: int = MEMBERS,
    ) -> None:
        """Before any flight; the bank is flown, or taken from the cache.

        Args:
            place: Task and world of the vehicle of the files; its family is the prior.
            policy: What to begin with, for every approach.
            region: Approaches that count.
            seed: Of everything that is drawn.
            threads: Worker threads of the bank; omitted: all processors.
            progress: Called with (vehicles flown, vehicles), if the bank is flown.
            n_members: Vehicles of the bank.

        Raises:
            ConfigError: The form is not for every approach, or nothing of the task is uncertain.
        """
        self.general = General(policy.form)
        self.flight = flight_of(place, policy, region)
        kin = family.of(place.world, place.task.family)
        self._rng = np.random.Generator(np.random.PCG64(seed))
        simulator = Simulator.of(kin, self.flight, n_members, threads, progress)
        self._belief = simulator.belief(self._rng, _PARTICLES, Trust())
        self._begin = np.array(policy.values)
        assert self.flight.approaches is not None
        self._form = linear(self.general, every.spread(self.flight.approaches))
        first = self._begin[self.general.searched]
        per_number = np.sqrt((self._form.threshold**2).mean(axis=0))[: self.general.n_threshold]
        spread = _SPREAD_PER_S / np.sqrt(self.general.n_threshold) / np.maximum(per_number, 1e-6)
        self._first_sigma = np.concatenate([spread, np.full(len(first) - len(spread), _SPREAD_NMM)])
        self._bounds = first[:, None] + _REACH * self._first_sigma[:, None] * np.array([-1.0, 1.0])
        self._mu, self._sigma, self._choice = first, self._first_sigma, first
        self._flown = _Flown(np.empty((0, 4)), np.empty((0, len(emulator.USED))), np.empty(0, bool), np.empty((0, 2)))
        self.margin_rate = 0.0
        self._improve()

    @property
    def theta(self) -> FloatArray:
        """The policy that is flown next, and recommended: all numbers of its form."""
        whole = self._begin.copy()
        whole[self.general.searched] = self._choice
        return whole

    def expected_rate(self) -> float:
        """Landing rate that is expected of it over the region."""
        return float(every.rate(self._belief, self._form, self._choice[None], self.flight.box)[0])

    def tell(self, speed_mps: float, angle_deg: float, features: FloatArray, landed: bool) -> None:
        """Learn from a flight of `theta`.

        Args:
            speed_mps: Approach speed.
            angle_deg: Approach angle.
            features: What it recorded, shape (`ivl.belief.recording.N`,).
            landed: Whether three or four legs hold.
        """
        here = linear(self.general, np.array([[speed_mps, angle_deg]]))
        theta = here.flights(self._choice[None], float(self.flight.bounds[1, 1]))[0]
        flown = self._flown
        flown.theta = np.vstack([flown.theta, theta])
        flown.features = np.vstack([flown.features, emulator.used(features)])
        flown.conditions = np.vstack([flown.conditions, features[recording.CONDITIONS]])
        flown.landed = np.append(flown.landed, landed)
        self._belief.update(Evidence(flown.theta, flown.features, flown.landed, flown.conditions))
        self._improve()

    def _improve(self) -> None:
        """EPHE over imagined flights, and the choice among where it goes and what there is."""
        box = self.flight.box
        sigma = np.maximum(self._sigma, _AGAIN * self._first_sigma)
        mu, sigma = imagine(
            every.imagined(self._belief, self._form, box, self._rng), self._mu, sigma, self._bounds, self._rng,
            _POLICIES, _UPDATES, _SHRINK, _FLOOR * self._first_sigma,
        )  # fmt: skip
        candidates = np.array([self._begin[self.general.searched], self._choice, mu])
        rates = every.margin_rate(self._belief, self._form, candidates, box)
        best = int(rates.argmax())
        self._choice, self.margin_rate = candidates[best], float(rates[best])
        self._mu, self._sigma = (mu, sigma) if best == len(candidates) - 1 else (self._choice, sigma)


def fly(
    world: World, adaptation: Adaptation, speed_mps: float, angle_deg: float, seed: int, stream: int
) -> tuple[FloatArray, Outcomes]:
    """Fly one simulated landing of the present policy, whatever its go / no-go says, and record it.

    Returns:
        Features, shape (`ivl.belief.recording.N`,), and the outcome, shape (1,).
    """
    general = adaptation.general
    flight = Flight(speed_mps, angle_deg, general.form.name, adaptation.flight.start, np.empty((general.form.n, 2)))
    return recording.simulated(world, flight, general.always_go(adaptation.theta), seed, stream)


def landed(outcome: Outcomes) -> bool:
    """Whether three or four legs hold."""
    return bool(four_leg(outcome)[0])
