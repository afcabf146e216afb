"""One landing, from the ground or from a reset to its outcome: the one way to fly, whatever the link.

    to the start point -> hover, policy confirmed -> approach -> (the vehicle decides) -> outcome

How the vehicle comes to the start point, and who knows the outcome, depends on the site.
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ivl import native
from ivl.errors import LinkError, RolloutError
from ivl.experiment import Experiment
from ivl.links.packets import Phase, Recording, Request
from ivl.links.trouble import Trouble, of_rule
from ivl.links.vehicle import Command, Snapshot, Vehicle
from ivl.surface import Surface

if TYPE_CHECKING:
    from ivl.links.sites.base import Site

_READY_S, _APPROACH_S, _IDLE_S = 5.0, 5.0, 3.0
_AFTER_READY = (
    Phase.APPROACH, Phase.LEVEL_OUT, Phase.FLIP, Phase.COAST, Phase.ATTACHED, Phase.DONE, Phase.ABORTED,
)  # fmt: skip
_LEVEL_OUT_S, _LOOK_S, _STILL_M = 12.0, 0.25, 0.03
_ASIDE_MPS, _LOW_M = 0.5, 0.15

Outcome = np.ndarray[Any, np.dtype[np.void]]


@dataclass(frozen=True)
class Rollout:
    """What is to be flown: policy (units of its form) and the numbers that make a simulated landing repeatable."""

    theta: tuple[float, ...]
    seed: int = 0
    stream: int = 0


@dataclass(frozen=True)
class Landing:
    """What came of it.

    Attributes:
        rollout: What was flown.
        outcome: Its outcome record, shape (1,).
        policy_seq: Number under which the vehicle confirmed the policy.
        snapshot: What the vehicle latched at the trigger; its policy_seq is another if the trigger did not fire.
        recording: Flight recorder, None if it was not asked for.
        battery_V: Before take-off.
    """

    rollout: Rollout
    outcome: Outcome
    policy_seq: int
    snapshot: Snapshot
    recording: Recording | None
    battery_V: float


class FlyingEnds(RolloutError):
    """No further flight makes sense until a person has done something; the run can be resumed."""


class LandingFlight:
    """Flies landings of one experiment with one vehicle."""

    def __init__(self, vehicle: Vehicle, experiment: Experiment) -> None:
        """Fly the experiment's approach."""
        self.vehicle, self._experiment = vehicle, experiment

    def fly(self, site: "Site", rollout: Rollout) -> Landing:
        """Fly one landing.

        Raises:
            PolicyRefused: The vehicle does not fly this policy.
            RolloutError: The landing must not be scored and can be flown again.
            LinkError: The same, and the link is gone.
        """
        self.vehicle.begin_flight()
        try:
            return self._fly(site, rollout)
        finally:
            site.end_flight()

    def _fly(self, site: "Site", rollout: Rollout) -> Landing:
        vehicle = self.vehicle
        start_W_m = site.to_start(rollout)
        battery_V = vehicle.battery_V
        vehicle.offer_policy(self._experiment.policy.shape, rollout.theta)
        vehicle.ask_for(Command(Request.HOVER, start_W_m), (Phase.READY,), _READY_S)
        policy_seq = vehicle.confirm_policy()
        site.before_approach(rollout)
        experiment = self._experiment
        approach = Command(Request.APPROACH, start_W_m, experiment.speed_mps, math.radians(experiment.angle_deg))
        vehicle.ask_for(approach, _AFTER_READY, _APPROACH_S)
        outcome, recording = site.outcome(policy_seq)
        self._check(policy_seq, outcome)
        return Landing(rollout, outcome, policy_seq, vehicle.snapshot(), recording, battery_V)

    def _check(self, policy_seq: int, outcome: Outcome) -> None:
        """Refuse to score what was not this policy's landing."""
        vehicle = self.vehicle
        check_abort(vehicle)
        seen = vehicle.watch.values.get("ivl.trg_seq")
        if outcome["triggered"][0] and seen is not None and int(seen) != policy_seq:
            raise RolloutError(f"the trigger fired for policy {int(seen)}, not {policy_seq}")


def check_abort(vehicle: Vehicle) -> None:
    """Raise RolloutError if this flight was aborted for a reason that says nothing about its policy.

    Which rules are such reasons is a column of the flight core's table of rules.
    """
    if vehicle.aborted_by and vehicle.abort_reason:
        raise Trouble(vehicle.abort_cause, f"aborted: {vehicle.abort_reason}")
    if vehicle.spoiled_by:
        raise Trouble(vehicle.abort_cause, f"not to be scored: {vehicle.spoiled_by}")
    if native.library().rules().get(vehicle.aborted_by, False):
        raise Trouble(of_rule(vehicle.aborted_by), f"the vehicle aborted: {vehicle.aborted_by}")


@dataclass(frozen=True)
class LevelOut:
    """A level-out as the vehicle's logs tell of it.

    Attributes:
        decision: Probability of a landing and sensed distance (m) by which the approach was called off.
        nearest_m: Least distance from the surface, m.
    """

    decision: tuple[float, float]
    nearest_m: float


def end_level_out(vehicle: Vehicle, surface: Surface) -> LevelOut:
    """After a no-go: wait until the vehicle hovers by itself, ask it to HOVER, and let it land where it is.

    If it aborts instead, which is then in `vehicle.aborted_by`, it is left to that.

    Raises:
        RolloutError: It did not come to rest.
        LinkError: The link is gone.
    """
    nearest_m, still, last = math.inf, 0, vehicle.position_W_m

    def hovers() -> bool:
        nonlocal nearest_m, still, last
        here = vehicle.position_W_m
        nearest_m = min(nearest_m, float(surface.gap_m(here)))
        still = still + 1 if math.dist(here, last) < _STILL_M else 0
        last = here
        return still >= 2 or vehicle.phase != Phase.LEVEL_OUT

    vehicle.wait(hovers, _LEVEL_OUT_S, "hover after a no-go", _LOOK_S)
    told = LevelOut(vehicle.decision(), nearest_m)  # a new hover forgets the decision
    if vehicle.phase == Phase.LEVEL_OUT:
        vehicle.ask_for(Command(Request.HOVER, vehicle.position_W_m), (Phase.READY,), _READY_S)
        vehicle.come_down()
    return told


def make_safe(vehicle: Vehicle, emergency_W_m: tuple[float, float] | None = None) -> str:
    """Bring a vehicle down and disarm it, whatever it does; returns what was done, in words.

    Under another controller it lands at `emergency_W_m` (x, y in W, m), or where it is if there is no such place. Under
    the core an abort brings it down where it is.

    After the trigger nothing is interrupted: half a flip is worse than a whole one.

    Raises:
        LinkError: The link is gone; the vehicle then ends its flight by its own rules.
        RolloutError: It did not come down in time; it was disarmed all the same.
    """
    done = []
    try:
        if vehicle.phase in (Phase.FLIP, Phase.COAST):
            vehicle.wait(lambda: vehicle.phase in (Phase.ATTACHED, Phase.DONE), 10.0, "end of the flip")
            done.append("flip completed")
        if vehicle.phase in (Phase.READY, Phase.APPROACH, Phase.LEVEL_OUT):
            vehicle.ask_for(Command(Request.ABORT), (Phase.ABORTED,), _IDLE_S)
        if vehicle.phase == Phase.ABORTED:
            # a new connection asks for IDLE, which one that has landed obeys
            vehicle.wait(
                lambda: vehicle.rule in ("landed", "lost") or vehicle.phase == Phase.IDLE,
                60.0,
                "landing after an abort",
            )
            done.append("landed")
        elif vehicle.phase == Phase.IDLE and vehicle.is_flying():
            vehicle.command = Command(Request.IDLE)
            if not _went_aside(vehicle, emergency_W_m):
                done.append("could not fly to the emergency place")
            vehicle.land(0.0, 4.0)
            vehicle.wait(lambda: not vehicle.is_flying(), 20.0, "landing", 0.5)
            done.append("landed")
        vehicle.stop_planner()
        vehicle.ask_for(Command(Request.IDLE), (Phase.IDLE,), _IDLE_S)
    finally:
        # also when a second Ctrl-C ends the above: what is armed by itself again must have nothing to do
        if not vehicle.session.cf.lost:
            try:
                vehicle.stop_planner()
            finally:
                done.append("STILL ARMED" if vehicle.arm(False) else "disarmed")
    return ", ".join(done)


def _went_aside(vehicle: Vehicle, place_W_m: tuple[float, float] | None) -> bool:
    """Fly to a place, at the present height; false if the vehicle refuses, which must not keep it from landing."""
    if place_W_m is None:
        return True
    x, y, z = vehicle.position_W_m
    if not (math.isfinite(x) and z > _LOW_M):
        return True  # it is down, or nobody knows where it is: it lands where it is
    span_s = math.dist((x, y), place_W_m) / _ASIDE_MPS + 1.0
    try:
        vehicle.go_to((*place_W_m, z), span_s)
    except RolloutError:
        return False
    vehicle.pause(span_s)
    return True


def safe_or_why(vehicle: Vehicle, emergency_W_m: tuple[float, float] | None = None) -> str:
    """`make_safe`, with a failure told as text: for the end of a run, which must go on."""
    try:
        return make_safe(vehicle, emergency_W_m)
    except (LinkError, RolloutError) as error:
        return f"not confirmed: {error}"
