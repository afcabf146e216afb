"""Rollouts flown by a vehicle at the other end of a link: `ivl learn EXPERIMENT --uri udp://... | radio://...`.

A rollout is scored only if the vehicle confirmed its policy, flew it to an end, and said so. Whatever goes wrong before
that (lost link, restarted server, an abort that is not the policy's) discards the flight, and the same rollout is flown
again: nothing is scored wrongly, and nothing is lost.
"""

import json
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ivl import native
from ivl.errors import LinkError, RolloutError
from ivl.experiment import Experiment
from ivl.links import preflight, sil
from ivl.links.clock import COARSE, FINE, Clock, LockStep, WallClock
from ivl.links.connection import check_uri
from ivl.links.episode import Episode, Field, Landing, Rollout, make_safe, safe_or_why, start_point
from ivl.links.fields import Room, SilField
from ivl.links.operators import ConsoleOperator, OperatorStopped
from ivl.links.options import Options
from ivl.links.packets import Phase, Request
from ivl.links.tables import Session
from ivl.links.tracking import Tracking
from ivl.links.vehicle import Command, OtherForms, PolicyRefused, Vehicle
from ivl.outcome import Outcomes, valid
from ivl.source import Flown, Plan

ATTEMPTS_MAX = 10
_AGAIN_S, _IDLE_S = 0.2, 3.0
_DIFFERENCES_TOLD = 6
JOURNAL, RECORDINGS = "flights.jsonl", "recordings"


class VehicleAway(RolloutError):
    """The vehicle was lost and did not come back in time; the run can be resumed."""


class OtherWorld(RolloutError):
    """The software vehicle simulates another world than the experiment's: what is learned there holds only there."""


class CrazyflieSource:
    """One vehicle, one connection; reconnects by itself when it is lost. A context manager, or call `close`."""

    def __init__(self, uri: str, experiment: Experiment, options: Options | None = None) -> None:
        """Connect, check and configure the vehicle.

        Raises:
            ConfigError: The URI is none, or the approach does not fit under the ceiling.
            LinkError: The vehicle cannot be reached.
            RolloutError: It must not fly as it is; the message says why and what to do.
            OtherWorld: It simulates another world, and the options do not allow that.
            OtherForms: It does not have the form of the experiment's policy.
        """
        check_uri(uri)
        self.uri, self._experiment, self.options = uri, experiment, options or Options()
        self.world = experiment.make_world()
        self._vehicle: Vehicle | None = None
        self._field: Field | None = None
        self._tracking: Tracking | None = None
        self.n_discarded = 0
        """Flights that were not scored and were flown again."""
        self.warnings: list[str] = []
        """What a reader of the results has to know."""
        self._folder: Path | None = None  # it may not be there before the first flight that counts
        self._connect()
        try:
            if self._is_sil and not self.warnings and not self._has_our_bits():
                self._meet_other_world("all parameters are the same, but one landing has other bits: another version?")
        except BaseException:
            self.close()
            raise
        self._folder = self.options.folder

    def _compare_worlds(self, session: Session) -> None:
        """With each connection, since a vehicle may have been started anew, and otherwise."""
        found = sil.differences(session, self.world)
        if found:
            rest = f", and {len(found) - _DIFFERENCES_TOLD} more" if len(found) > _DIFFERENCES_TOLD else ""
            self._meet_other_world(", ".join(found[:_DIFFERENCES_TOLD]) + rest)

    def _meet_other_world(self, what: str) -> None:
        text = f"{self.uri} simulates another world than {self._experiment.name}: {what}"
        if not self.options.other_world:
            raise OtherWorld(f"{text}; start the right one with: {self.options.start_hint}")
        if text not in self.warnings:
            self.warnings.append(text)
            self.options.say(text)

    def _has_our_bits(self) -> bool:
        """Whether one landing there has the bits that it has here."""
        policy = self._experiment.policy
        probe = Rollout(tuple(policy.mu0))
        here = self.world.rollouts(
            self._experiment.speed_mps, self._experiment.angle_deg, *probe.theta, form=policy.form,
            seed=0, stream=0, start=self._experiment.start, threads=1,
        )  # fmt: skip
        there = self._fly_until_known(np.zeros(1, dtype=np.intp), probe)
        return there.outcomes.tobytes() == here.tobytes()

    # ---- RolloutSource

    def fly(self, plan: Plan) -> Iterator[Flown]:
        """Fly every row of the plan, one after the other; each is handed over as soon as it is known.

        Raises:
            RolloutError: A rollout was discarded ten times, the vehicle stayed away, or the operator stopped.
        """
        for i in range(len(plan.theta)):
            rollout = Rollout(tuple(plan.theta[i].tolist()), int(plan.seed[i]), int(plan.stream[i]))
            yield self._fly_until_known(np.array([i], dtype=np.intp), rollout)

    def close(self) -> None:
        """Bring the vehicle down, disarm it and close the link; safe to call at any time, and again."""
        vehicle = self._vehicle
        if vehicle is None:
            return
        try:
            if not vehicle.session.cf.lost:
                done = safe_or_why(vehicle)
                if not self._is_sil:
                    self.options.say(f"vehicle: {done}")
                self._give_back(vehicle)
        finally:
            self._drop()

    def __enter__(self) -> "CrazyflieSource":
        """The source itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close."""
        self.close()

    # ---- flying

    def fly_one(self, rollout: Rollout) -> Landing:
        """Fly one rollout once, without a second attempt (errors as `Episode.fly`)."""
        vehicle, field = self._vehicle, self._field
        if vehicle is None or field is None:
            raise LinkError(f"{self.uri}: the link is closed")
        return Episode(vehicle, self._experiment).fly(field, rollout)

    def _fly_until_known(self, index: np.ndarray[Any, np.dtype[np.intp]], rollout: Rollout) -> Flown:
        for attempt in range(1, ATTEMPTS_MAX + 1):
            try:
                if self._vehicle is None:
                    self._return()
                landing = self.fly_one(rollout)
                outcome = landing.outcome
                self._keep(landing)
                good = bool(valid(outcome).all())
                reason = "" if good else f"simulation: {self.world.end_reason(int(outcome['end_reason'][0]))}"
                return Flown(index, outcome, reason)
            except PolicyRefused as error:
                self._note(rollout, f"refused: {error}")
                if not self._is_sil and self._vehicle is not None:
                    self.options.say(f"vehicle: {safe_or_why(self._vehicle)}")
                return Flown(index, _refused(), f"vehicle: {error}")
            except (OperatorStopped, VehicleAway, OtherWorld, OtherForms):
                raise
            except LinkError as error:
                self._discard(rollout, attempt, error)
                self._drop()
            except RolloutError as error:
                self._discard(rollout, attempt, error)
                self._recover()
        raise RolloutError(
            f"{self.uri}: a rollout was discarded {ATTEMPTS_MAX} times in a row; the last reason is above"
        )

    def _discard(self, rollout: Rollout, attempt: int, error: Exception) -> None:
        self.n_discarded += 1
        self._note(rollout, f"discarded: {error}")
        self.options.say(f"flight discarded, flown again (attempt {attempt} of {ATTEMPTS_MAX}): {error}")

    # ---- connection

    @property
    def _is_sil(self) -> bool:
        return isinstance(self._field, SilField)

    def _connect(self, again: bool = False) -> None:
        """Connect, check, configure; `again`: whatever the vehicle is doing comes from our own flight."""
        session = Session(self.uri, self.options.deadlines)
        try:
            self._vehicle = self._make_ready(session, again)
        except BaseException:
            self._drop()
            session.close()
            raise

    def _make_ready(self, session: Session, again: bool) -> Vehicle:
        software = sil.is_sil(session)
        if self.options.mocap is not None:
            self._tracking = Tracking(session, self.options.mocap)
        clock = self._make_clock(session, software)
        try:
            return self._prepare(Vehicle(session, clock), software, again)
        except BaseException:
            self._give_back_time(clock)
            raise

    def _prepare(self, vehicle: Vehicle, software: bool, again: bool) -> Vehicle:
        self._field = self._make_field(vehicle, software)
        if self._is_sil:
            self._compare_worlds(vehicle.session)
            sil.reset(vehicle)
        elif software:
            sil.put_on_floor(vehicle)
        elif again:
            self.options.say(f"vehicle: {make_safe(vehicle)}")
        # in a software vehicle the reset before each landing mends the rest, and lock-step waits for a bad link
        found = [preflight.tables(vehicle)] if self._is_sil else list(preflight.checks(vehicle))
        found.append(preflight.policy_range(vehicle, self._experiment))
        problems = [preflight.failures(found), *(self._tracking.problems() if self._tracking else ())]
        if any(problems):
            raise RolloutError(f"{self.uri}: not fit to fly: {'; '.join(filter(None, problems))}")
        vehicle.ask_for(Command(Request.IDLE), (Phase.IDLE,), _IDLE_S)
        vehicle.configure(self.world)
        if not again:  # on the ground: a vehicle with other forms is told from ours before it takes off
            vehicle.put_policy(self._experiment.policy.shape, self._experiment.policy.mu0)
        if self._tracking is not None:
            self._tracking.watch_over(vehicle)
        return vehicle

    def _make_clock(self, session: Session, software: bool) -> Clock:
        """Lock-step where it can be had; cameras have a time of their own."""
        if not software or self._tracking is not None:
            return WallClock()
        return LockStep(session, FINE if self.options.rehearse else COARSE)

    def _make_field(self, vehicle: Vehicle, software: bool) -> Field:
        if software and not self.options.rehearse:
            return SilField(vehicle, self._experiment, self.options.keep_recordings)
        start_W_m = start_point(self.world, self._experiment)
        operator = self.options.operator or ConsoleOperator()
        place = sil.put_on_floor if software else None
        return Room(vehicle, self.world, start_W_m, operator, tracking=self._tracking, place=place)

    def _return(self) -> None:
        """Connect again, for as long as a vehicle may stay away."""
        end_s = time.monotonic() + self.options.deadlines.return_s
        while True:
            try:
                self._connect(again=True)
            except LinkError as error:
                if time.monotonic() >= end_s:
                    away_s = self.options.deadlines.return_s
                    raise VehicleAway(f"the vehicle stayed away for {away_s:g} s: {error}") from error
                time.sleep(_AGAIN_S)
            else:
                self.options.say(f"connected again to {self.uri}")
                return

    def _recover(self) -> None:
        """After a flight that went wrong with the link still there: down first; then a new connection, to be sure.

        A vehicle that has started anew answers, but knows nothing of us.
        """
        if not self._is_sil and self._vehicle is not None:
            self.options.say(f"vehicle: {safe_or_why(self._vehicle)}")
        elif self._vehicle is not None:
            self._give_back_time(self._vehicle.clock)  # there may be no other attempt
        self._drop()

    def _drop(self) -> None:
        """Forget a connection that is no good any more; the vehicle ends its flight by its own rules."""
        vehicle, self._vehicle = self._vehicle, None
        tracking, self._tracking = self._tracking, None
        if tracking is not None:
            tracking.close()
        if vehicle is not None:
            vehicle.session.close()

    def _give_back(self, vehicle: Vehicle) -> None:
        """Leave a software vehicle as it was found; a link that breaks now is only told."""
        try:
            if isinstance(self._field, SilField):
                self._field.extras.close()
        except LinkError as error:
            self.options.say(f"not restored: {error}")
        self._give_back_time(vehicle.clock)

    def _give_back_time(self, clock: Clock) -> None:
        """Let a software vehicle's time pass again, or it would stand still for whoever comes next."""
        try:
            clock.close()
        except LinkError as error:
            self.options.say(f"time of the vehicle not restored: {error}")

    # ---- journal

    def _keep(self, landing: Landing) -> None:
        self._note(landing.rollout, "flown", landing)
        if not self._is_sil:
            self.options.say(f"flown: {int(landing.outcome['n_legs'][0])} legs hold, battery {landing.battery_V:.2f} V")
        folder = self._folder
        if folder is not None and landing.recording is not None:
            (folder / RECORDINGS).mkdir(exist_ok=True)
            name = f"{landing.rollout.seed:016x}-{landing.rollout.stream}.csv"
            (folder / RECORDINGS / name).write_text(landing.recording.to_csv(), encoding="utf-8")

    def _note(self, rollout: Rollout, what: str, landing: Landing | None = None) -> None:
        """One line of JSON per flight, on the disk before the next begins."""
        folder = self._folder
        if folder is None:
            return
        line: dict[str, Any] = {
            "time": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
            "seed": rollout.seed,
            "stream": rollout.stream,
            **dict(zip(self._experiment.policy.shape.names, rollout.theta, strict=True)),
            "what": what,
        }
        if landing is not None:
            battery_V = landing.battery_V if np.isfinite(landing.battery_V) else None
            line |= {"battery_V": battery_V, "n_legs": int(landing.outcome["n_legs"][0])}
        with (folder / JOURNAL).open("a", encoding="utf-8") as file:
            file.write(json.dumps(line, allow_nan=False) + "\n")


def _refused() -> Outcomes:
    """The outcome of a policy that was not flown, as the library gives it: nothing is known."""
    outcome = np.zeros(1, dtype=native.library().outcome_dtype)
    for name in outcome.dtype.names or ():
        if outcome.dtype[name].kind == "f":
            outcome[name] = np.nan
    codes = range(int(native.library().outcome_fields["end_reason"].hi) + 1)
    outcome["end_reason"] = next(code for code in codes if native.library().end_reason(code) == "refused")
    return outcome
