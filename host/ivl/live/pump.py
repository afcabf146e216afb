"""20 times a second: what the board says becomes the parts of the page, and a row for Foxglove.

Whatever takes longer (reading the run folder, simulating a landing) is done beside, in a thread of its own, so that
the page moves on. A part is made only when something has changed, and is made once for all clients.
"""

import asyncio
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ivl.errors import StoreError
from ivl.experiment import Experiment
from ivl.export.flight import Flight
from ivl.links.landing_flight import Landing, Rollout
from ivl.live import history, last_flight, plain, room
from ivl.live.board import Board
from ivl.live.last_flight import Replay

PERIOD_S = 0.05
_READ_S = 0.5
"""Least time between two looks into the run folder."""


@dataclass(frozen=True)
class Part:
    """A part of the page as JSON; `version` counts its changes."""

    version: int
    text: str


class Pump:
    """Of one run."""

    def __init__(self, board: Board, experiment: Experiment, in_process: bool) -> None:
        """Read `board`; `in_process`: no vehicle will ever connect, and landings are replayed."""
        self.board, self._experiment, self._in_process = board, experiment, in_process
        self.world = experiment.make_world()
        self.parts: dict[str, Part] = {}
        """What a page needs, by name; the latest only."""
        self._seen: dict[str, Any] = {}
        self._replay: Replay | None = None
        self._beside: asyncio.Future[None] | None = None
        self._next_read_s = 0.0
        self.ticked = asyncio.Condition()
        """Notified when the parts may have changed."""
        self._put("room", room.room_of(experiment, self.world))

    async def run(self, show: Callable[[Flight], None], ended: asyncio.Event) -> None:
        """Until it has ended; `show` gets each moment as a flight of one row."""
        due_s = time.monotonic()
        while not ended.is_set():
            row = self._tick()
            if row is not None:
                show(row)
            async with self.ticked:
                self.ticked.notify_all()
            due_s = max(due_s + PERIOD_S, time.monotonic())
            await asyncio.sleep(due_s - time.monotonic())
        if self._beside is not None:
            await self._beside
        await asyncio.to_thread(self._look_beside)
        self._tick()
        async with self.ticked:
            self.ticked.notify_all()

    def _put(self, name: str, data: Any) -> None:
        text = plain.text({"part": name, "data": data})
        before = self.parts.get(name)
        if before is None or before.text != text:
            self.parts[name] = Part(0 if before is None else before.version + 1, text)

    def _changed(self, name: str, value: Any) -> bool:
        """Whether a value is another one than the last time."""
        before, self._seen[name] = self._seen.get(name), value
        return bool(before != value)

    def _is_new(self, name: str, thing: object) -> bool:
        """Whether there is a thing, and it is another one than the last time."""
        before, self._seen[name] = self._seen.get(name), thing
        return thing is not None and thing is not before

    # ---- the fast parts

    def _tick(self) -> Flight | None:
        board, now_s = self.board, time.monotonic()
        self._look(now_s)
        contact, replay = board.contact, self._replay
        row = contact.row(self.world) if contact is not None else None
        if contact is None and replay is not None:
            row = replay.row(now_s, time.time())
        vehicle = contact.now(self.world) if contact is not None else None
        replayed = last_flight.moment(row) | {"number": replay.number} if vehicle is None and replay and row else None
        clock = time.strftime("%H:%M:%S")
        self._put(
            "now",
            {"clock": clock, "t_s": now_s, "stage": board.stage, "vehicle": vehicle, "replay": replayed,
             "in_process": self._in_process, "asked": board.asked, "flies": (board.folder / "flying").exists()},
        )  # fmt: skip
        if self._changed("n_lines", board.n_lines):
            self._put("log", list(board.lines))
        if self._is_new("upcoming", board.upcoming) and board.upcoming is not None:
            self._put("upcoming", _upcoming(board.upcoming))
        return row

    # ---- the slow ones, beside

    def _look(self, now_s: float) -> None:
        """Look into the run folder and at the last landing, unless that is being done."""
        if now_s < self._next_read_s or (self._beside is not None and not self._beside.done()):
            return
        if self._beside is not None:
            self._beside.result()
        self._next_read_s = now_s + _READ_S
        self._beside = asyncio.get_running_loop().run_in_executor(None, self._look_beside)

    def _look_beside(self) -> None:
        landing = self.board.landing
        if self._is_new("landing", landing) and landing is not None:
            self._tell_landing(landing)
        stamp = history.stamp(self.board.folder)
        if not stamp or not self._changed("stamp", stamp):
            return
        try:
            episodes, rollouts = history.read(self.board.folder)
        except StoreError:
            self._seen["stamp"] = None  # it is being written: the next look reads it
            return
        learned = history.part(self._experiment, episodes, rollouts)
        self._put("learning", learned)
        flown = learned["flights"]["number"]
        if self._in_process and flown and self._changed("replayed", flown[-1]):
            theta = tuple(column[-1] for column in learned["flights"]["theta"])
            self._tell_simulated(flown[-1], Rollout(theta, last_flight.seed_of(self._experiment), flown[-1] - 1))

    def _tell_landing(self, landing: Landing) -> None:
        rollout = landing.rollout
        trace = last_flight.simulate(self._experiment, self.world, rollout.theta, rollout.seed, rollout.stream)
        self._put("landing", last_flight.part(rollout.stream + 1, rollout, self.world, trace, landing))

    def _tell_simulated(self, number: int, rollout: Rollout) -> None:
        trace = last_flight.simulate(self._experiment, self.world, rollout.theta, rollout.seed, rollout.stream)
        self._put("landing", last_flight.part(number, rollout, self.world, trace, None))
        self._replay = Replay(number, self.world, trace, time.monotonic())


def _upcoming(upcoming: Any) -> dict[str, Any]:
    """A flight that was announced, with what the simulator expects of it."""
    forecast = upcoming.forecast
    return {
        "number": upcoming.number,
        "theta": upcoming.theta,
        "start_W_m": upcoming.start_W_m,
        "n": forecast.n,
        "n_landed": forecast.n_landed,
        "n_strikes": forecast.n_strikes,
    }
