"""The simulator of a software vehicle: reset into the air, start and outcome as the simulator has them."""

import math
from collections.abc import Callable, Iterator

from ivl.check import Check
from ivl.errors import LinkError
from ivl.links import preflight, sil
from ivl.links.clock import COARSE, Clock, LockStep, WallClock
from ivl.links.landing_flight import FlyingEnds, Landing, Outcome, Rollout, safe_or_why
from ivl.links.options import Options
from ivl.links.packets import Phase, Recording, Request
from ivl.links.recovery import Attempts, Recovery
from ivl.links.sites.base import Visit, give_back_time
from ivl.links.tables import Session
from ivl.links.vehicle import Command, Vehicle
from ivl.startpoint import Point

_DIFFERENCES_TOLD = 6
_IDLE_S, _READY_S = 3.0, 3.0


class OtherWorld(FlyingEnds):
    """The software vehicle simulates another world than the experiment's: what is learned there holds only there."""


class Simulator:
    """A site where everything is known, and where a landing has the bits that it has in this process."""

    contact_is_seen, is_flown = True, False

    def __init__(self, vehicle: Vehicle, visit: Visit) -> None:
        """The vehicle must be a software vehicle."""
        self._vehicle, self._visit = vehicle, visit
        self._extras = sil.Sil(vehicle)
        self._differs = False

    @staticmethod
    def suits(session: Session, options: Options) -> bool:
        """A software vehicle, unless a drone is to be rehearsed with it."""
        return sil.is_sil(session) and not options.rehearse

    @staticmethod
    def recovery(session: Session, options: Options) -> Recovery:
        """There is nobody to ask."""
        return Attempts(session.uri, options.say)

    @staticmethod
    def make_clock(session: Session, visit: Visit) -> Clock:
        """Lock-step, unless cameras follow the vehicle, which have a time of their own."""
        return LockStep(session, COARSE) if visit.tracking is None else WallClock()

    # ---- connection

    def make_ready(self, again: bool) -> None:
        """Compare worlds with each connection, since a vehicle may have been started anew, and otherwise; then reset.

        Raises:
            OtherWorld: It simulates another world, and the options do not allow that.
        """
        del again
        found = sil.differences(self._vehicle.session, self._visit.world)
        if found:
            rest = f", and {len(found) - _DIFFERENCES_TOLD} more" if len(found) > _DIFFERENCES_TOLD else ""
            self._meet_other_world(", ".join(found[:_DIFFERENCES_TOLD]) + rest)
        sil.reset(self._vehicle)

    def checks(self) -> Iterator[Check]:
        """The tables alone: the reset before each landing mends the rest, and lock-step waits for a bad link."""
        yield preflight.tables(self._vehicle)

    def prove(self, fly: Callable[[Rollout], Outcome]) -> None:
        """Whether one landing there has the bits that it has here; useless where the worlds are known to differ."""
        if self._differs:
            return
        experiment = self._visit.experiment
        policy = experiment.policy
        probe = Rollout(tuple(policy.mu0))
        here = self._visit.world.rollouts(
            experiment.speed_mps, experiment.angle_deg, *probe.theta, form=policy.form,
            seed=0, stream=0, start=experiment.start, threads=1,
        )  # fmt: skip
        if fly(probe).tobytes() != here.tobytes():
            self._meet_other_world("all parameters are the same, but one landing has other bits: another version?")

    def _meet_other_world(self, what: str) -> None:
        self._differs = True
        visit = self._visit
        text = f"{self._vehicle.session.uri} simulates another world than {visit.experiment.name}: {what}"
        if not visit.options.other_world:
            raise OtherWorld(f"{text}; start the right one with: {visit.options.start_hint}")
        visit.warn(text)

    def leave(self) -> None:
        """Bring the vehicle down, end the extras of the simulator, and let time pass again."""
        safe_or_why(self._vehicle)
        try:
            self._extras.close()
        except LinkError as error:
            self._visit.options.say(f"not restored: {error}")
        give_back_time(self._vehicle.clock, self._visit.options.say)

    # ---- a landing

    def to_start(self, rollout: Rollout) -> Point:
        """Reset; the simulator puts the vehicle to the start of each landing itself, when its approach begins."""
        experiment = self._visit.experiment
        self._vehicle.has_begun = True
        spec = sil.Spec(experiment.speed_mps, experiment.angle_deg, rollout.seed, rollout.stream, experiment.start)
        return self._extras.reset(spec)

    def before_approach(self, rollout: Rollout) -> None:
        """Do nothing: the reset has said where the landing begins."""

    def outcome(self, policy_seq: int) -> tuple[Outcome, Recording | None]:
        """Return what the simulator knows, and the recording if it is wanted."""
        vehicle = self._vehicle
        outcome = self._extras.wait_for_outcome(policy_seq)
        if vehicle.phase == Phase.LEVEL_OUT:  # called off, and hovers: taken over, as a drone would be
            vehicle.ask_for(Command(Request.HOVER, vehicle.position_W_m), (Phase.READY,), _READY_S)
        if not self._visit.options.keep_recordings:
            return outcome, None
        # the end of the cycle is also that of a recording which is not full yet
        vehicle.ask_for(Command(Request.IDLE), (Phase.IDLE,), _IDLE_S)
        return outcome, vehicle.recording(policy_seq)

    def end_flight(self) -> None:
        """Do nothing."""

    def rest_V(self) -> float:
        """Nothing that lasts: each landing has a battery of its own."""
        return math.nan

    def rotor_V(self, landing: Landing) -> float:
        """That of the world's battery, which is another one than that of the vehicle's power management."""
        del landing
        return self._extras.rotor_V

    def told(self, landing: Landing) -> str:
        """Say nothing: it would be many lines a second."""
        del landing
        return ""

    # ---- recovery

    def after_refusal(self) -> None:
        """Do nothing: the next landing begins with a reset."""

    def after_fault(self) -> None:
        """Time passes again, since there may be no other attempt; the next connection begins with a reset."""
        give_back_time(self._vehicle.clock, self._visit.options.say)
