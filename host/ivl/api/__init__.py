"""What a notebook needs: learn, sweep, and read what was flown, as data frames.

    import ivl

    run = ivl.learn("paper_vertical", learner="ephe", n_rollouts=4, budget=32, out="runs/mine")
    run.trials()                                # one row for each trial: what it found, and how good that is
    run.rollouts().groupby("episode").reward.mean()
    run = ivl.load("runs/mine")                 # the same, later

Everything here is a thin layer over the modules that the command line uses, and gives the same bits.
"""

from ivl.api.learning import learn
from ivl.api.runs import LearnRun, MapRun, SweepRun, load
from ivl.api.sweeping import sweep

__all__ = ["LearnRun", "MapRun", "SweepRun", "learn", "load", "sweep"]
