"""Options of commands that fly at a site: the site file, and what follows from it."""

from typing import Annotated

import typer

from ivl import links
from ivl.errors import ConfigError
from ivl.experiment import Experiment
from ivl.mocap import config as mocap_config
from ivl.mocap.config import MocapConfig
from ivl.site import file as site_file
from ivl.site import require

Site = Annotated[
    str | None, typer.Option("--site", metavar="FILE", help="Room where it is flown; see `ivl site --help`.")
]


def tracker(chosen: Experiment, uri: str | None, mocap: str | None, rehearse: bool = False) -> MocapConfig | None:
    """The tracking system of a flight: as named, else that of a drone's site; a rehearsal has none of its own.

    Raises:
        ConfigError: The site names one already, a rehearsed day has its own, or the name is none.
    """
    if mocap is not None and uri is not None and uri.startswith(links.REHEARSAL_SCHEME):
        raise ConfigError(require.OWN_CAMERAS)
    own = site_file.load(chosen.site).mocap if chosen.site and uri and require.is_drone(uri) and not rehearse else None
    if mocap is None:
        return own
    if own is not None:
        raise ConfigError(f"--mocap {mocap}: the site has its tracking system under mocap: leave --mocap out")
    return mocap_config.load(mocap)
