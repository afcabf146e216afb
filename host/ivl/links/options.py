"""How a vehicle is flown, beside where and what."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from ivl.experiment import Experiment
from ivl.links.deadlines import DEADLINES, Deadlines
from ivl.links.observer import NOBODY, Observer
from ivl.mocap.config import MocapConfig
from ivl.site import require
from ivl.site.file import SiteFile

if TYPE_CHECKING:
    from ivl.links.operators import Operator
    from ivl.rehearsal.day import Day
    from ivl.rehearsal.script import Script


def silent(text: str) -> None:
    """Tell nobody."""
    del text


@dataclass(frozen=True)
class Options:
    """How to fly.

    Attributes:
        folder: Where the journal and the recordings go, None: nowhere.
        operator: Who stands beside a real vehicle; None: asked in the terminal.
        mocap: Tracking system that follows the vehicle; None: somebody else streams poses, or the vehicle needs none.
        rehearse: Fly a software vehicle as if it were a drone: take-off, operator, no simulator's truth.
        other_world: Fly a software vehicle even though it simulates another world than the experiment's.
        start_hint: Command that starts a software vehicle in the experiment's world.
        keep_recordings: Download the flight recorder of a software vehicle too (of a drone always), and tell learners
            what it says.
        say: Called with each line for people.
        script: What goes wrong on a rehearsed day with a software vehicle of its own; None: nothing, and its battery
            stays full.
        answered_by_script: Nobody is asked in such a rehearsal: the script says yes, and sees what came of a landing.
        day: The day that follows from the script; whoever starts the vehicle makes it.
        deadlines: Limits of the link.
        observer: Who looks on.
    """

    folder: Path | None = None
    operator: "Operator | None" = None
    mocap: MocapConfig | None = None
    rehearse: bool = False
    other_world: bool = False
    start_hint: str = "ivl sil --experiment FILE"
    keep_recordings: bool = False
    say: Callable[[str], None] = silent
    script: "Script | None" = None
    answered_by_script: bool = False
    day: "Day | None" = None
    deadlines: Deadlines = DEADLINES
    observer: Observer = NOBODY

    def site_of(self, experiment: Experiment, uri: str) -> SiteFile | None:
        """The site file that a flight of an experiment is flown with (as `ivl.site.require.for_flight`)."""
        return require.for_flight(experiment, uri, self.rehearse)
