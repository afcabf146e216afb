"""The person beside a real vehicle: what is asked, and how."""

import time
from dataclasses import dataclass
from typing import Protocol

from rich.console import Console
from rich.prompt import Prompt

from ivl.links.landing_flight import FlyingEnds
from ivl.links.truth import Resting


class OperatorStopped(FlyingEnds):
    """The operator wants no further flight; the run can be resumed."""


@dataclass(frozen=True)
class Seen:
    """What is to be seen after a landing.

    Attributes:
        n_legs: Legs that hold on to the ceiling, 0 .. 4.
        body_contact: Body or rotors touched the ceiling.
        discard: Not to be scored; the same policy is flown again.
    """

    n_legs: int
    body_contact: bool
    discard: bool = False


class Operator(Protocol):
    """Answers what only a person can. Each method may raise OperatorStopped."""

    def place(self, start_W_m: tuple[float, float, float]) -> None:
        """Return when the vehicle stands upright below the start point, and nobody is near."""
        ...

    def change_battery(self, battery_V: float, needed_V: float) -> None:
        """Return when the battery has been changed."""
        ...

    def confirm(self, suggested: Seen, resting: Resting, note: str) -> Seen:
        """Confirm or correct what seems to have happened."""
        ...


class ConsoleOperator:
    """Asks in the terminal; q stops, at any question."""

    def __init__(self, console: Console | None = None, countdown_s: int = 3) -> None:
        """`console` is where is asked (default: the terminal's error stream, so that results can be piped)."""
        self._console = console or Console(stderr=True)
        self._countdown_s = countdown_s

    def _ask(self, text: str, choices: list[str], default: str) -> str:
        try:
            answer = Prompt.ask(text, console=self._console, choices=[*choices, "q"], default=default)
        except EOFError as error:
            raise OperatorStopped("nobody answers at the terminal: the run can be resumed") from error
        if answer == "q":
            raise OperatorStopped("stopped by the operator: the run can be resumed")
        return answer

    def place(self, start_W_m: tuple[float, float, float]) -> None:
        """Ask, then count down."""
        self._console.print(
            "RESET: vehicle upright on the floor near ({:.2f}, {:.2f}) m; it will hover at {:.2f} m.".format(
                *start_W_m
            ),
            highlight=False,
        )
        self._ask("CLEAR? everybody outside, net closed: y to arm and fly", ["y"], "y")
        for left_s in range(self._countdown_s, 0, -1):
            self._console.print(f"\atake-off in {left_s} (Ctrl-C stops)", highlight=False)
            time.sleep(1.0)

    def change_battery(self, battery_V: float, needed_V: float) -> None:
        """Ask."""
        self._console.print(
            f"BATTERY {battery_V:.2f} V, needed {needed_V:.2f} V: change it; the same policy is flown next.",
            style="bold",
        )
        self._ask("y when it is changed and the vehicle is on", ["y"], "y")

    def confirm(self, suggested: Seen, resting: Resting, note: str) -> Seen:
        """Ask for legs and body contact, with what the pose suggests as default."""
        pose = f"rests at {resting.p_W_m[2]:.3f} m, {'hanging' if resting.up_W[2] < 0 else 'upright'}"
        self._console.print(f"OUTCOME: {note or 'landing over'}; {pose}.", highlight=False)
        answer = self._ask(
            "legs that hold (d: discard, fly it again)", ["4", "3", "2", "1", "0", "d"], str(suggested.n_legs)
        )
        if answer == "d":
            return Seen(0, False, discard=True)
        body = self._ask("did body or rotors touch the ceiling?", ["y", "n"], "y" if suggested.body_contact else "n")
        return Seen(int(answer), body == "y")
