"""A room with a ceiling, and an operator who places the vehicle and tells what came of a landing."""

import math
from collections.abc import Callable, Iterator

import numpy as np

from ivl.check import Check
from ivl.errors import ConfigError
from ivl.links import operators, preflight, sil
from ivl.links.clock import Clock, WallClock
from ivl.links.landing_flight import (
    Landing,
    Outcome,
    Rollout,
    check_abort,
    end_level_out,
    make_safe,
    safe_or_why,
)
from ivl.links.operators import ConsoleOperator, Upcoming
from ivl.links.options import Options
from ivl.links.packets import Phase, Recording, Request
from ivl.links.recovery import AskOperator, Recovery
from ivl.links.sites.base import Visit, give_back_time
from ivl.links.stop import Stop
from ivl.links.tables import Session
from ivl.links.tracking import HOME_M, Tracked
from ivl.links.trouble import Cause, Trouble, of_checks
from ivl.links.truth import Resting, note_no_go, outcome_of_flight, suggest_legs
from ivl.links.vehicle import Command, Supervisor, Vehicle
from ivl.outcome import verdict
from ivl.site.require import HOW, refuse_unfit
from ivl.startpoint import Point, start_point
from ivl.surface import Surface

CLIMB_MPS, TRAVEL_MPS = 0.5, 0.5
NEAR_M = 0.1
"""The vehicle is where it was sent when its estimate is as near as this."""
AWAY_S = 120.0
"""An operator who has not answered for so long was away: the vehicle is checked again before it is armed."""
SURE_LEGS = (0, 4)
"""Legs of which a resting pose alone tells: hanging level, or not at the ceiling."""
_FIT = Supervisor.ARMED | Supervisor.CAN_FLY
_LOOK_S = 0.02
_TURNED = (Phase.COAST, Phase.ATTACHED, Phase.DONE)
"""Phases after a flip, which the recorder has: nobody needs to look how near the vehicle came."""
_SETTLE_S, _IDLE_S, _ARM_S, _END_S = 1.0, 3.0, 8.0, 30.0
_VOLTAGE_S = 10.0


class Room:
    """A site where nobody knows more than recorder, cameras and operator see."""

    contact_is_seen, is_flown = False, True

    def __init__(self, vehicle: Vehicle, visit: Visit) -> None:
        """Any vehicle.

        Raises:
            ConfigError: There is no site file, it does not suit, or the approach does not fit under the ceiling.
        """
        if visit.site_file is None:
            raise ConfigError(
                f"{vehicle.session.uri}: no software vehicle: a drone flies only in a room that is described: {HOW}"
            )
        self._room = visit.site_file
        if not sil.is_sil(vehicle.session):
            refuse_guesses(vehicle.session.uri, visit)
        self._vehicle, self._visit = vehicle, visit
        self._world, self._say = visit.world, visit.options.say
        self._tracking: Tracked | None = visit.tracking
        self._start_W_m = start_point(visit.world, visit.experiment)
        self._stop = Stop(visit.options.folder, self._room.stop == "motors_off", self._say)
        self._operator = visit.options.operator or ConsoleOperator()

    @staticmethod
    def suits(session: Session, options: Options) -> bool:
        """Every vehicle can be flown in a room."""
        del session, options
        return True

    @staticmethod
    def recovery(session: Session, options: Options) -> Recovery:
        """The operator is asked, and flying goes on."""
        del session
        return AskOperator(options.operator or ConsoleOperator(), options.say)

    @staticmethod
    def make_clock(session: Session, visit: Visit) -> Clock:
        """Real time."""
        del session, visit
        return WallClock()

    # ---- connection

    def make_ready(self, again: bool) -> None:
        """A vehicle that our own flight has left somewhere comes down first; one that lies is asked to forget it."""
        vehicle = self._vehicle
        if again:
            self._say(f"vehicle: {make_safe(vehicle, self._room.emergency_m)}")
        self._forget_crash()

    def _forget_crash(self) -> None:
        """Ask for it; only upright, and whether it is forgotten is a check."""
        if Supervisor.CRASHED in self._vehicle.supervisor():
            self._vehicle.recover()

    def checks(self) -> Iterator[Check]:
        """The whole preflight."""
        return preflight.checks(self._vehicle, battery_V_min=self._room.battery.rest_V_min)

    def prove(self, fly: Callable[[Rollout], Outcome]) -> None:
        """Do nothing: nobody knows what must come of a landing."""

    def leave(self) -> None:
        """Bring the vehicle down and disarm it, and say what was done."""
        self._come_down()
        give_back_time(self._vehicle.clock, self._say)

    def _come_down(self) -> None:
        self._say(f"vehicle: {safe_or_why(self._vehicle, self._room.emergency_m)}")

    def rest_V(self) -> float:
        """Ask for another battery until one is good; a vehicle without power is a lost link, which the caller sees."""
        vehicle, needed_V = self._vehicle, self._room.battery.rest_V_min
        while not vehicle.battery_V >= needed_V:
            self._operator.change_battery(vehicle.battery_V, needed_V)
            vehicle.pause(0.5)  # what was sent before is not what the new battery says
            vehicle.hear_battery(_VOLTAGE_S)
        return self._battery_V()

    def _battery_V(self) -> float:
        """Voltage at rest, now, of the battery that drives the motors; NaN: nobody knows."""
        return self._vehicle.battery_V

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
        vehicle = self._vehicle
        began_s = vehicle.clock.now_s()
        self._place(rollout)
        if vehicle.clock.now_s() - began_s > AWAY_S:
            self._check_again()
        self._check_gate()
        self._stop.begin(vehicle)
        self._check_home()
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

    def _place(self, rollout: Rollout) -> None:
        """Return when the vehicle stands upright at home, nobody is near, and this policy may be flown."""
        upcoming = self._upcoming(rollout)
        self._visit.options.observer.announced(upcoming)
        self._operator.place(upcoming)

    def _upcoming(self, rollout: Rollout) -> Upcoming:
        experiment = self._visit.experiment
        form = experiment.policy.shape
        return Upcoming(
            rollout.stream + 1, experiment.budget, form, rollout.theta, experiment.policy.bounds,
            self._visit.forecasts.of(rollout.theta, self._battery_V()),
            self._start_W_m, self._room.home_m,
        )  # fmt: skip

    def _check_again(self) -> None:
        """The operator was away: battery, link, tracking and supervisor may be other than they were."""
        self._say(f"{Cause.AWAY}: nobody answered for {AWAY_S:g} s, so the vehicle is checked again")
        self._forget_crash()
        trouble = of_checks(list(self.checks()), Supervisor.LOCKED in self._vehicle.supervisor())
        if trouble is not None:
            raise trouble

    def _check_gate(self) -> None:
        """The cameras see the vehicle, and its battery is good."""
        if self._tracking is not None and (problems := self._tracking.problems()):
            raise Trouble(Cause.TRACKING, "; ".join(problems))
        self.rest_V()

    def _check_home(self) -> None:
        """Refuse a vehicle that is not where the site has its home: then frames or heights are not as they say."""
        x, y, z = self._vehicle.position_W_m
        away_m = math.dist((x, y), self._room.home_m)
        if not (away_m <= HOME_M and abs(z) <= HOME_M):
            home = self._room.home_m
            raise Trouble(
                Cause.NOT_HOME,
                f"the vehicle is at ({x:.2f}, {y:.2f}, {z:.2f}) m (allowed within {HOME_M:g} m of home "
                f"({home[0]:.2f}, {home[1]:.2f}, 0)): put it there, or correct home_m or the tracking's frame",
            )

    def _make_fit(self) -> None:
        """Recover from a crash, and arm."""
        vehicle = self._vehicle
        vehicle.check_stop()
        bits = vehicle.supervisor()
        if Supervisor.LOCKED in bits:
            raise Trouble(Cause.LOCKED, "the vehicle is locked: switch it off and on again")
        if Supervisor.CRASHED in bits and not vehicle.recover():
            raise Trouble(Cause.CRASHED, "the vehicle counts as crashed: set it upright on the floor")
        if Supervisor.ARMED not in vehicle.supervisor():
            vehicle.arm(True)
        # one that has just landed, or was just armed, refuses a take-off until its supervisor lets it fly
        vehicle.wait(lambda: _FIT in vehicle.supervisor(), _ARM_S, "arming", 0.1)

    def _wait_near(self, target_W_m: Point, duration_s: float) -> None:
        vehicle = self._vehicle
        vehicle.wait(
            lambda: vehicle.check_stop() or math.dist(vehicle.position_W_m, target_W_m) < NEAR_M,
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
        nearest = Nearest(self._world.surface, self._position_W_m)
        vehicle.wait(
            lambda: nearest.look() or vehicle.phase in _TURNED or self._is_over(),
            _END_S,
            "end of the approach",
            _LOOK_S,
        )
        vehicle.wait(self._is_over, _END_S, "end of the landing")
        level_out = None
        if vehicle.phase == Phase.LEVEL_OUT:
            level_out = end_level_out(vehicle, self._world.surface)
            if vehicle.aborted_by:
                vehicle.wait(self._is_over, _END_S, "landing after an abort in the level-out")
        self._stop.end()
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
        seen = self._judge(suggested, resting, note, is_tracked=seen_at is not None)
        if seen.discard:
            raise Trouble(Cause.DISCARDED, f"discarded by the operator{f' ({why})' if why else ''}")
        outcome = outcome_of_flight(recording, vehicle.snapshot(), seen.n_legs, seen.body_contact, resting, self._world)
        if not outcome["triggered"][0]:  # then the recorder has the floor alone
            outcome["d_min_m"] = np.fmin(outcome["d_min_m"], nearest.gap_m)
        outcome["p_land"], outcome["d_decided_m"] = decision
        outcome["decided"] = int(math.isfinite(decision[0]))
        if called_off:
            note_no_go(outcome, level_out.nearest_m if level_out else math.inf, aborted)
        return outcome, recording

    def end_flight(self) -> None:
        """The terminal's keys belong to the questions again."""
        self._stop.end()

    def _position_W_m(self) -> Point:
        """Where the cameras see the vehicle, or else its estimate has it."""
        seen = self._tracking.resting() if self._tracking is not None else None
        return seen.p_W_m if seen is not None else self._vehicle.position_W_m

    def _judge(self, suggested: operators.Seen, resting: Resting, note: str, is_tracked: bool) -> operators.Seen:
        """What came of it, by who judges at this site; tracking does where it is sure, and what it says is told."""
        sure = is_tracked and suggested.n_legs in SURE_LEGS
        if self._room.judge == "tracking" and sure:
            self._say(f"judged by tracking: {suggested.n_legs} legs{f' ({note})' if note else ''}")
            return suggested
        return self._operator.confirm(suggested, resting, note)

    def rotor_V(self, landing: Landing) -> float:
        """What its power management tells: a drone has one battery."""
        return landing.battery_V

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


def refuse_guesses(uri: str, visit: Visit) -> None:
    """Refuse what is right for a rehearsal alone: whatever its link, this is a drone.

    Raises:
        ConfigError: It is to be rehearsed with, its site is a guess, or it is not tracked as its site says.
    """
    site = visit.site_file
    if visit.options.rehearse:
        raise ConfigError(f"--rehearse: {uri} leads to no software vehicle; leave --uri out, and one is started")
    if site is not None:
        refuse_unfit(site, visit.experiment, rehearse=False)
        if site.mocap is not None and visit.tracking is None:
            raise ConfigError(f"{uri}: no software vehicle: track it as its site says, with --mocap and the site file")


class Nearest:
    """The least distance from the surface at which a vehicle was seen."""

    def __init__(self, surface: Surface, position_W_m: Callable[[], Point]) -> None:
        """Nothing was seen yet."""
        self._surface, self._position_W_m = surface, position_W_m
        self.gap_m = math.inf

    def look(self) -> bool:
        """Look once; returns false, so that it can stand before a condition that is waited for."""
        gap_m = float(self._surface.gap_m(self._position_W_m()))
        if gap_m < self.gap_m:
            self.gap_m = gap_m
        return False


def resting_by_estimate(vehicle: Vehicle, recording: Recording) -> Resting:
    """Where the vehicle's own estimate has it, with the attitude of the recorder's last row."""
    return Resting.of(vehicle.position_W_m, recording.rows["q_WB"][-1] if len(recording.rows) else None)
