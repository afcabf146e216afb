"""The operator of a rehearsal: a person who answers, or the script, and the hands that do what was asked."""

from ivl.links.operators import Operator, OperatorStopped, Seen, Upcoming
from ivl.links.trouble import Cause
from ivl.links.truth import Resting
from ivl.rehearsal.day import Day


class Hands:
    """Whoever answers, what was asked for is then done to the software vehicle."""

    def __init__(self, day: Day, person: Operator | None = None) -> None:
        """`person` answers; None: the script does, says yes to all, and sees what came of a landing."""
        self._day, self._person = day, person

    def place(self, upcoming: Upcoming) -> None:
        """The flight may begin."""
        if self._person is not None:
            self._person.place(upcoming)
        elif self._day.is_over_before(upcoming.number):
            raise OperatorStopped("the script's operator ends the day (the run can be resumed)")

    def change_battery(self, battery_V: float, needed_V: float) -> None:
        """Change it."""
        if self._person is not None:
            self._person.change_battery(battery_V, needed_V)
        self._day.change_battery()

    def help(self, cause: Cause) -> None:
        """Mend what this cause asks for."""
        if self._person is not None:
            self._person.help(cause)
        self._day.mend(cause)

    def confirm(self, suggested: Seen, resting: Resting, note: str) -> Seen:
        """The person's word, or what the script's operator sees."""
        if self._person is not None:
            return self._person.confirm(suggested, resting, note)
        return self._day.sees(suggested)
