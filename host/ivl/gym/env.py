"""One landing an episode."""

from collections import deque
from typing import Any

import gymnasium
import numpy as np

from ivl.api.learning import RewardLike, Source
from ivl.errors import ConfigError
from ivl.gym.landings import NEVER_S, Approach, Draw, FloatArray, Landings, Range

_AHEAD = 8
"""Approaches flown at a time: as many as the widest register has lanes."""
_OPTIONS = ("speed_mps", "angle_deg")


class LandingEnv(gymnasium.Env[FloatArray, FloatArray]):
    """See `ivl.gym` for observation, action and reward."""

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012 - as in the base class

    def __init__(
        self,
        task: Source = "paper_vertical",
        speed_mps: Range | None = None,
        angle_deg: Range | None = None,
        reward: RewardLike | None = None,
        period_s: float = 0.01,
        render_mode: None = None,
    ) -> None:
        """Read the task.

        Args:
            task: What is flown, as for `ivl.learn`; its learner, budget and bounds of the threshold do not matter.
            speed_mps: Approach speed, m/s, or the range from which each episode draws one; omitted: the task's.
            angle_deg: Approach angle, degrees, likewise.
            reward: As for `ivl.learn`.
            period_s: Time between two decisions, s.
            render_mode: There is none; `ivl rollout --plot` draws a landing.

        Raises:
            ConfigError: The task or a value is wrong.
        """
        self.render_mode = render_mode
        self.landings = Landings(task, speed_mps, angle_deg, reward, period_s, threads=1)
        self.observation_space = self.landings.observation_space
        self.action_space = self.landings.action_space
        self._ahead: deque[Approach] = deque()
        self._approach: Approach | None = None
        self._i = 0

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[FloatArray, dict[str, Any]]:
        """Begin an approach; `options` may say its `speed_mps` and `angle_deg`."""
        super().reset(seed=seed)
        if seed is not None:
            self._ahead.clear()
        if options:
            self._approach = self._as_asked(options)
        else:
            if not self._ahead:
                self._ahead.extend(self.landings.fly([self.landings.draw(self.np_random) for _ in range(_AHEAD)]))
            self._approach = self._ahead.popleft()
        self._i = 0
        return self._approach.seen[0].copy(), {}

    def step(self, action: FloatArray) -> tuple[FloatArray, float, bool, bool, dict[str, Any]]:
        """Flip, or go on for a period."""
        approach, i = self._approach, self._i
        if approach is None:
            raise ConfigError("step: the episode is over, or has not begun: call reset")
        flips = bool(action[0] > 0.0)
        if not flips and i + 1 < len(approach.t_s):
            self._i += 1
            return approach.seen[i + 1].copy(), 0.0, False, False, {}
        self._approach = None
        at_s = float(approach.t_s[i]) if flips else NEVER_S
        returns, (info,) = self.landings.end([approach.draw], [at_s], np.array([action[1]], dtype=np.float64))
        return approach.seen[i].copy(), float(returns[0]), True, False, info

    def _as_asked(self, options: dict[str, Any]) -> Approach:
        """An approach whose speed or angle was asked for."""
        unknown = [name for name in options if name not in _OPTIONS]
        if unknown:
            raise ConfigError(f"reset: options: no option {unknown[0]!r} (allowed {', '.join(_OPTIONS)})")
        drawn = self.landings.draw(self.np_random)
        asked = Draw(
            float(options.get("speed_mps", drawn.speed_mps)),
            float(options.get("angle_deg", drawn.angle_deg)),
            drawn.seed,
        )
        return self.landings.fly([asked])[0]
