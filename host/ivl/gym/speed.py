"""How many steps and landings a second the vector form makes, beside `World.rollouts` on the same approach."""

import time
from typing import Any

import numpy as np

from ivl.gym.vector import LandingVectorEnv

_TASK = "paper_vertical"
_N_STEPS = 300
_P_FLIP = 0.02  # of each decision, so that episodes are as long as those of an agent that explores


def measure(n_envs: int, n_steps: int = _N_STEPS) -> dict[str, Any]:
    """Rates of agents that flip at random, per second of processor time, on one thread; best of three passes."""
    envs = LandingVectorEnv(n_envs, _TASK, threads=1)
    rng = np.random.default_rng(0)
    best_s, n_ended = np.inf, 0
    for _ in range(3):
        envs.reset(seed=1)
        ended, began = 0, time.process_time()
        for _ in range(n_steps):
            actions = rng.uniform(-1.0, 1.0, (n_envs, 2)).astype(np.float32)
            actions[:, 0] -= 1.0 - 2.0 * _P_FLIP
            ended += int(envs.step(actions)[2].sum())
        taken_s = time.process_time() - began
        if taken_s < best_s:
            best_s, n_ended = taken_s, ended
    return {
        f"gym_steps_per_s_{n_envs}": n_envs * n_steps / best_s,
        f"gym_landings_per_s_{n_envs}": n_ended / best_s,
    }
