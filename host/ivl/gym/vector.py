"""Many landings at a time, in the lanes of the simulator.

An environment that has ended begins anew in the next step, whose action it ignores: the mode that Gymnasium calls
NEXT_STEP, and its default.
"""

from collections import deque
from typing import Any

import gymnasium
import numpy as np
import numpy.typing as npt
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from ivl.api.learning import RewardLike, Source
from ivl.errors import ConfigError
from ivl.gym.landings import N_SEEN, NEVER_S, Approach, FloatArray, Landings, Range

_AHEAD = 8

BoolArray = npt.NDArray[np.bool_]
Step = tuple[FloatArray, npt.NDArray[Any], npt.NDArray[Any], npt.NDArray[Any], dict[str, Any]]


class LandingVectorEnv(VectorEnv[FloatArray, FloatArray, npt.NDArray[Any]]):
    """See `ivl.gym`. Environment i behaves as a `LandingEnv` whose seed is the seed + i."""

    metadata: dict[str, Any] = {  # noqa: RUF012 - as in the base class
        "render_modes": [],
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }

    def __init__(
        self,
        num_envs: int = 64,
        task: Source = "paper_vertical",
        speed_mps: Range | None = None,
        angle_deg: Range | None = None,
        reward: RewardLike | None = None,
        period_s: float = 0.01,
        threads: int = 1,
        render_mode: None = None,
    ) -> None:
        """Read the task.

        Args:
            num_envs: Landings at a time.
            task: As for `LandingEnv`, and so are speed_mps, angle_deg, reward, period_s and render_mode.
            speed_mps: Likewise.
            angle_deg: Likewise.
            reward: Likewise.
            period_s: Likewise.
            threads: Worker threads of the simulator; the bits do not depend on it.
            render_mode: Likewise.

        Raises:
            ConfigError: The task or a value is wrong.
        """
        self.num_envs, self.render_mode = num_envs, render_mode
        self.landings = Landings(task, speed_mps, angle_deg, reward, period_s, threads)
        self.single_observation_space = self.landings.observation_space
        self.single_action_space = self.landings.action_space
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._rng = [np.random.Generator(np.random.PCG64()) for _ in range(num_envs)]
        self._ahead: list[deque[Approach]] = [deque() for _ in range(num_envs)]
        self._now: list[Approach | None] = [None] * num_envs
        self._i = np.zeros(num_envs, dtype=np.intp)
        self._over = np.zeros(num_envs, dtype=np.bool_)

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[FloatArray, dict[str, Any]]:
        """Begin all approaches.

        Raises:
            ConfigError: Options were given, of which there are none.
        """
        if options:
            raise ConfigError(f"reset: options: there are none here ({', '.join(options)}); LandingEnv has some")
        seeds = (
            [None if seed is None else seed + i for i in range(self.num_envs)] if not isinstance(seed, list) else seed
        )
        for i, own in enumerate(seeds):
            if own is not None:
                self._rng[i], _ = gymnasium.utils.seeding.np_random(own)
                self._ahead[i].clear()
        self._begin(np.ones(self.num_envs, dtype=np.bool_))
        self._over[:] = False
        return self._seen(), {}

    def step(self, actions: FloatArray) -> Step:
        """Flip, go on for a period, or begin anew."""
        actions = np.asarray(actions)
        flips = (actions[:, 0] > 0.0) & ~self._over
        at_end = np.array([now is None or i + 1 >= len(now.t_s) for now, i in zip(self._now, self._i, strict=True)])
        ends, begins = (flips | at_end) & ~self._over, self._over.copy()
        returns = np.zeros(self.num_envs)
        infos: dict[str, Any] = {}
        if ends.any():
            returns[ends], infos = self._end(np.flatnonzero(ends), flips, actions)
        self._i[~ends & ~begins] += 1
        if begins.any():
            self._begin(begins)
        self._over = ends
        return self._seen(), returns, ends.copy(), np.zeros(self.num_envs, dtype=np.bool_), infos

    def _end(
        self, which: npt.NDArray[np.intp], flips: BoolArray, actions: FloatArray
    ) -> tuple[npt.NDArray[np.float64], dict[str, Any]]:
        """Land those whose episode ends."""
        own = [self._of(i) for i in which.tolist()]
        at_s = [float(now.t_s[self._i[i]]) if flips[i] else NEVER_S for i, now in zip(which.tolist(), own, strict=True)]
        moment = actions[which, 1].astype(np.float64)
        returns, found = self.landings.end([now.draw for now in own], at_s, moment)
        infos: dict[str, Any] = {}
        for i, info in zip(which.tolist(), found, strict=True):
            infos = self._add_info(infos, info, i)
        return returns, infos

    def _begin(self, which: BoolArray) -> None:
        """Give each of them its next approach; if one has none left, all are flown that will be needed soon."""
        if any(not self._ahead[i] for i in np.flatnonzero(which)):
            short = [i for i in range(self.num_envs) if len(self._ahead[i]) <= _AHEAD // 2]
            draws = [self.landings.draw(self._rng[i]) for i in short for _ in range(_AHEAD)]
            flown = iter(self.landings.fly(draws))
            for i in short:
                self._ahead[i].extend(next(flown) for _ in range(_AHEAD))
        for i in np.flatnonzero(which).tolist():
            self._now[i], self._i[i] = self._ahead[i].popleft(), 0

    def _of(self, i: int) -> Approach:
        now = self._now[i]
        if now is None:
            raise ConfigError("step: the episodes have not begun: call reset")
        return now

    def _seen(self) -> FloatArray:
        found = np.zeros((self.num_envs, N_SEEN), dtype=np.float32)
        for i, place in enumerate(self._i.tolist()):
            found[i] = self._of(i).seen[place]
        return found
