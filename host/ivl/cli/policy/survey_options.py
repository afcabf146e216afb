"""Options of the flights that the pictures of a policy show."""

from typing import Annotated

import typer

from ivl.errors import ConfigError

Approaches = Annotated[
    int | None,
    typer.Option(help="Fresh approaches over the plane; three policies fly each. Default: 1000.", min=1, max=1_000_000),
]
Seed = Annotated[int, typer.Option(help="Seed of approaches and noise.", min=0)]
Threads = Annotated[int | None, typer.Option(help="Worker threads; default: all processors.", min=1)]
N_APPROACHES = 1000


def constant_of(rrev: float | None, moment: float | None) -> tuple[float, float] | None:
    """The paper's policy that the options say; None if they say none.

    Raises:
        ConfigError: Only one of its numbers is given.
    """
    if (rrev is None) != (moment is None):
        raise ConfigError(f"{'--rrev' if rrev is None else '--moment'} is missing: the paper's policy has two numbers")
    return None if rrev is None or moment is None else (rrev, moment)
