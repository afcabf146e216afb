"""Ways to fly that are not the simulator in this process; each is chosen by the scheme of a URI.

source = open_source("pil://", experiment, threads=None)
"""

from collections.abc import Callable

from ivl.errors import ConfigError
from ivl.experiment import Experiment
from ivl.links import pil
from ivl.source import RolloutSource

Opener = Callable[[str, Experiment, int | None], RolloutSource]

SCHEMES: dict[str, Opener] = {"pil": pil.PilSource}
"""Scheme of a URI -> what opens it."""


def open_source(uri: str, experiment: Experiment, threads: int | None = None) -> RolloutSource:
    """The source that a URI names.

    Raises:
        ConfigError: No such scheme, or the rest of the URI makes no sense for it.
        RolloutError: The other end cannot be reached or started.
    """
    scheme, separator, _ = uri.partition("://")
    if not separator or scheme not in SCHEMES:
        allowed = ", ".join(f"{name}://" for name in SCHEMES)
        raise ConfigError(f"uri: value {uri!r} is unknown (allowed {allowed})")
    return SCHEMES[scheme](uri, experiment, threads)
