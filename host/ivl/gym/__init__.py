"""Landings as environments of Gymnasium.

    import gymnasium, ivl.gym

    env = gymnasium.make("ivl/InvertedLanding-v0", task="paper_vertical")
    envs = gymnasium.make_vec("ivl/InvertedLanding-v0", num_envs=64)    # flown in the lanes of the simulator

One landing is an episode. The vehicle approaches the ceiling; every 10 ms the agent sees what the vehicle senses, and
says whether to flip now and with which moment. A flip, or the contact that comes without one, ends the episode.

*Observation*, float32: RREV (1/s), OF_y (rad/s), distance to the ceiling (m) and its standard deviation (m), all as the
flight core has them, and whether it has a distance at all (0 or 1).

*Action*, float32 in -1 .. 1: flip now if the first number is above 0; moment, from nothing at -1 to the task's largest
at 1.

*Reward*: 0 until the end, then the return of the landing by the task's reward. `info` of the last step has `landed`,
`clean`, `n_legs`, `end_reason`, and the `speed_mps` and `angle_deg` of the approach.
"""

from ivl.optional import needed

needed("gymnasium", "gym")

import gymnasium  # noqa: E402 - after the hint of what installs it

from ivl.gym.env import LandingEnv  # noqa: E402
from ivl.gym.vector import LandingVectorEnv  # noqa: E402

__all__ = ["ENV_ID", "LandingEnv", "LandingVectorEnv"]

ENV_ID = "ivl/InvertedLanding-v0"

if ENV_ID not in gymnasium.registry:
    gymnasium.register(id=ENV_ID, entry_point="ivl.gym:LandingEnv", vector_entry_point="ivl.gym:LandingVectorEnv")
