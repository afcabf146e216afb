"""A sampler of Optuna as a learner: TPE, or a subclass with another one.

class Gp(Tpe):
    def sampler(self) -> Any:
        return optuna.samplers.GPSampler(seed=self.seed % 2**32)
"""

from typing import Any, ClassVar

import numpy as np
from pydantic import Field

from ivl.adapters.replayed import Optimiser, Replayed
from ivl.learners.base import FloatArray, Options
from ivl.optional import needed


class TpeOptions(Options):
    """Options of the sampler."""

    n_startup_trials: int = Field(default=16, ge=1, description="policies drawn at random before the model is used")


class Tpe(Replayed):
    """Optuna's tree of Parzen estimators; the start of the search is the first policy."""

    Options: ClassVar[type[Options]] = TpeOptions
    options: TpeOptions

    def sampler(self) -> Any:
        """The sampler: any of `optuna.samplers` that a seed determines."""
        samplers = needed("optuna", "optimisers").samplers
        return samplers.TPESampler(seed=self.seed % 2**32, n_startup_trials=self.options.n_startup_trials)

    def make(self) -> Optimiser:
        """A new study, in memory."""
        return _Study(self)


class _Study:
    """A study whose trials are rollouts."""

    def __init__(self, learner: Tpe) -> None:
        self._optuna = needed("optuna", "optimisers")
        self._optuna.logging.set_verbosity(self._optuna.logging.WARNING)
        self._names = [f"theta_{i}" for i in range(learner.dim)]
        float_of = self._optuna.distributions.FloatDistribution
        self._space = {
            name: float_of(float(lo), float(hi))
            for name, lo, hi in zip(self._names, learner.lo, learner.hi, strict=True)
        }
        self._study: Any = self._optuna.create_study(direction="maximize", sampler=learner.sampler())
        self._study.enqueue_trial(dict(zip(self._names, learner.mu0.tolist(), strict=True)))
        self._pending: dict[bytes, Any] = {}

    def ask(self, n: int) -> FloatArray:
        """Begin trials; those of the last call that have no return are failed ones, which the sampler leaves out."""
        for trial in self._pending.values():
            self._study.tell(trial, state=self._optuna.trial.TrialState.FAIL)
        trials = [self._study.ask(self._space) for _ in range(n)]
        theta: FloatArray = np.array([[trial.params[name] for name in self._names] for trial in trials])
        self._pending = {row.tobytes(): trial for row, trial in zip(theta, trials, strict=True)}
        return theta

    def tell(self, theta: FloatArray, returns: FloatArray) -> None:
        """End trials; a policy that was not asked for is added as a trial of its own."""
        for row, value in zip(theta, returns.tolist(), strict=True):
            trial = self._pending.pop(row.tobytes(), None)
            if trial is not None:
                self._study.tell(trial, value)
                continue
            params = dict(zip(self._names, row.tolist(), strict=True))
            added = self._optuna.trial.create_trial(params=params, distributions=self._space, value=value)
            self._study.add_trial(added)
