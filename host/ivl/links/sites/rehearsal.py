"""A rehearsal: the room, flown with the software vehicle.

Without a day (`ivl.rehearsal`) nothing goes wrong, and the simulator's truth is not looked at. With one its cameras
follow the vehicle, its battery drives the motors, and the vehicle is brought back by the hands of an operator.
"""

import math

from ivl.links import sil
from ivl.links.clock import FINE, Clock, LockStep, WallClock
from ivl.links.landing_flight import Landing, Rollout
from ivl.links.options import Options
from ivl.links.sites.base import Visit
from ivl.links.sites.room import Room
from ivl.links.tables import Session
from ivl.links.vehicle import Vehicle
from ivl.mocap import config as mocap_config
from ivl.rehearsal.cameras import Cameras, Watched


class Rehearsal(Room):
    """A room in which the software vehicle is flown as if it were a drone."""

    def __init__(self, vehicle: Vehicle, visit: Visit) -> None:
        """As the base; on a rehearsed day cameras follow the vehicle, unless others do."""
        super().__init__(vehicle, visit)
        self._day = visit.options.day
        if self._day is not None and visit.tracking is None:
            cameras = Cameras(vehicle.session, self._room.mocap or mocap_config.load("simulator"))
            vehicle.clock = Watched(vehicle.clock, cameras.look)
            cameras.watch_over(vehicle)
            self._tracking = cameras
            self._day.meets(vehicle, cameras)

    @staticmethod
    def suits(session: Session, options: Options) -> bool:
        """A software vehicle with which a drone is to be rehearsed."""
        return sil.is_sil(session) and options.rehearse

    @staticmethod
    def make_clock(session: Session, visit: Visit) -> Clock:
        """Lock-step at the pace of a drone's commands, unless cameras with a time of their own follow the vehicle."""
        return LockStep(session, FINE) if visit.tracking is None else WallClock()

    def make_ready(self, again: bool) -> None:
        """On a rehearsed day as a drone; else it is put on the floor, whatever it does."""
        if self._day is not None:
            super().make_ready(again)
        else:
            sil.put_on_floor(self._vehicle, self._room.home_m)

    def _place(self, rollout: Rollout) -> None:
        """Ask the operator, and do what the operator's hands do with a drone."""
        if self._day is None:
            super()._place(rollout)
            sil.put_on_floor(self._vehicle, self._room.home_m)
            return
        self._day.begin(rollout.stream + 1)
        super()._place(rollout)
        self._day.stands()

    def _make_fit(self) -> None:
        """As the base; then it takes off."""
        super()._make_fit()
        if self._day is not None:
            self._day.takes_off()

    def before_approach(self, rollout: Rollout) -> None:
        """As the base; then most of what goes wrong does."""
        super().before_approach(rollout)
        if self._day is not None:
            self._day.hovers()

    def _battery_V(self) -> float:
        """As the base on a rehearsed day; else the battery that a software vehicle tells of drives no motors."""
        return math.nan if self._day is None else super()._battery_V()

    def rotor_V(self, landing: Landing) -> float:
        """As the base on a rehearsed day; else the battery that a software vehicle tells of drives no motors."""
        return math.nan if self._day is None else super().rotor_V(landing)

    def end_flight(self) -> None:
        """As the base; the battery has less."""
        super().end_flight()
        if self._day is not None:
            self._day.ends()
