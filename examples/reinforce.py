"""An agent that learns to land by policy gradient, in one file and with numpy alone.

    .venv/bin/python examples/reinforce.py                        # about a minute on one core
    .venv/bin/python examples/reinforce.py --episodes 512         # a first look
    .venv/bin/python examples/reinforce.py --task paper_flight

At each decision the agent sees RREV. It flips with a probability that is a logistic function of it, and draws the
moment from a normal distribution. The return of a landing, less the mean of its batch, is what each of its decisions
gets. Needs pip install 'ivl[gym]'.
"""

import argparse
from dataclasses import dataclass, field

import gymnasium
import numpy as np

import ivl.gym  # noqa: F401 - registers the environment

SCALE = 3.0  # of RREV, so that the numbers of the policy are of the order of one
SPREAD = 0.15  # of the moment, in the units of an action
RATE = 0.08  # of Adam


def new_parameters() -> np.ndarray:
    """Threshold and steepness of the flip, moment: an agent that flips somewhere, with a middling moment."""
    return np.array([1.2, 2.0, 0.0])


@dataclass
class Adam:
    """Adam's ascent."""

    mean: np.ndarray = field(default_factory=lambda: np.zeros(3))
    square: np.ndarray = field(default_factory=lambda: np.zeros(3))
    n: int = 0

    def step(self, gradient: np.ndarray) -> np.ndarray:
        """The change that a gradient asks for."""
        self.n += 1
        self.mean = 0.9 * self.mean + 0.1 * gradient
        self.square = 0.99 * self.square + 0.01 * gradient**2
        return RATE * (self.mean / (1 - 0.9**self.n)) / (np.sqrt(self.square / (1 - 0.99**self.n)) + 1e-8)


def decide(parameters: np.ndarray, seen: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Actions, shape (n, 2), and gradients of their log-probabilities, shape (n, 3)."""
    threshold, steepness, moment = parameters
    over = seen[:, 0] / SCALE - threshold
    p_flip = 1.0 / (1.0 + np.exp(-np.clip(4.0 * steepness * over, -30.0, 30.0)))
    p_flip = np.clip(p_flip, 1e-6, 1 - 1e-6)
    flips = rng.random(len(seen)) < p_flip
    drawn = moment + SPREAD * rng.standard_normal(len(seen))
    error = flips - p_flip
    gradient = np.stack([-4.0 * steepness * error, 4.0 * over * error, flips * (drawn - moment) / SPREAD**2], axis=1)
    return np.stack([np.where(flips, 1.0, -1.0), drawn], axis=1).astype(np.float32), gradient


def episodes(
    envs: gymnasium.vector.VectorEnv, parameters: np.ndarray, n: int, seed: int | None, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Returns, gradients and landings of n episodes, one or more of each environment."""
    seen, _ = envs.reset(seed=seed)
    running = np.zeros((envs.num_envs, 3))
    returns, gradients, landed = [], [], []
    begins = np.zeros(envs.num_envs, dtype=bool)
    while len(returns) < n:
        actions, gradient = decide(parameters, seen, rng)
        running += np.where(begins[:, None], 0.0, gradient)  # the step after an end only begins the next episode
        seen, rewards, ends, _, infos = envs.step(actions)
        for i in np.flatnonzero(ends):
            returns.append(rewards[i])
            gradients.append(running[i].copy())
            landed.append(infos["landed"][i])
            running[i] = 0.0
        begins = ends
    return np.array(returns), np.array(gradients), np.array(landed)


def learn(task: str, n_episodes: int, seed: int, batch: int = 64) -> list[float]:
    """Landing rate of each batch."""
    envs = gymnasium.make_vec("ivl/InvertedLanding-v0", num_envs=batch, task=task)
    rng, parameters, adam, rates = np.random.default_rng(seed), new_parameters(), Adam(), []
    for number in range(n_episodes // batch):
        returns, gradients, landed = episodes(envs, parameters, batch, None if number else seed, rng)
        advantage = (returns - returns.mean()) / (returns.std() + 1e-8)
        parameters = parameters + adam.step((advantage[:, None] * gradients).mean(axis=0))
        rates.append(float(landed.mean()))
        threshold, _, moment = parameters
        print(
            f"{(number + 1) * batch:6d} episodes: landed {100 * landed.mean():5.1f} %, return {returns.mean():6.1f}, "
            f"flips near RREV {SCALE * threshold:4.2f} 1/s, moment {moment:+.2f}"
        )
    return rates


def main() -> None:
    """Learn, and say how it went."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--task", default="paper_vertical", help="shipped experiment, or a file")
    parser.add_argument("--episodes", type=int, default=4096)
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    rates = learn(args.task, args.episodes, args.seed)
    print(f"landed: first tenth {100 * np.mean(rates[: max(1, len(rates) // 10)]):.0f} %, "
          f"last tenth {100 * np.mean(rates[-max(1, len(rates) // 10):]):.0f} %")  # fmt: skip


if __name__ == "__main__":
    main()
