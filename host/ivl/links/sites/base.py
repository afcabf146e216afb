"""What a site is: where a vehicle is flown, and all that depends on where.

    make_clock -> (connect) -> make_ready, checks -> prove -> landings: to_start, before_approach, outcome -> leave

A site belongs to one connection of a vehicle. Whoever flies asks it, and does not need to know what kind of site it is.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Protocol

from ivl.check import Check
from ivl.errors import LinkError
from ivl.experiment import Experiment
from ivl.links.clock import Clock
from ivl.links.forecast import Forecasts
from ivl.links.landing_flight import Landing, Outcome, Rollout
from ivl.links.options import Options
from ivl.links.packets import Recording
from ivl.links.recovery import Recovery
from ivl.links.tables import Session
from ivl.links.tracking import Tracking
from ivl.links.vehicle import Vehicle
from ivl.site.file import SiteFile
from ivl.startpoint import Point
from ivl.world import World


@dataclass(frozen=True)
class Visit:
    """What a vehicle comes to a site for.

    Attributes:
        experiment: What is flown.
        world: Its world here.
        options: How it is flown.
        site_file: The room as measured; None: a simulator has none.
        tracking: Motion capture that follows the vehicle; None: there is none of ours.
        forecasts: What the simulator expects of a policy.
        warn: Called with what a reader of the results has to know.
    """

    experiment: Experiment
    world: World
    options: Options
    site_file: SiteFile | None
    tracking: Tracking | None
    forecasts: Forecasts
    warn: Callable[[str], None]


class Site(Protocol):
    """Where is flown.

    Attributes:
        contact_is_seen: Whether outcomes there tell when the first leg touched, and not when the accelerometer noticed.
        is_flown: Whether a vehicle flies there whose flights nobody can repeat bit for bit.

    Unless a method says otherwise, it may raise LinkError (the link is gone) and RolloutError (not now, and why).
    """

    contact_is_seen: bool
    is_flown: bool

    def __init__(self, vehicle: Vehicle, visit: Visit) -> None:
        """The vehicle has been connected, and nothing has been asked of it yet."""
        ...

    @staticmethod
    def suits(session: Session, options: Options) -> bool:
        """Whether this is the site of a vehicle that is flown in this way."""
        ...

    @staticmethod
    def recovery(session: Session, options: Options) -> Recovery:
        """Who decides whether flying goes on after a flight that does not count; asked at the first connection."""
        ...

    @staticmethod
    def make_clock(session: Session, visit: Visit) -> Clock:
        """Who makes time pass for the vehicle there."""
        ...

    # ---- connection

    def make_ready(self, again: bool) -> None:
        """Bring the vehicle into the state that `checks` expect; `again`: what it does comes from our own flight."""
        ...

    def checks(self) -> Iterator[Check]:
        """What must be right before anything is flown, beside policy bounds and motion capture."""
        ...

    def prove(self, fly: Callable[[Rollout], Outcome]) -> None:
        """Try the vehicle with a landing of its own, if the site can tell what must come of it; called once."""
        ...

    def leave(self) -> None:
        """Bring the vehicle down and leave it as it was found; a failure is reported, not raised."""
        ...

    def rest_V(self) -> float:
        """Voltage at rest of the battery for the next flight; one that is too empty is changed. NaN: nobody knows."""
        ...

    # ---- a landing

    def to_start(self, rollout: Rollout) -> Point:
        """Return when the vehicle hovers, not yet under the core's control; tells where the approach is to begin."""
        ...

    def before_approach(self, rollout: Rollout) -> None:
        """Called in hover, with the policy in force."""
        ...

    def outcome(self, policy_seq: int) -> tuple[Outcome, Recording | None]:
        """Wait for the end of the landing and tell what came of it; the recording is stored, unless it is None."""
        ...

    def end_flight(self) -> None:
        """The flight is over, however it ended; must not raise, and may come twice."""
        ...

    def rotor_V(self, landing: Landing) -> float:
        """Voltage of the battery that drives the motors, in the hover before the approach; NaN: nobody knows."""
        ...

    def told(self, landing: Landing) -> str:
        """What people are told of a landing that counts; empty: nothing."""
        ...

    # ---- recovery, whose failures are reported, not raised

    def after_refusal(self) -> None:
        """The vehicle has refused a policy before its approach, and is asked for the next one."""
        ...

    def after_fault(self) -> None:
        """A flight went wrong with the link still there; a new connection follows, if there is another attempt."""
        ...


def give_back_time(clock: Clock, say: Callable[[str], None]) -> None:
    """Let a vehicle's time pass again, or it would stand still for whoever comes next; a failure is reported."""
    try:
        clock.close()
    except LinkError as error:
        say(f"time of the vehicle not restored: {error}")
