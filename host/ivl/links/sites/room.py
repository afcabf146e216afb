"""A room with a ceiling, and an operator who places the vehicle and tells what came of a landing."""

import math
from collections.abc import Callable, Iterator

from ivl.errors import RolloutError
from ivl.links import operators, preflight
from ivl.links.clock import Clock, WallClock
from ivl.links.landing_flight import (
    Landing,
    Outcome,
    Point,
    Rollout,
    check_abort,
    end_level_out,
    make_safe,
    safe_or_why,
    start_point,
)
from ivl.links.operators import ConsoleOperator
from ivl.links.options import Options
from ivl.links.packets import Phase, Recording, Request
from ivl.links.sites.base import Visit, give_back_time
from ivl.links.tables import Session
from ivl.links.truth import Resting, note_no_go, outcome_of_flight, suggest_legs
from ivl.links.vehicle import Command, Supervisor, Vehicle
from ivl.outcome import verdict

CLIMB_MPS, TRAVEL_MPS = 0.5, 0.5
NEAR_M = 0.1
"""The vehicle is where it was sent when its estimate is as near as this."""
_SETTLE_S, _IDLE_S, _ARM_S, _END_S = 1.0, 3.0, 3.0, 30.0


class Room:
    """A site where nobody knows more than recorder, cameras and operator see."""

    contact_is_seen, battery_is_flown = False, True

    def __init__(self, vehicle: Vehicle, visit: Visit) -> None:
        """Any vehicle.

        Raises:
            ConfigError: The approach does not fit under the ceiling.
        """
        self._vehicle, self._visit = vehicle, visit
        self._world, self._tracking, self._say = visit.world, visit.tracking, visit.options.say
        self._start_W_m = start_point(visit.world, visit.experiment)
        self._operator = visit.options.operator or ConsoleOperator()

    @staticmethod
    def suits(session: Session, options: Options) -> bool:
        """Every vehicle can be flown in a room."""
        del session, options
        return True

    @staticmethod
    def make_clock(session: Session, visit: Visit) -> Clock:
        """Real time."""
        del session, visit
        return WallClock()

    # ---- connection

    def make_ready(self, again: bool) -> None:
        """A vehicle that our own flight has left somewhere comes down first; another one is not touched."""
        if again:
            self._say(f"vehicle: {make_safe(self._vehicle)}")

    def checks(self) -> Iterator[preflight.Check]:
        """The whole preflight."""
        return preflight.checks(self._vehicle)

    def prove(self, fly: Callable[[Rollout], Outcome]) -> None:
        """Do nothing: nobody knows what must come of a landing."""

    def leave(self) -> None:
        """Bring the vehicle down and disarm it, and say what was done."""
        self._come_down()
        give_back_time(self._vehicle.clock, self._say)

    def _come_down(self) -> None:
        self._say(f"vehicle: {safe_or_why(self._vehicle)}")

    # ---- recovery

    def after_refusal(self) -> None:
        """Bring the vehicle down: the next policy is flown from the floor."""
        self._come_down()

    def after_fault(self) -> None:
        """Bring the vehicle down; a new connection follows, to be sure."""
        self._come_down()

    # ---- a landing

    def to_start(self, rollout: Rollout) -> Point:
        """Ask the operator, arm, take off, fly to the start point."""
        del rollout
        vehicle = self._vehicle
        self._place()
        self._check_gate()
        vehicle.ask_for(Command(Request.IDLE), (Phase.IDLE,), _IDLE_S)
        self._make_fit()
        x, y, _ = vehicle.position_W_m
        height_m = self._start_W_m[2]
        duration_s = height_m / CLIMB_MPS + 1.0
        vehicle.take_off(height_m, duration_s)
        self._wait_near((x, y, height_m), duration_s)
        travel_s = math.dist((x, y), self._start_W_m[:2]) / TRAVEL_MPS + 1.0
        vehicle.go_to(self._start_W_m, travel_s)
        self._wait_near(self._start_W_m, travel_s)
        vehicle.pause(_SETTLE_S)
        return self._start_W_m

    def _place(self) -> None:
        """Return when the vehicle stands upright on the floor, and nobody is near."""
        self._operator.place(self._start_W_m)

    def _check_gate(self) -> None:
        """Ask for another battery until one is good; a vehicle without power is a lost link, which the caller sees."""
        vehicle = self._vehicle
        if self._tracking is not None and (problems := self._tracking.problems()):
            raise RolloutError("; ".join(problems))
        while not vehicle.battery_V >= preflight.BATTERY_V_MIN:
            self._operator.change_battery(vehicle.battery_V, preflight.BATTERY_V_MIN)
            vehicle.pause(0.5)

    def _make_fit(self) -> None:
        """Recover from a crash, and arm."""
        vehicle = self._vehicle
        bits = vehicle.supervisor()
        if Supervisor.LOCKED in bits:
            raise RolloutError("the vehicle is locked: switch it off and on again")
        if Supervisor.CRASHED in bits and not vehicle.recover():
            raise RolloutError("the vehicle counts as crashed: set it upright on the floor")
        if Supervisor.ARMED not in vehicle.supervisor():
            vehicle.arm(True)
            vehicle.wait(lambda: Supervisor.ARMED in vehicle.supervisor(), _ARM_S, "arming", 0.1)

    def _wait_near(self, target_W_m: Point, duration_s: float) -> None:
        vehicle = self._vehicle
        vehicle.wait(
            lambda: math.dist(vehicle.position_W_m, target_W_m) < NEAR_M,
            2.0 * duration_s + 3.0,
            "flight to ({:.2f}, {:.2f}, {:.2f}) m".format(*target_W_m),
        )

    def before_approach(self, rollout: Rollout) -> None:
        """Let the hover come to rest; the random numbers of a room are not ours."""
        del rollout
        self._vehicle.pause(_SETTLE_S)

    def outcome(self, policy_seq: int) -> tuple[Outcome, Recording | None]:
        """Wait until the motors are off for good, read the recorder, and let the operator confirm what is seen."""
        vehicle = self._vehicle
        vehicle.wait(self._is_over, _END_S, "end of the landing")
        level_out = None
        if vehicle.phase == Phase.LEVEL_OUT:
            level_out = end_level_out(vehicle, self._world.surface)
            if vehicle.aborted_by:
                vehicle.wait(self._is_over, _END_S, "landing after an abort in the level-out")
        vehicle.pause(_SETTLE_S)
        self._restore_tumble_check()
        aborted, called_off = vehicle.phase == Phase.ABORTED, vehicle.was_called_off()
        why = f"aborted: {vehicle.aborted_by}" if aborted else ""
        check_abort(vehicle)
        decision = level_out.decision if level_out else vehicle.decision()
        if aborted:
            # it stands upright, and the planner still has the start point: with IDLE its controller flies again
            vehicle.stop_planner()
        vehicle.ask_for(Command(Request.IDLE), (Phase.IDLE,), _IDLE_S)
        recording = vehicle.recording(policy_seq)
        seen_at = self._tracking.resting() if self._tracking is not None else None
        resting = seen_at or resting_by_estimate(vehicle, recording)
        suggested = operators.Seen(0 if aborted else suggest_legs(resting, self._world), body_contact=False)
        note = ", ".join(filter(None, ("called off by the policy" if called_off else "", why)))
        seen = self._operator.confirm(suggested, resting, note)
        if seen.discard:
            raise RolloutError(f"discarded by the operator{f' ({why})' if why else ''}")
        outcome = outcome_of_flight(recording, vehicle.snapshot(), seen.n_legs, seen.body_contact, resting, self._world)
        outcome["p_land"], outcome["d_decided_m"] = decision
        outcome["decided"] = int(math.isfinite(decision[0]))
        if called_off:
            note_no_go(outcome, level_out.nearest_m if level_out else math.inf, aborted)
        return outcome, recording

    def told(self, landing: Landing) -> str:
        """How it ended, as the operator has confirmed it, and the battery that the landing began with."""
        return f"flown: {verdict(landing.outcome[0])}, battery {landing.battery_V:.2f} V"

    def _is_over(self) -> bool:
        vehicle = self._vehicle
        return vehicle.phase in (Phase.DONE, Phase.LEVEL_OUT) or (
            vehicle.phase == Phase.ABORTED and vehicle.rule in ("landed", "lost")
        )

    def _restore_tumble_check(self) -> None:
        """The app has switched it on again; the stored parameter outlives a restart, so it is looked at."""
        name = "supervisor.tmblChckEn"
        session = self._vehicle.session
        if session.has_param(name) and session.read([name])[name] != 1:
            session.write({name: 1})


def resting_by_estimate(vehicle: Vehicle, recording: Recording) -> Resting:
    """Where the vehicle's own estimate has it, with the attitude of the recorder's last row."""
    return Resting.of(vehicle.position_W_m, recording.rows["q_WB"][-1] if len(recording.rows) else None)
