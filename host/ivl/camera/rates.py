"""How often a landing succeeds with pictures, and with their noise model."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ivl.outcome import four_leg
from ivl.world import World

THRESHOLDS_PER_S = np.round(np.arange(3.0, 6.51, 0.05), 2)
MOMENTS_NMM = np.array([7.0, 8.0, 9.0, 10.0, 10.65])
_CHOOSING = 100  # landings of each policy of the grid


@dataclass(frozen=True)
class Rates:
    """Landing rates of one policy.

    Attributes:
        rrev_c_per_s: Its threshold.
        moment_Nmm: Its moment.
        pictures: Share of landings on four feet with pictures.
        model: The same with the noise model.
        rollouts: Landings of each.
    """

    rrev_c_per_s: float
    moment_Nmm: float
    pictures: float
    model: float
    rollouts: int


def choose(world: World, speed_mps: float, angle_deg: float, seed: int = 0) -> tuple[float, float]:
    """The best policy of a grid: of those within a point of the best, the middle one of the best moment."""
    shape = (len(MOMENTS_NMM), len(THRESHOLDS_PER_S), _CHOOSING)
    rrev, moment = THRESHOLDS_PER_S[None, :, None], MOMENTS_NMM[:, None, None]
    stream = np.broadcast_to(np.arange(_CHOOSING), shape)
    out = world.rollouts(speed_mps, angle_deg, rrev, moment, seed=seed, start="flown", stream=stream)
    rate: npt.NDArray[np.float64] = four_leg(out).mean(axis=2)
    good = rate >= rate.max() - 0.01
    row = int(np.argmax(good.sum(axis=1)))
    columns = np.flatnonzero(good[row])
    return float(THRESHOLDS_PER_S[columns[len(columns) // 2]]), float(MOMENTS_NMM[row])


def compare(pictures: World, model: World, speed_mps: float, angle_deg: float, n: int, seed: int) -> Rates:
    """Choose a policy with the model, and fly it with both and other random numbers.

    Args:
        pictures: World with a rendered camera.
        model: The same with the noise model.
        speed_mps: Of the approach.
        angle_deg: Likewise.
        n: Landings of each.
        seed: Of these landings; 0 is that of the choice.
    """
    rrev, moment = choose(model, speed_mps, angle_deg)
    share = [
        float(
            np.mean(four_leg(world.rollouts(speed_mps, angle_deg, np.full(n, rrev), moment, seed=seed, start="flown")))
        )
        for world in (pictures, model)
    ]
    return Rates(rrev, moment, share[0], share[1], n)
