"""The script of a rehearsed day: how long a battery lasts, and what goes wrong in which rollout.

    script = load("default")
    script.plan(60)          # {4: [Kind.LOCKS], 11: [Kind.TRACKING_DROPS], ...}

A fault without a rollout gets one by the seed, so that the same script and budget are the same day.
"""

import random
from collections import defaultdict
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Annotated

from pydantic import BeforeValidator, Field

from ivl import yamlfile
from ivl.errors import ConfigError
from ivl.links.trouble import Cause
from ivl.settings import Finite, Strict

FOLDER = Path(__file__).parent
DEFAULT = "default"
TEMPLATE = FOLDER / f"{DEFAULT}.yaml"
"""With comments, to be changed."""


class Kind(StrEnum):
    """What can go wrong on a rehearsed day."""

    BATTERY_SAGS = "battery_sags"
    LOCKS = "locks"
    CRASHES = "crashes"
    NOT_HOME = "not_home"
    TRACKING_DROPS = "tracking_drops"
    TRACKING_SWAPS = "tracking_swaps"
    PACKETS_LOST = "packets_lost"
    LINK_SILENT = "link_silent"
    VEHICLE_LOST = "vehicle_lost"
    RESTARTS = "restarts"
    OPERATOR_AWAY = "operator_away"
    STOPPED = "stopped"
    DISCARDED = "discarded"


@dataclass(frozen=True)
class Row:
    """A row of the table of faults, which docs/SITE.md shows too.

    Attributes:
        kind: Its name in a script.
        happens: What happens to vehicle, cameras, link or operator.
        cause: The state of the day that must follow; None: the flight counts as if nothing had happened.
        in_flight: Whether it happens in the hover, so that a flight is lost; else the flight has not begun.
    """

    kind: Kind
    happens: str
    cause: Cause | None
    in_flight: bool


FAULTS = (
    Row(Kind.BATTERY_SAGS, "a worn cell gives way under the load of the hover", Cause.BATTERY, True),
    Row(Kind.LOCKS, "the supervisor locks the vehicle on the floor", Cause.LOCKED, False),
    Row(Kind.CRASHES, "the supervisor sees a crash in the hover, and the vehicle falls", Cause.CRASHED, True),
    Row(Kind.NOT_HOME, "the vehicle stands 0.6 m beside its home", Cause.NOT_HOME, False),
    Row(Kind.TRACKING_DROPS, "the cameras lose the body in the hover", Cause.TRACKING, True),
    Row(Kind.TRACKING_SWAPS, "the cameras take another body for the vehicle in the hover", Cause.TRACKING, True),
    Row(Kind.PACKETS_LOST, "a tenth of all packets is lost, until the flight is over", None, True),
    Row(Kind.LINK_SILENT, "no packet comes through for three seconds, from the hover on", Cause.LINK, True),
    Row(Kind.VEHICLE_LOST, "the battery falls out in the hover, and nobody puts it back", Cause.LOST, True),
    Row(Kind.RESTARTS, "the battery falls out in the hover, and finds its contacts again", Cause.LINK, True),
    Row(Kind.OPERATOR_AWAY, "the operator answers after more than two minutes", None, False),
    Row(Kind.STOPPED, "somebody stops the flight in the hover, as `ivl stop` does", Cause.STOPPED, True),
    Row(Kind.DISCARDED, "the operator of the script does not want the landing to count", Cause.DISCARDED, True),
)
_BY_KIND = {row.kind: row for row in FAULTS}


def _kind(value: object) -> object:
    """A name of a kind as that kind; what is none is left to the check that follows."""
    known = [kind.value for kind in Kind]
    if isinstance(value, str) and value not in known:
        raise ValueError(f"value {value!r} is unknown{yamlfile.did_you_mean(value, known, at_any_distance=True)}")
    return Kind(value) if isinstance(value, str) else value


class Fault(Strict):
    """One thing that goes wrong, once."""

    what: Annotated[Kind, BeforeValidator(_kind)]
    rollout: int | None = Field(default=None, ge=1, description="number from 1; left out: by the seed")


class Script(Strict):
    """A rehearsed day."""

    name: str = Field(min_length=1, pattern=r"^[A-Za-z0-9_.-]+$")
    doc: str = Field(min_length=1)
    seed: int = Field(ge=0, description="which rollouts get the faults without one, and the noise of the day")
    battery_s: Finite = Field(
        ge=10.0, le=7200.0, description="time in the air in which a full battery falls to rest_V_min of the site"
    )
    return_s: Finite = Field(ge=0.5, le=60.0, description="so long is a vehicle that does not answer called")
    ends_before: int | None = Field(
        default=None, ge=2, description="the script's operator ends the day before this rollout; left out: never"
    )
    faults: list[Fault]

    def plan(self, n_rollouts: int) -> dict[int, list[Kind]]:
        """The faults of each rollout, in the order in which its attempts meet them.

        Raises:
            ConfigError: A fault is of a rollout that the budget does not reach.
        """
        found: dict[int, list[Kind]] = defaultdict(list)
        for fault in self.faults:
            if fault.rollout is not None:
                if fault.rollout > n_rollouts:
                    raise ConfigError(
                        f"script {self.name}: {fault.what}: rollout {fault.rollout} (allowed 1 .. {n_rollouts}, "
                        "the budget)"
                    )
                found[fault.rollout].append(fault.what)
        free = [fault.what for fault in self.faults if fault.rollout is None]
        rng, places = random.Random(self.seed), [n for n in range(1, n_rollouts + 1) if n not in found]
        rng.shuffle(places)
        while len(places) < len(free):  # all rollouts once before any gets a second one
            places += rng.sample(range(1, n_rollouts + 1), n_rollouts)
        for what, number in zip(free, places, strict=False):
            found[number].append(what)
        return dict(found)


def row_of(kind: Kind) -> Row:
    """The row of a kind."""
    return _BY_KIND[kind]


def load(name: str) -> Script:
    """Read and check a script: a file, or a shipped one by its name.

    Raises:
        ConfigError: One line naming file, field and value.
    """
    path = Path(name) if Path(name).is_file() else FOLDER / f"{name}.yaml"
    if not path.is_file():
        shipped = ", ".join(sorted(each.stem for each in FOLDER.glob("*.yaml")))
        raise ConfigError(f"--script {name}: no such file, and no such script (shipped: {shipped})")
    return yamlfile.validate(Script, yamlfile.read(path), path.name)
