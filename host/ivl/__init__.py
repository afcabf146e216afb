"""Inverted landing: learn to land a small multicopter on a ceiling, in simulation and on the vehicle.

import ivl

world = ivl.World(vehicle="habas2021", gear="wide_long", gear_set="as_simulated")
out = world.rollouts(2.5, 90.0, 4.8, 8.0)              # one landing, or many: the arguments broadcast
run = ivl.learn("paper_vertical", learner="ephe")      # what `ivl learn` does
run.rollouts()                                         # a data frame; also .episodes(), .trials()
run = ivl.load("runs/paper_vertical-ephe-seed0")       # the same, later
ivl.sweep("smoke", vary={"sense.latency": [0.0, 0.02]})
"""

import os
from typing import TYPE_CHECKING

from ivl import memory  # noqa: F401 - looks at the limits of this process before anything large is loaded

# The matrices here are small: more BLAS threads only cost time, and their number changes the last bits of a search.
# It has to be said before numpy is loaded; a caller who has said otherwise is respected.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from ivl.api import LearnRun, MapRun, SweepRun, learn, load
from ivl.errors import (
    ArgumentError,
    ConfigError,
    IvlError,
    LearnerError,
    MissingError,
    NativeError,
    RolloutError,
    StoreError,
)
from ivl.experiment import Experiment
from ivl.learners import EPHE, Learner, RobustEPHE, make_learner
from ivl.outcome import clean, four_leg
from ivl.quantity import Quantity
from ivl.rewards import Options as RewardOptions
from ivl.rewards import Reward
from ivl.table import Rollouts
from ivl.task import Task
from ivl.world import State, Trace, World

if TYPE_CHECKING:
    from ivl.api import sweep
else:
    from ivl import sweep  # can be called

__all__ = [
    "EPHE",
    "ArgumentError",
    "ConfigError",
    "Experiment",
    "IvlError",
    "LearnRun",
    "Learner",
    "LearnerError",
    "MapRun",
    "MissingError",
    "NativeError",
    "Quantity",
    "Reward",
    "RewardOptions",
    "RobustEPHE",
    "RolloutError",
    "Rollouts",
    "State",
    "StoreError",
    "SweepRun",
    "Task",
    "Trace",
    "World",
    "__version__",
    "clean",
    "four_leg",
    "learn",
    "load",
    "make_learner",
    "sweep",
]
__version__ = "0.1.0"
