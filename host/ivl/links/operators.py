"""The person beside a real vehicle: what is asked, and how.

Each question needs its word, and none has an answer by default. What was typed before a question appeared is dropped.
Nobody is asked who does not sit at a terminal: a drone is never armed from a pipe.
"""

import sys
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from rich.console import Console

from ivl.errors import ConfigError
from ivl.forms import Form
from ivl.links.forecast import Forecast
from ivl.links.landing_flight import FlyingEnds
from ivl.links.trouble import Cause, Instead, Vetoed, state_of
from ivl.links.truth import Resting

STOP = "stop"
COUNTDOWN_S = 3
_RESUME = "the run can be resumed"


class OperatorStopped(FlyingEnds):
    """The operator wants no further flight; the run can be resumed."""


@dataclass(frozen=True)
class Upcoming:
    """The flight that is announced.

    Attributes:
        number: Of the rollout, from 1.
        n_all: Rollouts that the budget pays for.
        form: Form of the policy.
        theta: Its parameters, in the units of the form.
        bounds: Those of the search, (lower, upper) of each parameter.
        forecast: What the simulator expects.
        start_W_m: Where the vehicle will hover.
        home_W_m: Where it must stand, along the floor.
    """

    number: int
    n_all: int
    form: Form
    theta: tuple[float, ...]
    bounds: Sequence[Sequence[float]]
    forecast: Forecast
    start_W_m: tuple[float, float, float]
    home_W_m: tuple[float, float]


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

    def place(self, upcoming: Upcoming) -> None:
        """Return when the vehicle stands upright at home, nobody is near, and this flight may begin.

        Raises:
            Vetoed: It may not; the next policy is announced.
            Instead: Another policy is to be flown in its place.
        """
        ...

    def change_battery(self, battery_V: float, needed_V: float) -> None:
        """Return when the battery has been changed."""
        ...

    def help(self, cause: Cause) -> None:
        """Return when what the state of this cause asks for has been done; what has happened was told before."""
        ...

    def confirm(self, suggested: Seen, resting: Resting, note: str) -> Seen:
        """Confirm or correct what seems to have happened."""
        ...


def read_line() -> str:
    """A line from the terminal, without what was typed before.

    Raises:
        OperatorStopped: Nobody sits there.
    """
    if not sys.stdin.isatty():
        raise OperatorStopped(f"nobody answers: standard input is no terminal ({_RESUME})")
    drop_typed()
    line = sys.stdin.readline()
    if not line:
        raise OperatorStopped(f"the terminal was closed ({_RESUME})")
    return line


def answers_of(path: Path) -> Callable[[], str]:
    """Answers from a file, one a line, in place of a terminal: for rehearsals.

    Raises:
        ConfigError: It cannot be read.
    """
    try:
        lines = iter(path.read_text(encoding="utf-8").splitlines())
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"--answers {path}: cannot be read: {error}") from error

    def read() -> str:
        line = next(lines, None)
        if line is None:
            raise OperatorStopped(f"{path}: no answer is left ({_RESUME})")
        return line

    return read


def _numbers(words: list[str]) -> tuple[float, ...]:
    """The words as numbers; none if one of them is no number."""
    try:
        return tuple(float(word) for word in words)
    except ValueError:
        return ()


def drop_typed() -> None:
    """Forget what was typed ahead of a question."""
    import termios  # the package loads where there is none

    termios.tcflush(sys.stdin.fileno(), termios.TCIFLUSH)


class ConsoleOperator:
    """Asks in the terminal; the word `stop` ends the day, at any question."""

    def __init__(
        self, console: Console | None = None, countdown_s: int = COUNTDOWN_S, read: Callable[[], str] = read_line
    ) -> None:
        """Ask on a console.

        Args:
            console: Where is asked; None: the terminal's error stream, so that results can be piped.
            countdown_s: Seconds that are counted down before take-off.
            read: Gives the next answer.
        """
        self._console = console or Console(stderr=True, markup=False, highlight=False, soft_wrap=True)
        self._countdown_s, self._read = countdown_s, read

    def _tell(self, text: str) -> None:
        self._console.print(text)

    def _ask(self, text: str, words: Iterable[str]) -> str:
        """Ask until the answer is one of these words."""
        allowed = [*words, STOP]
        shown = " | ".join(allowed)
        while True:
            self._console.print(f"{text} [{shown}]: ", end="")
            answer = " ".join(self._read().split())
            if answer == STOP:
                raise OperatorStopped(f"stopped by the operator ({_RESUME})")
            if answer in allowed:
                return answer
            self._tell(f"not understood: {answer!r}; type one of the words in brackets")

    def _ask_policy(self, upcoming: Upcoming) -> tuple[float, ...]:
        """Ask for the parameters of a policy until each is a number within the bounds of the search."""
        params = upcoming.form.params
        named = ", ".join(
            f"{p.symbol} {lo:g} .. {hi:g} {p.unit}" for p, (lo, hi) in zip(params, upcoming.bounds, strict=True)
        )
        while True:
            self._console.print(f"fly instead: {len(params)} numbers: {named} [numbers | {STOP}]: ", end="")
            words = self._read().split()
            if words == [STOP]:
                raise OperatorStopped(f"stopped by the operator ({_RESUME})")
            theta = _numbers(words)
            if len(theta) == len(params) and all(
                lo <= value <= hi for value, (lo, hi) in zip(theta, upcoming.bounds, strict=True)
            ):
                return theta
            self._tell(f"not understood: {' '.join(words)!r}; type {len(params)} numbers in these bounds")

    def place(self, upcoming: Upcoming) -> None:
        """Show the flight, ask, then count down."""
        theta = upcoming.form.describe(upcoming.theta)
        self._tell(f"NEXT: rollout {upcoming.number} of {upcoming.n_all}: {theta}; {upcoming.forecast}.")
        home, start = (", ".join(f"{v:z.2f}" for v in place) for place in (upcoming.home_W_m, upcoming.start_W_m))
        self._tell(f"Vehicle upright at home ({home}) m; it will hover at ({start}) m. Everybody outside, net closed.")
        answer = self._ask("arm and fly?", [f"fly {upcoming.number}", "veto", "instead"])
        if answer == "veto":
            raise Vetoed("vetoed by the operator")
        if answer == "instead":
            raise Instead(self._ask_policy(upcoming))
        for left_s in range(self._countdown_s, 0, -1):
            self._tell(f"\atake-off in {left_s} (any key stops)")
            time.sleep(1.0)

    def change_battery(self, battery_V: float, needed_V: float) -> None:
        """Ask."""
        self._tell(f"BATTERY: {battery_V:.2f} V, needed {needed_V:.2f} V; the same rollout is next.")
        self._ask(f"{state_of(Cause.BATTERY).asks}, then", ["changed"])

    def help(self, cause: Cause) -> None:
        """Ask."""
        self._ask(f"{cause.upper()}: {state_of(cause).asks}, then", ["go on"])

    def confirm(self, suggested: Seen, resting: Resting, note: str) -> Seen:
        """Ask for legs and body contact; what the pose suggests is shown."""
        pose = f"rests at {resting.p_W_m[2]:.3f} m, {'hanging' if resting.up_W[2] < 0 else 'upright'}"
        self._tell(f"OUTCOME: {note or 'landing over'}; {pose}; it looks like {suggested.n_legs} legs.")
        answer = self._ask("legs that hold", ["4", "3", "2", "1", "0", "discard"])
        if answer == "discard":
            return Seen(0, False, discard=True)
        body = self._ask("body or rotors at the ceiling", ["touched", "clean"])
        return Seen(int(answer), body == "touched")
