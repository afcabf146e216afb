"""Every time limit of the link, in one place; docs/HOST.md shows the same table."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Deadlines:
    """Wall-clock limits of a session.

    Attributes:
        connect_s: From opening a link to knowing the vehicle's tables (a first download over radio takes seconds).
        answer_s: From the last answer to the next; longer silence is a lost link.
        retry_s: An unanswered question is sent again after this at the latest ...
        retry_s_min: ... and not before this; in between, after four round trips.
        window: Questions that may be under way at once.
        close_s: Closing a link, whatever state it is in.
        return_s: After a lost link, how long a vehicle may stay away before a run gives up.
    """

    connect_s: float = 30.0
    answer_s: float = 2.0
    retry_s: float = 0.25
    retry_s_min: float = 0.02
    window: int = 8
    close_s: float = 3.0
    return_s: float = 60.0


DEADLINES = Deadlines()
