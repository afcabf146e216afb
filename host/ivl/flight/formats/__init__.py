"""Forms of logs that people have. A new one is a module here and a row of the table."""

from collections.abc import Mapping
from types import MappingProxyType

from ivl.errors import ConfigError
from ivl.flight.formats import habas2021
from ivl.flight.log import Format

FORMATS: Mapping[str, Format] = MappingProxyType({module.FORMAT.name: module.FORMAT for module in (habas2021,)})


def by_name(name: str) -> Format:
    """The format called `name`.

    Raises:
        ConfigError: There is none.
    """
    if name not in FORMATS:
        raise ConfigError(f"--format {name}: no such format (allowed {', '.join(FORMATS)})")
    return FORMATS[name]
