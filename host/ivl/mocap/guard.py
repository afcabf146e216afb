"""What a loss of motion capture means for a flight."""

from collections.abc import Callable
from typing import Protocol

from ivl.errors import RolloutError
from ivl.links.packets import Phase
from ivl.mocap.watch import Status

BEFORE_TRIGGER = frozenset((Phase.READY, Phase.APPROACH, Phase.LEVEL_OUT))
WITHOUT_CORE = frozenset((Phase.IDLE, Phase.DONE))
IN_FLIP = frozenset((Phase.FLIP, Phase.COAST, Phase.ATTACHED))
AGAIN_S = 0.05


class Guard(Protocol):
    """Told of the state of motion capture a hundred times a second, in its thread."""

    def look(self, status: Status, text: str, now_s: float) -> None:
        """Look, and return at once."""
        ...

    def in_flight(self) -> bool:
        """Whether the vehicle flies, as far as is known."""
        ...


def _nowhere() -> bool:
    return False


def _ignore(reason: str) -> None:
    del reason


class LossGuard:
    """Before the trigger a loss spoils the flight, and asks for an abort, again and again while it lasts.

    Later nothing is interrupted.
    """

    def __init__(
        self,
        phase: Callable[[], int],
        abort: Callable[[str], None],
        flies: Callable[[], bool] = _nowhere,
        spoil: Callable[[str], None] = _ignore,
    ) -> None:
        """Watch over a flight.

        Args:
            phase: The flight core's phase as last heard.
            abort: Asks the vehicle to abort, with the reason; called in the thread of motion capture. Repeating it must
                change nothing, as with the request ABORT, which the flight core obeys before the trigger only.
            flies: Whether its motors carry the vehicle, whoever controls it.
            spoil: Told the reason why this flight must not be scored, whether or not an abort comes in time.
        """
        self._phase, self._abort, self._flies, self._spoil = phase, abort, flies, spoil
        self._t_next_s = float("-inf")
        self._is_lost = False
        self._has_asked = False
        self.n_aborts = 0
        """Losses for which an abort was asked."""
        self.n_ignored = 0
        """Losses that began in the flip."""
        self.reason = ""
        """Why an abort was asked since the last `check`; empty if none was."""

    def check(self) -> None:
        """Once a flight is over: raise RolloutError if an abort was asked for in it, since it must not be scored."""
        reason, self.reason = self.reason, ""
        if reason:
            raise RolloutError(f"aborted: {reason}")

    def in_flight(self) -> bool:
        """Under the flight core, or under another controller."""
        return self._phase() in BEFORE_TRIGGER | IN_FLIP or self._flies()

    def look(self, status: Status, text: str, now_s: float) -> None:
        """Ask for an abort if it is time to."""
        was_lost, self._is_lost = self._is_lost, status is not Status.GOOD
        phase = self._phase()
        if self._is_lost and (phase in BEFORE_TRIGGER or (phase in WITHOUT_CORE and self._flies())):
            self._spoil(text)
        if not self._is_lost:
            self._has_asked = False
        elif phase in BEFORE_TRIGGER and now_s >= self._t_next_s:
            self._t_next_s = now_s + AGAIN_S
            self.n_aborts += not self._has_asked
            self._has_asked, self.reason = True, text
            self._abort(text)
        elif phase in IN_FLIP and not was_lost:
            self.n_ignored += 1
