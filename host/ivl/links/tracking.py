"""Motion capture of one connection: poses to the vehicle, an abort when they stop in time, the resting pose."""

import math
from collections.abc import Iterator
from contextlib import ExitStack
from typing import Any, Protocol

from ivl.check import Check
from ivl.errors import LinkError
from ivl.links.tables import Session
from ivl.links.truth import Resting
from ivl.links.vehicle import Vehicle
from ivl.mocap.config import MocapConfig
from ivl.mocap.frame import FlightFrame
from ivl.mocap.guard import LossGuard
from ivl.mocap.simulated import SimulatedRoom
from ivl.mocap.stream import Mocap
from ivl.site.file import SiteFile

HOME_M = 0.3
"""A vehicle stands at home when it is as near as this, along the floor and in height."""
AGREES_M = 0.05
"""The vehicle's estimate and the cameras agree when they are as near as this."""
_SETTLE_S = 1.0


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
                frame = None  # true poses are in the flight frame, whatever the site says of its axes
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


def site_checks(vehicle: Vehicle, site: SiteFile) -> Iterator[Check]:
    """Whether the site's tracking system sees the vehicle, where its estimate has it, and at home.

    None where the site says that somebody else tells the vehicle its poses.
    """
    if site.mocap is None:
        return
    frame = FlightFrame(site.surface.landing_point_m, site.heading_rad)
    try:
        tracking = Tracking(vehicle.session, site.mocap, frame)
    except LinkError as error:
        yield check_of(str(error))
        return
    try:
        vehicle.wait_in_wall_time(lambda: False, _SETTLE_S)  # its estimate follows the poses
        yield from _seen(vehicle, site, tracking)
    finally:
        tracking.close()


def _seen(vehicle: Vehicle, site: SiteFile, tracking: Tracking) -> Iterator[Check]:
    rates = tracking.mocap.state().rates
    problems = tracking.problems()
    yield Check(
        "motion capture", not problems, "; ".join(problems) or f"good, {rates.rate_hz:.0f} Hz",
        "good, fast and steady enough", "see ivl mocap",
    )  # fmt: skip
    resting = tracking.resting()
    if resting is None:
        return
    away_m = math.dist(resting.p_W_m, vehicle.position_W_m)
    yield Check(
        "estimate", away_m <= AGREES_M, f"{1e3 * away_m:.0f} mm from where the cameras see it",
        f"{1e3 * AGREES_M:.0f} mm or less", "look at body, axes and landing point; stabilizer.estimator 2",
    )  # fmt: skip
    x, y, z = resting.p_W_m
    home_m = math.dist((x, y), site.home_m)
    yield Check(
        "home", home_m <= HOME_M and abs(z) <= HOME_M, f"seen at ({x:.2f}, {y:.2f}, {z:.2f}) m",
        f"within {HOME_M:g} m of ({site.home_m[0]:.2f}, {site.home_m[1]:.2f}, 0)",
        "put the vehicle there, or correct home_m, landing_point_m or heading_deg",
    )  # fmt: skip
