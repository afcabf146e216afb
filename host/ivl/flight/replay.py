"""Recorded flights through the flight core: does it see, and do, what was logged?

    result = replay.replay(store.read(Path("flights/july")), ivl.World("crazyflie21"))
    print(result.summary["rrev"]["within_0_003"], result.verdict())

Every tick is the core's own `ivl_step`, in this process or on an emulated chip; nothing of it is written here again.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from ivl.errors import ConfigError
from ivl.flight import agreement, inputs
from ivl.flight.agreement import Replayed
from ivl.flight.store import Flight, Flights
from ivl.links.pil import Chips
from ivl.world import World


@dataclass(frozen=True)
class Result:
    """All flights, replayed and compared.

    Attributes:
        flights: Those that could be replayed, in the order flown.
        left_out: Label and reason of the others.
        summary: The comparison as one JSON object.
    """

    flights: tuple[Replayed, ...]
    left_out: tuple[tuple[str, str], ...]
    summary: dict[str, Any]

    def verdict(self) -> list[str]:
        """What the comparison says, one sentence each."""
        return agreement.verdict(self.summary)


def replay(
    flights: Flights | Sequence[Flight],
    world: World,
    chips: Chips | None = None,
    battery: bool = False,
    step: float = 0.0,
) -> Result:
    """Feed recorded flights to the flight core and compare.

    Args:
        flights: What was recorded; flights that the log calls invalid are left out.
        world: Configures the core; the plane of the cues is each flight's own, where the log tells it.
        chips: Emulated chips that run the core; from this call on they decide all landings of `world`.
        battery: Tell the core of the logged battery, so that its rules about it apply.
        step: Numbers in the log are cut or rounded to multiples of this, in SI units: tells how much of the
            difference that explains. 0: not stated.

    Raises:
        ConfigError: No flight can be replayed, the core refuses a flight's policy, or the configuration cannot be fed.
        RolloutError: A chip failed.
    """
    if chips:
        chips.attach(world)
    left_out, replayed = [], []
    for flight in flights:
        reason = _why_not(flight)
        if reason:
            left_out.append((flight.label, reason))
        else:
            replayed.append(_replay(flight, world, chips, battery))
    if not replayed:
        first = f": flight {left_out[0][0]}: {left_out[0][1]}" if left_out else ""
        raise ConfigError(f"no flight can be replayed{first}")
    summary = agreement.summary(replayed, step) | {
        "left_out": [{"label": label, "reason": reason} for label, reason in left_out],
        "where": "emulated chip" if chips else "in process",
        "bits": agreement.bits(replayed),
    }
    return Result(tuple(replayed), tuple(left_out), summary)


def _why_not(flight: Flight) -> str:
    if not flight.info["usable"]:
        return f"not usable: {flight.info['note'] or 'the log does not say why'}"
    return inputs.why_not(flight)


def _replay(flight: Flight, world: World, chips: Chips | None, battery: bool) -> Replayed:
    ticks = inputs.make(flight, world, battery)
    rows, refused = world.native_model.replay(ticks.config, ticks.policy, ticks.inputs)
    if chips:
        chips.check()
    if refused:
        most_Nmm = 1e3 * float(ticks.config["ivl.flip_moment_max"][0])
        raise ConfigError(
            f"flight {flight.label}: {refused} refused by the flight core (policy {ticks.policy[1].tolist()} "
            f"in SI units; moments up to {most_Nmm:g} N mm are allowed)"
        )
    return Replayed(flight, ticks, rows)
