"""Inverted landing: learn to land a small multicopter on a ceiling, in simulation and on the vehicle.

import ivl
world = ivl.World(vehicle="habas2021", gear="wide_long", gear_set="as_simulated")
out = world.rollouts(2.5, 90.0, 4.8, 8.0)
"""

import os

# The matrices here are small: more BLAS threads only cost time, and their number changes the last bits of a search.
# It has to be said before numpy is loaded; a caller who has said otherwise is respected.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from ivl.errors import ArgumentError, ConfigError, IvlError, LearnerError, NativeError, RolloutError, StoreError
from ivl.experiment import Experiment
from ivl.learners import EPHE, Learner, RobustEPHE, make_learner
from ivl.outcome import clean, four_leg
from ivl.world import State, Trace, World

__all__ = [
    "EPHE",
    "ArgumentError",
    "ConfigError",
    "Experiment",
    "IvlError",
    "Learner",
    "LearnerError",
    "NativeError",
    "RobustEPHE",
    "RolloutError",
    "State",
    "StoreError",
    "Trace",
    "World",
    "__version__",
    "clean",
    "four_leg",
    "make_learner",
]
__version__ = "0.1.0"
