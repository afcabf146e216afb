"""A rehearsal: the room, flown with the software vehicle; the simulator's truth is not looked at."""

from ivl.links import sil
from ivl.links.clock import FINE, Clock, LockStep, WallClock
from ivl.links.landing_flight import Rollout
from ivl.links.options import Options
from ivl.links.sites.base import Visit
from ivl.links.sites.room import Room
from ivl.links.tables import Session


class Rehearsal(Room):
    """A room in which the software vehicle is flown as if it were a drone; of its voltage see `Simulator`."""

    battery_is_flown = False

    @staticmethod
    def suits(session: Session, options: Options) -> bool:
        """A software vehicle with which a drone is to be rehearsed."""
        return sil.is_sil(session) and options.rehearse

    @staticmethod
    def make_clock(session: Session, visit: Visit) -> Clock:
        """Lock-step at the pace of a drone's commands, unless cameras with a time of their own follow the vehicle."""
        return LockStep(session, FINE) if visit.tracking is None else WallClock()

    def make_ready(self, again: bool) -> None:
        """Put it on the floor, whatever it does."""
        del again
        sil.put_on_floor(self._vehicle, self._room.home_m)

    def _place(self, rollout: Rollout) -> None:
        """Ask the operator, and do what the operator's hands do with a drone."""
        super()._place(rollout)
        sil.put_on_floor(self._vehicle, self._room.home_m)
