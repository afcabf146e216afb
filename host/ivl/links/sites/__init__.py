"""Sites, where a vehicle is flown. A new one of this package is a file in this folder and a row here.

site = site_for(session, options)(vehicle, visit)

A site of another package is named by an entry point of the group `ivl.sites` (`ivl.plugins`), and is asked before those
of this package, so it has to say precisely which vehicles suit it.
"""

import inspect
from typing import Any, cast

from ivl.errors import ConfigError
from ivl.links.options import Options
from ivl.links.sites.base import Site
from ivl.links.sites.rehearsal import Rehearsal
from ivl.links.sites.room import Room
from ivl.links.sites.simulator import Simulator
from ivl.links.tables import Session
from ivl.plugins import Registry

SITES: tuple[type[Site], ...] = (Simulator, Rehearsal, Room)
"""In the order in which they are asked; the last one suits every vehicle."""


def _made(name: str, found: Any) -> type[Site]:
    """A site of another package.

    Raises:
        ConfigError: It lacks something that a site has.
    """
    if not inspect.isclass(found):
        raise ConfigError(f"site {name!r}: is no class")
    parts = (part for part in vars(Site) if not part.startswith("_"))
    missing = sorted(part for part in {*parts, *Site.__annotations__} if not hasattr(found, part))
    if missing:
        raise ConfigError(f"site {name!r}: {found.__name__} lacks {', '.join(missing)} (ivl.links.sites.base.Site)")
    return cast(type[Site], found)


OTHERS: Registry[type[Site]] = Registry("site", _made, {})
"""Those of other packages, in the order of their names."""


def site_for(session: Session, options: Options) -> type[Site]:
    """The first site that suits a vehicle that is flown in this way.

    Raises:
        ConfigError: A site of another package cannot be imported, or is none.
    """
    return next(site for site in (*OTHERS.found().values(), *SITES) if site.suits(session, options))
