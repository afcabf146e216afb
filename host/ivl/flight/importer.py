"""From the files of another program to a folder of flights."""

import hashlib
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ivl.errors import ConfigError
from ivl.flight import checks
from ivl.flight.formats import by_name
from ivl.flight.log import Given, Log
from ivl.flight.schema import SAMPLES
from ivl.flight.store import Flight, Flights, Manifest
from ivl.flight.table import read_bytes

_SAME = 0.01
"""Two numbers for one thing may differ by this share: a log is rounded."""
_LEGS_MAX = 4
_OPTIONS = {
    "threshold_per_s": "--rrev",
    "moment_Nmm": "--moment",
    "speed_mps": "--speed",
    "angle_deg": "--angle",
    "h_plane_m": "--h-plane",
    "h_surface_m": "--h-surface",
}
"""What can be given for all flights, and by which option."""


def run(sources: Sequence[Path], format_name: str, given: Given) -> Flights:
    """Read logs; nothing is written.

    Args:
        sources: Files, or folders if the format knows what lies in them.
        format_name: Name of the format.
        given: What the person says about the flights.

    Raises:
        ConfigError: A file is damaged or of another format, or what was given contradicts it. One line.
    """
    log = by_name(format_name).load(sources, given)
    if not log.flights:
        raise ConfigError(f"{', '.join(str(path) for path in sources)}: holds no flight")
    flights = [_complete(flight, given) for flight in log.flights]
    flights = [_judged(f, n, given) for f, n in zip(flights, _outcomes(flights, given), strict=True)]
    flights = _unique_labels(flights)
    manifest = Manifest(
        format=format_name,
        source=[_digest(file, sources) for file in log.files],
        licence=given.licence or "not stated",
        frames=log.frames,
        clock=log.clock,
        absent=_absent(log, flights),
        notes=[*log.notes, *checks.notes([f for f in flights if f.info["usable"]])],
    )
    return Flights(manifest, tuple(flights))


def _complete(flight: Flight, given: Given) -> Flight:
    """Add what the log does not say."""
    info: dict[str, Any] = dict(flight.info)
    for name, option in _OPTIONS.items():
        value = getattr(given, name)
        if value is None:
            continue
        if not np.isfinite(value):
            raise ConfigError(f"{option}: value {value}: must be finite")
        if np.isfinite(info[name]) and abs(info[name] - value) > _SAME * max(abs(value), 1.0):
            raise ConfigError(f"flight {flight.label}: {name}: {value:g} was given, but the log says {info[name]:g}")
        info[name] = info[name] if np.isfinite(info[name]) else value
    return Flight(info, flight.samples)


def _outcomes(flights: Sequence[Flight], given: Given) -> Sequence[int | None]:
    if not given.outcomes:
        return [None] * len(flights)
    if len(given.outcomes) != len(flights):
        raise ConfigError(f"--outcome: {len(given.outcomes)} outcomes for {len(flights)} flights")
    for n in given.outcomes:
        if n is not None and not 0 <= n <= _LEGS_MAX:
            raise ConfigError(f"--outcome: value {n}: feet that hold (allowed 0 .. {_LEGS_MAX}, or - for unknown)")
    return given.outcomes


def _judged(flight: Flight, n_legs: int | None, given: Given) -> Flight:
    if n_legs is None:
        return flight
    return Flight({**flight.info, "n_legs": n_legs, "judged_by": given.judged_by or "operator"}, flight.samples)


def _unique_labels(flights: Sequence[Flight]) -> list[Flight]:
    """Number the labels that are there more than once."""
    total, seen = Counter(flight.label for flight in flights), Counter[str]()
    result = []
    for flight in flights:
        label = flight.label
        seen[label] += 1
        number = f"#{seen[label]}" if total[label] > 1 else ""
        result.append(Flight({**flight.info, "label": label + number}, flight.samples))
    return result


def _digest(file: Path, sources: Sequence[Path]) -> dict[str, str]:
    """Name and digest of a file; one out of a folder that was named keeps the name of that folder."""
    folder = next((path for path in sources if path in file.parents), None)
    name = f"{folder.resolve().name}/{file.relative_to(folder)}" if folder else file.name
    return {"file": name, "sha256": hashlib.sha256(read_bytes(file)).hexdigest()}


def _absent(log: Log, flights: Sequence[Flight]) -> dict[str, str]:
    missing = [name for name in SAMPLES if name != "flight" and not any(flight.has(name) for flight in flights)]
    return {name: log.absent.get(name, "not in the log") for name in missing}
