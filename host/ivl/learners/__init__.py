"""Learners by name: one registry for the command line, the experiments and the tests.

A new learner of this package is a subclass of `Learner` and one line in `LEARNERS`. One of your own needs no line:
`module:Class` is found too (`ivl.plugins`).
"""

import inspect
from dataclasses import dataclass, field
from typing import Any

import numpy.typing as npt

from ivl.errors import ConfigError, LearnerError
from ivl.learners.base import Learner, Options, Result
from ivl.learners.bo import BOLearner
from ivl.learners.cma_learner import CMALearner
from ivl.learners.ephe import EPHE, RobustEPHE
from ivl.learners.ephe_belief import EpheBelief
from ivl.learners.ephe_memory import EpheMemory
from ivl.learners.fixed import Fixed
from ivl.plugins import Registry

__all__ = [
    "EPHE",
    "LEARNERS",
    "BOLearner",
    "CMALearner",
    "Entry",
    "EpheBelief",
    "EpheMemory",
    "Fixed",
    "Learner",
    "Options",
    "Result",
    "RobustEPHE",
    "make_learner",
]


@dataclass(frozen=True)
class Entry:
    """One line of the registry: a class, options that differ from its defaults, and what `ivl list` says."""

    cls: type[Learner]
    doc: str
    preset: dict[str, Any] = field(default_factory=dict)


def _made(name: str, found: Any) -> Entry:
    """A learner of one's own: a subclass of `Learner`, or an `Entry`.

    Raises:
        ConfigError: It is neither.
    """
    if isinstance(found, Entry):
        return found
    if not (inspect.isclass(found) and issubclass(found, Learner)):
        what = found.__name__ if inspect.isclass(found) else type(found).__name__
        raise ConfigError(f"learner {name!r}: {what} is no subclass of ivl.Learner")
    if inspect.isabstract(found):
        missing = ", ".join(sorted(found.__abstractmethods__))
        raise ConfigError(f"learner {name!r}: {found.__name__} has yet to define {missing}")
    return Entry(found, (inspect.getdoc(found) or "a learner of your own").splitlines()[0])


_OWN: dict[str, Entry] = {
    "ephe": Entry(EPHE, "EPHE as published: best 3 of N, sigma about the old mean"),
    "ephe_new": Entry(
        EPHE, "EPHE as in its first author's slides: best 3 of N, sigma about the new mean", {"sigma_ref": "new"}
    ),
    "ephe_2021": Entry(
        EPHE,
        "EPHE as in the landing paper's simulation code: best 2 of N, sigma about the old mean",
        {"n_best": 2},
    ),
    "ephe_robust": Entry(RobustEPHE, "EPHE with above-mean weights and a limit on how fast sigma may shrink"),
    "ephe_belief": Entry(EpheBelief, "EPHE on a belief over simulated vehicles: the first flights land"),
    "ephe_memory": Entry(EpheMemory, "EPHE on rollouts imagined from a memory of all that was flown"),
    "cmaes": Entry(CMALearner, "CMA-ES of the cmaes package"),
    "cmaes_lr": Entry(CMALearner, "CMA-ES of the cmaes package with learning-rate adaptation", {"lr_adapt": True}),
    "fixed": Entry(Fixed, "no search: flies the start again and again, such as a policy of a file"),
    "bo": Entry(BOLearner, "Gaussian process with Thompson sampling: fewest crashes, most computing"),
}

LEARNERS: Registry[Entry] = Registry("learner", _made, _OWN)


def make_learner(
    name: str,
    mu0: npt.ArrayLike,
    sigma0: npt.ArrayLike,
    *,
    bounds: npt.ArrayLike | None = None,
    n_rollouts: int = 8,
    seed: int = 0,
    **options: Any,
) -> Learner:
    """The learner called `name`; arguments as `Learner`, `options` on top of the entry's own.

    Raises:
        LearnerError: There is no such learner, or an argument is wrong.
    """
    try:
        entry = LEARNERS[name]
    except ConfigError as error:
        raise LearnerError(f"learner: {error}") from error
    return entry.cls(mu0, sigma0, bounds=bounds, n_rollouts=n_rollouts, seed=seed, **{**entry.preset, **options})
