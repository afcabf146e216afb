"""Motion capture of one connection: poses to the vehicle, an abort when they stop in time, the resting pose."""

from contextlib import ExitStack
from typing import Any, Protocol

from ivl.check import Check
from ivl.links.tables import Session
from ivl.links.truth import Resting
from ivl.links.vehicle import Vehicle
from ivl.mocap.config import MocapConfig
from ivl.mocap.frame import FlightFrame
from ivl.mocap.guard import LossGuard
from ivl.mocap.simulated import SimulatedRoom
from ivl.mocap.stream import Mocap


class Tracked(Protocol):
    """What is asked of a tracking system while a vehicle is flown."""

    def problems(self) -> list[str]:
        """What speaks against a flight now, one line each."""
        ...

    def resting(self) -> Resting | None:
        """Where the cameras see the vehicle; None if they do not."""
        ...


def check_of(problem: str) -> Check:
    """A check that has failed."""
    return Check("motion capture", False, problem, "good, fast and steady enough", "see ivl mocap")


class Tracking:
    """A tracking system that follows the vehicle of a session."""

    def __init__(self, session: Session, config: MocapConfig, frame: FlightFrame | None = None) -> None:
        """Start it, and wait until the pose is good; `frame` is that of the flight.

        Raises:
            LinkError: It is not good in time; the message says why.
        """
        self._stack = ExitStack()
        self.room: SimulatedRoom | None = None
        """Cameras of a software vehicle (system `simulator`); their faults are attributes."""
        try:
            request: dict[str, Any] | None = None
            if config.system == "simulator":
                self.room = self._stack.enter_context(SimulatedRoom(session, config.body))
                session.write({"sil.pose_source": 1})
                request = self.room.request(config)
            session.write({name: value for name, value in config.vehicle_params().items() if session.has_param(name)})
            self.mocap = self._stack.enter_context(Mocap(config, session.cf.extpos, request, frame))
            self.mocap.wait_until_good()
        except BaseException:
            self.close()
            raise

    def watch_over(self, vehicle: Vehicle) -> None:
        """From now on a loss before the trigger aborts the flight, and keeps it from being scored."""
        self.mocap.guard = LossGuard(
            lambda: int(vehicle.phase), vehicle.abort, flies=lambda: vehicle.seems_to_fly, spoil=vehicle.spoil
        )

    def problems(self) -> list[str]:
        """What speaks against a flight now, one line each."""
        return self.mocap.problems()

    def checks(self) -> list[Check]:
        """One check for each thing that speaks against a flight now."""
        return [check_of(text) for text in self.problems()]

    def resting(self) -> Resting | None:
        """Where the cameras see the vehicle; None if they do not."""
        state = self.mocap.state()
        if state.pose is None or state.age_s > self.mocap.config.restart_s:
            return None
        return Resting.of(state.pose.p_W_m, state.pose.q_WB)

    def close(self) -> None:
        """End it; again does nothing."""
        self._stack.close()
