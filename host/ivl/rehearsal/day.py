"""A rehearsed day: what the script says happens to the software vehicle, its battery, cameras and link.

The rehearsal's site tells it where a flight stands (`begin`, `stands`, `hovers`, `ends`), and the operator's hands ask
it to mend something (`mend`, `change_battery`). What it does to the vehicle goes over the control channel, which no
fault of the link touches.
"""

from collections.abc import Callable
from pathlib import Path

from ivl.errors import LinkError
from ivl.links import sil, stop
from ivl.links.operators import Seen
from ivl.links.trouble import Cause
from ivl.links.vehicle import Supervisor, Vehicle
from ivl.rehearsal.cameras import Cameras
from ivl.rehearsal.script import Kind, Script, row_of
from ivl.silproc import SilProcess
from ivl.site.file import SiteFile

AWAY_S = 130.0
"""So long is an operator away; longer than a site waits without a new preflight."""
ASIDE_M = 0.6
LOSS = 0.1
CUT_MS = 3000
_AWAY_STEPS = 65
_CRASH_G, _SAG_V = 1e-3, 0.1
_SHOWS_S, _LOCKS_S, _ENDS_S = 0.6, 8.0, 5.0


class Day:
    """What goes wrong, in which rollout; what has gone wrong so far is in `struck`."""

    def __init__(
        self,
        script: Script,
        site: SiteFile,
        n_rollouts: int,
        server: SilProcess,
        folder: Path | None,
        say: Callable[[str], None],
    ) -> None:
        """Begin a day with a full battery.

        Args:
            script: What happens.
            site: The room.
            n_rollouts: Rollouts of the budget.
            server: The vehicle's process, which runs.
            folder: Run folder, in which a stop is asked for; None: nowhere.
            say: Told what happens.

        Raises:
            ConfigError: The script does not fit the budget.
            LinkError: The vehicle's process does not answer.
        """
        self._plan = script.plan(n_rollouts)
        self._script, self._site, self._server, self._folder, self._say = script, site, server, folder, say
        self.struck: list[tuple[int, Kind]] = []
        """Rollout and fault, in the order in which they happened."""
        self.n_batteries = 1
        self._rest_V = site.battery.full_V
        self._rollout = 0
        self._now: Kind | None = None
        self._took_off_s: float | None = None
        self._vehicle: Vehicle | None = None
        self._cameras: Cameras | None = None
        self._is_powered = True
        self._prepare()

    # ---- what the site tells

    def meets(self, vehicle: Vehicle, cameras: Cameras) -> None:
        """A new connection of the vehicle, and the cameras around it."""
        self._vehicle, self._cameras = vehicle, cameras

    def begin(self, rollout: int) -> None:
        """An attempt of a rollout is announced; the operator of a bad day is not there."""
        self._rollout = rollout
        waiting = self._plan.get(rollout, [])
        self._now = waiting.pop(0) if waiting else None
        if self._now is Kind.OPERATOR_AWAY:
            self._strike()
            for _ in range(_AWAY_STEPS):
                self._flown().clock.pause(AWAY_S / _AWAY_STEPS)

    def is_over_before(self, rollout: int) -> bool:
        """Whether the script's operator goes home now."""
        return rollout == self._script.ends_before

    def stands(self) -> None:
        """The operator has said that it may fly: it is put at home, or where it should not be."""
        vehicle, cameras = self._flown(), self._cameras
        self._put(aside_m=ASIDE_M if self._now is Kind.NOT_HOME else 0.0)
        vehicle.pause(_SHOWS_S)
        if cameras is not None:
            cameras.wait_until_good(vehicle)
        if self._now is Kind.NOT_HOME:
            self._strike()
        elif self._now is Kind.PACKETS_LOST:
            self._strike()
            self._server.set("fault.loss", LOSS)
        elif self._now is Kind.LOCKS:
            self._strike()
            self._server.set("stabilizer.stop", 1)
            vehicle.wait(lambda: Supervisor.LOCKED in vehicle.supervisor(), _LOCKS_S, "lock", _SHOWS_S)

    def takes_off(self) -> None:
        """From now on the battery is drawn from."""
        self._took_off_s = self._flown().clock.now_s()

    def hovers(self) -> None:
        """The vehicle hovers under the flight core, just before its approach: most faults strike here."""
        kind, vehicle = self._now, self._flown()
        strikes: dict[Kind, Callable[[], object]] = {
            Kind.BATTERY_SAGS: lambda: self._server.set("sil.vbat", self._site.battery.load_V_min - _SAG_V),
            Kind.CRASHES: lambda: self._server.set("supervisor.crashDetectGs", _CRASH_G),
            Kind.TRACKING_DROPS: lambda: self._blind("drops"),
            Kind.TRACKING_SWAPS: lambda: self._blind("swaps"),
            Kind.LINK_SILENT: self._cut,
            Kind.VEHICLE_LOST: self._power_off,
            Kind.RESTARTS: self._power_cycle,
            Kind.STOPPED: self._stop,
        }
        if kind in strikes:
            self._strike()
            strikes[kind]()
            vehicle.pause(_SHOWS_S)

    def ends(self) -> None:
        """The flight is over, however: its battery has less, and its link is as it was; again does nothing."""
        took_off_s, self._took_off_s = self._took_off_s, None
        if took_off_s is None or self._vehicle is None:
            return
        battery, flown_s = self._site.battery, self._vehicle.clock.now_s() - took_off_s
        self._rest_V -= (battery.full_V - battery.rest_V_min) * flown_s / self._script.battery_s
        if self._is_powered:
            self._server.set("sil.cell", self._rest_V)
            self._server.set("fault.loss", 0.0)

    # ---- what a person sees

    def sees(self, suggested: Seen) -> Seen:
        """What hangs there, and whether something else touched: the truth, which a person who stands there sees.

        Where the simulator has seen no end of a landing, the vehicle has come down, and the pose tells all.

        Raises:
            LinkError: The vehicle does not tell, or tells of another landing.
        """
        if self._now is Kind.DISCARDED:
            self._strike()
            return Seen(0, False, discard=True)
        vehicle = self._flown()
        if not vehicle.pause_until(lambda: self._server.get("sil.ended") == 1.0, _ENDS_S, _SHOWS_S):
            return suggested
        truth = sil.last_outcome(vehicle.session, int(self._server.get("ivl.policy_seq")))
        return Seen(int(truth["n_legs"][0]), bool(truth["body_contact"][0]))

    # ---- what the operator's hands do

    def change_battery(self) -> None:
        """A charged one; the vehicle is without power meanwhile, and its link is lost."""
        self._rest_V = self._site.battery.full_V
        self.n_batteries += 1
        self._power_cycle()

    def mend(self, cause: Cause) -> None:
        """What the operator has been asked to do has been done."""
        if self._cameras is not None:
            self._cameras.drops = self._cameras.swaps = False
        if cause is Cause.BATTERY:
            self.change_battery()
        elif cause in (Cause.LOCKED, Cause.LOST) or not self._is_powered or self._is_locked():
            self._power_cycle()
        elif cause is Cause.CRASHED:
            self._server.set("supervisor.crashDetectGs", 0.0)
            self._put()
        elif cause is Cause.NOT_HOME:
            self._put()

    # ---- how

    def _flown(self) -> Vehicle:
        if self._vehicle is None:
            raise LinkError("rehearsal: no vehicle is connected")
        return self._vehicle

    def _strike(self) -> None:
        if self._now is not None:
            self.struck.append((self._rollout, self._now))
            self._say(f"rehearsal: rollout {self._rollout}: {row_of(self._now).happens}")
            self._now = None

    def _blind(self, how: str) -> None:
        if self._cameras is not None:
            setattr(self._cameras, how, True)

    def _cut(self) -> None:
        """Nothing comes through, and the vehicle's time goes on without its host."""
        self._server.set("sil.lockstep", 0)
        self._server.set("fault.cut_ms", CUT_MS)

    def _stop(self) -> None:
        if self._folder is None:
            raise LinkError("rehearsal: a stop needs a run folder")
        stop.ask(self._folder)

    def _is_locked(self) -> bool:
        return bool(int(self._server.get("supervisor.info")) & Supervisor.LOCKED)

    def _power_off(self) -> None:
        self._server.kill()
        self._is_powered = False

    def _power_cycle(self) -> None:
        if self._is_powered:
            self._power_off()
        self._server.start()
        self._is_powered = True
        self._prepare()

    def _prepare(self) -> None:
        """A vehicle that was just switched on stands at home."""
        self._server.set("sil.cell", self._rest_V)
        self._put()

    def _put(self, aside_m: float = 0.0) -> None:
        x_m, y_m = self._site.home_m
        for name, value in (("sil.start_x", x_m + aside_m), ("sil.start_y", y_m), ("sil.place", sil.PLACE_AT_START)):
            self._server.set(name, value)
