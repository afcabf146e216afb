"""Vehicles drawn from what is known of their numbers: a family.

    kin = family.of(world)                        # the sigma of the files of vehicle, gear and sensors
    kin = family.of(world, task.family)           # and what a `family:` section says beside them
    members = family.members(world, 20, seed=1, choice=task.family)

A member is a vector z of standard normal numbers, one for each parameter of the family, in the order of their names:

    x = L z,    L L' = the correlations                                                            (1)
    value_i = centre_i + sigma_i x_i                          a parameter with a sigma, or a share of its centre
    value_i = lo (hi / lo)^Phi(x_i)                           one that is log-uniform between lo and hi

A value out of the bounds of its parameter is drawn again, and so is a whole member that the library refuses, for
example because it cannot hover. A parameter that an override sets is known, and keeps its value. The flight core of a
member knows the mass, inertia and thrust of its own vehicle, as that of every world does.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Self

import numpy as np
import numpy.typing as npt
from pydantic import Field, model_validator
from scipy.special import ndtr  # type: ignore[import-untyped]

from ivl import native, yamlfile
from ivl.errors import ConfigError, NativeError
from ivl.settings import Finite, Strict
from ivl.world import World

FloatArray = npt.NDArray[np.float64]

_TRIES = 1000
_LEAST_EIGENVALUE = 1e-6


class Spread(Strict):
    """How uncertain one parameter is: exactly one of `sigma`, `share` and `log_uniform`."""

    sigma: Finite | None = Field(default=None, gt=0, description="standard deviation, in the unit of the parameter")
    share: Finite | None = Field(default=None, gt=0, le=1, description="standard deviation as a share of the value")
    log_uniform: Annotated[list[Finite], Field(min_length=2, max_length=2)] | None = Field(
        default=None, description="lowest and highest value, both > 0; each factor is as likely as any other"
    )
    bounds: Annotated[list[Finite], Field(min_length=2, max_length=2)] | None = Field(
        default=None, description="no member has a value outside; by default the range of the parameter"
    )
    source: str = Field(min_length=1)

    @model_validator(mode="after")
    def _one_of_three(self) -> Self:
        given = [name for name in ("sigma", "share", "log_uniform") if getattr(self, name) is not None]
        if len(given) != 1:
            raise ValueError(f"give one of sigma, share, log_uniform; given: {', '.join(given) or 'none'}")
        for name in ("log_uniform", "bounds"):
            pair = getattr(self, name)
            if pair is not None and not pair[0] < pair[1]:
                raise ValueError(f"{name}: {pair[0]:g} must be below {pair[1]:g}")
        if self.log_uniform is not None and self.log_uniform[0] <= 0:
            raise ValueError(f"log_uniform: {self.log_uniform[0]:g} must be above 0")
        if self.log_uniform is not None and self.bounds is not None:
            raise ValueError("bounds: log_uniform has its own")
        return self


class Correlation(Strict):
    """Two parameters that are not independent."""

    of: Annotated[list[str], Field(min_length=2, max_length=2)]
    value: Finite = Field(gt=-1, lt=1)
    source: str = Field(min_length=1)


class FamilyChoice(Strict):
    """The `family:` section of a task: what is uncertain beside the `sigma` of the files, and how."""

    parameters: dict[str, Spread] = Field(
        default_factory=dict, description="spread of a parameter, in place of the sigma of its file if it has one"
    )
    known: list[str] = Field(default_factory=list, description="parameters that are not drawn, whatever the files say")
    correlations: list[Correlation] = Field(default_factory=list)
    scale: Finite = Field(default=1.0, gt=0, le=10, description="factor on every spread")


@dataclass(frozen=True)
class Dimension:
    """One parameter of a family.

    Attributes:
        name: Dotted name.
        unit: Of every value below.
        centre: Value of the files; of a log-uniform parameter the middle of its range of factors.
        sigma: Standard deviation; 0 for a log-uniform parameter.
        lo: Smallest value.
        hi: Largest value.
        source: Where the spread comes from.
    """

    name: str
    unit: str
    centre: float
    sigma: float
    lo: float
    hi: float
    source: str

    @property
    def is_log(self) -> bool:
        """Whether the parameter is log-uniform."""
        return self.sigma == 0.0

    def values(self, x: npt.ArrayLike) -> FloatArray:
        """Values for standard normal numbers, of the same shape; outside `lo .. hi` nothing is clipped."""
        x = np.asarray(x, dtype=np.float64)
        if self.is_log:
            return np.asarray(self.lo * (self.hi / self.lo) ** ndtr(x))
        return np.asarray(self.centre + self.sigma * x)


@dataclass(frozen=True)
class Family:
    """A distribution over vehicles; see the module's text.

    Attributes:
        world: What the files say.
        dimensions: The parameters that are drawn, in the order of their names.
        root: L of equation (1), shape (n, n).
        scale: Factor on all of z.
    """

    world: World
    dimensions: tuple[Dimension, ...]
    root: FloatArray
    scale: float

    @property
    def names(self) -> tuple[str, ...]:
        """The parameters that are drawn."""
        return tuple(d.name for d in self.dimensions)

    def values(self, z: FloatArray) -> FloatArray:
        """Values of the parameters, shape (..., n), for z of the same shape."""
        x = self.scale * (z @ self.root.T)
        return np.stack([d.values(x[..., i]) for i, d in enumerate(self.dimensions)], axis=-1)

    def inside(self, z: FloatArray) -> npt.NDArray[np.bool_]:
        """Whether all values are inside their bounds, shape (...)."""
        values = self.values(z)
        lo, hi = (np.array([getattr(d, side) for d in self.dimensions]) for side in ("lo", "hi"))
        return np.asarray(((values >= lo) & (values <= hi)).all(axis=-1))

    def member(self, z: FloatArray) -> World:
        """The vehicle of z, shape (n,).

        Raises:
            NativeError: The library refuses it.
        """
        return self.world.changed(**dict(zip(self.names, self.values(z).tolist(), strict=True)))

    def draw(self, rng: np.random.Generator) -> tuple[FloatArray, World]:
        """One member: z, shape (n,), and its world.

        Raises:
            ConfigError: Nothing that is drawn is allowed.
        """
        refused: NativeError | None = None
        for _ in range(_TRIES):
            z = self._draw_inside(rng)
            try:
                return z, self.member(z)
            except NativeError as error:
                refused = error
        raise ConfigError(f"{self._who()}: none of {_TRIES} members is allowed: {refused}")

    def _draw_inside(self, rng: np.random.Generator) -> FloatArray:
        """A z whose values are inside their bounds; a parameter without correlations is drawn again by itself."""
        z = np.zeros(len(self.dimensions))
        for i, d in enumerate(self.dimensions):
            for _ in range(_TRIES):
                z[i] = rng.standard_normal()
                value = d.values(self.scale * (self.root[i] @ z))
                if d.lo <= value <= d.hi:
                    break
            else:
                allowed = f"allowed {d.lo:g} .. {d.hi:g} {d.unit}"
                raise ConfigError(f"{self._who()}: {d.name}: none of {_TRIES} values is in range ({allowed})")
        return z

    def _who(self) -> str:
        return f"family: vehicle {self.world.vehicle}, gear {self.world.gear_set}/{self.world.gear}"


def of(world: World, choice: FamilyChoice | None = None) -> Family:
    """The family of a world: the sigmas of its files, and what a `family:` section says.

    Raises:
        ConfigError: The section names a parameter that does not exist or is not drawn, a bound that leaves nothing, or
            correlations that contradict each other; or nothing is uncertain.
    """
    choice = choice or FamilyChoice()
    spreads: dict[str, Spread] = {
        name: Spread(sigma=sigma, source=f"sigma of {world.params.origin[name]}")
        for name, sigma in world.params.sigma.items()
        if sigma > 0
    }
    spreads |= {name: s for name, s in choice.parameters.items() if world.params.origin.get(name) != "override"}
    _check_names([*choice.parameters, *choice.known], native.library().params)
    for name in choice.known:
        spreads.pop(name, None)
    if not spreads:
        who = f"vehicle {world.vehicle}, gear {world.gear_set}/{world.gear}"
        raise ConfigError(f"family: {who}: no parameter has a sigma, so that all members are alike")
    dimensions = tuple(_dimension(world, name, spreads[name]) for name in sorted(spreads))
    root = _root([d.name for d in dimensions], choice.correlations, world.overrides)
    return Family(world, dimensions, root, choice.scale)


def members(world: World, n: int, seed: int, choice: FamilyChoice | None = None) -> list[World]:
    """The first n members of a seed; more members of the same seed begin with the same ones."""
    kin, rng = of(world, choice), np.random.Generator(np.random.PCG64(seed))
    return [kin.draw(rng)[1] for _ in range(n)]


def _check_names(names: Sequence[str], known: Mapping[str, Any]) -> None:
    for name in names:
        if name not in known:
            raise ConfigError(f"family: {name}: unknown parameter{yamlfile.did_you_mean(name, known)}")


def _dimension(world: World, name: str, spread: Spread) -> Dimension:
    field, value = native.library().params[name], world.params.values[name]
    if spread.log_uniform is not None:
        lo, hi = spread.log_uniform
        if not field.lo <= lo < hi <= field.hi:
            raise ConfigError(f"family: {name}: log_uniform {lo:g} .. {hi:g} (allowed {_range(field)})")
        return Dimension(name, field.unit, float(np.sqrt(lo * hi)), 0.0, lo, hi, spread.source)
    sigma = spread.sigma if spread.sigma is not None else (spread.share or 0.0) * abs(value)
    if sigma == 0.0:
        raise ConfigError(f"family: {name}: a share of its value, which is 0, is no spread; give sigma")
    lo, hi = spread.bounds or (field.lo, field.hi)
    lo, hi = max(lo, field.lo), min(hi, field.hi)
    if not lo < hi:
        raise ConfigError(f"family: {name}: bounds {spread.bounds} are outside of the range (allowed {_range(field)})")
    return Dimension(name, field.unit, value, sigma, lo, hi, spread.source)


def _range(field: native.Field) -> str:
    return f"{field.lo:g} .. {field.hi:g} {field.unit}"


def _root(names: Sequence[str], correlations: Sequence[Correlation], known: Mapping[str, float]) -> FloatArray:
    """Lower triangle L with L L' = correlations; a correlation with an overridden parameter means nothing."""
    matrix = np.eye(len(names))
    for correlation in correlations:
        a, b = correlation.of
        if a in known or b in known:
            continue
        for name in (a, b):
            if name not in names:
                raise ConfigError(f"family: correlations: {name}: is not drawn (drawn: {', '.join(names)})")
        i, j = names.index(a), names.index(b)
        if i == j:
            raise ConfigError(f"family: correlations: {a}: with itself")
        matrix[i, j] = matrix[j, i] = correlation.value
    if np.linalg.eigvalsh(matrix).min() < _LEAST_EIGENVALUE:
        raise ConfigError("family: correlations: together they contradict each other (not positive definite)")
    return np.asarray(np.linalg.cholesky(matrix))
