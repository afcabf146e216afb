"""Rollouts flown by a vehicle at the other end of a link: `ivl learn EXPERIMENT --uri udp://... | radio://...`.

A rollout is scored only if the vehicle confirmed its policy, flew it to an end, and said so. Whatever goes wrong before
that (lost link, restarted server, an abort that is not the policy's) discards the flight, and the same rollout is flown
again: nothing is scored wrongly, and nothing is lost.

All that depends on where is flown is the business of a site (`ivl.links.sites`).
"""

import time
from collections.abc import Iterator
from typing import Any

import numpy as np

from ivl import forms, native
from ivl.belief import recording
from ivl.errors import LinkError, RolloutError
from ivl.experiment import Experiment
from ivl.links import preflight
from ivl.links.connection import check_uri
from ivl.links.journal import Journal
from ivl.links.landing_flight import FlyingEnds, Landing, LandingFlight, Rollout
from ivl.links.options import Options
from ivl.links.packets import Phase, Request
from ivl.links.sites import site_for
from ivl.links.sites.base import Site, Visit, give_back_time
from ivl.links.tables import Session
from ivl.links.tracking import Tracking
from ivl.links.vehicle import Command, OtherForms, PolicyRefused, Vehicle
from ivl.outcome import Outcomes, valid
from ivl.source import Flown, Plan

ATTEMPTS_MAX = 10
_AGAIN_S, _IDLE_S = 0.2, 3.0


class VehicleAway(FlyingEnds):
    """The vehicle was lost and did not come back in time; the run can be resumed."""


class CrazyflieSource:
    """One vehicle, one connection; reconnects by itself when it is lost. A context manager, or call `close`."""

    def __init__(self, uri: str, experiment: Experiment, options: Options | None = None) -> None:
        """Connect, check and configure the vehicle.

        Raises:
            ConfigError: The URI is none, or the approach does not fit under the ceiling.
            LinkError: The vehicle cannot be reached.
            RolloutError: It must not fly as it is; the message says why and what to do.
            OtherForms: It does not have the form of the experiment's policy.
        """
        check_uri(uri)
        self.uri, self._experiment, self.options = uri, experiment, options or Options()
        self.world = experiment.make_world()
        self._vehicle: Vehicle | None = None
        self._site: Site | None = None
        self._tracking: Tracking | None = None
        self.n_discarded = 0
        """Flights that were not scored and were flown again."""
        self.warnings: list[str] = []
        """What a reader of the results has to know."""
        self._journal: Journal | None = None  # its folder may not be there before the first flight that counts
        site = self._connect()
        try:
            site.prove(lambda rollout: self._fly_until_known(np.zeros(1, dtype=np.intp), rollout).outcomes)
        except BaseException:
            self.close()
            raise
        if self.options.folder is not None:
            self._journal = Journal(self.options.folder, experiment.policy.shape)

    def _warn(self, text: str) -> None:
        if text not in self.warnings:
            self.warnings.append(text)
            self.options.say(text)

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
                return Flown(index, outcome, reason, self._features(landing))
            except PolicyRefused as error:
                self._note(rollout, f"refused: {error}")
                if self._site is not None:
                    self._site.after_refusal()
                return Flown(index, _refused(), f"vehicle: {error}")
            except (FlyingEnds, OtherForms):
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
            landing.battery_V if self._site.battery_is_flown else np.nan,
            self._site.contact_is_seen,
        )
        return features[None]

    def _keep(self, landing: Landing) -> None:
        self._note(landing.rollout, "flown", landing)
        told = self._site.told(landing) if self._site is not None else ""
        if told:
            self.options.say(told)
        if self._journal is not None:
            self._journal.keep_recording(landing)

    def _discard(self, rollout: Rollout, attempt: int, error: Exception) -> None:
        self.n_discarded += 1
        self._note(rollout, f"discarded: {error}")
        self.options.say(f"flight discarded, flown again (attempt {attempt} of {ATTEMPTS_MAX}): {error}")

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
            self._tracking = Tracking(session, self.options.mocap)
        visit = Visit(self._experiment, self.world, self.options, self._tracking, self._warn)
        kind = site_for(session, self.options)
        clock = kind.make_clock(session, visit)
        try:
            vehicle = Vehicle(session, clock)
            site = kind(vehicle, visit)
            self._prepare(vehicle, site, again)
        except BaseException:
            give_back_time(clock, self.options.say)
            raise
        self._vehicle, self._site = vehicle, site
        return site

    def _prepare(self, vehicle: Vehicle, site: Site, again: bool) -> None:
        site.make_ready(again)
        found = [*site.checks(), preflight.policy_range(vehicle, self._experiment)]
        problems = [preflight.failures(found), *(self._tracking.problems() if self._tracking else ())]
        if any(problems):
            raise RolloutError(f"{self.uri}: not fit to fly: {'; '.join(filter(None, problems))}")
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
    codes = range(int(native.library().outcome_fields["end_reason"].hi) + 1)
    outcome["end_reason"] = next(code for code in codes if native.library().end_reason(code) == "refused")
    return outcome
