"""Vehicles drawn from what is known of their numbers: a family.

    kin = family.of(world)                        # the sigma of the files of vehicle, gear and sensors
    kin = family.of(world, task.family)           # and what a `family:` section says beside them
    members = family.members(world, 20, seed=1, choice=task.family)

A member is a vector z of standard normal numbers, one for each parameter of the family, in the order of their names:

    x = L z,    L L' = the correlations                                                            (1)
    value_i = centre_i + sigma_i x_i                          a parameter with a sigma, or a share of its centre
    value_i = lo (hi / lo)^Phi(x_i)                           one that is log-uniform between lo and hi

Phi is the distribution function of x. A value out of the bounds of its parameter is drawn again, together with those
that it is correlated with, and so is a whole member that the library refuses, for example because it cannot hover. A
parameter that an override sets is known, and keeps its value. The flight core of a member knows the mass, inertia and
thrust of its own vehicle, as that of every world does.
"""

from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal, Self

import numpy as np
import numpy.typing as npt
from pydantic import Field, PlainValidator, model_validator
from scipy.special import ndtr  # type: ignore[import-untyped]

from ivl import model, native, yamlfile
from ivl.errors import ConfigError, NativeError
from ivl.settings import Finite, Strict
from ivl.world import World

FloatArray = npt.NDArray[np.float64]

MEMBER = "family.member"
"""Path of the member that a task flies."""
MEMBERS_MAX = 10_000
"""Members that a task can name."""
EACH = "each"
"""In place of a member's number: trial k of an experiment flies member k."""
_TRIES = 1000
_LEAST_EIGENVALUE = 1e-6
_OVERRIDE = "override"  # origin of such a value, see `ivl.model.Parameters`


def _member(value: Any) -> Any:
    """A member as a `family:` section names it."""
    is_number = isinstance(value, int) and not isinstance(value, bool)
    if value is None or value == EACH or (is_number and 0 <= value < MEMBERS_MAX):
        return value
    raise ValueError(f"must be null, {EACH} or a whole number (allowed 0 .. {MEMBERS_MAX - 1})")


class Spread(Strict):
    """How uncertain one parameter is: exactly one of `sigma`, `share` and `log_uniform`, and where that comes from."""

    sigma: Finite | None = Field(default=None, gt=0, description="standard deviation, in the unit of the parameter")
    share: Finite | None = Field(default=None, gt=0, le=1, description="standard deviation as a share of the centre")
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
    """Two parameters that are not independent: the correlation of their standard normal numbers x, equation (1)."""

    of: Annotated[list[str], Field(min_length=2, max_length=2)]
    value: Finite = Field(gt=-1, lt=1)
    source: str = Field(min_length=1)


class FamilyChoice(Strict):
    """The `family:` section of a task: what is uncertain beside the `sigma` of the files, and how."""

    parameters: dict[str, Spread] = Field(
        default_factory=dict, description="spread of a parameter, in place of the sigma of its file if it has one"
    )
    known: list[str] = Field(
        default_factory=list, description="parameters that are not drawn, whatever the files say; `aero.*`: of a group"
    )
    correlations: list[Correlation] = Field(default_factory=list)
    scale: Finite = Field(
        default=1.0, gt=0, le=10, description="factor on all of x; one that is log-uniform stays between its bounds"
    )
    seed: int = Field(default=0, ge=0, lt=2**63, description="of the members")
    member: Annotated[int | Literal["each"] | None, PlainValidator(_member)] = Field(
        default=None,
        description="flies in place of the vehicle of the files; null: that one; each: trial k flies member k",
    )
    member_scale: Finite = Field(
        default=1.0,
        gt=0,
        le=10,
        description="factor on `scale` for the members that fly; who learns knows `scale` alone",
    )
    member_overrides: dict[str, Finite] = Field(
        default_factory=dict,
        description="values of the members that fly, whatever is drawn; who learns does not know them",
    )

    @property
    def is_each(self) -> bool:
        """Whether every trial flies a vehicle of its own."""
        return self.member == EACH

    def of_trial(self, number: int) -> "FamilyChoice":
        """The section of one trial: with the member that flies there.

        Raises:
            ConfigError: There are not so many members.
        """
        if not self.is_each:
            return self
        if number >= MEMBERS_MAX:
            raise ConfigError(f"{MEMBER}: {EACH}: trial {number} has no member (allowed {MEMBERS_MAX} trials)")
        return self.model_copy(update={"member": number})

    def check(self) -> None:
        """Check names and ranges against the library's table; what needs the world is checked by `of`.

        Raises:
            ConfigError: One line naming the field, its value and the allowed range.
        """
        table = native.library().params
        for name, spread in self.parameters.items():
            where = f"family.parameters.{name}"
            field = _field(name, "family.parameters", table)
            for key in ("log_uniform", "bounds"):
                pair = getattr(spread, key)
                if pair is not None and not field.lo <= pair[0] < pair[1] <= field.hi:
                    raise ConfigError(f"{where}.{key}: value {pair} is out of range ({_allowed(field)})")
        _check_values(self.member_overrides, "family.member_overrides", table)
        for pattern in self.known:
            if not any(_is_known(name, [pattern]) for name in table):
                raise ConfigError(f"family.known: {pattern}: unknown parameter{yamlfile.did_you_mean(pattern, table)}")
        for name in self.parameters:
            if _is_known(name, self.known):
                raise ConfigError(f"family.parameters.{name}: has a spread, but `known` says that it is not drawn")
        pairs = [frozenset(correlation.of) for correlation in self.correlations]
        for correlation, pair in zip(self.correlations, pairs, strict=True):
            where = f"family.correlations: {' and '.join(correlation.of)}"
            for name in correlation.of:
                _field(name, where, table)
            if len(pair) == 1 or pairs.count(pair) > 1:
                raise ConfigError(f"{where}: {'is one parameter' if len(pair) == 1 else 'are given twice'}")


@dataclass(frozen=True)
class Dimension:
    """One parameter of a family.

    Attributes:
        name: Dotted name.
        unit: Of every value below.
        centre: Value of the files; of a log-uniform parameter its median, sqrt(lo hi).
        sigma: Standard deviation at scale 1, before values out of bounds are drawn again; 0: log-uniform.
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
class Sample:
    """Members of a family.

    Attributes:
        z: Their standard normal numbers, shape (n_members, n_dimensions).
        worlds: The members.
        n_refused: Further ones that the library refused and that were drawn again.
    """

    z: FloatArray
    worlds: list[World]
    n_refused: int

    @property
    def share_refused(self) -> float:
        """Share of all that were drawn inside their bounds."""
        drawn = self.n_refused + len(self.worlds)
        return self.n_refused / drawn if drawn else 0.0


@dataclass(frozen=True)
class Family:
    """A distribution over vehicles; see the module's text.

    Attributes:
        world: What the files say.
        dimensions: The parameters that are drawn, in the order of their names.
        root: L of equation (1), lower triangle, shape (n, n).
        scale: Factor on all of x.
        overrides: Values that every member has, whatever is drawn.
    """

    world: World
    dimensions: tuple[Dimension, ...]
    root: FloatArray
    scale: float
    overrides: Mapping[str, float]

    @property
    def names(self) -> tuple[str, ...]:
        """The parameters that are drawn."""
        return tuple(d.name for d in self.dimensions)

    @property
    def correlations(self) -> FloatArray:
        """Correlations of x, shape (n, n)."""
        return np.asarray(self.root @ self.root.T)

    def values(self, z: FloatArray) -> FloatArray:
        """Values of the parameters, shape (..., n), for z of the same shape."""
        x = self.scale * (z @ self.root.T)
        return np.stack([d.values(x[..., i]) for i, d in enumerate(self.dimensions)], axis=-1)

    def inside(self, z: FloatArray) -> npt.NDArray[np.bool_]:
        """Whether all values are inside their bounds, shape (...)."""
        return np.asarray(self._each_inside(z).all(axis=-1))

    def _each_inside(self, z: FloatArray) -> npt.NDArray[np.bool_]:
        """Whether each value is inside its bounds, of the shape of z."""
        values = self.values(z)
        lo, hi = (np.array([getattr(d, side) for d in self.dimensions]) for side in ("lo", "hi"))
        return np.asarray((values >= lo) & (values <= hi))

    def member(self, z: FloatArray) -> World:
        """The vehicle of z, shape (n,).

        Raises:
            NativeError: The library refuses it.
        """
        drawn = dict(zip(self.names, self.values(z).tolist(), strict=True))
        return self.world.changed(**{**drawn, **self.overrides})

    def draw(self, rng: np.random.Generator) -> tuple[FloatArray, World]:
        """One member: z, shape (n,), and its world.

        Raises:
            ConfigError: Nothing that is drawn is allowed.
        """
        z, world, _ = self._draw(rng)
        return z, world

    def sample(self, n: int, seed: int) -> Sample:
        """The first n members of a seed; more members of the same seed begin with the same ones.

        Raises:
            ConfigError: Nothing that is drawn is allowed.
        """
        rng = np.random.Generator(np.random.PCG64(seed))
        drawn = [self._draw(rng) for _ in range(n)]
        z = np.array([z for z, _, _ in drawn]).reshape(n, len(self.dimensions))
        return Sample(z, [world for _, world, _ in drawn], sum(refused for _, _, refused in drawn))

    def _draw(self, rng: np.random.Generator) -> tuple[FloatArray, World, int]:
        """Z and world of one member, and how many the library refused before."""
        refused: NativeError | None = None
        for n_refused in range(_TRIES):
            z = self._draw_inside(rng)
            try:
                return z, self.member(z), n_refused
            except NativeError as error:
                refused = error
        raise ConfigError(f"{self._who()}: none of {_TRIES} members is allowed: {refused}")

    def _draw_inside(self, rng: np.random.Generator) -> FloatArray:
        """A z whose values are inside their bounds."""
        n, blocks = len(self.dimensions), self._blocks()
        z = rng.standard_normal(n)
        outside = np.zeros(n, dtype=bool)
        for _ in range(_TRIES):
            outside = ~self._each_inside(z)
            if not outside.any():
                return z
            again = [i for block in blocks if outside[block].any() for i in block]
            z[again] = rng.standard_normal(len(again))
        d = self.dimensions[int(np.flatnonzero(outside)[0])]
        told = f"{d.name}: none of {_TRIES} values is in range (allowed {d.lo:g} .. {d.hi:g} {d.unit})"
        raise ConfigError(f"{self._who()}: {told}")

    def _blocks(self) -> list[list[int]]:
        """What is drawn together: each parameter without correlations by itself, and all the others."""
        alone = np.count_nonzero(self.correlations, axis=0) == 1
        together = np.flatnonzero(~alone).tolist()
        return [[int(i)] for i in np.flatnonzero(alone)] + ([together] if together else [])

    def _who(self) -> str:
        return f"family: vehicle {self.world.vehicle}, gear {self.world.gear_set}/{self.world.gear}"


def of(world: World, choice: FamilyChoice | None = None) -> Family:
    """The family of a world: the sigmas of its files, and what a `family:` section says.

    Raises:
        ConfigError: The section is wrong (`FamilyChoice.check`), it correlates what is not drawn, its correlations
            contradict each other, or nothing is uncertain.
    """
    choice = choice or FamilyChoice()
    choice.check()
    params, spreads = world.params, _spreads(world, choice)
    names = sorted(spreads)
    if not names:
        who = f"vehicle {world.vehicle}, gear {world.gear_set}/{world.gear}"
        raise ConfigError(f"family: {who}: no parameter has a sigma, so that all members are alike")
    dimensions = tuple(_dimension(world, name, spreads[name]) for name in names)
    overridden = {name for name, origin in params.origin.items() if origin == _OVERRIDE}
    return Family(world, dimensions, _root(names, choice.correlations, overridden), choice.scale, {})


def is_uncertain(world: World, choice: FamilyChoice) -> bool:
    """Whether the members of the family differ at all."""
    return bool(_spreads(world, choice))


def _spreads(world: World, choice: FamilyChoice) -> dict[str, Spread]:
    """The spread of each parameter that is drawn."""
    params = world.params
    spreads: dict[str, Spread] = {
        name: Spread(sigma=sigma, source=f"sigma of {params.origin[name]}") for name, sigma in params.sigma.items()
    }
    spreads |= {name: s for name, s in choice.parameters.items() if params.origin[name] != _OVERRIDE}
    return {name: spread for name, spread in spreads.items() if not _is_known(name, choice.known)}


def members(world: World, n: int, seed: int, choice: FamilyChoice | None = None) -> list[World]:
    """The first n members of a seed; more members of the same seed begin with the same ones."""
    return of(world, choice).sample(n, seed).worlds


def chosen_member(world: World, choice: FamilyChoice) -> World:
    """What a task flies: the member that its section names, or the vehicle of the files if it names none.

    Where every trial flies its own member, the first trial's stands for the task.

    Raises:
        ConfigError: As `of` and `Family.sample`.
    """
    member = choice.of_trial(0).member
    return world if member is None else flown(world, choice, int(member) + 1)[-1]


def flown(world: World, choice: FamilyChoice, n: int) -> list[World]:
    """The first n members that a task may fly.

    Raises:
        ConfigError: As `of` and `Family.sample`.
    """
    kin = of(world, choice)
    wide = replace(kin, scale=choice.member_scale * kin.scale, overrides=choice.member_overrides)
    return wide.sample(n, choice.seed).worlds


def _is_known(name: str, known: Sequence[str]) -> bool:
    """Whether a parameter is one of some names, or in one of some groups, which are written `group.*`."""
    return name in known or f"{name.partition('.')[0]}.*" in known


def _field(name: str, where: str, table: model.Table) -> native.Field:
    if name not in table:
        raise ConfigError(f"{where}: {name}: unknown parameter{yamlfile.did_you_mean(name, table)}")
    return table[name]


def _check_values(values: Mapping[str, float], where: str, table: model.Table) -> None:
    for name, value in values.items():
        field = _field(name, where, table)
        if not field.lo <= value <= field.hi:
            raise ConfigError(f"{where}.{name}: value {value:g} is out of range ({_allowed(field)})")


def _dimension(world: World, name: str, spread: Spread) -> Dimension:
    field, value = native.library().params[name], world.params.values[name]
    if spread.log_uniform is not None:
        lo, hi = spread.log_uniform
        return Dimension(name, field.unit, float(np.sqrt(lo * hi)), 0.0, lo, hi, spread.source)
    sigma = spread.sigma if spread.sigma is not None else (spread.share or 0.0) * abs(value)
    if not np.isfinite(value) or sigma == 0.0:
        what = "a sigma above 0 is needed" if value == 0.0 else "only log_uniform is possible"
        raise ConfigError(f"family.parameters.{name}: its centre is {value:g} {field.unit}: {what}")
    lo, hi = spread.bounds or (field.lo, field.hi)
    return Dimension(name, field.unit, value, sigma, lo, hi, spread.source)


def _allowed(field: native.Field) -> str:
    return f"allowed {field.lo:g} .. {field.hi:g} {field.unit}"


def _root(names: Sequence[str], correlations: Sequence[Correlation], overridden: Set[str]) -> FloatArray:
    """Lower triangle L with L L' = correlations; those of an overridden parameter mean nothing."""
    matrix = np.eye(len(names))
    for correlation in correlations:
        if overridden & set(correlation.of):
            continue
        for name in correlation.of:
            if name not in names:
                raise ConfigError(f"family.correlations: {name}: is not drawn (drawn are {', '.join(names)})")
        i, j = (names.index(name) for name in correlation.of)
        matrix[i, j] = matrix[j, i] = correlation.value
    if np.linalg.eigvalsh(matrix).min() < _LEAST_EIGENVALUE:
        raise ConfigError("family.correlations: together they contradict each other (not positive definite)")
    return np.asarray(np.linalg.cholesky(matrix))
