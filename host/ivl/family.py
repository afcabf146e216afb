"""Vehicles drawn from what the files say of the uncertainty of their numbers.

    members = family.members(world, 20, seed=1)

A member has every parameter with a `sigma` in the files of vehicle, gear and sensors drawn anew; a parameter that an
override sets is known, and keeps its value. The flight core of a member knows the mass, inertia and thrust of its own
vehicle, as that of every world does.
"""

import numpy as np

from ivl import native
from ivl.errors import ConfigError, NativeError
from ivl.world import World

_TRIES = 1000


def draw(world: World, rng: np.random.Generator) -> World:
    """One member.

    Each value is normal about that of the files. A value out of the range of its parameter is drawn again, and a whole
    member that the library refuses, for example because it cannot hover.

    Args:
        world: What the files say.
        rng: Random numbers; the draw takes the parameters in the order of their names.

    Raises:
        ConfigError: No parameter has a sigma, or nothing that is drawn is allowed.
    """
    sigma = world.params.sigma
    who = f"vehicle {world.vehicle}, gear {world.gear_set}/{world.gear}"
    if not sigma:
        raise ConfigError(f"family: {who}: no parameter has a sigma, so that all members are alike")
    refused: NativeError | None = None
    for _ in range(_TRIES):
        drawn = {name: _value(world, name, rng, who) for name in sorted(sigma)}
        try:
            return world.changed(**drawn)
        except NativeError as error:
            refused = error
    raise ConfigError(f"family: none of {_TRIES} members is allowed: {refused}")


def members(world: World, n: int, seed: int) -> list[World]:
    """The first n members of a seed; more members of the same seed begin with the same ones."""
    rng = np.random.Generator(np.random.PCG64(seed))
    return [draw(world, rng) for _ in range(n)]


def _value(world: World, name: str, rng: np.random.Generator, who: str) -> float:
    """A value inside the range of its parameter."""
    field = native.library().params[name]
    for _ in range(_TRIES):
        value = float(rng.normal(world.params.values[name], world.params.sigma[name]))
        if field.lo <= value <= field.hi:
            return value
    allowed = f"allowed {field.lo:g} .. {field.hi:g} {field.unit}"
    raise ConfigError(f"family: {who}: {name}: none of {_TRIES} values is in range ({allowed})")
