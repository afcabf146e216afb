"""Rollouts flown by a vehicle at the other end of a link: `ivl learn EXPERIMENT --uri udp://... | radio://...`.

A rollout is scored only if the vehicle confirmed its policy, flew it to an end, and said so. Whatever goes wrong before
that (lost link, restarted server, an abort that is not the policy's) discards the flight, and the same rollout is flown
again: nothing is scored wrongly, and nothing is lost.

All that depends on where is flown is the business of a site (`ivl.links.sites`).
"""

import math
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import count
from typing import Any

import numpy as np

from ivl import forms, native
from ivl.belief import recording
from ivl.errors import LinkError, RolloutError
from ivl.experiment import Experiment
from ivl.links import preflight
from ivl.links.connection import check_uri
from ivl.links.forecast import Forecasts
from ivl.links.journal import Journal
from ivl.links.landing_flight import FlyingEnds, Landing, LandingFlight, Rollout
from ivl.links.options import Options
from ivl.links.packets import Phase, Request
from ivl.links.recovery import Recovery
from ivl.links.sites import site_for
from ivl.links.sites.base import Site, Visit, give_back_time
from ivl.links.tables import Session
from ivl.links.tracking import Tracking
from ivl.links.trouble import Cause, Instead, Trouble, Vetoed, before_flight, cause_of, of_checks
from ivl.links.vehicle import Command, OtherForms, PolicyRefused, Supervisor, Vehicle
from ivl.mocap.frame import FlightFrame
from ivl.outcome import Outcomes, end_code, valid
from ivl.source import Flown, Plan

_AGAIN_S, _IDLE_S = 0.2, 3.0


Rechoose = Callable[[np.ndarray[Any, np.dtype[np.float64]], float], np.ndarray[Any, np.dtype[np.float64]]]
"""See `ivl.source.Plan`."""


class VehicleAway(FlyingEnds):
    """The vehicle was lost and did not come back in time; the run can be resumed."""

    cause = Cause.LOST


class CrazyflieSource:
    """One vehicle, one connection; reconnects by itself when it is lost. A context manager, or call `close`."""

    def __init__(self, uri: str, experiment: Experiment, options: Options | None = None) -> None:
        """Connect, check and configure the vehicle.

        Raises:
            ConfigError: The URI is none, a drone has no site that is fit to fly in, or the approach does not fit
                under the ceiling.
            LinkError: The vehicle cannot be reached.
            RolloutError: It must not fly as it is; the message says why and what to do.
            OtherForms: It does not have the form of the experiment's policy.
        """
        check_uri(uri)
        self.uri, self._experiment, self.options = uri, experiment, options or Options()
        self._site_file = self.options.site_of(experiment, uri)
        self.world = experiment.make_world()
        self._forecasts = Forecasts(self.world, experiment)
        self._vehicle: Vehicle | None = None
        self._site: Site | None = None
        self._tracking: Tracking | None = None
        self.n_discarded = 0
        """Flights that were not scored and were flown again."""
        self.troubles: Counter[Cause] = Counter()
        """Flights that did not count, by cause."""
        self.refusals: Counter[Cause] = Counter()
        """Flights that did not begin, by cause; they are no attempts."""
        self._recovery: Recovery | None = None  # known when the kind of the site is
        self.warnings: list[str] = []
        """What a reader of the results has to know."""
        self._journal: Journal | None = None  # its folder may not be there before the first flight that counts
        self.vehicle = ""
        site = self._begin()
        self.is_flown = site.is_flown
        try:
            site.prove(lambda rollout: self._fly_until_known(np.zeros(1, dtype=np.intp), rollout).outcomes)
        except BaseException:
            self.close()
            raise
        if self.options.folder is not None:
            self._journal = Journal(self.options.folder, experiment.policy.shape)

    def _begin(self) -> Site:
        """Connect for the first time; what a person can mend is asked for, if there is one."""
        while True:
            try:
                return self._connect()
            except (FlyingEnds, OtherForms):
                raise
            except RolloutError as error:
                if self._recovery is None:
                    raise
                found = before_flight(error)
                self.refusals[cause_of(found)] += 1
                self._recovery.before(found)

    def _warn(self, text: str) -> None:
        if text not in self.warnings:
            self.warnings.append(text)
            self.options.say(text)

    # ---- RolloutSource

    def fly(self, plan: Plan) -> Iterator[Flown]:
        """Fly every row of the plan, one after the other; each is handed over as soon as it is known.

        Raises:
            RolloutError: The site gives up, or its operator stopped.
        """
        for i in range(len(plan.theta)):
            rollout = Rollout(tuple(plan.theta[i].tolist()), int(plan.seed[i]), int(plan.stream[i]))
            yield self._fly_until_known(np.array([i], dtype=np.intp), rollout, plan.rechoose)

    def battery_V(self) -> float:
        """Voltage expected in the hover of the next flight, from that at rest; and of another battery if this is low.

        A vehicle that cannot be asked is none of this method's business: the flight meets the trouble again, and there
        it is told and counted.

        Raises:
            RolloutError: The operator stopped.
        """
        for _ in range(2):  # a change of battery takes the link
            try:
                if self._vehicle is None:
                    self._return()
                assert self._site is not None
                return recording.hover_V(self.world, self._experiment.flight, self._site.rest_V())
            except VehicleAway:
                return math.nan
            except (FlyingEnds, OtherForms):
                raise
            except (LinkError, RolloutError):
                self._drop()
        return math.nan

    def close(self) -> None:
        """Bring the vehicle down, disarm it and close the link; safe to call at any time, and again."""
        told = self._recovery.told(self.troubles) if self._recovery is not None else ""
        if told:
            self._warn(told)
        vehicle, site = self._vehicle, self._site
        if vehicle is None or site is None:
            return
        try:
            if not vehicle.session.cf.lost:
                site.leave()
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
        """Fly one rollout once, without a second attempt (errors as `LandingFlight.fly`)."""
        vehicle, site = self._vehicle, self._site
        if vehicle is None or site is None:
            raise LinkError(f"{self.uri}: the link is closed")
        return LandingFlight(vehicle, self._experiment).fly(site, rollout)

    def _fly_until_known(
        self, index: np.ndarray[Any, np.dtype[np.intp]], rollout: Rollout, rechoose: Rechoose | None = None
    ) -> Flown:
        planned = rollout.theta
        for n in count(1):
            try:
                if n > 1 and rechoose is not None:
                    rollout = self._rechosen(rollout, rechoose)
                if self._vehicle is None:
                    self._return()
                landing = self.fly_one(rollout)
                outcome = landing.outcome
                self._keep(landing)
                good = bool(valid(outcome).all())
                reason = "" if good else f"simulation: {self.world.end_reason(int(outcome['end_reason'][0]))}"
                flown = None if rollout.theta == planned else np.array([rollout.theta])
                return Flown(index, outcome, reason, self._features(landing), flown)
            except Instead as error:
                self._note(rollout, f"instead: {' '.join(f'{value:g}' for value in error.theta)}")
                rollout = replace(rollout, theta=error.theta)
            except PolicyRefused as error:
                return self._without_flight(index, rollout, "refused", f"vehicle: {error}")
            except Vetoed as error:
                return self._without_flight(index, rollout, "vetoed", str(error))
            except VehicleAway as error:
                self._meet(rollout, self._note_trouble(rollout, error), n)
            except (FlyingEnds, OtherForms):
                raise
            except LinkError as error:
                told = self._note_trouble(rollout, error)
                self._drop()
                self._meet(rollout, told, n)
            except RolloutError as error:
                told = self._note_trouble(rollout, error)
                self._recover()
                self._meet(rollout, told, n)
        raise AssertionError("count has no end")

    def _rechosen(self, rollout: Rollout, rechoose: Rechoose) -> Rollout:
        """The rollout with the policy for the battery that is on board now, which may be another one since."""
        battery_V = self.battery_V()
        if not math.isfinite(battery_V):
            return rollout
        theta = tuple(rechoose(np.array(rollout.theta), battery_V).tolist())
        if theta != rollout.theta:
            self._note(rollout, f"instead, for another battery: {' '.join(f'{value:g}' for value in theta)}")
            self.options.say(f"another battery, so another policy: {self._experiment.policy.shape.describe(theta)}")
        return replace(rollout, theta=theta)

    def _without_flight(
        self, index: np.ndarray[Any, np.dtype[np.intp]], rollout: Rollout, what: str, why: str
    ) -> Flown:
        """A policy that is not flown, by the vehicle's will or the operator's: the next one is."""
        self._note(rollout, f"{what}: {why}")
        if self._site is not None:
            self._site.after_refusal()
        return Flown(index, _refused(), why)

    def _meet(self, rollout: Rollout, error: Exception, n: int) -> None:
        """Let the site's recovery decide, which may ask, and may raise."""
        if self._recovery is None:
            raise error
        try:
            self._recovery.after(error, n)
        except FlyingEnds as end:
            self._note(rollout, f"ended: {end}")
            raise

    def _features(self, landing: Landing) -> np.ndarray[Any, np.dtype[np.float64]] | None:
        """What a landing recorded of its flip, shape (1, `ivl.belief.recording.N`); None without a recorder's rows."""
        if landing.recording is None or self._site is None:
            return None
        threshold_per_s = landing.rollout.theta[0] if self._experiment.policy.form == forms.PAPER else 0.0
        features = recording.of_recorder(
            self.world,
            landing.recording.rows,
            landing.recording.trigger_row,
            landing.outcome,
            threshold_per_s,
            self._site.rotor_V(landing),
            self._site.contact_is_seen,
        )
        return features[None]

    def _keep(self, landing: Landing) -> None:
        self._note(landing.rollout, "flown", landing)
        self.options.observer.landed(landing)
        told = self._site.told(landing) if self._site is not None else ""
        if told:
            self.options.say(told)
        if self._journal is not None:
            self._journal.keep_recording(landing)

    def _note_trouble(self, rollout: Rollout, error: Exception) -> Exception:
        """Count a flight that does not count, or one that did not begin, which is no attempt; what to meet."""
        flew = self._vehicle is not None and self._vehicle.has_begun
        found = error if flew else before_flight(error)
        cause = cause_of(found)
        (self.troubles if flew else self.refusals)[cause] += 1
        self.n_discarded += 1
        self._note(rollout, f"{'discarded' if flew else 'not begun'}: {cause}: {error}")
        return found

    def _note(self, rollout: Rollout, what: str, landing: Landing | None = None) -> None:
        if self._journal is not None:
            self._journal.note(rollout, what, landing)

    # ---- connection

    def _connect(self, again: bool = False) -> Site:
        """Connect, check, configure; `again`: whatever the vehicle is doing comes from our own flight."""
        session = Session(self.uri, self.options.deadlines)
        try:
            return self._open_site(session, again)
        except BaseException:
            self._drop()
            session.close()
            raise

    def _open_site(self, session: Session, again: bool) -> Site:
        if self.options.mocap is not None:
            self._tracking = Tracking(session, self.options.mocap, self._frame())
        visit = Visit(
            self._experiment, self.world, self.options, self._site_file, self._tracking, self._forecasts, self._warn
        )
        kind = site_for(session, self.options)
        self._recovery = self._recovery or kind.recovery(session, self.options)
        clock = kind.make_clock(session, visit)
        try:
            vehicle = Vehicle(session, clock)
            site = kind(vehicle, visit)
            self._prepare(vehicle, site, again)
        except BaseException:
            give_back_time(clock, self.options.say)
            raise
        self._vehicle, self._site = vehicle, site
        self.vehicle = vehicle.identity()
        self.options.observer.connected(vehicle, self._tracking)
        return site

    def _frame(self) -> FlightFrame | None:
        """The flight frame in the axes of the tracking system that the site names; another one has W itself."""
        site, mocap = self._site_file, self.options.mocap
        if site is None or mocap is None or mocap != site.mocap:
            return None
        return FlightFrame(site.surface.landing_point_m, site.heading_rad)

    def _prepare(self, vehicle: Vehicle, site: Site, again: bool) -> None:
        site.make_ready(again)
        found = [*site.checks(), preflight.policy_range(vehicle, self._experiment)]
        if self._tracking is not None:
            found += self._tracking.checks()
        trouble = of_checks(found, Supervisor.LOCKED in vehicle.supervisor())
        if trouble is not None:
            raise Trouble(trouble.cause, f"{self.uri}: {trouble}")
        vehicle.ask_for(Command(Request.IDLE), (Phase.IDLE,), _IDLE_S)
        vehicle.configure(self.world)
        if not again:  # on the ground: a vehicle with other forms is found out before it takes off
            vehicle.put_policy(self._experiment.policy.shape, self._experiment.policy.mu0)
        if self._tracking is not None:
            self._tracking.watch_over(vehicle)

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
        """After a flight that went wrong with the link still there: a new connection, to be sure.

        A vehicle that has started anew answers, but knows nothing of us.
        """
        if self._site is not None:
            self._site.after_fault()
        self._drop()

    def _drop(self) -> None:
        """Forget a connection that is no good any more; the vehicle ends its flight by its own rules."""
        vehicle, self._vehicle, self._site = self._vehicle, None, None
        self.options.observer.disconnected()
        tracking, self._tracking = self._tracking, None
        if tracking is not None:
            tracking.close()
        if vehicle is not None:
            vehicle.session.close()


def _refused() -> Outcomes:
    """The outcome of a policy that was not flown, as the library gives it: nothing is known."""
    outcome = np.zeros(1, dtype=native.library().outcome_dtype)
    for name in outcome.dtype.names or ():
        if outcome.dtype[name].kind == "f":
            outcome[name] = np.nan
    outcome["end_reason"] = end_code("refused")
    return outcome
