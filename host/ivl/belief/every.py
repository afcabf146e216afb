"""Policies for every approach over a belief: what they decide at each approach is a flight of the paper's form.

A policy's numbers c are those of its threshold and its moment. At an approach with the speeds (v_x, v_z) it flips at
the threshold R*(v_x, v_z; c) with the moment M(v_x, v_z; c), so that one emulator, whose flights differ in threshold,
moment, speed and angle, serves policies of every form whose threshold is linear in its numbers.

The landing rate of a policy is its mean over approaches that are spread evenly over a region, over the belief, and,
with margin, over a trigger up to 10 ms early or late and a moment up to 10 % smaller or larger (`ivl.belief.decide`).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.stats import qmc  # type: ignore[import-untyped]

from ivl.belief import decide
from ivl.belief.posterior import Belief

FloatArray = npt.NDArray[np.float64]

N_APPROACHES = 128
_SHOTS = 32
"""Imagined flights of a policy in an update, each at one approach with one particle, one timing and one moment."""


@dataclass(frozen=True)
class Linear:
    """The threshold and the moment of a form for every approach at some approaches, as its numbers change them.

    Attributes:
        approaches: Speed (m/s) and angle (degrees), shape (n, 2).
        base_per_s: Threshold of the numbers 0, shape (n,).
        threshold: What each number adds to it, shape (n, dim).
        moment: What each number adds to the moment in N mm, shape (n, dim).
        limits_per_s: Least and largest threshold.
    """

    approaches: FloatArray
    base_per_s: FloatArray
    threshold: FloatArray
    moment: FloatArray
    limits_per_s: tuple[float, float]

    def flights(self, theta: FloatArray, moment_Nmm_max: float) -> FloatArray:
        """Numbers of the flights of policies, shape (m, dim), at all approaches: shape (m, n, 4)."""
        rrev = np.clip(self.base_per_s + theta @ self.threshold.T, *self.limits_per_s)
        moment = np.clip(theta @ self.moment.T, 0.0, moment_Nmm_max)
        own = np.broadcast_to(self.approaches, (*rrev.shape, 2))
        return np.concatenate([np.stack([rrev, moment], axis=-1), own], axis=-1)

    def of(self, chosen: npt.NDArray[np.intp]) -> "Linear":
        """The same at some of the approaches."""
        return Linear(
            self.approaches[chosen],
            self.base_per_s[chosen],
            self.threshold[chosen],
            self.moment[chosen],
            self.limits_per_s,
        )


def spread(box: FloatArray, n: int = N_APPROACHES) -> FloatArray:
    """Approaches that fill a box of speed and angle, shape (2, 2), evenly: shape (n, 2)."""
    points = qmc.Sobol(2, scramble=False).random(n)
    return np.asarray(box[:, 0] + points * (box[:, 1] - box[:, 0]))


def margin_rate(belief: Belief, form: Linear, theta: FloatArray, box: FloatArray) -> FloatArray:
    """Margin rate of policies, shape (m, dim), over the approaches of `form`; `box` bounds flights, shape (4, 2)."""
    flights = form.flights(theta, float(box[1, 1]))
    points, weights = decide.around(flights[..., :2], box[:2])
    whole = np.concatenate([points, np.broadcast_to(flights[..., 2:], (*points.shape[:-1], 2))], axis=-1)
    rates = belief.rates(whole.reshape(-1, 4)).mean(axis=0).reshape(whole.shape[:-1])
    return np.asarray(np.tensordot(weights, rates, axes=1).mean(axis=-1))


def rate(belief: Belief, form: Linear, theta: FloatArray, box: FloatArray) -> FloatArray:
    """Landing rate of policies, without margin; otherwise as `margin_rate`."""
    flights = form.flights(theta, float(box[1, 1]))
    return np.asarray(belief.rates(flights.reshape(-1, 4)).mean(axis=0).reshape(flights.shape[:-1]).mean(axis=-1))


def imagined(
    belief: Belief, form: Linear, box: FloatArray, rng: np.random.Generator
) -> Callable[[FloatArray], FloatArray]:
    """Returns of policies, shape (m, dim): means over imagined flights, as in `ivl.belief.decide.imagined`.

    All policies meet the same approaches, so that they differ in what they are and not in their luck.
    """

    def reward(theta: FloatArray) -> FloatArray:
        at = rng.integers(len(form.approaches), size=_SHOTS)
        flights = form.of(at).flights(theta, float(box[1, 1]))
        late = rng.uniform(-decide.TIMING_S, decide.TIMING_S, len(at))
        moment = rng.uniform(-decide.MOMENT, decide.MOMENT, len(at))
        flown = decide.perturbed(flights[..., :2], late, moment, box[:2])
        whole = np.concatenate([flown, flights[..., 2:]], axis=-1)
        return np.asarray(belief.rate_of_one(whole.reshape(-1, 4)).reshape(len(theta), -1).mean(axis=1))

    return reward
