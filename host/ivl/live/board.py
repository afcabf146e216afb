"""What is known of a run: a board that the threads which run and fly write on, and a page reads.

Each writer replaces a reference, or appends to a queue of limited length; nobody ever waits for a reader.
"""

from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ivl.links.landing_flight import Landing
    from ivl.links.operators import Upcoming
    from ivl.links.tracking import Tracking
    from ivl.links.vehicle import Vehicle
    from ivl.live.vehicle import Contact

LINES_KEPT = 200


class Board:
    """Of one run. It is an `ivl.links.observer.Observer`."""

    def __init__(self, folder: Path) -> None:
        """Nothing has happened yet in this run folder."""
        self.folder = folder
        self.stage = "starting"
        """What the program does, in words."""
        self.contact: Contact | None = None
        """The connected vehicle."""
        self.upcoming: Upcoming | None = None
        """The flight that was announced last."""
        self.landing: Landing | None = None
        """The flight that counted last."""
        self.lines: deque[str] = deque(maxlen=LINES_KEPT)
        """What the terminal says; see `hear`."""
        self.n_lines = 0
        self.asked = ""
        """A line at the terminal that waits for its answer; empty if none does."""

    # ---- the terminal

    def hear(self, text: str) -> None:
        """What was written to the terminal; a line without an end is a question."""
        *whole, rest = (self.asked + text).replace("\a", "").split("\n")
        for line in whole:
            self._note(line)
        self.asked = rest

    def reader(self, read: Callable[[], str]) -> Callable[[], str]:
        """`read`, which gives the answer to the question at the terminal."""

        def heard() -> str:
            try:
                answer = read()
                self._note(self.asked + answer.strip())
            finally:
                self.asked = ""
            return answer

        return heard

    def _note(self, line: str) -> None:
        if line.strip():
            self.lines.append(line.rstrip())
            self.n_lines += 1

    # ---- progress

    def simulates(self, done: int, n: int) -> None:
        """Simulated vehicles are flown before the first flight."""
        self.stage = f"simulating vehicles before the first flight: {done} of {n}"

    def learns(self, episode: int, n_episodes: int) -> None:
        """Episodes are flown."""
        self.stage = f"learning: {episode} of {n_episodes} episodes done"

    def judges(self) -> None:
        """All is flown."""
        self.stage = "judging: how good is what was learned, and what is possible"

    # ---- Observer

    def connected(self, vehicle: "Vehicle", tracking: "Tracking | None") -> None:
        """See `Observer`."""
        from ivl.live.vehicle import Contact  # its modules load cflib, which flights in this process do not need

        self.contact = Contact(vehicle, tracking)

    def disconnected(self) -> None:
        """See `Observer`."""
        self.contact = None

    def announced(self, upcoming: "Upcoming") -> None:
        """See `Observer`."""
        self.upcoming = upcoming

    def landed(self, landing: "Landing") -> None:
        """See `Observer`."""
        self.landing = landing
