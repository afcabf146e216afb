"""Who may look on while a vehicle is flown (`Options.observer`): a live view, for instance."""

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from ivl.links.landing_flight import Landing
    from ivl.links.operators import Upcoming
    from ivl.links.tracking import Tracking
    from ivl.links.vehicle import Vehicle


class Observer(Protocol):
    """Told what happens, by the thread that flies: each call returns at once, and changes nothing."""

    def connected(self, vehicle: "Vehicle", tracking: "Tracking | None") -> None:
        """A vehicle is connected and fit to fly; log blocks may be added to its session."""
        ...

    def disconnected(self) -> None:
        """The connection is no good any more."""
        ...

    def announced(self, upcoming: "Upcoming") -> None:
        """The operator is shown this flight."""
        ...

    def landed(self, landing: "Landing") -> None:
        """A flight counts."""
        ...


class Nobody:
    """Looks at nothing."""

    def connected(self, vehicle: "Vehicle", tracking: "Tracking | None") -> None:
        """Do nothing."""

    def disconnected(self) -> None:
        """Do nothing."""

    def announced(self, upcoming: "Upcoming") -> None:
        """Do nothing."""

    def landed(self, landing: "Landing") -> None:
        """Do nothing."""


NOBODY = Nobody()
