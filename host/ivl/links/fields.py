"""Where is flown: the simulator's field, and a room with an operator in it."""

import math
from collections.abc import Callable
from dataclasses import dataclass

from ivl.errors import RolloutError
from ivl.experiment import Experiment
from ivl.links import operators, sil
from ivl.links.episode import Outcome, Point, Rollout, check_abort
from ivl.links.operators import Operator
from ivl.links.packets import Phase, Recording, Request
from ivl.links.tracking import Tracking
from ivl.links.truth import Resting, outcome_of_flight, suggest_legs
from ivl.links.vehicle import Command, Supervisor, Vehicle
from ivl.world import World

CLIMB_MPS, TRAVEL_MPS = 0.5, 0.5
NEAR_M = 0.1
"""The vehicle is where it was sent when its estimate is as near as this."""
_SETTLE_S, _IDLE_S, _ARM_S, _END_S = 1.0, 3.0, 3.0, 30.0


class SilField:
    """A software vehicle: reset into the air, start and outcome by the simulator."""

    def __init__(self, vehicle: Vehicle, experiment: Experiment, keep_recordings: bool = False) -> None:
        """The vehicle must be a software vehicle (`sil.is_sil`)."""
        self._vehicle, self._experiment, self._keep = vehicle, experiment, keep_recordings
        self.extras = sil.Sil(vehicle)

    def to_start(self, rollout: Rollout) -> Point:
        """Reset; the simulator puts the vehicle to the start of each landing itself, when its approach begins."""
        experiment = self._experiment
        spec = sil.Spec(experiment.speed_mps, experiment.angle_deg, rollout.seed, rollout.stream, experiment.start)
        return self.extras.reset(spec)

    def before_approach(self, rollout: Rollout) -> None:
        """Nothing: the start has been told with the reset."""

    def outcome(self, policy_seq: int) -> tuple[Outcome, Recording | None]:
        """The simulator's truth."""
        outcome = self.extras.wait_for_outcome(policy_seq)
        if not self._keep:
            return outcome, None
        # the end of the cycle is also that of a recording which is not full yet
        self._vehicle.ask_for(Command(Request.IDLE), (Phase.IDLE,), _IDLE_S)
        return outcome, self._vehicle.recording(policy_seq)


@dataclass(frozen=True)
class Gate:
    """What must hold before each take-off.

    Attributes:
        battery_V: Rest voltage below which the operator is asked for another battery.
    """

    battery_V: float = 3.7


class Room:
    """A drone under a real ceiling, and an operator who places it and tells what came of a landing."""

    def __init__(
        self,
        vehicle: Vehicle,
        world: World,
        start_W_m: Point,
        operator: Operator,
        gate: Gate | None = None,
        tracking: Tracking | None = None,
        place: Callable[[Vehicle], None] | None = None,
    ) -> None:
        """A room.

        Args:
            vehicle: A drone, or a software vehicle in a rehearsal.
            world: What is flown, for the geometry of legs and ceiling.
            start_W_m: Where the approach begins.
            operator: Who places the vehicle and confirms outcomes.
            gate: What must hold before each take-off.
            tracking: Motion capture; without it the vehicle's own estimate tells where it rests.
            place: Does with a software vehicle what the operator's hands do with a drone.
        """
        self._vehicle, self._world, self._start_W_m, self._operator = vehicle, world, start_W_m, operator
        self._gate = gate or Gate()
        self._tracking = tracking
        self._place = place

    def to_start(self, rollout: Rollout) -> Point:
        """Ask the operator, arm, take off, fly to the start point."""
        del rollout
        vehicle = self._vehicle
        self._operator.place(self._start_W_m)
        if self._place is not None:
            self._place(vehicle)
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

    def _check_gate(self) -> None:
        """Ask for another battery until one is good; a vehicle without power is a lost link, which the caller sees."""
        vehicle = self._vehicle
        if self._tracking is not None and (problems := self._tracking.problems()):
            raise RolloutError("; ".join(problems))
        while not vehicle.battery_V >= self._gate.battery_V:
            self._operator.change_battery(vehicle.battery_V, self._gate.battery_V)
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
        vehicle.pause(_SETTLE_S)
        self._restore_tumble_check()
        aborted = vehicle.phase == Phase.ABORTED
        why = vehicle.aborted_by
        check_abort(vehicle)
        vehicle.ask_for(Command(Request.IDLE), (Phase.IDLE,), _IDLE_S)
        recording = vehicle.recording(policy_seq)
        seen_at = self._tracking.resting() if self._tracking is not None else None
        resting = seen_at or resting_by_estimate(vehicle, recording)
        suggested = operators.Seen(0 if aborted else suggest_legs(resting, self._world), body_contact=False)
        seen = self._operator.confirm(suggested, resting, f"aborted: {why}" if aborted else "")
        if seen.discard:
            raise RolloutError(f"discarded by the operator{f' (aborted: {why})' if aborted else ''}")
        outcome = outcome_of_flight(recording, vehicle.snapshot(), seen.n_legs, seen.body_contact, resting, self._world)
        return outcome, recording

    def _is_over(self) -> bool:
        vehicle = self._vehicle
        return vehicle.phase == Phase.DONE or (vehicle.phase == Phase.ABORTED and vehicle.rule in ("landed", "lost"))

    def _restore_tumble_check(self) -> None:
        """The app has switched it on again; the stored parameter outlives a restart, so it is looked at."""
        name = "supervisor.tmblChckEn"
        session = self._vehicle.session
        if session.has_param(name) and session.read([name])[name] != 1:
            session.write({name: 1})


def resting_by_estimate(vehicle: Vehicle, recording: Recording) -> Resting:
    """Where the vehicle's own estimate has it, with the attitude of the recorder's last row."""
    if not len(recording.rows):
        return Resting(vehicle.position_W_m[2], float("nan"))
    x, y, _, _ = recording.rows["q_WB"][-1]
    return Resting(vehicle.position_W_m[2], float(1.0 - 2.0 * (x * x + y * y)))
