"""What both forms of the environment share: approaches that are flown ahead of time, and landings that end them.

Until the flip, a landing does not depend on when it will flip. So an approach is flown once, to the ceiling, and its
cues are looked up; the flip is a landing with the same random numbers and the flip at its time, which is the same as a
landing whose policy flips then, bit for bit. Both are batches of the simulator.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, cast

import gymnasium
import numpy as np
import numpy.typing as npt

from ivl.api.learning import RewardLike, Source, raw, set_choices
from ivl.errors import ConfigError
from ivl.experiment import Experiment, from_data
from ivl.forms import PAPER
from ivl.native import library
from ivl.outcome import clean, four_leg
from ivl.rewards import TOTAL
from ivl.table import Rollouts
from ivl.task import check_range

FloatArray = npt.NDArray[np.float32]
Range = float | tuple[float, float]
CUES = ("rrev_per_s", "of_y_radps", "d_sensed_m", "d_sigma_m")
N_SEEN = len(CUES) + 1
_ROWS_MAX = 1024
_CONTACT = "end.contact_time"
_MARGIN_S = 0.5
NEVER_S = 60.0
"""Time of a flip that never comes."""


@dataclass(frozen=True)
class Draw:
    """What is random of an episode."""

    speed_mps: float
    angle_deg: float
    seed: int


@dataclass(frozen=True)
class Approach:
    """An approach that was flown to the ceiling.

    Attributes:
        draw: What was drawn for it.
        t_s: Times of its decisions, shape (n,).
        seen: Observations there, shape (n, N_SEEN).
    """

    draw: Draw
    t_s: npt.NDArray[np.float64]
    seen: FloatArray


class Landings:
    """A task whose approaches and landings are flown in batches."""

    def __init__(
        self,
        task: Source,
        speed_mps: Range | None,
        angle_deg: Range | None,
        reward: RewardLike | None,
        period_s: float,
        threads: int,
    ) -> None:
        """Read the task (arguments and errors as `LandingEnv`)."""
        data, label = raw(task)
        set_choices(data, None, reward)
        self.experiment: Experiment = from_data(data, label)
        if self.experiment.policy.form != PAPER:
            raise ConfigError(f"{label}: policy.form: an agent takes the place of the form {PAPER} alone")
        self._speed = _range("speed_mps", self.experiment.speed_mps if speed_mps is None else speed_mps)
        self._angle = _range("angle_deg", self.experiment.angle_deg if angle_deg is None else angle_deg)
        self._period_s, self._threads = period_s, threads
        self._world = self.experiment.make_world()
        shortest_s = library().params[_CONTACT].lo
        self._approaching = self._world.changed(**{_CONTACT: shortest_s})  # nothing is told of what follows a contact
        self._moment = self.experiment.policy.parameters[-1].bounds

    @property
    def observation_space(self) -> gymnasium.Space[FloatArray]:
        """What an agent sees."""
        fields = library().trace_fields
        lo = [*(fields[name].lo for name in CUES), 0.0]
        hi = [*(fields[name].hi for name in CUES), 1.0]
        return _box(np.array(lo, np.float32), np.array(hi, np.float32))

    @property
    def action_space(self) -> gymnasium.Space[FloatArray]:
        """What an agent says."""
        return _box(np.full(2, -1.0, np.float32), np.full(2, 1.0, np.float32))

    def draw(self, rng: np.random.Generator) -> Draw:
        """An episode, by three random numbers."""
        speed, angle = rng.uniform(*self._speed), rng.uniform(*self._angle)
        return Draw(float(speed), float(angle), int(rng.integers(2**63)))

    def fly(self, draws: Sequence[Draw]) -> list[Approach]:
        """Fly approaches, several at a time."""
        if not draws:
            return []
        slowest = min(draw.speed_mps * max(np.sin(np.deg2rad(draw.angle_deg)), 0.05) for draw in draws)
        n_rows = min(_ROWS_MAX, int((self._longest_s(slowest) + _MARGIN_S) / self._period_s))
        rows = self._approaching.approaches(
            *_columns(draws), n_rows=n_rows, period_s=self._period_s, seed=_seeds(draws), stream=0,
            start=self.experiment.start, threads=self._threads,
        )  # fmt: skip
        return [self._approach(draw, own) for draw, own in zip(draws, rows, strict=True)]

    def end(
        self, draws: Sequence[Draw], flip_at_s: Sequence[float], moment: npt.NDArray[np.float64]
    ) -> tuple[npt.NDArray[np.float64], list[dict[str, Any]]]:
        """Returns and infos of landings; a flip at a time that the approach does not reach is none.

        Args:
            draws: What was drawn for the approaches.
            flip_at_s: Times of the flips.
            moment: In -1 .. 1 as an agent says it, shape (n,).
        """
        lo, hi = self._moment
        moment_y_Nmm = lo + (np.clip(moment, -1.0, 1.0) + 1.0) / 2.0 * (hi - lo)
        out = self._world.rollouts(
            *_columns(draws), 0.0, moment_y_Nmm, seed=_seeds(draws), stream=0, start=self.experiment.start,
            flip_at_s=np.array(flip_at_s), threads=self._threads,
        )  # fmt: skip
        returns = self.experiment.reward.score(out)[TOTAL]
        return returns, [self._info(draw, out, i) for i, draw in enumerate(draws)]

    def _longest_s(self, climb_mps: float) -> float:
        """Time that an approach takes at most: RREV is 1/s at the start, or there is a hover and an acceleration."""
        return 2.0 if self.experiment.start == "imparted" else 4.0 + 4.0 / climb_mps

    def _approach(self, draw: Draw, rows: Any) -> Approach:
        good = np.isfinite(rows["t_s"])
        good[0] = False  # nothing is sensed before the first tick
        seen = np.stack([rows[name][good] for name in CUES] + [rows["d_sensed_m"][good] > 0], axis=1)
        return Approach(draw, np.asarray(rows["t_s"][good]), seen.astype(np.float32))

    def _info(self, draw: Draw, out: Rollouts, i: int) -> dict[str, Any]:
        one = out[i : i + 1]
        return {
            "landed": bool(four_leg(one)[0]),
            "clean": bool(clean(one)[0]),
            "n_legs": int(one.n_legs[0]),
            "end_reason": self._world.end_reason(int(one.end_reason[0])),
            "speed_mps": draw.speed_mps,
            "angle_deg": draw.angle_deg,
        }


def _box(lo: FloatArray, hi: FloatArray) -> gymnasium.Space[FloatArray]:
    """A box of single precision, which Gymnasium does not tell the type of."""
    return cast("gymnasium.Space[FloatArray]", gymnasium.spaces.Box(lo, hi, dtype=np.float32))


def _range(name: str, given: Range) -> tuple[float, float]:
    """Least and largest value of a number that is drawn.

    Raises:
        ConfigError: They are out of range, or not in order.
    """
    lo, hi = given if isinstance(given, (tuple, list)) else (given, given)
    try:
        for value in (lo, hi):
            check_range(name, float(value), f"{name}: value")
    except ValueError as error:
        raise ConfigError(str(error)) from error
    if lo > hi:
        raise ConfigError(f"{name}: {lo:g} .. {hi:g} is not in order")
    return float(lo), float(hi)


def _columns(draws: Sequence[Draw]) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    return np.array([draw.speed_mps for draw in draws]), np.array([draw.angle_deg for draw in draws])


def _seeds(draws: Sequence[Draw]) -> npt.NDArray[np.uint64]:
    return np.array([draw.seed for draw in draws], dtype=np.uint64)
