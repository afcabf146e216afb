"""What can go wrong on a day of flying, and what then follows: one table, which docs/SITE.md shows too.

Whatever it is, the flight is not scored and its policy is flown next. A state with a question is left when the operator
has answered; nothing but the operator or the budget ends a day.
"""

from dataclasses import dataclass
from enum import StrEnum

from ivl.check import Check, failures
from ivl.errors import LinkError, RolloutError


class Cause(StrEnum):
    """Why a flight does not count, or does not begin."""

    BATTERY = "battery"
    LOCKED = "locked"
    CRASHED = "crashed"
    NOT_HOME = "not home"
    TRACKING = "tracking"
    LINK = "link"
    LOST = "lost"
    AWAY = "away"
    UNFIT = "unfit"
    STOPPED = "stopped"
    ABORTED = "aborted"
    DISCARDED = "discarded"


@dataclass(frozen=True)
class State:
    """A row of the table.

    Attributes:
        cause: What has happened.
        seen: By what it is noticed.
        asks: What the operator is asked to do; empty: nothing, the same policy is announced again.
        leaves: What must be so before the day goes on.
    """

    cause: Cause
    seen: str
    asks: str
    leaves: str


STATES = (
    State(
        Cause.BATTERY,
        "preflight, the gate before each flight, or an abort by a rule of the battery",
        "change the battery and switch the vehicle on",
        "the battery is above its limit",
    ),
    State(
        Cause.LOCKED,
        "the supervisor's bit",
        "switch the vehicle off and on again, upright on the floor",
        "the vehicle answers and can be armed",
    ),
    State(
        Cause.CRASHED,
        "the supervisor's bits, or an abort by the supervisor",
        "set the vehicle upright on the floor, look at legs and propellers",
        "the vehicle has forgotten the crash",
    ),
    State(
        Cause.NOT_HOME,
        "position before arming",
        "put the vehicle at home, or correct the site file and begin again",
        "its estimate is at home",
    ),
    State(
        Cause.TRACKING,
        "motion capture, the estimate's variance, or an abort by a rule of the state",
        "look at cameras, markers and streaming",
        "motion capture is good and the estimate is certain",
    ),
    State(
        Cause.LINK,
        "silence, an abort by a rule of link or host, or a vehicle that has started anew",
        "",
        "the vehicle answers again, which is tried for a minute",
    ),
    State(
        Cause.LOST,
        "silence for a minute after the link was lost",
        "find the vehicle, switch it on, look at radio and antenna",
        "the vehicle answers again and passes the preflight",
    ),
    State(
        Cause.AWAY,
        "a question that nobody has answered for two minutes",
        "",
        "an answer, and a new preflight",
    ),
    State(
        Cause.UNFIT,
        "any other check of the preflight, or a vehicle that refuses to begin",
        "do what the message says",
        "the preflight passes",
    ),
    State(
        Cause.STOPPED,
        "a key while it flies, or `ivl stop`",
        "see to it that the room is clear and the vehicle can fly",
        "the operator says so",
    ),
    State(Cause.ABORTED, "any other abort, or a flight that did not end", "", "the vehicle has come down"),
    State(Cause.DISCARDED, "the operator's judgement", "", "nothing"),
)
_BY_CAUSE = {state.cause: state for state in STATES}
_RULES = {
    "battery": Cause.BATTERY,
    "battery_rest": Cause.BATTERY,
    "state": Cause.TRACKING,
    "uncertain": Cause.TRACKING,
    "command": Cause.LINK,
    "link": Cause.LINK,
    "setpoint": Cause.LINK,
    "host": Cause.LINK,
    "supervisor": Cause.CRASHED,
    "config": Cause.LINK,  # it has started anew, and knows nothing of its host
}
_CHECKS = {  # a bad link, like all others, is unfit: the operator has to do something
    "battery": Cause.BATTERY,
    "estimator": Cause.TRACKING,
    "motion capture": Cause.TRACKING,
    "supervisor": Cause.CRASHED,
}


class Trouble(RolloutError):
    """A flight that does not count, or does not begin, and why."""

    def __init__(self, cause: Cause, text: str) -> None:
        """`text` is for people: what happened, and what is allowed."""
        super().__init__(text)
        self.cause = cause


class Instead(RolloutError):
    """The operator wants another policy to be flown in this one's place; it is announced next."""

    def __init__(self, theta: tuple[float, ...]) -> None:
        """`theta` is of the same form, in its units."""
        super().__init__("another policy instead, by the operator")
        self.theta = theta


class Vetoed(RolloutError):
    """The operator does not want this policy to be flown."""


def state_of(cause: Cause) -> State:
    """The row of a cause."""
    return _BY_CAUSE[cause]


def of_rule(rule: str) -> Cause:
    """The cause of an abort by a safety rule of the vehicle."""
    return _RULES.get(rule, Cause.ABORTED)


def of_checks(found: list[Check], locked: bool = False) -> Trouble | None:
    """What the first check that failed means, with all that failed as text; None if none did.

    Args:
        found: The checks.
        locked: Whether the supervisor is locked, which its check does not tell apart from a crash.
    """
    told = failures(found)
    if not told:
        return None
    cause = _CHECKS.get(next(check.name for check in found if not check.ok), Cause.UNFIT)
    return Trouble(Cause.LOCKED if locked and cause is Cause.CRASHED else cause, f"not fit to fly: {told}")


def before_flight(error: Exception) -> Exception:
    """What went wrong before a flight began: an error that asks for nothing would come again for ever, so it asks."""
    return Trouble(Cause.UNFIT, str(error)) if cause_of(error) is Cause.ABORTED else error


def cause_of(error: Exception) -> Cause:
    """Why a flight went wrong, from what was raised."""
    found = getattr(error, "cause", None)
    if isinstance(found, Cause):
        return found
    return Cause.LINK if isinstance(error, LinkError) else Cause.ABORTED
