"""Sites, where a vehicle is flown. A new one is a file in this folder and a row here.

site = site_for(session, options)(vehicle, visit)
"""

from ivl.links.options import Options
from ivl.links.sites.base import Site
from ivl.links.sites.rehearsal import Rehearsal
from ivl.links.sites.room import Room
from ivl.links.sites.simulator import Simulator
from ivl.links.tables import Session

SITES: tuple[type[Site], ...] = (Simulator, Rehearsal, Room)
"""In the order in which they are asked; the last one suits every vehicle."""


def site_for(session: Session, options: Options) -> type[Site]:
    """The first site that suits a vehicle that is flown in this way."""
    return next(site for site in SITES if site.suits(session, options))
