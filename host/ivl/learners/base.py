"""What every learner is: `ask` for policies, `tell` their returns, and a state that can be saved between any two calls.

The loop, as pycma and cmaes users know it (but returns are maximised):

    learner = EPHE(mu0=[4.0, 5.0], sigma0=[1.5, 1.5], seed=1)
    while not learner.stop():
        theta = learner.ask()
        learner.tell(theta, rewards=fly(theta))
    print(learner.result.recommended)

Only the order and the proportions of returns count: a factor on all of them changes nothing that a learner asks.

The public methods check and copy; algorithms override the underscored ones and see only clean arrays.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ConfigDict, ValidationError

from ivl.errors import LearnerError
from ivl.yamlfile import explain

FloatArray = npt.NDArray[np.float64]
Meta = Mapping[str, npt.NDArray[Any]]
LANDED = "landed"
"""Name in `Meta` under which a learner is told which rollouts were landings (`ivl.outcome.four_leg`)."""
RETURN_MIN, RETURN_MAX = 1e-30, 1e30
"""Smaller returns count as 0, larger ones are refused, and so are policies beyond so many spreads of the first centre:
squares of either, and sums of them, are then numbers, whatever a learner does with them."""
SPREADS_MAX = 1e6
RECORDING = "recording"
"""Name in `Meta` of what rollouts recorded of their flip, shape (n, `ivl.belief.recording.N`), NaN where nothing."""


class Options(BaseModel):
    """Base of the options of a learner: checked strictly, unknown names refused."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True)


@dataclass(frozen=True)
class Result:
    """Where a learner stands.

    Attributes:
        mu: Centre of the search, shape (dim,).
        sigma: Spread of the search in each dimension, shape (dim,).
        recommended: The policy that the learner would fly if it had to land now, shape (dim,).
        n_told: Rollouts told so far.
        n_updates: Calls of `tell` that brought at least one rollout.
    """

    mu: FloatArray
    sigma: FloatArray
    recommended: FloatArray
    n_told: int
    n_updates: int


class Learner(ABC):
    """Base class of all learners; see the module's text for the loop."""

    Options: ClassVar[type[Options]] = Options
    needs_bounds: ClassVar[bool] = False
    uses_simulator: ClassVar[bool] = False
    """Whether it can begin with simulated vehicles (`begin`), and wants to be told `RECORDING`."""

    def __init__(
        self,
        mu0: npt.ArrayLike,
        sigma0: npt.ArrayLike,
        *,
        bounds: npt.ArrayLike | None = None,
        n_rollouts: int = 8,
        seed: int = 0,
        **options: Any,
    ) -> None:
        """Start a search.

        Args:
            mu0: First centre, shape (dim,), inside the bounds.
            sigma0: First spread in each dimension, shape (dim,), > 0, at most the width of the bounds.
            bounds: Lower and upper bound of each dimension, shape (dim, 2); omitted: unbounded.
            n_rollouts: Rollouts per episode, what `ask()` returns.
            seed: Seed of the learner's own PCG64 generator.
            **options: Options of the algorithm, see its `Options`.

        Raises:
            LearnerError: A value, shape or option is wrong.
        """
        self.mu0, self.sigma0 = _vector("mu0", mu0), _vector("sigma0", sigma0)
        self.lo, self.hi = _bounds(bounds, self.mu0.size, self.needs_bounds)
        self._check_start()
        self.n_rollouts, self.seed = _whole("n_rollouts", n_rollouts, 1), _whole("seed", seed, 0)
        try:
            self.options = self.Options.model_validate(options)
        except ValidationError as error:
            raise LearnerError(f"options of {type(self).__name__}: {explain(error)}") from error
        self._rng = np.random.Generator(np.random.PCG64(seed))
        self._n_told = 0
        self._n_updates = 0
        self._setup()

    @property
    def dim(self) -> int:
        """Number of policy parameters."""
        return self.mu0.size

    @property
    def result(self) -> Result:
        """Where the search stands; the arrays are copies."""
        mu, sigma = self._distribution()
        return Result(mu.copy(), sigma.copy(), self._recommended().copy(), self._n_told, self._n_updates)

    @property
    def insight(self) -> dict[str, Any] | None:
        """What the learner expects, beside where it searches, as plain data; None: it expects nothing.

        Of every learner that has a model of the vehicle: `expected_rate` and `margin_rate`, the landing rates that it
        expects of its recommendation, without and with errors of timing and moment; `model_fits`, whether flights so
        far land as often as it expected.
        """
        return None

    def ask(self, n: int | None = None) -> FloatArray:
        """Draw policies to fly, shape (n, dim), inside the bounds; `n` omitted: `n_rollouts`."""
        return self._ask(self.n_rollouts if n is None else _whole("ask: n", n, 1))

    def tell(
        self, theta: npt.ArrayLike, rewards: npt.ArrayLike, meta: Mapping[str, npt.ArrayLike] | None = None
    ) -> None:
        """Update the search from rollouts that were flown.

        Rollouts that an operator discarded are simply left out; rows may come in any order; no rows at all change
        nothing.

        Args:
            theta: Policies as flown, shape (n, dim).
            rewards: Return of each, shape (n,), 0 .. 1e30, to be maximised; below 1e-30 it counts as 0.
            meta: More about each rollout by name (fields of its outcome, and `LANDED`), each of shape (n, ...);
                learners may use or ignore it.

        Raises:
            LearnerError: A shape is wrong, or a value is not finite or out of range; then nothing has changed.
        """
        x, r = _array("theta", theta), _array("rewards", rewards)
        if r.ndim != 1 or x.shape != (r.size, self.dim):
            raise LearnerError(
                f"tell: theta has shape {x.shape} and rewards {r.shape}, expected (n, {self.dim}) and (n,)"
            )
        self._check_told(x, r)
        r = np.where(r < RETURN_MIN, 0.0, r)
        extra = {name: np.array(value) for name, value in (meta or {}).items()}
        for name, value in extra.items():
            if value.shape[:1] != r.shape:
                raise LearnerError(f"tell: meta[{name!r}] has shape {value.shape}, expected ({r.size}, ...)")
        if r.size == 0:
            return
        self._update(x, r, extra)
        self._n_told += r.size
        self._n_updates += 1

    def stop(self) -> bool:
        """True when more rollouts would not change the result; budgets are the caller's affair."""
        return False

    def state_dict(self) -> dict[str, Any]:
        """Everything that the future of the search depends on, as plain data for JSON (generator included)."""
        return {
            "learner": type(self).__name__,
            "rng": self._rng.bit_generator.state,
            "n_told": self._n_told,
            "n_updates": self._n_updates,
            "search": self._state(),
        }

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Continue from a `state_dict` of a learner that was made with the same arguments.

        Raises:
            LearnerError: The state is of another algorithm or incomplete.
        """
        if state.get("learner") != type(self).__name__:
            raise LearnerError(f"state of learner {state.get('learner')!r} cannot be loaded into {type(self).__name__}")
        try:
            self._rng.bit_generator.state = state["rng"]
            self._n_told, self._n_updates = int(state["n_told"]), int(state["n_updates"])
            self._load(state["search"])
        except (KeyError, TypeError, ValueError) as error:
            raise LearnerError(f"the saved state of {type(self).__name__} is damaged: {error!r}") from error

    def _check_told(self, x: FloatArray, r: FloatArray) -> None:
        odd = r[(r < 0) | (r > RETURN_MAX)]
        if odd.size:
            raise LearnerError(f"tell: rewards: value {float(odd[0])!r} is out of range (allowed 0 .. {RETURN_MAX:g})")
        row, column = np.nonzero(np.abs(x - self.mu0) > SPREADS_MAX * self.sigma0)
        if row.size:
            raise LearnerError(
                f"tell: theta: value {float(x[row[0], column[0]])!r} is more than {SPREADS_MAX:g} * sigma0 from mu0"
            )

    def _check_start(self) -> None:
        if self.sigma0.shape != self.mu0.shape:
            raise LearnerError(f"sigma0 has shape {self.sigma0.shape}, mu0 {self.mu0.shape}: they must be equal")
        for i in range(self.dim):
            allowed = f"allowed {self.lo[i]:g} .. {self.hi[i]:g}"
            if not self.lo[i] <= self.mu0[i] <= self.hi[i]:
                raise LearnerError(f"mu0[{i}]: value {float(self.mu0[i])!r} is out of range ({allowed})")
            if not 0 < self.sigma0[i] <= self.hi[i] - self.lo[i]:
                width = self.hi[i] - self.lo[i]
                raise LearnerError(
                    f"sigma0[{i}]: value {float(self.sigma0[i])!r} is out of range (allowed > 0 .. {width:g})"
                )

    @abstractmethod
    def _setup(self) -> None:
        """Make the algorithm's state from mu0, sigma0 and options."""

    @abstractmethod
    def _ask(self, n: int) -> FloatArray:
        """Draw n policies, shape (n, dim)."""

    @abstractmethod
    def _update(self, theta: FloatArray, rewards: FloatArray, meta: Meta, /) -> None:
        """Learn from checked copies, at least one row."""

    @abstractmethod
    def _distribution(self) -> tuple[FloatArray, FloatArray]:
        """Present centre and spread."""

    @abstractmethod
    def _recommended(self) -> FloatArray:
        """The policy to fly if learning ended now."""

    @abstractmethod
    def _state(self) -> dict[str, Any]:
        """The algorithm's part of `state_dict`, plain data."""

    @abstractmethod
    def _load(self, state: Mapping[str, Any]) -> None:
        """Inverse of `_state`."""


def draw_truncated(
    rng: np.random.Generator, mu: FloatArray, sigma: FloatArray, lo: FloatArray, hi: FloatArray, n: int
) -> FloatArray:
    """Draw n vectors from N(mu, diag sigma^2) truncated to [lo, hi], by redrawing components that fall outside.

    Ends quickly if mu is in the box and sigma not wider than it: a component is then inside with probability 0.34 at
    least.
    """
    theta = np.empty((n, mu.size))
    missing = np.ones(theta.shape, dtype=bool)
    while missing.any():
        row, column = np.nonzero(missing)
        theta[row, column] = rng.normal(mu[column], sigma[column])
        missing = (theta < lo) | (theta > hi)
    return theta


def _whole(name: str, value: Any, least: int) -> int:
    """A whole number, those of numpy included."""
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, (int, np.integer)) or value < least:
        raise LearnerError(f"{name}: value {value!r} must be a whole number >= {least}")
    return int(value)


def _array(name: str, value: npt.ArrayLike) -> FloatArray:
    """A float64 copy of finite numbers."""
    try:
        raw = np.asarray(value)
    except ValueError as error:
        raise LearnerError(f"{name}: not an array of numbers: {error}") from error
    if raw.dtype.kind not in "iuf":
        raise LearnerError(f"{name}: value {value!r} is not an array of numbers")
    array = np.array(raw, dtype=np.float64)
    if not np.isfinite(array).all():
        raise LearnerError(f"{name}: value {float(array[~np.isfinite(array)].flat[0])!r} is not finite")
    return array


def _vector(name: str, value: npt.ArrayLike) -> FloatArray:
    array = _array(name, value)
    if array.ndim != 1 or array.size == 0:
        raise LearnerError(f"{name} has shape {array.shape}, expected (dim,)")
    return array


def _bounds(bounds: npt.ArrayLike | None, dim: int, needed: bool) -> tuple[FloatArray, FloatArray]:
    if bounds is None:
        if needed:
            raise LearnerError("bounds: this learner needs a lower and an upper bound of each dimension")
        return np.full(dim, -np.inf), np.full(dim, np.inf)
    array = _array("bounds", bounds)
    if array.shape != (dim, 2) or not (array[:, 0] < array[:, 1]).all():
        raise LearnerError(f"bounds: value {array.tolist()!r}: expected {dim} pairs (lower, upper) with lower < upper")
    return array[:, 0].copy(), array[:, 1].copy()
