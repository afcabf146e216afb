"""Who decides whether flying goes on after a flight that does not count: a limit, or the operator."""

from collections import Counter
from collections.abc import Callable
from typing import Protocol

from ivl.errors import RolloutError
from ivl.links.landing_flight import FlyingEnds
from ivl.links.operators import Operator
from ivl.links.trouble import Cause, cause_of, state_of

ATTEMPTS_MAX = 10


class Recovery(Protocol):
    """Returns if flying goes on, and raises if it does not."""

    def before(self, error: Exception) -> None:
        """The vehicle cannot be made ready before the first flight."""
        ...

    def after(self, error: Exception, n: int) -> None:
        """The `n`-th time in a row, a flight of the same rollout does not count, or does not begin."""
        ...

    def told(self, troubles: "Counter[Cause]") -> str:
        """What a reader of the results has to know of them; empty: nothing."""
        ...


class Attempts:
    """Gives up after ten attempts, or when the vehicle stays away: there is nobody to ask."""

    def __init__(self, uri: str, say: Callable[[str], None]) -> None:
        """`say` is told of each flight that is flown again."""
        self._uri, self._say = uri, say

    def before(self, error: Exception) -> None:
        """Give up at once.

        Raises:
            Exception: The error itself.
        """
        raise error

    def after(self, error: Exception, n: int) -> None:
        """Count.

        Raises:
            RolloutError: Ten in a row.
            FlyingEnds: The vehicle stayed away.
        """
        if isinstance(error, FlyingEnds):
            raise error
        self._say(f"flight discarded, flown again (attempt {n} of {ATTEMPTS_MAX}): {error}")
        if n >= ATTEMPTS_MAX:
            raise RolloutError(
                f"{self._uri}: a rollout was discarded {ATTEMPTS_MAX} times in a row; the last reason is above"
            ) from error

    def told(self, troubles: "Counter[Cause]") -> str:
        """Nothing: each has been said."""
        del troubles
        return ""


class AskOperator:
    """Tells the operator, asks what the table of states says, and goes on when that is answered."""

    def __init__(self, operator: Operator, say: Callable[[str], None]) -> None:
        """The operator may raise OperatorStopped at any question."""
        self._operator, self._say = operator, say

    def before(self, error: Exception) -> None:
        """The same as after a flight."""
        self.after(error, 1)

    def after(self, error: Exception, n: int) -> None:
        """Ask, if there is something to ask; the same policy is announced next."""
        del n
        cause = cause_of(error)
        self._say(f"{cause}: {error}; the same rollout is next")
        if state_of(cause).asks:
            self._operator.help(cause)

    def told(self, troubles: "Counter[Cause]") -> str:
        """How often each happened."""
        named = ", ".join(f"{cause} {n}" for cause, n in sorted(troubles.items()))
        return f"flights that do not count, by cause: {named}" if named else ""
