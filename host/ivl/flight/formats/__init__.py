"""Forms of logs that people have. A new one is a module here and a row of the table."""

from collections.abc import Mapping
from types import MappingProxyType

from ivl.errors import ConfigError
from ivl.flight.formats import cfclient, crazyswarm, habas2021, recording, trace, usd
from ivl.flight.log import Format

_MODULES = (habas2021, recording, trace, cfclient, crazyswarm, usd)
FORMATS: Mapping[str, Format] = MappingProxyType({module.FORMAT.name: module.FORMAT for module in _MODULES})


def by_name(name: str) -> Format:
    """The format called `name`.

    Raises:
        ConfigError: There is none.
    """
    if name not in FORMATS:
        raise ConfigError(f"--format {name}: no such format (allowed {', '.join(FORMATS)})")
    return FORMATS[name]
